"""Heights of a surface at any point, its nodes as points, and its summary."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.provenance import add_step
from trueterrain.core.quantiles import exact_quantiles
from trueterrain.core.row_blocks import (
    height_blocks,
    load_heights,
    load_rows,
    stored_rows,
    surface_blocks,
)
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
    parts = list(node_points(surface))
    columns: dict[str, Any] = {
        str(name): np.concatenate([part[name].values for part in parts])
        for name in parts[0].data_vars
    }
    points = make_points(crs=str(surface.attrs.get("crs", "")), **columns)
    return points.assign_attrs(parts[0].attrs)


def node_points(surface: xr.Dataset) -> Iterator[xr.Dataset]:
    """Nodes of a surface that have a height, as blocks of points.

    Use it to write a surface that does not fit into memory as a LAZ file.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map, in memory or on disk.

    Yields
    ------
    xarray.Dataset
        Points of some cross-sections, as by `surface_to_points`.
    """
    attrs = add_step(
        make_points([], [], [], crs=str(surface.attrs.get("crs", ""))),
        "surface_to_points",
        after=surface,
    ).attrs
    deviations = [name for name in ("sd", "sd_relative") if name in surface]
    first = str(surface["height"].dims[0])
    for rows in surface_blocks(surface):
        # a cross-section depends on its neighbours, which the part keeps
        around = slice(max(rows.start - 1, 0), rows.stop + 1)
        own = slice(rows.start - around.start, rows.stop - around.start)
        easting, northing = (
            values[own] for values in node_coordinates(surface.isel({first: around}))
        )
        height = load_heights(surface, rows)
        valid = np.isfinite(height)
        optional: dict[str, Any] = {
            name: load_rows(surface, name, rows)[valid] for name in deviations
        }
        points = make_points(easting[valid], northing[valid], height[valid], **optional)
        yield points.assign_attrs(attrs)


def _interpolate_heights(
    surface: xr.Dataset, frame: GridFrame, u: npt.ArrayLike, v: npt.ArrayLike
) -> Floats:
    if "u" not in surface.dims or stored_rows(surface) is None:
        height = np.asarray(surface["height"], dtype=np.float64)
        return interpolate_bilinear(frame, height if "u" in surface.dims else height.T, u, v)
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    row = np.searchsorted(frame.u, u.ravel(), side="right") - 1
    row = np.clip(row, 0, frame.u.size - 2)
    order = np.argsort(row, kind="stable")
    found = np.empty(u.size)
    for rows in surface_blocks(surface):
        begin, end = np.searchsorted(row, (rows.start, rows.stop), sorter=order)
        some = order[begin:end]
        if some.size:
            # a point lies between its row and the next
            with_next = slice(rows.start, min(rows.stop + 1, frame.u.size))
            found[some] = interpolate_bilinear(
                grid_frame(surface.isel(u=with_next)),
                load_heights(surface, with_next),
                u.ravel()[some],
                v.ravel()[some],
            )
    return found.reshape(u.shape)


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
    median, most = _quantiles(surface, "count", [0.5, 1.0]) or (None, None)
    return {
        "size": dict(zip(dims, surface["height"].shape, strict=True)),
        "spacing": {dim: float(np.diff(surface[dim].values).mean()) for dim in dims},
        "nodes": sum(int(np.isfinite(height).sum()) for _, height in height_blocks(surface)),
        "count": {
            "median": median,
            "most": None if most is None else int(most),
        },
        **{name: _sd_statistics(surface, name) for name in ("sd", "sd_relative")},
    }


def _sd_statistics(surface: xr.Dataset, name: str) -> dict[str, float | None]:
    found = _quantiles(surface, name, [0.5, 0.95, 1.0]) or (None, None, None)
    return dict(zip(("median", "p95", "largest"), found, strict=True))


def _quantiles(surface: xr.Dataset, name: str, fractions: list[float]) -> list[float] | None:
    """Quantiles of a variable over the nodes that have a height; None without any."""
    if name not in surface:
        return None

    def blocks() -> Iterator[npt.NDArray[Any]]:
        for rows, height in height_blocks(surface):
            yield load_rows(surface, name, rows)[np.isfinite(height)]

    return exact_quantiles(blocks, fractions)
