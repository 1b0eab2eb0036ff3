"""Holes within the cross-sections of a surface, which OpenCRG does not allow."""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.formats.opencrg._rules import interior_holes

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


def fill_interior(surface: xr.Dataset) -> xr.Dataset:
    """Fill holes between the outermost heights of each cross-section.

    The heights of a hole solve the discrete Laplace equation between the heights around it: a
    stretched membrane, without new extremes, and exact for planes. What is missing at the left and
    right edge stays missing.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line.

    Returns
    -------
    xarray.Dataset
        The surface without holes; the variable ``filled`` marks what was filled now or before, and
        ``attrs["filled"]`` counts what was filled now. A standard deviation is NaN there.

    Raises
    ------
    ValueError
        If the surface is a map.

    Examples
    --------
    >>> from trueterrain.kinds import make_surface
    >>> road = make_surface([[0, 1, 2], [0, np.nan, 2], [np.nan, 1, 2]], u=[0, 1, 2], v=[0, 1, 2],
    ...                     easting=[0, 1, 2], northing=[0, 0, 0])
    >>> filled = fill_interior(road)
    >>> filled.height.values[1], filled.attrs["filled"]
    (array([0., 1., 2.]), 1)
    """
    if "u" not in surface.dims:
        message = "surface must have the dimensions (u, v), got a map"
        raise ValueError(message)
    height = np.array(surface["height"], dtype=np.float64)
    holes = interior_holes(height)
    if holes.any():
        height[holes] = _membrane(
            height, holes, np.asarray(surface["u"], float), np.asarray(surface["v"], float)
        )
    before = np.asarray(surface["filled"], bool) if "filled" in surface else np.zeros_like(holes)
    result = surface.assign(
        height=surface["height"].copy(data=height),
        filled=(("u", "v"), before | holes, {"units": "1"}),
    )
    if "sd" in surface:
        sd = np.where(holes, np.nan, np.asarray(surface["sd"], float))
        result["sd"] = surface["sd"].copy(data=sd)
    return result.assign_attrs(filled=int(holes.sum()))


def _membrane(height: Floats, holes: Mask, u: Floats, v: Floats) -> Floats:
    """Heights of the holes [m], in the order of ``height[holes]``."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    count = int(holes.sum())
    number = np.full(height.shape, -1)
    number[holes] = np.arange(count)
    known = np.isfinite(height) | holes
    rows: list[npt.NDArray[np.int64]] = []
    columns: list[npt.NDArray[np.int64]] = []
    weights: list[Floats] = []
    constant = np.zeros(count)
    for axis, positions in enumerate((u, v)):
        node, before, after, to_before, to_after = _second_differences(
            holes, known, axis, positions
        )
        equation = number[node]
        rows.append(equation)
        columns.append(equation)
        weights.append(-(to_before + to_after))
        for neighbour, weight in ((before, to_before), (after, to_after)):
            hole = holes[neighbour]
            rows.append(equation[hole])
            columns.append(number[neighbour][hole])
            weights.append(weight[hole])
            np.add.at(constant, equation[~hole], -weight[~hole] * height[neighbour][~hole])
    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    matrix = coo_array(entries, shape=(count, count)).tocsc()
    return np.asarray(spsolve(matrix, constant))


Nodes = tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]


def _second_differences(
    holes: Mask, known: Mask, axis: int, positions: Floats
) -> tuple[Nodes, Nodes, Nodes, Floats, Floats]:
    """Holes with a known or unknown height on both sides along an axis, and their weights [1/m²].

    A side alone would not do: then a plane would no longer satisfy the equation. Across the road,
    each hole has both sides, so no equation is empty.
    """
    index = np.nonzero(holes)
    along = index[axis]
    inner = (along > 0) & (along < positions.size - 1)
    index = (index[0][inner], index[1][inner])
    before, after = _shift(index, axis, -1), _shift(index, axis, 1)
    both = known[before] & known[after]
    node, before, after = ((nodes[0][both], nodes[1][both]) for nodes in (index, before, after))
    at = node[axis]
    left = positions[at] - positions[at - 1]
    right = positions[at + 1] - positions[at]
    return node, before, after, 2 / (left * (left + right)), 2 / (right * (left + right))


def _shift(nodes: Nodes, axis: int, by: int) -> Nodes:
    return (nodes[0] + by, nodes[1]) if axis == 0 else (nodes[0], nodes[1] + by)
