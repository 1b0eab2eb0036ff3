"""Faults of the virtual profiler, injected by its scenes, are found by the tests of accuracy."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

from trueterrain.core.schemas import make_profile
from trueterrain.formats.run import Mounting, open_run
from trueterrain.georeference import Screening
from trueterrain.motion import fuse_motion
from trueterrain.simulate.accelerometers import Accelerometers, sensor_triangle
from trueterrain.simulate.scanner import Reflectivity, Scanner
from trueterrain.simulate.scene import (
    CalibrationPlate,
    Scene,
    ScenePass,
    Standing,
    read_scene,
)
from trueterrain.verify.dynamic import DynamicSettings, dynamic_test
from trueterrain.verify.static import StaticSettings, static_test

pytestmark = pytest.mark.slow

LASER = (-2.25, 0.0, 1.2)  # [m] in the body
MIDDLE, SPEED = 9.5, 5.4  # [m] of the plate, [m/s]
BOARDS = ((5.5, 0.75), (5.5, -0.75), (8.2, 0.75), (8.2, -0.75), (10.6, 0.75), (13.0, -0.75))
SURE = 4.0  # standard deviations
FRACTION = 0.15  # of a fault that fusion may absorb, besides 4 standard deviations
SATURATED = 0.0007, 0.0009  # [m] at 27,000 to 29,000 counts, 2 mm at 40,000
CLOCK, SCALE, ROLL, BESIDE = 0.001, 0.03, math.radians(0.1), 0.005


def _machined():
    s = np.arange(2401) / 2000
    return make_profile(s, CalibrationPlate().height(s - 0.6, 0.0))


def _dynamic(recorded_scene, **parts):
    """Boards under the wheels, on both sides of a strip of plane floor with the plate."""
    plate = {"kind": "plate", "east": MIDDLE, "width": 0.9}
    boards = [
        {
            "kind": "plate",
            "east": x,
            "north": y,
            "width": 0.3,
            "thickness": 0.0,
            "length": 1.3,
            "pitch": 0.488,
            "cleat": 0.17,
            "rise": 0.05,
        }
        for x, y in BOARDS
    ]
    scene = Scene(
        name="dynamic",
        raster=0.005,
        course={"kind": "straight", "length": 17.0},
        ground=(plate, *boards),
        vehicle=read_scene("dynamic-plate-excited")[0].vehicle,
        scanner=Scanner(beams=141, swath=0.6),
        mounting=Mounting(scanner_position=LASER),
        passes=(ScenePass(name="run", speed={"kind": "constant", "speed": SPEED}),),
        **parts,
    )
    run = open_run(recorded_scene(scene)[0]).load()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = fuse_motion(run).trajectory
    settings = DynamicSettings(assumed=MIDDLE - 0.06, search=0.2, floor=4.0, width=0.4)
    return dynamic_test(run, _machined(), path, settings)


@pytest.fixture(scope="module")
def late(recorded_scene):
    """A scanner whose stated clock is 1 ms too large."""
    declared = Mounting(scanner_position=LASER, scanner_clock=CLOCK)
    return _dynamic(recorded_scene, declared=declared)


@pytest.fixture(scope="module")
def strong(recorded_scene):
    """Accelerometers that read 3 % too much."""
    sensors = Accelerometers(positions=sensor_triangle(LASER, 0.5), scale=(SCALE,) * 3)
    return _dynamic(recorded_scene, accelerometers=sensors)


@pytest.fixture(scope="module")
def standing(recorded_scene):
    """A scanner with a wrong stated roll, a plate beside its place, a white cleat."""
    scene = Scene(
        name="static",
        raster=0.002,
        ground=({"kind": "plate", "east": 0.342 - BESIDE, "north": LASER[0]},),
        reflectivity=Reflectivity(period=10.0, width=0.076, stripe=0.9),
        mounting=Mounting(scanner_position=LASER),
        passes=(ScenePass(name="run", standing=Standing(duration=0.3, yaw=0.5 * math.pi)),),
    )
    scene = replace(
        scene, declared=Mounting(scanner_position=LASER, scanner_rotation=(ROLL, 0.0, 0.0))
    )
    run = recorded_scene(scene)[0]
    settings = StaticSettings(
        assumed=-0.942, search=0.05, level=0.0, screening=Screening(saturation=19999.0)
    )
    return static_test(run, _machined(), settings)[0]


def _named(result):
    return {one.name: one for one in result.findings}


def _found(result):
    return {one.name for one in result.findings if one.detected}


def test_the_clock_of_the_scanner(late):
    finding = _named(late)["clock of the scanner"]
    assert abs(finding.value + CLOCK) < SURE * finding.sd + FRACTION * CLOCK
    assert _found(late) == {finding.name}
    assert any(one.moves_with for one in late.modes)


def test_the_scale_of_the_accelerometers(strong):
    finding = _named(strong)["scale of the accelerometers"]
    assert abs(finding.value - SCALE) < SURE * finding.sd + FRACTION * SCALE
    assert _found(strong) == {finding.name}


def test_faults_unobservable_while_driving_are_reported(late):
    for name in ("boresight roll", "lever arm up", "place of the plate"):
        assert _named(late)[name].detected is None


def test_boresight_roll_place_and_saturation_at_once(standing):
    found = _named(standing)
    roll, place, bright = (
        found[name] for name in ("boresight roll", "place of the plate", "error of bright ground")
    )
    assert abs(roll.value + ROLL) < SURE * roll.sd
    # a scanner that is taken to lean sees the plate beside its place: 0.1 degrees at 2 m
    np.testing.assert_allclose(place.value, BESIDE + 2.0 * ROLL, rtol=0, atol=1e-4)  # [m]
    assert SATURATED[0] < bright.value < SATURATED[1]
    assert _found(standing) == {
        roll.name,
        place.name,
        bright.name,
        "flagged intensity",
    }
