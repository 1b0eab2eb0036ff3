"""Room for the sums of one thread."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.accumulate._pose import PoseVariance
from trueterrain.surface.accumulate._tally import KeptSums, ReturnTotals
from trueterrain.surface.cells import Grid


@dataclass
class ThreadSums:
    """Sums of one thread, flat; what is not wanted has no room.

    Memory that is never touched costs nothing, so each thread can have all cells.
    """

    count: Any
    totals: Any
    squares: Any
    lows: Any
    highs: Any
    alongs: Any
    acrosses: Any
    variances: Any
    touched: Any
    pose: PoseVariance
    tally: ReturnTotals = field(default_factory=ReturnTotals)

    @classmethod
    def empty(cls, grid: Grid, rows: int, wanted: KeptSums) -> "ThreadSums":
        """All sums zero, for some rows of a grid."""
        cells = rows * grid.shape[1]

        def some(keep: bool, dtype: Any) -> Any:
            return np.zeros(cells if keep else 0, dtype)

        return cls(
            count=some(True, np.int32),
            totals=some(True, np.int64),
            squares=some(True, np.int64),
            lows=some(wanted.extremes, np.int32),
            highs=some(wanted.extremes, np.int32),
            alongs=some(wanted.places, np.int32),
            acrosses=some(wanted.places, np.int32),
            variances=some(wanted.point_sd, np.int64),
            touched=np.zeros(rows, np.bool_),
            pose=PoseVariance.empty(grid),
        )

    @property
    def cells(self) -> tuple[Any, ...]:
        """Sums of returns, as the loops take them."""
        return (
            self.count,
            self.totals,
            self.squares,
            self.lows,
            self.highs,
            self.alongs,
            self.acrosses,
        )

    @property
    def sums(self) -> tuple[Any, ...]:
        """All sums of cells, and which rows have any, as the loops take them."""
        return (*self.cells, self.variances, self.touched)

    def take(self, other: "ThreadSums") -> None:
        """Add the sums of another thread, and leave nothing there."""
        _kernels.merge_sums(*self.sums, other.sums)
        self.pose.sums[...] += other.pose.sums
        other.pose.sums[...] = 0
        self.tally.add(other.tally)
        other.tally = ReturnTotals()

    def clear(self) -> None:
        """Leave nothing; the room stays, which takes less time than to get new."""
        _kernels.clear_sums(self.sums)
        self.pose.sums[...] = 0
        self.tally = ReturnTotals()
