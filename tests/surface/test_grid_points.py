"""Surfaces from points, against plain numpy."""

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import make_points
from trueterrain.formats import las, point_blocks
from trueterrain.geometry.reference_line import straight_line
from trueterrain.surface.accumulate import STEP, CellSums, KeptSums
from trueterrain.surface.cells import grid_along, grid_over
from trueterrain.surface.grid import GridSettings, grid_points, surface_of

ROUNDED = 0.5 * STEP + 1e-9  # [m] step of the heights
PLAIN = GridSettings(level=False)

CLOUDS = (
    "test_data_77050_627755_LA93_IGN69.laz",
    "las_with_several_extra_byte_bloc.laz",
    "test_semis_2021_0382_6565_LA93_IGN69_cropped.laz",
)


def numpy_means(points, grid):
    """Sums of heights in cells as one would write them with numpy alone."""
    i = np.floor((points.easting.values - grid.u[0]) / grid.spacing[0] + 0.5).astype(int)
    j = np.floor((points.northing.values - grid.v[0]) / grid.spacing[1] + 0.5).astype(int)
    cell = j * grid.u.size + i
    shape = (grid.v.size, grid.u.size)
    count = np.bincount(cell, minlength=grid.u.size * grid.v.size)
    total = np.bincount(cell, points.up.values, minlength=count.size)
    with np.errstate(invalid="ignore"):
        return (total / count).reshape(shape), count.reshape(shape)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOUDS)
def test_measured_clouds_have_the_means_of_numpy(data, name):
    points = las.read(data / "scanning" / "strips" / name)
    x, y = points.easting.values, points.northing.values
    grid = grid_over(x.min(), y.min(), x.max(), y.max(), spacing=0.5)
    surface = grid_points(point_blocks(data / "scanning" / "strips" / name), grid, PLAIN)
    mean, count = numpy_means(points, grid)
    npt.assert_array_equal(surface["count"], count)
    npt.assert_allclose(surface.height, mean, rtol=0, atol=ROUNDED)
    assert surface.attrs["crs"] == points.attrs["crs"]
    assert surface.attrs["outside"] == 0


def cloud(n=20_000, seed=1, **more):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 10, n), rng.uniform(0, 4, n)
    return make_points(x, y, 100 + 0.1 * x - 0.05 * y + 0.01 * rng.standard_normal(n), **more)


def test_minimum_and_maximum_are_those_of_numpy():
    points, grid = cloud(), grid_over(0, 0, 10, 4, spacing=0.5)
    low = grid_points(points, grid, GridSettings(statistic="minimum"))
    high = grid_points(points, grid, GridSettings(statistic="maximum"))
    i = np.rint(points.easting.values / 0.5).astype(int)
    j = np.rint(points.northing.values / 0.5).astype(int)
    for cell in ((0, 0), (3, 7), (8, 20)):
        up = points.up.values[(j == cell[0]) & (i == cell[1])]
        found = (low.height.values[cell], high.height.values[cell])
        npt.assert_allclose(found, (up.min(), up.max()), rtol=0, atol=ROUNDED)


@pytest.mark.parametrize("held", [10**9, 3000])
@pytest.mark.parametrize("percent", [50.0, 85.0])
def test_medians_and_percentiles_are_those_of_numpy(monkeypatch, percent, held):
    """All heights at once, and so few that the points are gone through several times."""
    monkeypatch.setattr("trueterrain.surface.accumulate._returns.COLLECTED", held)
    points, grid = cloud(), grid_over(0, 0, 10, 4, spacing=0.5)
    options = GridSettings(statistic="median" if percent == 50 else "percentile", percent=percent)
    parts = [points.isel(point=slice(k, k + 7000)) for k in range(0, 20_000, 7000)]
    surface = grid_points(parts, grid, options, threads=2)
    i = np.rint(points.easting.values / 0.5).astype(int)
    j = np.rint(points.northing.values / 0.5).astype(int)
    expected = [
        [
            np.percentile(points.up.values[(j == row) & (i == column)], percent)
            for column in range(21)
        ]
        for row in range(9)
    ]
    npt.assert_allclose(surface.height, expected, rtol=0, atol=ROUNDED)
    assert surface["count"].values.sum() == 20_000


def test_standard_deviations_of_medians_are_honest():
    rng = np.random.default_rng(1)
    points = make_points(
        rng.uniform(0, 10, 60_000), rng.uniform(0, 4, 60_000), 0.01 * rng.standard_normal(60_000)
    )
    grid = grid_over(0, 0, 10, 4, spacing=0.1)
    surface = grid_points(points, grid, GridSettings(statistic="median"))
    ratio = (surface.height / surface.sd_relative).values[2:-2, 2:-2]
    assert 0.9 < np.sqrt(np.nanmean(ratio**2)) < 1.1


def test_medians_need_points_twice():
    grid, options = grid_over(0, 0, 10, 4, spacing=0.5), GridSettings(statistic="median")
    with pytest.raises(ValueError, match="read twice"):
        grid_points(iter([cloud()]), grid, options)
    sums = CellSums(grid)
    points = cloud()
    sums.add_points(points.easting, points.northing, points.up)
    with pytest.raises(ValueError, match="through the data twice"):
        surface_of(sums, options)
    with pytest.raises(ValueError, match="must be the same"):
        surface_of(sums, options, add_data=lambda _: None)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_any_order_blocks_and_threads_give_the_same(threads):
    points, grid = cloud(600_000), grid_over(0, 0, 10, 4, spacing=0.1)
    whole = grid_points(points, grid)
    shuffled = points.isel(point=np.random.default_rng(2).permutation(points.sizes["point"]))
    size = 270_001
    blocks = [
        shuffled.isel(point=slice(k, k + size)) for k in range(0, shuffled.sizes["point"], size)
    ]
    other = grid_points(blocks, grid, threads=threads)
    for name in ("height", "sd_relative", "count"):
        npt.assert_array_equal(whole[name], other[name])


def test_levelled_means_lie_on_a_plane():
    points = cloud(40_000)
    points["up"] = points["up"].copy(data=100 + 0.1 * points.easting - 0.05 * points.northing)
    grid = grid_over(0, 0, 10, 4, spacing=0.25)
    surface = grid_points(points, grid)
    truth = 100 + 0.1 * grid.u - 0.05 * grid.v[:, None]
    inner = (slice(2, -2), slice(2, -2))
    npt.assert_allclose(surface.height.values[inner], truth[inner], rtol=0, atol=1e-4)
    plain = grid_points(points, grid, PLAIN)
    assert np.abs(plain.height.values - truth)[inner].max() > 1e-3


def test_a_step_stays_a_step():
    """Levelled means beside a step do not leave the heights on either side."""
    points = cloud(60_000)
    points["up"] = points["up"].copy(data=np.where(points.easting > 5.03, 0.1, 0.0))
    surface = grid_points(points, grid_over(0, 0, 10, 4, spacing=0.1))
    assert surface.height.min() >= -ROUNDED
    assert surface.height.max() <= 0.1 + ROUNDED


def test_standard_deviations_of_points_are_honest():
    noise, grid = 0.01, grid_over(0, 0, 10, 4, spacing=0.1)
    points = cloud(40_000)
    surface = grid_points(points, grid)
    truth = 100 + 0.1 * grid.u - 0.05 * grid.v[:, None]
    ratio = ((surface.height - truth) / surface.sd_relative).values[2:-2, 2:-2]
    assert 0.9 < np.sqrt(np.nanmean(ratio**2)) < 1.1
    # what points know of their own errors comes on top of the noise: it may be the same for all
    own = points.assign(sd=("point", np.full(40_000, 0.02), {"units": "m"}))
    known = grid_points(own, grid, GridSettings(range_noise=noise))
    extra = np.sqrt(known.sd.values**2 - surface.sd_relative.values**2)
    npt.assert_allclose(np.nanmedian(extra), np.sqrt(0.02**2 - noise**2), rtol=0.05)


@pytest.mark.parametrize(
    ("given", "found"),
    [((), {"sd_relative"}), (("sd_relative",), {"sd_relative"}), (("sd",), {"sd"})],
)
def test_an_unknown_absolute_sd_is_left_out(given, found):
    """Scatter alone is no absolute standard deviation, nor is one relative to a datum."""
    points = cloud(2000)
    own = ("point", np.full(2000, 0.02), {"units": "m"})
    surface = grid_points(
        points.assign(dict.fromkeys(given, own)), grid_over(0, 0, 10, 4, spacing=1)
    )
    assert {"sd", "sd_relative"} & set(surface.data_vars) == found
    for name in given:
        assert (surface[name].values >= np.float32(0.02)).all()


@given(
    st.lists(st.integers(-900_000_000, 900_000_000), min_size=1, max_size=30),
    st.integers(0, 10**6),
)
def test_sums_of_squares_may_pass_the_end_of_64_bits(heights, spread):
    """Deviations of heights of kilometres are as exact as those near zero."""
    base = heights[0]
    z = np.array([base + (h % (spread + 1)) for h in heights], dtype=np.int64)
    sums = CellSums(grid_over(0, 0, 1, 1, spacing=1.0), KeptSums(places=False))
    many = np.tile(z * STEP, 200)
    sums.add_points(np.zeros(many.size), np.zeros(many.size), many)
    mean, deviation = np.empty((2, 2)), np.empty((2, 2))
    from trueterrain.surface._nodes import _kernels

    part = sums.total()
    cells = (each.reshape(2, 2) for each in (part.count, part.totals, part.squares))
    _kernels.cell_moments(*cells, 1.0, mean, deviation)
    exact = [int(value) for value in np.tile(z, 200)]
    n, total = len(exact), sum(exact)
    numerator = n * sum(value * value for value in exact) - total * total
    npt.assert_allclose(mean[0, 0], total / n, rtol=1e-14)
    npt.assert_allclose(deviation[0, 0], numerator / n, rtol=1e-9, atol=1e-6)


def test_points_along_a_road_are_those_over_the_map():
    points = cloud()
    road = grid_points(points, grid_along(straight_line((0, 2), (10, 2), spacing=0.5)), PLAIN)
    over = grid_points(points, grid_over(0, 0, 10, 4, spacing=0.5), PLAIN)
    whole = road["count"].values.T
    assert whole.shape == (9, 21)
    near = whole == over["count"].values  # points on an edge may fall to either side
    assert near.mean() > 0.9
    npt.assert_allclose(
        road.height.values.T[near], over.height.values[near], rtol=0, atol=2 * ROUNDED
    )


def test_points_without_height_and_outside_are_counted():
    points = make_points([0, 0.1, 50, np.nan], [0, 0, 0, 0], [1, np.nan, 3, 4])
    sums = CellSums(grid_over(0, 0, 2, 2, spacing=1.0))
    sums.add_points(points.easting, points.northing, points.up)
    return_totals = sums.return_totals
    assert (return_totals.used, return_totals.outside, return_totals.too_high) == (1, 2, 1)
    assert surface_of(sums).height.values[0, 0] == 1.0


def test_cells_with_few_points_have_no_height():
    points = make_points([0, 0, 1], [0, 0, 0], [1, 1, 2])
    surface = grid_points(
        points, grid_over(0, 0, 1, 1, spacing=1.0), GridSettings(min_count=2, level=False)
    )
    npt.assert_array_equal(surface.height.values[0], [1, np.nan])


def test_data_without_sense_are_refused():
    grid = grid_over(0, 0, 1, 1, spacing=1.0)
    with pytest.raises(CoverageError, match="no points"):
        grid_points([], grid)
    with pytest.raises(CoverageError, match="Choose a coarser spacing"):
        grid_points(make_points([5.0], [5.0], [0.0]), grid)
    one, two = make_points([0], [0], [0], crs="EPSG:25832"), make_points([0], [0], [0])
    with pytest.raises(SchemaError, match="the same CRS"):
        grid_points([one, two], grid)
    with pytest.raises(SchemaError, match="variable sd: is missing"):
        grid_points([make_points([0], [0], [0], sd=[0.1]), two], grid)
    for settings in (
        {"statistic": "mode"},
        {"percent": 0.0},
        {"min_count": 0},
        {"range_noise": -1.0},
    ):
        with pytest.raises(ValueError, match="must be"):
            GridSettings(**settings)


def test_surfaces_are_of_their_kind():
    surface = grid_points(cloud(crs="EPSG:25832"), grid_over(0, 0, 10, 4, spacing=0.5))
    assert isinstance(surface, xr.Dataset)
    assert (surface["sd_relative"].dtype, surface["count"].dtype) == (np.float32, np.int32)


@pytest.mark.parametrize("power", [0.0, 1.5])
def test_means_over_discs_are_those_of_numpy(power):
    """Each return has the weight of its cell, by the distance of the middle of the cell."""
    points, step, radius = cloud(3000), 0.2, 0.5
    grid = grid_over(0, 0, 10, 4, spacing=step)
    options = GridSettings(level=False, radius=radius, power=power)
    surface = grid_points(points, grid, options)
    i = np.rint(points.easting.values / step)
    j = np.rint(points.northing.values / step)
    for row, column in ((0, 0), (5, 20), (20, 50), (11, 3)):
        distance = step * np.hypot(i - column, j - row)
        near = distance <= radius + 1e-9
        weight = np.maximum(distance[near], 0.5 * step) ** -power
        expected = np.average(points.up.values[near], weights=weight)
        npt.assert_allclose(surface.height.values[row, column], expected, rtol=0, atol=STEP)
        assert surface["count"].values[row, column] == near.sum()


def test_discs_close_gaps_and_stay_on_a_plane():
    points = cloud(2500)
    points["up"] = points["up"].copy(data=100 + 0.1 * points.easting - 0.05 * points.northing)
    grid = grid_over(0, 0, 10, 4, spacing=0.1)
    own = grid_points(points, grid)
    wide = grid_points(points, grid, GridSettings(radius=0.5))
    assert np.isnan(own.height.values).mean() > 0.3
    assert not np.isnan(wide.height.values).any()
    truth = 100 + 0.1 * grid.u - 0.05 * grid.v[:, None]
    inner = (slice(6, -6), slice(6, -6))
    npt.assert_allclose(wide.height.values[inner], truth[inner], rtol=0, atol=2e-4)


@pytest.mark.parametrize("power", [0.0, 2.0])
def test_standard_deviations_over_discs_are_honest(power):
    points = cloud(40_000)
    grid = grid_over(0, 0, 10, 4, spacing=0.1)
    surface = grid_points(points, grid, GridSettings(radius=0.3, power=power))
    truth = 100 + 0.1 * grid.u - 0.05 * grid.v[:, None]
    ratio = ((surface.height - truth) / surface.sd_relative).values[6:-6, 6:-6]
    assert 0.9 < np.sqrt(np.mean(ratio**2)) < 1.1


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"radius": -1.0}, "at least 0 m"),
        ({"radius": 1.0, "statistic": "median"}, "goes with the mean"),
        ({"power": 1.0}, "needs a radius"),
    ],
)
def test_discs_without_sense_are_refused(settings, words):
    with pytest.raises(ValueError, match=words):
        GridSettings(**settings)
