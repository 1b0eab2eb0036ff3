"""How many independent errors so many errors are, whose neighbours are alike."""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_MOST_ORDER = 6  # coefficients of an autoregression, of at most a third as many values
_TINY = 1e-12  # share of the power that an autoregression leaves at least


def autocorrelation_function(values: Floats) -> Floats:
    """Correlation of values with those so many places further on.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Values about zero, in equal steps.

    Returns
    -------
    numpy.ndarray, shape (n,)
        Correlation over 0 to n - 1 places.

    Notes
    -----
    That of the autoregression which Burg's recursion finds (Burg 1967), of the order with the least
    criterion of Akaike as Hurvich and Tsai (1989) correct it for few values. Unlike the products of
    the values themselves it goes on where the record ends, and is quiet where nothing is alike.

    Examples
    --------
    >>> white = np.random.default_rng(1).normal(size=20000)
    >>> print(f"{correlation(np.convolve(white, 0.8 ** np.arange(40)))[1]:.1f}")
    0.8
    """
    from scipy.signal import lfilter, lfiltic

    n = values.size
    found = np.zeros(n)
    found[0] = 1.0
    if not values.any():
        return found
    weights, known, left = np.ones(1), [1.0], 1.0
    forward, backward = values[1:], values[:-1]
    least, best, first = 2 * n / (n - 2), weights, list(known)
    for order in range(1, min(_MOST_ORDER, n // 3) + 1):
        power = float(forward @ forward + backward @ backward)
        reflection = -2 * float(forward @ backward) / power if power > 0 else 0.0
        weights = np.append(weights, 0.0)
        weights = weights + reflection * weights[::-1]
        known.append(-float(weights[1:] @ known[::-1]))
        left = max(left * (1 - reflection**2), _TINY)
        criterion = n * math.log(left) + 2 * (order + 1) * n / (n - order - 2)
        if criterion < least:
            least, best, first = criterion, weights, list(known)
        forward, backward = (
            (forward + reflection * backward)[1:],
            (backward + reflection * forward)[:-1],
        )
    found[: len(first)] = first
    if best.size > 1 and n > len(first):
        going = lfiltic([1.0], best, first[::-1])
        found[len(first) :] = lfilter([1.0], best, np.zeros(n - len(first)), zi=going)[0]
    return found


def count_for_mean(values: Floats) -> float:
    """How many independent values would know their mean as well.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Values about zero, in equal steps.

    Returns
    -------
    float
        n for values that are not alike.

    Examples
    --------
    >>> count_for_mean(np.random.default_rng(1).normal(size=500))
    500.0
    """
    n = values.size
    weights = 1 - np.arange(1, n) / n
    return n / max(1 + 2 * float(weights @ autocorrelation_function(values)[1:]), 1.0)


def count_for_power(values: Floats) -> float:
    """How many independent normal values would know their mean square as well as these.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Normal values about zero, in equal steps.

    Returns
    -------
    float
        n for values that are not alike, 2 for a wave.

    Examples
    --------
    >>> wave = np.sin(0.3 * np.arange(500)) + 0.01 * np.random.default_rng(1).normal(size=500)
    >>> print(f"{count_for_power(wave):.1f}")
    2.0
    """
    n = values.size
    weights = 1 - np.arange(1, n) / n
    return n / (1 + 2 * float(weights @ autocorrelation_function(values)[1:] ** 2))
