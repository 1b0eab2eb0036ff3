"""Heights of surfaces against analytic ground and the ASAM C-API."""

import json

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core.schemas import check_points, make_surface
from trueterrain.surface import (
    grid_frame,
    heights_at,
    heights_at_uv,
    node_coordinates,
    surface_to_points,
    uv_to_xy,
)

EXACT = {"rtol": 0, "atol": 1e-12}  # [m] round-off of heights of about 1 m
C_API = {"rtol": 0, "atol": 1e-6}  # [m] the C-API holds heights as float32


def curved_road(height_of_xy=None, **optional):
    heading = 0.02 * np.arange(60)
    easting = 20 + 0.5 * np.concatenate([[0], np.cumsum(np.cos(heading))])
    northing = -5 + 0.5 * np.concatenate([[0], np.cumsum(np.sin(heading))])
    u, v = 100 + 0.5 * np.arange(61), np.array([-2.0, -1.0, 0.0, 0.25, 2.5])
    flat = make_surface(
        np.zeros((u.size, v.size)), u=u, v=v, easting=easting, northing=northing, **optional
    )
    if height_of_xy is None:
        return flat
    return flat.assign(height=flat.height.copy(data=height_of_xy(*node_coordinates(flat))))


def test_bilinear_in_u_and_v():
    road = curved_road()
    truth = 0.3 + 0.01 * road.u + 0.2 * road.v - 0.03 * (road.u - 100) * road.v
    road = road.assign(height=road.height.copy(data=truth.transpose("u", "v")))
    rng = np.random.default_rng(1)
    u, v = rng.uniform(100, 130, 2_000), rng.uniform(-2, 2.5, 2_000)
    expected = 0.3 + 0.01 * u + 0.2 * v - 0.03 * (u - 100) * v
    npt.assert_allclose(heights_at_uv(road, u, v), expected, **EXACT)
    npt.assert_allclose(heights_at(road, *uv_to_xy(grid_frame(road), u, v)), expected, **EXACT)


def test_a_plane_over_a_map():
    easting, northing = np.array([0.0, 1.0, 3.0]), np.array([5.0, 5.5, 7.0, 8.0])
    plane = make_surface(
        1 + 0.1 * easting - 0.2 * northing[:, None], easting=easting, northing=northing
    )
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 3, 500), rng.uniform(5, 8, 500)
    npt.assert_allclose(heights_at(plane, x, y), 1 + 0.1 * x - 0.2 * y, **EXACT)
    assert np.isnan(heights_at(plane, [-0.1, 3.1, 1.0, 1.0], [6.0, 6.0, 4.9, 8.1])).all()


def test_a_node_needs_itself_alone():
    road = curved_road(lambda x, y: x)
    values = road.height.values.copy()
    values[10, 2] = np.nan
    road = road.assign(height=road.height.copy(data=values))
    easting, northing = node_coordinates(road)
    at_nodes = heights_at(road, easting, northing)
    npt.assert_array_equal(np.isnan(at_nodes), np.isnan(values))
    npt.assert_allclose(at_nodes, values, rtol=0, atol=1e-9)  # a point may lie 1e-9 m off its node
    # a point on the grid line between two valid nodes does not need the missing one beside it
    assert np.isfinite(heights_at_uv(road, 105.25, 0.25))
    assert np.isnan(heights_at_uv(road, 105.25, 0.1))
    assert np.isnan(heights_at_uv(road, 105.0, 0.1))


def test_outside_and_missing_coordinates_have_no_height():
    road = curved_road()
    assert np.isnan(
        heights_at_uv(road, [99.9, 130.1, 110, 110, np.nan], [0, 0, -2.1, 2.6, 0])
    ).all()
    assert np.isnan(heights_at(road, [1e9, -1e9, np.nan], [0.0, 0.0, 0.0])).all()


def test_points_of_a_surface():
    sd = np.full((61, 5), 0.001)
    road = curved_road(lambda x, y: x + y, sd=sd, crs="EPSG:25832")
    road["height"][3, 0] = np.nan
    points = check_points(surface_to_points(road))
    assert points.sizes["point"] == 61 * 5 - 1
    npt.assert_allclose(points.up, points.easting + points.northing, **EXACT)
    npt.assert_array_equal(points.sd, 0.001)
    assert points.attrs["crs"] == "EPSG:25832"
    assert [step["step"] for step in json.loads(points.attrs["provenance"])] == [
        "surface_to_points"
    ]


def test_points_of_a_map():
    ramp = make_surface([[0.0, 1.0, 2.0], [0.0, 1.0, 2.0]], easting=[0, 1, 2], northing=[7, 8])
    points = surface_to_points(ramp)
    npt.assert_array_equal(points.up, points.easting)
    npt.assert_array_equal(points.northing, [7, 7, 7, 8, 8, 8])


@pytest.fixture(scope="module")
def crg(data):
    pycrg = pytest.importorskip("pycrg")
    with pycrg.RoadSurface.open(
        data / "opencrg/asam/belgian_block.crg", apply_modifiers=False
    ) as surface:
        yield surface


@pytest.fixture(scope="module")
def belgian_block(crg):
    grid = crg.grid()
    return make_surface(grid.elevation, u=grid.u, v=grid.v, easting=grid.x, northing=grid.y)


def test_recorded_heights_of_the_c_api(data, belgian_block):
    recorded = np.genfromtxt(
        data / "opencrg/reference/belgian_block_capi201_nomods.csv", delimiter=",", skip_header=2
    )
    u, v, x, y, z = recorded.T[:5]
    inside = (u >= 730) & (u <= 740) & (np.abs(v) <= 1.7)
    assert np.isnan(z).sum() == 39
    # beyond the grid the C-API goes on with the last height, where there is no ground
    assert np.isnan(heights_at(belgian_block, x, y)[~inside]).all()
    for ours in (heights_at(belgian_block, x, y), heights_at_uv(belgian_block, u, v)):
        npt.assert_array_equal(np.isnan(ours[inside]), np.isnan(z[inside]))
        npt.assert_allclose(ours[inside], z[inside], **C_API)


def test_live_heights_of_the_c_api(crg, belgian_block):
    rng = np.random.default_rng(5)
    u, v = rng.uniform(730, 740, 5_000), rng.uniform(-1.7, 1.7, 5_000)
    truth = crg.uv_to_z_many(u, v)
    ours = heights_at(belgian_block, *crg.uv_to_xy_many(u, v))
    npt.assert_array_equal(np.isnan(ours), np.isnan(truth))
    npt.assert_allclose(ours, truth, **C_API)
