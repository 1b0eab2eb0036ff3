"""Robust statistics."""

import math

import numpy as np
import numpy.typing as npt

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
