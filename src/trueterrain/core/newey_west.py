"""Covariance of sums of correlated observations."""

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


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
