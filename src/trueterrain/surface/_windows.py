"""Windows of rows, so that memory stays flat however long runs are.

The sums of a cell take several times the memory of its results. So only the cells of a window of
rows have sums at a time, and only the scans that reach it are read. Which scans do is guessed from
their motion, and noted when they are worked; if a guess left out a window, that is worked again. So
the surface is the same, bit for bit, for windows of any size.
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

_OF_PASSES = 20  # [bytes] for a cell, if there are several passes
_LEAST = 8  # margins that a window is long at least
_AGAIN = 2.0  # times that scans are worked on average, at most


@dataclass(kw_only=True, eq=False)
class WindowPlan:
    """Windows, and what is known of the scans before; nothing if one window is enough."""

    windows: list[range]
    "Rows that are finished together."

    margin: int = 0
    "Rows to either side that they depend on."

    reaches: list[ScanReach] = field(default_factory=list)
    "Rows that the scans of each pass reach."

    poses: list[PoseVariance] = field(default_factory=list)
    "What the pose adds to variances in each pass."

    tally: ReturnTotals = field(default_factory=ReturnTotals)
    "Of scans."

    missed: set[range] = field(default_factory=set)
    "Windows that were worked without a scan that reaches them."

    @property
    def rows(self) -> int:
        """Rows that have sums at a time."""
        return min(max(map(len, self.windows)) + 2 * self.margin, self.windows[-1].stop)

    def first(self, window: range) -> int:
        """The first of them for a window."""
        return max(min(window.start - self.margin, self.windows[-1].stop - self.rows), 0)

    def reaching(self, number: int, window: range) -> npt.NDArray[np.intp] | None:
        """Scans of a pass that reach a window or its margin, as far as is known; None for all."""
        if not self.reaches:
            return None
        return np.flatnonzero(self._touches(self.reaches[number], window))

    def reach_of(self, number: int, index: npt.NDArray[np.intp]) -> ScanReach | None:
        """What is known of some scans of a pass, to be noted anew when they are worked."""
        return self.reaches[number].of(index) if self.reaches else None

    def done(self, number: int) -> int:
        """Scans of a pass that were worked."""
        return int(self.reaches[number].found.sum())

    def note(
        self, number: int, index: npt.NDArray[np.intp], found: ScanReach, window: range
    ) -> None:
        """Note the rows that scans of a pass were found to reach while a window was worked."""
        guess = self.reaches[number].of(index)
        self.reaches[number].put(index, found)
        if ((found.low < guess.low) | (found.high > guess.high)).any():
            for done in self.windows[: self.windows.index(window)]:
                if (self._touches(found, done) & ~self._touches(guess, done)).any():
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
    """Windows whose sums take no more memory than is given, if scans do not reach over too many.

    Parameters
    ----------
    grid : Grid
        The cells.
    passes : sequence of Recording
        Their scans.
    wanted : Wanted
        Which sums are kept.
    margin : int
        Rows to either side that a window depends on.
    memory : int
        For the sums [bytes].
    threads : int
        Threads that have sums of their own.
    furthest : float
        Range beyond which there are no returns [m].

    Returns
    -------
    Plan
        The windows; larger ones, if the scans would be worked more than twice on average.
    """
    rows, columns = grid.shape
    cell = threads * wanted.bytes + (_OF_PASSES if len(passes) > 1 else 0)
    size = max(memory // (cell * columns) - 2 * margin, _LEAST * margin)
    if size >= rows:
        return WindowPlan(windows=[range(rows)])
    found = [
        scan_reaches(grid, one.geometry, one.time, min(one.furthest, furthest)) for one in passes
    ]
    reaches, poses = [reach for reach, _, _ in found], [pose for _, pose, _ in found]
    tally = ReturnTotals()
    for _, _, some in found:
        tally.add(some)
    count = -(-rows // size)
    while True:
        edges = np.linspace(0, rows, count + 1).round().astype(np.int64)
        if count_scan_visits(reaches, edges, margin) <= _AGAIN * (
            tally.scans - tally.scans_uncovered
        ):
            break
        count = (count + 1) // 2
    windows = [range(begin, end) for begin, end in pairwise(edges.tolist())]
    return WindowPlan(windows=windows, margin=margin, reaches=reaches, poses=poses, tally=tally)
