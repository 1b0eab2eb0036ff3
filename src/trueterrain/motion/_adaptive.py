"""East, north and yaw of a vehicle, smoothed as far as its motion allows.

The horizontal error of navigation drifts by millimetres within seconds. The vehicle moves as well,
but differently: it has mass and its jerk is limited, while the drift is a random walk over seconds.
The trajectory is therefore estimated by a Kalman filter and smoother for

    navigation = position of the vehicle + drift (Gauss-Markov) + white noise,

where white jerk moves the vehicle along and across its heading, so that a curve at a steady speed
needs none, and about its vertical axis. The spectral density of each jerk, from second to second,
and the correlation time of the drift are those of maximum likelihood: a variance is right if the
squared adjoint (score) of what it drives equals its expectation. Most seconds of most drives need
hardly any jerk and are smoothed over long times; where the vehicle brakes, turns or sways, the
smoother follows.

Densities q of jerk have the prior 1 / q of an unknown scale (Jeffreys): each power of ten is
equally likely. Without it, chance would give half of all quiet seconds some jerk.

Sources: MacKay (1992), "Bayesian interpolation", for the iteration; Zhou et al. (2019), "MM
algorithms for variance components models", for its slower form that never decreases the likelihood.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inputs import (
    CubicSeries,
    NavigationInput,
    fit_polynomials,
    resample_evenly,
)
from trueterrain.motion._noise import fit_white_and_random_walk
from trueterrain.motion._smoother import SmoothedStates, StateSpaceModel, smooth_states

Float = npt.NDArray[np.float64]

_HORIZONTAL = [0, 1, 5]  # east, north, yaw among the components of navigation
_MIN_WHITE = np.array([1e-5, 1e-5, 1e-6])  # [m, m, rad] standard deviation of white noise
_INITIAL_DRIFT_TIME = np.array([25.0, 25.0, 60.0])  # [s] correlation times
_DRIFT_TIMES = 0.1, 1e5  # [s] their bounds

# Two-sided densities of jerk along, across [m^2/s^5] and about the vertical axis [rad^2/s^5]:
# initial values (a jerk of 5 m/s^3 for 0.4 s); minimum, below that of any vehicle; maximum: full
# braking at once has 25 m^2/s^5, a wrong epoch much more.
_INITIAL_JERK = np.array([10.0, 10.0, 1.0])
_MIN_JERK = np.array([1e-6, 1e-6, 1e-8])
_MAX_JERK = np.array([100.0, 100.0, 10.0])
_JERK_STEP = 1.0  # [s] between estimated densities, which are interpolated linearly
_MIN_EPOCHS = 9.5  # within that time, to observe fast motion
_MEAN_STEP = 0.02  # [s] over which epochs are averaged for the estimation
_MAX_STEP = 0.05  # [s] from knot to knot
_ITERATIONS = 15  # after which changes do not matter

_LONG_GAP = 1.0  # [s] of a gap that separates two parts
_SHORT_WINDOW, _LONG_WINDOW = 0.2, 1.0  # [s] of fits: of short parts, and of the initial motion
_PRIOR_FACTOR = 30.0  # standard deviations of the first position
_PRIOR_RATE = np.array([2.0, 2.0, 0.5])  # [m/s, m/s, rad/s] around the rates of the fit
_PRIOR_ACCELERATION = np.array([5.0, 5.0, 2.0])  # [m/s^2, m/s^2, rad/s^2] around 0


class AdaptiveTrajectory(CubicSeries):
    """East, north and yaw, smoothed as far as the motion of the vehicle allows.

    Long gaps are bridged by the cubic through positions and rates at both sides. Parts shorter than
    a second, and navigation slower than 10 Hz, are smoothed in a window of 0.2 s.

    Smoothing does not reduce the stated uncertainty: slow drift remains, and only its fast part
    shows how slow it is. The standard deviations of navigation stay those of the trajectory.

    Parameters
    ----------
    navigation : NavigationInput
        Epochs.
    sd : numpy.ndarray, shape (epoch, 6)
        Standard deviations of navigation, white noise and drift together [m, rad]; the white noise
        is estimated.

    Examples
    --------
    >>> time = np.arange(0.0, 20.0, 0.005)
    >>> pose = np.zeros((time.size, 6))
    >>> pose[:, 0] = 10.0 * time + 0.001 * np.random.default_rng(1).standard_normal(time.size)
    >>> navigation = NavigationInput(time=time, pose=pose, sd=pose, step=0.005, gaps=(), dropped=0)
    >>> smooth = AdaptiveTrajectory(navigation, np.full((time.size, 6), 0.02))
    >>> bool(np.abs(smooth.rate(time)[:, 0] - 10.0).max() < 1e-3)
    True
    """

    def __init__(self, navigation: NavigationInput, sd: Float) -> None:
        parts = _continuous_parts(navigation)
        white = _white_noise_sd(navigation, parts)
        smoothed = [
            _smooth_part(
                navigation.time[part],
                navigation.pose[part][:, _HORIZONTAL],
                sd[part][:, _HORIZONTAL],
                white,
            )
            for part in parts
        ]
        time, values, rates = map(np.concatenate, zip(*smoothed, strict=True))
        super().__init__(time, values, rates)


def _continuous_parts(navigation: NavigationInput) -> list[npt.NDArray[np.intp]]:
    """Indices of the epochs between long gaps."""
    long = np.flatnonzero(np.diff(navigation.time) > max(_LONG_GAP, 1.5 * navigation.step)) + 1
    return np.split(np.arange(navigation.time.size), long)


def _white_noise_sd(navigation: NavigationInput, parts: list[npt.NDArray[np.intp]]) -> Float:
    """Standard deviations of the white noise of east, north and yaw, shape (3,)."""
    rough = []
    for part in parts:
        grid, series = resample_evenly(navigation.time[part], navigation.pose[part][:, _HORIZONTAL])
        rough.append(series - fit_polynomials(series, grid, _LONG_WINDOW)[0])
    rate = 1.0 / navigation.step
    white = [fit_white_and_random_walk(one, rate)[0] for one in np.concatenate(rough).T]
    return np.asarray(np.maximum(white, _MIN_WHITE))


def _smooth_part(time: Float, pose: Float, sd: Float, white: Float) -> tuple[Float, Float, Float]:
    """Times, values and rates of one part."""
    grid, series = resample_evenly(time, pose)
    if time[-1] - time[0] < _JERK_STEP or _MIN_EPOCHS * np.median(np.diff(time)) > _JERK_STEP:
        values, rates, _ = fit_polynomials(series, grid, _SHORT_WINDOW)
        return grid, values, rates
    slow, rate, _ = fit_polynomials(series, grid, _LONG_WINDOW)
    epochs = _Epochs(
        time=time,
        pose=pose - pose[0],
        variance=np.tile(white**2, (time.size, 1)),
        drift_sd=np.sqrt(np.maximum(np.median(sd, axis=0) ** 2 - white**2, (0.1 * white) ** 2)),
        heading=slow[:, 2],
        rate=rate[0],
    )
    knots, states = _smooth_epochs(epochs, _estimate_motion_model(_average_epochs(epochs)))
    return knots, states.mean[:, :3] + pose[0], states.mean[:, 3:6]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Epochs:
    """Epochs of a part, or means of some."""

    time: Float
    "Shape (m,) [s]."

    pose: Float
    "East, north and yaw less those of the first epoch, shape (m, 3) [m, m, rad]."

    variance: Float
    "Variance of their white noise, shape (m, 3)."

    drift_sd: Float
    """Standard deviation of their drift, shape (3,). It may change when satellites are lost; the
    random walk within seconds, which inertial sensors determine, does not."""

    heading: Float
    "Approximate heading, shape (m,) [rad]."

    rate: Float
    "Approximate rates of the three at the first epoch, shape (3,)."


@dataclass(frozen=True, kw_only=True, eq=False)
class _MotionModel:
    """Jerk of the vehicle over time, and correlation times of the drift."""

    time: Float
    "Evenly spaced, shape (k,) [s]."

    jerk: Float
    "Density of jerk along, across and about the vertical axis at these times, shape (k, 3)."

    drift_time: Float
    "Correlation times of the drift of east, north and yaw [s]."

    def at(self, time: Float) -> Float:
        """Densities at any times, interpolated linearly, shape (n, 3)."""
        index, fraction = self._locate(time)
        here = self.jerk[index]
        return np.asarray(here + fraction[:, None] * (self.jerk[index + 1] - here))

    def sums(self, time: Float, values: Float) -> Float:
        """Sums of values (n, columns) with the weights of the interpolation; (k, columns)."""
        index, fraction = self._locate(time)
        sums = np.zeros((self.time.size, values.shape[1]))
        for column, one in enumerate(values.T):
            for next_, weight in enumerate((1.0 - fraction, fraction)):
                sums[:, column] += np.bincount(index + next_, weight * one, self.time.size)
        return sums

    def _locate(self, time: Float) -> tuple[npt.NDArray[np.intp], Float]:
        """Interval of each time, and its position within it from 0 to 1."""
        x = (time - self.time[0]) / (self.time[1] - self.time[0])
        index = np.clip(x.astype(int), 0, self.time.size - 2)
        return index, x - index


def _average_epochs(epochs: _Epochs) -> _Epochs:
    """Means over equal spans of time, which the estimation uses for speed."""
    since = epochs.time - epochs.time[0]
    step = float(np.median(np.diff(since)))
    width = step * max(round(_MEAN_STEP / step), 1)
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


def _estimate_motion_model(epochs: _Epochs) -> _MotionModel:
    """Jerk and correlation times of maximum posterior likelihood for a part."""
    begin, end = epochs.time[[0, -1]]
    time = np.linspace(begin, end, max(int((end - begin) / _JERK_STEP), 1) + 1)
    motion = _MotionModel(
        time=time, jerk=np.tile(_INITIAL_JERK, (time.size, 1)), drift_time=_INITIAL_DRIFT_TIME
    )
    for _ in range(_ITERATIONS):
        # fixed point: at the maximum the squared score of each variance equals its expectation
        # (plus twice the derivative of the logarithm of the prior), so each variance is multiplied
        # by their ratio
        knots, states = _smooth_epochs(epochs, motion, with_scores=True)
        length = np.diff(knots)[:, None]
        midpoint = 0.5 * (knots[1:] + knots[:-1])
        score, expected = states.scores[:, :, 0] * length, states.scores[:, :, 1] * length
        prior = 2.0 / (motion.jerk + _MIN_JERK)
        ratio = motion.sums(midpoint, score[:, :3]) / (
            motion.sums(midpoint, expected[:, :3]) + prior
        )
        drift = np.stack([score[:, 3:].sum(axis=0), expected[:, 3:].sum(axis=0)])
        drift[:, :2] = drift[:, :2].sum(axis=1, keepdims=True)  # one value for east and north
        faster = np.maximum(drift[0] / drift[1], 1e-3)  # constant positions have no score
        motion = replace(
            motion,
            jerk=np.clip(motion.jerk * ratio, _MIN_JERK, _MAX_JERK),
            drift_time=np.clip(motion.drift_time / faster, *_DRIFT_TIMES),
        )
    return motion


def _smooth_epochs(
    epochs: _Epochs, motion: _MotionModel, *, with_scores: bool = False
) -> tuple[Float, SmoothedStates]:
    """Knots, and the smoothed states at them."""
    knots, epochs_of_knots = _smoother_knots(epochs.time)
    step = np.diff(knots)
    midpoint = 0.5 * (knots[1:] + knots[:-1])
    # longitudinal and lateral accelerations are parameters of the model, each a random walk (white
    # jerk); the heading rotates them to east and north
    rotation = np.zeros((step.size, 3, 3))
    heading = np.interp(midpoint, epochs.time, epochs.heading)
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(heading)
    rotation[:, 1, 0] = np.sin(heading)
    rotation[:, 0, 1] = -rotation[:, 1, 0]
    rotation[:, 2, 2] = 1.0
    h = step[:, None, None]
    sd = epochs.drift_sd
    decay = np.exp(-step[:, None] / motion.drift_time)
    model = StateSpaceModel(
        step=step,
        increment=np.zeros((step.size, 6)),
        parameter_design=np.concatenate([0.5 * h**2 * rotation, h * rotation], axis=1),
        noise=np.zeros((step.size, 3, 3)),
        random_walk=motion.at(midpoint),
        decay=decay,
        drift_noise=sd**2 * (1.0 - decay**2),
        epochs=epochs_of_knots,
        time_after_knot=np.zeros(epochs.time.size),
        measured=epochs.pose,
        design=np.tile(np.eye(3), (epochs.time.size, 1, 1)),
        variance=epochs.variance,
    )
    first = np.hypot(sd, np.sqrt(epochs.variance[0]))
    prior = np.concatenate([_PRIOR_FACTOR * first, _PRIOR_RATE, _PRIOR_ACCELERATION, sd])
    state = np.zeros(prior.size)
    state[:3], state[3:6] = epochs.pose[0], epochs.rate
    return knots, smooth_states(model, state, np.diag(prior**2), with_scores=with_scores)


def _smoother_knots(time: Float) -> tuple[Float, npt.NDArray[np.intp]]:
    """Knots at the epochs and between distant ones, and the range of epochs of each knot."""
    counts = np.maximum(np.ceil(np.diff(time) / _MAX_STEP - 1e-6).astype(int), 1)
    at = np.concatenate([[0], np.cumsum(counts)])
    index = np.arange(at[-1] + 1)
    knots = np.interp(index, at, time)
    sides = [np.searchsorted(at, index, side) for side in ("left", "right")]
    return knots, np.stack(sides, axis=1)
