"""Least squares whose standard deviations allow for errors that neighbours share."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.core.newey_west import newey_west_covariance
from trueterrain.verify.findings.finding import CERTAIN

Floats = npt.NDArray[np.float64]

_BARTLETT = 1.5  # times rows over lags: degrees of freedom of a sum that his window smooths


@dataclass(frozen=True, kw_only=True, eq=False)
class RegressionEstimate:
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


def project_out(nuisance: Floats, columns: Floats) -> Floats:
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


def regress_signatures(
    marks: Floats, nuisance: Floats, error: Floats, *, lags: int
) -> RegressionEstimate:
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
        errors without correlation: few samples make the former too small by chance. Few independent
        errors know their own spread badly: it grows so that four standard deviations are as certain
        as those of many, by Student's t.

    Examples
    --------
    >>> x = np.arange(6.0)
    >>> found = regress(x[:, None] ** 2, np.stack([x**0, x], 1), 3 * x**2 + 5, lags=1)
    >>> found.value
    array([3.])
    """
    clean, bare = project_out(nuisance, marks), project_out(nuisance, error)
    inverse = np.linalg.inv(clean.T @ clean)
    value = inverse @ clean.T @ bare
    residual = bare - clean @ value
    unknowns = marks.shape[1] + nuisance.shape[1]
    free = max(error.size - unknowns, 1)
    scores = newey_west_covariance(clean * residual[:, None], lags)
    robust = inverse @ scores @ inverse * (error.size / free)
    white = inverse * float(residual @ residual) / free
    diagonal = np.maximum(np.diag(robust), 0.0)
    if not (diagonal > 0).all():
        return RegressionEstimate(value=value, covariance=white, residual=residual)
    grown = np.sqrt(np.maximum(np.diag(white) / diagonal, 1.0))
    known = min(_independent_count(residual) - unknowns, _BARTLETT * error.size / (lags + 1))
    grown *= _student_factor(max(known, 1.0))
    return RegressionEstimate(
        value=value, covariance=robust * np.outer(grown, grown), residual=residual
    )


def _independent_count(residual: Floats) -> float:
    """How many independent errors a residual amounts to, by its correlation up to its first end."""
    from scipy.signal import correlate

    power = float(residual @ residual)
    alike = correlate(residual, residual, method="fft")[residual.size :] / max(power, 1e-300)
    ends = np.flatnonzero(alike <= 0)
    run = alike[: int(ends[0])] if ends.size else alike
    return residual.size / (1.0 + 2.0 * float(run.sum()))


def _student_factor(free: float) -> float:
    """What Student's t asks more than the normal distribution, at the certainty of a finding."""
    from scipy.stats import norm, t

    return float(t.isf(norm.sf(CERTAIN), free)) / CERTAIN
