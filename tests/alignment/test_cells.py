"""Cells of passes in a common grid."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trueterrain.alignment import CellSettings, PassCells, cells_of_points, make_pass_cells
from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import make_points

HEIGHT_STEP = 1e-5  # [m] in which heights are added up
COLUMNS = (
    "cell",
    "time",
    "easting",
    "northing",
    "height",
    "variance",
    "count",
    "slope_east",
    "slope_north",
    "offset",
    "longitudinal",
)


def cloud(n=20_000, seed=1, *, corner=(0.0, 0.0), slope=(0.02, -0.03), noise=0.001):
    """Points of a pass along x at 5 m/s over a plane, all over 40 m x 3 m."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 40, n), rng.uniform(-1.5, 1.5, n)
    z = 3.0 + slope[0] * x + slope[1] * y + rng.normal(0, noise, n)
    return make_points(corner[0] + x, corner[1] + y, z, time=100.0 + x / 5.0)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (-20.3, -7.1), (949_361.0, 6_715_402.0)])
def test_cells_are_on_the_plane_of_the_points(corner):
    """Mean heights and times at mean positions, for any map coordinates."""
    (cells,) = cells_of_points(cloud(corner=corner), CellSettings(size=0.5))
    x, y = cells.easting - corner[0], cells.northing - corner[1]
    error = cells.height - (3.0 + 0.02 * x - 0.03 * y)
    assert len(cells) > 400
    assert 0.9 < np.sqrt(np.mean(error**2 / cells.variance)) < 1.1
    assert_allclose(cells.time, 100.0 + x / 5.0, rtol=0, atol=1e-5)  # [s] parts of a cell at 5 m/s
    assert_allclose(np.median(cells.slope_east), 0.02, rtol=0, atol=0.002)  # few returns are flat
    assert_allclose(np.median(cells.slope_north), -0.03, rtol=0, atol=0.003)
    number = np.floor(cells.easting / 0.5).astype(np.int64), np.floor(cells.northing / 0.5)
    assert np.unique(cells.cell).size == np.unique(np.stack(number), axis=1).shape[1]


def test_cells_do_not_depend_on_order_and_blocks():
    points = cloud()
    shuffled = points.isel(point=np.random.default_rng(5).permutation(points.sizes["point"]))
    blocks = [shuffled.isel(point=slice(k, k + 777)) for k in range(0, 20_000, 777)]
    (once,), (again,) = cells_of_points(points), cells_of_points(iter(blocks))
    for name in COLUMNS:
        assert_array_equal(getattr(again, name), getattr(once, name))


def test_passes_are_separated_by_number_and_named():
    points = cloud().assign(lane=("point", np.arange(20_000) % 2 + 3))
    passes = cells_of_points(points, names={3: "north"})
    assert [one.name for one in passes] == ["north", "4"]
    assert sum(int(one.count.sum()) for one in passes) <= 20_000


def test_a_repeated_visit_is_a_second_entry():
    first, later = cloud(seed=1), cloud(seed=2)
    later = later.assign(time=later.time + 60.0)
    (cells,) = cells_of_points([first, later], CellSettings(size=0.5, visit_gap=20.0))
    (once,) = cells_of_points([first, later], CellSettings(size=0.5, visit_gap=200.0))
    assert_array_equal(np.unique(cells.cell, return_counts=True)[1].max(), 2)
    assert np.unique(once.cell).size == len(once)
    assert len(cells) > 1.9 * len(once)


def test_offsets_refer_to_the_path_of_the_pass():
    """By the mean positions of the returns unless a path is given."""
    points = cloud(200_000)
    (guessed,) = cells_of_points(points, CellSettings(size=0.5))
    middle = (guessed.easting > 3) & (guessed.easting < 37)
    # [m] the mean place of the returns of a second, whose width is 3 m
    assert_allclose(guessed.offset[middle], guessed.northing[middle], rtol=0, atol=0.1)

    def path(time):
        return 5.0 * (time - 100.0) - 2.0, np.full(time.size, 0.5), np.zeros(time.size)

    (known,) = cells_of_points(points, CellSettings(size=0.5), path=path)
    assert_allclose(known.offset, known.northing - 0.5, rtol=0, atol=1e-9)
    assert_allclose(known.longitudinal, 2.0, rtol=0, atol=1e-4)  # [m] times are in steps of 1 µs


def test_rough_and_sparse_cells_are_left_out():
    points = cloud(noise=0.1)
    with pytest.raises(CoverageError, match=r"no cell of 1 m .* scatter by less than 50 mm"):
        cells_of_points(points, CellSettings(size=1.0))
    with pytest.raises(CoverageError, match=r"no cell of 0\.25 m with 500 returns"):
        cells_of_points(cloud(), CellSettings(min_count=500))


def test_points_without_time_are_refused_with_a_cure():
    with pytest.raises(SchemaError, match=r"variable time: is missing.*give the station"):
        cells_of_points(cloud().drop_vars("time"))
    with pytest.raises(CoverageError, match="there are no points"):
        cells_of_points([])


def test_values_that_are_not_finite_are_refused():
    points = cloud()
    points.up[7] = np.nan
    with pytest.raises(SchemaError, match="variable up, point 7: must be finite"):
        cells_of_points(points)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"size": 0.0}, "size must be greater than 0"),
        ({"max_sd": np.nan}, "max_sd must be greater than 0"),
        ({"min_count": 0}, "min_count must be at least 1"),
    ],
)
def test_wrong_settings_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        CellSettings(**wrong)


def test_inconsistent_cells_are_refused():
    good = make_pass_cells("a", [1, 2], [0.0, 1.0], [0.0, 0.0], variance=1e-6)
    columns = {name: getattr(good, name) for name in COLUMNS}
    with pytest.raises(ValueError, match="height must hold one value for each of the 2 cells of a"):
        PassCells(name="a", **(columns | {"height": np.zeros(3)}))
    with pytest.raises(ValueError, match="time of a must be finite"):
        PassCells(name="a", **(columns | {"time": np.array([0.0, np.nan])}))
    with pytest.raises(ValueError, match="variance of a must not be negative"):
        PassCells(name="a", **(columns | {"variance": np.array([0.0, -1.0])}))
    with pytest.raises(ValueError, match="name must not be empty"):
        PassCells(name="", **columns)
    with pytest.raises(ValueError, match="must both be given, or neither"):
        PassCells(name="a", **columns, sd_time=np.zeros(1))
    with pytest.raises(ValueError, match="sd_time of a must ascend"):
        PassCells(name="a", **columns, sd_time=np.array([1.0, 0.0]), sd_height=np.ones(2))


def test_cells_can_be_selected():
    cells = make_pass_cells("a", [1, 2, 3], [0.0, 1.0, 2.0], [0.0, 5.0, 0.0], variance=1e-6)
    assert_array_equal(cells.part(np.array([False, True, False])).height, [5.0])
