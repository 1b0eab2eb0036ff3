"""Table 3-1 of Smith (2009): four rows, by the thesis's processing and by that of this package.

The virtual profiler records the scenes of the rows; both evaluate the same recordings, and the
results are compared with the published figures.
"""

import math
import tempfile
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.formats.run import open_run
from trueterrain.georeference import Screening
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.motion.trajectory import Trajectory
from trueterrain.simulate.scene import CalibrationPlate, Scene, read_scene, record_scene
from trueterrain.verify.dynamic import DynamicResult, DynamicSettings, dynamic_test
from trueterrain.verify.plate.design import design_plate, machined_profile
from trueterrain.verify.static import StaticResult, StaticSettings, static_test
from trueterrain.verify.statistics.uncertainty import AccuracyFigure, rms_figure
from trueterrain.verify.thesis import ThesisResult, thesis_dynamic, thesis_static
from trueterrain.verify.truth import exact_trajectory

Floats = npt.NDArray[np.float64]

#: Assumed order of the thesis's Butterworth filters; it is not published.
ORDER = 2

#: Possible orders of these filters.
ORDERS: tuple[int, ...] = (1, 2, 4)

#: Largest relative difference of a reproduced figure from the published one.
WITHIN = 0.2

#: Settings of this package: constant speed allows a long window for east, north and yaw.
_OURS = FusionSettings(method="rts", smoothing_window=2.0)

#: Length at each end of the plate that is not compared: the plate ends in an upright face [m].
RIM = 0.05

#: Scenes and the rows for which they are recorded; the first gives two rows.
SCENES = {
    "thesis-static": "static",
    "thesis-smooth": "dynamic",
    "thesis-excited": "dynamic, excited",
}

_SEARCH = 0.1  # [m] search range around the known place of the plate

_FIGURES = ("rms", "off_edges", "distance")


@dataclass(frozen=True, kw_only=True)
class PublishedRange:
    """Published figures of a row."""

    low: float
    "Root mean square of the error, or the smallest of several published values [m]."

    high: float
    "The same, or the greatest of several values [m]."

    maximum: float
    "Greatest error [m]."

    def holds(self, value: float) -> bool:
        """Whether a root mean square [m] differs by at most 20 %."""
        return (1 - WITHIN) * self.low <= value <= (1 + WITHIN) * self.high


#: Table 3-1; the RMS of the last row is 1.8 mm in the table and 1.95 mm in the text.
PUBLISHED: dict[str, PublishedRange] = {
    "static": PublishedRange(low=1.1e-3, high=1.1e-3, maximum=5e-3),
    "static, screened": PublishedRange(low=0.92e-3, high=0.92e-3, maximum=4.3e-3),
    "dynamic": PublishedRange(low=1.6e-3, high=1.6e-3, maximum=4e-3),
    "dynamic, excited": PublishedRange(low=1.8e-3, high=1.95e-3, maximum=5e-3),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class TableRow:
    """A row of the table: the same recordings by both methods of processing."""

    test: str
    "Name of the row."

    thesis: tuple[ThesisResult, ...]
    "Results of the thesis's processing, for each recording."

    ours: tuple[StaticResult | DynamicResult, ...]
    "Results of the tests of this package, for each recording."

    exact: tuple[DynamicResult, ...] = ()
    "The same with the exact pose; empty for a scanner at rest."

    unregistered: tuple[DynamicResult, ...] = ()
    "Results of this package at the known place of the plate, without shift and stretch."

    unregistered_exact: tuple[DynamicResult, ...] = ()
    "The same with the exact pose."

    on_exact_path: tuple[DynamicResult, ...] = ()
    "At the known place, with estimated height, roll and pitch, but exact east and north."

    orders: dict[int, float] = field(default_factory=dict)
    "Root mean square of the thesis's processing, by the order of its filters [m]."

    @property
    def published(self) -> PublishedRange:
        """Published figures."""
        return PUBLISHED[self.test]

    @property
    def thesis_rms(self) -> float:
        """Root mean square over all recordings and sub-sample offsets of the plate [m]."""
        return math.sqrt(np.mean([found.rms**2 for found in self.thesis]))

    @property
    def reproduced(self) -> bool:
        """Whether the thesis's processing agrees with the published figure within 20 %."""
        return self.published.holds(self.thesis_rms)

    @property
    def position_errors(self) -> list[float]:
        """Registered less known place of the plate in each recording [m]."""
        return [
            found.registration.shift - unregistered.registration.shift
            for found, unregistered in zip(self.ours, self.unregistered, strict=False)
        ]

    def find_range(self, of: Callable[[ThesisResult], Floats]) -> tuple[float, float]:
        """Smallest and greatest value of a figure of the thesis's processing [m].

        Parameters
        ----------
        of : callable
            Function of a result that gives values, such as its ``single``.

        Returns
        -------
        tuple of float
            Over all recordings and offsets.
        """
        values = np.concatenate([of(found) for found in self.thesis])
        return float(values.min()), float(values.max())

    def ratio(self, figure: str, method: str = "ours") -> float | None:
        """Ratio of a figure to that with the exact pose.

        Parameters
        ----------
        figure : str
            rms, off_edges or distance.
        method : str
            ours, unregistered or on_exact_path.

        Returns
        -------
        float or None
            None for a scanner at rest.
        """
        exact = self.exact if method == "ours" else self.unregistered_exact
        if not exact:
            return None
        return pool_figures(getattr(self, method), figure).value / pool_figures(exact, figure).value


@dataclass(frozen=True, kw_only=True, eq=False)
class ThesisTable:
    """The table, and the scenes from which it is computed."""

    rows: list[TableRow]
    "The four rows."

    scenes: list[Scene]
    "Scenes that were recorded."

    @property
    def reflectivity(self) -> dict[str, float]:
        """Error that screening removes from row one: published, thesis's processing and ours [m].

        The root of the difference of the mean squares of rows one and two.
        """
        first, second = self.rows[:2]
        pairs = {
            "published": (first.published.low, second.published.low),
            "thesis": (first.thesis_rms, second.thesis_rms),
            "ours": (pool_figures(first.ours, "rms").value, pool_figures(second.ours, "rms").value),
        }
        return {name: math.sqrt(max(a**2 - b**2, 0.0)) for name, (a, b) in pairs.items()}


def make_table() -> ThesisTable:
    """Record the scenes in a temporary folder, and evaluate them."""
    rows: list[TableRow] = []
    scenes = []
    with tempfile.TemporaryDirectory() as folder:
        for name, test in SCENES.items():
            scene, path = read_scene(name)
            runs = record_scene(scene, folder, path=path)
            plate = scene_plate(scene)
            machined = _machined_profile(plate)
            if scene.passes[0].standing is not None:
                # the intensity of a saturated receiver is its saturation
                screening = Screening(saturation=scene.scanner.saturation - 1.0)
                rows += static_rows(runs[0], machined, screening)
            else:
                begin = (plate.east - 0.5 * plate.length + RIM, plate.north)
                rows.append(dynamic_row(test, runs, machined, begin))
            scenes.append(scene)
    return ThesisTable(rows=rows, scenes=scenes)


def scene_plate(scene: Scene) -> CalibrationPlate:
    """Calibration plate in the ground of a scene."""
    (layer,) = (one for one in scene.ground if one["kind"] == "plate")
    return CalibrationPlate(**{key: value for key, value in layer.items() if key != "kind"})


def _machined_profile(plate: CalibrationPlate) -> xr.Dataset:
    design = design_plate(
        plate.cleats,
        length=plate.length - 2 * RIM,
        cleat_width=plate.cleat,
        rise=plate.rise,
        thickness=plate.thickness,
    )
    return machined_profile(design)


def pool_figures(found: Sequence[StaticResult | DynamicResult], figure: str) -> AccuracyFigure:
    """Figure of the pooled errors of several recordings of a test.

    Parameters
    ----------
    found : sequence of StaticResult or DynamicResult
        Results of the recordings.
    figure : str
        rms, off_edges or distance.

    Returns
    -------
    AccuracyFigure
        Root mean square of all errors, with its interval [m].

    Raises
    ------
    ValueError
        If the figure is unknown.
    """
    if figure not in _FIGURES:
        message = f"figure must be one of {', '.join(_FIGURES)}, got {figure!r}."
        raise ValueError(message)
    values = []
    for one in found:
        name = "distance" if figure == "distance" else "error"
        kept = ~one.errors["edge"].values if figure == "off_edges" else slice(None)
        values.append(one.errors[name].values[kept])
    return rms_figure(np.concatenate(values))


def static_rows(run: Path, machined: xr.Dataset, screening: Screening) -> list[TableRow]:
    """Rows one and two of the table: a scanner at rest, without and with screening.

    Parameters
    ----------
    run : Path
        Run of a scanner at rest above the plate.
    machined : xarray.Dataset
        Machined profile of the plate.
    screening : Screening
        Bounds of intensity in row two.

    Returns
    -------
    list of TableRow
        The two rows.

    Raises
    ------
    CoverageError, SchemaError, ValueError
        See `static_test` and `thesis_static`.
    """
    ours = static_test(run, machined, StaticSettings(screening=screening))
    return [
        TableRow(
            test=found.row.test,
            thesis=(thesis_static(run, machined, how, name=found.row.test),),
            ours=(found,),
        )
        for found, how in zip(ours, (Screening(), screening), strict=True)
    ]


def dynamic_row(
    test: str, runs: Sequence[Path], machined: xr.Dataset, begin: tuple[float, float]
) -> TableRow:
    """Row three or four of the table: runs over the plate.

    Parameters
    ----------
    test : str
        Name of the row.
    runs : sequence of Path
        Simulated runs over the plate.
    machined : xarray.Dataset
        Machined profile of the plate.
    begin : tuple of float
        Easting and northing of the start of the plate [m].

    Returns
    -------
    TableRow
        This package uses the method rts with a smoothing window of 2 s, as the speed is constant,
        and registration with stretch; the thesis causal Butterworth filters of order 2 at 10 Hz.

    Raises
    ------
    CoverageError, SchemaError
        See `dynamic_test` and `thesis_dynamic`.
    """
    thesis: dict[int, list[ThesisResult]] = {order: [] for order in ORDERS}
    names = ("ours", "exact", "unregistered", "unregistered_exact", "on_exact_path")
    results: dict[str, list[DynamicResult]] = {name: [] for name in names}
    for run in runs:
        tree = open_run(run)
        exact, smoothed = exact_trajectory(tree), _fuse_quietly(tree, _OURS)
        for order, found in thesis.items():
            path = _fuse_quietly(tree, FusionSettings(method="thesis", order=order))
            found.append(
                thesis_dynamic(tree, machined, path, _settings_around(path, begin), name=test)
            )
        for method, path in (("ours", smoothed), ("exact", exact)):
            free = replace(_settings_around(path, begin), stretch=True)
            results[method].append(dynamic_test(tree, machined, path, free, name=test))
        mixed = _with_exact_path(smoothed, exact)
        for method, path in (
            ("unregistered", smoothed),
            ("unregistered_exact", exact),
            ("on_exact_path", mixed),
        ):
            fixed = replace(_settings_around(path, begin), search=0.0)
            results[method].append(dynamic_test(tree, machined, path, fixed, name=test))
    orders = {
        order: math.sqrt(np.mean([one.rms**2 for one in found])) for order, found in thesis.items()
    }
    return TableRow(
        test=test,
        thesis=tuple(thesis[ORDER]),
        orders=orders,
        **{method: tuple(found) for method, found in results.items()},
    )


def _fuse_quietly(tree: xr.DataTree, settings: FusionSettings) -> Trajectory:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # short runs, whose noise is poorly determined
        return fuse_motion(tree, settings=settings).trajectory


def _settings_around(path: Trajectory, begin: tuple[float, float]) -> DynamicSettings:
    """Settings with the known place of the plate along the path from the first pose."""
    chord = path.position[-1, :2] - path.position[0, :2]
    along = float((np.array(begin) - path.position[0, :2]) @ chord / np.hypot(*chord))
    return DynamicSettings(assumed=along, search=_SEARCH)


def _with_exact_path(path: Trajectory, exact: Trajectory) -> Trajectory:
    """Estimated motion with its east and north replaced by the exact ones."""
    part = path.between(float(exact.time[0]), float(exact.time[-1]))
    true = exact.at(part.time)
    position, velocity = part.position.copy(), part.velocity.copy()
    position[:, :2], velocity[:, :2] = true.position[:, :2], true.velocity[:, :2]
    return replace(part, position=position, velocity=velocity)
