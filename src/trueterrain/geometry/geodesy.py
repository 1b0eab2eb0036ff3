"""Positions, grids and heights: from any reference system into the local frame of a run.

Grid north is not true north, and a height over the geoid is not one over the ellipsoid: both are
converted or refused, never ignored. PROJ does the work.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.geometry.crs import parse_crs
from trueterrain.geometry.navigation_frames import (
    Origin,
    _level_axes,
    check_origin,
    enu_of_geodetic,
)

__all__ = [
    "ellipsoidal_height",
    "enu_of_geodetic",
    "enu_of_projected",
    "geodetic_of_enu",
    "geodetic_of_projected",
    "meridian_convergence",
    "true_heading",
]

Float = npt.NDArray[np.float64]


def geodetic_of_enu(position: npt.ArrayLike, origin: Origin) -> tuple[Float, Float, Float]:
    """Longitude, latitude [rad] and ellipsoidal height [m] from the local frame of an origin.

    Parameters
    ----------
    position : array_like, shape (n, 3)
        East, north, up [m].
    origin : sequence of float
        Longitude [deg], latitude [deg], ellipsoidal height [m] of the frame.

    Returns
    -------
    longitude, latitude, height : numpy.ndarray, shape (n,)
        On WGS 84 [rad, rad, m].

    Examples
    --------
    >>> longitude, latitude, height = geodetic_of_enu([[0.0, 0.0, 2.0]], (9.0, 48.0, 500.0))
    >>> np.rad2deg(longitude), np.rad2deg(latitude), height
    (array([9.]), array([48.]), array([502.]))
    """
    import pyproj

    origin = check_origin(origin)
    to_geodetic = pyproj.Transformer.from_crs(4978, 4979, always_xy=True)
    centre = to_geodetic.transform(*origin, direction="INVERSE")
    axes = _level_axes(np.deg2rad(origin[0]), np.deg2rad(origin[1]))
    points = np.asarray(position, dtype=float) @ axes + np.array(centre)
    longitude, latitude, height = to_geodetic.transform(*points.T)
    return np.deg2rad(longitude), np.deg2rad(latitude), np.asarray(height)


def meridian_convergence(crs: str, longitude: npt.ArrayLike, latitude: npt.ArrayLike) -> Float:
    """Angle from true north to grid north, clockwise.

    True heading = grid heading + convergence. One degree is 35 mm at 2 m.

    Parameters
    ----------
    crs : str
        A projected system, such as ``"EPSG:32632"``.
    longitude, latitude : array_like, shape (n,)
        Place [rad].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Convergence [rad].

    Raises
    ------
    ValueError
        If the system is no projection, or the place lies outside of it.

    Examples
    --------
    >>> np.rad2deg(meridian_convergence("EPSG:32632", np.deg2rad([11.0]), np.deg2rad([48.0])))
    array([1.4866])
    """
    import pyproj

    projection = parse_crs(crs)
    if not projection.is_projected:
        message = f"crs must be a projected system with a grid north, got {projection.name}."
        raise ValueError(message)
    horizontal = projection.sub_crs_list[0] if projection.is_compound else projection
    factors = pyproj.Proj(horizontal).get_factors(
        np.asarray(longitude, dtype=float), np.asarray(latitude, dtype=float), radians=True
    )
    convergence = np.deg2rad(np.asarray(factors.meridian_convergence, dtype=float))
    if not np.isfinite(convergence).all():
        message = f"longitude and latitude must lie within {horizontal.name}."
        raise ValueError(message)
    return np.atleast_1d(convergence)


def true_heading(
    grid_heading: npt.ArrayLike, crs: str, longitude: npt.ArrayLike, latitude: npt.ArrayLike
) -> Float:
    """Heading from true north [rad] from one that counts from grid north.

    Parameters
    ----------
    grid_heading : array_like, shape (n,)
        Clockwise from grid north [rad].
    crs : str
        The projected system.
    longitude, latitude : array_like, shape (n,)
        Place [rad].

    Returns
    -------
    numpy.ndarray, shape (n,)
        Clockwise from true north [rad].

    Examples
    --------
    >>> place = np.deg2rad([11.0]), np.deg2rad([48.0])
    >>> np.rad2deg(true_heading(0.0, "EPSG:32632", *place))
    array([1.4866])
    """
    heading = np.asarray(grid_heading, dtype=float)
    return np.asarray(heading + meridian_convergence(crs, longitude, latitude))


def ellipsoidal_height(
    longitude: npt.ArrayLike,
    latitude: npt.ArrayLike,
    height: npt.ArrayLike,
    *,
    vertical: str | None = None,
    undulation: float | None = None,
) -> Float:
    """Height over the ellipsoid from one over the geoid; never taken for it silently.

    Parameters
    ----------
    longitude, latitude : array_like, shape (n,)
        Place on WGS 84 [rad].
    height : array_like, shape (n,)
        Height over the geoid [m].
    vertical : str, optional
        The vertical system, such as ``"EPSG:5773"`` (EGM96); its grid must be installed.
    undulation : float, optional
        Height of the geoid over the ellipsoid [m], in place of `vertical`.

    Returns
    -------
    numpy.ndarray, shape (n,)
        Ellipsoidal height [m].

    Raises
    ------
    ValueError
        If not exactly one of `vertical` and `undulation` is given.
    CoverageError
        If the grid of the geoid is not installed, or does not reach the place.

    Examples
    --------
    >>> ellipsoidal_height([0.19], [0.84], [480.0], undulation=46.5)
    array([526.5])
    """
    if (vertical is None) == (undulation is None):
        message = "either vertical or undulation must be given, which tells where the geoid is."
        raise ValueError(message)
    over_geoid = np.asarray(height, dtype=float)
    if undulation is not None:
        return np.asarray(over_geoid + undulation)
    degrees = np.rad2deg(np.asarray(longitude)), np.rad2deg(np.asarray(latitude))
    return _transform_exactly(f"EPSG:4326+{_vertical_code(str(vertical))}", *degrees, over_geoid)[2]


def geodetic_of_projected(
    easting: npt.ArrayLike,
    northing: npt.ArrayLike,
    height: npt.ArrayLike,
    crs: str,
    *,
    undulation: float | None = None,
) -> tuple[Float, Float, Float]:
    """Longitude, latitude [rad] and ellipsoidal height [m] from a projected system.

    Parameters
    ----------
    easting, northing : array_like, shape (n,)
        Position [m].
    height : array_like, shape (n,)
        Height [m].
    crs : str
        A compound system that tells what the heights are, such as ``"EPSG:32632+5773"``; or a
        projected one together with `undulation`.
    undulation : float, optional
        Height over the ellipsoid less `height` [m]; 0 says that the heights are ellipsoidal.

    Returns
    -------
    longitude, latitude, height : numpy.ndarray, shape (n,)
        On WGS 84 [rad, rad, m].

    Raises
    ------
    ValueError
        If nothing tells what the heights are, or the two contradict.
    CoverageError
        If a grid is not installed, or does not reach the place.

    Examples
    --------
    >>> place = geodetic_of_projected([649187.875], [5318235.614], [500.0], "EPSG:32632",
    ...                               undulation=0)
    >>> np.rad2deg(place[0]), np.rad2deg(place[1]), place[2]
    (array([11.]), array([48.]), array([500.]))
    """
    system = parse_crs(crs)
    tells = system.is_compound or len(system.axis_info) == 3
    if tells == (undulation is not None):
        message = (
            f"the heights in {system.name} are over the geoid or the ellipsoid: either crs must be "
            "a compound system such as EPSG:32632+5773, or undulation be given (0 if ellipsoidal)."
        )
        raise ValueError(message)
    up = np.asarray(height, dtype=float)
    east, north = np.asarray(easting, dtype=float), np.asarray(northing, dtype=float)
    longitude, latitude, over = _transform_exactly(crs, east, north, up)
    if undulation is not None:
        over = up + undulation
    return np.deg2rad(longitude), np.deg2rad(latitude), over


def enu_of_projected(
    easting: npt.ArrayLike,
    northing: npt.ArrayLike,
    height: npt.ArrayLike,
    crs: str,
    origin: Origin,
    *,
    undulation: float | None = None,
) -> Float:
    """Positions in the local east-north-up frame of an origin from a projected system.

    Parameters
    ----------
    easting, northing, height : array_like, shape (n,)
        Position [m].
    crs : str
        As in `geodetic_of_projected`.
    origin : sequence of float
        Longitude [deg], latitude [deg], ellipsoidal height [m] of the frame.
    undulation : float, optional
        As in `geodetic_of_projected`.

    Returns
    -------
    numpy.ndarray, shape (n, 3)
        East, north, up [m].

    Examples
    --------
    >>> enu_of_projected([649187.875], [5318235.614], [500.0], "EPSG:32632", (11.0, 48.0, 500.0),
    ...                  undulation=0).round(0) + 0.0
    array([[0., 0., 0.]])
    """
    place = geodetic_of_projected(easting, northing, height, crs, undulation=undulation)
    return enu_of_geodetic(*place, origin)


def _vertical_code(crs: str) -> str:
    """Code of a vertical system, which the name of a compound one is made of."""
    system = parse_crs(crs)
    if not system.is_vertical or system.to_epsg() is None:
        message = f"vertical must be the EPSG code of a vertical system, got {crs[:60]!r}."
        raise ValueError(message)
    return str(system.to_epsg())


def _transform_exactly(crs: str, x: Float, y: Float, z: Float) -> tuple[Float, Float, Float]:
    """Longitude, latitude [deg] and ellipsoidal height on WGS 84, by exact transformations only."""
    import pyproj
    from pyproj.exceptions import ProjError

    # the one order of axes that PROJ cannot mistake: easting or longitude first
    try:
        transformer = pyproj.Transformer.from_crs(
            parse_crs(crs), 4979, always_xy=True, allow_ballpark=False, only_best=True
        )
        found = transformer.transform(x, y, z, errcheck=True)
    except ProjError as error:
        raise CoverageError(
            f"heights in {crs} cannot be brought over the ellipsoid ({error})",
            cure="Install the grid of the geoid (projsync), or give undulation.",
        ) from None
    longitude, latitude, height = (np.asarray(part, dtype=float) for part in found)
    if not (np.isfinite(longitude).all() and np.isfinite(height).all()):
        raise CoverageError(
            f"a position lies outside of {crs} or of the grid of its geoid",
            cure="Check the coordinate reference system, or give undulation.",
        )
    return longitude, latitude, height
