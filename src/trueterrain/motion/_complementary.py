"""Complementary filters: slow motion from navigation, fast motion from accelerometers.

All have the form ``z = z_acc + L (z_nav - z_acc)`` with the twice integrated accelerations z_acc
and a low-pass filter L. If L is real in the frequency domain there is no delay, and motion that
both instruments measure passes unchanged, whatever L. The causal pair of Butterworth filters of the
thesis does not have this property: at the crossover, near the wheel hop, low-pass and high-pass add
up to 1.4 (order 4) or 0 (order 2) instead of 1.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inertial import InertialAccelerations, lever_height
from trueterrain.motion._inputs import SmoothedSeries, Span, bridge_variance
from trueterrain.motion.settings import FusionSettings

Float = npt.NDArray[np.float64]

#: Crossover of the zero-phase filter that prepares the coordinates and isolates noise [Hz].
CROSSOVER = 1.5

_SIDE = 0.1  # [s] next to a gap over which a bridge is aligned
_GAP_ERROR = np.array([0.01, 0.01, 0.01])  # [m/s^2, rad/s^2] of bias and scale in a gap


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorSpectra:
    """One-sided spectra of the errors of height, roll and pitch [m^2/Hz, rad^2/Hz, rad^2/Hz]."""

    white: Float
    "White noise of navigation, shape (3,)."

    random_walk: Float
    "Drift of navigation times (2 pi f)^2, shape (3,)."

    acceleration: Float
    "White noise of the accelerations, shape (3,)."

    bias_walk: Float
    "Random walk of the accelerations times (2 pi f)^2, shape (3,)."

    def navigation(self, frequency: Float) -> Float:
        """Spectra of navigation, shape (f, 3)."""
        return np.asarray(self.white + self.random_walk / (2 * np.pi * frequency[:, None]) ** 2)

    def accelerometers(self, frequency: Float) -> Float:
        """Spectra of the twice integrated accelerations, shape (f, 3)."""
        square = (2 * np.pi * frequency[:, None]) ** 2
        return np.asarray(self.acceleration / square**2 + self.bias_walk / square**3)


def error_spectra(
    inertial: InertialAccelerations,
    *,
    white: tuple[float, float, float],
    random_walk: Float,
    accelerometer: tuple[float, ...],
    bias_walk: float,
    navigation_step: float,
) -> ErrorSpectra:
    """Spectra of the errors of both instruments in height, roll and pitch.

    Parameters
    ----------
    inertial : InertialAccelerations
        Weights of the sensors.
    white : tuple of float
        Standard deviations of the white noise of navigation [m, rad, rad].
    random_walk : numpy.ndarray, shape (3,)
        Variance of its drift per second [m^2/s, rad^2/s, rad^2/s].
    accelerometer : tuple of float
        Noise density of each sensor [m/s^2/sqrt(Hz)].
    bias_walk : float
        Random walk of a bias after 1 s [m/s^2/sqrt(s)].
    navigation_step : float
        Time from epoch to epoch [s].
    """
    squared_weights = np.square(inertial.weights)
    acceleration = squared_weights @ np.square(accelerometer)
    walk = squared_weights.sum(axis=1) * 2 * bias_walk**2
    if not inertial.observes_attitude:
        acceleration[1:], walk[1:] = 1e3, 0.0  # the sensors do not observe roll and pitch
    # a white series of variance s^2 and step h has the one-sided density 2 s^2 h
    return ErrorSpectra(
        white=2 * np.square(white) * navigation_step,
        random_walk=2 * random_walk,
        acceleration=acceleration,
        bias_walk=walk,
    )


def sensor_centre_coordinates(
    inertial: InertialAccelerations,
    vertical: SmoothedSeries,
    attitude: SmoothedSeries,
    gaps: tuple[Span, ...],
) -> Float:
    """Height of the centre of the sensors, roll and pitch at the knots by navigation, (n, 3).

    The lever arm is rotated by the fused roll and pitch, whose noise is less than navigation's.
    Over gaps of navigation the accelerations are integrated.
    """
    coordinates = vertical.value(inertial.time)
    angles = attitude.value(inertial.time)
    if inertial.observes_attitude:
        angles = zero_phase(inertial, coordinates, cutoff=CROSSOVER, order=2)[0][:, 1:]
    coordinates[:, 0] += lever_height(angles[:, 0], angles[:, 1], inertial.centre)[0]
    return _bridge_gaps(gaps, inertial, coordinates)


def _bridge_gaps(
    gaps: tuple[Span, ...], inertial: InertialAccelerations, coordinates: Float
) -> Float:
    """Replace coordinates in gaps of navigation by the integrated accelerations."""
    if not (gaps and inertial.observes_attitude):
        return coordinates
    time = inertial.time
    # three iterations: the parabola that aligns accelerometers and navigation is fitted to all
    # coordinates, those in gaps included, and improves with these
    for begin, end in gaps * 3:
        value, _ = integrate_acceleration(inertial, coordinates)
        difference = coordinates - value
        sides = [(time > begin - _SIDE) & (time <= begin), (time >= end) & (time < end + _SIDE)]
        inside = (time > begin) & (time < end)
        if not (inside.any() and sides[0].any() and sides[1].any()):
            continue
        x = (time[inside, None] - begin) / (end - begin)
        before, after = (difference[side].mean(axis=0) for side in sides)
        coordinates[inside] = value[inside] + before + x * (after - before)
    return coordinates


def integrate_acceleration(
    inertial: InertialAccelerations, navigation: Float
) -> tuple[Float, Float]:
    """Accelerations integrated twice and once, aligned with navigation by a parabola.

    The parabola stands for the constants of integration and a mean bias.

    Parameters
    ----------
    inertial : InertialAccelerations
        Accelerations.
    navigation : numpy.ndarray, shape (n, 3)
        Coordinates at the knots by navigation [m, rad, rad].

    Returns
    -------
    value, rate : numpy.ndarray, shape (n, 3)
        Coordinates and their rates.
    """
    time = inertial.time
    step = np.diff(time)[:, None]
    once, twice = inertial.integrals(inertial.acceleration)
    zero = np.zeros((1, 3))
    rate = np.concatenate([zero, np.cumsum(once, axis=0)])
    value = np.concatenate([zero, np.cumsum(step * rate[:-1] + twice, axis=0)])
    x = (time - time.mean()) / max(0.5 * (time[-1] - time[0]), 1e-9)
    basis = np.stack([np.ones_like(x), x, x**2], axis=1)
    fit = np.linalg.lstsq(basis, navigation - value, rcond=None)[0]
    slope = np.stack([np.zeros_like(x), np.ones_like(x), 2 * x], axis=1)
    slope *= (x[-1] - x[0]) / (time[-1] - time[0])
    return value + basis @ fit, rate + slope @ fit


def filter_coordinates(
    inertial: InertialAccelerations,
    coordinates: Float,
    spectra: ErrorSpectra,
    settings: FusionSettings,
    *,
    drift_time: tuple[float, float, float],
    drift_sd: Float,
) -> tuple[Float, Float, Float, tuple[float, float]]:
    """Coordinates by the complementary filter of the settings, with their variances.

    Parameters
    ----------
    inertial : InertialAccelerations
        Accelerations.
    coordinates : numpy.ndarray, shape (n, 3)
        Coordinates at the knots by navigation [m, rad, rad].
    spectra : ErrorSpectra
        Errors of both instruments.
    settings : FusionSettings
        Method (thesis, zero-phase or wiener), crossover and order.
    drift_time : tuple of float
        Correlation times of the drift of navigation [s].
    drift_sd : numpy.ndarray, shape (n, 3)
        Standard deviations of the drift at the knots [m, rad, rad].

    Returns
    -------
    value, rate, variance : numpy.ndarray, shape (n, 3)
        Coordinates, their rates and the variances of the coordinates, gaps aside.
    decay : tuple of float
        Times at both ends after which transients have decayed [s].
    """
    s = settings
    time = inertial.time
    frequency = np.geomspace(1.5 / (time[-1] - time[0]), 0.5 * s.rate, 2000)
    gain = butterworth_gain(frequency, s.crossover, s.order)
    decay = (0.5 / s.crossover, 0.5 / s.crossover)
    defect = np.zeros(3)
    zero = np.zeros_like(coordinates)  # the filter then passes the accelerometers alone
    if s.method == "wiener":
        value, rate = wiener_filter(inertial, coordinates, spectra)
        _, fast = wiener_filter(inertial, zero, spectra)
        gain = low_pass_gain(spectra, frequency)
    else:
        value, rate = zero_phase(inertial, coordinates, cutoff=s.crossover, order=s.order)
        _, fast = zero_phase(inertial, zero, cutoff=s.crossover, order=s.order)
    if s.method == "thesis":
        value, rate, defect = causal_filter(
            inertial, coordinates, cutoff=s.crossover, order=s.order
        )
        decay = (2.0 / s.crossover, 0.0)
    # an error of the delay displaces the motion from the accelerometers by its rate times the error
    delay = s.accelerometer_delay_sd * np.sqrt(np.mean(fast**2, axis=0))
    variance = filter_variance(spectra, gain, frequency) + defect**2 + delay**2
    drift = passed_drift(gain, frequency, np.array(drift_time)) * drift_sd**2
    return value, rate, drift + variance, decay


def gap_variance(
    inertial: InertialAccelerations, spectra: ErrorSpectra, gaps: tuple[Span, ...]
) -> Float:
    """Variance of coordinates that accelerations bridge over gaps of navigation, (n, 3)."""
    bridge = bridge_variance(inertial.time, gaps, 1.0)[:, None]
    return np.asarray(bridge * (0.5 * spectra.acceleration + _GAP_ERROR**2))


def causal_filter(
    inertial: InertialAccelerations, navigation: Float, *, cutoff: float, order: int
) -> tuple[Float, Float, Float]:
    """Method of the thesis: causal Butterworth filters, low-pass and high-pass.

    Returns
    -------
    value, rate : numpy.ndarray, shape (n, 3)
        Coordinates and their rates.
    defect : numpy.ndarray, shape (3,)
        Root mean square by which the pair distorts the motion itself.
    """
    from scipy.signal import butter, sosfilt, sosfilt_zi

    value, _ = integrate_acceleration(inertial, navigation)
    rate = _sample_rate(inertial.time)

    def filtered(kind: str, series: Float) -> Float:
        sections = butter(order, cutoff, kind, fs=rate, output="sos")
        begin = sosfilt_zi(sections)[:, :, None] * series[0]
        return np.asarray(sosfilt(sections, series, axis=0, zi=begin)[0])

    fast = filtered("highpass", value)
    fused = filtered("lowpass", navigation) + fast
    defect = filtered("lowpass", value) + fast - value
    return fused, np.gradient(fused, inertial.time, axis=0), np.sqrt(np.mean(defect**2, axis=0))


def zero_phase(
    inertial: InertialAccelerations, navigation: Float, *, cutoff: float, order: int
) -> tuple[Float, Float]:
    """Forward and backward Butterworth low-pass of the difference: exactly complementary."""
    from scipy.signal import butter, sosfiltfilt

    value, rate = integrate_acceleration(inertial, navigation)
    sampling = _sample_rate(inertial.time)
    sections = butter(order, cutoff, fs=sampling, output="sos")
    pad = min(len(value) - 1, int(3 * sampling / cutoff))
    slow = sosfiltfilt(sections, navigation - value, axis=0, padlen=pad)
    return value + slow, rate + np.gradient(slow, inertial.time, axis=0)


def wiener_filter(
    inertial: InertialAccelerations, navigation: Float, spectra: ErrorSpectra
) -> tuple[Float, Float]:
    """Real low-pass of least error for the spectra of both instruments."""
    from scipy.fft import dst, idst

    value, rate = integrate_acceleration(inertial, navigation)
    difference = navigation - value
    n, sampling = len(difference), _sample_rate(inertial.time)
    # a straight line from end to end, and a sine series of the remainder, which is 0 at both ends
    x = np.linspace(0.0, 1.0, n)[:, None]
    length = [min(int(sampling / cross), n // 4) for cross in crossover_frequency(spectra)]
    first = np.array([_end_value(difference[:, j], end) for j, end in enumerate(length)])
    last = np.array([_end_value(difference[::-1, j], end) for j, end in enumerate(length)])
    straight = first + (last - first) * x
    frequency = np.arange(1, n + 1) * sampling / (2 * (n + 1))
    gain = low_pass_gain(spectra, frequency)
    slow = straight + idst(gain * dst(difference - straight, type=1, axis=0), type=1, axis=0)
    return value + slow, rate + np.gradient(slow, inertial.time, axis=0)


def low_pass_gain(spectra: ErrorSpectra, frequency: Float) -> Float:
    """Gain of the Wiener low-pass, ``S_acc / (S_nav + S_acc)``, shape (f, 3).

    Examples
    --------
    >>> one = np.ones(3)
    >>> equal = ErrorSpectra(white=one, random_walk=0 * one, acceleration=one, bias_walk=0 * one)
    >>> low_pass_gain(equal, np.array([1 / (2 * np.pi)]))
    array([[0.5, 0.5, 0.5]])
    """
    noise = spectra.accelerometers(frequency)
    return np.asarray(noise / (noise + spectra.navigation(frequency)))


def crossover_frequency(spectra: ErrorSpectra) -> tuple[float, float, float]:
    """Frequency at which the errors of both instruments are equal, for each coordinate [Hz]."""
    frequency = np.geomspace(1e-3, 1e3, 3000)
    gain = low_pass_gain(spectra, frequency)
    found = [float(frequency[int(np.argmin(np.abs(gain[:, j] - 0.5)))]) for j in range(3)]
    return found[0], found[1], found[2]


def filter_variance(spectra: ErrorSpectra, gain: Float, frequency: Float) -> Float:
    """Variance of both instruments' noise after a complementary pair of real filters, (3,).

    Parameters
    ----------
    spectra : ErrorSpectra
        Errors of both instruments.
    gain : numpy.ndarray, shape (f, 3)
        Gain of the low-pass.
    frequency : numpy.ndarray, shape (f,)
        Frequencies [Hz].
    """
    density = gain**2 * spectra.white + (1 - gain) ** 2 * spectra.accelerometers(frequency)
    return np.asarray(np.trapezoid(density, frequency, axis=0))


def passed_drift(gain: Float, frequency: Float, time: Float) -> Float:
    """Fraction of the variance of a Gauss-Markov drift that a real low-pass passes, (3,).

    Parameters
    ----------
    gain : numpy.ndarray, shape (f, 3)
        Gain of the low-pass; 1 below the first frequency.
    frequency : numpy.ndarray, shape (f,)
        Frequencies [Hz].
    time : numpy.ndarray, shape (3,)
        Correlation time of the drift [s].
    """
    # one-sided spectrum of exp(-|t| / time), of variance 1
    density = 4 * time / (1 + (2 * np.pi * frequency[:, None] * time) ** 2)
    return np.asarray(1 - np.trapezoid((1 - gain**2) * density, frequency, axis=0))


def butterworth_gain(frequency: Float, cutoff: float, order: int) -> Float:
    """Gain of a Butterworth low-pass applied forward and backward, shape (f, 3)."""
    gain = 1.0 / (1.0 + (frequency / cutoff) ** (2 * order))
    return np.repeat(gain[:, None], 3, axis=1)


def _end_value(series: Float, count: int) -> float:
    """First value of a series, from the straight line through its first values."""
    count = max(count, 2)
    return float(np.polyfit(np.arange(count), series[:count], 1)[1])


def _sample_rate(time: Float) -> float:
    return float((time.size - 1) / (time[-1] - time[0]))
