"""GeoTIFF: surfaces over a map, with a band of heights and optional bands of sd, count and filled.

The centres of the pixels are the nodes of the surface. A reference system in metres is required,
since slopes of heights over degrees are undefined; without any, metres are assumed.

Needs rasterio, which comes with ``pip install trueterrain[gis]``.
"""

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import Checksums, not_whole, provenance, require_writable, whole_output
from trueterrain.core.errors import FormatError, OutputError, TrueTerrainError
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.formats._bounds import value_range
from trueterrain.geometry.crs import parse_crs

Floats = npt.NDArray[np.float64]

#: Largest plausible height or depth of ground [m].
HIGHEST = 1e5

_UNEVEN = 1e-6  # [m] by which nodes of an equally spaced axis may deviate
_SENTINELS = (-9999.0, -32767.0, -32768.0, -99999.0)  # [m] heights that stand for "no data"
_OPTIONAL = {"sd": "m", "sd_relative": "m", "count": "", "filled": ""}
_METRES = {"", "m", "metre", "meter", "metres", "meters"}
_HISTORY = "TRUETERRAIN_HISTORY"
_WARP = "Warp it to a projected CRS first, for example gdalwarp -t_srs EPSG:25832 IN.tif OUT.tif."

# rasterio raises errors and logs them, too; without a handler, GDAL's messages would be printed
logging.getLogger("rasterio").addHandler(logging.NullHandler())


def read(path: str | Path) -> xr.Dataset:
    """Read a surface over a map from a GeoTIFF file.

    Band 1 holds the heights; further bands are read if they are called sd, sd_relative, count
    or filled.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    xarray.Dataset
        Surface with dims (northing, easting), heights [m] in double precision, NaN where the file
        has no data.

    Raises
    ------
    FormatError
        If the file is damaged, an image, rotated, not georeferenced, or not in metres.
    TrueTerrainError
        If rasterio is not installed.
    """
    path = Path(path)
    with _open_raster(path) as source:
        surface = _read_surface(source, path)
        history = source.tags().get(_HISTORY)
    if history:
        surface.attrs["provenance"] = history
    return provenance.add_step(surface, "read", parameters={"format": "GeoTIFF"}, inputs=[path])


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a GeoTIFF file for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``size`` (rows, columns), ``spacing`` and ``extent`` [m], ``missing``
        (fraction of nodes without height), ``bands``, ``number_format``, ``crs`` and ``problems``.

    Raises
    ------
    FormatError
        If the file cannot be read as a surface.
    TrueTerrainError
        If rasterio is not installed.
    """
    path = Path(path)
    with _open_raster(path) as source:
        surface = _read_surface(source, path)
        bands = [name or f"band {at}" for at, name in enumerate(source.descriptions, start=1)]
        number_format = str(source.dtypes[0])
        spacing = {"easting": source.transform.a, "northing": abs(source.transform.e)}
    height = surface["height"].values
    return {
        "format": "GeoTIFF",
        "kind": "surface",
        "number_format": number_format,
        "size": list(height.shape),
        "spacing": spacing,
        "extent": {
            "easting": value_range(surface["easting"].values),
            "northing": value_range(surface["northing"].values),
            "height": value_range(height),
        },
        "missing": float(np.isnan(height).mean()),
        "bands": bands,
        "crs": surface.attrs["crs"],
        "problems": _flag_surface(surface, bands),
    }


def write(
    surface: xr.Dataset, path: str | Path, *, force: bool = False, dtype: str = "float64"
) -> None:
    """Write a surface over a map as GeoTIFF.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface with dims (northing, easting), each equally spaced.
    path : str or Path
        Path of the file to write.
    force : bool
        Replace an existing file.
    dtype : str
        ``"float64"`` or ``"float32"``, which halves the size but changes a height of 500 m by up to
        0.02 mm.

    Raises
    ------
    ValueError
        If `dtype` is neither of the two.
    OutputError
        If the surface is no map, not equally spaced or not in metres, if the file exists and
        `force` is false, or if it is not whole when it is read back.
    TrueTerrainError
        If rasterio is not installed.

    Examples
    --------
    >>> import tempfile
    >>> ramp = make_surface([[0.0, 1.0], [0.5, 1.5]], easting=[0, 1], northing=[0, 1])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(ramp, Path(folder) / "ramp.tif")
    ...     again = read(Path(folder) / "ramp.tif")
    >>> again.height.values
    array([[0. , 1. ], [0.5, 1.5]])
    """
    if dtype not in ("float32", "float64"):
        message = f"dtype must be 'float32' or 'float64', got {dtype!r}."
        raise ValueError(message)
    path = Path(path)
    require_writable(path, force=force)
    rasterio = _import_rasterio(path)
    if "u" in surface.dims:
        raise OutputError(
            "a surface along a reference line fits into no raster of pixels",
            path=path,
            cure="Write it as .crg.",
        )
    check_surface(surface)
    profile = _raster_profile(surface, path, rasterio) | {"dtype": dtype}
    names = ["height", *(name for name in _OPTIONAL if name in surface)]
    written = Checksums()
    with whole_output(path, force=force) as temporary:
        try:
            with rasterio.open(temporary, "w", count=len(names), **profile) as target:
                for band, name in enumerate(names, start=1):
                    values = surface[name].values[::-1].astype(dtype)
                    written.add(name, values)
                    target.write(values, band)
                    target.set_band_description(band, name)
                    target.set_band_unit(band, _OPTIONAL.get(name, "m"))
                target.update_tags(**{_HISTORY: json.dumps(provenance.provenance_steps(surface))})
            # GDAL does not say so if the disk is full when it closes a file
            _require_same(temporary, names, written, path)
        except rasterio.errors.RasterioError as error:
            raise not_whole(path, _reason_text(error)) from error
        except FormatError as error:
            raise not_whole(path, "it cannot be read back") from error


def _require_same(temporary: Path, names: list[str], written: Checksums, path: Path) -> None:
    found = Checksums()
    with _open_raster(temporary) as source:
        for band, name in enumerate(names, start=1):
            found.add(name, source.read(band))
    found.require_same(written, path)


def _import_rasterio(path: Path) -> Any:
    try:
        import rasterio
    except ImportError as error:
        message = "GeoTIFF needs rasterio, which is not installed"
        raise TrueTerrainError(
            message, path=path, cure="Run `pip install trueterrain[gis]`."
        ) from error
    return rasterio


@contextmanager
def _open_raster(path: Path) -> Iterator[Any]:
    if not path.is_file():
        raise FormatError("does not exist or is no file", path=path, cure="Check the name.")
    rasterio = _import_rasterio(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            with rasterio.open(path, driver="GTiff") as source:
                yield source
    except (rasterio.errors.RasterioError, UnicodeDecodeError) as error:
        raise FormatError(
            f"is not a complete GeoTIFF file: {_reason_text(error)}",
            path=path,
            cure="The file is cut off, damaged or of another kind: copy or export it again.",
        ) from error


def _reason_text(error: Exception) -> str:
    return " ".join(str(error.__cause__ or error).split()).rstrip(".")


def _read_surface(source: Any, path: Path) -> xr.Dataset:
    _require_map(source, path)
    crs = _parse_crs(source.crs.to_wkt() if source.crs else "")
    if crs.obstacle:
        raise FormatError(crs.obstacle, path=path, place="CRS", cure=crs.cure)
    _require_heights(source, path)
    easting = source.transform.c + source.transform.a * (np.arange(source.width) + 0.5)
    northing = source.transform.f + source.transform.e * (np.arange(source.height) + 0.5)
    rows = slice(None, None, -1 if source.transform.e < 0 else 1)
    bands: dict[str, Any] = {}
    for band, name in enumerate(source.descriptions, start=1):
        if band == 1 or name in _OPTIONAL:
            bands["height" if band == 1 else name] = _read_band(source, band)[rows]
    _require_possible(bands["height"], path)
    for name in ("count", "filled"):
        if name in bands and np.isfinite(bands[name]).all():
            bands[name] = bands[name].astype(bool if name == "filled" else np.int64)
    surface = make_surface(
        bands.pop("height"), easting=easting, northing=northing[rows], crs=crs.name, **bands
    )
    return check_surface(surface, path=path)


def _read_band(source: Any, band: int) -> Floats:
    """Values of a band with its scale and offset applied; NaN where it has no data."""
    stored = source.read(band, masked=True)
    values = np.ma.filled(stored.astype(np.float64), np.nan)
    return np.asarray(values * source.scales[band - 1] + source.offsets[band - 1])


def _require_map(source: Any, path: Path) -> None:
    transform = source.transform
    if transform.is_identity:
        raise FormatError(
            "is not georeferenced, so its pixels have no place on the ground",
            path=path,
            place="geotransform",
            cure="Add a geotransform, for example with gdal_edit.py -a_ullr.",
        )
    if transform.b or transform.d or transform.a <= 0:
        raise FormatError(
            "is rotated or mirrored against the axes easting and northing, so its nodes lie on no "
            "such grid",
            path=path,
            place="geotransform",
            cure="Warp it north-up first, for example with gdalwarp IN.tif OUT.tif.",
        )


def _require_heights(source: Any, path: Path) -> None:
    from rasterio.enums import ColorInterp

    if source.colorinterp[0] in (ColorInterp.red, ColorInterp.palette):
        raise FormatError(
            "is an image: band 1 holds colours, not heights",
            path=path,
            place="band 1",
            cure="Name the elevation model, not the picture.",
        )
    if np.issubdtype(source.dtypes[0], np.complexfloating):
        raise FormatError(
            "heights must be real numbers, got complex ones",
            path=path,
            place="band 1",
            cure="Name an elevation model.",
        )
    unit = source.units[0] or ""
    if unit.lower() not in _METRES:
        raise FormatError(
            f"heights must be in metres, got the unit {unit!r}",
            path=path,
            place="band 1",
            cure="Convert the heights first, for example with gdal_calc.py.",
        )


def _require_possible(height: Floats, path: Path) -> None:
    wrong = np.argwhere(np.abs(height) > HIGHEST)
    for value in _SENTINELS:
        if not wrong.size:
            wrong = np.argwhere(height == value)
    if wrong.size:
        value = height[tuple(wrong[0])]
        raise FormatError(
            f"{len(wrong)} heights such as {value:g} m are no ground, but the file does not mark "
            "them as missing",
            path=path,
            place="band 1",
            cure=f"Mark them, for example with gdal_edit.py -a_nodata {value:g}.",
        )


def _raster_profile(surface: xr.Dataset, path: Path, rasterio: Any) -> dict[str, Any]:
    """Settings of the raster."""
    crs = _parse_crs(str(surface.attrs.get("crs", "")))
    if crs.obstacle:
        raise OutputError(crs.obstacle, path=path, place="CRS", cure=crs.cure)
    easting, northing = (np.asarray(surface[axis], float) for axis in ("easting", "northing"))
    dx, dy = _node_spacing(easting, "easting", path), _node_spacing(northing, "northing", path)
    west, north = easting[0] - dx / 2, northing[-1] + dy / 2
    return {
        "driver": "GTiff",
        "height": northing.size,
        "width": easting.size,
        "crs": crs.name or None,
        "transform": rasterio.Affine(dx, 0, west, 0, -dy, north),
        "nodata": np.nan,
        "compress": "deflate",
        "predictor": 3,
        "tiled": min(easting.size, northing.size) >= 512,
        "bigtiff": "if_safer",
    }


def _node_spacing(axis: Floats, name: str, path: Path) -> float:
    spacing = float((axis[-1] - axis[0]) / (axis.size - 1))
    off = np.abs(axis - (axis[0] + spacing * np.arange(axis.size)))
    if off.max() > _UNEVEN:
        at = int(np.argmax(off))
        raise OutputError(
            f"must be equally spaced, but node {at} is off by {off[at]:.3g} m",
            path=path,
            place=f"axis {name}",
            cure="Grid the surface with equal spacing.",
        )
    return spacing


class _CrsReference(NamedTuple):
    """Name of a CRS, and why it cannot be used (empty if coordinates are in metres)."""

    name: str
    obstacle: str = ""
    cure: str = _WARP


def _parse_crs(text: str) -> _CrsReference:
    if not text:
        return _CrsReference("")
    try:
        crs = parse_crs(text)
    except ValueError as error:
        return _CrsReference(text, str(error), "Correct the name of the CRS.")
    code = crs.to_epsg(min_confidence=100)
    name = f"EPSG:{code}" if code else crs.to_wkt()
    units = {axis.unit_name for axis in crs.axis_info if axis.unit_conversion_factor != 1}
    if crs.is_geographic:
        found = "degrees"
    elif crs.is_geocentric:
        found = "geocentric x, y, z"
    elif units and not crs.is_engineering:
        found = " and ".join(sorted(units))
    else:
        return _CrsReference(name)
    return _CrsReference(
        name, f"easting and northing in metres are needed, got {found} ({crs.name})"
    )


def _flag_surface(surface: xr.Dataset, bands: list[str]) -> list[str]:
    found = []
    if not surface.attrs["crs"]:
        found.append("the CRS is missing: coordinates are taken as metres")
    unread = [name for name in bands[1:] if name not in _OPTIONAL]
    if unread:
        found.append(f"bands that are not read: {', '.join(unread)}")
    height = surface["height"].values
    finite = height[np.isfinite(height)]
    if not finite.size:
        found.append("all heights are missing")
    elif np.ptp(finite) == 0:
        found.append(f"all heights are {finite[0]:g} m")
    return found
