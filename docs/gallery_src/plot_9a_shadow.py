"""
Which ground is in the shadow of a scan?
========================================

Ground behind a kerb, a stone or the edge of a pothole is hidden from an oblique laser beam. A
virtual scanner passes a kerb of 150 mm on a stony road, and the truth shows the hidden ground.
Points are closest below the laser and further apart to the sides, as in thesis Fig. 2-3.
"""

import tempfile

import matplotlib.pyplot as plt

from trueterrain import figures
from trueterrain.formats.run import open_run
from trueterrain.simulate.scene import Scene, ScenePass, TruthSettings, Vehicle, record_scene

left = 1.5707963267948966  # [rad] direction in which the kerb falls off
scene = Scene(
    name="kerbside",
    course={"kind": "straight", "length": 1.0},
    ground=(
        {"kind": "step", "position": 0.9, "rise": -0.15, "direction": left},
        {"kind": "stones", "density": 60.0, "diameter_min": 0.02, "diameter_max": 0.06, "seed": 3},
    ),
    vehicle=Vehicle(model="rigid", height=0.8),
    passes=(ScenePass(name="by", speed={"kind": "constant", "speed": 5.0}),),
    truth=TruthSettings(spacing=0.005),
)
(path,) = record_scene(scene, tempfile.mkdtemp())
run = open_run(path)

# %%
# One figure: the scans from above, and one of them from behind.

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6.4), layout="constrained")
figures.scan_plan(run, at=0.0, scans=200, ax=above)
figures.scan_elevation(run, at=0.1, ax=below)
figure.suptitle("A kerb of 150 mm and stones, simulated", fontsize="medium")

# %%
# One number: the width of the hidden ground. A beam over the edge of the kerb, 0.9 m to the side,
# meets the ground 0.9 m / 2 m times 150 mm further out, if no stone blocks it.

(hidden,) = (patch.get_width() for patch in below.patches)
print(f"{1000 * hidden:.0f} mm beside the kerb")
