"""Plane curves against circles and straight lines."""

import numpy as np
import numpy.testing as npt
import pytest

import trueterrain.geometry.path
import trueterrain.profile
from trueterrain.geometry.curve import PlaneCurve, curve_of_points, polyline_curve

EXACT = {"rtol": 0, "atol": 1e-9}  # [m] round-off of coordinates of up to 1 km
RADIUS = 20.0  # [m]


def circle(count: int, parts: int, begin: float = 0.0) -> PlaneCurve:
    """Some of the corners of a regular polygon, at stations of the circle around it."""
    angle = 2 * np.pi / parts * np.arange(count)
    return curve_of_points(
        begin + RADIUS * angle,
        RADIUS * np.cos(angle),
        RADIUS * np.sin(angle),
        closed=count == parts,
    )


def test_headings_are_tangents_of_a_circle() -> None:
    for curve in (circle(60, 60), circle(30, 60)):
        inner = slice(None) if curve.closed else slice(1, -1)
        tangent = curve.s / RADIUS + np.pi / 2
        off = np.angle(np.exp(1j * (curve.heading - tangent)))
        npt.assert_allclose(off[inner], 0.0, rtol=0, atol=1e-12)


def test_curvature_is_that_of_a_polygon() -> None:
    turn = 2 * np.pi / 600
    # cross product of two chords of 2 R sin(turn / 2), over the cube of the arc R turn
    wanted = 4 * np.sin(turn / 2) ** 2 * np.sin(turn) / turn**3 / RADIUS
    npt.assert_allclose(circle(300, 600).curvature, wanted, rtol=0, atol=1e-9)


def test_a_closed_curve_goes_on_around() -> None:
    ring = circle(60, 60)
    assert ring.length == pytest.approx(2 * np.pi * RADIUS, abs=1e-12)
    more = ring.extend(3)
    angle = more.s / RADIUS
    assert len(more) == 66
    npt.assert_allclose(more.easting, RADIUS * np.cos(angle), **EXACT)
    npt.assert_allclose(more.northing, RADIUS * np.sin(angle), **EXACT)


def test_an_open_curve_goes_straight_on() -> None:
    bend = curve_of_points(np.arange(3.0) + 5, np.array([0.0, 1, 1]), np.array([0.0, 0, 1]))
    more = bend.extend(2)
    npt.assert_array_equal(more.s, np.arange(3.0, 10.0))
    npt.assert_array_equal(more.easting, [-2, -1, 0, 1, 1, 1, 1])
    npt.assert_array_equal(more.northing, [0, 0, 0, 0, 1, 2, 3])


def test_places_between_the_last_and_the_first_point_of_a_ring_lie_on_its_chord() -> None:
    ring = circle(60, 60)
    step = ring.spacing
    easting, northing = ring.position_at(ring.s[-1] + step * np.array([0.25, 0.5, 1.0, 1.25]))
    part = np.array([0.25, 0.5, 1.0, 0.25])
    first = np.array([59, 59, 59, 0])
    for found, nodes in ((easting, ring.easting), (northing, ring.northing)):
        chord = nodes[(first + 1) % 60] - nodes[first]
        npt.assert_allclose(found, nodes[first] + part * chord, **EXACT)


@pytest.mark.parametrize("begin", [0.0, 100.0])
def test_projection_is_the_inverse_of_position(begin) -> None:
    for curve in (circle(600, 600, begin), circle(300, 600, begin)):
        station = begin + np.linspace(0.3, 0.9 * curve.length, 40)
        offset = np.linspace(-30.0, 5.0, 40)
        found = curve.project(*curve.position_at(station, offset))
        near = np.abs(offset) < 12.0  # [m] there the cross-sections are continuous
        # [m] chords of 0.2 m lie within 0.3 mm of the circle; farther out, the nearest point of
        # the polygon may be a corner, half a chord away
        npt.assert_allclose(found.station[near], station[near], rtol=0, atol=1e-3)
        npt.assert_allclose(found.station, station, rtol=0, atol=0.5 * curve.spacing)
        npt.assert_allclose(found.offset, offset, rtol=0, atol=1e-3)
        assert not found.beyond.any()


def test_a_part_projects_to_stations_of_the_whole() -> None:
    line = curve_of_points(np.arange(11.0), np.arange(11.0), np.zeros(11)).part(4, 8)
    found = line.project([0.0, 5.5, 9.0], [1.0, 30.0, -1.0])
    npt.assert_array_equal(found.station, [4.0, 5.5, 7.0])
    npt.assert_array_equal(found.beyond, [True, False, True])
    npt.assert_array_equal(found.offset, [1.0, 30.0, -1.0])


def test_the_parallel_of_a_polygon_is_at_its_distance() -> None:
    inside = circle(60, 60).offset(2.0)
    apothem = RADIUS * np.cos(np.pi / 60)
    npt.assert_allclose(
        np.hypot(inside.easting, inside.northing), (apothem - 2.0) / np.cos(np.pi / 60), **EXACT
    )


def test_resampling_follows_the_chords() -> None:
    corner = polyline_curve([0.0, 3.0, 3.0, 3.0], [0.0, 0.0, 0.0, 4.0])
    found = corner.resample(0.5)
    assert (len(corner), len(found), found.length) == (3, 15, 7.0)
    npt.assert_allclose(found.easting, np.minimum(found.s, 3.0), **EXACT)
    npt.assert_allclose(found.northing, np.maximum(found.s - 3.0, 0.0), **EXACT)
    npt.assert_allclose(found.heading, np.where(found.s < 3.0, 0.0, np.pi / 2), **EXACT)


def test_points_at_unequal_distances_have_no_spacing() -> None:
    uneven = polyline_curve([0.0, 1.0, 3.0], [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="equally spaced, got 1 m to 2 m; resample it"):
        uneven.project([0.0], [0.0])
    with pytest.raises(ValueError, match="equally spaced, got one point"):
        _ = uneven.part(0, 1).spacing


@pytest.mark.parametrize("module", [trueterrain.geometry.path, trueterrain.profile])
def test_the_earlier_name_is_an_alias(module) -> None:
    with pytest.warns(DeprecationWarning, match="WheelPath is PlaneCurve now"):
        assert module.WheelPath is PlaneCurve
    with pytest.raises(AttributeError, match="no attribute 'Wheel'"):
        _ = module.Wheel
