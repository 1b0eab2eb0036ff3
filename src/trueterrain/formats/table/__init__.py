"""Points and profiles as tables: CSV and other text, and Parquet.

=======  ========================================================================================
profile  ``s,easting,northing,height,sd,count``; ``s`` and ``height`` are enough. Several tracks
         either in rows, with a column ``track``, or side by side: ``height_left,height_right``
points   ``easting,northing,up`` (or ``x,y,z``); optional ``time``, ``intensity``, ``lane``, ``sd``,
         ``sd_relative``
path     ``easting,northing`` (or ``x,y``): waypoints in order, see `read_waypoints`
=======  ========================================================================================

Lengths are metres unless the header names another unit: ``height [mm]``, ``s_ft``, ``height_in``.
Columns are separated by commas, semicolons, tabs or blanks. Without a header, two columns of
numbers are ``s height`` and three are ``easting northing up``. Lines that begin with # are skipped.

Text keeps every bit of the numbers, but neither CRS nor provenance; Parquet keeps them as well.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain import provenance
from trueterrain.errors import FormatError
from trueterrain.formats.table._build import build_points, build_profile
from trueterrain.formats.table._columns import Column, Layout
from trueterrain.formats.table._describe import describe_points, describe_profile
from trueterrain.formats.table._parquet import open_parquet, parquet_blocks
from trueterrain.formats.table._text import Values, line_of_row, open_text, text_blocks
from trueterrain.formats.table._write import write

__all__ = ["blocks", "describe", "kind", "read", "read_waypoints", "write"]

_BLOCK = 1_000_000  # rows at a time


def read(path: str | Path) -> xr.Dataset:
    """Points or a profile from a table.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file, see the columns above.

    Returns
    -------
    xarray.Dataset
        Points, or a profile with dims (s,) or (track, s).

    Raises
    ------
    FormatError
        Naming line and column: no number, a gap where none may be, s that does not ascend, a
        missing column, a wrong number of fields.
    """
    source = _open(Path(path))
    data = _whole(source).assign_attrs(source.attrs)
    parameters = {"format": source.format}
    return provenance.add_step(data, "read", parameters=parameters, inputs=[path])


def blocks(
    path: str | Path,
    *,
    bounds: tuple[float, float, float, float] | None = None,
    size: int = _BLOCK,
    crs: str | None = None,
) -> Iterator[xr.Dataset]:
    """Points of a table block by block, never the whole file at once.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file of points.
    bounds : tuple of float, optional
        Smallest easting and northing, largest easting and northing [m]; edges are inside.
    size : int
        Largest number of points in a block.
    crs : str, optional
        EPSG code or WKT to take instead of what the file says.

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        As by `read`, or if the table holds no points.
    """
    source = _open(Path(path))
    if source.layout.kind != "points":
        raise FormatError(
            f"holds no points but a {source.layout.kind}",
            path=path,
            place="header",
            cure="Name the columns easting, northing, up.",
        )
    attrs = source.attrs if crs is None else source.attrs | {"crs": crs}
    for values in source.blocks(size):
        points = build_points(values).assign_attrs(attrs)
        if bounds is not None:
            points = _cut(points, bounds)
        if points.sizes["point"]:
            yield points


def read_waypoints(path: str | Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    r"""Waypoints of a path from a table.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file with columns ``easting,northing`` or ``x,y``, in order along the path;
        other columns are ignored. Without a header, the first two columns are taken.

    Returns
    -------
    easting, northing : numpy.ndarray, shape (waypoint,)
        Coordinates [m].

    Raises
    ------
    FormatError
        Naming line and column: a waypoint that is NaN or no number, a missing column; or if all
        waypoints are the same.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "path.csv"
    ...     _ = path.write_text("x;y [ft]\n0;0\n1;10\n")
    ...     read_waypoints(path)[1]
    array([0.   , 3.048])
    """
    source = _open(Path(path), kind="path")
    named = {column.name: array for column, array in _concatenated(source).items()}
    easting, northing = named["easting"].astype(float), named["northing"].astype(float)
    if np.ptp(easting) == np.ptp(northing) == 0:
        raise FormatError(
            "a path needs at least 2 different waypoints, got 1",
            path=path,
            cure="Add where the path leads to.",
        )
    return easting, northing


def kind(path: str | Path) -> str:
    """Kind of data in a table, by its header alone.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file.

    Returns
    -------
    str
        ``"points"``, ``"profile"`` or ``"path"``.

    Raises
    ------
    FormatError
        If columns are missing or the file is damaged.
    """
    return _open(Path(path)).layout.kind


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a table for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``count``, ``columns``, ``extent`` [m], ``crs``, ``problems``; for a
        profile ``tracks`` and ``spacing`` [m]; everything can be written as JSON.

    Raises
    ------
    FormatError
        As by `read`.
    """
    source = _open(Path(path))
    summary: dict[str, Any] = {"format": source.format, "kind": source.layout.kind}
    summary["columns"] = [column.label for column in source.layout.columns]
    if source.layout.kind == "profile":
        summary |= describe_profile(_whole(source))
    else:
        summary |= describe_points(source.blocks(_BLOCK))
    summary["crs"] = source.attrs.get("crs", "")
    if source.layout.ignored:
        problem = f"columns that are not understood: {', '.join(source.layout.ignored)}"
        summary["problems"].append(problem)
    if source.layout.kind == "path":
        summary["problems"].append("has no heights: it can serve as a path, but is no ground")
    return summary


@dataclass(frozen=True, kw_only=True)
class _Source:
    path: Path
    format: str
    layout: Layout
    attrs: dict[str, Any]
    blocks: Callable[[int | None], Iterator[Values]]
    place: Callable[[int], str]  # where in the file a row stands


def _open(path: Path, *, kind: str | None = None) -> _Source:
    with path.open("rb") as stream:
        is_parquet = stream.read(4) == b"PAR1"
    if is_parquet:
        file, layout, attrs = open_parquet(path, kind=kind)
        return _Source(
            path=path,
            format="Parquet",
            layout=layout,
            attrs=attrs,
            blocks=lambda size: parquet_blocks(path, file, layout, size),
            place=lambda row: f"row {row + 1}",
        )
    table = open_text(path, kind=kind)
    return _Source(
        path=path,
        format="CSV",
        layout=table.layout,
        attrs={},
        blocks=lambda size: text_blocks(table, size),
        place=lambda row: f"line {line_of_row(table, row)}",
    )


def _whole(source: _Source) -> xr.Dataset:
    if source.layout.kind == "path":
        raise FormatError(
            "has no heights, it is a path (easting, northing)",
            path=source.path,
            place="header",
            cure="Add a column of heights, or use it as a path.",
        )
    values = _concatenated(source)
    if source.layout.kind == "points":
        return build_points(values)
    return build_profile(values, source.layout, source.path, source.place)


def _concatenated(source: _Source) -> dict[Column, Any]:
    parts = list(source.blocks(None))
    if len(parts) == 1:
        return parts[0]
    return {
        column: np.concatenate([part[column] for part in parts]) for column in source.layout.columns
    }


def _cut(points: xr.Dataset, bounds: tuple[float, float, float, float]) -> xr.Dataset:
    west, south, east, north = bounds
    x, y = points.easting.values, points.northing.values
    inside = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    return points.isel(point=np.flatnonzero(inside))
