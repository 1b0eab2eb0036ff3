"""Known clock offsets are estimated; poor excitation is refused."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import Mounting
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.motion.clocks import (
    accelerometer_clock_from_navigation,
    scanner_clock_from_bounce,
)
from trueterrain.simulate.scene import read_scene

from ._truth import Errors, rms
from .conftest import knots_of, run_of

BOUNCE = 5e-5  # [s] required
BOUND = 4.0  # standard deviations


def test_the_scanner_clock_from_a_bounce(bounce_run):
    run, scene = bounce_run
    found = scanner_clock_from_bounce(
        run,
        accelerometer_clock=scene.accelerometers.clock_offset,
        accelerometer_delay=scene.accelerometers.group_delay,
    )
    assert abs(found.clock - scene.mounting.scanner_clock) < BOUNCE
    assert abs(found.clock - scene.mounting.scanner_clock) < BOUND * found.sd
    assert found.sd < 3e-5
    assert_allclose(found.excitation[0], 0.0145, rtol=0, atol=0.002)  # [m] 20 mm / sqrt(2)


def test_the_scanner_clock_is_relative_to_that_of_the_accelerometers(bounce_run):
    run, scene = bounce_run
    found = scanner_clock_from_bounce(run)
    late = scene.accelerometers.clock_offset - scene.accelerometers.group_delay
    assert abs(found.clock - (scene.mounting.scanner_clock - late)) < BOUNCE


def test_a_small_bounce_is_refused(bounce_run):
    run, _ = bounce_run
    groups = {node.path: node.to_dataset() for node in run.subtree}
    force = groups["/accelerometers"]["acceleration"]
    groups["/accelerometers"]["acceleration"] = force.mean() + 0.0 * force
    scans = groups["/scans"].load()
    scans["range"] = 0 * scans["range"] + scans["range"].mean("scan")
    still = xr.DataTree.from_dict({path: data for path, data in groups.items() if path != "/scans"})
    still["scans"] = scans
    with pytest.raises(CoverageError, match="motion is too small to determine the scanner clock"):
        scanner_clock_from_bounce(still)


def test_a_moving_run_is_no_bounce(excited):
    scene, knots = excited
    with pytest.raises(CoverageError, match="Take a bounce: parked on a flat floor"):
        scanner_clock_from_bounce(run_of(knots, scene))


@pytest.fixture(scope="module")
def bounce():
    scene, path = read_scene("bounce")
    return scene, knots_of(scene, path)


def test_the_accelerometer_clock_from_navigation(bounce):
    """Five draws of all noise: errors agree with their standard deviations."""
    scene, knots = bounce
    delay = scene.accelerometers.group_delay
    ratios = []
    for seed in range(5):
        run = run_of(knots, scene, seed=seed)
        found = accelerometer_clock_from_navigation(run, accelerometer_delay=delay)
        ratios.append((found.clock - scene.accelerometers.clock_offset) / found.sd)
        assert found.sd < 2e-4
        assert found.rate == found.rate_sd == 0.0
    assert 0.3 < rms(ratios) < 2.0  # 5 values: sd 0.3


def test_the_scale_of_the_accelerometers_from_navigation(bounce):
    """All sensors read 2 % too much: the motion is 1 / 1.02 of their readings."""
    scene, knots = bounce
    sensors = replace(scene.accelerometers, scale=(0.02,) * 3, scale_sd=0.0)
    run = run_of(knots, replace(scene, accelerometers=sensors))
    found = accelerometer_clock_from_navigation(run, accelerometer_delay=sensors.group_delay)
    assert abs(found.scale[0] - 1 / 1.02) < BOUND * found.scale_sd[0]
    assert found.scale_sd[0] < 0.02  # drift of 5 mm in 1 s against a heave of 20 mm for 10 s


@pytest.mark.slow
def test_the_rate_of_a_clock(bounce):
    scene, knots = bounce
    sensors = replace(scene.accelerometers, clock_rate=4e-4)
    scene = replace(scene, accelerometers=sensors)
    run = run_of(knots, scene)
    found = accelerometer_clock_from_navigation(
        run, accelerometer_delay=sensors.group_delay, with_rate=True
    )
    assert abs(found.rate - 4e-4) < BOUND * found.rate_sd
    assert found.rate_sd < 5e-5
    assert abs(found.clock - sensors.clock_offset) < BOUND * found.sd
    mounting = dict(run.attrs["mounting"]) | {"accelerometer_clock": found.clock}
    run = run.copy()
    run.attrs = {**run.attrs, "mounting": mounting}
    settings = FusionSettings(
        accelerometer_delay=sensors.group_delay, accelerometer_clock_rate=found.rate
    )
    right, wrong = fuse_motion(run, settings=settings), fuse_motion(run)
    error = [rms(Errors(run, motion.trajectory).rotation[:, 1]) for motion in (right, wrong)]
    assert error[0] < error[1]


def test_poor_excitation_is_refused(bounce):
    scene, _ = bounce
    still = replace(scene.passes[0].standing, waves=())
    scene = replace(scene, passes=(replace(scene.passes[0], standing=still),))
    run = run_of(knots_of(scene), scene)
    with pytest.raises(CoverageError, match="too small to determine the accelerometer clock"):
        accelerometer_clock_from_navigation(run)


def test_a_run_that_is_too_short(excited):
    scene, knots = excited
    with pytest.raises(CoverageError, match=r"at least 5.0 s are needed"):
        accelerometer_clock_from_navigation(run_of(knots, scene))


def test_without_accelerometers(bounce):
    scene, knots = bounce
    run = run_of(knots, scene)
    bare = xr.DataTree.from_dict(
        {node.path: node.to_dataset() for node in run.subtree if node.path != "/accelerometers"}
    )
    with pytest.raises(CoverageError, match="has no accelerometers"):
        accelerometer_clock_from_navigation(bare)


def test_gaps_are_refused(bounce):
    scene, knots = bounce
    run = run_of(knots, scene)
    data = run["navigation"].to_dataset()
    time = data["time"].values
    run["navigation"] = data.isel(epoch=np.flatnonzero((time < 5) | (time > 6)))
    with pytest.raises(CoverageError, match="has gaps"):
        accelerometer_clock_from_navigation(run)


def test_stated_clocks_are_included(bounce):
    scene, knots = bounce
    declared = Mounting(accelerometer_clock=scene.accelerometers.clock_offset)
    delay = scene.accelerometers.group_delay
    stated = run_of(knots, replace(scene, declared=declared))
    first = accelerometer_clock_from_navigation(stated, accelerometer_delay=delay)
    second = accelerometer_clock_from_navigation(run_of(knots, scene), accelerometer_delay=delay)
    assert_allclose(first.clock, second.clock, rtol=0, atol=5e-6)  # [s] linear in 0.7 ms
