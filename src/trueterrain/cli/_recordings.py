"""Recordings on the command line: rows of ``info``, and errors where ground is required."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from trueterrain.core.errors import SchemaError

Rows = Iterator[tuple[str, str]]

#: Kinds of files that hold recorded data, not ground.
RECORDED = {"run": "a run", "navigation": "navigation", "accuracy": "the accuracy of navigation"}

_AXES = ("east", "north", "up")
_ROTATIONS = ("roll", "pitch", "yaw")
_MIN_JITTER = 1e-6  # [s] below this, jitter is not shown
_TIMES = {"run": "seconds since an arbitrary epoch", "gps": "seconds of the GPS week"}


def refuse_recording(path: Path, kind: str, required: str) -> None:
    """Raise SchemaError if a file is a recording and a command requires ground.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Kind of the file, as by `trueterrain.formats.kind_of_file`.
    required : str
        Kind that is required, with its article, for the message.

    Raises
    ------
    SchemaError
        If it is a run, navigation, or the accuracy of navigation.
    """
    if kind in RECORDED:
        cure = f"See what it holds: trueterrain info {path}"
        if kind == "run":
            cure = f"Grid it first: trueterrain grid {path} -o surface.crg. {cure}"
        raise SchemaError(
            f"is {RECORDED[kind]}, not {required}; this needs georeferenced points",
            path=path,
            cure=cure,
        )


def rows_of_recording(summary: Mapping[str, Any]) -> Rows:
    """Rows of ``info`` for a run, for navigation or for its accuracy.

    Parameters
    ----------
    summary : mapping
        Result of `trueterrain.formats.info`.

    Yields
    ------
    tuple of str
        Title, empty on a continued row, and text.
    """
    yield from {"run": _run_rows, "navigation": _navigation_rows, "accuracy": _accuracy_rows}[
        summary["kind"]
    ](summary)


def _run_rows(summary: Mapping[str, Any]) -> Rows:
    if summary["name"]:
        yield "name", str(summary["name"])
    if summary["origin"]:
        yield "origin", _origin_text(summary["origin"])
    reference = summary["time_reference"]
    if reference:
        yield "time", _TIMES.get(reference, str(reference))
    gaps: list[str] = []
    for name, what in (("scans", "scans"), ("navigation", "epochs"), ("accelerometers", "samples")):
        part = summary.get(name)
        if part is None:
            yield name, "none"
            continue
        sensors = part.get("beams") or part.get("sensors")
        of = {"scans": "beams", "accelerometers": "sensors"}.get(name)
        counted = f"{what} of {sensors:,} {of}" if sensors and of else what
        yield name, _timing_text(part, counted)
        if name == "scans":
            yield from (("", text) for text in _scan_text(part))
        if name == "navigation":
            yield from (("", text) for text in _trajectory_text(summary))
        gaps += [f"{name}: {text}" for text in _gap_text(part)]
    yield from _listed_rows("gaps", gaps or ["none"])
    for which, title in (("start", "begin"), ("end", "end")):
        order = summary["clock_order"].get(which, [])
        if order:
            yield title, ", ".join(f"{name} {time:.3f} s" for name, time in order)
    if isinstance(summary["mounting"], Mapping):
        yield from _mounting_rows(summary["mounting"])
    if summary["truth"]:
        yield "truth", ", ".join(summary["truth"])


def _navigation_rows(summary: Mapping[str, Any]) -> Rows:
    yield "epochs", _timing_text(summary, "")
    if "columns" in summary:
        yield "columns", ", ".join(summary["columns"])
    for name, (low, high) in summary.get("extent", {}).items():
        if name in ("longitude", "latitude"):
            yield name, f"{low:.7f} to {high:.7f} deg"
        else:
            yield name, f"{low:.3f} to {high:.3f} m"
    if "speed" in summary:
        yield "speed", f"up to {summary['speed']:.2f} m/s"
    yield from _listed_rows("gaps", list(_gap_text(summary)) or ["none"])
    yield "CRS", summary["crs"] or "unknown"


def _accuracy_rows(summary: Mapping[str, Any]) -> Rows:
    yield "epochs", _timing_text(summary, "")
    for which in ("median", "largest"):
        sd = summary[which]
        position = ", ".join(f"{axis} {sd[f'sd_{axis}']:.3f}" for axis in _AXES)
        rotations = ", ".join(f"{axis} {math.degrees(sd[f'sd_{axis}']):.4f}" for axis in _ROTATIONS)
        yield f"{which} sd", f"{position} m; {rotations} deg"
    yield from _listed_rows("gaps", list(_gap_text(summary)) or ["none"])


def _timing_text(part: Mapping[str, Any], what: str) -> str:
    """Count, rate, time span and jitter of a stream."""
    texts = [f"{part['count']:,} {what}".rstrip()]
    if part["rate"]:
        texts.append(f"{part['rate']:.6g} Hz")
    if part["time"]:
        start, end = part["time"]
        texts.append(f"{start:.3f} to {end:.3f} s ({end - start:.3f} s)")
    if part["jitter"] and part["jitter"] > _MIN_JITTER:
        texts.append(f"jitter {1e3 * part['jitter']:.2g} ms (rms)")
    return ", ".join(texts)


def _scan_text(scans: Mapping[str, Any]) -> Iterator[str]:
    texts = []
    if "angle" in scans:
        low, high = map(math.degrees, scans["angle"])
        texts.append(f"angles {low:.3f} to {high:.3f} deg")
    if scans.get("range"):
        texts.append("ranges {:.4f} to {:.4f} m".format(*scans["range"]))
    if texts:
        yield ", ".join(texts)
    if "returns" in scans:
        intensity = "with intensity" if scans["intensity"] else "without intensity"
        dropouts = scans["dropouts"]
        without = "" if dropouts is None else f", {dropouts:.3%} of the beams without a return"
        yield f"{scans['returns']:,} returns {intensity}{without}"


def _trajectory_text(summary: Mapping[str, Any]) -> Iterator[str]:
    if "distance" in summary:
        speed = summary["navigation"]["speed"]
        yield f"distance {summary['distance']:.2f} m, up to {speed:.2f} m/s"
    if summary.get("extent"):
        spans = (
            f"{axis} {low:.3f} to {high:.3f} m" for axis, (low, high) in summary["extent"].items()
        )
        yield ", ".join(spans)


def _gap_text(part: Mapping[str, Any]) -> Iterator[str]:
    for gap in part["gaps"]:
        yield f"{gap['length']:.6g} s from {gap['start']:.6f} s on"
    if part["gap_count"] > len(part["gaps"]):
        yield f"and {part['gap_count'] - len(part['gaps']):,} more"


def _mounting_rows(mounting: Mapping[str, Any]) -> Rows:
    try:
        position = ", ".join(f"{value:g}" for value in mounting["scanner_position"])
        rotation = ", ".join(f"{math.degrees(value):g}" for value in mounting["scanner_rotation"])
        clocks = [1e3 * mounting[f"{name}_clock"] for name in ("scanner", "accelerometer")]
    except (KeyError, TypeError, ValueError):
        return  # the problems state what is wrong with it
    yield (
        "scanner at",
        f"{position} m (forward, left, up), turned by {rotation} deg (roll, pitch, yaw)",
    )
    yield "clocks", f"scanner {clocks[0]:+g} ms, accelerometers {clocks[1]:+g} ms"


def _origin_text(origin: Any) -> str:
    try:
        text = "longitude {:.7g} deg, latitude {:.7g} deg, height {:.3f} m".format(*origin)
    except (TypeError, ValueError, IndexError):
        return str(origin)
    return text


def _listed_rows(title: str, texts: list[str]) -> Rows:
    for number, text in enumerate(texts):
        yield "" if number else title, text


def kind_of_all(inputs: list[Path], *, other: str, mixed: str) -> str:
    """Kind of several inputs: all runs or all points.

    Parameters
    ----------
    inputs : list of Path
        The files.
    other : str
        Cure if an input is of another kind.
    mixed : str
        Cure if runs and points are mixed.

    Returns
    -------
    str
        ``"run"`` or ``"points"``.

    Raises
    ------
    SchemaError
        If an input is neither, or not of the kind of the first.
    """
    from trueterrain import formats

    kinds = [formats.kind_of_file(path) for path in inputs]
    for path, kind in zip(inputs, kinds, strict=True):
        if kind not in ("run", "points"):
            raise SchemaError(
                f"must be a recorded run or points, but is {kind}", path=path, cure=other
            )
        if kind != kinds[0]:
            raise SchemaError(f"is {kind}, but {inputs[0]} is {kinds[0]}", path=path, cure=mixed)
    return kinds[0]
