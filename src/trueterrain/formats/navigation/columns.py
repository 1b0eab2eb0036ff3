"""Navigation from a CSV or Parquet table whose columns a frozen dataclass names."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError, SchemaError
from trueterrain.core.schemas.navigation import EpochRules, check_length, navigation_of
from trueterrain.formats.navigation.records import Floats, IntervalStatistics
from trueterrain.formats.navigation_signature import TIME
from trueterrain.formats.number_table import ROWS, table_blocks, table_columns
from trueterrain.geometry.navigation_frames import (
    Origin,
    YawUnwrapper,
    check_origin,
    enu_of_geodetic,
    iso8855_of_ned,
)

_SD = ("sd_east", "sd_north", "sd_up", "sd_roll", "sd_pitch", "sd_yaw")
_ANGLES = ("roll", "pitch", "yaw", "heading", "sd_roll", "sd_pitch", "sd_yaw")


def _require_one(what: str, one: dict[str, str], other: dict[str, str]) -> None:
    complete = [all(group.values()) for group in (one, other)]
    touched = [any(group.values()) for group in (one, other)]
    if touched != complete or sum(complete) != 1:
        message = (
            f"columns must name {what} either as {', '.join(one)} or as {', '.join(other)}, got "
            f"{ {name: column for name, column in (one | other).items() if column} }."
        )
        raise ValueError(message)


@dataclass(frozen=True, kw_only=True)
class NavigationColumns:
    """Names of the columns of a navigation table; the columns given decide the convention.

    Positions are either ``east``, ``north``, ``up`` [m] or ``longitude``, ``latitude`` [deg] and
    ``height`` [m]. Angles are either after ISO 8855 (``yaw`` given: pitch nose-down, yaw
    counter-clockwise from east) or aerospace (``heading`` given: pitch nose-up, heading clockwise
    from true north).
    """

    time: str = "time"
    "Column of the time [s]."

    east: str = ""
    "Column of the position east of the origin [m]."

    north: str = ""
    "Column of the position north of the origin [m]."

    up: str = ""
    "Column of the height above the origin [m]."

    longitude: str = ""
    "Column of the longitude [deg]."

    latitude: str = ""
    "Column of the latitude [deg]."

    height: str = ""
    "Column of the ellipsoidal height [m]."

    roll: str = "roll"
    "Column of the roll angle, right-down positive."

    pitch: str = "pitch"
    "Column of the pitch angle, nose-down positive with yaw, nose-up positive with heading."

    yaw: str = ""
    "Column of the yaw angle, counter-clockwise from east."

    heading: str = ""
    "Column of the heading, clockwise from true north."

    sd_east: str = ""
    "Column of the standard deviation of the position to the east [m]."

    sd_north: str = ""
    "Column of the standard deviation of the position to the north [m]."

    sd_up: str = ""
    "Column of the standard deviation of the height [m]."

    sd_roll: str = ""
    "Column of the standard deviation of the roll angle."

    sd_pitch: str = ""
    "Column of the standard deviation of the pitch angle."

    sd_yaw: str = ""
    "Column of the standard deviation of the yaw angle or heading."

    degrees: bool = False
    "Whether roll, pitch, yaw, heading and their standard deviations are in degrees."

    time_scale: float = 1.0
    "Seconds per unit of the time."

    def __post_init__(self) -> None:
        """Check that the columns of exactly one convention are named, and all of them."""
        _require_one(
            "positions",
            self._named("east", "north", "up"),
            self._named("longitude", "latitude", "height"),
        )
        _require_one("the direction", self._named("yaw"), self._named("heading"))
        if not self.time_scale > 0:
            message = f"time_scale must be greater than 0, got {self.time_scale}."
            raise ValueError(message)
        for name in ("time", "roll", "pitch"):
            if not getattr(self, name):
                message = f"{name} must name a column, got ''."
                raise ValueError(message)

    def _named(self, *names: str) -> dict[str, str]:
        return {name: getattr(self, name) for name in names}

    @property
    def is_geodetic(self) -> bool:
        """Whether positions are longitude, latitude and height."""
        return bool(self.longitude)

    def used(self) -> dict[str, str]:
        """Names of the columns that are given, by quantity."""
        chosen = {f.name: getattr(self, f.name) for f in fields(self)}
        return {
            name: column for name, column in chosen.items() if isinstance(column, str) and column
        }


#: Columns named as the variables of navigation are.
OURS = NavigationColumns(east="east", north="north", up="up", yaw="yaw")


def read(
    path: str | Path, columns: NavigationColumns = OURS, *, origin: Origin | None = None
) -> xr.Dataset:
    r"""Navigation from a table.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet file.
    columns : NavigationColumns
        Names of the columns; by default those of the variables of navigation.
    origin : sequence of float, optional
        Longitude [deg], latitude [deg], ellipsoidal height [m] of the local frame. By default the
        position in the first row of longitude, latitude and height; with positions in east, north
        and up it is only recorded.

    Returns
    -------
    xarray.Dataset
        Navigation, see `trueterrain.formats.navigation`.

    Raises
    ------
    FormatError
        Naming line and column: a missing column, a cell that is no number.
    SchemaError
        If a value is NaN, time does not ascend, or angles are in degrees although radians were
        stated.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "nav.csv"
    ...     _ = path.write_text("t,x,y,z,roll,pitch,hdg\n0,0,0,0,0,2,90\n1,9,0,0,0,2,90\n")
    ...     columns = NavigationColumns(
    ...         time="t", east="x", north="y", up="z", heading="hdg", degrees=True
    ...     )
    ...     navigation = read(path, columns)
    >>> navigation.pitch.values, navigation.yaw.values
    (array([-0.0349, -0.0349]), array([0., 0.]))
    """
    parts = list(blocks(path, columns, origin=origin))
    data = xr.concat(parts, "epoch", combine_attrs="override") if len(parts) > 1 else parts[0]
    check_length(data, "epoch", 2, path=path, place="")
    parameters = {"format": "table", "columns": columns, "origin": origin}
    return provenance.add_step(data, "read", parameters=parameters, inputs=[path])


def blocks(
    path: str | Path,
    columns: NavigationColumns = OURS,
    *,
    origin: Origin | None = None,
    size: int = ROWS,
) -> Iterator[xr.Dataset]:
    """Navigation from a table block by block.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet file.
    columns : NavigationColumns
        Names of the columns.
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
        As by `read`.
    """
    rules = EpochRules(path=path)
    used = columns.used()
    frame_origin = None if origin is None else check_origin(origin)
    unwrapper = YawUnwrapper()
    row = 0
    for raw in table_blocks(path, list(used.values()), size):
        values = {name: raw[column] for name, column in used.items()}
        if columns.degrees:
            values |= {name: np.deg2rad(values[name]) for name in _ANGLES if name in values}
        _refuse_impossible(values, used, row, path)
        row += values["time"].size
        if columns.is_geodetic and frame_origin is None:
            frame_origin = _first_position(values, path)
        named = {"time": values["time"] * columns.time_scale}
        named |= _pose_columns(values, frame_origin)
        named["yaw"] = unwrapper.continued(named["yaw"])
        named |= {name: values[name] for name in _SD if name in values}
        attrs = {} if frame_origin is None else {"origin": list(frame_origin)}
        block = navigation_of(named, **attrs)
        rules.check(block)
        yield block


def describe(path: str | Path) -> dict[str, Any]:
    """Summary of a table of navigation for ``trueterrain info``.

    Parameters
    ----------
    path : str or Path
        CSV or Parquet file with columns of navigation under any of the usual names.

    Returns
    -------
    dict
        ``format``, ``kind``, ``columns``, ``count``, ``time`` (in the unit of the file), ``rate``,
        ``jitter``, ``gaps``, ``crs`` (the file names none) and ``problems``; everything can be
        written as JSON.

    Raises
    ------
    FormatError
        If the file is damaged.
    """
    names = table_columns(path)
    time = next(name for name in names if TIME.match(name.strip()))
    intervals = IntervalStatistics()
    for block in table_blocks(path, [time]):
        intervals.add(block[time])
    problems = intervals.problems("navigation")
    if not set(OURS.used().values()) <= set(names):
        problems.append(
            "its columns, units and signs are not known: name them with `NavigationColumns`, or in "
            "the description of an import"
        )
    return {
        "format": "Navigation table",
        "kind": "navigation",
        "columns": names,
        **intervals.to_dict(),
        "crs": "",
        "problems": problems,
    }


def _pose_columns(values: dict[str, Floats], origin: Origin | None) -> dict[str, Floats]:
    """Position [m] and attitude [rad] in the local frame after ISO 8855."""
    geodetic: dict[str, Floats] = {}
    if "longitude" in values and origin is not None:
        longitude, latitude = np.deg2rad(values["longitude"]), np.deg2rad(values["latitude"])
        position = enu_of_geodetic(longitude, latitude, values["height"], origin).T
        geodetic = {"longitude": longitude, "latitude": latitude}
    else:
        position = np.stack([values[name] for name in ("east", "north", "up")])
    roll, pitch = values["roll"], values["pitch"]
    if "heading" in values:
        roll, pitch, yaw = iso8855_of_ned(
            roll, pitch, values["heading"], origin=origin if geodetic else None, **geodetic
        )
    else:
        yaw = values["yaw"]
    east, north, up = position
    return {"east": east, "north": north, "up": up, "roll": roll, "pitch": pitch, "yaw": yaw}


def _refuse_impossible(
    values: dict[str, Floats], used: dict[str, str], row: int, path: str | Path
) -> None:
    """Raise at missing values, and at angles that a later check would accept after conversion."""
    limits: dict[str, tuple[float, str, str | None]] = {"latitude": (90.0, "90 deg", None)}
    quarter = (np.pi / 2, "a quarter turn (pi/2 rad)", "Say `degrees = true` if they are degrees.")
    limits |= {"roll": quarter, "pitch": quarter}
    for name, cells in values.items():
        rule = "must be finite everywhere"
        cure: str | None = "Remove the row, or fill in the number."
        bad = ~np.isfinite(cells)
        if name in limits and not bad.any():
            limit, words, cure = limits[name]
            rule, bad = f"must be within {words}", np.abs(cells) > limit
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise SchemaError(
                f"{rule}, got {cells[first]:g} (time {values['time'][first]:g})",
                path=path,
                place=f"row {row + first + 1}, column {used[name]!r}",
                cure=cure,
            )


def _first_position(values: dict[str, Floats], path: str | Path) -> tuple[float, float, float]:
    first = [float(values[name][0]) for name in ("longitude", "latitude", "height")]
    try:
        return check_origin(first)
    except ValueError as error:
        raise FormatError(f"has no place in its first row ({error})", path=path) from None
