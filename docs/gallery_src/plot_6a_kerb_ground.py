"""
What is the ground under a vehicle that bounces?
================================================

When a vehicle drives off a kerb, body and scanner oscillate. If the ranges are processed as if the
scanner were level and at a constant height, the motion becomes a wave in the ground. With the
motion estimated from navigation and accelerometers, the wave disappears and the kerb appears.

In the manner of thesis Fig. 2-5 (b) and (c). The ready scene `kerb`, with the default errors of
all instruments; only the central beams, over 1.5 m, are recorded.
"""

import tempfile
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from trueterrain import figures, open_run, read_scene, record_scene
from trueterrain.geometry import rotations
from trueterrain.motion import fuse_motion
from trueterrain.surface import PassRecord, grid_along, grid_runs, straight_line

scene, path = read_scene("kerb")
few = replace(scene.scanner, beams=300, swath=2.0)
drive = replace(scene.passes[0], start=6.0, length=12.0)
scene = replace(scene, scanner=few, raster=0.01, passes=(drive,))
folder = tempfile.TemporaryDirectory()
(run,) = record_scene(scene, folder.name, path=path)

# %%
# The motion, and that of a level body at its mean height.

motion = fuse_motion(open_run(run)).trajectory
roll, pitch, yaw = rotations.to_iso8855(Rotation.from_quat(motion.quaternion))
level = np.full(yaw.size, motion.position[:, 2].mean())
still = replace(
    motion,
    position=np.column_stack([motion.position[:, :2], level]),
    velocity=motion.velocity * [1, 1, 0],
    quaternion=rotations.from_iso8855(0.0, 0.0, yaw).as_quat(),
    angular_velocity=motion.angular_velocity * [0, 0, 1],
)

# %%
# One figure: the ground by both, at the same scale.

grid = grid_along(straight_line((6.0, 0.0), (14.0, 0.0), spacing=0.02), right=-0.8, left=0.8)
ground = {
    "(b) scanner assumed level and still": grid_runs([PassRecord(run=run, trajectory=still)], grid)[
        0
    ],
    "(c) body motion removed": grid_runs([PassRecord(run=run, trajectory=motion)], grid)[0],
}
heights = [float(f(s.height)) for s in ground.values() for f in (np.nanmin, np.nanmax)]
fig, axes = plt.subplots(2, 1, figsize=(8.0, 5.6), layout="constrained")
for ax, (name, surface) in zip(axes, ground.items(), strict=True):
    figures.surface_relief(surface, exaggeration=4, heights=(min(heights), max(heights)), ax=ax)
    ax.set_title(name, loc="left", fontsize="medium")

# %%
# One number, for each: the peak-to-peak height of the ground in front of the kerb and behind it,
# without the 0.3 m around the kerb.

for name, surface in ground.items():
    line = surface.height.mean("v", skipna=True).values
    station = surface.u.values
    before, behind = line[station < 3.85], line[station > 4.15]
    wave = max(np.ptp(before), np.ptp(behind))
    print(f"{name}: {1000 * wave:.1f} mm from peak to peak")
folder.cleanup()
