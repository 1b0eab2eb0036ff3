"""Drift of the height of navigation, pass by pass.

The heights of two passes over one road differ, since navigation drifts. The difference was measured
between two drives over the same 8 km of road with a post-processed Applanix POS LV (Boreas data
set, University of Toronto, CC BY 4.0). Where both move and their tracks are within 1 m, the second
is 42 mm lower in the median, with a standard deviation of 25 mm and an autocorrelation of 1/e at
25 s. Its spectrum is within a factor of 2.5 of that of a first-order Gauss-Markov process from
0.01 Hz to 4 Hz; so the default drift is such a process and needs no file. (The difference includes
all changes between the days: the ride height, and the crossfall times the distance of the tracks.)
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.noise import (
    GaussMarkov,
    SecondOrderGaussMarkov,
    check_not_negative,
    check_positive,
    named_generator,
)

Float = npt.NDArray[np.float64]

Order = Literal["first", "second"]


@dataclass(frozen=True, kw_only=True)
class GaussMarkovDrift:
    """Drift as a Gauss-Markov process, with the statistics of the two Boreas drives.

    Each pass has its own drift, and a constant part that alternates from pass to pass. So the
    difference of two consecutive passes has the measured mean and standard deviation.
    """

    height_sd: float = 0.025 / 2**0.5
    "Standard deviation of one pass [m]; that of the difference of two is sqrt(2) times as large."

    correlation_time: float = 25.0
    "Time at which the autocorrelation is 1/e [s]."

    between_passes: float = -0.042
    "Mean height of an odd pass (1, 3, ...) less that of an even pass (0, 2, ...) [m]."

    order: Order = "first"
    "``first``, as measured, or ``second``: smooth, as that of an INS without satellites."

    def __post_init__(self) -> None:
        """Check the values."""
        check_not_negative(height_sd=self.height_sd)
        check_positive(correlation_time=self.correlation_time)
        if not np.isfinite(self.between_passes):
            message = f"between_passes must be finite, got {self.between_passes}."
            raise ValueError(message)
        if self.order not in get_args(Order):
            message = f"order must be first or second, got {self.order!r}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class DriftSeries:
    """Drift from a time series of the difference of two passes; each pass gets half of it.

    An odd pass drifts by half of the series, the even pass before it by minus half, so that their
    difference is the series. Each further pair of passes starts `stretch` later in the series. The
    series is reflected at its ends.

    Examples
    --------
    >>> ramp = DriftSeries(time=(0.0, 100.0), height=(0.0, 0.04))
    >>> start_drift(ramp, seed=1, pass_number=1, rate=1.0).next(np.array([0.0, 50.0]))
    array([0.  , 0.01])
    """

    time: tuple[float, ...]
    "Times since the first, ascending [s]."

    height: tuple[float, ...]
    "Height of the odd pass less that of the even one [m]; linear between the times."

    stretch: float = 300.0
    "Time in the series by which each further pair of passes starts later [s]."

    def __post_init__(self) -> None:
        """Check the values."""
        if len(self.time) < 2 or len(self.time) != len(self.height):
            message = (
                "time and height must have the same number of values, at least 2, "
                f"got {len(self.time)} and {len(self.height)}."
            )
            raise ValueError(message)
        if not (np.isfinite(self.time).all() and np.isfinite(self.height).all()):
            message = "time and height must be finite."
            raise ValueError(message)
        steps = np.diff(self.time)
        if not (steps > 0).all():
            place = int(np.argmax(steps <= 0)) + 1
            message = (
                f"time must ascend, got {self.time[place]} s after {self.time[place - 1]} s "
                f"at value {place}."
            )
            raise ValueError(message)
        check_not_negative(stretch=self.stretch)


HeightDrift = GaussMarkovDrift | DriftSeries


@dataclass(kw_only=True, eq=False)
class Drift:
    """Drift of the height of one pass, in blocks; from `start_drift`."""

    sd: float
    "Root mean square of the drift over time and over all passes of its parity [m]."

    offset: float
    "Constant part [m]."

    process: GaussMarkov | SecondOrderGaussMarkov | None
    "Random process; None for a series."

    series: tuple[Float, Float]
    "Times [s] and heights [m] of the series, the sign of the pass included."

    begin: float
    "Time in the series at which the pass starts [s]."

    def next(self, time: Float) -> Float:
        """Drift of the next epochs.

        Parameters
        ----------
        time : numpy.ndarray, shape (n,)
            Times since the beginning of the pass [s].

        Returns
        -------
        numpy.ndarray, shape (n,)
            Drift of the height [m].
        """
        if self.process is not None:
            return self.process.next(time.size)[:, 0] + self.offset
        times, heights = self.series
        span = times[-1] - times[0]
        # reflect times at both ends of the series
        folded = np.mod(self.begin + time, 2.0 * span)
        place = times[0] + np.minimum(folded, 2.0 * span - folded)
        return np.asarray(np.interp(place, times, heights), dtype=np.float64)


def start_drift(drift: HeightDrift, *, seed: int, pass_number: int, rate: float) -> Drift:
    """Drift of one pass from its beginning.

    Parameters
    ----------
    drift : GaussMarkovDrift or DriftSeries
        Parameters.
    seed : int
        Seed of all random numbers.
    pass_number : int
        Number of the pass, from 0.
    rate : float
        Epochs per second [Hz].

    Returns
    -------
    Drift
        Gives the drift block by block.

    Raises
    ------
    ValueError
        If the number of the pass is negative.

    Examples
    --------
    >>> perfect = GaussMarkovDrift(height_sd=0.0)
    >>> start_drift(perfect, seed=1, pass_number=0, rate=1.0).next(np.zeros(1))
    array([0.021])
    >>> start_drift(perfect, seed=1, pass_number=1, rate=1.0).next(np.zeros(1))
    array([-0.021])
    """
    if pass_number < 0:
        message = f"pass_number must be at least 0, got {pass_number}."
        raise ValueError(message)
    sign = 0.5 if pass_number % 2 else -0.5
    none = (np.zeros(1), np.zeros(1))
    if isinstance(drift, GaussMarkovDrift):
        kind = GaussMarkov if drift.order == "first" else SecondOrderGaussMarkov
        process = kind(
            rng=named_generator(seed, "navigation", f"pass {pass_number}", "height drift"),
            sd=drift.height_sd,
            correlation_time=drift.correlation_time,
            rate=rate,
        )
        offset = sign * drift.between_passes
        sd = float(np.hypot(offset, drift.height_sd))
        return Drift(sd=sd, offset=offset, process=process, series=none, begin=0.0)
    times, heights = np.array(drift.time), sign * np.array(drift.height)
    # mean square of the piecewise linear series
    left, right = heights[:-1], heights[1:]
    square = np.average((left**2 + left * right + right**2) / 3.0, weights=np.diff(times))
    return Drift(
        sd=float(np.sqrt(square)),
        offset=0.0,
        process=None,
        series=(times, heights),
        begin=(pass_number // 2) * drift.stretch,
    )
