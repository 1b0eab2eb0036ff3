"""Page of a calibration plate: drawing, machined profile, masses, view from the scanner."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trueterrain import figures
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
from trueterrain.verify.plate.design import PlateDesign, PlateView, ScanSetup, write_machined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CARRIED = 25.0  # [kg] that one person carries


def plate_numbers(
    design: PlateDesign, view: PlateView, *, carried: float = CARRIED
) -> dict[str, Any]:
    """Sizes, masses and view of a plate, ready for JSON; lengths in m, masses in kg, angles in rad.

    Parameters
    ----------
    design : PlateDesign
        The plate.
    view : PlateView
        What the scanner sees of it, from `view_plate`.
    carried : float
        Maximum mass of a panel [kg], so that it can be carried.

    Returns
    -------
    dict
        ``design``, ``view`` and an empty list of ``files``.
    """
    shape = design.to_dict()
    shape["panels"] = {name: design.panels(name, carried) for name in shape["mass"]}
    return {
        "design": shape,
        "view": {
            "returns": int(view.s.size),
            "shadows": [list(pair) for pair in view.shadows],
            "edges": [asdict(edge) for edge in view.edges],
            "bands": [asdict(band) for band in view.bands],
            "flags": list(view.flags),
        },
        "files": [],
    }


def write_plate_page(
    design: PlateDesign,
    view: PlateView,
    setup: ScanSetup,
    folder: str | Path,
    *,
    carried: float = CARRIED,
    force: bool = False,
) -> list[str]:
    """Write drawing, machined profile, report and numbers of a calibration plate into a folder.

    Parameters
    ----------
    design : PlateDesign
        The plate.
    view : PlateView
        What the scanner sees of it, from `view_plate`.
    setup : ScanSetup
        Position of plate and scanner, from which it is seen.
    folder : str or Path
        Existing folder.
    carried : float
        Maximum mass of a panel [kg], so that it can be carried.
    force : bool
        Replace files that are there already.

    Returns
    -------
    list of str
        Names of the files: drawing.svg, drawing.pdf, profile.csv, plate.html and plate.json.

    Raises
    ------
    OutputError
        If a file exists and `force` is false, or the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.verify.plate.design import design_plate, view_plate
    >>> design, setup = design_plate(("triangle", "edge")), ScanSetup(offset=0.8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_plate_page(design, view_plate(design, setup), setup, folder)
    ['drawing.svg', 'drawing.pdf', 'profile.csv', 'plate.html', 'plate.json']
    """
    import matplotlib.pyplot as plt

    folder = Path(folder)
    numbers = plate_numbers(design, view, carried=carried)
    drawing = _plate_drawing(design)
    figures.save_figure(drawing, folder / "drawing.svg", force=force)
    figures.save_figure(drawing, folder / "drawing.pdf", force=force)
    write_machined(design, folder / "profile.csv", force=force)
    report = _plate_report(design, view, setup, numbers["design"], drawing)
    write_report(report, folder / "plate.html", force=force)
    write_json_file(numbers, folder / "plate.json", force=force)
    plt.close("all")
    return ["drawing.svg", "drawing.pdf", "profile.csv", "plate.html", "plate.json"]


def _cleat_places(design: PlateDesign) -> dict[str, tuple[float, float]]:
    """Start and end of each cleat [m] by name; further cleats of a shape are numbered."""
    places: dict[str, tuple[float, float]] = {}
    for cleat in design.cleats:
        same = sum(name.split()[0] == cleat.shape for name in places)
        name = f"{cleat.shape} {same + 1}" if same else cleat.shape
        places[name] = (design.foot(cleat), design.foot(cleat) + cleat.width)
    return places


def _plate_drawing(design: PlateDesign) -> "Figure":
    import matplotlib.pyplot as plt

    s, height = design.vertices()
    cleats = _cleat_places(design)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(8.0, 9.5), layout="constrained", height_ratios=(3.2, 1.0)
    )
    figures.plate_plan(
        cleats,
        length=design.length,
        width=design.width,
        holes=design.holes(),
        bands=design.bands,
        ax=above,
    )
    figures.plate_section(s, height, thickness=design.thickness, cleats=cleats, ax=below)
    drawing: Figure = figure
    return drawing


def _plate_report(
    design: PlateDesign,
    view: PlateView,
    setup: ScanSetup,
    shape: dict[str, Any],
    drawing: "Figure",
) -> Report:
    s, height = design.vertices()
    seen = figures.plate_view(s, height, returns=(view.s, view.height), shadows=view.shadows)
    slope = figures.measurable_slope(setup.height, max(2.0, abs(setup.offset) + design.length / 2))
    weights = [
        (
            material,
            mass,
            design.mass_of_plate(material),
            shape["panels"][material],
            max(design.mass_of_cleat(cleat, material) for cleat in design.cleats),
        )
        for material, mass in shape["mass"].items()
    ]
    edges = [
        (
            edge.name,
            1000 * edge.s,
            1000 * edge.rise,
            "yes" if edge.seen else "no",
            edge.on_face,
            1000 * edge.spacing,
            edge.blurred,
            math.degrees(min(edge.limit, math.pi / 2)),
        )
        for edge in view.edges
    ]
    return Report(
        title="Calibration plate",
        subtitle=f"{len(design.cleats)} cleats {setup.lie}, laser {setup.height:g} m above the "
        f"ground, lateral offset of the plate {setup.offset:g} m",
        headline=(
            Number(label="Length", value=design.length, unit="m", digits=2),
            Number(label="Width", value=design.width, unit="m", digits=2),
            Number(label="Aluminium", value=shape["mass"]["aluminium"], unit="kg", digits=0),
            Number(label="Steel", value=shape["mass"]["steel"], unit="kg", digits=0),
            Number(label="Tolerance", value=1000 * design.tolerance, unit="mm", digits=2),
            Number(label="Returns", value=int(view.s.size)),
        ),
        sections=(
            Section(
                title="Drawing",
                blocks=(
                    Picture(figure=drawing, alt="Dimensioned plan and section of the plate"),
                    Table(
                        columns=(
                            Column(label="Material"),
                            Column(label="Whole", unit="kg", digits=0),
                            Column(label="Plate", unit="kg", digits=0),
                            Column(label="Panels"),
                            Column(label="Heaviest cleat", unit="kg", digits=1),
                        ),
                        rows=weights,
                        caption="Masses of plate and cleats.",
                    ),
                    Text(
                        paragraph="The profile is linear between the rows of profile.csv: s and "
                        "height in metres, and the standard uncertainty from the tolerance."
                    ),
                ),
            ),
            Section(
                title="View from the scanner",
                blocks=(
                    Warnings(items=view.flags),
                    Picture(figure=seen, alt="Returns on the profile, and shadows"),
                    Table(
                        columns=(
                            Column(label="Steep face"),
                            Column(label="Place", unit="mm", digits=0),
                            Column(label="Height", unit="mm", digits=0),
                            Column(label="Fully in view"),
                            Column(label="Returns on it"),
                            Column(label="Points apart", unit="mm", digits=1),
                            Column(label="Returns across the edge", digits=2),
                            Column(label="Steepest visible slope", unit="deg", digits=1),
                        ),
                        rows=edges,
                        caption="The spot of a return across an edge averages both sides.",
                    ),
                    Picture(
                        figure=slope, alt="Steepest visible face over the offset from the scanner"
                    ),
                    Table(
                        columns=(
                            Column(label="Surface"),
                            Column(label="Reflectivity", unit="%", digits=0),
                            Column(label="Intensity", unit="counts", digits=0),
                            Column(label="Returns"),
                        ),
                        rows=[
                            (b.name, 100 * b.reflectivity, b.intensity, b.brightness)
                            for b in view.bands
                        ],
                    ),
                ),
            ),
        ),
    )
