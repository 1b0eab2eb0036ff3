"""Read points, surfaces and profiles from stores."""

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError, FormatError, SchemaError
from trueterrain.core.schemas import COORDINATES, check_points, check_profile, check_surface
from trueterrain.formats._bounds import Bounds, check_bounds, clip_points
from trueterrain.formats._zarr import damaged_error
from trueterrain.formats.store._layout import CHUNK, OpenedStore, Values, open_store, rows_of

BLOCK = 1_000_000  # points

_CHECKS = {"points": check_points, "surface": check_surface, "profile": check_profile}


def read(path: str | Path, *, between: tuple[float, float] | None = None) -> xr.Dataset:
    """Read points, a surface or a profile from a store, as it was written.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.
    between : tuple of float, optional
        Read only the part of a surface or a profile between two stations (u or s), or of a map
        between two northings [m], both included.

    Returns
    -------
    xarray.Dataset
        Points, surface or profile, in memory.

    Raises
    ------
    FormatError
        If it is not such a store, or damaged.
    CoverageError
        If there are no rows between the stations.
    ValueError
        If `between` is given for points, or does not ascend.
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
    """Read the points of a store block by block, in their order and in flat memory.

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
        Variables to read besides the coordinates; by default all that the store has.

    Yields
    ------
    xarray.Dataset
        Points; blocks without points are omitted.

    Raises
    ------
    FormatError
        If it is not a store of points, or damaged; damage of a chunk is found when it is read.
    ValueError
        If `bounds` or `size` are not valid.
    """
    if size < 1:
        message = f"size must be at least 1 point, got {size}."
        raise ValueError(message)
    check_bounds(bounds)
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
            points = clip_points(points, bounds)
        if points.sizes["point"]:
            yield points if crs is None else points.assign_attrs(crs=crs)


def point_variables(path: str | Path) -> tuple[str, ...]:
    """Variables of a store of points besides the coordinates.

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
        If it is not a store of points, or damaged.
    """
    entries = _opened_points(path).entries
    return tuple(one.name for one in entries if one.name not in COORDINATES)


def _opened_points(path: str | Path) -> OpenedStore:
    stored = open_store(path)
    if stored.kind != "points":
        raise FormatError(
            f"holds a {stored.kind}, not points",
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
        else:  # (track, s): a profile is small, so it is read as a whole and cut in memory
            variable = stored.variable(entry).isel({dim: rows})
        (coordinates if entry.coordinate else variables)[entry.name] = variable
    try:
        data = xr.Dataset(variables, coordinates, stored.attrs)
        return _CHECKS[stored.kind](data, path=stored.path)
    except SchemaError as error:
        # the data were checked on writing, so this is damage
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
    min_rows = 2 if stored.kind == "surface" else 1
    if last - first < min_rows:
        raise CoverageError(
            f"there are fewer than {min_rows} rows between {start:g} and {end:g} m: {dim} runs "
            f"from {axis[0]:g} to {axis[-1]:g} m",
            path=stored.path,
        )
    return slice(int(first), int(last))


def _touched_chunks(chunks: Values, bounds: Bounds) -> Values:
    """Indices of the chunks whose bounds touch the given bounds."""
    west, south, east, north = bounds
    apart = (
        (chunks[:, 0] > east)
        | (chunks[:, 2] < west)
        | (chunks[:, 1] > north)
        | (chunks[:, 3] < south)
    )
    return np.flatnonzero(~apart)


def _narrow_rows(rows: slice, touched: Values) -> slice:
    """Rows from the first touched chunk to the last."""
    among = touched[(touched >= rows.start // CHUNK) & (touched <= (rows.stop - 1) // CHUNK)]
    if not among.size:
        return slice(rows.start, rows.start)
    first, last = int(among[0]) * CHUNK, (int(among[-1]) + 1) * CHUNK
    return slice(max(rows.start, first), min(rows.stop, last))
