"""Least squares with standard deviations that allow for correlated errors."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.core.statistics import newey_west_covariance

#: Standard deviations from zero beyond which a fault is detected: a false alarm in 16,000 cases.
CERTAIN = 4.0

Floats = npt.NDArray[np.float64]

_BARTLETT = 1.5  # degrees of freedom over (rows / lags) of a spectral estimate by Bartlett's window


@dataclass(frozen=True, kw_only=True, eq=False)
class RegressionEstimate:
    """Estimates of a regression."""

    value: Floats
    "Coefficients of the signatures, shape (k,)."

    covariance: Floats
    "Their covariance, shape (k, k)."

    residual: Floats
    "Residuals, shape (n,)."

    @property
    def sd(self) -> Floats:
        """Standard deviations of the coefficients, shape (k,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def project_out(nuisance: Floats, columns: Floats) -> Floats:
    """Residuals of columns after regression on nuisance columns.

    Parameters
    ----------
    nuisance : numpy.ndarray, shape (n, m)
        Columns of the regression.
    columns : numpy.ndarray, shape (n,) or (n, k)
        Columns whose residuals are returned.

    Returns
    -------
    numpy.ndarray
        Residuals, in the shape of `columns`.

    Examples
    --------
    >>> project_out(np.ones((3, 1)), np.array([1.0, 2.0, 3.0]))
    array([-1., 0., 1.])
    """
    coefficients = np.linalg.lstsq(nuisance, columns, rcond=None)[0]
    return np.asarray(columns - nuisance @ coefficients)


def regress_signatures(
    signatures: Floats, nuisance: Floats, error: Floats, *, lags: int
) -> RegressionEstimate:
    """Regression of errors on fault signatures, with nuisance functions.

    Parameters
    ----------
    signatures : numpy.ndarray, shape (n, k)
        Error by a unit of each fault.
    nuisance : numpy.ndarray, shape (n, m)
        Other components of the errors, such as offset and trend.
    error : numpy.ndarray, shape (n,)
        Errors, in an order in which neighbours are correlated.
    lags : int
        Number of neighbours over which they are correlated.

    Returns
    -------
    RegressionEstimate
        By least squares. The covariance is that of Newey and West (1987), and at least that of
        uncorrelated errors, as the former is too small by chance for small samples. For few
        independent errors the standard deviations are enlarged by Student's t, so that four of them
        have the same significance as for many.

    Examples
    --------
    >>> x = np.arange(6.0)
    >>> found = regress_signatures(x[:, None] ** 2, np.stack([x**0, x], 1), 3 * x**2 + 5, lags=1)
    >>> found.value
    array([3.])
    """
    # nuisance functions are eliminated first (Frisch and Waugh 1933)
    clean, cleaned_error = project_out(nuisance, signatures), project_out(nuisance, error)
    inverse = np.linalg.inv(clean.T @ clean)
    value = inverse @ clean.T @ cleaned_error
    residual = cleaned_error - clean @ value
    unknowns = signatures.shape[1] + nuisance.shape[1]
    degrees = max(error.size - unknowns, 1)
    robust = (
        inverse
        @ newey_west_covariance(clean * residual[:, None], lags)
        @ inverse
        * (error.size / degrees)
    )
    white = inverse * float(residual @ residual) / degrees
    diagonal = np.maximum(np.diag(robust), 0.0)
    if not (diagonal > 0).all():
        return RegressionEstimate(value=value, covariance=white, residual=residual)
    enlargement = np.sqrt(np.maximum(np.diag(white) / diagonal, 1.0))
    independent = min(_independent_count(residual) - unknowns, _BARTLETT * error.size / (lags + 1))
    enlargement *= _student_factor(max(independent, 1.0))
    return RegressionEstimate(
        value=value, covariance=robust * np.outer(enlargement, enlargement), residual=residual
    )


def _independent_count(residual: Floats) -> float:
    """Effective number of residuals, from their autocorrelation up to its first zero crossing."""
    from scipy.signal import correlate

    power = float(residual @ residual)
    correlation = correlate(residual, residual, method="fft")[residual.size :] / max(power, 1e-300)
    ends = np.flatnonzero(correlation <= 0)
    positive = correlation[: int(ends[0])] if ends.size else correlation
    return residual.size / (1.0 + 2.0 * float(positive.sum()))


def _student_factor(degrees: float) -> float:
    """Ratio of the quantiles of Student's t and the normal distribution at four deviations."""
    from scipy.stats import norm, t

    return float(t.isf(norm.sf(CERTAIN), degrees)) / CERTAIN
