"""Runs without noise, and their exact motion as a trajectory."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from trueterrain.motion import Trajectory
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import Scene, read_scene
from trueterrain.verify import exact_trajectory

NOISE_FREE = Scanner(
    range_noise=0.0, intensity_noise=0.0, floor=0.0, saturation_bias=0.0, dropouts=0.0, spot_rays=1
)


def short(name: str, **changes: object) -> Scene:
    """A ready scene without noise, with its first pass shortened."""
    scene, _ = read_scene(name)
    how = {"start": 20.0, "length": 1.0}
    passes = (replace(scene.passes[0], **how),)
    return replace(
        scene, passes=passes, **{"scanner": NOISE_FREE, "navigation": Navigation(), **changes}
    )


@pytest.fixture(scope="session")
def record(recorded_scene) -> Callable[[Scene], tuple[Path, Trajectory]]:
    """Record a scene of one pass; the run and its exact motion."""

    def recorded(scene: Scene) -> tuple[Path, Trajectory]:
        (run,) = recorded_scene(scene)
        return run, exact_trajectory(run)

    return recorded


@pytest.fixture(scope="session")
def short_scene() -> Callable[..., Scene]:
    """`short`, for tests."""
    return short
