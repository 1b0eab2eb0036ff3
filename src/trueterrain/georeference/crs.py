"""Points from the local frame of a run into a coordinate reference system of maps.

The local frame is a plane that touches the ellipsoid at the origin of the run, its axes east, north
and up there. Sources: EPSG Guidance Note 7-2, section 4.1.2 (topocentric coordinates); PROJ.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain import provenance

if TYPE_CHECKING:
    import pyproj

Floats = npt.NDArray[np.float64]

_GEODETIC, _GEOCENTRIC = 4979, 4978  # EPSG codes of WGS 84 in three dimensions


def into_crs(points: xr.Dataset, origin: Sequence[float], crs: str) -> xr.Dataset:
    """Points in a projected coordinate reference system, with ellipsoidal heights.

    Parameters
    ----------
    points : xarray.Dataset
        Points in the local frame of a run.
    origin : sequence of float
        Longitude [deg], latitude [deg] and ellipsoidal height [m] of the frame, on WGS 84.
    crs : str
        Projected system with metres, e.g. ``"EPSG:32632"``.

    Returns
    -------
    xarray.Dataset
        The same points with ``easting``, ``northing`` and ellipsoidal ``up``; ``attrs["crs"]``
        names the system. Grid north is not true north: all directions turn by the meridian
        convergence, and lengths change by the scale of the projection.

    Raises
    ------
    ValueError
        If the system is unknown, not projected, not in metres, or asks for heights above a geoid,
        whose model is not at hand.

    Examples
    --------
    >>> from trueterrain.kinds import make_points
    >>> here = into_crs(make_points([0.0], [0.0], [1.5]), (9.0, 48.0, 500.0), "EPSG:32632")
    >>> here.easting.values, here.northing.values, here.up.values
    (array([500000.]), array([5316300.2]), array([501.5]))
    """
    from pyproj import Transformer

    target = check_crs(crs).to_3d()
    to_geocentric = Transformer.from_crs(_GEODETIC, _GEOCENTRIC, always_xy=True)
    longitude, latitude, height = (float(part) for part in origin)
    centre = np.array(to_geocentric.transform(longitude, latitude, height))
    local = np.stack([np.asarray(points[name]) for name in ("easting", "northing", "up")], axis=1)
    geocentric = centre + local @ _axes(np.deg2rad(longitude), np.deg2rad(latitude))
    to_map: Any = Transformer.from_crs(_GEOCENTRIC, target, always_xy=True)
    x, y, z = geocentric.T
    east, north, up = to_map.transform(x, y, z)
    moved = points.assign(
        easting=points["easting"].copy(data=np.asarray(east)),
        northing=points["northing"].copy(data=np.asarray(north)),
        up=points["up"].copy(data=np.asarray(up)),
    ).assign_attrs(crs=crs)
    parameters = {"crs": crs, "origin": list(origin), "heights": "ellipsoidal"}
    return provenance.add_step(moved, "into_crs", parameters=parameters)


def _axes(longitude: float, latitude: float) -> Floats:
    """East, north and up at a place, as rows of geocentric components."""
    sl, cl, sp, cp = np.sin(longitude), np.cos(longitude), np.sin(latitude), np.cos(latitude)
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


def check_crs(crs: str) -> "pyproj.CRS":
    """System that points can be moved into.

    Parameters
    ----------
    crs : str
        EPSG code or WKT.

    Returns
    -------
    pyproj.CRS
        The system.

    Raises
    ------
    ValueError
        As by `into_crs`.
    """
    from trueterrain.formats.crs import parse_crs

    system = parse_crs(crs)
    if system.is_compound or len(system.axis_info) > 2:
        message = (
            f"crs must be without heights, got {system.name}: heights of a run are ellipsoidal, "
            "and no model of a geoid is at hand."
        )
        raise ValueError(message)
    metres = all(abs(axis.unit_conversion_factor - 1) < 1e-12 for axis in system.axis_info)
    if not (system.is_projected and metres):
        message = f"crs must be a projected system in metres, got {system.name}."
        raise ValueError(message)
    return system
