"""Virtual navigation: the exact pose of the body with the errors of an INS."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.clock import SimulatedClock, check_next
from trueterrain.simulate.drift import GaussMarkovDrift, HeightDrift, start_drift
from trueterrain.simulate.noise import (
    GaussMarkov,
    White,
    check_not_negative,
    check_positive,
    named_generator,
)
from trueterrain.simulate.pose import COMPONENTS, PoseKnots
from trueterrain.simulate.quality import PositionAccuracy, PositionErrors, Quality, check_quality

Float = npt.NDArray[np.float64]
Block = dict[str, npt.NDArray[np.float64] | npt.NDArray[np.int8]]

_DEGREE = float(np.pi / 180.0)

#: Epochs whose poses are computed at a time, so that they stay in the cache.
_CHUNK = 4096


@dataclass(frozen=True, kw_only=True)
class Navigation:
    """Settings of a post-processed GNSS/INS whose navigation point is the origin of the body.

    The defaults are those of the class of an Applanix POS LV 220: 0.02 m horizontally, 0.015
    degrees in roll and pitch, 0.025 degrees in heading (cited by the PPC data set,
    taroz/PPC-Dataset, for its reference system). Errors of the height are from two drives over one
    road, see `trueterrain.simulate.drift`. The correlation times of horizontal drift and attitude,
    and the white noise, are assumptions.
    """

    rate: float = 200.0
    "Epochs per second [Hz]."

    drift: HeightDrift = field(default_factory=GaussMarkovDrift)
    "Drift of the height: Gauss-Markov process, or a given series."

    horizontal_sd: float = 0.02
    "Standard deviation of the drift (Gauss-Markov) of east and north [m]."

    horizontal_time: float = 25.0
    "Time at which the autocorrelation of that drift is 1/e [s]."

    attitude_sd: tuple[float, float, float] = (0.014 * _DEGREE, 0.014 * _DEGREE, 0.0245 * _DEGREE)
    "Standard deviations of the drift (Gauss-Markov) of roll, pitch and yaw [rad]."

    attitude_time: float = 60.0
    "Time at which the autocorrelation of that drift is 1/e [s]."

    noise: tuple[float, float, float, float, float, float] = (
        0.001,
        0.001,
        0.001,
        0.005 * _DEGREE,
        0.005 * _DEGREE,
        0.005 * _DEGREE,
    )
    "Standard deviations of the white noise of east, north, up [m], roll, pitch and yaw [rad]."

    clock_offset: float = 0.0
    "True time less stamp, at the beginning [s]."

    clock_rate: float = 0.0
    "Growth of the clock, true time less stamp, per second [s/s]."

    quality: tuple[Quality, ...] = ()
    "States of satellite positioning in order of time; before the first it has a base station."

    accuracy: PositionAccuracy = field(default_factory=PositionAccuracy)
    "Errors of positions in each state."

    optimism: float = 1.0
    "Reported standard deviations over true ones; less than 1 is too optimistic."

    def __post_init__(self) -> None:
        """Check the values."""
        check_positive(
            rate=self.rate,
            horizontal_time=self.horizontal_time,
            attitude_time=self.attitude_time,
            optimism=self.optimism,
        )
        check_not_negative(horizontal_sd=self.horizontal_sd)
        for name, size in (("attitude_sd", 3), ("noise", 6)):
            values = getattr(self, name)
            if np.shape(values) != (size,):
                message = f"{name} must be {size} numbers, got shape {np.shape(values)}."
                raise ValueError(message)
            for component, value in zip(COMPONENTS[-size:], values, strict=True):
                check_not_negative(**{f"{name} of {component}": value})
        SimulatedClock(offset=self.clock_offset, rate=self.clock_rate)
        check_quality(self.quality)


class NavigationBlock(NamedTuple):
    """Epochs of navigation over an interval of time, and the truth."""

    recorded: Block
    """``time`` [s], ``east``, ``north``, ``up`` [m], ``roll``, ``pitch``, ``yaw`` [rad], and
    ``sd_east`` to ``sd_yaw``, each of shape (epoch,)."""

    truth: Block
    """``true_time`` [s], ``error_east`` to ``error_yaw`` (recorded less true), ``drift_up`` [m],
    the drift in the error of the height, and ``quality``, an index of
    `trueterrain.simulate.quality.STATES`, each of shape (epoch,)."""


class NavigationStream:
    """Simulator of the navigation of one pass, recorded block by block.

    The epochs are the same to the last bit for any division of the pass into blocks.

    Parameters
    ----------
    parameters : Navigation
        The instrument.
    seed : int
        Seed of all random numbers.
    pass_number : int
        Number of the pass, from 0: each has its own random numbers, and odd and even passes
        differ by a mean height (see `GaussMarkovDrift`).
    begin : float
        True time at which the pass begins [s].

    Examples
    --------
    >>> still = PoseKnots(time=np.array([0.0, 1.0]), pose=np.zeros((2, 6)), rate=np.zeros((2, 6)),
    ...                   acceleration=np.zeros((2, 6)))
    >>> recorded, truth = NavigationStream(Navigation(), seed=1).record(still, 0.0, 1.0)
    >>> recorded["time"].size, recorded["time"][1]
    (200, np.float64(0.005))
    >>> bool((recorded["up"] == truth["error_up"]).all())
    True
    """

    def __init__(
        self, parameters: Navigation, *, seed: int, pass_number: int = 0, begin: float = 0.0
    ) -> None:
        p = parameters
        name = f"pass {pass_number}"
        self.parameters = p
        self._clock = SimulatedClock(offset=p.clock_offset, rate=p.clock_rate, begin=begin)
        self._begin = self._end = begin
        self._drift = start_drift(p.drift, seed=seed, pass_number=pass_number, rate=p.rate)
        self._horizontal = GaussMarkov(
            rng=named_generator(seed, "navigation", name, "horizontal drift"),
            sd=(p.horizontal_sd, p.horizontal_sd),
            correlation_time=p.horizontal_time,
            rate=p.rate,
        )
        self._attitude = GaussMarkov(
            rng=named_generator(seed, "navigation", name, "attitude drift"),
            sd=p.attitude_sd,
            correlation_time=p.attitude_time,
            rate=p.rate,
        )
        self._noise = White(rng=named_generator(seed, "navigation", name, "noise"), sd=p.noise)
        self._quality = PositionErrors(p.quality, p.accuracy, seed, name, rate=p.rate)
        slow = [p.horizontal_sd, p.horizontal_sd, self._drift.sd, *p.attitude_sd]
        self._variance = np.square(slow) + np.square(p.noise)

    def record(self, knots: PoseKnots, begin: float, end: float) -> NavigationBlock:
        """Epochs with true times in [begin, end).

        Parameters
        ----------
        knots : PoseKnots
            True motion, from `begin` to `end` at least.
        begin, end : float
            True times [s]; `begin` must be the end of the last block.

        Returns
        -------
        NavigationBlock
            Epochs and truth. Stamps are whole multiples of 1 / rate.

        Raises
        ------
        ValueError
            If the block does not follow the last one, or the knots do not cover it.
        """
        check_next(self._end, begin, end)
        rate = self.parameters.rate
        stamp = self._clock.ticks(begin, end, rate) / rate
        true_time = self._clock.true(stamp)
        pose = _poses_at(knots, true_time)
        self._end = end
        since = true_time - self._begin
        position, variance, code = self._quality.next(since)
        drift = self._drift.next(since)
        error = self._noise.next(stamp.size)
        error[:, :2] += self._horizontal.next(stamp.size)
        error[:, 2] += drift
        error[:, :3] += position
        error[:, 3:] += self._attitude.next(stamp.size)
        true_variance = np.tile(self._variance, (stamp.size, 1))
        true_variance[:, :3] += variance[:, None]
        sd = self.parameters.optimism * np.sqrt(true_variance)
        recorded: Block = {"time": stamp}
        truth: Block = {"true_time": true_time, "drift_up": drift, "quality": code}
        for column, component in enumerate(COMPONENTS):
            recorded[component] = pose[:, column] + error[:, column]
            recorded[f"sd_{component}"] = sd[:, column].copy()
            truth[f"error_{component}"] = error[:, column].copy()
        return NavigationBlock(recorded, truth)


def _poses_at(knots: PoseKnots, time: Float) -> Float:
    pose = np.empty((time.size, len(COMPONENTS)))
    for first in range(0, time.size, _CHUNK):
        part = slice(first, first + _CHUNK)
        pose[part] = knots.at(time[part])[0]
    return pose
