"""Search areas: points inside of a disc, an ellipse and a rectangle, and their reach."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trueterrain.core.schemas import make_points, make_surface
from trueterrain.profile import (
    Disc,
    Ellipse,
    PlaneCurve,
    Rectangle,
    TyreProfileSettings,
    height_distributions,
    straight_path,
)
from trueterrain.profile.area import EDGE_TOLERANCE, area_flag, area_reach

UTM = (512_345.0, 5_512_345.0)  # [m] easting and northing of central Europe
AREAS = [Disc(), Disc(radius=0.0213), Ellipse(length=0.09, width=0.04)]
AREAS += [Rectangle(length=0.05, width=0.11), Rectangle(length=0.2, width=0.005)]


def single(easting, northing, heading=0.0):
    """Path of a single point."""
    return PlaneCurve(
        s=np.zeros(1),
        easting=np.array([easting], float),
        northing=np.array([northing], float),
        heading=np.array([heading], float),
        length=0.0,
    )


def lattice(step, reach_, origin=(0.0, 0.0)):
    """Lattice around an origin, as a map and as points."""
    axis = step * np.arange(-round(reach_ / step), round(reach_ / step) + 1)
    height = np.arange(axis.size**2, dtype=float).reshape(axis.size, -1)
    surface = make_surface(height, easting=origin[0] + axis, northing=origin[1] + axis)
    east, north = np.meshgrid(origin[0] + axis, origin[1] + axis)
    return surface, make_points(east.ravel(), north.ravel(), height.ravel())


def inside(area, along, across):
    """Membership by the definition of each shape, without any tolerance."""
    a, b = area.half_axes
    if isinstance(area, Rectangle):
        return (np.abs(along) <= a) & (np.abs(across) <= b)
    return (along / a) ** 2 + (across / b) ** 2 <= 1


def test_the_thesis_counts_81_points_of_a_5_mm_grid_in_its_disc():
    """A disc of 25 mm radius has an area of about 2000 mm2."""
    for ground in lattice(0.005, 0.1):
        distributions = height_distributions(ground, single(0, 0), area=Disc(radius=0.025))
        assert distributions.count.tolist() == [81]  # Gauss's circle problem for a radius of 5
    assert np.pi * 25**2 == pytest.approx(2000, rel=0.02)
    assert pytest.approx(np.pi * 25**2, rel=0.04) == 81 * 5**2


@pytest.mark.parametrize("origin", [(0.0, 0.0), UTM, (-UTM[0], -UTM[1])])
@pytest.mark.parametrize(
    ("area", "count"),
    [
        (Disc(radius=0.025), 81),
        (Disc(radius=0.005), 5),
        (Ellipse(length=0.05, width=0.05), 81),
        (
            Ellipse(length=0.1, width=0.02),
            21 + 2 * 17 + 2 * 1,
        ),  # rows of a lattice, from the centre
        (Rectangle(length=0.05, width=0.02), 11 * 5),
        (Rectangle(length=0.01, width=0.01), 9),
    ],
)
def test_nodes_on_the_edge_count_in_any_coordinates(origin, area, count):
    a, b = (round(half / 0.005) for half in area.half_axes)
    i, j = np.meshgrid(np.arange(-a, a + 1), np.arange(-b, b + 1))
    if isinstance(area, Rectangle):
        exact = i.size
    else:  # in integers: nothing is rounded
        exact = int(((i * b) ** 2 + (j * a) ** 2 <= (a * b) ** 2).sum())
    for ground in lattice(0.005, 0.1, origin):
        distributions = height_distributions(ground, single(*origin), area=area)
        assert distributions.count.tolist() == [exact]
    assert exact == count


@pytest.mark.parametrize("heading", [0.0, 0.4, np.pi / 2, 2.5, -1.0])
@pytest.mark.parametrize("area", AREAS)
def test_areas_are_aligned_with_the_path(area, heading):
    """Points at random: too few fall within the tolerance of the edge to matter."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-0.15, 0.15, (2, 20_000))
    z = np.arange(x.size, dtype=float)
    along = np.cos(heading) * x + np.sin(heading) * y
    across = np.cos(heading) * y - np.sin(heading) * x
    wanted = np.flatnonzero(inside(area, along, across))
    points = make_points(UTM[0] + x, UTM[1] + y, z)
    got = height_distributions(points, single(*UTM, heading), area=area)[0]
    np.testing.assert_array_equal(got.heights, wanted)
    # coordinates of thousands of kilometres are rounded to 1 nm
    assert_allclose(got.distances, np.hypot(x, y)[wanted], rtol=0, atol=2e-9)


def test_a_long_patch_on_a_path_to_the_north_is_long_to_the_north():
    _, points = lattice(0.01, 0.1)
    path = straight_path((0, -0.05), (0, 0.05), spacing=0.05)
    area = Rectangle(length=0.12, width=0.02)
    one = height_distributions(points, path, area=area)[1]
    north, east = np.divmod(one.heights.astype(int), 21)
    assert (set(north - 10), set(east - 10)) == (set(range(-6, 7)), {-1, 0, 1})


@given(
    st.floats(0.001, 0.2), st.floats(0.001, 0.2), st.floats(-np.pi, np.pi), st.integers(0, 2**32)
)
def test_no_point_of_an_area_is_beyond_its_reach(length, width, heading, seed):
    rng = np.random.default_rng(seed)
    along, across = rng.uniform(-0.1, 0.1, (2, 200))
    for area in (
        Disc(radius=length),
        Ellipse(length=length, width=width),
        Rectangle(length=length, width=width),
    ):
        a, b = area.half_axes
        along, across = np.append(along, [a, a, 0]), np.append(across, [b, 0, b])
        found = inside(area, along, across)
        assert (np.hypot(along, across)[found] <= area_reach(area)).all()
        assert area_reach(area) <= np.hypot(a, b) + 3 * EDGE_TOLERANCE


@pytest.mark.parametrize("value", [0.0, -0.025, np.nan, np.inf])
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda x: Disc(radius=x), "radius"),
        (lambda x: Ellipse(length=x, width=1), "length"),
        (lambda x: Ellipse(length=1, width=x), "width"),
        (lambda x: Rectangle(length=x, width=1), "length"),
        (lambda x: Rectangle(length=1, width=x), "width"),
    ],
)
def test_an_extent_must_be_greater_than_zero(make, name, value):
    with pytest.raises(ValueError, match=rf"^{name} must be greater than 0 m, got {value}\.$"):
        make(value)


def test_the_default_is_the_disc_of_the_thesis():
    assert Disc() == Disc(radius=0.025)
    assert Disc().half_axes == (0.025, 0.025)
    assert Rectangle(length=0.2, width=0.1).half_axes == (0.1, 0.05)
    assert Ellipse(length=0.2, width=0.1).half_axes == (0.1, 0.05)


@pytest.mark.parametrize("millimetres", [5, 25, 150])
@pytest.mark.parametrize(
    "make",
    [
        lambda size: Disc(radius=size),
        lambda size: Ellipse(length=size, width=0.1),
        lambda size: Rectangle(length=0.1, width=size),
        lambda size: TyreProfileSettings(radius=size),
        lambda size: TyreProfileSettings(patch=(size, 0.1)),
        lambda size: TyreProfileSettings(ellipse=(0.1, size)),
    ],
)
def test_areas_in_millimetres_are_refused(make, millimetres):
    """25 m of ground in each search area made a flat profile, whose IRI was 0.000."""
    with pytest.raises(ValueError, match=rf"at most [12] m, .*got {millimetres}; is it in millim"):
        make(float(millimetres))
    make(millimetres / 1000)


def test_areas_larger_than_contact_patches_are_flagged():
    assert [area_flag(area) for area in AREAS] == [None] * len(AREAS)
    assert area_flag(Rectangle(length=0.3, width=0.5)) is None
    for area in (Disc(radius=0.26), Disc(radius=1.0), Rectangle(length=0.1, width=2.0)):
        assert "shorter waves are lost" in area_flag(area)
