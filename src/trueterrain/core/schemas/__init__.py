"""Schemas of data: Points, Surface and Profile; Navigation and Run in the modules beside it.

Each is an `xarray.Dataset` with agreed names, dimensions and units. ``make_...`` builds one
from arrays, ``check_...`` says which variable breaks which rule.

==========  ==========================  =======================================================
kind        dimensions                  variables [m] unless noted
==========  ==========================  =======================================================
Points      point                       easting, northing, up; optional time [s], intensity,
                                        lane (point source), sd, sd_relative, those of
                                        `RETURN_ATTRIBUTES`, and ``extra_NAME``: extra bytes of
                                        LAS, as they are
Surface     u, v (along, across a       height; reference line along u: easting, northing,
            reference line)             heading [rad], elevation; optional banking [m/m],
                                        count, sd, sd_relative, filled
Surface     northing, easting (a map)   height; optional count, sd, sd_relative, filled
Profile     s, optional track           height; optional easting, northing, sd, count
==========  ==========================  =======================================================

All lengths are metres, all angles radians. Ground axes are east, north, up; u runs along the line,
v to the left; ``heading[i]`` is the direction of the chord that ends at node i, counter-clockwise
from east (the first repeats the second). ``height`` of a surface is the full height: it includes
elevation and banking of the reference line.

``sd`` of points and surfaces is the absolute standard deviation of a height. ``sd_relative`` leaves
out the error that all of them have in common: that of the datum of the adjustment of several passes
or, for points without ``sd``, of the system that they refer to. If the absolute one is unknown,
there is no ``sd``. That of a profile is of the statistic: the scatter under the tyre only.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError

#: Version of the schemas below.
SCHEMA = 1

#: Attribute of data whose file names no unit: a sentence that states the assumed unit.
ASSUMED = "assumed"

_UNITS = {
    "easting": "m",
    "northing": "m",
    "up": "m",
    "height": "m",
    "elevation": "m",
    "sd": "m",
    "sd_relative": "m",
    "heading": "rad",
    "banking": "m/m",
    "u": "m",
    "v": "m",
    "s": "m",
    "time": "s",
    "intensity": "1",
    "lane": "1",
    "count": "1",
    "filled": "1",
    "scan_angle": "rad",
}

#: Attributes of a return in LAS besides position, time, intensity and point source, and types.
#: Names are those of LAS 1.4, colours are 16 bits, ``scan_angle`` is in rad.
RETURN_ATTRIBUTES = {
    "return_number": "u1",
    "number_of_returns": "u1",
    "classification": "u1",
    "scan_angle": "f4",
    "user_data": "u1",
    "scanner_channel": "u1",
    "scan_direction_flag": "u1",
    "edge_of_flight_line": "u1",
    "synthetic": "u1",
    "key_point": "u1",
    "withheld": "u1",
    "overlap": "u1",
    "red": "u2",
    "green": "u2",
    "blue": "u2",
    "nir": "u2",
}

#: Prefix of the names of variables that hold extra bytes of LAS files.
EXTRA = "extra_"

#: Variables that every set of points has.
COORDINATES = ("easting", "northing", "up")

_POINTS_OPTIONAL = ("time", "intensity", "lane", "sd", "sd_relative", *RETURN_ATTRIBUTES)
_SURFACE_OPTIONAL = ("count", "sd", "sd_relative", "filled")
_PROFILE_OPTIONAL = ("easting", "northing", "heading", "sd", "count")
_REFERENCE_LINE = ("easting", "northing", "heading", "elevation")

Array = npt.ArrayLike


def make_points(
    easting: Array, northing: Array, up: Array, *, crs: str = "", **optional: Array
) -> xr.Dataset:
    """Points from arrays.

    Parameters
    ----------
    easting, northing, up : array_like, shape (point,)
        Coordinates [m].
    crs : str
        Coordinate reference system: an EPSG code or WKT; empty if it is not known.
    **optional : array_like, shape (point,)
        ``time`` [s], ``intensity``, ``lane``, ``sd``, ``sd_relative`` [m], those of
        `RETURN_ATTRIBUTES`, and ``extra_NAME``.

    Returns
    -------
    xarray.Dataset
        Checked dataset of kind Points.

    Raises
    ------
    SchemaError
        If lengths differ or a name is unknown.

    Examples
    --------
    >>> make_points([0.0, 1.0], [0.0, 0.0], [0.1, 0.2]).sizes["point"]
    2
    """
    named = {"easting": easting, "northing": northing, "up": up, **optional}
    return check_points(_make_dataset(named, dict.fromkeys(named, ("point",)), {}, "points", crs))


def make_surface(
    height: Array,
    *,
    u: Array | None = None,
    v: Array | None = None,
    easting: Array,
    northing: Array,
    heading: Array | None = None,
    elevation: Array | None = None,
    banking: Array | None = None,
    crs: str = "",
    **optional: Array,
) -> xr.Dataset:
    """Surface from arrays: along a reference line if `u` and `v` are given, else a map.

    Parameters
    ----------
    height : array_like, shape (u, v) or (northing, easting)
        Whole height of each node [m]; NaN where there is no ground.
    u, v : array_like, shape (u,), (v,)
        Station along and offset (left positive) across the reference line [m], ascending.
    easting, northing : array_like
        Nodes of the reference line [m], shape (u,), or the axes of the map [m], ascending.
    heading : array_like, shape (u,), optional
        Direction of the chord that ends at each node [rad].
    elevation : array_like, shape (u,), optional
        Height of the reference line [m]; default 0.
    banking : array_like, shape (u,), optional
        Cross slope dz/dv of the reference line [m/m], contained in `height`.
    crs : str
        Coordinate reference system: an EPSG code or WKT; empty if it is not known.
    **optional : array_like, same shape as height
        ``count``, ``sd``, ``sd_relative`` [m], ``filled``.

    Returns
    -------
    xarray.Dataset
        Checked dataset of kind Surface.

    Raises
    ------
    SchemaError
        If shapes do not fit, axes do not ascend, or a name is unknown.

    Examples
    --------
    >>> flat = make_surface(np.zeros((2, 3)), easting=[0, 1, 2], northing=[0, 1])
    >>> flat.height.dims
    ('northing', 'easting')
    """
    if u is None or v is None:
        named: dict[str, Array] = {"height": height, **optional}
        axes: dict[str, Array] = {"northing": northing, "easting": easting}
        over_map = dict.fromkeys(named, ("northing", "easting"))
        return check_surface(_make_dataset(named, over_map, axes, "surface", crs))
    length = np.size(u)
    line: dict[str, Array] = {
        "easting": easting,
        "northing": northing,
        "heading": _chord_heading(easting, northing) if heading is None else heading,
        "elevation": np.zeros(length) if elevation is None else elevation,
    }
    if banking is not None:
        line["banking"] = banking
    cells = {"height": height, **optional}
    dims: dict[str, tuple[str, ...]] = dict.fromkeys(line, ("u",))
    dims |= dict.fromkeys(cells, ("u", "v"))
    return check_surface(_make_dataset(line | cells, dims, {"u": u, "v": v}, "surface", crs))


def make_profile(
    s: Array, height: Array, *, tracks: list[str] | None = None, crs: str = "", **optional: Array
) -> xr.Dataset:
    """Profile from arrays.

    Parameters
    ----------
    s : array_like, shape (s,)
        Distance along the path [m], ascending.
    height : array_like, shape (s,) or (track, s)
        Height [m].
    tracks : list of str, optional
        Names of the tracks; required if `height` has two dimensions.
    crs : str
        Coordinate reference system of easting and northing; empty if it is not known.
    **optional : array_like, same shape as height
        ``easting``, ``northing``, ``sd`` [m], ``heading`` [rad], ``count``.

    Returns
    -------
    xarray.Dataset
        Checked dataset of kind Profile.

    Raises
    ------
    SchemaError
        If shapes do not fit, s does not ascend, or a name is unknown.

    Examples
    --------
    >>> make_profile([0.0, 0.1], [[1.0, 1.1], [2.0, 2.1]], tracks=["left", "right"]).height.dims
    ('track', 's')
    """
    shape = ("s",) if tracks is None else ("track", "s")
    named = {"height": height, **optional}
    data = _make_dataset(named, dict.fromkeys(named, shape), {"s": s}, "profile", crs)
    return check_profile(data if tracks is None else data.assign_coords(track=tracks))


def check_points(data: xr.Dataset, *, path: str | Path | None = None) -> xr.Dataset:
    """Return the dataset if it conforms to the schema Points.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset to check.
    path : str or Path, optional
        File that it came from, for the message.

    Returns
    -------
    xarray.Dataset
        `data`, unchanged.

    Raises
    ------
    SchemaError
        Naming the file, the variable and the rule.
    """
    _require_variables(data, COORDINATES, ("point",), path)
    known = (*COORDINATES, *_POINTS_OPTIONAL)
    extra = (str(name) for name in data.data_vars if str(name).startswith(EXTRA))
    _forbid_others(data, (*known, *extra), path)
    return data


def check_surface(data: xr.Dataset, *, path: str | Path | None = None) -> xr.Dataset:
    """Return the dataset if it conforms to the schema Surface.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset to check.
    path : str or Path, optional
        File that it came from, for the message.

    Returns
    -------
    xarray.Dataset
        `data`, unchanged.

    Raises
    ------
    SchemaError
        Naming the file, the variable and the rule.
    """
    axes = ("u", "v") if "u" in data.dims else ("northing", "easting")
    for axis in axes:
        _require_ascending(data, axis, path)
        if data.sizes[axis] < 2:
            raise SchemaError("must have at least 2 nodes", path=path, place=f"axis {axis}")
    _require_variables(data, ("height",), axes, path)
    known: tuple[str, ...] = ("height", *_SURFACE_OPTIONAL)
    if axes == ("u", "v"):
        _require_variables(data, _REFERENCE_LINE, ("u",), path)
        for name in (*_REFERENCE_LINE, "banking"):
            if name in data and not np.isfinite(data[name]).all():
                raise SchemaError("must be finite everywhere", path=path, place=f"variable {name}")
        known += (*_REFERENCE_LINE, "banking")
    _forbid_others(data, known, path)
    return data


def check_profile(data: xr.Dataset, *, path: str | Path | None = None) -> xr.Dataset:
    """Return the dataset if it conforms to the schema Profile.

    Parameters
    ----------
    data : xarray.Dataset
        Dataset to check.
    path : str or Path, optional
        File that it came from, for the message.

    Returns
    -------
    xarray.Dataset
        `data`, unchanged.

    Raises
    ------
    SchemaError
        Naming the file, the variable and the rule.
    """
    _require_ascending(data, "s", path)
    dims = ("track", "s") if "track" in data.dims else ("s",)
    _require_variables(data, ("height",), dims, path)
    _forbid_others(data, ("height", *_PROFILE_OPTIONAL), path)
    return data


def kind_of(data: xr.Dataset) -> str:
    """Kind of a dataset.

    Parameters
    ----------
    data : xarray.Dataset
        Any dataset of this package.

    Returns
    -------
    str
        ``"points"``, ``"surface"`` or ``"profile"``.

    Raises
    ------
    SchemaError
        If it is none of them.
    """
    kind = str(data.attrs.get("kind", "")).removeprefix("trueterrain/")
    if kind not in ("points", "surface", "profile"):
        raise SchemaError(
            f"has no known kind (attrs['kind'] is {kind!r})",
            cure="Build it with make_points, make_surface or make_profile.",
        )
    return kind


def _make_dataset(
    named: Mapping[str, Array],
    dims: Mapping[str, tuple[str, ...]],
    axes: Mapping[str, Array],
    kind: str,
    crs: str,
) -> xr.Dataset:
    variables: dict[str, Any] = {}
    lengths: dict[str, int] = {name: np.size(np.asarray(axis)) for name, axis in axes.items()}
    for name, values in named.items():
        array = np.asarray(values)
        if array.ndim != len(dims[name]):
            expected = " x ".join(dims[name])
            raise SchemaError(
                f"must have the dimensions {expected}, got shape {array.shape}",
                place=f"variable {name}",
            )
        for dim, length in zip(dims[name], array.shape, strict=True):
            if lengths.setdefault(dim, length) != length:
                raise SchemaError(
                    f"has {length} values along {dim}, the others have {lengths[dim]}",
                    place=f"variable {name}",
                )
        variables[name] = (dims[name], array, _unit_attrs(name))
    coordinates = {
        name: (name, np.asarray(axis, dtype=float), _unit_attrs(name))
        for name, axis in axes.items()
    }
    attrs = {"kind": f"trueterrain/{kind}", "schema": SCHEMA, "crs": crs}
    return xr.Dataset(variables, coordinates, attrs)


def _unit_attrs(name: str) -> dict[str, str]:
    return {"units": _UNITS[name]} if name in _UNITS else {}


def _chord_heading(easting: Array, northing: Array) -> npt.NDArray[np.float64]:
    along = np.unwrap(np.arctan2(np.diff(np.asarray(northing)), np.diff(np.asarray(easting))))
    return np.concatenate([along[:1], along])


def _require_variables(
    data: xr.Dataset, names: tuple[str, ...], dims: tuple[str, ...], path: str | Path | None
) -> None:
    for name in names:
        if name not in data:
            raise SchemaError("is missing", path=path, place=f"variable {name}")
        if data[name].dims != dims:
            found = ", ".join(str(dim) for dim in data[name].dims)
            raise SchemaError(
                f"must have the dimensions ({', '.join(dims)}), got ({found})",
                path=path,
                place=f"variable {name}",
            )
        units = data[name].attrs.get("units")
        if units != _UNITS[name]:
            raise SchemaError(
                f"must be in {_UNITS[name]}, got units {units!r}",
                path=path,
                place=f"variable {name}",
            )


def _require_ascending(data: xr.Dataset, axis: str, path: str | Path | None) -> None:
    if axis not in data.coords:
        raise SchemaError("is missing", path=path, place=f"axis {axis}")
    values = np.asarray(data[axis])
    if values.size == 0:
        raise SchemaError("is empty", path=path, place=f"axis {axis}")
    if not np.isfinite(values).all():
        raise SchemaError("must be finite everywhere", path=path, place=f"axis {axis}")
    falls = np.flatnonzero(np.diff(values) <= 0)
    if falls.size:
        at = int(falls[0]) + 1
        raise SchemaError(
            f"must ascend, but value {at} ({values[at]:g}) follows {values[at - 1]:g}",
            path=path,
            place=f"axis {axis}",
        )


def _forbid_others(data: xr.Dataset, known: tuple[str, ...], path: str | Path | None) -> None:
    for name in data.data_vars:
        if name not in known:
            raise SchemaError(
                f"is unknown; known are {', '.join(known)}", path=path, place=f"variable {name}"
            )
