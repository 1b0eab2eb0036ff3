"""Autocorrelation of errors, and the effective number of independent errors."""

import math

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_MAX_ORDER = 6  # of the autoregression; at most a third of the number of values
_TINY = 1e-12  # smallest fraction of the power that an autoregression leaves unexplained


def autocorrelation_function(values: Floats) -> Floats:
    """Autocorrelation function, from an autoregressive model.

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
    The model is fitted by Burg's recursion (Burg 1967); its order minimises Akaike's criterion with
    the correction of Hurvich and Tsai (1989) for small samples. Unlike the sample autocorrelation,
    it extends to lags near the length of the record and has no noise where values are independent.

    Examples
    --------
    >>> white = np.random.default_rng(1).normal(size=20000)
    >>> print(f"{autocorrelation_function(np.convolve(white, 0.8 ** np.arange(40)))[1]:.1f}")
    0.8
    """
    from scipy.signal import lfilter, lfiltic

    n = values.size
    found = np.zeros(n)
    found[0] = 1.0
    if not values.any():
        return found
    weights, known, remainder = np.ones(1), [1.0], 1.0
    forward, backward = values[1:], values[:-1]
    lowest, best, first = 2 * n / (n - 2), weights, list(known)
    for order in range(1, min(_MAX_ORDER, n // 3) + 1):
        # Burg: the reflection coefficient minimises forward plus backward prediction errors
        power = float(forward @ forward + backward @ backward)
        reflection = -2 * float(forward @ backward) / power if power > 0 else 0.0
        weights = np.append(weights, 0.0)
        weights = weights + reflection * weights[::-1]
        known.append(-float(weights[1:] @ known[::-1]))
        remainder = max(remainder * (1 - reflection**2), _TINY)
        criterion = n * math.log(remainder) + 2 * (order + 1) * n / (n - order - 2)
        if criterion < lowest:
            lowest, best, first = criterion, weights, list(known)
        forward, backward = (
            (forward + reflection * backward)[1:],
            (backward + reflection * forward)[:-1],
        )
    found[: len(first)] = first
    if best.size > 1 and n > len(first):
        # the recursion of the model continues the correlations beyond its order
        state = lfiltic([1.0], best, first[::-1])
        found[len(first) :] = lfilter([1.0], best, np.zeros(n - len(first)), zi=state)[0]
    return found


def count_for_mean(values: Floats) -> float:
    """Effective number of values for their mean: n over the variance inflation by correlation.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Values about zero, in equal steps.

    Returns
    -------
    float
        n for uncorrelated values.

    Examples
    --------
    >>> count_for_mean(np.random.default_rng(1).normal(size=500))
    500.0
    """
    n = values.size
    weights = 1 - np.arange(1, n) / n
    return n / max(1 + 2 * float(weights @ autocorrelation_function(values)[1:]), 1.0)


def count_for_power(values: Floats) -> float:
    """Effective number of normal values for their mean square.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Normal values about zero, in equal steps.

    Returns
    -------
    float
        n for uncorrelated values, 2 for a sine wave.

    Examples
    --------
    >>> wave = np.sin(0.3 * np.arange(500)) + 0.01 * np.random.default_rng(1).normal(size=500)
    >>> print(f"{count_for_power(wave):.1f}")
    2.0
    """
    n = values.size
    weights = 1 - np.arange(1, n) / n
    # squares of normal values have the squared correlation (Isserlis 1918)
    return n / (1 + 2 * float(weights @ autocorrelation_function(values)[1:] ** 2))
