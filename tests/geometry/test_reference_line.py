"""Reference lines: equal chords, gentle bends, and where they run."""

import numpy as np
import numpy.testing as npt
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError
from trueterrain.geometry.curve import polyline_curve
from trueterrain.geometry.reference_line import (
    ReferenceLine,
    line_from_trajectory,
    line_through,
    straight_line,
)
from trueterrain.motion import Trajectory
from trueterrain.surface.cells import grid_along, grid_over

CHORD = 1e-9  # [m] in which all chords are equally long; OpenCRG asks for 1e-4
ON_CIRCLE = 1e-6  # [m] of a spline through points of a circle 0.2 m apart


def chords(line):
    return np.hypot(np.diff(line.curve.easting), np.diff(line.curve.northing))


def circling(radius=20.0, speed=5.0, duration=6.0, noise=0.0):
    t = np.arange(0, duration, 0.01)
    yaw = speed * t / radius
    rng = np.random.default_rng(1)
    position = np.stack([radius * np.sin(yaw), radius * (1 - np.cos(yaw)), 0 * t], axis=1)
    velocity = speed * np.stack([np.cos(yaw), np.sin(yaw), 0 * t], axis=1)
    return Trajectory(
        time=t,
        position=position + noise * rng.standard_normal(position.shape),
        velocity=velocity,
        quaternion=Rotation.from_euler("Z", yaw[:, None]).as_quat(),
        angular_velocity=np.tile([0, 0, speed / radius], (t.size, 1)),
        covariance=np.zeros((t.size, 6, 6)),
        flag=np.zeros(t.size, np.uint8),
    )


def test_a_straight_line_is_straight():
    line = straight_line((2.0, 1.0), (5.0, 5.0), spacing=0.01)
    assert line.curve.s.size == 501
    npt.assert_allclose(chords(line), 0.01, rtol=0, atol=CHORD)
    npt.assert_allclose(
        [line.curve.easting[-1], line.curve.northing[-1]], [5, 5], rtol=0, atol=CHORD
    )


@pytest.mark.parametrize("spacing", [0.005, 0.1])
def test_chords_through_waypoints_are_equal_and_the_line_runs_through_them(spacing):
    angle = np.arange(0, 2, 0.01)
    x, y = 20 * np.cos(angle), 20 * np.sin(angle)
    line = line_through(x, y, spacing=spacing, elevation=3 * angle)
    npt.assert_allclose(chords(line), spacing, rtol=0, atol=CHORD)
    npt.assert_allclose(
        np.hypot(line.curve.easting, line.curve.northing), 20, rtol=0, atol=ON_CIRCLE
    )
    npt.assert_allclose(
        line.elevation, 3 * np.arctan2(line.curve.northing, line.curve.easting), rtol=0, atol=1e-6
    )
    npt.assert_array_equal(line.curve.s, np.round(np.arange(line.curve.s.size) * spacing, 3))
    assert line.curve.s[-1] <= 20 * angle[-1] < line.curve.s[-1] + 2 * spacing


def test_the_line_of_a_run_follows_its_scanner():
    lever = (-2.0, 0.5, 1.0)
    line = line_from_trajectory(circling(), lever=lever, smoothing=0.5, begin=1.0, end=5.0)
    radius = np.hypot(line.curve.easting, line.curve.northing - 20)
    inner = slice(300, -300)
    # smoothing over 0.5 m draws the line in by 0.5² / (2 R)
    npt.assert_allclose(radius[inner], np.hypot(19.5, 2.0), rtol=0, atol=0.5**2 / 20)
    npt.assert_allclose(chords(line), 0.01, rtol=0, atol=CHORD)


def test_noise_of_the_trajectory_makes_no_bends():
    line = line_from_trajectory(circling(noise=0.01), half_width=2.5)
    assert np.abs(line.curve.curvature).max() * 2.5 < 0.9
    npt.assert_allclose(chords(line), 0.01, rtol=0, atol=CHORD)


def test_a_sharp_corner_is_smoothed_until_the_grid_fits():
    x, y = np.r_[np.linspace(0, 20, 41), np.full(40, 20.0)], np.r_[np.zeros(41), np.arange(1, 41)]
    line = line_through(x, y, half_width=2.0)
    assert 0.3 < np.abs(line.curve.curvature).max() * 2.0 < 0.9
    assert grid_along(line).shape[1] == 401


def test_a_turn_on_the_spot_is_refused():
    easting = np.r_[np.linspace(0, 3, 31), np.linspace(3, 0, 31)[1:]]
    with pytest.raises(CoverageError, match="too sharp for a grid of 2 m"):
        line_through(easting, 1e-3 * np.arange(easting.size), half_width=2.0)


def test_a_body_at_rest_has_no_line():
    still = circling(speed=1e-3, noise=1e-3)
    with pytest.raises(CoverageError, match="does not move far enough"):
        line_from_trajectory(still)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: straight_line((0, 0), (0, 0)), "at least 0.01 m apart"),
        (lambda: straight_line((0, 0), (1, 0), spacing=0.0005), "multiple of 0.001 m"),
        (lambda: straight_line((0, 0), (1, 0), spacing=float("nan")), "multiple of 0.001 m"),
        (lambda: line_through([0], [0]), "at least 2, got 1"),
        (lambda: line_through([0, np.nan], [0, 0]), "finite"),
        (lambda: line_through([0, 0], [0, 0]), "at least 0.01 m apart"),
        (lambda: line_through([0, 1], [0, 0], smoothing=-1), "at least 0 m"),
        (lambda: line_from_trajectory(circling(), begin=3.0, end=2.0), "less than end"),
        (lambda: line_from_trajectory(circling(), begin=-3.0, end=2.0), "time must be from"),
        (lambda: grid_along(straight_line((0, 0), (1, 0)), right=1, left=-1), "less than left"),
        (lambda: grid_over(0, 0, 1, -1, spacing=1.0), "west, south, east, north"),
        (lambda: grid_over(0, 0, 1, 1, spacing=0.0), "greater than 0 m"),
        (lambda: grid_over(0, 0, 1e6, 1e6, spacing=0.001), "too large"),
        (
            lambda: ReferenceLine(
                curve=straight_line((0, 0), (1, 0)).curve.part(0, 1), elevation=np.zeros(1)
            ),
            "equally spaced, got one point",
        ),
        (
            lambda: ReferenceLine(
                curve=polyline_curve([0, 1, 3], [0, 0, 0]), elevation=np.zeros(3)
            ),
            "equally spaced, got 1 m to 2 m",
        ),
        (
            lambda: ReferenceLine(curve=straight_line((0, 0), (1, 0)).curve, elevation=np.zeros(2)),
            "finite value for each station",
        ),
    ],
)
def test_arguments_without_sense_are_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_a_grid_that_overlaps_itself_is_refused():
    angle = np.linspace(0, 1, 40)
    line = line_through(3 * np.cos(angle), 3 * np.sin(angle), half_width=0.0)
    with pytest.raises(ValueError, match="radius of 3 m"):
        grid_along(line, right=-2, left=3)


def test_nodes_are_whole_multiples_of_the_spacing_and_cover_what_was_asked():
    grid = grid_along(straight_line((0, 0), (1, 0)), right=-0.325, left=0.11, spacing=0.02)
    npt.assert_allclose(grid.v[[0, -1]], [-0.34, 0.12], rtol=0, atol=1e-12)
    grid = grid_over(0.26, -0.26, 1.24, 0.24, spacing=0.5)
    assert (grid.u.tolist(), grid.v.tolist()) == ([0.5, 1.0], [-0.5, 0.0])
