"""Robust statistics, and covariance of sums of correlated observations."""

import math

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

#: Times the median absolute deviation is the standard deviation of normal errors: 1 / Φ⁻¹(3/4).
MAD_TO_SD = 1.482602218505602


def nmad(values: npt.ArrayLike) -> float:
    """Normalised median absolute deviation: an estimate of the standard deviation of normal values.

    Parameters
    ----------
    values : array_like
        Finite values, in any unit.

    Returns
    -------
    float
        1.4826 times the median of the magnitudes about the median; NaN without values.

    Examples
    --------
    >>> print(f"{nmad([0.001, 0.002, 0.003, 9.0]):.6f}")
    0.001483
    """
    array = np.asarray(values, dtype=float)
    if not array.size:
        return math.nan
    return MAD_TO_SD * float(np.median(np.abs(array - np.median(array))))


def newey_west_covariance(scores: Float, lags: int) -> Float:
    """Covariance of the sum of correlated rows (Newey and West, 1987), with Bartlett's window.

    Parameters
    ----------
    scores : numpy.ndarray, shape (n, k)
        Rows, which may be correlated with their neighbours.
    lags : int
        Distance in rows over which they are.

    Returns
    -------
    numpy.ndarray, shape (k, k)
        Covariance.

    Examples
    --------
    >>> newey_west_covariance(np.array([[1.0], [-1.0], [1.0], [-1.0]]), 0)
    array([[4.]])
    """
    from scipy.signal import fftconvolve

    lags = min(lags, len(scores) - 1)
    window = 1.0 - np.abs(np.arange(-lags, lags + 1)) / (lags + 1)
    smooth = fftconvolve(scores, window[:, None], mode="same", axes=0)
    covariance = scores.T @ smooth
    return np.asarray(0.5 * (covariance + covariance.T))
