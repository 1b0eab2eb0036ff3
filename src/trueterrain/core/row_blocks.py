"""Blocks of rows of large surfaces, so that no surface has to fit into memory.

A surface that is opened from a store holds its values on disk. Functions that visit all nodes take
them block by block, by the iterators of this module; of a surface in memory the blocks are views.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

Floats = npt.NDArray[np.float64]

_NODES = 1 << 18  # nodes in a block: 2 MB as float64, which fits into the cache


def row_blocks(shape: tuple[int, ...], multiple: int = 1) -> Iterator[slice]:
    """Slices of the rows of a grid; their lengths are multiples of `multiple`.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns.
    multiple : int
        Rows of a chunk on disk.

    Yields
    ------
    slice
        Rows, some 260 000 nodes at a time.

    Examples
    --------
    >>> [(rows.start, rows.stop) for rows in row_blocks((5, 200_000), 2)]
    [(0, 2), (2, 4), (4, 5)]
    """
    rows, columns = shape
    size = -(-max(1, _NODES // max(1, columns)) // multiple) * multiple
    for start in range(0, rows, size):
        yield slice(start, min(start + size, rows))


def surface_blocks(surface: xr.Dataset) -> Iterator[slice]:
    """Slices of the rows of a surface; of a surface on disk they are whole chunks.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Yields
    ------
    slice
        Rows of its first dimension.
    """
    yield from row_blocks(surface["height"].shape, stored_rows(surface) or 1)


def stored_rows(surface: xr.Dataset) -> int | None:
    """Rows of a chunk of a surface on disk.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Returns
    -------
    int or None
        Rows; None if the surface was made in memory.
    """
    height = surface["height"]
    rows: int | None = height.encoding.get("preferred_chunks", {}).get(height.dims[0])
    return rows


def load_rows(surface: xr.Dataset, name: str, rows: slice) -> npt.NDArray[Any]:
    """Values of some rows of a variable; of a surface on disk only these are read.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    name : str
        Variable of it whose first dimension is that of the rows.
    rows : slice
        Rows.

    Returns
    -------
    numpy.ndarray
        Values, a view where the surface is in memory.
    """
    return np.asarray(surface[name].variable[rows].values)


def load_heights(surface: xr.Dataset, rows: slice) -> Floats:
    """Heights of some rows of a surface.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    rows : slice
        Rows.

    Returns
    -------
    numpy.ndarray
        Heights [m], NaN where there is none.
    """
    return np.asarray(load_rows(surface, "height", rows), dtype=np.float64)


def height_blocks(surface: xr.Dataset) -> Iterator[tuple[slice, Floats]]:
    """Heights of all rows of a surface, block by block.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Yields
    ------
    rows : slice
        Rows of the block.
    height : numpy.ndarray
        Their heights [m].
    """
    for rows in surface_blocks(surface):
        yield rows, load_heights(surface, rows)
