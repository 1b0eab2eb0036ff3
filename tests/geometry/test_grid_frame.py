"""Geometry of surfaces against analytic lines, a brute-force search, and the ASAM C-API."""

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import make_surface
from trueterrain.surface import GridFrame, grid_frame, node_coordinates, uv_to_xy, xy_to_uv

ROUND_TRIP = {"rtol": 0, "atol": 1e-10}  # [m] round-off of coordinates of up to 1 km
C_API = {"rtol": 0, "atol": 1e-9}  # [m] the recorded points carry 17 digits
UTM_ROUND_TRIP = {"rtol": 0, "atol": 5e-9}  # [m] a double near 5.4e6 m is rounded by 1e-9 m


def road(heading, *, du=0.5, half_width=2.0, start=(0.0, 0.0), dv=0.5):
    """Flat surface whose reference line has the given headings of its chords [rad]."""
    heading = np.asarray(heading, float)
    easting = start[0] + du * np.concatenate([[0], np.cumsum(np.cos(heading))])
    northing = start[1] + du * np.concatenate([[0], np.cumsum(np.sin(heading))])
    u = du * np.arange(easting.size)
    v = np.arange(-half_width, half_width + dv / 2, dv)
    return make_surface(np.zeros((u.size, v.size)), u=u, v=v, easting=easting, northing=northing)


def wiggly(n=400, **settings):
    s = np.arange(n)
    return road(0.8 * np.sin(s / 37.0) + 0.3 * np.cos(s / 11.0), **settings)


def brute_force(frame: GridFrame, x, y):
    """Grid coordinates of one point by looking at every strip: nearest reference line wins."""
    _, *lines = frame.sections
    p, n = np.stack(lines[:2], axis=1), np.stack(lines[2:], axis=1)
    best = (np.inf, np.nan, np.nan)
    for i in range(frame.u.size - 1):
        chord = p[i + 1] - p[i]
        length = np.hypot(*chord)
        across = np.dot([x, y] - p[i], [-chord[1], chord[0]]) / length
        if not frame.v[0] <= across <= frame.v[-1]:
            continue
        a, b = p[i] + across * n[i], p[i + 1] + across * n[i + 1]
        if np.dot(b - a, chord) <= 0:
            continue
        t = np.dot([x, y] - a, b - a) / np.dot(b - a, b - a)
        if 0 <= t <= 1 and abs(across) < best[0]:
            best = (abs(across), (1 - t) * frame.u[i] + t * frame.u[i + 1], across)
    return best[1:]


def random_points(frame: GridFrame, n, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(frame.u[0], frame.u[-1], n), rng.uniform(frame.v[0], frame.v[-1], n)


def test_a_straight_road_is_a_rotated_rectangle():
    heading = 0.7
    frame = grid_frame(road(np.full(20, heading), start=(100.0, -50.0)))
    u, v = random_points(frame, 500)
    along, left = (np.cos(heading), np.sin(heading)), (-np.sin(heading), np.cos(heading))
    easting, northing = uv_to_xy(frame, u, v)
    npt.assert_allclose(easting, 100 + u * along[0] + v * left[0], **ROUND_TRIP)
    npt.assert_allclose(northing, -50 + u * along[1] + v * left[1], **ROUND_TRIP)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_lines_of_equal_v_around_a_circle_are_polygons_at_distance_v(side):
    n, radius = 90, 30.0
    du = 2 * radius * np.sin(np.pi / n)
    heading = side * 2 * np.pi / n * (np.arange(n // 2) + 0.5)
    surface = road(heading, du=du)
    easting, northing = node_coordinates(surface)
    # starting at the origin, the centre lies to the left (right) at the radius
    distance = np.hypot(easting, northing - side * radius)
    half = np.pi / n
    inner = radius - side * surface.v.values / np.cos(half)
    npt.assert_allclose(distance[1:-1], np.broadcast_to(inner, distance[1:-1].shape), **ROUND_TRIP)


@pytest.mark.parametrize("n", [2, 3, 50, 1000])
def test_round_trip_on_a_wiggly_road(n):
    frame = grid_frame(wiggly(n))
    u, v = random_points(frame, 20_000)
    back = xy_to_uv(frame, *uv_to_xy(frame, u, v))
    npt.assert_allclose(back[0], u, **ROUND_TRIP)
    npt.assert_allclose(back[1], v, **ROUND_TRIP)


@given(
    st.lists(st.floats(-0.1, 0.1), min_size=2, max_size=60),
    st.floats(-3.0, 3.0),
    st.floats(0.1, 0.9),
)
def test_round_trip_on_any_line_that_does_not_fold(turns, start, fraction):
    heading = np.clip(np.cumsum(turns), -1.5, 1.5) + start
    frame = grid_frame(road(heading, du=0.5, half_width=2.0))
    u = frame.u[0] + fraction * (frame.u[-1] - frame.u[0])
    for v in (-2.0, -0.3, 0.0, 2.0):
        back = xy_to_uv(frame, *uv_to_xy(frame, u, v))
        npt.assert_allclose(back, [u, v], **ROUND_TRIP)


def test_round_trip_in_map_coordinates():
    frame = grid_frame(wiggly(start=(691_234.5, 5_334_567.25)))
    u, v = random_points(frame, 5_000)
    back = xy_to_uv(frame, *uv_to_xy(frame, u, v))
    npt.assert_allclose(back[0], u, **UTM_ROUND_TRIP)
    npt.assert_allclose(back[1], v, **UTM_ROUND_TRIP)


def test_nodes_and_edges_are_inside_and_points_beyond_are_not():
    surface = wiggly(start=(691_234.5, 5_334_567.25))
    frame = grid_frame(surface)
    u, v = xy_to_uv(frame, *node_coordinates(surface))
    npt.assert_allclose(u, np.broadcast_to(frame.u[:, None], u.shape), **UTM_ROUND_TRIP)
    npt.assert_allclose(v, np.broadcast_to(frame.v, v.shape), **UTM_ROUND_TRIP)
    beyond = 10 * frame.edge
    for at in (
        [-beyond, 0.0],
        [frame.u[-1] + beyond, 0.0],
        [50.0, 2 + beyond],
        [50.0, -2 - beyond],
    ):
        assert np.isnan(xy_to_uv(frame, *uv_to_xy(frame, *at))).all()
    assert np.isnan(xy_to_uv(frame, [np.nan, 0.0, np.inf], [0.0, np.nan, 0.0])).all()


def test_the_order_of_the_points_does_not_matter():
    frame = grid_frame(wiggly())
    u, v = random_points(frame, 5_000)
    x, y = uv_to_xy(frame, np.sort(u), v)
    shuffle = np.random.default_rng(2).permutation(x.size)
    ordered = np.stack(xy_to_uv(frame, x, y))
    npt.assert_array_equal(np.stack(xy_to_uv(frame, x[shuffle], y[shuffle])), ordered[:, shuffle])


def closed_loop():
    return road(2 * np.pi / 100 * (np.arange(100) + 0.5))


def hairpin():
    """Two legs 4.2 m apart whose sides of 2 m all but touch."""
    turn = np.pi * (np.arange(14) + 0.5) / 14
    return road(np.concatenate([np.zeros(60), turn, np.full(60, np.pi)]))


def figure_eight():
    turn = 2 * np.pi * (np.arange(120) + 0.5) / 120
    return road(np.concatenate([np.zeros(10), turn, -turn]))


def folded():
    """Chords that turn by 40 degrees within the width of the road."""
    return road(np.deg2rad(40) * (np.arange(30) % 2))


def off_centre():
    """Grid far to the left of a line that turns right: blocks of more than half a turn."""
    heading = -0.5 * np.arange(8)
    surface = road(heading)
    return surface.assign_coords(v=surface.v + 8)


@pytest.mark.slow
@pytest.mark.parametrize("make", [closed_loop, hairpin, figure_eight, folded, off_centre, wiggly])
def test_every_point_is_found_as_by_looking_at_every_strip(make):
    frame = grid_frame(make())
    rng = np.random.default_rng(3)
    x, y = uv_to_xy(frame, *random_points(frame, 300))
    x = np.concatenate([x, rng.uniform(x.min() - 2, x.max() + 2, 300)])
    y = np.concatenate([y, rng.uniform(y.min() - 2, y.max() + 2, 300)])
    expected = np.array([brute_force(frame, *at) for at in zip(x, y, strict=True)]).T
    found = np.stack(xy_to_uv(frame, x, y))
    npt.assert_array_equal(np.isnan(found), np.isnan(expected))
    npt.assert_allclose(found, expected, **ROUND_TRIP)


def test_a_hairpin_keeps_its_legs_apart():
    frame = grid_frame(hairpin())
    u, v = random_points(frame, 3_000)
    back = xy_to_uv(frame, *uv_to_xy(frame, u, v))
    npt.assert_allclose(back[0], u, **ROUND_TRIP)
    npt.assert_allclose(back[1], v, **ROUND_TRIP)


def test_a_map_is_its_own_grid():
    surface = make_surface(
        np.zeros((3, 4)), easting=[10.0, 11.0, 13.0, 14.0], northing=[5e6, 5e6 + 1, 5e6 + 2]
    )
    frame = grid_frame(surface)
    u, v = xy_to_uv(frame, [10.0, 12.5, 14.1], [5e6, 5e6 + 1.25, 5e6])
    npt.assert_array_equal(u, [10.0, 12.5, np.nan])
    npt.assert_array_equal(v, [5e6, 5e6 + 1.25, np.nan])
    npt.assert_array_equal(np.stack(uv_to_xy(frame, 12.5, 5e6 + 0.5)), [12.5, 5e6 + 0.5])


def test_shapes_broadcast():
    frame = grid_frame(wiggly())
    easting, northing = uv_to_xy(frame, frame.u[:, None], frame.v)
    assert easting.shape == northing.shape == (frame.u.size, frame.v.size)
    assert xy_to_uv(frame, 1.0, 0.0)[0].shape == ()


def test_a_long_road_needs_no_large_index():
    frame = grid_frame(road(np.full(200_000, 0.7), du=0.1))
    assert frame.strips.index.bucket_starts.size < 2_000_000
    u, v = random_points(frame, 1_000)
    npt.assert_allclose(xy_to_uv(frame, *uv_to_xy(frame, u, v))[0], u, rtol=0, atol=1e-8)


def test_nodes_that_coincide_are_named():
    with pytest.raises(SchemaError, match="nodes 1 and 2: coincide"):
        grid_frame(
            make_surface(
                np.zeros((4, 2)), u=range(4), v=[0, 1], easting=[0, 1, 1, 2], northing=[0, 0, 0, 0]
            )
        )


def test_a_line_that_doubles_back_is_named():
    with pytest.raises(SchemaError, match="node 1: turns by 180 degrees"):
        grid_frame(
            make_surface(
                np.zeros((3, 2)), u=range(3), v=[0, 1], easting=[0, 1, 0], northing=[0, 0, 0]
            )
        )


@pytest.fixture(scope="module")
def belgian_block(data):
    pycrg = pytest.importorskip("pycrg")
    with pycrg.RoadSurface.open(
        data / "opencrg/asam/belgian_block.crg", apply_modifiers=False
    ) as road_surface:
        yield road_surface


@pytest.fixture(scope="module")
def belgian_frame(belgian_block):
    grid = belgian_block.grid()
    return grid_frame(
        make_surface(grid.elevation, u=grid.u, v=grid.v, easting=grid.x, northing=grid.y)
    )


def test_recorded_points_of_the_c_api(data, belgian_frame):
    recorded = np.genfromtxt(
        data / "opencrg/reference/belgian_block_capi201_nomods.csv", delimiter=",", skip_header=2
    )
    u, v, x, y = recorded.T[:4]
    npt.assert_allclose(np.stack(uv_to_xy(belgian_frame, u, v)), [x, y], **C_API)
    inside = (u >= 730) & (u <= 740) & (np.abs(v) <= 1.7)
    back = np.stack(xy_to_uv(belgian_frame, x, y))
    npt.assert_allclose(back[:, inside], np.stack([u, v])[:, inside], **C_API)
    assert np.isnan(back[:, ~inside]).all()
    assert inside.sum() == 2003  # 4 of the 2007 lie beyond the grid on purpose


def test_live_c_api(belgian_block, belgian_frame):
    u, v = random_points(belgian_frame, 2_000)
    x, y = belgian_block.uv_to_xy_many(u, v)
    npt.assert_allclose(np.stack(uv_to_xy(belgian_frame, u, v)), [x, y], **C_API)
    npt.assert_allclose(np.stack(xy_to_uv(belgian_frame, x, y)), [u, v], **C_API)
