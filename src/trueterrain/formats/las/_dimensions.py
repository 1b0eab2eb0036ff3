"""Dimensions of LAS points converted to variables of Points, and back."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import xarray as xr

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import EXTRA, RETURN_ATTRIBUTES

ANGLE_STEP = np.deg2rad(0.006)  # [rad] of the scan angle from point format 6 on
_LARGEST_ANGLE = 30_000  # [steps] 180 deg
_BITS = {
    "return_number": 4,
    "number_of_returns": 4,
    "scanner_channel": 2,
    "scan_direction_flag": 1,
    "edge_of_flight_line": 1,
    "synthetic": 1,
    "key_point": 1,
    "withheld": 1,
    "overlap": 1,
}
_COLOURS = ("red", "green", "blue")
_DEVIATIONS = {"sd": "standard deviation [m]", "sd_relative": "relative to the datum [m]"}
_LONGEST_NAME = 32  # [bytes] of extra bytes
_SCALE, _OFFSET, _STORED = "scale", "offset", "stored_as"  # attributes of scaled extra bytes

_PARTS = laspy.DecompressionSelection
_FLAGS = (
    "scan_direction_flag",
    "edge_of_flight_line",
    "synthetic",
    "key_point",
    "withheld",
    "overlap",
)
_PART_OF = {
    "time": _PARTS.GPS_TIME,
    "intensity": _PARTS.INTENSITY,
    "lane": _PARTS.POINT_SOURCE_ID,
    "classification": _PARTS.CLASSIFICATION,
    "scan_angle": _PARTS.SCAN_ANGLE,
    "user_data": _PARTS.USER_DATA,
    "nir": _PARTS.NIR,
    **dict.fromkeys(_COLOURS, _PARTS.RGB),
    **dict.fromkeys(_FLAGS, _PARTS.FLAGS),
}


def variables_of(point_format: Any) -> tuple[str, ...]:
    """Variables of points of a format besides their coordinates."""
    standard = set(point_format.standard_dimension_names)
    angle = {"scan_angle"} if standard & {"scan_angle", "scan_angle_rank"} else set()
    time = {"time"} if "gps_time" in standard else set()
    known = {"intensity", "lane"} | time | angle | (standard & set(RETURN_ATTRIBUTES))
    order = ("intensity", "lane", "time", *RETURN_ATTRIBUTES)
    return (*(name for name in order if name in known), *_extra_dimensions(point_format))


def selection_of(point_format: Any, names: Collection[str]) -> Any:
    """Parts of a compressed point that these variables need."""
    selection = _PARTS.XY_RETURNS_CHANNEL | _PARTS.Z
    extra = _extra_dimensions(point_format)
    for name in names:
        if name in extra:
            selection |= _PARTS.ALL_EXTRA_BYTES
        elif name in _PART_OF:
            selection |= _PART_OF[name]
    return selection


def values_of(record: Any, name: str) -> Any:
    """Values of a variable of a record, except times (see `times_of`)."""
    point_format = record.point_format
    if name in (extra := _extra_dimensions(point_format)):
        dimension, element = extra[name]
        values = record[dimension]
        return np.array(
            values if element is None else values[:, element],
            dtype=np.float64 if name in _DEVIATIONS else None,
        )
    if name == "scan_angle":
        if "scan_angle_rank" in point_format.dimension_names:
            return np.deg2rad(np.asarray(record["scan_angle_rank"], dtype=np.float32))
        return (np.asarray(record["scan_angle"]) * ANGLE_STEP).astype(np.float32)
    return np.array(record["point_source_id" if name == "lane" else name])


def attrs_of(point_format: Any, name: str) -> dict[str, Any]:
    """Attributes of extra bytes: description, and scale and offset of scaled integers."""
    if name in _DEVIATIONS or name not in (extra := _extra_dimensions(point_format)):
        return {}
    dimension, element = extra[name]
    found = point_format.dimension_by_name(dimension)
    attrs = {"long_name": found.description.strip()} if found.description.strip("\0 ") else {}
    if found.is_scaled:
        number = element or 0
        attrs |= {
            _STORED: found.dtype.base.str[1:],
            _SCALE: float(found.scales[number]),
            _OFFSET: float(found.offsets[number]),
        }
    return attrs


def point_format_of(points: xr.Dataset) -> int:
    """Smallest point format of LAS 1.4 that holds the variables: 6, or 7 and 8 with colours."""
    if "nir" in points:
        return 8
    return 7 if any(name in points for name in _COLOURS) else 6


def extra_parameters(points: xr.Dataset, point_format: int, path: Path) -> list[Any]:
    """Descriptions of the extra bytes that points need."""
    found = [
        laspy.ExtraBytesParams(name, np.float32, about)
        for name, about in _DEVIATIONS.items()
        if name in points
    ]
    for name in map(str, points.data_vars):
        if not name.startswith(EXTRA):
            continue
        attrs, dtype = points[name].attrs, points[name].dtype
        label = name.removeprefix(EXTRA)
        _check_label(label, name, point_format, path)
        more: dict[str, Any] = {}
        if _SCALE in attrs:
            dtype = np.dtype(attrs[_STORED])
            more = {"scales": [attrs[_SCALE]], "offsets": [attrs[_OFFSET]]}
        elif dtype == np.bool_:
            dtype = np.dtype("u1")
        if dtype.kind not in "iuf" or dtype.itemsize > 8 or dtype == np.float16:
            raise SchemaError(
                f"cannot be extra bytes of LAS, its type is {dtype}",
                path=path,
                place=f"variable {name}",
                cure="Convert it to integers or float64.",
            )
        about = str(attrs.get("long_name", "")).encode()[:_LONGEST_NAME].decode(errors="ignore")
        found.append(laspy.ExtraBytesParams(label, dtype.newbyteorder("="), about, **more))
    return found


def put_attributes(record: Any, points: xr.Dataset, done: int, path: Path) -> None:
    """Copy attributes of the returns and extra bytes into a record."""
    for name in map(str, points.data_vars):
        if name == "scan_angle":
            steps = np.rint(points[name].values / ANGLE_STEP)
            record[name] = whole_numbers(
                steps, name, -_LARGEST_ANGLE, _LARGEST_ANGLE, done, path
            ).astype(np.int16)
        elif name in RETURN_ATTRIBUTES:
            bits = _BITS.get(name, 8 * np.dtype(RETURN_ATTRIBUTES[name]).itemsize)
            record[name] = whole_numbers(points[name].values, name, 0, 2**bits - 1, done, path)
        elif name.startswith(EXTRA) or name in _DEVIATIONS:
            record[name.removeprefix(EXTRA)] = points[name].values
    count = np.ones(points.sizes["point"], dtype=np.uint8)
    if "return_number" not in points:
        record["return_number"] = count
    if "number_of_returns" not in points:
        record["number_of_returns"] = np.maximum(count, np.asarray(record["return_number"]))


def whole_numbers(values: Any, name: str, low: int, high: int, done: int, path: Path) -> Any:
    """Values as integers from `low` to `high`; a SchemaError names the first that is not."""
    bad = ~((values >= low) & (values <= high) & (values == np.rint(values)))
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise SchemaError(
            f"must hold whole numbers from {low} to {high}, got {values[first]} at point "
            f"{done + first + 1}",
            path=path,
            place=f"variable {name}",
            cure="Scale and round the values, or drop the variable.",
        )
    return values.astype(np.uint16) if low == 0 else values


def _extra_dimensions(point_format: Any) -> dict[str, tuple[str, int | None]]:
    """Variables of extra bytes: dimension, and index in it if it holds several values."""
    found: dict[str, tuple[str, int | None]] = {}
    for dimension in point_format.extra_dimensions:
        name = dimension.name
        variable = EXTRA + name.replace("/", "_")  # a slash would be a folder in a Zarr store
        if name in _DEVIATIONS and dimension.num_elements == 1:
            found[name] = (name, None)
        elif dimension.num_elements == 1:
            found[variable] = (name, None)
        else:
            # names are cut so that the index fits into 32 bytes, too
            parts = range(dimension.num_elements)
            found |= {f"{variable[: len(EXTRA) + _LONGEST_NAME - 3]}_{i}": (name, i) for i in parts}
    return found


def _check_label(label: str, name: str, point_format: int, path: Path) -> None:
    taken = {*laspy.PointFormat(point_format).dimension_names, "x", "y", "z", *_DEVIATIONS}
    problem = ""
    if label in taken or not label:
        problem = f"would be extra bytes of the name {label!r}, which means something else in LAS"
    elif len(label.encode()) > _LONGEST_NAME:
        problem = f"is too long: extra bytes of LAS have names of {_LONGEST_NAME} bytes at most"
    if problem:
        raise SchemaError(problem, path=path, place=f"variable {name}", cure="Rename it.")
