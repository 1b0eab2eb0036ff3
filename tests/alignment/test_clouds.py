"""Point clouds as passes: found, aligned and written."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trueterrain import formats
from trueterrain.alignment import CellSettings, cells_of_points
from trueterrain.alignment.clouds.merge import (
    cells_of_clouds,
    find_cloud_passes,
    merge_clouds,
    merged_surface,
    suggested_cell,
    with_cells,
)
from trueterrain.alignment.discontinuity.reference_path import waypoint_reference
from trueterrain.alignment.merge import MergeSettings, compare_passes
from trueterrain.core.errors import CoverageError, SchemaError, TrueTerrainError
from trueterrain.core.schemas import make_points
from trueterrain.formats import PointFilter
from trueterrain.surface.cells import grid_over
from trueterrain.surface.grid import GridSettings

SPEED = 10.0  # [m/s]
NOISE = 1e-3  # [m] of a point
LENGTH = 60.0  # [m]
START = 3.0e8  # [s] adjusted standard time of the first pass
ROUNDING = 1e-4  # [m] of LAZ files
SETTINGS = with_cells(MergeSettings(), 0.2)
STRIPS = "scanning/strips"


def ground(x, y, slope=0.02):
    return 0.03 * np.sin(x / 3.0) + slope * y


def drift(name, t):
    """Of passes a and b, seconds after their start; their mean is 0 at all times [m]."""
    sign = {"a": 1.0, "b": -1.0}[name]
    return sign * (0.006 + 0.004 * np.sin(2 * np.pi * t / 6.0))


def cloud(
    name, *, right=0.0, width=2.0, density=400, begin=START, seed=None, drifts=True, slope=0.02
):
    """Points of a pass along x, from `right` to the left."""
    rng = np.random.default_rng(ord(name) if seed is None else seed)
    n = int(LENGTH * width * density)
    x, y = np.sort(rng.uniform(0, LENGTH, n)), right + rng.uniform(0, width, n)
    t = x / SPEED
    z = ground(x, y, slope) + rng.normal(0, NOISE, n) + (drift(name, t) if drifts else 0.0)
    return make_points(x, y, z, time=begin + t, crs="EPSG:2154")


def pair():
    """Two passes side by side; a third of each lies under the other."""
    return cloud("a"), cloud("b", right=1.3, begin=START + 100)


def numbered(*points):
    """Points in one dataset, each with a number of its own."""
    names = list(points[0].data_vars)
    columns = {one: np.concatenate([part[one].values for part in points]) for one in names}
    lane = np.repeat(np.arange(len(points)) + 11, [part.sizes["point"] for part in points])
    return make_points(**columns, lane=lane, crs=points[0].attrs["crs"])


def written(folder, **points):
    paths = []
    for name, one in points.items():
        folder.mkdir(exist_ok=True)
        paths.append(folder / f"{name}.laz")
        formats.write(one, paths[-1])
    return paths


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Files of two passes."""
    a, b = pair()
    return written(tmp_path_factory.mktemp("two"), a=a, b=b)


@pytest.fixture(scope="module")
def merged(two):
    return merge_clouds(find_cloud_passes(two), SETTINGS)


def test_each_of_several_files_is_a_pass(two):
    passes = find_cloud_passes(two)
    assert list(passes) == ["a", "b"]
    a = passes["a"]
    assert (a.count, a.crs, a.label) == (48_000, "EPSG:2154", 1)
    assert_allclose(a.time, (START, START + LENGTH / SPEED), rtol=0, atol=0.001)  # [s] last point
    assert_allclose(a.extent, (0.0, 0.0, LENGTH, 2.0), rtol=0, atol=0.01)  # [m] outermost points
    # [1/m²] coordinates that are rounded may touch one square more than the 120
    assert_allclose(a.density, 400.0, rtol=0, atol=4.0)
    assert sum(block.sizes["point"] for block in a()) == a.count


def test_one_file_is_split_by_the_number_of_its_points(tmp_path):
    (path,) = written(tmp_path, road=numbered(*pair()))
    passes = find_cloud_passes([path])
    assert [(one.name, one.count) for one in passes.values()] == [("11", 48_000), ("12", 48_000)]
    assert all((block.lane == 12).all() for block in passes["12"]())
    (whole,) = find_cloud_passes([path], split=False).values()
    assert whole.count == 96_000
    assert "several passes (point_source_id 11, 12)" in whole.flags[0]


def test_tiles_of_a_pass_are_joined(tmp_path):
    """Each pass from both files, and as if there were one."""
    both = numbered(*pair())
    west = both.easting.values < 30
    parts = {"west": west, "east": ~west, "one": west | ~west}
    for name, some in parts.items():
        formats.write(both.isel(point=np.flatnonzero(some)), tmp_path / f"{name}.zarr")
    split, whole = (
        merge_clouds(
            find_cloud_passes([tmp_path / f"{name}.zarr" for name in names], split=True), SETTINGS
        )
        for names in (("west", "east"), ("one",))
    )
    assert list(split[1]) == ["11", "12"]
    assert split[0].pairs == whole[0].pairs
    assert split[0].problems == whole[0].problems == ()


def test_known_drift_is_removed_from_the_points(merged):
    """Corrected points have their noise only, and the reported sd."""
    merging, corrected = merged
    (agreement,) = merging.pairs
    assert agreement.before.rmse > 0.012
    assert agreement.held_out.rmse < 1e-3  # [m] of means of some 16 points, in two passes
    for name, lane in corrected.items():
        correction = merging.adjustment.correction(name)
        for block in lane():
            t = block.time.values - lane.cloud.time[0]
            left = block.up.values - ground(block.easting.values, block.northing.values)
            assert_allclose(left.std(), NOISE, rtol=0, atol=0.05 * NOISE)
            error = correction(block.time.values) + drift(name, t)
            assert np.abs(error).max() < 3e-4  # [m] a metre of the overlap has some 20 cells
            assert np.sqrt(np.mean((error / block.sd_relative.values) ** 2)) < 1.1


def test_an_unobservable_tilt_stays_zero(merged):
    """A tilt common to both passes is unobservable and stays 0."""
    merging, _ = merged
    t = np.linspace(0, LENGTH / SPEED, 50)
    one, two = (merging.adjustment.correction(name) for name in "ab")
    first, second = START + t, START + 100 + t
    shared = one(first) + two(second)
    assert_allclose(shared / 2, 0.0, rtol=0, atol=1e-4)  # [m] along the path
    roll = one(first, "roll") + two(second, "roll")
    assert_allclose(roll / 2, 0.0, rtol=0, atol=1e-4)  # [rad] across it


def test_cells_of_corrected_points_agree_as_reported(merged):
    """Reported agreement is that of the corrected points."""
    merging, corrected = merged
    points = [one for lane in corrected.values() for one in lane()]
    (found,) = compare_passes(cells_of_points(points, SETTINGS.cells, names={1: "a", 2: "b"}))
    (said,) = merging.pairs
    # [m] cells whose points moved differently within them
    assert_allclose(found.before.rmse, said.after.rmse, rtol=0, atol=2e-5)
    assert_allclose(found.before.median, said.after.median, rtol=0, atol=2e-5)


def test_corrected_points_are_written_to_one_file(merged, tmp_path):
    _, corrected = merged
    formats.write(corrected.blocks(), tmp_path / "merged.laz")
    again = find_cloud_passes([tmp_path / "merged.laz"])
    assert [(one.name, one.count) for one in again.values()] == [("1", 48_000), ("2", 48_000)]
    assert "sd_relative" in again["1"].variables
    settings = replace(SETTINGS, method="grid", limit=0.01)
    (left,) = merge_clouds(again, settings)[0].pairs
    assert_allclose(left.before.rmse, merged[0].pairs[0].after.rmse, rtol=0, atol=ROUNDING)


def test_files_are_read_once_for_all_of_their_passes(tmp_path, monkeypatch):
    (path,) = written(tmp_path, road=numbered(*pair()))
    passes = find_cloud_passes([path])
    _, corrected = merge_clouds(passes, replace(SETTINGS, method="grid"))
    read = []
    blocks = formats.point_blocks
    monkeypatch.setattr(formats, "point_blocks", lambda *a, **k: read.append(a) or blocks(*a, **k))
    assert sum(block.sizes["point"] for block in corrected.blocks()) == 96_000
    assert len(read) == 1
    cells_of_clouds(find_cloud_passes([path]))
    assert len(read) == 3  # the second time to look what there is


def test_order_of_files_does_not_matter(two, merged):
    merging, _ = merge_clouds(find_cloud_passes(two[::-1]), SETTINGS)
    assert merging.pairs == merged[0].pairs
    assert merging.names == merged[0].names


@pytest.mark.parametrize("ending", ["csv", "parquet", "zarr"])
def test_other_formats_are_passes_too(ending, tmp_path):
    for name, one in zip("ab", pair(), strict=True):
        formats.write(one.isel(point=slice(0, None, 4)), tmp_path / f"{name}.{ending}")
    passes = find_cloud_passes([tmp_path / f"{name}.{ending}" for name in "ab"], crs="EPSG:2154")
    merging, corrected = merge_clouds(passes, with_cells(MergeSettings(), suggested_cell(passes)))
    (agreement,) = merging.pairs
    assert agreement.held_out.rmse < 0.1 * agreement.before.rmse
    formats.write(corrected["a"](), tmp_path / f"corrected.{ending}")


def test_the_merged_surface_is_more_accurate_than_each_pass(merged):
    _, corrected = merged
    grid = grid_over(0.5, 0.2, LENGTH - 0.5, 3.1, spacing=0.2)
    surface = merged_surface(corrected, grid, GridSettings(min_count=8))
    raw = merged_surface(
        merge_clouds(
            {name: one.cloud for name, one in corrected.items()},
            replace(SETTINGS, method="grid"),
        )[1],
        grid,
        GridSettings(min_count=8),
    )
    x, y = np.meshgrid(surface.easting.values, surface.northing.values)
    truth = ground(x, y).reshape(surface.height.shape)
    error, before = (one.height.values - truth for one in (surface, raw))
    assert np.sqrt(np.nanmean(error**2)) < 0.1 * np.sqrt(np.nanmean(before**2))
    median = merged_surface(corrected, grid, GridSettings(statistic="median"))
    assert np.nanstd(median.height.values - truth) < 1e-3  # [m]


@pytest.mark.slow
def test_the_sd_of_the_merged_surface_holds(tmp_path):
    """Against a fixed pass that has no drift."""
    ratios = []
    for seed in range(4):
        # no cross slope: of one, what cells that an edge cuts leave of it is taken for roll
        a = cloud("a", seed=2 * seed, drifts=False, slope=0.0)
        b = cloud("b", right=1.3, begin=START + 100, seed=2 * seed + 1, slope=0.0)
        passes = find_cloud_passes(written(tmp_path / str(seed), a=a, b=b))
        _, corrected = merge_clouds(passes, replace(SETTINGS, fixed=("a",)))
        surface = merged_surface(
            corrected,
            grid_over(0.5, 0.3, LENGTH - 0.5, 2.9, spacing=0.2),
            GridSettings(min_count=8),
        )
        x, y = np.meshgrid(surface.easting.values, surface.northing.values)
        error = surface.height.values - ground(x, y, 0.0).reshape(surface.height.shape)
        ratios.append((error / surface.sd_relative.values) ** 2)
    assert 0.9 < np.sqrt(np.nanmean(ratios)) < 1.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("own", "settings", "absolute"),
    [
        (None, {}, False),
        (0.03, {}, True),
        (None, {"datum_sd": 0.02}, True),
        (0.03, {"datum_sd": 0.02}, True),
    ],
)
def test_absolute_sd_needs_the_sd_of_points_or_datum(tmp_path, own, settings, absolute):
    """The points' own, or that of the datum by the settings; else the relative one is alone."""
    a, b = cloud("a", seed=0), cloud("b", right=1.3, begin=START + 100, seed=1)
    if own is not None:
        sd = ("point", np.full(a.sizes["point"], own), {"units": "m"})
        a, b = a.assign(sd=sd), b.assign(sd=sd)
    passes = find_cloud_passes(written(tmp_path, a=a, b=b))
    network = replace(SETTINGS.network, **settings)
    merging, corrected = merge_clouds(passes, replace(SETTINGS, network=network))
    surface = merged_surface(corrected, grid_over(0.5, 0.3, LENGTH - 0.5, 2.9, spacing=0.5))
    block = next(corrected["a"]())
    for found in (block, surface):
        assert ("sd" in found, "sd_relative" in found) == (absolute, True)
    assert set(merging.adjustment.datum_sd.values()) == {settings.get("datum_sd")}
    if absolute:
        both = np.hypot(own or 0.0, settings.get("datum_sd", 0.0))
        assert_allclose(block.sd, np.hypot(block.sd_relative, both), rtol=0, atol=1e-6)  # [m] f4
        extra = np.sqrt(surface.sd.values**2 - surface.sd_relative.values**2)
        assert_allclose(np.nanmedian(extra), both, rtol=0, atol=1e-4)  # [m] means of a cell


def test_points_follow_stations_along_a_reference_path(two):
    settings = replace(SETTINGS, method="discontinuity")
    merging, corrected = merge_clouds(find_cloud_passes(two), settings)
    (agreement,) = merging.pairs
    assert agreement.after.rmse < 0.1 * agreement.before.rmse
    (block,) = corrected["b"]()
    left = block.up.values - ground(block.easting.values, block.northing.values)
    middle = (block.easting.values > 1) & (block.easting.values < LENGTH - 1)
    # [m] stations, low-pass filtered with cut-off 5 m
    assert_allclose(left[middle].mean(), 0.0, rtol=0, atol=2e-4)
    assert not {"sd", "sd_relative"} & set(block.data_vars)


def test_method_grid_corrects_nothing_and_flags(two):
    merging, corrected = merge_clouds(find_cloud_passes(two), replace(SETTINGS, method="grid"))
    assert "passes differ by more than 2 mm" in merging.problems[0]
    lane = corrected["a"]
    assert_array_equal(next(lane()).up, next(lane.cloud()).up)


def test_a_fixed_pass_is_not_corrected(two):
    _, corrected = merge_clouds(find_cloud_passes(two), replace(SETTINGS, fixed=("a",)))
    (before,), (after,) = corrected["a"].cloud(), corrected["a"]()
    assert_array_equal(after.up, before.up)
    assert_array_equal(after.sd_relative, 0.0)
    (block,) = corrected["b"]()
    t = block.time.values - START - 100
    left = block.up.values - ground(block.easting.values, block.northing.values) - drift("a", t)
    assert_allclose(left.mean(), 0.0, rtol=0, atol=4e-4)  # [m] 1 m of a roll of 0.4 mrad: cut cells


def curved(name, *, inside, radius=30.0, seed=3):
    """Points of a pass without time around three quarters of a circle."""
    rng = np.random.default_rng(seed)
    n = 60_000
    angle, r = rng.uniform(0, 1.5 * np.pi, n), radius + inside + rng.uniform(0, 2.0, n)
    up = rng.normal(0, NOISE, n) + drift(name, angle)
    return make_points(r * np.cos(angle), r * np.sin(angle), up, crs="EPSG:2154")


@pytest.mark.slow
@pytest.mark.parametrize("given", [False, True])
def test_without_time_corrections_follow_the_station(given, tmp_path):
    """Straight and curved passes; a warning is given, and no time is invented."""
    straight = [one.drop_vars("time") for one in pair()]
    for number, points in enumerate((straight, [curved("a", inside=0), curved("b", inside=1.2)])):
        files = [tmp_path / f"{name}{number}.csv" for name in "ab"]
        for file, one in zip(files, points, strict=True):
            formats.write(one, file)
        angle = np.linspace(0, 1.5 * np.pi, 50)
        path = waypoint_reference(31.5 * np.cos(angle), 31.5 * np.sin(angle), spacing=1.0)
        if number == 0:
            path = waypoint_reference([0, LENGTH], [1.5, 1.5], spacing=1.0)
        merging, corrected = merge_clouds(
            find_cloud_passes(files), SETTINGS, path=path if given else None
        )
        (agreement,) = merging.pairs
        assert agreement.held_out.rmse < 0.15 * agreement.before.rmse
        where = "the path given" if given else "the centre line of each pass"
        assert (
            f"without gps_time: corrections follow the station along {where}"
            in (merging.problems[0])
        )
        assert "time" not in next(corrected[f"a{number}"]())


def test_times_of_different_kinds_are_flagged(tmp_path):
    """Seconds of the week in one file: each pass keeps its own, and all are corrected."""
    a, b = pair()
    b = b.assign(time=b.time - START + 345_678.0)
    merging, _ = merge_clouds(find_cloud_passes(written(tmp_path, a=a, b=b)), SETTINGS)
    (problem,) = merging.problems
    assert problem.startswith("times of b are seconds of a week, those of a are not")
    assert merging.pairs[0].held_out.rmse < 1e-3  # [m] as with one kind


def test_passes_longer_than_a_week_are_left_out(tmp_path):
    """They are refused if they are the only ones, and left out otherwise."""
    two = numbered(*pair()).isel(point=slice(0, None, 3))
    two["lane"][:] = 7  # one number for two flights, the second in seconds of the week
    mixed = two.assign(time=two.time.where(two.time < START + 50, two.time - START + 345_678.0))
    with pytest.raises(CoverageError, match=r"mixed is left out: its times run from .*a week"):
        merge_clouds(find_cloud_passes(written(tmp_path / "one", mixed=mixed)), SETTINGS)
    a, b = pair()
    passes = find_cloud_passes(written(tmp_path / "three", a=a, b=b, mixed=mixed), split=False)
    merging, corrected = merge_clouds(passes, SETTINGS)
    assert list(corrected) == ["a", "b"]
    assert any("mixed is left out" in problem for problem in merging.problems)
    assert merging.pairs[0].held_out.rmse < 1e-3  # [m] as without it
    _, by_station = merge_clouds(passes, replace(SETTINGS, method="grid"))
    assert "mixed" in by_station  # where time does not matter


def test_points_without_source_and_time_are_no_pass(tmp_path):
    """In a file of numbered passes they are left out; times of the others stay in use."""
    made_up = cloud("a", density=40).assign(time=("point", np.zeros(4800), {"units": "s"}))
    points = numbered(*pair(), made_up)
    points["lane"][points.lane == 13] = 0
    passes = find_cloud_passes(written(tmp_path, road=points))
    merging, corrected = merge_clouds(passes, SETTINGS)
    assert list(corrected) == ["11", "12"]
    assert merging.problems[0].startswith("4800 points of source 0 are left out")
    assert merging.pairs[0].held_out.rmse < 1e-3  # [m] as without them
    (alone,) = find_cloud_passes(
        written(
            tmp_path / "two",
            made_up=points.isel(point=points.lane.values == 0),
            road=points.isel(point=points.lane.values == 11),
        ),
        split=True,
    ).values()
    assert (alone.name, alone.number) == ("road", 11)  # by the file that holds it
    timed = points.assign(time=points.time + 1.0 + 0.001 * np.arange(points.sizes["point"]))
    assert list(find_cloud_passes(written(tmp_path / "t", road=timed))) == ["0", "11", "12"]


def test_points_without_time_among_others_are_left_out(tmp_path):
    a, b = pair()
    time = a.time.values.copy()
    time[:7] = 0.0
    passes = find_cloud_passes(
        written(tmp_path, a=a.assign(time=("point", time, a.time.attrs)), b=b)
    )
    merging, corrected = merge_clouds(passes, SETTINGS)
    assert merging.problems == ("a: 7 of 48000 points have no time and are left out",)
    assert sum(block.sizes["point"] for block in corrected["a"]()) == 47_993


def test_a_stray_strip_is_left_out_and_reported(tmp_path):
    a, b = pair()
    points = numbered(a, b, a.isel(point=slice(0, 40)), b.isel(point=[7, 9000]))
    passes = find_cloud_passes(written(tmp_path, road=points))
    merging, corrected = merge_clouds(passes, SETTINGS)
    assert list(corrected) == ["11", "12"]
    assert merging.problems[0].startswith("13 is left out: ")
    assert merging.problems[0].endswith(" cells with 40 points in all are too few for a pass")
    assert merging.problems[1].startswith("14 is left out: it has no cell of 0.2 m with 5 returns")


def test_variables_that_not_all_passes_have_are_left_out(tmp_path):
    a, b = pair()
    bright = a.assign(intensity=("point", np.full(48_000, 7), {"units": "1"}))
    for name, one in (("a", bright), ("b", b)):
        formats.write(one, tmp_path / f"{name}.zarr")
    _, corrected = merge_clouds(
        find_cloud_passes([tmp_path / f"{name}.zarr" for name in "ab"]), SETTINGS
    )
    names = [set(block.data_vars) for block in corrected.blocks()]
    assert all(found == names[0] for found in names)
    assert "intensity" not in names[0]


@pytest.mark.slow
def test_points_keep_their_other_variables(tmp_path):
    """Only heights, their sd and a changed number of the pass differ."""
    rng = np.random.default_rng(2)
    given = {}
    for name, one in zip("ab", pair(), strict=True):
        kinds = {"classification": 32, "return_number": 4, "user_data": 256, "red": 65536}
        more = {key: rng.integers(1, most, 48_000) for key, most in kinds.items()}
        more |= {"extra_Deviation": rng.integers(0, 9, 48_000), "lane": rng.integers(4, 6, 48_000)}
        given[name] = one.assign({key: ("point", values) for key, values in more.items()})
    given["a"] = given["a"].assign(nir=("point", np.full(48_000, 5)))
    given["a"].attrs |= {"coordinate_scale": [0.00025] * 3, "coordinate_offset": [0.0] * 3}
    _, corrected = merge_clouds(find_cloud_passes(written(tmp_path / "in", **given)), SETTINGS)
    for name, label in (("a", 1), ("b", 2)):
        formats.write(iter(corrected[name]()), tmp_path / f"{name}.laz")
        before = formats.open(tmp_path / "in" / f"{name}.laz")
        after = formats.open(tmp_path / f"{name}.laz")
        assert set(after.data_vars) == {*before.data_vars, "sd_relative", "extra_source"}
        assert_array_equal(after.extra_source, before.lane)
        assert (after.lane == label).all()
        for variable in set(before.data_vars) - {"easting", "northing", "up", "lane"}:
            assert_array_equal(after[variable], before[variable], err_msg=variable)
        for axis in ("easting", "northing"):
            assert_allclose(after[axis], before[axis], rtol=0, atol=1e-9)  # [m] float64
        assert max(after.attrs["coordinate_scale"]) <= ROUNDING  # of corrected heights
    # merged once more, the first numbers stay
    _, corrected = merge_clouds(
        find_cloud_passes([tmp_path / "b.laz", tmp_path / "a.laz"]), SETTINGS
    )
    again = np.concatenate([block.extra_source for block in corrected["a"]()])
    assert_array_equal(again, formats.open(tmp_path / "in" / "a.laz").lane)


def test_classes_other_than_ground_are_reported_and_left_out(tmp_path):
    roofs, grounds = {}, 0
    for name, one in zip("ab", pair(), strict=True):
        roof = one.easting.values % 3.0 < 1.0
        classes = np.where(roof, 6, 2)
        roofs[name] = one.assign(up=one.up + 4.0 * roof, classification=("point", classes))
        grounds += int(np.count_nonzero(~roof))
    files = written(tmp_path, **roofs)
    merging, _ = merge_clouds(find_cloud_passes(files), replace(SETTINGS, method="grid"))
    named = f"building (6) {96_000 - grounds:,}; take the ground alone: --class 2"
    assert any(named in one for one in merging.problems)
    passes = find_cloud_passes(files, only=PointFilter(classes=(2,)))
    merging, corrected = merge_clouds(passes, SETTINGS)
    assert not any("no ground" in one for one in merging.problems)
    points = list(corrected.blocks())
    assert sum(block.sizes["point"] for block in points) == grounds
    assert all((block.classification == 2).all() for block in points)


def test_passes_without_common_ground_are_refused(tmp_path):
    a, b = cloud("a"), cloud("b", right=50.0)
    passes = find_cloud_passes(written(tmp_path, a=a, b=b))
    with pytest.raises(CoverageError, match=r"no cell is seen by two passes.*Compare their CRS"):
        merge_clouds(passes, SETTINGS)
    with pytest.raises(CoverageError, match="pass b: overlaps with none of a"):
        merge_clouds(passes, replace(SETTINGS, method="discontinuity"))


def test_a_single_pass_is_refused(two):
    for method in ("network", "discontinuity", "grid"):
        with pytest.raises(CoverageError, match=r"at least two passes that overlap"):
            merge_clouds(find_cloud_passes(two[:1]), replace(SETTINGS, method=method))


def test_an_overlap_narrower_than_the_search_area_is_refused(tmp_path):
    passes = find_cloud_passes(written(tmp_path, a=cloud("a"), b=cloud("b", right=1.8)))
    wide = replace(SETTINGS.discontinuity, radius=0.5)
    settings = replace(SETTINGS, method="discontinuity", discontinuity=wide)
    with pytest.raises(CoverageError, match="too narrow for search areas 1 m long and 1 m wide"):
        merge_clouds(passes, settings)


def test_other_reference_systems_are_refused(tmp_path):
    a, b = pair()
    files = written(tmp_path, a=a, b=b.assign_attrs(crs="EPSG:25832"))
    with pytest.raises(SchemaError, match=r"b\.laz: has .* 'EPSG:25832', but that of a\.laz is"):
        find_cloud_passes(files)
    assert {lane.crs for lane in find_cloud_passes(files, crs="EPSG:2154").values()} == {
        "EPSG:2154"
    }
    files = written(tmp_path / "more", a=a, b=b.assign_attrs(crs=""))
    with pytest.raises(SchemaError, match=r"unknown, but that of a\.laz .* state it with --crs"):
        find_cloud_passes(files)


def test_the_same_points_twice_are_refused(two, tmp_path):
    with pytest.raises(ValueError, match=r"a\.laz is given twice"):
        find_cloud_passes([two[0], two[0]])
    (copy,) = written(tmp_path, again=pair()[0])
    for method in ("network", "discontinuity", "grid"):
        with pytest.raises(TrueTerrainError, match=r"hold.? the same (returns|points)"):
            merge_clouds(find_cloud_passes([two[0], copy]), replace(SETTINGS, method=method))


def test_a_part_of_the_same_points_is_flagged(two, tmp_path):
    """A clipped strip and the whole of it, with coordinates rounded in the same steps."""
    half = formats.open(two[0])
    (clip,) = written(tmp_path, clip=half.isel(point=np.flatnonzero(half.easting < 30)))
    merging, _ = merge_clouds(find_cloud_passes([two[0], clip]), replace(SETTINGS, method="grid"))
    assert "a and clip do not differ at all in most of" in merging.problems[0]


def test_files_of_one_name_are_distinguished_by_folder(tmp_path):
    a, b = pair()
    files = [*written(tmp_path / "one", run=a), *written(tmp_path / "two", run=b)]
    assert list(find_cloud_passes(files)) == ["one-run", "two-run"]
    deep = [*files, *written(tmp_path / "more", x=a)]
    (tmp_path / "more" / "one").mkdir()
    deep.append(*written(tmp_path / "more" / "one", run=b))
    with pytest.raises(ValueError, match="names that differ, got one-run twice"):
        find_cloud_passes(deep)


def test_cells_too_small_for_the_points_are_refused(two):
    settings = with_cells(MergeSettings(), 0.02)
    with pytest.raises(CoverageError, match=r"fewer than two passes .* points suggest 0\.25 m"):
        merge_clouds(find_cloud_passes(two), settings)


def test_heights_that_are_not_finite_name_the_file(tmp_path):
    a, b = pair()
    a.up[5] = np.nan
    for name, one in (("a", a), ("b", b)):
        formats.write(one, tmp_path / f"{name}.zarr")
    with pytest.raises(TrueTerrainError, match=r"a\.zarr: variable up.* finite"):
        merge_clouds(find_cloud_passes([tmp_path / f"{name}.zarr" for name in "ab"]), SETTINGS)


def test_no_file_is_an_error():
    with pytest.raises(ValueError, match="at least one file"):
        find_cloud_passes([])
    with pytest.raises(ValueError, match="at least one pass"):
        suggested_cell({})


@pytest.mark.parametrize(
    ("density", "size"), [(4000, 0.1), (400, 0.2), (240, 0.25), (60, 0.5), (13, 1.0), (1.5, 2.0)]
)
def test_cells_suit_the_density(density, size, tmp_path):
    passes = find_cloud_passes(written(tmp_path, a=cloud("a", width=1.0, density=density)))
    assert suggested_cell(passes) == size


@pytest.mark.parametrize(
    ("file", "passes", "gain"),
    [
        ("las_with_origin_dsmMarker.laz", {"3025", "3026"}, 0.35),
        ("test_data_77055_627755_LA93_IGN69.laz", {"706", "707"}, 1.0),
        ("test_data_77055_627760_LA93_IGN69.laz", {"706", "707"}, 1.0),
        ("St_Barth_RGAF09_UTM20N_IGN_1988_SB_subset_100m.laz", {"4320", "4330"}, 1.0),
        ("faceraster_2strips_20m.laz", {"305", "306"}, 0.6),
    ],
)
def test_real_strips_agree_better_in_held_out_cells(file, passes, gain, data):
    """In cells of 1 m, as the points suggest; stray strips are left out and reported."""
    found = find_cloud_passes([data / STRIPS / file])
    assert suggested_cell(found) == 1.0
    merging, corrected = merge_clouds(found, with_cells(MergeSettings(), 1.0))
    assert set(corrected) == passes
    (agreement,) = merging.pairs
    assert agreement.held_out.rmse < gain * agreement.before.rmse
    assert agreement.after.nmad < agreement.before.nmad + 1e-4  # [m]
    for stray in set(found) - passes:
        assert any(one.startswith(f"{stray} is left out: 9 cells") for one in merging.problems)


def test_real_tiles_are_one_road(data):
    """Six tiles of two strips: both agree as in each tile, in one adjustment."""
    tiles = sorted((data / STRIPS).glob("test_data_770*_LA93_IGN69.laz"))
    passes = find_cloud_passes(tiles, split=True)
    assert list(passes) == ["706", "707"]
    assert len(passes["706"].files) == 6
    merging, _ = merge_clouds(passes, with_cells(MergeSettings(), 1.0))
    (agreement,) = merging.pairs
    assert agreement.held_out.rmse < agreement.before.rmse
    assert agreement.before.n > 3000


def test_a_method_that_increases_differences_is_flagged(data):
    """Discontinuity vectors by the mean of trees and roofs."""
    passes = find_cloud_passes([data / STRIPS / "test_data_77050_627755_LA93_IGN69.laz"])
    settings = with_cells(MergeSettings(method="discontinuity"), 1.0)
    merging, _ = merge_clouds(passes, settings)
    assert any("the method does not suit this ground" in problem for problem in merging.problems)


def test_cells_of_clouds_are_those_compared(data):
    path = data / STRIPS / "las_with_origin_dsmMarker.laz"
    cells, size, problems = cells_of_clouds(find_cloud_passes([path]))
    assert (size, problems) == (1.0, [])
    (found,) = compare_passes(cells)
    (known,) = compare_passes(cells_of_points(formats.point_blocks(path), CellSettings(size=1.0)))
    assert found.before == known.before
