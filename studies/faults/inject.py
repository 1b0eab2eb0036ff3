"""Record the scenes with a fault, and carry out both tests."""

import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from scenes import (
    BEGINS,
    FLOOR,
    LEAD,
    MIDDLE,
    PLATE,
    SPEED,
    STRIP,
    Fault,
    dynamic_scene,
    static_scene,
)
from trueterrain import make_profile
from trueterrain.formats.run import open_run
from trueterrain.georeference import Screening
from trueterrain.motion import fuse_motion
from trueterrain.simulate.scene import CalibrationPlate, Scene, record_scene
from trueterrain.verify.dynamic import DynamicResult, DynamicSettings, dynamic_test
from trueterrain.verify.static import StaticResult, StaticSettings, static_test


@dataclass(frozen=True, kw_only=True)
class Tested:
    """Results of both tests for a fault."""

    fault: Fault
    "Injected fault."

    static: StaticResult
    "Static test with all returns."

    dynamic: DynamicResult
    "Dynamic test with the motion by the smoother."


def machined() -> xr.Dataset:
    """Machined profile of the plate."""
    s = np.arange(2401) / 2000
    return make_profile(s, CalibrationPlate().height(s - 0.5 * PLATE, 0.0))


def tested(fault: Fault) -> Tested:
    """Record both runs and test them."""
    return Tested(fault=fault, static=tested_static(fault), dynamic=tested_dynamic(fault))


def tested_static(fault: Fault) -> StaticResult:
    """The static test, with a spirit level on the plate."""
    run = _recorded(static_scene(fault), fault)
    settings = StaticSettings(
        assumed=BEGINS, search=0.05, level=0.0, screening=Screening(saturation=19999.0)
    )
    return static_test(run, machined(), settings)[0]


def tested_dynamic(fault: Fault) -> DynamicResult:
    """The dynamic test, with the whole floor."""
    run = _recorded(dynamic_scene(fault), fault)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the dropped scans are intended
        path = fuse_motion(run).trajectory
    begins = MIDDLE - 0.5 * PLATE + LEAD * SPEED
    settings = DynamicSettings(assumed=begins, search=0.2, floor=FLOOR, width=STRIP)
    return dynamic_test(run, machined(), path, settings)


def _recorded(scene: Scene, fault: Fault) -> xr.DataTree:
    """A run in memory, without the dropped scans."""
    with tempfile.TemporaryDirectory() as folder:
        (target,) = record_scene(scene, Path(folder))
        tree = open_run(target).load()
    if not fault.dropped:
        return tree
    scans = tree["scans"].to_dataset()
    kept = np.ones(scans.sizes["scan"], dtype=bool)
    some = fault.dropped // 4
    centre = kept.size // 2
    kept[centre : centre + fault.dropped - some] = False
    kept[centre // 2 : centre // 2 + some] = False
    tree["scans"] = xr.DataTree(scans.isel(scan=kept))
    return tree
