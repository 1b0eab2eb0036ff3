"""Accuracy tests by the processing of the thesis, for comparison with that of this package.

After section 3.5 of Smith, "Improving the Quality of Terrain Measurement" (Virginia Tech, 2009):
means of scans or of the cells of a grid of 10 mm, offset and tilt by least squares, and the plate
aligned to a whole beam or a whole cell. The true place of the plate differs from that by up to half
a sample, which the thesis does not state and which causes errors of height, as the thesis remarks.
Therefore a range of sub-sample offsets is evaluated; each figure is that of all offsets together,
with the range of the single ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.formats.run import open_run, scan_blocks
from trueterrain.georeference import Screening
from trueterrain.motion.trajectory import Trajectory
from trueterrain.verify.dynamic import DynamicSettings, select_strip
from trueterrain.verify.registration.search import check_machined_profile

Floats = npt.NDArray[np.float64]

_MIN_HEIGHTS = 20  # on the plate
_SEARCH_SAMPLES = 2.5  # samples around the registered place that are searched
_MAX_ERROR = 0.5  # residual over the relief of the plate for it to be recognised

#: Offsets of the plate from a whole sample that are evaluated, as fractions of the spacing.
PLACES: tuple[float, ...] = tuple(np.round(np.arange(-0.475, 0.5, 0.05), 3).tolist())


@dataclass(frozen=True, kw_only=True)
class LaidProfile:
    """Errors of heights with the plate aligned to a sample."""

    s: Floats
    "Positions on the machined profile [m]."

    height: Floats
    "Heights less offset and tilt [m]."

    machined: Floats
    "Machined heights at the same positions [m]."

    begin: float
    "Measured coordinate of the start of the machined profile (of its end, if reversed) [m]."

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
    """Result of the thesis's processing over all sub-sample offsets of the plate."""

    test: str
    "Name of the test."

    beside: Floats
    "Offsets of the plate from a whole sample, as fractions of the spacing."

    single: Floats
    "Root mean square of the error at each offset [m]."

    largest: Floats
    "Greatest error at each offset, of either sign [m]."

    errors: xr.Dataset
    """Over position s on the machined profile [m]: ``height``, ``machined`` and ``error`` [m], at
    the offset whose root mean square is nearest to that of all."""

    @property
    def rms(self) -> float:
        """Root mean square of the error over all offsets [m]."""
        return float(np.sqrt(np.mean(self.single**2)))

    @property
    def maximum(self) -> float:
        """Greatest error in ``errors`` [m]."""
        return float(np.abs(self.errors["error"]).max())

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON; lengths in m."""
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
    """Error of the mean scan of a scanner at rest, by the thesis's processing (3.5.1).

    Parameters
    ----------
    run : xarray.DataTree or path
        Run of a scanner at rest above the plate.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    screening : Screening
        Bounds of range and intensity; none by default (Fig. 3-18), an upper bound of intensity in
        the second row of Table 3-1.
    name : str
        Name of the test.
    places : sequence of float
        Offsets of the plate from a whole beam, as fractions of the spacing.

    Returns
    -------
    ThesisResult
        The errors.

    Raises
    ------
    CoverageError
        If the plate is not found.
    SchemaError
        If the machined profile is not that of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.
    """
    from scipy.spatial.transform import Rotation

    run = open_run(run)
    angle = np.asarray(run["scans/angle"])
    total, count = np.zeros(angle.size), np.zeros(angle.size)
    for block in scan_blocks(run):
        ranges = block["range"].values
        intensity = block["intensity"].values if "intensity" in block else None
        weight = screening.weights(ranges, intensity)
        total += np.where(weight > 0, weight * ranges, 0.0).sum(axis=0)
        count += weight.sum(axis=0)
    # beams that are mostly screened do not belong to the mean scan
    good = count > 0.5 * run["scans"].sizes["scan"]
    beam = np.arange(angle.size)
    with name_file_in_errors(run.source):
        if not good.any():
            raise CoverageError("no beam has returns in most of the scans")
        mean = np.interp(beam, beam[good], total[good] / count[good])
        rotation = Rotation.from_euler("ZYX", run.mounting.scanner_rotation[::-1])
        beams = np.stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)], axis=-1)
        _, along, up = (rotation.apply(beams) * mean[:, None]).T
        return _over_offsets(name, along, np.where(good, up, np.nan), machined, places)


def thesis_dynamic(
    run: xr.DataTree | str | Path,
    machined: xr.Dataset,
    trajectory: Trajectory,
    settings: DynamicSettings = DynamicSettings(),
    *,
    name: str = "dynamic",
    places: Sequence[float] = PLACES,
) -> ThesisResult:
    """Error of a profile over the plate from a moving vehicle, by the thesis's processing (3.5.2).

    Parameters
    ----------
    run : xarray.DataTree or path
        Run over the plate, whose cleats lie across the path.
    machined : xarray.Dataset
        Machined profile of the plate; straight lines join its nodes.
    trajectory : Trajectory
        Motion of the body; that of the thesis is by `fuse_motion` with the method thesis.
    settings : DynamicSettings
        Spacing of the grid, strip, screening, and search range of the plate.
    name : str
        Name of the test.
    places : sequence of float
        Offsets of the plate from a whole cell, as fractions of the spacing.

    Returns
    -------
    ThesisResult
        The errors.

    Raises
    ------
    CoverageError
        If the run does not cross the plate.
    SchemaError
        If the machined profile is not that of a plate, or in another unit.
    ValueError
        If screening needs intensities that were not recorded.

    Notes
    -----
    The height of a cell is the mean of its returns, assigned to its centre.
    """
    run = open_run(run)
    path = trajectory.between(settings.begin, settings.end)
    with name_file_in_errors(run.source):
        strip = select_strip(run, path, settings)
        return _over_offsets(
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
    """Align a machined profile to samples of a measured one, by least squares.

    Parameters
    ----------
    along, height : array_like, shape (n,)
        Coordinates and heights of the samples; NaN for missing heights [m].
    machined : xarray.Dataset
        Machined profile; straight lines join its nodes.
    beside : float
        Offset of the start of the plate from a sample, as a fraction of the spacing.
    assumed : float, optional
        Assumed start of the plate [m].
    search : float, optional
        Greatest distance from there [m]; by default all samples are tried.

    Returns
    -------
    LaidProfile
        The alignment of least error over all samples and both directions, with offset and tilt by
        unweighted least squares.

    Raises
    ------
    CoverageError
        If the plate is not found.
    SchemaError
        If the machined profile is not that of a plate, or in another unit.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> plate = make_profile([0, 0.3, 0.35, 0.4, 1.0], [0, 0, 0.05, 0, 0])
    >>> x = np.arange(-1000, 1000, 4) / 1000
    >>> z = np.interp(x + 0.6013, plate.s, plate.height)
    >>> found = lay_profile(x, z, plate)
    >>> print(f"{found.begin:.3f} m, {1000 * np.abs(found.error).max():.1f} mm")
    -0.600 m, 1.4 mm
    """
    x, z = (np.asarray(values, dtype=np.float64) for values in (along, height))
    order = np.argsort(x, kind="stable")
    x, z = x[order], z[order]
    s, h = check_machined_profile(machined)
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
    if best is None or best.rms > _MAX_ERROR * float(_remove_line(s, h).std()):
        raise CoverageError(
            "the plate is not found: the heights agree with the machined profile at no place",
            cure="Check that it was scanned: `trueterrain plot`.",
        )
    return best


def _lay_at(
    x: Floats, z: Floats, begin: float, s: Floats, h: Floats, *, turned: bool
) -> LaidProfile | None:
    """Heights on the plate without offset and tilt; None if they are too few."""
    inside = slice(*np.searchsorted(x, (begin, begin + s[-1])))
    if x[inside].size < _MIN_HEIGHTS:
        return None
    at = s[-1] - (x[inside] - begin) if turned else x[inside] - begin
    true = np.interp(at, s, h)
    height = true + _remove_line(x[inside], z[inside] - true)
    return LaidProfile(s=at, height=height, machined=true, begin=begin, reversed=turned)


def _remove_line(x: Floats, y: Floats) -> Floats:
    """Values less their regression line."""
    t = x - x.mean()
    return np.asarray(y - y.mean() - (t @ y) / (t @ t) * t)


def _cell_heights(strip: dict[str, Floats], spacing: float) -> tuple[Floats, Floats]:
    """Centres of cells and mean heights of their returns; NaN without returns [m]."""
    cell = np.floor(strip["along"] / spacing).astype(np.int64)
    count, total = (np.bincount(cell - cell[0], weights) for weights in (None, strip["up"]))
    held = np.maximum(count, 1)
    centre = (cell[0] + np.arange(count.size) + 0.5) * spacing
    return centre, np.where(count > 0, total / held, np.nan)


def _over_offsets(
    name: str,
    along: Floats,
    height: Floats,
    machined: xr.Dataset,
    places: Sequence[float],
    *,
    assumed: float | None = None,
    search: float | None = None,
) -> ThesisResult:
    """Errors at all sub-sample offsets."""
    first = lay_profile(along, height, machined, assumed=assumed, search=search)
    near = {"assumed": first.begin, "search": _SEARCH_SAMPLES * float(np.median(np.diff(along)))}
    laid = [lay_profile(along, height, machined, beside=one, **near) for one in places]
    single = np.array([one.rms for one in laid])
    shown = laid[int(np.argmin(np.abs(single - np.sqrt(np.mean(single**2)))))]
    order = np.argsort(shown.s)
    columns = {"height": shown.height, "machined": shown.machined, "error": shown.error}
    return ThesisResult(
        test=name,
        beside=np.array(places),
        single=single,
        largest=np.array([np.abs(one.error).max() for one in laid]),
        errors=xr.Dataset(
            {key: ("s", values[order]) for key, values in columns.items()}, {"s": shown.s[order]}
        ),
    )
