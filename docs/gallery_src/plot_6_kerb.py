"""
How does a vehicle move that drives off a kerb?
===============================================

The front wheels fall by 120 mm, then the rear wheels do, and the body swings on its springs, the
scanner with it. What the scanner measures is the ground less this motion: navigation has to take it
out, millimetre by millimetre.

In the manner of thesis Fig. 2-5. The van of the ready scene `kerb` drives at 3 m/s; its motion is
computed, no instrument is needed for it.
"""

import numpy as np

from trueterrain import figures
from trueterrain.simulate.scene import read_scene, set_stage

scene, _ = read_scene("kerb")
stage = set_stage(scene)
motion = stage.motion(scene.passes[0])
knots = motion.knots(2.5, 6.0, margin=0.0)

# %%
# One figure: heave, pitch (nose down positive) and roll of the body.

truth = {"time": knots.time, "up": knots.pose[:, 2], "pitch": knots.pose[:, 4]}
ax = figures.body_motion(truth | {"roll": knots.pose[:, 3]})
ax.figure.suptitle(scene.title + ", simulated", fontsize="medium")

# %%
# One number: how far the scanner, 1 m behind the rear axle, travels. It rises first, as the nose
# falls, so its way is longer than the kerb is high.

forward, _, above = scene.mounting.scanner_position
pitch = truth["pitch"]
laser = truth["up"] - forward * np.sin(pitch) + above * np.cos(pitch)
print(f"The scanner travels {1000 * np.ptp(laser):.0f} mm over a kerb of 120 mm.")
