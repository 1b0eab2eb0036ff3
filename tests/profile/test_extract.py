"""Tyre profiles of planes, stones, gaps, and the measured Belgian block."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.spatial import cKDTree

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import check_profile, make_points, make_profile, make_surface
from trueterrain.profile import (
    Disc,
    Ellipse,
    InverseDistance,
    Mean,
    Median,
    Percentile,
    PlaneCurve,
    Rectangle,
    SteepestCpf,
    Window,
    height_distributions,
    offset_path,
    point_profile,
    straight_path,
    tyre_profile,
)
from trueterrain.surface import heights_at, node_coordinates, surface_to_points

PLANE = 1e-9  # [m] round-off only: what the software promises of a plane
UTM = (512_345.0, 5_512_345.0)  # [m]

AREAS = [Disc(), Ellipse(length=0.06, width=0.03), Rectangle(length=0.05, width=0.04)]
SYMMETRIC = [
    Median(),
    Median(resolution=0.001),
    Mean(),
    Percentile(percent=50),
    Window(),
    Window(skip=40, size=20),
    InverseDistance(),
    InverseDistance(power=1, of="median"),
]
EVERY = [
    *SYMMETRIC,
    Percentile(percent=0),
    Percentile(percent=85),
    Window(skip=0, size=30),
    SteepestCpf(),
    SteepestCpf(bandwidth=0.002),
]


def road(heading, height, origin=(0.0, 0.0), extent=0.15, step=0.005):
    """Straight road at a heading around an origin; `height` of eastings and northings from it."""
    axis = step * np.arange(-round(extent / step), round(extent / step) + 1)
    east, north = axis * np.cos(heading), axis * np.sin(heading)
    x = east[:, None] - axis * np.sin(heading)
    y = north[:, None] + axis * np.cos(heading)
    return make_surface(
        height(x, y), u=axis, v=axis, easting=origin[0] + east, northing=origin[1] + north
    )


def chart(height, origin=(0.0, 0.0), extent=0.15, step=0.005):
    """Map around an origin."""
    axis = step * np.arange(-round(extent / step), round(extent / step) + 1)
    return make_surface(
        height(*np.meshgrid(axis, axis)), easting=origin[0] + axis, northing=origin[1] + axis
    )


def cloud(height, origin=(0.0, 0.0), extent=0.15, count=4000, seed=3):
    """Points at random around an origin."""
    x, y = np.random.default_rng(seed).uniform(-extent, extent, (2, count))
    return make_points(origin[0] + x, origin[1] + y, height(x, y))


def plane(slope, camber, level=0.0):
    return lambda x, y: level + slope * x + camber * y


def line(heading, length=0.2, spacing=0.02, origin=(0.0, 0.0)):
    half = 0.5 * length * np.array([np.cos(heading), np.sin(heading)])
    return straight_path(tuple(origin - half), tuple(origin + half), spacing=spacing)


def stone(x, y, at=(0.0, 0.0)):
    """Half an ellipsoid, 25 mm high and 25 mm wide."""
    away = np.hypot(x - at[0], y - at[1]) / 0.0125
    return 0.025 * np.sqrt(np.clip(1 - away**2, 0, None))


GROUNDS = {
    "road": road,
    "map": lambda heading, height: chart(height),
    "points": lambda heading, height: cloud(height),
}
angles = st.floats(-np.pi, np.pi)
slopes = st.floats(-0.3, 0.3)


def check_levelled(ground, area, statistic, height, path):
    profile = tyre_profile(ground, path, area=area, statistic=statistic, level=True)
    assert_allclose(profile.height, height(path.easting, path.northing), rtol=0, atol=PLANE)
    step = getattr(statistic, "resolution", None) or 0.0
    assert profile.sd.max() <= step + PLANE  # a slope is no scatter


@pytest.mark.parametrize("name", GROUNDS)
@pytest.mark.parametrize("area", AREAS, ids=str)
@pytest.mark.parametrize("statistic", EVERY, ids=str)
def test_a_plane_is_its_own_profile(statistic, area, name):
    tilted, level = plane(0.07, -0.04, 3.0), plane(0, 0, 3.0)
    check_levelled(GROUNDS[name](0.4, tilted), area, statistic, tilted, line(0.5))
    profile = tyre_profile(GROUNDS[name](0.4, level), line(0.5), area=area, statistic=statistic)
    assert_allclose(profile.height, 3.0, rtol=0, atol=PLANE)


@given(
    st.sampled_from(sorted(GROUNDS)),
    st.sampled_from(AREAS),
    st.sampled_from(EVERY),
    slopes,
    slopes,
    angles,
    angles,
    st.floats(-2000, 2000),
)
def test_a_tilted_plane_is_its_own_levelled_profile(
    name, area, statistic, slope, camber, heading, course, level
):
    height = plane(slope, camber, level)
    check_levelled(GROUNDS[name](heading, height), area, statistic, height, line(course))


@given(
    st.sampled_from(sorted(GROUNDS)),
    st.sampled_from(AREAS),
    st.sampled_from(EVERY),
    angles,
    angles,
    st.floats(-2000, 2000),
)
def test_a_level_plane_is_its_own_profile(name, area, statistic, heading, course, level):
    ground = GROUNDS[name](heading, plane(0, 0, level))
    profile = tyre_profile(ground, line(course), area=area, statistic=statistic)
    assert_allclose(profile.height, level, rtol=0, atol=PLANE)


@given(st.sampled_from(AREAS), st.sampled_from(SYMMETRIC), slopes, slopes, angles, st.booleans())
def test_a_tilted_plane_is_its_own_profile_where_the_nodes_are_symmetric(
    area, statistic, slope, camber, heading, along
):
    """Path points on nodes, along the rows or the columns: heights before and behind cancel."""
    height = plane(slope, camber)
    path = line(heading if along else heading + np.pi / 2)
    true = height(path.easting, path.northing)
    profile = tyre_profile(road(heading, height), path, area=area, statistic=statistic)
    assert_allclose(profile.height, true, rtol=0, atol=PLANE)


@given(slopes, slopes, angles)
def test_a_tilted_plane_is_its_own_steepest_height_in_a_disc(slope, camber, heading):
    """The central height is the most frequent one; in a rectangle all are equally frequent."""
    height, path = plane(slope, camber), line(heading)
    true = height(path.easting, path.northing)
    profile = tyre_profile(road(heading, height), path, statistic=SteepestCpf())
    assert_allclose(profile.height, true, rtol=0, atol=PLANE)


@pytest.mark.parametrize("statistic", EVERY, ids=str)
def test_a_plane_is_its_own_profile_in_coordinates_of_thousands_of_kilometres(statistic):
    height = plane(0.03, -0.02, 317.0)
    path = line(0.6, origin=np.array(UTM))
    true = height(path.easting - UTM[0], path.northing - UTM[1])
    for ground in (road(0.6, height, UTM), cloud(height, UTM)):
        profile = tyre_profile(ground, path, statistic=statistic, level=True)
        # coordinates are rounded to 1 nm, on a slope of 4 %
        assert_allclose(profile.height, true, rtol=0, atol=PLANE)


def test_points_on_a_single_line_level_along_it_alone():
    """Nothing tells the slope across: none is assumed."""
    along = 0.001 * np.arange(-80, 81)
    points = make_points(along, 0.3 * along, 0.2 * along)
    path = straight_path((-0.04, -0.012), (0.04, 0.012), spacing=0.01)
    profile = tyre_profile(points, path, level=True, statistic=Percentile(percent=90))
    assert_allclose(profile.height, 0.2 * path.easting, rtol=0, atol=PLANE)


def test_a_stone_changes_the_median_by_less_than_a_tenth_and_a_point_by_all_of_it():
    rng = np.random.default_rng(6)
    rough = 0.0005 * rng.normal(size=(61, 61))
    path = line(0.0, length=0.1, spacing=0.005)
    for texture in (0.0, 1.0):
        flat = chart(lambda x, y, t=texture: t * rough)
        stony = chart(lambda x, y, t=texture: t * rough + stone(x, y))
        change = tyre_profile(stony, path).height - tyre_profile(flat, path).height
        assert np.abs(change).max() < 0.0025
        bare = point_profile(stony, path).height - point_profile(flat, path).height
        assert_allclose(bare.max(), 0.025, rtol=0, atol=1e-12)
        points = surface_to_points(stony)
        change = tyre_profile(points, path).height - tyre_profile(flat, path).height
        assert np.abs(change).max() < 0.0025


@pytest.mark.parametrize("at", [0.0, 0.008, 0.015, 0.022])
def test_a_stone_does_not_tilt_the_levelled_ground(at):
    """A quarter of the disc is stone, at its centre or its side: the plane passes below it."""
    height = plane(0.08, -0.05)
    ground = chart(lambda x, y: height(x, y) + stone(x, y, (at, 0.3 * at)))
    path = line(0.4, length=0.1, spacing=0.05)
    for statistic in (Median(), Percentile(percent=20), SteepestCpf(bandwidth=0.001)):
        profile = tyre_profile(ground, path, statistic=statistic, level=True)
        assert_allclose(
            profile.height, height(path.easting, path.northing), rtol=0, atol=1e-6
        )  # the plane of least absolute residuals is found to 1e-7 m, its step


def test_the_standard_deviation_of_a_profile_is_that_of_its_errors_on_noisy_ground():
    """Discs apart from each other on a tilted plane with scanner noise, levelled."""
    height, noise = plane(0.05, 0.02), 0.0007
    x, y = np.random.default_rng(1).uniform((0, -0.05), (60, 0.05), (200_000, 2)).T
    z = height(x, y) + noise * np.random.default_rng(2).normal(size=x.size)
    path = straight_path((0.05, 0), (59.95, 0), spacing=0.06)
    for statistic in (Median(), Mean(), Window(), InverseDistance(), SteepestCpf()):
        profile = tyre_profile(
            make_points(x, y, z), path, statistic=statistic, level=True, min_count=30
        )
        error = profile.height - height(path.easting, path.northing)
        ratio = np.sqrt(np.mean((error / profile.sd) ** 2))
        assert 0.9 < ratio < 1.1


def test_a_profile_has_positions_and_provenance():
    ground = chart(plane(0, 0)).assign_attrs(crs="EPSG:25832")
    ground = provenance.add_step(ground, "read")
    path = line(0.7)
    profile = check_profile(
        tyre_profile(ground, path, area=Disc(radius=0.03), statistic=Window(), thin="nan")
    )
    for name in ("easting", "northing"):
        assert_array_equal(profile[name], getattr(path, name))
    assert_array_equal(profile.s, path.s)
    assert profile["count"].dtype == np.int64
    assert profile.attrs["crs"] == "EPSG:25832"
    assert profile.attrs["thin"] == 0
    first, last = provenance.provenance_steps(profile)
    assert (first["step"], last["step"]) == ("read", "tyre_profile")
    assert last["parameters"] == {
        "area": {"kind": "Disc", "radius": 0.03},
        "statistic": {"kind": "Window", "skip": 15.0, "size": 70.0},
        "level": False,
        "min_count": 3,
        "thin": "nan",
    }
    json.dumps(profile.attrs)  # so that every store can keep them
    points = surface_to_points(ground)
    again = tyre_profile([points, points.isel(point=slice(0, 9))], path)
    assert again.attrs["crs"] == "EPSG:25832"
    assert [step["step"] for step in provenance.provenance_steps(again)][-2:] == [
        "surface_to_points",
        "tyre_profile",
    ]


def test_the_count_is_that_of_the_heights_and_the_sd_that_of_their_scatter():
    ground = chart(plane(0.1, 0))
    path = line(0.0)
    profile = tyre_profile(ground, path, statistic=Mean())
    found = height_distributions(ground, path)
    assert_array_equal(profile["count"], found.count)
    scatter = [one.heights.std(ddof=1) / np.sqrt(one.heights.size) for one in found]
    assert_allclose(profile.sd, scatter, rtol=0, atol=1e-12)


def holey():
    """Map with a hole of 60 mm in its centre."""
    return chart(lambda x, y: np.where(np.hypot(x, y) < 0.03, np.nan, 0.2))


def test_thin_search_areas_are_an_error_that_names_the_station():
    pattern = (
        r"^1 of 11 search areas have fewer than 3 heights, the first at s = 0\.100 m \(easting "
        r"-?0\.000 m, northing -?0\.000 m\) with 0\. Choose .* \(--thin nan, thin=\"nan\"\)\.$"
    )
    with pytest.raises(CoverageError, match=pattern) as info:
        tyre_profile(holey(), line(0.3), area=Disc(radius=0.025))
    assert "\n" not in str(info.value)


def test_thin_search_areas_become_nan_if_asked_and_nothing_is_interpolated():
    for ground in (holey(), surface_to_points(holey())):
        profile = tyre_profile(ground, line(0.3), thin="nan")
        centre = np.arange(11) == 5
        assert_array_equal(np.isnan(profile.height), centre)
        assert_array_equal(np.isnan(profile.sd), centre)
        assert profile["count"][5] == 0
        assert profile.attrs["thin"] == 1
        assert_allclose(profile.height[~centre], 0.2, rtol=0, atol=PLANE)


def test_min_count_sets_the_minimum_number_of_heights():
    count = tyre_profile(holey(), line(0.3), thin="nan")["count"].values
    fewest = int(count[count > 0].min())
    profile = tyre_profile(holey(), line(0.3), thin="nan", min_count=fewest + 1)
    assert profile.attrs["thin"] > 1
    assert_array_equal(np.isnan(profile.height), count < fewest + 1)
    with pytest.raises(CoverageError, match=f"11 of 11 .* fewer than {count.max() + 1} heights"):
        tyre_profile(holey(), line(0.3), thin="nan", min_count=int(count.max()) + 1)
    single = make_points([0.0], [0.0], [0.4])
    path = straight_path((0, 0), (0.01, 0))
    one = tyre_profile(single, path, min_count=1)
    assert_array_equal(one.height, [0.4, 0.4])
    assert np.isnan(one.sd).all()


@pytest.mark.parametrize("thin", ["error", "nan"])
def test_a_path_outside_of_the_ground_is_an_error_under_any_policy(thin):
    path = straight_path((100, 100), (101, 100), spacing=0.1)
    message = r"^the path lies outside of the ground: no height within 0\.025 m .* CRS"
    blocks = [cloud(plane(0, 0)), cloud(plane(0, 0), seed=4)]
    for ground in (chart(plane(0, 0)), road(0.3, plane(0, 0)), blocks[0], blocks, []):
        with pytest.raises(CoverageError, match=message):
            tyre_profile(ground, path, thin=thin)


def test_a_path_partly_outside_is_thin_there():
    path = straight_path((-0.25, 0.003), (0.25, 0.003), spacing=0.01)
    profile = tyre_profile(chart(plane(0, 0, 1.0)), path, thin="nan")
    assert_array_equal(np.isnan(profile.height), np.abs(path.easting) > 0.171)
    # a disc half over the edge has half of the heights
    edge = np.flatnonzero(np.isclose(path.easting, 0.15))[0]
    assert profile["count"][edge] < 0.65 * profile["count"].max()


@pytest.mark.parametrize("min_count", [0, -3])
def test_a_minimum_count_must_be_at_least_one(min_count):
    with pytest.raises(ValueError, match=f"min_count must be at least 1, got {min_count}"):
        tyre_profile(holey(), line(0.3), min_count=min_count)


def test_an_unknown_policy_is_refused():
    with pytest.raises(ValueError, match="thin must be 'error' or 'nan', got 'interpolate'"):
        tyre_profile(holey(), line(0.3), thin="interpolate")  # type: ignore[arg-type] # as meant


def test_ground_of_another_kind_is_refused():
    profile = make_profile([0.0, 1.0], [0.0, 0.0])
    with pytest.raises(CoverageError, match="a profile has no ground lateral to its line"):
        tyre_profile(profile, line(0.0))
    with pytest.raises(SchemaError, match="easting"):
        tyre_profile([profile], line(0.0))
    with pytest.raises(SchemaError, match="no known kind"):
        tyre_profile(profile.drop_attrs(), line(0.0))


def test_progress_is_reported_up_to_the_end():
    calls = []
    path = line(0.3, spacing=0.0001)
    tyre_profile(chart(plane(0, 0)), path, progress=lambda *call: calls.append(call))
    assert [call[0] for call in calls] == ["profile"] * len(calls)
    done = [call[1] for call in calls]
    assert done == sorted(done)
    assert (done[-1], calls[-1][2]) == (len(path), len(path))
    assert len(calls) > 1


def test_a_point_profile_is_bilinear_between_the_nodes():
    def height(x, y):
        return 0.3 + 0.2 * x - 0.1 * y + 4.0 * x * y

    path = line(0.8, spacing=0.0013)
    profile = point_profile(chart(height), path)
    assert_allclose(profile.height, height(path.easting, path.northing), rtol=0, atol=PLANE)
    bumpy = road(0.5, lambda x, y: np.random.default_rng(1).normal(size=x.shape))
    assert_array_equal(
        point_profile(bumpy, path).height, heights_at(bumpy, path.easting, path.northing)
    )
    assert provenance.provenance_steps(profile)[-1]["step"] == "point_profile"
    assert check_profile(profile).sizes["s"] == len(path)


def test_a_point_profile_needs_a_height_everywhere():
    with pytest.raises(CoverageError, match=r"of 41 path points have no height, the first at s ="):
        point_profile(chart(plane(0, 0)), line(0.0, length=0.4, spacing=0.01))
    with pytest.raises(CoverageError, match=r"have no height"):
        point_profile(holey(), line(0.0))
    with pytest.raises(CoverageError, match="scattered points have no height between them"):
        point_profile(cloud(plane(0, 0)), line(0.0))


def test_a_single_path_point_has_a_profile():
    one = PlaneCurve(
        s=np.zeros(1), easting=np.zeros(1), northing=np.zeros(1), heading=np.zeros(1), length=0.0
    )
    assert tyre_profile(chart(plane(0, 0, 2.0)), one).height.values.tolist() == [2.0]


@pytest.fixture(scope="module")
def belgian_block(data):
    from trueterrain.formats import opencrg

    return opencrg.read(data / "opencrg" / "asam" / "belgian_block.crg")


@pytest.mark.parametrize("level", [False, True])
def test_the_belgian_block_and_its_nodes_give_the_same_profile(belgian_block, level):
    path = offset_path(belgian_block, 0.3)
    points = surface_to_points(belgian_block)
    for statistic in (Median(), InverseDistance(), SteepestCpf()):
        of_surface = tyre_profile(belgian_block, path, statistic=statistic, level=level)
        of_points = tyre_profile(points, path, statistic=statistic, level=level)
        for name in ("height", "sd", "count"):
            assert_array_equal(of_surface[name], of_points[name])  # to the last bit


def test_the_belgian_block_keeps_its_profile_through_a_laz_file(belgian_block, tmp_path):
    from trueterrain.formats import las

    file = tmp_path / "belgian_block.laz"
    las.write(surface_to_points(belgian_block), file)
    path = offset_path(belgian_block, 0.3)
    before = tyre_profile(belgian_block, path)
    after = tyre_profile(las.read(file), path)
    # rounded to 0.1 mm across, a node near the rim of a disc may get in or out of it
    tree = cKDTree(np.stack([c.ravel() for c in node_coordinates(belgian_block)], axis=1))
    at = np.stack([path.easting, path.northing], axis=1)
    inner, outer = (tree.query_ball_point(at, r, return_length=True) for r in (0.0249, 0.0251))
    rim = inner < outer
    assert rim.mean() < 0.4
    change = np.abs(after.height - before.height).values
    # the heights are rounded to 0.1 mm as well, and so is their median: half of that at most
    assert_allclose(change[~rim], 0, rtol=0, atol=0.00005 + PLANE)
    assert_array_equal(after["count"][~rim], before["count"][~rim])
    # a height more or less moves a median by half of the distance to the next one
    assert np.sqrt(np.mean(change**2)) < 0.0001
    blocks = list(las.blocks(file))
    assert_array_equal(tyre_profile(blocks, path).height, after.height)


@pytest.mark.parametrize("offset", [-0.5, 0.0, 0.3, 0.8])
def test_a_tyre_profile_of_the_belgian_block_is_smoother_than_the_line(belgian_block, offset):
    """Joints are some 13 mm deep over 100 mm; the disc takes a tenth off them, and no height."""
    path = offset_path(belgian_block, offset)
    bare, felt = (f(belgian_block, path).height.values for f in (point_profile, tyre_profile))
    assert np.diff(felt).std() < 0.93 * np.diff(bare).std()

    def depth(height):
        return np.mean(maximum_filter1d(height, 11) - minimum_filter1d(height, 11))

    assert depth(felt) < 0.93 * depth(bare)
    assert abs(felt.mean() - bare.mean()) < 0.001


@pytest.mark.parametrize("extract", [tyre_profile, point_profile, height_distributions])
def test_ground_and_path_in_the_wrong_order_are_refused(extract):
    """A surface has easting, northing and heading too, but not one of each per path point."""
    surface = road(0.3, lambda e, n: 0 * e)
    path = straight_path((-0.05, 0.0), (0.05, 0.0), spacing=0.01)
    for arguments in ((path, surface), (surface, surface)):
        with pytest.raises(TypeError, match="path must be a PlaneCurve, after the ground, got Dat"):
            extract(*arguments)
