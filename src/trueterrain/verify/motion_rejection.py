"""Body-motion rejection: spectrum of the motion over that of the error of the profile."""

import numpy as np
import numpy.typing as npt
import xarray as xr

Floats = npt.NDArray[np.float64]

#: Half width of the main lobe of the tapers, times the bandwidth of the record.
HALF_BANDWIDTH = 2.5

#: Tapers over which spectra are means.
TAPERS = 4

#: Samples of which spectra are taken at least.
LEAST_SAMPLES = 32


def rejection_of(
    time: Floats, motion: Floats, error: Floats, *, confidence: float = 0.95
) -> xr.Dataset:
    """How much smaller errors are than the motion from which they come, by frequency.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Equally spaced times [s].
    motion, error : numpy.ndarray, shape (n,)
        Height of the laser, and error of the profile at the same time [m].
    confidence : float
        Share of repeats in which the interval of the rejection holds the truth.

    Returns
    -------
    xarray.Dataset
        Over ``frequency`` [Hz], from the half bandwidth of the tapers to half the sampling rate:
        ``motion`` and ``error`` [m²/Hz], ``rejection``, ``low`` and ``high`` [dB].

    Raises
    ------
    ValueError
        If there are less than 32 samples.

    Notes
    -----
    Spectra are means over four tapers of Slepian (Thomson 1982) of records without their trend, so
    that each has eight degrees of freedom; the interval of their ratio is that of Fisher's F, for
    errors that do not depend on the motion.

    Examples
    --------
    >>> time = np.linspace(0, 4, 2000, endpoint=False)
    >>> motion = np.random.default_rng(1).normal(size=2000)
    >>> found = rejection_of(time, motion, 0.01 * motion)
    >>> print(f"{float(found.rejection.min()):.1f} to {float(found.rejection.max()):.1f} dB")
    40.0 to 40.0 dB
    """
    from scipy.stats import f

    if time.size < LEAST_SAMPLES:
        message = f"time must hold at least {LEAST_SAMPLES} samples, got {time.size}."
        raise ValueError(message)
    step = (time[-1] - time[0]) / (time.size - 1)

    def density(values: Floats) -> Floats:
        return np.asarray(2 * step * np.mean(np.abs(turned_by_tapers(values)) ** 2, axis=0))

    frequency = np.fft.rfftfreq(time.size, step)
    seen = np.flatnonzero(frequency >= HALF_BANDWIDTH / (time.size * step))
    of_motion, of_error = density(motion)[seen], density(error)[seen]
    tiny = np.finfo(float).tiny
    rejection = 10 * np.log10(np.maximum(of_motion, tiny) / np.maximum(of_error, tiny))
    apart = 10 * np.log10(f.ppf(0.5 + 0.5 * confidence, 2 * TAPERS, 2 * TAPERS))
    columns = {
        "motion": of_motion,
        "error": of_error,
        "rejection": rejection,
        "low": rejection - apart,
        "high": rejection + apart,
    }
    return xr.Dataset(
        {name: ("frequency", values) for name, values in columns.items()},
        {"frequency": frequency[seen]},
    )


def turned_by_tapers(values: Floats) -> npt.NDArray[np.complex128]:
    """Fourier transforms of a record without its trend, one for each taper.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        The record.

    Returns
    -------
    numpy.ndarray, shape (4, n // 2 + 1)
        Over the frequencies of `numpy.fft.rfftfreq`; mean squares of them, times twice the step in
        time, are the spectral density.
    """
    from scipy.signal import detrend
    from scipy.signal.windows import dpss

    tapers = dpss(values.size, HALF_BANDWIDTH, TAPERS)
    return np.asarray(np.fft.rfft(tapers * detrend(values), axis=-1))
