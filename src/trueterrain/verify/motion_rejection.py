"""Body-motion rejection: spectral density of the motion over that of the profile's error."""

import numpy as np
import numpy.typing as npt
import xarray as xr

Floats = npt.NDArray[np.float64]

#: Half bandwidth of the tapers, in units of the reciprocal of the record's length.
HALF_BANDWIDTH = 2.5

#: Number of tapers over which spectra are averaged.
TAPERS = 4

#: Smallest number of samples of a spectrum.
MIN_SAMPLES = 32


def rejection_spectrum(
    time: Floats, motion: Floats, error: Floats, *, confidence: float = 0.95
) -> xr.Dataset:
    """Ratio of motion to error of the profile by frequency, in decibels.

    Use it to judge how well navigation and fusion remove the motion of the vehicle.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Equally spaced times [s].
    motion, error : numpy.ndarray, shape (n,)
        Height of the laser, and error of the profile at the same time [m].
    confidence : float
        Fraction of repeats in which the interval of the rejection holds the true value.

    Returns
    -------
    xarray.Dataset
        Over ``frequency`` [Hz], from the half bandwidth of the tapers to half the sampling rate:
        ``motion`` and ``error`` [m²/Hz], ``rejection``, ``low`` and ``high`` [dB].

    Raises
    ------
    ValueError
        If there are fewer than 32 samples.

    Notes
    -----
    Spectra are means over four Slepian tapers (Thomson 1982) of detrended records, so that each has
    eight degrees of freedom; the interval of their ratio follows from the F distribution, for
    errors that are independent of the motion.

    Examples
    --------
    >>> time = np.linspace(0, 4, 2000, endpoint=False)
    >>> motion = np.random.default_rng(1).normal(size=2000)
    >>> found = rejection_spectrum(time, motion, 0.01 * motion)
    >>> print(f"{float(found.rejection.min()):.1f} to {float(found.rejection.max()):.1f} dB")
    40.0 to 40.0 dB
    """
    from scipy.stats import f

    if time.size < MIN_SAMPLES:
        message = f"time must hold at least {MIN_SAMPLES} samples, got {time.size}."
        raise ValueError(message)
    step = (time[-1] - time[0]) / (time.size - 1)

    def density(values: Floats) -> Floats:
        return np.asarray(2 * step * np.mean(np.abs(tapered_transforms(values)) ** 2, axis=0))

    frequency = np.fft.rfftfreq(time.size, step)
    resolved = np.flatnonzero(frequency >= HALF_BANDWIDTH / (time.size * step))
    of_motion, of_error = density(motion)[resolved], density(error)[resolved]
    tiny = np.finfo(float).tiny
    rejection = 10 * np.log10(np.maximum(of_motion, tiny) / np.maximum(of_error, tiny))
    half_width = 10 * np.log10(f.ppf(0.5 + 0.5 * confidence, 2 * TAPERS, 2 * TAPERS))
    columns = {
        "motion": of_motion,
        "error": of_error,
        "rejection": rejection,
        "low": rejection - half_width,
        "high": rejection + half_width,
    }
    return xr.Dataset(
        {name: ("frequency", values) for name, values in columns.items()},
        {"frequency": frequency[resolved]},
    )


def tapered_transforms(values: Floats) -> npt.NDArray[np.complex128]:
    """Fourier transforms of a detrended record, one for each taper.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        The record.

    Returns
    -------
    numpy.ndarray, shape (4, n // 2 + 1)
        At the frequencies of `numpy.fft.rfftfreq`; their mean square times twice the time step is
        the one-sided spectral density.
    """
    from scipy.signal import detrend
    from scipy.signal.windows import dpss

    tapers = dpss(values.size, HALF_BANDWIDTH, TAPERS)
    return np.asarray(np.fft.rfft(tapers * detrend(values), axis=-1))
