"""Clocks: conversion of stamps to true time, and estimation of clock offsets from the motion.

True time is that of the navigation. The mounting of a run states the offsets to be added to the
stamps of scanner and accelerometers. If they are unknown, two instruments that measure the same
motion determine them:

- `scanner_clock_from_bounce`: on a vehicle that is parked on a flat floor and bounced by hand, the
  scanner measures the height that the accelerometers feel. The floor does not move, so the standard
  deviation is some 0.01 ms. A moving run is unsuitable: the road is correlated with the motion that
  it excites.
- `accelerometer_clock_from_navigation`: any run with enough motion; navigation is noisy, so the
  standard deviation is some 0.1 ms, and poor excitation is refused.

Both compare band-passed series of the same motion, one of them the twice integrated accelerations,
and fit the shift in time together with a scale error. The standard deviations allow for residuals
that are correlated in time (Newey and West, 1987).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.statistics import newey_west_covariance
from trueterrain.formats.run import scan_blocks
from trueterrain.geometry.rotations import from_iso8855
from trueterrain.motion import _complementary as filters
from trueterrain.motion._inertial import (
    InertialAccelerations,
    lever_height,
    normal_gravity,
    reduce_samples,
)
from trueterrain.motion._inputs import (
    InstrumentClock,
    NavigationInput,
    SmoothedSeries,
    read_accelerometers,
    read_navigation,
)

__all__ = [
    "ClockEstimate",
    "InstrumentClock",
    "accelerometer_clock",
    "accelerometer_clock_from_navigation",
    "scanner_clock",
    "scanner_clock_from_bounce",
]

Float = npt.NDArray[np.float64]

_PARKED = 0.5  # [m] by which navigation may drift while the body is parked
_MIN_EXCITATION = 5e-4  # [m, rad] root mean square of the motion
_ORDER = 3  # of the band-pass
_ITERATIONS = 6  # of the fit of a shift in time


@dataclass(frozen=True, kw_only=True)
class ClockEstimate:
    """Offset of a clock from true time, estimated from the motion."""

    clock: float
    """Offset to be added to the stamps, at the first epoch of navigation; it replaces the one that
    the mounting of the run states [s]."""

    sd: float
    "Standard deviation of the offset [s]."

    rate: float
    "Rate of change of the offset, if estimated [s/s]."

    rate_sd: float
    "Standard deviation of the rate [s/s]; 0 if it is not estimated."

    excitation: tuple[float, ...]
    "Root mean square of the motion in the band: of height [m], and of roll and pitch [rad]."

    residual: tuple[float, ...]
    "Root mean square of the residuals of the fit, for each of the same."

    scale: tuple[float, ...] = ()
    """Ratio of the motion to its measurement by the accelerometers, for each of the same: less than
    1 if they read too much [1]."""

    scale_sd: tuple[float, ...] = ()
    "Standard deviations of the ratios [1]."


def scanner_clock(run: xr.DataTree) -> InstrumentClock:
    """Clock of the scanner as the run states it.

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
    """Clock of the accelerometers as the run states it.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    delay : float
        Delay of their anti-alias filter: a sample stamped t shows the motion at t - delay [s].
    rate : float
        Rate of change of the offset [s/s].
    begin : float
        Stamp at which the offset holds [s].

    Returns
    -------
    InstrumentClock
        Conversion of stamps to true time.
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
    """Clock of the scanner from a bounce test: parked on a flat floor, bounced by hand.

    The result is relative to the clock of the accelerometers and has the same error.

    Parameters
    ----------
    run : xarray.DataTree
        Run with scans and accelerometers; 10 s of 10 mm at 1 to 2 Hz are enough.
    accelerometer_clock : float, optional
        Offset of the stamps of the accelerometers [s]; by default that of the run.
    accelerometer_delay : float
        Delay of their anti-alias filter [s].
    band : tuple of float
        Lowest and highest frequency of the comparison [Hz].
    max_sd : float
        Standard deviation above which the result is refused [s].

    Returns
    -------
    ClockEstimate
        Offset of the stamps of the scanner, which replaces that of the run.

    Raises
    ------
    CoverageError
        If there are no accelerometers, the body drives, or the motion is too small.
    """
    own = (
        _mounting_value(run, "accelerometer_clock")
        if accelerometer_clock is None
        else accelerometer_clock
    )
    navigation, inertial, attitude = _sensed_motion(
        run, InstrumentClock(offset=own - accelerometer_delay)
    )
    away = np.ptp(navigation.pose[:, :2], axis=0).max()
    if away > _PARKED:
        raise CoverageError(
            f"the body moves by {away:.2f} m, and the road under the laser with it",
            cure="Take a bounce: parked on a flat floor, bounced by hand.",
        )
    roll, pitch = attitude(inertial.time)
    position = np.array(_mounting_value(run, "scanner_position"))
    declared = _mounting_value(run, "scanner_clock")
    centre_lever, by_roll, by_pitch = lever_height(roll, pitch, inertial.centre)
    navigated = np.column_stack(
        [_interpolate_component(inertial.time, navigation, 2) + centre_lever, roll, pitch]
    )
    value, _ = filters.integrate_acceleration(inertial, navigated)
    # height of the scanner: that of the sensor centre, and the lever arm between both, linearised
    _, scanner_by_roll, scanner_by_pitch = lever_height(roll, pitch, position)
    felt = value[:, 0] + (scanner_by_roll - by_roll).mean() * value[:, 1]
    felt += (scanner_by_pitch - by_pitch).mean() * value[:, 2]
    stamp, seen = _floor_heights(run, attitude, declared)
    inside = (inertial.time >= stamp[0]) & (inertial.time <= stamp[-1])
    time = inertial.time[inside]
    motion = _band_pass(felt[inside], time, band)
    scanned = _band_pass(np.interp(time, stamp, seen), time, band)
    # the scan stamped t measures the height at t + shift
    fit = _fit_shift([(time, scanned, motion)], band, sign=1.0, begin=time[0], with_rate=False)
    return _clock_estimate(fit, declared, max_sd, "scanner")


def accelerometer_clock_from_navigation(
    run: xr.DataTree,
    *,
    accelerometer_delay: float = 0.0,
    band: tuple[float, float] = (0.8, 8.0),
    with_rate: bool = False,
    max_sd: float = 5e-4,
) -> ClockEstimate:
    """Clock of the accelerometers from height, roll and pitch of navigation.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    accelerometer_delay : float
        Delay of their anti-alias filter [s].
    band : tuple of float
        Lowest and highest frequency of the comparison [Hz].
    with_rate : bool
        Whether to estimate a rate of the clock as well.
    max_sd : float
        Standard deviation above which the result is refused [s]; with a rate, that of the offset at
        the midpoint of the run.

    Returns
    -------
    ClockEstimate
        Offset of the stamps of the accelerometers, which replaces that of the run.

    Raises
    ------
    CoverageError
        If there are no accelerometers, or the motion is too small.
    """
    declared = _mounting_value(run, "accelerometer_clock")
    navigation, inertial, attitude = _sensed_motion(
        run, InstrumentClock(offset=declared - accelerometer_delay)
    )
    time = inertial.time
    roll, pitch = attitude(time)
    navigated = np.stack(
        [_interpolate_component(time, navigation, column) for column in (2, 3, 4)], axis=1
    )
    navigated[:, 0] += lever_height(roll, pitch, inertial.centre)[0]
    value, _ = filters.integrate_acceleration(inertial, navigated)
    channels = [
        (time, _band_pass(navigated[:, j], time, band), _band_pass(value[:, j], time, band))
        for j in range(3 if inertial.observes_attitude else 1)
    ]
    # the larger the offset of their stamps, the later the accelerometers: sign -1
    begin = float(navigation.time[0])
    fit = _fit_shift(channels, band, sign=-1.0, begin=begin, with_rate=with_rate)
    return _clock_estimate(fit, declared, max_sd, "accelerometer")


@dataclass(frozen=True, eq=False)
class _ShiftFit:
    """Shift in time between two instruments, with scales, residuals and standard deviations."""

    shift: Float  # at begin, and per second if estimated
    covariance: Float
    midpoint_sd: float
    excitation: tuple[float, ...]
    residual: tuple[float, ...]
    scale: tuple[float, ...]
    scale_sd: tuple[float, ...]


def _sensed_motion(
    run: xr.DataTree, clock: InstrumentClock
) -> tuple[NavigationInput, InertialAccelerations, Any]:
    """Navigation, accelerations, and a function that gives roll and pitch at any times."""
    navigation = read_navigation(run)
    sensors = read_accelerometers(run, clock)
    if sensors is None or sensors.time[-1] < navigation.time[0]:
        raise CoverageError("has no accelerometers whose clock could be estimated")
    if navigation.gaps or sensors.gaps:
        raise CoverageError(
            "has gaps, over which the motion cannot be compared", cure="Cut the run at its gaps."
        )
    smooth = SmoothedSeries(navigation, [3, 4], window=0.1, slow=0.1)
    horizontal = SmoothedSeries(navigation, [0, 1, 5], window=0.2, slow=1.0)
    gravity = normal_gravity(run.attrs.get("origin"))
    inertial = reduce_samples(sensors, navigation, smooth, horizontal, rate=1000.0, gravity=gravity)

    def attitude(time: Float) -> Float:
        return smooth.value(np.clip(time, navigation.time[0], navigation.time[-1])).T

    return navigation, inertial, attitude


def _floor_heights(run: xr.DataTree, attitude: Any, declared: float) -> tuple[Float, Float]:
    """Times and heights of the scanner over a flat floor, one per scan."""
    mounted = from_iso8855(*_mounting_value(run, "scanner_rotation"))
    times, heights = [], []
    for block in scan_blocks(run):
        distance = block["range"].values
        angle, delay = block["angle"].values, block["delay"].values
        weight = np.isfinite(distance).astype(float)
        down = np.where(weight > 0, distance, 0.0) * np.cos(angle)
        across = np.where(weight > 0, distance, 0.0) * np.sin(angle)
        # height at the foot point of the scanner of the line fitted to the returns (down over
        # across); `part` holds the weight of each return in this height
        n, s1, s2 = weight.sum(1), (weight * across).sum(1), (weight * across**2).sum(1)
        determinant = n * s2 - s1**2
        good = determinant > 1e-6 * np.maximum(n, 1) ** 2
        part = weight[good] * (s2[good, None] - s1[good, None] * across[good])
        part /= determinant[good, None]
        time = block["time"].values[good] + declared + part @ delay
        roll, pitch = attitude(time)
        rotation = from_iso8855(roll, pitch, np.zeros(time.size)) * mounted
        times.append(time)
        heights.append((part * down[good]).sum(axis=1) * rotation.as_matrix()[:, 2, 2])
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
    """Fit ``seen(t) = scale felt(t + sign shift)`` to all channels, each with its own scale.

    Parameters
    ----------
    channels : list of (time, seen, felt)
        Each of shape (n,).
    band : tuple of float
        Frequencies that the series contain [Hz].
    sign : float
        1 or -1.
    begin : float
        Time at which the shift holds, if there is a rate [s].
    with_rate : bool
        Whether the shift changes with time.
    """
    from scipy.interpolate import CubicSpline

    shift = np.zeros(2 if with_rate else 1)
    trim = 1.0 / band[0]  # [s] in which transients of the band-pass decay
    count = shift.size
    weights = np.ones(len(channels))
    for _ in range(_ITERATIONS):
        normal = np.zeros((count + len(channels),) * 2)
        right = np.zeros(count + len(channels))
        rows = []
        for j, (time, seen, felt) in enumerate(channels):
            inside = (time > time[0] + trim) & (time < time[-1] - trim)
            at = time[inside]
            since = np.stack([np.ones_like(at), at - begin])[:count]
            spline = CubicSpline(time, felt)
            shifted = at + sign * (shift @ since)
            shape = np.zeros((at.size, count + len(channels)))
            shape[:, :count] = (sign * spline(shifted, 1) * since).T
            shape[:, count + j] = spline(shifted)
            normal += weights[j] * shape.T @ shape
            right += weights[j] * shape.T @ seen[inside]
            rows.append((shape, seen[inside]))
        # Gauss-Newton: the first unknowns are steps of the shift, linearised at scale 1, the others
        # the scales themselves; channels weigh by the inverse variance of their residuals
        found = np.linalg.solve(normal, right)
        residuals = [seen - shape @ found for shape, seen in rows]
        weights = np.array([1.0 / np.mean(residual**2) for residual in residuals])
        shift = shift + found[:count]
    # sandwich estimator: N^-1 (covariance of the scores) N^-1
    score_covariance = np.zeros_like(normal)
    for j, ((shape, _), residual) in enumerate(zip(rows, residuals, strict=True)):
        step = float(np.median(np.diff(channels[j][0])))
        score_covariance += weights[j] ** 2 * newey_west_covariance(
            shape * residual[:, None], round(1.0 / band[0] / step)
        )
    inverse = np.linalg.inv(normal)
    covariance = inverse @ score_covariance @ inverse
    shift_covariance = covariance[:count, :count]
    midpoint = np.array([1.0, 0.5 * (channels[0][0][0] + channels[0][0][-1]) - begin])[:count]
    return _ShiftFit(
        shift=shift,
        covariance=shift_covariance,
        midpoint_sd=float(np.sqrt(midpoint @ shift_covariance @ midpoint)),
        excitation=tuple(
            float(np.sqrt(np.mean(shape[:, count + j] ** 2))) for j, (shape, _) in enumerate(rows)
        ),
        residual=tuple(float(np.sqrt(np.mean(residual**2))) for residual in residuals),
        scale=tuple(found[count:].tolist()),
        scale_sd=tuple(np.sqrt(np.diag(covariance))[count:].tolist()),
    )


def _clock_estimate(fit: _ShiftFit, declared: float, max_sd: float, name: str) -> ClockEstimate:
    """The estimate; raises a CoverageError if it is too uncertain."""
    small = fit.excitation[0] < _MIN_EXCITATION and all(
        a < _MIN_EXCITATION for a in fit.excitation[1:]
    )
    if small or not fit.midpoint_sd <= max_sd:
        raise CoverageError(
            f"the motion is too small to determine the {name} clock: root mean square "
            f"{1000 * fit.excitation[0]:.2f} mm in height, standard deviation of the clock "
            f"{1000 * fit.midpoint_sd:.3f} ms, at most {1000 * max_sd:g} ms is required",
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
    """Series through a Butterworth band-pass, forward and backward: without delay."""
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


def _interpolate_component(time: Float, navigation: NavigationInput, column: int) -> Float:
    """Component of navigation at other times, by a cubic spline."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(navigation.time, navigation.pose[:, column])(time))


def _mounting_value(run: xr.DataTree, name: str) -> Any:
    return dict(run.attrs.get("mounting", {})).get(name, 0.0)
