"""
What does a tyre feel of a cleat, a gap and a stone next to the path?
=====================================================================

A wheel with point contact falls into every gap and does not feel the ground next to its line. Five
methods extract the profile over a cleat 10 mm high and 20 mm long, a gap of the same length, and a
stone of 40 mm whose top is 50 mm from the path: the line itself, the thesis's median within 25 mm,
and three models of a passenger car's tyre, whose contact patch is 130 mm long and 140 mm wide.
"""

import matplotlib.pyplot as plt
import numpy as np

import trueterrain as tt
from trueterrain import figures
from trueterrain.profile import RadialSpringTyre, RigidDisc, TandemCams, tyre_envelope
from trueterrain.simulate.ground import Stone

obstacles = {
    "cleat, 10 mm high, 20 mm long": tt.ground.Cleats(width=0.02, rise=0.01),
    "gap, 5 mm deep, 20 mm long": tt.ground.Cleats(width=0.02, rise=-0.005),
    "stone, 20 mm high, 50 mm beside": Stone(y=0.05, diameter=0.04, rise=0.02),
}
tyres = {
    "rigid disc": RigidDisc(),
    "tandem cams": TandemCams(),
    "radial springs": RadialSpringTyre(),
}
along, across = np.arange(-0.7, 0.7001, 0.0025), np.arange(-0.11, 0.1101, 0.0025)
path = tt.straight_path((-0.25, 0.0), (0.25, 0.0), spacing=0.0025)


def feel(ground):
    """Profile of the line itself, and those of the other methods."""
    surface = tt.sample_surface(ground, easting=along, northing=across)
    felt = {name: tyre_envelope(surface, path, tyre=tyre) for name, tyre in tyres.items()}
    felt["median, 25 mm"] = tt.tyre_profile(surface, path)
    return tt.point_profile(surface, path), felt


roads = {name: feel(ground) for name, ground in obstacles.items()}

# %%
# One figure. The profile of the line itself is grey.

figure, axes = plt.subplots(3, 1, figsize=(8, 7.6), layout="constrained", sharex=True)
for ax, (name, (line, felt)) in zip(axes, roads.items(), strict=True):
    figures.tyre_envelopes(line, felt, ax=ax)
    ax.set_title(name, fontsize="medium", loc="left")
    if ax is not axes[0]:
        ax.get_legend().remove()
    if ax is not axes[-1]:
        ax.set_xlabel("")

# %%
# The cleat makes two bumps and a dip. As it enters the patch, only the front edge climbs while the
# rear one rests on the road, and the hub rises to about half the height of the cleat; as it
# leaves, the rear edge does the same. In between the cleat is under the centre of the tread, which
# deforms, and both edges are back on the road. Cams rise by exactly a half, half of their
# distance, 55 mm, before and behind the cleat; springs divide the load between it and the road
# around it. The rigid disc climbs its full height, unlike a tyre.
#
# They bridge the gap. The stone is next to the line but under the patch: disc and tyres feel it,
# line and median do not. The median does not feel the cleat either, since 20 mm of it cover 49 %
# of the disc; of one that is 5 mm longer it feels the full height.

print("[mm] maximum deviation from level, and at the centre:")
for name, (line, felt) in roads.items():
    print(name)
    for tyre, profile in {"bare line": line, **felt}.items():
        height = np.round(1000 * profile.height.values, 1) + 0.0  # not -0.0
        print(f"    {tyre:15}{height[np.abs(height).argmax()]:5.1f}{height[height.size // 2]:6.1f}")

_, felt = feel(tt.ground.Cleats(width=0.025, rise=0.01))
print(
    f"cleat 25 mm long\n    median, 25 mm  {1000 * float(felt['median, 25 mm'].height.max()):5.1f}"
)
