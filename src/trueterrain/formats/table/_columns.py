"""Meaning of the columns of a table: names, units and tracks."""

import difflib
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy.typing as npt

from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import COORDINATES, EXTRA, RETURN_ATTRIBUTES

_ANGLES = {"rad": 1.0, "deg": math.pi / 180}
_LENGTHS = {
    "m": 1.0,
    "metre": 1.0,
    "metres": 1.0,
    "meter": 1.0,
    "meters": 1.0,
    "mm": 0.001,
    "millimetre": 0.001,
    "millimetres": 0.001,
    "millimeter": 0.001,
    "millimeters": 0.001,
    "cm": 0.01,
    "km": 1000.0,
    "in": 0.0254,
    "inch": 0.0254,
    "inches": 0.0254,
    "mil": 2.54e-5,
    "mils": 2.54e-5,
    "ft": 0.3048,
    "foot": 0.3048,
    "feet": 0.3048,
    "usft": 1200 / 3937,
    "us-ft": 1200 / 3937,
}
_UNITS = {
    **dict.fromkeys(("s", "easting", "northing", "up", "height", "sd", "sd_relative"), _LENGTHS),
    "heading": _ANGLES,
    "scan_angle": _ANGLES,
    "time": {"s": 1.0},
}
_NAMES = (*_UNITS, "intensity", "lane", "count", "track")
_ALIASES = {
    "station": "s",
    "distance": "s",
    "chainage": "s",
    "x": "easting",
    "y": "northing",
    "z": "up",
    "elevation": "up",
    "altitude": "up",
}
_PER_TRACK = ("height", "easting", "northing", "heading", "sd", "count")

# names of tracks that are accepted as names of columns, and words that may accompany them
_TRACK = re.compile(
    r"left|right|cent(er|re)|middle|[lrc]|[lrc]wp|[lrc]elev\.?|(track|line|laser|sensor)\d+"
)
_FILLING = ("height", "elevation", "elev", "z", "profile", "wheel", "path", "wheelpath", "wp")

_KEPT = {
    "points": (
        *COORDINATES,
        "time",
        "intensity",
        "lane",
        "sd",
        "sd_relative",
        *RETURN_ATTRIBUTES,
    ),
    "profile": ("track", "s", "easting", "northing", "height", "heading", "sd", "count"),
    "path": ("easting", "northing"),
}
_REQUIRED = {
    "points": ("easting", "northing", "up"),
    "profile": ("s", "height"),
    "path": ("easting", "northing"),
}


@dataclass(frozen=True, kw_only=True)
class TableColumn:
    """One column of a table whose name is known."""

    index: int
    label: str  # name in the file
    name: str  # name of the variable
    track: str | None = None  # track, if there is one column per track
    scale: float = 1.0  # factor to SI units

    @property
    def key(self) -> tuple[str, str | None]:
        """Name and track: the key of the column."""
        return self.name, self.track


#: Values of some columns.
Values = dict[TableColumn, npt.NDArray[Any]]


@dataclass(frozen=True, kw_only=True)
class TableLayout:
    """Kind of data in a table and meaning of its columns."""

    kind: str  # points, profile or path
    columns: tuple[TableColumn, ...]
    ignored: tuple[str, ...] = ()

    def must_be_finite(self, column: TableColumn) -> bool:
        """Whether the column must not have gaps; heights and standard deviations may."""
        needed = _REQUIRED[self.kind]
        return column.name in needed and column.name != "height"

    @property
    def tracks(self) -> list[str | None]:
        """Tracks with a column each, in the order of the file; [None] if there is only one."""
        return [column.track for column in self.columns if column.name == "height"]


def layout_of(labels: list[str], path: str | Path, *, kind: str | None = None) -> TableLayout:
    """Meaning of a table by the names of its columns; `kind` demands a certain kind of data."""
    columns = _columns_of(labels, path)
    names = {column.name for column in columns}
    kind = kind or _kind_of(names)
    if kind is not None:
        columns = [_named_for(kind, column, names) for column in columns]
    if kind is None or not {column.name for column in columns}.issuperset(_REQUIRED[kind]):
        raise _missing_error(labels, names, kind, path)
    kept = [
        column
        for column in columns
        if column.name in _KEPT[kind] or (kind == "points" and column.name.startswith(EXTRA))
    ]
    # easting_left belongs to height_left; without a column height_left it is ignored
    tracks = {column.track for column in kept if column.name == "height"} or {None}
    kept = [column for column in kept if column.track in tracks or column.name in ("s", "track")]
    _refuse_doubles(kept, path)
    used = {column.index for column in kept}
    ignored = tuple(label for index, label in enumerate(labels) if index not in used)
    return TableLayout(kind=kind, columns=tuple(kept), ignored=ignored)


def names_columns(labels: list[str]) -> bool:
    """Whether labels are the names of the columns of points, a profile or a path."""
    try:
        columns = _columns_of(labels, "")
    except FormatError:  # a known name with an unknown unit
        return True
    return _kind_of({column.name for column in columns}) is not None


def layout_without_header(count: int, path: str | Path, *, kind: str | None = None) -> TableLayout:
    """Meaning of a table without names: two columns are s and height, three are points."""
    if kind == "path" and count >= 2:
        names: tuple[str, ...] = ("easting", "northing")
    elif count == 2:
        kind, names = "profile", ("s", "height")
    elif count == 3:
        kind, names = "points", ("easting", "northing", "up")
    else:
        raise FormatError(
            f"{count} columns need names; only 2 (s, height) or 3 (easting, northing, up) do not",
            path=path,
            place="line 1",
            cure="Add a first line with the names of the columns.",
        )
    columns = [TableColumn(index=i, label=name, name=name) for i, name in enumerate(names)]
    ignored = tuple(f"number {i + 1}" for i in range(len(names), count))
    return TableLayout(kind=kind, columns=tuple(columns), ignored=ignored)


def _columns_of(labels: list[str], path: str | Path) -> list[TableColumn]:
    understood = [_parse_column(index, label, path) for index, label in enumerate(labels)]
    columns = [column for column in understood if column is not None]
    names = {column.name for column in columns}
    if "s" in names and not names & {"height", "up", "track"}:
        tracks = [_parse_track(index, label, path) for index, label in enumerate(labels)]
        columns += [column for column in tracks if column is not None]
    return sorted(columns, key=lambda column: column.index)


def _parse_column(index: int, label: str, path: str | Path) -> TableColumn | None:
    words, unit = _words_and_unit(label)
    head, *rest = _split_words(words)
    if head.lower() not in (*_ALIASES, *_NAMES, *RETURN_ATTRIBUTES) and " " in head:  # height mm
        head, *rest = words.split()
    name = _ALIASES.get(head.lower(), head.lower())
    if name.startswith(EXTRA):
        return TableColumn(index=index, label=words, name=words)
    if name not in (*_NAMES, *RETURN_ATTRIBUTES):
        return None
    units = _UNITS.get(name, {})
    if not unit and rest and rest[-1].lower() in units:
        unit = rest.pop().lower()
        if rest and rest[-1].lower() == "in":  # height in mm
            rest.pop()
    if rest and name not in (*_PER_TRACK, "up"):
        return None
    track = "_".join(rest) or None
    return _make_column(index, label, name, unit, path, track=track)


def _parse_track(index: int, label: str, path: str | Path) -> TableColumn | None:
    """Column of heights that has the name of its track: left, right [mm], track 1."""
    words, unit = _words_and_unit(label)
    parts = re.split(r"[\s_]+", words)
    if not unit and len(parts) > 1 and parts[-1].lower() in _LENGTHS:
        unit = parts.pop().lower()
    named = [part for part in parts if part.lower() not in _FILLING]
    if not _TRACK.fullmatch("".join(named).lower()):
        return None
    return _make_column(index, label, "height", unit, path, track=" ".join(named))


def _words_and_unit(label: str) -> tuple[str, str]:
    text = label.strip().strip('"')
    bracket = re.fullmatch(r"(.+?)\s*[\[(]\s*(.*?)\s*[\])]", text)
    return (bracket[1], bracket[2].lower()) if bracket else (text, "")


def _make_column(
    index: int, label: str, name: str, unit: str, path: str | Path, *, track: str | None
) -> TableColumn:
    units = _UNITS.get(name, {})
    if unit and unit not in units and units:
        raise FormatError(
            f"has the unit {unit!r}; known are {', '.join(units)}",
            path=path,
            place=f"column {label!r}",
            cure="Convert the column, or correct its unit.",
        )
    text = label.strip().strip('"')
    scale = units.get(unit, 1.0)
    return TableColumn(index=index, label=text, name=name, track=track, scale=scale)


def _split_words(words: str) -> list[str]:
    """Name of a column, and the words that follow it: track, unit."""
    if words.startswith(EXTRA):
        return [words]
    known = [name for name in RETURN_ATTRIBUTES if f"{words.lower()}_".startswith(f"{name}_")]
    if not known:
        return words.split("_")
    name = max(known, key=len)
    return [name, *words[len(name) :].split("_")[1:]]


def _kind_of(names: set[str]) -> str | None:
    heights = bool(names & {"height", "up"})
    if heights and "s" in names:
        return "profile"
    if {"easting", "northing"} <= names:
        return "points" if heights else "path"
    if heights and "easting" in names:  # x and z, without y
        return "profile"
    return None


def _named_for(kind: str, column: TableColumn, names: set[str]) -> TableColumn:
    if kind == "points" and column.name == "height" and "up" not in names:
        return replace(column, name="up")
    if kind == "profile" and column.name == "up" and "height" not in names:
        return replace(column, name="height")
    if kind == "profile" and column.name == "easting" and "s" not in names:
        return replace(column, name="s")
    return column


def _missing_error(
    labels: list[str], names: set[str], kind: str | None, path: str | Path
) -> FormatError:
    wanted = {
        "points": "easting, northing and up",
        "profile": "s and height",
        "path": "easting and northing",
    }
    needs = wanted[kind] if kind else ", or ".join(wanted.values())
    lacking = [name for known in _REQUIRED.values() for name in known if name not in names]
    for label in labels:
        near = difflib.get_close_matches(label.strip().lower(), lacking, n=1, cutoff=0.6)
        if near and label.strip().lower() not in names:
            cure = f"Rename column {label.strip()!r} to {near[0]!r} if that is what it is."
            break
    else:
        cure = "Add the column, or name the columns so."
    if kind is None and "s" in names and not names & {"height", "up"} and len(labels) > 2:
        cure = (
            "Name the columns of heights: height, or of several tracks height_left, height_right."
        )
    found = ", ".join(label.strip() for label in labels[:8]) + (", ..." if len(labels) > 8 else "")
    return FormatError(f"needs columns {needs}, got {found}", path=path, place="header", cure=cure)


def _refuse_doubles(columns: list[TableColumn], path: str | Path) -> None:
    seen: dict[tuple[str, str | None], TableColumn] = {}
    for column in columns:
        other = seen.setdefault(column.key, column)
        if other is not column:
            raise FormatError(
                f"{other.label!r} and {column.label!r} both hold {column.name}",
                path=path,
                place="header",
                cure="Remove or rename one of them.",
            )
