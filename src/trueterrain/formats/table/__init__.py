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

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import ASSUMED, COORDINATES, EXTRA
from trueterrain.formats._bounds import Bounds, clip_points
from trueterrain.formats._table_file import ColumnRule, TextTable, open_table
from trueterrain.formats.table._build import build_points, build_profile
from trueterrain.formats.table._columns import (
    TableColumn,
    Values,
    layout_of,
    layout_without_header,
    names_columns,
)
from trueterrain.formats.table._write import bare_texts, write
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
    source = _TableSource(Path(path))
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
    source = _TableSource(Path(path))
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
    source = _TableSource(Path(path), kind="path")
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
    return _TableSource(Path(path)).layout.kind


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
    source = _TableSource(Path(path))
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


class _TableSource:
    """An open table of points, a profile or a path, and the meaning of its columns."""

    def __init__(self, path: Path, *, kind: str | None = None) -> None:
        self.table = open_table(path, names_columns)
        self.path, self.format, self.attrs = path, self.table.format, self.table.attrs
        labels = list(self.table.labels)
        # without names, columns and units are assumed
        self.assumed = not self.table.named
        if self.assumed:
            self.layout = layout_without_header(len(labels), path, kind=kind)
        else:
            self.layout = layout_of(labels, path, kind=kind)
        if isinstance(self.table, TextTable):
            self.table.check_last_line()

    def blocks(self, size: int | None) -> Iterator[Values]:
        """Yield the columns in SI units, `size` rows at a time; every row is checked."""
        columns = {column.index: column for column in self.layout.columns}
        rules = {index: self._rule(column) for index, column in columns.items()}
        for block in self.table.blocks(rules, size):
            yield {column: self._in_si(column, block[index]) for index, column in columns.items()}

    def _in_si(self, column: TableColumn, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        if column.name != "track":
            return values if column.scale == 1.0 else values * column.scale
        return bare_texts(values.astype(str)) if self.format == "CSV" else values

    def _rule(self, column: TableColumn) -> ColumnRule:
        return ColumnRule(
            label=column.label,
            is_text=column.name == "track",
            accepts="finite" if self.layout.must_be_finite(column) else "gaps",
            # extra bytes keep their type, since float64 does not hold 64-bit integers
            keep_type=column.label.startswith(EXTRA),
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
    return build_profile(values, source.layout, source.path, source.table.place)


def _concatenate_blocks(source: _TableSource) -> dict[TableColumn, Any]:
    parts = list(source.blocks(None))
    if len(parts) == 1:
        return parts[0]
    return {
        column: np.concatenate([part[column] for part in parts]) for column in source.layout.columns
    }
