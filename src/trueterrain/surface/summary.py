"""Summary of a surface, in numbers that JSON takes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.quantiles import exact_quantiles
from trueterrain.core.row_blocks import height_blocks, load_rows


def summarise_surface(surface: xr.Dataset) -> dict[str, Any]:
    """Size, spacing, counts and standard deviations of a surface.

    A surface on disk is read block by block.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map, with ``count``, ``sd`` and ``sd_relative``.

    Returns
    -------
    dict
        ``size`` and ``spacing`` [m] by dimension; ``nodes`` with height; ``count`` of returns:
        ``median`` and ``most``; ``sd`` and ``sd_relative`` [m]: ``median``, ``p95`` and
        ``largest``, None where unknown.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[0, 1], [2, np.nan]], easting=[0, 1], northing=[0, 1],
    ...                     count=[[4, 6], [8, 0]], sd=[[0.1, 0.2, ], [0.3, np.nan]])
    >>> summarise_surface(road)["nodes"], summarise_surface(road)["sd"]["median"]
    (3, 0.2)
    """
    dims = [str(dim) for dim in surface["height"].dims]
    counts = _quantiles(surface, "count", [0.5, 1.0]) or [None, None]
    return {
        "size": dict(zip(dims, surface["height"].shape, strict=True)),
        "spacing": {dim: float(np.diff(surface[dim].values).mean()) for dim in dims},
        "nodes": sum(int(np.isfinite(height).sum()) for _, height in height_blocks(surface)),
        "count": {
            "median": counts[0],
            "most": None if counts[1] is None else int(counts[1]),
        },
        **{name: _sd_statistics(surface, name) for name in ("sd", "sd_relative")},
    }


def _sd_statistics(surface: xr.Dataset, name: str) -> dict[str, float | None]:
    found = _quantiles(surface, name, [0.5, 0.95, 1.0]) or [None, None, None]
    return dict(zip(("median", "p95", "largest"), found, strict=True))


def _quantiles(surface: xr.Dataset, name: str, fractions: list[float]) -> list[float] | None:
    """Quantiles of a variable over the nodes that have a height; None without any."""
    if name not in surface:
        return None

    def blocks() -> Iterator[npt.NDArray[Any]]:
        for rows, height in height_blocks(surface):
            yield load_rows(surface, name, rows)[np.isfinite(height)]

    return exact_quantiles(blocks, fractions)
