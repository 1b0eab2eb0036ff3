"""Clocks: true time from stamps, and what a clock is off by, found from the motion itself.

True time is that of the navigation. The mounting of a run tells what is to be added to the stamps
of scanner and accelerometers. If nobody knows, two instruments that feel the same motion tell:

- `scanner_clock_from_bounce`: parked on a flat floor and bounced by hand, the laser sees the height
  that the accelerometers feel. The floor does not move, so that this is sure to 0.01 ms; a run that
  drives will not do, since the road is alike to the motion that it excites.
- `accelerometer_clock_from_navigation`: any run in which the body moves enough; navigation is
  noisy, so that this is sure to some 0.1 ms, and poor excitation is refused.

Both compare band-passed series of the same motion, the accelerations integrated twice, and fit the
shift in time together with an error of scale. Their standard deviations allow for residuals that
are correlated in time (Newey and West, 1987).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.motion._inputs import InstrumentClock

if TYPE_CHECKING:
    from trueterrain.motion._inertial import InertialAccelerations
    from trueterrain.motion._inputs import NavigationInput

__all__ = [
    "ClockEstimate",
    "InstrumentClock",
    "accelerometer_clock",
    "accelerometer_clock_from_navigation",
    "scanner_clock",
    "scanner_clock_from_bounce",
]

Float = npt.NDArray[np.float64]

_PARKED = 0.5  # [m] that a parked body may have moved
_LEAST_HEIGHT = 5e-4  # [m] root mean square of a motion that deserves the name
_ORDER = 3  # of the band-pass
_ROUNDS = 6  # of the fit of a shift in time


@dataclass(frozen=True, kw_only=True)
class ClockEstimate:
    """What a clock is off by."""

    clock: float
    """What is to be added to the stamps at the first epoch of navigation, in place of what the
    mounting of the run says [s]."""

    sd: float
    "Its standard deviation [s]."

    rate: float
    "Growth of it, where it was asked for [s/s]."

    rate_sd: float
    "Its standard deviation [s/s]; 0 where it was not asked for."

    excitation: tuple[float, ...]
    "Root mean square of the motion in the band: of height [m], and of roll and pitch [rad]."

    residual: tuple[float, ...]
    "Root mean square of what the fit leaves of it."

    scale: tuple[float, ...] = ()
    """How many times as large the motion is as the accelerometers feel it, for each of the same:
    less than 1 if they read too much [1]."""

    scale_sd: tuple[float, ...] = ()
    "Their standard deviations [1]."


def scanner_clock(run: xr.DataTree) -> InstrumentClock:
    """Clock of the scanner as the run knows it.

    Examples
    --------
    >>> run = xr.DataTree(xr.Dataset(attrs={"mounting": {"scanner_clock": 0.002}}))
    >>> scanner_clock(run).true(np.array([1.0]))
    array([1.002])
    """
    return InstrumentClock(offset=_mounting_value(run, "scanner_clock"))


def accelerometer_clock(
    run: xr.DataTree, *, delay: float = 0.0, rate: float = 0.0, begin: float = 0.0
) -> InstrumentClock:
    """Clock of the accelerometers as the run knows it.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    delay : float
        Delay of their filter against aliases: what is stamped t happened that much before [s].
    rate : float
        Growth of what is added to stamps [s/s].
    begin : float
        Stamp from which on it grows [s].

    Returns
    -------
    Clock
        Stamps to true time.
    """
    return InstrumentClock(
        offset=_mounting_value(run, "accelerometer_clock") - delay, rate=rate, begin=begin
    )


def scanner_clock_from_bounce(
    run: xr.DataTree,
    *,
    accelerometer_clock: float | None = None,
    accelerometer_delay: float = 0.0,
    band: tuple[float, float] = (0.5, 8.0),
    max_sd: float = 5e-5,
) -> ClockEstimate:
    """Clock of the scanner from a bounce: parked on a flat floor, rocked by hand.

    It is as true as the clock of the accelerometers, to which it is bound.

    Parameters
    ----------
    run : xarray.DataTree
        The run, with scans and accelerometers; 10 s and 10 mm at 1 to 2 Hz do.
    accelerometer_clock : float, optional
        What is to be added to the accelerometers' stamps [s]; by default what the run says.
    accelerometer_delay : float
        Delay of their filter against aliases [s].
    band : tuple of float
        Lowest and highest frequency that is compared [Hz].
    max_sd : float
        Standard deviation above which the result is refused [s].

    Returns
    -------
    ClockEstimate
        What is to be added to the scanner's stamps, in place of what the run says.

    Raises
    ------
    CoverageError
        If there are no accelerometers, the body drives, or the motion is too small to tell.
    """
    from trueterrain.motion import _complementary as filters
    from trueterrain.motion._heave import lever_height

    own = (
        _mounting_value(run, "accelerometer_clock")
        if accelerometer_clock is None
        else (accelerometer_clock)
    )
    navigation, inertial, attitude = _sensed_motion(
        run, InstrumentClock(offset=own - accelerometer_delay)
    )
    away = np.ptp(navigation.pose[:, :2], axis=0).max()
    if away > _PARKED:
        raise CoverageError(
            f"the body moves by {away:.2f} m, and the road under the laser with it",
            cure="Take a bounce: parked on a flat floor, rocked by hand.",
        )
    roll, pitch = attitude(inertial.time)
    position = np.array(_mounting_value(run, "scanner_position"))
    declared = _mounting_value(run, "scanner_clock")
    over, by_roll, by_pitch = lever_height(roll, pitch, inertial.middle)
    navigated = np.column_stack(
        [_interpolate_component(inertial.time, navigation, 2) + over, roll, pitch]
    )
    value, _ = filters.integrate_acceleration(inertial, navigated)
    at_laser = lever_height(roll, pitch, position)
    felt = value[:, 0] + (at_laser[1] - by_roll).mean() * value[:, 1]
    felt += (at_laser[2] - by_pitch).mean() * value[:, 2]
    stamp, seen = _floor_heights(run, attitude, declared)
    inside = (inertial.time >= stamp[0]) & (inertial.time <= stamp[-1])
    time = inertial.time[inside]
    motion = _band_pass(felt[inside], time, band)
    laser = _band_pass(np.interp(time, stamp, seen), time, band)
    # what is stamped t is the height at t + shift
    fit = _fit_shift([(time, laser, motion)], band, sign=1.0, begin=time[0], with_rate=False)
    return _clock_estimate(fit, declared, max_sd, "scanner")


def accelerometer_clock_from_navigation(
    run: xr.DataTree,
    *,
    accelerometer_delay: float = 0.0,
    band: tuple[float, float] = (0.8, 8.0),
    with_rate: bool = False,
    max_sd: float = 5e-4,
) -> ClockEstimate:
    """Clock of the accelerometers from height, roll and pitch as navigation gives them.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    accelerometer_delay : float
        Delay of their filter against aliases [s].
    band : tuple of float
        Lowest and highest frequency that is compared [Hz].
    with_rate : bool
        Whether the clock may also run fast or slow.
    max_sd : float
        Standard deviation above which the result is refused [s]; with a rate that of the clock in
        the middle of the run.

    Returns
    -------
    ClockEstimate
        What is to be added to the accelerometers' stamps, in place of what the run says.

    Raises
    ------
    CoverageError
        If there are no accelerometers, or the motion is too small to tell.
    """
    from trueterrain.motion import _complementary as filters
    from trueterrain.motion._heave import lever_height

    declared = _mounting_value(run, "accelerometer_clock")
    navigation, inertial, attitude = _sensed_motion(
        run, InstrumentClock(offset=declared - accelerometer_delay)
    )
    time = inertial.time
    roll, pitch = attitude(time)
    navigated = np.stack(
        [_interpolate_component(time, navigation, column) for column in (2, 3, 4)], axis=1
    )
    navigated[:, 0] += lever_height(roll, pitch, inertial.middle)[0]
    value, _ = filters.integrate_acceleration(inertial, navigated)
    channels = [
        (time, _band_pass(navigated[:, j], time, band), _band_pass(value[:, j], time, band))
        for j in range(3 if inertial.turns else 1)
    ]
    # the accelerometers are the later, the more is to be added to their stamps
    begin = float(navigation.time[0])
    fit = _fit_shift(channels, band, sign=-1.0, begin=begin, with_rate=with_rate)
    return _clock_estimate(fit, declared, max_sd, "accelerometer")


@dataclass(frozen=True, eq=False)
class _ShiftFit:
    shift: Float  # at begin, and per second if asked for
    covariance: Float
    middle_sd: float
    excitation: tuple[float, ...]
    residual: tuple[float, ...]
    scale: tuple[float, ...]
    scale_sd: tuple[float, ...]


def _sensed_motion(
    run: xr.DataTree, clock: InstrumentClock
) -> "tuple[NavigationInput, InertialAccelerations, Any]":
    """Navigation, accelerations, and a function for roll and pitch at any times."""
    from trueterrain.motion._fuse import gravity_at
    from trueterrain.motion._inertial import inertial_of
    from trueterrain.motion._inputs import read_accelerometers, read_navigation
    from trueterrain.motion._way import SmoothedSeries

    navigation = read_navigation(run)
    sensors = read_accelerometers(run, clock)
    if sensors is None or sensors.time[-1] < navigation.time[0]:
        raise CoverageError("has no accelerometers, whose clock could be compared")
    if navigation.gaps or sensors.gaps:
        raise CoverageError(
            "has gaps, over which motion cannot be compared", cure="Cut the run at its gaps."
        )
    quick = SmoothedSeries(navigation, [3, 4], window=0.1, slow=0.1)
    way = SmoothedSeries(navigation, [0, 1, 5], window=0.2, slow=1.0)
    gravity = gravity_at(run.attrs.get("origin"))
    inertial = inertial_of(sensors, navigation, quick, way, rate=1000.0, gravity=gravity)

    def attitude(time: Float) -> Float:
        return quick.value(np.clip(time, navigation.time[0], navigation.time[-1])).T

    return navigation, inertial, attitude


def _floor_heights(run: xr.DataTree, attitude: Any, declared: float) -> tuple[Float, Float]:
    """Height of the scanner over a flat floor, scan by scan, and when it was measured."""
    from trueterrain.formats.run import scan_blocks
    from trueterrain.geometry.rotations import from_iso8855

    mounted = from_iso8855(*_mounting_value(run, "scanner_rotation"))
    times, heights = [], []
    for block in scan_blocks(run):
        distance = block["range"].values
        angle, delay = block["angle"].values, block["delay"].values
        weight = np.isfinite(distance).astype(float)
        down = np.where(weight > 0, distance, 0.0) * np.cos(angle)
        across = np.where(weight > 0, distance, 0.0) * np.sin(angle)
        # the line through the returns, straight below the scanner: weights of each return
        n, s1, s2 = weight.sum(1), (weight * across).sum(1), (weight * across**2).sum(1)
        determinant = n * s2 - s1**2
        good = determinant > 1e-6 * np.maximum(n, 1) ** 2
        part = weight[good] * (s2[good, None] - s1[good, None] * across[good])
        part /= determinant[good, None]
        time = block["time"].values[good] + declared + part @ delay
        roll, pitch = attitude(time)
        turned = from_iso8855(roll, pitch, np.zeros(time.size)) * mounted
        times.append(time)
        heights.append((part * down[good]).sum(axis=1) * turned.as_matrix()[:, 2, 2])
    time, height = np.concatenate(times), np.concatenate(heights)
    if time.size < 4:
        raise CoverageError("the scanner sees no floor", place="group scans")
    return time, height


def _fit_shift(
    channels: list[tuple[Float, Float, Float]],
    band: tuple[float, float],
    *,
    sign: float,
    begin: float,
    with_rate: bool,
) -> _ShiftFit:
    """Fit ``seen(t) = scale felt(t + sign shift)`` to all channels, each with its own scale."""
    from scipy.interpolate import CubicSpline

    shift = np.zeros(2 if with_rate else 1)
    trim = 1.0 / band[0]  # [s] in which the band-pass settles
    count = shift.size
    weights = np.ones(len(channels))
    for _ in range(_ROUNDS):
        normal = np.zeros((count + len(channels),) * 2)
        right = np.zeros(count + len(channels))
        rows = []
        for j, (time, seen, felt) in enumerate(channels):
            inside = (time > time[0] + trim) & (time < time[-1] - trim)
            at = time[inside]
            since = np.stack([np.ones_like(at), at - begin])[:count]
            spline = CubicSpline(time, felt)
            moved = at + sign * (shift @ since)
            shape = np.zeros((at.size, count + len(channels)))
            shape[:, :count] = (sign * spline(moved, 1) * since).T
            shape[:, count + j] = spline(moved)
            normal += weights[j] * shape.T @ shape
            right += weights[j] * shape.T @ seen[inside]
            rows.append((shape, seen[inside]))
        # the first columns are steps: the scale multiplies the shape, not the steps
        found = np.linalg.solve(normal, right)
        left = [seen - shape @ found for shape, seen in rows]
        weights = np.array([1.0 / np.mean(rest**2) for rest in left])
        shift = shift + found[:count]
    meat = np.zeros_like(normal)
    for j, ((shape, _), rest) in enumerate(zip(rows, left, strict=True)):
        step = float(np.median(np.diff(channels[j][0])))
        meat += weights[j] ** 2 * long_run(shape * rest[:, None], round(1.0 / band[0] / step))
    inverse = np.linalg.inv(normal)
    every = inverse @ meat @ inverse
    whole = every[:count, :count]
    middle = np.array([1.0, 0.5 * (channels[0][0][0] + channels[0][0][-1]) - begin])[:count]
    return _ShiftFit(
        shift=shift,
        covariance=whole,
        middle_sd=float(np.sqrt(middle @ whole @ middle)),
        excitation=tuple(
            float(np.sqrt(np.mean(shape[:, count + j] ** 2))) for j, (shape, _) in enumerate(rows)
        ),
        residual=tuple(float(np.sqrt(np.mean(rest**2))) for rest in left),
        scale=tuple(found[count:].tolist()),
        scale_sd=tuple(np.sqrt(np.diag(every))[count:].tolist()),
    )


def long_run(scores: Float, lags: int) -> Float:
    """Covariance of the sum of correlated rows (Newey and West, 1987), with Bartlett's window.

    Parameters
    ----------
    scores : numpy.ndarray, shape (n, k)
        Rows, of which neighbours may be alike.
    lags : int
        Rows over which they are.

    Returns
    -------
    numpy.ndarray, shape (k, k)
        Covariance.

    Examples
    --------
    >>> long_run(np.array([[1.0], [-1.0], [1.0], [-1.0]]), 0)
    array([[4.]])
    """
    from scipy.signal import fftconvolve

    lags = min(lags, len(scores) - 1)
    window = 1.0 - np.abs(np.arange(-lags, lags + 1)) / (lags + 1)
    smooth = fftconvolve(scores, window[:, None], mode="same", axes=0)
    whole = scores.T @ smooth
    return np.asarray(0.5 * (whole + whole.T))


def _clock_estimate(fit: _ShiftFit, declared: float, max_sd: float, name: str) -> ClockEstimate:
    """The estimate, or a CoverageError if it is not sure enough."""
    small = fit.excitation[0] < _LEAST_HEIGHT and all(a < _LEAST_HEIGHT for a in fit.excitation[1:])
    if small or not fit.middle_sd <= max_sd:
        raise CoverageError(
            f"the motion is too small to tell the {name} clock: root mean square "
            f"{1000 * fit.excitation[0]:.2f} mm in height, standard deviation of the clock "
            f"{1000 * fit.middle_sd:.3f} ms, at most {1000 * max_sd:g} ms is asked for",
            cure="Take a longer run with stronger motion at 1 to 2 Hz, or raise max_sd.",
        )
    sd = np.sqrt(np.diag(fit.covariance))
    with_rate = sd.size > 1
    return ClockEstimate(
        clock=declared + float(fit.shift[0]),
        sd=float(sd[0]),
        rate=float(fit.shift[1]) if with_rate else 0.0,
        rate_sd=float(sd[1]) if with_rate else 0.0,
        excitation=fit.excitation,
        residual=fit.residual,
        scale=fit.scale,
        scale_sd=fit.scale_sd,
    )


def _band_pass(series: Float, time: Float, band: tuple[float, float]) -> Float:
    """Band-passed without delay."""
    from scipy.signal import butter, sosfiltfilt

    rate = (time.size - 1) / (time[-1] - time[0])
    if time[-1] - time[0] < 4.0 / band[0]:
        raise CoverageError(
            f"lasts {time[-1] - time[0]:.2f} s, at least {4 / band[0]:.1f} s are needed",
            cure="Take a longer run, or raise the lowest frequency of the band.",
        )
    sections = butter(_ORDER, band, "bandpass", fs=rate, output="sos")
    pad = min(series.size - 1, int(2.0 * rate / band[0]))
    return np.asarray(sosfiltfilt(sections, series, padlen=pad))


def _interpolate_component(time: Float, navigation: "NavigationInput", column: int) -> Float:
    """A component of navigation at other times, by a cubic spline."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(navigation.time, navigation.pose[:, column])(time))


def _mounting_value(run: xr.DataTree, name: str) -> Any:
    return dict(run.attrs.get("mounting", {})).get(name, 0.0)
