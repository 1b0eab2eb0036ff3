"""Scenes: recorded runs of the virtual profiler over known ground, with the truth."""

from trueterrain.simulate.scene._parts import RoadShape, ScenePass, Standing, TruthSettings, Vehicle
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
    "RoadShape",
    "Scene",
    "ScenePass",
    "Stage",
    "Standing",
    "TruthSettings",
    "Vehicle",
    "read_scene",
    "record_pass",
    "record_scene",
    "scene_names",
    "scene_template",
    "set_stage",
]
