"""Uncertainty of figures of accuracy: how many independent errors they were taken of.

Errors of neighbours are alike, and a few large ones may govern a figure. Both leave fewer errors
that tell of others than were counted.
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

#: Errors of which a figure is taken at least.
LEAST = 8

#: Independent errors from which an interval is trusted.
ENOUGH = 20.0

_LONGER = 3.0  # times the length for the mean: spreads of correlated errors need more
_FEWEST_BLOCKS = 3.0  # effective blocks of which a spread is taken
# How alike errors are is learned from the same few errors, which look less alike where they happen
# to be small: variances by 1 / count are enlarged by 1 + COST / count. Found by simulation.
_COST = 4.0
_FEWEST_MEAN, _FEWEST_SQUARE = 2.0, 1.0  # of which an interval is given
_LONGEST_WAVES = 8  # in the band of the longest ones; each further band holds twice as many
_BY_CHANCE = 0.8  # share of repeats in which runs differ by less, if blocks say it all


@dataclass(frozen=True, kw_only=True)
class AccuracyFigure:
    """A figure of accuracy and the interval that holds its true value."""

    value: float
    "The figure [m]."

    low: float
    "Lower end of the interval [m]."

    high: float
    "Upper end of the interval [m]."

    confidence: float
    "Share of repeats of the test in which the interval holds the truth."

    block: int
    "Neighbours that were drawn together."

    independent: float
    "How many independent normal errors would know the figure as well."

    @property
    def trusted(self) -> bool:
        """Whether so many independent errors tell how large others would be: at least 20."""
        return self.independent >= ENOUGH


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
        Share of repeats in which the interval shall hold the truth.
    block : int, optional
        Neighbours that are drawn together; by default as many as the errors ask for.
    most : float
        Independent errors that there can be at most, as of edges that were each met once.

    Returns
    -------
    Figure
        The root mean square [m].

    Raises
    ------
    ValueError
        If there are less than 8 errors, one is not finite, or the confidence is no share.

    Notes
    -----
    The true value is the root mean square over all repeats of the test. How far the mean square of
    one is from it is told in three ways, and the widest interval is taken:

    - from the squares, of which circular blocks (Politis and Romano 1992) of the length of Politis
      and White (2004, with the correction of 2009) are drawn: that knows errors that are large now
      and then, but nothing of what is longer than a block;
    - from the correlation of normal errors, by an autoregression: that knows errors which are alike
      over much of the record. The mean, what differs between the means of runs, and the rest
      count apart. A mean square of the larger of both spreads is that of `independent` normal
      errors, whose chi-square distribution gives the interval (Satterthwaite 1946);
    - from the power of normal errors in bands of wavelength, octave by octave: the few long waves
      may be much larger than they happen to be in the record, below the noise of the short ones.
      Each band is as uncertain as chi-square of as many degrees as it has waves, and the sum is
      drawn (a fiducial interval of a sum of variances, Weerahandi 1993).

    Below 20 independent errors the interval is wide and holds the truth a few percent less often
    than claimed; what did not happen in the record, as the one beam that meets an upright face, no
    interval knows.

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
    length, spread = _block_sd(squares, block)
    if power == 0.0:
        return AccuracyFigure(
            value=0.0,
            low=0.0,
            high=0.0,
            confidence=confidence,
            block=length,
            independent=min(float(rows.size), most),
        )
    mean = _of_mean(rows, block)
    variance = max(spread**2, _of_normal(rows, mean)) / power**2
    count = 2 / max(variance, 1e-12)
    count = min(max(count / (1 + _COST / count), _FEWEST_SQUARE), most)
    shares = np.array([0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence])
    low, high = power * count / chi2.ppf(shares[::-1], count)
    lower, higher = np.quantile(_by_bands(rows, mean), shares)
    return AccuracyFigure(
        value=value,
        low=math.sqrt(min(low, lower)),
        high=math.sqrt(max(high, higher)),
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
        As by `rms_figure`.

    Returns
    -------
    Figure
        The mean [m].

    Raises
    ------
    ValueError
        As by `rms_figure`.

    Notes
    -----
    The spread is that of blocks or of an autoregression, as by `rms_figure`; or, where means of
    runs differ by more than that, the one between them: what is constant in a run is then seen.

    Examples
    --------
    >>> mean_figure(np.full(20, 0.002)).value
    0.002
    """
    from scipy.stats import t

    rows = _error_rows(error, confidence)
    mean = _of_mean(rows, block)
    count = min(mean.independent, max(most, _FEWEST_MEAN))
    reach = float(t.ppf(0.5 + 0.5 * confidence, count - 1)) * mean.spread
    return AccuracyFigure(
        value=mean.value,
        low=mean.value - reach,
        high=mean.value + reach,
        confidence=confidence,
        block=mean.block,
        independent=count,
    )


class _MeanEstimate(NamedTuple):
    """A mean, its standard deviation, how many values tell it, and the length of blocks."""

    value: float
    spread: float
    independent: float
    block: int


def _error_rows(error: npt.ArrayLike, confidence: float) -> Floats:
    """Errors as rows of runs, after their check."""
    rows = np.atleast_2d(np.asarray(error, dtype=np.float64))
    if rows.shape[1] < LEAST or not np.isfinite(rows).all():
        message = f"error must hold at least {LEAST} finite values, got {rows.shape[1]}."
        raise ValueError(message)
    if not 0 < confidence < 1:
        message = f"confidence must be between 0 and 1, got {confidence}."
        raise ValueError(message)
    return rows


def _of_mean(rows: Floats, block: int | None) -> _MeanEstimate:
    """Mean of all errors and how far it may be from the true one."""
    from scipy.stats import f

    runs = rows.shape[0]
    values = rows.mean(axis=0)
    value = float(values.mean())
    length, drawn = _block_sd(values, block)
    deviation = float(values.std())
    count = count_for_mean(values - value)
    if drawn > 0:
        count = min(count, (deviation / drawn) ** 2)
    count = max(count / (1 + _COST / count), _FEWEST_MEAN)
    spread = deviation / math.sqrt(count - 1)
    if runs > 1:
        between = float(rows.mean(axis=1).std(ddof=1)) / math.sqrt(runs)
        if between**2 > spread**2 * float(f.ppf(_BY_CHANCE, runs - 1, count - 1)):
            return _MeanEstimate(value, between, float(runs), length)
    return _MeanEstimate(value, spread, count, length)


def _of_normal(rows: Floats, mean: _MeanEstimate) -> float:
    """Variance of the mean square of errors if they are normal, however alike neighbours are."""
    runs = rows.shape[0]
    means = rows.mean(axis=1)
    shared = (rows - means[:, None]).mean(axis=0)
    found = 4 * (mean.value * mean.spread) ** 2
    found += 2 * float(np.mean(shared**2)) ** 2 / count_for_power(shared)
    if runs > 1:
        apart = rows - means[:, None] - shared
        alike = float(np.mean([1 / count_for_power(row) for row in apart]))
        found += 2 * (float(means.var()) ** 2 + float(np.mean(apart**2)) ** 2 * alike) / (runs - 1)
    return found


def _by_bands(rows: Floats, mean: _MeanEstimate) -> Floats:
    """Mean squares that may be the true one, if waves of a band of wavelengths are alike."""
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
    found = np.square(mean.value + mean.spread * rng.standard_t(mean.independent - 1, _REPEATS))
    for power, count in zip(powers, counts, strict=True):
        drawn = count / rng.chisquare(count, (_REPEATS, count.size))
        found += drawn @ np.add.reduceat(power, first) / n
    return np.asarray(found)


def _block_sd(values: Floats, block: int | None) -> tuple[int, float]:
    """Length of blocks, and standard deviation of the mean if blocks are drawn from anywhere."""
    n = values.size
    most = max(1, int(n / _FEWEST_BLOCKS))
    length = min(_block_length(values) if block is None else block, most)
    if length < 1:
        message = f"block must be at least 1, got {block}."
        raise ValueError(message)
    around = np.concatenate([[0.0], np.cumsum(np.concatenate([values, values[:length]]))])
    means = (around[length : length + n] - around[:n]) / length
    # the bootstrap in closed form: n / length blocks, one of which stands for the mean
    return length, float(means.std()) / math.sqrt(n / length - 1)


def _block_length(values: Floats) -> int:
    """Length of circular blocks that suits the correlation of neighbours."""
    n = values.size
    x = values - values.mean()
    power = float(x @ x)
    if power <= 1e-24 * max(1.0, float(values @ values)):
        return 1
    most = min(n - 1, math.ceil(math.sqrt(n)) + max(5, math.ceil(math.log10(n))))
    r = np.array([float(x[: n - k] @ x[k:]) for k in range(most + 1)]) / power
    run = max(5, math.ceil(math.sqrt(math.log10(n))))
    small = np.abs(r[1:]) < 2 * math.sqrt(math.log10(n) / n)
    first = next(
        (k for k in range(small.size - run + 1) if small[k : k + run].all()), small.size // 2
    )
    lag = min(2 * max(first, 1), most)
    k = np.arange(-lag, lag + 1)
    taper = np.clip(2 * (1 - np.abs(k) / lag), 0.0, 1.0)
    around = taper * r[np.abs(k)]
    g, spectral = float(np.sum(around * np.abs(k))), float(around.sum())
    if spectral <= 0:
        return 1
    length = _LONGER * (2 * g**2 / (4 / 3 * spectral**2)) ** (1 / 3) * n ** (1 / 3)
    return max(1, min(int(length) + 1, int(min(3 * math.sqrt(n), n / 3))))
