"""Kalman filter and Rauch-Tung-Striebel smoother over a run, in pieces that bound memory.

The state-space model is that of the body, its accelerometers and navigation.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inertial import BodyCoordinates, InertialAccelerations, lever_height
from trueterrain.motion._inputs import NavigationInput
from trueterrain.motion._noise import InstrumentNoise

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.intp]

_PIECE = 4000  # knots whose filtered states are stored at a time

# The prior of the first pose is the first epoch with its standard deviation times this factor, so
# wide that it counts no more than that epoch; the rates are of height [m/s], roll, pitch [rad/s].
_PRIOR_FACTOR = 30.0
_PRIOR_RATE = np.array([5.0, 1.0, 1.0])
_CORRELATION_TIME = 0.1  # [s] of roll and pitch acceleration that no accelerometer measures


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpaceModel:
    """A linear model of 3 coordinates, their rates, n_p parameters and 3 drifts, at n knots."""

    step: Float
    "Time from knot to knot, shape (n - 1,) [s]."

    increment: Float
    "Known increments of coordinates and rates in a step, shape (n - 1, 6)."

    parameter_design: Float
    """Derivatives of the increments of coordinates and rates in a step by the parameters, shape
    (n - 1, 6, n_p)."""

    noise: Float
    "Two-sided density of the white acceleration of the coordinates, shape (n - 1, 3, 3)."

    random_walk: Float
    """Variance per second of the random walk of each parameter, shape (n - 1, n_p), or (1, n_p) if
    constant."""

    decay: Float
    "Factor of each drift over a step, shape (n - 1, 3)."

    drift_noise: Float
    "Variance that each drift gains in a step, shape (n - 1, 3)."

    epochs: Int
    "First measurement of each knot, and the one after its last, shape (n, 2)."

    time_after_knot: Float
    "Time from the knot to each measurement, shape (m,) [s]."

    measured: Float
    "Measurements, shape (m, 3)."

    design: Float
    "Derivatives of the measurements by the coordinates, shape (m, 3, 3)."

    variance: Float
    "Variance of the white noise of the measurements, shape (m, 3)."


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothedStates:
    """States at the knots given all measurements, with their covariances."""

    mean: Float
    "States, shape (n, 6 + n_p + 3)."

    covariance: Float
    "Covariance of the coordinates, shape (n, 3, 3)."

    drift_variance: Float
    "Variance of the drifts, shape (n, 3)."

    parameter_covariance: Float
    "Covariance of the parameters at the last knot, shape (n_p, n_p)."

    normalised_innovation_squared: Float
    "Mean square of the innovations over their variance, of each measured coordinate, shape (3,)."

    scores: Float
    """For each step and each parameter and drift, the square of the adjoint and its expectation.
    Their difference is twice the derivative of the log likelihood by the variance that the step
    adds. Shape (n - 1, n_p + 3, 2), or empty."""


def smooth_states(
    model: StateSpaceModel, state: Float, covariance: Float, *, with_scores: bool = False
) -> SmoothedStates:
    """States of a linear model at all knots, given all measurements.

    Parameters
    ----------
    model : StateSpaceModel
        Dynamics and measurements.
    state : numpy.ndarray, shape (6 + n_p + 3,)
        Mean at the first knot before any measurement.
    covariance : numpy.ndarray, shape (6 + n_p + 3, 6 + n_p + 3)
        Covariance of that state.
    with_scores : bool
        Whether to compute `SmoothedStates.scores`.

    Returns
    -------
    SmoothedStates
        States and covariances.
    """
    from trueterrain.motion import _kernels  # here, as numba takes long to import

    # The backward recursion needs all filtered states and covariances. The forward recursion stores
    # its state at the begin of each piece; the pieces are filtered a second time, last one first.
    n = model.step.size + 1
    starts = np.arange(0, n, _PIECE)
    x, p = state.copy(), covariance.copy()
    checkpoints = []
    for first in starts:
        checkpoints.append((x.copy(), p.copy()))
        _filter_piece(model, int(first), min(int(first) + _PIECE, n), x, p, None)
    size = state.size
    mean, cov, drift = np.empty((n, size)), np.empty((n, 3, 3)), np.empty((n, 3))
    adjoint, information = np.zeros(size), np.zeros((size, size))
    scores = np.empty((n - 1 if with_scores else 0, size - 6, 2))
    normalised_innovation_squared, count = np.zeros(3), 0
    for first, (x0, p0) in zip(starts[::-1], checkpoints[::-1], strict=True):
        last = min(int(first) + _PIECE, n)
        piece = _FilteredPiece.allocate(
            size, last - first, model.epochs[last - 1, 1] - model.epochs[first, 0]
        )
        _filter_piece(model, int(first), last, x0, p0, piece)
        if last == n:
            end = piece.covariances[-1][6:-3, 6:-3].copy()
        _kernels.smooth_backward(
            int(first),
            last,
            adjoint,
            information,
            model.step,
            model.parameter_design,
            model.decay,
            model.epochs,
            model.time_after_knot,
            model.design,
            piece.states,
            piece.covariances,
            piece.gains,
            piece.innovations,
            mean,
            cov,
            drift,
            scores,
        )
        normalised_innovation_squared += (
            piece.innovations[:, :, 0] ** 2 / piece.innovations[:, :, 1]
        ).sum(axis=0)
        count += len(piece.innovations)
    return SmoothedStates(
        mean=mean,
        covariance=cov,
        drift_variance=drift,
        parameter_covariance=end,
        normalised_innovation_squared=normalised_innovation_squared / max(count, 1),
        scores=scores,
    )


@dataclass(frozen=True, eq=False)
class _FilteredPiece:
    """Filtered states, covariances, gains and innovations of some knots."""

    states: Float
    covariances: Float
    gains: Float
    innovations: Float

    @classmethod
    def allocate(cls, size: int, knots: int, measurements: int) -> "_FilteredPiece":
        return cls(
            np.empty((knots, size)),
            np.empty((knots, size, size)),
            np.empty((measurements, 3, size)),
            np.empty((measurements, 3, 2)),
        )


def _filter_piece(
    m: StateSpaceModel, first: int, last: int, x: Float, p: Float, piece: _FilteredPiece | None
) -> None:
    """Filter from knot `first` to before knot `last`; x and p are updated in place."""
    from trueterrain.motion import _kernels

    piece = _FilteredPiece.allocate(x.size, 0, 0) if piece is None else piece
    _kernels.filter_forward(
        first,
        last,
        x,
        p,
        m.step,
        m.increment,
        m.parameter_design,
        m.noise,
        m.random_walk,
        m.decay,
        m.drift_noise,
        m.epochs,
        m.time_after_knot,
        m.measured,
        m.design,
        m.variance,
        piece.states,
        piece.covariances,
        piece.gains,
        piece.innovations,
    )


@dataclass(frozen=True, kw_only=True)
class SensorErrors:
    """Standard deviations of the systematic errors of the accelerometers."""

    bias_sd: float
    "Bias [m/s^2]."

    bias_walk: float
    "Random walk of the bias after 1 s [m/s^2/sqrt(s)]."

    scale_sd: float
    "Scale error [1]."

    delay_sd: float
    "Error of the clock [s]."


@dataclass(frozen=True, kw_only=True, eq=False)
class SmootherResult:
    """Coordinates of the body, drift of navigation and errors of the accelerometers."""

    coordinates: BodyCoordinates
    "Height of the centre of the sensors, roll and pitch."

    drift: Float
    "Drift of up, roll and pitch of navigation, shape (n, 3) [m, rad, rad]."

    drift_sd: Float
    "Standard deviation of the drift, shape (n, 3)."

    bias: Float
    "Biases of the accelerometers at the last knot, shape (sensor,) [m/s^2]."

    scale: Float
    "Scale errors of the accelerometers, shape (sensor,) [1]."

    delay: tuple[float, float]
    "Delay of the accelerometers beyond the stated one, and its standard deviation [s]."

    normalised_innovation_squared: Float
    "Mean square of the innovations over their variance, of up, roll and pitch."


def smooth_coordinates(
    inertial: InertialAccelerations,
    navigation: NavigationInput,
    nominal: Float,
    angular_acceleration: Float,
    noise: InstrumentNoise,
    drift_sd: Float,
    sensors: SensorErrors,
) -> SmootherResult:
    """Coordinates at the knots by the Rauch-Tung-Striebel smoother.

    Parameters
    ----------
    inertial : InertialAccelerations
        Accelerations.
    navigation : NavigationInput
        Epochs.
    nominal : numpy.ndarray, shape (epoch, 2)
        Roll and pitch at which levers are linearised [rad].
    angular_acceleration : numpy.ndarray, shape (2,)
        Root mean square of roll and pitch acceleration, used if no sensor measures it [rad/s^2].
    noise : InstrumentNoise
        Noise of the instruments.
    drift_sd : numpy.ndarray, shape (n, 3)
        Standard deviation of the drifts at the knots [m, rad, rad].
    sensors : SensorErrors
        Systematic errors of the accelerometers.
    """
    model = _state_model(
        inertial, navigation, nominal, angular_acceleration, noise, drift_sd, sensors
    )
    # state: 3 coordinates, 3 rates, biases, scale errors, delay, 3 drifts
    count = inertial.weights.shape[1]
    size = 6 + 2 * count + 1 + 3
    prior = np.empty(size)
    prior[:3] = _PRIOR_FACTOR * np.hypot(drift_sd[0], noise.white)
    prior[0] += _PRIOR_FACTOR * float(np.hypot(*inertial.centre[:2])) * prior[1:3].max()
    prior[3:6] = _PRIOR_RATE
    prior[6 : 6 + count] = sensors.bias_sd
    prior[6 + count : 6 + 2 * count] = sensors.scale_sd
    prior[6 + 2 * count] = sensors.delay_sd
    prior[-3:] = drift_sd[0]
    state = np.zeros(size)
    state[:3] = np.linalg.solve(model.design[0], model.measured[0])
    states = smooth_states(model, state, np.diag(prior**2))
    return _smoother_result(states, count)


def _smoother_result(s: SmoothedStates, count: int) -> SmootherResult:
    delay = s.mean[-1, 6 + 2 * count], np.sqrt(max(s.parameter_covariance[-1, -1], 0.0))
    return SmootherResult(
        coordinates=BodyCoordinates(
            value=s.mean[:, :3].copy(),
            rate=s.mean[:, 3:6].copy(),
            covariance=_positive_definite(s.covariance),
        ),
        drift=s.mean[:, -3:].copy(),
        drift_sd=np.sqrt(np.maximum(s.drift_variance, 0.0)),
        bias=s.mean[-1, 6 : 6 + count].copy(),
        scale=s.mean[-1, 6 + count : 6 + 2 * count].copy(),
        delay=(float(delay[0]), float(delay[1])),
        normalised_innovation_squared=s.normalised_innovation_squared,
    )


def _positive_definite(covariance: Float) -> Float:
    """Covariances (n, 3, 3) with eigenvalues that round-off made negative set to a tiny value."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + np.swapaxes(covariance, 1, 2)))
    bad = values[:, 0] <= 0
    if bad.any():
        raised = np.maximum(values[bad], 1e-18)[:, None, :]
        covariance[bad] = (vectors[bad] * raised) @ np.swapaxes(vectors[bad], 1, 2)
    return covariance


def _state_model(
    inertial: InertialAccelerations,
    navigation: NavigationInput,
    nominal: Float,
    angular_acceleration: Float,
    noise: InstrumentNoise,
    drift_sd: Float,
    sensors: SensorErrors,
) -> StateSpaceModel:
    time = inertial.time
    step = np.diff(time)
    once, twice = inertial.integrals(inertial.acceleration)
    count = inertial.weights.shape[1]
    walk = np.zeros((1, 2 * count + 1))
    walk[0, :count] = sensors.bias_walk**2
    # a drift whose standard deviation falls from knot to knot must not gain negative variance
    decay = np.exp(-step[:, None] / np.array(noise.drift_time))
    decay = np.minimum(decay, drift_sd[1:] / drift_sd[:-1])
    nearest = _nearest_knots(time, navigation.time)
    order = np.arange(time.size)
    time_after_knot = navigation.time - time[nearest]
    design, measured = _measurement_design(navigation, nominal, inertial.centre)
    # position and rate of the knot are extrapolated to the epoch; acceleration adds t^2 / 2
    curvature = 0.5 * time_after_knot[:, None] ** 2
    curvature = curvature * inertial.acceleration[inertial.knot_index[nearest]]
    measured -= np.einsum("mij,mj->mi", design, curvature)
    return StateSpaceModel(
        step=step,
        increment=np.concatenate([twice, once], axis=1),
        parameter_design=_parameter_design(inertial, once, step),
        noise=_acceleration_noise(inertial, noise, angular_acceleration),
        random_walk=walk,
        decay=decay,
        drift_noise=np.maximum(drift_sd[1:] ** 2 - (decay * drift_sd[:-1]) ** 2, 0.0),
        epochs=np.stack(
            [np.searchsorted(nearest, order), np.searchsorted(nearest, order, side="right")], axis=1
        ),
        time_after_knot=time_after_knot,
        measured=measured,
        design=design,
        variance=np.tile(np.square(noise.white), (navigation.time.size, 1)),
    )


def _parameter_design(inertial: InertialAccelerations, once: Float, step: Float) -> Float:
    """Derivatives of the increments by biases, scale errors and delay, (n - 1, 6, parameter)."""
    count = inertial.weights.shape[1]
    design = np.zeros((step.size, 6, 2 * count + 1))
    coordinate, rate = design[:, :3], design[:, 3:]
    # a bias b makes the acceleration too large by b: the increments are reduced by its integrals
    weights = -inertial.weights
    rate[:, :, :count] = weights * step[:, None, None]
    coordinate[:, :, :count] = weights * 0.5 * step[:, None, None] ** 2
    # a scale error acts on the readings less their mean; its effect on the mean is a bias
    force, force_twice = inertial.integrals(inertial.per_sensor)
    rate[:, :, count:-1] = weights * force[:, None, :]
    coordinate[:, :, count:-1] = weights * force_twice[:, None, :]
    # a delay d shifts the acceleration: a(t + d) = a(t) + d a'(t), integrated once and twice
    at_knots = inertial.acceleration[inertial.knot_index]
    rate[:, :, -1] = np.diff(at_knots, axis=0)
    coordinate[:, :, -1] = once - step[:, None] * at_knots[:-1]
    missing = np.maximum.reduceat(
        inertial.missing[:-1] | inertial.missing[1:], inertial.knot_index[:-1]
    )
    design[missing] = 0.0
    return design


def _acceleration_noise(
    inertial: InertialAccelerations, noise: InstrumentNoise, angular_acceleration: Float
) -> Float:
    """Two-sided density of the error of the accelerations, shape (n - 1, 3, 3)."""
    density = 0.5 * np.square(noise.accelerometer)
    white = (inertial.weights * density) @ inertial.weights.T
    if not inertial.observes_attitude:
        # all of the angular acceleration is unknown: variance times correlation time
        white[[1, 2], [1, 2]] += np.maximum(angular_acceleration, 1e-3) ** 2 * _CORRELATION_TIME
    length = np.diff(inertial.sample_time)[:, None]
    starts = inertial.knot_index[:-1]
    missing = np.add.reduceat(inertial.missing_density * length, starts, axis=0)
    missing /= np.diff(inertial.time)[:, None]
    whole = np.tile(white, (starts.size, 1, 1))
    whole[:, [0, 1, 2], [0, 1, 2]] += missing
    return whole


def _nearest_knots(knots: Float, time: Float) -> npt.NDArray[np.intp]:
    right = np.clip(np.searchsorted(knots, time), 1, knots.size - 1)
    return np.asarray(right - (time - knots[right - 1] < knots[right] - time))


def _measurement_design(
    navigation: NavigationInput, nominal: Float, centre: Float
) -> tuple[Float, Float]:
    """Derivatives (epoch, 3, 3) of up, roll and pitch by the coordinates, and the measurements.

    up = height of the centre - lever(roll, pitch), linearised at the nominal attitude; its constant
    terms are added to the measurements.
    """
    roll, pitch = nominal.T
    lever, by_roll, by_pitch = lever_height(roll, pitch, centre)
    design = np.tile(np.eye(3), (roll.size, 1, 1))
    design[:, 0, 1], design[:, 0, 2] = -by_roll, -by_pitch
    measured = navigation.pose[:, 2:5].copy()
    measured[:, 0] += lever - by_roll * roll - by_pitch * pitch
    return design, measured
