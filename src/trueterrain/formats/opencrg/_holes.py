"""Fill holes within the cross-sections of a surface, which OpenCRG does not allow."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing

from trueterrain.core.row_blocks import height_blocks, load_heights, row_blocks
from trueterrain.formats.opencrg._rules import interior_holes

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


def fill_interior(surface: xr.Dataset) -> xr.Dataset:
    """Fill holes between the outermost heights of each cross-section.

    The heights of a hole solve the discrete Laplace equation with the heights around it as boundary
    values: a stretched membrane, without new extremes, and exact for planes. Nodes that are missing
    at the left and right edge stay missing.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line.

    Returns
    -------
    xarray.Dataset
        The surface without holes. The variable ``filled`` marks all filled nodes, also those filled
        before; ``attrs["filled"]`` counts those filled now. Standard deviations are NaN there.

    Raises
    ------
    ValueError
        If the surface is a map.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[0, 1, 2], [0, np.nan, 2], [np.nan, 1, 2]], u=[0, 1, 2], v=[0, 1, 2],
    ...                     easting=[0, 1, 2], northing=[0, 0, 0])
    >>> filled = fill_interior(road)
    >>> filled.height.values[1], filled.attrs["filled"]
    (array([0., 1., 2.]), 1)
    """
    if "u" not in surface.dims:
        message = "surface must have the dimensions (u, v), got a map"
        raise ValueError(message)
    columns = surface.sizes["v"]
    holes = [rows.start * columns + holes_in(block) for rows, block in height_blocks(surface)]
    return patch_surface(surface, np.concatenate(holes)).load()


def holes_in(height: Floats) -> Index:
    """Flat indices of the holes in some cross-sections."""
    valid = np.isfinite(height)
    if valid.all():
        return np.empty(0, dtype=np.int64)
    width = height.shape[1] - valid.argmax(axis=1) - valid[:, ::-1].argmax(axis=1)
    # a row has a hole if fewer nodes are valid than lie between its outermost heights
    broken = np.flatnonzero(width > valid.sum(axis=1))
    row, column = np.nonzero(interior_holes(height[broken]))
    return np.asarray(broken[row] * height.shape[1] + column)


def patch_surface(surface: xr.Dataset, holes: Index) -> xr.Dataset:
    """The result of `fill_interior`, with the filled nodes inserted only when values are read.

    So a large surface, in memory or on disk, is not copied for a few nodes.
    """
    shape = surface["height"].shape
    if "filled" in surface:
        filled = surface["filled"].variable
    else:
        filled = xr.Variable(("u", "v"), np.broadcast_to(np.False_, shape), {"units": "1"})
    changed = {"filled": filled}
    if holes.size:
        changed["filled"] = _patch_variable(filled, holes, np.ones(holes.size, dtype=bool))
        changed["height"] = _patch_variable(
            surface["height"].variable, holes, _solve_membrane(surface, holes)
        )
        for name in ("sd", "sd_relative"):
            if name not in surface:
                continue
            sd = surface[name].variable
            missing = np.full(holes.size, np.nan, dtype=np.result_type(sd.dtype, np.float32))
            changed[name] = _patch_variable(sd, holes, missing)
    return surface.assign(changed).assign_attrs(filled=holes.size)


def _patch_variable(variable: xr.Variable, index: Index, values: npt.NDArray[Any]) -> xr.Variable:
    # copy on write and cached once it is loaded, like arrays that xarray opens from disk
    lazy = indexing.LazilyIndexedArray(_PatchedArray(variable, index, values))
    # these classes of xarray have no type annotations
    data = indexing.MemoryCachedArray(indexing.CopyOnWriteArray(lazy))  # type: ignore[arg-type,no-untyped-call]  # as xarray does
    return xr.Variable(variable.dims, data, variable.attrs, variable.encoding)


class _PatchedArray(BackendArray):
    """Lazy array with other values at some nodes, which are inserted on reading."""

    def __init__(self, source: xr.Variable, index: Index, values: npt.NDArray[Any]) -> None:
        self.shape = source.shape
        self.dtype = values.dtype
        self._source = source
        self._index = index  # flat, ascending
        self._values = values

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        support = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, support, self._read)

    def _read(self, key: tuple[int | slice, ...]) -> npt.NDArray[Any]:
        rows = np.arange(self.shape[0])[key[0]]
        each = np.atleast_1d(rows)
        block = self._source[key[0]].values.astype(self.dtype).reshape(each.size, self.shape[1])
        ends = [each[0], each[-1] + 1] if each.size else [0, 0]
        first, last = np.searchsorted(self._index, np.multiply(ends, self.shape[1]))
        row, column = np.divmod(self._index[first:last], self.shape[1])
        at = np.searchsorted(each, row)
        there = each[at] == row
        block[at[there], column[there]] = self._values[first:last][there]
        return np.asarray(block.reshape(*np.shape(rows), self.shape[1])[..., key[1]])


def _solve_membrane(surface: xr.Dataset, holes: Index) -> Floats:
    """Heights of the holes [m], from the discrete Laplace equation.

    For each hole, sum over u and v of the second differences of height = 0. Neighbours that are
    holes are unknowns of the sparse system, the others enter its right-hand side.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    shape = surface["height"].shape
    rim = _heights_around(surface, holes)
    rows: list[Index] = []
    columns: list[Index] = []
    weights: list[Floats] = []
    constant = np.zeros(holes.size)
    for axis, name in enumerate(("u", "v")):
        positions = np.asarray(surface[name], float)
        equation, before, after, to_before, to_after = _second_differences(
            holes, rim, shape, axis, positions
        )
        rows.append(equation)
        columns.append(equation)
        weights.append(-(to_before + to_after))
        for neighbour, weight in ((before, to_before), (after, to_after)):
            number = _find_indices(holes, neighbour)
            hole = number >= 0
            rows.append(equation[hole])
            columns.append(number[hole])
            weights.append(weight[hole])
            known = rim.heights[_find_indices(rim.nodes, neighbour[~hole])]
            np.add.at(constant, equation[~hole], -weight[~hole] * known)
    entries = (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns)))
    matrix = coo_array(entries, shape=(holes.size, holes.size)).tocsc()
    return np.asarray(spsolve(matrix, constant))


class _HoleRim(NamedTuple):
    """Nodes with a height next to holes."""

    nodes: Index  # flat, ascending
    heights: Floats


def _heights_around(surface: xr.Dataset, holes: Index) -> _HoleRim:
    rows, columns = surface["height"].shape
    neighbours = np.concatenate([holes - columns, holes - 1, holes + 1, holes + columns])
    neighbours = np.unique(neighbours[(neighbours >= 0) & (neighbours < rows * columns)])
    neighbours = neighbours[_find_indices(holes, neighbours) < 0]
    found = np.empty(neighbours.size)
    for block in row_blocks((rows, columns)):
        first, last = np.searchsorted(neighbours, [block.start * columns, block.stop * columns])
        if first < last:
            flat = load_heights(surface, block).reshape(-1)
            found[first:last] = flat[neighbours[first:last] - block.start * columns]
    known = np.isfinite(found)
    return _HoleRim(neighbours[known], found[known])


def _find_indices(ascending: Index, wanted: Index) -> Index:
    """Index of each value in an ascending array, -1 for values that are not in it."""
    at = np.searchsorted(ascending, wanted)
    inside = at < ascending.size
    inside[inside] = ascending[at[inside]] == wanted[inside]
    return np.where(inside, at, -1)


def _second_differences(
    holes: Index, rim: _HoleRim, shape: tuple[int, ...], axis: int, positions: Floats
) -> tuple[Index, Index, Index, Floats, Floats]:
    """Second differences of height along an axis, for holes with a node on both sides.

    With distances a before and b after the node, h'' = 2/(a(a+b)) h_before + 2/(b(a+b)) h_after
    less their sum times h. Holes with a neighbour on one side only get no equation along this axis:
    a one-sided difference would not vanish for planes. Across the road each hole has both
    neighbours, so no equation is empty.

    Returns
    -------
    number : ndarray
        Numbers of the holes.
    before, after : ndarray
        Flat indices of both neighbours.
    to_before, to_after : ndarray
        Their weights [1/m²].
    """
    along = np.divmod(holes, shape[1])[axis]
    step = shape[1] if axis == 0 else 1
    number = np.flatnonzero((along > 0) & (along < positions.size - 1))
    for offset in (-step, step):
        node = holes[number] + offset
        number = number[(_find_indices(holes, node) >= 0) | (_find_indices(rim.nodes, node) >= 0)]
    at = along[number]
    left = positions[at] - positions[at - 1]
    right = positions[at + 1] - positions[at]
    to_before, to_after = 2 / (left * (left + right)), 2 / (right * (left + right))
    return number, holes[number] - step, holes[number] + step, to_before, to_after
