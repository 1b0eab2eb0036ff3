"""Runs without noise, and their exact motion as a trajectory."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import open_run
from trueterrain.motion import Trajectory
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import Scene, read_scene, record_scene

NOISE_FREE = Scanner(
    range_noise=0.0, intensity_noise=0.0, floor=0.0, saturation_bias=0.0, dropouts=0.0, spot_rays=1
)


def exact(run: Path) -> Trajectory:
    """Trajectory through the knots of the true motion of the body, 0.5 ms apart."""
    body = open_run(run)["truth/body"].to_dataset().load()
    position, velocity = (
        np.stack([body[f"{name}{what}"].values for name in ("east", "north", "up")], axis=1)
        for what in ("", "_rate")
    )
    roll, pitch, yaw = (body[name].values for name in ("roll", "pitch", "yaw"))
    r, p, y = (body[f"{name}_rate"].values for name in ("roll", "pitch", "yaw"))
    turning = [
        r - y * np.sin(pitch),
        p * np.cos(roll) + y * np.sin(roll) * np.cos(pitch),
        -p * np.sin(roll) + y * np.cos(roll) * np.cos(pitch),
    ]
    n = body.sizes["knot"]
    return Trajectory(
        time=body["time"].values, position=position, velocity=velocity,
        quaternion=Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_quat(),
        angular_velocity=np.stack(turning, axis=1), covariance=np.zeros((n, 6, 6)),
        flag=np.zeros(n, np.uint8),
    )  # fmt: skip


def short(name: str, **changes: object) -> Scene:
    """A ready scene without noise, with its first pass shortened."""
    scene, _ = read_scene(name)
    how = {"start": 20.0, "length": 1.0}
    passes = (replace(scene.passes[0], **how),)
    return replace(
        scene, passes=passes, **{"scanner": NOISE_FREE, "navigation": Navigation(), **changes}
    )


@pytest.fixture(scope="session")
def record(tmp_path_factory) -> Callable[[Scene], tuple[Path, Trajectory]]:
    """Record a scene of one pass; the run and its exact motion."""

    def recorded(scene: Scene) -> tuple[Path, Trajectory]:
        (run,) = record_scene(scene, tmp_path_factory.mktemp("run"))
        return run, exact(run)

    return recorded


@pytest.fixture(scope="session")
def short_scene() -> Callable[..., Scene]:
    """`short`, for tests."""
    return short
