"""Clocks of the virtual instruments: true time = stamp + clock."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

#: Maximum rate of a clock [s/s]: real ones are below 1e-4, and stamps must increase.
_MAX_RATE = 0.1


@dataclass(frozen=True, kw_only=True)
class SimulatedClock:
    """Clock with an offset and a rate: true time = stamp + clock.

    An event at the true time T has the stamp ``T - clock``: with a clock of +1 ms all stamps are
    1 ms too early.

    Examples
    --------
    >>> slow = SimulatedClock(offset=0.001)
    >>> slow.true(np.array([9.999]))
    array([10.])
    """

    offset: float = 0.0
    "True time less stamp, at `begin` [s]."

    rate: float = 0.0
    "Growth of the clock per second of the stamps [s/s]."

    begin: float = 0.0
    "Stamp at which the offset holds [s]."

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("offset", "begin"):
            if not math.isfinite(getattr(self, name)):
                message = f"clock {name} must be finite, got {getattr(self, name)}."
                raise ValueError(message)
        if not abs(self.rate) < _MAX_RATE:
            message = f"clock rate must be from -{_MAX_RATE} to {_MAX_RATE} s/s, got {self.rate}."
            raise ValueError(message)

    def true(self, stamp: Float) -> Float:
        """True time of stamps.

        Parameters
        ----------
        stamp : numpy.ndarray
            Stamps [s].

        Returns
        -------
        numpy.ndarray
            True times [s].
        """
        return stamp + (self.offset + self.rate * (stamp - self.begin))

    def ticks(self, begin: float, end: float, frequency: float) -> npt.NDArray[np.int64]:
        """Numbers k of the stamps ``k / frequency`` whose true times are in [begin, end).

        Parameters
        ----------
        begin, end : float
            True times [s].
        frequency : float
            Stamps per second [Hz].

        Returns
        -------
        numpy.ndarray of int64
            Each number is in exactly one of two consecutive intervals.

        Examples
        --------
        >>> SimulatedClock().ticks(0.0, 0.01, 200.0)
        array([0, 1])
        """
        first, last = self._tick(begin, frequency), self._tick(end, frequency)
        return np.arange(first, last, dtype=np.int64)

    def _tick(self, time: float, frequency: float) -> int:
        """Minimum k whose true time, with the rounding of `true`, is at least `time`."""
        stamp = (time - self.offset + self.rate * self.begin) / (1.0 + self.rate)
        k = math.ceil(stamp * frequency)
        # rounding may move the result by one tick: compare with `true` itself
        while self._true_tick(k - 1, frequency) >= time:
            k -= 1
        while self._true_tick(k, frequency) < time:
            k += 1
        return k

    def _true_tick(self, k: int, frequency: float) -> float:
        return float(self.true(np.float64(k) / np.array(frequency)))


def check_next(expected: float, begin: float, end: float) -> None:
    """Raise ValueError unless a block starts at the end of the last one and does not end before.

    Parameters
    ----------
    expected, begin, end : float
        End of the last block, begin and end of this one [s].

    Raises
    ------
    ValueError
        If the blocks do not follow each other.
    """
    if begin != expected:
        message = f"begin must be the end of the last block, {expected} s, got {begin} s."
        raise ValueError(message)
    if not (math.isfinite(end) and end >= begin):
        message = f"end must be at least the begin, {begin} s, got {end} s."
        raise ValueError(message)
