"""
How far apart do two passes over the same ground lie?
=====================================================

Two passes side by side, with an overlap of half a metre, as over the Belgian block of thesis
Fig. 4-2. The navigation of each drifts independently: where both measure the same stones, their
heights differ.

The drift is of the size that two drives over one road show with a post-processed Applanix POS LV
(Boreas data set): the difference of two passes has a mean of -42 mm and a standard deviation of
25 mm, with a correlation over 25 s.
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from trueterrain import figures
from trueterrain.formats.run import open_run
from trueterrain.simulate.scene import Vehicle, read_scene, record_pass, set_stage

scene, _ = read_scene("belgian-two-lanes")
folder = Path(tempfile.mkdtemp())

# %%
# A minute of it. Errors of navigation do not depend on the ground, so a plane, a rigid body and a
# few beams are enough.

few = replace(scene.scanner, beams=20, rate=10.0, spot_rays=1)
long = replace(
    scene,
    course={"kind": "straight", "length": 300.0},
    ground=({"kind": "plane"},),
    vehicle=Vehicle(model="rigid"),
    scanner=few,
    truth=replace(scene.truth, spacing=1.0),
)
stage = set_stage(long)
runs = []
for number, drive in enumerate(long.passes):
    path = folder / f"{drive.name}.zarr"
    record_pass(stage, drive, stage.motion(drive), path, number=number, block=10.0)
    runs.append(open_run(path))
left, right = runs

# %%
# One figure: recorded less true height. The thick line is the drift, the thin one the drift with
# white noise.

ax = figures.navigation_errors({"left lane": left, "right lane": right})
ax.figure.suptitle("Two passes, 300 m at 5 m/s, simulated", fontsize="medium")

# %%
# One number: the difference in height of the two passes.

apart = left["truth/navigation"].error_up.values - right["truth/navigation"].error_up.values
print(
    f"The passes are {1000 * apart.mean():.0f} mm apart on average, "
    f"{1000 * apart.min():.0f} mm to {1000 * apart.max():.0f} mm in the course of a minute."
)
