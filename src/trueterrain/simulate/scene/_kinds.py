"""Kinds of grounds, courses and speeds, by their names in TOML."""

import difflib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from trueterrain.core.errors import FormatError, TrueTerrainError
from trueterrain.formats.settings import parse_settings, settings_template
from trueterrain.simulate.course import Arc, Oval, Straight, Stretches, Waypoints
from trueterrain.simulate.ground import (
    BelgianBlock,
    Cleats,
    Cracks,
    ExcitationEvent,
    Plane,
    Repeated,
    Road,
    Sine,
    Step,
    Stone,
    Stones,
)
from trueterrain.simulate.scene._plate import CalibrationPlate
from trueterrain.simulate.speed import Constant, Ramp, StopAndGo
from trueterrain.vehicle import GOLDEN_QUARTER_CAR, named_vehicle

Table = Mapping[str, Any]

GROUNDS: dict[str, type] = {
    "plane": Plane,
    "sine": Sine,
    "step": Step,
    "cleats": Cleats,
    "event": ExcitationEvent,
    "plate": CalibrationPlate,
    "belgian-block": BelgianBlock,
    "road": Road,
    "stone": Stone,
    "stones": Stones,
    "cracks": Cracks,
}

COURSES: dict[str, type] = {
    "straight": Straight,
    "arc": Arc,
    "oval": Oval,
    "stretches": Stretches,
    "waypoints": Waypoints,
}

SPEEDS: dict[str, type] = {"constant": Constant, "ramp": Ramp, "stop-and-go": StopAndGo}

#: Kind of a measured surface, which is read from its file.
MEASURED = "crg"


@dataclass(frozen=True, kw_only=True)
class MeasuredFile:
    """Measured surface from an OpenCRG file, repeated periodically."""

    file: str
    "OpenCRG file, relative to the folder of the scene."

    mirrored: bool = True
    "Whether every other copy is reversed, so that there is no step between them."

    across: bool = False
    "Whether it is repeated laterally too, mirrored; otherwise there is no ground beyond it."

    part_u: tuple[float, float] | None = None
    "Range of stations to use [m]; all by default."

    part_v: tuple[float, float] | None = None
    "Range of offsets to use, for example without ragged edges [m]; all by default."


def build_kind(kinds: Mapping[str, type], table: Table, place: str, *, path: Path | None) -> Any:
    """Instance of the class that a table with a key ``kind`` describes.

    Parameters
    ----------
    kinds : mapping
        Classes by name.
    table : mapping
        ``kind`` and the parameters of the class.
    place : str
        Position of the table in the file, for messages.
    path : Path, optional
        File of the scene, for messages; paths of CRG files are relative to its folder.

    Returns
    -------
    object
        Instance of the class.

    Raises
    ------
    FormatError
        If the kind is unknown, or a parameter is unknown, missing or breaks a rule.

    Examples
    --------
    >>> build_kind(SPEEDS, {"kind": "constant", "speed": 5.0}, "speed", path=None)
    Constant(speed=5.0)
    """
    values = dict(table)
    kind = values.pop("kind", None)
    known = [*kinds, MEASURED] if kinds is GROUNDS else list(kinds)
    if kind not in known:
        near = difflib.get_close_matches(str(kind), known, n=1) if kind is not None else []
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        problem = "kind is missing" if kind is None else f"kind {kind!r} is unknown"
        raise FormatError(f"{problem} ({hint})", path=path, place=place)
    try:
        if kind == MEASURED:
            return _measured_ground(parse_settings(MeasuredFile, values), path)
        return parse_settings(kinds[kind], values)
    except (TrueTerrainError, ValueError) as error:
        problem = error.problem if isinstance(error, FormatError) else str(error)
        raise FormatError(problem, path=path, place=place) from None


def kind_catalogue() -> str:
    """All kinds with their parameters, as comments for a template.

    Returns
    -------
    str
        Lines that start with ``#``.
    """
    lines = []
    for what, kinds in {
        "[course]": COURSES,
        "[[ground]] (the heights of several are added)": {**GROUNDS, MEASURED: MeasuredFile},
        "speed of a pass": SPEEDS,
    }.items():
        lines += ["", f"Kinds for {what}", ""]
        for name, kind in kinds.items():
            lines += [f'kind = "{name}"', *settings_template(kind).splitlines(), ""]
    for what, car in {
        'full cars, here "van"': named_vehicle("van"),
        '"quarter car"': GOLDEN_QUARTER_CAR,
    }.items():
        lines += ["", f"Parameters for [vehicle.parameters] of {what}", ""]
        lines += settings_template(car).splitlines()
    return "\n".join(f"# {line}".rstrip() for line in lines) + "\n"


def _measured_ground(settings: MeasuredFile, path: Path | None) -> Repeated:
    file = (Path() if path is None else path.parent) / settings.file
    options = asdict(settings)
    del options["file"]
    try:
        return Repeated.from_file(file, **options)
    except OSError as error:
        message = f"{file}: {error.strerror}"
        raise ValueError(message) from None
    except TrueTerrainError as error:
        raise ValueError(str(error)) from None
