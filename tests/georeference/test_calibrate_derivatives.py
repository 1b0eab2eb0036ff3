"""What a mounting does to returns, against differences of georeferenced points; and the planes."""

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting
from trueterrain.georeference import ScanGeometry, Screening, georeference
from trueterrain.georeference._patches import NAMES, PatchGrid, _georeference_returns, fit_patches
from trueterrain.motion import Trajectory

ASKEW = Mounting(
    scanner_position=(-2.1, 0.12, 1.15), scanner_rotation=(0.03, -0.04, 0.06), scanner_clock=0.0037
)
STEP = 1e-5  # [rad, m, s] to both sides; the rest goes with its square
SLOPE = 1e-6  # [m/rad] or [1], of some metres
SPEED = 5e-4  # [m/s] of 8: the knots of the motion have no common acceleration
LEVEL = 1e-6  # [m] and [1] of planes that are exact but for the rotation of the beam


def moving():
    """Driving a curve at 8 m/s, rolling and heaving."""
    t = np.arange(0, 1.0025, 0.005)
    yaw, tilt = 0.5 * t, 0.02 * np.sin(20 * t)
    position = np.stack([16 * np.sin(yaw), 16 * (1 - np.cos(yaw)), 0.02 * np.cos(25 * t)], axis=1)
    velocity = np.stack([8 * np.cos(yaw), 8 * np.sin(yaw), -0.5 * np.sin(25 * t)], axis=1)
    turning = [0.4 * np.cos(20 * t), 0.5 * np.sin(tilt), 0.5 * np.cos(tilt)]
    return Trajectory(
        time=t,
        position=position,
        velocity=velocity,
        quaternion=Rotation.from_euler("ZX", np.stack([yaw, tilt], axis=1)).as_quat(),
        angular_velocity=np.stack(turning, axis=1),
        covariance=np.zeros((t.size, 6, 6)),
        flag=np.zeros(t.size, np.uint8),
    )


def still(up=2.0):
    rest = np.zeros((2, 3))
    return Trajectory(
        time=np.array([0.0, 10.0]),
        position=rest + np.array([0.0, 0.0, up]),
        velocity=rest,
        quaternion=np.tile([0, 0, 0, 1.0], (2, 1)),
        angular_velocity=rest,
        covariance=np.zeros((2, 6, 6)),
        flag=np.zeros(2, np.uint8),
    )


def moved(mounting, name, by):
    part = {"roll": 0, "pitch": 1, "yaw": 2, "lever_x": 0, "lever_y": 1, "lever_z": 2}.get(name)
    if part is None:
        return replace(mounting, scanner_clock=mounting.scanner_clock + by)
    field = "scanner_position" if name.startswith("lever") else "scanner_rotation"
    values = list(getattr(mounting, field))
    values[part] += by
    return replace(mounting, **{field: tuple(values)})


@pytest.mark.parametrize("span", [0.8e-3, 5e-3])
def test_derivatives_are_those_of_georeferenced_points(span):
    trajectory = moving()
    angle, delay = np.linspace(-0.6, 0.6, 31), np.linspace(0, span, 31)
    rng = np.random.default_rng(5)
    block = xr.Dataset(
        {
            "time": ("scan", rng.uniform(0.05, 0.9, 20)),
            "range": (("scan", "beam"), rng.uniform(1.8, 2.6, (20, 31))),
            "angle": ("beam", angle),
            "delay": ("beam", delay),
        }
    )

    def points(mounting):
        (found,) = georeference([block], trajectory, mounting)
        return np.stack([found[name].values for name in ("easting", "northing", "up")])

    where, by, weight, when = _georeference_returns(
        ScanGeometry(trajectory, ASKEW, angle, delay), block, Screening(), 1.0
    )
    npt.assert_allclose(where, points(ASKEW), rtol=0, atol=1e-12)
    assert (weight == 1).all()
    clock = ASKEW.scanner_clock
    npt.assert_allclose(
        when, (block["time"].values[:, None] + clock + delay).ravel(), rtol=0, atol=1e-12
    )
    for name, found in zip(NAMES, by, strict=True):
        ahead, behind = points(moved(ASKEW, name, STEP)), points(moved(ASKEW, name, -STEP))
        truth = (ahead - behind) / (2 * STEP)
        atol = SPEED if name == "clock" else SLOPE
        npt.assert_allclose(found, truth, rtol=0, atol=atol, err_msg=name)


def test_a_plane_is_exact_for_any_distribution_of_returns():
    """Heights and slopes of a tilted plane from scattered returns of a scanner that walks on."""
    rng = np.random.default_rng(2)
    # the scanner is carried along easting, 1 mm per scan, by a trajectory
    t = np.array([0.0, 1.0])
    trajectory = Trajectory(
        time=t, position=np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0]]),
        velocity=np.array([[1.0, 0, 0], [1.0, 0, 0]]), angular_velocity=np.zeros((2, 3)),
        quaternion=np.tile([0, 0, 0, 1.0], (2, 1)), covariance=np.zeros((2, 6, 6)),
        flag=np.zeros(2, np.uint8),
    )  # fmt: skip
    time = np.sort(rng.uniform(0.01, 0.99, 400))
    angle = np.sort(rng.uniform(-0.2, 0.2, 80))
    # up = 0.1 east + 0.05 north: 2 - r cos a = 0.1 t + 0.05 r sin a
    ranges = (2.0 - 0.1 * time[:, None]) / (np.cos(angle) + 0.05 * np.sin(angle))
    block = xr.Dataset(
        {
            "time": ("scan", time),
            "range": (("scan", "beam"), ranges),
            "angle": ("beam", angle),
            "delay": ("beam", np.zeros(80)),
        }
    )
    grid = PatchGrid.over((0.1, -0.25, 0.9, 0.25), 0.04)
    found = fit_patches([block], trajectory, Mounting(), grid, Screening(), 1.0)
    good = np.isfinite(found.height)
    assert good[2:-2, 2:-2].mean() > 0.9
    north, east = np.meshgrid(
        -0.25 + 0.04 * (np.arange(grid.shape[0]) + 0.5),
        0.1 + 0.04 * (np.arange(grid.shape[1]) + 0.5),
        indexing="ij",
    )
    npt.assert_allclose(found.height[good], (0.1 * east + 0.05 * north)[good], rtol=0, atol=LEVEL)
    npt.assert_allclose(found.slope[0][good], 0.1, rtol=0, atol=LEVEL)
    npt.assert_allclose(found.slope[1][good], 0.05, rtol=0, atol=LEVEL)
    clock = found.shift[NAMES.index("clock")]
    npt.assert_allclose(clock[0][good], 1.0, rtol=0, atol=LEVEL)  # [m/s] to the east


def test_beams_beyond_the_largest_angle_are_not_used():
    block = xr.Dataset(
        {
            "time": ("scan", [1.0]),
            "range": (("scan", "beam"), [[2.0, 2.0, 2.0]]),
            "angle": ("beam", [-0.6, 0.0, 0.6]),
            "delay": ("beam", np.zeros(3)),
        }
    )
    geometry = ScanGeometry(still(), Mounting(), block.angle, block.delay)
    found = _georeference_returns(geometry, block, Screening(), 0.5)
    assert found is not None
    npt.assert_allclose(found[0], [[0.0], [0.0], [0.0]], rtol=0, atol=1e-12)
    assert _georeference_returns(geometry, block, Screening(nearest=3.0), 0.5) is None
