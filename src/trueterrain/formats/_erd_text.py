"""Parse ERD text: its header and its numbers, checked against each other."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import FormatError

#: Units of length in ERD [m].
UNITS = {"m": 1.0, "mm": 0.001, "in": 0.0254, "ft": 0.3048}

SIGNATURE = "ERDFILEV"
TEXT = 5  # KEYNUM of files whose numbers are text
COLUMNS = 8  # width of keys, of short names and of units


@dataclass(frozen=True, kw_only=True)
class ErdHeader:
    """Contents of the header of an ERD file, in metres."""

    channels: int
    samples: int
    step: float  # [m]
    start: float  # [m]
    x_units: str
    units: list[str]
    names: list[str]
    keys: list[tuple[str, str]]
    data_line: int  # index of the first line after END, from 0
    problems: list[str]


def load_erd(path: Path) -> tuple[ErdHeader, npt.NDArray[np.float64]]:
    """Read the header, and the numbers, shape (sample, channel), in the units of the file."""
    lines = _read_lines(path)
    header = _parse_header(lines, path)
    expected = header.samples * header.channels
    values = _parse_numbers(lines, header.data_line, path)
    if values.size < expected:
        raise FormatError(
            f"ends after {values.size} of {expected} numbers ({header.samples} samples of "
            f"{header.channels} channels are announced in line 2)",
            path=path,
            place=f"line {len(lines)}",
            cure="The file is cut off: copy or export it again.",
        )
    if values.size > expected:
        raise FormatError(
            f"must announce the numbers that follow, but announces {expected} (samples x channels) "
            f"and {values.size} follow",
            path=path,
            place="line 2",
            cure="Correct the counts of channels and samples, or export the file again.",
        )
    return header, values.reshape(header.samples, header.channels)


def _read_lines(path: Path) -> list[str]:
    content = path.read_bytes()
    if not content.startswith(SIGNATURE.encode()):
        found = "is empty" if not content else f"begins with {content[:12]!r}"
        raise FormatError(
            f"is not an ERD file: it must begin with {SIGNATURE}2.00, but {found}",
            path=path,
            place="line 1",
            cure="See with `trueterrain info` what the file is.",
        )
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    text = text.rstrip("\x1a\0 \r\n")  # DOS editors end files with 0x1a
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _parse_header(lines: list[str], path: Path) -> ErdHeader:
    channels, samples, step = _parse_storage(lines, path)
    end = next((i for i, line in enumerate(lines) if i > 1 and _line_key(line) == "END"), None)
    if end is None:
        raise FormatError(
            "has no line END that ends the header",
            path=path,
            place=f"line {len(lines)}",
            cure="The file is cut off or damaged: export it again.",
        )
    keys = [(_line_key(line), line[COLUMNS:].rstrip()) for line in lines[2:end]]
    values = dict(keys)
    problems: list[str] = []
    x_units = values.get("XUNITS", "").strip().lower()
    if x_units not in ("m", "ft"):
        raise FormatError(
            f"must say m or ft, got {x_units!r}",
            path=path,
            place="key XUNITS",
            cure="Add a line 'XUNITS  m' or 'XUNITS  ft' before END.",
        )
    units = [unit.lower() for unit in _split_fields(values.get("UNITSNAM", ""), channels)]
    if "" in units:
        raise FormatError(
            f"must name the unit of each of the {channels} channels in 8 columns",
            path=path,
            place="key UNITSNAM",
            cure="Add a line such as 'UNITSNAM' + 'mm      ' per channel before END.",
        )
    return ErdHeader(
        channels=channels,
        samples=samples,
        step=step * UNITS[x_units],
        start=_start_station(values, path) * UNITS[x_units],
        x_units=x_units,
        units=units,
        names=_track_names(values, channels, problems),
        keys=keys,
        data_line=end + 1,
        problems=problems,
    )


def _parse_storage(lines: list[str], path: Path) -> tuple[int, int, float]:
    line = lines[1] if len(lines) > 1 else ""
    fields = [field.strip() for field in (line.split(",") if "," in line else line.split())]
    try:
        channels, samples, keynum = int(fields[0]), int(fields[1]), int(fields[4])
        step = float(_fortran_exponents(fields[5]))
    except (IndexError, ValueError):
        raise FormatError(
            f"must hold channels, samples, two integers, KEYNUM, step, got {line.strip()!r}",
            path=path,
            place="line 2",
            cure="Export the file again.",
        ) from None
    if keynum != TEXT:
        raise FormatError(
            f"KEYNUM must be {TEXT} (numbers as text in the same file), got {keynum}",
            path=path,
            place="line 2",
            cure="Export the profile as ERD text.",
        )
    if channels < 1 or samples < 1 or not (step > 0 and np.isfinite(step)):
        raise FormatError(
            "channels, samples and step must be greater than 0, "
            f"got {channels}, {samples} and {step:g}",
            path=path,
            place="line 2",
            cure="Export the file again.",
        )
    return channels, samples, step


def _line_key(line: str) -> str:
    return line[:COLUMNS].strip().upper()


def _start_station(values: dict[str, str], path: Path) -> float:
    text = values.get("XSTART", "0").strip()
    try:
        start = float(_fortran_exponents(text))
    except ValueError:
        start = np.nan
    if not np.isfinite(start):
        raise FormatError(
            f"must be a number, got {text!r}",
            path=path,
            place="key XSTART",
            cure="Correct the station of the first sample, or remove the line.",
        )
    return start


def _track_names(values: dict[str, str], channels: int, problems: list[str]) -> list[str]:
    names = _split_fields(values.get("SHORTNAM", ""), channels)
    if "TRACKS" in values:
        whole = [name.strip() for name in values["TRACKS"].split(";")]
        names = whole if len(whole) == channels else names
    if "" in names:
        problems.append("SHORTNAM does not name every channel: numbered instead")
    unique: list[str] = []
    for number, given in enumerate(names, start=1):
        name = given or f"track {number}"
        if name in unique:
            problems.append(f"two channels are named {name!r}: the later one is numbered")
            name = f"{name} {number}"
        unique.append(name)
    return unique


def _split_fields(value: str, count: int) -> list[str]:
    return [value[i * COLUMNS : (i + 1) * COLUMNS].strip() for i in range(count)]


def _parse_numbers(lines: list[str], first: int, path: Path) -> npt.NDArray[np.float64]:
    text = "\n".join(lines[first:])
    try:
        return np.array(text.split(), dtype=np.float64)
    except ValueError:
        pass
    numbers: list[float] = []
    for number, line in enumerate(lines[first:], start=first + 1):
        for word in line.split():
            try:
                numbers.append(float(_fortran_exponents(word)))
            except ValueError:
                raise FormatError(
                    f"must hold numbers, got {word!r}",
                    path=path,
                    place=f"line {number}",
                    cure="Correct the line, or export the file again.",
                ) from None
    return np.array(numbers)


def _fortran_exponents(word: str) -> str:
    """Text with exponents of Fortran, 1.0D-03, written as 1.0e-03."""
    return re.sub(r"(?<=[\d.])[dD](?=[-+\d])", "e", word)
