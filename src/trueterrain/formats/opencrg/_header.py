"""Read the header of an OpenCRG file, and list its problems.

Sections are parsed as by the ASAM C-API: a line that begins with ``$`` ends the open section; it
begins a new one only if none is open. So a section that is not ended hides the next one.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Literal

from trueterrain.core.errors import FormatError

NumberFormat = Literal["KRBI", "KDBI", "LRFI", "LDFI"]

#: Bytes per number, and numbers per record of 80 bytes.
NUMBER_FORMATS: dict[NumberFormat, tuple[int, int]] = {
    "KRBI": (4, 20),
    "KDBI": (8, 10),
    "LRFI": (10, 8),
    "LDFI": (20, 4),
}

_KEYWORDS = (
    "ROAD_CRG_MODS",
    "ROAD_CRG_OPTS",
    "ROAD_CRG_FILE",
    "ROAD_CRG_MPRO",
    "ROAD_CRG",
    "CT",
    "KD_DEFINITION",
)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_CHANNELS = {
    "reference line phi": ("phi", "rad"),
    "reference line slope": ("slope", "m/m"),
    "reference line banking": ("banking", "m/m"),
}
_LONGEST_LINE = 72  # [characters]
_LONGEST_TEXT = 4096  # [bytes] a longer line is no line of a header
_MAX_STATIONS = 1e9  # a larger count is damage
#: Cure in messages about a line that is missing from the header.
LOST = "Export the file again, or restore the line in the header."


@dataclass
class CrgHeader:
    """Contents of the header of an OpenCRG file."""

    path: Path
    data_offset: int = 0  # [bytes] position of the first number
    number_format: NumberFormat | None = None
    comment: list[str] = field(default_factory=list)
    road: dict[str, float] = field(default_factory=dict)
    options: dict[str, float | str] | None = None
    modifiers: dict[str, float | str] | None = None
    reference: str | None = None
    channels: list[str] = field(default_factory=list)  # phi, slope, banking, section or other
    sections: list[tuple[str, float]] = field(default_factory=list)  # ("at v", v) or ("number", n)
    line_ends: str = "LF"
    problems: list[str] = field(default_factory=list)

    @property
    def start(self) -> float:
        """First station [m]."""
        return self.road.get("reference_line_start_u", 0.0)

    @property
    def increment(self) -> float:
        """Spacing of the stations [m]."""
        return self.road["reference_line_increment"]

    @property
    def is_binary(self) -> bool:
        """Whether the numbers are binary, not text."""
        return self.number_format in ("KRBI", "KDBI")


def read_header(path: Path) -> CrgHeader:
    """Read the header of an OpenCRG file, with all checks that need no data."""
    header = CrgHeader(path)
    with path.open("rb") as stream:
        _require_signature(stream, path)
        _parse_header(stream, header)
    if header.reference is not None:
        raise FormatError(
            f"holds no grid, it only refers to {header.reference}",
            path=path,
            place="section $ROAD_CRG_FILE",
            cure="Name that file itself.",
        )
    if header.number_format is None:
        raise FormatError(
            "no line #: names the format of the numbers (KRBI, KDBI, LRFI or LDFI)",
            path=path,
            place="section $KD_DEFINITION",
            cure=LOST,
        )
    _require_road(header)
    return header


def station_count(header: CrgHeader) -> int | None:
    """Number of cross-sections by the header; None if it does not state it."""
    end = header.road.get("reference_line_end_u")
    if end is None:
        if not header.is_binary:
            return None
        raise FormatError(
            "REFERENCE_LINE_END_U is missing, so it is unknown whether the data are complete",
            path=header.path,
            place="section $ROAD_CRG",
            cure=LOST,
        )
    steps = (end - header.start) / header.increment
    if not (0.5 < steps < _MAX_STATIONS and abs(steps - round(steps)) < 0.01):
        raise FormatError(
            f"REFERENCE_LINE_END_U ({end:g} m) must lie a whole number of increments "
            f"({header.increment:g} m) beyond the start ({header.start:g} m)",
            path=header.path,
            place="section $ROAD_CRG",
            cure="Correct the header, or export the file again.",
        )
    return round(steps) + 1


def _require_signature(stream: BinaryIO, path: Path) -> None:
    begin = stream.read(64)
    stream.seek(0)
    if begin.lstrip()[:1] == b"$":
        return
    if not begin:
        found = "it is empty"
    elif begin.startswith(b"LASF"):
        found = "it is a LAS or LAZ point cloud"
    else:
        found = f"it begins with {begin[:12]!r}"
    raise FormatError(
        f"is not an OpenCRG file: it must begin with $CT, but {found}",
        path=path,
        place="line 1",
        cure="See with `trueterrain info` what the file is.",
    )


def _parse_header(stream: BinaryIO, header: CrgHeader) -> None:
    section = ""
    crlf = 0
    reference: list[str] = []
    seen: set[tuple[str, str]] = set()
    long_lines: list[int] = []
    number = 0
    while raw := stream.readline(_LONGEST_TEXT):
        number += 1
        crlf += raw.endswith(b"\r\n")
        if len(raw) == _LONGEST_TEXT:
            break
        line = _decode_line(raw)
        if len(line.partition("!")[0].rstrip()) > _LONGEST_LINE and section not in ("", "CT"):
            long_lines.append(number)
        keyword = _section_keyword(line) if _ends_or_begins(line, section) else None
        if keyword is not None:
            if section and keyword:
                raise FormatError(
                    f"section ${section} is not ended by a line with a single $, so {line.strip()} "
                    "is lost",
                    path=header.path,
                    place=f"line {number}",
                    cure="Add the line.",
                )
            if keyword == "$":
                _complete_header(header, stream.tell(), number, crlf, long_lines)
                return
            if keyword and not seen and keyword != "CT":
                header.problems.append(f"must begin with section $CT, but begins with ${keyword}")
            section = "" if section else keyword
            seen.add((section, ""))
            _begin_section(header, section)
        elif section:
            _parse_line(header, section, line, number, reference, seen)
    if reference:
        header.reference = "".join(reference)
        return
    raise FormatError(
        "the header has no end: a line of $$$$ must stand before the numbers",
        path=header.path,
        place=f"line {number}",
        cure="The file is cut off or no OpenCRG file: copy or export it again.",
    )


def _complete_header(
    header: CrgHeader,
    offset: int,
    lines: int,
    crlf: int,
    long_lines: list[int],
) -> None:
    header.data_offset = offset
    header.line_ends = {0: "LF", lines: "CRLF"}.get(crlf, "mixed")
    if header.line_ends == "mixed":
        header.problems.append(f"{crlf} of {lines} header lines end with CRLF, the others with LF")
    if long_lines:
        header.problems.append(
            f"{len(long_lines)} header lines are longer than {_LONGEST_LINE} characters, of which "
            f"programs may ignore the rest; line {long_lines[0]} is the first"
        )


def _decode_line(raw: bytes) -> str:
    try:
        return raw.decode("utf-8").rstrip("\r\n")
    except UnicodeDecodeError:
        return raw.decode("latin-1").rstrip("\r\n")


def _ends_or_begins(line: str, section: str) -> bool:
    # a file reference may begin with an environment variable, free text with any character
    return line.startswith("$") if section in ("CT", "ROAD_CRG_FILE") else line.lstrip()[:1] == "$"


def _section_keyword(line: str) -> str:
    """Keyword of a line that begins with $: "$" before the data, "" if it names no section."""
    upper = line.strip().upper()
    if upper.startswith("$$$$"):
        return "$"
    return next((name for name in _KEYWORDS if upper.startswith(f"${name}")), "")


def _begin_section(header: CrgHeader, section: str) -> None:
    if section == "ROAD_CRG_OPTS":
        header.options = {}
    elif section == "ROAD_CRG_MODS":
        header.modifiers = {}


def _parse_line(
    header: CrgHeader,
    section: str,
    line: str,
    number: int,
    reference: list[str],
    seen: set[tuple[str, str]],
) -> None:
    if section == "CT":
        header.comment.append(line)
        return
    text = line.partition("!")[0].strip()
    if not text or text.startswith("*"):
        return
    if section == "ROAD_CRG_FILE":
        reference.append(text.split(" ", 1)[0])
    elif section == "KD_DEFINITION":
        _parse_channel(header, text, number)
    elif section in ("ROAD_CRG", "ROAD_CRG_OPTS", "ROAD_CRG_MODS"):
        _parse_parameter(header, section, text, number, seen)


def _parse_parameter(
    header: CrgHeader, section: str, text: str, number: int, seen: set[tuple[str, str]]
) -> None:
    name, equals, value = (part.strip() for part in text.partition("="))
    name = name.lower()
    match = _NUMBER.match(value)
    if not equals or not name:
        header.problems.append(f"line {number} of section ${section} is not `name = value`")
        return
    if (section, name) in seen:
        header.problems.append(f"{name} stands twice in section ${section}")
    seen.add((section, name))
    if section == "ROAD_CRG":
        if match is None:
            raise FormatError(
                f"{name} must be a number, got {value!r}",
                path=header.path,
                place=f"line {number}",
                cure="Correct the line.",
            )
        header.road[name] = float(match.group())
        return
    target = header.options if section == "ROAD_CRG_OPTS" else header.modifiers
    if target is not None:
        target[name] = value if match is None else float(match.group())


def _parse_channel(header: CrgHeader, text: str, number: int) -> None:
    if text.startswith("#:"):
        name = text[2:6].upper()
        if name not in NUMBER_FORMATS:
            raise FormatError(
                f"the format of the numbers must be KRBI, KDBI, LRFI or LDFI, got {name!r}",
                path=header.path,
                place=f"line {number}",
                cure="Export the file again in one of these formats.",
            )
        header.number_format = name
        return
    if text[:2].upper() == "U:":
        _compare_virtual_channel(header, text)
        return
    if text[:2].upper() != "D:":
        return
    name, _, unit = (part.strip() for part in text[2:].partition(","))
    name = " ".join(name.lower().split())
    kind, expected = _CHANNELS.get(
        name, ("section" if name.startswith("long section") else "", "m")
    )
    if kind and unit.lower() != expected:
        raise FormatError(
            f"{name} must be in {expected}, got {unit!r}",
            path=header.path,
            place=f"line {number}",
            cure="Export the file again in metres and radians.",
        )
    if kind == "section":
        header.sections.append(_parse_section(header, name, number))
    elif not kind:
        header.problems.append(f"channel {name!r} is unknown and not read")
    header.channels.append(kind or "other")


def _parse_section(header: CrgHeader, name: str, number: int) -> tuple[str, float]:
    text = name.removeprefix("long section").strip()
    position = re.fullmatch(r"at v\s*=\s*(.+)", text)
    match = _NUMBER.fullmatch(position.group(1) if position else text)
    if match is None:
        raise FormatError(
            f"must read `long section N` or `long section at v = X`, got {name!r}",
            path=header.path,
            place=f"line {number}",
            cure="Correct the line.",
        )
    return "at v" if position else "number", float(match.group())


def _compare_virtual_channel(header: CrgHeader, text: str) -> None:
    fields = [part.strip() for part in text[2:].split(",")]
    if fields[0].lower() != "reference line u" or len(fields) < 4:
        return
    for value, key in zip(
        fields[2:4], ("reference_line_start_u", "reference_line_increment"), strict=True
    ):
        match = _NUMBER.match(value)
        stated = header.road.get(key)
        if match and stated is not None and abs(float(match.group()) - stated) > 1e-3:
            header.problems.append(
                f"channel U: says {float(match.group()):g} m where {key} is {stated:g} m"
            )


def _require_road(header: CrgHeader) -> None:
    increment = header.road.get("reference_line_increment")
    if increment is None or not increment > 0:
        problem = "is missing" if increment is None else f"must be greater than 0, got {increment}"
        raise FormatError(
            f"REFERENCE_LINE_INCREMENT {problem}",
            path=header.path,
            place="section $ROAD_CRG",
            cure=LOST,
        )
    for end in ("start", "end"):
        x, y = (f"reference_line_{end}_{axis}" for axis in "xy")
        if (x in header.road) != (y in header.road):
            present, absent = (x, y) if x in header.road else (y, x)
            raise FormatError(
                f"{present.upper()} stands without {absent.upper()}",
                path=header.path,
                place="section $ROAD_CRG",
                cure=LOST,
            )
    if "reference_line_end_x" in header.road and "reference_line_start_x" not in header.road:
        raise FormatError(
            "REFERENCE_LINE_END_X stands without REFERENCE_LINE_START_X",
            path=header.path,
            place="section $ROAD_CRG",
            cure=LOST,
        )
