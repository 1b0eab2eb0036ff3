"""From the ellipsoid and the aerospace angles to the local frame and the angles of ISO 8855.

Sources: geodetic to geocentric and topocentric coordinates after EPSG Guidance Note 7-2, sections
4.1.1 and 4.1.2 (geocentric by PROJ); local-level attitude C = Rz(heading) Ry(pitch) Rx(roll) of the
forward-right-down body in the north-east-down frame, as Applanix and most of aerospace use it.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

#: Longitude [deg], latitude [deg], ellipsoidal height [m].
Origin = Sequence[float]

_GEODETIC, _GEOCENTRIC = 4979, 4978  # EPSG codes of WGS 84 in three dimensions


def check_origin(origin: Origin) -> tuple[float, float, float]:
    """Origin as three floats.

    Parameters
    ----------
    origin : sequence of float
        Longitude [deg], latitude [deg], ellipsoidal height [m].

    Returns
    -------
    tuple of float
        The same.

    Raises
    ------
    ValueError
        If they are not three, not finite, or no place on Earth.
    """
    values = tuple(float(value) for value in origin)
    if len(values) != 3 or not all(math.isfinite(value) for value in values):
        message = f"origin must be longitude [deg], latitude [deg], height [m], got {origin!r}."
        raise ValueError(message)
    longitude, latitude, height = values
    if abs(longitude) > 360 or abs(latitude) > 90:
        message = (
            "origin must have a longitude within 360 deg and a latitude within 90 deg, got "
            f"{longitude:g} and {latitude:g}."
        )
        raise ValueError(message)
    return longitude, latitude, height


def enu_of_geodetic(
    longitude: npt.ArrayLike, latitude: npt.ArrayLike, height: npt.ArrayLike, origin: Origin
) -> Floats:
    """Positions in the local east-north-up frame of an origin.

    The frame is a plane that touches the ellipsoid: 1 km away the ellipsoid lies 78 mm below it.

    Parameters
    ----------
    longitude, latitude : array_like, shape (point,)
        Position on the ellipsoid [rad].
    height : array_like, shape (point,)
        Ellipsoidal height [m].
    origin : sequence of float
        Longitude [deg], latitude [deg], ellipsoidal height [m] of the frame.

    Returns
    -------
    numpy.ndarray, shape (point, 3)
        East, north, up [m].

    Examples
    --------
    >>> enu_of_geodetic([0.0], [0.0], [2.0], (0.0, 0.0, 0.5))
    array([[0. , 0. , 1.5]])
    """
    import pyproj

    to_geocentric = pyproj.Transformer.from_crs(_GEODETIC, _GEOCENTRIC, always_xy=True)
    origin = check_origin(origin)
    centre = np.array(to_geocentric.transform(*origin))
    points = np.stack(
        to_geocentric.transform(
            np.rad2deg(np.asarray(longitude, dtype=np.float64)),
            np.rad2deg(np.asarray(latitude, dtype=np.float64)),
            np.asarray(height, dtype=np.float64),
        ),
        axis=-1,
    )
    axes = _level_axes(np.deg2rad(origin[0]), np.deg2rad(origin[1]))
    # einsum, whose result for a point does not depend on how many there are, as that of @ may
    local: Floats = np.einsum("pj,kj->pk", points - centre, axes)
    return local


def iso8855_of_ned(
    roll: npt.ArrayLike,
    pitch: npt.ArrayLike,
    heading: npt.ArrayLike,
    *,
    longitude: npt.ArrayLike | None = None,
    latitude: npt.ArrayLike | None = None,
    origin: Origin | None = None,
) -> tuple[Floats, Floats, Floats]:
    """Angles of ISO 8855 from roll, pitch (nose-up) and heading (clockwise from north).

    Without a position the local level at the body is taken for that of the frame: roll stays,
    pitch changes its sign, yaw is a quarter turn less the heading. With a position the attitude is
    turned from the local level there into the level of the origin: about the vertical by the
    convergence of the meridians (0.8 mrad in 5 km at 45 deg), and by the curvature of the Earth
    (0.16 mrad per km).

    Parameters
    ----------
    roll, pitch, heading : array_like, shape (epoch,)
        Right-down, nose-up, clockwise from true north [rad].
    longitude, latitude : array_like, shape (epoch,), optional
        Where the body was [rad].
    origin : sequence of float, optional
        Longitude [deg], latitude [deg], height [m] of the local frame.

    Returns
    -------
    roll, pitch, yaw : numpy.ndarray, shape (epoch,)
        Body to ground is Rz(yaw) Ry(pitch) Rx(roll) [rad]; yaw is within half a turn.

    Examples
    --------
    >>> import math
    >>> _, pitch, yaw = iso8855_of_ned([0.0], [0.02], [math.pi / 2])
    >>> pitch, yaw
    (array([-0.02]), array([0.]))
    """
    from scipy.spatial.transform import Rotation

    h, q, r = (np.asarray(angle, dtype=np.float64) for angle in (heading, pitch, roll))
    if longitude is None or latitude is None or origin is None:
        return r + 0.0, 0.0 - q, _wrap_angle(np.pi / 2 - h)
    origin = check_origin(origin)
    level = Rotation.from_euler("ZYX", np.stack([np.pi / 2 - h, -q, r], axis=-1))
    here = _level_axes(np.asarray(longitude, dtype=np.float64), np.asarray(latitude))
    there = _level_axes(np.deg2rad(origin[0]), np.deg2rad(origin[1]))
    to_frame = Rotation.from_matrix(there @ np.swapaxes(here, -1, -2))
    yaw, pitch_iso, roll_iso = (to_frame * level).as_euler("ZYX").T
    return roll_iso, pitch_iso, yaw


class YawUnwrapper:
    """Continuous yaw without jumps of 2 pi, from block to block.

    Whole turns are counted, so that the result is bit-identical for any size of block.

    Examples
    --------
    >>> YawUnwrapper().continued(np.array([3.0, -3.0]))
    array([3.        , 3.28318531])
    """

    def __init__(self) -> None:
        self._last: float | None = None
        self._turns = 0

    def continued(self, yaw: Floats) -> Floats:
        """Yaw of the next block [rad] without jumps."""
        last = yaw[:1] if self._last is None else np.array([self._last])
        jumps = np.rint(np.diff(yaw, prepend=last) / (2 * np.pi))
        turns = self._turns - np.cumsum(jumps)
        if yaw.size:
            self._last, self._turns = float(yaw[-1]), int(turns[-1])
        continuous: Floats = yaw + 2 * np.pi * turns
        return continuous


def _wrap_angle(angle: Floats) -> Floats:
    return np.pi - np.mod(np.pi - angle, 2 * np.pi)


def _level_axes(longitude: npt.ArrayLike, latitude: npt.ArrayLike) -> Floats:
    """Rows are east, north and up of a place in geocentric coordinates; shape (..., 3, 3)."""
    lon, lat = np.asarray(longitude), np.asarray(latitude)
    sl, cl, sp, cp = np.sin(lon), np.cos(lon), np.sin(lat), np.cos(lat)
    rows = [
        [-sl, cl, np.zeros_like(sl)],
        [-sp * cl, -sp * sl, cp],
        [cp * cl, cp * sl, sp],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
