"""Complementary filters: slow motion from navigation, fast motion from accelerometers.

All give ``z = z_acc + L (z_ins - z_acc)`` with the accelerometers integrated twice, z_acc, and a
low-pass L. If L is real in the frequency domain there is no delay, and what both instruments agree
on comes out as it is, whatever L. The thesis's causal pair of Butterworth filters is not such: at
the crossover, on the wheel-hop mode, low-pass and high-pass add up to 1.4 (order 4) or to nothing
(order 2) instead of 1.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inertial import InertialAccelerations

Float = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyCoordinates:
    """Height of some point of the body, roll and pitch at the knots."""

    value: Float
    "Shape (n, 3) [m, rad, rad]."

    rate: Float
    "Shape (n, 3) [m/s, rad/s, rad/s]."

    covariance: Float
    "Shape (n, 3, 3)."


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorSpectra:
    """One-sided spectra of the errors of the three coordinates [m^2/Hz, rad^2/Hz]."""

    white: Float
    "Of the white noise of navigation, shape (3,)."

    wander: Float
    "Of its drift times (2 pi f)^2, shape (3,)."

    acceleration: Float
    "Of the white noise of the accelerations, shape (3,)."

    walk: Float
    "Of their random walk times (2 pi f)^2, shape (3,)."

    def navigation(self, frequency: Float) -> Float:
        """Of navigation, shape (f, 3)."""
        return np.asarray(self.white + self.wander / (2 * np.pi * frequency[:, None]) ** 2)

    def accelerometers(self, frequency: Float) -> Float:
        """Of the accelerations integrated twice, shape (f, 3)."""
        square = (2 * np.pi * frequency[:, None]) ** 2
        return np.asarray(self.acceleration / square**2 + self.walk / square**3)


def integrate_acceleration(
    inertial: InertialAccelerations, navigation: Float
) -> tuple[Float, Float]:
    """Accelerations integrated twice and once, with the parabola removed that navigation denies.

    Parameters
    ----------
    inertial : Inertial
        Accelerations.
    navigation : numpy.ndarray, shape (n, 3)
        The coordinates at the knots as navigation gives them.

    Returns
    -------
    value, rate : numpy.ndarray, shape (n, 3)
        Coordinates and their rates.
    """
    time = inertial.time
    step = np.diff(time)[:, None]
    once, twice = inertial.integrals(inertial.acceleration)
    none = np.zeros((1, 3))
    rate = np.concatenate([none, np.cumsum(once, axis=0)])
    value = np.concatenate([none, np.cumsum(step * rate[:-1] + twice, axis=0)])
    x = (time - time.mean()) / max(0.5 * (time[-1] - time[0]), 1e-9)
    basis = np.stack([np.ones_like(x), x, x**2], axis=1)
    fit = np.linalg.lstsq(basis, navigation - value, rcond=None)[0]
    slope = np.stack([np.zeros_like(x), np.ones_like(x), 2 * x], axis=1)
    slope *= (x[-1] - x[0]) / (time[-1] - time[0])
    return value + basis @ fit, rate + slope @ fit


def causal_filter(
    inertial: InertialAccelerations, navigation: Float, *, cutoff: float, order: int
) -> tuple[Float, Float, Float]:
    """The thesis's way: causal Butterworth filters, low-pass and high-pass.

    Returns
    -------
    value, rate : numpy.ndarray, shape (n, 3)
        Coordinates and their rates.
    defect : numpy.ndarray, shape (3,)
        Root mean square of what the pair makes of the motion itself.
    """
    from scipy.signal import butter, sosfilt, sosfilt_zi

    value, _ = integrate_acceleration(inertial, navigation)
    rate = _sample_rate(inertial.time)

    def through(kind: str, series: Float) -> Float:
        sections = butter(order, cutoff, kind, fs=rate, output="sos")
        begin = sosfilt_zi(sections)[:, :, None] * series[0]
        return np.asarray(sosfilt(sections, series, axis=0, zi=begin)[0])

    fast = through("highpass", value)
    fused = through("lowpass", navigation) + fast
    defect = through("lowpass", value) + fast - value
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
    """The best real low-pass for the spectra of both errors."""
    from scipy.fft import dst, idst

    value, rate = integrate_acceleration(inertial, navigation)
    apart = navigation - value
    n, sampling = len(apart), _sample_rate(inertial.time)
    # straight from end to end, the rest a series of sines, which has no jump at the ends
    x = np.linspace(0.0, 1.0, n)[:, None]
    length = [min(int(sampling / cross), n // 4) for cross in crossover_frequency(spectra)]
    first = np.array([_end_value(apart[:, j], end) for j, end in enumerate(length)])
    last = np.array([_end_value(apart[::-1, j], end) for j, end in enumerate(length)])
    straight = first + (last - first) * x
    frequency = np.arange(1, n + 1) * sampling / (2 * (n + 1))
    share = low_pass(spectra, frequency)
    slow = straight + idst(share * dst(apart - straight, type=1, axis=0), type=1, axis=0)
    return value + slow, rate + np.gradient(slow, inertial.time, axis=0)


def low_pass(spectra: ErrorSpectra, frequency: Float) -> Float:
    """Wiener's low-pass ``S_acc / (S_ins + S_acc)``, shape (f, 3).

    Examples
    --------
    >>> one = np.ones(3)
    >>> equal = Spectra(white=one, wander=0 * one, acceleration=one, walk=0 * one)
    >>> low_pass(equal, np.array([1 / (2 * np.pi)]))
    array([[0.5, 0.5, 0.5]])
    """
    noise = spectra.accelerometers(frequency)
    return np.asarray(noise / (noise + spectra.navigation(frequency)))


def crossover_frequency(spectra: ErrorSpectra) -> tuple[float, float, float]:
    """Frequency at which both errors are equal, for each coordinate [Hz]."""
    frequency = np.geomspace(1e-3, 1e3, 3000)
    share = low_pass(spectra, frequency)
    found = [float(frequency[int(np.argmin(np.abs(share[:, j] - 0.5)))]) for j in range(3)]
    return found[0], found[1], found[2]


def filter_variance(spectra: ErrorSpectra, share: Float, frequency: Float) -> Float:
    """Variance of white noise through a real low-pass and of the accelerometers beside it, (3,)."""
    density = share**2 * spectra.white + (1 - share) ** 2 * spectra.accelerometers(frequency)
    return np.asarray(np.trapezoid(density, frequency, axis=0))


def passed_drift(share: Float, frequency: Float, time: Float) -> Float:
    """Share of the variance of a Gauss-Markov drift that a real low-pass lets through, (3,).

    Parameters
    ----------
    share : numpy.ndarray, shape (f, 3)
        Gain of the low-pass; 1 below the first frequency.
    frequency : numpy.ndarray, shape (f,)
        Frequencies [Hz].
    time : numpy.ndarray, shape (3,)
        Time of correlation of the drift [s].
    """
    density = 4 * time / (1 + (2 * np.pi * frequency[:, None] * time) ** 2)
    return np.asarray(1 - np.trapezoid((1 - share**2) * density, frequency, axis=0))


def butterworth_gain(frequency: Float, cutoff: float, order: int) -> Float:
    """Gain of a Butterworth low-pass forward and backward, shape (f, 3)."""
    gain = 1.0 / (1.0 + (frequency / cutoff) ** (2 * order))
    return np.repeat(gain[:, None], 3, axis=1)


def _end_value(series: Float, count: int) -> float:
    """First value of a series, by a straight line through its first values."""
    count = max(count, 2)
    return float(np.polyfit(np.arange(count), series[:count], 1)[1])


def _sample_rate(time: Float) -> float:
    return float((time.size - 1) / (time[-1] - time[0]))
