"""Quantiles of the heights in each cell, exact to their step.

Counts say how much room each cell needs, so that another look at the data, or some for many
returns, puts the heights of each cell side by side.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.surface.accumulate import _kernels

#: Returns whose heights are held at once.
COLLECTED = 50_000_000


@dataclass(eq=False)
class HeightCollection:
    """Room for the heights of some cells, one cell after the other."""

    first_cell: int = 0
    cursor: Any = field(default_factory=lambda: np.empty(0, np.int64))
    values: Any = field(default_factory=lambda: np.empty(0, np.int32))


def cell_quantiles(
    count: npt.NDArray[np.int32], share: float, collect: Callable[[HeightCollection], None]
) -> npt.NDArray[np.float64]:
    """Quantile of the heights in each cell in steps; NaN where there is none.

    Parameters
    ----------
    count : numpy.ndarray, shape (row, column)
        Returns.
    share : float
        Share of the heights below it; between two heights by their shares, as numpy does [1].
    collect : callable
        Puts the heights of all data into a collection.

    Returns
    -------
    numpy.ndarray, shape (row, column)
        In steps of the heights.

    Raises
    ------
    ValueError
        If the data are not those that were counted.
    """
    rows, columns = count.shape
    found = np.full((rows, columns), np.nan)
    for begin, end in _row_stretches(count.sum(axis=1, dtype=np.int64)):
        ends = np.cumsum(count[begin:end].ravel(), dtype=np.int64)
        if not ends[-1]:
            continue
        room = HeightCollection(
            first_cell=begin * columns,
            cursor=np.concatenate([[0], ends[:-1]]),
            values=np.empty(ends[-1] + 1, np.int32),
        )
        collect(room)
        if not np.array_equal(room.cursor, ends):
            message = "the data must be the same when they are added again."
            raise ValueError(message)
        _kernels.cell_quantiles(room.values, ends, share, found[begin:end].reshape(-1))
    return found


def _row_stretches(returns: npt.NDArray[np.int64]) -> list[tuple[int, int]]:
    """Stretches of rows that hold no more returns than are collected at once, if a row does not."""
    found, begin, held = [], 0, 0
    for row, some in enumerate(returns.tolist()):
        if held and held + some > COLLECTED:
            found.append((begin, row))
            begin, held = row, 0
        held += some
    return [*found, (begin, returns.size)]
