"""Grounds in closed form: plane, sine, step, cleats, excitation event."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from trueterrain.simulate.ground._ground import (
    Floats,
    Ground,
    check_finite,
    check_not_negative,
    check_positive,
    rotate_axes,
)

CleatShape = Literal["rectangle", "triangle", "semicircle"]


@dataclass(frozen=True, kw_only=True)
class Plane(Ground):
    """Inclined plane: ``elevation + slope * x + camber * y``.

    Examples
    --------
    >>> Plane(elevation=1.0, slope=0.02, camber=-0.01).height(10.0, 5.0)
    array(1.15)
    """

    elevation: float = 0.0
    "Height at x = y = 0 [m]."
    slope: float = 0.0
    "Rise per metre of x [m/m]."
    camber: float = 0.0
    "Rise per metre of y [m/m]."

    def __post_init__(self) -> None:
        check_finite(self, "elevation", "slope", "camber")

    def _height(self, x: Floats, y: Floats) -> Floats:
        return self.elevation + self.slope * x + self.camber * y


@dataclass(frozen=True, kw_only=True)
class Sine(Ground):
    """Sine wave: ``amplitude * sin(2 pi d / wavelength + phase)``, d the distance along.

    Examples
    --------
    >>> Sine(amplitude=0.02, wavelength=4.0).height([0.0, 1.0, 3.0], 0.0)
    array([ 0.  ,  0.02, -0.02])
    """

    amplitude: float
    "Half the height from trough to crest [m]."
    wavelength: float
    "Distance from crest to crest [m]."
    phase: float = 0.0
    "Phase at x = y = 0 [rad]."
    direction: float = 0.0
    "Direction of the wave vector, counter-clockwise from east [rad]."

    def __post_init__(self) -> None:
        check_finite(self, "amplitude", "phase", "direction")
        check_positive(self, "wavelength")

    def _height(self, x: Floats, y: Floats) -> Floats:
        along, _ = rotate_axes(x, y, self.direction)
        argument: Floats = 2.0 * np.pi * np.remainder(along / self.wavelength, 1.0)
        return np.asarray(self.amplitude * np.sin(argument + self.phase))


@dataclass(frozen=True, kw_only=True)
class Step(Ground):
    """Kerb: level before `position`, `rise` higher after it, with a ramp of `width` between.

    Examples
    --------
    >>> Step(position=2.0, rise=0.12, width=0.04).height([1.9, 2.01, 2.04], 0.0)
    array([0.  , 0.03, 0.12])
    """

    position: float = 0.0
    "Start of the rise along `direction` [m]."
    rise: float = 0.1
    "Rise [m]; negative is a step down."
    width: float = 0.0
    "Length of the ramp [m]; 0 for a vertical face, with the upper height at `position`."
    direction: float = 0.0
    "Direction of the rise, counter-clockwise from east [rad]."

    def __post_init__(self) -> None:
        check_finite(self, "position", "rise", "direction")
        check_not_negative(self, "width")

    def _height(self, x: Floats, y: Floats) -> Floats:
        along, _ = rotate_axes(x, y, self.direction)
        beyond = along - self.position
        if self.width == 0.0:
            return np.where(beyond >= 0.0, self.rise, 0.0)
        return self.rise * np.clip(beyond / self.width, 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Cleats(Ground):
    """Row of equal cleats across the road on level ground.

    Examples
    --------
    >>> bar = Cleats(first=1.0, width=0.05, rise=0.025, shape="semicircle")
    >>> bar.height([0.9, 1.0, 1.02, 1.03], 0.0)
    array([0.   , 0.025, 0.015, 0.   ])
    """

    first: float = 0.0
    "Centre of the first cleat along `direction` [m]."
    spacing: float = 1.0
    "Distance between the centres of cleats [m]."
    number: int = 1
    "Number of cleats."
    width: float = 0.05
    "Length of a cleat along `direction` [m]."
    rise: float = 0.025
    "Height of the top of a cleat [m]; negative is a groove."
    direction: float = 0.0
    "Direction across the cleats, counter-clockwise from east [rad]."
    shape: CleatShape = "rectangle"
    """Cross-section: ``"rectangle"``, ``"triangle"`` or ``"semicircle"`` (half an ellipse where
    `rise` is not half of `width`)."""

    def __post_init__(self) -> None:
        check_finite(self, "first", "rise", "direction")
        check_positive(self, "spacing", "width")
        if isinstance(self.number, bool) or self.number != int(self.number) or self.number < 1:
            raise ValueError(f"number must be a whole number of at least 1, got {self.number}.")
        if self.number > 1 and self.spacing < self.width:
            raise ValueError(
                f"spacing must be at least the width {self.width} m, got {self.spacing} m."
            )
        if self.shape not in get_args(CleatShape):
            raise ValueError(
                f"shape must be one of {', '.join(get_args(CleatShape))}, got {self.shape!r}."
            )

    def _height(self, x: Floats, y: Floats) -> Floats:
        along, _ = rotate_axes(x, y, self.direction)
        cleat = np.clip(np.rint((along - self.first) / self.spacing), 0, self.number - 1)
        t = np.abs(2.0 * (along - (self.first + self.spacing * cleat)) / self.width)
        if self.shape == "rectangle":
            return np.where(t <= 1.0, self.rise, 0.0)
        if self.shape == "triangle":
            return self.rise * np.maximum(1.0 - t, 0.0)
        return self.rise * np.sqrt(np.maximum(1.0 - t * t, 0.0))


@dataclass(frozen=True, kw_only=True)
class ExcitationEvent(Ground):
    """Cleats across a level road, in one or several groups.

    The defaults are the event of Smith, "Improving the Quality of Terrain Measurement" (Virginia
    Tech, 2009), section 3.5.2: five cleats 38 mm high and 0.17 m wide, one every 0.488 m, so that
    the event is 2.44 m long. At 5.4 m/s wheels meet the cleats at 11 Hz, and the event as a whole
    is half a period of 1.1 Hz. Each cleat is at the centre of its 0.488 m.

    Examples
    --------
    >>> event = ExcitationEvent(begin=10.0)
    >>> event.length
    2.44
    >>> event.height([9.9, 10.244, 10.488, 10.732], 0.0)
    array([0.   , 0.038, 0.   , 0.038])
    """

    begin: float = 0.0
    "Start of the first event along `direction` [m]."
    number: int = 5
    "Number of cleats of an event."
    spacing: float = 0.488
    "Distance between the centres of cleats: a of the thesis [m]."
    width: float = 0.17
    "Length of a cleat along `direction`: w of the thesis [m]."
    rise: float = 0.038
    "Height of the top of a cleat [m]."
    base: float = 0.0
    "Thickness of a board under each event [m]; 0.019 for plywood of 3/4 inch."
    events: int = 1
    "Number of events."
    pitch: float = 4.88
    "Distance between the starts of events [m]."
    stagger: float = 0.0
    "Distance by which cleats are further along to the right of the line through 0, 0 [m]."
    direction: float = 0.0
    "Direction across the cleats, counter-clockwise from east [rad]."

    def __post_init__(self) -> None:
        check_finite(self, "begin", "rise", "stagger", "direction")
        check_positive(self, "spacing", "width", "pitch")
        check_not_negative(self, "base")
        for name in ("number", "events"):
            value = getattr(self, name)
            if isinstance(value, bool) or value != int(value) or value < 1:
                raise ValueError(f"{name} must be a whole number of at least 1, got {value}.")
        if self.spacing < self.width:
            raise ValueError(
                f"spacing must be at least the width {self.width} m, got {self.spacing} m."
            )
        if self.events > 1 and self.pitch < self.length:
            raise ValueError(
                f"pitch must be at least the length of an event {self.length:.6g} m, "
                f"got {self.pitch} m."
            )

    @property
    def length(self) -> float:
        """Length of one event: L of the thesis [m]."""
        return self.number * self.spacing

    def _height(self, x: Floats, y: Floats) -> Floats:
        along, across = rotate_axes(x, y, self.direction)
        if self.stagger:
            along = along - np.where(across < 0.0, self.stagger, 0.0)
        since = along - self.begin
        since = since - self.pitch * np.clip(np.floor(since / self.pitch), 0, self.events - 1)
        on_board = (since >= 0.0) & (since <= self.length)
        cleat = np.clip(np.floor(since / self.spacing), 0, self.number - 1)
        on_cleat = np.abs(since - (cleat + 0.5) * self.spacing) <= 0.5 * self.width
        return np.where(on_board, self.base, 0.0) + np.where(on_cleat, self.rise, 0.0)
