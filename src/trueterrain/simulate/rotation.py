"""Rotations of the body, for the simulator only.

Axes are those of ISO 8855: body x forward, y left, z up; ground east, north, up. The angles are
roll, pitch (nose-down positive) and yaw (counter-clockwise from east), each a right-handed
rotation; from body to ground, ``R_gb = Rz(yaw) Ry(pitch) Rx(roll)``.

No other package may use these functions, and they use nothing of the package: the processing of
recorded runs has its own (`trueterrain.geometry.rotations`), so that a sign error cannot cancel.
"""

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


def body_to_ground(angles: npt.ArrayLike) -> Float:
    """Rotation matrix R_gb from body to ground axes.

    Parameters
    ----------
    angles : array_like, shape (..., 3)
        Roll, pitch and yaw [rad].

    Returns
    -------
    numpy.ndarray, shape (..., 3, 3)
        ``Rz(yaw) Ry(pitch) Rx(roll)``.

    Raises
    ------
    ValueError
        If the last dimension does not hold three angles.

    Examples
    --------
    With the nose down by 0.1 rad, the forward axis points below the horizon.

    >>> body_to_ground([0.0, 0.1, 0.0]) @ [1.0, 0.0, 0.0]
    array([ 0.995,  0.   , -0.0998])
    """
    angles = _require_angles("angles", angles)
    roll, pitch, yaw = np.moveaxis(angles, -1, 0)
    sr, cr, sp, cp, sy, cy = (
        np.sin(roll),
        np.cos(roll),
        np.sin(pitch),
        np.cos(pitch),
        np.sin(yaw),
        np.cos(yaw),
    )
    matrix = np.empty((*roll.shape, 3, 3))
    matrix[..., 0, 0] = cy * cp
    matrix[..., 0, 1] = cy * sp * sr - sy * cr
    matrix[..., 0, 2] = cy * sp * cr + sy * sr
    matrix[..., 1, 0] = sy * cp
    matrix[..., 1, 1] = sy * sp * sr + cy * cr
    matrix[..., 1, 2] = sy * sp * cr - cy * sr
    matrix[..., 2, 0] = -sp
    matrix[..., 2, 1] = cp * sr
    matrix[..., 2, 2] = cp * cr
    return matrix


def angular_velocity(angles: npt.ArrayLike, rates: npt.ArrayLike) -> Float:
    """Angular velocity of the body against the ground, in body axes.

    Parameters
    ----------
    angles : array_like, shape (..., 3)
        Roll, pitch and yaw [rad].
    rates : array_like, shape (..., 3)
        Their first derivatives [rad/s].

    Returns
    -------
    numpy.ndarray, shape (..., 3)
        Angular velocity about x, y and z of the body [rad/s].

    Raises
    ------
    ValueError
        If the last dimension does not hold three angles.

    Examples
    --------
    A body rolled by 90 degrees yaws about its y axis.

    >>> angular_velocity([np.pi / 2, 0.0, 0.0], [0.0, 0.0, 1.0]).round(12) + 0.0
    array([0., 1., 0.])
    """
    roll, pitch, _ = np.moveaxis(_require_angles("angles", angles), -1, 0)
    roll_rate, pitch_rate, yaw_rate = np.moveaxis(_require_angles("rates", rates), -1, 0)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.stack(
        [
            roll_rate - yaw_rate * sp,
            pitch_rate * cr + yaw_rate * cp * sr,
            -pitch_rate * sr + yaw_rate * cp * cr,
        ],
        axis=-1,
    )


def angular_acceleration(
    angles: npt.ArrayLike, rates: npt.ArrayLike, accelerations: npt.ArrayLike
) -> Float:
    """Angular acceleration of the body against the ground, in body axes.

    Parameters
    ----------
    angles : array_like, shape (..., 3)
        Roll, pitch and yaw [rad].
    rates, accelerations : array_like, shape (..., 3)
        Their first [rad/s] and second derivatives [rad/s^2].

    Returns
    -------
    numpy.ndarray, shape (..., 3)
        Derivative of the angular velocity [rad/s^2]. (It is the same whether taken in the body or
        on the ground: the two differ by the velocity's cross product with itself.)

    Raises
    ------
    ValueError
        If the last dimension does not hold three angles.

    Examples
    --------
    >>> angular_acceleration([0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [0.0, 0.0, 0.0])
    array([0., 2., 0.])
    """
    roll, pitch, _ = np.moveaxis(_require_angles("angles", angles), -1, 0)
    p, q, r = np.moveaxis(_require_angles("rates", rates), -1, 0)
    dp, dq, dr = np.moveaxis(_require_angles("accelerations", accelerations), -1, 0)
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.stack(
        [
            dp - dr * sp - r * cp * q,
            dq * cr - q * sr * p + dr * cp * sr + r * (cp * cr * p - sp * sr * q),
            -dq * sr - q * cr * p + dr * cp * cr - r * (cp * sr * p + sp * cr * q),
        ],
        axis=-1,
    )


def _require_angles(name: str, values: npt.ArrayLike) -> Float:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        message = f"{name} must hold roll, pitch and yaw last, got shape {array.shape}."
        raise ValueError(message)
    return array
