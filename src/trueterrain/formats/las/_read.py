"""Points from LAS, LAZ and COPC, block by block."""

import json
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import xarray as xr

from trueterrain import provenance
from trueterrain.errors import CoverageError, FormatError
from trueterrain.formats.las import _copc
from trueterrain.formats.las._crs import Reference, reference_named, reference_of
from trueterrain.formats.las._open import Bounds, chunks, opened
from trueterrain.kinds import make_points

BLOCK = 1_000_000  # points

SECONDS_OF_WEEK = 604_800.0  # [s]
ADJUSTED = 1e9  # [s] adjusted standard GPS time = seconds since 1980-01-06 minus this
_OFFSET_UNIT = 1e6  # [s] unit of the time offset of LAS 1.5

_SELECTION = laspy.DecompressionSelection
_FIELDS = (
    _SELECTION.XY_RETURNS_CHANNEL | _SELECTION.Z | _SELECTION.GPS_TIME | _SELECTION.INTENSITY
    | _SELECTION.POINT_SOURCE_ID | _SELECTION.ALL_EXTRA_BYTES
)  # fmt: skip


def read(path: str | Path, *, bounds: Bounds | None = None, crs: str | None = None) -> xr.Dataset:
    """Points of a LAS, LAZ or COPC file.

    ``time`` is the GPS time, ``lane`` the point source id, ``sd`` and
    ``sd_relative`` the extra bytes of these names.
    ``attrs["gps_time_kind"]`` is ``"adjusted standard"`` or ``"week seconds"``: as the file says,
    unless its values cannot be seconds of a week.

    Parameters
    ----------
    path : str or Path
        The file.
    bounds : tuple of float, optional
        Smallest easting and northing, largest easting and northing [m]; edges are inside.
    crs : str, optional
        EPSG code or WKT to take instead of what the file says.

    Returns
    -------
    xarray.Dataset
        Points.

    Raises
    ------
    FormatError
        If the file is damaged, or its coordinates are feet, degrees or geocentric.
    CoverageError
        If there are no points (within the bounds).
    ValueError
        If `crs` or `bounds` mean nothing.
    """
    parts = list(_stream(path, bounds, BLOCK, crs))
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
    points = points.assign_attrs(parts[0].attrs)
    parameters = {"format": "LAS", "bounds": bounds, "crs": crs}
    return provenance.add_step(points, "read", parameters=parameters, inputs=[path])


def blocks(
    path: str | Path,
    *,
    bounds: Bounds | None = None,
    size: int = BLOCK,
    crs: str | None = None,
) -> Iterator[xr.Dataset]:
    """Points of a LAS, LAZ or COPC file block by block, never the whole file at once.

    With bounds, only the parts of a COPC file that touch them are read; other files are read
    through. The order of the points is the file's, except for COPC with bounds. While a block is
    worked with, the next one is read.

    Parameters
    ----------
    path : str or Path
        The file.
    bounds : tuple of float, optional
        Smallest easting and northing, largest easting and northing [m]; edges are inside.
    size : int
        Largest number of points in a block.
    crs : str, optional
        EPSG code or WKT to take instead of what the file says.

    Yields
    ------
    xarray.Dataset
        Points; blocks without points are left out.

    Raises
    ------
    FormatError
        As by `read`; damage is found when it is reached.
    ValueError
        If `crs`, `bounds` or `size` mean nothing.
    """
    if size < 1:
        message = f"size must be at least 1 point, got {size}."
        raise ValueError(message)
    yield from _ahead(_with_history(path, bounds, size, crs))


def _with_history(
    path: str | Path, bounds: Bounds | None, size: int, crs: str | None
) -> Generator[xr.Dataset, None, None]:
    history: str | None = None
    for block in _stream(path, bounds, size, crs):
        if history is None:
            parameters = {"format": "LAS", "bounds": bounds, "crs": crs}
            # the hash of the whole file would cost more than the part that is read
            inputs = [path] if bounds is None else []
            parameters |= {} if inputs else {"file": Path(path).name}
            step = provenance.add_step(block, "read", parameters=parameters, inputs=inputs)
            history = step.attrs["provenance"]
        yield block.assign_attrs(provenance=history)


def _ahead(items: Generator[xr.Dataset, None, None]) -> Iterator[xr.Dataset]:
    """Items in order, the next of which is made in a thread of its own."""
    with closing(items), ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(next, items, None)
        while (item := waiting.result()) is not None:
            waiting = pool.submit(next, items, None)
            yield item


def _stream(
    path: str | Path, bounds: Bounds | None, size: int, crs: str | None
) -> Iterator[xr.Dataset]:
    path = Path(path)
    _check_bounds(bounds)
    override = None if crs is None else reference_named(crs)
    with opened(path, _FIELDS) as reader:
        header = reader.header
        reference = override or reference_of(header)
        _require_metres(reference, path)
        attrs: dict[str, Any] = {"crs": reference.crs, **_history(header)}
        if bounds is not None and _copc.is_copc(header):
            records = _copc.query(path, bounds, size, _FIELDS)
        else:
            records = chunks(reader, path, size)
        for record in records:
            points = _points(record, header)
            if points.sizes["point"] and "gps_time_kind" not in attrs and "time" in points:
                attrs["gps_time_kind"] = time_kind(header, points.time.values)
            points = points.assign_attrs(attrs)
            if bounds is not None:
                points = _cut(points, bounds)
            if points.sizes["point"]:
                yield points


def time_kind(header: Any, time: Any) -> str:
    """What gps_time counts: as the flag says, unless the values contradict it."""
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


def _points(record: Any, header: Any) -> xr.Dataset:
    east, north, up = (
        np.multiply(record[name], scale) for name, scale in zip("XYZ", header.scales, strict=True)
    )
    for axis, offset in zip((east, north, up), header.offsets, strict=True):
        axis += offset
    optional: dict[str, Any] = {
        "intensity": np.array(record["intensity"]),
        "lane": np.array(record["point_source_id"]),
    }
    time = times_of(record, header)
    if time is not None:
        optional["time"] = time
    for name in ("sd", "sd_relative"):
        if name in record.point_format.extra_dimension_names:
            optional[name] = np.array(record[name], dtype=np.float64)
    return make_points(east, north, up, **optional)


def _cut(points: xr.Dataset, bounds: Bounds) -> xr.Dataset:
    west, south, east, north = bounds
    x, y = points.easting.values, points.northing.values
    inside = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    return points if inside.all() else points.isel(point=np.flatnonzero(inside))


def _check_bounds(bounds: Bounds | None) -> None:
    if bounds is None:
        return
    west, south, east, north = bounds
    if not (west <= east and south <= north):
        message = (
            "bounds must be smallest easting, smallest northing, largest easting, largest "
            f"northing [m], got {bounds}."
        )
        raise ValueError(message)


def _require_metres(reference: Reference, path: Path) -> None:
    if reference.obstacle:
        raise FormatError(
            f"coordinates must be easting, northing and up in metres, but are "
            f"{reference.obstacle} ({reference.name})",
            path=path,
            place="CRS of the header",
            cure="Transform the file to a projected CRS in metres, or name the true CRS "
            "(crs=..., --crs) if the header is wrong.",
        )


def _history(header: Any) -> dict[str, str]:
    for record in header.vlrs.get_by_id("trueterrain"):
        try:
            history = json.loads(record.record_data)
        except ValueError:
            continue
        if isinstance(history, list) and all(isinstance(entry, dict) for entry in history):
            return {"provenance": json.dumps(history)}
    return {}
