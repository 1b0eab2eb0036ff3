"""Georeferenced points: every return with the pose at its own time (thesis 2.3).

``p_g = t_gb(t) + R_gb(t) (l_b + R_bs range (0, sin(angle), -cos(angle))), t = stamp + clock``
"""

import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.core.schemas import make_points
from trueterrain.formats.run import Mounting, open_run, scan_blocks
from trueterrain.georeference.scans import ScanGeometry
from trueterrain.georeference.screening import Screening
from trueterrain.motion.trajectory import BRIDGED, Trajectory

Floats = npt.NDArray[np.float64]

#: Scans in a block by default.
BLOCK = 2000

_MAX_LANE = 65535  # maximum of a point source ID, which stores it in LAS
_COUNTS = ("scans", "scans_uncovered", "returns", "missing", "flagged", "bridged")


def georeference(
    scans: xr.DataTree | str | Path | Iterable[xr.Dataset],
    trajectory: Trajectory,
    mounting: Mounting | None = None,
    *,
    screening: Screening = Screening(),
    range_noise: float = 0.0,
    lane: int | None = None,
    block: int = BLOCK,
    crs: str = "",
) -> Iterator[xr.Dataset]:
    """Points of a run, block by block.

    Parameters
    ----------
    scans : xarray.DataTree, path, or iterable of xarray.Dataset
        A run, its store, or blocks as `trueterrain.formats.run.scan_blocks` yields them.
    trajectory : Trajectory
        Motion of the body, in the frame of the points.
    mounting : Mounting, optional
        Lever arm, boresight angles and clock of the scanner; by default those of the run.
    screening : Screening
        Flags of returns, and their treatment.
    range_noise : float
        Standard deviation of a range [m].
    lane : int, optional
        Number of the pass, stored with all points as ``lane``.
    block : int
        Scans in a block; points do not depend on it.
    crs : str
        Coordinate reference system of the frame, if it has one.

    Yields
    ------
    xarray.Dataset
        Points in the order of scans and beams, with ``time`` (true time) [s], ``sd`` of their
        heights [m], ``sd_relative`` [m] if the trajectory was adjusted with other passes, and, if
        known, ``intensity`` and ``lane``. ``attrs`` count from the first block on: ``scans``,
        ``scans_uncovered`` (not covered by the trajectory and left out), ``returns``, ``missing``
        (beams without return or out of range), ``flagged`` (by intensity) and ``bridged`` (returns
        at times at which no instrument observed the motion).

    Raises
    ------
    ValueError
        If no mounting is known, the range noise is negative, or screening needs intensities that
        were not recorded.
    CoverageError
        If the trajectory covers no scan at all, or there is no return.
    FormatError
        If a chunk of the run is damaged.

    Notes
    -----
    The variance of a height is that of the range along the beam plus that of the pose: of its
    height, and of its rotations times the distance from the body. Within a scan, errors of the pose
    are the same for all returns, so averaging does not reduce them.

    Examples
    --------
    A laser 2 m above the ground, at rest:

    >>> rest = np.zeros((2, 3))
    >>> still = Trajectory(
    ...     time=np.array([0.0, 1.0]), position=rest + [5.0, 0.0, 2.0], velocity=rest,
    ...     angular_velocity=rest, quaternion=np.tile([0, 0, 0, 1.0], (2, 1)),
    ...     covariance=np.zeros((2, 6, 6)), flag=np.zeros(2, np.uint8))
    >>> scan = xr.Dataset({"time": ("scan", [0.5]), "range": (("scan", "beam"), [[2.0, 2.5]]),
    ...                    "angle": ("beam", [0.0, np.arccos(0.8)]), "delay": ("beam", [0, 1e-6])})
    >>> (points,) = georeference([scan], still, Mounting())
    >>> points.easting.values, points.northing.values, points.up.values
    (array([5., 5.]), array([0. , 1.5]), array([0., 0.]))
    """
    if not range_noise >= 0:
        message = f"range_noise must be at least 0 m, got {range_noise}."
        raise ValueError(message)
    if lane is not None and not 0 <= lane <= _MAX_LANE:
        message = f"lane must be from 0 to {_MAX_LANE}, got {lane}."
        raise ValueError(message)
    mounting, blocks, source = _open_scans(scans, mounting, block)
    return _georeference_blocks(
        blocks, trajectory, mounting, screening, range_noise, lane, crs, source
    )


def _georeference_blocks(
    blocks: Iterable[xr.Dataset],
    trajectory: Trajectory,
    mounting: Mounting,
    screening: Screening,
    range_noise: float,
    lane: int | None,
    crs: str,
    source: Path | None,
) -> Iterator[xr.Dataset]:
    geometry: ScanGeometry | None = None
    counts = dict.fromkeys(_COUNTS, 0)
    step = provenance.add_step(
        xr.Dataset(),
        "georeference",
        parameters={
            "mounting": mounting,
            "screening": screening,
            "range_noise": range_noise,
            "run": source.name if source else "",
        },
    )
    for scans in blocks:
        if geometry is None:
            geometry = ScanGeometry(trajectory, mounting, scans["angle"], scans["delay"])
        columns = _georeference_block(geometry, scans, screening, range_noise, counts)
        if columns["up"].size:
            if lane is not None:
                columns["lane"] = np.full(columns["up"].size, lane, np.uint16)
            points = make_points(**columns, crs=crs)
            yield points.assign_attrs(provenance=step.attrs["provenance"], **counts)
    _require_points(counts, trajectory, source)


def _georeference_block(
    geometry: ScanGeometry,
    scans: xr.Dataset,
    screening: Screening,
    range_noise: float,
    counts: dict[str, int],
) -> dict[str, Any]:
    """Columns of the points of one block; updates the counts."""
    from trueterrain.georeference import _kernels  # here, as numba takes long to import

    time = np.asarray(scans["time"], dtype=np.float64)
    covered = np.flatnonzero(geometry.covers(time))
    counts["scans"] += time.size
    counts["scans_uncovered"] += time.size - covered.size
    time = time[covered]
    ranges = np.asarray(scans["range"], dtype=np.float64)[covered]
    intensity = np.asarray(scans["intensity"])[covered] if "intensity" in scans else None
    weights = screening.weights(ranges, intensity)
    motion = geometry.expand(time)
    found, sd = np.empty((*ranges.shape, 3)), np.empty(ranges.shape)
    _kernels.georeference_returns(
        motion.coefficient,
        motion.body,
        motion.variance,
        geometry.first,
        geometry.beam,
        ranges,
        weights,
        range_noise**2,
        found,
        sd,
    )
    good = weights > 0
    _count_returns(counts, screening, ranges, intensity, good)
    flags = np.repeat(
        motion.flag.reshape(time.size, geometry.pieces), np.diff(geometry.first), axis=1
    )
    counts["bridged"] += int(((flags & BRIDGED != 0) & good).sum())
    beams = time[:, None] + geometry.mounting.scanner_clock + geometry.delay
    columns: dict[str, Any] = {
        "easting": found[good, 0],
        "northing": found[good, 1],
        "up": found[good, 2],
        "time": beams[good],
    }
    datum = geometry.trajectory.datum_sd
    if datum is not None:
        columns["sd"] = sd[good]
    if datum != 0.0:
        # a lower weight divides all parts of the variance, that of the datum included
        rest = sd[good] ** 2 - (datum or 0.0) ** 2 / weights[good]
        columns["sd_relative"] = np.sqrt(np.maximum(rest, 0.0))
    if intensity is not None:
        columns["intensity"] = intensity[good]
    return columns


def _count_returns(
    counts: dict[str, int],
    screening: Screening,
    ranges: Floats,
    intensity: npt.NDArray[Any] | None,
    good: npt.NDArray[np.bool_],
) -> None:
    within = (ranges >= screening.nearest) & (ranges <= screening.furthest)
    counts["missing"] += int((~within).sum())
    if screening.needs_intensity and intensity is not None:
        counts["flagged"] += int((screening.flagged(intensity) & within).sum())
    counts["returns"] += int(good.sum())


def _require_points(counts: dict[str, int], trajectory: Trajectory, source: Path | None) -> None:
    """Raise CoverageError unless there was a point."""
    if counts["returns"]:
        return
    if counts["scans"] and counts["scans_uncovered"] == counts["scans"]:
        knots = trajectory.time
        raise CoverageError(
            f"the motion, {knots[0]:.3f} s to {knots[-1]:.3f} s, covers none of the "
            f"{counts['scans']} scans",
            path=source,
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )
    raise CoverageError(
        f"there is no return in {counts['scans']} scans ({counts['flagged']} were flagged)",
        path=source,
        place="scans",
        cure="Loosen the screening, or look at the ranges: `trueterrain plot`.",
    )


def _open_scans(
    scans: xr.DataTree | str | Path | Iterable[xr.Dataset], mounting: Mounting | None, block: int
) -> tuple[Mounting, Iterable[xr.Dataset], Path | None]:
    """Mounting, blocks of scans, and the file of a run, a store or blocks."""
    if isinstance(scans, str | Path | xr.DataTree):
        run = open_run(scans)
        return mounting or run.mounting, scan_blocks(run, size=block), run.source
    if mounting is None:
        message = "mounting must be given with blocks of scans, which do not contain it."
        raise ValueError(message)
    return mounting, scans, None


def mounting_of(run: xr.DataTree, *, path: Path | None = None) -> Mounting:
    """Mounting that a run states; deprecated: it is `Run.mounting`."""
    warnings.warn("mounting_of(run) is now run.mounting.", DeprecationWarning, stacklevel=2)
    with name_file_in_errors(path):
        return open_run(run).mounting
