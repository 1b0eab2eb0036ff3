"""Grounds that follow a course, go on for ever, or shake a vehicle, against formulas."""

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core.schemas import make_surface
from trueterrain.simulate.course import Arc, Oval, Straight, Stretch, Stretches, Waypoints
from trueterrain.simulate.ground import (
    AlongCourse,
    BelgianBlock,
    Cleats,
    ExcitationEvent,
    Plane,
    Repeated,
    Road,
    Sine,
    StationTable,
    Step,
    Sum,
)
from trueterrain.surface.evaluate import heights_at_uv

EXACT = {"rtol": 0, "atol": 1e-9}  # [m] round-off of stations over a kilometre

OVAL = Oval(straight=120.0, radius=40.0, transition=25.0, east=30.0, heading=0.4)
BROKEN = Stretches(parts=(Stretch(length=5.0), Stretch(length=5.0, begin=0.1, end=0.1)))
RNG = np.random.default_rng(5)
U, V = RNG.uniform(0.0, OVAL.length - 5.0, 4000), RNG.uniform(-6.0, 6.0, 4000)


def on(course, u, v):
    return course.at(u, v).position.T


def test_ground_follows_the_course():
    wave = Sine(amplitude=0.1, wavelength=3.0, direction=0.7)
    npt.assert_allclose(
        AlongCourse(ground=wave, course=OVAL).height(*on(OVAL, U, V)), wave.height(U, V), **EXACT
    )


def test_elevation_and_banking_are_added():
    table = StationTable(station=(0.0, 100.0, OVAL.length), value=(1.0, 4.0, 1.0), smooth=False)
    lean = StationTable(station=(0.0, 200.0, OVAL.length), value=(0.0, -0.1, 0.0), smooth=False)
    ground = AlongCourse(ground=Plane(camber=0.01), course=OVAL, elevation=table, banking=lean)
    u = RNG.uniform(0.0, OVAL.length, 4000)
    truth = 0.01 * V + np.interp(u, [0, 100, OVAL.length], [1, 4, 1])
    truth += V * np.interp(u, [0, 200, OVAL.length], [0, -0.1, 0])
    npt.assert_allclose(ground.height(*on(OVAL, u, V)), truth, **EXACT)


def test_a_slope_goes_on_beyond_the_ends():
    arc = Arc(radius=30.0, angle=1.0)
    ground = AlongCourse(ground=Plane(), course=arc, slope=0.05, elevation=2.0)
    u = np.array([-20.0, 0.0, 15.0, 50.0])
    npt.assert_allclose(ground.height(*on(arc, u, 1.0)), 2.0 + 0.05 * u, **EXACT)


def test_a_closed_course_has_no_step_where_it_closes():
    rough = Road(road_class="D", waves=256, seed=1)
    v = np.linspace(-3.0, 3.0, 61)
    end = np.nextafter(OVAL.length, 0.0)
    for seam, step in ((10.0, 1e-9), (0.0, None)):
        ground = AlongCourse(ground=rough, course=OVAL, seam=seam)
        before, after = (ground.height(*on(OVAL, u, v)) for u in (end, 0.0))
        if step is None:
            assert np.abs(before - after).max() > 1e-3
        else:
            npt.assert_allclose(before, after, rtol=0, atol=step)
    u = np.linspace(OVAL.length - 12.0, OVAL.length, 2401)[:-1]
    across = AlongCourse(ground=rough, course=OVAL, seam=10.0).height(*on(OVAL, u, 1.0))
    along = rough.height(u, 1.0)
    npt.assert_allclose(across[u < OVAL.length - 10.0], along[u < OVAL.length - 10.0], **EXACT)
    assert np.abs(np.diff(across)).max() < 2 * np.abs(np.diff(along)).max()


def test_elevation_is_smooth_where_a_course_closes():
    table = StationTable(
        station=(0.0, 60.0, 150.0, 300.0, OVAL.length), value=(0.0, 3.0, 1.0, 4.0, 0.0)
    )
    ground = AlongCourse(ground=Plane(), course=OVAL, elevation=table)
    u = np.linspace(-1.0, 1.0, 2001)
    height = ground.height(*on(OVAL, u, 0.0))
    npt.assert_allclose(height[1000], 0.0, **EXACT)
    slope = np.gradient(height, u)
    assert np.abs(np.diff(slope)).max() < 1e-3  # [m/m] per millimetre


def test_superelevation_leans_inwards_with_curvature():
    for course in (OVAL, Oval(straight=50, radius=20, transition=12, turn_to="right")):
        ground = AlongCourse.superelevated(ground=Plane(), course=course, max_banking=0.08)
        u = RNG.uniform(0.0, course.length, 2000)
        v = RNG.uniform(-5.0, 5.0, 2000)
        lean = -0.08 * course.at(u).curvature * course.radius
        npt.assert_allclose(ground.height(*on(course, u, v)), lean * v, **EXACT)
    level = AlongCourse.superelevated(ground=Plane(), course=Straight(length=5.0), max_banking=0.1)
    npt.assert_allclose(level.height([1.0, 2.0], 3.0), 0.0, **EXACT)


def test_a_height_does_not_depend_on_the_other_points():
    ground = AlongCourse.superelevated(
        ground=BelgianBlock(seed=1), course=OVAL, max_banking=0.1, seam=50.0
    )
    x, y = RNG.uniform(-100.0, 200.0, (2, 3000))
    whole = ground.height(x, y)
    npt.assert_array_equal(ground.height(x[::-3], y[::-3]), whole[::-3])
    assert ground.height(x[0], y[0]) == whole[0]


def surface():
    rng = np.random.default_rng(2)
    nodes = np.arange(0.0, 4.1, 0.5)
    return make_surface(
        rng.normal(size=(9, 7)),
        u=nodes,
        v=np.linspace(-1.5, 1.5, 7),
        easting=10.0 + nodes,
        northing=np.full(9, 3.0),
    )


def test_a_surface_is_mirrored_without_a_step():
    measured = surface()
    ground = Repeated(surface=measured)
    u, v = RNG.uniform(0.0, 4.0, 500), RNG.uniform(-1.5, 1.5, 500)
    truth = heights_at_uv(measured, u, v)
    for n in (-3, -1, 0, 2):
        npt.assert_allclose(ground.height(8.0 * n + u, v), truth, **EXACT)
        npt.assert_allclose(ground.height(8.0 * n - u, v), truth, **EXACT)
    near = ground.height(4.0 * np.arange(-5, 6) - 1e-9, 0.3)
    npt.assert_allclose(near, ground.height(4.0 * np.arange(-5, 6) + 1e-9, 0.3), rtol=0, atol=1e-7)
    assert np.isnan(ground.height(1.0, [-1.6, 1.6])).all()


def test_a_surface_is_repeated():
    measured = surface()
    ground = Repeated(surface=measured, mirrored=False, part_u=(0.5, 3.0))
    u, v = RNG.uniform(0.0, 2.5, 500), RNG.uniform(-1.5, 1.5, 500)
    truth = heights_at_uv(measured, 0.5 + u, v)
    for n in (-2, 0, 3):
        npt.assert_allclose(ground.height(2.5 * n + u, v), truth, **EXACT)


def test_a_surface_is_mirrored_across_too():
    measured = surface()
    ground = Repeated(surface=measured, across=True, part_v=(-1.0, 0.5))
    u, v = RNG.uniform(0.0, 4.0, 500), RNG.uniform(-1.0, 0.5, 500)
    truth = heights_at_uv(measured, u, v)
    npt.assert_allclose(ground.height(u, v), truth, **EXACT)
    npt.assert_allclose(ground.height(u, 1.0 - v), truth, **EXACT)  # about v = 0.5
    npt.assert_allclose(ground.height(u, -2.0 - v), truth, **EXACT)  # about v = -1
    npt.assert_allclose(ground.height(u, v + 3.0), truth, **EXACT)


def test_a_measured_belgian_block_follows_an_oval(data):
    block = Repeated.from_file(
        data / "opencrg" / "asam" / "belgian_block.crg", across=True, part_v=(-1.2, 1.2)
    )
    ground = AlongCourse(ground=block, course=OVAL)
    height = ground.height(*on(OVAL, U, V))
    assert np.isfinite(height).all()
    assert 0.02 < height.std() < 0.03  # [m] 24 mm as measured
    npt.assert_allclose(height, block.height(U, V), rtol=0, atol=1e-7)  # steep sides of blocks
    assert ground.to_dict()["ground"]["kind"] == "Repeated"


def test_the_event_is_cleats_in_groups():
    event = ExcitationEvent(begin=3.0, events=3, pitch=4.88)
    groups = tuple(
        Cleats(first=3.0 + 0.244 + 4.88 * n, spacing=0.488, number=5, width=0.17, rise=0.038)
        for n in range(3)
    )
    x = RNG.uniform(0.0, 20.0, 20_000)
    npt.assert_allclose(event.height(x, 1.0), Sum(parts=groups).height(x, 1.0), **EXACT)
    board = ExcitationEvent(begin=3.0, base=0.019).height(x, 0.0) - ExcitationEvent(
        begin=3.0
    ).height(x, 0.0)
    npt.assert_allclose(board, np.where((x >= 3.0) & (x <= 5.44), 0.019, 0.0), **EXACT)


def test_the_right_side_may_be_staggered():
    event, plain = ExcitationEvent(begin=1.0, stagger=0.244), ExcitationEvent(begin=1.0)
    x = np.linspace(0.0, 5.0, 5003)
    npt.assert_array_equal(event.height(x, 0.5), plain.height(x, 0.5))
    npt.assert_allclose(event.height(x, -0.5), plain.height(x - 0.244, -0.5), **EXACT)


def test_grounds_of_a_course_can_be_added():
    arc = Arc(radius=30.0, angle=1.0)
    both = AlongCourse(ground=Plane() + Step(position=5.0, rise=0.1), course=arc) + Plane(
        elevation=1.0
    )
    npt.assert_allclose(both.height(*on(arc, [4.0, 6.0], 0.0)), [1.0, 1.1], **EXACT)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: AlongCourse(ground=Plane(), course=OVAL, slope=0.01), "slope must be 0 on a clos"),
        (lambda: AlongCourse(ground=Plane(), course=OVAL, seam=-1.0), "seam must be at least 0"),
        (lambda: AlongCourse(ground=Plane(), course=OVAL, seam=9e3), "seam must be at most"),
        (lambda: AlongCourse(ground=Plane(), course=OVAL, banking=np.nan), "banking must be fin"),
        (
            lambda: AlongCourse(
                ground=Plane(), course=OVAL, banking=StationTable(station=(0, 9), value=(0, 0))
            ),
            "station must be from 0 to 541",
        ),
        (
            lambda: AlongCourse(
                ground=Plane(),
                course=OVAL,
                elevation=StationTable(station=(0, OVAL.length), value=(0, 1)),
            ),
            "value must be the same at both ends",
        ),
        (
            lambda: AlongCourse.superelevated(ground=Plane(), course=OVAL, max_banking=-0.1),
            "max_banking must be at least 0",
        ),
        (
            lambda: AlongCourse.superelevated(ground=Plane(), course=BROKEN, max_banking=0.1),
            "course must have clothoids",
        ),
        (lambda: StationTable(station=(0,), value=(1,)), "of the same length of at least 2"),
        (lambda: StationTable(station=(0, 0), value=(1, 1)), "station must ascend"),
        (lambda: StationTable(station=(0, 1), value=(1, np.nan)), "must be finite"),
        (lambda: Repeated(surface=surface(), part_u=(-1.0, 2.0)), "part_u must be two ascending"),
        (lambda: Repeated(surface=surface(), part_v=(1.0, 0.0)), "part_v must be two ascending"),
        (
            lambda: Repeated(
                surface=make_surface(np.zeros((2, 2)), easting=[0, 1], northing=[0, 1])
            ),
            "surface must lie along a reference line",
        ),
        (lambda: ExcitationEvent(number=0), "number must be a whole number"),
        (lambda: ExcitationEvent(width=0.6), "spacing must be at least the width"),
        (lambda: ExcitationEvent(events=2, pitch=2.0), "pitch must be at least the length"),
        (lambda: ExcitationEvent(base=-0.1), "base must be at least 0"),
    ],
)
def test_impossible_grounds_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_superelevation_follows_waypoints():
    course = Waypoints(points=((0, 0), (40, 5), (70, 30), (75, 70)))
    ground = AlongCourse.superelevated(ground=Plane(), course=course, max_banking=0.05)
    u = np.linspace(0.0, course.length, 50)
    curvature = course.at(u).curvature
    largest = max(abs(k) for _, k in course.borders)
    npt.assert_allclose(
        ground.height(*on(course, u, 2.0)), -0.05 * curvature / largest * 2.0, **EXACT
    )
