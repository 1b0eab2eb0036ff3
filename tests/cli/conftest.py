"""Fixtures of the tests of the command line."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

import trueterrain
from trueterrain.cli import main
from trueterrain.core.schemas import make_profile

STANDING = """
name = "stand"
scanner = {beams = 940, rate = 200.0}
ground = [{kind = "plate", east = 0.1, north = -2.25}]
passes = [{name = "run", standing = {duration = 1.0, yaw = 1.5707963267948966}}]
truth = {returns = false}
"""
DRIVING = """
name = "drive"
raster = 0.002
scanner = {beams = 61, rate = 1000.0, swath = 0.3}
course = {kind = "straight", length = 10.0}
ground = [{kind = "plate", east = 4.0, width = 1.0}]
vehicle = {model = "rigid", waves = [{component = "up", amplitude = 0.01, frequency = 3.0}]}
passes = [{name = "run", speed = {kind = "constant", speed = 5.0}}]
truth = {returns = false}
"""


class Finished(NamedTuple):
    """What a command left behind."""

    code: int
    out: str
    err: str


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Finished]:
    """Run the command line in this process; returns exit code, stdout and stderr."""

    def call(*arguments: object) -> Finished:
        capsys.readouterr()
        try:
            main([str(argument) for argument in arguments])
            code = 0
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        return Finished(code, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def machined(tmp_path_factory):
    """Machined profile of the plate of the scenes, every half millimetre."""
    path = tmp_path_factory.mktemp("plate") / "plate.csv"
    from trueterrain.simulate.scene import CalibrationPlate

    s = np.arange(2401) / 2000
    trueterrain.write(make_profile(s, CalibrationPlate().height(s - 0.6, 0.0)), path)
    return path


@pytest.fixture(scope="session")
def recorded(tmp_path_factory, recorded_scene):
    """Folder with a standing and a driven run."""
    from trueterrain.simulate.scene import read_scene

    folder = tmp_path_factory.mktemp("runs")
    for text in (STANDING, DRIVING):
        (folder / "scene.toml").write_text(text)
        (run,) = recorded_scene(read_scene(folder / "scene.toml")[0])
        (folder / run.name).symlink_to(run)
    return folder


@pytest.fixture(scope="session")
def two_lanes(recorded_scene):
    """Runs of two lanes of 13 m that overlap, with few beams."""
    from trueterrain.simulate.scene import read_scene

    scene, _ = read_scene("belgian-two-lanes")
    return recorded_scene(
        replace(
            scene,
            course={"kind": "straight", "length": 13.0},
            raster=0.01,
            ground=({"kind": "road", "road_class": "B", "seed": 3, "waves": 200},),
            scanner=replace(scene.scanner, beams=200),
        )
    )
