"""Fusion of navigation and accelerometers: trajectory of the body with its covariance.

=============  ===================================================================================
`method`       description
=============  ===================================================================================
`navigation`   navigation alone, interpolated
`thesis`       navigation low-passed and accelerometers high-passed at 10 Hz by causal Butterworth
               filters and integrated twice, as in the thesis (2.3): distorts the wheel hop
`zero-phase`   the same crossover without delay, exactly complementary
`wiener`       zero-phase, with the optimal crossover for the noise of both instruments
`rts`          Kalman filter and Rauch-Tung-Striebel smoother; biases, scale errors and clock of
               the accelerometers and the drift of navigation are estimated
=============  ===================================================================================

East, north and yaw come from navigation, smoothed without delay: by rts as far as the motion of the
vehicle allows (see `trueterrain.motion._adaptive`), else in a fixed window. An accelerometer along
z of the body also measures gravity, centripetal and braking terms, which are all modelled (see
`trueterrain.motion._inertial`). Three accelerometers that are not in line determine height, roll
and pitch; fewer determine the height alone.

Sources: H. Smith III (2009) section 2.3; Smyth and Wu (2007), Karamihas (2021) for the multi-rate
filter with smoothing; Bierman (1973) for the form of the smoother.
"""

import warnings
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.motion import _complementary as filters
from trueterrain.motion._adaptive import AdaptiveTrajectory
from trueterrain.motion._inertial import (
    BodyCoordinates,
    InertialAccelerations,
    normal_gravity,
    reduce_samples,
)
from trueterrain.motion._inputs import (
    AccelerometerInput,
    CubicSeries,
    NavigationInput,
    SmoothedSeries,
    bridge_variance,
    describe_gaps,
    read_accelerometers,
    read_navigation,
    refuse_long_gaps,
)
from trueterrain.motion._noise import InstrumentNoise, estimate_noise, horizontal_window
from trueterrain.motion._smoother import SensorErrors, SmootherResult, smooth_coordinates
from trueterrain.motion.clocks import accelerometer_clock
from trueterrain.motion.settings import FusionSettings, Method, Three
from trueterrain.motion.trajectory import Trajectory, assemble_trajectory, knots_of_navigation

__all__ = ["FusedMotion", "FusionSettings", "fuse_motion"]

Float = npt.NDArray[np.float64]

_COVARIANCE = ("east", "north", "up", "about_east", "about_north", "about_up")

_VERTICAL = [2, 3, 4]  # up, roll, pitch among the components of navigation
_HORIZONTAL = [0, 1, 5]  # east, north, yaw
_ATTITUDE_WINDOW, _MAX_WINDOW = 0.1, 1.0  # [s] of attitude; the longest, of accelerations
_HORIZONTAL_WINDOW = 0.2  # [s] of east, north and yaw, where the smoothing does not adapt
_MAX_INNOVATION = 2.0  # normalised innovation squared above which a warning is given


@dataclass(frozen=True, kw_only=True, eq=False)
class FusedMotion:
    """Trajectory of a run, with the noise and the sensor errors that the fusion estimated."""

    trajectory: Trajectory
    "Position and attitude of the body, with covariance and flags."

    method: Method
    "Method of the fusion."

    noise: InstrumentNoise | None
    "Noise of the instruments as used; None for navigation alone."

    crossover: Three | None
    "Frequency at which both instruments are equally noisy: up, roll, pitch [Hz]."

    drift: Float | None
    "Drift of up, roll and pitch of navigation at the knots, by rts, shape (n, 3) [m, rad, rad]."

    bias: tuple[float, ...] | None
    "Biases of the accelerometers at the last knot, by rts [m/s^2]."

    delay: tuple[float, float] | None
    "Delay of the accelerometers beyond the stated one, and its standard deviation, by rts [s]."

    normalised_innovation_squared: Three | None
    """Mean square of the innovations of rts over their predicted variance, for up, roll, pitch:
    near 1 if the noise model holds."""

    gaps: tuple[tuple[str, float, float], ...]
    "Instrument, begin and end of each gap [s]."

    problems: tuple[str, ...]
    "Warnings, as sentences."

    def to_dict(self) -> dict[str, Any]:
        """Method, noise, sensor errors and warnings, ready for JSON."""
        t = self.trajectory
        sd = np.median(np.sqrt(np.einsum("nii->ni", t.covariance)), axis=0)
        return {
            "method": self.method,
            "time": [float(t.time[0]), float(t.time[-1])],
            "knots": int(t.time.size),
            "sd": dict(zip(_COVARIANCE, sd.tolist(), strict=True)),
            "noise": None if self.noise is None else asdict(self.noise),
            "crossover": self.crossover,
            "bias": self.bias,
            "delay": self.delay,
            "normalised_innovation_squared": self.normalised_innovation_squared,
            "gaps": [list(gap) for gap in self.gaps],
            "problems": list(self.problems),
        }


def fuse_motion(run: xr.DataTree, *, settings: FusionSettings | None = None) -> FusedMotion:
    """Trajectory of the body over a run, from navigation and accelerometers.

    Parameters
    ----------
    run : xarray.DataTree
        Run with ``navigation`` and, unless the method is navigation, ``accelerometers``.
    settings : FusionSettings, optional
        Method and parameters; by default rts.

    Returns
    -------
    FusedMotion
        Trajectory over the time of the navigation, with covariance and flags, and a report.

    Raises
    ------
    SchemaError
        If times are not finite, not ascending, or the clock of the navigation jumps.
    CoverageError
        If there are too few epochs, a gap is longer than `max_gap`, or the method needs
        accelerometers and there are none (rts then warns and uses navigation alone).

    Examples
    --------
    >>> from trueterrain.formats.navigation import make_navigation
    >>> time = np.arange(0.0, 2.0, 0.005)
    >>> still = dict.fromkeys(("north", "up", "roll", "pitch", "yaw"), np.zeros(time.size))
    >>> navigation = make_navigation({"time": time, "east": 5.0 * time, **still})
    >>> run = xr.DataTree.from_dict({"navigation": navigation})
    >>> motion = fuse_motion(run, settings=FusionSettings(method="navigation"))
    >>> motion.trajectory.at([1.0012]).position
    array([[5.006, 0.   , 0.   ]])
    """
    settings = FusionSettings() if settings is None else settings
    navigation = read_navigation(run)
    refuse_long_gaps(navigation, settings.max_gap)
    problems = [f"navigation: {navigation.dropped} epochs are left out: not finite or alone"]
    problems = problems if navigation.dropped else []
    sensors = None
    if settings.method != "navigation":
        clock = accelerometer_clock(
            run,
            delay=settings.accelerometer_delay,
            rate=settings.accelerometer_clock_rate,
            begin=float(navigation.time[0]),
        )
        sensors = _require_overlap(read_accelerometers(run, clock), navigation)
    if settings.method != "navigation" and sensors is None:
        reason = "the run has no accelerometers that were on while the navigation was"
        if settings.method != "rts":
            raise CoverageError(
                f"{reason}, which the method {settings.method} needs", cure="Use method navigation."
            )
        warnings.warn(f"{reason}; its motion is that of navigation alone", stacklevel=2)
        problems.append(reason)
    parts = _prepare_parts(navigation, settings)
    problems += describe_gaps("navigation", navigation.gaps)
    if sensors is None:
        return _fuse_navigation_only(parts, problems)
    if sensors.dropped:
        problems.append(f"accelerometers: {sensors.dropped} samples are left out: not finite")
    inertial = _inertial_accelerations(run, parts, sensors)
    problems += describe_gaps("accelerometers", inertial.missing_spans)
    if not inertial.observes_attitude:
        problems.append(
            "the accelerometers do not determine roll and pitch, which come from navigation"
        )
    return _fuse_both(parts, sensors, inertial, problems)


@dataclass(frozen=True, kw_only=True, eq=False)
class _FusionParts:
    """Navigation as series of time, smoothed as the steps of the fusion need them."""

    navigation: NavigationInput
    settings: FusionSettings
    sd: Float  # of navigation, reported or assumed, (epoch, 6)
    vertical: SmoothedSeries  # up, roll, pitch, not smoothed
    attitude: SmoothedSeries  # roll, pitch
    windowed: SmoothedSeries  # east, north, yaw in a fixed window
    window: float  # its length [s]
    horizontal: CubicSeries  # east, north, yaw of the trajectory


def _prepare_parts(navigation: NavigationInput, settings: FusionSettings) -> _FusionParts:
    sd = np.where(np.isfinite(navigation.sd), navigation.sd, settings.navigation_sd)
    window = _HORIZONTAL_WINDOW if settings.smoothing_window is None else settings.smoothing_window
    windowed = SmoothedSeries(navigation, _HORIZONTAL, window=window, slow=_MAX_WINDOW)
    adaptive = settings.method == "rts" and settings.smoothing_window is None
    return _FusionParts(
        navigation=navigation,
        settings=settings,
        sd=sd,
        windowed=windowed,
        window=window,
        vertical=SmoothedSeries(navigation, _VERTICAL, window=0.0, slow=_MAX_WINDOW),
        attitude=SmoothedSeries(
            navigation, _VERTICAL[1:], window=_ATTITUDE_WINDOW, slow=_ATTITUDE_WINDOW
        ),
        horizontal=AdaptiveTrajectory(navigation, sd) if adaptive else windowed,
    )


def _require_overlap(
    sensors: AccelerometerInput | None, navigation: NavigationInput
) -> AccelerometerInput | None:
    """Accelerometers if at least 4 samples lie within the navigation."""
    if sensors is None:
        return None
    inside = (sensors.time >= navigation.time[0]) & (sensors.time <= navigation.time[-1])
    return sensors if np.count_nonzero(inside) >= 4 else None


def _inertial_accelerations(
    run: xr.DataTree, parts: _FusionParts, sensors: AccelerometerInput
) -> InertialAccelerations:
    """Accelerations of height, roll and pitch; other terms are reduced by navigation."""
    settings = parts.settings
    gravity = (
        normal_gravity(run.attrs.get("origin")) if settings.gravity is None else settings.gravity
    )
    slow = SmoothedSeries(
        parts.navigation,
        _HORIZONTAL,
        window=parts.window,
        slow=horizontal_window(
            parts.navigation, parts.windowed, sensors, _ATTITUDE_WINDOW, _MAX_WINDOW
        ),
    )
    return reduce_samples(
        sensors, parts.navigation, parts.attitude, slow, rate=settings.rate, gravity=gravity
    )


def _fuse_navigation_only(parts: _FusionParts, problems: list[str]) -> FusedMotion:
    time, coarse = knots_of_navigation(
        parts.navigation, parts.vertical, parts.horizontal, parts.settings.rate
    )
    variance = _interpolate_columns(time, parts.navigation.time, parts.sd[:, _VERTICAL] ** 2)
    variance += _gap_variance(parts, time, _VERTICAL)
    coordinates = BodyCoordinates(
        value=parts.vertical.value(time),
        rate=parts.vertical.rate(time),
        covariance=_diagonal_matrices(variance),
    )
    edge = (parts.navigation.step, parts.navigation.step)
    return _assemble_motion(parts, time, coordinates, np.zeros(3), (), edge, [*problems, *coarse])


def _fuse_both(
    parts: _FusionParts,
    sensors: AccelerometerInput,
    inertial: InertialAccelerations,
    problems: list[str],
) -> FusedMotion:
    settings = parts.settings
    navigation = parts.navigation
    time = inertial.time
    coordinates = filters.sensor_centre_coordinates(
        inertial, parts.vertical, parts.attitude, navigation.gaps
    )
    noise, random_walk = estimate_noise(
        settings,
        navigation,
        sensors,
        inertial,
        coordinates,
        parts.attitude,
        parts.sd[:, _VERTICAL],
    )
    spectra = filters.error_spectra(
        inertial,
        white=noise.white,
        random_walk=random_walk,
        accelerometer=noise.accelerometer,
        bias_walk=settings.bias_walk,
        navigation_step=navigation.step,
    )
    # reported variance = white noise + drift; at least a tenth of the white noise is drift
    white = np.array(noise.white)
    drift_sd = np.sqrt(np.maximum(parts.sd[:, _VERTICAL] ** 2 - white**2, (0.1 * white) ** 2))
    drift_sd = _interpolate_columns(time, navigation.time, drift_sd)
    found: SmootherResult | None = None
    edge = (0.5 * parts.window, 0.5 * parts.window)
    if settings.method == "rts":
        attitude = parts.attitude
        angular_acceleration = np.sqrt(np.mean(attitude.second(navigation.time) ** 2, axis=0))
        found = smooth_coordinates(
            inertial,
            navigation,
            attitude.value(navigation.time),
            angular_acceleration,
            noise,
            drift_sd,
            SensorErrors(
                bias_sd=settings.bias_sd,
                bias_walk=settings.bias_walk,
                scale_sd=settings.scale_sd,
                delay_sd=settings.accelerometer_delay_sd,
            ),
        )
        result = found.coordinates
        problems = [*problems, *_smoother_problems(found, settings)]
    else:
        result, decay = _filter_coordinates(parts, inertial, coordinates, spectra, noise, drift_sd)
        edge = (max(edge[0], decay[0]), max(edge[1], decay[1]))
    gaps = tuple(("accelerometers", *gap) for gap in inertial.missing_spans)
    motion = _assemble_motion(parts, time, result, inertial.centre, gaps, edge, problems)
    return FusedMotion(
        trajectory=motion.trajectory,
        method=settings.method,
        noise=noise,
        crossover=filters.crossover_frequency(spectra),
        gaps=motion.gaps,
        problems=motion.problems,
        drift=None if found is None else found.drift,
        bias=None if found is None else tuple(map(float, found.bias)),
        delay=None if found is None else found.delay,
        normalised_innovation_squared=None
        if found is None
        else _three_floats(found.normalised_innovation_squared),
    )


def _smoother_problems(found: SmootherResult, settings: FusionSettings) -> list[str]:
    """Warnings where innovations or the delay contradict the model."""
    problems = []
    squares = found.normalised_innovation_squared
    if squares.max() > _MAX_INNOVATION:
        name = ("up", "roll", "pitch")[int(np.argmax(squares))]
        problems.append(
            f"navigation and accelerometers disagree in {name}, {squares.max():.1f} times "
            "as much as their noise allows: look for a jump of a clock, or a position that is wrong"
        )
    if abs(found.delay[0]) > 3 * settings.accelerometer_delay_sd:
        problems.append(
            f"the accelerometers are {1000 * found.delay[0]:.2f} ms later than stated, more than "
            "accelerometer_delay_sd allows: find their clock with "
            "clocks.accelerometer_clock_from_navigation"
        )
    return problems


def _filter_coordinates(
    parts: _FusionParts,
    inertial: InertialAccelerations,
    coordinates: Float,
    spectra: filters.ErrorSpectra,
    noise: InstrumentNoise,
    drift_sd: Float,
) -> tuple[BodyCoordinates, tuple[float, float]]:
    """Coordinates by a complementary filter, and its decay times at both ends [s]."""
    s = parts.settings
    value, rate, variance, decay = filters.filter_coordinates(
        inertial, coordinates, spectra, s, drift_time=noise.drift_time, drift_sd=drift_sd
    )
    if inertial.observes_attitude:
        variance += filters.gap_variance(inertial, spectra, parts.navigation.gaps)
    else:
        variance += _gap_variance(parts, inertial.time, _VERTICAL)
    for begin, end in inertial.missing_spans:
        bridge = bridge_variance(inertial.time, ((begin, end),), 1.0)[:, None]
        variance += bridge * [s.bridge_density, s.bridge_turn_density, s.bridge_turn_density]
    found = BodyCoordinates(value=value, rate=rate, covariance=_diagonal_matrices(variance))
    return found, decay


def _assemble_motion(
    parts: _FusionParts,
    time: Float,
    coordinates: BodyCoordinates,
    centre: Float,
    gaps: tuple[tuple[str, float, float], ...],
    edge: tuple[float, float],
    problems: list[str],
) -> FusedMotion:
    variance = _interpolate_columns(time, parts.navigation.time, parts.sd[:, _HORIZONTAL] ** 2)
    variance += _gap_variance(parts, time, _HORIZONTAL)
    all_gaps = (*(("navigation", *gap) for gap in parts.navigation.gaps), *gaps)
    spans = tuple((begin, end) for _, begin, end in all_gaps)
    trajectory = assemble_trajectory(
        time, coordinates, centre, parts.horizontal, variance, spans, edge
    )
    return FusedMotion(
        trajectory=trajectory,
        method="navigation",
        noise=None,
        crossover=None,
        drift=None,
        bias=None,
        delay=None,
        normalised_innovation_squared=None,
        gaps=all_gaps,
        problems=tuple(problems),
    )


def _gap_variance(parts: _FusionParts, time: Float, columns: list[int]) -> Float:
    """Variance of cubics over the gaps of navigation, shape (n, columns)."""
    s = parts.settings
    one = bridge_variance(time, parts.navigation.gaps, 1.0)[:, None]
    return one * [s.bridge_density if c < 3 else s.bridge_turn_density for c in columns]


def _interpolate_columns(time: Float, known: Float, values: Float) -> Float:
    return np.stack([np.interp(time, known, column) for column in values.T], axis=1)


def _diagonal_matrices(variance: Float) -> Float:
    return np.asarray(variance[:, :, None] * np.eye(3))


def _three_floats(values: Float) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
