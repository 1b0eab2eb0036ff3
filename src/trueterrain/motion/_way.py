"""Smooth motion from navigation alone: values and derivatives, bridges over gaps.

Between gaps a polynomial of third order is fitted in a window that moves along (Savitzky and Golay,
1964): no delay, and no trouble at the ends. Over a gap goes the cubic through positions and
velocities at both sides.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inputs import NavigationInput, Span

Float = npt.NDArray[np.float64]

_ORDER = 3
_UNEVEN = 1e-3  # steps by which epochs may lie off an even grid


class CubicSeries:
    """Series over time and their derivatives: cubics through values and rates at some times.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Times, ascending [s].
    values, rates : numpy.ndarray, shape (n, columns)
        At these times.
    """

    def __init__(self, time: Float, values: Float, rates: Float) -> None:
        from scipy.interpolate import CubicHermiteSpline

        self._spline = CubicHermiteSpline(time, values, rates, axis=0)
        self._rate = self._spline.derivative()

    def value(self, time: Float) -> Float:
        """Values, shape (m, columns)."""
        return np.asarray(self._spline(time))

    def rate(self, time: Float) -> Float:
        """First derivatives, shape (m, columns)."""
        return np.asarray(self._rate(time))


class SmoothedSeries(CubicSeries):
    """Series smoothed in a window that moves along.

    Parameters
    ----------
    navigation : NavigationInput
        Epochs.
    columns : sequence of int
        Which of its components.
    window : float
        Window of the fit [s]; 0 for the values as they are.
    slow : float
        Window for the second derivative, and for the velocity at the sides of gaps [s].
    """

    def __init__(
        self, navigation: NavigationInput, columns: list[int], *, window: float, slow: float
    ) -> None:
        times, values, rates, seconds = [], [], [], []
        edges = np.flatnonzero(np.isin(navigation.time, [end for _, end in navigation.gaps]))
        for part in np.split(np.arange(navigation.time.size), edges):
            time = navigation.time[part]
            grid, series = resample_evenly(time, navigation.pose[part][:, columns])
            value, rate, _ = fit_polynomials(series, grid, window)
            _, slow_rate, second = fit_polynomials(series, grid, slow)
            if navigation.gaps:
                rate[[0, -1]] = slow_rate[[0, -1]]
            times.append(grid)
            values.append(value)
            rates.append(rate)
            seconds.append(second)
        self._time = np.concatenate(times)
        self._second = np.concatenate(seconds)
        super().__init__(self._time, np.concatenate(values), np.concatenate(rates))

    def second(self, time: Float) -> Float:
        """Second derivatives of the slow fit, shape (m, columns)."""
        columns = [np.interp(time, self._time, column) for column in self._second.T]
        return np.stack(columns, axis=1)


def bridge_variance(time: Float, gaps: tuple[Span, ...], density: float) -> Float:
    """Variance of what is bridged by a cubic over gaps.

    That of a body which white acceleration moves and whose position and velocity are known at both
    sides: density T^3 x^3 (1 - x)^3 / 3 at the share x of a gap of length T.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Times [s].
    gaps : tuple
        Their sides [s].
    density : float
        Two-sided density of the acceleration [m^2/s^3 or rad^2/s^3].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Variance [m^2 or rad^2]; 0 outside of the gaps.

    Examples
    --------
    >>> bridge_variance(np.array([0.0, 1.0, 2.0]), ((0.0, 2.0),), 3.0)
    array([0.   , 0.125, 0.   ])
    """
    variance = np.zeros(time.size)
    for begin, end in gaps:
        x = np.clip((time - begin) / (end - begin), 0.0, 1.0)
        variance += density * (end - begin) ** 3 * (x * (1 - x)) ** 3 / 3.0
    return variance


def resample_evenly(time: Float, values: Float) -> tuple[Float, Float]:
    """The same on an even grid."""
    grid = np.linspace(time[0], time[-1], time.size)
    step = grid[1] - grid[0]
    if np.abs(grid - time).max() <= _UNEVEN * step:
        return time, values
    from scipy.interpolate import CubicSpline

    return grid, np.asarray(CubicSpline(time, values, axis=0)(grid))


def fit_polynomials(values: Float, time: Float, window: float) -> tuple[Float, Float, Float]:
    """Value, first and second derivative of the polynomial fitted around each epoch."""
    step = (time[-1] - time[0]) / (time.size - 1)
    if window <= 2 * step:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(time, values, axis=0)
        return values, np.asarray(spline(time, 1)), np.asarray(spline(time, 2))
    from scipy.signal import savgol_filter

    points = min(2 * round(0.5 * window / step) + 1, time.size - (time.size + 1) % 2)
    order = min(_ORDER, points - 1)
    fits = [
        savgol_filter(values, points, order, deriv=d, delta=step, axis=0, mode="interp")
        if d <= order
        else np.zeros_like(values)
        for d in range(3)
    ]
    return fits[0], fits[1], fits[2]
