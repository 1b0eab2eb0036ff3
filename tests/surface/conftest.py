"""Runs without noise, and their exact motion as a trajectory."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting, open_run, scan_blocks
from trueterrain.georeference import ScanGeometry
from trueterrain.motion import Trajectory
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import RoadShape, Scene, ScenePass, record_scene, set_stage
from trueterrain.verify import exact_trajectory

NOISE_FREE = Scanner(
    range_noise=0.0, intensity_noise=0.0, floor=0.0, saturation_bias=0.0, dropouts=0.0, spot_rays=1
)
SMOOTH = ({"kind": "road", "road_class": "A", "seed": 11, "waves": 300},)


@dataclass(frozen=True)
class Driven:
    """A recorded pass and what is true of it."""

    path: Path
    trajectory: Trajectory
    mounting: Mounting
    ground: Raster
    geometry: ScanGeometry
    time: np.ndarray
    range: np.ndarray


@pytest.fixture(scope="session")
def drive(tmp_path_factory) -> Callable[..., Driven]:
    """Drive over a smooth road, 8 m/s on a van, and record it, by default without noise."""

    def driven(
        course: dict[str, Any],
        road: RoadShape = RoadShape(),
        *,
        start: float = 12.0,
        length: float = 4.0,
        speed: float = 8.0,
        **changes: Any,
    ) -> Driven:
        how = {"kind": "constant", "speed": speed}
        scene = Scene(
            name="drive",
            course=course,
            road=road,
            raster=0.01,
            passes=(ScenePass(name="pass", start=start, length=length, speed=how),),
            **{"ground": SMOOTH, "scanner": NOISE_FREE, "navigation": Navigation(), **changes},
        )
        (path,) = record_scene(scene, tmp_path_factory.mktemp("run"))
        blocks = list(scan_blocks(path))
        trajectory, mounting = exact_trajectory(path), open_run(path).mounting
        return Driven(
            path=path,
            trajectory=trajectory,
            mounting=mounting,
            ground=Raster(set_stage(scene).ground, spacing=scene.raster),
            geometry=ScanGeometry(trajectory, mounting, blocks[0].angle, blocks[0].delay),
            time=np.concatenate([block.time.values for block in blocks]),
            range=np.concatenate([block.range.values for block in blocks]),
        )

    return driven


@pytest.fixture(scope="session")
def with_errors() -> Callable[..., Trajectory]:
    """A trajectory with slow errors drawn from the covariance that it states."""

    def disturbed(
        trajectory: Trajectory, rng: np.random.Generator, sd: np.ndarray, period: float = 0.03
    ) -> Trajectory:
        # a sum of waves with random phases: stationary, and nearly normal
        waves = 24
        rate = 2 * np.pi / period * rng.uniform(0.3, 1.0, (waves, 6))
        phase = rng.uniform(0, 2 * np.pi, (waves, 6))
        t = trajectory.time[:, None, None]
        error = sd * np.sqrt(2 / waves) * np.sin(rate * t + phase).sum(axis=1)
        slope = sd * np.sqrt(2 / waves) * (rate * np.cos(rate * t + phase)).sum(axis=1)
        turned = Rotation.from_rotvec(error[:, 3:]) * Rotation.from_quat(trajectory.quaternion)
        return replace(
            trajectory,
            position=trajectory.position + error[:, :3],
            velocity=trajectory.velocity + slope[:, :3],
            quaternion=turned.as_quat(),
            angular_velocity=trajectory.angular_velocity + turned.inv().apply(slope[:, 3:]),
            covariance=np.tile(np.diag(sd**2), (trajectory.time.size, 1, 1)),
        )

    return disturbed
