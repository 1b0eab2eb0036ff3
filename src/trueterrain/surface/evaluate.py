"""Heights of a surface at any point, and its nodes as points."""

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
    easting, northing = grid_frame(surface).nodes()
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
