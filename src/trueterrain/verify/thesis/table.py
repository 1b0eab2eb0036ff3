"""Table 3-1 of Smith (2009): four rows, by the thesis's processing and by that of this package.

Both look at the same recordings, those of the virtual profiler. What is published is only compared
with what they find.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.georeference import Screening
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.motion.trajectory import Trajectory
from trueterrain.verify.dynamic import DynamicResult, DynamicSettings, dynamic_test
from trueterrain.verify.results import describe_figure
from trueterrain.verify.static import StaticResult, StaticSettings, static_test
from trueterrain.verify.statistics.uncertainty import AccuracyFigure, rms_figure
from trueterrain.verify.thesis.processing import ThesisResult, thesis_dynamic, thesis_static
from trueterrain.verify.truth import exact_trajectory

Floats = npt.NDArray[np.float64]

#: Order of the thesis's Butterworth filters, an assumption: it is not published.
ORDER = 2

#: Orders that the thesis may have used.
ORDERS: tuple[int, ...] = (1, 2, 4)

#: Share of the published figure by which one that is reproduced may differ.
WITHIN = 0.2

#: Ours: a vehicle at a steady speed allows a long window for east, north and yaw.
_OURS = FusionSettings(method="rts", smoothing_window=2.0)

_SEARCH = 0.1  # [m] around its known place in which the plate is looked for

_FIGURES = ("rms", "off_edges", "distance")


@dataclass(frozen=True, kw_only=True)
class PublishedRange:
    """What the thesis publishes of a row."""

    low: float
    "Root mean square of the error, or the least of several that are published [m]."

    high: float
    "The same, or the greatest of several [m]."

    maximum: float
    "Greatest error [m]."

    def holds(self, value: float) -> bool:
        """Whether a root mean square [m] differs by 20 % at most."""
        return (1 - WITHIN) * self.low <= value <= (1 + WITHIN) * self.high


#: Table 3-1; of the last row's RMS the table says 1.8 mm and the text 1.95 mm.
PUBLISHED: dict[str, PublishedRange] = {
    "static": PublishedRange(low=1.1e-3, high=1.1e-3, maximum=5e-3),
    "static, screened": PublishedRange(low=0.92e-3, high=0.92e-3, maximum=4.3e-3),
    "dynamic": PublishedRange(low=1.6e-3, high=1.6e-3, maximum=4e-3),
    "dynamic, excited": PublishedRange(low=1.8e-3, high=1.95e-3, maximum=5e-3),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class TableRow:
    """A row of the table: the same recordings by both ways of processing."""

    test: str
    "Name of the row."

    thesis: tuple[ThesisResult, ...]
    "What the thesis's processing finds, of each recording."

    ours: tuple[StaticResult | DynamicResult, ...]
    "What the tests of this package find, of each recording."

    exact: tuple[DynamicResult, ...] = ()
    "The same with the exact pose; none of a scanner that stands."

    lying: tuple[DynamicResult, ...] = ()
    "Ours, as the plate lies: from its known place, with neither shift nor stretch taken off."

    lying_exact: tuple[DynamicResult, ...] = ()
    "The same with the exact pose."

    on_exact_way: tuple[DynamicResult, ...] = ()
    "As it lies, with our heights, roll and pitch, but the exact east and north."

    orders: dict[int, float] = field(default_factory=dict)
    "Root mean square by the thesis's processing, by the order of its filters [m]."

    @property
    def published(self) -> PublishedRange:
        """What the thesis publishes."""
        return PUBLISHED[self.test]

    @property
    def thesis_rms(self) -> float:
        """Root mean square over all recordings, and places of the plate beside samples [m]."""
        return math.sqrt(np.mean([found.rms**2 for found in self.thesis]))

    @property
    def reproduced(self) -> bool:
        """Whether the thesis's processing finds what it published, within 20 %."""
        return self.published.holds(self.thesis_rms)

    @property
    def beside(self) -> list[float]:
        """How far behind its known place each recording of ours finds the plate [m]."""
        return [
            found.registration.shift - lying.registration.shift
            for found, lying in zip(self.ours, self.lying, strict=False)
        ]

    def ends(self, of: Callable[[ThesisResult], Floats]) -> tuple[float, float]:
        """Least and greatest of a figure of the thesis's processing [m].

        Parameters
        ----------
        of : callable
            What to take of each result, such as its ``single``.

        Returns
        -------
        tuple of float
            Over all recordings and places.
        """
        values = np.concatenate([of(found) for found in self.thesis])
        return float(values.min()), float(values.max())

    def ratio(self, figure: str, way: str = "ours") -> float | None:
        """How many times as large a figure is as with the exact pose.

        Parameters
        ----------
        figure : str
            rms, off_edges or distance.
        way : str
            ours, lying or on_exact_way.

        Returns
        -------
        float or None
            None of a scanner that stands.
        """
        exact = self.exact if way == "ours" else self.lying_exact
        if not exact:
            return None
        return pool_figures(getattr(self, way), figure).value / pool_figures(exact, figure).value

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON; lengths in m."""
        published = self.published
        lowest, highest = self.ends(lambda found: found.single)
        least, most = self.ends(lambda found: found.largest)
        described_: dict[str, Any] = {
            "test": self.test,
            "recordings": len(self.thesis),
            "published": {
                "low": published.low,
                "high": published.high,
                "maximum": published.maximum,
            },
            "thesis": {
                "rms": self.thesis_rms,
                "rms_low": lowest,
                "rms_high": highest,
                "maximum": self.thesis[0].maximum,
                "maximum_low": least,
                "maximum_high": most,
                "recordings": [found.to_dict() for found in self.thesis],
            },
            "reproduced": self.reproduced,
            "ours": _figure_values(self.ours),
            "orders": {str(order): rms for order, rms in self.orders.items()},
        }
        for name, way, exact in (
            ("registered", "ours", self.exact),
            ("as_it_lies", "lying", self.lying_exact),
            ("as_it_lies_on_exact_way", "on_exact_way", self.lying_exact),
        ):
            described_[name] = (
                None
                if not exact
                else {
                    "ours": _figure_values(getattr(self, way)),
                    "exact": _figure_values(exact),
                    "ratio": {one: self.ratio(one, way) for one in _FIGURES},
                }
            )
        described_["beside"] = self.beside
        return described_


def pool_figures(found: Sequence[StaticResult | DynamicResult], figure: str) -> AccuracyFigure:
    """A figure over several recordings of a test.

    Parameters
    ----------
    found : sequence of StaticResult or DynamicResult
        Results of the recordings.
    figure : str
        rms, off_edges or distance.

    Returns
    -------
    Figure
        Root mean square of all their errors, with its interval [m].

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
    """Rows one and two: a scanner that stands, without and with screening.

    Parameters
    ----------
    run : Path
        Run of a scanner that stands above the plate.
    machined : xarray.Dataset
        Machined profile of the plate.
    screening : Screening
        Of which intensities returns are left out in row two.

    Returns
    -------
    list of TableRow
        The two rows.

    Raises
    ------
    CoverageError, SchemaError, ValueError
        As by `static_test` and `thesis_static`.
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
    """Row three or four: runs over the plate.

    Parameters
    ----------
    test : str
        Name of the row.
    runs : sequence of Path
        Simulated runs over the plate, whose exact motion is known.
    machined : xarray.Dataset
        Machined profile of the plate.
    begin : tuple of float
        Easting and northing where it is known to begin [m].

    Returns
    -------
    TableRow
        The row. Ours is by the method rts with a window of 2 s for the way, since the speed is
        steady, and registered with the stretch of the way; the thesis's by causal Butterworth
        filters of order 2 at 10 Hz.

    Raises
    ------
    CoverageError, SchemaError
        As by `dynamic_test` and `thesis_dynamic`.
    """
    from trueterrain.formats.run import open_run

    thesis: dict[int, list[ThesisResult]] = {order: [] for order in ORDERS}
    names = ("ours", "exact", "lying", "lying_exact", "on_exact_way")
    ways: dict[str, list[DynamicResult]] = {name: [] for name in names}
    for run in runs:
        tree = open_run(run)
        exact, smoothed = exact_trajectory(tree), _fuse_quietly(tree, _OURS)
        for order, found in thesis.items():
            path = _fuse_quietly(tree, FusionSettings(method="thesis", order=order))
            found.append(
                thesis_dynamic(tree, machined, path, _settings_around(path, begin), name=test)
            )
        for way, path in (("ours", smoothed), ("exact", exact)):
            free = replace(_settings_around(path, begin), stretch=True)
            ways[way].append(dynamic_test(tree, machined, path, free, name=test))
        mixed = _on_way(smoothed, exact)
        for way, path in (("lying", smoothed), ("lying_exact", exact), ("on_exact_way", mixed)):
            fixed = replace(_settings_around(path, begin), search=0.0)
            ways[way].append(dynamic_test(tree, machined, path, fixed, name=test))
    orders = {
        order: math.sqrt(np.mean([one.rms**2 for one in found])) for order, found in thesis.items()
    }
    return TableRow(
        test=test,
        thesis=tuple(thesis[ORDER]),
        orders=orders,
        **{way: tuple(found) for way, found in ways.items()},
    )


def _fuse_quietly(tree: xr.DataTree, settings: FusionSettings) -> Trajectory:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of short runs, whose noise is not measured well
        return fuse_motion(tree, settings=settings).trajectory


def _settings_around(path: Trajectory, begin: tuple[float, float]) -> DynamicSettings:
    """Settings with the known place of the plate along the way from the first pose."""
    way = path.position[-1, :2] - path.position[0, :2]
    along = float((np.array(begin) - path.position[0, :2]) @ way / np.hypot(*way))
    return DynamicSettings(assumed=along, search=_SEARCH)


def _on_way(path: Trajectory, exact: Trajectory) -> Trajectory:
    """Motion with the exact east and north."""
    part = path.between(float(exact.time[0]), float(exact.time[-1]))
    true = exact.at(part.time)
    position, velocity = part.position.copy(), part.velocity.copy()
    position[:, :2], velocity[:, :2] = true.position[:, :2], true.velocity[:, :2]
    return replace(part, position=position, velocity=velocity)


def _figure_values(found: Sequence[StaticResult | DynamicResult]) -> dict[str, Any]:
    figures: dict[str, Any] = {one: describe_figure(pool_figures(found, one)) for one in _FIGURES}
    return {**figures, "maximum": max(one.row.maximum for one in found)}
