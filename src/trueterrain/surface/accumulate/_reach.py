"""Which rows of a grid scans reach, so that it can be worked window by window."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from trueterrain.georeference import PoseExpansion, ScanGeometry
from trueterrain.motion.trajectory import BRIDGED
from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.accumulate._pose import PoseVariance
from trueterrain.surface.accumulate._tally import ReturnTotals
from trueterrain.surface.cells import Grid

Index = slice | npt.NDArray[np.intp]

_CHUNK = 2048  # scans whose motion is worked out at once
_RAYS = 5  # beams of a scan that are looked at
_SPARE = 3  # rows that a scan may reach further than they do
_ASIDE = 0.3  # [m] beside the grid to which they are followed: it may curve


@dataclass(kw_only=True, eq=False)
class ScanReach:
    """Rows that some scans reach: first a good guess, then what was found."""

    hint: npt.NDArray[np.int32]
    "A strip of the line near each scan, shape (scan,)."

    low: npt.NDArray[np.int32]
    "First row, shape (scan,); after the last one if the scan has no return on the grid."

    high: npt.NDArray[np.int32]
    "Last row, shape (scan,)."

    found: npt.NDArray[np.bool_]
    "Whether the scan was worked, so that the rows are those of its returns, shape (scan,)."

    @classmethod
    def unknown(cls, scans: int) -> "ScanReach":
        """Room for so many scans, which reach no row."""
        hint, low, high = np.zeros((3, scans), np.int32)
        return cls(hint=hint, low=low, high=high - 1, found=np.zeros(scans, np.bool_))

    def of(self, index: Index) -> "ScanReach":
        """Those of some scans."""
        return ScanReach(**{entry.name: getattr(self, entry.name)[index] for entry in fields(self)})

    def put(self, index: Index, those: "ScanReach") -> None:
        """Take over what was found of some scans."""
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
    tally: ReturnTotals,
) -> tuple[PoseExpansion, npt.NDArray[np.int64]]:
    """Motion of scans, and a strip of the line near each; what the pose adds to variances is noted.

    Parameters
    ----------
    grid : Grid
        The cells.
    geometry : ScanGeometry
        Motion and beams.
    time : numpy.ndarray, shape (scan,)
        Stamps of scans that the motion covers [s].
    pose : Pose
        The variances are added to it.
    tally : Tally
        The bridged scans are added to it.

    Returns
    -------
    motion : Expansion
        Of all pieces.
    hint : numpy.ndarray of int, shape (scan,)
        Strips.
    """
    motion = geometry.expand(time)
    flags = motion.flag.reshape(time.size, geometry.pieces)
    tally.bridged += int((flags & BRIDGED != 0).any(axis=1).sum())
    middle = motion.coefficient[geometry.pieces // 2 :: geometry.pieces, :2, 0]
    hint = grid.near(middle[:, 0], middle[:, 1])
    pose.add(motion, geometry.pieces, hint, grid, datum_sd=geometry.trajectory.datum_sd or 0.0)
    return motion, hint


def scan_reaches(
    grid: Grid, geometry: ScanGeometry, time: npt.NDArray[np.float64], furthest: float
) -> tuple[ScanReach, PoseVariance, ReturnTotals]:
    """Look at the motion of all scans of a pass: which rows they may reach.

    Parameters
    ----------
    grid : Grid
        The cells.
    geometry : ScanGeometry
        Motion and beams.
    time : numpy.ndarray, shape (scan,)
        Stamps of the scans [s].
    furthest : float
        Range that is not often passed [m]: a greater one costs time, as does a smaller one.

    Returns
    -------
    reach : Reach
        Guessed for the scans that the motion covers; the others reach no row.
    pose : Pose
        What the pose adds to variances.
    tally : Tally
        Of scans, not yet of returns.
    """
    reach, pose, tally = ScanReach.unknown(time.size), PoseVariance.empty(grid), ReturnTotals()
    covered = np.flatnonzero(geometry.covers(time))
    tally.add(ReturnTotals(scans=time.size, scans_uncovered=time.size - covered.size))
    beams = np.unique(np.linspace(0, geometry.angle.size - 1, _RAYS).round().astype(np.int64))
    piece = np.searchsorted(geometry.first, beams, side="right") - 1
    edge = 0.5 * grid.spacing[1] + _ASIDE
    for start in range(0, covered.size, _CHUNK):
        some = covered[start : start + _CHUNK]
        motion, hint = near_line(grid, geometry, time[some], pose, tally)
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
            _SPARE,
            here.low,
            here.high,
        )
        reach.put(some, here)
    return reach, pose, tally


def count_scan_visits(
    reaches: Sequence[ScanReach], edges: npt.NDArray[np.int64], margin: int
) -> int:
    """Scans that are worked for all windows between edges, each as often as it is."""
    found = 0
    for reach in reaches:
        seen = reach.low <= reach.high
        first = np.searchsorted(edges[1:-1], reach.low[seen] - margin, side="right")
        last = np.searchsorted(edges[1:-1], reach.high[seen] + margin, side="right")
        found += int((last - first + 1).sum())
    return found
