"""Off a kerb (thesis Fig. 2-5): the body's motion is a wave in the ground unless it is removed."""

from dataclasses import replace

import numpy as np
import pytest

from trueterrain.formats.run import open_run
from trueterrain.geometry import rotations
from trueterrain.motion import fuse_motion
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene, record_scene
from trueterrain.surface import PassRecord, grid_along, grid_runs, straight_line

pytestmark = pytest.mark.slow

KERB = 10.0  # [m] easting
RISE = -0.12  # [m]
EDGE = 0.15  # [m] around the kerb that is left out: spot, cells, and the shadow under it

WAVE = 0.15  # [m] at least, from peak to peak: more than the kerb is high
# [m] from peak to peak over 2.6 s: the drift of navigation changes by 5 mm in 1 s
LEFT = 0.006
SWING = 3e-4  # [m] rms of what is left, less the parabola that drift over some seconds is
HEIGHT = 0.003  # [m] of the kerb, of which the drift of 0.1 s is part


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The scene with the default errors of all instruments; 60 beams in the middle."""
    scene, path = read_scene("kerb")
    scene = replace(
        scene,
        scanner=Scanner(beams=60, swath=0.4),
        truth=TruthSettings(returns=False, spacing=0.1),
        raster=0.01,
        passes=(replace(scene.passes[0], start=6.0, length=12.0),),
    )
    (recorded,) = record_scene(scene, tmp_path_factory.mktemp("runs"), path=path)
    return recorded


@pytest.fixture(scope="module")
def motion(run):
    """Motion from navigation and accelerometers, all settings as they are."""
    return fuse_motion(open_run(run)).trajectory


def held_still(motion):
    """The body rolls along level at its mean height."""
    _, _, yaw = rotations.to_iso8855(motion.at(motion.time).rotation)
    level = np.full(yaw.size, motion.position[:, 2].mean())
    return replace(
        motion,
        position=np.column_stack([motion.position[:, :2], level]),
        velocity=motion.velocity * [1, 1, 0],
        quaternion=rotations.from_iso8855(0, 0, yaw).as_quat(),
        angular_velocity=motion.angular_velocity * [0, 0, 1],
    )


def middle(run, trajectory):
    """Easting and height along the middle of the lane, mean across [m]."""
    line = straight_line((6.0, 0.0), (14.0, 0.0), spacing=0.02)
    grid = grid_along(line, right=-0.1, left=0.1)
    surface, _ = grid_runs([PassRecord(run=run, trajectory=trajectory)], grid)
    return surface.easting.values, np.nanmean(surface.height.values, axis=1)


def waves(x, height):
    """From peak to peak about level ground, before the kerb and behind it [m]."""
    return [np.ptp(height[side]) for side in (x < KERB - EDGE, x > KERB + EDGE)]


def test_held_still_the_ground_waves(run, motion):
    x, height = middle(run, held_still(motion))
    assert max(waves(x, height)) > WAVE
    assert min(waves(x, height)) > 5 * LEFT


def test_with_the_motion_the_wave_is_gone_and_the_kerb_is_there(run, motion):
    x, height = middle(run, motion)
    assert max(waves(x, height)) < LEFT
    seen = np.abs(x - KERB) > EDGE
    level = height - RISE * (x > KERB)
    rest = level[seen] - np.polyval(np.polyfit(x[seen], level[seen], 2), x[seen])
    assert np.sqrt(np.mean(rest**2)) < SWING
    sides = [
        height[(side * (x - KERB) > EDGE) & (np.abs(x - KERB) < 0.5)].mean() for side in (-1, 1)
    ]
    assert abs(sides[1] - sides[0] - RISE) < HEIGHT
