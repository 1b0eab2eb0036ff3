"""Application of corrections to trajectories and points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from trueterrain.alignment import SplineCorrection, SplineKnots
from trueterrain.alignment.apply import (
    body_coordinates,
    corrected_points,
    corrected_trajectory,
    fixed_trajectory,
    trajectory_along,
)
from trueterrain.alignment.discontinuity.alignment import DiscontinuitySettings, correct_points
from trueterrain.alignment.discontinuity.reference_path import polar_reference, straight_reference
from trueterrain.alignment.discontinuity.result import PassAlignment, StationCorrection
from trueterrain.core.errors import SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_points
from trueterrain.motion import Trajectory

EXACT = 1e-9  # [m] round-off
HEIGHT = 1.8  # [m] of the body above the ground
RADIUS = 40.0  # [m] of the curve that is driven
SPEED = 8.0  # [m/s]
LEAN = 0.03  # [rad] by which the body rolls and pitches itself
TURN = 2e-3  # [rad] of corrections, at most
REACH = 4.0  # [m] to where the ground is looked at
#: [m] of heights: turns about axes that lean, with the cosine of the turn
SECOND = TURN * (LEAN * HEIGHT + LEAN**2 * REACH + TURN * (REACH + HEIGHT))


def driving(step=0.005, *, lean=0.0, covariance=None):
    """Left curve at constant speed, level or with a roll angle."""
    t = np.arange(0.0, 5.0 + step / 2, step)
    yaw = SPEED / RADIUS * t
    position = np.stack(
        [RADIUS * np.sin(yaw), RADIUS * (1 - np.cos(yaw)), np.full(t.size, HEIGHT)], axis=1
    )
    velocity = SPEED * np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    attitude = Rotation.from_euler("Z", yaw[:, None]) * Rotation.from_euler("YX", [lean, -lean])
    rate = attitude.inv().apply([0.0, 0.0, SPEED / RADIUS])
    own = np.zeros((6, 6)) if covariance is None else covariance
    return Trajectory(
        time=t,
        position=position,
        velocity=velocity,
        quaternion=attitude.as_quat(),
        angular_velocity=rate,
        covariance=np.tile(own, (t.size, 1, 1)),
        flag=np.zeros(t.size, np.uint8),
    )


def correction(*components, seed=1):
    """Smooth functions of time, with a covariance of its own in each interval."""
    rng = np.random.default_rng(seed)
    knots = SplineKnots(begin=-0.25, spacing=0.5, intervals=11)
    size = {"height": 0.012, "roll": TURN, "pitch": -TURN, "east": 0.02, "north": -0.01}
    k = len(components)
    wave = np.sin(knots.places[None, :] + np.arange(k)[:, None])
    root = rng.normal(0, 1e-3, (knots.intervals, 4 * k, 4 * k))
    return SplineCorrection(
        name="b",
        knots=knots,
        components=components,
        coefficients=np.array([size[name] for name in components])[:, None] * wave,
        offset=np.zeros(k),
        covariance=root @ root.transpose(0, 2, 1),
        residual_sd=5e-4,
        supported=np.ones(knots.intervals, bool),
    )


def seen(trajectory, time, arm):
    """Position of a point given in the body frame."""
    poses = trajectory.at(time)
    return poses.position + poses.rotation.apply(arm)


def body(trajectory):
    """Easting, northing and heading of the body at some times."""

    def path(time):
        poses = trajectory.at(time)
        longitudinal = poses.rotation.apply([1.0, 0.0, 0.0])
        return (
            poses.position[:, 0],
            poses.position[:, 1],
            np.arctan2(longitudinal[:, 1], longitudinal[:, 0]),
        )

    return path


def placed(trajectory, time, arm, **more):
    """The same as points."""
    x, y, z = seen(trajectory, time, arm).T
    return make_points(x, y, z, time=time, **more)


TIME = np.linspace(0.1, 4.9, 240)


@pytest.mark.parametrize("lean", [0.0, LEAN])
@pytest.mark.parametrize(
    ("components", "left", "longitudinal"),
    [
        (("height",), 2.0, 1.0),
        (("height", "roll"), 3.5, 0.0),
        (("height", "roll"), -3.5, 0.0),
        (("height", "pitch"), 0.0, 3.0),
        (("height", "roll", "pitch"), 2.0, -2.5),
    ],
)
def test_ground_rises_by_the_correction(components, left, longitudinal, lean):
    """By height, roll times left and pitch times forward, up to second order of the angles."""
    trajectory, one = driving(lean=lean), correction(*components)
    arm = np.array([longitudinal, left, -HEIGHT])
    before = placed(trajectory, TIME, arm)
    risen = seen(corrected_trajectory(trajectory, one), TIME, arm)[:, 2] - before.up.values
    v, u = body_coordinates(before, body(trajectory))
    said = one.height_at(TIME, v, u)
    assert np.ptp(said) > 5e-3  # [m] something is corrected
    # [m] heights alone are off by the motion between knots only
    assert_allclose(risen, said, rtol=0, atol=SECOND if len(components) > 1 else 1e-7)


@pytest.mark.parametrize("datum", [None, 0.0, 0.02])
def test_covariance_includes_a_known_datum(datum):
    before, one = driving(covariance=0.03**2 * np.eye(6)), correction("height", "roll")
    relative = corrected_trajectory(before, one).covariance
    after = corrected_trajectory(before, replace(one, datum_sd=datum))
    fixed = fixed_trajectory(before, datum)
    assert after.datum_sd == fixed.datum_sd == datum
    extra = after.covariance - relative
    assert_allclose(extra[:, 2, 2], (datum or 0.0) ** 2, rtol=0, atol=1e-15)
    extra[:, 2, 2] = 0.0
    assert_array_equal(extra, 0.0)
    assert_array_equal(fixed.covariance[:, 2, 2], (datum or 0.0) ** 2)
    assert_array_equal(fixed.covariance[:, 3:, 3:], before.covariance[:, 3:, 3:])
    assert fixed.between(1.0, 2.0).datum_sd == datum


def test_positive_roll_lifts_the_left_and_positive_pitch_the_front():
    """Positive roll lifts points to the left, positive pitch points ahead."""
    trajectory = driving()
    for name, arm in (("roll", [0, 2.0, -HEIGHT]), ("pitch", [2.0, 0, -HEIGHT])):
        one = correction("height", name)
        coefficients = np.zeros_like(one.coefficients)
        coefficients[1] = 1e-3
        one = SplineCorrection(**{**vars(one), "coefficients": coefficients})
        moved = corrected_trajectory(trajectory, one)
        rise = (seen(moved, TIME, arm) - seen(trajectory, TIME, arm))[:, 2]
        assert_allclose(rise, 2e-3, rtol=0, atol=2e-6)  # [m] second order: 1e-3² x 1.8 m


def test_horizontal_shifts_move_the_body():
    one = correction("height", "east", "north")
    moved = seen(corrected_trajectory(driving(), one), TIME, [0, 0, 0])
    by = (moved - seen(driving(), TIME, [0, 0, 0])).T
    for values, name in zip(by, ("east", "north", "height"), strict=True):
        assert_allclose(values, one(TIME, name), rtol=0, atol=1e-7)  # [m] between knots


def test_velocity_and_angular_velocity_include_the_correction():
    """Interpolated poses between epochs of 10 Hz include the correction."""
    one, step = correction("height", "roll", "pitch"), 0.1
    coarse = corrected_trajectory(driving(step), one).at(TIME)
    truth = driving(0.005).at(TIME)
    turn = np.stack([one(TIME, "roll"), -one(TIME, "pitch"), 0 * TIME], axis=1)
    wrong = (coarse.rotation.inv() * (truth.rotation * Rotation.from_rotvec(turn))).as_rotvec()
    # [rad] third derivatives of splines with knots of 0.5 s; with the old rates it were 1.6e-5
    assert np.abs(wrong).max() < 1e-6
    height = truth.position[:, 2] + one(TIME)
    assert_allclose(coarse.position[:, 2], height, rtol=0, atol=1e-6)  # [m] the same


@pytest.mark.parametrize(
    "components",
    [("height",), ("height", "roll"), ("height", "roll", "pitch"), ("height", "east", "north")],
)
def test_sd_of_heights_is_that_of_the_correction(components):
    """For any reported sd, and any position relative to the body."""
    own = np.diag([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])  # [m²] nothing that turns
    trajectory = corrected_trajectory(driving(covariance=own), one := correction(*components))
    t, k = trajectory.time, slice(None, None, 50)
    _, _, heading = body(trajectory)(t)
    for left, longitudinal in ((0.0, 0.0), (3.0, 0.0), (-3.0, 2.0)):
        east = longitudinal * np.cos(heading) - left * np.sin(heading)
        north = longitudinal * np.sin(heading) + left * np.cos(heading)
        none = np.zeros(t.size)
        # how the height changes with place and turns of the body
        row = np.stack([none, none, none + 1, north, -east, none], axis=1)
        sd = np.sqrt(np.einsum("ni,nij,nj->n", row, trajectory.covariance, row))
        assert_allclose(sd[k], one.sd(t, left, longitudinal)[k], rtol=0, atol=1e-8)  # [m]


def test_uncorrected_components_keep_their_covariance():
    rng = np.random.default_rng(2)
    root = rng.normal(0, 1e-2, (6, 6))
    before = driving(covariance=root @ root.T)
    after = corrected_trajectory(before, correction("height", "roll")).covariance
    for axes in ([0, 1], [5]):
        kept = np.ix_(range(len(after)), axes, axes)
        assert_allclose(after[kept], before.covariance[kept], rtol=0, atol=1e-15)
    assert_array_equal(after[:, 2, :2], 0.0)  # the navigation's height is no more
    assert_allclose(after, after.transpose(0, 2, 1), rtol=0, atol=1e-18)
    assert np.linalg.eigvalsh(after).min() > -1e-12
    # at its begin the body looks to the east: its pitch is a turn about north
    assert_allclose(after[0, 4, 4], before.covariance[0, 4, 4], rtol=0, atol=1e-15)


def test_points_and_trajectory_get_the_same_correction():
    """Heights up to second order; a rotated body also moves the ground below it sideways."""
    trajectory = driving(lean=LEAN)
    one = correction("height", "roll", "pitch", "east", "north")
    for arm in ([0.0, 3.0, -HEIGHT], [2.0, -3.0, -HEIGHT]):
        moved = corrected_points(placed(trajectory, TIME, arm), one, body(trajectory))
        truth = seen(corrected_trajectory(trajectory, one), TIME, arm)
        assert_allclose(moved.up, truth[:, 2], rtol=0, atol=SECOND)
        lateral = np.hypot(moved.easting - truth[:, 0], moved.northing - truth[:, 1])
        # [m] by roll and pitch; and across by the lean of the body
        assert lateral.max() < np.sqrt(2) * TURN * (HEIGHT + LEAN * REACH) * 1.1


def test_blocks_of_points_give_the_same_result():
    trajectory, one = driving(), correction("height", "roll")
    points = placed(trajectory, TIME, [0.0, 3.0, -HEIGHT])
    whole = corrected_points(points, one, body(trajectory))
    parts = [
        corrected_points(points.isel(point=slice(k, k + 37)), one, body(trajectory))
        for k in range(0, TIME.size, 37)
    ]
    for name in ("easting", "northing", "up", "sd_relative"):
        assert_array_equal(np.concatenate([part[name] for part in parts]), whole[name])


def test_points_combine_the_sd_of_the_correction_with_their_own():
    trajectory, one = driving(), correction("height", "roll")
    arm, own = [0.0, 3.0, -HEIGHT], np.full(TIME.size, 0.004)
    plain, known = (
        corrected_points(placed(trajectory, TIME, arm, **more), one, body(trajectory))
        for more in ({}, {"sd": own})
    )
    # [m] offset by the trajectory
    assert_allclose(plain.sd_relative, one.sd(TIME, 3.0), rtol=0, atol=1e-8)
    assert "sd" not in plain  # nothing says how sure the datum is
    assert_array_equal(known.sd_relative, plain.sd_relative)
    assert_allclose(known.sd, np.hypot(plain.sd_relative, 0.004), rtol=0, atol=EXACT)
    sure = replace(one, datum_sd=0.003)
    absolute = corrected_points(placed(trajectory, TIME, arm), sure, body(trajectory))
    assert_allclose(absolute.sd, np.hypot(plain.sd_relative, 0.003), rtol=0, atol=EXACT)
    assert plain.sd_relative.attrs == {"units": "m"}
    assert plain.up.attrs == {"units": "m"}
    (step,) = provenance_steps(plain)
    assert step["parameters"] == {
        "method": "network",
        "lane": "b",
        "components": ["height", "roll"],
    }


def test_missing_time_and_path_are_errors():
    points = placed(driving(), TIME, [0.0, 3.0, -HEIGHT])
    with pytest.raises(SchemaError, match=r"variable time: is missing.*discontinuity"):
        corrected_points(points.drop_vars("time"), correction("height"))
    with pytest.raises(ValueError, match="path is needed, since the correction holds roll"):
        corrected_points(points, correction("height", "roll"))
    corrected_points(points, correction("height", "east", "north"))  # which need none


def alignment(path, height):
    """Correction of one of two passes along a path; the other is fixed."""
    one = StationCorrection(path=path, height=height, begin=0.0, end=path.curve.length)
    return PassAlignment(
        settings=DiscontinuitySettings(),
        names=("a", "b"),
        pairs=(),
        corrections={"b": one},
        states=(),
        left_out={},
    )


@pytest.mark.parametrize("bent", [False, True])
def test_runs_and_points_are_corrected_by_the_same_station(bent):
    """Ground lateral to the scanner has its station, so both get the same correction."""
    trajectory = driving()
    path = polar_reference((0.0, RADIUS), RADIUS, spacing=0.25, start_angle=-0.6 * np.pi)
    if not bent:
        straight = np.stack([SPEED * trajectory.time, 0 * trajectory.time], axis=1)
        trajectory = Trajectory(
            **{
                **vars(trajectory),
                "position": np.column_stack([straight, trajectory.position[:, 2]]),
                "velocity": np.tile([SPEED, 0.0, 0.0], (trajectory.time.size, 1)),
                "quaternion": np.tile([0.0, 0.0, 0.0, 1.0], (trajectory.time.size, 1)),
                "angular_velocity": np.zeros((trajectory.time.size, 3)),
            }
        )
        path = straight_reference((-5.0, 1.0), (50.0, 1.0))
    height = 0.01 * np.sin(path.curve.s / 4.0)
    found = alignment(path, height)
    moved = trajectory_along(trajectory, found, "b")
    at = path.locate(trajectory.position[:, 0], trajectory.position[:, 1]).station
    lowered = trajectory.position[:, 2] - moved.position[:, 2]
    assert_allclose(lowered, np.interp(at, path.curve.s, height), rtol=0, atol=EXACT)
    assert np.ptp(lowered) > 0.015  # [m]
    for left in (2.0, -2.0):
        arm = [0.0, left, -HEIGHT]
        points = correct_points(placed(trajectory, TIME, arm), found, "b")
        # [m] straight pieces between reference points have corners, motion has none
        assert_allclose(points.up, seen(moved, TIME, arm)[:, 2], rtol=0, atol=2e-6)
    longitudinal = [2.0, 0.0, -HEIGHT]
    apart = (
        correct_points(placed(trajectory, TIME, longitudinal), found, "b").up
        - seen(moved, TIME, longitudinal)[:, 2]
    )
    assert np.abs(apart).max() < 2.0 * 0.01 / 4.0 * 1.05  # [m] 2 m ahead, by the steepest change


def test_velocity_along_a_path_is_the_derivative_of_the_height():
    trajectory = driving()
    path = polar_reference((0.0, RADIUS), RADIUS, start_angle=-0.6 * np.pi)
    moved = trajectory_along(trajectory, alignment(path, 0.01 * np.sin(path.curve.s / 4.0)), "b")
    slope = np.gradient(moved.position[:, 2], moved.time)
    assert_allclose(moved.velocity[:, 2], slope, rtol=0, atol=EXACT)
    for name in ("time", "quaternion", "angular_velocity", "covariance", "flag"):
        assert_array_equal(getattr(moved, name), getattr(trajectory, name))
    assert_array_equal(moved.position[:, :2], trajectory.position[:, :2])


def test_a_fixed_pass_keeps_its_trajectory():
    trajectory = driving()
    path = straight_reference((-5.0, 1.0), (50.0, 1.0))
    found = alignment(path, np.ones(path.curve.s.size))
    assert_array_equal(trajectory_along(trajectory, found, "a").position, trajectory.position)
    with pytest.raises(ValueError, match="name must be one of a, b, got 'c'"):
        trajectory_along(trajectory, found, "c")


def test_body_coordinates_are_left_and_forward_positive():
    points = make_points([3.0, 10.0], [4.0, 1.0], [0.0, 0.0], time=[0.0, 1.0])
    north = np.array([np.pi / 2, np.pi / 2])
    offset, longitudinal = body_coordinates(
        points, lambda t: (np.array([5.0, 5.0]), np.array([1.0, 1.0]), north)
    )
    assert_allclose(offset, [2.0, -5.0], rtol=0, atol=EXACT)
    assert_allclose(longitudinal, [3.0, 0.0], rtol=0, atol=EXACT)
