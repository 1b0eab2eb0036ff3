"""Poses between knots against closed-form motions."""

import numpy as np
import numpy.testing as npt
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.motion import Trajectory
from trueterrain.motion.trajectory import BRIDGED

STEP = 0.005  # [s] from knot to knot, 200 Hz


def tumbling(step=STEP, duration=1.0):
    """A motion whose angles and position are sines, and its exact pose."""
    w = np.array([3.0, 5.0, 7.0])

    def pose(t):
        phase = w * np.atleast_1d(t)[:, None]
        angles = np.array([0.3, 0.2, 1.0]) * np.sin(phase)
        return 2.0 * np.cos(phase), Rotation.from_euler("ZYX", angles[:, ::-1])

    def rates(t):
        h = 1e-6
        (_, r0), (_, r1) = pose(t - h), pose(t + h)
        rate = (r0.inv() * r1).as_rotvec() / (2 * h)
        return -2.0 * w * np.sin(w * np.atleast_1d(t)[:, None]), rate

    time = np.arange(0, duration + step / 2, step)
    position, rotation = pose(time)
    velocity, angular_velocity = rates(time)
    n = time.size
    trajectory = Trajectory(
        time=time,
        position=position,
        velocity=velocity,
        quaternion=rotation.as_quat(),
        angular_velocity=angular_velocity,
        covariance=np.tile(np.eye(6), (n, 1, 1)),
        flag=np.zeros(n, np.uint8),
    )
    return trajectory, pose, rates


def test_knots_are_met_exactly():
    trajectory, pose, _ = tumbling()
    found = trajectory.at(trajectory.time)
    npt.assert_allclose(found.position, pose(trajectory.time)[0], rtol=0, atol=1e-13)
    angle = (found.rotation.inv() * pose(trajectory.time)[1]).magnitude()
    npt.assert_allclose(angle, 0, rtol=0, atol=1e-12)


def test_between_knots_the_error_is_that_of_a_cubic():
    """Fourth derivative times step^4 / 384: 2 m at 7 rad/s and 200 Hz leave 8 nm."""
    trajectory, pose, rates = tumbling()
    time = np.random.default_rng(1).uniform(0, 1, 2000)
    found = trajectory.at(time)
    bound = 2.0 * 7.0**4 * STEP**4 / 384
    npt.assert_allclose(found.position, pose(time)[0], rtol=0, atol=1.1 * bound)
    angle = (found.rotation.inv() * pose(time)[1]).magnitude()
    npt.assert_allclose(angle, 0, rtol=0, atol=2e-8)
    velocity, angular_velocity = rates(time)
    npt.assert_allclose(found.velocity, velocity, rtol=0, atol=1e-5)
    npt.assert_allclose(found.angular_velocity, angular_velocity, rtol=0, atol=2e-5)


def test_halving_the_step_divides_the_error_by_sixteen():
    time = np.random.default_rng(2).uniform(0.1, 0.9, 500)
    errors = []
    for step in (0.02, 0.01):
        trajectory, pose, _ = tumbling(step)
        found = trajectory.at(time)
        errors.append((found.rotation.inv() * pose(time)[1]).magnitude().max())
    assert 12 < errors[0] / errors[1] < 20


def test_covariance_and_flags_between_knots():
    trajectory, _, _ = tumbling()
    trajectory.covariance[1] = 3 * np.eye(6)
    trajectory.flag[1] = BRIDGED
    found = trajectory.at([0.25 * STEP, 0.75 * STEP, 2.5 * STEP])
    npt.assert_allclose(found.covariance[:, 0, 0], [1.5, 2.5, 1.0], rtol=0, atol=1e-12)
    assert found.flag.tolist() == [BRIDGED, BRIDGED, 0]


@pytest.mark.parametrize("time", [-0.1, 1.1, np.nan])
def test_times_outside_the_knots_are_refused(time):
    with pytest.raises(ValueError, match=r"time must be from 0\.000000 s to 1\.000000 s"):
        tumbling()[0].at([0.5, time])


def test_knots_must_ascend():
    trajectory, _, _ = tumbling()
    parts = {**vars(trajectory), "time": trajectory.time[::-1]}
    with pytest.raises(ValueError, match="time must ascend"):
        Trajectory(**parts)
