"""Heights of a pass in the search areas of a reference path, accumulated block by block."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
import xarray as xr

from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.observations.overlap import STEP, Overlap, cell_keys, height_steps
from trueterrain.alignment.observations.sparse_sums import (
    Flags,
    Floats,
    Integers,
    SparseSums,
    contains_keys,
)
from trueterrain.geometry.grid_frame import xy_to_uv

_LOW = 1 << 16  # heights are split in two parts, so that sums of squares fit in float64 exactly
_STRETCH = 1.5  # maximum compression of stations on the inside of a bend
_FEW = 1 << 14  # search areas checked at once


class SearchArea(Protocol):
    """Search area around a reference point, such as those of `trueterrain.profile`."""

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""

    @property
    def shape(self) -> IntEnum:
        """0 for an ellipse, 1 for a rectangle."""


class SearchShape(IntEnum):
    """Shapes of search areas."""

    ELLIPSE = 0
    RECTANGLE = 1


@dataclass(frozen=True, kw_only=True)
class SearchDisc:
    """Disc around the reference point: the search area of the thesis."""

    radius: float = 0.2
    "Radius of the disc [m]."

    def __post_init__(self) -> None:
        """Check the radius."""
        if not 0 < self.radius < np.inf:
            message = f"radius must be greater than 0 m, got {self.radius}."
            raise ValueError(message)

    @property
    def half_axes(self) -> tuple[float, float]:
        """Half length along and half width across the path [m]."""
        return self.radius, self.radius

    @property
    def shape(self) -> SearchShape:
        """Ellipse, with equal axes."""
        return SearchShape.ELLIPSE


@dataclass(frozen=True, kw_only=True, eq=False)
class HeightHistograms:
    """Histogram of the heights at each reference point (thesis Fig. 4-4)."""

    bin_width: float
    "Width of the bins [m]; the edges are whole multiples of it."

    start: Integers
    "First entry of each reference point, then the number of entries, shape (s + 1,)."

    number: Integers
    "Occupied bins [number, number + 1) * bin_width, ascending for each reference point."

    quantity: Integers
    "Number of heights in each bin."

    def __getitem__(self, index: int) -> tuple[Floats, Integers]:
        """Edges of the bins of one reference point, and the number of heights in each."""
        index = range(self.start.size - 1)[index]
        part = slice(self.start[index], self.start[index + 1])
        number = self.number[part]
        if not number.size:
            return np.empty(0), np.empty(0, np.int64)
        quantity = np.zeros(number[-1] - number[0] + 1, np.int64)
        quantity[number - number[0]] = self.quantity[part]
        return np.arange(number[0], number[-1] + 2) * self.bin_width, quantity

    @property
    def median(self) -> Floats:
        """Median of each reference point, linear within a bin, shape (s,) [m]."""
        n = self.start.size - 1
        owner = np.repeat(np.arange(n), np.diff(self.start))
        total = np.append(0, np.cumsum(self.quantity))
        before = total[:-1] - total[self.start[:-1]][owner]  # heights in lower bins
        half = 0.5 * (total[self.start[1:]] - total[self.start[:-1]])
        holds = (before <= half[owner]) & (before + self.quantity > half[owner])
        median = np.full(n, np.nan)
        within = (half[owner] - before)[holds] / self.quantity[holds]
        median[owner[holds]] = (self.number[holds] + within) * self.bin_width
        return median


@dataclass(frozen=True, kw_only=True, eq=False)
class AreaHeights:
    """Statistics of the heights of one pass in the search areas, of shape (s,)."""

    count: Integers
    "Number of heights."

    mean: Floats
    "Their mean [m]."

    sd: Floats
    "Their standard deviation [m]; NaN with fewer than two."

    histograms: HeightHistograms
    "Their histograms."


class AreaSums:
    """Accumulate the heights in the search areas of a path.

    Parameters
    ----------
    path : ReferencePath
        Reference path.
    area : SearchArea
        Search area around each reference point.
    bin_width : float
        Width of the bins of the histograms, a multiple of `STEP` [m].
    """

    def __init__(self, path: ReferencePath, area: SearchArea, bin_width: float) -> None:
        self._path, self._area = path, area
        self._bin = round(bin_width / STEP)
        far = float(np.hypot(*area.half_axes))
        self._x, self._y = path.places
        self._width = far + float(np.abs(0.0 if path.lateral is None else path.lateral).max())
        self._frame = path.frame(self._width + path.curve.spacing, far + path.curve.spacing)
        n = path.curve.easting.size
        reach = int(np.ceil(_STRETCH * far / path.curve.spacing)) + 1
        steps = np.arange(-reach, reach + 1)
        self._steps = steps[:n] if path.curve.closed else steps  # each search area once
        self._cos, self._sin = np.cos(path.curve.heading), np.sin(path.curve.heading)
        self._sums: Any = np.zeros((6, n), np.int64)
        self._histograms = SparseSums(1)

    def add(self, block: xr.Dataset) -> None:
        """Add points; those outside all search areas are ignored.

        Parameters
        ----------
        block : xarray.Dataset
            Points.
        """
        for x, y, height, _ in height_steps(block):
            u, v = xy_to_uv(self._frame, x, y)
            near = np.flatnonzero(np.abs(v) <= self._width)  # false for NaN
            if near.size:
                nearest = np.rint(u[near] / self._path.curve.spacing).astype(np.int64)
                self._add(x[near], y[near], height[near], nearest)

    def _add(self, x: Floats, y: Floats, height: Integers, nearest: Integers) -> None:
        n = self._path.curve.easting.size
        for step in self._steps:
            k = nearest + step
            k = k % n if self._path.curve.closed else k
            some = np.flatnonzero((k >= 0) & (k < n))
            k = k[some]
            dx, dy = x[some] - self._x[k], y[some] - self._y[k]
            cos, sin = self._cos[k], self._sin[k]
            inside = _inside_area(self._area, cos * dx + sin * dy, cos * dy - sin * dx)
            k, h = k[inside], height[some][inside]
            high, low = h // _LOW, h % _LOW
            for sums, value in zip(
                self._sums, (None, high, low, high * high, high * low, low * low), strict=True
            ):
                # integers below 2^53 are exact in float64
                sums += np.rint(np.bincount(k, value, minlength=n)).astype(np.int64)
            self._histograms.add(k, h // self._bin)

    def heights(self) -> AreaHeights:
        """Counts, means and standard deviations of the heights."""
        # Python integers are exact, so results do not depend on the order of the points
        n, high, low, high2, mixed, low2 = self._sums.astype(object)
        total = high * _LOW + low
        squares = high2 * _LOW**2 + 2 * mixed * _LOW + low2
        count = self._sums[0]
        some, more = np.maximum(count, 1), np.maximum(count - 1, 1)
        variance = (n * squares - total**2) / (some * more).astype(object)
        k, number, (quantity,) = self._histograms.sums()
        return AreaHeights(
            count=count.copy(),
            mean=np.where(count > 0, (total / some.astype(object)).astype(float), np.nan) * STEP,
            sd=np.where(count > 1, np.sqrt(variance.astype(float)), np.nan) * STEP,
            histograms=HeightHistograms(
                bin_width=self._bin * STEP,
                start=np.searchsorted(k, np.arange(count.size + 1)),
                number=number,
                quantity=quantity,
            ),
        )


def inside_overlap(overlap: Overlap, path: ReferencePath, area: SearchArea) -> Flags:
    """Whether search areas lie completely inside an overlap.

    Parameters
    ----------
    overlap : Overlap
        The overlap.
    path : ReferencePath
        Path with the reference points.
    area : SearchArea
        Search area around each.

    Returns
    -------
    numpy.ndarray of bool, shape (s,)
        True if the overlap contains the reference point and all cells whose centres are in the
        area.
    """
    far = float(np.hypot(*area.half_axes))
    reach = int(np.ceil(far / overlap.cell)) + 1
    steps = np.arange(-reach, reach + 1)
    easting, northing = path.places
    inside_all = overlap.holds(easting, northing)
    for begin in range(0, path.curve.easting.size, _FEW):
        part = slice(begin, begin + _FEW)
        x, y, heading = easting[part], northing[part], path.curve.heading[part]
        cos, sin = np.cos(heading), np.sin(heading)
        for column in steps:
            for row in steps:
                cx, cy = (
                    (np.floor(at / overlap.cell) + step + 0.5) * overlap.cell
                    for at, step in ((x, column), (y, row))
                )
                dx, dy = cx - x, cy - y
                inside = _inside_area(area, cos * dx + sin * dy, cos * dy - sin * dx)
                there = contains_keys(overlap.key, cell_keys(cx, cy, overlap.cell))
                inside_all[part] &= there | ~inside
    return inside_all


def _inside_area(area: SearchArea, longitudinal: Floats, lateral: Floats) -> Flags:
    """Whether an area contains positions, relative to the path."""
    a, b = area.half_axes
    if int(area.shape) == SearchShape.RECTANGLE:
        return (np.abs(longitudinal) <= a) & (np.abs(lateral) <= b)
    return np.asarray((longitudinal / a) ** 2 + (lateral / b) ** 2 <= 1.0)
