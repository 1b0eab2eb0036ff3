"""Exact quantiles of values that do not fit into memory."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

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
    size = 1 << _BITS
    upper = np.zeros(size, np.int64)
    decode: type[Any] = np.float32
    for block in blocks():
        keys, decode = _sort_keys(block)
        upper += np.bincount(keys >> _BITS, minlength=size)
    count = int(upper.sum())
    if not count:
        return None
    places = [fraction * (count - 1) for fraction in fractions]
    ranks = sorted(
        {rank for place in places for rank in (int(place), min(int(place) + 1, count - 1))}
    )
    ends = np.cumsum(upper)
    bins = {rank: int(np.searchsorted(ends, rank, side="right")) for rank in sorted(ranks)}
    lower = {key: np.zeros(size, np.int64) for key in set(bins.values())}
    for block in blocks():
        keys, _ = _sort_keys(block)
        high = keys >> _BITS
        for key, counts in lower.items():
            counts += np.bincount(keys[high == key] & (size - 1), minlength=size)
    value = {}
    for rank, key in bins.items():
        before = rank - int(ends[key] - upper[key])
        low = int(np.searchsorted(np.cumsum(lower[key]), before, side="right"))
        value[rank] = float(np.array((key << _BITS) | low, np.uint32).view(decode))
    found = []
    for place in places:
        rank = int(place)
        low, high = value[rank], value[min(rank + 1, count - 1)]
        found.append(low + (high - low) * (place - rank))
    return found


def _sort_keys(values: npt.NDArray[Any]) -> tuple[npt.NDArray[np.int64], type[Any]]:
    """Whole numbers that ascend with the values, without NaN, and the type of the values."""
    if values.dtype.kind == "f":
        known = values[np.isfinite(values)].astype(np.float32) + np.float32(0)  # no negative zero
        return known.view(np.uint32).astype(np.int64), np.float32
    return values.astype(np.int64).ravel(), np.uint32
