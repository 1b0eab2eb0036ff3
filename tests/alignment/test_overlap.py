"""Cells of passes and their overlaps against direct counts."""

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain.alignment.observations.overlap import (
    cell_centres,
    cell_keys,
    find_overlap,
    occupied_cells,
    point_blocks,
)
from trueterrain.core.errors import CoverageError, SchemaError, TrueTerrainError
from trueterrain.core.schemas import make_points

STEP = 1e-5  # [m] in which heights are added up


def square(west: float, south: float, size: float = 2.0, up: float = 0.0) -> xr.Dataset:
    """One point at the centre of each cell of 0.1 m."""
    side = np.arange(0.05, size, 0.1)
    x, y = (at.ravel() for at in np.meshgrid(west + side, south + side))
    return make_points(x, y, np.full(x.size, up))


@pytest.mark.parametrize("origin", [(0.0, 0.0), (-3.7, 12.2), (651_000.0, 6_861_000.0)])
def test_cells_hold_the_count_and_the_mean_of_their_points(origin) -> None:
    rng = np.random.default_rng(1)
    x, y = (begin + 3 * rng.random(5000) for begin in origin)
    z = 500 + 0.1 * rng.standard_normal(5000)
    cells = occupied_cells(make_points(x, y, z), 0.25)
    east, north = cell_centres(cells.key, 0.25)
    assert cells.count.sum() == 5000
    for k in (0, 7, cells.key.size - 1):
        inside = (np.floor(x / 0.25) == np.floor(east[k] / 0.25)) & (
            np.floor(y / 0.25) == np.floor(north[k] / 0.25)
        )
        assert cells.count[k] == inside.sum()
        assert cells.height[k] == pytest.approx(z[inside].mean(), abs=STEP)
    npt.assert_array_equal(np.unique(cell_keys(x, y, 0.25)), cells.key)


def test_cells_are_the_same_for_any_blocks_and_far_scattered_points() -> None:
    rng = np.random.default_rng(2)
    x, y = 50_000 * rng.random((2, 3000))  # so sparse that no array of the box is made
    points = make_points(x, y, rng.standard_normal(3000))
    whole = occupied_cells(points, 0.5)
    parts = occupied_cells([points.isel(point=slice(k, k + 7)) for k in range(0, 3000, 7)], 0.5)
    backwards = occupied_cells(points.isel(point=slice(None, None, -1)), 0.5)
    for other in (parts, backwards):
        for name in ("key", "count", "total"):
            npt.assert_array_equal(getattr(whole, name), getattr(other, name))


def test_two_squares_have_the_cells_of_their_overlap_in_common() -> None:
    found = find_overlap(occupied_cells(square(0, 0)), occupied_cells(square(1.5, 1.0, up=0.2)))
    assert found.area == pytest.approx(0.5 * 1.0, abs=1e-9)
    key, count, height = found.shared
    assert key.size == 50
    assert (count == 1).all()
    npt.assert_allclose(height, np.array([[0.0], [0.2]]) * np.ones(50), rtol=0, atol=STEP)
    npt.assert_array_equal(found.holds([1.75, 1.45, 1.75], [1.5, 1.5, 0.95]), [True, False, False])


def test_a_missing_cell_is_no_hole_but_a_missing_patch_is() -> None:
    points = square(0, 0)

    def without(size: float) -> xr.Dataset:
        hole = (np.abs(points.easting - 1.05) < size) & (np.abs(points.northing - 1.05) < size)
        return points.isel(point=np.flatnonzero(~hole))

    whole = occupied_cells(square(0, 0, up=0.1))
    assert find_overlap(whole, occupied_cells(without(0.05))).key.size == 400
    assert find_overlap(whole, occupied_cells(without(0.15))).key.size == 400 - 9


@pytest.mark.parametrize(("edge", "columns"), [(0.98, 10), (0.92, 9), (0.0, 0)])
def test_cells_that_an_edge_cuts_count_if_half_is_left(edge, columns) -> None:
    side = np.arange(0.0025, 1.0, 0.005)  # 400 in a cell
    x, y = (at.ravel() for at in np.meshgrid(np.append(side, side - 1.0), side))
    whole = occupied_cells(make_points(x, y, 0 * x + 0.1))
    x, y = x[x < edge], y[x < edge]
    found = find_overlap(whole, occupied_cells(make_points(x, y, 0 * x)))
    assert found.key.size == 10 * (10 + columns)


def test_separate_passes_have_no_overlap() -> None:
    assert find_overlap(occupied_cells(square(0, 0)), occupied_cells(square(2.05, 0))) is None


def test_points_that_are_not_finite_are_counted() -> None:
    points = make_points([0.0, np.nan, 1.0, 2.0], [0.0, 0.0, np.inf, 0.0], [0.0, 0.0, 0.0, 1e6])
    cells = occupied_cells(points)
    assert cells.left_out == 3
    assert cells.count.sum() == 1


def test_passes_without_points_are_refused() -> None:
    with pytest.raises(CoverageError, match=r"pass a: holds no point .*\(2 others\)\. Leave"):
        occupied_cells(make_points([np.nan] * 2, [0.0] * 2, [0.0] * 2), name="a")
    with pytest.raises(CoverageError, match="holds no point"):
        occupied_cells([])


def test_sizes_must_be_positive_and_equal() -> None:
    with pytest.raises(ValueError, match="cell must be greater than 0 m"):
        occupied_cells(square(0, 0), 0.0)
    with pytest.raises(ValueError, match=r"cells must have one size, got 0\.1 and 0\.2 m"):
        find_overlap(occupied_cells(square(0, 0)), occupied_cells(square(0, 0), 0.2))


def test_different_crs_are_refused_between_and_within_passes() -> None:
    here, there = square(0, 0).assign_attrs(crs="EPSG:2154"), square(1, 1)
    with pytest.raises(SchemaError, match=r"pass b: has .*system unknown, but that of pass a is"):
        find_overlap(occupied_cells(here), occupied_cells(there), names=("a", "b"))
    with pytest.raises(SchemaError, match=r"pass a: .*'EPSG:2154', but .*the blocks before it"):
        occupied_cells([there, here], name="a")


def test_the_same_points_twice_are_refused() -> None:
    with pytest.raises(TrueTerrainError, match="pass second: holds the same points as pass first"):
        find_overlap(occupied_cells(square(0, 0)), occupied_cells(square(0, 0)))


def test_blocks_come_from_datasets_sequences_and_functions() -> None:
    points = square(0, 0)
    assert len(list(point_blocks(points))) == 1
    assert len(list(point_blocks([points, points]))) == 2
    assert len(list(point_blocks(lambda: iter([points] * 3)))) == 3
    with pytest.raises(ValueError, match="exhausted after one iteration"):
        list(point_blocks(iter([points])))
