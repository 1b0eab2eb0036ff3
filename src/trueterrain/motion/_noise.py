"""How noisy the instruments are: given, or measured in the run itself.

Navigation: what remains of it over the accelerometers, above a few hertz, where the motion of the
body is known to both. Its spectrum is that of white noise and of a drift that wanders like a random
walk, ``white + wander / (2 pi f)^2``, fitted by Whittle's likelihood. Accelerometers: the quietest
octave of their own spectra, which no motion of the body reaches.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

#: Least noise that is believed: of height [m], roll and pitch [rad], white.
LEAST = np.array([1e-5, 1e-6, 1e-6])

_LOWEST = 2.0  # [Hz] of the residual, below which errors of the accelerometers may show
_SURE = 4.0  # gain in log likelihood from which on a drift is believed to be seen
_QUIET = 20.0  # [Hz] from which on the quietest octave of the accelerometers is sought
_LEAST_DENSITY = 1e-5  # [m/s^2/sqrt(Hz)], one-sided: 1 ug


@dataclass(frozen=True, kw_only=True)
class InstrumentNoise:
    """Noise of the instruments, as the fusion used it."""

    white: tuple[float, float, float]
    "Standard deviation of the white noise of up [m], roll and pitch [rad] of navigation."

    drift_sd: tuple[float, float, float]
    "Standard deviation of their drift (Gauss-Markov): its mean over the run [m, rad, rad]."

    drift_time: tuple[float, float, float]
    "Time of correlation of the drift [s]."

    accelerometer: tuple[float, ...]
    "White noise of each accelerometer, one-sided [m/s^2/sqrt(Hz)]."

    estimated: tuple[str, ...]
    "What of this was measured in the run; the rest was given, reported or assumed."


def white_and_wander(residual: Float, rate: float) -> tuple[float, float]:
    """White noise and random walk in a series, from its spectrum above 2 Hz.

    Parameters
    ----------
    residual : numpy.ndarray, shape (n,)
        The series; slow motion is of no account.
    rate : float
        Its samples per second [Hz].

    Returns
    -------
    white : float
        Standard deviation of the white noise, in the unit of the series.
    wander : float
        Variance of the random walk per second; 0 if none is seen.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = 1e-3 * rng.standard_normal(8000)
    >>> walk = np.cumsum(5e-3 * np.sqrt(0.005) * rng.standard_normal(8000))
    >>> white, wander = white_and_wander(noise + walk, 200.0)
    >>> round(1000 * white, 2), round(1000 * wander**0.5, 1)
    (1.0, 5.0)
    """
    from scipy.optimize import minimize
    from scipy.signal import periodogram

    frequency, power = periodogram(residual, rate, window="hann", detrend="linear")
    band = (frequency >= min(_LOWEST, 0.1 * rate)) & (frequency <= 0.475 * rate)
    frequency, power = frequency[band], power[band]
    if frequency.size < 4 or not power.max() > 0:
        return float(np.std(residual)), 0.0
    # of a random walk in steps, not of its limit
    walk = 2.0 / (2.0 * rate * np.sin(np.pi * frequency / rate)) ** 2

    def cost(logs: Float) -> float:
        spectrum = np.exp(logs[0]) + np.exp(logs[1]) * walk
        return float(np.sum(np.log(spectrum) + power / spectrum))

    level = float(np.mean(power[frequency > 0.5 * frequency[-1]]))
    start = [np.log(level), np.log(level / walk[0])]
    found = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-3})
    alone = float(np.mean(power))
    only_white = float(np.sum(np.log(alone) + power / alone))
    # neighbours are alike under the window, so that the likelihood counts them 1.9 times
    if only_white - found.fun < 1.9 * _SURE:
        return float(np.sqrt(0.5 * alone * rate)), 0.0
    white, wander = np.exp(found.x)
    return float(np.sqrt(0.5 * white * rate)), float(wander)


def quietest_density(readings: Float, rate: float) -> float:
    """Density of the noise of one accelerometer, one-sided [m/s^2/sqrt(Hz)].

    Parameters
    ----------
    readings : numpy.ndarray, shape (n,)
        Specific force [m/s^2].
    rate : float
        Samples per second [Hz].

    Returns
    -------
    float
        Root of the least mean power over the octaves from 20 Hz to 0.15 of the rate; the filter
        against aliases acts above.

    Examples
    --------
    >>> noise = 0.02 * np.random.default_rng(1).standard_normal(8000)
    >>> round(quietest(noise, 2000.0) * 1000**0.5, 3)
    0.02
    """
    from scipy.signal import welch

    frequency, power = welch(readings, rate, nperseg=min(2048, readings.size))
    high = 0.15 * rate
    low = min(_QUIET, 0.25 * high)
    levels = []
    while high > low * 1.5:
        band = power[(frequency > high / 2) & (frequency <= high)]
        if band.size >= 3:
            levels.append(float(np.mean(band)))
        high /= 2
    return max(float(np.sqrt(min(levels))) if levels else 0.0, _LEAST_DENSITY)
