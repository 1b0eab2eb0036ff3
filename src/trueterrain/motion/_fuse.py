"""The steps of the fusion, one after the other."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.motion import _complementary as filters
from trueterrain.motion._adaptive import AdaptiveTrajectory
from trueterrain.motion._assemble import trajectory_of
from trueterrain.motion._complementary import BodyCoordinates, ErrorSpectra
from trueterrain.motion._heave import lever_height
from trueterrain.motion._inertial import InertialAccelerations, inertial_of, knots_without
from trueterrain.motion._inputs import AccelerometerInput, NavigationInput, Span
from trueterrain.motion._noise import LEAST, InstrumentNoise, quietest_density, white_and_wander
from trueterrain.motion._rts import SensorErrors, SmootherResult, smoothed_coordinates
from trueterrain.motion._way import CubicSeries, SmoothedSeries, bridge_variance
from trueterrain.motion.fuse import DRIFT_TIME, FusedMotion, FusionSettings

Float = npt.NDArray[np.float64]

_HEAVE = [2, 3, 4]  # up, roll, pitch among the components of navigation
_WAY = [0, 1, 5]  # east, north, yaw
_QUICK, _SLOW = 0.1, 1.0  # [s] windows for attitude, and longest for accelerations of the way
_WINDOW = 0.2  # [s] in which the way is smoothed if it is not found from the run
_DRIFT_TIMES = 0.1, 1e5  # [s] times of correlation of a drift that are believed
_UNSURE = np.array([0.01, 0.01, 0.01])  # [m/s^2, rad/s^2] of errors of bias and scale over a gap
_STRANGE = 2.0  # mean square of innovations over what is expected that is worth a word
_SIDE = 0.1  # [s] beside a gap from which it is bridged
_APART = 1.5  # [Hz] crossover of the filter that measures noise
_FOLLOWED = np.array([1e-5, 5e-6, 5e-6])  # [m, rad, rad] to which knots follow up, roll, pitch
_FOLLOWED_WAY = np.array([1e-4, 1e-4, 5e-5])  # [m, m, rad] the same of east, north, yaw
_MOST_KNOTS = 2_000_000  # that fast navigation may be given: 0.9 GB


@dataclass(frozen=True, kw_only=True, eq=False)
class _FusionParts:
    navigation: NavigationInput
    settings: FusionSettings
    sd: Float  # of navigation, reported or assumed, (epoch, 6)
    quick: SmoothedSeries  # up, roll, pitch as they are
    attitude: SmoothedSeries  # roll, pitch
    near: SmoothedSeries  # east, north, yaw in a fixed window
    window: float  # this [s]
    way: CubicSeries  # east, north, yaw as they are stated


def fuse_inputs(
    run: xr.DataTree,
    navigation: NavigationInput,
    sensors: AccelerometerInput | None,
    settings: FusionSettings,
    problems: list[str],
) -> FusedMotion:
    """Motion from what was read."""
    sd = np.where(np.isfinite(navigation.sd), navigation.sd, settings.navigation_sd)
    window = _WINDOW if settings.smoothing_window is None else settings.smoothing_window
    near = SmoothedSeries(navigation, _WAY, window=window, slow=_SLOW)
    adaptive = settings.method == "rts" and settings.smoothing_window is None
    parts = _FusionParts(
        navigation=navigation,
        settings=settings,
        sd=sd,
        near=near,
        window=window,
        quick=SmoothedSeries(navigation, _HEAVE, window=0.0, slow=_SLOW),
        attitude=SmoothedSeries(navigation, _HEAVE[1:], window=_QUICK, slow=_QUICK),
        way=AdaptiveTrajectory(navigation, sd) if adaptive else near,
    )
    problems = [*problems, *_gap_problems("navigation", navigation.gaps)]
    if sensors is None:
        return _by_navigation(parts, problems)
    if sensors.dropped:
        problems.append(f"accelerometers: {sensors.dropped} samples are left out: not finite")
    gravity = gravity_at(run.attrs.get("origin")) if settings.gravity is None else settings.gravity
    slow = SmoothedSeries(
        navigation, _WAY, window=window, slow=_acceleration_window(parts, sensors)
    )
    inertial = inertial_of(
        sensors, navigation, parts.attitude, slow, rate=settings.rate, gravity=gravity
    )
    problems += _gap_problems("accelerometers", _lost_spans(inertial))
    if not inertial.turns:
        problems.append("the accelerometers do not tell roll and pitch, which are by navigation")
    return _by_both(parts, sensors, inertial, problems)


def gravity_at(origin: object) -> float:
    """Gravity on the ellipsoid and above it [m/s^2]; standard gravity if no place is known.

    Source: Somigliana's formula of WGS 84 with the free-air gradient.

    Examples
    --------
    >>> gravity_at((11.0, 45.0, 0.0))
    9.80619...
    """
    if not isinstance(origin, list | tuple | np.ndarray) or len(origin) != 3:
        return 9.80665
    square = np.sin(np.deg2rad(float(origin[1]))) ** 2
    normal = 9.7803253359 * (1 + 0.00193185265241 * square)
    return float(normal / np.sqrt(1 - 0.00669437999013 * square) - 3.086e-6 * float(origin[2]))


def _gap_problems(name: str, gaps: tuple[Span, ...]) -> list[str]:
    if not gaps:
        return []
    longest = max(gaps, key=lambda gap: gap[1] - gap[0])
    several = f"{len(gaps)} gaps are" if len(gaps) > 1 else "a gap is"
    return [
        f"{name}: {several} bridged, the longest {longest[1] - longest[0]:.6g} s at "
        f"{longest[0]:.6f} s"
    ]


def _acceleration_window(parts: _FusionParts, sensors: AccelerometerInput) -> float:
    """Window for accelerations of the way [s]: so long that their noise is less than the sensors'.

    A cubic over the window W passes noise up to 1.25 / W; an inclined accelerometer feels it.
    """
    navigation = parts.navigation
    rough = navigation.pose[:, _WAY[:2]] - parts.near.value(navigation.time)[:, :2]
    density = np.sqrt(2 * navigation.step) * np.sqrt(np.mean(rough**2))
    incline = np.sqrt(np.mean(navigation.pose[:, 3:5] ** 2))
    own = np.mean([quietest_density(one, 1.0 / sensors.step) for one in sensors.force.T])
    window = 2 * np.pi * 1.25 * np.sqrt(density * incline * np.sqrt(len(sensors.position)) / own)
    return float(np.clip(window, _QUICK, _SLOW))


def _by_navigation(parts: _FusionParts, problems: list[str]) -> FusedMotion:
    time, coarse = _knots_by_navigation(parts)
    variance = _interpolate_columns(time, parts.navigation.time, parts.sd[:, _HEAVE] ** 2)
    variance += _gap_variance(parts, time, _HEAVE)
    found = BodyCoordinates(
        value=parts.quick.value(time),
        rate=parts.quick.rate(time),
        covariance=_diagonal_matrices(variance),
    )
    edge = (parts.navigation.step, parts.navigation.step)
    return _assemble_motion(parts, time, found, np.zeros(3), (), edge, [*problems, *coarse])


def _knots_by_navigation(parts: _FusionParts) -> tuple[Float, list[str]]:
    """Knots between which cubics follow the navigation, and where they do not, in words.

    Rates at the epochs of a fast navigation hold its noise and the steps of its numbers: over
    knots far longer than its steps, cubics multiply these.
    """
    from scipy.interpolate import CubicHermiteSpline

    navigation, rate = parts.navigation, parts.settings.rate
    finest = 1.0 / navigation.step
    while True:
        time = knots_without(navigation, rate)
        off = [
            np.abs(series.value(navigation.time) - cubic(navigation.time)).max(axis=0) / allowed
            for series, allowed in ((parts.quick, _FOLLOWED), (parts.way, _FOLLOWED_WAY))
            for cubic in [CubicHermiteSpline(time, series.value(time), series.rate(time))]
        ]
        worst = float(np.max(off))
        if worst <= 1.0 or rate >= finest:  # a knot for each epoch is all that there is
            return time, []
        rate = min(2.0 * rate, finest)
        if rate * (time[-1] - time[0]) > _MOST_KNOTS:
            break
    return time, [
        f"navigation: its {finest:.0f} epochs per second are followed to "
        f"{1000 * worst * _FOLLOWED[0]:.2g} mm only, with {time.size} knots: cut the run into "
        "shorter ones, or thin the navigation out"
    ]


def _by_both(
    parts: _FusionParts,
    sensors: AccelerometerInput,
    inertial: InertialAccelerations,
    problems: list[str],
) -> FusedMotion:
    settings = parts.settings
    time = inertial.time
    coordinates = _sensor_centre_motion(parts, inertial)
    noise, wander = _estimate_noise(parts, sensors, inertial, coordinates)
    spectra = _error_spectra(parts, inertial, noise, wander)
    white = np.array(noise.white)
    drift_sd = np.sqrt(np.maximum(parts.sd[:, _HEAVE] ** 2 - white**2, (0.1 * white) ** 2))
    drift_sd = _interpolate_columns(time, parts.navigation.time, drift_sd)
    found: SmootherResult | None = None
    edge = (0.5 * parts.window, 0.5 * parts.window)
    if settings.method == "rts":
        turn = np.sqrt(np.mean(parts.attitude.second(parts.navigation.time) ** 2, axis=0))
        found = smoothed_coordinates(
            inertial,
            parts.navigation,
            parts.attitude.value(parts.navigation.time),
            turn,
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
        problems = [*problems, *_flag_estimates(found, settings)]
    else:
        result, settles = _filter_complementary(
            parts, inertial, coordinates, spectra, noise, drift_sd
        )
        edge = (max(edge[0], settles[0]), max(edge[1], settles[1]))
    gaps = tuple(("accelerometers", *gap) for gap in _lost_spans(inertial))
    motion = _assemble_motion(parts, time, result, inertial.middle, gaps, edge, problems)
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


def _flag_estimates(found: SmootherResult, settings: FusionSettings) -> list[str]:
    """What the smoother finds strange, in words."""
    flags = []
    if found.normalised_innovation_squared.max() > _STRANGE:
        name = ("up", "roll", "pitch")[int(np.argmax(found.normalised_innovation_squared))]
        flags.append(
            f"navigation and accelerometers disagree in {name}, {found.normalised_innovation_squared.max():.1f} times "
            "as much as their noise allows: look for a jump of a clock, or a position that is wrong"
        )
    if abs(found.delay[0]) > 3 * settings.accelerometer_delay_sd:
        flags.append(
            f"the accelerometers are {1000 * found.delay[0]:.2f} ms later than was said, more than "
            "accelerometer_delay_sd allows: find their clock with "
            "clocks.accelerometer_clock_from_navigation"
        )
    return flags


def _sensor_centre_motion(parts: _FusionParts, inertial: InertialAccelerations) -> Float:
    """Height of the middle of the sensors, roll and pitch at the knots by navigation, (n, 3).

    The lever goes by roll and pitch of both instruments, whose noise is less.
    """
    coordinates = parts.quick.value(inertial.time)
    angles = parts.attitude.value(inertial.time)
    if inertial.turns:
        angles = filters.zero_phase(inertial, coordinates, cutoff=_APART, order=2)[0][:, 1:]
    coordinates[:, 0] += lever_height(angles[:, 0], angles[:, 1], inertial.middle)[0]
    return _bridge_gaps(parts.navigation.gaps, inertial, coordinates)


def _bridge_gaps(
    gaps: tuple[Span, ...], inertial: InertialAccelerations, coordinates: Float
) -> Float:
    """Over gaps of navigation the motion goes on as the accelerometers say."""
    if not (gaps and inertial.turns):
        return coordinates
    time = inertial.time
    for begin, end in gaps * 3:  # the parabola that aligns both is the better each time
        value, _ = filters.integrate_acceleration(inertial, coordinates)
        apart = coordinates - value
        sides = [(time > begin - _SIDE) & (time <= begin), (time >= end) & (time < end + _SIDE)]
        inside = (time > begin) & (time < end)
        if not (inside.any() and sides[0].any() and sides[1].any()):
            continue
        x = (time[inside, None] - begin) / (end - begin)
        before, after = (apart[side].mean(axis=0) for side in sides)
        coordinates[inside] = value[inside] + before + x * (after - before)
    return coordinates


def _filter_complementary(
    parts: _FusionParts,
    inertial: InertialAccelerations,
    coordinates: Float,
    spectra: ErrorSpectra,
    noise: InstrumentNoise,
    drift_sd: Float,
) -> tuple[BodyCoordinates, tuple[float, float]]:
    """Coordinates by a complementary filter, and the times in which it settles at both ends."""
    s = parts.settings
    time = inertial.time
    frequency = np.geomspace(1.5 / (time[-1] - time[0]), 0.5 * s.rate, 2000)
    share = filters.butterworth_gain(frequency, s.crossover, s.order)
    settles = (0.5 / s.crossover, 0.5 / s.crossover)
    extra = np.zeros(3)
    none = np.zeros_like(coordinates)  # through which the filter shows the share of the sensors
    if s.method == "wiener":
        value, rate = filters.wiener_filter(inertial, coordinates, spectra)
        _, fast = filters.wiener_filter(inertial, none, spectra)
        share = filters.low_pass(spectra, frequency)
    else:
        value, rate = filters.zero_phase(inertial, coordinates, cutoff=s.crossover, order=s.order)
        _, fast = filters.zero_phase(inertial, none, cutoff=s.crossover, order=s.order)
    if s.method == "thesis":
        value, rate, extra = filters.causal_filter(
            inertial, coordinates, cutoff=s.crossover, order=s.order
        )
        settles = (2.0 / s.crossover, 0.0)
    late = s.accelerometer_delay_sd * np.sqrt(np.mean(fast**2, axis=0))
    variance = filters.filter_variance(spectra, share, frequency) + extra**2 + late**2
    left = filters.passed_drift(share, frequency, np.array(noise.drift_time))
    whole = left * drift_sd**2 + variance
    if inertial.turns:
        carried = bridge_variance(time, parts.navigation.gaps, 1.0)[:, None]
        whole += carried * (0.5 * spectra.acceleration + _UNSURE**2)
    else:
        whole += _gap_variance(parts, time, _HEAVE)
    for begin, end in _lost_spans(inertial):
        lost = bridge_variance(time, ((begin, end),), 1.0)[:, None]
        whole += lost * [s.bridge_density, s.bridge_turn_density, s.bridge_turn_density]
    return BodyCoordinates(value=value, rate=rate, covariance=_diagonal_matrices(whole)), settles


def _estimate_noise(
    parts: _FusionParts,
    sensors: AccelerometerInput,
    inertial: InertialAccelerations,
    coordinates: Float,
) -> tuple[InstrumentNoise, Float]:
    """Noise of the instruments, and the wander of the drift per second."""
    s = parts.settings
    estimated = []
    inside = (sensors.time >= inertial.fine[0]) & (sensors.time <= inertial.fine[-1])
    density = [quietest_density(one, 1.0 / sensors.step) for one in sensors.force[inside].T]
    if s.accelerometer_noise is not None:
        density = [s.accelerometer_noise] * len(density)
    else:
        estimated.append("accelerometer")
    residual = _navigation_residual(parts, inertial, coordinates)
    rate = 1.0 / parts.navigation.step
    pairs = np.array([white_and_wander(column, rate) for column in residual.T])
    white = np.maximum(pairs[:, 0], LEAST)
    if s.navigation_noise is not None:
        white = np.array(s.navigation_noise)
    else:
        estimated.append("white")
    total = np.sqrt(np.mean(parts.sd[:, _HEAVE] ** 2, axis=0))
    drift = np.sqrt(np.maximum(total**2 - white**2, (0.1 * white) ** 2))
    length = np.array(DRIFT_TIME if s.drift_time is None else s.drift_time)
    if s.drift_time is None:
        seen = pairs[:, 1] > 0
        length[seen] = np.clip(2 * drift[seen] ** 2 / pairs[seen, 1], *_DRIFT_TIMES)
        estimated += [
            f"drift_time of {name}"
            for name, at in zip(("up", "roll", "pitch"), seen, strict=True)
            if at
        ]
    noise = InstrumentNoise(
        white=_three_floats(white),
        drift_sd=_three_floats(drift),
        drift_time=_three_floats(length),
        accelerometer=tuple(density),
        estimated=tuple(estimated),
    )
    return noise, 2 * drift**2 / length


def _navigation_residual(
    parts: _FusionParts, inertial: InertialAccelerations, coordinates: Float
) -> Float:
    """Navigation less the fused motion, above 1.5 Hz, at the epochs; shape (epoch, 3).

    What errors of the accelerometers' clock and scale leave of the motion is fitted and removed.
    """
    from scipy.interpolate import CubicHermiteSpline

    navigation = parts.navigation
    time = inertial.time
    value, rate = filters.zero_phase(inertial, coordinates, cutoff=_APART, order=2)
    smooth = CubicHermiteSpline(time, value, rate, axis=0)(navigation.time)
    slow, slow_rate = filters.zero_phase(
        inertial, np.zeros_like(coordinates), cutoff=_APART, order=2
    )  # the motion above the crossover
    measured = navigation.pose[:, _HEAVE].copy()
    angles = smooth[:, 1:] if inertial.turns else parts.attitude.value(navigation.time)
    measured[:, 0] += lever_height(angles[:, 0], angles[:, 1], inertial.middle)[0]
    residual = measured - smooth
    fast = CubicHermiteSpline(time, slow, slow_rate, axis=0)
    shapes = fast(navigation.time), fast(navigation.time, 1)
    for j in range(3):
        basis = np.stack([shape[:, j] for shape in shapes], axis=1)
        residual[:, j] -= basis @ np.linalg.lstsq(basis, residual[:, j], rcond=None)[0]
    return np.asarray(residual)


def _error_spectra(
    parts: _FusionParts, inertial: InertialAccelerations, noise: InstrumentNoise, wander: Float
) -> ErrorSpectra:
    shares = np.square(inertial.share)
    acceleration = shares @ np.square(noise.accelerometer)
    walk = shares.sum(axis=1) * 2 * parts.settings.bias_walk**2
    if not inertial.turns:
        acceleration[1:], walk[1:] = 1e3, 0.0  # nothing is known of roll and pitch
    return ErrorSpectra(
        white=2 * np.square(noise.white) * parts.navigation.step,
        wander=2 * wander,
        acceleration=acceleration,
        walk=walk,
    )


def _assemble_motion(
    parts: _FusionParts,
    time: Float,
    found: BodyCoordinates,
    middle: Float,
    gaps: tuple[tuple[str, float, float], ...],
    edge: tuple[float, float],
    problems: list[str],
) -> FusedMotion:
    variance = _interpolate_columns(time, parts.navigation.time, parts.sd[:, _WAY] ** 2)
    variance += _gap_variance(parts, time, _WAY)
    every = (*(("navigation", *gap) for gap in parts.navigation.gaps), *gaps)
    spans = tuple((begin, end) for _, begin, end in every)
    trajectory = trajectory_of(time, found, middle, parts.way, variance, spans, edge)
    return FusedMotion(
        trajectory=trajectory,
        method="navigation",
        noise=None,
        crossover=None,
        drift=None,
        bias=None,
        delay=None,
        normalised_innovation_squared=None,
        gaps=every,
        problems=tuple(problems),
    )


def _gap_variance(parts: _FusionParts, time: Float, columns: list[int]) -> Float:
    """Variance over the gaps of navigation, shape (n, columns)."""
    s = parts.settings
    one = bridge_variance(time, parts.navigation.gaps, 1.0)[:, None]
    return one * [s.bridge_density if c < 3 else s.bridge_turn_density for c in columns]


def _lost_spans(inertial: InertialAccelerations) -> tuple[Span, ...]:
    """Stretches without accelerometers."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inertial.bridged.astype(int), [0]])))
    fine = inertial.fine
    spans = edges.reshape(-1, 2)
    tick = 1e-9  # [s] so that a knot at the end counts
    return tuple(
        (
            float(fine[max(a - 1, 0)]) - (tick if a == 0 else 0.0),
            float(fine[min(b, fine.size - 1)]) + (tick if b == fine.size else 0.0),
        )
        for a, b in spans
    )


def _interpolate_columns(time: Float, known: Float, values: Float) -> Float:
    return np.stack([np.interp(time, known, column) for column in values.T], axis=1)


def _diagonal_matrices(variance: Float) -> Float:
    return np.asarray(variance[:, :, None] * np.eye(3))


def _three_floats(values: Float) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
