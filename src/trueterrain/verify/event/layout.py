"""Layout of an excitation event: sizes and places of its cleats, and the speed of the crossing."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from trueterrain.verify.event.hop import HopModel
from trueterrain.verify.event.inputs import EventInputs, Target
from trueterrain.verify.event.waves import half_power

#: Rule for the width of the cleats: a wheel in hop touches both edges; the width that excites most
#: hop, if a strongly damped wheel never does; or a given width.
WidthRule = Literal["both edges", "most hop", "given"]

#: Placement of the cleats: across the traffic lane; right side half a wavelength behind the left
#: one; under the left wheels only.
CleatPlacement = Literal["across", "staggered", "one side"]


@dataclass(frozen=True, kw_only=True)
class EventDesign:
    """An excitation event and the speed of its crossing; made by `design_event`."""

    model: HopModel
    "Oscillator that determines the width of the cleats."

    target: Target
    "Mode of the body that the event as a whole is to excite."

    placement: CleatPlacement
    "Placement of the cleats."

    inputs: EventInputs
    "Inputs of the design."

    length: float
    "Required length of the event, half a wavelength of the body's mode: L [m]."

    speed: float
    "Speed of the crossing: V [m/s]."

    spacing: float
    "Distance between the centres of neighbouring cleats: a [m]."

    number: int
    "Number of cleats."

    width: float
    "Width of a cleat in the direction of travel: w [m]."

    rise: float
    "Height of a cleat [m]."

    base: float
    "Thickness of a board under the whole event [m]."

    events: int
    "Number of repeats of the event, a wavelength of the body's mode apart."

    width_rule: WidthRule
    "Rule that gave the width."

    tolerances: Mapping[str, float]
    """Tolerances of speed [m/s], spacing [m], width [m] and cleat_ratio [1], propagated from those
    of the inputs."""

    @property
    def cleat_ratio(self) -> float:
        """Width of a cleat over the spacing: w / a [1]."""
        return self.width / self.spacing

    @property
    def built_length(self) -> float:
        """Length as built: of a whole number of cleats, with half a spacing at both ends [m]."""
        return self.number * self.spacing

    @property
    def stagger(self) -> float:
        """Longitudinal distance of the right side behind the left side [m]."""
        return self.length if self.placement == "staggered" else 0.0

    @property
    def pitch(self) -> float:
        """Distance between the starts of repeated events, a wavelength of the body's mode [m]."""
        return max(2 * self.length, self.built_length)

    @property
    def extent(self) -> float:
        """Distance from the start of the first event to the end of the last one, both sides [m]."""
        return (self.events - 1) * self.pitch + self.built_length + self.stagger

    @property
    def ride_met(self) -> float:
        """Frequency of the body's mode whose half wavelength is the event as built [Hz]."""
        return self.speed / (2 * self.built_length)

    @property
    def hop_met(self) -> float:
        """Frequency at which a wheel meets cleats [Hz]."""
        return self.speed / self.spacing

    @property
    def speed_band(self) -> tuple[float, float]:
        """Range of speeds in which wheel hop receives at least half of the power [m/s]."""
        half = half_power(self.number)
        centre = self.inputs.hop * self.spacing
        return centre / (1 + half), centre / (1 - half)

    @property
    def ground(self) -> dict[str, Any]:
        """Parameters of `trueterrain.simulate.ground.ExcitationEvent`, with cleats on both sides.

        Examples
        --------
        >>> from trueterrain.simulate.ground import ExcitationEvent
        >>> from trueterrain.verify.event.design import design_event
        >>> ExcitationEvent(**design_event(EventInputs(), length=2.44).ground).number
        5
        """
        return {
            "number": self.number,
            "spacing": self.spacing,
            "width": self.width,
            "rise": self.rise,
            "base": self.base,
            "stagger": self.stagger,
            "events": self.events,
            "pitch": self.pitch,
        }

    def to_dict(self) -> dict[str, Any]:
        """Numbers and strings, ready for JSON; lengths in m."""
        low, high = self.speed_band
        return {
            **asdict(self),
            "cleat_ratio": self.cleat_ratio,
            "built_length": self.built_length,
            "stagger": self.stagger,
            "pitch": self.pitch,
            "extent": self.extent,
            "ride_met": self.ride_met,
            "hop_met": self.hop_met,
            "speed_band": [low, high],
        }
