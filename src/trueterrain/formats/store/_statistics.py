"""Statistics of points and surfaces, accumulated while a store is written, for its summary."""

from typing import Any

import numpy as np
import xarray as xr

from trueterrain.formats.point_filter import ReturnCounts
from trueterrain.formats.store._layout import CHUNK, Values

_PLACE = ("easting", "northing")
_SPANS = (*_PLACE, "up", "time")
_MAX_LANES = 1000  # lanes that are counted individually


class PointStatistics:
    """Counts, extent and time span of points, and the bounds of each chunk."""

    def __init__(self) -> None:
        self.count = 0
        self._bounds: list[Values] = []
        self._spans = {name: [np.inf, -np.inf] for name in _SPANS}
        self._not_finite = 0
        self._lanes: dict[str, int] = {}
        self._returns = ReturnCounts()

    def add(self, columns: dict[str, Values]) -> None:
        """Add points; the first of them begins a chunk."""
        self.count += columns["up"].size
        place = [columns[name] for name in _PLACE]
        for start in range(0, columns["up"].size, CHUNK):
            west, east, south, north = (
                end for axis in place for end in _finite_span(axis[start : start + CHUNK])
            )
            self._bounds.append(np.array([west, south, east, north]))
        for name, span in self._spans.items():
            if name in columns:
                low, high = _finite_span(columns[name])
                self._spans[name] = [min(span[0], low), max(span[1], high)]
        finite = np.isfinite(place[0]) & np.isfinite(place[1]) & np.isfinite(columns["up"])
        self._not_finite += int(np.count_nonzero(~finite))
        self._returns.add(columns)
        if "lane" in columns and len(self._lanes) <= _MAX_LANES:
            for lane, number in zip(*np.unique(columns["lane"], return_counts=True), strict=True):
                name = f"{lane.item():.15g}"
                self._lanes[name] = self._lanes.get(name, 0) + int(number)

    def bounds(self) -> Values:
        """West, south, east, north of each chunk, shape (chunk, 4) [m]."""
        return np.stack(self._bounds)

    def to_dict(self) -> dict[str, Any]:
        """Count, extent, time span, lanes, classes and returns."""
        spans = {name: span for name, span in self._spans.items() if span[0] <= span[1]}
        time = spans.pop("time", None)
        found: dict[str, Any] = {"count": self.count, "extent": spans, "time": time}
        found["not_finite"] = self._not_finite
        if 0 < len(self._lanes) <= _MAX_LANES:
            found["lanes"] = self._lanes
        return found | self._returns.counts()


class SurfaceStatistics:
    """Extent of a surface and the fraction of its nodes without height."""

    def __init__(self, surface: xr.Dataset) -> None:
        self._ground = _ground_extent(surface)
        self._span = (np.inf, -np.inf)
        self._nodes = surface["height"].size
        self._known = 0

    def add(self, height: Values) -> None:
        """Add the heights of some rows."""
        low, high = _finite_span(height)
        self._span = (min(self._span[0], low), max(self._span[1], high))
        self._known += int(np.count_nonzero(np.isfinite(height)))

    def to_dict(self) -> dict[str, Any]:
        """Extent [m], and fraction of the nodes without height."""
        height = list(self._span) if self._known else None
        return {
            "extent": self._ground | {"height": height},
            "missing": (self._nodes - self._known) / self._nodes,
        }


def _ground_extent(surface: xr.Dataset) -> dict[str, Any]:
    """Range of easting and northing of the nodes of a surface [m]."""
    if "u" not in surface.dims:
        return {name: _finite_span(surface[name].values) for name in _PLACE}
    # a cross-section bisects the angle between the chord that ends at its node and the next one
    ends, begins = surface["heading"].values, np.roll(surface["heading"].values, -1)
    begins[-1] = ends[-1]
    bisector = ends + 0.5 * (begins - ends)
    reach = surface["v"].values[[0, -1]] / np.cos(0.5 * (begins - ends))[:, None]
    easting = surface["easting"].values[:, None] - reach * np.sin(bisector)[:, None]
    northing = surface["northing"].values[:, None] + reach * np.cos(bisector)[:, None]
    return {"easting": _finite_span(easting), "northing": _finite_span(northing)}


def _finite_span(values: Values) -> tuple[float, float]:
    """Minimum and maximum of the finite values."""
    floats = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(floats)
    return (
        float(np.min(floats, where=finite, initial=np.inf)),
        float(np.max(floats, where=finite, initial=-np.inf)),
    )
