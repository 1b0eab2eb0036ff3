"""Scenes: the virtual profiler on known ground, recorded as runs whose truth is known."""

from trueterrain.simulate.scene._parts import Drive, Road, Standing, Truth, Vehicle
from trueterrain.simulate.scene._plate import CalibrationPlate
from trueterrain.simulate.scene._record import record_pass, record_scene
from trueterrain.simulate.scene._scene import (
    Scene,
    Stage,
    read_scene,
    scene_names,
    scene_template,
    set_stage,
)

__all__ = [
    "CalibrationPlate",
    "Drive",
    "Road",
    "Scene",
    "Stage",
    "Standing",
    "Truth",
    "Vehicle",
    "read_scene",
    "record_pass",
    "record_scene",
    "scene_names",
    "scene_template",
    "set_stage",
]
