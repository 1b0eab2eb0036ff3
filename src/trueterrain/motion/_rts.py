"""The model of body, accelerometers and navigation that the smoother works on."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion._complementary import BodyCoordinates
from trueterrain.motion._heave import lever_height
from trueterrain.motion._inertial import InertialAccelerations
from trueterrain.motion._inputs import NavigationInput
from trueterrain.motion._noise import InstrumentNoise
from trueterrain.motion._smoother import SmoothedStates, StateSpaceModel, smooth_states

Float = npt.NDArray[np.float64]

# Nothing is known of the first pose but the first epoch, of whose standard deviations these are so
# many that it matters no more than once; and of the rates of height [m/s], roll and pitch [rad/s].
_FIRST = 30.0
_FIRST_RATE = np.array([5.0, 1.0, 1.0])
_TURN_MEMORY = 0.1  # [s] of roll and pitch acceleration where no accelerometer tells them


@dataclass(frozen=True, kw_only=True)
class SensorErrors:
    """What may be wrong with the accelerometers besides their noise."""

    bias_sd: float
    "Standard deviation of the bias [m/s^2]."

    bias_walk: float
    "Of its random walk after 1 s [m/s^2/sqrt(s)]."

    scale_sd: float
    "Of the error of scale [1]."

    delay_sd: float
    "Of the error of their clock [s]."


@dataclass(frozen=True, kw_only=True, eq=False)
class SmootherResult:
    """What the smoother says."""

    coordinates: BodyCoordinates
    "Height of the middle of the sensors, roll and pitch."

    drift: Float
    "Drift of up, roll and pitch of navigation, shape (n, 3) [m, rad, rad]."

    drift_sd: Float
    "Its standard deviation, shape (n, 3)."

    bias: Float
    "Of the accelerometers at the last knot, shape (sensor,) [m/s^2]."

    scale: Float
    "Their errors of scale, shape (sensor,) [1]."

    delay: tuple[float, float]
    "By how much they are later than was said, and its standard deviation [s]."

    normalised_innovation_squared: Float
    "Mean square of the innovations over what was expected, of up, roll and pitch; near 1."


def smoothed_coordinates(
    inertial: InertialAccelerations,
    navigation: NavigationInput,
    nominal: Float,
    turn: Float,
    noise: InstrumentNoise,
    drift_sd: Float,
    sensors: SensorErrors,
) -> SmootherResult:
    """Coordinates at the knots by the smoother.

    Parameters
    ----------
    inertial : Inertial
        What accelerometers say.
    navigation : NavigationInput
        Epochs.
    nominal : numpy.ndarray, shape (epoch, 2)
        Roll and pitch about which levers are linear [rad].
    turn : numpy.ndarray, shape (2,)
        Root mean square of the roll and pitch acceleration, where no sensor tells it [rad/s^2].
    noise : Noise
        Noise of the instruments.
    drift_sd : numpy.ndarray, shape (n, 3)
        Standard deviation of the drifts at the knots [m, rad, rad].
    sensors : Sensors
        What may be wrong with the accelerometers.
    """
    model = _state_model(inertial, navigation, nominal, turn, noise, drift_sd, sensors)
    count = inertial.share.shape[1]
    size = 6 + 2 * count + 1 + 3
    spread = np.empty(size)
    spread[:3] = _FIRST * np.hypot(drift_sd[0], noise.white)
    spread[0] += _FIRST * float(np.hypot(*inertial.middle[:2])) * spread[1:3].max()
    spread[3:6] = _FIRST_RATE
    spread[6 : 6 + count] = sensors.bias_sd
    spread[6 + count : 6 + 2 * count] = sensors.scale_sd
    spread[6 + 2 * count] = sensors.delay_sd
    spread[-3:] = drift_sd[0]
    state = np.zeros(size)
    state[:3] = np.linalg.solve(model.design[0], model.measured[0])
    found = smooth_states(model, state, np.diag(spread**2))
    return _smoother_result(found, count)


def _smoother_result(s: SmoothedStates, count: int) -> SmootherResult:
    delay = s.mean[-1, 6 + 2 * count], np.sqrt(max(s.parameter_covariance[-1, -1], 0.0))
    return SmootherResult(
        coordinates=BodyCoordinates(
            value=s.mean[:, :3].copy(),
            rate=s.mean[:, 3:6].copy(),
            covariance=_not_negative(s.covariance),
        ),
        drift=s.mean[:, -3:].copy(),
        drift_sd=np.sqrt(np.maximum(s.drift_variance, 0.0)),
        bias=s.mean[-1, 6 : 6 + count].copy(),
        scale=s.mean[-1, 6 + count : 6 + 2 * count].copy(),
        delay=(float(delay[0]), float(delay[1])),
        normalised_innovation_squared=s.normalised_innovation_squared,
    )


def _not_negative(covariance: Float) -> Float:
    """Covariances whose round-off, if next to nothing is unknown, has not made them negative."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + np.swapaxes(covariance, 1, 2)))
    bad = values[:, 0] <= 0
    if bad.any():
        kept = np.maximum(values[bad], 1e-18)[:, None, :]
        covariance[bad] = (vectors[bad] * kept) @ np.swapaxes(vectors[bad], 1, 2)
    return covariance


def _state_model(
    inertial: InertialAccelerations,
    navigation: NavigationInput,
    nominal: Float,
    turn: Float,
    noise: InstrumentNoise,
    drift_sd: Float,
    sensors: SensorErrors,
) -> StateSpaceModel:
    time = inertial.time
    step = np.diff(time)
    once, twice = inertial.integrals(inertial.acceleration)
    into_coordinate, into_rate = _parameter_design(inertial, once, step)
    count = inertial.share.shape[1]
    walk = np.zeros((1, 2 * count + 1))
    walk[0, :count] = sensors.bias_walk**2
    decay = np.exp(-step[:, None] / np.array(noise.drift_time))
    decay = np.minimum(decay, drift_sd[1:] / drift_sd[:-1])
    nearest = _nearest_knots(time, navigation.time)
    order = np.arange(time.size)
    before = navigation.time - time[nearest]
    design, measured = _measurement_design(navigation, nominal, inertial.middle)
    # the body accelerates on the way from the knot to the epoch
    ahead = 0.5 * before[:, None] ** 2 * inertial.acceleration[inertial.knot[nearest]]
    measured -= np.einsum("mij,mj->mi", design, ahead)
    return StateSpaceModel(
        step=step,
        known=np.concatenate([twice, once], axis=1),
        into_coordinate=into_coordinate,
        into_rate=into_rate,
        noise=_acceleration_noise(inertial, noise, turn),
        walk=walk,
        decay=decay,
        drift_noise=np.maximum(drift_sd[1:] ** 2 - (decay * drift_sd[:-1]) ** 2, 0.0),
        seen=np.stack(
            [np.searchsorted(nearest, order), np.searchsorted(nearest, order, side="right")], axis=1
        ),
        before=before,
        measured=measured,
        design=design,
        variance=np.tile(np.square(noise.white), (navigation.time.size, 1)),
    )


def _parameter_design(
    inertial: InertialAccelerations, once: Float, step: Float
) -> tuple[Float, Float]:
    """What biases, errors of scale and the error of the clock add to coordinates and rates."""
    count = inertial.share.shape[1]
    n = step.size
    into_coordinate, into_rate = np.zeros((n, 3, 2 * count + 1)), np.zeros((n, 3, 2 * count + 1))
    share = -inertial.share
    into_rate[:, :, :count] = share * step[:, None, None]
    into_coordinate[:, :, :count] = share * 0.5 * step[:, None, None] ** 2
    felt, felt_twice = inertial.integrals(inertial.per_sensor)
    into_rate[:, :, count:-1] = share * felt[:, None, :]
    into_coordinate[:, :, count:-1] = share * felt_twice[:, None, :]
    at_knots = inertial.acceleration[inertial.knot]
    into_rate[:, :, -1] = np.diff(at_knots, axis=0)
    into_coordinate[:, :, -1] = once - step[:, None] * at_knots[:-1]
    missing = np.maximum.reduceat(inertial.bridged[:-1] | inertial.bridged[1:], inertial.knot[:-1])
    into_coordinate[missing] = 0.0
    into_rate[missing] = 0.0
    return into_coordinate, into_rate


def _acceleration_noise(
    inertial: InertialAccelerations, noise: InstrumentNoise, turn: Float
) -> Float:
    """Two-sided density of the error of the accelerations, shape (n - 1, 3, 3)."""
    density = 0.5 * np.square(noise.accelerometer)
    always = (inertial.share * density) @ inertial.share.T
    if not inertial.turns:
        always[[1, 2], [1, 2]] += np.maximum(turn, 1e-3) ** 2 * _TURN_MEMORY
    length = np.diff(inertial.fine)[:, None]
    starts = inertial.knot[:-1]
    lost = np.add.reduceat(inertial.lost * length, starts, axis=0)
    lost /= np.diff(inertial.time)[:, None]
    whole = np.tile(always, (starts.size, 1, 1))
    whole[:, [0, 1, 2], [0, 1, 2]] += lost
    return whole


def _nearest_knots(knots: Float, time: Float) -> npt.NDArray[np.intp]:
    right = np.clip(np.searchsorted(knots, time), 1, knots.size - 1)
    return np.asarray(right - (time - knots[right - 1] < knots[right] - time))


def _measurement_design(
    navigation: NavigationInput, nominal: Float, middle: Float
) -> tuple[Float, Float]:
    """Derivatives (epoch, 3, 3) of up, roll and pitch by the coordinates, and what is measured."""
    roll, pitch = nominal.T
    over, by_roll, by_pitch = lever_height(roll, pitch, middle)
    design = np.tile(np.eye(3), (roll.size, 1, 1))
    design[:, 0, 1], design[:, 0, 2] = -by_roll, -by_pitch
    measured = navigation.pose[:, 2:5].copy()
    measured[:, 0] += over - by_roll * roll - by_pitch * pitch
    return design, measured
