"""Holes in a surface: which there are, and small ones filled.

A hole is a set of nodes without height that touch each other by their sides. It is interior if it
does not reach the edge of the grid: what is missing there is no hole but ground that was not seen.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.errors import SchemaError

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_REPORTED = 10  # largest holes that are named


@dataclass(frozen=True, kw_only=True)
class Filling:
    """Which holes are filled."""

    largest: float = 0.1
    "Extent of the largest hole that is filled, along either axis [m]; 0 for none."

    def __post_init__(self) -> None:
        """Check the value."""
        if not self.largest >= 0:
            message = f"largest must be at least 0 m, got {self.largest}."
            raise ValueError(message)


def fill_holes(
    surface: xr.Dataset, filling: Filling = Filling()
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Fill interior holes up to a size, and say which there are.

    The heights of a hole solve the discrete Laplace equation between the heights around it: a
    stretched membrane, without new extremes, and exact for planes.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map, with equally spaced axes.
    filling : Filling
        Which holes are filled.

    Returns
    -------
    surface : xarray.Dataset
        ``filled`` marks what was filled now or before; there the count is 0 and the standard
        deviation NaN.
    report : dict
        ``filled_nodes`` and ``filled_holes``; ``open_nodes`` and ``open_holes`` of interior holes
        that were too large, and ``largest``: place of the middle and extent [m] of the largest of
        them; ``unseen_nodes``: those without height that reach the edge.

    Raises
    ------
    SchemaError
        If the surface has no height at all.

    Examples
    --------
    >>> from trueterrain.kinds import make_surface
    >>> road = make_surface([[0, 1, 2], [0, np.nan, 2], [0, 1, np.nan]], u=[0, 1, 2], v=[0, 1, 2],
    ...                     easting=[0, 1, 2], northing=[0, 0, 0])
    >>> whole, report = fill_holes(road, Filling(largest=1.0))
    >>> whole.height.values[1], report["filled_nodes"], report["unseen_nodes"]
    (array([0., 1., 2.]), 1, 1)
    """
    from scipy.ndimage import find_objects, label

    dims = surface["height"].dims
    axes = [np.asarray(surface[dim], dtype=np.float64) for dim in dims]
    height = np.array(surface["height"], dtype=np.float64)
    missing = ~np.isfinite(height)
    if missing.all():
        raise SchemaError("is missing everywhere", place="variable height")
    names, _ = label(missing)
    spacing = [float(np.diff(axis).mean()) for axis in axes]
    objects = find_objects(names)
    small = np.zeros(len(objects) + 1, np.bool_)
    large: list[tuple[float, float, tuple[float, ...]]] = []
    unseen = 0
    sizes = np.bincount(names.ravel(), minlength=len(objects) + 1)
    for number, box in enumerate(objects, start=1):
        if any(cut.start == 0 or cut.stop == n for cut, n in zip(box, height.shape, strict=True)):
            unseen += int(sizes[number])
            continue
        extent = [(cut.stop - cut.start) * step for cut, step in zip(box, spacing, strict=True)]
        if max(extent) <= filling.largest + 1e-9:
            small[number] = True
        else:
            middle = tuple(
                float(0.5 * (axis[cut.start] + axis[cut.stop - 1]))
                for axis, cut in zip(axes, box, strict=True)
            )
            large.append((extent[0], extent[1], middle))
    holes = small[names]
    if holes.any():
        height[holes] = _membrane(height, holes, spacing)
    report = {
        "filled_nodes": int(holes.sum()),
        "filled_holes": int(small.sum()),
        "open_nodes": int(missing.sum()) - int(holes.sum()) - unseen,
        "open_holes": len(large),
        "unseen_nodes": unseen,
        "largest": [
            {str(dims[0]): middle[0], str(dims[1]): middle[1], "extent": [a, b]}
            for a, b, middle in sorted(large, key=lambda hole: (-max(hole[:2]), hole[2]))
        ][:_REPORTED],
    }
    return _marked(surface, height, holes), report


def _marked(surface: xr.Dataset, height: Floats, holes: Mask) -> xr.Dataset:
    dims = surface["height"].dims
    before = np.asarray(surface["filled"], bool) if "filled" in surface else np.zeros_like(holes)
    result = surface.assign(
        height=surface["height"].copy(data=height), filled=(dims, before | holes, {"units": "1"})
    )
    if "sd" in surface and holes.any():
        sd = np.where(holes, np.nan, np.asarray(surface["sd"]))
        result["sd"] = surface["sd"].copy(data=sd)
    return result


def _membrane(height: Floats, holes: Mask, spacing: list[float]) -> Floats:
    """Heights of the holes [m], in the order of ``height[holes]``; none is at the edge."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    node = np.nonzero(holes)
    count = node[0].size
    number = np.full(height.shape, -1)
    number[holes] = np.arange(count)
    rows, columns, weights = [np.arange(count)], [np.arange(count)], []
    diagonal, constant = np.zeros(count), np.zeros(count)
    for axis, step in enumerate(spacing):
        for by in (-1, 1):
            beside = tuple(at + (by if k == axis else 0) for k, at in enumerate(node))
            weight = 1 / step**2
            unknown = number[beside]
            is_hole = unknown >= 0
            diagonal -= weight
            rows.append(np.flatnonzero(is_hole))
            columns.append(unknown[is_hole])
            weights.append(np.full(int(is_hole.sum()), weight))
            constant -= np.where(is_hole, 0.0, weight * height[beside])
    entries = (
        np.concatenate([diagonal, *weights]),
        (np.concatenate(rows), np.concatenate(columns)),
    )
    matrix = coo_array(entries, shape=(count, count)).tocsc()
    return np.asarray(spsolve(matrix, constant))
