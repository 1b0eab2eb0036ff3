"""Summaries of points and profiles in tables for ``trueterrain info``."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.formats._bounds import value_range
from trueterrain.formats._flags import profile_flags
from trueterrain.formats.point_filter import ReturnCounts
from trueterrain.formats.table._columns import Values

_EQUAL = 1e-3  # fraction by which equal spacings may differ: rounding, as for ERD


def describe_profile(profile: xr.Dataset) -> dict[str, Any]:
    """Count, spacing, extent, tracks and problems of a profile."""
    s = profile.s.values
    several = "track" in profile.dims
    names = [str(n) for n in profile.track.values] if several else [profile.attrs.get("track", "")]
    problems, tracks = [], []
    for name, height in zip(names, np.atleast_2d(profile.height.values), strict=True):
        problems += profile_flags(name or "height", s, height)
        low, high = value_range(height) or (None, None)
        tracks.append({"name": name, "lowest": low, "highest": high})
    summary: dict[str, Any] = {"count": s.size, "extent": {"s": [float(s[0]), float(s[-1])]}}
    steps = np.diff(s)
    if steps.size:
        low, high = float(steps.min()), float(steps.max())
        equal = high - low <= _EQUAL * low
        summary["spacing"] = float(np.median(steps)) if equal else [low, high]
    return summary | {"tracks": tracks, "problems": problems}


def describe_points(blocks: Iterator[Values]) -> dict[str, Any]:
    """Count, extent, lanes and problems of points or waypoints, block by block."""
    extent: dict[str, list[float]] = {}
    lanes: dict[str, int] = {}
    returns = ReturnCounts()
    count = 0
    for values in blocks:
        named = {column.name: array for column, array in values.items()}
        count += named["easting"].size
        returns.add(named)
        for name in ("easting", "northing", "up", "time"):
            if name in named:
                low, high = extent.get(name, [np.inf, -np.inf])
                extent[name] = [
                    float(min(low, named[name].min())),
                    float(max(high, named[name].max())),
                ]
        for lane, number in zip(*np.unique(named.get("lane", []), return_counts=True), strict=True):
            lanes[f"{lane:g}"] = lanes.get(f"{lane:g}", 0) + int(number)
    summary: dict[str, Any] = {"count": count, "extent": extent, "problems": []}
    if "time" in extent:
        start, end = extent.pop("time")
        summary["time"] = {"kind": "unknown", "start": start, "end": end}
    if lanes:
        summary["lanes"] = lanes
    return summary | returns.counts()
