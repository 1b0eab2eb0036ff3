"""Coarser surfaces for smooth terrain (thesis 4.4), and the loss of content."""

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.row_blocks import height_blocks, load_heights, load_rows, row_blocks
from trueterrain.surface import _kernels

Floats = npt.NDArray[np.float64]


def down_sample(
    surface: xr.Dataset, factor: tuple[int, int]
) -> tuple[xr.Dataset, dict[str, float]]:
    """Keep every n-th node of a surface, each the mean of the nodes around it; report the loss.

    Smooth terrain needs fewer nodes; the report says how much of its content they lose. A surface
    on disk is read block by block, twice.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    factor : tuple of int
        Nodes that become one, along the first and along the second dimension of the height.

    Returns
    -------
    surface : xarray.Dataset
        As by `coarsen_surface`.
    report : dict
        Loss of content at all nodes that had a height: ``rms`` and ``largest`` difference of the
        coarse surface, bilinear between its nodes [m]; ``kept``: fraction of the variance about
        the mean plane that remains [1].

    Raises
    ------
    ValueError
        If a factor is less than 1, or leaves fewer than 2 nodes.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface(np.arange(15.0).reshape(3, 5), easting=np.arange(5),
    ...                     northing=np.arange(3))
    >>> coarse, report = down_sample(ramp, (1, 2))
    >>> coarse.height.values[0], report["rms"]
    (array([0., 2., 4.]), 0.0)
    """
    coarse = coarsen_surface(surface, factor)
    return coarse, _coarsening_loss(surface, coarse, factor)


def coarsen_surface(surface: xr.Dataset, factor: tuple[int, int]) -> xr.Dataset:
    """Keep every n-th node of a surface, each the mean of the nodes around it.

    Use it for overviews, where the loss of content does not matter; else `down_sample`. A surface
    on disk is read block by block.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    factor : tuple of int
        Nodes that become one, along the first and along the second dimension of the height.

    Returns
    -------
    xarray.Dataset
        Nodes 0, factor, 2 factor, ... in memory; a height is the mean of the nodes nearer to it
        than to the next one, those midway with half the weight. ``count`` is summed likewise;
        ``sd`` is that of the mean for fully correlated errors of neighbours, an upper bound.

    Raises
    ------
    ValueError
        If a factor is less than 1, or leaves fewer than 2 nodes.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface(np.arange(15.0).reshape(3, 5), easting=np.arange(5),
    ...                     northing=np.arange(3))
    >>> coarsen_surface(ramp, (2, 2)).height.values
    array([[ 0.,  2.,  4.],
           [10., 12., 14.]])
    """
    if min(factor) < 1:
        message = f"factor must be at least 1 along both axes, got {factor}."
        raise ValueError(message)
    dims = surface["height"].dims
    fine_shape = surface["height"].shape
    shape = tuple(-(-size // by) for size, by in zip(fine_shape, factor, strict=True))
    if min(shape) < 2:
        message = f"factor must leave at least 2 nodes along both axes, got {factor}."
        raise ValueError(message)
    deviations = [name for name in ("sd", "sd_relative") if name in surface]
    cells: dict[str, Any] = {"height": np.empty(shape)}
    if "count" in surface:
        cells["count"] = np.empty(shape, np.int64)
    cells |= {name: np.empty(shape) for name in deviations}
    for rows in row_blocks((shape[0], fine_shape[1] * factor[0])):
        around = _FineRows(rows, factor, fine_shape)
        fine = load_heights(surface, around.rows)
        seen = np.isfinite(fine)
        height = around.mean(fine, seen)
        # a node without height gets none from its neighbours
        here = around.at_nodes(seen)
        cells["height"][rows] = np.where(here, height, np.nan)
        if "count" in surface:
            count = np.asarray(load_rows(surface, "count", around.rows), dtype=np.float64)
            total, _ = around.sums(count, np.ones_like(seen))
            cells["count"][rows] = np.rint(total)
        for name in deviations:
            known = np.asarray(load_rows(surface, name, around.rows), dtype=np.float64)
            sd = around.mean(known, seen & np.isfinite(known))
            cells[name][rows] = np.where(here, sd, np.nan)
    # variables of nodes are replaced or, like marks of filled nodes, thinned out
    kept = {dim: slice(None, None, by) for dim, by in zip(dims, factor, strict=True)}
    others = surface.drop_vars(list(cells)).isel(kept).load()
    return others.assign(
        {name: (dims, values, surface[name].attrs) for name, values in cells.items()}
    )[[*surface.data_vars]].assign_attrs(surface.attrs)


class _FineRows:
    """Fine rows around some coarse ones."""

    def __init__(self, coarse: slice, factor: tuple[int, int], shape: tuple[int, ...]) -> None:
        by, self._step = factor
        at = np.arange(coarse.start, coarse.stop) * by
        reach = np.full(at.size, by // 2)
        reach[(at < by // 2) | (at + by // 2 > shape[0] - 1)] = 0
        first = int((at - reach).min())
        self.rows = slice(first, int((at + reach).max()) + 1)
        self._at = at - first
        self._reach = np.where(by % 2 == 0, -reach, reach)
        self._shape = at.size, -(-shape[1] // self._step)

    def sums(self, values: Floats, known: npt.NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Sums of values and of their weights around each coarse node."""
        total, weight = np.empty(self._shape), np.empty(self._shape)
        _kernels.gather_nodes(values, known, self._at, self._reach, self._step, total, weight)
        return total, weight

    def mean(self, values: Floats, known: npt.NDArray[np.bool_]) -> Floats:
        """Mean around each coarse node; NaN where nothing is known."""
        total, weight = self.sums(values, known)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(total / weight)

    def at_nodes(self, values: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Values at the coarse nodes themselves."""
        return np.asarray(values[self._at][:, :: self._step])


def _coarsening_loss(
    fine: xr.Dataset, coarse: xr.Dataset, factor: tuple[int, int]
) -> dict[str, float]:
    """Differences of the coarse surface from the heights of the fine one."""
    dims = fine["height"].dims
    u, v = (np.asarray(fine[dim], dtype=np.float64) for dim in dims)
    height = np.asarray(coarse["height"], dtype=np.float64)
    row, row_fraction = _places_between(u, factor[0])
    column, column_fraction = _places_between(v, factor[1])
    known = height[np.isfinite(height)]
    datum = float(known[0]) if known.size else 0.0
    sums = np.zeros(12)
    for rows, block in height_blocks(fine):
        rows = slice(rows.start, min(rows.stop, row.size))
        inside = block[: rows.stop - rows.start, : column.size]
        _kernels.coarsening_moments(
            np.ascontiguousarray(inside),
            row[rows],
            row_fraction[rows],
            column,
            column_fraction,
            height,
            u[rows] - u[u.size // 2],
            v - v[v.size // 2],
            datum,
            sums,
        )
    n, *_ = sums
    if not n:
        return {"rms": float("nan"), "largest": float("nan"), "kept": float("nan")}
    variance = _variance_about_plane(sums)
    error_variance = float(sums[10] / n)
    return {
        "rms": error_variance**0.5,
        "largest": float(sums[11]),
        "kept": 1.0 - error_variance / variance if variance > error_variance else 0.0,
    }


def _places_between(axis: Floats, by: int) -> tuple[npt.NDArray[np.int64], Floats]:
    """Coarse node before each fine one, and the distance from it, as far as coarse nodes go."""
    last = (axis.size - 1) // by
    index = np.arange(last * by + 1)
    place = np.minimum(index // by, last)
    step = axis[np.minimum(place + 1, last) * by] - axis[place * by]
    with np.errstate(invalid="ignore"):
        fraction = (axis[index] - axis[place * by]) / step
    return place, np.where(index % by == 0, 0.0, fraction)


def _variance_about_plane(sums: Floats) -> float:
    """Variance of heights about their mean plane, by normal equations [m²]."""
    n, u, v, h, uu, uv, vv, uh, vh, hh, *_ = sums
    normal = np.array([[n, u, v], [u, uu, uv], [v, uv, vv]])
    right = np.array([h, uh, vh])
    plane, *_ = np.linalg.lstsq(normal, right, rcond=None)
    return float(max(hh - plane @ right, 0.0) / n)
