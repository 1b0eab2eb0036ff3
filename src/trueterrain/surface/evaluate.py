"""Heights of a surface at any point, its nodes as points, and its summary."""

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.provenance import add_step
from trueterrain.core.schemas import make_points
from trueterrain.geometry.grid_frame import (
    Floats,
    GridFrame,
    grid_frame,
    interpolate_bilinear,
    xy_to_uv,
)


def heights_at(surface: xr.Dataset, easting: npt.ArrayLike, northing: npt.ArrayLike) -> Floats:
    """Height of a surface at ground coordinates, bilinear between its nodes.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.
    easting, northing : array_like
        Coordinates [m], of shapes that broadcast.

    Returns
    -------
    ndarray
        Height [m]; NaN outside the surface and where a node with weight has no height. A point on
        a node depends on that node alone.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface([[0.0, 1.0], [0.0, 1.0]], easting=[0, 1], northing=[0, 1])
    >>> heights_at(ramp, [0.25, 2.0], [0.5, 0.5])
    array([0.25,  nan])
    """
    frame = grid_frame(surface)
    return _interpolate_heights(surface, frame, *xy_to_uv(frame, easting, northing))


def heights_at_uv(surface: xr.Dataset, u: npt.ArrayLike, v: npt.ArrayLike) -> Floats:
    """Height of a surface at grid coordinates, bilinear between its nodes.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map (then u is the easting and v the northing).
    u, v : array_like
        Station along and offset across the reference line [m], of shapes that broadcast.

    Returns
    -------
    ndarray
        Height [m]; NaN outside the surface and where a node with weight has no height.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface([[0.0, 1.0], [2.0, 3.0]], u=[0, 1], v=[0, 1], easting=[0, 1],
    ...                     northing=[0, 0])
    >>> heights_at_uv(road, 0.5, [0.0, 0.5])
    array([1. , 1.5])
    """
    return _interpolate_heights(surface, grid_frame(surface), u, v)


def node_coordinates(surface: xr.Dataset) -> tuple[Floats, Floats]:
    """Ground coordinates of all nodes of a surface.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Returns
    -------
    easting, northing : ndarray
        Coordinates [m], shaped like ``surface.height``.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface(np.zeros((2, 3)), easting=[0, 1, 2], northing=[5, 6])
    >>> node_coordinates(ramp)[1]
    array([[5., 5., 5.], [6., 6., 6.]])
    """
    frame = grid_frame(surface)
    easting = frame.origin_easting[:, None] + frame.v * frame.normal_easting[:, None]
    northing = frame.origin_northing[:, None] + frame.v * frame.normal_northing[:, None]
    if "u" in surface.dims:
        return easting, northing
    return np.ascontiguousarray(easting.T), np.ascontiguousarray(northing.T)


def surface_to_points(surface: xr.Dataset) -> xr.Dataset:
    """Nodes of a surface that have a height, as points.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Returns
    -------
    xarray.Dataset
        Points, cross-section by cross-section; the standard deviation of the heights is kept if
        the surface has one, and so are the coordinate reference system and the provenance.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface([[0.0, 1.0], [np.nan, 2.0]], easting=[0, 1], northing=[0, 1])
    >>> surface_to_points(ramp).up.values
    array([0., 1., 2.])
    """
    easting, northing = node_coordinates(surface)
    height = np.asarray(surface["height"], float)
    valid = np.isfinite(height)
    optional = {
        name: np.asarray(surface[name])[valid] for name in ("sd", "sd_relative") if name in surface
    }
    points = make_points(
        easting[valid],
        northing[valid],
        height[valid],
        crs=str(surface.attrs.get("crs", "")),
        **optional,
    )
    return add_step(points, "surface_to_points", after=surface)


def _interpolate_heights(
    surface: xr.Dataset, frame: GridFrame, u: npt.ArrayLike, v: npt.ArrayLike
) -> Floats:
    height = np.asarray(surface["height"], dtype=np.float64)
    return interpolate_bilinear(frame, height if "u" in surface.dims else height.T, u, v)


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
