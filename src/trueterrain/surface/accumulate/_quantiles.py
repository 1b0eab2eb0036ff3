"""Quantiles of the heights in each cell, exact to their step.

The counts of a first pass over the data give the offset of each cell in one array. A second pass,
or several if there are many returns, writes the heights of each cell into its part of the array.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.surface.accumulate import _kernels

#: Returns whose heights are in memory at once.
COLLECTED = 50_000_000


@dataclass(eq=False)
class HeightCollection:
    """Heights of some cells, one cell after the other."""

    first_cell: int = 0
    cursor: Any = field(default_factory=lambda: np.empty(0, np.int64))
    values: Any = field(default_factory=lambda: np.empty(0, np.int32))


def cell_quantiles(
    count: npt.NDArray[np.int32], fraction: float, collect: Callable[[HeightCollection], None]
) -> npt.NDArray[np.float64]:
    """Quantile of the heights in each cell, in steps; NaN in empty cells.

    Parameters
    ----------
    count : numpy.ndarray, shape (row, column)
        Returns.
    fraction : float
        Fraction of the heights below it; linear between two heights, as numpy does [1].
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
    for begin, end in _row_ranges(count.sum(axis=1, dtype=np.int64)):
        ends = np.cumsum(count[begin:end].ravel(), dtype=np.int64)
        if not ends[-1]:
            continue
        collection = HeightCollection(
            first_cell=begin * columns,
            cursor=np.concatenate([[0], ends[:-1]]),
            values=np.empty(ends[-1] + 1, np.int32),
        )
        collect(collection)
        if not np.array_equal(collection.cursor, ends):
            message = "the data must be the same when they are added a second time."
            raise ValueError(message)
        _kernels.cell_quantiles(collection.values, ends, fraction, found[begin:end].reshape(-1))
    return found


def _row_ranges(returns: npt.NDArray[np.int64]) -> list[tuple[int, int]]:
    """Ranges of rows with at most `COLLECTED` returns each, or of one row that has more."""
    found, begin, held = [], 0, 0
    for row, some in enumerate(returns.tolist()):
        if held and held + some > COLLECTED:
            found.append((begin, row))
            begin, held = row, 0
        held += some
    return [*found, (begin, returns.size)]
