"""Exact quantiles of values that do not fit into memory."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.kernels import compile_kernel

_BITS = 16  # of the first of two sweeps


def exact_quantiles(
    blocks: Callable[[], Iterable[npt.NDArray[Any]]], fractions: Sequence[float]
) -> list[float] | None:
    """Quantiles of values that are at least 0, as `numpy.quantile` gives them.

    Sorting would need all values at once. Two sweeps over them are enough: the first counts values
    by their upper 16 bits, the second those near the quantiles by their lower 16 bits. The bits of
    floating-point numbers that are not negative ascend with the numbers, so that both sweeps sort.

    Parameters
    ----------
    blocks : callable
        Returns the values in blocks, float32 or whole numbers below 2³¹; the same at each call.
    fractions : sequence of float
        Fractions of the values below the quantiles [1].

    Returns
    -------
    list of float or None
        Quantiles, linear between two values; None if there are no values. NaN do not count.

    Examples
    --------
    >>> exact_quantiles(lambda: [np.float32([4.0, 1.0]), np.float32([2.0])], [0.5, 0.75])
    [2.0, 3.0]
    """
    upper = np.zeros(1 << _BITS, np.int64)
    decode: type[Any] = np.float32
    for block in blocks():
        keys, decode = _sort_keys(block)
        _count_upper(keys, upper)
    count = int(upper.sum())
    if not count:
        return None
    places = [fraction * (count - 1) for fraction in fractions]
    ranks = {int(place) for place in places}
    ranks |= {min(rank + 1, count - 1) for rank in ranks}
    ends = np.cumsum(upper)
    high = {rank: int(np.searchsorted(ends, rank, side="right")) for rank in ranks}
    wanted = np.full(upper.size, -1)  # row of `lower` for upper bits
    wanted[sorted(set(high.values()))] = np.arange(len(set(high.values())))
    lower = np.zeros((int(wanted.max()) + 1, upper.size), np.int64)
    for block in blocks():
        _count_lower(_sort_keys(block)[0], wanted, lower)
    value = {}
    for rank, key in high.items():
        before = rank - int(ends[key] - upper[key])
        low = int(np.searchsorted(np.cumsum(lower[wanted[key]]), before, side="right"))
        value[rank] = float(np.array((key << _BITS) | low, np.uint32).view(decode))
    found = []
    for place in places:
        rank = int(place)
        below, above = value[rank], value[min(rank + 1, count - 1)]
        found.append(below + (above - below) * (place - rank))
    return found


def _sort_keys(values: npt.NDArray[Any]) -> tuple[npt.NDArray[np.uint32], type[Any]]:
    """Whole numbers that ascend with the values, without NaN, and the type of the values."""
    if values.dtype.kind == "f":
        known = values[np.isfinite(values)].astype(np.float32) + np.float32(0)  # no negative zero
        return known.view(np.uint32), np.float32
    return values.astype(np.uint32).ravel(), np.uint32


@compile_kernel
def _count_upper(keys: npt.NDArray[np.uint32], counts: npt.NDArray[np.int64]) -> None:
    """Count keys by their upper 16 bits.

    keys : shape (value,)
    counts : input and output, shape (2^16,)
    """
    for k in range(keys.size):
        counts[keys[k] >> 16] += 1


@compile_kernel
def _count_lower(
    keys: npt.NDArray[np.uint32],
    wanted: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
) -> None:
    """Count keys with some upper bits by their lower 16 bits.

    keys : shape (value,)
    wanted : row of `counts` for each number of upper bits, -1 for none, shape (2^16,)
    counts : input and output, shape (row, 2^16)
    """
    for k in range(keys.size):
        row = wanted[keys[k] >> 16]
        if row >= 0:
            counts[row, keys[k] & 0xFFFF] += 1
