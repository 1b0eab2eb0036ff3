"""Write points as LAS 1.4 and LAZ."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import Any

import laspy
import lazrs
import numpy as np
import xarray as xr
from laspy.vlrs.known import WktCoordinateSystemVlr

from trueterrain._version import __version__
from trueterrain.core import Checksums, not_whole, whole_output
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import COORDINATES, check_points
from trueterrain.formats.las._crs import wkt_of
from trueterrain.formats.las._dimensions import (
    extra_parameters,
    point_format_of,
    put_attributes,
    whole_numbers,
)
from trueterrain.formats.las._read import SECONDS_OF_WEEK

_COARSEST = 0.1  # [m] largest scale of coordinates; coarser ones destroy the profile
_STEP = 0.0001  # [m] default scale of coordinates, unless that of the input is finer
_LATTICE = 1e-6  # relative deviation within which a scale counts as a multiple of another
_WHOLE_STEPS = 1e-3  # [steps] the same for offsets: float64 holds 6e6 m to 1e-5 steps of 0.1 mm
_LARGEST = 2**31 - 1  # largest integer coordinate of LAS
_LARGEST_UINT16 = 2**16 - 1
_LARGEST_RECORD = 2**16 - 1  # [bytes] of a variable length record
_ROWS = 1_000_000  # points that are written at a time
_KINDS = {"week seconds": 0, "adjusted standard": 1}
_WHOLE = {"lane": "point_source_id", "intensity": "intensity"}


def write(
    points: xr.Dataset | Iterator[xr.Dataset],
    path: str | Path,
    *,
    force: bool = False,
    scale: float | None = None,
) -> None:
    """Write points as LAS 1.4, point format 6 (7 or 8 with colours); compressed as .laz.

    ``lane`` becomes the point source id, ``time`` the GPS time, ``sd`` and ``sd_relative`` extra
    bytes (float32), and so do variables ``extra_NAME``, in their own type. The CRS is written as
    WKT, the provenance as a record of user ``trueterrain``. The offset is a whole number of metres
    near the first block of points, unless the coordinates came with a scale and offset that this
    would not fit: they are then kept, so that no coordinate is rounded twice.

    Parameters
    ----------
    points : xarray.Dataset or iterator of xarray.Dataset
        Points, or blocks of points with the same variables; blocks are written one by one.
    path : str or Path
        Path of the file to write.
    force : bool
        Replace an existing file.
    scale : float, optional
        Scale of the coordinates [m]: the step to which they are rounded. By default 0.0001, or that
        of the input (``attrs["coordinate_scale"]``) if it is finer or not a multiple of 0.0001.

    Raises
    ------
    ValueError
        If `scale` is not greater than 0 and at most 0.1 m, or the name ends with .copc.laz or
        neither .las nor .laz.
    SchemaError
        If coordinates are not finite or too far apart for the scale, or lanes, intensities and
        other attributes are not whole numbers in the range of LAS.
    CoverageError
        If there are no points.
    OutputError
        If the file exists and `force` is false, or differs when it is read back.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.formats.las import read
    >>> from trueterrain.core.schemas import make_points
    >>> points = make_points([691000.0123], [5334000.0456], [512.0789], crs="EPSG:25832")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(points, Path(folder) / "p.laz")
    ...     again = read(Path(folder) / "p.laz")
    >>> again.up.values
    array([512.0789])
    """
    path = Path(path)
    _check_name(path)
    if scale is not None and not 0 < scale <= _COARSEST:
        message = f"scale must be greater than 0 m and at most {_COARSEST:g} m, got {scale:g} m."
        raise ValueError(message)
    with whole_output(path, force=force) as temporary:
        parts = chain([points]) if isinstance(points, xr.Dataset) else points
        first = next((part for part in parts if part.sizes.get("point", 0)), None)
        if first is None:
            raise CoverageError("there are no points to write", path=path)
        header = _make_header(check_points(first, path=path), scale, path)
        names = list(first.data_vars)
        compress = path.suffix.lower() == ".laz"
        done = 0
        written = Checksums()
        try:
            with (
                temporary.open("wb+") as stream,  # laspy does not close it if the disk is full
                laspy.open(
                    stream, mode="w", header=header, do_compress=compress, closefd=False
                ) as writer,
            ):
                for part in chain([first], parts):
                    if list(check_points(part, path=path).data_vars) != names:
                        raise _variables_error(part, names, path)
                    for start in range(0, part.sizes["point"], _ROWS):
                        rows = part.isel(point=slice(start, start + _ROWS))
                        record = _point_record(rows, header, done, path)
                        written.add("points", record.array)
                        writer.write_points(record)
                        done += rows.sizes["point"]
            _require_same(temporary, written, path)
        except (lazrs.LazrsError, laspy.errors.LaspyException) as error:
            raise not_whole(path, str(error)) from error


def _require_same(temporary: Path, written: Checksums, path: Path) -> None:
    found = Checksums()
    with laspy.open(temporary) as reader:
        for record in reader.chunk_iterator(_ROWS):
            found.add("points", record.array)
    found.require_same(written, path)


def _make_header(first: xr.Dataset, scale: float | None, path: Path) -> Any:
    point_format = point_format_of(first)
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    header.generating_software = f"trueterrain {__version__}"
    axes = [_axis_lattice(first, axis, scale, path) for axis in range(3)]
    header.scales = np.array([step for step, _ in axes])
    header.offsets = np.array([offset for _, offset in axes])
    header.global_encoding.wkt = True  # LAS 1.4 requires the flag from point format 6 on
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType(_gps_time_kind(first))
    if crs := first.attrs.get("crs"):
        try:
            header.vlrs.append(WktCoordinateSystemVlr(wkt_of(crs)))
        except ValueError as error:
            raise SchemaError(str(error), path=path, place="attribute crs") from None
    history = first.attrs.get("provenance", "").encode()
    if 0 < len(history) <= _LARGEST_RECORD:
        header.vlrs.append(laspy.VLR("trueterrain", 1, "provenance, JSON", history))
    if extra := extra_parameters(first, point_format, path):
        header.add_extra_dims(extra)
    return header


def _axis_lattice(
    points: xr.Dataset, axis: int, scale: float | None, path: Path
) -> tuple[float, float]:
    """Scale and offset of an axis [m] that keep coordinates on the lattice of their source."""
    centre = _coordinate_offset(points, COORDINATES[axis], path)
    scales = points.attrs.get("coordinate_scale")
    origins = points.attrs.get("coordinate_offset")
    if scales is None or origins is None:
        return scale or _STEP, centre
    was, origin = float(scales[axis]), float(origins[axis])
    ratio = was / _STEP
    fits = not was > 0 or (ratio > 0.5 and abs(ratio - np.rint(ratio)) < _LATTICE * ratio)
    step = scale or (_STEP if fits else was)
    apart = (centre - origin) / step  # [steps] whole if both offsets lie on one lattice
    if scale is not None or abs(apart - np.rint(apart)) < _WHOLE_STEPS:
        return step, centre
    return step, origin if abs(apart) < _LARGEST / 2 else float(origin + step * np.rint(apart))


def _coordinate_offset(points: xr.Dataset, name: str, path: Path) -> float:
    values = points[name].values
    if not np.isfinite(values).all():
        raise _not_finite(values, name, 0, path)
    return float(np.rint(values.min() / 2 + values.max() / 2))


def _gps_time_kind(points: xr.Dataset) -> int:
    kind = points.attrs.get("gps_time_kind", "")
    if kind in _KINDS:
        return _KINDS[kind]
    if "time" not in points:
        return 1
    time = points.time.values
    return int(bool((time < 0).any() or (time > SECONDS_OF_WEEK).any()))


def _point_record(points: xr.Dataset, header: Any, done: int, path: Path) -> Any:
    record = laspy.ScaleAwarePointRecord.zeros(points.sizes["point"], header=header)
    for axis, name in enumerate(("easting", "northing", "up")):
        steps = _integer_steps(points, name, header.offsets[axis], header.scales[axis], done, path)
        record["XYZ"[axis]] = steps
    for name, field in _WHOLE.items():
        if name in points:
            record[field] = whole_numbers(points[name].values, name, 0, _LARGEST_UINT16, done, path)
    if "time" in points:
        time = points.time.values
        if not np.isfinite(time).all():
            raise _not_finite(time, "time", done, path)
        record["gps_time"] = time
    put_attributes(record, points, done, path)
    return record


def _integer_steps(
    points: xr.Dataset, name: str, offset: float, scale: float, done: int, path: Path
) -> Any:
    values = points[name].values
    if not np.isfinite(values).all():
        raise _not_finite(values, name, done, path)
    steps = np.rint((values - offset) / scale)
    far = np.abs(steps) > _LARGEST
    if far.any():
        first = int(np.flatnonzero(far)[0])
        raise SchemaError(
            f"point {done + first + 1} lies {abs(values[first] - offset):.6g} m from the offset "
            f"{offset:.0f} m; at a scale of {scale:g} m at most {_LARGEST * scale:.6g} m fit",
            path=path,
            place=f"variable {name}",
            cure="Write with a coarser scale (scale=0.001), or one file per region.",
        )
    return steps.astype(np.int32)


def _not_finite(values: Any, name: str, done: int, path: Path) -> SchemaError:
    first = int(np.flatnonzero(~np.isfinite(values))[0])
    return SchemaError(
        f"must be finite everywhere, got {values[first]} at point {done + first + 1}",
        path=path,
        place=f"variable {name}",
        cure="Leave out the points without ground.",
    )


def _variables_error(part: xr.Dataset, names: list[Any], path: Path) -> SchemaError:
    found = ", ".join(str(name) for name in part.data_vars)
    wanted = ", ".join(str(name) for name in names)
    return SchemaError(
        f"all blocks must have the same variables, got {found} after {wanted}", path=path
    )


def _check_name(path: Path) -> None:
    name = path.name.lower()
    if name.endswith(".copc.laz"):
        message = f"{path}: COPC can be read but not written; choose a name that ends with .laz."
        raise ValueError(message)
    if not name.endswith((".las", ".laz")):
        message = f"{path}: the name must end with .las or .laz, got {path.suffix!r}."
        raise ValueError(message)
