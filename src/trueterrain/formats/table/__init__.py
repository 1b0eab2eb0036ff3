"""Points and profiles as tables: CSV and other text, and Parquet.

=======  ========================================================================================
profile  ``s,easting,northing,height,sd,count``; ``s`` and ``height`` are required. Several tracks
         either in rows, with a column ``track``, or in columns: ``height_left,height_right``
points   ``easting,northing,up`` (or ``x,y,z``); optional ``time``, ``intensity``, ``lane``, ``sd``,
         ``sd_relative``, ``classification`` and the others of
         `trueterrain.core.schemas.RETURN_ATTRIBUTES`, ``extra_NAME``
path     ``easting,northing`` (or ``x,y``): waypoints in order along the path, see `read_waypoints`
=======  ========================================================================================

Columns of heights may be named as their tracks: ``s,left,right``, ``station,track 1,track 2 [mm]``.
Lengths are metres unless the header names another unit: ``height [mm]``, ``s_ft``, ``height inch``.
Columns are separated by commas, semicolons, tabs or blanks; except with commas, numbers may have
decimal commas. Titles before the header and comment lines (#) are skipped. Without a header, two
columns are ``s height`` and three are ``easting northing up``, in metres: ``info`` and
commands that rate profiles warn of this assumption.

Text keeps numbers to the last bit, but neither CRS nor provenance; Parquet keeps these, too.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import ASSUMED, COORDINATES
from trueterrain.formats._bounds import Bounds, clip_points
from trueterrain.formats.signature import open_regular
from trueterrain.formats.table._build import build_points, build_profile
from trueterrain.formats.table._columns import TableColumn, TableLayout
from trueterrain.formats.table._parquet import open_parquet, parquet_blocks
from trueterrain.formats.table._text import Values, line_of_row, open_text, text_blocks
from trueterrain.formats.table._write import write
from trueterrain.formats.table.description import describe_points, describe_profile

__all__ = ["blocks", "describe", "kind", "point_variables", "read", "read_waypoints", "write"]

_BLOCK = 1_000_000  # rows at a time
_MAX_SPACING = 0.305  # [m] between samples of a profiler, which takes 0.025 to 0.305 m (1 ft)


def read(path: str | Path) -> xr.Dataset:
    """Read points or a profile from a table.

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
        Naming line and column: a cell that is not a number, a missing value of a required column,
        s that does not ascend, a missing column, a wrong number of fields.
    """
    source = _open_table(Path(path))
    data = _read_whole(source).assign_attrs(source.attrs)
    if source.assumed:
        data = data.assign_attrs({ASSUMED: _assumed_text(source, data)})
    parameters = {"format": source.format}
    return provenance.add_step(data, "read", parameters=parameters, inputs=[path])


def blocks(
    path: str | Path,
    *,
    bounds: Bounds | None = None,
    size: int = _BLOCK,
    crs: str | None = None,
    variables: Collection[str] | None = None,
) -> Iterator[xr.Dataset]:
    """Read the points of a table block by block, in flat memory.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file of points.
    bounds : tuple of float, optional
        West, south, east and north edge [m]; points on an edge are inside.
    size : int
        Largest number of points in a block.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the file.
    variables : collection of str, optional
        Variables to take besides the coordinates; by default all that the table has.

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        As by `read`, or if the table holds no points.
    """
    source = _open_points(path)
    attrs = source.attrs if crs is None else source.attrs | {"crs": crs}
    for values in source.blocks(size):
        taken = {
            column: array
            for column, array in values.items()
            if variables is None or column.name in {*COORDINATES, *variables}
        }
        points = build_points(taken).assign_attrs(attrs)
        if bounds is not None:
            points = clip_points(points, bounds)
        if points.sizes["point"]:
            yield points


def point_variables(path: str | Path) -> tuple[str, ...]:
    """Variables of the points of a table besides the coordinates, by its header alone.

    Parameters
    ----------
    path : str or Path
        Text or Parquet file of points.

    Returns
    -------
    tuple of str
        Names.

    Raises
    ------
    FormatError
        As by `read`, or if the table holds no points.
    """
    columns = _open_points(path).layout.columns
    return tuple(column.name for column in columns if column.name not in COORDINATES)


def _open_points(path: str | Path) -> "_TableSource":
    source = _open_table(Path(path))
    if source.layout.kind != "points":
        raise FormatError(
            f"holds a {source.layout.kind}, not points",
            path=path,
            place="header",
            cure="Name the columns easting, northing, up.",
        )
    return source


def read_waypoints(path: str | Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    r"""Read the waypoints of a path from a table.

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
        Naming line and column: a waypoint that is NaN or not a number, a missing column; or if all
        waypoints are equal.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "path.csv"
    ...     _ = path.write_text("x;y [ft]\n0;0\n1;10\n")
    ...     read_waypoints(path)[1]
    array([0.   , 3.048])
    """
    source = _open_table(Path(path), kind="path")
    named = {column.name: array for column, array in _concatenate_blocks(source).items()}
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
    return _open_table(Path(path)).layout.kind


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
        profile ``tracks`` and ``spacing`` [m]; all values are plain types that JSON can hold.

    Raises
    ------
    FormatError
        As by `read`.
    """
    source = _open_table(Path(path))
    summary: dict[str, Any] = {"format": source.format, "kind": source.layout.kind}
    summary["columns"] = [column.label for column in source.layout.columns]
    profile = None
    if source.layout.kind == "profile":
        profile = _read_whole(source)
        summary |= describe_profile(profile)
    else:
        summary |= describe_points(source.blocks(_BLOCK))
    if source.assumed:
        summary["problems"].append(_assumed_text(source, profile))
    summary["crs"] = source.attrs.get("crs", "")
    if source.layout.ignored:
        problem = f"columns that are not understood: {', '.join(source.layout.ignored)}"
        summary["problems"].append(problem)
    if source.layout.kind == "path":
        summary["problems"].append("has no heights: it can serve as a path, but is no ground")
    return summary


@dataclass(frozen=True, kw_only=True)
class _TableSource:
    """An open table, in text or Parquet, with one function to read its blocks."""

    path: Path
    format: str
    layout: TableLayout
    attrs: dict[str, Any]
    assumed: bool  # whether columns and units are assumed, since the file names none
    blocks: Callable[[int | None], Iterator[Values]]
    place: Callable[[int], str]  # place of a row in the file, for messages


def _open_table(path: Path, *, kind: str | None = None) -> _TableSource:
    with open_regular(path) as stream:
        is_parquet = stream.read(4) == b"PAR1"
    if is_parquet:
        file, layout, attrs = open_parquet(path, kind=kind)
        return _TableSource(
            path=path,
            format="Parquet",
            layout=layout,
            attrs=attrs,
            assumed=False,
            blocks=lambda size: parquet_blocks(path, file, layout, size),
            place=lambda row: f"row {row + 1}",
        )
    table = open_text(path, kind=kind)
    return _TableSource(
        path=path,
        format="CSV",
        layout=table.layout,
        attrs={},
        assumed=not table.named,
        blocks=lambda size: text_blocks(table, size),
        place=lambda row: f"line {line_of_row(table.rows, row)}",
    )


def _assumed_text(source: _TableSource, data: xr.Dataset | None) -> str:
    """Warning about the columns and units that are assumed of a table without names."""
    names = [column.name for column in source.layout.columns]
    text = f"has no names of columns: they are taken as {', '.join(names)} in metres"
    if data is not None and "s" in data.dims and data.sizes["s"] > 1:
        s = data["s"].values
        spacing = float(np.median(np.diff(s)))
        text += f", every {spacing:.4g} m over {s[-1] - s[0]:.6g} m"
        if spacing > _MAX_SPACING:
            text += " (no profiler's spacing: are they inches or feet?)"
    example = ",".join(f"{name} [in]" for name in names)
    return f"{text}; name them and their units in a first line, such as {example}"


def _read_whole(source: _TableSource) -> xr.Dataset:
    if source.layout.kind == "path":
        raise FormatError(
            "has no heights, it is a path (easting, northing)",
            path=source.path,
            place="header",
            cure="Add a column of heights, or use it as a path.",
        )
    values = _concatenate_blocks(source)
    if source.layout.kind == "points":
        return build_points(values)
    return build_profile(values, source.layout, source.path, source.place)


def _concatenate_blocks(source: _TableSource) -> dict[TableColumn, Any]:
    parts = list(source.blocks(None))
    if len(parts) == 1:
        return parts[0]
    return {
        column: np.concatenate([part[column] for part in parts]) for column in source.layout.columns
    }
