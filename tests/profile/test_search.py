"""Gathering of heights from grids and points, for any order, blocks and threads."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import cKDTree

from trueterrain.core.schemas import make_points, make_surface
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
    straight_path,
    tyre_profile,
)
from trueterrain.profile.area import EDGE_TOLERANCE
from trueterrain.surface import node_coordinates, surface_to_points

AREAS = [Disc(radius=0.06), Ellipse(length=0.2, width=0.07), Rectangle(length=0.16, width=0.09)]
STATISTICS = [
    Median(),
    Median(resolution=0.001),
    Mean(),
    Percentile(percent=20),
    Percentile(percent=85, resolution=0.001),
    Window(),
    Window(skip=10, size=25),
    InverseDistance(),
    InverseDistance(of="median", power=1.5),
    SteepestCpf(),
    SteepestCpf(bandwidth=0.004),
]


def brute_force(easting, northing, height, path, area):
    """Indices of the heights inside each search area, from all pairs and the definition."""
    inside = []
    for x, y, heading in zip(path.easting, path.northing, path.heading, strict=True):
        along = np.cos(heading) * (easting - x) + np.sin(heading) * (northing - y)
        across = np.cos(heading) * (northing - y) - np.sin(heading) * (easting - x)
        a, b = np.array(area.half_axes) + EDGE_TOLERANCE
        if isinstance(area, Rectangle):
            found = (np.abs(along) <= a) & (np.abs(across) <= b)
        else:
            found = (along / a) ** 2 + (across / b) ** 2 <= 1
        inside.append(np.flatnonzero(found & np.isfinite(height)))
    return inside


def check_against_brute_force(ground, path, area):
    if "point" in ground.dims:
        columns = [np.asarray(ground[name]) for name in ("easting", "northing", "up")]
    else:
        columns = [c.ravel() for c in (*node_coordinates(ground), ground.height.values)]
    found = height_distributions(ground, path, area=area)
    wanted = brute_force(*columns, path, area)
    assert_array_equal(found.count, [w.size for w in wanted])
    for k, w in enumerate(wanted):
        assert_array_equal(found[k].heights, np.sort(columns[2][w]))
        away = np.hypot(columns[0][w] - path.easting[k], columns[1][w] - path.northing[k])
        order = np.argsort(columns[2][w])  # heights are drawn, so that no two are equal
        assert_allclose(found[k].distances, away[order], rtol=0, atol=1e-12)
    return found.count


def rough(shape, seed=7):
    return np.random.default_rng(seed).normal(0, 0.01, shape)


def bend(radius=0.8, turn=2.0, nu=200, v=None, seed=7):
    """Road along a narrow bend to the left, with an uneven grid across."""
    angle = np.linspace(0, turn, nu)
    v = np.sort(np.random.default_rng(seed).uniform(-0.5, 0.5, 60)) if v is None else v
    return make_surface(
        rough((nu, v.size), seed),
        u=radius * angle,
        v=v,
        easting=100 + radius * np.sin(angle),
        northing=-50 + radius * (1 - np.cos(angle)),
    )


def chicane(seed=3):
    s = np.linspace(0, 4, 401)
    heading = 0.9 * np.sin(2 * s) + 0.3
    step = np.diff(s)
    x = np.concatenate([[0], np.cumsum(step * np.cos(heading[1:]))])
    y = np.concatenate([[0], np.cumsum(step * np.sin(heading[1:]))])
    height = rough((s.size, 41), seed)
    height[np.random.default_rng(seed).uniform(size=height.shape) < 0.2] = np.nan
    return make_surface(height, u=s, v=np.linspace(-0.2, 0.2, 41), easting=x, northing=y)


def chart(seed=5):
    rng = np.random.default_rng(seed)
    return make_surface(
        rough((70, 90), seed),
        easting=np.cumsum(rng.uniform(0.01, 0.04, 90)),
        northing=5e6 + np.cumsum(rng.uniform(0.01, 0.04, 70)),
    )


SURFACES = {"bend": bend(), "chicane": chicane(), "map": chart()}


def random_points(count=30_000, seed=11, length=4.0):
    rng = np.random.default_rng(seed)
    return make_points(
        rng.uniform(0, length, count), rng.uniform(0, 0.6, count), rng.normal(0, 0.01, count)
    )


def across(surface, angle, length=1.4, spacing=0.031, at=None):
    """Path at an angle through the centre of a surface, and out of it on both sides."""
    easting, northing = node_coordinates(surface)
    centre = (easting.mean(), northing.mean()) if at is None else at
    ahead = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
    return straight_path(tuple(centre - ahead), tuple(centre + ahead), spacing=spacing)


@pytest.mark.parametrize("area", AREAS)
@pytest.mark.parametrize("offset", [-0.19, 0.0, 0.123])
@pytest.mark.parametrize("name", ["bend", "chicane"])
def test_a_path_along_a_grid_finds_the_nodes_of_brute_force(name, offset, area):
    path = offset_path(SURFACES[name], offset, spacing=0.023)
    count = check_against_brute_force(SURFACES[name], path, area)
    assert (count > 0).all()


@settings(max_examples=40)
@given(
    st.sampled_from(sorted(SURFACES)),
    st.floats(-np.pi, np.pi),
    st.sampled_from(AREAS),
    st.integers(0, 10_000),
)
def test_a_path_at_any_angle_and_partly_outside_finds_the_nodes_of_brute_force(
    name, angle, area, node
):
    surface = SURFACES[name]
    easting, northing = node_coordinates(surface)
    node %= easting.size
    path = across(surface, angle, at=(easting.flat[node], northing.flat[node]))
    check_against_brute_force(surface, path, area)


@pytest.mark.parametrize("area", [*AREAS, Disc(radius=0.9)])
def test_scattered_points_are_those_of_brute_force(area):
    points = random_points(8000)
    points.up[::7] = np.nan
    path = straight_path((-0.5, 0.1), (4.5, 0.55), spacing=0.037)
    count = check_against_brute_force(points, path, area)
    assert count.max() > 10
    assert count[0] == 0 or area.half_axes[0] > 0.5  # the path begins outside


def test_scattered_points_are_those_of_a_tree():
    points = random_points(200_000)
    path = straight_path((0.1, 0.1), (3.9, 0.5), spacing=0.01)
    found = height_distributions(points, path)
    tree = cKDTree(np.stack([points.easting, points.northing], axis=1))
    near = tree.query_ball_point(np.stack([path.easting, path.northing], axis=1), 0.025)
    for one, indices in zip(found, near, strict=True):
        assert_array_equal(one.heights, np.sort(points.up.values[indices]))


def test_a_path_over_the_same_ground_twice_gathers_it_twice():
    points = random_points(5000)
    there = straight_path((0.5, 0.3), (3.5, 0.3), spacing=0.05)
    back = straight_path((3.5, 0.3), (0.5, 0.3), spacing=0.05)
    both = PlaneCurve(
        s=np.arange(2.0 * len(there)),
        easting=np.concatenate([there.easting, back.easting]),
        northing=np.concatenate([there.northing, back.northing]),
        heading=np.concatenate([there.heading, back.heading]),
        length=6.0,
    )
    check_against_brute_force(points, both, Disc(radius=0.05))


def closed_loop(nodes=1201, radius=3.0, turn=2 * np.pi, lift=0.0):
    """Road that ends where it began: the last row of nodes lies on the first one."""
    angle = np.linspace(0, turn, nodes)
    height = rough((nodes, 21), 9)
    return make_surface(
        height + lift * angle[:, None],
        u=radius * angle,
        v=np.linspace(-0.2, 0.2, 21),
        easting=radius * np.cos(angle),
        northing=radius * np.sin(angle),
    )


@pytest.mark.parametrize("turn", [2 * np.pi, 2 * np.pi - 0.005, 0.99 * 2 * np.pi])
def test_search_areas_reach_over_the_seam_of_a_closed_loop(turn):
    loop = closed_loop(turn=turn)
    path = across(loop, np.pi / 2, 0.6, 0.01, at=(3.05, 0.0))
    count = check_against_brute_force(loop, path, Disc(radius=0.06))
    assert (count[10:-10] > 0).all() or turn < 6.25  # there the gap is 0.2 m wide
    for offset in (-0.1, 0.2):
        along = offset_path(loop, offset, spacing=0.02)
        check_against_brute_force(loop, along.part(0, 10), Disc(radius=0.06))
        check_against_brute_force(loop, along.part(len(along) - 10, len(along)), Disc(radius=0.06))


def test_search_areas_reach_over_the_gap_of_a_hairpin():
    """Two lanes side by side, joined by a bend of 20 mm inner radius."""
    straight = np.arange(0, 1, 0.01)
    angle = np.linspace(0, np.pi, 60)[1:-1]
    x = np.concatenate([straight, 1 + 0.22 * np.sin(angle), straight[::-1]])
    y = np.concatenate([0 * straight, 0.22 * (1 - np.cos(angle)), 0 * straight + 0.44])
    u = np.concatenate([[0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    surface = make_surface(
        rough((u.size, 41)), u=u, v=np.linspace(-0.2, 0.2, 41), easting=x, northing=y
    )
    path = offset_path(surface, 0.19, spacing=0.01)  # 60 mm from its own return
    check_against_brute_force(surface, path, Disc(radius=0.08))


def parts(data, sizes):
    begin = 0
    for size in sizes:
        yield data.isel(point=slice(begin, begin + size))
        begin += size


def quantised(points, step):
    return points.assign(up=("point", np.round(points.up.values / step) * step, points.up.attrs))


def same(one, other, names=("height", "sd", "count")):
    for name in names:
        assert_array_equal(one[name], other[name])  # to the last bit


@pytest.mark.parametrize("step", [None, 0.001, 0.02])
@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("statistic", STATISTICS, ids=str)
def test_results_depend_on_neither_order_nor_blocks_nor_threads(statistic, level, step):
    points = random_points(4_000, length=0.8)
    if step is not None:
        points = quantised(points, step)  # many ties: 20 mm leaves three heights or so
    path = straight_path((0.1, 0.1), (0.7, 0.5), spacing=0.05)
    settings = {"area": Disc(radius=0.06), "statistic": statistic, "level": level}
    whole = tyre_profile(points, path, **settings)
    assert whole["count"].max() > 48  # long enough for the other sorting algorithm
    rng = np.random.default_rng(2)
    shuffled = points.isel(point=rng.permutation(points.sizes["point"]))
    same(tyre_profile(shuffled, path, **settings), whole)
    blocks = list(parts(shuffled, [1, 0, 1400, 2599]))
    same(tyre_profile(blocks, path, **settings), whole)
    same(tyre_profile(iter(blocks[::-1]), path, **settings), whole)
    try:
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        same(tyre_profile(points, path, **settings), whole)
    finally:
        numba.set_num_threads(1)


def test_results_do_not_depend_on_the_size_of_blocks_of_the_path(monkeypatch):
    points = random_points(4_000, length=0.8)
    path = straight_path((0.1, 0.1), (0.7, 0.5), spacing=0.005)
    whole = tyre_profile(points, path)
    for heights in (1, 500):
        monkeypatch.setattr("trueterrain.profile.extract._HEIGHTS", heights)
        monkeypatch.setattr("trueterrain.profile.extract._FIRST_BLOCK", 3)
        same(tyre_profile(points, path), whole)


@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("statistic", STATISTICS, ids=str)
def test_a_surface_and_its_nodes_as_points_give_the_same_profile(statistic, level):
    settings = {"area": Disc(radius=0.06), "statistic": statistic, "level": level, "thin": "nan"}
    for surface in SURFACES.values():
        points = surface_to_points(surface)
        for path in (across(surface, 0.4), across(surface, 2.0)):
            one = tyre_profile(surface, path, **settings)
            assert np.isfinite(one.height).sum() > 5
            same(tyre_profile(points, path, **settings), one)


def test_heights_far_from_the_path_are_not_kept():
    """Memory holds the neighbourhood of the path, never the survey."""
    from trueterrain.profile.search.gather import ScatteredHeights

    path = straight_path((0.1, 0.3), (3.9, 0.3), spacing=0.01)
    scattered = ScatteredHeights(path, Disc())
    scattered.add(random_points(100_000))
    kept = sum(len(points) for _, points in scattered._kept)
    strip = 2 * 0.05 / 0.6  # at most two rows of cells, twice the radius wide each
    assert kept < 1.1 * strip * 100_000


def test_flat_ground_in_a_large_area_takes_no_quadratic_time():
    """40,000 equal heights: 0.3 s sorted, an hour by insertion."""
    axis = 0.005 * np.arange(250)
    flat = make_surface(np.zeros((250, 250)), easting=axis, northing=axis)
    path = straight_path((0.6, 0.6), (0.61, 0.6))
    found = height_distributions(flat, path, area=Disc(radius=0.57))
    assert found.count[0] > 40_000
    assert (np.diff(found[0].distances) >= 0).all()  # equal heights lie in order of distance


def test_infinite_heights_are_ignored():
    surface = bend()
    surface.height[::3, ::2] = np.inf
    path = offset_path(surface, 0.05, spacing=0.03)
    check_against_brute_force(surface, path, Disc(radius=0.06))
    points = random_points(3000)
    points.up[::5] = -np.inf
    check_against_brute_force(points, straight_path((0, 0.3), (4, 0.3)), Disc(radius=0.06))
