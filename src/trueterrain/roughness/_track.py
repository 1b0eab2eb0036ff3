"""One track under a quarter car: conventions turned into slopes, start and means."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.roughness.quarter_car import IRI_SPEED, QuarterCar

Array = npt.NDArray[np.float64]

_START_LENGTH = 11.0  # [m] Sayers's program; the texts say 0.5 s, which is 11.1 m at 80 km/h
_START_TIME = 0.5  # [s]

# Share of a step that station and dx may be off by rounding [1]: 0.25/0.1 must round up whether dx
# is 0.1 or 0.09999999999, and a segment that ends at a sample must not divide the step before it
_ROUNDING = 1e-6

_LONGEST_WINDOW = 1.0  # [m] of the moving average; a longer one takes out what the cars feel

Window = Literal["sayers", "centred", "exact", "none"]
Start = Literal["11m", "0.5s", "level"]


@dataclass(frozen=True, kw_only=True)
class QuarterCarSettings(ABC):
    """What every index has to settle whose car drives over a profile."""

    window: Window = "sayers"
    """Moving average before the car: "sayers" (slope over nint(length / spacing) samples, equal
    spacing only; at spacings from 2/3 of the length on that is one step, and nothing is averaged),
    "centred" (mean of the samples within half a length, both ends included; left out if no spacing
    is at most half a length; at the ends of the profile it has samples on one side only, which
    bends a grade there), "exact" (mean of the straight lines between the samples, where the whole
    window is on the profile), or "none" (for smoothed profiles)."""

    window_length: float = 0.25
    "Length of the moving average [m]."

    restart: bool = False
    "Start the car again in every segment, instead of one run over the whole profile."

    speed: float = IRI_SPEED
    "Speed of the car [m/s]; the indices are defined at 80 km/h."

    spacing_tolerance: float = 1e-3
    "Largest distance of a station from equal spacing that still counts as equal [steps]."

    max_spacing: float
    """Largest distance between samples that is rated [m]: half the shortest wave to which the car
    responds with half of its largest gain. Shorter waves are lost, or pass for longer ones."""

    accurate_spacing: ClassVar[float]
    "Largest distance between samples that leaves the index accurate [m]."

    car: QuarterCar
    "Parameters of the car."

    def __post_init__(self) -> None:
        _require_known("window", self.window, Window)
        for name, unit in (("window_length", " m"), ("max_spacing", " m"), ("speed", " m/s")):
            require_positive(name, getattr(self, name), unit)
        if self.window_length > _LONGEST_WINDOW:
            message = (
                f"window_length must be at most {_LONGEST_WINDOW:g} m, got {self.window_length:g}; "
                "is it in metres?"
            )
            raise ValueError(message)
        if not 0 <= self.spacing_tolerance < 0.5:
            message = f"spacing_tolerance must be within 0 and 0.5, got {self.spacing_tolerance}"
            raise ValueError(message)

    @property
    @abstractmethod
    def lead(self) -> "LeadIn | None":
        """Chord with whose slope the car starts, None for a level start."""


class LeadIn(NamedTuple):
    """First part of the profile, with whose slope the car starts."""

    length: float
    "How long it is [m]."

    as_program: bool
    "Whether its height is divided by one sample more than it spans, as Sayers's program does."


@dataclass(frozen=True, kw_only=True)
class IriSettings(QuarterCarSettings):
    """Conventions of the International Roughness Index; the defaults are those of Sayers's program.

    Conventions matter: on measured roads the kind of window changes the index by about 0.5 %, the
    window itself by about 2 %, and the start by more than 10 % on profiles shorter than 100 m.

    Examples
    --------
    >>> IriOptions(window="none").start
    '11m'
    >>> IriOptions(window="box")
    Traceback (most recent call last):
    ValueError: window must be one of sayers, centred, exact, none, got 'box'
    """

    start: Start = "11m"
    """Slope with which the car starts: "11m" (chord of the first 11 m, divided by one sample more
    than it spans, as in the program; on unequal spacing by its own length), "0.5s" (chord of the
    first 0.5 s, which are 11.11 m at 80 km/h), or "level" (0)."""

    max_spacing: float = 0.61
    """Largest distance between samples that is rated [m]: half of 1.2 m, the shortest wave to which
    the golden car responds with half of its largest gain; 2 ft, Class 2 of ASTM E1364."""

    accurate_spacing: ClassVar[float] = 0.305
    """Largest distance between samples that leaves the index accurate [m]: 1 ft, Class 1 of ASTM
    E1364, which stands for 2 % (on roads of waviness 2, up to 3 % were found)."""

    car: QuarterCar = field(default_factory=QuarterCar)
    "Parameters of the car."

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_known("start", self.start, Start)

    @property
    def lead(self) -> LeadIn | None:
        """Chord with whose slope the car starts, None for a level start."""
        if self.start == "level":
            return None
        program = self.start == "11m"
        return LeadIn(_START_LENGTH if program else _START_TIME * self.speed, program)


def require_positive(name: str, value: float, unit: str) -> None:
    """Refuse a value that is not finite and greater than 0."""
    if not (np.isfinite(value) and value > 0):
        message = f"{name} must be finite and greater than 0{unit}, got {value}"
        raise ValueError(message)


def _require_known(name: str, value: str, known: Any) -> None:
    if value not in get_args(known):
        message = f"{name} must be one of {', '.join(get_args(known))}, got {value!r}"
        raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class ProfileDrive:
    """What the car drives over: a profile after its window, from station to station."""

    station: Array
    "Where the steps begin and end [m]; of a Sayers window, where its first sample is."

    height: Array
    "Heights from which slopes are taken [m]; `base` - 1 more than stations."

    step: float | None
    "Spacing [m], or None if it is not equal."

    base: int
    "Samples that a slope spans."

    slope: float
    "Slope with which the car starts [m/m]."

    options: QuarterCarSettings
    "Conventions."

    @property
    def state(self) -> Array:
        """State with which the car starts: both masses climb the slope."""
        return np.array([self.slope, 0.0, self.slope, 0.0])

    @property
    def constants(self) -> tuple[float, float, float, float, float, float]:
        """Elements of A and a bound of its norm, velocities being scaled by a frequency [1/s]."""
        car = self.options.car
        k1, k2, c, mu = car.tyre_stiffness, car.spring_stiffness, car.damping, car.mass_ratio
        wheel = math.sqrt((k1 + 2 * k2) / mu)
        bound = max(wheel + 2 * c / mu, 2 * k2 / wheel + 2 * c)
        return k1 / mu, k2 / mu, c / mu, k2, c, bound


def drive_profile(station: Array, height: Array, options: QuarterCarSettings) -> ProfileDrive:
    """Apply window and start to the heights of one track."""
    if station.size < 2:
        raise _too_short(station)
    _refuse_coarse(station, options.max_spacing)
    step = equal_step(station, options.spacing_tolerance)
    slope = _start_slope(station, height, step, options.lead)
    base = 1
    if options.window == "sayers":
        base = _sayers_base(station, step, options.window_length)
    elif options.window == "centred":
        height = _centred_mean(station, height, options.window_length)
    elif options.window == "exact":
        station, height = _exact_mean(station, height, options.window_length)
    steps = station.size - base
    if steps < 1:
        raise _too_short(station)
    return ProfileDrive(
        station=station[: steps + 1],
        height=height,
        step=step,
        base=base,
        slope=slope,
        options=options,
    )


def mean_outputs(way: ProfileDrive, edges: Array, *, squared: bool = False) -> tuple[float, Array]:
    """Mean of abs(output), or of its square, over the whole way, and between edges [m] within it.

    It is in m/m, or its square.
    """
    inner = np.clip(edges, way.station[0], way.station[-1])
    widths = np.diff(inner)
    if way.step is None:
        total, parts = _unequal_sums(way, inner, squared)
    else:
        total, parts = _equal_sums(way, inner, squared)
    with np.errstate(invalid="ignore"):
        return total, parts / widths


def step_response(way: ProfileDrive) -> Array:
    """Output at the end of each step [m/m]."""
    from trueterrain.roughness import _kernels

    out = np.empty(way.station.size - 1)
    if way.step is None:
        _kernels.unequal_response(
            way.station, way.height, way.options.speed, way.constants, way.state, out
        )
    else:
        S, p = way.options.car.transition(way.step, speed=way.options.speed)
        scale = 1 / (way.base * way.step)
        _kernels.equal_response(way.height, way.base, scale, S, p, way.state, out)
    return out


def equal_step(station: Array, tolerance: float) -> float | None:
    """Spacing [m] if the stations are equally spaced within a share of it, else None."""
    from trueterrain.roughness import _kernels

    step = float(station[-1] - station[0]) / (station.size - 1)
    rounding = 4 * np.finfo(float).eps * max(abs(station[0]), abs(station[-1]))
    largest: float = _kernels.largest_deviation(station, step)
    return step if largest <= tolerance * step + rounding else None


def nearest_integer(value: float) -> int:
    """Round as Fortran's NINT does, halves up, also if they carry rounding."""
    return math.floor(value + 0.5 + _ROUNDING)


def _refuse_coarse(station: Array, largest: float) -> None:
    gaps = np.diff(station)
    coarse = np.flatnonzero(gaps > largest * (1 + _ROUNDING))
    if coarse.size:
        at = int(coarse[0])
        raise CoverageError(
            f"has samples {gaps[at]:.4g} m apart, which must be at most {largest:g} m: half the "
            "shortest wave that the car feels",
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


def _equal_sums(way: ProfileDrive, edges: Array, squared: bool) -> tuple[float, Array]:
    from trueterrain.roughness import _kernels

    assert way.step is not None
    steps = way.station.size - 1
    S, p = way.options.car.transition(way.step, speed=way.options.speed)
    at = (edges - way.station[0]) / way.step
    at = np.where(abs(at - np.rint(at)) < _ROUNDING, np.rint(at), at)
    at = np.concatenate([[0.0], np.clip(at, 0, steps), [float(steps)]])
    parts = np.empty(at.size - 1)
    total = _kernels.equal_sums(
        way.height,
        way.base,
        1 / (way.base * way.step),
        S,
        p,
        way.step / way.options.speed,
        way.constants,
        way.state,
        squared,
        at,
        parts,
    )
    return total / steps, parts[1:-1] * way.step


def _unequal_sums(way: ProfileDrive, edges: Array, squared: bool) -> tuple[float, Array]:
    from trueterrain.roughness import _kernels

    after = np.searchsorted(way.station, edges)
    before = np.maximum(after - 1, 0)
    gap = np.minimum(abs(way.station[after] - edges), abs(way.station[before] - edges))
    new = edges[gap > _ROUNDING * (way.station[after] - way.station[before])]
    at = np.searchsorted(way.station, new)
    station = np.insert(way.station, at, new)
    height = np.insert(way.height, at, np.interp(new, way.station, way.height))
    own = np.insert(np.ones(way.station.size, dtype=bool), at, values=False)
    out = np.empty(station.size - 1)
    _kernels.unequal_response(station, height, way.options.speed, way.constants, way.state, out)
    travel = out**2 if squared else abs(out)
    total = float(np.sum(travel[own[1:]] * np.diff(way.station)))
    behind = np.concatenate([[0.0], np.cumsum(travel * np.diff(station))])
    reached = np.interp(edges, station, behind)
    return total / float(way.station[-1] - way.station[0]), np.diff(reached)


def _start_slope(station: Array, height: Array, step: float | None, lead: LeadIn | None) -> float:
    if lead is None:
        return 0.0
    if lead.as_program and step is not None:
        last = min(nearest_integer(lead.length / step) + 1, station.size)
        return float(height[last - 1] - height[0]) / (step * last)
    end = min(station[0] + lead.length, station[-1])
    at = int(np.clip(np.searchsorted(station, end), 1, station.size - 1))
    share = (end - station[at - 1]) / (station[at] - station[at - 1])
    reached = height[at - 1] + share * (height[at] - height[at - 1])
    return float((reached - height[0]) / (end - station[0]))


def _sayers_base(station: Array, step: float | None, length: float) -> int:
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
    from trueterrain.roughness import _kernels

    half = 0.5 * length * (1 + _ROUNDING)
    if np.diff(station).min() > half:
        return height
    out = np.empty_like(height)
    _kernels.mean_of_samples(station, height, half, out)
    return out


def _exact_mean(station: Array, height: Array, length: float) -> tuple[Array, Array]:
    from trueterrain.roughness import _kernels

    room = 0.5 * length * (1 - _ROUNDING)
    first = int(np.searchsorted(station, station[0] + room))
    behind = int(np.searchsorted(station, station[-1] - room, side="right"))
    if behind - first < 2:
        raise _too_short(station)
    out = np.empty(behind - first)
    _kernels.mean_of_lines(station, height, length, first, out)
    return station[first:behind], out
