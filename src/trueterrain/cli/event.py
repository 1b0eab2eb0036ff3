"""The command ``trueterrain event``: design of excitation events for accuracy tests."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import write_json, write_line, write_note
from trueterrain.cli._options import INTEGER

if TYPE_CHECKING:
    from trueterrain.vehicle import FullCarParameters, Tyre
    from trueterrain.verify.event.design import EventDesign, EventInputs, EventResponse

_LASER = (-2.25, 0.0)  # [m] forward, left: the default of scenes
_MAX_DEVIATION = 0.1  # [1] of a vehicle from the one for which the event is designed
_PATCH = 0.15  # [m] length of the contact patch, over which a tyre averages the ground


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
    events: Annotated[int, INTEGER] = 1,
    band: tuple[float, float] | None = None,
    laser: tuple[float, float] | None = None,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    json: bool = False,
    force: bool = False,
) -> None:
    """Design an excitation event: cleats that excite body modes and wheel hop of a vehicle.

    The length of the event is half a wavelength of the body mode, and the wheels cross its cleats
    at the frequency of wheel hop (Smith 2009, section 3.3). The response of the vehicle is
    simulated with a model of seven degrees of freedom: heave, pitch and roll of the body, and the
    travel of four wheels.

    Example: trueterrain event design --vehicle van --target pitch -o pitch_event

    Parameters
    ----------
    action
        design: sizes, drawing, cut list, driving instruction and predicted motion.
    vehicle
        Vehicle to excite: compact, golden car, sedan, van, or a scene (.toml) with other
        parameters. It provides the values that are not given below.
    model
        Oscillator that determines the width of the cleats. base-excited: damper between wheel and
        body, as in vehicles. thesis: as printed, damper between wheel and road.
    target
        Mode of the body that the event excites.
    ride
        Frequency of that mode [Hz]; by default that of the vehicle.
    hop
        Undamped frequency of wheel hop [Hz]; by default that of the vehicle.
    damping
        Damping ratio of wheel hop [1]; by default that of the vehicle.
    wheelbase
        Distance between the axles [m]; by default that of the vehicle.
    track
        Maximum distance between the wheels of an axle [m]; by default that of the vehicle.
    length
        Length of the event, half a wavelength of the body mode [m]; by default half the wheelbase
        for heave and roll, the wheelbase for pitch, 2.44 with --model thesis.
    ride_tolerance
        Tolerance of ride [Hz]; by default 0.05.
    hop_tolerance
        Tolerance of hop [Hz]; by default 0.5.
    damping_tolerance
        Tolerance of damping [1]; by default 0.05.
    length_tolerance
        Tolerance of the length as built [m]; by default 0.005.
    rise
        Height of a cleat [m].
    base
        Thickness of a board under the whole event, e.g. 0.019 [m].
    width_ratio
        Ratio of cleat width to spacing [1]; by default from the model.
    placement
        across: one cleat under both wheels. staggered: the right side half a wavelength behind the
        left one. one side: under the left wheels only. By default staggered for roll, else across.
    events
        Number of repeats of the event, one wavelength of the body mode apart.
    band
        Lowest and highest frequency of hop to cover [Hz]; the speeds that cover them are listed. By
        default 20 % below to 20 % above hop.
    laser
        Position of the laser from the centre of gravity of the body: forward and left [m]; by
        default that of the scene, else 2.25 behind it.
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

    car, tyre, position = _named_vehicle(vehicle)
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
    response = _predict_response(car, design, tyre, laser or position)
    pieces = cut_list(design)
    low, high = band or (0.8 * inputs.hop, 1.2 * inputs.hop)
    speeds = covering_speeds(low, high, number=design.number, spacing=design.spacing)
    texts = _page_texts(design, response, vehicle, (low, high), speeds.tolist())
    texts["flags"] += _vehicle_notes(car, design, vehicle)
    document: dict[str, Any] = {
        "design": design.to_dict(),
        "vehicle": vehicle,
        "predicted": {
            "laser_span": response.laser_span,
            "laser_acceleration": float(abs(response.laser_acceleration).max()),
            "spans": {name: response.span(name) for name in ("heave", "pitch", "roll")},
            "energy": dict(response.energy),
            "strongest": response.strongest,
        },
        "cut_list": [asdict(piece) | {"mass": piece.mass} for piece in pieces],
        "speeds": {"band": [low, high], "speeds": speeds.tolist()},
        "flags": texts["flags"],
        "files": [],
    }
    if output is not None:
        read = [vehicle] if vehicle.lower().endswith(".toml") else []
        document["files"] = _write_event(
            output, document, design, response, car, texts, inputs=read, force=force
        )
    if json:
        write_json(document)
    else:
        _print_event(design, texts)
    for name in document["files"]:
        write_note(f"{name}: written")


def _named_vehicle(name: str) -> "tuple[FullCarParameters, Tyre, tuple[float, float]]":
    """Vehicle by name or from a scene, its tyre, and the position of its laser [m]."""
    from trueterrain.vehicle import FullCarParameters, Tyre, named_vehicle

    if not name.lower().endswith(".toml"):
        return named_vehicle(name), Tyre(), _LASER
    from trueterrain.simulate.scene import read_scene

    scene, path = read_scene(name)
    car = scene.vehicle.car
    if not isinstance(car, FullCarParameters):
        message = f"{path}: vehicle must have four wheels, got the model {scene.vehicle.model!r}."
        raise ValueError(message)  # noqa: TRY004 - the content of the file is wrong, not an argument
    x, y, _ = scene.mounting.scanner_position
    return car, scene.vehicle.tyre, (x, y)


def _vehicle_notes(car: "FullCarParameters", design: "EventDesign", vehicle: str) -> list[str]:
    """Flags if the prediction is for another vehicle than the one the event is designed for."""
    from trueterrain.verify.event.design import event_inputs

    own, flags = event_inputs(car, design.target), []
    for name, unit in (("ride", "Hz"), ("hop", "Hz"), ("wheelbase", "m")):
        actual, given = getattr(own, name), getattr(design.inputs, name)
        if abs(given / actual - 1) > _MAX_DEVIATION:
            flags.append(
                f"The motion is predicted for {vehicle!r}, whose {name} is {actual:.2f} {unit}, "
                f"not {given:.2f}: give your vehicle with --vehicle SCENE.toml."
            )
    return flags


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
    response: "EventResponse",
    vehicle: str,
    band: tuple[float, float],
    speeds: list[float],
) -> dict[str, list[str]]:
    """Sentences of the report by section."""
    import numpy as np

    from trueterrain.report.event import speed_text

    low, high = design.speed_band
    energy = ", ".join(f"{name} {100 * part:.0f} %" for name, part in response.energy.items())
    driving = [
        f"Drive at a constant speed of {speed_text(design.speed)} from 20 m before the event to "
        "20 m behind it, without braking; the wheels at the centre of the cleats.",
        f"From {low:.2f} to {high:.2f} m/s, wheel hop has at least half of its maximum power.",
        f"To cover hop from {band[0]:.1f} to {band[1]:.1f} Hz, drive at "
        f"{', '.join(f'{speed:.2f}' for speed in speeds)} m/s in turn.",
    ]
    excited = [
        f"Predicted for {vehicle!r}: laser {1000 * response.laser_span:.0f} mm from peak to peak, "
        f"{abs(response.laser_acceleration).max():.0f} m/s² at most; heave "
        f"{1000 * response.span('heave'):.0f} mm, "
        f"pitch {np.rad2deg(response.span('pitch')):.2f} deg, "
        f"roll {np.rad2deg(response.span('roll')):.2f} deg.",
        f"Kinetic energy: {energy}. The strongest mode of the body is {response.strongest}.",
    ]
    if design.events > 1:
        apart = f"{design.pitch:.2f} m from start to start"
        driving.insert(0, f"Lay the event {design.events} times, {apart}.")
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


def _write_event(
    folder: Path,
    document: dict[str, Any],
    design: "EventDesign",
    response: "EventResponse",
    car: "FullCarParameters",
    texts: dict[str, list[str]],
    *,
    inputs: list[str],
    force: bool,
) -> list[str]:
    import json

    from trueterrain.core import whole_folder
    from trueterrain.report.event import write_event_page
    from trueterrain.verify.event.design import cut_list

    with whole_folder(folder, result="event", force=force, inputs=inputs) as temporary:
        names = write_event_page(temporary, design, cut_list(design), response, car, texts)
        text = json.dumps(document, indent=2, allow_nan=False)
        (temporary / "event.json").write_text(text + "\n", encoding="utf-8")
    return [str(folder / name) for name in (*names, "event.json")]


def _print_event(design: "EventDesign", texts: dict[str, list[str]]) -> None:
    from trueterrain.report.event import piece_text, speed_text
    from trueterrain.verify.event.design import cut_list

    tolerance = design.tolerances
    rows = (
        ("speed V", f"{speed_text(design.speed)}, +- {tolerance['speed']:.2f} m/s"),
        ("cleats", f"{design.number}, {1000 * design.rise:.0f} mm high, {design.placement}"),
        ("spacing a", f"{design.spacing:.3f} +- {tolerance['spacing']:.3f} m"),
        ("width w", f"{design.width:.3f} +- {tolerance['width']:.3f} m"),
        (
            "w / a",
            f"{design.cleat_ratio:.3f} +- {tolerance['cleat_ratio']:.3f}, {design.width_rule}",
        ),
        ("length", f"{design.length:.2f} m requested, {design.built_length:.2f} m as built"),
        ("excites", f"{design.target} at {design.ride_met:.2f} Hz, hop at {design.hop_met:.2f} Hz"),
    )
    write_line(f"Event for {design.target}, oscillator {design.model}")
    for name, value in rows:
        write_line(f"  {name:<10} {value}")
    for title, sentences in (
        ("Cut list", [piece_text(piece, design.spacing) for piece in cut_list(design)]),
        ("Driving", texts["driving"]),
        ("What is excited", [*texts["excited"], *texts["flags"]]),
        ("Two oscillators", texts["models"]),
    ):
        write_line(title)
        for sentence in sentences:
            write_line(f"  {sentence}")
