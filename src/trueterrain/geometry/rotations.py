r"""Frames: conventions of angles, positions and heights, and their conversion to ours.

Ours is that of ISO 8855: body x forward, y left, z up; ground east, north, up; the attitude is the
`scipy.spatial.transform.Rotation` that takes vectors from the body to the ground,
``Rz(yaw) Ry(pitch) Rx(roll)`` with pitch nose-down positive and yaw counter-clockwise from east.

Each other convention has a function into ours and one back. With R the right-handed rotations
about one axis, and r, q, h for roll (right-down), pitch (nose-up) and heading (clockwise from
north):

====================  ==========================================  ==============================
convention            matrix                                      takes
====================  ==========================================  ==============================
`from_iso8855`        Rz(yaw) Ry(pitch) Rx(roll)                  forward-left-up to
                                                                  east-north-up
`from_sbet`           Rz(h) Ry(q) Rx(r)                           forward-right-down to
                                                                  north-east-down
`from_span`           Rz(-h) Rx(q) Ry(r)                          right-forward-up to
                                                                  east-north-up
`from_opk`            Rx(omega) Ry(phi) Rz(kappa)                 right-forward-up to
                                                                  east-north-up
`from_thesis_eq_2_1`  [Rx(omega) Ry(phi) Rz(kappa)] transposed    as is said with it
====================  ==========================================  ==============================

Sources: Applanix SBET and most of aerospace; NovAtel APN-037 and APN-065; photogrammetric textbooks
for omega, phi, kappa; Smith (2009), equation 2-1, which prints the photogrammetric matrix from
ground to sensor and not that of aerospace, whatever its angles are called.
"""

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trueterrain.geometry.geodesy import (
    ellipsoidal_height,
    enu_of_geodetic,
    enu_of_projected,
    geodetic_of_enu,
    geodetic_of_projected,
    meridian_convergence,
    true_heading,
)
from trueterrain.geometry.navigation_frames import iso8855_of_ned

__all__ = [
    "ellipsoidal_height",
    "enu_of_geodetic",
    "enu_of_projected",
    "from_iso8855",
    "from_opk",
    "from_sbet",
    "from_span",
    "from_thesis_eq_2_1",
    "geodetic_of_enu",
    "geodetic_of_projected",
    "meridian_convergence",
    "to_iso8855",
    "to_opk",
    "to_sbet",
    "to_span",
    "to_thesis_eq_2_1",
    "true_heading",
]

Float = npt.NDArray[np.float64]

#: What the matrix of equation 2-1 may take into what.
ThesisUse = Literal["flu to enu", "flu to nwu", "frd to ned", "enu to rfu"]

# Fixed turns between axes; all are proper rotations.
_RFU_OF_FLU = Rotation.from_matrix([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_ENU_OF_NWU = Rotation.from_matrix([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_ENU_OF_NED = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FRD_OF_FLU = Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])


def from_iso8855(roll: npt.ArrayLike, pitch: npt.ArrayLike, yaw: npt.ArrayLike) -> Rotation:
    """Attitude from the angles of ISO 8855, as runs hold them.

    Parameters
    ----------
    roll, pitch, yaw : array_like, shape (n,) or ()
        Right-down, nose-down, counter-clockwise from east [rad].

    Returns
    -------
    Rotation
        Body to ground.

    Examples
    --------
    >>> from_iso8855(0.0, 0.1, 0.0).apply([1.0, 0.0, 0.0])  # nose down
    array([ 0.995,  0.   , -0.0998])
    """
    return _euler_rotation("ZYX", yaw, pitch, roll)


def to_iso8855(rotation: Rotation) -> tuple[Float, Float, Float]:
    """Roll, pitch and yaw [rad] of ISO 8855; see `from_iso8855`."""
    yaw, pitch, roll = np.moveaxis(rotation.as_euler("ZYX"), -1, 0)
    return roll, pitch, yaw


def from_sbet(roll: npt.ArrayLike, pitch: npt.ArrayLike, heading: npt.ArrayLike) -> Rotation:
    """Attitude from roll, pitch and heading of the forward-right-down body (SBET, aerospace).

    Parameters
    ----------
    roll, pitch, heading : array_like, shape (n,) or ()
        Right-down, nose-up, clockwise from true north [rad]. The platform heading of an SBET is
        to be lessened by its wander angle first, which `trueterrain.formats.navigation` does.

    Returns
    -------
    Rotation
        Body to ground.

    Examples
    --------
    >>> from_sbet(0.0, 0.1, np.pi / 2).apply([1.0, 0.0, 0.0]).round(4)  # to the east, nose up
    array([0.995 , 0.    , 0.0998])
    """
    return from_iso8855(*iso8855_of_ned(roll, pitch, heading))


def to_sbet(rotation: Rotation) -> tuple[Float, Float, Float]:
    """Roll, pitch (nose-up) and heading (0 to a turn) [rad]; see `from_sbet`."""
    roll, pitch, yaw = to_iso8855(rotation)
    return roll, -pitch, np.mod(np.pi / 2 - yaw, 2 * np.pi)


def from_span(roll: npt.ArrayLike, pitch: npt.ArrayLike, azimuth: npt.ArrayLike) -> Rotation:
    """Attitude from roll, pitch and azimuth of the right-forward-up body (NovAtel SPAN).

    Parameters
    ----------
    roll, pitch, azimuth : array_like, shape (n,) or ()
        About y, about x, clockwise from true north about z [rad]: the same values as of an SBET.

    Returns
    -------
    Rotation
        Forward-left-up body to ground.

    Examples
    --------
    >>> from_span(0.0, 0.1, np.pi / 2).apply([1.0, 0.0, 0.0]).round(4)
    array([0.995 , 0.    , 0.0998])
    """
    return _euler_rotation("ZXY", -np.asarray(azimuth, dtype=float), pitch, roll) * _RFU_OF_FLU


def to_span(rotation: Rotation) -> tuple[Float, Float, Float]:
    """Roll, pitch and azimuth (0 to a turn) [rad]; see `from_span`."""
    angles = (rotation * _RFU_OF_FLU.inv()).as_euler("ZXY")
    azimuth, pitch, roll = np.moveaxis(angles, -1, 0)
    return roll, pitch, np.mod(-azimuth, 2 * np.pi)


def from_opk(omega: npt.ArrayLike, phi: npt.ArrayLike, kappa: npt.ArrayLike) -> Rotation:
    """Attitude from the photogrammetric angles omega, phi, kappa.

    ``Rx(omega) Ry(phi) Rz(kappa)`` takes the right-forward-up body to east-north-up. Omega and phi
    are turns about east and north, not roll and pitch.

    Parameters
    ----------
    omega, phi, kappa : array_like, shape (n,) or ()
        Angles [rad].

    Returns
    -------
    Rotation
        Forward-left-up body to ground.

    Examples
    --------
    >>> from_opk(0.0, 0.0, -np.pi / 2).apply([1.0, 0.0, 0.0]).round(6)  # to the east
    array([1., 0., 0.])
    """
    return _euler_rotation("XYZ", omega, phi, kappa) * _RFU_OF_FLU


def to_opk(rotation: Rotation) -> tuple[Float, Float, Float]:
    """Omega, phi, kappa [rad]; see `from_opk`."""
    angles = (rotation * _RFU_OF_FLU.inv()).as_euler("XYZ")
    omega, phi, kappa = np.moveaxis(angles, -1, 0)
    return omega, phi, kappa


def from_thesis_eq_2_1(
    omega: npt.ArrayLike,
    phi: npt.ArrayLike,
    kappa: npt.ArrayLike,
    *,
    use: ThesisUse = "flu to enu",
) -> Rotation:
    """Attitude from the angles of the thesis's equation 2-1.

    Its matrix is ``Rz(-kappa) Ry(-phi) Rx(-omega)``. What it takes into what the thesis does not
    say, so that it has to be said here; with the angles of ISO 8855 ``"flu to enu"`` takes
    omega = -roll, phi = -pitch, kappa = -yaw.

    Parameters
    ----------
    omega, phi, kappa : array_like, shape (n,) or ()
        Angles [rad].
    use : str
        ``"flu to enu"``, ``"flu to nwu"`` or ``"frd to ned"``: body axes (forward, left, up or
        forward, right, down) to ground axes; ``"enu to rfu"``: ground to right, forward, up, as
        photogrammetry uses the same matrix.

    Returns
    -------
    Rotation
        Forward-left-up body to east-north-up.

    Raises
    ------
    ValueError
        If the use is unknown.

    Examples
    --------
    >>> from_thesis_eq_2_1(0.0, -0.1, 0.0).apply([1.0, 0.0, 0.0])
    array([ 0.995,  0.   , -0.0998])
    """
    _check_use(use)
    matrix = _euler_rotation("XYZ", omega, phi, kappa).inv()
    return {
        "flu to enu": matrix,
        "flu to nwu": _ENU_OF_NWU * matrix,
        "frd to ned": _ENU_OF_NED * matrix * _FRD_OF_FLU,
        "enu to rfu": matrix.inv() * _RFU_OF_FLU,
    }[use]


def to_thesis_eq_2_1(
    rotation: Rotation, *, use: ThesisUse = "flu to enu"
) -> tuple[Float, Float, Float]:
    """Omega, phi, kappa [rad] of the thesis's equation 2-1; see `from_thesis_eq_2_1`."""
    _check_use(use)
    matrix = {
        "flu to enu": rotation,
        "flu to nwu": _ENU_OF_NWU.inv() * rotation,
        "frd to ned": _ENU_OF_NED.inv() * rotation * _FRD_OF_FLU.inv(),
        "enu to rfu": (rotation * _RFU_OF_FLU.inv()).inv(),
    }[use]
    omega, phi, kappa = np.moveaxis(matrix.inv().as_euler("XYZ"), -1, 0)
    return omega, phi, kappa


def _check_use(use: str) -> None:
    if use not in get_args(ThesisUse):
        message = f"use must be one of {', '.join(get_args(ThesisUse))}, got {use!r}."
        raise ValueError(message)


def _euler_rotation(axes: str, *angles: npt.ArrayLike) -> Rotation:
    parts = np.broadcast_arrays(*(np.asarray(angle, dtype=float) for angle in angles))
    return Rotation.from_euler(axes, np.stack(parts, axis=-1))
