"""Reference paths against analytic lines and circles."""

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.alignment.discontinuity.centre_line import (
    centre_reference,
    follow_centre,
    overlap_edges,
)
from trueterrain.alignment.discontinuity.reference_path import (
    ReferencePath,
    polar_reference,
    straight_reference,
    waypoint_reference,
)
from trueterrain.alignment.discontinuity.seams import PairCells
from trueterrain.alignment.observations.overlap import (
    OccupiedCells,
    Overlap,
    find_overlap,
    occupied_cells,
)
from trueterrain.alignment.observations.sparse_sums import pack_cell
from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_points
from trueterrain.geometry.curve import curve_of_points

EXACT = 1e-9  # [m] round-off
SPLINE = 1e-5  # [m] a cubic spline through waypoints 1 m apart on a circle of 30 m
CHORD = 0.25**2 / (8 * 30) + 1e-6  # [m] a circle of 30 m less its chords of 0.25 m
MIDDLE = 0.02  # [m] middle of an overlap 6 cells wide, whose edges cut cells of 0.1 m
RADIUS = 30.0  # [m]


def on_circle(s: np.ndarray, v: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    return (RADIUS - v) * np.cos(s / RADIUS), (RADIUS - v) * np.sin(s / RADIUS)


def cells_along(curve, begin: float, end: float, right: float, left: float) -> OccupiedCells:
    """Cells of 0.1 m of a pass with points every 0.04 m."""
    s, v = (
        at.ravel() for at in np.meshgrid(np.arange(begin, end, 0.04), np.arange(right, left, 0.04))
    )
    x, y = curve(s, v)
    return occupied_cells(make_points(x, y, 0 * x + (right > -0.5)), 0.1)


def overlap_along(curve, length: float) -> Overlap:
    """Overlap of 0.6 m in the middle of two passes."""
    return find_overlap(
        cells_along(curve, 0.0, length, -0.3, 2.0), cells_along(curve, 0.0, length, -2.0, 0.3)
    )


def test_straight_paths_have_equal_steps_and_stations() -> None:
    path = straight_reference((10, 20), (16, 28), spacing=0.5)
    assert path.curve.easting.size == 21
    assert path.curve.length == pytest.approx(10.0, abs=EXACT)
    npt.assert_allclose(path.curve.heading, np.arctan2(8, 6), rtol=0, atol=EXACT)
    s, v = np.array([0.0, 3.3, 9.9]), np.array([0.0, 2.0, -30.0])  # beyond the wide strip as well
    found = path.locate(10 + 0.6 * s - 0.8 * v, 20 + 0.8 * s + 0.6 * v)
    npt.assert_allclose(found.station, s, rtol=0, atol=EXACT)
    npt.assert_allclose(found.offset, v, rtol=0, atol=EXACT)
    assert not found.beyond.any()


def test_positions_beyond_the_ends_get_the_station_of_the_end() -> None:
    path = straight_reference((0, 0), (10, 0))
    found = path.locate([-3.0, -1e-3, 10.001, 99.0], [1.0, 0.0, 0.0, -2.0])
    npt.assert_array_equal(found.station, [0.0, 0.0, 10.0, 10.0])
    assert found.beyond.all()


def test_positions_that_are_not_finite_have_no_station() -> None:
    found = straight_reference((0, 0), (10, 0)).locate([np.nan, 1.0], [0.0, np.inf])
    assert np.isnan(found.station).all()
    assert not found.beyond.any()


def test_waypoints_on_an_arc_give_arc_lengths() -> None:
    s = np.arange(0, 60.5, 1.0)
    path = waypoint_reference(*on_circle(s))
    npt.assert_allclose(
        np.hypot(path.curve.easting, path.curve.northing), RADIUS, rtol=0, atol=SPLINE
    )
    wanted = on_circle(path.curve.s)
    npt.assert_allclose((path.curve.easting, path.curve.northing), wanted, rtol=0, atol=10 * SPLINE)
    places, offset = np.array([5.03, 31.4, 55.5]), np.array([2.0, -7.0, 0.1])
    found = path.locate(*on_circle(places, offset))
    npt.assert_allclose(found.station, places, rtol=0, atol=CHORD)
    npt.assert_allclose(found.offset, offset, rtol=0, atol=CHORD)


def test_a_closed_path_is_periodic() -> None:
    s = np.linspace(0, 2 * np.pi * RADIUS, 180, endpoint=False)
    for repeated in (s, np.append(s, 0.0)):
        ring = waypoint_reference(*on_circle(repeated), closed=True)
        assert ring.curve.length == pytest.approx(2 * np.pi * RADIUS, abs=1e-4)
        gap = np.hypot(
            ring.curve.easting[0] - ring.curve.easting[-1],
            ring.curve.northing[0] - ring.curve.northing[-1],
        )
        assert gap == pytest.approx(ring.curve.spacing, abs=SPLINE)
    near_start = np.array([-0.4, -1e-4, 0.0, 1e-4, 0.4])
    found = ring.locate(*on_circle(near_start, 1.0))
    npt.assert_allclose(
        (found.station + 1) % ring.curve.length - 1, near_start, rtol=0, atol=1e-4 + CHORD
    )
    assert not found.beyond.any()


@pytest.mark.parametrize("clockwise", [False, True])
def test_polar_stations_are_angles_times_the_radius(clockwise) -> None:
    path = polar_reference((5.0, -3.0), 20.0, start_angle=0.5, clockwise=clockwise)
    curve = -1 if clockwise else 1
    angle, radius = np.array([0.0, 1.0, 3.0, 6.2]), np.array([20.0, 18.0, 25.0, 20.5])
    found = path.locate(
        5.0 + radius * np.cos(0.5 + curve * angle), -3.0 + radius * np.sin(0.5 + curve * angle)
    )
    circumference = path.curve.length
    assert circumference == pytest.approx(40 * np.pi, abs=EXACT)
    off = (found.station - 20 * angle + 1) % circumference - 1
    npt.assert_allclose(off, 0.0, rtol=0, atol=1e-6)
    npt.assert_allclose(found.offset, curve * (20.0 - radius), rtol=0, atol=EXACT)


def test_at_is_the_inverse_of_locate() -> None:
    path = waypoint_reference(*on_circle(np.arange(0, 60.5, 1.0)))
    s, v = np.array([1.03, 20.2, 58.0]), np.array([1.5, -2.0, 0.0])
    found = path.locate(*path.curve.position_at(s, v))
    npt.assert_allclose(found.station, s, rtol=0, atol=1e-4)
    npt.assert_allclose(found.offset, v, rtol=0, atol=CHORD)


@pytest.mark.parametrize(
    ("curve", "length"),
    [
        (lambda s, v: (s, v), 20.0),
        (lambda s, v: (-0.6 * s - 0.8 * v, 0.8 * s - 0.6 * v), 20.0),
        (on_circle, 80.0),  # more than a third of the circle
    ],
    ids=["east", "north-west", "curve"],
)
def test_the_centre_of_an_overlap_is_found(curve, length) -> None:
    overlap = overlap_along(curve, length)
    path = centre_reference(overlap)
    assert not path.curve.closed
    truth = waypoint_reference(*curve(np.linspace(0, length, 200), np.zeros(200)))
    found = truth.locate(path.curve.easting, path.curve.northing)
    npt.assert_allclose(found.offset, 0.0, rtol=0, atol=3 * MIDDLE)
    assert np.sqrt(np.mean(found.offset**2)) < MIDDLE
    assert np.ptp(found.station) > length - 1.0
    width = overlap_edges(overlap, path).width
    # cells of 6 points count whole where an edge cuts them: up to a diagonal of one is too much
    assert 0.6 - EXACT < np.nanmedian(width) < 0.6 + 0.142


def test_the_centre_of_a_ring_is_found_closed() -> None:
    overlap = overlap_along(on_circle, 2 * np.pi * RADIUS)
    path = centre_reference(overlap)
    assert path.curve.closed
    npt.assert_allclose(
        np.hypot(path.curve.easting, path.curve.northing), RADIUS, rtol=0, atol=2 * MIDDLE
    )
    assert path.curve.length == pytest.approx(2 * np.pi * RADIUS, abs=0.2)
    turn = np.unwrap(path.curve.heading)
    assert turn[-1] > turn[0]  # counter-clockwise


def test_pieces_of_an_overlap_are_joined() -> None:
    left = cells_along(lambda s, v: (s, v), 0.0, 30.0, -0.3, 2.0)
    rights = [
        make_points(*(at.ravel() for at in np.meshgrid(east, np.arange(-2, 0.3, 0.04))), up)
        for east, up in (
            (np.arange(0, 10, 0.04), np.zeros(250 * 58)),
            (np.arange(12, 30, 0.04), np.zeros(450 * 58)),
        )
    ]
    path = centre_reference(find_overlap(left, occupied_cells(rights, 0.1)))
    assert path.curve.length == pytest.approx(30.0, abs=1.0)
    npt.assert_allclose(path.curve.northing, 0.0, rtol=0, atol=3 * MIDDLE)


def test_search_areas_follow_a_winding_overlap_and_the_path_does_not() -> None:
    def swaying(s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return s, v + 0.2 * np.sin(2 * np.pi * s / 2.8)

    overlap = overlap_along(swaying, 25.0)
    path = centre_reference(overlap)
    npt.assert_allclose(
        path.curve.northing[8:-8], 0.0, rtol=0, atol=0.05
    )  # [m] a quarter of the sway
    moved = follow_centre(overlap, path)
    x, y = moved.places
    inner = slice(4, -4)
    # over 0.4 m the mean of the sway is 3.3 % less than in the middle; where the overlap runs along
    # the cells, both of its edges are off by up to half a cell
    npt.assert_allclose(
        y[inner], 0.2 * np.sin(2 * np.pi * x[inner] / 2.8), rtol=0, atol=0.2 * 0.033 + 0.05
    )
    npt.assert_array_equal(moved.curve.easting, path.curve.easting)


def test_overlaps_without_length_are_refused() -> None:
    speck = find_overlap(
        cells_along(lambda s, v: (s, v), 0, 0.3, -0.3, 2.0),
        cells_along(lambda s, v: (s, v), 0, 0.3, -2.0, -0.15),
    )
    with pytest.raises(
        CoverageError, match=r"overlap of first and second: has no centre line .* shorter than"
    ):
        centre_reference(speck, spacing=1.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: straight_reference((0, 0), (0.1, 0)), "shorter than the spacing"),
        (lambda: straight_reference((0, 0), (0, 0)), "at least 2 different waypoints, got 1"),
        (lambda: waypoint_reference([0, np.nan], [0, 1]), "finite waypoints"),
        (lambda: waypoint_reference([0, 1], [0, 1], spacing=0), "spacing must be greater"),
        (lambda: waypoint_reference([0, 1], [0, 1], closed=True), "at least 3 different"),
        (lambda: polar_reference((0, 0), -1.0), "radius greater than 0 m"),
        (lambda: polar_reference((0, 0), 1.0, spacing=-1), "spacing must be greater"),
        (lambda: curve_of_points(np.zeros(2), np.zeros(2), np.zeros(3)), "at least 2 points"),
        (lambda: curve_of_points(np.zeros(1), np.zeros(1), np.zeros(1)), "at least 2 points"),
        (
            lambda: ReferencePath(
                curve=curve_of_points(np.arange(2.0), np.zeros(2), np.ones(2), closed=True)
            ),
            "at least 3 points, got 2",
        ),
        (
            lambda: ReferencePath(
                curve=curve_of_points(np.arange(2.0), np.zeros(2), np.arange(2.0)),
                lateral=np.zeros(3),
            ),
            "lateral must hold",
        ),
        (lambda: waypoint_reference([0, 9, 0.1], [0, 0, 0.1], spacing=2.5), "must be smooth"),
    ],
)
def test_wrong_paths_are_refused(call, message) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def scattered(rng, n):
    return rng.integers(0, 4000, (2, n))


def in_a_box(rng, n):
    return rng.integers(0, rng.integers(1, 60, (2, 1)), (2, n))


def in_three_pieces(rng, n):
    return rng.integers(0, 8, (2, 3 * n)) + np.repeat([0, 1, 2], n) * rng.integers(0, 900, (2, 1))


def random_walk(rng, n):
    return np.cumsum(rng.integers(-1, 2, (2, n)), axis=1)


def ring(rng, n):
    angle = np.linspace(0, 2 * np.pi, 4 * n)
    return np.floor(rng.uniform(2, 40) * np.stack([np.cos(angle), np.sin(angle)]))


def spiral(rng, n):
    angle = np.arange(4 * n) * rng.uniform(0.02, 0.3)
    return np.floor(angle * np.stack([np.cos(angle), np.sin(angle)]))


def three_legs(rng, n):
    t, none = np.arange(n), np.zeros(n)
    return np.stack([np.concatenate([t, none, t]), np.concatenate([none, t, t])])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "shape", [scattered, in_a_box, in_three_pieces, random_walk, ring, spiral, three_legs]
)
def test_an_overlap_of_any_shape_has_a_path_or_says_why_not(shape, seed) -> None:
    """Cells of real overlaps lie in pieces, rings and single cells; both results are accepted.

    A path that is found tells stations of all cells, and steps at the edges.
    """
    rng = np.random.default_rng(seed)
    key = np.unique(pack_cell(*np.asarray(shape(rng, int(rng.integers(1, 250))), np.int64)))
    cell = float(rng.choice([0.1, 0.25, 1.0, 2.0]))
    few, many = (
        OccupiedCells(cell=cell, key=key, count=np.full(key.size, n), total=0 * key) for n in (5, 6)
    )
    overlap = Overlap(names=("a", "b"), cells=(few, many), key=key)
    problem = ""
    try:
        path = centre_reference(
            overlap, spacing=2.5 * cell, smoothing=(20 + 80 * (seed % 2)) * cell
        )
    except CoverageError as error:
        problem = error.problem
    else:
        cells = PairCells(overlap)
        assert np.isfinite(path.locate(*cells.centres).offset).all()
        cells.seam(np.zeros((2, key.size)), path, 1.0, 3 * cell)
        overlap_edges(overlap, follow_centre(overlap, path))
    assert not problem or problem.startswith("has no centre line for a reference path")
