"""The command ``trueterrain event``: design of excitation events for accuracy tests."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import write_json, write_line, write_note
from trueterrain.cli._options import INTEGER

if TYPE_CHECKING:
    from trueterrain.report.event_text import PredictedEvent
    from trueterrain.vehicle import FullCarParameters, Tyre
    from trueterrain.verify.event.design import EventInputs


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
    from trueterrain.report.event_text import predict_event
    from trueterrain.verify.event.design import design_event

    car, tyre, position = _named_vehicle(vehicle)
    given = {"ride": ride, "hop": hop, "damping": damping, "wheelbase": wheelbase, "track": track}
    tolerances = {
        "ride": ride_tolerance,
        "hop": hop_tolerance,
        "damping": damping_tolerance,
        "length": length_tolerance,
    }
    design = design_event(
        _event_inputs(car, target, given, tolerances),
        model=model,
        target=target,
        length=length,
        rise=rise,
        base=base,
        width_ratio=width_ratio,
        placement=placement,
        events=events,
    )
    predicted = predict_event(
        design, car, vehicle=vehicle, tyre=tyre, laser=laser or position, band=band
    )
    files = []
    if output is not None:
        from trueterrain.core import whole_folder
        from trueterrain.report import write_event_page

        inputs = [vehicle] if vehicle.lower().endswith(".toml") else []
        with whole_folder(output, result="event", force=force, inputs=inputs) as folder:
            names = write_event_page(predicted, folder)
        files = [str(output / name) for name in names]
    if json:
        write_json(predicted.to_dict() | {"files": files})
    else:
        _print_event(predicted)
    for name in files:
        write_note(f"{name}: written")


def _named_vehicle(name: str) -> "tuple[FullCarParameters, Tyre, tuple[float, float]]":
    """Vehicle by name or from a scene, its tyre, and the position of its laser [m]."""
    from trueterrain.report.event_text import LASER
    from trueterrain.vehicle import FullCarParameters, Tyre, named_vehicle

    if not name.lower().endswith(".toml"):
        return named_vehicle(name), Tyre(), LASER
    from trueterrain.simulate.scene import read_scene

    scene, path = read_scene(name)
    car = scene.vehicle.car
    if not isinstance(car, FullCarParameters):
        message = f"{path}: vehicle must have four wheels, got the model {scene.vehicle.model!r}."
        raise ValueError(message)  # noqa: TRY004 - the content of the file is wrong, not an argument
    x, y, _ = scene.mounting.scanner_position
    return car, scene.vehicle.tyre, (x, y)


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


def _print_event(event: "PredictedEvent") -> None:
    from trueterrain.report.event_text import describe_event, speed_text

    design = event.design
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
    for title, sentences in describe_event(event).items():
        write_line(title)
        for sentence in sentences:
            write_line(f"  {sentence}")
