"""Differences of surfaces: maps, statistics, structure functions, and what cannot be compared."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.formats import open as open_file
from trueterrain.surface.difference import (
    HeightDifferences,
    difference_statistics,
    structure_function,
    surface_difference,
)

EXACT = 1e-12  # [m] round-off
U, V = np.arange(0.0, 20.0, 0.1), np.arange(-2.0, 2.05, 0.1)


def along(height, **more):
    """Surface along a straight line to the north-east."""
    place = U / np.sqrt(2)
    return make_surface(height, u=U, v=V, easting=place, northing=place, **more)


def plain(level=0.0):
    return np.full((U.size, V.size), level)


def test_a_map_and_a_surface_along_a_line_differ_by_what_they_should():
    """The difference of two planes is a plane, whatever the nodes."""
    axis = np.arange(-3.0, 20.0, 0.25)
    high = make_surface(0.05 * axis[:, None] - 0.02 * axis, easting=axis, northing=axis)
    low = along(plain(0.1))
    found = surface_difference(high, low)
    check_surface(found)
    normal = np.array([-1.0, 1.0]) / np.sqrt(2)
    easting = U[:, None] / np.sqrt(2) + V * normal[0]
    northing = U[:, None] / np.sqrt(2) + V * normal[1]
    assert_allclose(found.height, 0.05 * northing - 0.02 * easting - 0.1, rtol=0, atol=EXACT)
    assert_allclose(found.elevation, 0.0, rtol=0, atol=0)
    assert "surface_difference" in found.attrs["provenance"]


@pytest.mark.parametrize(("level", "left"), [("none", 0.3), ("median", 0.0), ("plane", 0.0)])
def test_what_is_taken_off(level, left):
    found = surface_difference(along(plain(0.5)), along(plain(0.2)), level=level)
    assert_allclose(found.height, left, rtol=0, atol=EXACT)


def test_a_plane_of_least_squares_leaves_nothing_of_a_plane_with_holes():
    height = 0.01 * U[:, None] + 0.02 * V
    height[50:60, 3:9] = np.nan
    found = surface_difference(along(height), along(plain()), level="plane")
    assert_allclose(found.height.values[np.isfinite(height)], 0.0, rtol=0, atol=EXACT)
    assert np.isnan(found.height.values[50:60, 3:9]).all()


def test_statistics_of_normal_errors():
    sd, n = 0.002, 1_000_000
    found = HeightDifferences.of(0.001 + sd * np.random.default_rng(4).standard_normal(n))
    # relative standard deviations: mean 1, rms 0.7, nmad and percentile about 1.2, over sqrt(n)
    assert_allclose([found.mean, found.median], 0.001, rtol=0, atol=5 * 1.3 * sd / np.sqrt(n))
    assert_allclose(found.rms, np.hypot(0.001, sd), rtol=0, atol=5 * sd / np.sqrt(n))
    assert_allclose(found.nmad, sd, rtol=0, atol=5 * 1.2 * sd / np.sqrt(n))
    from scipy.optimize import brentq
    from scipy.stats import norm

    inside = lambda x: norm.cdf(x, 0.001, sd) - norm.cdf(-x, 0.001, sd) - 0.95  # noqa: E731
    assert_allclose(found.p95, brentq(inside, 0, 0.1), rtol=0, atol=1e-5)


def test_outliers_do_not_move_the_nmad():
    values = np.random.default_rng(4).standard_normal(100_000)
    spoilt = np.append(values, np.full(1000, 500.0))
    assert abs(HeightDifferences.of(spoilt).nmad - 1) < 0.03
    assert HeightDifferences.of([np.nan]).n == 0


def test_lanes_take_each_node_once():
    height = plain()
    height[:, V < -1e-9] = 0.001
    found = surface_difference(along(height), along(plain()))
    right, left = (difference_statistics(found, across=lane) for lane in ((-2, 0), (0, 2)))
    assert right.n + left.n == height.size
    assert_allclose([right.mean, left.mean], [0.001, 0.0], rtol=0, atol=EXACT)
    both = difference_statistics([found, found])
    assert both.n == 2 * height.size


def test_noise_has_the_same_structure_at_every_distance():
    """Independent errors: the mean of (a - b)² is 2 sd²."""
    sd = 0.001
    noise = sd * np.random.default_rng(1).standard_normal((U.size, V.size))
    noise[20:30, 5:9] = np.nan
    difference = surface_difference(along(noise), along(plain()))
    for axis in ("along", "across"):
        found = structure_function(difference, axis=axis)
        # n pairs whose squares have relative sd sqrt(2), neighbours correlated by 1/4
        bound = 4 * np.sqrt(3 / found.pairs.min().item())
        assert_allclose(found.structure / (2 * sd**2), 1.0, rtol=0, atol=bound)
        assert found.distance[0] == pytest.approx(0.1)


def test_drift_grows_with_the_square_of_the_distance():
    found = structure_function(
        surface_difference(along(0.001 * U[:, None] + 0 * V), along(plain()))
    )
    assert_allclose(found.structure, 1e-6 * found.distance**2, rtol=0, atol=EXACT)
    assert found.distance[-1] == pytest.approx(10.0)


def test_a_wave_has_the_structure_of_a_cosine():
    amplitude, length = 0.002, 2.0  # ten whole waves
    wave = amplitude * np.sin(2 * np.pi * U / length)[:, None] + 0 * V
    found = structure_function(surface_difference(along(wave), along(plain())))
    expected = amplitude**2 * (1 - np.cos(2 * np.pi * found.distance / length))
    # pairs at the ends are not whole waves: at most one wave of 2 m in the 10 m that pairs span
    assert_allclose(found.structure, expected, rtol=0, atol=0.1 * amplitude**2)


def test_a_measured_surface_agrees_with_its_coarser_self(data):
    fine = open_file(data / "opencrg" / "asam" / "belgian_block.crg")
    coarse = fine.isel(v=slice(0, None, 2))
    found = difference_statistics(surface_difference(coarse, coarse))
    assert (found.rms, found.largest) == (0.0, 0.0)
    onto = surface_difference(fine, coarse)
    assert_allclose(difference_statistics(onto).largest, 0.0, rtol=0, atol=1e-9)


def test_unlike_reference_systems_are_refused():
    one, other = along(plain(), crs="EPSG:25832"), along(plain(), crs="EPSG:25833")
    with pytest.raises(SchemaError, match=r"zone 32N, but the reference in .* zone 33N"):
        surface_difference(one, other)
    from pyproj import CRS

    same = along(plain(), crs=CRS.from_epsg(25832).to_wkt())
    assert surface_difference(one, same).attrs["crs"] == same.attrs["crs"]


def test_an_unknown_reference_system_is_a_warning():
    with pytest.warns(UserWarning, match="only the surface has .*; the reference is assumed"):
        surface_difference(along(plain(), crs="EPSG:25832"), along(plain()))
    with pytest.warns(UserWarning, match="only the reference has .*; the surface is assumed"):
        surface_difference(along(plain()), along(plain(), crs="EPSG:25832"))


def test_surfaces_that_do_not_overlap_are_refused():
    away = make_surface(plain(), u=U, v=V, easting=U + 500, northing=0 * U)
    with pytest.raises(
        CoverageError, match=r"have no node with a height in common: .*easting 500.0 to 519.9 m"
    ):
        surface_difference(away, along(plain()))


def test_heights_in_feet_are_questioned():
    with pytest.warns(UserWarning, match="are those of the surface in feet"):
        surface_difference(along(plain(120.0 / 0.3048)), along(plain(120.0)))


def test_bad_arguments_are_refused():
    found = surface_difference(along(plain()), along(plain()))
    with pytest.raises(ValueError, match="level must be none, median or plane"):
        surface_difference(along(plain()), along(plain()), level="mean")
    with pytest.raises(ValueError, match="across must be a right edge"):
        difference_statistics(found, across=(1.0, 0.0))
    with pytest.raises(ValueError, match="axis must be along or across"):
        structure_function(found, axis="up")
    with pytest.raises(ValueError, match="per_decade must be at least 1"):
        structure_function(found, per_decade=0)
    axis = np.array([0.0, 1.0, 3.0])
    uneven = make_surface(np.zeros((3, 3)), easting=axis, northing=axis)
    with pytest.raises(SchemaError, match="axis easting: must be equally spaced, got spacings"):
        structure_function(uneven)
    with pytest.raises(SchemaError, match="is a map, which has no lanes"):
        difference_statistics(uneven, across=(-1.0, 1.0))
