"""A trajectory from the parts that were found on different ways."""

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trueterrain.motion._complementary import BodyCoordinates
from trueterrain.motion._heave import lever_height
from trueterrain.motion._inputs import Span, inside_spans
from trueterrain.motion._way import CubicSeries
from trueterrain.motion.trajectory import BRIDGED, EDGE, Trajectory

Float = npt.NDArray[np.float64]


def trajectory_of(
    time: Float,
    coordinates: BodyCoordinates,
    middle: Float,
    way: CubicSeries,
    way_variance: Float,
    bridged: tuple[Span, ...],
    edge: tuple[float, float],
) -> Trajectory:
    """Trajectory of the origin of the body.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Knots [s].
    coordinates : Coordinates
        Height of a point of the body, roll and pitch.
    middle : numpy.ndarray, shape (3,)
        That point [m].
    way : Way
        East, north, yaw.
    way_variance : numpy.ndarray, shape (n, 3)
        Their variances [m^2, m^2, rad^2].
    bridged : tuple
        Stretches that an instrument did not see [s].
    edge : tuple of float
        Lengths at both ends in which filters settle [s].
    """
    roll, pitch = coordinates.value[:, 1], coordinates.value[:, 2]
    over, by_roll, by_pitch = lever_height(roll, pitch, middle)
    plan, plan_rate = way.value(time), way.rate(time)
    up_rate = coordinates.rate[:, 0] - by_roll * coordinates.rate[:, 1]
    up_rate -= by_pitch * coordinates.rate[:, 2]
    rotation = Rotation.from_euler("ZYX", np.stack([plan[:, 2], pitch, roll], axis=1))
    flag = np.where(inside_spans(time, bridged), BRIDGED, 0).astype(np.uint8)
    flag[(time < time[0] + edge[0]) | (time > time[-1] - edge[1])] |= EDGE
    return Trajectory(
        time=time,
        position=np.stack([plan[:, 0], plan[:, 1], coordinates.value[:, 0] - over], axis=1),
        velocity=np.stack([plan_rate[:, 0], plan_rate[:, 1], up_rate], axis=1),
        quaternion=rotation.as_quat(),
        angular_velocity=_body_rates(
            roll, pitch, coordinates.rate[:, 1], coordinates.rate[:, 2], plan_rate[:, 2]
        ),
        covariance=_pose_covariance(coordinates, by_roll, by_pitch, plan[:, 2], way_variance),
        flag=flag,
    )


def _body_rates(roll: Float, pitch: Float, a: Float, b: Float, c: Float) -> Float:
    """Angular velocity in body axes from the rates of roll, pitch and yaw."""
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.stack([a - c * sp, b * cr + c * cp * sr, c * cp * cr - b * sr], axis=1)


def _pose_covariance(
    coordinates: BodyCoordinates, by_roll: Float, by_pitch: Float, yaw: Float, way: Float
) -> Float:
    """Of east, north, up and small turns about them, shape (n, 6, 6)."""
    n = yaw.size
    pitch = coordinates.value[:, 2]
    # derivatives by (height of the middle, roll, pitch)
    out = np.zeros((n, 4, 3))
    out[:, 0, 0], out[:, 0, 1], out[:, 0, 2] = 1.0, -by_roll, -by_pitch
    # the axis of roll is x of the body, that of pitch lies level to its left
    out[:, 1, 1], out[:, 1, 2] = np.cos(yaw) * np.cos(pitch), -np.sin(yaw)
    out[:, 2, 1], out[:, 2, 2] = np.sin(yaw) * np.cos(pitch), np.cos(yaw)
    out[:, 3, 1] = -np.sin(pitch)
    covariance = np.zeros((n, 6, 6))
    covariance[:, 2:, 2:] = out @ coordinates.covariance @ np.swapaxes(out, 1, 2)
    covariance[:, 0, 0] = way[:, 0]
    covariance[:, 1, 1] = way[:, 1]
    covariance[:, 5, 5] += way[:, 2]
    return covariance
