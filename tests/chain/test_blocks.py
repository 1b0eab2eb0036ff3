"""A run of more scans than any block holds: the surface is the same, bit for bit."""

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.formats.run import Mounting, RunWriter, open_run
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.surface import (
    GridSettings,
    PassRecord,
    grid_along,
    grid_runs,
    line_from_trajectory,
)

SCANS = 120_000  # 30 s at 4000 Hz: more than the largest block
BLOCKS = (1_000, 7_777, 100_000)  # scans
ANGLE = np.linspace(-0.4, 0.4, 6)  # [rad]
LEVER = (-1.0, 0.1, 1.2)  # [m]


@pytest.fixture(scope="module")
def long_run(tmp_path_factory):
    """A bend driven at 2 m/s by a body that heaves and rolls; ranges with noise and gaps."""
    rng = np.random.default_rng(1)
    path = tmp_path_factory.mktemp("runs") / "long.zarr"
    time = np.arange(-0.1, 30.15, 0.05)
    yaw = 0.04 * time
    pose = {
        "time": time,
        "east": 50 * np.sin(yaw),
        "north": 50 * (1 - np.cos(yaw)),
        "up": 0.8 + 0.01 * np.sin(7 * time),
        "roll": 0.01 * np.sin(5 * time),
        "pitch": 0.01 * np.cos(6 * time),
        "yaw": yaw,
    }
    stamps = np.arange(SCANS) / 4000
    ranges = 2.0 / np.cos(ANGLE) + 0.01 * rng.standard_normal((SCANS, ANGLE.size))
    ranges[rng.random(ranges.shape) < 0.01] = np.nan
    with RunWriter(
        path,
        name="long",
        origin=(11.0, 48.0, 500.0),
        time_reference="run",
        mounting=Mounting(scanner_position=LEVER),
        angle=ANGLE,
        delay=np.linspace(0, 2e-4, ANGLE.size),
    ) as run:
        run.append_navigation(pose)
        run.append_scans(stamps, ranges)
    trajectory = fuse_motion(
        open_run(path), settings=FusionSettings(method="navigation")
    ).trajectory
    return PassRecord(run=path, trajectory=trajectory)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [GridSettings(), GridSettings(statistic="minimum"), GridSettings(statistic="median")],
    ids=lambda options: options.statistic,
)
def test_surfaces_of_any_blocks_and_threads_are_the_same(long_run, options):
    line = line_from_trajectory(
        long_run.trajectory, spacing=0.05, lever=LEVER, begin=0.0, end=SCANS / 4000
    )
    grid = grid_along(line, right=-1.0, left=1.0, spacing=0.05)
    found = {
        (block, threads): grid_runs([long_run], grid, options, block=block, threads=threads)
        for block in BLOCKS
        for threads in (1, 2)
    }
    first, counts = found.pop((BLOCKS[0], 1))
    assert counts["scans"] == SCANS
    assert counts["used"] > 0.9 * SCANS * ANGLE.size
    for surface, again in found.values():
        assert again == counts
        for name in ("height", "sd", "count"):
            npt.assert_array_equal(surface[name], first[name])
