"""File formats: recognise, describe, read and write files of any known format.

A file, or a folder that is a Zarr store, is recognised by its content, never by its ending alone.
Each format is a module with ``read``, ``write`` and ``describe``, imported when it is first needed.
"""

import importlib
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from trueterrain import core
from trueterrain.core.errors import CoverageError, FormatError, name_file_in_errors
from trueterrain.formats.point_filter import PointFilter, ReturnCounts
from trueterrain.formats.signature import Format, ending_matches, recognise_format

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Format",
    "PointFilter",
    "conversion_of",
    "info",
    "kind_of_file",
    "open",
    "point_blocks",
    "point_variables",
    "recognise_format",
    "require_writable",
    "write",
    "writer_of",
]

#: Points in a block by default.
BLOCK = 1_000_000

# module that writes a kind of data under each ending
_WRITERS = {
    "surface": {".crg": "opencrg", ".tif": "geotiff", ".tiff": "geotiff", ".zarr": "store"},
    "profile": {".erd": "erd", ".csv": "table", ".parquet": "table", ".zarr": "store"},
    "points": {
        ".laz": "las",
        ".las": "las",
        ".csv": "table",
        ".parquet": "table",
        ".zarr": "store",
    },
}


def open(  # noqa: A001 - called as trueterrain.formats.open
    path: str | Path, *, only: PointFilter | None = None
) -> "xr.Dataset":
    """Read a file of any known format.

    Parameters
    ----------
    path : str or Path
        CRG, GeoTIFF, LAS, LAZ, COPC, ERD, CSV or Parquet file, or a Zarr store; or navigation.
    only : PointFilter, optional
        Classes and returns of the points to take; by default all. Only for points.

    Returns
    -------
    xarray.Dataset
        Points, Surface or Profile, see `trueterrain.core.schemas`, or navigation, see
        `trueterrain.formats.navigation`.

    Raises
    ------
    FormatError
        If the format is unknown, the file is damaged, or `only` is given and it holds no points.
    CoverageError
        If no point is taken.
    """
    data: xr.Dataset = _import_format(recognise_format(path).module).read(path)
    if only is None or not only.variables:
        return data
    if "point" not in data.dims:
        raise _no_points(path)
    return next(_filtered_blocks(iter([data]), only, path))


def info(path: str | Path) -> dict[str, Any]:
    """Describe a file: format, kind of data, counts, extent, CRS and problems.

    Use it before processing a file of unknown origin; the values are those of ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        File or store of any known format.

    Returns
    -------
    dict
        ``file``, ``bytes``, and the result of the format's ``describe`` (``format``, ``kind``,
        ``extent``, ``problems``, ...); all values are plain types that JSON can hold.

    Raises
    ------
    FormatError
        If the format is unknown, or the file is too damaged to be described.
    """
    path = Path(path)
    found = recognise_format(path)
    summary: dict[str, Any] = {"file": str(path), "bytes": path.stat().st_size}
    summary |= _import_format(found.module).describe(path)
    if not ending_matches(path, found):
        flag = f"the name ends with {path.suffix or 'nothing'!r}, the content is {found.name}"
        summary["problems"] = [flag, *summary["problems"]]
    return summary


def write(
    data: "xr.Dataset | Iterator[xr.Dataset]",
    path: str | Path,
    *,
    force: bool = False,
    **options: Any,
) -> Any:
    """Write data; the ending of the path selects the format.

    Parameters
    ----------
    data : xarray.Dataset or iterator of xarray.Dataset
        Surface (.crg, .tif, .zarr), profile (.erd, .csv, .parquet, .zarr), points (.laz, .las,
        .csv, .parquet, .zarr), or an iterator of blocks of points.
    path : str or Path
        Path of the file or store to write.
    force : bool
        Replace an existing file, or an existing store of the same kind of data.
    **options
        Passed to the format's own ``write``.

    Returns
    -------
    object
        What the format's ``write`` returns.

    Raises
    ------
    ValueError
        If this kind of data cannot be written under this ending.
    OutputError
        If the file exists and `force` is false.
    """
    from trueterrain.core.schemas import kind_of

    kind = "points" if isinstance(data, Iterator) else kind_of(data)
    module = _import_format(writer_of(kind, path))
    with name_file_in_errors(path):
        return module.write(data, path, force=force, **options)


def require_writable(
    path: str | Path,
    *,
    force: bool = False,
    inputs: Iterable[str | Path] = (),
    kind: str | None = None,
) -> None:
    """Raise if an output file or store may not be written.

    Call it before a long computation, so that the error comes at once and not at the end.

    Parameters
    ----------
    path : str or Path
        Path of the output; a name that ends with .zarr is that of a store.
    force : bool
        Allow replacing an existing output: a file by a file, a store by a store of the same kind.
    inputs : iterable of str or Path
        Files and stores that are read. The output must not be one of them, contain one or lie
        inside one, not even with `force`.
    kind : str, optional
        Kind of data to write: ``"points"``, ``"surface"`` or ``"profile"``; by default any of them.

    Raises
    ------
    OutputError
        If something exists and may not be replaced, or the folder does not exist.

    Examples
    --------
    >>> require_writable("missing/points.zarr")
    Traceback (most recent call last):
    trueterrain.core.errors.OutputError: missing/points.zarr: the folder missing does not exist. ...
    """
    store = Path(path).suffix.lower() == ".zarr"
    kinds = tuple(_WRITERS) if kind is None else (kind,)
    core.require_writable(path, force=force, inputs=inputs, replaces=kinds if store else "file")


def writer_of(kind: str, path: str | Path) -> str:
    """Name of the module that writes a kind of data to a path, by the ending of the path.

    Parameters
    ----------
    kind : str
        ``"points"``, ``"surface"`` or ``"profile"``.
    path : str or Path
        Path of the file to write.

    Returns
    -------
    str
        Name of a module of `trueterrain.formats`.

    Raises
    ------
    ValueError
        If this kind of data has no format with that ending; the message names those that it has.

    Examples
    --------
    >>> writer_of("profile", "road.ERD")
    'erd'
    """
    writers = _WRITERS[kind]
    ending = Path(path).suffix.lower()
    if ending not in writers:
        known = ", ".join(writers)
        what = kind if kind == "points" else f"a {kind}"
        message = f"{path}: {what} can be written to {known}, got ending {ending!r}."
        raise ValueError(message)
    return writers[ending]


def point_blocks(
    path: str | Path,
    *,
    bounds: tuple[float, float, float, float] | None = None,
    size: int = BLOCK,
    crs: str | None = None,
    variables: Collection[str] | None = None,
    only: PointFilter | None = None,
) -> "Iterator[xr.Dataset]":
    """Read the points of a file block by block, in flat memory.

    Parameters
    ----------
    path : str or Path
        LAS, LAZ, COPC, CSV or Parquet file, or Zarr store, of points.
    bounds : tuple of float, optional
        West, south, east and north edge [m]; points on an edge are inside.
    size : int
        Largest number of points in a block.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the file.
    variables : collection of str, optional
        Variables to read besides the coordinates; those that the file lacks are ignored. By default
        all; reading fewer is faster.
    only : PointFilter, optional
        Classes and returns of the points to take; by default all.

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        If the file is damaged, holds no points, or lacks the variables that `only` needs.
    CoverageError
        If there are points within the bounds, but `only` takes none of them.
    """
    module = _points_module(path)
    chosen = () if only is None else only.variables
    if only is not None and chosen:
        with name_file_in_errors(path):
            only.require(module.point_variables(path))
    if crs is not None and not hasattr(module, "header_of"):
        crs = _crs_in_metres(crs)
    read = variables if variables is None else {*variables, *chosen}
    blocks = module.blocks(path, bounds=bounds, size=size, crs=crs, variables=read)
    if only is None or not chosen:
        yield from blocks
        return
    surplus = () if variables is None else set(chosen) - set(variables)
    for block in _filtered_blocks(blocks, only, path):
        yield block.drop_vars(surplus)


def point_variables(path: str | Path) -> tuple[str, ...]:
    """Variables of the points of a file besides the coordinates, by its header alone.

    Parameters
    ----------
    path : str or Path
        LAS, LAZ, COPC, CSV or Parquet file, or Zarr store, of points.

    Returns
    -------
    tuple of str
        Names, as `point_blocks` takes them.

    Raises
    ------
    FormatError
        If the file is damaged or holds no points.
    """
    found: tuple[str, ...] = _points_module(path).point_variables(path)
    return found


def conversion_of(path: str | Path, crs: str | None = None) -> str:
    """Conversion of coordinates to metres on reading, in words, for reports and log messages.

    Parameters
    ----------
    path : str or Path
        Any file.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the file.

    Returns
    -------
    str
        Empty if coordinates are in metres, or the format states no units.
    """
    module = _import_format(recognise_format(path).module)
    if hasattr(module, "header_of"):
        return str(module.header_of(path, crs)[0].conversion)
    if crs is not None and _crs_in_metres(crs) != crs:
        return "taken in metres or the units of its columns; its CRS becomes the one in metres"
    return ""


def _crs_in_metres(crs: str) -> str:
    """CRS of points in metres: the given one, or its counterpart in metres if it is in feet."""
    from trueterrain.geometry.crs import crs_in_metres, parse_crs, units_of

    parsed = parse_crs(crs)
    if parsed.is_geographic or parsed.is_geocentric or units_of(parsed).metres:
        return crs
    return crs_in_metres(parsed)


def _filtered_blocks(
    blocks: "Iterator[xr.Dataset]", only: PointFilter, path: str | Path
) -> "Iterator[xr.Dataset]":
    """Points that a filter takes; if it takes none, an error that counts classes and returns."""
    counts, seen, taken = ReturnCounts(), 0, 0
    for block in blocks:
        with name_file_in_errors(path):
            part = only.apply(block)
        seen += block.sizes["point"]
        taken += part.sizes["point"]
        if part.sizes["point"]:
            yield part
        elif not taken:
            counts.add(block)
    if seen and not taken:
        found = "; ".join(
            f"{key} " + ", ".join(f"{name}: {number:,}" for name, number in by.items())
            for key, by in counts.counts().items()
        )
        raise CoverageError(
            f"none of {seen:,} points is of {only}; there are {found}",
            path=path,
            cure="Choose other classes or returns (--class, --return).",
        )


def _points_module(path: str | Path) -> ModuleType:
    module = _import_format(recognise_format(path).module)
    if not hasattr(module, "point_variables"):
        raise _no_points(path)
    return module


def _no_points(path: str | Path) -> FormatError:
    return FormatError(
        f"holds no points, its format is {recognise_format(path).name}",
        path=path,
        cure="Convert it to points first: `trueterrain convert`.",
    )


def kind_of_file(path: str | Path) -> str:
    """Kind of data in a file, by its first bytes or its header.

    Parameters
    ----------
    path : str or Path
        File or store of any known format.

    Returns
    -------
    str
        ``"points"``, ``"surface"``, ``"profile"``, ``"path"`` (a table without heights), ``"run"``,
        ``"navigation"`` or ``"accuracy"``.

    Raises
    ------
    FormatError
        If the format is unknown.
    """
    kinds = {
        "opencrg": "surface",
        "geotiff": "surface",
        "las": "points",
        "erd": "profile",
        "run": "run",
        "navigation.sbet": "navigation",
        "navigation.boreas": "navigation",
        "navigation.columns": "navigation",
        "navigation.smrmsg": "accuracy",
    }
    module = recognise_format(path).module
    return kinds[module] if module in kinds else str(_import_format(module).kind(path))


def _import_format(name: str) -> ModuleType:
    return importlib.import_module(f"trueterrain.formats.{name}")
