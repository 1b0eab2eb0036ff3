"""Surfaces reduced to the size of a page: means over blocks of nodes."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.surface import grid_frame, uv_to_xy

Floats = npt.NDArray[np.float64]

_MAX_NODES = 160_000  # on a page: 400 by 400
_MAX_LENGTH = 4000  # nodes along an axis, a limit of graphics cards
_LARGE = 10_000.0  # [m] above, coordinates are shown from a round base
_ROUND = 100.0  # [m] multiple of which the base is


@dataclass(frozen=True, kw_only=True, eq=False)
class Blocks:
    """Means over blocks of nodes; all arrays have the shape of the reduced surface."""

    first: Floats
    "Centres of the blocks along the first axis of the surface: u or northing [m]."

    second: Floats
    "Centres of the blocks along the second axis: v or easting [m]."

    easting: Floats
    "Of the centre of each block [m]."

    northing: Floats
    "Of the centre of each block [m]."

    height: Floats
    "Mean height of each block [m]; NaN where less than half of it has one."

    colour: Floats
    "Mean of the variable that the colour shows; NaN where the height is."

    factors: tuple[int, int]
    "Nodes that became one, along both axes."

    along_line: bool
    "Whether the axes are u and v of a reference line."


def reduce_surface(surface: xr.Dataset, colour: str) -> Blocks:
    """Means over blocks: as small as a page allows, and nearly square on the ground."""
    along_line = "u" in surface.dims
    dims = ("u", "v") if along_line else ("northing", "easting")
    axes = [np.asarray(surface[dim], dtype=np.float64) for dim in dims]
    factors = _thinning_factors(axes)
    first, second = (_block_centres(axis, by) for axis, by in zip(axes, factors, strict=True))
    if along_line:
        u, v = np.meshgrid(first, second, indexing="ij")
        easting, northing = uv_to_xy(grid_frame(surface), u, v)
    else:
        northing, easting = np.meshgrid(first, second, indexing="ij")
    height = _block_means(np.asarray(surface["height"].transpose(*dims), dtype=np.float64), factors)
    shown = _block_means(np.asarray(surface[colour].transpose(*dims), dtype=np.float64), factors)
    return Blocks(
        first=first,
        second=second,
        easting=easting,
        northing=northing,
        height=height,
        colour=np.where(np.isfinite(height), shown, np.nan),
        factors=factors,
        along_line=along_line,
    )


def round_below(values: Floats) -> float:
    """Round base of large coordinates, 0 for small ones [m]."""
    low = float(values.min())
    return math.floor(low / _ROUND) * _ROUND if abs(low) > _LARGE else 0.0


def _thinning_factors(axes: list[Floats]) -> tuple[int, int]:
    spacing = [(axis[-1] - axis[0]) / (axis.size - 1) for axis in axes]
    factors = [1, 1]
    while True:
        sizes = [-(-axis.size // by) for axis, by in zip(axes, factors, strict=True)]
        too_long = [size > _MAX_LENGTH for size in sizes]
        if not any(too_long) and math.prod(sizes) <= _MAX_NODES:
            return factors[0], factors[1]
        if any(too_long):
            grown = int(too_long[1])
        else:  # the axis along which a block is shorter, unless it has two nodes left
            blocks = [step * by for step, by in zip(spacing, factors, strict=True)]
            grown = int(blocks[1] < blocks[0])
            grown = grown if sizes[grown] > 2 else 1 - grown
        factors[grown] += 1


def _block_centres(axis: Floats, by: int) -> Floats:
    starts = np.arange(0, axis.size, by)
    return np.asarray(np.add.reduceat(axis, starts) / _block_lengths(axis.size, by))


def _block_means(values: Floats, factors: tuple[int, int]) -> Floats:
    known = np.isfinite(values)
    total, seen = np.where(known, values, 0.0), known.astype(np.float64)
    for axis, by in enumerate(factors):
        starts = np.arange(0, values.shape[axis], by)
        total = np.add.reduceat(total, starts, axis=axis)
        seen = np.add.reduceat(seen, starts, axis=axis)
    cells = np.outer(*(_block_lengths(n, by) for n, by in zip(values.shape, factors, strict=True)))
    means: Floats = np.full(total.shape, np.nan)
    np.divide(total, seen, out=means, where=2 * seen >= cells)
    return means


def _block_lengths(nodes: int, by: int) -> npt.NDArray[np.int64]:
    starts = np.arange(0, nodes, by)
    return np.diff(starts, append=nodes)
