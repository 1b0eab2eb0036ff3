"""Page of an excitation event: drawing, cut list, driving instruction, predicted motion."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trueterrain import figures
from trueterrain.report.event_text import (
    PredictedEvent,
    describe_event,
    describe_flags,
    describe_response,
)
from trueterrain.report.parts import (
    Column,
    Number,
    Picture,
    Report,
    Section,
    Table,
    Text,
    Warnings,
)
from trueterrain.report.write import write_json_file, write_report
from trueterrain.verify.event.design import (
    EventDesign,
    event_errata,
    event_spectrum,
    passage_gain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PAPER = (8.27, 11.69)  # [inches] A4


def write_event_page(
    event: PredictedEvent, folder: str | Path, *, force: bool = False
) -> list[str]:
    """Write drawing, page to print, report and numbers of an excitation event into a folder.

    Parameters
    ----------
    event : PredictedEvent
        The event and the predicted response, from `predict_event`.
    folder : str or Path
        Existing folder.
    force : bool
        Replace files that are there already.

    Returns
    -------
    list of str
        Names of the files: drawing.svg, event.pdf, event.html and event.json.

    Raises
    ------
    OutputError
        If a file exists and `force` is false, or the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.report import predict_event
    >>> from trueterrain.vehicle import named_vehicle
    >>> from trueterrain.verify.event.design import design_event, event_inputs
    >>> car = named_vehicle("van")
    >>> event = predict_event(design_event(event_inputs(car, "pitch")), car, vehicle="van")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_event_page(event, folder)
    ['drawing.svg', 'event.pdf', 'event.html', 'event.json']
    """
    import matplotlib.pyplot as plt

    folder = Path(folder)
    drawing = _event_drawing(event)
    figures.save_figure(drawing, folder / "drawing.svg", force=force)
    figures.save_figure(_print_page(event), folder / "event.pdf", force=force)
    write_report(_event_report(event, drawing), folder / "event.html", force=force)
    write_json_file(event.to_dict(), folder / "event.json", force=force)
    plt.close("all")
    return ["drawing.svg", "event.pdf", "event.html", "event.json"]


def _event_drawing(event: PredictedEvent) -> "Figure":
    import matplotlib.pyplot as plt

    figure: Figure
    figure, axes = plt.subplots(
        2, 1, figsize=(8, 6.4), layout="constrained", height_ratios=(2.2, 1.0)
    )
    _draw_event(event, *axes)
    return figure


def _draw_event(event: PredictedEvent, above: Any, below: Any) -> None:
    design = event.design
    shape = design.to_dict()
    whole = event.pieces[0].length * (1 if design.placement == "across" else 2)
    figures.event_plan(shape, across=whole, track=design.inputs.track, ax=above)
    figures.event_side(shape, ax=below)


def _print_page(event: PredictedEvent) -> "Figure":
    import matplotlib.pyplot as plt

    design, response = event.design, event.response
    figure: Any = plt.figure(figsize=_PAPER, layout="constrained")
    figure.get_layout_engine().set(rect=(0.03, 0.02, 0.94, 0.93))
    grid = figure.add_gridspec(4, 1, height_ratios=(2.8, 1.0, 1.2, 2.2))
    above, below, motion, text = (figure.add_subplot(grid[row]) for row in range(4))
    _draw_event(event, above, below)
    figures.laser_displacement({"time": response.time, "up": response.laser}, ax=motion)
    text.axis("off")
    lines = []
    for title, sentences in describe_event(event).items():
        if title == "Two oscillators":
            continue  # theory: not needed where the event is built
        lines.append(title.upper())
        for sentence in sentences:
            lines += textwrap.wrap(sentence, 122, initial_indent="- ", subsequent_indent="  ")
        lines.append("")
    written = text.text(0, 1, "\n".join(lines), va="top", fontsize=7.5, linespacing=1.35)
    title = figure.suptitle(_event_title(design), fontsize="large", y=0.975)  # within the margin
    figures.draw_names([written, title])
    page: Figure = figure
    return page


def _event_title(design: EventDesign) -> str:
    return (
        f"Excitation event for {design.target} at {design.ride_met:.2f} Hz "
        f"and wheel hop at {design.hop_met:.1f} Hz"
    )


def _event_report(event: PredictedEvent, drawing: "Figure") -> Report:
    design, response, sentences = event.design, event.response, describe_event(event)
    frequency = np.geomspace(0.3, 30.0, 600)
    gains = passage_gain(event.car, frequency, design.speed)
    spectrum = event_spectrum(
        frequency,
        design.speed,
        number=design.number,
        spacing=design.spacing,
        width=design.width,
        rise=design.rise,
        base=design.base,
    )
    named = {
        "heave": gains.heave,
        "pitch, at the axles": gains.pitch,
        "front axle": gains.front_hop,
        "rear axle": gains.rear_hop,
    }
    passage = figures.passage_gains(
        {name: (frequency, values) for name, values in named.items()},
        event=(frequency, spectrum),
        speed=design.speed,
    )
    laser = figures.laser_displacement({"time": response.time, "up": response.laser})
    off = design.tolerances
    sizes = [
        ("speed V", "m/s", design.speed, off["speed"]),
        ("spacing a", "m", design.spacing, off["spacing"]),
        ("width w", "m", design.width, off["width"]),
        ("width over spacing w/a", "1", design.cleat_ratio, off["cleat_ratio"]),
    ]
    errata = event_errata(design.inputs.damping, design.inputs.tyre_stiffness_fraction)
    return Report(
        title=_event_title(design),
        subtitle=f"{design.number} cleats, {design.placement}; oscillator {design.model}",
        headline=(
            Number(label="Speed", value=design.speed, unit="m/s", digits=2),
            Number(label="Spacing", value=1000 * design.spacing, unit="mm", digits=0),
            Number(label="Cleats", value=design.number),
            Number(label="Width", value=1000 * design.width, unit="mm", digits=0),
            Number(
                label="Laser, peak to peak", value=1000 * response.laser_span, unit="mm", digits=0
            ),
        ),
        sections=(
            Section(
                title="Drawing",
                blocks=(
                    Picture(
                        figure=drawing, alt="The event from above and from the side, dimensioned"
                    ),
                    Table(
                        columns=(
                            Column(label="Size"),
                            Column(label="Unit"),
                            Column(label="Value", digits=3),
                            Column(label="Tolerance", digits=3),
                        ),
                        rows=sizes,
                        caption="Sizes and their tolerances.",
                    ),
                ),
            ),
            Section(
                title="Cut list",
                blocks=tuple(Text(paragraph=sentence) for sentence in sentences["Cut list"]),
            ),
            Section(
                title="Driving",
                blocks=tuple(Text(paragraph=sentence) for sentence in sentences["Driving"]),
            ),
            Section(
                title="What is excited",
                blocks=(
                    *(Text(paragraph=sentence) for sentence in describe_response(event)),
                    Warnings(items=describe_flags(event)),
                    Picture(figure=laser, alt="Predicted height of the laser over time"),
                    Picture(
                        figure=passage,
                        alt="Motion of body and axles over frequency",
                        caption="Ground equal on the left and the right. The notches are those of "
                        "the wheelbase; the area is the spectrum of one event.",
                    ),
                    Table(
                        columns=(
                            Column(label="Mode"),
                            Column(label="Fraction of the energy", unit="%", digits=1),
                        ),
                        rows=[(name, 100 * fraction) for name, fraction in response.energy.items()],
                    ),
                ),
            ),
            Section(
                title="Two oscillators",
                blocks=(
                    *(Text(paragraph=sentence) for sentence in sentences["Two oscillators"]),
                    Table(
                        columns=(
                            Column(label="Equation"),
                            Column(label="Quantity"),
                            Column(label="Unit"),
                            Column(label="As printed", digits=4),
                            Column(label="Corrected", digits=4),
                            Column(label="Reason"),
                        ),
                        rows=[
                            (e.place, e.quantity, e.unit, e.printed, e.right, e.why) for e in errata
                        ],
                    ),
                ),
            ),
        ),
    )
