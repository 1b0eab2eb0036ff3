"""Summary and problems of a run for ``trueterrain info``."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError, TrueTerrainError
from trueterrain.core.schemas.run import QUANTUM, Mounting
from trueterrain.formats._zarr import find_damaged_chunks
from trueterrain.formats.navigation.records import IntervalStatistics
from trueterrain.formats.run._handle import open_unchecked
from trueterrain.formats.run._open import scan_blocks
from trueterrain.formats.run.rules import group_of, row_blocks, rules_of, span_of

Floats = npt.NDArray[np.float64]

_TIMED = {"scans": "scan", "navigation": "epoch", "accelerometers": "sample"}
_CLOCKS = {"scans": "scanner_clock", "accelerometers": "accelerometer_clock"}
_MANY = 0.2  # fraction of beams without a return above which a run is flagged
_FASTEST = 100.0  # [m/s] largest plausible speed of a vehicle
_JITTER = 0.1  # jitter above which times are flagged, as a fraction of the interval
_STRIDE = 0.2  # [s] between positions for distance and speed: noise would add to shorter steps


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a run for ``trueterrain info``, read once, block by block.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.

    Returns
    -------
    dict
        ``format``, ``kind``, ``name``, ``origin``, ``time_reference``, ``mounting``, ``bytes``,
        ``count`` (returns), ``scans``, ``navigation`` and ``accelerometers`` with their ``count``,
        ``time`` [s], ``rate`` [1/s], ``jitter`` (rms) [s] and ``gaps``; of the scans ``beams``,
        ``angle`` [rad], ``range`` [m], ``dropouts`` (fraction of beams without a return)
        and ``empty_scans``; ``extent`` [m] and ``distance`` [m] of the navigation, and its
        ``speed`` (maximum, from five positions per second) [m/s]; ``clock_order``: the instruments
        in the order in which they start and end in true time, with their times [s]; ``truth``
        (names of its groups) and ``problems``. All values are plain types that JSON can hold.

    Raises
    ------
    FormatError
        If it is not a Zarr store, or too damaged to be described.
    """
    path = Path(path)
    tree = open_unchecked(path)
    problems = problems_of(tree, path)
    summary: dict[str, Any] = {"format": "Run", "kind": "run"}
    for name in ("name", "origin", "time_reference", "mounting"):
        summary[name] = tree.attrs.get(name)
    summary["bytes"] = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    summary["crs"] = ""
    flags: list[str] = []
    for name, dim in _TIMED.items():
        if _is_timed(tree, name, dim):
            with _note_problems(problems):
                summary[name], found = _describe_timing(group_of(tree, name), name, dim)
                flags += found
    if "scans" in summary:
        with _note_problems(problems):
            flags += _describe_scans(tree, summary)
    if "navigation" in summary:
        with _note_problems(problems):
            flags += _describe_trajectory(tree, summary)
    if "accelerometers" in summary:
        summary["accelerometers"]["sensors"] = tree.children["accelerometers"].sizes.get(
            "sensor", 0
        )
    summary["clock_order"] = _clock_order(tree, summary)
    summary["truth"] = sorted(tree.children["truth"].children) if "truth" in tree.children else []
    # all other groups have been read above
    problems += find_damaged_chunks(
        array for name, array in tree.stored.items() if name.startswith("truth/")
    )
    summary["problems"] = list(dict.fromkeys([*problems, *flags]))
    return summary


def problems_of(tree: xr.DataTree, path: str | Path | None = None) -> list[str]:
    """List every rule that a run breaks, one line each.

    Parameters
    ----------
    tree : xarray.DataTree
        Tree to check.
    path : str or Path, optional
        Store of the tree.

    Returns
    -------
    list of str
        Messages as those of `check_run`, without the name of the file. If the layout is wrong, only
        that is listed.
    """
    found: list[str] = []
    for index, rule in enumerate(rules_of(tree, path)):
        with _note_problems(found):
            rule()
        if index == 0 and found:
            break
    return found


@contextmanager
def _note_problems(problems: list[str]) -> Iterator[None]:
    """Append an error of the data to the problems, and continue."""
    try:
        yield
    except TrueTerrainError as error:
        cure = f". {error.cure}" if error.cure else ""
        problems.append(f"{error.place}: {error.problem}{cure}" if error.place else error.problem)


def _is_timed(tree: xr.DataTree, name: str, dim: str) -> bool:
    if name not in tree.children or "time" not in group_of(tree, name):
        return False
    time = group_of(tree, name)["time"]
    return time.dims == (dim,) and time.dtype.kind == "f"


def _describe_timing(group: xr.Dataset, name: str, dim: str) -> tuple[dict[str, Any], list[str]]:
    intervals = IntervalStatistics()
    for block in row_blocks(group, dim, ("time",)):
        intervals.add(block["time"])
    summary = intervals.to_dict()
    # times that do not ascend are among the problems already, by the rules of a run
    flags = [text for text in intervals.problems(name) if "run forward" not in text]
    if summary["rate"] and summary["jitter"] and summary["jitter"] * summary["rate"] > _JITTER:
        flags.append(
            f"{name}: the interval between times varies by {summary['jitter']:.3g} s (rms)"
        )
    return summary, flags


def _describe_scans(tree: xr.DataTree, summary: dict[str, Any]) -> list[str]:
    scans, group = summary["scans"], group_of(tree, "scans")
    if "range" not in group or group["range"].dims != ("scan", "beam"):
        return []
    scans["beams"] = group.sizes["beam"]
    if "angle" in group and group["angle"].size:
        scans["angle"] = [float(group["angle"].values.min()), float(group["angle"].values.max())]
    returns, empty, low, high = 0, 0, np.inf, -np.inf
    for block in scan_blocks(tree):
        ranges = block["range"].values
        is_return = np.isfinite(ranges)
        per_scan = np.count_nonzero(is_return, axis=1)
        returns += int(per_scan.sum())
        empty += int(np.count_nonzero(per_scan == 0))
        low = min(low, float(np.min(ranges, where=is_return, initial=np.inf)))
        high = max(high, float(np.max(ranges, where=is_return, initial=-np.inf)))
    total = scans["count"] * scans["beams"]
    scans |= {
        "returns": returns,
        "range": [low, high] if returns else None,
        "dropouts": 1 - returns / total if total else None,
        "empty_scans": empty,
        "intensity": "intensity" in group,
    }
    summary["count"] = returns
    flags = []
    if total and scans["dropouts"] > _MANY:
        flags.append(f"scans: {scans['dropouts']:.0%} of the beams have no return")
    if empty:
        flags.append(f"scans: {empty} of {scans['count']} have no return at all")
    largest = group["range"].encoding.get("_FillValue", np.inf) * QUANTUM
    if returns and high > largest - 2 * QUANTUM:
        flags.append(f"scans: ranges reach the largest that can be stored, {high:.4f} m")
    return flags


def _describe_trajectory(tree: xr.DataTree, summary: dict[str, Any]) -> list[str]:
    """Add extent, distance and speed of the navigation to the summary; return flags."""
    group = group_of(tree, "navigation")
    axes = ("east", "north", "up")
    if not all(name in group and group[name].dims == ("epoch",) for name in axes):
        return []
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    distance, max_speed, max_jump = 0.0, 0.0, 0.0
    stride = max(1, round(_STRIDE * (summary["navigation"]["rate"] or 0.0)))
    before = landmark = np.empty((4, 0))
    done, count = 0, group.sizes["epoch"]
    for block in row_blocks(group, "epoch", ("time", *axes)):
        rows = np.stack([block[name] for name in ("time", *axes)])
        low = np.fmin(low, np.fmin.reduce(rows[1:], axis=1, initial=np.inf))
        high = np.fmax(high, np.fmax.reduce(rows[1:], axis=1, initial=-np.inf))
        number = done + np.arange(rows.shape[1])
        landmarks = rows[:, (number % stride == 0) | (number == count - 1)]
        max_jump = max(max_jump, _travelled_steps(before, rows)[1])
        length, speed = _travelled_steps(landmark, landmarks)
        distance, max_speed = distance + length, max(max_speed, speed)
        before, done = rows[:, -1:], done + rows.shape[1]
        landmark = landmarks[:, -1:] if landmarks.size else landmark
    known = bool(np.isfinite(low).all())
    spans = zip(axes, low, high, strict=True)
    summary["extent"] = {name: [float(a), float(b)] for name, a, b in spans} if known else None
    summary["distance"] = distance
    summary["navigation"]["speed"] = max_speed
    if max_jump > _FASTEST:
        return [f"navigation: positions jump, as if at {max_jump:.4g} m/s"]
    return []


def _travelled_steps(before: Floats, rows: Floats) -> tuple[float, float]:
    """Distance along times and positions, shape (4, epoch) [m], and maximum speed [m/s]."""
    steps = np.diff(np.concatenate([before, rows], axis=1), axis=1)
    steps = steps[:, np.isfinite(steps).all(axis=0) & (steps[0] > 0)]
    length = np.sqrt(np.sum(steps[1:] ** 2, axis=0))
    return float(length.sum()), float(np.max(length / steps[0], initial=0.0))


def _clock_order(tree: xr.DataTree, summary: dict[str, Any]) -> dict[str, list[list[Any]]]:
    """Instruments in the order of their first and last true time [s]."""
    mounting = Mounting()
    with suppress(SchemaError):  # it is among the problems already
        mounting = Mounting.from_attrs(tree.attrs.get("mounting"))
    spans = {}
    for name, dim in _TIMED.items():
        if name in summary and summary[name]["count"]:
            clock = getattr(mounting, _CLOCKS.get(name, ""), 0.0)
            start, end = span_of(group_of(tree, name), dim)
            spans[name] = (start + clock, end + clock)
    return {
        which: [[name, spans[name][i]] for name in sorted(spans, key=lambda n: spans[n][i])]
        for i, which in enumerate(("start", "end"))
    }
