import numpy as np
import numpy.testing as npt
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.simulate.rotation import angular_acceleration, angular_velocity, body_to_ground

EXACT = 1e-14  # [1] a few units of round-off in products of three sines
DIFFERENCE = 1e-8  # [rad/s], [rad/s^2] central differences over 1e-5 s: 1e-16 / 1e-5 of round-off


@pytest.fixture(scope="module")
def motion():
    """Angles beyond all quadrants, rates and accelerations, 500 of each."""
    rng = np.random.default_rng(3)
    return rng.uniform(-4, 4, (500, 3)), rng.normal(size=(500, 3)), rng.normal(size=(500, 3))


def test_matrix_equals_that_of_scipy(motion):
    angles = motion[0]
    truth = Rotation.from_euler("ZYX", angles[:, ::-1]).as_matrix()
    npt.assert_allclose(body_to_ground(angles), truth, rtol=0, atol=EXACT)


@pytest.mark.parametrize(
    ("angles", "body", "ground"),
    [
        ([0.0, 0.1, 0.0], [1, 0, 0], [np.cos(0.1), 0, -np.sin(0.1)]),  # nose down: front lower
        ([0.1, 0.0, 0.0], [0, 1, 0], [0, np.cos(0.1), np.sin(0.1)]),  # roll: left side higher
        ([0.0, 0.0, 0.1], [1, 0, 0], [np.cos(0.1), np.sin(0.1), 0]),  # yaw: turns to the north
        ([0.0, 0.0, np.pi / 2], [0, 1, 0], [-1, 0, 0]),  # driving north, west is on the left
    ],
)
def test_signs_are_those_of_iso_8855(angles, body, ground):
    npt.assert_allclose(body_to_ground(angles) @ body, ground, rtol=0, atol=EXACT)


def at(motion, t):
    """Scipy's rotation of each body at the time t, when its angles move as quadratics."""
    angles, rates, accelerations = motion
    return Rotation.from_euler("ZYX", (angles + rates * t + accelerations * t**2 / 2)[:, ::-1])


def test_angular_velocity_is_the_rate_of_the_rotation(motion):
    h = 1e-5
    truth = (at(motion, -h).inv() * at(motion, h)).as_rotvec() / (2 * h)
    npt.assert_allclose(angular_velocity(*motion[:2]), truth, rtol=0, atol=DIFFERENCE)


def test_angular_acceleration_is_the_rate_of_the_angular_velocity(motion):
    angles, rates, accelerations = motion
    h = 1e-5

    def velocity(t):
        return angular_velocity(
            angles + rates * t + accelerations * t**2 / 2, rates + accelerations * t
        )

    truth = (velocity(h) - velocity(-h)) / (2 * h)
    npt.assert_allclose(angular_acceleration(*motion), truth, rtol=0, atol=DIFFERENCE)


def test_shapes_are_kept():
    assert body_to_ground(np.zeros((4, 5, 3))).shape == (4, 5, 3, 3)
    assert angular_velocity(np.zeros((4, 5, 3)), np.zeros((4, 5, 3))).shape == (4, 5, 3)


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match=r"angles must hold roll, pitch and yaw.*\(2,\)"):
        body_to_ground([1.0, 2.0])
    with pytest.raises(ValueError, match="rates must hold"):
        angular_velocity(np.zeros(3), 0.0)
    with pytest.raises(ValueError, match="accelerations must hold"):
        angular_acceleration(np.zeros(3), np.zeros(3), np.zeros(4))
