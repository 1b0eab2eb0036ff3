"""Windows of rows, so that memory does not grow with the length of a run.

The sums of a cell take several times the memory of its results. So only the cells of one window of
rows have sums at a time, and only the scans that reach it are read. These are predicted from their
motion and checked when they are gridded; a window that a prediction missed is gridded a second
time. So the surface is the same, bit for bit, for windows of any size.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from trueterrain.surface._recordings import Recording
from trueterrain.surface.accumulate import (
    KeptSums,
    PoseVariance,
    ReturnTotals,
    ScanReach,
    count_scan_visits,
    scan_reaches,
)
from trueterrain.surface.cells import Grid

_PASS_BYTES = 20  # [bytes] for a cell, if there are several passes
_MIN_MARGINS = 8  # length of a window, in margins
_MAX_VISITS = 2.0  # mean number of windows that a scan is gridded for


@dataclass(kw_only=True, eq=False)
class WindowPlan:
    """Windows, and the predicted reach of scans; without reaches if one window is enough."""

    windows: list[range]
    "Rows of each window."

    margin: int = 0
    "Rows to either side that a window depends on."

    reaches: list[ScanReach] = field(default_factory=list)
    "Rows that the scans of each pass reach."

    poses: list[PoseVariance] = field(default_factory=list)
    "Pose variance of each pass."

    return_totals: ReturnTotals = field(default_factory=ReturnTotals)
    "Counts of scans."

    missed: set[range] = field(default_factory=set)
    "Windows that were gridded without a scan that reaches them."

    @property
    def rows(self) -> int:
        """Rows that have sums at a time."""
        return min(max(map(len, self.windows)) + 2 * self.margin, self.windows[-1].stop)

    def first(self, window: range) -> int:
        """First row that has sums while a window is gridded."""
        return max(min(window.start - self.margin, self.windows[-1].stop - self.rows), 0)

    def reaching(self, number: int, window: range) -> npt.NDArray[np.intp] | None:
        """Scans of a pass that reach a window or its margin by prediction; None for all."""
        if not self.reaches:
            return None
        return np.flatnonzero(self._touches(self.reaches[number], window))

    def reach_of(self, number: int, index: npt.NDArray[np.intp]) -> ScanReach | None:
        """Reach of some scans of a pass, to be replaced by `note`."""
        return self.reaches[number].of(index) if self.reaches else None

    def done(self, number: int) -> int:
        """Number of scans of a pass that were gridded."""
        return int(self.reaches[number].found.sum())

    def note(
        self, number: int, index: npt.NDArray[np.intp], found: ScanReach, window: range
    ) -> None:
        """Set the rows that scans of a pass reached while a window was gridded."""
        predicted = self.reaches[number].of(index)
        self.reaches[number].put(index, found)
        if ((found.low < predicted.low) | (found.high > predicted.high)).any():
            for done in self.windows[: self.windows.index(window)]:
                if (self._touches(found, done) & ~self._touches(predicted, done)).any():
                    self.missed.add(done)

    def _touches(self, reach: ScanReach, window: range) -> npt.NDArray[np.bool_]:
        return reach.touches(window.start - self.margin, window.stop + self.margin)


def plan_windows(
    grid: Grid,
    passes: Sequence[Recording],
    wanted: KeptSums,
    *,
    margin: int,
    memory: int,
    threads: int,
    furthest: float,
) -> WindowPlan:
    """Windows whose sums fit into the memory, unless scans then reach over too many of them.

    Parameters
    ----------
    grid : Grid
        The cells.
    passes : sequence of Recording
        Their scans.
    wanted : KeptSums
        Which sums are kept.
    margin : int
        Rows to either side that a window depends on.
    memory : int
        Memory for the sums [bytes].
    threads : int
        Threads that have sums of their own.
    furthest : float
        Range beyond which there are no returns [m].

    Returns
    -------
    WindowPlan
        The windows; larger ones if the scans were gridded more than twice on average.
    """
    rows, columns = grid.shape
    cell = threads * wanted.bytes + (_PASS_BYTES if len(passes) > 1 else 0)
    size = max(memory // (cell * columns) - 2 * margin, _MIN_MARGINS * margin)
    if size >= rows:
        return WindowPlan(windows=[range(rows)])
    found = [
        scan_reaches(grid, one.geometry, one.time, min(one.furthest, furthest)) for one in passes
    ]
    reaches, poses = [reach for reach, _, _ in found], [pose for _, pose, _ in found]
    return_totals = ReturnTotals()
    for _, _, some in found:
        return_totals.add(some)
    count = -(-rows // size)
    while True:
        edges = np.linspace(0, rows, count + 1).round().astype(np.int64)
        if count_scan_visits(reaches, edges, margin) <= _MAX_VISITS * (
            return_totals.scans - return_totals.scans_uncovered
        ):
            break
        count = (count + 1) // 2
    windows = [range(begin, end) for begin, end in pairwise(edges.tolist())]
    return WindowPlan(
        windows=windows, margin=margin, reaches=reaches, poses=poses, return_totals=return_totals
    )
