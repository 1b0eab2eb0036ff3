"""Recordings on the command line: what ``info`` says of them, and who cannot use them."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from trueterrain.core.errors import SchemaError

Rows = Iterator[tuple[str, str]]

#: Kinds of files that hold what was recorded, not yet ground.
RECORDED = {"run": "a run", "navigation": "navigation", "accuracy": "the accuracy of navigation"}

_AXES = ("east", "north", "up")
_TURNS = ("roll", "pitch", "yaw")
_STEADY = 1e-6  # [s] of jitter that is not worth a word
_TIMES = {"run": "seconds since any moment", "gps": "seconds of the GPS week"}


def refuse_recording(path: Path, kind: str, wanted: str) -> None:
    """Raise if a file is a recording where ground is wanted.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Its kind, as by `trueterrain.formats.kind_of_file`.
    wanted : str
        What it should be, in words.

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
            f"is {RECORDED[kind]}, not {wanted}; this needs georeferenced points",
            path=path,
            cure=cure,
        )


def rows_of_recording(summary: Mapping[str, Any]) -> Rows:
    """What is said of a run, of navigation or of accuracy, as titles and texts.

    Parameters
    ----------
    summary : mapping
        Of `trueterrain.formats.info`.

    Yields
    ------
    tuple of str
        Title, empty where the last one goes on, and text.
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
        many = f"{what} of {sensors:,} {of}" if sensors and of else what
        yield name, _timing_text(part, many)
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
        turns = ", ".join(f"{axis} {math.degrees(sd[f'sd_{axis}']):.4f}" for axis in _TURNS)
        yield f"{which} sd", f"{position} m; {turns} deg"
    yield from _listed_rows("gaps", list(_gap_text(summary)) or ["none"])


def _timing_text(part: Mapping[str, Any], what: str) -> str:
    """How many, how often, from when to when."""
    texts = [f"{part['count']:,} {what}".rstrip()]
    if part["rate"]:
        texts.append(f"{part['rate']:.6g} Hz")
    if part["time"]:
        start, end = part["time"]
        texts.append(f"{start:.3f} to {end:.3f} s ({end - start:.3f} s)")
    if part["jitter"] and part["jitter"] > _STEADY:
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
        lost = scans["dropouts"]
        without = "" if lost is None else f", {lost:.3%} of the beams without a return"
        yield f"{scans['returns']:,} returns {intensity}{without}"


def _trajectory_text(summary: Mapping[str, Any]) -> Iterator[str]:
    if "distance" in summary:
        speed = summary["navigation"]["speed"]
        yield f"way of {summary['distance']:.2f} m, up to {speed:.2f} m/s"
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
        place = ", ".join(f"{value:g}" for value in mounting["scanner_position"])
        turns = ", ".join(f"{math.degrees(value):g}" for value in mounting["scanner_rotation"])
        clocks = [1e3 * mounting[f"{name}_clock"] for name in ("scanner", "accelerometer")]
    except (KeyError, TypeError, ValueError):
        return  # the problems tell what is wrong with it
    yield "scanner at", f"{place} m (forward, left, up), turned by {turns} deg (roll, pitch, yaw)"
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
    """Kind of several inputs, which are all runs or all points.

    Parameters
    ----------
    inputs : list of Path
        The files.
    other : str
        What to do about something else.
    mixed : str
        What to do about a mixture.

    Returns
    -------
    str
        ``"run"`` or ``"points"``.

    Raises
    ------
    SchemaError
        If one is of another kind.
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
