"""Road classes of ISO 8608: limits of the displacement spectrum, and bands that smooth it."""

import math

import numpy as np
import numpy.typing as npt

from trueterrain.roughness._spectrum import FrequencyBands

__all__ = ["CLASS_LIMITS", "N0", "road_class", "smoothing_bands"]

#: Reference spatial frequency n0 [1/m].
N0 = 0.1

#: Lower limit, geometric mean and upper limit of Gd(n0) of each class [m³]; A has no lower and H no
#: upper limit, though their geometric means are given.
CLASS_LIMITS = {
    name: (
        8e-6 * 4**k if k else 0.0,
        16e-6 * 4**k,
        32e-6 * 4**k if name != "H" else math.inf,
    )
    for k, name in enumerate("ABCDEFGH")
}

# Centres of the bands, as exponents of 2, and how many bands an octave has
_OCTAVES = (np.arange(-9, -4, 1.0), 1)
_THIRDS = (np.arange(-13, -5, 1.0) / 3, 3)
_TWELFTHS = (np.arange(-22, 37, 1.0) / 12, 12)


def road_class(gd_n0: npt.ArrayLike) -> npt.NDArray[np.str_]:
    """Road class A to H of a displacement spectrum.

    Parameters
    ----------
    gd_n0 : array_like
        Gd(n0), one-sided, at 0.1 cycles/m [m³].

    Returns
    -------
    numpy.ndarray of str, shape of gd_n0
        Class; a value on a limit belongs to the rougher class, NaN to none ("").

    Notes
    -----
    The upper limit of a class is twice its geometric mean; the means grow by a factor of 4, from
    16e-6 m³. Limits are those published with the standard's table; whether a limit itself belongs
    to the smoother or the rougher class was not found.

    Examples
    --------
    >>> print(road_class([16e-6, 128e-6, 5e-4]))
    ['A' 'C' 'C']
    """
    value = np.asarray(gd_n0, dtype=float)
    if (value < 0).any():
        message = f"gd_n0 must not be less than 0 m³, got {np.nanmin(value):g}"
        raise ValueError(message)
    names = np.array([*CLASS_LIMITS, ""])
    upper = np.array([limit for _, _, limit in CLASS_LIMITS.values()])
    at = np.searchsorted(upper[:-1], value, side="right")
    return np.asarray(names[np.where(np.isnan(value), names.size - 1, at)])


def smoothing_bands() -> FrequencyBands:
    """Frequency bands over which ISO 8608 averages a spectrum before it is classed.

    Returns
    -------
    FrequencyBands
        Octaves centred at 2^-9 to 2^-5 cycles/m, third octaves to 2^-2, twelfth octaves from
        2^(-11/6), which is 0.2806, to 2^3.

    Notes
    -----
    Edges are exact: centre times 2^(+-1/2), 2^(+-1/6) and 2^(+-1/24). Rounded ones, as printed, are
    off by up to 1.4 %. The first twelfth overlaps with the last third, as in the printed table,
    which was seen in a public program; the body of the standard was not available.

    Examples
    --------
    >>> bands = smoothing_bands()
    >>> print(bands.centre.size, bands.centre[[0, 5, 13]].round(4))
    72 [0.002  0.0496 0.2806]
    """
    groups = (_OCTAVES, _THIRDS, _TWELFTHS)
    exponent = np.concatenate([at for at, _ in groups])
    half = np.concatenate([np.full(at.size, 0.5 / parts) for at, parts in groups])
    return FrequencyBands(
        lower=2.0 ** (exponent - half), centre=2.0**exponent, upper=2.0 ** (exponent + half)
    )
