"""Read points from LAS, LAZ and COPC, block by block."""

import json
from collections.abc import Collection, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, FormatError
from trueterrain.core.schemas import make_points
from trueterrain.formats._bounds import Bounds, check_bounds, clip_points
from trueterrain.formats.las import _copc
from trueterrain.formats.las._crs import CrsReference, reference_named, reference_of
from trueterrain.formats.las._dimensions import (
    attrs_of,
    selection_of,
    values_of,
    variables_of,
)
from trueterrain.formats.las._open import open_reader, read_chunks

BLOCK = 1_000_000  # points

SECONDS_OF_WEEK = 604_800.0  # [s]
ADJUSTED = 1e9  # [s] adjusted standard GPS time = seconds since 1980-01-06 minus this
_OFFSET_UNIT = 1e6  # [s] unit of the time offset of LAS 1.5


def read(path: str | Path, *, bounds: Bounds | None = None, crs: str | None = None) -> xr.Dataset:
    """Read the points of a LAS, LAZ or COPC file.

    ``time`` is the GPS time, ``lane`` the point source id, ``sd`` and ``sd_relative`` the extra
    bytes of these names; all other dimensions have the names of
    `trueterrain.core.schemas.RETURN_ATTRIBUTES`, other extra bytes ``extra_NAME``. Wave packets are
    not read (``attrs["not_read"]``). Feet are converted to metres, and the CRS to one in metres.
    ``attrs["coordinate_scale"]`` and ``["coordinate_offset"]`` are scale and offset of the
    coordinates in the file [m]. ``attrs["gps_time_kind"]`` is ``"adjusted standard"`` or
    ``"week seconds"``: as the header states, unless the values exceed the seconds of a week.

    Parameters
    ----------
    path : str or Path
        The file.
    bounds : tuple of float, optional
        West, south, east and north edge [m]; points on an edge are inside.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the file.

    Returns
    -------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        If the file is damaged, or its coordinates are degrees or geocentric.
    CoverageError
        If there are no points (within the bounds).
    ValueError
        If `crs` or `bounds` are not valid.
    """
    parts = list(_stream_points(path, bounds, BLOCK, crs, None))
    if not parts:
        place = "" if bounds is None else " within the bounds"
        raise CoverageError(f"there are no points{place}", path=path)
    names = [str(name) for name in parts[0].data_vars]
    columns: dict[str, Any] = {
        name: np.concatenate([part[name].values for part in parts]) for name in names
    }
    points = make_points(
        columns.pop("easting"), columns.pop("northing"), columns.pop("up"), **columns
    )
    for name in names:
        points[name].attrs = parts[0][name].attrs
    points = points.assign_attrs(parts[0].attrs)
    parameters = {"format": "LAS", "bounds": bounds, "crs": crs}
    return provenance.add_step(points, "read", parameters=parameters, inputs=[path])


def blocks(
    path: str | Path,
    *,
    bounds: Bounds | None = None,
    size: int = BLOCK,
    crs: str | None = None,
    variables: Collection[str] | None = None,
) -> Iterator[xr.Dataset]:
    """Read the points of a LAS, LAZ or COPC file block by block, in flat memory.

    With bounds, only the parts of a COPC file that touch them are read; other files are read to the
    end. The order of the points is that of the file, except for COPC with bounds. The next block is
    read in a thread while the current one is processed.

    Parameters
    ----------
    path : str or Path
        The file.
    bounds : tuple of float, optional
        West, south, east and north edge [m]; points on an edge are inside.
    size : int
        Largest number of points in a block.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the file.
    variables : collection of str, optional
        Variables to read besides the coordinates; by default all that the file has. Decompression
        is faster with fewer variables.

    Yields
    ------
    xarray.Dataset
        Points; blocks without points are omitted.

    Raises
    ------
    FormatError
        As by `read`; damage is found when it is reached.
    ValueError
        If `crs`, `bounds` or `size` are not valid.
    """
    if size < 1:
        message = f"size must be at least 1 point, got {size}."
        raise ValueError(message)
    yield from _read_ahead(_with_history(path, bounds, size, crs, variables))


def point_variables(path: str | Path) -> tuple[str, ...]:
    """Variables of the points of a file besides the coordinates, by its header alone.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    tuple of str
        Names.

    Raises
    ------
    FormatError
        If the header is damaged.
    """
    with open_reader(path) as reader:
        return variables_of(reader.header.point_format)


def header_of(path: str | Path, crs: str | None = None) -> tuple[CrsReference, Any]:
    """Coordinate reference and extent of a file, by its header alone.

    Parameters
    ----------
    path : str or Path
        The file.
    crs : str, optional
        EPSG code or WKT that replaces the CRS of the file.

    Returns
    -------
    reference : CrsReference
        CRS and units of the coordinates.
    extent : numpy.ndarray, shape (2, 3)
        Minimum and maximum of easting, northing, up by the header [m].

    Raises
    ------
    FormatError
        If the header is damaged, or coordinates are degrees or geocentric.
    """
    with open_reader(path) as reader:
        override = None if crs is None else reference_named(crs)
        reference = _crs_reference(reader.header, Path(path), override)
        factors = np.array(reference.units.factors)
        return reference, np.stack([reader.header.mins, reader.header.maxs]) * factors


def _with_history(
    path: str | Path,
    bounds: Bounds | None,
    size: int,
    crs: str | None,
    variables: Collection[str] | None,
) -> Generator[xr.Dataset, None, None]:
    history: str | None = None
    for block in _stream_points(path, bounds, size, crs, variables):
        if history is None:
            parameters = {"format": "LAS", "bounds": bounds, "crs": crs}
            # with bounds, hashing the whole file would take longer than reading the part
            inputs = [path] if bounds is None else []
            parameters |= {} if inputs else {"file": Path(path).name}
            step = provenance.add_step(block, "read", parameters=parameters, inputs=inputs)
            history = step.attrs["provenance"]
        yield block.assign_attrs(provenance=history)


def _read_ahead(items: Generator[xr.Dataset, None, None]) -> Iterator[xr.Dataset]:
    """Yield items in order; a thread computes the next one meanwhile."""
    with closing(items), ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(next, items, None)
        while (item := waiting.result()) is not None:
            waiting = pool.submit(next, items, None)
            yield item


def _stream_points(
    path: str | Path,
    bounds: Bounds | None,
    size: int,
    crs: str | None,
    variables: Collection[str] | None,
) -> Iterator[xr.Dataset]:
    path = Path(path)
    check_bounds(bounds)
    reference, names, selection = _reading_plan(path, crs, variables)
    factors = reference.units.factors
    with open_reader(path, selection) as reader:
        header = reader.header
        attrs: dict[str, Any] = {"crs": reference.crs, **_read_provenance(header)}
        attrs["coordinate_scale"] = (np.asarray(header.scales) * factors).tolist()
        attrs["coordinate_offset"] = (np.asarray(header.offsets) * factors).tolist()
        if "wavepacket_index" in header.point_format.dimension_names:
            attrs["not_read"] = "wave packets"
        if bounds is not None and _copc.is_copc(header):
            across = factors[0]
            west, south, east, north = (edge / across for edge in bounds)
            records = _copc.query_nodes(path, (west, south, east, north), size, selection)
        else:
            records = read_chunks(reader, path, size)
        for record in records:
            points = _make_points(record, header, names, factors)
            if points.sizes["point"] and "gps_time_kind" not in attrs and "time" in points:
                attrs["gps_time_kind"] = time_kind(header, points.time.values)
            points = points.assign_attrs(attrs)
            if bounds is not None:
                points = clip_points(points, bounds)
            if points.sizes["point"]:
                yield points


def _reading_plan(
    path: Path, crs: str | None, variables: Collection[str] | None
) -> tuple[CrsReference, list[str], Any]:
    """CRS of a file, variables to read, and the parts of points to decompress for them."""
    override = None if crs is None else reference_named(crs)
    with open_reader(path) as reader:
        reference = _crs_reference(reader.header, path, override)
        point_format = reader.header.point_format
        names = [n for n in variables_of(point_format) if variables is None or n in variables]
        return reference, names, selection_of(point_format, names)


def time_kind(header: Any, time: Any) -> str:
    """Kind of GPS time: as the flag of the header states, unless the values contradict it."""
    standard = header.global_encoding.gps_time_type.value == 1
    known = time[np.isfinite(time)]
    if not standard and not (known.size and np.abs(known).max() > SECONDS_OF_WEEK):
        return "week seconds"
    return "adjusted standard"


def times_of(record: Any, header: Any) -> Any:
    """GPS times of a record [s]; None if the point format has none."""
    if "gps_time" not in record.point_format.dimension_names:
        return None
    time = np.array(record["gps_time"], dtype=np.float64)
    if header.global_encoding.gps_time_offset:
        time += header.gps_time_offset * _OFFSET_UNIT - ADJUSTED
    return time


def _make_points(
    record: Any, header: Any, names: list[str], factors: tuple[float, float, float]
) -> xr.Dataset:
    east, north, up = (
        np.multiply(record[name], scale) for name, scale in zip("XYZ", header.scales, strict=True)
    )
    for axis, offset, factor in zip((east, north, up), header.offsets, factors, strict=True):
        axis += offset
        if factor != 1.0:
            axis *= factor
    optional = {
        name: times_of(record, header) if name == "time" else values_of(record, name)
        for name in names
    }
    points = make_points(east, north, up, **optional)
    for name in names:
        points[name].attrs |= attrs_of(record.point_format, name)
    return points


def _crs_reference(header: Any, path: Path, override: CrsReference | None) -> CrsReference:
    reference = override or reference_of(header)
    if reference.obstacle:
        raise FormatError(
            f"coordinates must be easting, northing and up, but are {reference.obstacle} "
            f"({reference.name})",
            path=path,
            place="CRS of the header",
            cure="Transform the file to a projected CRS, or name the true CRS (crs=..., --crs) "
            "if the header is wrong.",
        )
    return reference


def _read_provenance(header: Any) -> dict[str, str]:
    for record in header.vlrs.get_by_id("trueterrain"):
        try:
            history = json.loads(record.record_data)
        except ValueError:
            continue
        if isinstance(history, list) and all(isinstance(entry, dict) for entry in history):
            return {"provenance": json.dumps(history)}
    return {}
