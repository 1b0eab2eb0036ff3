"""The command ``trueterrain info``: summary and problems of files."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from trueterrain.cli._console import error_text, write_json, write_line
from trueterrain.cli._recordings import RECORDED, rows_of_recording
from trueterrain.core.errors import FormatError, TrueTerrainError

# units of the numbers of a summary
_UNITS = {
    "spacing": "m",
    "scale": "m",
    "offset": "m",
    "resolution": "m",
    "density": "points/m²",
    "curvature": "1/m",
}
_TITLES = {
    "crs": "CRS",
    "point_format": "point format",
    "point_source_ids": "point source ids",
    "number_format": "number format",
    "missing": "without height",
}
_OWN_ROWS = ("file", "bytes", "format", "kind", "problems", "crs_name", "comment", "error")
_MAX_ENTRIES = 8  # of a list
_MAX_LENGTH = 100  # [characters] of a text


def info(file: Path, /, *more: Path, json: bool = False) -> None:
    """Show kind, counts, extent, CRS, time span and problems of files.

    For runs and navigation also rates, gaps and the order of the clocks. Formats are recognised by
    the content. All files are examined; the exit code is 2 if one of them cannot be read.

    Example: trueterrain info *.laz --json

    Parameters
    ----------
    file
        OpenCRG, GeoTIFF, LAS, LAZ, COPC, ERD, CSV or Parquet file; NAME.zarr of points, a surface,
        a profile or a recorded run; SBET or SMRMSG.
    more
        More files.
    json
        Print one JSON document {"files": [{"file", "bytes", "format", "kind", ..., "problems"}]};
        {"file", "error"} for a file that cannot be read. Lengths are in m, times in s, angles in
        rad, longitude and latitude in deg.
    """
    summaries, errors = [], []
    for path in (file, *more):
        try:
            summaries.append(_file_summary(path))
        except (TrueTerrainError, OSError) as error:
            errors.append(error)
            summaries.append({"file": str(path), "error": error_text(error)})
    if json:
        write_json({"files": summaries})
    elif more or not errors:
        for number, summary in enumerate(summaries):
            if number:
                write_line()
            _print_summary(summary)
    if len(errors) > 1:
        count = f"{len(errors)} of {len(summaries)} files"
        raise FormatError(f"{count} cannot be read; the first: {error_text(errors[0])}")
    if errors:
        raise errors[0]


def _file_summary(path: Path) -> dict[str, Any]:
    from trueterrain import formats

    return formats.info(path)


def _print_summary(summary: dict[str, Any]) -> None:
    write_line(summary["file"])
    rows = list(_summary_rows(summary))
    width = max(len(title) for title, _ in rows)
    for title, text in rows:
        write_line(f"  {title:<{width}}  {text}")


def _summary_rows(summary: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if "error" in summary:
        yield "unreadable", summary["error"].removeprefix(f"{summary['file']}: ")
        return
    yield "format", f"{summary['format']}, {summary['kind']}, {summary['bytes']:,} bytes"
    if summary["kind"] in RECORDED:
        yield from rows_of_recording(summary)
    else:
        yield from _rows_of_ground(summary)
    problems = summary["problems"]
    yield "problems", problems[0] if problems else "no problems found"
    for problem in problems[1:]:
        yield "", problem


def _rows_of_ground(summary: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for key, value in summary.items():
        if key in _OWN_ROWS or value is None or value in ("", [], {}):
            continue
        if key in ("extent", "range"):
            for axis, (low, high) in value.items():
                # "range" is along the axes of a surface, "extent" on the ground
                length = f"({_format_number(high - low)} m)"
                yield axis, f"{_format_number(low)} to {_format_number(high)} m {length}"
        elif key == "tracks":
            yield from _track_rows(value)
        elif key == "time":
            yield "time", _time_text(value)
        else:
            yield _TITLES.get(key, key.replace("_", " ")), _value_text(key, value, summary)
    if summary["kind"] in ("points", "surface") and not summary["crs"]:
        yield "CRS", "unknown"


def _track_rows(tracks: list[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    for track in tracks:
        low, high = track["lowest"], track["highest"]
        heights = (
            "no heights"
            if low is None
            else f"heights {_format_number(low)} to {_format_number(high)} m"
        )
        yield "track", f"{track['name']}: {heights}" if track["name"] else heights


def _time_text(time: dict[str, Any]) -> str:
    start, end = time["start"], time["end"]
    text = f"{start:.3f} to {end:.3f} s ({_format_number(end - start)} s), {time['kind']}"
    return f"{text}, {time['first']} to {time['last']}" if "first" in time else text


def _value_text(key: str, value: Any, summary: dict[str, Any]) -> str:
    unit = f" {_UNITS[key]}" if key in _UNITS else ""
    if key == "crs":
        name = summary.get("crs_name", "")
        named = name and not value.startswith(("PROJ", "COMPOUND"))
        return _cut_text(f"{value} ({name})" if named else name or value)
    if key == "missing":
        return f"{100 * value:.3g} % of the nodes" if value else "none of the nodes"
    if key == "size":
        return " x ".join(f"{number:,}" for number in value)
    if key == "classes":
        texts = [f"{_class_text(name)}: {count:,}" for name, count in value.items()]
        return "; ".join(texts)
    if isinstance(value, dict):
        texts = [
            f"{name}: {_plain_text(item)}{unit}" for name, item in value.items() if item is not None
        ]
        return _cut_text("; ".join(_shorten_list(texts)))
    if isinstance(value, list) and key in ("spacing", "curvature", "resolution"):
        return " to ".join(_plain_text(item) for item in value) + unit
    if isinstance(value, list):
        texts = [_plain_text(item) for item in value]
        texts = texts[:1] if len(set(texts)) == 1 and unit else texts
        return ", ".join(_shorten_list(texts)) + unit
    return _cut_text(_plain_text(value)) + unit


def _class_text(number: str) -> str:
    from trueterrain.formats.point_filter import CLASS_NAMES

    name = CLASS_NAMES.get(int(float(number)))
    return f"{number} {name}" if name else number


def _shorten_list(texts: list[str]) -> list[str]:
    if len(texts) <= _MAX_ENTRIES:
        return texts
    return [*texts[:_MAX_ENTRIES], f"and {len(texts) - _MAX_ENTRIES} more"]


def _plain_text(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_plain_text(item) for item in value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return " ".join(str(value).split())
    return _format_number(value)


def _format_number(value: float) -> str:
    """Integers with separators; others to 4 decimals, below 1 to 6 significant digits."""
    if isinstance(value, int):
        return f"{value:,}"
    if abs(value) < 1:
        return f"{value:.6g}"
    return f"{value:.4f}".rstrip("0").rstrip(".")


def _cut_text(text: str) -> str:
    return text if len(text) <= _MAX_LENGTH else text[: _MAX_LENGTH - 4] + " ..."
