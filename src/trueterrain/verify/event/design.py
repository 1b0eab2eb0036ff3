"""Design of an excitation event: cleats that excite chosen modes of a vehicle.

After section 3.3 of Smith, "Improving the Quality of Terrain Measurement" (Virginia Tech, 2009):
the event as a whole is half a wavelength of a mode of the body, and the wheels meet its cleats at
the frequency of wheel hop. `cross_event` predicts the response of a given vehicle.
"""

import math
from dataclasses import replace

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
from trueterrain.verify.event.layout import CleatPlacement, EventDesign, WidthRule
from trueterrain.verify.event.lumber import EventPiece, cut_list
from trueterrain.verify.event.waves import (
    covering_speeds,
    event_spectrum,
    passage_gain,
    wheelbase_filter,
)

__all__ = [
    "CleatPlacement",
    "Erratum",
    "EventDesign",
    "EventInputs",
    "EventPiece",
    "EventResponse",
    "HopModel",
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

_THESIS_LENGTH = 2.44  # [m] 8 feet, a sheet of plywood
_MAX_EXTENT = 1000.0  # [m] of an event
_MAX_CLEATS = 200
_RATIO_OF_MOST_HOP = 0.5  # [1] w / a at which the first harmonic of the cleats is greatest


def design_event(
    inputs: EventInputs = EventInputs(),
    *,
    model: HopModel = "base-excited",
    target: Target = "heave",
    length: float | None = None,
    rise: float = 0.038,
    base: float = 0.0,
    width_ratio: float | None = None,
    placement: CleatPlacement | None = None,
    events: int = 1,
) -> EventDesign:
    """Design an excitation event: speed, and spacing, number and width of its cleats.

    Use it before a dynamic test, so that the crossing excites the modes whose motion the profiler
    must reject.

    Parameters
    ----------
    inputs : EventInputs
        Frequencies, damping and wheelbase with their tolerances.
    model : {"base-excited", "thesis"}
        "thesis": Eqs. 3-4 to 3-13 of Smith (2009) as printed. "base-excited": the corrected
        oscillator, excited at resonance, and the length from the wheelbase.
    target : {"heave", "pitch", "roll"}
        Mode of the body that the event as a whole is to excite.
    length : float, optional
        Length of the event, half a wavelength of the body's mode [m]. By default half the wheelbase
        for heave and roll, so that the rear axle follows a whole period after the front axle, and
        the wheelbase for pitch; 2.44 m with model "thesis" or without wheelbase.
    rise : float
        Height of a cleat [m]; 0.038 is lumber of nominally 2 inches.
    base : float
        Thickness of a board under the whole event, which increases the half wave [m].
    width_ratio : float, optional
        Width of a cleat over the spacing; by default that of the model, or 0.5, which excites most
        hop, if the model has no solution because the damping of the wheel is too large [1].
    placement : {"across", "staggered", "one side"}, optional
        By default staggered for roll, so that left and right rise alternately, else across.
    events : int
        Number of repeats of the event, a wavelength of the body's mode apart.

    Returns
    -------
    EventDesign
        The event.

    Raises
    ------
    ValueError
        If a value is out of its bounds, or fewer than two cleats fit into the event.

    Notes
    -----
    V = 2 L f1, a = V / f2, n = L / a = f2 / (2 f1), rounded to a whole number; w follows from
    `cleat_ratio`, at the peak in the thesis's form, at r = V / (a f2) = 1 in the corrected one. As
    the number is rounded, `built_length` and `ride_met` differ slightly from the required values.

    Tolerances are propagated to first order; those of independent inputs add in squares.

    Examples
    --------
    >>> printed = design_event(EventInputs(), model="thesis")
    >>> print(f"{printed.speed:.2f} m/s, {printed.spacing:.3f} m, {printed.number} cleats, "
    ...       f"w/a {printed.cleat_ratio:.3f}")
    5.37 m/s, 0.488 m, 5 cleats, w/a 0.348
    >>> right = design_event(EventInputs(tyre_stiffness_fraction=0.912), length=2.44)
    >>> print(f"w/a {right.cleat_ratio:.3f} +- {right.tolerances['cleat_ratio']:.3f}")
    w/a 0.271 +- 0.047
    """
    check_choice("model", model, HopModel)
    check_choice("target", target, Target)
    placement = placement or ("staggered" if target == "roll" else "across")
    check_choice("placement", placement, CleatPlacement)
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
    if not 2 <= number <= _MAX_CLEATS:
        message = (
            f"hop must be from 3 to {2 * _MAX_CLEATS} times ride, so that at least two cleats lie "
            f"in half a wavelength, got {inputs.hop:g} Hz and {inputs.ride:g} Hz."
        )
        raise ValueError(message)
    rule: WidthRule = "both edges"
    if width_ratio is not None:
        rule = "given"
        if not 0 < width_ratio < 1:
            message = f"width_ratio must be greater than 0 and less than 1, got {width_ratio}."
            raise ValueError(message)
    elif model == "base-excited" and not _touches_both_edges(inputs):
        width_ratio, rule = _RATIO_OF_MOST_HOP, "most hop"
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
    if design.extent > _MAX_EXTENT:
        message = (
            f"the event must be at most {_MAX_EXTENT:g} m long, got {design.extent:g} m; choose a "
            "shorter length or fewer events."
        )
        raise ValueError(message)
    return design


def _event_length(inputs: EventInputs, model: HopModel, target: Target) -> float:
    if model == "thesis" or inputs.wheelbase is None:
        return _THESIS_LENGTH
    return inputs.wheelbase if target == "pitch" else inputs.wheelbase / 2


def _touches_both_edges(inputs: EventInputs) -> bool:
    """Whether a wheel at resonance moves more than the ground, as the width rule requires."""
    fraction = inputs.tyre_stiffness_fraction
    gain = hop_transmissibility(1.0, inputs.damping, tyre_stiffness_fraction=fraction)
    return float(gain) > 1


def _cleat_sizes(
    inputs: EventInputs, length: float, model: HopModel, width_ratio: float | None
) -> dict[str, float]:
    """Speed [m/s], spacing and width of the cleats [m], and their ratio [1]."""
    if width_ratio is not None:
        ratio = width_ratio
    elif model == "thesis":
        ratio = cleat_ratio(inputs.damping, model=model)
    elif _touches_both_edges(inputs):
        fraction = inputs.tyre_stiffness_fraction
        ratio = cleat_ratio(inputs.damping, tyre_stiffness_fraction=fraction, ratio=1.0)
    else:  # a tolerance that reaches beyond the limit of the rule: the width vanishes
        ratio = 0.0
    speed = 2 * length * inputs.ride
    spacing = speed / inputs.hop
    return {"speed": speed, "spacing": spacing, "width": ratio * spacing, "cleat_ratio": ratio}


def _propagate_tolerances(
    inputs: EventInputs, length: float, model: HopModel, width_ratio: float | None
) -> dict[str, float]:
    """Tolerances of the sizes: central differences over each tolerance, added in squares."""
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
