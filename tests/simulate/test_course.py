"""Courses and lanes against circles, Fresnel integrals and numerical integration."""

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import fresnel

from trueterrain.simulate.course import (
    Arc,
    OffsetLine,
    Oval,
    Straight,
    Stretch,
    Stretches,
    Waypoints,
)

EXACT = {"rtol": 0, "atol": 1e-9}  # [m], [rad] round-off over a kilometre, with a margin
SECOND_DIFFERENCE = 1e-5  # [1/m] round-off of a second difference over 10 mm, and its own error

OVAL = Oval(straight=120.0, radius=40.0, transition=25.0, east=30.0, north=-7.0, heading=0.4)
RIGHT = Oval(straight=60.0, radius=25.0, transition=30.0, turn_to="right")
WAYPOINTS = Waypoints(points=((0, 0), (40, 5), (70, 30), (75, 70), (40, 90), (10, 120)))
LOOP = Waypoints(points=((0, 0), (60, -10), (90, 40), (40, 80), (-20, 50)), close=True)
COURSES = {
    "straight": Straight(length=200.0, heading=-2.0, east=5.0),
    "arc": Arc(radius=30.0, angle=2.0, transition=15.0, turn_to="right", heading=1.0),
    "oval": OVAL,
    "right": RIGHT,
    "waypoints": WAYPOINTS,
    "loop": LOOP,
}
any_course = pytest.mark.parametrize("course", COURSES.values(), ids=COURSES)


def test_an_arc_is_a_circle():
    arc = Arc(radius=25.0, angle=3.0, east=3.0, north=4.0, heading=0.5)
    s = np.linspace(0.0, 75.0, 301)
    place = arc.at(s)
    h = 0.5 + s / 25.0
    centre = np.array([3.0 - 25.0 * np.sin(0.5), 4.0 + 25.0 * np.cos(0.5)])
    truth = centre + 25.0 * np.column_stack([np.sin(h), -np.cos(h)])
    npt.assert_allclose(place.position, truth, **EXACT)
    npt.assert_allclose(place.heading, h, **EXACT)
    npt.assert_allclose(place.curvature, 1 / 25.0, **EXACT)
    npt.assert_allclose(arc.length, 75.0, **EXACT)


def test_a_clothoid_is_that_of_fresnel():
    clothoid = Stretches(parts=(Stretch(length=60.0, begin=0.0, end=0.05),))
    s = np.linspace(0.0, 60.0, 61)
    scale = np.sqrt(np.pi * 60.0 / 0.05)  # heading = pi/2 (s / scale)^2
    sine, cosine = fresnel(s / scale)
    npt.assert_allclose(clothoid.at(s).position, scale * np.column_stack([cosine, sine]), **EXACT)


@pytest.mark.parametrize("course", [OVAL, RIGHT, LOOP])
def test_a_closed_course_ends_where_it_begins(course):
    first, last = course.at(0.0), course.at(np.nextafter(course.length, 0.0))
    npt.assert_allclose(last.position, first.position, **EXACT)
    npt.assert_allclose(abs(last.heading - first.heading), 2 * np.pi, **EXACT)
    npt.assert_allclose(last.curvature, first.curvature, **EXACT)


def test_an_oval_is_as_long_as_its_parts():
    # each clothoid turns by transition / 2 radius, and takes half of its length from the arc
    npt.assert_allclose(OVAL.length, 2 * (120 + np.pi * 40 + 25), **EXACT)
    npt.assert_allclose(OVAL.turn, 2 * np.pi, **EXACT)
    npt.assert_allclose(RIGHT.turn, -2 * np.pi, **EXACT)


@any_course
def test_heading_is_the_integral_of_curvature(course):
    middle = [s for s, _ in course.borders]
    total, _ = quad(
        lambda s: course.at(s).curvature[0],
        0.0,
        0.7 * course.length,
        points=[s for s in middle if 0 < s < 0.7 * course.length],
        epsabs=1e-11,
        limit=200,
    )
    change = course.at(0.7 * course.length).heading[0] - course.at(0.0).heading[0]
    npt.assert_allclose(change, total, **EXACT)


@any_course
@pytest.mark.parametrize("offset", [0.0, 1.75, -3.5])
def test_heading_and_curvature_are_derivatives(course, offset):
    s = np.linspace(-20.0, course.length + 20.0, 1000)
    edges = [b for b, _ in course.borders]
    if course.closed:
        edges = edges + [e + course.length for e in edges] + [e - course.length for e in edges]
    s = s[np.abs(s[:, None] - edges).min(axis=1) > 0.02]
    step = 0.01
    before, here, after = (course.at(s + n * step, offset) for n in (-1, 0, 1))
    run = np.hypot(*(after.position - before.position).T) / 2  # along the parallel line
    tangent = (after.position - before.position) / (2 * run[:, None])
    npt.assert_allclose(tangent[:, 0], np.cos(here.heading), rtol=0, atol=SECOND_DIFFERENCE)
    npt.assert_allclose(tangent[:, 1], np.sin(here.heading), rtol=0, atol=SECOND_DIFFERENCE)
    bend = (after.heading - before.heading) / (2 * run)
    npt.assert_allclose(bend, here.curvature, rtol=0, atol=SECOND_DIFFERENCE)
    twist = (after.curvature - before.curvature) / (2 * run)
    npt.assert_allclose(twist, here.curvature_slope, rtol=0, atol=SECOND_DIFFERENCE)


@pytest.mark.parametrize("course", [OVAL, RIGHT, WAYPOINTS, LOOP])
def test_curvature_is_continuous(course):
    s = np.array([b for b, _ in course.borders[1:-1]])
    if course.closed:
        s = np.append(s, course.length)
    before, after = course.at(s - 1e-9), course.at(s + 1e-9)
    npt.assert_allclose(before.curvature, after.curvature, rtol=0, atol=1e-9)  # [1/m]
    npt.assert_allclose(before.position, after.position, rtol=0, atol=1e-8)  # [m] 2e-9 m apart


def test_heading_counts_on_from_lap_to_lap():
    s = np.linspace(-1.5, 2.5, 401) * OVAL.length
    heading = OVAL.at(s).heading
    assert np.abs(np.diff(heading)).max() < 0.2
    laps = OVAL.at(50.0 + OVAL.length * np.arange(-2, 3)).heading
    npt.assert_allclose(np.diff(laps), 2 * np.pi, **EXACT)
    npt.assert_allclose(OVAL.at(50.0).position, OVAL.at(50.0 + 3 * OVAL.length).position, **EXACT)


@any_course
def test_projection_is_the_inverse(course):
    rng = np.random.default_rng(1)
    ends = (0.0, course.length) if course.closed else (-30.0, course.length + 30.0)
    s, v = rng.uniform(*ends, 5000), rng.uniform(-6.0, 6.0, 5000)
    x, y = np.concatenate([course.at(a, b).position for a, b in zip(s, v, strict=True)]).T
    station, offset = course.project(x, y)
    npt.assert_allclose(station, s, **EXACT)
    npt.assert_allclose(offset, v, **EXACT)


@any_course
def test_projection_finds_the_nearest_point(course):
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-150, 250, (2, 300))
    station, offset = course.project(x, y)
    ends = (0.0, course.length) if course.closed else (-400.0, course.length + 400.0)
    line = course.at(np.linspace(*ends, 40001)).position
    sampled = np.hypot(x[:, None] - line[:, 0], y[:, None] - line[:, 1]).min(axis=1)
    foot = course.at(station).position
    npt.assert_allclose(np.hypot(x - foot[:, 0], y - foot[:, 1]), np.abs(offset), **EXACT)
    assert (np.abs(offset) <= sampled + 1e-9).all()


def test_projection_does_not_depend_on_other_points():
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-50, 200, (2, 1000))
    u, v = LOOP.project(x, y)
    again = LOOP.project(x[::-7], y[::-7])
    npt.assert_array_equal(again[0], u[::-7])
    npt.assert_array_equal(again[1], v[::-7])


@pytest.mark.parametrize("course", [WAYPOINTS, LOOP])
def test_waypoints_lie_on_the_course(course):
    _, offset = course.project(*np.array(course.points, dtype=float).T)
    npt.assert_allclose(offset, 0.0, **EXACT)
    starts = [s for s, _ in course.borders][: len(course.points)]
    npt.assert_allclose(course.at(starts).position, course.points, **EXACT)


@given(st.lists(st.tuples(st.floats(20.0, 60.0), st.floats(-1.0, 1.0)), min_size=1, max_size=30))
def test_gentle_waypoints_always_have_a_course(legs):
    length, turn = np.array(legs).T
    direction = np.cumsum(turn)
    travelled = np.cumsum(length * np.exp(1j * direction))
    points = tuple((z.real, z.imag) for z in [0j, *travelled])
    course = Waypoints(points=points)
    starts = [s for s, _ in course.borders]
    npt.assert_allclose(course.at(starts).position, points, rtol=0, atol=1e-8)  # [m] over 1 km
    assert course.length < 1.3 * length.sum()


def test_two_waypoints_are_a_straight():
    course = Waypoints(points=((1.0, 2.0), (4.0, 6.0)))
    npt.assert_allclose(course.length, 5.0, **EXACT)
    npt.assert_allclose(course.at(2.5).position, [[2.5, 4.0]], **EXACT)


def test_waypoints_on_a_circle_make_a_circle():
    a = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    circle = Waypoints(points=tuple(zip(50 * np.cos(a), 50 * np.sin(a), strict=True)), close=True)
    npt.assert_allclose(circle.length, 100 * np.pi, **EXACT)
    npt.assert_allclose(circle.at(np.linspace(0, 300, 31)).curvature, 1 / 50, **EXACT)


@pytest.mark.parametrize("offset", [-3.0, 0.0, 1.5])
@pytest.mark.parametrize("course", [OVAL, RIGHT, COURSES["arc"], WAYPOINTS])
@pytest.mark.parametrize("reverse", [False, True])
def test_distances_are_those_along_the_lane(course, offset, reverse):
    lane = OffsetLine(course=course, offset=offset, reverse=reverse)
    fine = np.linspace(0.0, lane.length, 200_001)
    place = lane.at(fine)
    chords = np.hypot(*np.diff(place.position, axis=0).T)
    # a chord is shorter than its arc by s^3 k^2 / 24, less than 1e-9 of it here
    npt.assert_allclose(chords, fine[1], rtol=1e-8)
    direction = np.diff(place.position, axis=0) / chords[:, None]
    middle = (place.heading[1:] + place.heading[:-1]) / 2
    npt.assert_allclose(direction[:, 0], np.cos(middle), rtol=0, atol=1e-7)
    npt.assert_allclose(direction[:, 1], np.sin(middle), rtol=0, atol=1e-7)
    bend = np.diff(place.heading) / fine[1]
    npt.assert_allclose(bend, (place.curvature[1:] + place.curvature[:-1]) / 2, rtol=0, atol=1e-6)
    twist = np.diff(place.curvature) / fine[1]
    smooth = np.abs(np.diff(place.curvature_slope)) < 1e-6
    npt.assert_allclose(
        twist[smooth],
        ((place.curvature_slope[1:] + place.curvature_slope[:-1]) / 2)[smooth],
        rtol=0,
        atol=1e-6,
    )


def test_laps_of_a_lane_meet():
    for reverse in (False, True):
        lane = OffsetLine(course=RIGHT, offset=2.0, reverse=reverse, start=17.0)
        npt.assert_allclose(
            lane.length, RIGHT.length + 2.0 * 2 * np.pi, **EXACT
        )  # outside of a right turn
        d = np.array([-3.0, 0.0, 40.0])
        once, twice = lane.at(d), lane.at(d + 2 * lane.length)
        npt.assert_allclose(twice.position, once.position, **EXACT)
        npt.assert_allclose(twice.heading - once.heading, (4 if reverse else -4) * np.pi, **EXACT)
        npt.assert_allclose(lane.at(0.0).position, RIGHT.at(17.0, 2.0).position, **EXACT)


def test_a_lane_goes_straight_on_beyond_the_ends():
    lane = OffsetLine(course=COURSES["arc"], offset=1.0)
    place = lane.at([-10.0, 0.0, lane.length, lane.length + 10.0])
    npt.assert_allclose(place.heading[[1, 3]], place.heading[[0, 2]], **EXACT)
    gaps = np.hypot(*(place.position[[1, 3]] - place.position[[0, 2]]).T)
    npt.assert_allclose(gaps, 10.0, **EXACT)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Straight(length=0.0), "length must be greater than 0 m, got 0.0"),
        (lambda: Straight(length=1.0, heading=np.nan), "heading must be finite"),
        (lambda: Arc(radius=-3.0, angle=1.0), "radius must be greater than 0 m, got -3.0"),
        (lambda: Arc(radius=3.0, angle=1.0, turn_to="up"), "turn_to must be 'left' or 'right'"),
        (lambda: Oval(straight=10, radius=10, transition=32), "transition must be from 0 to 31.4"),
        (lambda: Oval(straight=10, radius=10, transition=0), "transition must be greater than 0"),
        (lambda: Stretches(parts=()), "parts must hold at least one stretch"),
        (
            lambda: Stretches(parts=(Stretch(length=5.0),), close=True),
            "must end at its start, in the same direction; it ends 5 m away after 0 revolutions",
        ),
        (lambda: Stretch(length=-1.0), "length must be greater than 0 m"),
        (lambda: Stretch(length=1.0, end=np.inf), "end must be finite"),
        (lambda: Waypoints(points=((0, 0),)), "points must be at least 2 pairs"),
        (lambda: Waypoints(points=((0, 0), (1, 0)), close=True), "at least 3 pairs"),
        (lambda: Waypoints(points=((0, 0), (0, 0), (1, 1))), "point 0 is the same"),
        (lambda: Waypoints(points=((0, 0), (np.nan, 0))), "points must be finite"),
        (lambda: Waypoints(points=((0, 0), (10, 0), (0, 1), (10, 2))), "without sharp bends"),
        (lambda: OVAL.at(np.nan), "station and offset must be finite"),
        (lambda: OVAL.at(200.0, 41.0), "centre of the curve, which is at v = 40 m"),
        (lambda: OffsetLine(course=OVAL, offset=45.0), "offset must lie on the road side"),
        (lambda: OffsetLine(course=OVAL, offset=np.inf), "offset must be finite"),
        (lambda: OffsetLine(course=COURSES["arc"], start=-1.0), "start must be from 0 to"),
        (lambda: OffsetLine(course=OVAL, start=np.nan), "start must be finite"),
    ],
)
def test_impossible_courses_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_course_describes_itself():
    assert OVAL.to_dict()["kind"] == "Oval"
    assert OVAL.to_dict()["radius"] == 40.0
    assert WAYPOINTS.to_dict()["points"][1] == (40, 5)
