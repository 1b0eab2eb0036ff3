"""Holes in a surface, and interpolation over small ones.

A hole is a set of nodes without height that are neighbours by their sides. It is interior if it
does not reach the edge of the grid; nodes missing at the edge are ground that was not surveyed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from trueterrain.core.errors import SchemaError
from trueterrain.surface import _kernels

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_REPORTED = 10  # of the largest holes that are listed
_MAX_BATCH = 50_000  # nodes of one system of equations, unless a hole has more


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
    stretched membrane: they have no extremes of their own and are exact for planes.

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
    dims = surface["height"].dims
    axes = [np.asarray(surface[dim], dtype=np.float64) for dim in dims]
    height = np.asarray(surface["height"], dtype=np.float64)
    holes = _find_holes(height)
    if int(holes.nodes.sum()) == height.size:
        raise SchemaError("is missing everywhere", place="variable height")
    spacing = np.array([float(np.diff(axis).mean()) for axis in axes])
    interior = (holes.low > 0).all(axis=1) & (holes.high < height.shape).all(axis=1)
    extent = (holes.high - holes.low) * spacing
    small = interior & (extent.max(axis=1) <= filling.largest + 1e-9)
    large = np.flatnonzero(interior & ~small)
    centre = np.stack(
        [
            0.5 * (axis[holes.low[large, k]] + axis[holes.high[large, k] - 1])
            for k, axis in enumerate(axes)
        ],
        axis=1,
    )
    order = np.lexsort([*centre.T[::-1], -extent[large].max(axis=1)])[:_REPORTED]
    report = {
        "filled_nodes": int(holes.nodes[small].sum()),
        "filled_holes": int(small.sum()),
        "open_nodes": int(holes.nodes[large].sum()),
        "open_holes": large.size,
        "unseen_nodes": int(holes.nodes[~interior].sum()),
        "largest": [
            {str(dims[0]): a, str(dims[1]): b, "extent": extent[large[k]].tolist()}
            for k, (a, b) in zip(order, centre[order].tolist(), strict=True)
        ],
    }
    return _fill_small_holes(surface, holes, small, spacing, in_place=in_place), report


@dataclass(frozen=True, kw_only=True, eq=False)
class _Holes:
    """Sets of nodes without height that are neighbours."""

    runs: npt.NDArray[np.int32]
    "Row, first and one past the last column of consecutive nodes, shape (run, 3)."

    hole: npt.NDArray[np.int32]
    "Hole that a run belongs to, shape (run,)."

    low: Integers
    "First node along both axes, shape (hole, 2)."

    high: Integers
    "One past the last node along both axes, shape (hole, 2)."

    nodes: Integers
    "Nodes, shape (hole,)."

    transposed: bool
    "Whether runs go along the first axis, so that the axes are exchanged in `runs`."

    def nodes_of(self, wanted: npt.NDArray[np.bool_]) -> Iterator[tuple[Integers, Integers]]:
        """Nodes of some holes along both axes, in batches of whole holes."""
        runs = np.flatnonzero(wanted[self.hole])
        runs = runs[np.argsort(self.hole[runs], kind="stable")]
        ends = np.cumsum(self.nodes[wanted])
        cuts = np.flatnonzero(np.diff(ends // _MAX_BATCH, prepend=0))
        starts = np.searchsorted(self.hole[runs], np.flatnonzero(wanted)[cuts])
        for some in np.split(runs, starts):
            row, begin, end = self.runs[some].T.astype(np.int64)
            length = end - begin
            before = np.cumsum(length) - length
            column = np.arange(length.sum()) + np.repeat(begin - before, length)
            row = np.repeat(row, length)
            if row.size:
                yield (column, row) if self.transposed else (row, column)


def _find_holes(height: Floats) -> _Holes:
    """All sets of nodes without height; runs go along the axis that is contiguous in memory."""
    transposed = abs(height.strides[0]) < abs(height.strides[1])
    cells = height.T if transposed else height
    runs = _kernels.missing_runs(cells)
    hole, count = _kernels.connect_runs(runs)
    low, high = np.full((count, 2), max(height.shape)), np.zeros((count, 2), np.int64)
    nodes = np.zeros(count, np.int64)
    _kernels.measure_holes(runs, hole, low, high, nodes)
    if transposed:
        low, high = low[:, ::-1], high[:, ::-1]
    return _Holes(runs=runs, hole=hole, low=low, high=high, nodes=nodes, transposed=transposed)


def _fill_small_holes(
    surface: xr.Dataset,
    holes: _Holes,
    small: npt.NDArray[np.bool_],
    spacing: Floats,
    *,
    in_place: bool,
) -> xr.Dataset:
    """Surface with heights in the small holes."""
    stated = False  # whether a node without height had a standard deviation
    deviations = {
        name: np.asarray(surface[name]) for name in ("sd", "sd_relative") if name in surface
    }
    filled = np.zeros(surface["height"].shape, np.bool_)
    if "filled" in surface:
        filled |= np.asarray(surface["filled"], np.bool_)
    height = np.asarray(surface["height"], dtype=np.float64)
    if small.any() and not in_place:
        height = height.copy()
    for node in holes.nodes_of(small):
        height[node] = _solve_membrane(height, node, spacing)
        filled[node] = True
        stated = stated or any(not np.isnan(sd[node]).all() for sd in deviations.values())
    if stated:
        deviations = {
            name: np.where(filled, np.nan, sd).astype(sd.dtype) for name, sd in deviations.items()
        }
    result = surface.assign(
        height=surface["height"].copy(data=height),
        filled=(surface["height"].dims, filled, {"units": "1"}),
    )
    return result.assign({name: surface[name].copy(data=sd) for name, sd in deviations.items()})


def _solve_membrane(height: Floats, node: tuple[Integers, Integers], spacing: Floats) -> Floats:
    """Heights of whole holes [m], in the order of their nodes; none is at the edge."""
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
