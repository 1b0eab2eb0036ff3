"""Points from the local frame of a run into a coordinate reference system of maps.

The local frame is a plane that touches the ellipsoid at the origin of the run, its axes east, north
and up there. Sources: EPSG Guidance Note 7-2, section 4.1.2 (topocentric coordinates); PROJ.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core import provenance

if TYPE_CHECKING:
    import pyproj

Floats = npt.NDArray[np.float64]

_GEODETIC, _GEOCENTRIC = 4979, 4978  # EPSG codes of WGS 84 in three dimensions
# [1] by which a projection may change lengths: Lambert-93 does by 0.33 % in its own area, most
# systems for surveying by 0.1 % or less
_MOST_STRETCH = 0.0035
_BESIDE = 10.0  # [m] of the origin, where lengths are compared


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
        If the system is unknown, not projected, not in metres, changes lengths at the origin by
        more than 0.35 %, or asks for heights above a geoid, whose model is not at hand.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> here = into_crs(make_points([0.0], [0.0], [1.5]), (9.0, 48.0, 500.0), "EPSG:32632")
    >>> here.easting.values, here.northing.values, here.up.values
    (array([500000.]), array([5316300.2]), array([501.5]))
    """
    target = check_crs(crs, origin)
    local = np.stack([np.asarray(points[name]) for name in ("easting", "northing", "up")], axis=1)
    east, north, up = _on_map(local, origin, target)
    moved = points.assign(
        easting=points["easting"].copy(data=east),
        northing=points["northing"].copy(data=north),
        up=points["up"].copy(data=up),
    ).assign_attrs(crs=crs)
    parameters = {"crs": crs, "origin": list(origin), "heights": "ellipsoidal"}
    return provenance.add_step(moved, "into_crs", parameters=parameters)


def _on_map(local: Floats, origin: Sequence[float], target: "pyproj.CRS") -> Floats:
    """Easting, northing and ellipsoidal height [m] of places in a local frame, as rows."""
    from pyproj import Transformer

    to_geocentric = Transformer.from_crs(_GEODETIC, _GEOCENTRIC, always_xy=True)
    longitude, latitude, height = (float(part) for part in origin)
    centre = np.array(to_geocentric.transform(longitude, latitude, height))
    geocentric = centre + local @ _topocentric_axes(np.deg2rad(longitude), np.deg2rad(latitude))
    to_map: Any = Transformer.from_crs(_GEOCENTRIC, target.to_3d(), always_xy=True)
    return np.array(to_map.transform(*geocentric.T))


def _topocentric_axes(longitude: float, latitude: float) -> Floats:
    """East, north and up at a place, as rows of geocentric components."""
    sl, cl, sp, cp = np.sin(longitude), np.cos(longitude), np.sin(latitude), np.cos(latitude)
    return np.array([[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]])


def check_crs(crs: str, origin: Sequence[float] | None = None) -> "pyproj.CRS":
    """System that points can be moved into.

    Parameters
    ----------
    crs : str
        EPSG code or WKT.
    origin : sequence of float, optional
        Longitude [deg], latitude [deg] and ellipsoidal height [m] of the place whose lengths the
        system must not change.

    Returns
    -------
    pyproj.CRS
        The system.

    Raises
    ------
    ValueError
        As by `into_crs`.
    """
    from trueterrain.geometry.crs import parse_crs

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
    if origin is not None:
        _require_true_lengths(system, origin)
    return system


def _require_true_lengths(system: "pyproj.CRS", origin: Sequence[float]) -> None:
    # from the transformation itself: the factors that PROJ reports of EPSG:3857 are of a sphere
    half = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) * _BESIDE
    ends = _on_map(np.concatenate([half, -half]), origin, system)[:2]
    largest = np.inf
    if np.isfinite(ends).all():
        sides = (ends[:, :2] - ends[:, 2:]) / (2 * _BESIDE)
        largest = max(np.linalg.svd(sides, compute_uv=False), key=lambda scale: abs(scale - 1))
    if not abs(largest - 1) <= _MOST_STRETCH:
        longitude, latitude, _ = origin
        zone = int((longitude + 180) // 6) % 60 + 1
        message = (
            f"crs must change lengths by at most {_MOST_STRETCH:.2%} at the run, at longitude "
            f"{longitude:.4f} and latitude {latitude:.4f} degrees, but the scale factor of "
            f"{system.name} is {largest:.4g} there. Choose a system made for the place, such as "
            f"EPSG:{(32600 if latitude >= 0 else 32700) + zone} (UTM)."
        )
        raise ValueError(message)
