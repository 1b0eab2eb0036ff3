"""Sums over the returns of each cell, of one thread."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.accumulate._totals import KeptSums, ReturnTotals
from trueterrain.surface.accumulate.pose_variance import PoseVariance
from trueterrain.surface.cells import Grid


@dataclass
class ThreadSums:
    """Sums of one thread, flat; arrays of sums that are not kept are empty.

    The operating system gives memory only to pages that are written, so each thread can have
    arrays over all cells.
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
    return_totals: ReturnTotals = field(default_factory=ReturnTotals)

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
        """Add the sums of another thread, and set those to zero."""
        _kernels.merge_sums(*self.sums, other.sums)
        self.pose.sums[...] += other.pose.sums
        other.pose.sums[...] = 0
        self.return_totals.add(other.return_totals)
        other.return_totals = ReturnTotals()

    def clear(self) -> None:
        """Set all sums to zero; the arrays are reused, which is faster than allocating them."""
        _kernels.clear_sums(self.sums)
        self.pose.sums[...] = 0
        self.return_totals = ReturnTotals()
