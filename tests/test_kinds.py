"""The schemas accept what they promise and name what they refuse."""

import numpy as np
import pytest
import xarray as xr

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import (
    check_points,
    check_profile,
    check_surface,
    kind_of,
    make_points,
    make_profile,
    make_surface,
)

NODES = np.arange(4.0)


def road(**changes):
    arguments = {
        "height": np.zeros((4, 3)),
        "u": NODES,
        "v": [-1.0, 0.0, 1.0],
        "easting": NODES,
        "northing": np.zeros(4),
    }
    return make_surface(**{**arguments, **changes})


def test_points_carry_units_kind_and_crs():
    points = make_points([0.0], [1.0], [2.0], crs="EPSG:25832", lane=[3])
    assert points.easting.attrs["units"] == "m"
    assert points.attrs["crs"] == "EPSG:25832"
    assert kind_of(points) == "points"


def test_points_of_different_lengths_are_refused():
    with pytest.raises(SchemaError, match=r"northing.*has 1 values along point"):
        make_points([0.0, 1.0], [1.0], [2.0, 3.0])


def test_an_unknown_variable_is_refused_with_the_known_ones():
    with pytest.raises(SchemaError, match=r"colour.*is unknown; known are easting"):
        make_points([0.0], [1.0], [2.0], colour=[1])


def test_a_missing_variable_is_named_with_the_file():
    points = make_points([0.0], [1.0], [2.0]).drop_vars("up")
    with pytest.raises(SchemaError, match=r"scan.laz: variable up: is missing"):
        check_points(points, path="scan.laz")


def test_a_wrong_unit_is_refused():
    points = make_points([0.0], [1.0], [2.0])
    points["up"].attrs["units"] = "ft"
    with pytest.raises(SchemaError, match="variable up: must be in m, got units 'ft'"):
        check_points(points)


def test_headings_of_a_surface_follow_from_its_nodes():
    surface = road(easting=[0.0, 1.0, 1.0, 0.0], northing=[0.0, 0.0, 1.0, 1.0])
    # chords east, north, west; the first node repeats the first chord; no jump by a turn
    np.testing.assert_allclose(surface.heading, [0, 0, np.pi / 2, np.pi], rtol=0, atol=1e-15)


def test_a_surface_must_ascend():
    with pytest.raises(SchemaError, match=r"axis u: must ascend, but value 2 \(1\) follows 1"):
        road(u=[0.0, 1.0, 1.0, 2.0])


def test_a_surface_needs_two_nodes_along_each_axis():
    with pytest.raises(SchemaError, match="axis v: must have at least 2 nodes"):
        road(height=np.zeros((4, 1)), v=[0.0])


def test_a_reference_line_must_be_finite():
    with pytest.raises(SchemaError, match="variable elevation: must be finite everywhere"):
        road(elevation=[0.0, np.nan, 0.0, 0.0])


def test_a_map_has_no_reference_line():
    surface = make_surface(np.zeros((2, 3)), easting=[0, 1, 2], northing=[5, 6])
    assert surface.height.dims == ("northing", "easting")
    assert check_surface(surface) is surface


def test_swapped_axes_are_refused():
    with pytest.raises(SchemaError, match="variable height: has 3 values along u"):
        road(height=np.zeros((3, 4)))


def test_profiles_have_one_track_or_several():
    single = make_profile([0.0, 1.0], [0.0, 0.1])
    double = make_profile([0.0, 1.0], [[0.0, 0.1], [0.2, 0.3]], tracks=["left", "right"])
    assert single.height.dims == ("s",)
    assert list(double.track.values) == ["left", "right"]


@pytest.mark.parametrize("s", [[0.0, 0.0], [1.0, 0.0], [0.0, np.nan]])
def test_a_profile_must_ascend(s):
    with pytest.raises(SchemaError, match="axis s: must"):
        make_profile(s, [0.0, 0.1])


def test_an_empty_profile_is_refused():
    with pytest.raises(SchemaError, match="axis s: is empty"):
        make_profile([], [])


def test_a_profile_without_its_axis_is_refused():
    with pytest.raises(SchemaError, match="axis s: is missing"):
        check_profile(xr.Dataset({"height": ("s", [0.0, 1.0])}))


def test_a_dataset_from_elsewhere_has_no_kind():
    with pytest.raises(SchemaError, match="has no known kind"):
        kind_of(xr.Dataset())
