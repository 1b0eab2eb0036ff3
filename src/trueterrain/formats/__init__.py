"""File formats: what a file is, reading and writing it.

A file, or a folder that is a Zarr store, is recognised by its content, never by its ending alone.
Each format is a module with ``read``, ``write`` and ``describe``, imported when it is first needed.
"""

import importlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from trueterrain.errors import FormatError, concerning
from trueterrain.formats.signature import Format, ending_matches, recognise

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "Format",
    "info",
    "kind_of_file",
    "open",
    "point_blocks",
    "recognise",
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
        ".laz": "las", ".las": "las", ".csv": "table", ".parquet": "table", ".zarr": "store",
    },
}  # fmt: skip


def open(path: str | Path) -> "xr.Dataset":  # noqa: A001 - called as trueterrain.formats.open
    """Read a file of any known format.

    Parameters
    ----------
    path : str or Path
        CRG, GeoTIFF, LAS, LAZ, COPC, ERD, CSV or Parquet file, or a Zarr store; or navigation.

    Returns
    -------
    xarray.Dataset
        Points, Surface or Profile, see `trueterrain.kinds`, or navigation, see
        `trueterrain.formats.navigation`.

    Raises
    ------
    FormatError
        If the format is unknown or the file is damaged.
    """
    data: xr.Dataset = _module(recognise(path).module).read(path)
    return data


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
    found = recognise(path)
    summary: dict[str, Any] = {"file": str(path), "bytes": path.stat().st_size}
    summary |= _module(found.module).describe(path)
    if not ending_matches(path, found):
        doubt = f"the name ends with {path.suffix or 'nothing'!r}, the content is {found.name}"
        summary["problems"] = [doubt, *summary["problems"]]
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
        Replace a file that is there already, or a store of points, a surface or a profile.
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
    from trueterrain.kinds import kind_of

    kind = "points" if isinstance(data, Iterator) else kind_of(data)
    module = _module(writer_of(kind, path))
    with concerning(path):
        return module.write(data, path, force=force, **options)


def require_writable(
    path: str | Path, *, force: bool = False, inputs: Iterable[str | Path] = ()
) -> None:
    """Raise if an output, file or store, may not be written, before the work for it begins.

    Parameters
    ----------
    path : str or Path
        Where the output shall be; a name that ends with .zarr is that of a store.
    force : bool
        Whether what is there already may be replaced: a file by a file, and points, a surface or a
        profile in a store by a store.
    inputs : iterable of str or Path
        Files and stores that the work reads; none of them is replaced, not even with `force`.

    Raises
    ------
    OutputError
        If something exists and may not be replaced, or the folder does not exist.

    Examples
    --------
    >>> require_writable("nowhere/points.zarr")
    Traceback (most recent call last):
    trueterrain.errors.OutputError: nowhere/points.zarr: the folder nowhere does not exist. ...
    """
    if Path(path).suffix.lower() == ".zarr":
        _module("store").require_replaceable(path, force=force, inputs=inputs)
        return
    from trueterrain import engine

    engine.require_writable(path, force=force, inputs=inputs)


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

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        If the file is damaged or holds no points.
    """
    found = recognise(path)
    module = _module(found.module)
    if not hasattr(module, "blocks"):
        raise FormatError(
            f"holds no points, its format is {found.name}",
            path=path,
            cure="Convert it to points first: `trueterrain convert`.",
        )
    yield from module.blocks(path, bounds=bounds, size=size, crs=crs)


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
    module = recognise(path).module
    return kinds[module] if module in kinds else str(_module(module).kind(path))


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"trueterrain.formats.{name}")
