"""``trueterrain event``: design an event that shakes a vehicle for accuracy tests."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import out_json, write_line, write_note
from trueterrain.cli._numbers import WHOLE

if TYPE_CHECKING:
    from trueterrain.vehicle import FullCarParameters, Tyre
    from trueterrain.verify.event.design import EventDesign, EventInputs, EventResponse

_LASER = (-2.25, 0.0)  # [m] as in scenes that say nothing else
_ANOTHER = 0.1  # [1] by which a vehicle may depart from what the event is designed for
_PATCH = 0.15  # [m] contact patch of a tyre, over which it averages the ground


def event(
    action: Literal["design"],
    /,
    *,
    vehicle: str = "golden car",
    model: Literal["base-excited", "thesis"] = "base-excited",
    target: Literal["heave", "pitch", "roll"] = "heave",
    ride: float | None = None,
    hop: float | None = None,
    damping: float | None = None,
    wheelbase: float | None = None,
    track: float | None = None,
    length: float | None = None,
    ride_tolerance: float | None = None,
    hop_tolerance: float | None = None,
    damping_tolerance: float | None = None,
    length_tolerance: float | None = None,
    rise: float = 0.038,
    base: float = 0.0,
    width_ratio: float | None = None,
    placement: Literal["across", "staggered", "one side"] | None = None,
    events: Annotated[int, WHOLE] = 1,
    band: tuple[float, float] | None = None,
    laser: tuple[float, float] | None = None,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    json: bool = False,
    force: bool = False,
) -> None:
    """Design an excitation event: cleats that shake a vehicle in its body modes and in wheel hop.

    Half a wave of a mode of the body is as long as the event, and wheels meet its cleats at wheel
    hop (Smith 2009, section 3.3). What of that comes true is simulated for the vehicle, a model of
    seven freedoms: heave, pitch and roll of the body, and four wheels.

    Example: trueterrain event design --vehicle van --target pitch -o pitch_event

    Parameters
    ----------
    action
        design: sizes, drawing, cut list, driving instruction and predicted motion.
    vehicle
        Vehicle that shall be shaken: compact, golden car, sedan, van, or a scene (.toml) with
        parameters of your own. What is not given below is taken from it.
    model
        Which oscillator gives the cleats' width. base-excited: damper between wheel and body, as
        vehicles have it. thesis: as printed, damper between wheel and road.
    target
        Mode of the body that the event as a whole shall excite.
    ride
        Frequency of that mode [Hz]; default that of the vehicle.
    hop
        Undamped frequency of wheel hop [Hz]; default that of the vehicle.
    damping
        Damping ratio of wheel hop [1]; default that of the vehicle.
    wheelbase
        Distance between the axles [m]; default that of the vehicle.
    track
        Greatest distance between the wheels of an axle [m]; default that of the vehicle.
    length
        Length of the event, half a wave of the body [m]; default half the wheelbase for heave and
        roll, the wheelbase for pitch, 2.44 with --model thesis.
    ride_tolerance
        By how much ride may be off [Hz]; default 0.05.
    hop_tolerance
        By how much hop may be off [Hz]; default 0.5.
    damping_tolerance
        By how much damping may be off [1]; default 0.05.
    length_tolerance
        By how much the length may be off as built [m]; default 0.005.
    rise
        Height of a cleat [m].
    base
        Thickness of a board under the whole event, such as 0.019 [m].
    width_ratio
        Width of a cleat over the spacing [1]; default from the model.
    placement
        across: one cleat under both wheels. staggered: the right side half a wave behind the left
        one. one side: under the left wheels only. Default staggered for roll, else across.
    events
        How often the event is repeated, a wave of the body apart.
    band
        Frequencies of hop to cover, lowest and highest [Hz]; lists the speeds that do it. Default
        20 % below to 20 % above hop.
    laser
        Place of the laser in the body from its centre of gravity: forward and left [m]; default
        that of the scene, else 2.25 behind it.
    output
        Folder for event.pdf (one page), drawing.svg, event.html and event.json.
    json
        Print one JSON document: {"design", "vehicle", "predicted", "cut_list", "speeds", "flags",
        "files"}; lengths in m, angles in rad.
    force
        Replace an earlier result of the same command in the folder; other files in it stay.
    """
    del action
    from dataclasses import asdict

    from trueterrain.verify.event.design import covering_speeds, cut_list, design_event

    car, tyre, place = _named_vehicle(vehicle)
    given = {"ride": ride, "hop": hop, "damping": damping, "wheelbase": wheelbase, "track": track}
    tolerances = {
        "ride": ride_tolerance,
        "hop": hop_tolerance,
        "damping": damping_tolerance,
        "length": length_tolerance,
    }
    inputs = _event_inputs(car, target, given, tolerances)
    design = design_event(
        inputs,
        model=model,
        target=target,
        length=length,
        rise=rise,
        base=base,
        width_ratio=width_ratio,
        placement=placement,
        events=events,
    )
    moved = _predict_response(car, design, tyre, laser or place)
    pieces = cut_list(design)
    low, high = band or (0.8 * inputs.hop, 1.2 * inputs.hop)
    speeds = covering_speeds(low, high, number=design.number, spacing=design.spacing)
    words = _page_texts(design, moved, vehicle, (low, high), speeds.tolist())
    words["flags"] += _vehicle_notes(car, design, vehicle)
    document: dict[str, Any] = {
        "design": design.to_dict(),
        "vehicle": vehicle,
        "predicted": {
            "laser_span": moved.laser_span,
            "laser_acceleration": float(abs(moved.laser_acceleration).max()),
            "spans": {name: moved.span(name) for name in ("heave", "pitch", "roll")},
            "energy": dict(moved.energy),
            "strongest": moved.strongest,
        },
        "cut_list": [asdict(piece) | {"mass": piece.mass} for piece in pieces],
        "speeds": {"band": [low, high], "speeds": speeds.tolist()},
        "flags": words["flags"],
        "files": [],
    }
    if output is not None:
        read = [vehicle] if vehicle.lower().endswith(".toml") else []
        document["files"] = _write_event(
            output, document, design, moved, car, words, inputs=read, force=force
        )
    if json:
        out_json(document)
    else:
        _print_event(design, words)
    for name in document["files"]:
        write_note(f"{name}: written")


def _named_vehicle(name: str) -> "tuple[FullCarParameters, Tyre, tuple[float, float]]":
    """Vehicle by name or from a scene, its tyres, and where the laser is in it."""
    from trueterrain.vehicle import FullCarParameters, Tyre, named_vehicle

    if not name.lower().endswith(".toml"):
        return named_vehicle(name), Tyre(), _LASER
    from trueterrain.simulate.scene import read_scene

    scene, path = read_scene(name)
    car = scene.vehicle.car
    if not isinstance(car, FullCarParameters):
        message = f"{path}: vehicle must have four wheels, got the model {scene.vehicle.model!r}."
        raise ValueError(message)  # noqa: TRY004 - the file holds what must not be, not the caller
    x, y, _ = scene.mounting.scanner_position
    return car, scene.vehicle.tyre, (x, y)


def _vehicle_notes(car: "FullCarParameters", design: "EventDesign", vehicle: str) -> list[str]:
    """Flags about a prediction for a vehicle other than the one that the event is made for."""
    from trueterrain.verify.event.design import event_inputs

    own, out = event_inputs(car, design.target), []
    for name, unit in (("ride", "Hz"), ("hop", "Hz"), ("wheelbase", "m")):
        has, given = getattr(own, name), getattr(design.inputs, name)
        if abs(given / has - 1) > _ANOTHER:
            out.append(
                f"The motion is predicted for {vehicle!r}, whose {name} is {has:.2f} {unit}, not "
                f"{given:.2f}: give your vehicle with --vehicle SCENE.toml."
            )
    return out


def _event_inputs(
    car: "FullCarParameters",
    target: Literal["heave", "pitch", "roll"],
    given: dict[str, float | None],
    tolerances: dict[str, float | None],
) -> "EventInputs":
    from dataclasses import replace

    from trueterrain.verify.event.design import event_inputs

    own = event_inputs(car, target)
    changed: dict[str, Any] = {k: value for k, value in given.items() if value is not None}
    stated = {name: value for name, value in tolerances.items() if value is not None}
    return replace(own, **changed, tolerances={**own.tolerances, **stated})


def _predict_response(
    car: "FullCarParameters", design: "EventDesign", tyre: "Tyre", laser: tuple[float, float]
) -> "EventResponse":
    import numpy as np

    from trueterrain.simulate.ground import ExcitationEvent
    from trueterrain.verify.event.design import cross_event

    ground = ExcitationEvent(**design.ground)

    def height(x: Any, y: Any) -> Any:
        if design.placement == "one side":
            return np.where(y > 0, ground.height(x, y), 0.0)
        return ground.height(x, y)

    return cross_event(car, height, design.speed, length=design.extent, laser=laser, tyre=tyre)


def _page_texts(
    design: "EventDesign",
    moved: "EventResponse",
    vehicle: str,
    band: tuple[float, float],
    speeds: list[float],
) -> dict[str, list[str]]:
    """What a reader is told, by section of the page."""
    import numpy as np

    from trueterrain.report.event import speed_text

    low, high = design.speed_band
    shares = ", ".join(f"{name} {100 * share:.0f} %" for name, share in moved.energy.items())
    driving = [
        f"Drive at {speed_text(design.speed)}, steadily, from 20 m before the event to 20 m "
        "behind it, without braking; the wheels in the middle of the cleats.",
        f"From {low:.2f} to {high:.2f} m/s wheel hop gets at least half of the power.",
        f"To cover hop from {band[0]:.1f} to {band[1]:.1f} Hz, drive at "
        f"{', '.join(f'{speed:.2f}' for speed in speeds)} m/s in turn.",
    ]
    excited = [
        f"Predicted for {vehicle!r}: laser {1000 * moved.laser_span:.0f} mm from peak to peak, "
        f"{abs(moved.laser_acceleration).max():.0f} m/s² at most; heave "
        f"{1000 * moved.span('heave'):.0f} mm, pitch {np.rad2deg(moved.span('pitch')):.2f} deg, "
        f"roll {np.rad2deg(moved.span('roll')):.2f} deg.",
        f"Kinetic energy: {shares}. Of the body, {moved.strongest} gets most.",
    ]
    if design.events > 1:
        apart = f"{design.pitch:.2f} m from begin to begin"
        driving.insert(0, f"Lay the event {design.events} times, {apart}.")
    flags = []
    if moved.strongest != design.target:
        flags.append(
            f"The event was to excite {design.target}, but {moved.strongest} gets more: choose "
            "the length from the wheelbase (leave --length out), or repeat the event (--events)."
        )
    if design.spacing - design.width < _PATCH or design.width < 0.5 * _PATCH:
        flags.append(
            f"Cleats of {1000 * design.width:.0f} mm, {1000 * design.spacing:.0f} mm apart, are "
            f"short for a contact patch of {1000 * _PATCH:.0f} mm, which averages them: hop is "
            "excited less."
        )
    if design.width_rule == "most hop":
        flags.append(
            f"At a damping ratio of {design.inputs.damping:.2f} no wheel in hop touches both edges "
            "of a cleat; half the spacing was taken as width, where hop is excited most."
        )
    return {
        "driving": driving,
        "excited": excited,
        "flags": flags,
        "models": _model_notes(design),
    }


def _model_notes(design: "EventDesign") -> list[str]:
    from trueterrain.verify.event.design import cleat_ratio, hop_transmissibility

    inputs = design.inputs
    printed = cleat_ratio(inputs.damping, model="thesis")
    gain = float(
        hop_transmissibility(
            1.0, inputs.damping, tyre_stiffness_fraction=inputs.tyre_stiffness_fraction
        )
    )
    sentences = [
        f"As printed, w/a is {printed:.3f} at a damping ratio of {inputs.damping:.2f}: the damper "
        "of Eq. 3-7 is fixed to the road, the peak is taken for that of a force, and the width is "
        "stretched by 1 / sqrt(1 - z²), as if a wheel on cleats oscillated by itself.",
    ]
    if gain > 1:
        right = cleat_ratio(
            inputs.damping, tyre_stiffness_fraction=inputs.tyre_stiffness_fraction, ratio=1.0
        )
        sentences.append(
            f"With the damper between wheel and body, a wheel met at its resonance moves "
            f"{gain:.2f} times as much as the ground, and w/a is {right:.3f}."
        )
    else:
        sentences.append(
            f"With the damper between wheel and body, a wheel met at its resonance moves "
            f"{gain:.2f} times as much as the ground, less than the cleats: the rule has no answer."
        )
    sentences.append(
        "Either is a rule of construction, not an optimum: hop grows with sin(pi w/a) up to a "
        "width of half the spacing, the motion of the body with the mean height h w/a."
    )
    return sentences


def _write_event(
    folder: Path,
    document: dict[str, Any],
    design: "EventDesign",
    moved: "EventResponse",
    car: "FullCarParameters",
    words: dict[str, list[str]],
    *,
    inputs: list[str],
    force: bool,
) -> list[str]:
    import json

    from trueterrain.core import whole_folder
    from trueterrain.report.event import write_event_page
    from trueterrain.verify.event.design import cut_list

    with whole_folder(folder, result="event", force=force, inputs=inputs) as temporary:
        names = write_event_page(temporary, design, cut_list(design), moved, car, words)
        text = json.dumps(document, indent=2, allow_nan=False)
        (temporary / "event.json").write_text(text + "\n", encoding="utf-8")
    return [str(folder / name) for name in (*names, "event.json")]


def _print_event(design: "EventDesign", words: dict[str, list[str]]) -> None:
    from trueterrain.report.event import piece_text, speed_text
    from trueterrain.verify.event.design import cut_list

    off = design.tolerances
    rows = (
        ("speed V", f"{speed_text(design.speed)}, +- {off['speed']:.2f} m/s"),
        ("cleats", f"{design.number}, {1000 * design.rise:.0f} mm high, {design.placement}"),
        ("spacing a", f"{design.spacing:.3f} +- {off['spacing']:.3f} m"),
        ("width w", f"{design.width:.3f} +- {off['width']:.3f} m"),
        ("w / a", f"{design.cleat_ratio:.3f} +- {off['cleat_ratio']:.3f}, {design.width_rule}"),
        ("length", f"{design.length:.2f} m asked for, {design.built_length:.2f} m as built"),
        ("met", f"{design.target} at {design.ride_met:.2f} Hz, hop at {design.hop_met:.2f} Hz"),
    )
    write_line(f"Event for {design.target}, oscillator {design.model}")
    for name, value in rows:
        write_line(f"  {name:<10} {value}")
    for title, sentences in (
        ("Cut list", [piece_text(piece, design.spacing) for piece in cut_list(design)]),
        ("Driving", words["driving"]),
        ("What is excited", [*words["excited"], *words["flags"]]),
        ("Two oscillators", words["models"]),
    ):
        write_line(title)
        for sentence in sentences:
            write_line(f"  {sentence}")
