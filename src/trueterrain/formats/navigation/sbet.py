"""SBET: the smoothed best estimate of trajectory of Applanix POSPac, in bytes or as text.

136 bytes per record, 17 little-endian doubles without any header: seconds of the GPS week,
latitude, longitude [rad], ellipsoidal height [m], three velocities in the wander frame [m/s], roll,
pitch, platform heading, wander angle [rad], three specific forces [m/s²] and three angular rates
[rad/s] of the body. The body is forward-right-down. The true heading is the platform heading less
the wander angle; the velocities are along the x axis of the wander frame (wander angle west of
north), its y axis (to the left of x) and up. The file names neither datum nor week. As text, it has
the same 17 numbers in each line, divided by blanks, tabs, semicolons or commas.

Sources: POSPac MMS user guide as reproduced by the LiDAR360 manual ("OUT File"); the sign of the
wander angle and the axes of the velocities were found in measured files.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas.navigation import EpochRules, check_length, navigation_of
from trueterrain.formats._text_head import Head, find_head
from trueterrain.formats.navigation import smrmsg
from trueterrain.formats.navigation.records import (
    BLOCK,
    WEEK,
    Floats,
    IntervalStatistics,
    WeekUnwrapper,
    file_records,
    refuse_value,
)
from trueterrain.formats.navigation_signature import is_sbet_text
from trueterrain.formats.number_table import table_blocks
from trueterrain.formats.signature import open_regular
from trueterrain.geometry.navigation_frames import (
    Origin,
    YawUnwrapper,
    check_origin,
    enu_of_geodetic,
    iso8855_of_ned,
)

FIELDS = 17

_SAMPLE = 1 << 16  # [bytes] of a text in which its first record is searched
_HIGHEST = 100_000.0  # [m] largest plausible height: the edge of space
_SWAPPED = "If the byte order is wrong, or it is not an SBET file, export it again."


def read(
    path: str | Path, *, origin: Origin | None = None, accuracy: str | Path | None = None
) -> xr.Dataset:
    """Navigation from an SBET file.

    Positions are transformed to the local east-north-up frame of the origin, attitudes from the
    local level of each record to that of the origin: both differ by the curvature of the earth, 32
    arc seconds per km. Yaw is continuous, without jumps of 2 pi. Seconds of the week count on
    beyond 604800 s after a week rollover.

    Parameters
    ----------
    path : str or Path
        The file.
    origin : sequence of float, optional
        Longitude [deg], latitude [deg], ellipsoidal height [m] of the local frame; by default the
        position of the first record.
    accuracy : str or Path, optional
        SMRMSG file of the same solution, for the standard deviations.

    Returns
    -------
    xarray.Dataset
        Navigation, see `trueterrain.formats.navigation`; ``attrs["origin"]`` holds the origin,
        ``attrs["time_reference"]`` is ``"gps"``.

    Raises
    ------
    FormatError
        Naming record and field: the file is cut off, latitude or longitude is in degrees or
        impossible, a number is not finite.
    SchemaError
        If time does not ascend.
    CoverageError
        If the accuracies do not cover the epochs.
    """
    path = Path(path)
    parts = list(blocks(path, origin=origin))
    data = xr.concat(parts, "epoch", combine_attrs="override") if len(parts) > 1 else parts[0]
    check_length(data, "epoch", 2, path=path, place="")
    inputs = [path]
    if accuracy is not None:
        data = smrmsg.add_accuracy(data, smrmsg.read(accuracy), path=accuracy)
        inputs.append(Path(accuracy))
    parameters = {"format": "SBET", "origin": data.attrs["origin"]}
    return provenance.add_step(data, "read", parameters=parameters, inputs=inputs)


def blocks(
    path: str | Path, *, origin: Origin | None = None, size: int = BLOCK
) -> Iterator[xr.Dataset]:
    """Navigation from an SBET file block by block.

    Parameters
    ----------
    path : str or Path
        The file.
    origin : sequence of float, optional
        As for `read`.
    size : int
        Largest number of epochs in a block.

    Yields
    ------
    xarray.Dataset
        Navigation.

    Raises
    ------
    FormatError, SchemaError
        As by `read`; damage is found when it is reached.
    """
    path = Path(path)
    clock, rules = WeekUnwrapper(path), EpochRules(path=path)
    unwrapper = YawUnwrapper()
    frame_origin = None if origin is None else check_origin(origin)
    for first, fields in _record_blocks(path, size):
        _check_fields(path, fields, first)
        time = clock.continued(fields[0])
        latitude, longitude, height, roll, pitch = fields[[1, 2, 3, 7, 8]]
        if frame_origin is None:
            frame_origin = _origin_of(longitude[0], latitude[0], height[0])
        east, north, up = enu_of_geodetic(longitude, latitude, height, frame_origin).T
        # the wander frame is rotated west of north by the wander angle
        heading = fields[9] - fields[10]
        roll, pitch, yaw = iso8855_of_ned(
            roll, pitch, heading, longitude=longitude, latitude=latitude, origin=frame_origin
        )
        yaw = unwrapper.continued(yaw)
        columns = {
            "time": time,
            "east": east,
            "north": north,
            "up": up,
            "roll": roll,
            "pitch": pitch,
            "yaw": yaw,
        }
        block = navigation_of(columns, origin=list(frame_origin), time_reference="gps")
        rules.check(block)
        yield block


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of an SBET file for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    dict
        ``format``, ``kind``, ``count``, ``time`` [s], ``rate`` [1/s], ``jitter`` [s], ``gaps``,
        ``extent`` of longitude and latitude [deg] and height [m], ``speed`` [m/s], ``crs`` (the
        file names none) and ``problems``; all values are plain types that JSON can hold.

    Raises
    ------
    FormatError, SchemaError
        As by `read`.
    """
    path = Path(path)
    clock, intervals = WeekUnwrapper(path), IntervalStatistics()
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    max_speed, max_time = 0.0, 0.0
    for first, fields in _record_blocks(path):
        _check_fields(path, fields, first)
        intervals.add(clock.continued(fields[0]))
        position = np.stack([np.rad2deg(fields[2]), np.rad2deg(fields[1]), fields[3]])
        low, high = np.minimum(low, position.min(axis=1)), np.maximum(high, position.max(axis=1))
        max_speed = max(max_speed, float(np.sqrt(np.sum(fields[4:7] ** 2, axis=0)).max()))
        max_time = max(max_time, float(fields[0].max()))
    problems = intervals.problems("navigation")
    if clock.rollovers:
        problems.append(f"a GPS week begins at record {clock.rollovers[0] + 1}")
    if max_time > 2 * WEEK or intervals.start < 0:
        problems.append(f"times up to {max_time:.0f} s are no seconds of the GPS week")
    names = ("longitude", "latitude", "height")
    extent = {n: [float(a), float(b)] for n, a, b in zip(names, low, high, strict=True)}
    return {
        "format": "SBET",
        "kind": "navigation",
        **intervals.to_dict(),
        "extent": extent,
        "speed": max_speed,
        "crs": "",
        "problems": problems,
    }


def _record_blocks(path: Path, size: int = BLOCK) -> Iterator[tuple[int, Floats]]:
    """Index of the first record and fields, shape (field, record), block by block."""
    head = _text_head(path)
    if head is None:
        yield from file_records(path, FIELDS, "SBET", size)
        return
    names = [str(number) for number in range(1, FIELDS + 1)]
    first = 0
    for part in table_blocks(
        path, names, size, head=replace(head, labels=tuple(names), named=True)
    ):
        fields = np.stack([part[name] for name in names])
        yield first, fields
        first += fields.shape[1]


def _text_head(path: Path) -> Head | None:
    """Header of an SBET in text; None if the file is binary."""
    with open_regular(path) as stream:
        start = stream.read(_SAMPLE).decode("latin-1").splitlines()
    try:
        head = find_head(start, lambda _: False)
    except FormatError:
        return None
    return None if head is None or not is_sbet_text(head.labels) else head


def _check_fields(path: Path, fields: Floats, first: int) -> None:
    latitude, longitude, height = fields[1:4]
    names = (
        "time",
        "latitude",
        "longitude",
        "height",
        *(f"velocity {axis}" for axis in "xyz"),
        "roll",
        "pitch",
        "platform heading",
        "wander angle",
    )
    for name, values in zip(names, fields, strict=False):
        bad = ~np.isfinite(values)
        refuse_value(path, name, "must be finite everywhere", values, bad, first, _SWAPPED)
    limits = (
        ("latitude", latitude, 90),
        ("longitude", longitude, 360),
        ("roll", fields[7], 90),
        ("pitch", fields[8], 90),
    )
    for name, values, limit in limits:
        rule = f"must be in radians and within {limit} deg ({np.deg2rad(limit):.4f} rad)"
        cure = "Convert degrees to radians." if np.all(np.abs(values) <= limit) else _SWAPPED
        refuse_value(path, name, rule, values, np.abs(values) > np.deg2rad(limit), first, cure)
    bad = np.abs(height) > _HIGHEST
    refuse_value(path, "height", f"must be within {_HIGHEST:g} m", height, bad, first, _SWAPPED)


def _origin_of(longitude: float, latitude: float, height: float) -> tuple[float, float, float]:
    degrees = (np.rad2deg(longitude) + 180.0) % 360.0 - 180.0
    return float(degrees), float(np.rad2deg(latitude)), float(height)
