"""The same scene is the same run, byte by byte; and a pass that fails leaves nothing."""

from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core.errors import CoverageError, FormatError, OutputError
from trueterrain.formats import opencrg
from trueterrain.formats.run import Mounting, open_run
from trueterrain.simulate.accelerometers import Accelerometers
from trueterrain.simulate.ground import Plane, sample_road
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import (
    Scene,
    ScenePass,
    Standing,
    record_pass,
    record_scene,
    set_stage,
)

pytestmark = pytest.mark.slow

WRONG_CLOCKS = {
    "navigation": Navigation(clock_offset=0.0031, clock_rate=2e-4),
    "accelerometers": Accelerometers(clock_offset=-0.0017, clock_rate=-1e-4),
    "mounting": Mounting(scanner_position=(-2.25, 0.0, 1.2), scanner_clock=0.0013),
}
FAST = {"kind": "constant", "speed": 7.0}


def scene(**changes) -> Scene:
    """Half a second through a curve of stones, with clocks that are wrong."""
    values = {
        "name": "curve",
        "course": {"kind": "arc", "radius": 12.0, "angle": 1.6},
        "ground": (
            {"kind": "road", "road_class": "B", "waves": 50},
            {"kind": "stones", "density": 5.0},
        ),
        "passes": (ScenePass(name="only", start=3.0, length=3.3, speed=FAST),),
        "scanner": Scanner(beams=300),
        "raster": 0.01,
        **WRONG_CLOCKS,
    }
    return Scene(**values | changes)


def files_of(store: Path) -> dict[str, bytes]:
    """Content of all files of a store."""
    return {
        str(file.relative_to(store)): file.read_bytes()
        for file in sorted(store.rglob("*"))
        if file.is_file()
    }


def recorded(scene: Scene, folder: Path, **how) -> Path:
    """The run of the only pass of a scene."""
    folder.mkdir()
    stage = set_stage(scene)
    (drive,) = scene.passes
    target = folder / "run.zarr"
    record_pass(stage, drive, stage.motion(drive), target, **how)
    return target


def test_a_seed_makes_the_same_bytes_for_any_block_and_any_number_of_threads(tmp_path):
    first = files_of(recorded(scene(), tmp_path / "first"))
    assert len(first) > 60  # every array of a run, with its chunks
    assert files_of(recorded(scene(), tmp_path / "again")) == first
    for block in (0.037, 0.1, 5.0):
        assert files_of(recorded(scene(), tmp_path / f"{block}", block=block)) == first
    try:
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        assert files_of(recorded(scene(), tmp_path / "all threads")) == first
    finally:
        numba.set_num_threads(1)


def test_a_seed_makes_the_noise_and_not_the_ground(tmp_path):
    runs = [open_run(recorded(scene(seed=seed), tmp_path / str(seed))) for seed in (1, 2)]
    for same in ("truth/ground", "truth/body", "truth/scanner"):
        one, two = (run[same].to_dataset().load() for run in runs)
        assert one.equals(two)
    ranges, errors = (
        [run[name].values for run in runs] for name in ("scans/range", "truth/returns/range_error")
    )
    exact = [a - b for a, b in zip(ranges, errors, strict=True)]
    both = np.isfinite(exact[0]) & np.isfinite(exact[1])  # 0.05 % of each are lost
    assert both.mean() > 0.99
    npt.assert_allclose(exact[0][both], exact[1][both], rtol=0, atol=1.01e-6)  # [m] kept in 1 um
    for name in (
        "truth/returns/range_error",
        "scans/intensity",
        "truth/navigation/error_up",
        "truth/accelerometers/bias",
    ):
        one, two = (run[name].values.ravel().astype(float) for run in runs)
        kept = np.isfinite(one) & np.isfinite(two)
        assert not np.array_equal(one[kept], two[kept])
    one, two = (error.ravel() for error in errors)
    kept = np.isfinite(one) & np.isfinite(two)
    together = np.corrcoef(one[kept], two[kept])[0, 1]
    npt.assert_allclose(together, 0.0, rtol=0, atol=4 / np.sqrt(kept.sum()))


def test_passes_of_a_scene_have_noise_of_their_own(tmp_path):
    twice = tuple(ScenePass(name=name, start=3.0, length=2.0, speed=FAST) for name in "ab")
    one, two = (open_run(path) for path in record_scene(scene(passes=twice), tmp_path))
    assert one["truth/body"].to_dataset().equals(two["truth/body"].to_dataset())
    error, other = (run["truth/returns/range_error"].values for run in (one, two))
    assert not np.array_equal(np.nan_to_num(error), np.nan_to_num(other))
    # the same sensors: their constant errors stay
    name = "truth/accelerometers/scale_error"
    npt.assert_array_equal(one[name].values, two[name].values)


def test_a_run_says_how_it_was_made(tmp_path):
    import json

    run = open_run(recorded(scene(seed=5), tmp_path / "run", number=1))
    (step,) = json.loads(run.attrs["provenance"])
    assert step["step"] == "simulate"
    assert step["parameters"]["scene"]["seed"] == 5
    assert (step["parameters"]["pass"], step["parameters"]["pass_number"]) == ("only", 1)


def test_the_true_ground_of_a_long_path_has_wider_spacing(tmp_path, monkeypatch):
    from trueterrain.simulate.scene import _record

    fine = open_run(recorded(scene(), tmp_path / "fine"))["truth/ground"].to_dataset().load()
    monkeypatch.setattr(_record, "_MAX_TRUTH_NODES", 20_000)
    for block in (0.05, 5.0):
        found = open_run(recorded(scene(), tmp_path / f"{block}", block=block))["truth/ground"]
        coarse = found.to_dataset().load()
        # 3.3 m by 5 m at 20 mm are 41,666 nodes: a third of the rows will do
        npt.assert_allclose(np.diff(coarse["u"]), 0.06, rtol=0, atol=1e-12)
        shared = coarse.sel(u=coarse["u"][(coarse["u"] >= 0) & (coarse["u"] <= 4.6)])
        there = fine.sel(u=shared["u"], method="nearest")
        for name in ("easting", "northing"):
            npt.assert_allclose(shared[name], there[name], rtol=0, atol=1e-12)


def test_a_standing_vehicle_shows_the_ground_around_its_laser(tmp_path):
    standing = Standing(duration=0.3, east=2.0, north=1.0, yaw=np.pi / 2)
    still = scene(passes=(ScenePass(name="still", standing=standing),))
    ground = open_run(recorded(still, tmp_path / "still"))["truth/ground"].to_dataset()
    # 2.25 m behind the origin of a body that looks north
    for name, middle, half in (("easting", 2.0, 0.0), ("northing", -1.25, 1.0)):
        values = ground[name].values
        npt.assert_allclose([values.min(), values.max()], [middle - half, middle + half], atol=1e-9)


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_an_interrupted_pass_leaves_no_files(tmp_path, error):
    seen = []

    def stop(name, done, total):
        seen.append((name, done, total))
        if len(seen) == 2:
            raise error

    with pytest.raises(error):
        record_scene(scene(), tmp_path, progress=stop)
    assert [name for name, _, _ in seen] == ["only", "only"]
    assert seen[0][1] < seen[1][1] <= seen[1][2] == pytest.approx(3.3 / 7.0)
    assert list(tmp_path.iterdir()) == []


def refuse(*_):
    pytest.fail("it was driven")


def test_an_existing_run_is_refused_before_any_pass_is_driven(tmp_path):
    passes = tuple(ScenePass(name=name, start=3.0, length=1.5, speed=FAST) for name in "ab")
    there = tmp_path / "curve-b.zarr"
    there.mkdir()
    (there / "zarr.json").write_text('{"attributes": {"kind": "trueterrain/run"}}')
    with pytest.raises(OutputError, match=r"curve-b\.zarr: exists already"):
        record_scene(scene(passes=passes), tmp_path, progress=refuse)
    assert list(tmp_path.iterdir()) == [there]
    record_scene(scene(passes=passes), tmp_path, force=True)
    assert open_run(there).attrs["name"] == "curve-b"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_missing_folder_is_refused_before_any_pass_is_driven(tmp_path):
    with pytest.raises(OutputError, match=r"folder .*missing does not exist"):
        record_scene(scene(), tmp_path / "missing", progress=refuse)


def test_an_impossible_pass_is_refused_before_any_pass_is_driven(tmp_path):
    passes = (
        ScenePass(name="fine", start=3.0, length=1.5, speed=FAST),
        ScenePass(name="long", start=3.0, length=500.0, speed=FAST),
    )
    with pytest.raises(FormatError, match=r"pass long: length must be at most 16\.2 m"):
        record_scene(scene(passes=passes), tmp_path, progress=refuse)
    assert list(tmp_path.iterdir()) == []


def test_ground_that_ends_is_named_with_wheel_and_place(tmp_path):
    """A measured lane of 3 m: the left wheels leave it."""
    lane = sample_road(Plane(), length=5.0, width=3.0, spacing_u=0.1, spacing_v=0.1)
    opencrg.write(lane, tmp_path / "lane.crg")
    beside = replace(
        scene(),
        course={"kind": "straight", "length": 20.0},
        ground=({"kind": "crg", "file": "lane.crg"},),
        passes=(ScenePass(name="only", start=3.0, length=3.0, lane=1.0, speed=FAST),),
    )
    message = (
        r"easting -?\d+\.\d+ m, northing 1\.\d+ m: there is no ground under the wheel \w+-left"
    )
    with pytest.raises(CoverageError, match=message):
        record_scene(beside, tmp_path, path=tmp_path / "scene.toml")
    assert [file.name for file in tmp_path.iterdir()] == ["lane.crg"]
