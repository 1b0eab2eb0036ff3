"""Sums over pairs of whole numbers, of which few occur: cells of a map, bins of histograms."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_SHIFT = 1 << 30  # makes both numbers positive
_ROW = 1 << 32  # by which packed numbers differ whose first numbers differ by 1
_DENSE = 4  # pairs in a box per entry, up to which they are summed as an array
_SMALL = 1 << 20  # pairs in a box that are in any case

#: What the packed numbers of a cell and of its eight neighbours differ by.
AROUND = tuple(c * _ROW + r for c in (-1, 0, 1) for r in (-1, 0, 1) if c or r)

#: And those of the next ones north and east.
STRAIGHT = (1, _ROW)


class SparseSums:
    """Sums over entries that have the same two numbers."""

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
            What is added up for each pair of numbers, besides the count.
        """
        if first.size == 0:
            return
        self._parts.append(_group_entries(first, second, values))
        self._pending += self._parts[-1][0].size
        if self._pending > self._parts[0][0].size * 2:
            self._merge()

    def sums(self) -> tuple[Integers, Integers, Integers]:
        """Both numbers, ascending, and counts and sums, shape (1 + values, n)."""
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
    """One number for both numbers of a cell; ascending with the first, then with the second."""
    return np.asarray((column + _SHIFT) * _ROW + (row + _SHIFT))


def unpack_cell(key: Integers) -> tuple[Integers, Integers]:
    """Both numbers of a cell."""
    return key // _ROW - _SHIFT, key % _ROW - _SHIFT


def contains_keys(ascending: Integers, wanted: Integers) -> Flags:
    """Whether numbers are among ascending ones."""
    if not ascending.size:
        return np.zeros(wanted.shape, np.bool_)
    at = np.minimum(np.searchsorted(ascending, wanted), ascending.size - 1)
    return np.asarray(ascending[at] == wanted)


def _group_entries(
    first: Integers, second: Integers, values: tuple[Integers, ...]
) -> tuple[Integers, Integers]:
    """Packed numbers, ascending, and counts and sums of the entries that share them."""
    low = int(first.min()), int(second.min())
    shape = int(first.max()) - low[0] + 1, int(second.max()) - low[1] + 1
    if shape[0] * shape[1] <= _DENSE * first.size + _SMALL:
        flat = (first - low[0]) * shape[1] + (second - low[1])
        count = np.bincount(flat, minlength=shape[0] * shape[1])
        there = np.flatnonzero(count)
        sums = [np.bincount(flat, value, minlength=count.size)[there] for value in values]
        key = pack_cell(there // shape[1] + low[0], there % shape[1] + low[1])
        counted = count[there]
    else:
        key, inverse, counted = np.unique(
            pack_cell(first, second), return_inverse=True, return_counts=True
        )
        sums = [np.bincount(inverse, value, minlength=key.size) for value in values]
    # whole numbers below 2^53 are exact in float64
    return key, np.stack([counted, *(np.rint(part) for part in sums)]).astype(np.int64)
