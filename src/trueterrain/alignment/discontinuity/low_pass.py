"""Low-pass filter of values at equal spacing: zero phase, straight on at its ends and over gaps.

The Gaussian filter of ISO 16610-21 passes half of a wave as long as its cut-off. Here a straight
line is fitted under that Gaussian at every place (as ISO 16610-31 does without robustness). Amidst
even values that is the same filter; at ends and beside gaps it bends nothing that is straight.
"""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

_ALPHA = math.sqrt(math.log(2) / math.pi)  # so that half of a wave passes at the cut-off
_REACH = 1.0  # cut-offs to either side; the Gaussian is below 1e-6 there
_MOST = 20  # times the values, that the Gaussian reaches to either side at most
_FLAT = 1e-9  # of the greatest determinant, below which there is no straight line to fit


def low_pass(values: Floats, spacing: float, cut_off: float, *, closed: bool = False) -> Floats:
    """Smooth values along a path.

    Parameters
    ----------
    values : numpy.ndarray, shape (s,)
        Values at equal spacing; NaN where there is none.
    spacing : float
        Distance from one to the next [m].
    cut_off : float
        Wavelength of which half passes [m].
    closed : bool
        Whether the last value is followed by the first.

    Returns
    -------
    numpy.ndarray, shape (s,)
        Before the first value and behind the last it stays as it is there; over gaps too wide for
        the filter it is straight. NaN if there is no value at all.

    Raises
    ------
    ValueError
        If the cut-off is not greater than 0.

    Examples
    --------
    >>> x = np.arange(400) * 0.1
    >>> smooth = low_pass(np.cos(2 * np.pi * x / 5.0), 0.1, 5.0, closed=True)
    >>> float(np.ptp(smooth)) / 2
    0.5
    """
    if not 0 < cut_off < np.inf:
        message = f"cut_off must be greater than 0 m, got {cut_off}."
        raise ValueError(message)
    there = np.isfinite(values)
    if not there.any():
        return np.full(values.shape, np.nan)
    # if a course is many times shorter than that, only its mean passes anyway
    reach = min(max(int(_REACH * cut_off / spacing), 1), _MOST * values.size)
    x = np.arange(-reach, reach + 1) * spacing
    kernel = np.exp(-np.pi * (x / (_ALPHA * cut_off)) ** 2)
    padded = _pad_values(
        np.stack([there.astype(float), np.where(there, values, 0.0)]), reach, closed
    )
    weight, total = padded
    # moments about each place; np.correlate keeps the sign of x
    m0, m1, m2 = (np.correlate(weight, kernel * x**power, "valid") for power in range(3))
    b0, b1 = (np.correlate(total, kernel * x**power, "valid") for power in range(2))
    determinant = m0 * m2 - m1**2
    known = determinant > _FLAT * kernel.sum() * (kernel * x**2).sum()
    smooth = np.full(values.shape, np.nan)
    if not known.any():  # a single value, or so few that they tell no direction
        known, smooth = there, values.copy()
    else:
        smooth[known] = (b0 * m2 - b1 * m1)[known] / determinant[known]
    return _interpolate_gaps(smooth, _is_between(there, closed) & known, closed)


def _pad_values(values: Floats, more: int, closed: bool) -> Floats:
    if closed:
        return np.take(values, np.arange(-more, values.shape[1] + more), axis=1, mode="wrap")
    return np.pad(values, ((0, 0), (more, more)))


def _is_between(there: Flags, closed: bool) -> Flags:
    """Whether a place lies between the first and the last value."""
    if closed:
        return np.ones(there.size, np.bool_)
    found = np.flatnonzero(there)
    place = np.arange(there.size)
    return np.asarray((place >= found[0]) & (place <= found[-1]))


def _interpolate_gaps(values: Floats, known: Flags, closed: bool) -> Floats:
    """Straight lines over what is not known; constant beyond the ends."""
    place = np.arange(values.size, dtype=float)
    period = float(values.size) if closed else None
    return np.asarray(np.interp(place, place[known], values[known], period=period))
