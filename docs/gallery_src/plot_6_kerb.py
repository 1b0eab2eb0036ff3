"""
How does a vehicle move that drives off a kerb?
===============================================

The front wheels fall by 120 mm, then the rear wheels, and body and scanner oscillate on the
suspension. The scanner measures the ground less this motion, which must be known to a millimetre
to remove it.

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
# One number: the vertical travel of the scanner, 1 m behind the rear axle. The scanner rises
# first, as the nose falls, so it travels more than the height of the kerb.

forward, _, above = scene.mounting.scanner_position
pitch = truth["pitch"]
laser = truth["up"] - forward * np.sin(pitch) + above * np.cos(pitch)
print(f"The scanner travels {1000 * np.ptp(laser):.0f} mm over a kerb of 120 mm.")
