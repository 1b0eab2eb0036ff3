"""Summary of a surface, in numbers that JSON takes."""

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr


def summarise_surface(surface: xr.Dataset) -> dict[str, Any]:
    """Size, spacing, counts and standard deviations of a surface.

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
    height = surface["height"].values
    seen = np.isfinite(height)
    count = surface["count"].values[seen] if "count" in surface else np.empty(0)
    return {
        "size": dict(zip(dims, height.shape, strict=True)),
        "spacing": {dim: float(np.diff(surface[dim].values).mean()) for dim in dims},
        "nodes": int(seen.sum()),
        "count": {
            "median": _finite_median(count),
            "most": int(count.max()) if count.size else None,
        },
        **{name: _sd_statistics(surface, name, seen) for name in ("sd", "sd_relative")},
    }


def _sd_statistics(
    surface: xr.Dataset, name: str, seen: npt.NDArray[np.bool_]
) -> dict[str, float | None]:
    sd = surface[name].values[seen] if name in surface else np.empty(0)
    known = sd[np.isfinite(sd)]
    return {
        "median": _finite_median(known),
        "p95": float(np.percentile(known, 95)) if known.size else None,
        "largest": float(known.max()) if known.size else None,
    }


def _finite_median(values: npt.NDArray[Any]) -> float | None:
    return float(np.median(values)) if values.size else None
