"""Parts of a scene: shape of the road, passes, vehicle and settings of the truth."""

import dataclasses
import difflib
import math
from dataclasses import dataclass, field
from typing import Any

from trueterrain.formats.settings import check_name
from trueterrain.simulate.body import Wave
from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    FullCarParameters,
    QuarterCarParameters,
    Tyre,
    named_vehicle,
    vehicle_names,
)

_QUARTER, _RIGID = "quarter car", "rigid"


@dataclass(frozen=True, kw_only=True)
class RoadShape:
    """Shape of the road: whether the ground follows the course, slope and banking."""

    along_course: bool = False
    """Whether the ground follows the course, with x the station and y the offset; always with a
    slope, banking or superelevation."""

    slope: float = 0.0
    "Slope of the course [m/m]."

    banking: float = 0.0
    "Cross slope of the whole course, left side up [m/m]."

    superelevation: float = 0.0
    """Maximum inward banking, at the maximum curvature; proportional to the curvature elsewhere.
    Curvature must be continuous: courses need transitions [m/m]."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_finite(self, "slope", "banking", "superelevation")
        if not self.superelevation >= 0:
            message = f"superelevation must be at least 0 m/m, got {self.superelevation}."
            raise ValueError(message)
        if self.superelevation and self.banking:
            message = (
                "banking and superelevation exclude each other, "
                f"got {self.banking} and {self.superelevation} m/m."
            )
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class Standing:
    """Position and duration of a vehicle that stands instead of driving."""

    duration: float = 4.0
    "Duration [s]."

    east: float = 0.0
    "Easting of the body [m]."

    north: float = 0.0
    "Northing of the body [m]."

    yaw: float = 0.0
    "Heading, counter-clockwise from east [rad]."

    waves: tuple[Wave, ...] = ()
    "Sines added to its pose, in east, north, up, roll, pitch or yaw."

    def __post_init__(self) -> None:
        """Check the values."""
        if not 0 < self.duration < math.inf:
            message = f"duration must be greater than 0 s, got {self.duration}."
            raise ValueError(message)
        check_finite(self, "east", "north", "yaw")


@dataclass(frozen=True, kw_only=True)
class ScenePass:
    """One pass over the ground, recorded as one run."""

    name: str
    "Name of the pass; the run is called SCENE-PASS."

    lane: float = 0.0
    "Lateral offset of the pass to the left of the course [m]."

    reverse: bool = False
    "Whether the direction of travel is against that of the course."

    start: float | None = None
    "Station of the start [m]; by default the start of the course."

    length: float | None = None
    "Length driven [m]; by default to the end of the course, or once around."

    speed: dict[str, Any] = field(default_factory=lambda: {"kind": "constant", "speed": 5.0})
    "Speed: its kind and parameters."

    standing: Standing | None = None
    "Stand instead of driving."

    def __post_init__(self) -> None:
        """Check the name, and that `standing` excludes the settings of a drive."""
        check_name(self.name)
        check_finite(self, "lane", "start", "length")
        driven = self.lane or self.reverse or self.start is not None or self.length is not None
        if self.standing is not None and driven:
            message = "standing excludes lane, reverse, start and length; it has its own position."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """The vehicle that carries the instruments."""

    model: str = "van"
    """Full car "compact", "golden car", "sedan" or "van"; "quarter car", the golden one; or
    "rigid", without suspension."""

    parameters: dict[str, float] = field(default_factory=dict)
    "Parameters of the car that differ from those of the model; all are listed at the end."

    height: float = 0.8
    """Height of the origin of a rigid body or a quarter car above level ground [m]; for a full car
    its parameter cg_height."""

    roll: float = 0.0
    "Roll of a rigid body [rad]."

    pitch: float = 0.0
    "Pitch of a rigid body, nose down positive [rad]."

    waves: tuple[Wave, ...] = ()
    "Sines added to the pose of a rigid body."

    tyre: Tyre = field(default_factory=Tyre)
    "Contact patch of the tyres."

    def __post_init__(self) -> None:
        """Check model and parameters."""
        known = [*vehicle_names(), _QUARTER, _RIGID]
        if self.model not in known:
            message = f"model {self.model!r} is unknown ({suggest_name(self.model, known)})."
            raise ValueError(message)
        check_finite(self, "height", "roll", "pitch")
        if self.model != _RIGID and (self.roll or self.pitch or self.waves):
            message = f"roll, pitch and waves are for a rigid body, got the model {self.model!r}."
            raise ValueError(message)
        _ = self.car  # refuses invalid parameters at once

    @property
    def car(self) -> FullCarParameters | QuarterCarParameters | None:
        """Parameters of the car; None for a rigid body.

        Examples
        --------
        >>> Vehicle(model="van", parameters={"sprung_mass": 1500.0}).car.sprung_mass
        1500.0
        """
        if self.model == _RIGID:
            if self.parameters:
                message = "parameters are for a car with suspension, got the model 'rigid'."
                raise ValueError(message)
            return None
        car = GOLDEN_QUARTER_CAR if self.model == _QUARTER else named_vehicle(self.model)
        known = [entry.name for entry in dataclasses.fields(car)]
        for name in self.parameters:
            if name not in known:
                message = f"parameters.{name} is unknown ({suggest_name(name, known)})."
                raise ValueError(message)
        values: dict[str, float] = dataclasses.asdict(car) | self.parameters
        try:
            return type(car)(**values)
        except ValueError as error:
            message = f"parameters.{error}"
            raise ValueError(message) from None


@dataclass(frozen=True, kw_only=True)
class TruthSettings:
    """Settings of the truth of a run, in addition to the exact motion and the errors."""

    spacing: float = 0.02
    "Spacing of the surface of the true ground, for display [m]."

    returns: bool = True
    "Whether to store the error of every range (2 bytes each)."

    def __post_init__(self) -> None:
        """Check the spacing."""
        if not 0 < self.spacing < math.inf:
            message = f"spacing must be greater than 0 m, got {self.spacing}."
            raise ValueError(message)


def suggest_name(name: str, known: list[str]) -> str:
    """Hint with the most similar known name, or with all of them."""
    near = difflib.get_close_matches(name.lower(), known, n=1)
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"


def check_finite(settings: object, *names: str) -> None:
    """Raise ValueError unless fields are finite or None."""
    for name in names:
        value = getattr(settings, name)
        if value is not None and not math.isfinite(value):
            message = f"{name} must be finite, got {value}."
            raise ValueError(message)
