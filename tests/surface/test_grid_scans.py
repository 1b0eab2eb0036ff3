"""Surfaces of recorded runs against the ground that was scanned, and against plain numpy."""

import json
import shutil
from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from scipy.stats import binned_statistic_2d

from trueterrain.core.errors import CoverageError, FormatError, SchemaError
from trueterrain.geometry.reference_line import line_from_trajectory
from trueterrain.georeference import ScanGeometry, Screening, georeference, mounting_of
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import RoadShape
from trueterrain.surface import node_coordinates, xy_to_uv
from trueterrain.surface.accumulate import STEP, CellSums
from trueterrain.surface.cells import grid_along, grid_over
from trueterrain.surface.grid import GridSettings, surface_of
from trueterrain.surface.holes import HoleSettings, fill_holes
from trueterrain.surface.runs import PassRecord, grid_runs

pytestmark = pytest.mark.slow

TRUE = 1e-4  # [m] surface of a run without noise; ranges are stored in steps of as much
ROUNDED = STEP  # [m] step of the heights, and the mean of what is left

STRAIGHT = {"kind": "straight", "length": 40.0}
OVAL = {"kind": "oval", "straight": 30.0, "radius": 25.0, "transition": 15.0}
COURSES = {
    "straight": (STRAIGHT, RoadShape(), 12.0),
    "banked and climbing": (STRAIGHT, RoadShape(slope=0.04, banking=-0.06), 12.0),
    "curved and leaning": (OVAL, RoadShape(superelevation=0.05), 52.0),
}


def grid_of(driven, spacing=0.01, width=1.7):
    begin, end = driven.time[[0, -1]] + driven.mounting.scanner_clock + [0.0, 1e-3]
    line = line_from_trajectory(
        driven.trajectory,
        spacing=spacing,
        lever=driven.mounting.scanner_position,
        begin=begin,
        end=end,
    )
    return grid_along(line, right=-width, left=width, spacing=spacing)


def sums_of(driven, grid, options=GridSettings(), *, size=10**9, threads=1, geometry=None):
    sums = CellSums(grid, options.kept_sums(), threads=threads)
    for start in range(0, driven.time.size, size):
        part = slice(start, start + size)
        sums.add_scans(geometry or driven.geometry, driven.time[part], driven.range[part])
    return sums


def inner(count):
    """Cells that have returns in all cells around them, two deep."""
    seen = np.pad(count > 0, 2)
    whole = np.ones(count.shape, bool)
    for i in range(5):
        for j in range(5):
            whole &= seen[i : i + count.shape[0], j : j + count.shape[1]]
    return whole


@pytest.fixture(scope="module", params=COURSES)
def noise_free(request, drive):
    course, road, start = COURSES[request.param]
    return drive(course, road, start=start)


def test_the_surface_of_a_run_without_noise_is_the_ground(noise_free):
    surface = surface_of(sums_of(noise_free, grid_of(noise_free)))
    truth = noise_free.ground.height(*node_coordinates(surface))
    cells = inner(surface["count"].values)
    assert cells.mean() > 0.9
    npt.assert_allclose(surface.height.values[cells], truth[cells], rtol=0, atol=TRUE)


def test_sums_from_ranges_are_those_of_points_and_scipy(noise_free):
    """Counts and plain means from points, their grid coordinates and scipy's statistic."""
    grid, options = grid_of(noise_free), GridSettings(level=False)
    surface = surface_of(sums_of(noise_free, grid, options), options)
    blocks = georeference(noise_free.path, noise_free.trajectory)
    x, y, z = np.concatenate([np.stack([b.easting, b.northing, b.up]) for b in blocks], axis=1)
    u, v = xy_to_uv(grid.frame, x, y)
    on = np.isfinite(u)
    edges = [
        np.append(axis - 0.5 * step, axis[-1] + 0.5 * step)
        for axis, step in zip((grid.u, grid.v), grid.spacing, strict=True)
    ]
    mean, *_ = binned_statistic_2d(u[on], v[on], z[on], "mean", bins=edges)
    count, *_ = binned_statistic_2d(u[on], v[on], z[on], "count", bins=edges)
    npt.assert_array_equal(surface["count"], count)
    npt.assert_allclose(surface.height, mean, rtol=0, atol=ROUNDED)


@pytest.mark.parametrize("statistic", ["mean", "minimum"])
def test_surfaces_are_the_same_bit_for_bit(noise_free, statistic):
    """For blocks of 1,000, 7,777 and 100,000 scans and smaller ones, and 1 and 2 threads."""
    grid, options = grid_of(noise_free), GridSettings(statistic=statistic)
    first = surface_of(sums_of(noise_free, grid, options), options)
    for size in (77, 256, 1000, 7777, 100_000):
        for threads in (1, 2):
            sums = sums_of(noise_free, grid, options, size=size, threads=threads)
            other = surface_of(sums, options)
            for name in ("height", "sd", "count"):
                npt.assert_array_equal(other[name], first[name])


def test_runs_from_their_stores_are_the_same(noise_free):
    """With motion, mounting and ranges as they are stored, in blocks, and for the median too."""
    grid = grid_of(noise_free)
    one = PassRecord(run=noise_free.path, trajectory=noise_free.trajectory)
    surface, report = grid_runs([one], grid, threads=2, block=99)
    direct = surface_of(sums_of(noise_free, grid))
    npt.assert_array_equal(surface["count"], direct["count"])
    npt.assert_allclose(surface.height, direct.height, rtol=0, atol=ROUNDED)
    assert report["used"] == direct["count"].values.sum()
    options = GridSettings(statistic="median")
    middle, _ = grid_runs([one], grid, options, block=99)
    again, _ = grid_runs([one], grid, options, threads=2)
    npt.assert_array_equal(middle.height, again.height)
    few = surface["count"].values <= 2  # the median of two is their mean
    plain, _ = grid_runs([one], grid, GridSettings(level=False))
    npt.assert_allclose(middle.height.values[few], plain.height.values[few], rtol=0, atol=ROUNDED)
    with pytest.raises(ValueError, match="at least one pass"):
        grid_runs([], grid)
    early = PassRecord(
        run=noise_free.path,
        trajectory=replace(noise_free.trajectory, time=noise_free.trajectory.time + 100.0),
    )
    with pytest.raises(CoverageError, match="covers none of the"):
        grid_runs([early], grid)


def test_runs_of_different_frames_are_refused(noise_free, tmp_path):
    other = tmp_path / "other.zarr"
    shutil.copytree(noise_free.path, other)
    document = json.loads((other / "zarr.json").read_text())
    document["attributes"]["origin"] = [12.0, 48.0, 500.0]
    (other / "zarr.json").write_text(json.dumps(document))
    passes = [
        PassRecord(run=path, trajectory=noise_free.trajectory) for path in (noise_free.path, other)
    ]
    with pytest.raises(SchemaError, match="attribute origin: is"):
        grid_runs(passes, grid_of(noise_free))


def test_earlier_names_of_a_pass_are_deprecated(noise_free):
    with pytest.warns(DeprecationWarning, match="run="):
        one = PassRecord(path=noise_free.path, trajectory=noise_free.trajectory)
    assert one.path == one.run.source == noise_free.path
    with pytest.warns(DeprecationWarning, match=r"run\.mounting"):
        assert mounting_of(one.run) == one.mounting
    with pytest.raises(ValueError, match="run must be a run or its store"):
        PassRecord(trajectory=noise_free.trajectory)


def test_a_damaged_chunk_is_named(noise_free, tmp_path):
    broken = tmp_path / "broken.zarr"
    shutil.copytree(noise_free.path, broken)
    (broken / "scans" / "range" / "c.0.0").write_bytes(b"nonsense")
    with pytest.raises(FormatError, match=r"array scans/range, chunk c\.0\.0: is damaged"):
        grid_runs([PassRecord(run=broken, trajectory=noise_free.trajectory)], grid_of(noise_free))


def test_stored_numbers_and_metres_give_the_same(noise_free):
    grid = grid_of(noise_free)
    metres = sums_of(noise_free, grid)
    lost = np.isnan(noise_free.range)
    raw = np.where(lost, 65535, np.rint(np.nan_to_num(noise_free.range) / 1e-4)).astype(np.uint16)
    stored = CellSums(grid)
    stored.add_scans(noise_free.geometry, noise_free.time, raw, scale=1e-4, missing=65535)
    a, b = surface_of(metres), surface_of(stored)
    npt.assert_array_equal(a["count"], b["count"])
    npt.assert_allclose(a.height, b.height, rtol=0, atol=ROUNDED)


@pytest.mark.parametrize(("beams", "span"), [(1, 0.0), (300, 9e-3)])
def test_scanners_of_one_beam_and_slow_ones(noise_free, beams, span):
    """A profiler, and a scanner whose scans are cut into pieces, against points one by one."""
    angle = np.linspace(-0.6, 0.6, beams) if beams > 1 else np.zeros(1)
    delay = np.linspace(0, span, beams)[::-1]
    geometry = ScanGeometry(noise_free.trajectory, noise_free.mounting, angle, delay)
    assert geometry.pieces == (1 if beams == 1 else 5)
    time = noise_free.time[:: 1 if beams == 1 else 10]
    ranges = np.full((time.size, beams), 1.9)
    grid, options = grid_of(noise_free), GridSettings(level=False)
    fused, one_by_one = CellSums(grid, options.kept_sums()), CellSums(grid, options.kept_sums())
    fused.add_scans(geometry, time, ranges)
    scans = xr.Dataset(
        {
            "time": ("scan", time),
            "range": (("scan", "beam"), ranges),
            "angle": ("beam", angle),
            "delay": ("beam", delay),
        }
    )
    for points in georeference([scans], noise_free.trajectory, noise_free.mounting):
        one_by_one.add_points(points.easting, points.northing, points.up)
    a, b = surface_of(fused, options), surface_of(one_by_one, options)
    npt.assert_array_equal(a["count"], b["count"])
    npt.assert_allclose(a.height, b.height, rtol=0, atol=ROUNDED)
    assert fused.return_totals.used > 0.5 * time.size


def test_spacing_finer_than_the_data_leaves_holes_that_are_counted(noise_free):
    surface = surface_of(sums_of(noise_free, grid_of(noise_free, spacing=0.002, width=0.2)))
    seen = np.isfinite(surface.height.values)
    assert 0.1 < seen.mean() < 0.6
    filled, report = fill_holes(surface, HoleSettings(largest=0.01))
    assert report["filled_nodes"] == (np.isfinite(filled.height.values) & ~seen).sum()
    assert report["open_nodes"] + report["unseen_nodes"] == np.isnan(filled.height.values).sum()


def test_a_map_and_a_road_show_the_same_ground(drive):
    driven = drive(STRAIGHT, RoadShape(banking=0.03))
    where = driven.trajectory.at(driven.time[[5, -5]]).position - np.array([2.2, 0.0, 0.0])
    grid = grid_over(where[0, 0] + 0.2, -1.0, where[1, 0] - 0.2, 1.0, spacing=(0.01, 0.02))
    surface = surface_of(sums_of(driven, grid))
    assert surface.height.dims == ("northing", "easting")
    truth = driven.ground.height(*node_coordinates(surface))
    cells = inner(surface["count"].values)
    assert cells.mean() > 0.9
    npt.assert_allclose(surface.height.values[cells], truth[cells], rtol=0, atol=TRUE)


def test_returns_far_off_the_line_do_no_harm(drive):
    """A grid of the whole oval, of which a part is driven, and one that is elsewhere."""
    driven = drive(OVAL, start=52.0)
    grid = grid_of(driven)
    curve = grid.line.curve
    moved = replace(grid.line, curve=replace(curve, easting=curve.easting + 500.0))
    sums = sums_of(driven, grid_along(moved, right=-1.7, left=1.7))
    assert (sums.return_totals.used, sums.return_totals.outside) == (
        0,
        np.isfinite(driven.range).sum(),
    )
    with pytest.raises(CoverageError, match="0 lie on the grid"):
        surface_of(sums)


NOISY = Scanner(spot_rays=1, dropouts=0.01, saturation_bias=0.0)
CAUTIOUS = GridSettings(range_noise=NOISY.range_noise)


@pytest.mark.parametrize("banking", [0.0, 0.08])
def test_standard_deviations_are_honest_without_errors_of_the_pose(drive, banking):
    driven = drive(STRAIGHT, RoadShape(banking=banking), scanner=NOISY)
    surface = surface_of(sums_of(driven, grid_of(driven)), GridSettings())
    truth = driven.ground.height(*node_coordinates(surface))
    cells = inner(surface["count"].values)
    ratio = (surface.height.values - truth)[cells] / surface.sd.values[cells]
    assert 0.9 < np.sqrt(np.mean(ratio**2)) < 1.1


@pytest.mark.slow
@pytest.mark.parametrize(
    "sd", [[0.002, 0.002, 0.001, 3e-4, 3e-4, 3e-4], [0.01, 0.01, 0.0, 2e-3, 2e-3, 1e-3]]
)
def test_standard_deviations_are_honest_with_errors_of_the_pose(drive, with_errors, sd):
    """Errors of all components of the pose that last for some 20 scans; many draws of them."""
    driven = drive(STRAIGHT, RoadShape(banking=0.02), scanner=NOISY, length=3.0)
    grid = grid_of(driven)
    ratios = []
    for seed in range(16):
        rng = np.random.default_rng(seed)
        trajectory = with_errors(driven.trajectory, rng, np.array(sd))
        geometry = type(driven.geometry)(
            trajectory, driven.mounting, driven.geometry.angle, driven.geometry.delay
        )
        surface = surface_of(sums_of(driven, grid, geometry=geometry), CAUTIOUS)
        truth = driven.ground.height(*node_coordinates(surface))
        cells = inner(surface["count"].values)
        ratios.append((surface.height.values - truth)[cells] / surface.sd.values[cells])
    assert 0.9 < np.sqrt(np.mean(np.concatenate(ratios) ** 2)) < 1.1


def test_errors_of_passes_average_out(drive, with_errors):
    """Four passes with errors of the pose of their own: half the standard deviation, and honest."""
    driven = drive(STRAIGHT, RoadShape(), scanner=NOISY, length=3.0)
    grid, sd = grid_of(driven), np.array([0.002, 0.002, 0.003, 5e-4, 5e-4, 5e-4])
    ratios, sizes = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        sums = CellSums(grid)
        for number in range(4):
            if number:
                sums.next_pass()
            geometry = type(driven.geometry)(
                with_errors(driven.trajectory, rng, sd),
                driven.mounting,
                driven.geometry.angle,
                driven.geometry.delay,
            )
            sums.add_scans(geometry, driven.time, driven.range)
            if number == 0:
                alone = surface_of(sums, CAUTIOUS).sd.values
        surface = surface_of(sums, CAUTIOUS)
        truth = driven.ground.height(*node_coordinates(surface))
        cells = inner(surface["count"].values)
        ratios.append((surface.height.values - truth)[cells] / surface.sd.values[cells])
        sizes.append(np.nanmedian(surface.sd.values / alone))
    assert 0.9 < np.sqrt(np.mean(np.concatenate(ratios) ** 2)) < 1.1
    # a little more than half: errors that change within a pass are scatter as well
    assert 0.48 < min(sizes) <= max(sizes) < 0.56


def test_errors_of_passes_in_agreement_stay(drive, with_errors):
    """Four passes with one error of the pose: no smaller than that of one pass, and honest."""
    driven = drive(STRAIGHT, RoadShape(), scanner=NOISY, length=3.0)
    grid, sd = grid_of(driven), np.array([0.002, 0.002, 0.003, 5e-4, 5e-4, 5e-4])
    agreed = replace(CAUTIOUS, agreed=True)
    ratios = []
    for seed in range(16):
        trajectory = with_errors(driven.trajectory, np.random.default_rng(seed), sd)
        geometry = type(driven.geometry)(
            trajectory, driven.mounting, driven.geometry.angle, driven.geometry.delay
        )
        sums = CellSums(grid, agreed.kept_sums())
        for number in range(4):
            if number:
                sums.next_pass()
            sums.add_scans(geometry, driven.time, driven.range)
        surface = surface_of(sums, agreed)
        truth = driven.ground.height(*node_coordinates(surface))
        cells = inner(surface["count"].values)
        ratios.append((surface.height.values - truth)[cells] / surface.sd.values[cells])
    assert 0.9 < np.sqrt(np.mean(np.concatenate(ratios) ** 2)) < 1.1


def test_flagged_returns_are_left_out_or_weigh_less(drive):
    driven = drive(STRAIGHT, length=1.0)
    grid = grid_of(driven)
    rng = np.random.default_rng(1)
    bad = rng.random(driven.range.shape) < 0.3
    intensity = np.where(bad, 100, 1000).astype(np.uint16)
    wrong = np.where(bad, driven.range - 0.05, driven.range)

    def surface(screening, ranges):
        sums = CellSums(grid)
        sums.add_scans(driven.geometry, driven.time, ranges, intensity, screening=screening)
        return surface_of(sums), sums

    strict, sums = surface(Screening(floor=500.0), wrong)
    assert sums.return_totals.flagged == (bad & np.isfinite(driven.range)).sum()
    without = np.where(bad, np.nan, driven.range)
    npt.assert_array_equal(strict.height, surface(Screening(), without)[0].height)
    soft, _ = surface(Screening(floor=500.0, weight=0.125), wrong)
    plain, _ = surface(Screening(), wrong)
    truth = driven.ground.height(*node_coordinates(plain))
    off = [np.nanmean(np.abs(found.height - truth)) for found in (strict, soft, plain)]
    assert off[0] < 1e-4 < off[1] < 0.3 * off[2]


def test_scans_without_motion_are_counted(drive):
    driven = drive(STRAIGHT, length=1.0)
    sums = CellSums(grid_of(driven))
    time = driven.time.copy()
    time[:3] = [np.nan, -5.0, 99.0]
    sums.add_scans(driven.geometry, time, driven.range)
    assert (sums.return_totals.scans, sums.return_totals.scans_uncovered) == (time.size, 3)


def test_arguments_without_sense_are_refused(drive):
    driven = drive(STRAIGHT, length=1.0)
    grid = grid_of(driven)
    with pytest.raises(ValueError, match="threads must be at least 1"):
        CellSums(grid, threads=0)
    sums = CellSums(grid)
    with pytest.raises(ValueError, match="must have the shape"):
        sums.add_scans(driven.geometry, driven.time, driven.range[1:])
    with pytest.raises(ValueError, match="not recorded"):
        sums.add_scans(driven.geometry, driven.time, driven.range, screening=Screening(floor=1.0))
    sums.add_scans(driven.geometry, driven.time, driven.range)
    with pytest.raises(ValueError, match="with weights, or none"):
        sums.add_scans(
            driven.geometry,
            driven.time,
            driven.range,
            driven.range,
            screening=Screening(floor=1.0, weight=0.5),
        )
    with pytest.raises(ValueError, match="lack extremes"):
        surface_of(sums, GridSettings(statistic="maximum"))
