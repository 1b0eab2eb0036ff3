"""Conventions of the indices that drive a quarter car over a profile.

`QuarterCarSettings` holds those that all such indices have in common, `IriSettings` those of the
International Roughness Index; those of the Ride Number are in `trueterrain.roughness.ride_number`.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np

from trueterrain.roughness.quarter_car import IRI_SPEED, QuarterCar

__all__ = ["IriSettings", "LeadIn", "QuarterCarSettings", "Start", "Window", "require_positive"]

_START_LENGTH = 11.0  # [m] of Sayers's program; the texts say 0.5 s, which is 11.1 m at 80 km/h
_START_TIME = 0.5  # [s]

_MAX_WINDOW = 1.0  # [m] of the moving average; a longer one removes waves to which the cars respond

Window = Literal["sayers", "centred", "exact", "none"]
Start = Literal["11m", "0.5s", "level"]


class LeadIn(NamedTuple):
    """First part of the profile; the slope of its chord is the initial slope of the car."""

    length: float
    "Length of the chord [m]."

    as_program: bool
    "Whether its height is divided by one sample more than it spans, as Sayers's program does."


@dataclass(frozen=True, kw_only=True)
class QuarterCarSettings(ABC):
    """Conventions of an index that drives a quarter car over a profile."""

    window: Window = "sayers"
    """Moving average before the car. "sayers": slope over the whole number of samples nearest to
    the length, equal spacing only; from a spacing of 2/3 of the length on, nothing is averaged.
    "centred": mean of the samples within half a length, both ends included; at the ends of the
    profile it has samples on one side only, which bends a grade there; left out if no spacing is at
    most half a length. "exact": mean of the linearly interpolated profile, where the whole window
    is on it. "none": for profiles that are smoothed already."""

    window_length: float = 0.25
    "Length of the moving average [m]."

    restart: bool = False
    "Start a new car in each segment, instead of one run over the whole profile."

    speed: float = IRI_SPEED
    "Speed of the car [m/s]; the indices are defined at 80 km/h."

    spacing_tolerance: float = 1e-3
    "Largest distance of a station from equal spacing that still counts as equal [steps]."

    max_spacing: float
    """Largest distance between samples that is rated [m]: half the shortest wave to which the car
    responds with half of its largest gain. Shorter waves are lost or aliased to longer ones."""

    accurate_spacing: ClassVar[float]
    "Largest distance between samples that leaves the index accurate [m]."

    car: QuarterCar
    "Parameters of the car."

    def __post_init__(self) -> None:
        _require_known("window", self.window, Window)
        for name, unit in (("window_length", " m"), ("max_spacing", " m"), ("speed", " m/s")):
            require_positive(name, getattr(self, name), unit)
        if self.window_length > _MAX_WINDOW:
            message = (
                f"window_length must be at most {_MAX_WINDOW:g} m, got {self.window_length:g}; "
                "is it in metres?"
            )
            raise ValueError(message)
        if not 0 <= self.spacing_tolerance < 0.5:
            message = f"spacing_tolerance must be within 0 and 0.5, got {self.spacing_tolerance}"
            raise ValueError(message)

    @property
    @abstractmethod
    def lead(self) -> LeadIn | None:
        """Chord whose slope is the initial slope of the car, None for a level start."""


@dataclass(frozen=True, kw_only=True)
class IriSettings(QuarterCarSettings):
    """Conventions of the International Roughness Index; the defaults are those of Sayers's program.

    Conventions matter: on measured roads the kind of window changes the index by about 0.5 %, the
    window itself by about 2 %, and the start by more than 10 % on profiles shorter than 100 m.

    Examples
    --------
    >>> IriSettings(window="none").start
    '11m'
    >>> IriSettings(window="box")
    Traceback (most recent call last):
    ValueError: window must be one of sayers, centred, exact, none, got 'box'
    """

    start: Start = "11m"
    """Initial slope of the car. "11m": chord of the first 11 m, divided by one sample more than it
    spans, as in the program (on unequal spacing by its own length); "0.5s": chord of the first half
    second (11.11 m at 80 km/h); "level": 0."""

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
        """Chord whose slope is the initial slope of the car, None for a level start."""
        if self.start == "level":
            return None
        as_program = self.start == "11m"
        return LeadIn(_START_LENGTH if as_program else _START_TIME * self.speed, as_program)


def require_positive(name: str, value: float, unit: str) -> None:
    """Raise ValueError if a value is not finite and greater than 0; `unit` begins with a space."""
    if not (np.isfinite(value) and value > 0):
        message = f"{name} must be finite and greater than 0{unit}, got {value}"
        raise ValueError(message)


def _require_known(name: str, value: str, known: Any) -> None:
    if value not in get_args(known):
        message = f"{name} must be one of {', '.join(get_args(known))}, got {value!r}"
        raise ValueError(message)
