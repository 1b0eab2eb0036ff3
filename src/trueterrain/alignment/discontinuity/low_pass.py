"""Zero-phase low-pass filter of equally spaced values with gaps.

The Gaussian filter of ISO 16610-21 transmits 50 % at its cut-off wavelength. Here a straight line
is fitted with Gaussian weights at each point (local linear regression, as ISO 16610-31 without
robustness). Away from ends and gaps this is the same filter; at ends and gaps it reproduces
straight lines.
"""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

_ALPHA = math.sqrt(math.log(2) / math.pi)  # for 50 % transmission at the cut-off (ISO 16610-21)
_REACH = 1.0  # half-width of the kernel in cut-offs; the Gaussian is below 1e-6 there
_MAX_REACH = 20  # maximum half-width of the kernel over the number of values
_FLAT = 1e-9  # determinant over that without gaps, below which no line can be fitted


def low_pass(values: Floats, spacing: float, cut_off: float, *, closed: bool = False) -> Floats:
    """Low-pass filter values along a path.

    Parameters
    ----------
    values : numpy.ndarray, shape (s,)
        Values at equal spacing; NaN in gaps.
    spacing : float
        Distance from one to the next [m].
    cut_off : float
        Wavelength with a transmission of 50 % [m].
    closed : bool
        Whether the last value is followed by the first.

    Returns
    -------
    numpy.ndarray, shape (s,)
        Constant before the first and after the last value; linear over gaps wider than the filter.
        NaN if there is no value.

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
    present = np.isfinite(values)
    if not present.any():
        return np.full(values.shape, np.nan)
    # for a path much shorter than the cut-off only the line through all values remains
    reach = min(max(int(_REACH * cut_off / spacing), 1), _MAX_REACH * values.size)
    x = np.arange(-reach, reach + 1) * spacing
    kernel = np.exp(-np.pi * (x / (_ALPHA * cut_off)) ** 2)
    padded = _pad_values(
        np.stack([present.astype(float), np.where(present, values, 0.0)]), reach, closed
    )
    weight, total = padded
    # weighted moments about each point; np.correlate keeps the sign of x
    m0, m1, m2 = (np.correlate(weight, kernel * x**power, "valid") for power in range(3))
    b0, b1 = (np.correlate(total, kernel * x**power, "valid") for power in range(2))
    determinant = m0 * m2 - m1**2
    known = determinant > _FLAT * kernel.sum() * (kernel * x**2).sum()
    smooth = np.full(values.shape, np.nan)
    if not known.any():  # a single value: no line can be fitted
        known, smooth = present, values.copy()
    else:
        smooth[known] = (b0 * m2 - b1 * m1)[known] / determinant[known]
    return _interpolate_gaps(smooth, _is_between(present, closed) & known, closed)


def _pad_values(values: Floats, more: int, closed: bool) -> Floats:
    if closed:
        return np.take(values, np.arange(-more, values.shape[1] + more), axis=1, mode="wrap")
    return np.pad(values, ((0, 0), (more, more)))


def _is_between(there: Flags, closed: bool) -> Flags:
    """Whether a point lies between the first and the last value."""
    if closed:
        return np.ones(there.size, np.bool_)
    found = np.flatnonzero(there)
    place = np.arange(there.size)
    return np.asarray((place >= found[0]) & (place <= found[-1]))


def _interpolate_gaps(values: Floats, known: Flags, closed: bool) -> Floats:
    """Interpolate unknown values linearly; constant beyond the ends."""
    place = np.arange(values.size, dtype=float)
    period = float(values.size) if closed else None
    return np.asarray(np.interp(place, place[known], values[known], period=period))
