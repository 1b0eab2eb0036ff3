"""Tyres along paths: surfaces, maps and profiles, holes, ends, blocks, and a measured road."""

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import check_profile, make_points, make_profile, make_surface
from trueterrain.formats import opencrg
from trueterrain.profile import (
    Median,
    PlaneCurve,
    arc_path,
    offset_path,
    point_profile,
    straight_path,
    tyre_profile,
)
from trueterrain.profile.envelope import (
    LineLaser,
    PatchMean,
    RadialSpringTyre,
    RigidDisc,
    TandemCams,
    along,
    effective_road,
    tyre_envelope,
)
from trueterrain.roughness import MovingAverage, filter_profile

EXACT = 1e-12  # [m] round-off
SMALL = [
    RigidDisc(radius=0.1, width=0.06, lines=5),
    TandemCams(spacing=0.03, half_length=0.1, half_height=0.1, order=1.8, width=0.06, across=3),
    RadialSpringTyre(
        radius=0.1,
        width=0.06,
        load=100.0,
        rated_load=100.0,
        stiffness=2e4,
        contact_length=0.03,
        sections=3,
    ),
    LineLaser(width=0.06, spots=7),
    PatchMean(length=0.04, width=0.06, lines=3),
]
TYRE = pytest.mark.parametrize("tyre", SMALL, ids=lambda tyre: type(tyre).__name__)


def rough_road(seed=1, length=2.0, origin=(0.0, 0.0)):
    """Rough road to the east, 0.4 m wide at 10 mm."""
    u, v = np.arange(round(length / 0.01) + 1) * 0.01, np.arange(-20, 21) * 0.01
    height = np.random.default_rng(seed).normal(0, 0.003, (u.size, v.size))
    return make_surface(height, u=u, v=v, easting=origin[0] + u, northing=origin[1] + 0 * u)


@TYRE
def test_a_level_plane_gives_the_plane_anywhere(tyre):
    axis = np.arange(-40, 41) * 0.01
    plane = make_surface(
        np.full((81, 81), 312.5), easting=512_345 + axis, northing=5_512_345 + axis
    )
    bend = arc_path((512_345.0, 5_512_345.0), 0.2, 0.0, 3.0, spacing=0.01)
    rolled = tyre_envelope(plane, bend, tyre=tyre)
    check_profile(rolled)
    assert_allclose(rolled.height, 312.5, rtol=0, atol=1e-11)
    assert rolled.attrs["thin"] == rolled.attrs["held"] == 0
    assert_array_equal(rolled.easting, bend.easting)


@TYRE
def test_road_and_map_are_the_same_ground(tyre):
    road = rough_road()
    chart = make_surface(road.height.values.T, easting=road.u, northing=road.v)
    path = straight_path((0.3, -0.05), (1.7, 0.07), spacing=0.01)
    both = [tyre_envelope(ground, path, tyre=tyre) for ground in (road, chart)]
    assert_allclose(both[0].height, both[1].height, rtol=0, atol=1e-10)


@TYRE
def test_the_profile_does_not_depend_on_the_direction_of_travel(tyre):
    road = rough_road(seed=2)
    there = straight_path((0.3, 0.02), (1.7, 0.02), spacing=0.01)
    back = straight_path((1.7, 0.02), (0.3, 0.02), spacing=0.01)
    forward, backward = (effective_road(road, path, tyre=tyre) for path in (there, back))
    assert_allclose(forward.height, backward.height[::-1], rtol=0, atol=1e-9)
    for name in ("slope", "camber"):
        if name in forward:
            assert_allclose(forward[name], -backward[name][::-1], rtol=0, atol=1e-6)


@TYRE
def test_blocks_and_threads_change_nothing(tyre, monkeypatch):
    road = rough_road(seed=3)
    path = offset_path(road, 0.031, spacing=0.007)
    whole = effective_road(road, path, tyre=tyre)
    monkeypatch.setattr(along, "_SAMPLES", 40)  # from 5 to 13 path points
    try:
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        parts = effective_road(road, path, tyre=tyre)
    finally:
        numba.set_num_threads(1)
    for name in whole.data_vars:
        assert_array_equal(whole[name], parts[name])
    assert whole.attrs["held"] == parts.attrs["held"]


@TYRE
def test_the_ground_between_coarse_path_points_is_sampled(tyre):
    """Ground is sampled as finely as it is known, however far path points lie apart."""
    road = rough_road(seed=4)
    fine = tyre_envelope(road, straight_path((0.3, 0.0), (1.7, 0.0), spacing=0.01), tyre=tyre)
    coarse = tyre_envelope(road, straight_path((0.3, 0.0), (1.7, 0.0), spacing=0.1), tyre=tyre)
    assert_allclose(coarse.height, fine.height[::10], rtol=0, atol=1e-10)


def test_a_profile_is_ground_that_is_level_across():
    s = np.arange(301) * 0.01
    height = np.random.default_rng(5).normal(0, 0.003, (2, s.size))
    tracks = make_profile(s, height, tracks=["left", "right"])
    v = np.arange(-20, 21) * 0.01
    for tyre in SMALL:
        rolled = tyre_envelope(tracks, tyre=tyre)
        check_profile(rolled)
        for name, line in zip(("left", "right"), height, strict=True):
            road = make_surface(line[:, None] + 0 * v, u=s, v=v, easting=s, northing=0 * s)
            wide = tyre_envelope(road, offset_path(road, 0.0), tyre=tyre)
            if not isinstance(tyre, LineLaser):  # on one height per line it has no sd
                assert (
                    rolled.sel(track=name)["count"].max() * len(tyre.offsets) == wide["count"].max()
                )
            assert_allclose(rolled.height.sel(track=name), wide.height, rtol=0, atol=1e-10)


def test_the_patch_mean_of_a_line_is_the_moving_average():
    """Both are means of the straight lines between samples; at the ends they differ."""
    s = np.arange(401) * 0.01
    profile = make_profile(s, np.random.default_rng(6).normal(0, 0.003, s.size))
    wheel = tyre_envelope(profile, tyre=PatchMean(length=0.25, width=0)).height
    average = filter_profile(profile, MovingAverage(shortest=0.25)).height
    inner = (s > 0.2) & (s < 3.8)
    assert_allclose(wheel[inner], average[inner], rtol=0, atol=EXACT)


def test_a_line_laser_averages_a_window_of_ranks_across():
    road = rough_road(seed=7)
    path = offset_path(road, 0.0)
    laser = LineLaser(width=0.1, spots=11, skip=20, size=50)
    rolled = tyre_envelope(road, path, tyre=laser)
    heights = np.sort(road.height.values[:, 15:26], axis=1)
    # of 11 ranks, 2.2 are left out at the top and 5.5 are averaged: from rank 3.3 to 8.8
    expected = (0.7 * heights[:, 3] + heights[:, 4:8].sum(axis=1) + 0.8 * heights[:, 8]) / 5.5
    assert_allclose(rolled.height, expected, rtol=0, atol=EXACT)
    assert (rolled.sd > 0).all()
    assert (rolled["count"] == 11).all()


def holed(node):
    road = rough_road(seed=8)
    road.height.values[node] = np.nan
    return road


@TYRE
def test_a_hole_in_reach_is_an_error_nan_or_tolerated(tyre):
    road = holed((100, 20))
    path = straight_path((0.3, 0.0), (1.7, 0.0), spacing=0.01)
    with pytest.raises(CoverageError, match="too little ground under the tyre, the first at s = 0"):
        tyre_envelope(road, path, tyre=tyre)
    rolled = tyre_envelope(road, path, tyre=tyre, thin="nan")
    lost = np.isnan(rolled.height.values)
    assert rolled.attrs["thin"] == lost.sum()
    # bilinear ground is missing up to the next nodes beside the hole
    near = np.abs(path.easting - 1.0) < tyre.reach + 0.01 - 1e-9
    assert_array_equal(lost, near)
    tolerant = tyre_envelope(road, path, tyre=tyre, min_cover=0.5)
    assert np.isfinite(tolerant.height).all()
    assert_array_equal(tolerant.height[~lost], rolled.height[~lost])
    whole = tyre_envelope(rough_road(seed=8), path, tyre=tyre)
    assert abs(tolerant.height - whole.height).max() < 0.01  # what is missing touches nothing


def test_at_its_ends_the_ground_is_held():
    s = np.arange(101) * 0.01
    ramp = make_profile(s, np.where(s > 0.9, 0.1 * (s - 0.9), 0.0) + 1)
    disc = RigidDisc(radius=0.2)
    rolled = tyre_envelope(ramp, tyre=disc)
    longer = np.arange(141) * 0.01
    held = make_profile(longer, np.interp(longer, s, ramp.height))
    assert_allclose(
        rolled.height, tyre_envelope(held, tyre=disc).height[: s.size], rtol=0, atol=EXACT
    )
    assert rolled.attrs["held"] == 40
    road = rough_road()
    inside = straight_path((0.5, 0.0), (1.5, 0.0))
    assert tyre_envelope(road, inside, tyre=disc).attrs["held"] == 0
    # a path that ends on the ground is not held: there is ground ahead of it
    part = straight_path((0.5, 0.0), (1.95, 0.0))
    assert tyre_envelope(road, part, tyre=disc).attrs["held"] == 15


def test_paths_outside_of_the_ground_are_refused():
    road = rough_road()
    for start, end, says in [
        ((50.0, 50.0), (51.0, 50.0), "the path lies outside of the ground"),
        ((0.5, 0.19), (1.5, 0.19), "101 of 101 path points have too little ground"),
        ((0.5, 0.0), (2.5, 0.0), "path points have too little ground"),
    ]:
        with pytest.raises(CoverageError, match=says):
            tyre_envelope(road, straight_path(start, end))
    with pytest.raises(CoverageError, match="too little ground"):
        tyre_envelope(road, straight_path((0.5, 0.19), (1.5, 0.19)), thin="nan")  # all of them


def test_invalid_arguments_are_refused():
    s = np.arange(50) * 0.01
    profile, road = make_profile(s, 0 * s), rough_road()
    path = straight_path((0.5, 0.0), (1.5, 0.0))
    uneven = make_profile(np.append(s, 0.6), np.zeros(51))
    points = make_points(s, s, s)
    for ground in (points, iter([points])):
        with pytest.raises(CoverageError, match="scattered points have no height between them"):
            tyre_envelope(ground, path)
    with pytest.raises(CoverageError, match="the profile must be equally spaced"):
        tyre_envelope(uneven)
    with pytest.raises(CoverageError, match="at least 2 points"):
        tyre_envelope(make_profile([0.0], [0.0]))
    uneven = PlaneCurve(
        s=np.array([0.0, 0.1, 0.3]),
        easting=np.array([0.5, 0.6, 0.8]),
        northing=np.zeros(3),
        heading=np.zeros(3),
        length=0.3,
    )
    with pytest.raises(CoverageError, match="the path must be equally spaced"):
        tyre_envelope(road, uneven)
    with pytest.raises(ValueError, match="path must not be given with a profile"):
        tyre_envelope(profile, path)
    with pytest.raises(TypeError, match="path must be a PlaneCurve, after the ground, got None"):
        tyre_envelope(road)
    for bad, says in [
        ({"min_cover": 0.0}, "min_cover must be greater than 0 and at most 1"),
        ({"thin": "drop"}, "thin must be 'error' or 'nan'"),
        ({"step": 0.0}, "step must be greater than 0 m"),
    ]:
        with pytest.raises(ValueError, match=says):
            tyre_envelope(profile, **bad)


def test_ground_that_reaches_the_hub_is_refused():
    s = np.arange(-100, 101) * 0.01
    wall = make_profile(s, np.where(np.abs(s) < 0.005, 5.0, 0.0))
    weak = RadialSpringTyre(stiffness=4e4, rated_load=4000.0, load=20_000.0, contact_length=0.4)
    with pytest.raises(CoverageError, match="the tyre cannot carry its load at"):
        tyre_envelope(wall, tyre=weak)


def test_envelopes_of_the_measured_belgian_block_are_ordered(data):
    """What must hold of any road: no rigid wheel is below it, the wider the higher, and so on."""
    surface = opencrg.read(data / "opencrg" / "asam" / "belgian_block.crg")
    path = offset_path(surface, 0.3).part(100, 400)
    line = point_profile(surface, path).height
    disc = tyre_envelope(surface, path, tyre=RigidDisc(width=0.0)).height
    cylinder = tyre_envelope(surface, path).height
    assert (disc >= line - EXACT).all()
    assert (cylinder >= disc - EXACT).all()
    springs, cams, mean = (
        tyre_envelope(surface, path, tyre=tyre).height
        for tyre in (RadialSpringTyre(), TandemCams(), PatchMean())
    )
    median = tyre_profile(surface, path, statistic=Median()).height
    # blocks deflect a tyre, joints do not: it lies between the mean and the rigid wheel
    assert float((springs - mean).mean()) > 0 > float((springs - cylinder).mean())
    # and steps from block to block are spread over the patch
    of_line, of_median, of_springs, of_cams = (
        float(np.abs(np.diff(height)).max()) for height in (line, median, springs, cams)
    )
    assert max(of_springs, of_cams) < of_median < of_line
    assert np.corrcoef(springs, cams)[0, 1] > 0.95  # two models of one tyre
