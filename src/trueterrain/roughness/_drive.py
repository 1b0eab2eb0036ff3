"""Drive of a quarter car over one track: moving average, initial slope, response and means."""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.roughness._segments import ROUNDING, FixedSegments, sample_range
from trueterrain.roughness.settings import LeadIn, QuarterCarSettings

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ProfileDrive:
    """Profile after its moving average, from station to station, as the car drives over it."""

    station: Array
    "Stations at which steps begin and end [m]; of a Sayers window, station of its first sample."

    height: Array
    "Heights from which slopes are taken [m]; `base` - 1 more than stations."

    step: float | None
    "Spacing [m], or None if it is not equal."

    base: int
    "Samples that a slope spans."

    slope: float
    "Initial slope of the car [m/m]."

    settings: QuarterCarSettings
    "Conventions."

    @property
    def state(self) -> Array:
        """Initial state of the car: both masses climb the slope at constant velocity."""
        return np.array([self.slope, 0.0, self.slope, 0.0])

    @property
    def constants(self) -> tuple[float, float, float, float, float, float]:
        """Elements of A, and a bound of its norm after scaling [1/s]."""
        car = self.settings.car
        k1, k2, c, mu = car.tyre_stiffness, car.spring_stiffness, car.damping, car.mass_ratio
        wheel = math.sqrt((k1 + 2 * k2) / mu)  # about the frequency of wheel hop
        # infinity norm of A after the accelerations are divided by `wheel`, which makes the rows of
        # velocities and accelerations comparable
        bound = max(wheel + 2 * c / mu, 2 * k2 / wheel + 2 * c)
        return k1 / mu, k2 / mu, c / mu, k2, c, bound


def drive_profile(station: Array, height: Array, settings: QuarterCarSettings) -> ProfileDrive:
    """Apply moving average and initial slope to the heights of one track."""
    if station.size < 2:
        raise _too_short(station)
    step = equal_step(station, settings.spacing_tolerance)
    gaps = np.diff(station) if step is None else np.array([step])
    _refuse_coarse(station, gaps, settings.max_spacing)
    slope = _start_slope(station, height, step, settings.lead)
    base = 1
    if settings.window == "sayers":
        base = _sayers_base(station, step, settings.window_length)
    elif settings.window == "centred":
        height = _centred_mean(station, height, settings.window_length)
    elif settings.window == "exact":
        station, height = _exact_mean(station, height, settings.window_length)
    steps = station.size - base
    if steps < 1:
        raise _too_short(station)
    return ProfileDrive(
        station=station[: steps + 1],
        height=height,
        step=step,
        base=base,
        slope=slope,
        settings=settings,
    )


def rate_track(
    station: Array,
    height: Array,
    settings: QuarterCarSettings,
    segments: FixedSegments,
    *,
    squared: bool = False,
) -> tuple[float, Array]:
    """Mean of abs(output), or of its square, of a track and of its segments.

    In m/m, or its square; NaN for a segment without a step.
    """
    drive = drive_profile(station, height, settings)
    if not (settings.restart and segments.start.size):
        return mean_outputs(drive, segments.edges, squared=squared)
    whole, _ = mean_outputs(drive, np.empty(0), squared=squared)
    once = replace(settings, restart=False)
    parts = np.full(segments.start.size, np.nan)
    for at, (start, end) in enumerate(zip(segments.start, segments.end, strict=True)):
        inside = sample_range(station, start, end)
        try:
            part = drive_profile(station[inside], height[inside], once)
        except CoverageError:
            if segments.complete[at]:
                raise
            continue
        parts[at], _ = mean_outputs(part, np.empty(0), squared=squared)
    return whole, parts


def mean_outputs(
    drive: ProfileDrive, edges: Array, *, squared: bool = False
) -> tuple[float, Array]:
    """Mean of abs(output), or of its square, over the whole drive, and between edges [m] within it.

    In m/m, or its square.
    """
    inner = np.clip(edges, drive.station[0], drive.station[-1])
    widths = np.diff(inner)
    if drive.step is None:
        total, parts = _unequal_sums(drive, inner, squared)
    else:
        total, parts = _equal_sums(drive, inner, squared)
    with np.errstate(invalid="ignore"):
        return total, parts / widths


def step_response(drive: ProfileDrive) -> Array:
    """Output at the end of each step [m/m]."""
    from trueterrain.roughness import _kernels

    out = np.empty(drive.station.size - 1)
    if drive.step is None:
        _kernels.unequal_response(
            drive.station, drive.height, drive.settings.speed, drive.constants, drive.state, out
        )
    else:
        S, p = drive.settings.car.transition(drive.step, speed=drive.settings.speed)
        scale = 1 / (drive.base * drive.step)
        _kernels.equal_response(drive.height, drive.base, scale, S, p, drive.state, out)
    return out


def equal_step(station: Array, tolerance: float) -> float | None:
    """Spacing [m] if stations are equally spaced within `tolerance` of it, else None."""
    from trueterrain.roughness import _kernels

    step = float(station[-1] - station[0]) / (station.size - 1)
    # stations of thousands of kilometres carry a rounding of their own
    rounding = 4 * np.finfo(float).eps * max(abs(station[0]), abs(station[-1]))
    largest: float = _kernels.max_deviation(station, step)
    return step if largest <= tolerance * step + rounding else None


def nearest_integer(value: float) -> int:
    """Round as Fortran's NINT does, halves up, also if they carry rounding.

    0.25 / 0.1 must round up whether the spacing is 0.1 or 0.09999999999.
    """
    return math.floor(value + 0.5 + ROUNDING)


def _refuse_coarse(station: Array, gaps: Array, max_spacing: float) -> None:
    coarse = np.flatnonzero(gaps > max_spacing * (1 + ROUNDING))
    if coarse.size:
        at = int(coarse[0])
        raise CoverageError(
            f"has samples {gaps[at]:.4g} m apart, which must be at most {max_spacing:g} m: half "
            "the shortest wave to which the car responds",
            place=f"s = {station[at]:.6g} m",
            cure="Sample the ground more finely; if the stations are not in metres, name their "
            "unit.",
        )


def _too_short(station: Array) -> CoverageError:
    return CoverageError(
        "is too short for the window and one step of the car: "
        f"{station.size} samples over {np.ptp(station):g} m",
        place="axis s",
        cure="Give a longer profile.",
    )


def _equal_sums(drive: ProfileDrive, edges: Array, squared: bool) -> tuple[float, Array]:
    """Mean output per metre of the whole, and integrals between edges [m], at equal spacing."""
    from trueterrain.roughness import _kernels

    assert drive.step is not None
    steps = drive.station.size - 1
    S, p = drive.settings.car.transition(drive.step, speed=drive.settings.speed)
    at = (edges - drive.station[0]) / drive.step
    # a segment that ends at a sample must not divide the step before it because of rounding
    at = np.where(abs(at - np.rint(at)) < ROUNDING, np.rint(at), at)
    at = np.concatenate([[0.0], np.clip(at, 0, steps), [float(steps)]])
    parts = np.empty(at.size - 1)
    total = _kernels.equal_sums(
        drive.height,
        drive.base,
        1 / (drive.base * drive.step),
        S,
        p,
        drive.step / drive.settings.speed,
        drive.constants,
        drive.state,
        squared,
        at,
        parts,
    )
    return total / steps, parts[1:-1] * drive.step


def _unequal_sums(drive: ProfileDrive, edges: Array, squared: bool) -> tuple[float, Array]:
    """Mean output per metre of the whole, and integrals between edges [m], at unequal spacing.

    Edges between samples are inserted as stations, where the profile is straight. The total takes
    only the outputs at own samples, so that it does not depend on the segments.
    """
    from trueterrain.roughness import _kernels

    after = np.searchsorted(drive.station, edges)
    before = np.maximum(after - 1, 0)
    gap = np.minimum(abs(drive.station[after] - edges), abs(drive.station[before] - edges))
    new = edges[gap > ROUNDING * (drive.station[after] - drive.station[before])]
    at = np.searchsorted(drive.station, new)
    station = np.insert(drive.station, at, new)
    height = np.insert(drive.height, at, np.interp(new, drive.station, drive.height))
    own = np.insert(np.ones(drive.station.size, dtype=bool), at, values=False)
    out = np.empty(station.size - 1)
    _kernels.unequal_response(
        station, height, drive.settings.speed, drive.constants, drive.state, out
    )
    rectified = out**2 if squared else abs(out)
    total = float(np.sum(rectified[own[1:]] * np.diff(drive.station)))
    integral = np.concatenate([[0.0], np.cumsum(rectified * np.diff(station))])
    at_edges = np.interp(edges, station, integral)
    return total / float(drive.station[-1] - drive.station[0]), np.diff(at_edges)


def _start_slope(station: Array, height: Array, step: float | None, lead: LeadIn | None) -> float:
    """Slope of the chord of the lead-in [m/m], 0 without one."""
    if lead is None:
        return 0.0
    if lead.as_program and step is not None:
        last = min(nearest_integer(lead.length / step) + 1, station.size)
        return float(height[last - 1] - height[0]) / (step * last)
    end = min(station[0] + lead.length, station[-1])
    at = int(np.clip(np.searchsorted(station, end), 1, station.size - 1))
    fraction = (end - station[at - 1]) / (station[at] - station[at - 1])
    end_height = height[at - 1] + fraction * (height[at] - height[at - 1])
    return float((end_height - height[0]) / (end - station[0]))


def _sayers_base(station: Array, step: float | None, length: float) -> int:
    """Steps over which Sayers's program takes a slope."""
    if step is None:
        spacing = np.diff(station)
        message = (
            "must be equally spaced for the window sayers, "
            f"got spacings from {spacing.min():g} to {spacing.max():g} m"
        )
        raise SchemaError(
            message,
            place="axis s",
            cure="Choose the window exact, centred or none, or resample the profile.",
        )
    return max(nearest_integer(length / step), 1)


def _centred_mean(station: Array, height: Array, length: float) -> Array:
    """Mean of the samples within half a length of each."""
    from trueterrain.roughness import _kernels

    half = 0.5 * length * (1 + ROUNDING)
    if np.diff(station).min() > half:
        return height
    out = np.empty_like(height)
    _kernels.mean_of_samples(station, height, half, out)
    return out


def _exact_mean(station: Array, height: Array, length: float) -> tuple[Array, Array]:
    """Stations at which the whole window is on the profile, and the means there."""
    from trueterrain.roughness import _kernels

    half = 0.5 * length * (1 - ROUNDING)
    first = int(np.searchsorted(station, station[0] + half))
    end = int(np.searchsorted(station, station[-1] - half, side="right"))
    if end - first < 2:
        raise _too_short(station)
    out = np.empty(end - first)
    _kernels.mean_of_lines(station, height, length, first, out)
    return station[first:end], out
