"""Excitation event: lumber cleats that excite the body modes and wheel hop of a vehicle."""

from dataclasses import dataclass

import numpy as np

from trueterrain.simulate.ground._ground import (
    Floats,
    Ground,
    check_finite,
    check_not_negative,
    check_positive,
    rotate_axes,
)


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
