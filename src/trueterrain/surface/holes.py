"""Holes in a surface, and interpolation over small ones.

A hole is a set of nodes without height that are neighbours by their sides. It is interior if it
does not reach the edge of the grid; nodes missing at the edge are ground that was not surveyed.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from trueterrain.core.errors import SchemaError
from trueterrain.core.row_blocks import height_blocks, load_heights, surface_blocks
from trueterrain.surface import _kernels

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_REPORTED = 10  # of the largest holes that are listed
_MAX_BANDED = 2_000_000_000  # operations up to which a banded solution is faster than a sparse one


@dataclass(frozen=True, kw_only=True)
class HoleSettings:
    """Which holes are filled."""

    largest: float = 0.1
    "Extent of the largest hole that is filled, along either axis [m]; 0 for none."

    def __post_init__(self) -> None:
        """Check the value."""
        if not self.largest >= 0:
            message = f"largest must be at least 0 m, got {self.largest}."
            raise ValueError(message)


def fill_holes(
    surface: xr.Dataset, filling: HoleSettings = HoleSettings(), *, in_place: bool = False
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Fill interior holes up to a size, and report all holes.

    The heights of a hole solve the discrete Laplace equation between the heights around it, like a
    stretched membrane: they have no extremes of their own and are exact for planes. Each hole is
    solved by itself, so the result does not depend on the blocks in which a surface is read. For a
    surface that does not fit into memory use `count_holes` and `filled_blocks`.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map, with equally spaced axes.
    filling : HoleSettings
        Which holes are filled.
    in_place : bool
        Fill the holes of `surface` itself, which saves the memory of a copy.

    Returns
    -------
    surface : xarray.Dataset
        ``filled`` marks the nodes that were filled now or before; their count is 0 and their
        standard deviation NaN.
    report : dict
        ``filled_nodes`` and ``filled_holes``; ``open_nodes`` and ``open_holes`` of interior holes
        that were too large, and ``largest``: position of the centre and extent [m] of the largest
        of them; ``unseen_nodes``: those without height that reach the edge.

    Raises
    ------
    SchemaError
        If the surface has no height at all.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[0, 1, 2], [0, np.nan, 2], [0, 1, np.nan]], u=[0, 1, 2], v=[0, 1, 2],
    ...                     easting=[0, 1, 2], northing=[0, 0, 0])
    >>> whole, report = fill_holes(road, HoleSettings(largest=1.0))
    >>> whole.height.values[1], report["filled_nodes"], report["unseen_nodes"]
    (array([0., 1., 2.]), 1, 1)
    """
    report = count_holes(surface, filling)
    dims = surface["height"].dims
    height = np.asarray(surface["height"], dtype=np.float64)
    if report["filled_holes"] and not in_place:
        height = height.copy()
    marked = np.zeros(height.shape, np.bool_)
    if "filled" in surface:
        marked |= np.asarray(surface["filled"], np.bool_)
    if report["filled_holes"]:
        raw = surface.assign(height=(dims, height))
        for rows, values, filled in filled_blocks(raw, filling):
            height[rows] = values
            marked[rows] |= filled
    result = surface.assign(
        height=surface["height"].copy(data=height), filled=(dims, marked, {"units": "1"})
    )
    return result.assign(
        {
            name: surface[name].copy(data=without_filled(surface[name].values, marked))
            for name in ("sd", "sd_relative")
            if name in surface
        }
    ), report


def without_filled(sd: npt.NDArray[Any], filled: npt.NDArray[np.bool_]) -> npt.NDArray[Any]:
    """Standard deviations without those of filled nodes.

    Parameters
    ----------
    sd : numpy.ndarray
        Standard deviations [m].
    filled : numpy.ndarray of bool
        Nodes that were filled, of the same shape.

    Returns
    -------
    numpy.ndarray
        NaN where a node was filled; the same array if it is so already.

    Examples
    --------
    >>> without_filled(np.array([0.1, 0.2]), np.array([False, True]))
    array([0.1, nan])
    """
    if np.isnan(sd[filled]).all():
        return sd
    return np.where(filled, np.nan, sd).astype(sd.dtype)


def count_holes(surface: xr.Dataset, filling: HoleSettings = HoleSettings()) -> dict[str, Any]:
    """Numbers and sizes of the holes in a surface, read block by block.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map, in memory or on disk.
    filling : HoleSettings
        Which holes are to be filled.

    Returns
    -------
    dict
        Report as by `fill_holes`.

    Raises
    ------
    SchemaError
        If the surface has no height at all.
    """
    grid = _HoleGrid.of(surface, filling)
    census = _HoleCensus(grid)
    for rows, height in height_blocks(surface):
        census.add(rows, np.ascontiguousarray(height))
    return census.report()


def filled_blocks(
    surface: xr.Dataset, filling: HoleSettings = HoleSettings()
) -> Iterator[tuple[slice, Floats, npt.NDArray[np.bool_]]]:
    """Fill interior holes up to a size, block by block.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map, in memory or on disk.
    filling : HoleSettings
        Which holes are filled.

    Yields
    ------
    rows : slice
        Rows of the block.
    height : numpy.ndarray
        Their heights [m]. The surface may be changed in these rows before the next block is taken.
    filled : numpy.ndarray of bool
        Nodes of them that were filled.
    """
    grid = _HoleGrid.of(surface, filling)
    halo = grid.limit[0] + 1
    above = np.empty((0, grid.shape[1]))  # rows before the block, as they were
    for rows in surface_blocks(surface):
        there = slice(rows.start, min(rows.stop + halo, grid.shape[0]))
        around = np.concatenate([above, load_heights(surface, there)])
        own = slice(len(above), len(above) + rows.stop - rows.start)
        above = around[max(own.stop - halo, 0) : own.stop].copy()
        filled = _fill_around(around, grid)
        yield rows, around[own], filled[own]


@dataclass(frozen=True, kw_only=True, eq=False)
class _HoleGrid:
    """Axes of a surface, and the extent of the largest hole that is filled."""

    dims: tuple[str, str]
    axes: tuple[Floats, Floats]
    spacing: Floats
    limit: tuple[int, int]
    "Extent of the largest hole that is filled, along both axes [nodes]."

    @classmethod
    def of(cls, surface: xr.Dataset, filling: HoleSettings) -> "_HoleGrid":
        first, second = (str(dim) for dim in surface["height"].dims)
        axes = tuple(np.asarray(surface[dim], dtype=np.float64) for dim in (first, second))
        spacing = np.array([float(np.diff(axis).mean()) for axis in axes])
        limit = np.floor((filling.largest + 1e-9) / spacing).astype(int)
        return cls(
            dims=(first, second),
            axes=(axes[0], axes[1]),
            spacing=spacing,
            limit=(int(limit[0]), int(limit[1])),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.axes[0].size, self.axes[1].size


class _HoleCensus:
    """Counts of holes over blocks of rows; holes that reach the last row so far stay open."""

    def __init__(self, grid: _HoleGrid) -> None:
        self._grid = grid
        self._edge_runs = np.empty((0, 3), np.int32)  # in the last row
        self._edge_hole = np.empty(0, np.int64)  # open hole of each of them
        self._open = _Extents.empty(0)
        self._filled, self._wide = np.zeros(2, np.int64), np.zeros(2, np.int64)  # nodes, holes
        self._unseen = 0  # nodes
        self._largest: list[tuple[float, float, float, list[float]]] = []

    def add(self, rows: slice, height: Floats) -> None:
        """Add the rows that follow."""
        before = len(self._edge_runs)
        runs = _kernels.missing_runs(height)
        runs[:, 0] += 1  # the last row so far is row 0
        runs = np.concatenate([self._edge_runs, runs])
        part, count = _kernels.connect_runs(runs)
        group, groups = _join(part[:before], count, self._edge_hole, len(self._open.nodes))
        found = _Extents.empty(groups)
        hole = group[part]
        _kernels.measure_holes(runs[before:], hole[before:], found.low, found.high, found.nodes)
        found.low[:, 0] += rows.start - 1
        found.high[:, 0] += rows.start - 1
        found.take(self._open, group[count:])
        last = runs[:, 0] == height.shape[0]
        is_open = np.zeros(groups, np.bool_)
        is_open[hole[last]] = True
        self._close(found.of(~is_open))
        number = np.cumsum(is_open) - 1
        self._open = found.of(is_open)
        self._edge_runs, self._edge_hole = runs[last], number[hole[last]]
        self._edge_runs[:, 0] = 0

    def report(self) -> dict[str, Any]:
        """Report of `fill_holes`, after all rows."""
        self._close(self._open)
        self._open = _Extents.empty(0)
        if self._unseen == math.prod(self._grid.shape):
            raise SchemaError("is missing everywhere", place="variable height")
        first, second = self._grid.dims
        return {
            "filled_nodes": int(self._filled[0]),
            "filled_holes": int(self._filled[1]),
            "open_nodes": int(self._wide[0]),
            "open_holes": int(self._wide[1]),
            "unseen_nodes": self._unseen,
            "largest": [
                {first: a, second: b, "extent": extent} for _, a, b, extent in self._largest
            ],
        }

    def _close(self, holes: "_Extents") -> None:
        grid = self._grid
        size = holes.high - holes.low
        interior = (holes.low > 0).all(axis=1) & (holes.high < grid.shape).all(axis=1)
        small = interior & (size <= grid.limit).all(axis=1)
        wide = interior & ~small
        self._unseen += int(holes.nodes[~interior].sum())
        self._filled += [holes.nodes[small].sum(), small.sum()]
        self._wide += [holes.nodes[wide].sum(), wide.sum()]
        for at in np.flatnonzero(wide):
            a, b = (
                0.5 * float(axis[low] + axis[high - 1])
                for axis, low, high in zip(grid.axes, holes.low[at], holes.high[at], strict=True)
            )
            extent = (size[at] * grid.spacing).tolist()
            self._largest.append((-max(extent), a, b, extent))
        self._largest = sorted(self._largest)[:_REPORTED]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Extents:
    """First and one past the last node along both axes, shape (hole, 2), and nodes of holes."""

    low: Integers
    high: Integers
    nodes: Integers

    @classmethod
    def empty(cls, count: int) -> "_Extents":
        return cls(
            low=np.full((count, 2), np.iinfo(np.int32).max, np.int64),
            high=np.zeros((count, 2), np.int64),
            nodes=np.zeros(count, np.int64),
        )

    def of(self, chosen: npt.NDArray[np.bool_]) -> "_Extents":
        """Some of the holes."""
        return _Extents(low=self.low[chosen], high=self.high[chosen], nodes=self.nodes[chosen])

    def take(self, parts: "_Extents", hole: Integers) -> None:
        """Add parts to the holes that they belong to."""
        np.minimum.at(self.low, hole, parts.low)
        np.maximum.at(self.high, hole, parts.high)
        np.add.at(self.nodes, hole, parts.nodes)


def _join(
    part: npt.NDArray[np.int32], parts: int, hole: Integers, holes: int
) -> tuple[Integers, int]:
    """Connected groups of `parts` sets of this block and `holes` open ones; run k joins two."""
    size = parts + holes
    if not holes:
        return np.arange(size), size
    joined = coo_array((np.ones(part.size), (part, parts + hole)), shape=(size, size))
    groups, group = connected_components(joined, directed=False)
    return group.astype(np.int64), int(groups)


def _fill_around(height: Floats, grid: _HoleGrid) -> npt.NDArray[np.bool_]:
    """Fill the small holes of some rows in place; those that reach the first or last row stay."""
    runs = _kernels.missing_runs(height)
    hole, count = _kernels.connect_runs(runs)
    found = _Extents.empty(count)
    _kernels.measure_holes(runs, hole, found.low, found.high, found.nodes)
    inside = (found.low > 0).all(axis=1) & (found.high < height.shape).all(axis=1)
    small = np.asarray(inside & (found.high - found.low <= grid.limit).all(axis=1))
    chosen = np.flatnonzero(small[hole])
    runs = runs[chosen[np.argsort(hole[chosen], kind="stable")]]
    starts = np.concatenate([[0], np.cumsum(np.bincount(hole[chosen], minlength=count)[small])])
    filled = np.zeros(height.shape, np.bool_)
    weights = 1 / grid.spacing**2
    left = _kernels.solve_holes(height, runs, starts, weights, _MAX_BANDED, filled)
    for at in np.flatnonzero(left):
        some = runs[starts[at] : starts[at + 1]]
        node = tuple(
            np.concatenate(
                [np.stack([np.full(b - a, row), np.arange(a, b)]) for row, a, b in some.tolist()],
                axis=1,
            )
        )
        height[node] = _solve_membrane(height, node, grid.spacing)
        filled[node] = True
    return filled


def _solve_membrane(height: Floats, node: tuple[Any, ...], spacing: Floats) -> Floats:
    """Heights of a hole with many nodes [m], in their order; none is at the edge."""
    # five-point stencil: sum of (neighbour - node) / step² = 0; known neighbours go to the right
    count = node[0].size
    place = np.ravel_multi_index(node, height.shape)
    order = np.argsort(place)
    rows, columns, weights = [np.arange(count)], [np.arange(count)], []
    diagonal, constant = np.zeros(count), np.zeros(count)
    for axis, step in enumerate(spacing):
        for by in (-1, 1):
            neighbour = tuple(at + (by if k == axis else 0) for k, at in enumerate(node))
            weight = 1 / step**2
            there = np.ravel_multi_index(neighbour, height.shape)
            found = order[np.searchsorted(place, there, sorter=order).clip(max=count - 1)]
            is_hole = place[found] == there
            diagonal -= weight
            rows.append(np.flatnonzero(is_hole))
            columns.append(found[is_hole])
            weights.append(np.full(int(is_hole.sum()), weight))
            constant -= np.where(is_hole, 0.0, weight * height[neighbour])
    entries = (
        np.concatenate([diagonal, *weights]),
        (np.concatenate(rows), np.concatenate(columns)),
    )
    matrix = coo_array(entries, shape=(count, count)).tocsc()
    return np.asarray(spsolve(matrix, constant))
