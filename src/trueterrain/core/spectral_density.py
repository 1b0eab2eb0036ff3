"""Spectral densities by Welch's method, and their confidence intervals."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


def welch_density(
    some: Floats, other: Floats, rate: float, size: int
) -> tuple[Floats, Complex, float]:
    """Cross density of two signals: Hann windows that overlap by half, each detrended.

    Parameters
    ----------
    some, other : numpy.ndarray, shape (n,)
        Signals; the same one twice gives its power.
    rate : float
        Samples per second [Hz].
    size : int
        Samples of a segment.

    Returns
    -------
    frequency : numpy.ndarray
        Without 0 [Hz].
    density : numpy.ndarray of complex
        One-sided cross density, in the units of both over Hz.
    degrees : float
        Degrees of freedom: twice the equivalent number of independent segments (Welch 1967).

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(20000)
    >>> frequency, density, degrees = welch_density(noise, noise, 200.0, 1000)
    >>> print(f"{density.real.mean():.3f} 1/Hz with {degrees:.0f} degrees of freedom")
    0.010 1/Hz with 74 degrees of freedom
    """
    from scipy.signal import csd, get_window

    window = get_window("hann", size)
    step = size - size // 2
    frequency, density = csd(some, other, rate, window=window, noverlap=size // 2, detrend="linear")
    count = 1 + (some.size - size) // step
    # segments overlap, so they are correlated by the overlap of their windows
    correlated = 0.0
    for apart in range(1, min(count, -(-size // step))):
        correlation = np.sum(window[: -apart * step] * window[apart * step :]) / np.sum(window**2)
        correlated += (1 - apart / count) * float(correlation) ** 2
    return frequency[1:], density[1:].astype(complex), 2 * count / (1 + 2 * correlated)


def density_interval(degrees: float, confidence: float) -> tuple[float, float]:
    """Confidence interval of a spectral density, relative to its estimate.

    Parameters
    ----------
    degrees : float
        Degrees of freedom of the estimate.
    confidence : float
        Probability that the interval contains the density, for random signals.

    Returns
    -------
    low, high : float
        Factors, from the distribution of chi-square.

    Examples
    --------
    >>> low, high = density_interval(40, 0.9)
    >>> print(f"{low:.2f} to {high:.2f}")
    0.72 to 1.51
    """
    from scipy.stats import chi2

    tail = 0.5 * (1 - confidence)
    return degrees / float(chi2.ppf(1 - tail, degrees)), degrees / float(chi2.ppf(tail, degrees))
