"""Least squares whose standard deviations allow for errors that neighbours share."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion.clocks import long_run

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """What a regression found."""

    value: Floats
    "Coefficients of the marks, shape (k,)."

    covariance: Floats
    "Their covariance, shape (k, k)."

    residual: Floats
    "What is left, shape (n,)."

    @property
    def sd(self) -> Floats:
        """Standard deviations of the coefficients, shape (k,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def without(nuisance: Floats, columns: Floats) -> Floats:
    """What of columns is not made of others.

    Parameters
    ----------
    nuisance : numpy.ndarray, shape (n, m)
        Columns whose share is taken out.
    columns : numpy.ndarray, shape (n,) or (n, k)
        Columns from which it is taken.

    Returns
    -------
    numpy.ndarray
        The rest, of the shape of `columns`.

    Examples
    --------
    >>> without(np.ones((3, 1)), np.array([1.0, 2.0, 3.0]))
    array([-1., 0., 1.])
    """
    share = np.linalg.lstsq(nuisance, columns, rcond=None)[0]
    return np.asarray(columns - nuisance @ share)


def regress(marks: Floats, nuisance: Floats, error: Floats, *, lags: int) -> Estimate:
    """How much of each mark errors bear, beside what may be anything.

    Parameters
    ----------
    marks : numpy.ndarray, shape (n, k)
        Error that a unit of each fault leaves.
    nuisance : numpy.ndarray, shape (n, m)
        What errors may hold besides, such as offset and trend.
    error : numpy.ndarray, shape (n,)
        Errors, in the order in which neighbours are alike.
    lags : int
        Neighbours over which they are.

    Returns
    -------
    Estimate
        By least squares. The covariance is that of Newey and West (1987), and at least that of
        errors without correlation: few samples make the former too small by chance.

    Examples
    --------
    >>> x = np.arange(6.0)
    >>> found = regress(x[:, None] ** 2, np.stack([x**0, x], 1), 3 * x**2 + 5, lags=1)
    >>> found.value
    array([3.])
    """
    clean, bare = without(nuisance, marks), without(nuisance, error)
    inverse = np.linalg.inv(clean.T @ clean)
    value = inverse @ clean.T @ bare
    residual = bare - clean @ value
    free = max(error.size - marks.shape[1] - nuisance.shape[1], 1)
    robust = inverse @ long_run(clean * residual[:, None], lags) @ inverse * (error.size / free)
    white = inverse * float(residual @ residual) / free
    diagonal = np.maximum(np.diag(robust), 0.0)
    tiny = np.finfo(float).tiny
    grown = np.sqrt(np.maximum(np.diag(white) / np.maximum(diagonal, tiny), 1.0))
    if not (diagonal > 0).all():
        return Estimate(value=value, covariance=white, residual=residual)
    return Estimate(value=value, covariance=robust * np.outer(grown, grown), residual=residual)
