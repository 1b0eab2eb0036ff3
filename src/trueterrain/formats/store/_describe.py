"""Summary of a store for ``trueterrain info``."""

from pathlib import Path
from typing import Any

import numpy as np

from trueterrain.formats._zarr import find_damaged_chunks
from trueterrain.formats.store._layout import OpenedStore, Values, open_store
from trueterrain.formats.store._read import read
from trueterrain.formats.table.description import describe_profile

_EVEN = 1e-6  # [m] tolerance of equal spacing


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a store for ``trueterrain info``; every chunk is read to verify its checksum.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.

    Returns
    -------
    dict
        ``format``, ``kind``, ``bytes``, ``variables``, ``extent`` [m], ``crs`` and ``problems``; of
        points also ``count``, ``time`` [s] and ``lanes``, of a surface ``size``, ``spacing`` and
        ``range`` [m] and ``missing`` (fraction of nodes without height), of a profile ``count``,
        ``spacing`` [m] and ``tracks``. All values are plain types that JSON can hold.

    Raises
    ------
    FormatError
        If it is no such store, arrays or chunks are missing, or chunks that the summary needs are
        damaged. Other damaged chunks are listed among the problems.
    """
    stored = open_store(path)
    summary: dict[str, Any] = {"format": "Zarr", "kind": stored.kind}
    files = (file for file in stored.path.rglob("*") if file.is_file())
    summary["bytes"] = sum(file.stat().st_size for file in files)
    summary["variables"] = [entry.name for entry in stored.entries if not entry.coordinate]
    damage = find_damaged_chunks(stored.arrays.values())
    about = {
        "points": _describe_points,
        "surface": _describe_surface,
        "profile": _describe_profile,
    }[stored.kind]
    summary |= about(stored)
    summary["crs"] = str(stored.attrs.get("crs", ""))
    summary["problems"] = damage + summary["problems"]
    summary["problems"] += [
        f"{name}: is not part of the store and is ignored" for name in stored.unlisted
    ]
    return summary


def _describe_points(stored: OpenedStore) -> dict[str, Any]:
    found = dict(stored.statistics)
    not_finite, time = found.pop("not_finite"), found.pop("time")
    if time is not None:
        kind = stored.attrs.get("gps_time_kind", "unknown")
        found["time"] = {"kind": kind, "start": time[0], "end": time[1]}
    problems = (
        [f"{not_finite:,} of {found['count']:,} points have coordinates that are not finite"]
        if not_finite
        else []
    )
    return found | {"problems": problems}


def _describe_surface(stored: OpenedStore) -> dict[str, Any]:
    dims = next(entry.dims for entry in stored.entries if entry.name == "height")
    axes = {dim: stored.values(dim) for dim in dims}
    found = {
        "size": [stored.sizes[dim] for dim in dims],
        "spacing": {dim: _equal_spacing(axis) for dim, axis in axes.items()},
    }
    if "u" in axes:
        found["range"] = {dim: [float(axis[0]), float(axis[-1])] for dim, axis in axes.items()}
    missing = stored.statistics["missing"]
    problems = ["no node has a height"] if missing == 1 else []
    return found | stored.statistics | {"problems": problems}


def _describe_profile(stored: OpenedStore) -> dict[str, Any]:
    return describe_profile(read(stored.path))


def _equal_spacing(axis: Values) -> float | None:
    steps = np.diff(axis)
    return round(float(steps.mean()), 9) if np.ptp(steps) < _EVEN else None
