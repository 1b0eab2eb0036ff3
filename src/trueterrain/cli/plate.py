"""The command ``trueterrain plate``: design of calibration plates for accuracy tests."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import write_json, write_line, write_note

if TYPE_CHECKING:
    from trueterrain.verify.plate.design import PlateDesign, PlateView


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
    from trueterrain.core import whole_folder
    from trueterrain.report.plate import plate_numbers, write_plate_page
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
    numbers, files = plate_numbers(design, view, carried=carried), []
    if output is not None:
        with whole_folder(output, result="plate", force=force) as folder:
            names = write_plate_page(design, view, setup, folder, carried=carried)
        files = [str(output / name) for name in names]
    if json:
        write_json(numbers | {"files": files})
    else:
        _print_plate(design, view, numbers["design"])
    for name in files:
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
