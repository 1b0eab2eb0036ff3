"""Blocks of cross-sections of large surfaces, so that no second copy is held in memory."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import xarray as xr

Floats = npt.NDArray[np.float64]

_NODES = 1 << 18  # nodes in a block: 2 MB as float64, which fits into the cache


def row_blocks(shape: tuple[int, ...], multiple: int = 1) -> Iterator[slice]:
    """Slices of the cross-sections of a grid; their lengths are multiples of `multiple`."""
    rows, columns = shape
    size = -(-max(1, _NODES // columns) // multiple) * multiple
    for start in range(0, rows, size):
        yield slice(start, min(start + size, rows))


def block_heights(surface: xr.Dataset, rows: slice) -> Floats:
    """Heights of some cross-sections [m]; of a surface on disk only these are loaded."""
    return np.asarray(surface["height"].variable[rows].values, dtype=np.float64)


def height_blocks(surface: xr.Dataset) -> Iterator[tuple[slice, Floats]]:
    """Heights of all cross-sections [m], block by block; of a surface on disk by whole chunks."""
    chunks = surface["height"].encoding.get("preferred_chunks", {})
    for rows in row_blocks(surface["height"].shape, chunks.get("u", 1)):
        yield rows, block_heights(surface, rows)
