"""Points, surfaces and profiles from stores."""

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError, FormatError, SchemaError
from trueterrain.core.schemas import COORDINATES, check_points, check_profile, check_surface
from trueterrain.formats._zarr import damaged_error
from trueterrain.formats.store._layout import CHUNK, OpenedStore, Values, open_store, rows_of

BLOCK = 1_000_000  # points

Bounds = tuple[float, float, float, float]

_CHECKS = {"points": check_points, "surface": check_surface, "profile": check_profile}


def read(path: str | Path, *, between: tuple[float, float] | None = None) -> xr.Dataset:
    """Points, surface or profile from a store, as it was written.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.
    between : tuple of float, optional
        Only the part of a surface or a profile between two stations (u or s), or northings of a
        map [m], both inside; no more than that is read.

    Returns
    -------
    xarray.Dataset
        In memory.

    Raises
    ------
    FormatError
        If it is no such store, or damaged.
    CoverageError
        If there is nothing between the stations.
    ValueError
        If `between` is given for points, or means nothing.
    """
    stored = open_store(path)
    dim = rows_of(stored.kind, stored.sizes)
    rows = slice(None) if between is None else _select_rows(stored, dim, between)
    return _build_dataset(stored, dim, rows)


def blocks(
    path: str | Path,
    *,
    bounds: Bounds | None = None,
    size: int = BLOCK,
    crs: str | None = None,
    variables: Collection[str] | None = None,
) -> Iterator[xr.Dataset]:
    """Points of a store block by block, in their order, never all at once.

    With bounds, only chunks that touch them are read.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.
    bounds : tuple of float, optional
        West, south, east and north edge [m]; points on an edge are inside.
    size : int
        Largest number of points in a block; multiples of 250 000 are read fastest.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the store.
    variables : collection of str, optional
        Variables to read beside the coordinates, as far as the store has them; by default all.

    Yields
    ------
    xarray.Dataset
        Points; blocks without points are left out.

    Raises
    ------
    FormatError
        If it is no store of points, or damaged; damage within a chunk is found when it is reached.
    ValueError
        If `bounds` or `size` mean nothing.
    """
    if size < 1:
        message = f"size must be at least 1 point, got {size}."
        raise ValueError(message)
    _check_bounds(bounds)
    stored = _opened_points(path)
    if variables is not None:
        wanted = {*COORDINATES, *variables}
        entries = [one for one in stored.entries if one.coordinate or one.name in wanted]
        stored = replace(stored, entries=entries)
    touched = None if bounds is None else _touched_chunks(stored.chunk_bounds(), bounds)
    for start in range(0, stored.sizes["point"], size):
        rows = slice(start, min(start + size, stored.sizes["point"]))
        if touched is not None:
            rows = _narrow_rows(rows, touched)
        if rows.start == rows.stop:
            continue
        points = _build_dataset(stored, "point", rows)
        if bounds is not None:
            points = _clip_points(points, bounds)
        if points.sizes["point"]:
            yield points if crs is None else points.assign_attrs(crs=crs)


def point_variables(path: str | Path) -> tuple[str, ...]:
    """Variables beside the coordinates that a store of points has.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.

    Returns
    -------
    tuple of str
        Names.

    Raises
    ------
    FormatError
        If it is no store of points, or damaged.
    """
    entries = _opened_points(path).entries
    return tuple(one.name for one in entries if one.name not in COORDINATES)


def _opened_points(path: str | Path) -> OpenedStore:
    stored = open_store(path)
    if stored.kind != "points":
        raise FormatError(
            f"holds no points but a {stored.kind}",
            path=path,
            cure="Convert a surface to points first: `trueterrain convert`.",
        )
    return stored


def _build_dataset(stored: OpenedStore, dim: str, rows: slice) -> xr.Dataset:
    variables: dict[str, xr.Variable] = {}
    coordinates: dict[str, xr.Variable] = {}
    for entry in stored.entries:
        if dim not in entry.dims or entry.dims[0] == dim:
            variable = stored.variable(entry, rows if dim in entry.dims else slice(None))
        else:  # a profile of several tracks, which is short enough to be cut in memory
            variable = stored.variable(entry).isel({dim: rows})
        (coordinates if entry.coordinate else variables)[entry.name] = variable
    try:
        data = xr.Dataset(variables, coordinates, stored.attrs)
        return _CHECKS[stored.kind](data, path=stored.path)
    except SchemaError as error:
        # it was checked when it was written
        raise damaged_error(stored.path, error.place or "arrays", error.problem) from None
    except ValueError as error:
        raise damaged_error(stored.path, "arrays", str(error)) from None


def _select_rows(stored: OpenedStore, dim: str, between: tuple[float, float]) -> slice:
    start, end = between
    if stored.kind == "points" or not start <= end:
        message = f"between must be two rising stations of a surface or a profile, got {between}."
        raise ValueError(message)
    axis = stored.values(dim)
    first, last = np.searchsorted(axis, start), np.searchsorted(axis, end, side="right")
    least = 2 if stored.kind == "surface" else 1
    if last - first < least:
        raise CoverageError(
            f"there are fewer than {least} rows between {start:g} and {end:g} m: {dim} runs from "
            f"{axis[0]:g} to {axis[-1]:g} m",
            path=stored.path,
        )
    return slice(int(first), int(last))


def _check_bounds(bounds: Bounds | None) -> None:
    if bounds is None:
        return
    west, south, east, north = bounds
    if not (west <= east and south <= north):
        message = (
            "bounds must be west, south, east and north edge [m], west <= east and south <= north, "
            f"got {bounds}."
        )
        raise ValueError(message)


def _touched_chunks(chunks: Values, bounds: Bounds) -> Values:
    """Numbers of the chunks that touch a place."""
    west, south, east, north = bounds
    apart = (
        (chunks[:, 0] > east)
        | (chunks[:, 2] < west)
        | (chunks[:, 1] > north)
        | (chunks[:, 3] < south)
    )
    return np.flatnonzero(~apart)


def _narrow_rows(rows: slice, touched: Values) -> slice:
    """Rows from the first chunk that is touched to the last one."""
    among = touched[(touched >= rows.start // CHUNK) & (touched <= (rows.stop - 1) // CHUNK)]
    if not among.size:
        return slice(rows.start, rows.start)
    first, last = int(among[0]) * CHUNK, (int(among[-1]) + 1) * CHUNK
    return slice(max(rows.start, first), min(rows.stop, last))


def _clip_points(points: xr.Dataset, bounds: Bounds) -> xr.Dataset:
    west, south, east, north = bounds
    x, y = points.easting.values, points.northing.values
    inside: Any = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    return points if inside.all() else points.isel(point=np.flatnonzero(inside))
