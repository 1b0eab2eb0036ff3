"""What accelerometers say about height, roll and pitch.

An accelerometer with its axis along z of the body reads the third component of

    R' (p'' - g) + w' x r + w x (w x r)

(rotation R of the body, acceleration p'' of its origin, gravity g, angular velocity w and
acceleration w' in body axes, position r of the sensor). With roll a, pitch b, yaw c (ISO 8855) this
is linear in the acceleration of a height, a'' and b''; everything else in it is known well enough
from navigation. The height is that of the middle of the sensors, because its acceleration is their
mean, however the body turns.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

_FLATTEST = 0.02  # [m] least spread of sensors, second singular value, that tells roll and pitch


@dataclass(frozen=True, kw_only=True, eq=False)
class AttitudeHistory:
    """Motion that is known from navigation, at some times."""

    roll: Float
    "Shape (n,) [rad]."

    pitch: Float
    "Shape (n,) [rad]."

    roll_rate: Float
    "Shape (n,) [rad/s]."

    pitch_rate: Float
    "Shape (n,) [rad/s]."

    turn: Float
    "Second derivatives of roll and pitch, used if the sensors do not tell them, (n, 2) [rad/s^2]."

    yaw_rate: Float
    "Shape (n,) [rad/s]."

    yaw_turn: Float
    "Its derivative, shape (n,) [rad/s^2]."

    ahead: Float
    "Horizontal acceleration of the origin towards where the body heads, shape (n,) [m/s^2]."

    left: Float
    "And to the left of it, shape (n,) [m/s^2]."


def tells_turns(position: Float) -> bool:
    """Whether sensors at some positions (sensor, 3) tell roll and pitch apart from height.

    Examples
    --------
    >>> tells_turns(np.array([[0.5, 0, 0], [-0.25, 0.4, 0], [-0.25, -0.4, 0]]))
    True
    >>> tells_turns(np.array([[0.5, 0, 0], [0.0, 0, 0], [-0.5, 0, 0]]))
    False
    """
    if len(position) < 3:
        return False
    plan = position[:, :2] - position[:, :2].mean(axis=0)
    return bool(np.linalg.svd(plan, compute_uv=False)[1] > _FLATTEST)


def lever_height(roll: Float, pitch: Float, point: Float) -> tuple[Float, Float, Float]:
    """Height of a point of the body over its origin, and its derivatives by roll and by pitch [m].

    Examples
    --------
    >>> float(lever(0.0, 0.1, np.array([1.0, 0.0, 0.0]))[0])  # nose down: what is ahead is low
    -0.0998...
    """
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    x, y, z = point
    return (
        -sp * x + cp * (sr * y + cr * z),
        cp * (cr * y - sr * z),
        -cp * x - sp * (sr * y + cr * z),
    )


def sensor_matrix(roll: Float, pitch: Float, position: Float) -> Float:
    """What each sensor feels of the height of their middle, of roll and of pitch accelerating.

    Returns
    -------
    numpy.ndarray, shape (n, sensor, 3)
        Derivatives of the readings by the three accelerations [1, m, m].
    """
    cr, upright = np.cos(roll), np.cos(roll) * np.cos(pitch)
    _, by_roll, by_pitch = lever_height(roll, pitch, position.mean(axis=0))
    matrix = np.empty((roll.size, len(position), 3))
    for i, (x, y, _) in enumerate(position):
        matrix[:, i, 0] = upright
        matrix[:, i, 1] = y - upright * by_roll
        matrix[:, i, 2] = -x * cr - upright * by_pitch
    return matrix


def body_accelerations(
    force: Float, position: Float, motion: AttitudeHistory, gravity: float
) -> Float:
    """Accelerations of the height of the middle of the sensors, of roll and of pitch.

    Parameters
    ----------
    force : numpy.ndarray, shape (n, sensor)
        Readings [m/s^2].
    position : numpy.ndarray, shape (sensor, 3)
        Of the sensors in the body [m].
    motion : Attitude
        What navigation knows at their times.
    gravity : float
        Gravity, straight down [m/s^2].

    Returns
    -------
    numpy.ndarray, shape (n, 3)
        [m/s^2, rad/s^2, rad/s^2]; the latter two those of `motion` if the sensors do not tell them.
    """
    matrix = sensor_matrix(motion.roll, motion.pitch, position)
    free = force - _known_acceleration(position, motion, gravity)
    if tells_turns(position):
        across = np.swapaxes(matrix, 1, 2)
        return np.asarray(np.linalg.solve(across @ matrix, across @ free[:, :, None])[:, :, 0])
    free -= np.einsum("nij,nj->ni", matrix[:, :, 1:], motion.turn)
    height = free.mean(axis=1) / matrix[:, 0, 0]
    return np.column_stack([height, motion.turn])


def _known_acceleration(position: Float, m: AttitudeHistory, gravity: float) -> Float:
    """What the sensors feel besides the three accelerations, shape (n, sensor) [m/s^2]."""
    sr, cr, sp, cp = np.sin(m.roll), np.cos(m.roll), np.sin(m.pitch), np.cos(m.pitch)
    a, b, c = m.roll_rate, m.pitch_rate, m.yaw_rate
    wx, wy, wz = a - c * sp, b * cr + c * cp * sr, c * cp * cr - b * sr
    # angular acceleration less what comes from a'' and b''
    turn_x = -m.yaw_turn * sp - c * cp * b
    turn_y = -b * sr * a + m.yaw_turn * cp * sr + c * (cp * cr * a - sp * sr * b)
    x, y, z = position.mean(axis=0)
    # second derivative of the height of the middle over the origin, less what comes from a'', b''
    bend = (
        -cp * (sr * y + cr * z) * a**2
        - 2 * sp * (cr * y - sr * z) * a * b
        + (sp * x - cp * (sr * y + cr * z)) * b**2
    )
    common = cr * (sp * m.ahead + cp * (gravity - bend)) - sr * m.left
    felt = np.empty((m.roll.size, len(position)))
    for i, (rx, ry, rz) in enumerate(position):
        outward = wz * (wx * rx + wy * ry) - rz * (wx**2 + wy**2)
        felt[:, i] = common + turn_x * ry - turn_y * rx + outward
    return felt
