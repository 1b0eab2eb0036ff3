"""Poses of the Boreas data set: real drives with a surveyed trajectory (CSV).

``GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,
angvel_x``, about 10 rows per second. Times are microseconds of UTC since 1970, positions are those
of the lidar. The meaning of the columns was determined from the two drives under test, since the
description of the data set changed after they were published:

- Velocities are the derivatives of the positions (to 3e-5 in length, 2e-3 deg in direction), so the
  positions are metres on the ground, not those of a map projection (which would be 2.1e-4 shorter).
- The heading turns clockwise and, with 43.2 deg added, is the course over ground, clockwise from
  north: the lidar is mounted so that its x axis points 46.8 deg to the right of forward.
- Roll and pitch are those of the car, not of the turned lidar. Pitch is nose-down positive:
  it equals minus the slope of the road driven, with factor 1.01. Roll is left-down positive: in
  bends it has the sign of a body that leans outward, on straights that of a road that falls to the
  right.

Source: Burnett et al. 2023, Boreas: A multi-season autonomous driving dataset; CC BY 4.0.
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas.navigation import check_navigation, navigation_of
from trueterrain.formats.navigation.records import Floats, IntervalStatistics
from trueterrain.formats.navigation_signature import BOREAS_COLUMNS
from trueterrain.formats.number_table import table_columns, table_whole
from trueterrain.geometry.navigation_frames import YawUnwrapper

#: Yaw of the lidar's x axis in the car, counter-clockwise from forward [rad]: median over both
#: drives of the difference between heading and course above 5 m/s (-46.78 and -46.82 deg).
LIDAR_YAW = float(np.deg2rad(-46.80))

_MICROSECOND = 1e-6  # [s]


def read(
    path: str | Path,
    *,
    reference: tuple[float, float, float] | None = None,
    lidar_yaw: float = LIDAR_YAW,
) -> xr.Dataset:
    """Navigation of a car from the lidar poses of a Boreas drive.

    Parameters
    ----------
    path : str or Path
        ``lidar_poses.csv``.
    reference : tuple of float, optional
        Easting, northing and altitude [m] of the origin of the local frame; by default those of the
        first row. Give the same reference for drives that are to be compared.
    lidar_yaw : float
        Yaw of the lidar in the car [rad].

    Returns
    -------
    xarray.Dataset
        Navigation, see `trueterrain.formats.navigation`; ``time`` is UTC in seconds since 1970
        (``attrs["time_reference"]`` is ``"utc"``), ``attrs["reference"]`` the origin of the frame.

    Raises
    ------
    FormatError
        If columns are missing or a line is cut off.
    SchemaError
        If time does not ascend, or a value is NaN.
    """
    path = Path(path)
    columns = _columns_of(path)
    origin = reference or tuple(
        float(columns[name][0]) for name in ("easting", "northing", "altitude")
    )
    named = {
        "time": columns["GPSTime"] * _MICROSECOND,
        "east": columns["easting"] - origin[0],
        "north": columns["northing"] - origin[1],
        "up": columns["altitude"] - origin[2],
        "roll": -columns["roll"],
        "pitch": columns["pitch"],
        "yaw": YawUnwrapper().continued(-columns["heading"] - lidar_yaw),
    }
    data = navigation_of(named, reference=list(origin), time_reference="utc")
    parameters = {"format": "Boreas", "reference": origin, "lidar_yaw": lidar_yaw}
    checked = check_navigation(data, path=path)
    return provenance.add_step(checked, "read", parameters=parameters, inputs=[path])


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a Boreas drive for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        ``lidar_poses.csv``.

    Returns
    -------
    dict
        ``format``, ``kind``, ``count``, ``time`` [s], ``rate`` [1/s], ``jitter`` [s], ``gaps``,
        ``extent`` [m], ``speed`` [m/s], ``crs`` (the file names none) and
        ``problems``; all values are plain types that JSON can hold.

    Raises
    ------
    FormatError
        As by `read`.
    """
    columns = _columns_of(Path(path))
    intervals = IntervalStatistics()
    intervals.add(columns["GPSTime"] * _MICROSECOND)
    speed = np.hypot(columns["vel_east"], columns["vel_north"])
    named = {"easting": "easting", "northing": "northing", "altitude": "up"}
    return {
        "format": "Boreas poses",
        "kind": "navigation",
        **intervals.to_dict(),
        "extent": {
            ours: [float(columns[name].min()), float(columns[name].max())]
            for name, ours in named.items()
        },
        "speed": float(speed.max()),
        "crs": "",
        "problems": intervals.problems("navigation"),
    }


def _columns_of(path: Path) -> dict[str, Floats]:
    found = table_columns(path)
    missing = [name for name in BOREAS_COLUMNS if name not in found]
    if missing:
        raise FormatError(
            f"is not a file of Boreas poses: it lacks the columns {', '.join(missing)}",
            path=path,
            place="header",
            cure="Name the columns of another table with NavigationColumns and read_columns.",
        )
    return table_whole(path, list(BOREAS_COLUMNS))
