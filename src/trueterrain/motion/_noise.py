"""Noise of the instruments, stated or estimated from the run itself.

Navigation: the residual of navigation against the fused motion above a few hertz, where both
instruments observe the motion of the body. Its spectrum is that of white noise and of a drift that
is a random walk at these frequencies, ``white + random_walk / (2 pi f)^2``, fitted by Whittle's
likelihood. Accelerometers: the quietest octave of their own spectra, which the motion of the body
does not reach.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion._complementary import CROSSOVER, zero_phase
from trueterrain.motion._inertial import InertialAccelerations, lever_height
from trueterrain.motion._inputs import AccelerometerInput, NavigationInput, SmoothedSeries
from trueterrain.motion.settings import DRIFT_TIME, FusionSettings

Float = npt.NDArray[np.float64]

_VERTICAL = [2, 3, 4]  # up, roll, pitch among the components of navigation
_MIN_NOISE = np.array([1e-5, 1e-6, 1e-6])  # white, of up [m], roll and pitch [rad]
_DRIFT_TIMES = 0.1, 1e5  # [s] bounds of an estimated correlation time
_MIN_FREQUENCY = 2.0  # [Hz] of the residual; below, errors of the accelerometers may show
_MIN_GAIN = 4.0  # of the log likelihood by which a drift is accepted
_DEPENDENCE = 1.9  # neighbouring frequencies of a Hann window are correlated: variance of their sum
_OCTAVES_BEGIN = 20.0  # [Hz] of the accelerometers
_MIN_DENSITY = 1e-5  # [m/s^2/sqrt(Hz)], one-sided: 1 ug


@dataclass(frozen=True, kw_only=True)
class InstrumentNoise:
    """Noise of the instruments as the fusion uses it."""

    white: tuple[float, float, float]
    "Standard deviation of the white noise of up [m], roll and pitch [rad] of navigation."

    drift_sd: tuple[float, float, float]
    "Standard deviation of their drift (Gauss-Markov), mean over the run [m, rad, rad]."

    drift_time: tuple[float, float, float]
    "Correlation time of the drift [s]."

    accelerometer: tuple[float, ...]
    "White noise of each accelerometer, one-sided [m/s^2/sqrt(Hz)]."

    estimated: tuple[str, ...]
    "Values estimated from the run; the others are stated, reported or assumed."


def estimate_noise(
    settings: FusionSettings,
    navigation: NavigationInput,
    sensors: AccelerometerInput,
    inertial: InertialAccelerations,
    coordinates: Float,
    attitude: SmoothedSeries,
    sd: Float,
) -> tuple[InstrumentNoise, Float]:
    """Noise of both instruments, estimated where the settings do not state it.

    Parameters
    ----------
    settings : FusionSettings
        Stated noise.
    navigation, sensors : NavigationInput, AccelerometerInput
        Epochs and samples.
    inertial : InertialAccelerations
        Accelerations.
    coordinates : numpy.ndarray, shape (n, 3)
        Height of the sensor centre, roll and pitch at the knots by navigation [m, rad, rad].
    attitude : SmoothedSeries
        Roll and pitch by navigation.
    sd : numpy.ndarray, shape (epoch, 3)
        Standard deviations of up, roll and pitch, white noise and drift together [m, rad, rad].

    Returns
    -------
    noise : InstrumentNoise
        Noise.
    random_walk : numpy.ndarray, shape (3,)
        Variance of the drift per second at high frequencies [m^2/s, rad^2/s, rad^2/s].
    """
    estimated = []
    inside = (sensors.time >= inertial.sample_time[0]) & (sensors.time <= inertial.sample_time[-1])
    density = [
        accelerometer_noise_density(one, 1.0 / sensors.step) for one in sensors.force[inside].T
    ]
    if settings.accelerometer_noise is not None:
        density = [settings.accelerometer_noise] * len(density)
    else:
        estimated.append("accelerometer")
    residual = _navigation_residual(navigation, inertial, coordinates, attitude)
    rate = 1.0 / navigation.step
    pairs = np.array([fit_white_and_random_walk(column, rate) for column in residual.T])
    white = np.maximum(pairs[:, 0], _MIN_NOISE)
    if settings.navigation_noise is not None:
        white = np.array(settings.navigation_noise)
    else:
        estimated.append("white")
    total = np.sqrt(np.mean(sd**2, axis=0))
    drift = np.sqrt(np.maximum(total**2 - white**2, (0.1 * white) ** 2))
    length = np.array(DRIFT_TIME if settings.drift_time is None else settings.drift_time)
    if settings.drift_time is None:
        # a Gauss-Markov process of variance s^2 and correlation time T is at high frequencies a
        # random walk of variance 2 s^2 / T per second
        seen = pairs[:, 1] > 0
        length[seen] = np.clip(2 * drift[seen] ** 2 / pairs[seen, 1], *_DRIFT_TIMES)
        estimated += [
            f"drift_time of {name}"
            for name, at in zip(("up", "roll", "pitch"), seen, strict=True)
            if at
        ]
    noise = InstrumentNoise(
        white=_three_floats(white),
        drift_sd=_three_floats(drift),
        drift_time=_three_floats(length),
        accelerometer=tuple(density),
        estimated=tuple(estimated),
    )
    return noise, 2 * drift**2 / length


def _navigation_residual(
    navigation: NavigationInput,
    inertial: InertialAccelerations,
    coordinates: Float,
    attitude: SmoothedSeries,
) -> Float:
    """Navigation less the fused motion, above 1.5 Hz, at the epochs; shape (epoch, 3).

    Errors of scale and clock of the accelerometers leave residuals proportional to the motion and
    to its rate, which are fitted and removed.
    """
    from scipy.interpolate import CubicHermiteSpline

    time = inertial.time
    value, rate = zero_phase(inertial, coordinates, cutoff=CROSSOVER, order=2)
    smooth = CubicHermiteSpline(time, value, rate, axis=0)(navigation.time)
    # without navigation the filter passes the accelerometers alone: the motion above the crossover
    fast_value, fast_rate = zero_phase(
        inertial, np.zeros_like(coordinates), cutoff=CROSSOVER, order=2
    )
    measured = navigation.pose[:, _VERTICAL].copy()
    angles = smooth[:, 1:] if inertial.observes_attitude else attitude.value(navigation.time)
    measured[:, 0] += lever_height(angles[:, 0], angles[:, 1], inertial.centre)[0]
    residual = measured - smooth
    fast = CubicHermiteSpline(time, fast_value, fast_rate, axis=0)
    shapes = fast(navigation.time), fast(navigation.time, 1)
    for j in range(3):
        basis = np.stack([shape[:, j] for shape in shapes], axis=1)
        residual[:, j] -= basis @ np.linalg.lstsq(basis, residual[:, j], rcond=None)[0]
    return np.asarray(residual)


def fit_white_and_random_walk(residual: Float, rate: float) -> tuple[float, float]:
    """White noise and random walk in a series, from its spectrum above 2 Hz.

    Parameters
    ----------
    residual : numpy.ndarray, shape (n,)
        The series; slow motion does not matter.
    rate : float
        Samples per second [Hz].

    Returns
    -------
    white : float
        Standard deviation of the white noise, in the unit of the series.
    random_walk : float
        Variance of the random walk per second; 0 if none is significant.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = 1e-3 * rng.standard_normal(8000)
    >>> walk = np.cumsum(5e-3 * np.sqrt(0.005) * rng.standard_normal(8000))
    >>> white, random_walk = fit_white_and_random_walk(noise + walk, 200.0)
    >>> round(1000 * white, 2), round(1000 * random_walk**0.5, 1)
    (1.0, 5.0)
    """
    from scipy.optimize import minimize
    from scipy.signal import periodogram

    frequency, power = periodogram(residual, rate, window="hann", detrend="linear")
    band = (frequency >= min(_MIN_FREQUENCY, 0.1 * rate)) & (frequency <= 0.475 * rate)
    frequency, power = frequency[band], power[band]
    if frequency.size < 4 or not power.max() > 0:
        return float(np.std(residual)), 0.0
    # spectrum of a random walk in discrete steps, rather than its limit 1 / (2 pi f)^2
    walk = 2.0 / (2.0 * rate * np.sin(np.pi * frequency / rate)) ** 2

    def cost(logs: Float) -> float:
        spectrum = np.exp(logs[0]) + np.exp(logs[1]) * walk
        return float(np.sum(np.log(spectrum) + power / spectrum))

    level = float(np.mean(power[frequency > 0.5 * frequency[-1]]))
    start = [np.log(level), np.log(level / walk[0])]
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
    white_only = float(np.mean(power))
    cost_of_white = float(np.sum(np.log(white_only) + power / white_only))
    if cost_of_white - found.fun < _DEPENDENCE * _MIN_GAIN:
        return float(np.sqrt(0.5 * white_only * rate)), 0.0
    white, random_walk = np.exp(found.x)
    return float(np.sqrt(0.5 * white * rate)), float(random_walk)


def accelerometer_noise_density(readings: Float, rate: float) -> float:
    """Spectral density of the noise of one accelerometer, one-sided [m/s^2/sqrt(Hz)].

    Parameters
    ----------
    readings : numpy.ndarray, shape (n,)
        Specific force [m/s^2].
    rate : float
        Samples per second [Hz].

    Returns
    -------
    float
        Square root of the lowest mean power among the octaves from 20 Hz to 0.15 of the rate; above
        them the anti-alias filter attenuates.

    Examples
    --------
    >>> noise = 0.02 * np.random.default_rng(1).standard_normal(8000)
    >>> round(accelerometer_noise_density(noise, 2000.0) * 1000**0.5, 3)
    0.02
    """
    from scipy.signal import welch

    frequency, power = welch(readings, rate, nperseg=min(2048, readings.size))
    high = 0.15 * rate
    low = min(_OCTAVES_BEGIN, 0.25 * high)
    levels = []
    while high > low * 1.5:
        band = power[(frequency > high / 2) & (frequency <= high)]
        if band.size >= 3:
            levels.append(float(np.mean(band)))
        high /= 2
    return max(float(np.sqrt(min(levels))) if levels else 0.0, _MIN_DENSITY)


def horizontal_window(
    navigation: NavigationInput,
    horizontal: SmoothedSeries,
    sensors: AccelerometerInput,
    min_window: float,
    max_window: float,
) -> float:
    """Window for horizontal accelerations [s] whose noise is below that of the accelerometers.

    A cubic over the window W passes noise up to 1.25 / W, amplified by (2 pi f)^2 in acceleration;
    an accelerometer inclined by an angle measures that fraction of it.

    Parameters
    ----------
    navigation, sensors : NavigationInput, AccelerometerInput
        Epochs and samples.
    horizontal : SmoothedSeries
        East, north and yaw.
    min_window, max_window : float
        Bounds of the result [s].
    """
    rough = navigation.pose[:, :2] - horizontal.value(navigation.time)[:, :2]
    density = np.sqrt(2 * navigation.step) * np.sqrt(np.mean(rough**2))
    incline = np.sqrt(np.mean(navigation.pose[:, 3:5] ** 2))
    own = np.mean([accelerometer_noise_density(one, 1.0 / sensors.step) for one in sensors.force.T])
    window = 2 * np.pi * 1.25 * np.sqrt(density * incline * np.sqrt(len(sensors.position)) / own)
    return float(np.clip(window, min_window, max_window))


def _three_floats(values: Float) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
