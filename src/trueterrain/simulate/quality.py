"""Quality of satellite positioning: errors without a base station or without satellites.

In addition to the drift, the error of each component of the position is a first-order Gauss-Markov
process with the standard deviation and the correlation time of the current state. A change of state
takes effect gradually: the error reaches its new size within the correlation time of the new state.
In an outage the error starts at its last value and grows: as a random walk, and with the square of
time, since an accelerometer of the INS has an unknown bias.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.noise import (
    accumulate_samples,
    check_not_negative,
    check_positive,
    named_generator,
)

Float = npt.NDArray[np.float64]

State = Literal["base station", "decimetre", "standalone", "outage"]

#: States in the order of their codes in recorded truth.
STATES: tuple[State, ...] = get_args(State)


@dataclass(frozen=True, kw_only=True)
class Quality:
    """State of satellite positioning from a time on."""

    begin: float
    "Start of the state, since the beginning of the run [s]."

    state: State
    "``base station`` (2 cm), ``decimetre``, ``standalone`` (0.8 m to 1.2 m) or ``outage``."

    def __post_init__(self) -> None:
        """Check the values."""
        if not np.isfinite(self.begin):
            message = f"begin must be finite, got {self.begin}."
            raise ValueError(message)
        if self.state not in STATES:
            message = f"state must be one of {', '.join(STATES)}, got {self.state!r}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class PositionAccuracy:
    """Errors of positions in each state, in addition to the drift with a base station (2 cm).

    Standard deviations are those of the receiver of the thesis (chapter 2). The times and the
    growth in an outage are assumptions, typical of tactical-grade systems.
    """

    base_station_time: float = 5.0
    "Correlation time with which errors decay to those with a base station [s]."

    decimetre_sd: float = 0.1
    "Standard deviation of each component with decimetre corrections [m]."

    decimetre_time: float = 30.0
    "Time at which its autocorrelation is 1/e [s]."

    standalone_sd: tuple[float, float] = (0.8, 1.2)
    "Lowest and highest standard deviation stand-alone [m]; each period has a random one."

    standalone_time: float = 60.0
    "Time at which its autocorrelation is 1/e [s]."

    outage_walk: float = 0.005
    "Standard deviation of the random walk after 1 s of outage [m/sqrt(s)]."

    outage_acceleration: float = 1e-4
    "Standard deviation of the constant acceleration error in an outage [m/s^2]."

    def __post_init__(self) -> None:
        """Check the values."""
        check_positive(
            base_station_time=self.base_station_time,
            decimetre_time=self.decimetre_time,
            standalone_time=self.standalone_time,
        )
        check_not_negative(
            decimetre_sd=self.decimetre_sd,
            outage_walk=self.outage_walk,
            outage_acceleration=self.outage_acceleration,
        )
        lowest, highest = self.standalone_sd
        if not 0 <= lowest <= highest < np.inf:
            message = f"standalone_sd must be two ascending numbers, got {self.standalone_sd}."
            raise ValueError(message)


def check_quality(quality: tuple[Quality, ...]) -> None:
    """Raise ValueError unless the states are in order of time.

    Parameters
    ----------
    quality : tuple of Quality
        States of a run.

    Raises
    ------
    ValueError
        If a state starts before the previous one.
    """
    starts = [state.begin for state in quality]
    for place, (before, after) in enumerate(pairwise(starts), start=1):
        if not before < after:
            message = (
                f"quality must be in order of time, got a begin of {after} s after {before} s "
                f"at state {place}."
            )
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Period:
    """One period in a state, with its random constants."""

    code: int
    begin: float
    sd: float
    keep: float
    walk: float
    acceleration: Float
    acceleration_sd: float


class PositionErrors:
    """Errors of the position by the quality of positioning, in blocks.

    Parameters
    ----------
    quality : tuple of Quality
        States in order; before the first it has a base station.
    accuracy : PositionAccuracy
        Errors of positions in each state.
    seed : int
        Seed of all random numbers.
    name : str
        Name of the run, for independent random numbers.
    rate : float
        Epochs per second [Hz].

    Examples
    --------
    >>> outage = Quality(begin=1.0, state="outage")
    >>> lost = PositionErrors((outage,), PositionAccuracy(), 1, "", rate=1.0)
    >>> error, variance, code = lost.next(np.array([0.0, 1.0, 2.0]))
    >>> code
    array([0, 3, 3], dtype=int8)
    >>> np.sqrt(variance).round(4)
    array([0.    , 0.005 , 0.0071])
    """

    def __init__(
        self,
        quality: tuple[Quality, ...],
        accuracy: PositionAccuracy,
        seed: int,
        name: str,
        *,
        rate: float,
    ) -> None:
        check_quality(quality)
        check_positive(rate=rate)
        self._step = 1.0 / rate
        draws = named_generator(seed, "navigation", name, "quality of periods")
        first = Quality(begin=-np.finfo(np.float64).max, state="base station")
        self._periods = [self._period(q, accuracy, draws) for q in (first, *quality)]
        self._starts = np.array([period.begin for period in self._periods])
        self._drive = named_generator(seed, "navigation", name, "quality")
        self._current = -1
        self._epoch = 0
        self._variance = self._variance_before = 0.0
        self._last = np.zeros(3)

    def _period(
        self, quality: Quality, accuracy: PositionAccuracy, rng: np.random.Generator
    ) -> _Period:
        sd = float(rng.uniform(*accuracy.standalone_sd))
        acceleration = rng.standard_normal(3) * accuracy.outage_acceleration
        sds = {"base station": 0.0, "decimetre": accuracy.decimetre_sd, "standalone": sd}
        times = {
            "base station": accuracy.base_station_time,
            "decimetre": accuracy.decimetre_time,
            "standalone": accuracy.standalone_time,
        }
        out = quality.state == "outage"
        return _Period(
            code=STATES.index(quality.state),
            begin=quality.begin,
            sd=0.0 if out else sds[quality.state],
            keep=1.0 if out else float(np.exp(-self._step / times[quality.state])),
            walk=accuracy.outage_walk if out else 0.0,
            acceleration=acceleration if out else np.zeros(3),
            acceleration_sd=accuracy.outage_acceleration if out else 0.0,
        )

    def next(self, time: Float) -> tuple[Float, Float, npt.NDArray[np.int8]]:
        """Errors of the next epochs.

        Parameters
        ----------
        time : numpy.ndarray, shape (n,)
            Times since the beginning of the run, ascending [s].

        Returns
        -------
        error : numpy.ndarray, shape (n, 3)
            Errors of east, north and up [m].
        variance : numpy.ndarray, shape (n,)
            Their variance, the same for each component [m^2].
        code : numpy.ndarray of int8, shape (n,)
            State, as an index of `STATES`.
        """
        error = np.zeros((time.size, 3))
        variance = np.zeros(time.size)
        if len(self._periods) == 1:
            return error, variance, np.zeros(time.size, dtype=np.int8)
        state_index = np.searchsorted(self._starts, time, side="right") - 1
        code = np.array([period.code for period in self._periods], dtype=np.int8)[state_index]
        edges = np.flatnonzero(np.diff(state_index)) + 1
        for part in np.split(np.arange(time.size), edges):
            if part.size:
                error[part], variance[part] = self._next_errors(
                    int(state_index[part[0]]), part.size
                )
        return error, variance, code

    def _next_errors(self, state_index: int, n: int) -> tuple[Float, Float]:
        """Errors and variance of the next `n` epochs, in period `state_index`."""
        period = self._periods[state_index]
        if state_index != self._current:
            if self._current < 0 and period.sd:  # stationary at the first epoch
                self._last = self._drive.standard_normal(3) * period.sd
                self._variance = period.sd**2
            self._current, self._epoch, self._variance_before = state_index, 0, self._variance
        epoch = self._epoch + np.arange(1, n + 1, dtype=np.float64)
        elapsed = epoch * self._step
        scale = np.hypot(
            period.sd * np.sqrt(1.0 - period.keep**2), period.walk * np.sqrt(self._step)
        )
        drive = self._drive.standard_normal((n, 3)) * scale
        # a constant acceleration a adds a (t[m]^2 - t[m - 1]^2) / 2 in each step
        drive += ((epoch - 0.5) * self._step**2)[:, None] * period.acceleration
        error = accumulate_samples(period.keep, drive, self._last)
        kept = period.keep ** (2.0 * epoch)
        variance = (
            kept * self._variance_before
            + (1.0 - kept) * period.sd**2
            + period.walk**2 * elapsed
            + (0.5 * period.acceleration_sd * elapsed**2) ** 2
        )
        self._epoch += n
        self._last, self._variance = error[-1], float(variance[-1])
        return error, variance
