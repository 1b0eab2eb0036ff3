"""Exact median of values that are too many to be sorted in memory."""

from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def blockwise_median(blocks: Callable[[], Iterable[Floats]], sample: Floats) -> float:
    """Median of the finite values of all blocks.

    A sample gives a bracket in which the median probably lies. All values are counted, but only
    those in the bracket are kept and sorted; if the median lies outside, the bracket is widened.
    The result depends neither on the sample nor on the blocks.

    Parameters
    ----------
    blocks : callable
        Returns an iterator of all values, block by block, at each call.
    sample : ndarray
        Some of the values, spaced over all blocks; at least one is finite.

    Returns
    -------
    float
        The median.

    Examples
    --------
    >>> values = np.array([7.0, 1.0, np.nan, 3.0, 2.0])
    >>> blockwise_median(lambda: [values[:3], values[3:]], values[:2])
    2.5
    """
    sample = np.sort(sample[np.isfinite(sample)])
    fraction = 0.02  # of the values in the bracket, on either side of the median
    while True:
        bracket = (-np.inf, np.inf)
        if sample.size and fraction < 0.5:
            places = (
                (0.5 - fraction) * (sample.size - 1),
                (0.5 + fraction) * (sample.size - 1),
            )
            bracket = (float(sample[int(places[0])]), float(sample[int(np.ceil(places[1]))]))
        found = _median_between(blocks(), *bracket)
        if found is not None:
            return found
        fraction *= 2


def _median_between(blocks: Iterable[Floats], low: float, high: float) -> float | None:
    """The median, if it lies between two values."""
    below = lows = highs = above = 0
    between = []
    for values in blocks:
        below += int(np.count_nonzero(values < low))
        above += int(np.count_nonzero(values > high))
        near = values[(values >= low) & (values <= high)]
        # values equal to a bound are counted, not kept: all heights of a flat road may be equal
        lows += int(np.count_nonzero(near == low))
        highs += int(np.count_nonzero((near == high) & (high > low)))
        between.append(near[(near > low) & (near < high)])
    inner = np.concatenate(between)
    count = below + lows + inner.size + highs + above
    if count == 0:
        message = "at least one value must be finite"
        raise ValueError(message)

    def ranked(rank: int) -> float | None:
        rank -= below
        if not 0 <= rank < count - below - above:
            return None
        if rank < lows:
            return low
        rank -= lows
        return float(np.partition(inner, rank)[rank]) if rank < inner.size else high

    lower, upper = ranked((count - 1) // 2), ranked(count // 2)
    return None if lower is None or upper is None else (lower + upper) / 2
