"""Sparse sums over pairs of integers, such as cells of a map or bins of histograms."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_SHIFT = 1 << 30  # offset that makes both numbers positive
_ROW = 1 << 32  # difference of keys whose first numbers differ by 1
_DENSE = 4  # size of the bounding box over the entries up to which a dense array is used
_SMALL = 1 << 20  # size of the bounding box for which a dense array is always used

#: Differences between the key of a cell and those of its eight neighbours.
AROUND = tuple(c * _ROW + r for c in (-1, 0, 1) for r in (-1, 0, 1) if c or r)

#: Differences to the neighbours to the north and to the east.
STRAIGHT = (1, _ROW)


class SparseSums:
    """Sums over entries with the same pair of integers, accumulated in blocks."""

    def __init__(self, columns: int) -> None:
        self._columns = columns
        self._parts: list[tuple[Integers, Integers]] = []
        self._pending = 0

    def add(self, first: Integers, second: Integers, *values: Integers) -> None:
        """Add entries.

        Parameters
        ----------
        first, second : numpy.ndarray of int64, shape (n,)
            Numbers of each entry.
        *values : numpy.ndarray of int64, shape (n,)
            Values to sum for each pair.
        """
        if first.size == 0:
            return
        self._parts.append(_group_entries(first, second, values))
        self._pending += self._parts[-1][0].size
        if self._pending > self._parts[0][0].size * 2:
            self._merge()

    def sums(self) -> tuple[Integers, Integers, Integers]:
        """Pairs in ascending order, and counts and sums, shape (1 + values, n)."""
        self._merge()
        if not self._parts:
            none = np.empty(0, np.int64)
            return none, none, np.empty((self._columns, 0), np.int64)
        key, sums = self._parts[0]
        return *unpack_cell(key), sums

    def _merge(self) -> None:
        if len(self._parts) > 1:
            keys = np.concatenate([key for key, _ in self._parts])
            sums = np.concatenate([part for _, part in self._parts], axis=1)
            order = np.argsort(keys, kind="stable")
            begin = np.flatnonzero(np.diff(keys[order], prepend=-1))
            self._parts = [(keys[order][begin], np.add.reduceat(sums[:, order], begin, axis=1))]
        self._pending = 0


def pack_cell(column: Integers, row: Integers) -> Integers:
    """Key of a cell: one integer, which sorts by column, then by row."""
    return np.asarray((column + _SHIFT) * _ROW + (row + _SHIFT))


def unpack_cell(key: Integers) -> tuple[Integers, Integers]:
    """Column and row of a key."""
    return key // _ROW - _SHIFT, key % _ROW - _SHIFT


def contains_keys(ascending: Integers, values: Integers) -> Flags:
    """Whether values occur in an ascending array."""
    if not ascending.size:
        return np.zeros(values.shape, np.bool_)
    at = np.minimum(np.searchsorted(ascending, values), ascending.size - 1)
    return np.asarray(ascending[at] == values)


def _group_entries(
    first: Integers, second: Integers, values: tuple[Integers, ...]
) -> tuple[Integers, Integers]:
    """Keys in ascending order, and counts and sums of their entries."""
    low = int(first.min()), int(second.min())
    shape = int(first.max()) - low[0] + 1, int(second.max()) - low[1] + 1
    if shape[0] * shape[1] <= _DENSE * first.size + _SMALL:
        flat = (first - low[0]) * shape[1] + (second - low[1])
        count = np.bincount(flat, minlength=shape[0] * shape[1])
        occupied = np.flatnonzero(count)
        sums = [np.bincount(flat, value, minlength=count.size)[occupied] for value in values]
        key = pack_cell(occupied // shape[1] + low[0], occupied % shape[1] + low[1])
        counted = count[occupied]
    else:
        key, inverse, counted = np.unique(
            pack_cell(first, second), return_inverse=True, return_counts=True
        )
        sums = [np.bincount(inverse, value, minlength=key.size) for value in values]
    # integers below 2^53 are exact in float64
    return key, np.stack([counted, *(np.rint(part) for part in sums)]).astype(np.int64)
