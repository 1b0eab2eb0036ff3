"""The command ``trueterrain plate``: design of calibration plates for accuracy tests."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import write_json, write_line, write_note

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from trueterrain.report import Report
    from trueterrain.verify.plate.design import PlateDesign, PlateView, ScanSetup


def plate(
    action: Literal["design"],
    /,
    *,
    cleats: Annotated[
        tuple[Literal["rectangle", "semicircle", "triangle", "edge"], ...],
        Parameter(consume_multiple=True),
    ] = ("rectangle", "semicircle", "triangle", "edge"),
    cleat_width: float = 0.076,
    rise: float = 0.038,
    edge_rise: float = 0.015,
    length: float = 1.2,
    width: float = 1.2,
    thickness: float = 0.012,
    pitch: float = 0.152,
    tolerance: float = 0.0001,
    reflectivity: Annotated[tuple[float, ...], Parameter(consume_multiple=True)] = (0.05, 0.3, 0.8),
    carried: float = 25.0,
    laser_height: float = 2.0,
    offset: float = 0.0,
    lie: Literal["along the scan", "along the lane"] = "along the scan",
    speed: float = 5.4,
    output: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None,
    json: bool = False,
    force: bool = False,
) -> None:
    """Design a calibration plate: interchangeable cleats of known profile on a grid of holes.

    A simulated scan of the plate shows shadows, faces that are too steep, the number of returns at
    each edge, and surfaces that saturate the receiver (Smith 2009, section 3.4). The machined
    profile is written as data: the reference of accuracy tests.

    Example: trueterrain plate design --offset 0.8 -o plate

    Parameters
    ----------
    action
        design: drawing, machined profile, masses, and view from the scanner.
    cleats
        Profiles from left to right: rectangle, semicircle, triangle, edge (a low bar with sharp
        edges), two holes apart.
    cleat_width
        Extent of a cleat along the profile [m].
    rise
        Height of rectangle, semicircle and triangle above the plate [m].
    edge_rise
        Height of the bar with sharp edges [m].
    length
        Extent of the plate along the profile [m].
    width
        Extent of plate and cleats across the profile [m].
    thickness
        Thickness of the plate [m].
    pitch
        Distance between holes [m].
    tolerance
        Tolerance of the machined profile, plus or minus [m].
    reflectivity
        Reflectivity of the bands of surface across the profile, from 0 to 1.
    carried
        Maximum mass of a panel [kg], so that it can be carried.
    laser_height
        Height of the laser above the ground [m].
    offset
        Offset of the centre of the plate from the laser, left positive [m].
    lie
        Direction of the profile: along the scan, as in a static test, or along the lane.
    speed
        Speed of the vehicle over a plate along the lane [m/s].
    output
        Folder for drawing.svg, drawing.pdf, profile.csv, plate.html and plate.json.
    json
        Print one JSON document: {"design", "view": {"returns", "shadows", "edges", "bands",
        "flags"}, "files"}; lengths in m, masses in kg, angles in rad.
    force
        Replace an earlier result of the same command in the folder; other files in it stay.
    """
    del action
    from dataclasses import asdict

    from trueterrain.simulate.scanner import Scanner
    from trueterrain.verify.plate.design import ScanSetup, design_plate, view_plate

    design = design_plate(
        cleats,
        cleat_width=cleat_width,
        rise=rise,
        edge_rise=edge_rise,
        length=length,
        width=width,
        thickness=thickness,
        pitch=pitch,
        tolerance=tolerance,
        bands=tuple((f"surface {n}", value) for n, value in enumerate(reflectivity, start=1)),
    )
    scanner = Scanner()
    setup = ScanSetup(
        angle=scanner.angle,
        height=laser_height,
        offset=offset,
        lie=lie,
        speed=speed,
        rate=scanner.rate,
        spot_width=scanner.spot_width,
        spot_length=scanner.spot_length,
        gain=scanner.gain,
        nominal=scanner.nominal_height,
        floor=scanner.floor,
        saturation=scanner.saturation,
    )
    view = view_plate(design, setup)
    shape = design.to_dict()
    shape["panels"] = {name: design.panels(name, carried) for name in shape["mass"]}
    document: dict[str, Any] = {
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
    if output is not None:
        document["files"] = _write_plate(output, document, design, view, setup, force=force)
    if json:
        write_json(document)
    else:
        _print_plate(design, view, shape)
    for name in document["files"]:
        write_note(f"{name}: written")


def _print_plate(design: "PlateDesign", view: "PlateView", shape: dict[str, Any]) -> None:
    along, across = design.holes()
    write_line(
        f"Plate {design.length:g} x {design.width:g} m, {1000 * design.thickness:g} mm thick, "
        f"{along.size} x {across.size} holes every {1000 * design.pitch:g} mm"
    )
    for material, mass in shape["mass"].items():
        cleats = ", ".join(f"{design.mass_of_cleat(c, material):.1f}" for c in design.cleats)
        write_line(
            f"  {material:<10} {mass:.0f} kg; plate {design.mass_of_plate(material):.0f} kg in "
            f"{shape['panels'][material]} panels; cleats {cleats} kg"
        )
    write_line("Cleats")
    for cleat in design.cleats:
        write_line(
            f"  {cleat.shape:<10} {1000 * cleat.width:g} x {1000 * cleat.rise:g} mm, centre at "
            f"{design.foot(cleat) + cleat.width / 2:.3f} m"
        )
    write_line(f"Steep faces, of {view.s.size} returns in all")
    for edge in view.edges:
        seen = f"{edge.on_face} returns" if edge.on_face or edge.seen else "not seen"
        seen += ", partly in shadow" if edge.on_face and not edge.seen else ""
        write_line(
            f"  {edge.name:<18} at {edge.s:.3f} m: {seen}; points {1000 * edge.spacing:.1f} mm "
            f"apart, {edge.blurred:.2f} across the edge"
        )
    write_line("Surfaces")
    for band in view.bands:
        write_line(
            f"  {band.name:<10} {100 * band.reflectivity:.0f} %: {band.intensity:.0f} counts, "
            f"{band.brightness}"
        )
    if view.flags:
        write_line("Flags")
        for flag in view.flags:
            write_line(f"  {flag}")


def _write_plate(
    folder: Path,
    document: dict[str, Any],
    design: "PlateDesign",
    view: "PlateView",
    setup: "ScanSetup",
    *,
    force: bool,
) -> list[str]:
    import json

    import matplotlib.pyplot as plt

    from trueterrain import figures
    from trueterrain.core import whole_folder
    from trueterrain.report import write_report
    from trueterrain.verify.plate.design import write_machined

    drawing = _plate_drawing(design)
    names = ["drawing.svg", "drawing.pdf", "profile.csv", "plate.html", "plate.json"]
    with whole_folder(folder, result="plate", force=force) as temporary:
        figures.save_figure(drawing, temporary / names[0])
        figures.save_figure(drawing, temporary / names[1])
        write_machined(design, temporary / names[2])
        write_report(
            _plate_report(design, view, setup, document["design"], drawing), temporary / names[3]
        )
        text = json.dumps(document, indent=2, allow_nan=False)
        (temporary / names[4]).write_text(text + "\n", encoding="utf-8")
    plt.close("all")
    return [str(folder / name) for name in names]


def _cleat_places(design: "PlateDesign") -> dict[str, tuple[float, float]]:
    """Start and end of each cleat [m] by name; further cleats of a shape are numbered."""
    places: dict[str, tuple[float, float]] = {}
    for cleat in design.cleats:
        same = sum(name.split()[0] == cleat.shape for name in places)
        name = f"{cleat.shape} {same + 1}" if same else cleat.shape
        places[name] = (design.foot(cleat), design.foot(cleat) + cleat.width)
    return places


def _plate_drawing(design: "PlateDesign") -> "Figure":
    import matplotlib.pyplot as plt

    from trueterrain import figures

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
    design: "PlateDesign",
    view: "PlateView",
    setup: "ScanSetup",
    shape: dict[str, Any],
    drawing: "Figure",
) -> "Report":
    import math

    from trueterrain import figures
    from trueterrain.report import Column, Number, Picture, Report, Section, Table, Text, Warnings

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
