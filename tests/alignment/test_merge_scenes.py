"""Merging recorded runs of scenes whose ground is known: seams, truth, closure, and no harm done.

Seams are measured on cells that are collected again with the corrected motion, so that nothing
that the adjustment believes of itself enters them.
"""

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.alignment.merge import MergeSettings, compare_passes, merge_cells
from trueterrain.alignment.run_passes import cells_of_passes, merge_runs
from trueterrain.alignment.seams import find_seams
from trueterrain.formats.run import open_run
from trueterrain.georeference import georeference
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.simulate.drift import MeasuredDrift
from trueterrain.simulate.scene import read_scene, record_scene
from trueterrain.surface import node_coordinates
from trueterrain.surface.grid import GridSettings
from trueterrain.surface.placement import GridPlacement
from trueterrain.surface.runs import PassRecord, grid_runs
from trueterrain.verify import exact_trajectory, ground_errors, truth_of

pytestmark = pytest.mark.slow

NETWORK_SEAM = 0.0002  # [m] asked of the network adjustment
VECTORS_SEAM = 0.001  # [m] that the thesis reports
CLOSURE = 0.0002  # [m] asked of loops
SAME = 1e-9  # [m] round-off of the solver
CAR = 0.4  # [m] by which an object that one pass saw stands above the road
SURE = 4.0  # standard deviations that noise does not exceed
RARE = 1e-4  # probability below which chance is no explanation


def passes_of(runs, scene):
    """Runs of a scene with their fused motion, by the names of their passes."""
    return {
        drive.name: PassRecord(run=path, trajectory=fuse_motion(open_run(path)).trajectory)
        for drive, path in zip(scene.passes, runs, strict=True)
    }


def seam_of(passes):
    """Steps at the edges of the overlaps, seen anew [m]."""
    cells = cells_of_passes(passes)
    none = {one.name: np.zeros(len(one)) for one in cells}
    return [seam.before.median for seam in find_seams(cells, none, 0.1)[0]]


def errors_of(passes):
    """Errors of the surface of passes against their recorded truth."""
    some = list(passes.values())
    surface, _ = grid_runs(
        some, GridPlacement(spacing=0.05, lap=True).of_runs(some), GridSettings(range_noise=0.0005)
    )
    known = [truth_of(one.path) for one in some]

    def height(easting, northing):
        found = known[0](easting, northing)
        for other in known[1:]:
            found = np.where(np.isfinite(found), found, other(easting, northing))
        return found

    return surface, ground_errors(surface, height)


@pytest.fixture(scope="module")
def two_passes(tmp_path_factory, data):
    """Half of the ready scene, with the drift that was measured on the road."""
    scene, _ = read_scene("belgian-two-lanes")
    first, second = sorted((data / "scanning" / "trajectories").glob("boreas-*.csv"))
    drift = MeasuredDrift(first=first, second=second)
    scene = replace(
        scene,
        course={"kind": "straight", "length": 20.0},
        raster=0.01,
        scanner=replace(scene.scanner, beams=300),
        navigation=replace(scene.navigation, drift=drift),
    )
    return passes_of(record_scene(scene, tmp_path_factory.mktemp("two")), scene)


@pytest.fixture(scope="module")
def cells(two_passes):
    """Cells of both passes."""
    return cells_of_passes(two_passes)


@pytest.fixture(scope="module")
def merged(two_passes):
    """Both passes merged by the network adjustment."""
    return merge_runs(two_passes)


def test_the_network_closes_the_seam(two_passes, merged):
    merging, passes = merged
    (before,), (after,) = seam_of(two_passes), seam_of(passes)
    assert before > 0.005  # the measured drift of two drives
    assert after < NETWORK_SEAM
    (reported,) = merging.seams
    npt.assert_allclose(reported.before.median, before, rtol=0, atol=1e-5)
    npt.assert_allclose(reported.after.median, after, rtol=0, atol=0.5 * NETWORK_SEAM)


def test_the_vectors_of_the_thesis_close_the_seam(two_passes):
    _, passes = merge_runs(two_passes, MergeSettings(method="discontinuity"))
    (after,) = seam_of(passes)
    assert after < VECTORS_SEAM


def test_the_grid_method_corrects_nothing_and_warns(two_passes):
    merging, passes = merge_runs(two_passes, MergeSettings(method="grid"))
    assert passes == two_passes
    assert any("steps remain" in problem for problem in merging.problems)
    assert merging.seams[0].before.median == merging.seams[0].after.median


def test_the_merged_ground_is_more_accurate_than_each_pass(two_passes, merged):
    _, passes = merged
    _, together = errors_of(passes)
    _, as_recorded = errors_of(two_passes)
    alone = [errors_of({name: one})[1] for name, one in two_passes.items()]
    assert together["rms_about_median"] < min(one["rms_about_median"] for one in alone)
    assert together["rms_about_median"] < as_recorded["rms_about_median"]


def test_sd_of_the_merged_ground_includes_the_datum(two_passes, merged):
    """The error common to both is in `sd` of surfaces and points, not in `sd_relative`."""
    merging, passes = merged
    (datum,) = set(merging.adjustment.datum_sd.values())
    reported = [
        np.sqrt(np.median(one.trajectory.covariance[:, 2, 2])) for one in two_passes.values()
    ]
    npt.assert_allclose(datum, np.hypot(*reported) / 2, rtol=0.05)  # 4 s of a drift of 25 s
    surface, _ = grid_runs(
        list(passes.values()),
        GridPlacement(spacing=0.05, lap=True).of_runs(list(passes.values())),
        GridSettings(range_noise=0.0005, agreed=True),
    )
    extra = surface.sd.values**2 - surface.sd_relative.values**2
    npt.assert_allclose(extra[np.isfinite(extra)], datum**2, rtol=1e-3)  # float32
    one = passes["left"]
    points = next(georeference(one.path, one.trajectory, one.mounting))
    npt.assert_allclose(points.sd**2 - points.sd_relative**2, datum**2, rtol=1e-6)
    alone = next(georeference(one.path, two_passes["left"].trajectory))
    assert ("sd" in alone, "sd_relative" in alone) == (True, False)


@pytest.mark.parametrize("method", ["network", "discontinuity", "grid"])
def test_no_method_omits_errors_common_to_all_passes(two_passes, method):
    _, passes = merge_runs(two_passes, MergeSettings(method=method, fixed=()))
    some = list(passes.values())
    surface, _ = grid_runs(
        some, GridPlacement(spacing=0.1, lap=True).of_runs(some), GridSettings(agreed=True)
    )
    least = min(np.sqrt(one.trajectory.covariance[:, 2, 2].min()) for one in two_passes.values())
    assert np.nanmin(surface.sd) > 0.9 * least / np.sqrt(2)


def test_a_fixed_pass_has_the_reported_sd(two_passes):
    merging, passes = merge_runs(two_passes, MergeSettings(fixed=("left",)))
    own = np.sqrt(np.mean(two_passes["left"].trajectory.covariance[:, 2, 2]))
    npt.assert_allclose(list(merging.adjustment.datum_sd.values()), own, rtol=1e-3)
    for one in passes.values():
        assert one.trajectory.datum_sd == merging.adjustment.datum_sd["left"]
    npt.assert_allclose(passes["left"].trajectory.covariance[:, 2, 2], own**2, rtol=2e-3)


def test_the_order_of_the_passes_does_not_matter(cells):
    one = merge_cells(cells).adjustment
    other = merge_cells(cells[::-1]).adjustment
    for name in one.names:
        time = one.correction(name).knots.begin + np.linspace(0, 3, 50)
        for component in ("height", "roll", "east"):
            npt.assert_allclose(
                other.correction(name)(time, component),
                one.correction(name)(time, component),
                rtol=0,
                atol=SAME,
            )


def test_an_object_in_one_pass_is_rejected_without_bias(cells):
    left = next(one for one in cells if one.name == "left")
    inside = (np.abs(left.easting - 10.0) < 2.0) & (np.abs(left.northing) < 0.2)
    assert inside.sum() > 30
    with_car = replace(left, height=left.height + np.where(inside, CAR, 0.0))
    others = [one for one in cells if one.name != "left"]
    clean, parked = merge_cells(cells), merge_cells([with_car, *others])
    rejected = set(parked.adjustment.rejected.cell.tolist())
    shared = set(left.cell[inside].tolist()) & set(others[0].cell.tolist())
    assert len(shared & rejected) > 0.95 * len(shared)
    (before,), (after,) = clean.seams, parked.seams
    # at the stretches where the object did not stand
    away = (np.abs(after.before.step - before.before.step) < SAME).all(axis=0)
    assert away.sum() > 10
    npt.assert_allclose(
        after.after.step[:, away], before.after.step[:, away], rtol=0, atol=NETWORK_SEAM
    )


def exactly(path):
    """True trajectory of a run, with a negligible standard deviation."""
    found = exact_trajectory(path)
    return replace(found, covariance=np.tile(1e-8 * np.eye(6), (found.time.size, 1, 1)))


def test_without_drift_there_is_no_correction(two_passes):
    true = {name: replace(one, trajectory=exactly(one.path)) for name, one in two_passes.items()}
    merging, _ = merge_runs(true)
    together = merging.adjustment.tests[-1]
    assert together.p_value > RARE
    for one in merging.adjustment.corrections:
        time = np.linspace(0.5, 3.5, 50)
        for offset in (-2.0, 0.0, 2.0):
            assert (np.abs(one.height_at(time, offset)) < SURE * one.sd(time, offset)).all()
    (seam,) = merging.seams
    npt.assert_allclose(seam.after.median, seam.before.median, rtol=0, atol=NETWORK_SEAM)


@pytest.fixture(scope="module")
def three_passes(tmp_path_factory):
    """A part of the ready scene: the middle pass driven against the others."""
    scene, _ = read_scene("three-lanes")
    scene = replace(
        scene,
        course={"kind": "straight", "length": 30.0},
        raster=0.01,
        scanner=replace(scene.scanner, beams=160),
    )
    return passes_of(record_scene(scene, tmp_path_factory.mktemp("three")), scene)


def cross_slope(surface, passes):
    """Slope across, of its errors against the truth, station by station [1]."""
    easting, northing = node_coordinates(surface)
    found = np.full(surface.height.shape, np.nan)
    for one in passes.values():
        truth = truth_of(one.path)(easting, northing)
        found = np.where(np.isfinite(found), found, surface.height.values - truth)
    v = surface["v"].values
    good = np.isfinite(found)
    rows = good.sum(axis=1) > 0.8 * v.size
    return np.array(
        [
            np.polyfit(v[known], row[known], 1)[0]
            for row, known in zip(found[rows], good[rows], strict=True)
        ]
    )


def test_three_passes_close_without_twist(three_passes):
    merging, passes = merge_runs(three_passes)
    assert len(merging.pairs) == 2
    assert all(abs(pair.after.median) < CLOSURE for pair in merging.pairs)
    assert all(seam < NETWORK_SEAM for seam in seam_of(passes))
    surface, together = errors_of(passes)
    alone = {name: errors_of({name: one}) for name, one in three_passes.items()}
    # neither the long waves nor the cross slope are worse than those of the best single pass, but
    # for what three passes add to the width
    assert together["rms_about_median"] < 1.2 * max(
        error["rms_about_median"] for _, error in alone.values()
    )
    best = min(
        np.abs(cross_slope(one, {name: three_passes[name]})).mean()
        for name, (one, _) in alone.items()
    )
    assert np.abs(cross_slope(surface, passes)).mean() < best + CLOSURE


@pytest.fixture(scope="module")
def lap(tmp_path_factory):
    """A lap and some metres of a small oval."""
    scene, _ = read_scene("oval")
    scene = replace(
        scene,
        course={"kind": "oval", "straight": 12.0, "radius": 14.0, "transition": 8.0},
        scanner=replace(scene.scanner, beams=80),
        raster=0.02,
        passes=(replace(scene.passes[0], length=140.0),),
    )
    return passes_of(record_scene(scene, tmp_path_factory.mktemp("oval")), scene)


def test_a_lap_closes(lap):
    merging, passes = merge_runs(lap)
    (loop,) = merging.adjustment.closures
    assert abs(loop.before) > CLOSURE
    assert abs(loop.after) < CLOSURE
    (pair,) = compare_passes(cells_of_passes(passes))
    assert abs(pair.before.median) < CLOSURE
    surface, after = errors_of(passes)
    _, before = errors_of(lap)
    assert after["rms_about_median"] < 1.05 * before["rms_about_median"]
    assert surface.sizes["u"] * 0.05 < 140.0


def test_runs_without_accelerometers_are_merged(two_passes):
    settings = FusionSettings(method="navigation")
    plain = {
        name: replace(one, trajectory=fuse_motion(open_run(one.path), settings=settings).trajectory)
        for name, one in two_passes.items()
    }
    merging, _ = merge_runs(plain)
    assert merging.pairs[0].after.rmse < 0.5 * merging.pairs[0].before.rmse
