"""File formats: what a file is, reading and writing it.

A file, or a folder that is a Zarr store, is recognised by its content, never by its ending alone.
Each format is a module with ``read``, ``write`` and ``describe``, imported when it is first needed.
"""

import importlib
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

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

#: Points in a block, unless told otherwise.
BLOCK = 1_000_000

# endings by which a kind of data can be written, and the module that does it
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
        Which points of a cloud are taken; by default all. Of other kinds of data, nothing else is
        allowed.

    Returns
    -------
    xarray.Dataset
        Points, Surface or Profile, see `trueterrain.core.schemas`, or navigation, see
        `trueterrain.formats.navigation`.

    Raises
    ------
    FormatError
        If the format is unknown or the file is damaged, or holds no points that could be chosen.
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
    """Say what a file is, and what is wrong with it.

    Parameters
    ----------
    path : str or Path
        File or store of any known format.

    Returns
    -------
    dict
        What the format's ``describe`` says (``format``, ``kind``, ``extent``, ``problems``, ...),
        and ``file`` and ``bytes``; everything can be written as JSON.

    Raises
    ------
    FormatError
        If the format is unknown or the file is damaged beyond description.
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
    """Write data in the format that the ending names.

    Parameters
    ----------
    data : xarray.Dataset or iterator of xarray.Dataset
        Surface (.crg, .tif, .zarr), profile (.erd, .csv, .parquet, .zarr), or points (.laz, .las,
        .csv, .parquet, .zarr); points also block by block.
    path : str or Path
        Where the file shall be, or the store.
    force : bool
        Replace a file that is there already, or a store of the same kind of data.
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
    """Raise if an output, file or store, may not be written, before the work for it begins.

    Parameters
    ----------
    path : str or Path
        Where the output shall be; a name that ends with .zarr is that of a store.
    force : bool
        Whether what is there already may be replaced: a file by a file, a store by a store of the
        same kind.
    inputs : iterable of str or Path
        Files and stores that the work reads; the output is none of them, holds none and lies in
        none, not even with `force`.
    kind : str, optional
        ``"points"``, ``"surface"`` or ``"profile"``: what will be written; by default any of them.

    Raises
    ------
    OutputError
        If something exists and may not be replaced, or the folder does not exist.

    Examples
    --------
    >>> require_writable("nowhere/points.zarr")
    Traceback (most recent call last):
    trueterrain.core.errors.OutputError: nowhere/points.zarr: the folder nowhere does not exist. ...
    """
    from trueterrain import core

    store = Path(path).suffix.lower() == ".zarr"
    kinds = tuple(_WRITERS) if kind is None else (kind,)
    core.require_writable(path, force=force, inputs=inputs, replaces=kinds if store else "file")


def writer_of(kind: str, path: str | Path) -> str:
    """Module that writes a kind of data under an ending.

    Parameters
    ----------
    kind : str
        ``"points"``, ``"surface"`` or ``"profile"``.
    path : str or Path
        Where the file shall be.

    Returns
    -------
    str
        Name of a module of `trueterrain.formats`.

    Raises
    ------
    ValueError
        Naming the endings that this kind of data can have.

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
    """Points of a file block by block, never the whole file at once.

    Parameters
    ----------
    path : str or Path
        LAS, LAZ, COPC, CSV or Parquet file, or Zarr store, of points.
    bounds : tuple of float, optional
        Smallest easting and northing, largest easting and northing [m]; points on the edges are
        inside.
    size : int
        Largest number of points in a block.
    crs : str, optional
        EPSG code or WKT to take instead of what the file says.
    variables : collection of str, optional
        Variables to read beside the coordinates, as far as the file has them; by default all. The
        fewer, the faster.
    only : PointFilter, optional
        Which points are taken; by default all.

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        If the file is damaged, holds no points, or lacks what they are chosen by.
    CoverageError
        If there are points (within the bounds), but none of them is taken.
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
    """Variables beside the coordinates that points of a file have; the points are not read.

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
    """How coordinates of a point cloud in feet become metres when they are read, in words.

    Parameters
    ----------
    path : str or Path
        Any file.
    crs : str, optional
        EPSG code or WKT to take instead of what the file says.

    Returns
    -------
    str
        Empty if they are metres, or the format has no CRS with units of its own.
    """
    module = _import_format(recognise_format(path).module)
    if hasattr(module, "header_of"):
        return str(module.header_of(path, crs)[0].conversion)
    if crs is not None and _crs_in_metres(crs) != crs:
        return "taken in metres or the units of its columns; its CRS becomes the one in metres"
    return ""


def _crs_in_metres(crs: str) -> str:
    """CRS for points that are in metres, whatever the axes of the one that is named."""
    from trueterrain.geometry.crs import crs_in_metres, parse_crs, units_of

    parsed = parse_crs(crs)
    if parsed.is_geographic or parsed.is_geocentric or units_of(parsed).metres:
        return crs
    return crs_in_metres(parsed)


def _filtered_blocks(
    blocks: "Iterator[xr.Dataset]", only: PointFilter, path: str | Path
) -> "Iterator[xr.Dataset]":
    """Points that are taken; an error that says what there is if there are none."""
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
    """Kind of data in a file, by its first bytes.

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
