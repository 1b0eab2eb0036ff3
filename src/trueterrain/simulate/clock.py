"""Clocks of the virtual instruments: true time = stamp + clock."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

#: Largest rate of a clock; real ones stay below 1e-4, and a stamp must never stand still.
_FASTEST = 0.1


@dataclass(frozen=True, kw_only=True)
class SimulatedClock:
    """A clock that is wrong by an offset and a rate: true time = stamp + clock.

    What happens at the true time T gets the stamp ``T - clock``: a clock of +1 ms stamps all 1 ms
    too early.

    Examples
    --------
    >>> slow = Clock(offset=0.001)
    >>> slow.true(np.array([9.999]))
    array([10.])
    """

    offset: float = 0.0
    "True time less stamp, at the begin [s]."

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
        if not abs(self.rate) < _FASTEST:
            message = f"clock rate must be from -{_FASTEST} to {_FASTEST} s/s, got {self.rate}."
            raise ValueError(message)

    def true(self, stamp: Float) -> Float:
        """True time at which something got a stamp.

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
            Each number belongs to exactly one of two intervals that follow each other.

        Examples
        --------
        >>> Clock().ticks(0.0, 0.01, 200.0)
        array([0, 1])
        """
        first, last = self._tick(begin, frequency), self._tick(end, frequency)
        return np.arange(first, last, dtype=np.int64)

    def _tick(self, time: float, frequency: float) -> int:
        """Least k whose true time is at least `time`, as `true` iterations it."""
        stamp = (time - self.offset + self.rate * self.begin) / (1.0 + self.rate)
        k = math.ceil(stamp * frequency)
        while self._true_tick(k - 1, frequency) >= time:
            k -= 1
        while self._true_tick(k, frequency) < time:
            k += 1
        return k

    def _true_tick(self, k: int, frequency: float) -> float:
        return float(self.true(np.float64(k) / np.array(frequency)))


def check_next(expected: float, begin: float, end: float) -> None:
    """Raise ValueError unless a block begins where the last one ended, and does not run backwards.

    Parameters
    ----------
    expected, begin, end : float
        Where the last block ended, and where this one begins and ends [s].

    Raises
    ------
    ValueError
        If the blocks do not follow each other.
    """
    if begin != expected:
        message = f"begin must be where the last block ended, {expected} s, got {begin} s."
        raise ValueError(message)
    if not (math.isfinite(end) and end >= begin):
        message = f"end must be at least the begin, {begin} s, got {end} s."
        raise ValueError(message)
