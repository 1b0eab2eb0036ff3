"""Fixtures and settings shared by all tests."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from trueterrain.simulate.scene import Scene

mpl.use("Agg")

# No deadline: the first call of a kernel includes its compilation. Derandomized: each run
# tests the same examples.
settings.register_profile("quick", deadline=None, derandomize=True, max_examples=20)
settings.register_profile("thorough", settings.get_profile("quick"), max_examples=100)
settings.load_profile("quick")


def _data_folder() -> Path:
    named = os.environ.get("TRUETERRAIN_DATA")
    return Path(named) if named else Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of the measured data. If it is absent, tests fail in CI and are skipped elsewhere."""
    folder = _data_folder()
    if not folder.is_dir():
        reason = f"no measured data in {folder}; set TRUETERRAIN_DATA to their folder"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return folder


@pytest.fixture(scope="session")
def measured_drift(data: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and heights [m] of a drive over a road less those of an earlier drive.

    Each pose of the second drive is compared with the nearest one of the first, shifted along its
    velocity to the foot of the perpendicular. Both move, and are within 1 m of each other.
    """
    from scipy.spatial import cKDTree

    columns = ("GPSTime", "easting", "northing", "altitude", "vel_east", "vel_north", "vel_up")
    files = ("boreas-2021-08-05-13-34.lidar_poses.csv", "boreas-2021-09-02-11-42.lidar_poses.csv")
    tables = [
        pd.read_csv(data / "scanning" / "trajectories" / name)[list(columns)].to_numpy(float)
        for name in files
    ]
    (first_time, first_at, first_v), (time, at, v) = (
        (table[:, 0] * 1e-6, table[:, 1:4], table[:, 4:7]) for table in tables
    )
    _, nearest = cKDTree(first_at[:, :2]).query(at[:, :2])
    away, velocity = at - first_at[nearest], first_v[nearest]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = (speed > 1.0) & (np.hypot(v[:, 0], v[:, 1]) > 1.0)  # [m/s]
    scale = np.where(moving, speed, 1.0)
    longitudinal = (away[:, 0] * velocity[:, 0] + away[:, 1] * velocity[:, 1]) / scale
    lateral = (away[:, 1] * velocity[:, 0] - away[:, 0] * velocity[:, 1]) / scale
    # a longitudinal distance beyond one spacing means that the first drive has a gap or ends there
    spacing = np.gradient(first_time)[nearest] * speed
    used = moving & (np.abs(lateral) < 1.0) & (np.abs(longitudinal) < spacing)
    height = away[:, 2] - longitudinal * velocity[:, 2] / scale
    return time[used] - time[used][0], height[used]


@pytest.fixture(scope="session")
def recorded_scene(
    pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., list[Path]]:
    """Record a scene once per test run, in one folder for all workers of pytest-xdist.

    Tests that modify a run copy it first.
    """
    folder = tmp_path_factory.getbasetemp()
    if hasattr(pytestconfig, "workerinput"):
        folder = folder.parent

    def record(scene: "Scene", *, path: Path | None = None) -> list[Path]:
        """Runs of the passes of a scene; `path` is the file of the scene."""
        from trueterrain.simulate.scene import record_scene

        kept = folder / "scenes" / sha256(f"{scene!r} {path}".encode()).hexdigest()[:16]
        kept.mkdir(parents=True, exist_ok=True)
        runs = [kept / f"{scene.name}-{drive.name}.zarr" for drive in scene.passes]
        with _lock_folder(kept):
            if not all(run.exists() for run in runs):
                record_scene(scene, kept, path=path)
        return runs

    return record


@contextmanager
def _lock_folder(folder: Path) -> Iterator[None]:
    """Let one worker at a time work in a folder; fails if another one holds it for 10 minutes."""
    lock = folder / "lock"
    deadline = time.monotonic() + 600.0
    while True:
        try:
            lock.mkdir()
            break
        except FileExistsError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.05)
    try:
        yield
    finally:
        lock.rmdir()
