"""Rows of a grid that scans reach, for gridding window by window."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from trueterrain.georeference import PoseExpansion, ScanGeometry
from trueterrain.motion.trajectory import BRIDGED
from trueterrain.surface import _kernels
from trueterrain.surface.accumulate._returns import ReturnTotals
from trueterrain.surface.accumulate.pose_variance import PoseVariance
from trueterrain.surface.cells import Grid

Index = slice | npt.NDArray[np.intp]

_CHUNK = 2048  # scans whose motion is expanded at once
_SAMPLED_BEAMS = 5  # beams of a scan that are followed
_ROW_MARGIN = 3  # rows that a scan may reach beyond those of the sampled beams
_LATERAL_MARGIN = 0.3  # [m] beyond the edges of the grid, since it may curve


@dataclass(kw_only=True, eq=False)
class ScanReach:
    """Rows that some scans reach: first predicted, then those found when they are gridded."""

    hint: npt.NDArray[np.int32]
    "A strip of the line near each scan, shape (scan,)."

    low: npt.NDArray[np.int32]
    "First row, shape (scan,); after the last one if the scan has no return on the grid."

    high: npt.NDArray[np.int32]
    "Last row, shape (scan,)."

    found: npt.NDArray[np.bool_]
    "Whether the scan was gridded, so that the rows are those of its returns, shape (scan,)."

    @classmethod
    def unknown(cls, scans: int) -> "ScanReach":
        """Reach of scans of which nothing is known yet: no row."""
        hint, low, high = np.zeros((3, scans), np.int32)
        return cls(hint=hint, low=low, high=high - 1, found=np.zeros(scans, np.bool_))

    def of(self, index: Index) -> "ScanReach":
        """Reach of some of the scans."""
        return ScanReach(**{entry.name: getattr(self, entry.name)[index] for entry in fields(self)})

    def put(self, index: Index, those: "ScanReach") -> None:
        """Set the reach of some of the scans."""
        for entry in fields(self):
            getattr(self, entry.name)[index] = getattr(those, entry.name)

    def touches(self, begin: int, end: int) -> npt.NDArray[np.bool_]:
        """Which scans reach the rows from `begin` to before `end`."""
        return np.asarray((self.low < end) & (self.high >= begin) & (self.low <= self.high))


def near_line(
    grid: Grid,
    geometry: ScanGeometry,
    time: npt.NDArray[np.float64],
    pose: PoseVariance,
    return_totals: ReturnTotals,
) -> tuple[PoseExpansion, npt.NDArray[np.int64]]:
    """Motion of scans, and a strip of the line near each; adds their pose variance to `pose`.

    Parameters
    ----------
    grid : Grid
        The cells.
    geometry : ScanGeometry
        Motion and beams.
    time : numpy.ndarray, shape (scan,)
        Stamps of scans that the motion covers [s].
    pose : PoseVariance
        The variances are added to it.
    return_totals : ReturnTotals
        The bridged scans are added to it.

    Returns
    -------
    motion : PoseExpansion
        Of all pieces of the scans.
    hint : numpy.ndarray of int, shape (scan,)
        Strips.
    """
    motion = geometry.expand(time)
    flags = motion.flag.reshape(time.size, geometry.pieces)
    return_totals.bridged += int((flags & BRIDGED != 0).any(axis=1).sum())
    centre = motion.coefficient[geometry.pieces // 2 :: geometry.pieces, :2, 0]
    hint = grid.near(centre[:, 0], centre[:, 1])
    pose.add(motion, geometry.pieces, hint, grid, datum_sd=geometry.trajectory.datum_sd or 0.0)
    return motion, hint


def scan_reaches(
    grid: Grid, geometry: ScanGeometry, time: npt.NDArray[np.float64], furthest: float
) -> tuple[ScanReach, PoseVariance, ReturnTotals]:
    """Predict from the motion which rows the scans of a pass reach.

    Parameters
    ----------
    grid : Grid
        The cells.
    geometry : ScanGeometry
        Motion and beams.
    time : numpy.ndarray, shape (scan,)
        Stamps of the scans [s].
    furthest : float
        Range that few returns exceed [m]; it affects only the run time.

    Returns
    -------
    reach : ScanReach
        Predicted for the scans that the motion covers; the others reach no row.
    pose : PoseVariance
        Variance of heights by the pose.
    return_totals : ReturnTotals
        Of scans, not yet of returns.
    """
    reach, pose, return_totals = (
        ScanReach.unknown(time.size),
        PoseVariance.empty(grid),
        ReturnTotals(),
    )
    covered = np.flatnonzero(geometry.covers(time))
    return_totals.add(ReturnTotals(scans=time.size, scans_uncovered=time.size - covered.size))
    beams = np.unique(
        np.linspace(0, geometry.angle.size - 1, _SAMPLED_BEAMS).round().astype(np.int64)
    )
    piece = np.searchsorted(geometry.first, beams, side="right") - 1
    edge = 0.5 * grid.spacing[1] + _LATERAL_MARGIN
    for start in range(0, covered.size, _CHUNK):
        some = covered[start : start + _CHUNK]
        motion, hint = near_line(grid, geometry, time[some], pose, return_totals)
        here = ScanReach.unknown(some.size)
        here.hint[:] = hint
        _kernels.scan_reach(
            motion.coefficient,
            geometry.pieces,
            piece,
            geometry.beam[:, beams],
            furthest,
            *grid.strips[:6],
            here.hint,
            grid.v[0] - edge,
            grid.v[-1] + edge,
            _ROW_MARGIN,
            here.low,
            here.high,
        )
        reach.put(some, here)
    return reach, pose, return_totals


def count_scan_visits(
    reaches: Sequence[ScanReach], edges: npt.NDArray[np.int64], margin: int
) -> int:
    """Number of scans to grid in all windows between edges, repeated ones included."""
    found = 0
    for reach in reaches:
        seen = reach.low <= reach.high
        first = np.searchsorted(edges[1:-1], reach.low[seen] - margin, side="right")
        last = np.searchsorted(edges[1:-1], reach.high[seen] + margin, side="right")
        found += int((last - first + 1).sum())
    return found
