"""Design of an excitation event: cleats that shake a vehicle in the modes that one wants to test.

After section 3.3 of Smith, "Improving the Quality of Terrain Measurement" (Virginia Tech, 2009):
the event as a whole is half a wave of a mode of the body, the cleats in it meet the wheels at wheel
hop. What of that comes true for a given vehicle is told by `cross_event`.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from trueterrain.verify.event.crossing import EventResponse, cross_event
from trueterrain.verify.event.hop import (
    Erratum,
    HopModel,
    cleat_ratio,
    event_errata,
    hop_lag,
    hop_transmissibility,
    peak_ratio,
)
from trueterrain.verify.event.inputs import EventInputs, Target, check_choice, event_inputs
from trueterrain.verify.event.lumber import EventPiece, cut_list
from trueterrain.verify.event.waves import (
    covering_speeds,
    event_spectrum,
    half_power,
    passage_gain,
    wheelbase_filter,
)

__all__ = [
    "Erratum",
    "EventDesign",
    "EventInputs",
    "EventPiece",
    "EventResponse",
    "HopModel",
    "Placement",
    "Target",
    "WidthRule",
    "cleat_ratio",
    "covering_speeds",
    "cross_event",
    "cut_list",
    "design_event",
    "event_errata",
    "event_inputs",
    "event_spectrum",
    "hop_lag",
    "hop_transmissibility",
    "passage_gain",
    "peak_ratio",
    "wheelbase_filter",
]

#: Where the width of the cleats comes from: a wheel in hop touches both edges; the most hop, where
#: a wheel that is damped so much never does; or it was given.
WidthRule = Literal["both edges", "most hop", "given"]

#: Where the cleats lie: across the lane; right side half a wave behind; under the left wheels only.
Placement = Literal["across", "staggered", "one side"]

_THESIS_LENGTH = 2.44  # [m] 8 feet, a sheet of plywood
_LONGEST = 1000.0  # [m] of an event, beyond any proving ground's lumber
_MOST_CLEATS = 200
_MOST_HOP = 0.5  # [1] w / a at which the first harmonic of the cleats is greatest


@dataclass(frozen=True, kw_only=True)
class EventDesign:
    """An event, and how it is driven over; made by `design_event`."""

    model: HopModel
    "Oscillator from which the cleats' width comes."

    target: Target
    "Mode of the body that the event as a whole shall excite."

    placement: Placement
    "Where the cleats lie."

    inputs: EventInputs
    "What it was designed from."

    length: float
    "Length of the event as asked for, half a wave of the body: L [m]."

    speed: float
    "Speed at which it is driven over: V [m/s]."

    spacing: float
    "From cleat to cleat: a [m]."

    number: int
    "Cleats."

    width: float
    "Width of a cleat along the lane: w [m]."

    rise: float
    "Height of a cleat [m]."

    base: float
    "Thickness of a board under the whole event [m]."

    events: int
    "How often the event is repeated, a wave of the body apart."

    width_rule: WidthRule
    "Where the width comes from."

    tolerances: Mapping[str, float]
    "By how much speed [m/s], spacing [m], width [m] and cleat_ratio [1] are off with the inputs."

    @property
    def cleat_ratio(self) -> float:
        """Width of a cleat over the spacing: w / a [1]."""
        return self.width / self.spacing

    @property
    def built_length(self) -> float:
        """Length of the whole number of cleats, half a spacing beyond the outer ones [m]."""
        return self.number * self.spacing

    @property
    def stagger(self) -> float:
        """By how much the right side lies further along than the left side [m]."""
        return self.length if self.placement == "staggered" else 0.0

    @property
    def pitch(self) -> float:
        """From the begin of an event to that of the next, a wave of the body [m]."""
        return max(2 * self.length, self.built_length)

    @property
    def extent(self) -> float:
        """From the begin of the first event to the end of the last one on both sides [m]."""
        return (self.events - 1) * self.pitch + self.built_length + self.stagger

    @property
    def ride_met(self) -> float:
        """Frequency of which the event as built is half a wave [Hz]."""
        return self.speed / (2 * self.built_length)

    @property
    def hop_met(self) -> float:
        """Frequency at which wheels meet cleats [Hz]."""
        return self.speed / self.spacing

    @property
    def speed_band(self) -> tuple[float, float]:
        """Speeds between which wheel hop gets at least half of the power [m/s]."""
        half = half_power(self.number)
        centre = self.inputs.hop * self.spacing
        return centre / (1 + half), centre / (1 - half)

    @property
    def ground(self) -> dict[str, Any]:
        """Parameters of `trueterrain.simulate.ground.ExcitationEvent`; both sides have cleats.

        Examples
        --------
        >>> from trueterrain.simulate.ground import ExcitationEvent
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
        """All of it as plain numbers and words, as for JSON; lengths in m."""
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


def design_event(
    inputs: EventInputs = EventInputs(),
    *,
    model: HopModel = "base-excited",
    target: Target = "heave",
    length: float | None = None,
    rise: float = 0.038,
    base: float = 0.0,
    width_ratio: float | None = None,
    placement: Placement | None = None,
    events: int = 1,
) -> EventDesign:
    """Speed, spacing, number and width of the cleats of an event.

    Parameters
    ----------
    inputs : EventInputs
        Frequencies, damping, wheelbase, and how sure they are.
    model : {"base-excited", "thesis"}
        "thesis": as Smith (2009) designs it, Eqs. 3-4 to 3-13 as printed. "base-excited": the right
        oscillator, met at its resonance, and the length from the wheelbase.
    target : {"heave", "pitch", "roll"}
        Mode of the body that the event as a whole shall excite.
    length : float, optional
        Length of the event, half a wave of the body [m]. By default half the wheelbase for heave
        and roll, so that the rear axle follows a whole period after the front axle, and the
        wheelbase for pitch; 2.44 m with model "thesis" or without wheelbase.
    rise : float
        Height of a cleat [m]; 0.038 is lumber of nominally 2 inches.
    base : float
        Thickness of a board under the whole event, which raises the half wave [m].
    width_ratio : float, optional
        Width of a cleat over the spacing; by default as the model says, or 0.5, where hop is
        excited most, if the model has no answer because a wheel is damped too much [1].
    placement : {"across", "staggered", "one side"}, optional
        By default staggered for roll, so that left and right go up in turn, else across.
    events : int
        How often the event is repeated, a wave of the body apart.

    Returns
    -------
    EventDesign
        The event.

    Raises
    ------
    ValueError
        If a value breaks its rule, or the event would have no room for its cleats.

    Notes
    -----
    V = 2 L f1, a = V / f2, n = L / a = f2 / (2 f1), rounded to a whole number, w from
    `cleat_ratio`: of the peak in the thesis's form, of r = V / (a f2) = 1 in the right one. As the
    number is rounded, `built_length` and `ride_met` differ a little from what was asked for.

    Tolerances go through to first order, each input by itself, and add in squares.

    Examples
    --------
    >>> printed = design_event(EventInputs(), model="thesis")
    >>> print(f"{printed.speed:.2f} m/s, {printed.spacing:.3f} m, {printed.number} cleats, "
    ...       f"w/a {printed.cleat_ratio:.3f}")
    5.37 m/s, 0.488 m, 5 cleats, w/a 0.348
    >>> right = design_event(EventInputs(tyre_share=0.912), length=2.44)
    >>> print(f"w/a {right.cleat_ratio:.3f} +- {right.tolerances['cleat_ratio']:.3f}")
    w/a 0.271 +- 0.047
    """
    check_choice("model", model, HopModel)
    check_choice("target", target, Target)
    placement = placement or ("staggered" if target == "roll" else "across")
    check_choice("placement", placement, Placement)
    length = _event_length(inputs, model, target) if length is None else length
    if not 0 < length < math.inf:
        message = f"length must be finite and greater than 0 m, got {length}."
        raise ValueError(message)
    if not (0 < rise < math.inf and 0 <= base < math.inf):
        message = f"rise must be greater than 0 m and base at least 0 m, got {rise} and {base}."
        raise ValueError(message)
    if events < 1 or events != int(events):
        message = f"events must be a whole number of at least 1, got {events}."
        raise ValueError(message)
    number = round(inputs.hop / (2 * inputs.ride))
    if not 2 <= number <= _MOST_CLEATS:
        message = (
            f"hop must be from 3 to {2 * _MOST_CLEATS} times ride, so that at least two cleats lie "
            f"in half a wave, got {inputs.hop:g} Hz and {inputs.ride:g} Hz."
        )
        raise ValueError(message)
    rule: WidthRule = "both edges"
    if width_ratio is not None:
        rule = "given"
        if not 0 < width_ratio < 1:
            message = f"width_ratio must be greater than 0 and less than 1, got {width_ratio}."
            raise ValueError(message)
    elif model == "base-excited" and not _touches_both_edges(inputs):
        width_ratio, rule = _MOST_HOP, "most hop"
    sizes = _cleat_sizes(inputs, length, model, width_ratio)
    design = EventDesign(
        model=model,
        target=target,
        placement=placement,
        inputs=inputs,
        length=length,
        number=number,
        rise=rise,
        base=base,
        speed=sizes["speed"],
        spacing=sizes["spacing"],
        width=sizes["width"],
        events=events,
        width_rule=rule,
        tolerances=_propagate_tolerances(inputs, length, model, width_ratio),
    )
    if design.extent > _LONGEST:
        message = (
            f"the event must be at most {_LONGEST:g} m long, got {design.extent:g} m; choose a "
            "shorter length or fewer events."
        )
        raise ValueError(message)
    return design


def _event_length(inputs: EventInputs, model: HopModel, target: Target) -> float:
    if model == "thesis" or inputs.wheelbase is None:
        return _THESIS_LENGTH
    return inputs.wheelbase if target == "pitch" else inputs.wheelbase / 2


def _touches_both_edges(inputs: EventInputs) -> bool:
    gain = hop_transmissibility(1.0, inputs.damping, tyre_share=inputs.tyre_share)
    return float(gain) > 1


def _cleat_sizes(
    inputs: EventInputs, length: float, model: HopModel, width_ratio: float | None
) -> dict[str, float]:
    if width_ratio is not None:
        share = width_ratio
    elif model == "thesis":
        share = cleat_ratio(inputs.damping, model=model)
    elif _touches_both_edges(inputs):
        share = cleat_ratio(inputs.damping, tyre_share=inputs.tyre_share, ratio=1.0)
    else:  # beyond what a tolerance may reach: no width is left
        share = 0.0
    speed = 2 * length * inputs.ride
    spacing = speed / inputs.hop
    return {"speed": speed, "spacing": spacing, "width": share * spacing, "cleat_ratio": share}


def _propagate_tolerances(
    inputs: EventInputs, length: float, model: HopModel, width_ratio: float | None
) -> dict[str, float]:
    """Tolerances of the sizes: differences over each tolerance either way, added in squares."""
    squares = dict.fromkeys(("speed", "spacing", "width", "cleat_ratio"), 0.0)
    for name, tolerance in inputs.tolerances.items():
        ends = []
        for sign in (-1.0, 1.0):
            if name == "length":
                changed, longer = inputs, length + sign * tolerance
            else:
                value = getattr(inputs, name) + sign * tolerance
                changed, longer = replace(inputs, **{name: value}), length
            ends.append(_cleat_sizes(changed, longer, model, width_ratio))
        for size in squares:
            squares[size] += (0.5 * (ends[1][size] - ends[0][size])) ** 2
    return {size: math.sqrt(square) for size, square in squares.items()}
