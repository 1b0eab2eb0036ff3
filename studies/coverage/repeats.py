"""Repeats of accuracy tests with the virtual profiler, with equal conditions and other seeds."""

import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from trueterrain.core.schemas import make_profile
from trueterrain.formats.run import open_run
from trueterrain.georeference import Screening
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.simulate.drift import GaussMarkovDrift, start_drift
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scene import (
    CalibrationPlate,
    ScenePass,
    Stage,
    read_scene,
    record_pass,
    set_stage,
)
from trueterrain.verify.drift import drift_test
from trueterrain.verify.dynamic import DynamicSettings, dynamic_test
from trueterrain.verify.results import ResultRow
from trueterrain.verify.static import StaticSettings, static_test

SCREENING = Screening(saturation=19999.0)
STANDING = 0.3  # [s] of the static test: 300 scans
BESIDE = 0.05  # [m] range of its place: several distances of beams
ALONG = 0.3  # [m] range of the start of the run: other phases of the scans and of the motion
LENGTH = 17.0  # [m] driven: two events and the plate
BEAMS, SWATH = 61, 0.3  # [m] of the moving scanner: only a strip over the plate is needed
ROAD, SPEED, RUNS = 2000.0, 10.0, 4  # [m], [m/s]


def static(seed: int) -> list[ResultRow]:
    """Rows of the static test, with and without screening."""
    stage, ground = _stage("static-plate")
    drive = stage.scene.passes[0]
    assert drive.standing is not None
    north = _random(seed).uniform(0, BESIDE)
    drive = replace(drive, standing=replace(drive.standing, duration=STANDING, north=north))
    with tempfile.TemporaryDirectory() as folder:
        run = _recorded(stage, ground, drive, seed, Path(folder))
        found = static_test(run, _machined(), StaticSettings(screening=SCREENING))
    return [one.row for one in found]


def dynamic(seed: int) -> list[ResultRow]:
    """Rows of the dynamic test among events, by two methods of fusion."""
    stage, ground = _stage("dynamic-plate-excited")
    start = _random(seed).uniform(0, ALONG)
    drive = replace(stage.scene.passes[0], start=start, length=LENGTH)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        run = _recorded(stage, ground, drive, seed, Path(folder))
        for method in ("thesis", "rts"):
            motion = fuse_motion(open_run(run), settings=FusionSettings(method=method)).trajectory
            found = dynamic_test(
                run,
                _machined(),
                motion,
                DynamicSettings(screening=SCREENING),
                name=f"dynamic, {method}",
            )
            rows.append(found.row)
    return rows


def drift(seed: int) -> list[ResultRow]:
    """Row of the drift test of four runs."""
    s = np.arange(ROAD + 1.0)
    model = GaussMarkovDrift(between_passes=0.0)
    runs = [
        start_drift(model, seed=seed, pass_number=number, rate=SPEED).next(s / SPEED)
        for number in range(RUNS)
    ]
    return [drift_test([make_profile(s, run) for run in runs], make_profile(s, 0 * s)).row]


@lru_cache
def _stage(name: str) -> tuple[Stage, Raster]:
    """Scene, and its ground as a raster common to all repeats."""
    scene, _ = read_scene(name)
    raster = scene.raster
    if name != "static-plate":
        scene = replace(scene, scanner=replace(scene.scanner, beams=BEAMS, swath=SWATH))
    truth = replace(scene.truth, returns=False, spacing=0.5)
    stage = set_stage(replace(scene, raster=0.0, truth=truth))
    return stage, Raster(stage.ground, spacing=raster)


def _recorded(stage: Stage, ground: Raster, drive: ScenePass, seed: int, folder: Path) -> Path:
    stage = replace(stage, scene=replace(stage.scene, seed=seed))
    motion = stage.motion(drive)
    record_pass(replace(stage, ground=ground), drive, motion, folder / "run.zarr")
    return folder / "run.zarr"


@lru_cache
def _machined():  # type: ignore[no-untyped-def]  # a dataset, of a library without types
    s = np.arange(2401) / 2000
    return make_profile(s, CalibrationPlate().height(s - 0.6, 0.0))


def _random(seed: int) -> np.random.Generator:
    return np.random.default_rng([1964, seed])
