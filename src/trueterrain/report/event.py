"""Page of an excitation event: drawing, cut list, driving instruction, predicted motion."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trueterrain import figures
from trueterrain.report import (
    Column,
    Number,
    Picture,
    Report,
    Section,
    Table,
    Text,
    Warnings,
    write_report,
)
from trueterrain.vehicle import FullCarParameters
from trueterrain.verify.event.design import (
    EventDesign,
    EventPiece,
    EventResponse,
    event_errata,
    event_spectrum,
    passage_gain,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_KMH, _MPH, _INCH = 3.6, 2.236936, 0.0254  # per m/s, per m/s, m
_SAWN = 0.0015  # [m] tolerance of lumber
_PAPER = (8.27, 11.69)  # [inches] A4


def write_event_page(
    folder: Path,
    design: EventDesign,
    pieces: tuple[EventPiece, ...],
    moved: EventResponse,
    car: FullCarParameters,
    words: dict[str, list[str]],
) -> list[str]:
    """Write the drawing (SVG), the page to print (PDF) and the report (HTML) into a folder.

    Parameters
    ----------
    folder : Path
        Existing folder.
    design : EventDesign
        The event.
    pieces : tuple of EventPiece
        Its cut list.
    moved : EventResponse
        Predicted motion.
    car : FullCarParameters
        Vehicle of the prediction.
    words : dict of str to list of str
        Sentences under ``driving``, ``excited``, ``models`` and ``flags``.

    Returns
    -------
    list of str
        Names of the files.
    """
    import matplotlib.pyplot as plt

    drawing = _event_drawing(design, pieces)
    figures.save_figure(drawing, folder / "drawing.svg")
    page = _print_page(design, pieces, moved, words)
    figures.save_figure(page, folder / "event.pdf")
    report = _event_report(design, pieces, moved, car, words, drawing)
    write_report(report, folder / "event.html")
    plt.close("all")
    return ["drawing.svg", "event.pdf", "event.html"]


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


def _event_drawing(design: EventDesign, pieces: tuple[EventPiece, ...]) -> "Figure":
    import matplotlib.pyplot as plt

    figure: Figure
    figure, axes = plt.subplots(
        2, 1, figsize=(8, 6.4), layout="constrained", height_ratios=(2.2, 1.0)
    )
    _draw_event(design, pieces, *axes)
    return figure


def _draw_event(
    design: EventDesign, pieces: tuple[EventPiece, ...], above: Any, below: Any
) -> None:
    shape = design.to_dict()
    whole = pieces[0].length * (1 if design.placement == "across" else 2)
    figures.event_plan(shape, across=whole, track=design.inputs.track, ax=above)
    figures.event_side(shape, ax=below)


def _print_page(
    design: EventDesign,
    pieces: tuple[EventPiece, ...],
    moved: EventResponse,
    words: dict[str, list[str]],
) -> "Figure":
    import matplotlib.pyplot as plt

    figure: Any = plt.figure(figsize=_PAPER, layout="constrained")
    figure.get_layout_engine().set(rect=(0.03, 0.02, 0.94, 0.96))
    grid = figure.add_gridspec(4, 1, height_ratios=(2.8, 1.0, 1.2, 2.2))
    above, below, motion, text = (figure.add_subplot(grid[row]) for row in range(4))
    _draw_event(design, pieces, above, below)
    figures.laser_displacement({"time": moved.time, "up": moved.laser}, ax=motion)
    text.axis("off")
    lines = []
    for title, sentences in (
        ("Cut list", [piece_text(piece, design.spacing) for piece in pieces]),
        ("Driving", words["driving"]),
        ("What is excited", [*words["excited"], *words["flags"]]),
    ):
        lines.append(title.upper())
        for sentence in sentences:
            lines += textwrap.wrap(sentence, 122, initial_indent="- ", subsequent_indent="  ")
        lines.append("")
    written = text.text(0, 1, "\n".join(lines), va="top", fontsize=7.5, linespacing=1.35)
    figures.draw_names([written, figure.suptitle(_event_title(design), fontsize="large")])
    page: Figure = figure
    return page


def _event_title(design: EventDesign) -> str:
    return (
        f"Excitation event for {design.target} at {design.ride_met:.2f} Hz "
        f"and wheel hop at {design.hop_met:.1f} Hz"
    )


def _event_report(
    design: EventDesign,
    pieces: tuple[EventPiece, ...],
    moved: EventResponse,
    car: FullCarParameters,
    words: dict[str, list[str]],
    drawing: "Figure",
) -> Report:
    frequency = np.geomspace(0.3, 30.0, 600)
    gains = passage_gain(car, frequency, design.speed)
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
    laser = figures.laser_displacement({"time": moved.time, "up": moved.laser})
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
            Number(label="Laser, peak to peak", value=1000 * moved.laser_span, unit="mm", digits=0),
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
                blocks=tuple(Text(paragraph=piece_text(piece, design.spacing)) for piece in pieces),
            ),
            Section(title="Driving", blocks=tuple(Text(paragraph=w) for w in words["driving"])),
            Section(
                title="What is excited",
                blocks=(
                    *(Text(paragraph=sentence) for sentence in words["excited"]),
                    Warnings(items=words["flags"]),
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
                        rows=[(name, 100 * fraction) for name, fraction in moved.energy.items()],
                    ),
                ),
            ),
            Section(
                title="Two oscillators",
                blocks=(
                    *(Text(paragraph=sentence) for sentence in words["models"]),
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
