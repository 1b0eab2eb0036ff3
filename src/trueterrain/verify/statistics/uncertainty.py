"""Confidence intervals of accuracy figures from correlated errors.

Neighbouring errors are correlated, and a few large ones may dominate a figure. Both make the
effective number of independent errors smaller than their count.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.verify.statistics.autocorrelation import count_for_mean, count_for_power

Floats = npt.NDArray[np.float64]

_REPEATS = 2000
_SEED = 1964

#: Smallest number of errors of a figure.
MIN_ERRORS = 8

#: Number of independent errors from which an interval is trusted.
TRUSTED_COUNT = 20.0

_LENGTH_FACTOR = 3.0  # block length over that for the mean: variances need longer blocks
_MIN_BLOCKS = 3.0  # effective number of blocks of a standard deviation
# The correlation is estimated from the same few errors, and is underestimated where these happen to
# be small: variances 1 / count are enlarged by 1 + COST / count. Calibrated by simulation.
_COST = 4.0
_MIN_COUNT_MEAN, _MIN_COUNT_SQUARE = 2.0, 1.0  # effective number of errors for an interval
_LONGEST_WAVES = 8  # in the band of the longest ones; each further band holds twice as many
_LEVEL_BETWEEN = 0.8  # probability level of the F test of differences between runs


@dataclass(frozen=True, kw_only=True)
class AccuracyFigure:
    """A figure of accuracy with its confidence interval."""

    value: float
    "The figure [m]."

    low: float
    "Lower end of the interval [m]."

    high: float
    "Upper end of the interval [m]."

    confidence: float
    "Fraction of repeats of the test in which the interval holds the true value."

    block: int
    "Length of a bootstrap block."

    independent: float
    "Effective number of independent normal errors of the figure."

    @property
    def trusted(self) -> bool:
        """Whether there are enough independent errors for the interval: at least 20."""
        return self.independent >= TRUSTED_COUNT


def rms_figure(
    error: npt.ArrayLike,
    *,
    confidence: float = 0.95,
    block: int | None = None,
    most: float = math.inf,
) -> AccuracyFigure:
    """Root mean square of correlated errors, with its interval.

    Parameters
    ----------
    error : array_like, shape (n,) or (k, n)
        Errors in equal steps [m]; several rows are independent runs over the same places.
    confidence : float
        Fraction of repeats in which the interval is to hold the true value.
    block : int, optional
        Length of a bootstrap block; by default chosen from the correlation of the errors.
    most : float
        Upper bound of the number of independent errors, as for edges that were each met once.

    Returns
    -------
    AccuracyFigure
        The root mean square [m].

    Raises
    ------
    ValueError
        If there are fewer than 8 errors, one is not finite, or the confidence is not from 0 to 1.

    Notes
    -----
    The true value is the root mean square over all repeats of the test. Three methods estimate the
    uncertainty of one mean square, and the widest interval is taken:

    - a circular block bootstrap of the squares (Politis and Romano 1992) with the block length of
      Politis and White (2004, corrected 2009). It allows for occasional large errors, but not for
      correlation longer than a block;
    - an autoregressive model of normal errors, which allows for correlation over much of the
      record. The mean, the differences between the means of runs, and the remaining errors are
      treated separately. The larger variance of these two methods gives the effective number
      `independent` of normal errors, whose chi-square distribution gives an interval
      (Satterthwaite 1946);
    - the power of normal errors in octave bands of wavelength: the few long waves may have much
      more power than they happen to have in the record, hidden by the noise of the short ones. The
      power of each band has a chi-square distribution with as many degrees as waves; the sum is
      simulated (fiducial interval of a sum of variances, Weerahandi 1993).

    Below 20 independent errors the interval is wide and its coverage is some percent below
    `confidence`. No interval allows for events that are not in the record, such as a single beam
    that meets an upright face.

    Examples
    --------
    >>> found = rms_figure(1e-3 * np.random.default_rng(1).normal(size=400))
    >>> print(f"{1e3 * found.value:.2f} mm ({1e3 * found.low:.2f} to {1e3 * found.high:.2f})")
    0.91 mm (0.84 to 1.00)
    """
    from scipy.stats import chi2

    rows = _error_rows(error, confidence)
    squares = (rows**2).mean(axis=0)
    power = float(squares.mean())
    value = math.sqrt(power)
    length, block_sd = _block_sd(squares, block)
    if power == 0.0:
        return AccuracyFigure(
            value=0.0,
            low=0.0,
            high=0.0,
            confidence=confidence,
            block=length,
            independent=min(float(rows.size), most),
        )
    mean = _mean_estimate(rows, block)
    variance = max(block_sd**2, _normal_variance(rows, mean)) / power**2
    # the relative variance of a mean square of `count` normal values is 2 / count
    count = 2 / max(variance, 1e-12)
    count = min(max(count / (1 + _COST / count), _MIN_COUNT_SQUARE), most)
    levels = np.array([0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence])
    low, high = power * count / chi2.ppf(levels[::-1], count)
    band_low, band_high = np.quantile(_band_powers(rows, mean), levels)
    return AccuracyFigure(
        value=value,
        low=math.sqrt(min(low, band_low)),
        high=math.sqrt(max(high, band_high)),
        confidence=confidence,
        block=length,
        independent=min(count, float(rows.size)),
    )


def mean_figure(
    error: npt.ArrayLike,
    *,
    confidence: float = 0.95,
    block: int | None = None,
    most: float = math.inf,
) -> AccuracyFigure:
    """Mean of correlated errors, with its interval.

    Parameters
    ----------
    error, confidence, block, most
        See `rms_figure`.

    Returns
    -------
    AccuracyFigure
        The mean [m].

    Raises
    ------
    ValueError
        See `rms_figure`.

    Notes
    -----
    The standard deviation is the larger of those by blocks and by an autoregressive model, as in
    `rms_figure`. If the means of runs differ significantly more, it is that between runs, which
    includes errors that are constant in a run.

    Examples
    --------
    >>> mean_figure(np.full(20, 0.002)).value
    0.002
    """
    from scipy.stats import t

    rows = _error_rows(error, confidence)
    mean = _mean_estimate(rows, block)
    count = min(mean.independent, max(most, _MIN_COUNT_MEAN))
    half_width = float(t.ppf(0.5 + 0.5 * confidence, count - 1)) * mean.sd
    return AccuracyFigure(
        value=mean.value,
        low=mean.value - half_width,
        high=mean.value + half_width,
        confidence=confidence,
        block=mean.block,
        independent=count,
    )


class _MeanEstimate(NamedTuple):
    """A mean, its standard deviation, its effective number of values, and the block length."""

    value: float
    sd: float
    independent: float
    block: int


def _error_rows(error: npt.ArrayLike, confidence: float) -> Floats:
    """Check errors, and return them as rows of runs."""
    rows = np.atleast_2d(np.asarray(error, dtype=np.float64))
    if rows.shape[1] < MIN_ERRORS or not np.isfinite(rows).all():
        message = f"error must hold at least {MIN_ERRORS} finite values, got {rows.shape[1]}."
        raise ValueError(message)
    if not 0 < confidence < 1:
        message = f"confidence must be between 0 and 1, got {confidence}."
        raise ValueError(message)
    return rows


def _mean_estimate(rows: Floats, block: int | None) -> _MeanEstimate:
    """Mean of all errors, with its standard deviation."""
    from scipy.stats import f

    runs = rows.shape[0]
    values = rows.mean(axis=0)
    value = float(values.mean())
    length, block_sd = _block_sd(values, block)
    deviation = float(values.std())
    count = count_for_mean(values - value)
    if block_sd > 0:
        count = min(count, (deviation / block_sd) ** 2)
    count = max(count / (1 + _COST / count), _MIN_COUNT_MEAN)
    sd = deviation / math.sqrt(count - 1)
    if runs > 1:
        between = float(rows.mean(axis=1).std(ddof=1)) / math.sqrt(runs)
        if between**2 > sd**2 * float(f.ppf(_LEVEL_BETWEEN, runs - 1, count - 1)):
            return _MeanEstimate(value, between, float(runs), length)
    return _MeanEstimate(value, sd, count, length)


def _normal_variance(rows: Floats, mean: _MeanEstimate) -> float:
    """Variance of the mean square of correlated normal errors [m⁴]."""
    runs = rows.shape[0]
    means = rows.mean(axis=1)
    shared = (rows - means[:, None]).mean(axis=0)
    found = 4 * (mean.value * mean.sd) ** 2
    found += 2 * float(np.mean(shared**2)) ** 2 / count_for_power(shared)
    if runs > 1:
        deviation = rows - means[:, None] - shared
        reciprocal = float(np.mean([1 / count_for_power(row) for row in deviation]))
        found += (
            2
            * (float(means.var()) ** 2 + float(np.mean(deviation**2)) ** 2 * reciprocal)
            / (runs - 1)
        )
    return found


def _band_powers(rows: Floats, mean: _MeanEstimate) -> Floats:
    """Sample of the fiducial distribution of the mean square, from power in octave bands [m²]."""
    from scipy.fft import dct

    runs, n = rows.shape
    rng = np.random.default_rng(_SEED)
    first = _LONGEST_WAVES * (2 ** np.arange(int(math.log2(n / _LONGEST_WAVES)) + 1) - 1)
    waves = np.diff(np.append(first, n))
    shared = rows.mean(axis=0)
    powers = [np.square(dct(shared - shared.mean(), norm="ortho"))]
    counts = [waves - (first == 0)]
    if runs > 1:
        powers.append(np.square(dct(rows - shared, norm="ortho")).mean(axis=0))
        counts.append((runs - 1) * waves)
    found = np.square(mean.value + mean.sd * rng.standard_t(mean.independent - 1, _REPEATS))
    for power, count in zip(powers, counts, strict=True):
        drawn = count / rng.chisquare(count, (_REPEATS, count.size))
        found += drawn @ np.add.reduceat(power, first) / n
    return np.asarray(found)


def _block_sd(values: Floats, block: int | None) -> tuple[int, float]:
    """Length of blocks, and standard deviation of the mean by a circular block bootstrap."""
    n = values.size
    max_length = max(1, int(n / _MIN_BLOCKS))
    length = min(_block_length(values) if block is None else block, max_length)
    if length < 1:
        message = f"block must be at least 1, got {block}."
        raise ValueError(message)
    sums = np.concatenate([[0.0], np.cumsum(np.concatenate([values, values[:length]]))])
    means = (sums[length : length + n] - sums[:n]) / length
    # bootstrap in closed form: n / length blocks, less one for the mean
    return length, float(means.std()) / math.sqrt(n / length - 1)


def _block_length(values: Floats) -> int:
    """Length of circular blocks for the correlation of the values (Politis and White 2004)."""
    n = values.size
    x = values - values.mean()
    power = float(x @ x)
    if power <= 1e-24 * max(1.0, float(values @ values)):
        return 1
    max_lag = min(n - 1, math.ceil(math.sqrt(n)) + max(5, math.ceil(math.log10(n))))
    r = np.array([float(x[: n - k] @ x[k:]) for k in range(max_lag + 1)]) / power
    run = max(5, math.ceil(math.sqrt(math.log10(n))))
    small = np.abs(r[1:]) < 2 * math.sqrt(math.log10(n) / n)
    first = next(
        (k for k in range(small.size - run + 1) if small[k : k + run].all()), small.size // 2
    )
    # flat-top window up to twice the lag after which correlations are insignificant
    lag = min(2 * max(first, 1), max_lag)
    k = np.arange(-lag, lag + 1)
    taper = np.clip(2 * (1 - np.abs(k) / lag), 0.0, 1.0)
    weighted = taper * r[np.abs(k)]
    g, spectral = float(np.sum(weighted * np.abs(k))), float(weighted.sum())
    if spectral <= 0:
        return 1
    length = _LENGTH_FACTOR * (2 * g**2 / (4 / 3 * spectral**2)) ** (1 / 3) * n ** (1 / 3)
    return max(1, min(int(length) + 1, int(min(3 * math.sqrt(n), n / 3))))
