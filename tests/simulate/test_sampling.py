"""Surfaces and points taken from a ground."""

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import kind_of
from trueterrain.simulate.ground import (
    BelgianBlock,
    Plane,
    sample_points,
    sample_road,
    sample_surface,
)

EXACT = {"rtol": 0, "atol": 1e-12}  # [m] round-off only: the truth has no noise

ramp = Plane(elevation=1.0, slope=0.1, camber=0.02)


def test_a_map_holds_the_ground_at_its_nodes():
    surface = sample_surface(ramp, easting=[0.0, 1.0, 5.0], northing=[-1.0, 2.0])
    assert kind_of(surface) == "surface"
    assert surface.height.dims == ("northing", "easting")
    npt.assert_allclose(surface.height, [[0.98, 1.08, 1.48], [1.04, 1.14, 1.54]], **EXACT)
    assert surface.attrs["crs"] == ""


def test_a_map_needs_ascending_axes():
    with pytest.raises(SchemaError, match="must ascend"):
        sample_surface(ramp, easting=[0.0, -1.0], northing=[0.0, 1.0])


def test_a_straight_road_runs_along_its_heading():
    road = sample_road(
        ramp,
        length=2.0,
        width=1.0,
        spacing_u=0.5,
        spacing_v=0.5,
        start=(3.0, 4.0),
        heading=np.pi / 2,
    )
    npt.assert_allclose(road.u, [0.0, 0.5, 1.0, 1.5, 2.0], **EXACT)
    npt.assert_allclose(road.v, [-0.5, 0.0, 0.5], **EXACT)
    npt.assert_allclose(road.easting, 3.0, **EXACT)
    npt.assert_allclose(road.northing, 4.0 + road.u, **EXACT)
    npt.assert_allclose(road.heading, np.pi / 2, **EXACT)
    truth = 1.0 + 0.1 * (3.0 - road.v.values) + 0.02 * (4.0 + road.u.values[:, None])
    npt.assert_allclose(road.height, truth, **EXACT)


@pytest.mark.parametrize("curvature", [0.05, -0.05])
def test_a_curved_road_has_equal_chords_on_a_circle(curvature):
    road = sample_road(
        ramp,
        length=40.0,
        width=4.0,
        spacing_u=2.0,
        spacing_v=1.0,
        start=(10.0, -5.0),
        heading=0.3,
        curvature=curvature,
    )
    x, y = road.easting.values, road.northing.values
    npt.assert_allclose(np.hypot(np.diff(x), np.diff(y)), 2.0, **EXACT)
    centre = 10.0 - np.sin(0.3) / curvature, -5.0 + np.cos(0.3) / curvature
    npt.assert_allclose(np.hypot(x - centre[0], y - centre[1]), 1 / abs(curvature), **EXACT)
    # A mitred normal stands on the circle, and is longer by 1 / cos(half the turn of a chord).
    i = np.arange(1, 20)
    radial = np.hypot(x[i] - centre[0], y[i] - centre[1])
    longer = 1 / np.sqrt(1 - (0.5 * curvature * 2.0) ** 2)
    inward = np.array([centre[0] - x[i], centre[1] - y[i]]) / radial * np.sign(curvature)
    for v in (-2.0, 1.0):
        truth = ramp.height(x[i] + v * longer * inward[0], y[i] + v * longer * inward[1])
        npt.assert_allclose(road.height.sel(v=v)[i], truth, **EXACT)


def test_an_odd_number_of_strips_is_centred():
    road = sample_road(ramp, length=1.0, width=0.3, spacing_u=0.5, spacing_v=0.1)
    npt.assert_allclose(road.v, [-0.15, -0.05, 0.05, 0.15], **EXACT)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"length": 1.05}, "length must be a whole multiple of spacing_u 0.1 m, got 1.05 m"),
        ({"width": 0.0}, "width must be greater than 0 m"),
        ({"spacing_v": -0.1}, "spacing_v must be greater than 0 m"),
        ({"spacing_u": np.nan}, "spacing_u must be greater than 0 m"),
        ({"curvature": 2.0}, "curvature must be less than 2 1/m"),
        ({"heading": np.inf}, "must be finite"),
    ],
)
def test_bad_roads_are_refused(parameters, message):
    good = {"length": 1.0, "width": 1.0, "spacing_u": 0.1, "spacing_v": 0.1}
    with pytest.raises(ValueError, match=message):
        sample_road(ramp, **good | parameters)


def test_points_lie_on_the_ground_and_fill_the_extent_evenly():
    points = sample_points(ramp, 40_000, (10.0, -2.0, 30.0, 2.0), seed=3)
    x, y = points.easting.values, points.northing.values
    npt.assert_allclose(points.up, ramp.height(x, y), rtol=0, atol=0)
    assert "sd" not in points
    count = np.histogram2d(x, y, bins=(5, 4), range=((10, 30), (-2, 2)))[0]
    assert count.sum() == 40_000
    npt.assert_allclose(count, 2000, rtol=0, atol=5 * np.sqrt(2000))  # 5 sd of a count


def test_noise_has_the_sd_that_is_requested():
    points = sample_points(ramp, 20_000, (0.0, 0.0, 9.0, 9.0), seed=3, noise_sd=0.002)
    error = points.up - ramp.height(points.easting, points.northing)
    normalised = float(np.sqrt(np.mean((error / points.sd) ** 2)))
    npt.assert_allclose(normalised, 1.0, rtol=0, atol=0.03)  # 6 sd of 20 000 numbers
    assert abs(float(error.mean())) < 6 * 0.002 / np.sqrt(20_000)


def test_the_seed_determines_the_points():
    points = [sample_points(ramp, 100, (0, 0, 1, 1), seed=seed) for seed in (1, 1, 2)]
    npt.assert_array_equal(points[0].easting, points[1].easting)
    assert not np.array_equal(points[0].easting, points[2].easting)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"number": 0}, "number must be"),
        ({"number": 1.5}, "number must be"),
        ({"extent": (0.0, 0.0, 0.0, 1.0)}, "extent must be"),
        ({"noise_sd": -0.1}, "noise_sd must be"),
        ({"seed": -1}, "seed must be"),
    ],
)
def test_bad_points_are_refused(parameters, message):
    good = {"number": 10, "extent": (0.0, 0.0, 1.0, 1.0)}
    with pytest.raises(ValueError, match=message):
        sample_points(ramp, **good | parameters)


def test_results_carry_the_parameters_of_their_ground():
    block = BelgianBlock(seed=5)
    road = sample_road(block, length=0.1, width=0.1, curvature=0.02)
    step = provenance.provenance_steps(road)[-1]
    assert step["step"] == "sample_road"
    assert step["parameters"]["curvature"] == 0.02
    assert step["parameters"]["ground"]["kind"] == "BelgianBlock"
    assert step["parameters"]["ground"]["seed"] == 5
    points = sample_points(block, 3, (0.0, 0.0, 1.0, 1.0), seed=2)
    assert provenance.provenance_steps(points)[-1]["parameters"]["seed"] == 2
