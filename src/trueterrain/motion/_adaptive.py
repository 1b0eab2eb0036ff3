"""East, north and yaw of a vehicle, smoothed as far as its own motion allows.

Navigation drifts: within seconds, its horizontal error wanders by millimetres. So does a vehicle
that steers and brakes, but otherwise: a body has mass, and its jerk is limited, while drift wanders
like a random walk. So the way is what a Kalman filter and smoother find for

    navigation = place of the vehicle + drift (Gauss-Markov) + white noise,

where white jerk moves the vehicle: along and across its heading, so that a curve at a steady speed
needs none, and about its vertical axis. How strong each jerk is, from second to second, and how
fast drift wanders, are those for which the run itself is most likely: a variance is right if
measurements pull at what it lets move as hard as they do by chance. Most seconds of most drives
then need next to no jerk, and are smoothed over long times; where the vehicle brakes, turns or
sways, the smoother follows.

Densities q of jerk have the prior 1 / q of an unknown scale (Jeffreys): each power of ten is as
likely as the next. Without it, chance gives half of all quiet seconds some jerk.

Sources: MacKay (1992), "Bayesian interpolation", for the iteration; Zhou et al. (2019), "MM
algorithms for variance components models", for its slower form that never goes down.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inputs import NavigationInput
from trueterrain.motion._noise import white_and_wander
from trueterrain.motion._smoother import SmoothedStates, StateSpaceModel, smooth_states
from trueterrain.motion._way import CubicSeries, fit_polynomials, resample_evenly

Float = npt.NDArray[np.float64]

_WAY = [0, 1, 5]  # east, north, yaw among the components of navigation
_LEAST_WHITE = np.array([1e-5, 1e-5, 1e-6])  # [m, m, rad] white noise that is believed
_DRIFT_TIME = np.array([25.0, 25.0, 60.0])  # [s] of correlation, at which the search begins
_DRIFT_TIMES = 0.1, 1e5  # [s] that are believed

# Two-sided densities of jerk along, across [m^2/s^5] and about the vertical axis [rad^2/s^5]: where
# the search begins (a jerk of 5 m/s^3 that lasts 0.4 s); the least, less than that of any vehicle;
# the most: full braking at once has 25 m^2/s^5, an epoch that is wrong much more.
_BEGIN = np.array([10.0, 10.0, 1.0])
_LEAST = np.array([1e-6, 1e-6, 1e-8])
_MOST = np.array([100.0, 100.0, 10.0])
_APART = 1.0  # [s] from each density that is sought to the next; between them they are linear
_FEWEST = 9.5  # epochs within that time, without which nothing is known of quick motion
_MEAN = 0.02  # [s] over which epochs are averaged for the search
_STEP = 0.05  # [s] longest from knot to knot
_ROUNDS = 15  # of the search, after which nothing changes that matters

_LONG = 1.0  # [s] of a gap that parts what is before it from what is behind
_WINDOWS = 0.2, 1.0  # [s] of fits: of short parts, and of what the vehicle does at most
_FIRST = 30.0  # standard deviations of its own within which the first place is thought to lie
_FIRST_RATE = np.array([2.0, 2.0, 0.5])  # [m/s, rad/s] how sure the fit's first rates are
_FIRST_ACCELERATION = np.array([5.0, 5.0, 2.0])  # [m/s^2, rad/s^2] that nothing is known of


class AdaptiveTrajectory(CubicSeries):
    """East, north and yaw, smoothed as far as the motion of the vehicle allows.

    Long gaps are bridged by the cubic through places and rates at both sides. Parts of less than a
    second, and navigation of less than 10 Hz, are smoothed in a window of 0.2 s.

    What is smooth is not more certain: slow drift stays, and how slow it is only its quick part
    tells. So the standard deviations of navigation are still those of its way.

    Parameters
    ----------
    navigation : NavigationInput
        Epochs.
    sd : numpy.ndarray, shape (epoch, 6)
        Standard deviations of navigation: of white noise, which is measured, and of drift [m, rad].

    Examples
    --------
    >>> time = np.arange(0.0, 20.0, 0.005)
    >>> pose = np.zeros((time.size, 6))
    >>> pose[:, 0] = 10.0 * time + 0.001 * np.random.default_rng(1).standard_normal(time.size)
    >>> navigation = NavigationInput(time=time, pose=pose, sd=pose, step=0.005, gaps=(), dropped=0)
    >>> way = AdaptiveWay(navigation, np.full((time.size, 6), 0.02))
    >>> bool(np.abs(way.rate(time)[:, 0] - 10.0).max() < 1e-3)
    True
    """

    def __init__(self, navigation: NavigationInput, sd: Float) -> None:
        parts = _continuous_parts(navigation)
        white = _white_noise_sd(navigation, parts)
        found = [
            _smooth_part(navigation.time[at], navigation.pose[at][:, _WAY], sd[at][:, _WAY], white)
            for at in parts
        ]
        time, values, rates = map(np.concatenate, zip(*found, strict=True))
        super().__init__(time, values, rates)


def _continuous_parts(navigation: NavigationInput) -> list[npt.NDArray[np.intp]]:
    """Indices of the epochs between long gaps."""
    long = np.flatnonzero(np.diff(navigation.time) > max(_LONG, 1.5 * navigation.step)) + 1
    return np.split(np.arange(navigation.time.size), long)


def _white_noise_sd(navigation: NavigationInput, parts: list[npt.NDArray[np.intp]]) -> Float:
    """Standard deviations of the white noise of the three, shape (3,)."""
    rough = []
    for part in parts:
        grid, series = resample_evenly(navigation.time[part], navigation.pose[part][:, _WAY])
        rough.append(series - fit_polynomials(series, grid, _WINDOWS[1])[0])
    rate = 1.0 / navigation.step
    white = [white_and_wander(one, rate)[0] for one in np.concatenate(rough).T]
    return np.asarray(np.maximum(white, _LEAST_WHITE))


def _smooth_part(time: Float, pose: Float, sd: Float, white: Float) -> tuple[Float, Float, Float]:
    """Times, values and rates of one part."""
    grid, series = resample_evenly(time, pose)
    if time[-1] - time[0] < _APART or _FEWEST * np.median(np.diff(time)) > _APART:
        values, rates, _ = fit_polynomials(series, grid, _WINDOWS[0])
        return grid, values, rates
    slow, rate, _ = fit_polynomials(series, grid, _WINDOWS[1])
    epochs = _Epochs(
        time=time,
        pose=pose - pose[0],
        variance=np.tile(white**2, (time.size, 1)),
        drift_sd=np.sqrt(np.maximum(np.median(sd, axis=0) ** 2 - white**2, (0.1 * white) ** 2)),
        heading=slow[:, 2],
        rate=rate[0],
    )
    knots, found = _smooth_epochs(epochs, _most_likely(_epoch_means(epochs)))
    return knots, found.mean[:, :3] + pose[0], found.mean[:, 3:6]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Epochs:
    """Epochs of a part, or means of some."""

    time: Float
    "Shape (m,) [s]."

    pose: Float
    "East, north and yaw, from 0 on, shape (m, 3) [m, m, rad]."

    variance: Float
    "Of their white noise, shape (m, 3)."

    drift_sd: Float
    """Standard deviation of their drift, shape (3,). It may change, when satellites are lost, but
    not how the drift wanders within seconds, which inertial sensors keep."""

    heading: Float
    "Roughly, shape (m,) [rad]."

    rate: Float
    "Rates of the three at the begin, roughly, shape (3,)."


@dataclass(frozen=True, kw_only=True, eq=False)
class _MotionModel:
    """How vehicle and drift move."""

    time: Float
    "Evenly spaced, shape (k,) [s]."

    jerk: Float
    "Its density along, across and about the vertical axis at these times, shape (k, 3)."

    drift_time: Float
    "Times of correlation of the drift of east, north and yaw [s]."

    def at(self, time: Float) -> Float:
        """Densities at any times, shape (n, 3)."""
        index, share = self._shares(time)
        here = self.jerk[index]
        return np.asarray(here + share[:, None] * (self.jerk[index + 1] - here))

    def sums(self, time: Float, values: Float) -> Float:
        """Sums of values (n, columns), each with the weights that it has in `at`; (k, columns)."""
        index, share = self._shares(time)
        sums = np.zeros((self.time.size, values.shape[1]))
        for column, one in enumerate(values.T):
            for next_, weight in enumerate((1.0 - share, share)):
                sums[:, column] += np.bincount(index + next_, weight * one, self.time.size)
        return sums

    def _shares(self, time: Float) -> tuple[npt.NDArray[np.intp], Float]:
        x = (time - self.time[0]) / (self.time[1] - self.time[0])
        index = np.clip(x.astype(int), 0, self.time.size - 2)
        return index, x - index


def _epoch_means(epochs: _Epochs) -> _Epochs:
    """Means over equal spans of time."""
    since = epochs.time - epochs.time[0]
    step = float(np.median(np.diff(since)))
    width = step * max(round(_MEAN / step), 1)
    starts = np.flatnonzero(np.diff(np.floor(since / width + 1e-6), prepend=-1.0))
    count = np.diff(np.append(starts, since.size))

    def mean(values: Float) -> Float:
        return np.asarray((np.add.reduceat(values, starts).T / count).T, dtype=float)

    return replace(
        epochs,
        time=mean(epochs.time),
        pose=mean(epochs.pose),
        heading=mean(epochs.heading),
        variance=(mean(epochs.variance).T / count).T,
    )


def _most_likely(epochs: _Epochs) -> _MotionModel:
    """Intensities for which a part is most likely."""
    begin, end = epochs.time[[0, -1]]
    time = np.linspace(begin, end, max(int((end - begin) / _APART), 1) + 1)
    motion = _MotionModel(time=time, jerk=np.tile(_BEGIN, (time.size, 1)), drift_time=_DRIFT_TIME)
    for _ in range(_ROUNDS):
        knots, found = _smooth_epochs(epochs, motion, pulls=True)
        length = np.diff(knots)[:, None]
        middle = 0.5 * (knots[1:] + knots[:-1])
        pull, chance = found.pull[:, :, 0] * length, found.pull[:, :, 1] * length
        prior = 2.0 / (motion.jerk + _LEAST)  # twice the derivative of its logarithm
        ratio = motion.sums(middle, pull[:, :3]) / (motion.sums(middle, chance[:, :3]) + prior)
        drift = np.stack([pull[:, 3:].sum(axis=0), chance[:, 3:].sum(axis=0)])
        drift[:, :2] = drift[:, :2].sum(axis=1, keepdims=True)  # of east and north alike
        faster = np.maximum(drift[0] / drift[1], 1e-3)  # nothing pulls at what is the same always
        motion = replace(
            motion,
            jerk=np.clip(motion.jerk * ratio, _LEAST, _MOST),
            drift_time=np.clip(motion.drift_time / faster, *_DRIFT_TIMES),
        )
    return motion


def _smooth_epochs(
    epochs: _Epochs, motion: _MotionModel, *, pulls: bool = False
) -> tuple[Float, SmoothedStates]:
    """Knots, and what the smoother finds at them."""
    knots, seen = _smoother_knots(epochs.time)
    step = np.diff(knots)
    middle = 0.5 * (knots[1:] + knots[:-1])
    # along and across accelerations are parameters that walk at random, turned to east and north
    turn = np.zeros((step.size, 3, 3))
    heading = np.interp(middle, epochs.time, epochs.heading)
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(heading)
    turn[:, 1, 0] = np.sin(heading)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    sd = epochs.drift_sd
    decay = np.exp(-step[:, None] / motion.drift_time)
    model = StateSpaceModel(
        step=step,
        known=np.zeros((step.size, 6)),
        into_coordinate=0.5 * step[:, None, None] ** 2 * turn,
        into_rate=step[:, None, None] * turn,
        noise=np.zeros((step.size, 3, 3)),
        walk=motion.at(middle),
        decay=decay,
        drift_noise=sd**2 * (1.0 - decay**2),
        seen=seen,
        before=np.zeros(epochs.time.size),
        measured=epochs.pose,
        design=np.tile(np.eye(3), (epochs.time.size, 1, 1)),
        variance=epochs.variance,
    )
    first = np.hypot(sd, np.sqrt(epochs.variance[0]))
    spread = np.concatenate([_FIRST * first, _FIRST_RATE, _FIRST_ACCELERATION, sd])
    state = np.zeros(spread.size)
    state[:3], state[3:6] = epochs.pose[0], epochs.rate
    return knots, smooth_states(model, state, np.diag(spread**2), pulls=pulls)


def _smoother_knots(time: Float) -> tuple[Float, npt.NDArray[np.intp]]:
    """Times of the epochs and between those that are far apart, and which epochs each one sees."""
    counts = np.maximum(np.ceil(np.diff(time) / _STEP - 1e-6).astype(int), 1)
    at = np.concatenate([[0], np.cumsum(counts)])
    index = np.arange(at[-1] + 1)
    knots = np.interp(index, at, time)
    sides = [np.searchsorted(at, index, side) for side in ("left", "right")]
    return knots, np.stack(sides, axis=1)
