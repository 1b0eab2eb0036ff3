"""Uncertainty of figures of accuracy, by the block bootstrap: errors of neighbours are alike."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_REPEATS = 2000
_SEED = 1964

#: Errors of which a figure is taken at least.
LEAST = 8

_LONGER = 3.0  # times the length for the mean: spreads of correlated errors need more
_FEWEST_BLOCKS = 3.0  # effective blocks of which a spread is taken


@dataclass(frozen=True, kw_only=True)
class Figure:
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


def rms_figure(
    error: npt.ArrayLike, *, confidence: float = 0.95, block: int | None = None
) -> Figure:
    """Root mean square of correlated errors, with its interval.

    Parameters
    ----------
    error : array_like, shape (n,) or (k, n)
        Errors in equal steps [m]; of several rows, the same places are drawn together.
    confidence : float
        Share of repeats in which the interval shall hold the truth.
    block : int, optional
        Neighbours that are drawn together; by default as many as the errors ask for.

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
    Circular blocks (Politis and Romano 1992) of the length of Politis and White (2004, with the
    correction of 2009) are drawn from the squares. The spread of the logarithm of their mean gives
    the interval, with Student's factor for as many degrees of freedom as there are blocks: few
    blocks know their own spread badly. Errors that hold less than some twenty lengths of their own
    correlation cannot tell how large others would be: then the interval is too narrow.

    Examples
    --------
    >>> found = rms_figure(1e-3 * np.random.default_rng(1).normal(size=400))
    >>> print(f"{1e3 * found.value:.2f} mm ({1e3 * found.low:.2f} to {1e3 * found.high:.2f})")
    0.91 mm (0.84 to 1.00)
    """
    squares = _means(np.square(np.asarray(error, dtype=np.float64)))
    length, spread, factor = _drawn(squares, confidence, block)
    value = math.sqrt(float(squares.mean()))
    ratio = math.exp(0.5 * factor * spread / max(float(squares.mean()), 1e-300))
    return Figure(
        value=value, low=value / ratio, high=value * ratio, confidence=confidence, block=length
    )


def mean_figure(
    error: npt.ArrayLike, *, confidence: float = 0.95, block: int | None = None
) -> Figure:
    """Mean of correlated errors, with its interval.

    Parameters
    ----------
    error, confidence, block
        As by `rms_figure`.

    Returns
    -------
    Figure
        The mean [m].

    Raises
    ------
    ValueError
        As by `rms_figure`.

    Examples
    --------
    >>> mean_figure(np.full(20, 0.002)).value
    0.002
    """
    values = _means(np.asarray(error, dtype=np.float64))
    length, spread, factor = _drawn(values, confidence, block)
    value = float(values.mean())
    return Figure(
        value=value, low=value - factor * spread, high=value + factor * spread,
        confidence=confidence, block=length,
    )  # fmt: skip


def _means(values: Floats) -> Floats:
    """One value for each place."""
    return values.mean(axis=0) if values.ndim == 2 else values


def _drawn(values: Floats, confidence: float, block: int | None) -> tuple[int, float, float]:
    """Length of blocks, standard deviation of the mean, and Student's factor."""
    from scipy.stats import t

    if values.size < LEAST or not np.isfinite(values).all():
        message = f"error must hold at least {LEAST} finite values, got {values.size}."
        raise ValueError(message)
    if not 0 < confidence < 1:
        message = f"confidence must be between 0 and 1, got {confidence}."
        raise ValueError(message)
    n = values.size
    most = max(1, int(n / _FEWEST_BLOCKS))
    length = min(_block_length(values) if block is None else block, most)
    if length < 1:
        message = f"block must be at least 1, got {block}."
        raise ValueError(message)
    rng = np.random.default_rng(_SEED)
    doubled = np.concatenate([[0.0], np.cumsum(np.concatenate([values, values]))])
    blocks = -(-n // length)
    starts = rng.integers(0, n, (_REPEATS, blocks))
    means = (doubled[starts + length] - doubled[starts]).mean(axis=1) / length
    count = n / length
    # a mean of `blocks` blocks, one of which stands for the rest; less the bias of few blocks
    spread = float(means.std()) * math.sqrt(blocks / count) * math.sqrt(count / (count - 1))
    return length, spread, float(t.ppf(0.5 + 0.5 * confidence, count - 1))


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
