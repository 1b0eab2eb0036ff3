"""Stones and cracks: their volumes, their numbers, their limits."""

import numpy as np
import numpy.testing as npt
import pytest
from scipy.ndimage import label

from trueterrain.simulate.ground import Cracks, Plane, Stone, Stones

pytestmark = pytest.mark.slow

CELL = 0.5e-3  # [m] grid on which volumes are summed
VOLUME = 2e-3  # [1] of the midpoint rule on that grid, for a stone of 20 cells
axis = (np.arange(4000) + 0.5) * CELL  # [m] 2 m


def test_a_stone_has_the_volume_of_half_an_ellipsoid():
    stone = Stone(x=1.0, y=1.0, diameter=0.025, rise=0.01)
    near = np.abs(axis - 1.0) < 0.02
    volume = stone.height(axis[near, None], axis[near]).sum() * CELL**2
    npt.assert_allclose(volume, 2 / 3 * np.pi * 0.0125**2 * 0.01, rtol=VOLUME, atol=0)


def test_a_stone_is_round_and_ends_at_its_edge():
    stone = Stone(x=2.0, y=-1.0, diameter=0.02, rise=0.01)
    angle = np.linspace(0.0, 2 * np.pi, 9)
    for radius, height in ((0.0, 0.01), (0.006, 0.008), (0.0100001, 0.0)):
        found = stone.height(2.0 + radius * np.cos(angle), -1.0 + radius * np.sin(angle))
        npt.assert_allclose(found, height, rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def scattered() -> np.ndarray:
    """Heights of stones on 2 m x 2 m, along the cells of 0.1 m that hold one stone each [m]."""
    stones = Stones(density=100.0, diameter_min=0.02, diameter_max=0.04, height_ratio=0.3, seed=5)
    along, across = axis[:, None] - 1.0, axis + 7.0
    cos, sin = np.cos(stones._turn), np.sin(stones._turn)
    return stones.height(cos * along - sin * across, sin * along + cos * across)


def test_there_are_as_many_stones_as_asked_for_and_none_overlap(scattered):
    number = label(scattered > 0)[1]  # the area holds whole cells
    assert number == 400


def test_stones_have_the_diameters_and_heights_asked_for(scattered):
    names, number = label(scattered > 0)
    covered = np.bincount(names.ravel())[1:] * CELL**2
    diameter = 2 * np.sqrt(covered / np.pi)
    highest = np.array([scattered[names == i].max() for i in range(1, 20)])
    assert 0.02 - CELL < diameter.min() < 0.021
    assert 0.039 < diameter.max() < 0.04 + CELL
    npt.assert_allclose(np.median(diameter), np.sqrt(0.02 * 0.04), rtol=0.05, atol=0)  # of 400
    npt.assert_allclose(highest / diameter[:19], 0.3, rtol=0.01, atol=0)
    assert number > 20


@pytest.mark.parametrize("seed", range(6))
def test_a_line_along_or_across_the_road_meets_its_fraction_of_stones(seed):
    """Even a line between the cells of an unturned lattice: fraction covered is density x area."""
    stones = Stones(density=100.0, diameter_min=0.03, diameter_max=0.03, seed=seed)
    s = np.linspace(0, 200, 200_001)
    fraction = 100.0 * np.pi * 0.015**2
    for x, y in ((s, 0.0), (s, 0.3), (0.0, s)):
        # some 600 stones are met; they lie in a lattice, so that they scatter less than by chance
        npt.assert_allclose((stones.height(x, y) > 0).mean(), fraction, rtol=0.15, atol=0)


def test_stones_lie_on_the_ground_below():
    stones, plane = Stones(seed=1), Plane(elevation=3.0, slope=0.1)
    x, y = np.random.default_rng(0).uniform(0.0, 5.0, (2, 1000))
    together = (plane + stones).height(x, y)
    npt.assert_allclose(together, 3.0 + 0.1 * x + stones.height(x, y), rtol=0, atol=0)


def test_stones_need_space():
    with pytest.raises(ValueError, match=r"diameter_max must be at most 0\.1 m"):
        Stones(density=100.0, diameter_max=0.11)


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ["transverse", "alligator"])
def test_cracks_reach_their_depth_and_no_deeper(pattern):
    cracks = Cracks(pattern=pattern, spacing=0.5, width=0.008, depth=0.012, meander=0.05, seed=3)
    height = cracks.height(axis[:, None], axis)
    assert height.max() == 0.0
    assert height.min() >= -0.012
    npt.assert_allclose(height.min(), -0.012, rtol=0, atol=0.1e-3)  # a node off the middle


def test_straight_cracks_have_the_section_and_number_asked_for():
    cracks = Cracks(spacing=0.5, width=0.008, depth=0.012, meander=0.0, seed=3)
    height = cracks.height(axis[:, None], np.arange(5.0))
    # A parabola has two thirds of the area of its frame; four spacings fit in, a crack in each.
    npt.assert_allclose(-height.sum(axis=0) * CELL, 4 * 2 / 3 * 0.008 * 0.012, rtol=0.01, atol=0)
    middle = np.argmin(height[:1000, 0]) * CELL
    assert 0.1 < middle < 0.4


def test_a_fraction_of_the_length_is_open():
    cracks = Cracks(spacing=1.0, width=0.008, meander=0.0, share=0.4, piece=0.5, seed=2)
    x = np.arange(0.0, 1.0, 1e-3)
    middle_of_piece = 0.25 + 0.5 * np.arange(3000)
    open_here = cracks.height(x[:, None], middle_of_piece).min(axis=0) < 0
    npt.assert_allclose(open_here.mean(), 0.4, rtol=0, atol=0.04)  # 4 sd of 3000 throws


def test_a_piece_closes_towards_its_end():
    cracks = Cracks(spacing=1.0, width=0.02, depth=0.01, meander=0.0, share=0.4, piece=1.0, seed=2)
    x, y = np.arange(0.0, 1.0, 1e-3), np.arange(0.0, 60.0, 0.01)
    depth = -cracks.height(x[:, None], y).min(axis=0)
    assert np.abs(np.diff(depth)).max() < 0.07 * 0.01  # 10 mm of a taper of 0.2 m, and the grid


@pytest.mark.slow
def test_alligator_cracks_part_the_ground_into_cells_of_the_size_asked_for():
    cracks = Cracks(pattern="alligator", spacing=0.2, width=0.006, meander=0.0, seed=4)
    cells = label(cracks.height(axis[:, None], axis) == 0.0)[1]
    # 100 squares of 0.2 m on 2 m x 2 m; cells cut by the edge, about 40, count as whole ones.
    assert 100 <= cells <= 160


def test_closed_edges_join_cells():
    closed = Cracks(pattern="alligator", spacing=0.2, width=0.006, meander=0.0, share=0.0)
    npt.assert_allclose(closed.height(axis[::9, None], axis[::9]), 0.0, rtol=0, atol=0)
    some = Cracks(pattern="alligator", spacing=0.2, width=0.006, meander=0.0, share=0.5, seed=4)
    every = Cracks(pattern="alligator", spacing=0.2, width=0.006, meander=0.0, seed=4)
    x, y = axis[::4, None], axis[::4]
    part = (some.height(x, y) < 0).sum() / (every.height(x, y) < 0).sum()
    npt.assert_allclose(part, 0.5, rtol=0, atol=0.1)  # 300 edges of unequal length


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        (Stone, {"diameter": 0.0}),
        (Stone, {"x": np.nan}),
        (Stones, {"density": 0.0}),
        (Stones, {"diameter_min": 0.05}),
        (Stones, {"height_ratio": -0.5}),
        (Stones, {"seed": True}),
        (Cracks, {"pattern": "fish"}),
        (Cracks, {"width": 1.0}),
        (Cracks, {"meander": 1.0}),
        (Cracks, {"share": 1.1}),
        (Cracks, {"depth": -1.0}),
        (Cracks, {"seed": 2**63}),
    ],
)
def test_bad_parameters_are_refused(kind, parameters):
    with pytest.raises(ValueError, match="must"):
        kind(**parameters)
