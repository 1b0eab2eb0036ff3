"""Coarser surfaces for smooth terrain (thesis 4.4), and the loss of content."""

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.interpolate import RegularGridInterpolator

Floats = npt.NDArray[np.float64]


def down_sample(
    surface: xr.Dataset, factor: tuple[int, int]
) -> tuple[xr.Dataset, dict[str, float]]:
    """Keep every n-th node of a surface, each the mean of the nodes around it.

    Smooth terrain needs fewer nodes; the report says what is error_variance.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    factor : tuple of int
        Nodes that become one, along the first and along the second dimension of the height.

    Returns
    -------
    surface : xarray.Dataset
        Nodes 0, factor, 2 factor, ...; a height is the mean of the nodes nearer to it than to the
        next one, those midway with half the weight. ``count`` is summed likewise; ``sd`` is that
        of the mean for fully correlated errors of neighbours, an upper bound.
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
    first, second = factor
    if min(factor) < 1:
        message = f"factor must be at least 1 along both axes, got {factor}."
        raise ValueError(message)
    dims = surface["height"].dims
    kept = {dim: slice(None, None, by) for dim, by in zip(dims, factor, strict=True)}
    coarse = surface.isel(kept)
    if min(coarse.sizes[dim] for dim in dims) < 2:
        message = f"factor must leave at least 2 nodes along both axes, got {factor}."
        raise ValueError(message)
    fine = np.asarray(surface["height"], dtype=np.float64)
    seen = np.isfinite(fine)
    weight = _gather_sums(seen.astype(np.float64), factor)
    with np.errstate(invalid="ignore", divide="ignore"):
        height = _gather_sums(np.where(seen, fine, 0.0), factor) / weight
    # a node without height gets none from its neighbours
    height = np.where(seen[::first, ::second], height, np.nan)
    cells: dict[str, Any] = {"height": coarse["height"].copy(data=height)}
    if "count" in surface:
        total = _gather_sums(np.asarray(surface["count"], dtype=np.float64), factor)
        cells["count"] = coarse["count"].copy(data=np.rint(total).astype(np.int64))
    for name in ("sd", "sd_relative"):
        if name not in surface:
            continue
        known = np.asarray(surface[name], dtype=np.float64)
        has = seen & np.isfinite(known)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = _gather_sums(np.where(has, known, 0.0), factor) / _gather_sums(
                has.astype(np.float64), factor
            )
        sd = np.where(np.isfinite(height), mean, np.nan)
        cells[name] = coarse[name].copy(data=sd)
    result = coarse.assign(cells)
    return result, _coarsening_loss(surface, result)


def _gather_sums(values: Floats, factor: tuple[int, int]) -> Floats:
    """Sums around every n-th node; nodes midway count by half to both sides.

    A node at the edge keeps its own height: a mean over one side would be biased on a slope.
    """
    for axis, by in enumerate(factor):
        reach = by // 2
        pad = [(0, 0), (0, 0)]
        pad[axis] = (reach, reach)
        padded = np.pad(values, pad)
        size = values.shape[axis]
        total = np.zeros_like(np.take(values, range(0, size, by), axis=axis))
        for k in range(-reach, reach + 1):
            weight = 0.5 if by % 2 == 0 and abs(k) == reach and by > 1 else 1.0
            total += weight * np.take(padded, range(reach + k, reach + k + size, by), axis=axis)
        at = np.arange(0, size, by)
        at_edge = np.flatnonzero((at < reach) | (at + reach > size - 1))
        index = (at_edge, slice(None)) if axis == 0 else (slice(None), at_edge)
        total[index] = np.take(values, at[at_edge], axis=axis)
        values = total
    return values


def _coarsening_loss(fine: xr.Dataset, coarse: xr.Dataset) -> dict[str, float]:
    """Differences of the coarse surface from the heights of the fine one."""
    dims = fine["height"].dims
    axes = [np.asarray(coarse[dim], dtype=np.float64) for dim in dims]
    between = RegularGridInterpolator(
        axes, np.asarray(coarse["height"]), bounds_error=False, fill_value=np.nan
    )
    height = np.asarray(fine["height"], dtype=np.float64)
    first, second = (np.asarray(fine[dim], dtype=np.float64) for dim in dims)
    error = np.empty(height.shape)
    for row in range(height.shape[0]):
        at = np.stack([np.full(second.size, first[row]), second], axis=1)
        error[row] = between(at) - height[row]
    known = np.isfinite(error)
    if not known.any():
        return {"rms": float("nan"), "largest": float("nan"), "kept": float("nan")}
    a, b = (axis[known] for axis in np.meshgrid(first, second, indexing="ij"))
    design = np.stack([np.ones(a.size), a - a.mean(), b - b.mean()], axis=1)
    plane, *_ = np.linalg.lstsq(design.T @ design, design.T @ height[known], rcond=None)
    residual = height[known] - design @ plane
    variance = float(np.mean(residual**2))
    error_variance = float(np.mean(error[known] ** 2))
    return {
        "rms": error_variance**0.5,
        "largest": float(np.abs(error[known]).max()),
        "kept": 1.0 - error_variance / variance if variance > error_variance else 0.0,
    }
