"""Random processes in blocks: each block continues the last one.

A process has an explicit seed and a name. Its samples are the same to the last bit for any division
into blocks, and independent of all other processes.

All processes but the random walk are stationary from their first sample. Their covariances are
exact at the sampled times, for any sampling rate.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

#: beta * correlation time of the second-order process: (1 + x) exp(-x) = 1/e.
_SECOND_ORDER = 2.146193220620583


def named_generator(seed: int, *names: str) -> np.random.Generator:
    """Independent random generator for each name: Philox, counter-based (Salmon et al. 2011).

    Parameters
    ----------
    seed : int
        Seed of all random numbers.
    *names : str
        Purpose of the random numbers.

    Returns
    -------
    numpy.random.Generator
        Independent of those of other seeds and names.

    Raises
    ------
    ValueError
        If the seed is not a whole number of at least 0.

    Examples
    --------
    >>> first = named_generator(1, "navigation", "drift").standard_normal()
    >>> bool(first == named_generator(1, "navigation", "drift").standard_normal())
    True
    >>> bool(first == named_generator(1, "navigation", "attitude").standard_normal())
    False
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        message = f"seed must be a whole number of at least 0, got {seed!r}."
        raise ValueError(message)
    key = tuple("\n".join(names).encode())
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(int(seed), spawn_key=key)))


@dataclass(kw_only=True, eq=False)
class White:
    """White noise: independent normal samples.

    Examples
    --------
    >>> White(rng=named_generator(1, "range"), sd=0.001).next(2).shape
    (2, 1)
    """

    rng: np.random.Generator
    "Random numbers."

    sd: npt.ArrayLike
    "Standard deviation of each component."

    def __post_init__(self) -> None:
        """Check the values."""
        self._sd = _component_arrays(sd=self.sd)[0]

    def next(self, n: int) -> Float:
        """Next samples of the process.

        Parameters
        ----------
        n : int
            Number of samples.

        Returns
        -------
        numpy.ndarray, shape (n, component)
            Samples, in the unit of the standard deviation.
        """
        return self.rng.standard_normal((n, self._sd.size)) * self._sd


@dataclass(kw_only=True, eq=False)
class RandomWalk:
    """Random walk: the integral of white noise; 0 at the first sample.

    Examples
    --------
    >>> walk = RandomWalk(rng=named_generator(1, "bias"), density=0.01, rate=100.0)
    >>> walk.next(3)[0]
    array([0.])
    """

    rng: np.random.Generator
    "Random numbers."

    density: npt.ArrayLike
    "Standard deviation of each component after 1 s [unit/sqrt(s)]."

    rate: float
    "Samples per second [Hz]."

    def __post_init__(self) -> None:
        """Check the values."""
        check_positive(rate=self.rate)
        self._sd = _component_arrays(density=self.density)[0] / np.sqrt(self.rate)
        self._last: Float | None = None

    def next(self, n: int) -> Float:
        """Next samples of the process.

        Parameters
        ----------
        n : int
            Number of samples.

        Returns
        -------
        numpy.ndarray, shape (n, component)
            Samples, in the unit of the density times sqrt(s).
        """
        if n == 0:
            return np.zeros((0, self._sd.size))
        first = self._last is None
        drive = np.zeros((n, self._sd.size))
        drive[int(first) :] = self.rng.standard_normal((n - first, self._sd.size)) * self._sd
        last = np.zeros(self._sd.size) if self._last is None else self._last
        walk = accumulate_samples(1.0, drive, last)
        self._last = walk[-1]
        return walk


@dataclass(kw_only=True, eq=False)
class GaussMarkov:
    """First-order Gauss-Markov process: autocorrelation ``sd^2 exp(-|t| / correlation_time)``.

    Its one-sided spectrum is ``4 sd^2 T / (1 + (2 pi f T)^2)``: a random walk at high frequencies,
    white noise at low ones (Gelb 1974, "Applied Optimal Estimation", section 3.8).

    Examples
    --------
    >>> rng = named_generator(1, "drift")
    >>> drift = GaussMarkov(rng=rng, sd=0.025, correlation_time=25.0, rate=200.0)
    >>> drift.next(3).shape
    (3, 1)
    """

    rng: np.random.Generator
    "Random numbers."

    sd: npt.ArrayLike
    "Standard deviation of each component."

    correlation_time: float
    "Time at which the autocorrelation is 1/e [s]."

    rate: float
    "Samples per second [Hz]."

    def __post_init__(self) -> None:
        """Check the values."""
        check_positive(correlation_time=self.correlation_time, rate=self.rate)
        self._sd = _component_arrays(sd=self.sd)[0]
        step = 1.0 / (self.rate * self.correlation_time)
        self._keep = float(np.exp(-step))
        self._drive = self._sd * np.sqrt(-np.expm1(-2.0 * step))
        self._last: Float | None = None

    def next(self, n: int) -> Float:
        """Next samples of the process.

        Parameters
        ----------
        n : int
            Number of samples.

        Returns
        -------
        numpy.ndarray, shape (n, component)
            Samples, in the unit of the standard deviation.
        """
        drive = self.rng.standard_normal((n, self._sd.size))
        if n == 0:
            return drive
        if self._last is None:
            drive[0] *= self._sd
            drive[1:] *= self._drive
            self._last = np.zeros(self._sd.size)
        else:
            drive *= self._drive
        values = accumulate_samples(self._keep, drive, self._last)
        self._last = values[-1]
        return values


@dataclass(kw_only=True, eq=False)
class SecondOrderGaussMarkov:
    """Second-order Gauss-Markov process: differentiable, with a rate of finite variance.

    Its autocorrelation is ``sd^2 (1 + b |t|) exp(-b |t|)``, with b such that it is 1/e at the
    correlation time; the standard deviation of the rate is ``b sd`` (Gelb 1974, section 3.8).

    Examples
    --------
    >>> drift = SecondOrderGaussMarkov(
    ...     rng=named_generator(1, "drift"), sd=0.025, correlation_time=25.0, rate=200.0)
    >>> drift.next(3).shape
    (3, 1)
    """

    rng: np.random.Generator
    "Random numbers."

    sd: npt.ArrayLike
    "Standard deviation of each component."

    correlation_time: float
    "Time at which the autocorrelation is 1/e [s]."

    rate: float
    "Samples per second [Hz]."

    def __post_init__(self) -> None:
        """Check the values."""
        check_positive(correlation_time=self.correlation_time, rate=self.rate)
        self._sd = _component_arrays(sd=self.sd)[0]
        beta = _SECOND_ORDER / self.correlation_time
        step = beta / self.rate
        # The states x / sd and y = x / sd + (dx/dt) / (b sd) are a cascade of two first-order
        # processes with the same decay, so that the input of x contains step * y.
        keep = np.exp(-step)
        self._keep, self._feed = float(keep), float(step * keep)
        self._start = _cholesky_factor(np.array([[2.0, 1.0], [1.0, 1.0]]))
        self._drive = _cholesky_factor(_second_order_covariance(step))
        self._last: Float | None = None

    def next(self, n: int) -> Float:
        """Next samples of the process.

        Parameters
        ----------
        n : int
            Number of samples.

        Returns
        -------
        numpy.ndarray, shape (n, component)
            Samples, in the unit of the standard deviation.
        """
        size = self._sd.size
        if n == 0:
            return np.zeros((0, size))
        random = self.rng.standard_normal((n, 2, size))
        w_y, w_x = _correlate_pairs(self._drive, random)
        if self._last is None:
            start = np.stack(_correlate_pairs(self._start, random[:1]))
            w_y[0], w_x[0] = start[:, 0]
            y_last = x_last = np.zeros(size)
        else:
            y_last, x_last = self._last
        y = accumulate_samples(self._keep, w_y, y_last)
        w_x[0] += self._feed * y_last
        w_x[1:] += self._feed * y[:-1]
        x = accumulate_samples(self._keep, w_x, x_last)
        self._last = np.stack([y[-1], x[-1]])
        return x * self._sd


def accumulate_samples(keep: float, drive: Float, last: Float) -> Float:
    """Samples of the recursion ``x[i] = keep x[i - 1] + drive[i]``.

    Parameters
    ----------
    keep : float
        Factor of the last sample, at most 1.
    drive : numpy.ndarray, shape (n, component)
        Input of the recursion.
    last : numpy.ndarray, shape (component,)
        Sample before the first one.

    Returns
    -------
    numpy.ndarray, shape (n, component)
        Samples.

    Examples
    --------
    >>> accumulate_samples(0.5, np.array([[1.0], [0.0]]), np.array([4.0])).ravel()
    array([3. , 1.5])
    """
    if not drive.size:
        return drive
    from scipy.signal import lfilter

    samples, _ = lfilter([1.0], [1.0, -keep], drive, axis=0, zi=keep * last[None])
    return np.asarray(samples)


def check_positive(**values: float) -> None:
    """Raise ValueError unless all are finite and greater than 0."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            message = f"{name} must be greater than 0, got {value}."
            raise ValueError(message)


def check_not_negative(**values: float) -> None:
    """Raise ValueError unless all are finite and at least 0."""
    for name, value in values.items():
        if not (np.isfinite(value) and value >= 0):
            message = f"{name} must be at least 0, got {value}."
            raise ValueError(message)


def _component_arrays(**values: npt.ArrayLike) -> tuple[Float, ...]:
    checked = []
    for name, value in values.items():
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
        if array.ndim != 1:
            message = f"{name} must be a number or one per component, got shape {array.shape}."
            raise ValueError(message)
        for number in array:
            check_not_negative(**{name: float(number)})
        checked.append(array)
    return tuple(checked)


def _second_order_covariance(step: float) -> Float:
    """Covariance of the process noise of (y, x) over a step, in closed form; ``step = b / rate``.

    With y' = -b y + w, x' = b (y - x) and var(w) = 4 b (so that var(x) = 1):

        var(y) = 4 b int exp(-2 b t) dt,  cov(x, y) = 4 b int b t exp(-2 b t) dt,
        var(x) = 4 b int (b t)^2 exp(-2 b t) dt,  each from 0 to the length of the step.
    """
    s = step
    if s < 0.1:  # the closed form cancels; the series is exact to round-off
        powers = [
            sum(
                4.0 * (-2.0) ** k / math.factorial(k) * s ** (k + p + 1) / (k + p + 1)
                for k in range(14)
            )
            for p in range(3)
        ]
    else:
        e = np.exp(-2.0 * s)
        powers = [
            2.0 * (1.0 - e),
            1.0 - e * (1.0 + 2.0 * s),
            1.0 - e * (1.0 + 2.0 * s + 2.0 * s * s),
        ]
    yy, xy, xx = powers
    return np.array([[yy, xy], [xy, xx]])


def _cholesky_factor(covariance: Float) -> Float:
    return np.linalg.cholesky(covariance).astype(np.float64)


def _correlate_pairs(factor: Float, random: Float) -> tuple[Float, Float]:
    first, second = random[:, 0], random[:, 1]
    return factor[0, 0] * first, factor[1, 0] * first + factor[1, 1] * second
