"""Simulated runs for the tests of motion, mostly without scans."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from trueterrain.formats.run import Mounting, open_run
from trueterrain.simulate.accelerometers import AccelerometerStream
from trueterrain.simulate.navigation import NavigationStream
from trueterrain.simulate.pose import COMPONENTS
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene, set_stage

LEAD = 0.1  # [s] of navigation and accelerometers before and after the drive


def run_of(knots, scene, *, seed=None, number=0):
    """A run in memory: navigation, accelerometers and the true knots of a pass."""
    seed = scene.seed if seed is None else seed
    begin, end = knots.time[0], knots.time[-1] - 1e-9
    seeded = {"seed": seed, "pass_number": number, "begin": begin}
    epochs = NavigationStream(scene.navigation, **seeded).record(knots, begin, end).recorded
    stream = AccelerometerStream(scene.accelerometers, **seeded)
    samples = stream.record(knots, begin, end).recorded
    mounting = replace(scene.mounting, accelerometer_clock=scene.accelerometers.clock_offset)
    accelerometers = xr.Dataset(
        {
            "time": ("sample", samples["time"]),
            "acceleration": (("sample", "sensor"), samples["acceleration"]),
            "position": (("sensor", "axis"), np.array(scene.accelerometers.positions)),
        }
    )
    body = {"time": knots.time}
    for column, name in enumerate(COMPONENTS):
        body[name] = knots.pose[:, column]
    return xr.DataTree.from_dict(
        {
            "navigation": xr.Dataset({k: ("epoch", np.array(v)) for k, v in epochs.items()}),
            "accelerometers": accelerometers,
            "truth/body": xr.Dataset({k: ("knot", v) for k, v in body.items()}),
            "/": xr.Dataset(
                attrs={
                    "mounting": (scene.declared or mounting).to_attrs(),
                    "origin": list(scene.origin),
                }
            ),
        }
    )


def knots_of(scene, path=None):
    """Exact motion of the first pass of a scene, with lead."""
    motion = set_stage(scene, path=path).motion(scene.passes[0])
    end = motion.duration + LEAD
    ((_, _, knots),) = motion.blocks(-LEAD, end, end + LEAD, margin=0.0)
    return knots


@pytest.fixture(scope="session")
def excited():
    """The scene of the plate among excitation events, and its exact motion."""
    scene, path = read_scene("dynamic-plate-excited")
    return scene, knots_of(scene, path)


@pytest.fixture(scope="session")
def bounce_run(recorded_scene):
    """A recording of the scene `bounce` with a coarse scanner, and the scene."""
    scene, path = read_scene("bounce")
    scene = replace(
        scene,
        scanner=Scanner(beams=41, spot_rays=1),
        truth=TruthSettings(returns=False, spacing=0.1),
        raster=0.05,
    )
    (store,) = recorded_scene(scene, path=path)
    return open_run(store), scene


__all__ = ["Mounting", "knots_of", "run_of"]
