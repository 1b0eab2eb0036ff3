"""Predicted response to an excitation event, and the sentences that describe it."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.ground import ExcitationEvent
from trueterrain.vehicle import FullCarParameters, Tyre
from trueterrain.verify.event.design import (
    EventDesign,
    EventPiece,
    EventResponse,
    cleat_ratio,
    covering_speeds,
    cross_event,
    cut_list,
    event_inputs,
    hop_transmissibility,
)

Floats = npt.NDArray[np.float64]

LASER = (-2.25, 0.0)  # [m] forward, left: the default of scenes

_MAX_DEVIATION = 0.1  # [1] of a vehicle from the one for which the event is designed
_PATCH = 0.15  # [m] length of the contact patch, over which a tyre averages the ground
_KMH, _MPH, _INCH = 3.6, 2.236936, 0.0254  # per m/s, per m/s, m
_SAWN = 0.0015  # [m] tolerance of lumber


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedEvent:
    """An excitation event and the predicted response of a vehicle; made by `predict_event`."""

    design: EventDesign
    "The event."

    car: FullCarParameters
    "Vehicle that crosses it."

    vehicle: str
    "Name of the vehicle."

    response: EventResponse
    "Motion of the vehicle over the event."

    band: tuple[float, float]
    "Lowest and highest frequency of wheel hop to cover [Hz]."

    pieces: tuple[EventPiece, ...]
    "Cut list."

    speeds: tuple[float, ...]
    "Speeds that cover the band [m/s]."

    def to_dict(self) -> dict[str, Any]:
        """Numbers and sentences, ready for JSON; lengths in m, angles in rad."""
        response = self.response
        return {
            "design": self.design.to_dict(),
            "vehicle": self.vehicle,
            "predicted": {
                "laser_span": response.laser_span,
                "laser_acceleration": float(abs(response.laser_acceleration).max()),
                "spans": {name: response.span(name) for name in ("heave", "pitch", "roll")},
                "energy": dict(response.energy),
                "strongest": response.strongest,
            },
            "cut_list": [asdict(piece) | {"mass": piece.mass} for piece in self.pieces],
            "speeds": {"band": list(self.band), "speeds": list(self.speeds)},
            "flags": describe_flags(self),
            "files": [],
        }


def predict_event(
    design: EventDesign,
    car: FullCarParameters,
    *,
    vehicle: str = "vehicle",
    tyre: Tyre = Tyre(),
    laser: tuple[float, float] = LASER,
    band: tuple[float, float] | None = None,
) -> PredictedEvent:
    """Predict the response of a vehicle to an excitation event.

    Parameters
    ----------
    design : EventDesign
        The event.
    car : FullCarParameters
        Vehicle that crosses it at the speed of the design.
    vehicle : str
        Name of the vehicle.
    tyre : Tyre
        Contact of its tyres.
    laser : tuple of float
        Position of the laser from the centre of gravity of the body: forward and left [m].
    band : tuple of float, optional
        Lowest and highest frequency of wheel hop to cover [Hz]; by default 20 % below to 20 %
        above that of the design.

    Returns
    -------
    PredictedEvent
        Argument of `write_event_page`.

    Raises
    ------
    ValueError
        If the cleats cannot be sawn from lumber, or the band is not one of rising frequencies.

    Examples
    --------
    >>> from trueterrain.vehicle import named_vehicle
    >>> from trueterrain.verify.event.design import design_event, event_inputs
    >>> car = named_vehicle("sedan")
    >>> predict_event(design_event(event_inputs(car)), car).response.strongest
    'heave'
    """
    ground = ExcitationEvent(**design.ground)

    def height(x: Floats, y: Floats) -> Floats:
        under_left = (y > 0) | (design.placement != "one side")
        return np.where(under_left, ground.height(x, y), 0.0)

    band = band or (0.8 * design.inputs.hop, 1.2 * design.inputs.hop)
    speeds = covering_speeds(*band, number=design.number, spacing=design.spacing)
    return PredictedEvent(
        design=design,
        car=car,
        vehicle=vehicle,
        response=cross_event(
            car, height, design.speed, length=design.extent, laser=laser, tyre=tyre
        ),
        band=band,
        pieces=cut_list(design),
        speeds=tuple(speeds.tolist()),
    )


def speed_text(speed: float) -> str:
    """A speed in m/s, km/h and miles per hour."""
    return f"{speed:.2f} m/s ({speed * _KMH:.1f} km/h, {speed * _MPH:.1f} mile/h)"


def piece_text(piece: EventPiece, spacing: float) -> str:
    """Line of the cut list; `spacing` [m] gives the width ratio of unsawn lumber."""
    sizes = (piece.length, piece.width, piece.thickness)
    size = " x ".join(f"{1000 * value:.0f}" for value in sizes)
    inches = " x ".join(f"{value / _INCH:.1f}" for value in sizes)
    unsawn = ""
    if abs(piece.unsawn_width - piece.width) > _SAWN:
        ratio = piece.unsawn_width / spacing
        unsawn = f" (or left {1000 * piece.unsawn_width:.0f} mm wide: w/a {ratio:.2f})"
    return (
        f"{piece.count} x {piece.name}, {size} mm ({inches} in), {piece.mass:.1f} kg each: "
        f"{piece.stock_count} of {piece.stock}; {piece.work}{unsawn}"
    )


def describe_event(event: PredictedEvent) -> dict[str, list[str]]:
    """Sentences on an event by their titles."""
    return {
        "Cut list": [piece_text(piece, event.design.spacing) for piece in event.pieces],
        "Driving": describe_driving(event),
        "What is excited": [*describe_response(event), *describe_flags(event)],
        "Two oscillators": describe_oscillators(event.design),
    }


def describe_driving(event: PredictedEvent) -> list[str]:
    """Driving instruction."""
    design = event.design
    low, high = design.speed_band
    driving = [
        f"Drive at a constant speed of {speed_text(design.speed)} from 20 m before the event to "
        "20 m behind it, without braking; the wheels at the centre of the cleats.",
        f"From {low:.2f} to {high:.2f} m/s, wheel hop has at least half of its maximum power.",
        f"To cover hop from {event.band[0]:.1f} to {event.band[1]:.1f} Hz, drive at "
        f"{', '.join(f'{speed:.2f}' for speed in event.speeds)} m/s in turn.",
    ]
    if design.events > 1:
        apart = f"{design.pitch:.2f} m from start to start"
        driving.insert(0, f"Lay the event {design.events} times, {apart}.")
    return driving


def describe_response(event: PredictedEvent) -> list[str]:
    """Predicted motion and energy."""
    response = event.response
    energy = ", ".join(f"{name} {100 * part:.0f} %" for name, part in response.energy.items())
    return [
        f"Predicted for {event.vehicle!r}: laser {1000 * response.laser_span:.0f} mm from peak to "
        f"peak, {abs(response.laser_acceleration).max():.0f} m/s² at most; heave "
        f"{1000 * response.span('heave'):.0f} mm, "
        f"pitch {np.rad2deg(response.span('pitch')):.2f} deg, "
        f"roll {np.rad2deg(response.span('roll')):.2f} deg.",
        f"Kinetic energy: {energy}. The strongest mode of the body is {response.strongest}.",
    ]


def describe_flags(event: PredictedEvent) -> list[str]:
    """Flags of the design, and of a prediction for another vehicle than the one it is for."""
    design, response = event.design, event.response
    flags = []
    if response.strongest != design.target:
        flags.append(
            f"The event is designed for {design.target}, but excites {response.strongest} more: "
            "choose the length from the wheelbase (leave --length out), or repeat the event "
            "(--events)."
        )
    if design.spacing - design.width < _PATCH or design.width < 0.5 * _PATCH:
        flags.append(
            f"Cleats of {1000 * design.width:.0f} mm, {1000 * design.spacing:.0f} mm apart, are "
            f"short compared with a contact patch of {1000 * _PATCH:.0f} mm, which averages them: "
            "hop is excited less."
        )
    if design.width_rule == "most hop":
        flags.append(
            f"At a damping ratio of {design.inputs.damping:.2f} no wheel in hop touches both edges "
            "of a cleat; the width is half the spacing, which excites hop most."
        )
    own = event_inputs(event.car, design.target)
    for name, unit in (("ride", "Hz"), ("hop", "Hz"), ("wheelbase", "m")):
        actual, given = getattr(own, name), getattr(design.inputs, name)
        if abs(given / actual - 1) > _MAX_DEVIATION:
            flags.append(
                f"The motion is predicted for {event.vehicle!r}, whose {name} is {actual:.2f} "
                f"{unit}, not {given:.2f}: give your vehicle with --vehicle SCENE.toml."
            )
    return flags


def describe_oscillators(design: EventDesign) -> list[str]:
    """Width of the cleats by the oscillator as printed and by the corrected one."""
    inputs = design.inputs
    printed = cleat_ratio(inputs.damping, model="thesis")
    gain = float(
        hop_transmissibility(
            1.0, inputs.damping, tyre_stiffness_fraction=inputs.tyre_stiffness_fraction
        )
    )
    sentences = [
        f"As printed, w/a is {printed:.3f} at a damping ratio of {inputs.damping:.2f}: the damper "
        "of Eq. 3-7 connects wheel and road, the resonance is that of a force on the wheel, and "
        "the width is divided by sqrt(1 - z²), as for free oscillation.",
    ]
    if gain > 1:
        ratio = cleat_ratio(
            inputs.damping, tyre_stiffness_fraction=inputs.tyre_stiffness_fraction, ratio=1.0
        )
        sentences.append(
            f"With the damper between wheel and body, a wheel excited at its resonance moves "
            f"{gain:.2f} times as much as the ground, and w/a is {ratio:.3f}."
        )
    else:
        sentences.append(
            f"With the damper between wheel and body, a wheel excited at its resonance moves "
            f"{gain:.2f} times as much as the ground, less than the cleats: the rule has no "
            "solution."
        )
    sentences.append(
        "Both are design rules, not optima: hop increases with sin(pi w/a) up to a width of half "
        "the spacing, body motion with the mean height h w/a."
    )
    return sentences
