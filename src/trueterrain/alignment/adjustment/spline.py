"""Corrections of passes: cubic B-splines of time or station, and the prior of their drift.

The errors of an INS drift about a constant. The drift is modelled as a Gauss-Markov process of
first order (rough, as measured on two drives over one road) or of second order (smooth, as an INS
whose height rests on accelerometers), sampled at the coefficients of the spline.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import get_args

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.settings import COMPONENTS, Order

Floats = npt.NDArray[np.float64]

# sums of products of the four cubic basis functions over an interval, by the lag of their
# coefficients: values of the B-spline of degree 7 at its knots
_OVERLAP = np.array([2416.0, 2 * 1191.0, 2 * 120.0, 2.0]) / 5040.0
_SMOOTH = 2.146193220620583  # (1 + x) exp(-x) = 1 / e


@dataclass(frozen=True, kw_only=True)
class GaussMarkovProcess:
    """Gauss-Markov process: prior of the drift of a component about its constant part."""

    sd: float
    "Standard deviation [m] or [rad]; 0 for a component that is constant."

    correlation_time: float = 25.0
    "Time or distance after which the autocorrelation is 1/e [s] or [m]."

    order: Order = "first"
    "Order of the process: ``first`` is rough, ``second`` smooth (Gelb 1974)."

    def __post_init__(self) -> None:
        """Check the values."""
        if not (np.isfinite(self.sd) and self.sd >= 0):
            message = f"sd must be at least 0, got {self.sd}."
            raise ValueError(message)
        if not (np.isfinite(self.correlation_time) and self.correlation_time > 0):
            message = f"correlation_time must be greater than 0, got {self.correlation_time}."
            raise ValueError(message)
        if self.order not in get_args(Order):
            message = f"order must be first or second, got {self.order!r}."
            raise ValueError(message)

    def correlation(self, lag: npt.ArrayLike) -> Floats:
        """Autocorrelation.

        Parameters
        ----------
        lag : array_like
            Differences of time [s] or distance [m].

        Returns
        -------
        numpy.ndarray
            From 0 to 1.

        Examples
        --------
        >>> GaussMarkovProcess(sd=0.02, correlation_time=25.0).correlation([0.0, 25.0])
        array([1.   , 0.3679])
        """
        x = np.abs(np.asarray(lag, dtype=np.float64)) / self.correlation_time
        if self.order == "first":
            return np.asarray(np.exp(-x), dtype=np.float64)
        return np.asarray((1.0 + _SMOOTH * x) * np.exp(-_SMOOTH * x), dtype=np.float64)

    def whitening(self, sd: Floats, spacing: float) -> Floats:
        """Whitening matrix of the coefficients of a spline, as three diagonals.

        W c has unit covariance, so WᵀW is the normal matrix of the prior.

        Parameters
        ----------
        sd : numpy.ndarray, shape (n,)
            Standard deviation of the spline near each coefficient [m] or [rad].
        spacing : float
            Spacing of the knots [s] or [m].

        Returns
        -------
        numpy.ndarray, shape (3, n)
            Diagonal, first and second subdiagonal.
        """
        step = spacing / self.correlation_time
        rows, rho = np.zeros((3, sd.size)), np.ones(4)
        if self.order == "first":
            rho[:] = np.exp(-step * np.arange(4))
            # AR(1): (c_i - rho c_(i-1)) / sqrt(1 - rho²)
            rows[:2] = np.array([[1.0], [-rho[1]]]) / np.sqrt(-np.expm1(-2.0 * step))
        else:
            phi = np.exp(-_SMOOTH * step)
            # AR(2) with a double root phi, the sampled critically damped process
            rho[1] = 2.0 * phi / (1.0 + phi**2)
            for lag in (2, 3):
                rho[lag] = 2.0 * phi * rho[lag - 1] - phi**2 * rho[lag - 2]
            free = -np.expm1(-2.0 * _SMOOTH * step)
            rows[:] = np.array([[1.0], [-2.0 * phi], [phi**2]]) * np.sqrt((1.0 + phi**2) / free**3)
            rows[:, 1:2] = np.array([[1.0], [-rho[1]], [0.0]]) * ((1.0 + phi**2) / free)
        # the variance of the spline is less than that of its coefficients, by their overlap
        scale = np.sqrt(_OVERLAP @ rho) / sd
        rows[:, 0] = 1.0, 0.0, 0.0
        for back in range(3):
            rows[back, back:] *= scale[: scale.size - back]
        return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class SplineKnots:
    """Equally spaced knots of a cubic B-spline."""

    begin: float
    "First knot [s] or [m]."

    spacing: float
    "Spacing [s] or [m]."

    intervals: int
    "Number of intervals between knots; the spline has three coefficients more."

    @property
    def end(self) -> float:
        """Last knot [s] or [m]."""
        return self.begin + self.intervals * self.spacing

    @property
    def places(self) -> Floats:
        """Centre of each basis function, shape (intervals + 3,) [s] or [m]."""
        return self.begin + self.spacing * np.arange(-1.0, self.intervals + 2.0)

    def basis(self, time: npt.ArrayLike) -> tuple[npt.NDArray[np.int64], Floats]:
        """Interval of each time and the weights of its four coefficients.

        Parameters
        ----------
        time : array_like, shape (m,)
            Times [s] or stations [m]; clipped to the ends.

        Returns
        -------
        interval : numpy.ndarray of int, shape (m,)
            Index of the first of the four coefficients.
        weights : numpy.ndarray, shape (m, 4)
            Their sum is 1.

        Examples
        --------
        >>> SplineKnots(begin=0.0, spacing=2.0, intervals=3).basis([2.0])
        (array([1]), array([[0.1667, 0.6667, 0.1667, 0.    ]]))
        """
        time = np.clip(np.asarray(time, dtype=np.float64).ravel(), self.begin, self.end)
        interval, weights = np.empty(time.size, np.int64), np.empty((time.size, 4))
        _kernels.spline_basis(time, self.begin, self.spacing, self.intervals, 0, interval, weights)
        return interval, weights


def knots_over(first: float, last: float, spacing: float) -> SplineKnots:
    """Knots over a span of time or distance, centred on it.

    Parameters
    ----------
    first, last : float
        Ends of the span [s] or [m].
    spacing : float
        Spacing [s] or [m].

    Returns
    -------
    SplineKnots
        The fewest that cover the span.

    Examples
    --------
    >>> knots_over(0.0, 5.0, 2.0).begin
    -0.5
    """
    intervals = max(1, int(np.ceil((last - first) / spacing * (1.0 - 1e-9))))
    slack = intervals * spacing - (last - first)
    return SplineKnots(begin=first - 0.5 * slack, spacing=spacing, intervals=intervals)


@dataclass(frozen=True, kw_only=True, eq=False)
class SplineCorrection:
    """Correction of a pass: height, and optionally roll, pitch and shift, with their covariance.

    At the time t, a point at the offset v to the left of the path and u ahead of the body gets
    ``height(t) + v roll(t) + u pitch(t)`` added to its height, and is moved by ``east(t)`` and
    ``north(t)``. Components that were not estimated are 0.
    """

    name: str
    "Name of the pass."

    knots: SplineKnots
    "Knots of all components."

    components: tuple[str, ...]
    "Estimated components, of height, roll, pitch, east, north."

    coefficients: Floats
    "Coefficients, shape (component, intervals + 3) [m] or [rad], offsets included."

    offset: Floats
    "Constant parts that the coefficients contain, shape (component,) [m] or [rad]."

    covariance: Floats
    """Covariance of the 4 coefficients of each component in an interval, ordered by component,
    shape (interval, 4 k, 4 k)."""

    residual_sd: float
    "Standard deviation of the drift that the knots are too coarse for [m]."

    supported: npt.NDArray[np.bool_]
    "Intervals in which other passes cover the same ground, shape (interval,)."

    datum_sd: float | None = None
    """Standard deviation of the datum [m]: of the height error that all passes of the adjustment
    have in common, which `covariance` does not include; None if it is unknown."""

    def __call__(self, time: npt.ArrayLike, component: str = "height") -> Floats:
        """Evaluate one component.

        Parameters
        ----------
        time : array_like
            Times [s] or stations [m]; constant beyond the ends.
        component : str
            One of `COMPONENTS`.

        Returns
        -------
        numpy.ndarray, shape of time
            Correction [m] or [rad].
        """
        if component not in COMPONENTS:
            message = f"component must be one of {', '.join(COMPONENTS)}, got {component!r}."
            raise ValueError(message)
        shape = np.shape(time)
        if component not in self.components:
            return np.zeros(shape)
        interval, weights = self.knots.basis(time)
        row = self.coefficients[self.components.index(component)]
        values = (row[interval[:, None] + np.arange(4)] * weights).sum(axis=1)
        return np.asarray(values.reshape(shape))

    def height_at(
        self, time: npt.ArrayLike, offset: npt.ArrayLike = 0.0, longitudinal: npt.ArrayLike = 0.0
    ) -> Floats:
        """Correction of heights.

        Parameters
        ----------
        time : array_like
            Times [s], or stations [m].
        offset, longitudinal : array_like
            Position relative to the body: lateral, to the left positive, and longitudinal [m].

        Returns
        -------
        numpy.ndarray
            Height, roll times offset and pitch times longitudinal [m].
        """
        return np.asarray(
            self(time)
            + self(time, "roll") * np.asarray(offset)
            + self(time, "pitch") * np.asarray(longitudinal)
        )

    def sd(
        self, time: npt.ArrayLike, offset: npt.ArrayLike = 0.0, longitudinal: npt.ArrayLike = 0.0
    ) -> Floats:
        """Standard deviation of a corrected height.

        Parameters
        ----------
        time : array_like
            Times [s], or stations [m].
        offset, longitudinal : array_like
            Position relative to the body: lateral, to the left positive, and longitudinal [m].

        Returns
        -------
        numpy.ndarray
            Relative to the datum of the adjustment, `residual_sd` included [m].
        """
        time, offset, longitudinal = np.broadcast_arrays(time, offset, longitudinal)
        factor = {
            "height": np.ones(time.size),
            "roll": offset.ravel(),
            "pitch": longitudinal.ravel(),
        }
        none = np.zeros(time.size)
        interval, weights = self.knots.basis(time)
        row = np.concatenate(
            [weights * factor.get(name, none)[:, None] for name in self.components],
            axis=1,
        )
        variance = np.einsum("ni,nij,nj->n", row, self.covariance[interval], row, optimize=True)
        variance = np.maximum(variance, 0.0) + self.residual_sd**2
        return np.asarray(np.sqrt(variance).reshape(time.shape))

    @cached_property
    def unsupported(self) -> list[tuple[float, float]]:
        """Spans of time or distance in which no other pass covers the same ground.

        There the correction is extrapolated by its prior, and its standard deviation grows.
        """
        edges = np.flatnonzero(np.diff(np.concatenate([[1], self.supported, [1]]).astype(int)))
        at = self.knots.begin + self.knots.spacing * edges
        return [(float(a), float(b)) for a, b in zip(at[::2], at[1::2], strict=True)]
