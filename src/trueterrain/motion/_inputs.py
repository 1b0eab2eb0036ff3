"""Inputs of the fusion: navigation and accelerometers of a run in true time, and their gaps.

Navigation is smoothed between its gaps by a cubic fitted in a moving window (Savitzky and Golay,
1964), which has no delay and also smooths the ends. A gap is bridged by the cubic through positions
and velocities at both sides.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError

Float = npt.NDArray[np.float64]
Span = tuple[float, float]

COORDINATES = ("east", "north", "up", "roll", "pitch", "yaw")

_GAP = 1.5  # median steps above which a step is a gap
_MIN_EPOCHS = 4  # between two gaps
_JUMP_SPEED = 1.0  # [m/s] above which positions show a jump of the clock
_ORDER = 3
_MAX_UNEVENNESS = 1e-3  # steps by which epochs may deviate from an even grid


@dataclass(frozen=True, kw_only=True)
class InstrumentClock:
    """Conversion of the stamps of an instrument to true time: offset and linear drift.

    Examples
    --------
    >>> InstrumentClock(offset=0.5, rate=0.001, begin=10.0).true(np.array([20.0]))
    array([20.51])
    """

    offset: float = 0.0
    "True time less stamp, at `begin` [s]."

    rate: float = 0.0
    "Rate of change of the offset [s/s]."

    begin: float = 0.0
    "Stamp at which the offset holds [s]."

    def true(self, stamp: Float) -> Float:
        """True times of stamps [s]."""
        return np.asarray(stamp + self.offset + self.rate * (stamp - self.begin))


@dataclass(frozen=True, kw_only=True, eq=False)
class NavigationInput:
    """Usable epochs of navigation."""

    time: Float
    "True times, ascending, shape (n,) [s]."

    pose: Float
    "East, north, up [m], roll, pitch, yaw [rad] (yaw without jumps), shape (n, 6)."

    sd: Float
    "Reported standard deviations, shape (n, 6) [m, rad]; NaN where none is reported."

    step: float
    "Median time from epoch to epoch [s]."

    gaps: tuple[Span, ...]
    "Last epoch before and first epoch after each gap [s]."

    dropped: int
    "Number of epochs left out: not finite, or alone between gaps."


@dataclass(frozen=True, kw_only=True, eq=False)
class AccelerometerInput:
    """Usable samples of the accelerometers."""

    time: Float
    "True times, ascending, shape (m,) [s]."

    force: Float
    "Specific force along body z, shape (m, sensor) [m/s^2]."

    position: Float
    "Position of each sensor in the body, shape (sensor, 3) [m]."

    step: float
    "Median time from sample to sample [s]."

    gaps: tuple[Span, ...]
    "Last sample before and first sample after each gap [s]."

    dropped: int
    "Number of samples left out: not finite."


def read_navigation(run: xr.DataTree) -> NavigationInput:
    """Usable epochs of the navigation of a run, with continuous yaw.

    Raises
    ------
    SchemaError
        If times are not finite, do not ascend, or jump.
    CoverageError
        If fewer than 4 epochs are usable.
    """
    group = _require_group(run, "navigation")
    time = _group_times(group, "navigation")
    pose = np.stack([np.asarray(group[name].values, float) for name in COORDINATES], axis=1)
    sd = np.stack([_reported_sd(group, name, time.size) for name in COORDINATES], axis=1)
    usable = np.isfinite(pose).all(axis=1)
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    usable &= _in_groups(time, usable, step)
    if np.count_nonzero(usable) < _MIN_EPOCHS:
        raise CoverageError(
            f"has {np.count_nonzero(usable)} usable epochs, at least {_MIN_EPOCHS} are needed",
            place="group navigation",
            cure="Record or export it again.",
        )
    dropped = int(usable.size - np.count_nonzero(usable))
    time, pose, sd = time[usable], pose[usable], sd[usable]
    pose[:, 5] = np.unwrap(pose[:, 5])
    _refuse_jumps(time, pose, step)
    gaps = _find_gaps(time, step)
    return NavigationInput(time=time, pose=pose, sd=sd, step=step, gaps=gaps, dropped=dropped)


def read_accelerometers(run: xr.DataTree, clock: InstrumentClock) -> AccelerometerInput | None:
    """Usable samples of the accelerometers of a run; None if there are none.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    clock : InstrumentClock
        Clock of the accelerometers, the delay of their anti-alias filter included.

    Raises
    ------
    SchemaError
        If times are not finite or do not ascend.
    """
    if "accelerometers" not in run.children:
        return None
    group = _require_group(run, "accelerometers")
    time = _group_times(group, "accelerometers")
    force = np.asarray(group["acceleration"].values, dtype=float)
    usable = np.isfinite(force).all(axis=1)
    if np.count_nonzero(usable) < _MIN_EPOCHS:
        return None
    step = float(np.median(np.diff(time)))
    dropped = int(usable.size - np.count_nonzero(usable))
    time = clock.true(time[usable])
    return AccelerometerInput(
        time=time,
        force=force[usable],
        position=np.asarray(group["position"].values, float),
        step=step,
        gaps=_find_gaps(time, step),
        dropped=dropped,
    )


def refuse_long_gaps(navigation: NavigationInput, max_gap: float) -> None:
    """Raise a CoverageError if a gap of navigation is longer than `max_gap` [s]."""
    for begin, end in navigation.gaps:
        if end - begin > max_gap:
            raise CoverageError(
                f"has a gap of {end - begin:.3f} s at {begin:.6f} s, longer than max_gap, "
                f"{max_gap:g} s",
                place="group navigation",
                cure="Cut the run there, or raise max_gap.",
            )


def describe_gaps(name: str, gaps: tuple[Span, ...]) -> list[str]:
    """Warning about the gaps of an instrument, as a list of one sentence, or none."""
    if not gaps:
        return []
    longest = max(gaps, key=lambda gap: gap[1] - gap[0])
    several = f"{len(gaps)} gaps are" if len(gaps) > 1 else "a gap is"
    return [
        f"{name}: {several} bridged, the longest {longest[1] - longest[0]:.6g} s at "
        f"{longest[0]:.6f} s"
    ]


def inside_spans(time: Float, spans: tuple[Span, ...]) -> npt.NDArray[np.bool_]:
    """Whether each time lies strictly inside one of the spans."""
    inside = np.zeros(time.size, dtype=bool)
    for begin, end in spans:
        inside |= (time > begin) & (time < end)
    return inside


def _require_group(run: xr.DataTree, name: str) -> xr.Dataset:
    if name not in run.children:
        raise SchemaError("is missing", place=f"group {name}")
    return run[name].to_dataset()


def _group_times(group: xr.Dataset, name: str) -> Float:
    time = np.array(group["time"].values, dtype=float)
    place = f"group {name}, variable time"
    if not np.isfinite(time).all():
        first = int(np.argmin(np.isfinite(time)))
        raise SchemaError(
            f"must be finite everywhere, got {time[first]:g} at index {first}",
            place=place,
            cure="Leave out the records without a time.",
        )
    falls = np.flatnonzero(np.diff(time) <= 0)
    if falls.size:
        at = int(falls[0]) + 1
        raise SchemaError(
            f"must run forward, but value {at} ({time[at]:.6f} s) follows {time[at - 1]:.6f} s",
            place=place,
            cure="Cut the recording there, or correct the jump of its clock.",
        )
    return time


def _reported_sd(group: xr.Dataset, name: str, size: int) -> Float:
    if f"sd_{name}" not in group:
        return np.full(size, np.nan)
    return np.asarray(group[f"sd_{name}"].values, dtype=float)


def _in_groups(time: Float, usable: npt.NDArray[np.bool_], step: float) -> npt.NDArray[np.bool_]:
    """Whether an epoch belongs to at least 4 without a gap between them."""
    index = np.flatnonzero(usable)
    grouped = np.zeros(usable.size, dtype=bool)
    for part in np.split(index, np.flatnonzero(np.diff(time[index]) > _GAP * step) + 1):
        if part.size >= _MIN_EPOCHS:
            grouped[part] = True
    return grouped


def _find_gaps(time: Float, step: float) -> tuple[Span, ...]:
    at = np.flatnonzero(np.diff(time) > _GAP * step)
    return tuple((float(time[k]), float(time[k + 1])) for k in at)


def _refuse_jumps(time: Float, pose: Float, step: float) -> None:
    """Raise a SchemaError where time jumps but the body moves only as in one usual step."""
    speed = np.linalg.norm(np.diff(pose[:, :2], axis=0), axis=1) / np.diff(time)
    for k in np.flatnonzero(np.diff(time) > _GAP * step):
        # a gap: distance = speed x gap; a jump of the clock: distance = speed x one step
        around = np.concatenate([speed[max(k - 20, 0) : k], speed[k + 1 : k + 21]])
        usual = float(np.median(around))
        length = time[k + 1] - time[k]
        distance = speed[k] * length
        as_one_step = abs(distance - usual * step)
        as_a_gap = abs(distance - usual * length)
        if usual > _JUMP_SPEED and 3 * as_one_step < as_a_gap and as_a_gap > 0.05:
            raise SchemaError(
                f"jumps by {length - step:.6f} s at {time[k]:.6f} s, while the body went on "
                f"{distance:.3f} m, as in one step of {step:.6f} s",
                place="group navigation, variable time",
                cure="Correct the jump of its clock, or cut the recording there.",
            )


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
