"""Series of time from navigation: smoothed values and derivatives, and bridges over gaps.

Between gaps a cubic is fitted in a moving window (Savitzky and Golay, 1964), which has no delay and
also smooths the ends. A gap is bridged by the cubic through positions and velocities at both sides.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.motion._inputs import NavigationInput, Span

Float = npt.NDArray[np.float64]

_ORDER = 3
_MAX_UNEVENNESS = 1e-3  # steps by which epochs may deviate from an even grid
_KNOT_TOLERANCE = np.array([1e-5, 5e-6, 5e-6])  # [m, rad, rad] of cubics for up, roll, pitch
_KNOT_TOLERANCE_HORIZONTAL = np.array([1e-4, 1e-4, 5e-5])  # [m, m, rad] for east, north, yaw
_MAX_KNOTS = 2_000_000  # for fast navigation: 0.9 GB


class CubicSeries:
    """Cubic Hermite splines over time through given values and rates.

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
    """Components of navigation smoothed in a moving window.

    Parameters
    ----------
    navigation : NavigationInput
        Epochs.
    columns : sequence of int
        Components to smooth.
    window : float
        Window of the fit [s]; 0 to keep the values.
    slow : float
        Window of the second derivative, and of the velocity at the sides of gaps [s].
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
                # noise of the velocities at its sides would grow with the length of the gap
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
    """Variance of positions that a cubic bridges over gaps.

    A body that white acceleration moves, with known position and velocity at both sides, has the
    variance density T^3 x^3 (1 - x)^3 / 3 at the fraction x of a gap of length T.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Times [s].
    gaps : tuple
        Begin and end of each gap [s].
    density : float
        Two-sided spectral density of the acceleration [m^2/s^3 or rad^2/s^3].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Variance [m^2 or rad^2]; 0 outside the gaps.

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
    """Times and values on an even grid, as Savitzky-Golay filters need them."""
    grid = np.linspace(time[0], time[-1], time.size)
    step = grid[1] - grid[0]
    if np.abs(grid - time).max() <= _MAX_UNEVENNESS * step:
        return time, values
    from scipy.interpolate import CubicSpline

    return grid, np.asarray(CubicSpline(time, values, axis=0)(grid))


def fit_polynomials(values: Float, time: Float, window: float) -> tuple[Float, Float, Float]:
    """Value, first and second derivative of the polynomial fitted around each epoch.

    Parameters
    ----------
    values : numpy.ndarray, shape (n, columns)
        Values on an even grid.
    time : numpy.ndarray, shape (n,)
        Times [s].
    window : float
        Length of the fit [s]; up to two steps, the values are interpolated by a spline.
    """
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


def even_knots(navigation: NavigationInput, rate: float) -> Float:
    """Equidistant knots over the navigation, `rate` of them per second at most."""
    begin, end = navigation.time[[0, -1]]
    count = max(int(np.floor((end - begin) * rate + 1e-9)), 1)
    return np.asarray(np.linspace(begin, end, count + 1))


def knots_of_navigation(
    navigation: NavigationInput, vertical: CubicSeries, horizontal: CubicSeries, rate: float
) -> tuple[Float, list[str]]:
    """Knots between which cubics follow the navigation, and a warning where they do not.

    The rates at the epochs of fast navigation contain its noise and the rounding of its numbers.
    Cubics between knots that are far apart amplify these, so the knots are refined.

    Parameters
    ----------
    navigation : NavigationInput
        Epochs.
    vertical, horizontal : CubicSeries
        Up, roll, pitch; east, north, yaw.
    rate : float
        Knots per second to begin with [Hz].
    """
    from scipy.interpolate import CubicHermiteSpline

    max_rate = 1.0 / navigation.step  # one knot for each epoch
    series_and_tolerances = (
        (vertical, _KNOT_TOLERANCE),
        (horizontal, _KNOT_TOLERANCE_HORIZONTAL),
    )
    while True:
        time = even_knots(navigation, rate)
        errors = [
            np.abs(series.value(navigation.time) - cubic(navigation.time)).max(axis=0) / tolerance
            for series, tolerance in series_and_tolerances
            for cubic in [CubicHermiteSpline(time, series.value(time), series.rate(time))]
        ]
        worst = float(np.max(errors))
        if worst <= 1.0 or rate >= max_rate:
            return time, []
        rate = min(2.0 * rate, max_rate)
        if rate * (time[-1] - time[0]) > _MAX_KNOTS:
            break
    return time, [
        f"navigation: its {max_rate:.0f} epochs per second are followed to "
        f"{1000 * worst * _KNOT_TOLERANCE[0]:.2g} mm only, with {time.size} knots: cut the run "
        "into shorter ones, or thin the navigation out"
    ]
