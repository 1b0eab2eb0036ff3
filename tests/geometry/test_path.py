"""Paths: points at equal arc length in any direction; headings; errors."""

import time
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator
from scipy.special import fresnel

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_surface
from trueterrain.profile import (
    PlaneCurve,
    arc_path,
    curve_path,
    function_path,
    offset_path,
    polyline_path,
    straight_path,
    waypoint_path,
)
from trueterrain.surface import node_coordinates

SPACING_PART = 1e-6  # of the spacing: what the module promises for the arc length of every step
ROUND_OFF = 1e-9  # [m] of coordinates up to a few kilometres after a few thousand operations
DIRECTION = 1e-5  # [rad] a spline that misses the curve by 1e-7 of the spacing turns by less
UTM_ROUND_OFF = 5e-9  # [m] five steps of a float64 near 5.5e6 m: coordinates cannot do better


def arc_lengths(velocity, t, breaks=()):
    """Arc length between successive parameters, by adaptive quadrature."""

    def speed(at):
        return np.hypot(*np.ravel(velocity(at)))

    lengths = []
    for begin, end in pairwise(t):
        inner = [b for b in breaks if begin < b < end] or None
        lengths.append(quad(speed, begin, end, points=inner, epsabs=1e-12, epsrel=1e-12)[0])
    return np.array(lengths)


def locate(path, position, velocity, start, end):
    """Parameters of the path points: those nearest to them on the curve, and the distance left."""
    dense = np.linspace(start, end, 40_001)
    cumulative = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(position(dense), axis=0).T))])
    t = np.interp(path.s, cumulative, dense)
    at = np.stack([path.easting, path.northing], axis=1)
    for _ in range(20):
        v = velocity(t)
        along, square = ((at - position(t)) * v).sum(axis=1), (v * v).sum(axis=1)
        t = np.clip(t + along / np.where(square > 1e-9, square, np.inf), dense.min(), dense.max())
    return t, np.hypot(*(at - position(t)).T)


def check_walk(path, position, velocity, start, end, spacing, breaks=()):
    """Every step has the arc length of the spacing, on the curve, along its direction."""
    t, off = locate(path, position, velocity, start, end)
    assert_allclose(off, 0, rtol=0, atol=max(SPACING_PART * spacing, ROUND_OFF))
    ordered = t if end > start else -t
    along = velocity if end > start else (lambda at: velocity(-at))
    edges = breaks if end > start else [-b for b in breaks]
    steps = arc_lengths(along, ordered, edges)
    assert_allclose(steps, spacing, rtol=0, atol=SPACING_PART * spacing)
    v = velocity(t) * np.sign(end - start)
    true = np.arctan2(v[:, 1], v[:, 0])
    assert_allclose(np.sin(path.heading - true), 0, rtol=0, atol=DIRECTION)
    assert (np.cos(path.heading - true) > 0).all()
    assert_allclose(path.s, spacing * np.arange(len(path)), rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("end", [(3.0, 4.0), (-3.0, 4.0), (0.0, -5.0), (-5.0, 0.0), (3.0, -4.0)])
def test_a_line_has_points_at_equal_arc_length_in_any_direction(end):
    path = straight_path((1.0, 2.0), (1.0 + end[0], 2.0 + end[1]), spacing=0.01)
    assert len(path) == 501
    assert path.length == pytest.approx(5.0, abs=1e-12)
    steps = np.hypot(np.diff(path.easting), np.diff(path.northing))
    assert_allclose(steps, 0.01, rtol=0, atol=SPACING_PART * 0.01)
    assert_allclose(path.heading, np.arctan2(end[1], end[0]), rtol=0, atol=1e-12)
    assert path.easting[-1] == pytest.approx(1.0 + end[0], abs=1e-12)


def test_the_remainder_of_a_path_is_shorter_than_the_spacing_and_kept_in_its_length():
    path = straight_path((0, 0), (1.05, 0), spacing=0.1)
    assert (len(path), path.length) == (11, 1.05)
    assert 0 <= path.length - path.s[-1] < 0.1


def test_round_off_of_the_length_does_not_lose_the_last_point():
    assert len(straight_path((0, 0), (0.3, 0), spacing=0.1)) == 4  # 0.3 / 0.1 < 3 in float64
    assert len(straight_path((0, 0), (100.0, 0), spacing=0.01)) == 10_001


@pytest.mark.parametrize("turn", [1.0, -1.0, 12.0, -7.0])
def test_an_arc_has_points_at_equal_arc_length_to_either_side_and_over_a_turn(turn):
    path = arc_path((10.0, -4.0), 7.0, 0.5, 0.5 + turn, spacing=0.05)
    angle = np.unwrap(np.arctan2(path.northing + 4.0, path.easting - 10.0))
    assert_allclose(7.0 * np.abs(np.diff(angle)), 0.05, rtol=0, atol=SPACING_PART * 0.05)
    assert path.length == pytest.approx(7.0 * abs(turn), abs=1e-12)
    steps = np.stack([np.diff(path.easting), np.diff(path.northing)])
    centre = 0.5 * (path.heading[1:] + path.heading[:-1])
    assert_allclose(np.cos(np.arctan2(steps[1], steps[0]) - centre), 1, rtol=0, atol=1e-12)


FUNCTIONS = {
    "sine": (np.sin, np.cos, 0.0, 7.0),
    "falling": (lambda x: -(x**3) / 9, lambda x: -(x**2) / 3, -2.0, 2.0),
    "steep": (lambda x: 5 * np.tanh(20 * x), lambda x: 100 / np.cosh(20 * x) ** 2, -1.0, 1.0),
    "whole periods": (
        lambda x: 0.1 * np.sin(2 * np.pi * x),
        lambda x: 0.2 * np.pi * np.cos(2 * np.pi * x),
        0.0,
        8.0,
    ),
}


@pytest.mark.parametrize("westward", [False, True])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_has_points_at_equal_arc_length(name, westward):
    function, slope, start, end = FUNCTIONS[name]
    if westward:
        start, end = end, start
    path = function_path(function, start, end, spacing=0.02)
    # on the graph of a function the easting is the parameter: nothing has to be located
    assert_allclose(path.northing, function(path.easting), rtol=0, atol=SPACING_PART * 0.02)
    sign = np.sign(end - start)
    steps = [
        sign * quad(lambda x: np.hypot(1, slope(x)), a, b, epsabs=1e-13, epsrel=1e-12)[0]
        for a, b in pairwise(path.easting)
    ]
    assert_allclose(steps, 0.02, rtol=0, atol=SPACING_PART * 0.02)
    true = np.arctan2(sign * slope(path.easting), sign)
    assert_allclose(np.sin(path.heading - true), 0, rtol=0, atol=1e-5)  # steep: bends of 0.1 mm
    assert (np.cos(path.heading - true) > 0).all()
    assert path.easting[0] == pytest.approx(start, abs=ROUND_OFF)


def test_a_sine_that_passes_every_sample_at_zero_is_no_straight_line():
    """64 whole waves: samples at 2^k equal distances all lie on the zero line."""
    for end in (64.0, 128.0):
        path = function_path(lambda x: 0.1 * np.sin(2 * np.pi * x), 0.0, end, spacing=0.01)
        wave = quad(lambda x: np.hypot(1, 0.2 * np.pi * np.cos(2 * np.pi * x)), 0, 1)[0]
        assert path.length == pytest.approx(end * wave, abs=1e-6)


def test_a_single_bump_between_coarse_samples_is_followed():
    """0.3 m wide on a path of 200 m: between two of the first samples, which are 3 m apart."""

    def bump(x):
        return 0.2 * np.exp(-(((x - 101.4) / 0.15) ** 2))

    path = function_path(bump, 0.0, 200.0, spacing=0.01)
    assert path.northing.max() == pytest.approx(0.2, abs=1e-3)  # a path point is 5 mm off at most


CURVES = {
    "circle": (
        lambda t: np.stack([3 * np.cos(t), 3 * np.sin(t)], axis=-1),
        lambda t: np.stack([-3 * np.sin(t), 3 * np.cos(t)], axis=-1),
        2 * np.pi,
    ),
    "figure eight": (
        lambda t: np.stack([2 * np.sin(t), np.sin(2 * t)], axis=-1),
        lambda t: np.stack([2 * np.cos(t), 2 * np.cos(2 * t)], axis=-1),
        2 * np.pi,
    ),
    "clothoid": (
        lambda t: np.stack(fresnel(t)[::-1], axis=-1),
        lambda t: np.stack([np.cos(np.pi / 2 * t**2), np.sin(np.pi / 2 * t**2)], axis=-1),
        2.5,
    ),
}


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize("name", CURVES)
def test_a_parametric_curve_has_points_at_equal_arc_length(name, backward):
    position, velocity, end = CURVES[name]
    start, end = (end, 0.0) if backward else (0.0, end)
    path = curve_path(position, start, end, spacing=0.02)
    check_walk(path, position, velocity, start, end, 0.02)


def test_lengths_of_known_curves():
    circle, _, turn = CURVES["circle"]
    assert curve_path(circle, 0, turn).length == pytest.approx(6 * np.pi, abs=1e-7)
    clothoid, _, end = CURVES["clothoid"]
    assert curve_path(clothoid, 0, end).length == pytest.approx(2.5, abs=1e-7)

    def cycloid(t):  # its speed falls to 0 at the cusp in its centre
        return np.stack([t - np.sin(t), 1 - np.cos(t)], axis=-1)

    assert curve_path(cycloid, 0, 4 * np.pi).length == pytest.approx(16, abs=1e-6)


def test_curves_work_in_coordinates_of_thousands_of_kilometres():
    centre = np.array([5e5, 5.5e6])

    def circle(t):
        return centre + 50 * np.stack([np.cos(t), np.sin(t)], axis=-1)

    path = curve_path(circle, 0.0, 6.0, spacing=0.001)
    x, y = path.easting - centre[0], path.northing - centre[1]
    assert_allclose(np.hypot(x, y), 50, rtol=0, atol=UTM_ROUND_OFF)
    steps = 50 * np.diff(np.unwrap(np.arctan2(y, x)))
    assert_allclose(steps, 0.001, rtol=0, atol=UTM_ROUND_OFF)


@pytest.mark.slow
def test_a_curve_with_a_corner_or_a_jump_is_refused_with_the_cure():
    with pytest.raises(ValueError, match=r"not smooth enough .* Give its corners as waypoints"):
        function_path(lambda x: np.abs(x - 0.3), 0.0, 1.0)
    with pytest.raises(ValueError, match="must return finite"):
        function_path(lambda x: np.where(x > 0.5, np.nan, x), 0.0, 1.0)
    with pytest.raises(ValueError, match="shape"):
        curve_path(lambda t: np.zeros((3, 2)), 0.0, 1.0)


LOOP = np.array([[0, 0], [4, 0], [6, 2], [4, 4], [2, 2], [4, 0.5], [8, 0.2]], float)
SQUARE = np.array([[0, 0], [0, 3], [0, 5], [2, 5], [2, 1], [2, 0]], float)
SPIRAL = np.stack([np.arange(40) * 0.1] * 2, axis=1) * np.stack(
    [np.cos(np.arange(40) * 0.4), np.sin(np.arange(40) * 0.4)], axis=1
)
WAYPOINTS = {"loop": LOOP, "vertical": SQUARE, "spiral": SPIRAL, "two": LOOP[:2]}


def pchip_of(points):
    chords = np.hypot(*np.diff(points, axis=0).T)
    knots = np.concatenate([[0], np.cumsum(chords)])
    curve = PchipInterpolator(knots, points)
    return curve, curve.derivative(), knots


@pytest.mark.parametrize("name", WAYPOINTS)
def test_waypoints_are_joined_by_pchip_over_the_chord_length(name):
    points = WAYPOINTS[name]
    curve, velocity, knots = pchip_of(points)
    path = waypoint_path(*points.T, spacing=0.03)
    assert path.length == pytest.approx(arc_lengths(velocity, knots).sum(), abs=1e-8)
    inner = np.hypot(*velocity(locate(path, curve, velocity, 0, knots[-1])[0]).T) > 1e-3
    assert inner.mean() > 0.95
    t, off = locate(path, curve, velocity, 0, knots[-1])
    assert_allclose(off, 0, rtol=0, atol=SPACING_PART * 0.03)
    steps = arc_lengths(velocity, t, knots)
    both = inner[1:] & inner[:-1]  # where the curve halts, a nearest parameter is not sharp
    assert_allclose(steps[both], 0.03, rtol=0, atol=SPACING_PART * 0.03)
    v = velocity(t)[inner]
    assert_allclose(
        np.sin(path.heading[inner] - np.arctan2(v[:, 1], v[:, 0])), 0, rtol=0, atol=DIRECTION
    )


@pytest.mark.parametrize("direction", [0.0, 0.7, np.pi / 2, np.pi, -2.0])
def test_a_hairpin_is_followed_in_both_directions(direction):
    """Out 3 m and straight back: PCHIP stands still at the turn, the steps do not."""
    ahead = np.array([np.cos(direction), np.sin(direction)])
    out = np.array([0.0, 1.0, 3.0, 1.5, 0.0])[:, None] * ahead
    path = waypoint_path(*out.T, spacing=0.1)
    assert path.length == pytest.approx(6.0, abs=1e-9)
    along = path.easting * ahead[0] + path.northing * ahead[1]
    true = 3 - np.abs(3 - path.s)
    assert_allclose(along, true, rtol=0, atol=SPACING_PART * 0.1)
    across = path.northing * ahead[0] - path.easting * ahead[1]
    assert_allclose(across, 0, rtol=0, atol=ROUND_OFF)
    turn = np.isclose(path.s, 3.0)  # there both directions are right, and no other
    forth = np.where(path.s < 3, 1, -1)
    cosine = np.cos(path.heading - direction)
    assert_allclose(cosine[~turn], forth[~turn], rtol=0, atol=1e-9)
    assert_allclose(np.abs(cosine[turn]), 1, rtol=0, atol=1e-9)


def test_repeated_waypoints_count_once():
    once = waypoint_path(*LOOP.T, spacing=0.05)
    often = waypoint_path(*np.repeat(LOOP, [1, 3, 1, 2, 1, 1, 4], axis=0).T, spacing=0.05)
    for name in ("easting", "northing", "heading"):
        np.testing.assert_array_equal(getattr(once, name), getattr(often, name))


def test_waypoints_closer_than_round_off_count_once():
    path = waypoint_path([0.0, 5000.0, 5000.0, 9000.0], [0.0, 0.0, 1e-17, 0.0], spacing=10.0)
    assert len(path) == 901


def test_hundreds_of_thousands_of_waypoints_in_seconds():
    """300,000 waypoints of a circle of 5 km radius: 3 million points."""
    angle = np.linspace(0, 6.0, 300_000)
    begin = time.perf_counter()
    path = waypoint_path(5000 * np.cos(angle), 5000 * np.sin(angle), spacing=0.1)
    assert time.perf_counter() - begin < 20  # 0.5 s measured; a shared machine may be slow
    # a chord of 0.1 m lies 0.25 um off the circle, so that its length and the circle's agree
    assert path.length == pytest.approx(30_000, abs=1e-3)
    steps = np.hypot(np.diff(path.easting), np.diff(path.northing))
    assert_allclose(steps, 0.1, rtol=0, atol=SPACING_PART * 0.1)


def test_waypoints_in_coordinates_of_thousands_of_kilometres_give_the_same_path():
    near = waypoint_path(*LOOP.T, spacing=0.01)
    far = waypoint_path(LOOP[:, 0] + 5e5, LOOP[:, 1] + 5.5e6, spacing=0.01)
    assert_allclose(far.easting - 5e5, near.easting, rtol=0, atol=UTM_ROUND_OFF)
    assert_allclose(far.northing - 5.5e6, near.northing, rtol=0, atol=UTM_ROUND_OFF)


def test_a_polyline_is_followed_along_its_chords():
    path = polyline_path([0, 3, 3, 3, 0], [0, 4, 4, 10, 10], spacing=0.5)
    assert path.length == 14.0
    corner = path.s <= 5
    assert_allclose(path.northing[corner], 0.8 * path.s[corner], rtol=0, atol=1e-12)
    assert_allclose(path.easting[~corner & (path.s <= 11)], 3, rtol=0, atol=1e-12)
    assert_allclose(path.heading[path.s < 5], np.arctan2(4, 3), rtol=0, atol=1e-12)
    assert_allclose(path.heading[(path.s >= 5) & (path.s < 11)], np.pi / 2, rtol=0, atol=1e-12)
    assert_allclose(path.heading[path.s >= 11], np.pi, rtol=0, atol=1e-12)


def test_a_polyline_that_ends_in_repeated_nodes_keeps_its_heading():
    path = polyline_path([0, 0, 0], [0, 1, 1], spacing=0.5)
    assert_allclose(path.heading, np.pi / 2, rtol=0, atol=1e-12)


def circle_road(radius, turn, width=2.0, nodes=2001):
    """Road along an arc around the origin, counter-clockwise from east; left is inside."""
    angle = np.linspace(0, turn, nodes)
    v = np.linspace(-width, width, 9)
    return make_surface(
        np.zeros((nodes, v.size)),
        u=radius * angle,
        v=v,
        easting=radius * np.cos(angle),
        northing=radius * np.sin(angle),
    )


@pytest.mark.parametrize("offset", [-2.0, -0.3, 0.0, 0.7, 2.0])
def test_an_offset_in_a_bend_has_the_arc_length_of_its_own_radius(offset):
    radius, turn, chords = 20.0, 1.5, 2000
    path = offset_path(circle_road(radius, turn), offset, spacing=0.01)
    # the road turns at the nodes between its chords, by turn / chords each: exact for a polyline
    corner = turn / chords
    true = chords * 2 * radius * np.sin(corner / 2) - offset * (chords - 1) * 2 * np.tan(corner / 2)
    assert path.length == pytest.approx(true, abs=ROUND_OFF)
    # and that of the circle but for the half corners that both ends lack
    assert path.length == pytest.approx((radius - offset) * turn, abs=abs(offset) * corner + 1e-6)
    assert_allclose(
        np.hypot(path.easting, path.northing), radius - offset, rtol=0, atol=2e-6
    )  # sagitta of a chord of 15 mm: 1.4e-6 m
    steps = np.hypot(np.diff(path.easting), np.diff(path.northing))
    assert_allclose(steps, 0.01, rtol=0, atol=SPACING_PART * 0.01)


def test_an_offset_in_a_straight_road_is_the_parallel_to_its_left():
    s = np.linspace(0, 10, 101)
    road = make_surface(np.zeros((101, 3)), u=s, v=[-1, 0, 1], easting=0.6 * s, northing=0.8 * s)
    path = offset_path(road, 0.5, spacing=0.25)
    assert_allclose(path.easting, 0.6 * path.s - 0.4, rtol=0, atol=ROUND_OFF)
    assert_allclose(path.northing, 0.8 * path.s + 0.3, rtol=0, atol=ROUND_OFF)
    assert len(path) == 41


def test_the_offset_of_a_node_column_runs_through_its_nodes():
    road = circle_road(5.0, 2.0, nodes=401)
    easting, northing = node_coordinates(road)
    path = offset_path(road, float(road.v[2]), spacing=0.001)
    at = np.concatenate([[0], np.cumsum(np.hypot(np.diff(easting[:, 2]), np.diff(northing[:, 2])))])
    assert_allclose(np.interp(path.s, at, easting[:, 2]), path.easting, rtol=0, atol=ROUND_OFF)


def test_an_offset_on_the_edge_is_not_lost_to_round_off():
    v = -1.5 + 0.3 * np.arange(11)
    v[-1] = np.nextafter(1.5, 0)  # what a user calls the edge lies just outside
    road = make_surface(np.zeros((2, v.size)), u=[0, 1], v=v, easting=[0, 1], northing=[0, 0])
    assert offset_path(road, 1.5, spacing=0.5).northing[0] == 1.5


@pytest.mark.parametrize("offset", [1.001, -1.001, np.nan, np.inf])
def test_an_offset_outside_of_the_surface_names_its_range(offset):
    road = make_surface(np.zeros((2, 2)), u=[0, 1], v=[-1, 1], easting=[0, 1], northing=[0, 0])
    with pytest.raises(CoverageError, match=r"outside .* from v = -1 m to 1 m\. Choose"):
        offset_path(road, offset)


def test_a_map_has_no_offset():
    with pytest.raises(CoverageError, match="needs a reference line"):
        offset_path(make_surface(np.zeros((2, 2)), easting=[0, 1], northing=[0, 1]), 0.0)


MAKERS = {
    "straight": lambda spacing: straight_path((0, 0), (1, 0), spacing=spacing),
    "arc": lambda spacing: arc_path((0, 0), 1, 0, 1, spacing=spacing),
    "function": lambda spacing: function_path(np.sin, 0, 1, spacing=spacing),
    "curve": lambda spacing: curve_path(CURVES["circle"][0], 0, 0.3, spacing=spacing),
    "waypoints": lambda spacing: waypoint_path([0, 1], [0, 0], spacing=spacing),
    "polyline": lambda spacing: polyline_path([0, 1], [0, 0], spacing=spacing),
    "offset": lambda spacing: offset_path(circle_road(5, 0.2), 0.0, spacing=spacing),
}


@pytest.mark.parametrize("spacing", [0.0, -0.01, np.nan, np.inf])
@pytest.mark.parametrize("name", MAKERS)
def test_a_spacing_must_be_greater_than_zero(name, spacing):
    with pytest.raises(ValueError, match=r"spacing must be greater than 0 m, got"):
        MAKERS[name](spacing)


@pytest.mark.parametrize("name", MAKERS)
def test_a_path_shorter_than_its_spacing_is_refused(name):
    with pytest.raises(ValueError, match=r"shorter than the spacing of 5 m"):
        MAKERS[name](5.0)


@pytest.mark.parametrize("make", [waypoint_path, polyline_path])
def test_a_waypoint_that_is_not_finite_is_named_by_its_index(make):
    with pytest.raises(
        ValueError, match=r"must be finite, got \[ *2\. +nan\] at index 2\.$"
    ) as info:
        make([0, 1, 2, 3], [0, 0, np.nan, np.inf])
    assert "\n" not in str(info.value)


@pytest.mark.parametrize("make", [waypoint_path, polyline_path])
def test_waypoints_that_make_no_path_are_refused(make):
    with pytest.raises(ValueError, match="at least 2 different"):
        make([1, 1, 1], [2, 2, 2])
    with pytest.raises(ValueError, match="at least 2 different"):
        make([1.0], [2.0])
    with pytest.raises(ValueError, match="two arrays of one length"):
        make([1.0, 2.0, 3.0], [2.0, 1.0])


def test_ends_that_make_no_path_are_refused():
    with pytest.raises(ValueError, match="shorter than the spacing"):
        straight_path((1, 1), (1, 1))
    with pytest.raises(ValueError, match="must be finite"):
        straight_path((1, np.nan), (1, 1))
    with pytest.raises(ValueError, match="radius must be greater than 0 m, got -1"):
        arc_path((0, 0), -1, 0, 1)
    with pytest.raises(ValueError, match="must differ"):
        curve_path(CURVES["circle"][0], 1.0, 1.0)


def test_a_wheel_path_holds_finite_arrays_of_one_shape():
    good = {"s": np.arange(3.0), "easting": np.zeros(3), "northing": np.zeros(3)}
    square = dict.fromkeys(("s", "easting", "northing", "heading"), np.zeros((2, 2)))
    for wrong in (good | {"heading": np.zeros(2)}, square):
        with pytest.raises(ValueError, match=r"must be arrays \(s,\) of one length"):
            PlaneCurve(**wrong, length=2.0)
    with pytest.raises(ValueError, match="northing must hold"):
        PlaneCurve(**(good | {"northing": np.full(3, np.nan)}), heading=np.zeros(3), length=2.0)
    with pytest.raises(ValueError, match="at least one value"):
        straight_path((0, 0), (1, 0)).part(5, 5)


def test_a_part_of_a_path_keeps_its_stations():
    path = straight_path((0, 0), (1, 0), spacing=0.1)
    part = path.part(3, 6)
    assert_allclose(part.s, [0.3, 0.4, 0.5], rtol=0, atol=1e-12)
    assert part.length == path.length
    assert len(part) == 3
