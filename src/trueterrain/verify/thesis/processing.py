"""The thesis's own processing of its tests of accuracy, to be set beside that of this package.

As far as section 3.5 of Smith, "Improving the Quality of Terrain Measurement" (Virginia Tech,
2009), tells it: means of scans or of the cells of a grid of 10 mm, offset and tilt by least
squares, and the plate where a whole beam or a whole cell begins. How far it truly lies beside that,
by up to half a sample, the thesis does not tell: it is charged to the height, as the thesis itself
complains. So all places beside whole samples are looked at, and each figure is that of all of them
together, with the range of the single ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.georeference import Screening
from trueterrain.motion.trajectory import Trajectory
from trueterrain.verify.dynamic import DynamicSettings, strip_of
from trueterrain.verify.registration.search import check_machined

Floats = npt.NDArray[np.float64]

_LEAST = 20  # heights on the plate
_AROUND = 2.5  # samples from where the plate was found that are looked at
_FOUND = 0.5  # of the relief of the plate, by which errors stay below where it truly lies

#: Places of the plate beside a whole sample that are looked at, as shares of the spacing.
PLACES: tuple[float, ...] = tuple(np.round(np.arange(-0.475, 0.5, 0.05), 3).tolist())


@dataclass(frozen=True, kw_only=True)
class LaidProfile:
    """Errors of heights with the plate laid where a whole sample begins."""

    s: Floats
    "Positions on the machined profile [m]."

    height: Floats
    "Heights without offset and tilt [m]."

    machined: Floats
    "Machined heights at the same positions [m]."

    begin: float
    "Where the machined profile begins in the measured coordinate (its end, if reversed) [m]."

    reversed: bool
    "Whether the machined profile runs against the measured coordinate."

    @property
    def error(self) -> Floats:
        """Measured less machined heights [m]."""
        return self.height - self.machined

    @property
    def rms(self) -> float:
        """Root mean square of the error [m]."""
        return float(np.sqrt(np.mean(self.error**2)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ThesisResult:
    """What the thesis's processing finds, over all places of the plate beside whole samples."""

    test: str
    "What was tested."

    beside: Floats
    "The places: how far the plate begins behind a whole sample, as a share of the spacing."

    single: Floats
    "Root mean square of the error at each of them [m]."

    largest: Floats
    "Greatest error at each of them, of either sign [m]."

    errors: xr.Dataset
    """Over position s on the machined profile [m]: ``height``, ``machined`` and ``error`` [m], at
    the place whose root mean square is nearest to that of all."""

    @property
    def rms(self) -> float:
        """Root mean square of the error over all places [m]."""
        return float(np.sqrt(np.mean(self.single**2)))

    @property
    def maximum(self) -> float:
        """Greatest error at the place that ``errors`` show [m]."""
        return float(np.abs(self.errors["error"]).max())

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and words, as for JSON; lengths in m."""
        return {
            "test": self.test,
            "rms": self.rms,
            "rms_low": float(self.single.min()),
            "rms_high": float(self.single.max()),
            "maximum": self.maximum,
            "maximum_low": float(self.largest.min()),
            "maximum_high": float(self.largest.max()),
            "beside": self.beside.tolist(),
            "rms_at": self.single.tolist(),
        }


def thesis_static(
    run: xr.DataTree | str | Path,
    machined: xr.Dataset,
    screening: Screening = Screening(),
    *,
    name: str = "static",
    places: Sequence[float] = PLACES,
) -> ThesisResult:
    """Error of the mean scan of a standing scanner, as the thesis finds it (3.5.1).

    Parameters
    ----------
    run : xarray.DataTree or path
        Run of a scanner that stands above the plate.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    screening : Screening
        Which returns are left out; none by default (Fig. 3-18), those of high intensity in the
        second row of Table 3-1.
    name : str
        Name of the test.
    places : sequence of float
        Places of the plate beside whole beams, as shares of their spacing.

    Returns
    -------
    ThesisResult
        The errors.

    Raises
    ------
    CoverageError
        If the plate is not found.
    SchemaError
        If the machined profile is none of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.
    """
    from scipy.spatial.transform import Rotation

    from trueterrain.formats.run import open_run, scan_blocks
    from trueterrain.georeference import mounting_of

    source = None if isinstance(run, xr.DataTree) else Path(run)
    tree = run if isinstance(run, xr.DataTree) else open_run(run)
    angle = np.asarray(tree["scans/angle"])
    total, count = np.zeros(angle.size), np.zeros(angle.size)
    for block in scan_blocks(run):
        ranges = block["range"].values
        intensity = block["intensity"].values if "intensity" in block else None
        weight = screening.weights(ranges, intensity)
        total += np.where(weight > 0, weight * ranges, 0.0).sum(axis=0)
        count += weight.sum(axis=0)
    # of a beam that is mostly left out, what remains is no mean scan
    good = count > 0.5 * tree["scans"].sizes["scan"]
    beam = np.arange(angle.size)
    with name_file_in_errors(source):
        if not good.any():
            raise CoverageError("no beam has returns in most of the scans")
        mean = np.interp(beam, beam[good], total[good] / count[good])
        turn = Rotation.from_euler("ZYX", mounting_of(tree, path=source).scanner_rotation[::-1])
        beams = np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=-1)
        _, along, up = (turn.apply(beams) * mean[:, None]).T
        return _over_places(name, along, np.where(good, up, np.nan), machined, places)


def thesis_dynamic(
    run: xr.DataTree | str | Path,
    machined: xr.Dataset,
    trajectory: Trajectory,
    settings: DynamicSettings = DynamicSettings(),
    *,
    name: str = "dynamic",
    places: Sequence[float] = PLACES,
) -> ThesisResult:
    """Error of a profile over the plate from a moving vehicle, as the thesis finds it (3.5.2).

    Parameters
    ----------
    run : xarray.DataTree or path
        Run over the plate, whose cleats lie across the way.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    trajectory : Trajectory
        Motion of the body: the thesis's by `trueterrain.motion.fuse` with its method thesis.
    settings : DynamicSettings
        Spacing of the grid, strip and screening, and where the plate is looked for.
    name : str
        Name of the test.
    places : sequence of float
        Places of the plate beside whole cells, as shares of the spacing.

    Returns
    -------
    ThesisResult
        The errors.

    Raises
    ------
    CoverageError
        If the run does not cross the plate.
    SchemaError
        If the machined profile is none of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.

    Notes
    -----
    The height of a cell is the mean of its returns, and stands for its middle.
    """
    source = None if isinstance(run, xr.DataTree) else Path(run)
    path = trajectory.between(settings.begin, settings.end)
    with name_file_in_errors(source):
        strip = strip_of(run, path, settings)
        return _over_places(
            name,
            *_cell_heights(strip, settings.spacing),
            machined,
            places,
            assumed=settings.assumed,
            search=settings.search,
        )


def lay_profile(
    along: npt.ArrayLike,
    height: npt.ArrayLike,
    machined: xr.Dataset,
    *,
    beside: float = 0.0,
    assumed: float | None = None,
    search: float | None = None,
) -> LaidProfile:
    """Lay a machined profile onto heights, to begin where one of them is.

    Parameters
    ----------
    along, height : array_like, shape (n,)
        Places of the samples and their heights; NaN for heights that were not measured [m].
    machined : xarray.Dataset
        Machined profile; straight lines join its nodes.
    beside : float
        How far behind a sample the plate begins, as a share of the spacing.
    assumed : float, optional
        Where the plate is assumed to begin [m].
    search : float, optional
        Greatest distance from there [m]; by default the plate is looked for everywhere.

    Returns
    -------
    Laid
        Of all samples with which it may begin, and of both directions, that with the least error.
        Offset and tilt are those of plain least squares.

    Raises
    ------
    CoverageError
        If the plate is not found.
    SchemaError
        If the machined profile is none of a plate, or in another unit.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> plate = make_profile([0, 0.3, 0.35, 0.4, 1.0], [0, 0, 0.05, 0, 0])
    >>> x = np.arange(-1000, 1000, 4) / 1000
    >>> z = np.interp(x + 0.6013, plate.s, plate.height)
    >>> found = lay(x, z, plate)
    >>> print(f"{found.begin:.3f} m, {1000 * np.abs(found.error).max():.1f} mm")
    -0.600 m, 1.4 mm
    """
    x, z = (np.asarray(values, dtype=np.float64) for values in (along, height))
    order = np.argsort(x, kind="stable")
    x, z = x[order], z[order]
    s, h = check_machined(machined)
    length = float(s[-1])
    steps = np.diff(x)
    begins = x[:-1] + beside * steps
    if steps.size:
        kept = begins + length <= x[-1] + np.median(steps)
        if assumed is not None and search is not None:
            kept &= np.abs(begins - assumed) <= search
        begins = begins[kept]
    x, z = x[np.isfinite(z)], z[np.isfinite(z)]
    found = [
        one
        for turned in (False, True)
        for begin in begins.tolist()
        if (one := _lay_at(x, z, begin, s, h, turned=turned)) is not None
    ]
    best = min(found, key=lambda one: one.rms, default=None)
    if best is None or best.rms > _FOUND * float(_remove_line(s, h).std()):
        raise CoverageError(
            "the plate is not found: nowhere do heights follow the machined profile",
            cure="Look whether it was scanned: `trueterrain plot`.",
        )
    return best


def _lay_at(
    x: Floats, z: Floats, begin: float, s: Floats, h: Floats, *, turned: bool
) -> LaidProfile | None:
    """Heights on the plate without offset and tilt; None if they are too few."""
    inside = slice(*np.searchsorted(x, (begin, begin + s[-1])))
    if x[inside].size < _LEAST:
        return None
    at = s[-1] - (x[inside] - begin) if turned else x[inside] - begin
    true = np.interp(at, s, h)
    height = true + _remove_line(x[inside], z[inside] - true)
    return LaidProfile(s=at, height=height, machined=true, begin=begin, reversed=turned)


def _remove_line(x: Floats, y: Floats) -> Floats:
    """Values without their line of least squares."""
    t = x - x.mean()
    return np.asarray(y - y.mean() - (t @ y) / (t @ t) * t)


def _cell_heights(strip: dict[str, Floats], spacing: float) -> tuple[Floats, Floats]:
    """Middles of cells and mean heights of their returns; NaN where there are none."""
    cell = np.floor(strip["along"] / spacing).astype(np.int64)
    count, total = (np.bincount(cell - cell[0], weights) for weights in (None, strip["up"]))
    held = np.maximum(count, 1)
    middle = (cell[0] + np.arange(count.size) + 0.5) * spacing
    return middle, np.where(count > 0, total / held, np.nan)


def _over_places(
    name: str,
    along: Floats,
    height: Floats,
    machined: xr.Dataset,
    places: Sequence[float],
    *,
    assumed: float | None = None,
    search: float | None = None,
) -> ThesisResult:
    """Errors at all places beside whole samples."""
    first = lay_profile(along, height, machined, assumed=assumed, search=search)
    near = {"assumed": first.begin, "search": _AROUND * float(np.median(np.diff(along)))}
    all_ = [lay_profile(along, height, machined, beside=one, **near) for one in places]
    single = np.array([one.rms for one in all_])
    shown = all_[int(np.argmin(np.abs(single - np.sqrt(np.mean(single**2)))))]
    order = np.argsort(shown.s)
    columns = {"height": shown.height, "machined": shown.machined, "error": shown.error}
    return ThesisResult(
        test=name,
        beside=np.array(places),
        single=single,
        largest=np.array([np.abs(one.error).max() for one in all_]),
        errors=xr.Dataset(
            {key: ("s", values[order]) for key, values in columns.items()}, {"s": shown.s[order]}
        ),
    )
