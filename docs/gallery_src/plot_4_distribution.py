"""
Which height stands for a search area?
======================================

All heights inside a search area make a distribution, seen as its cumulative probability function
(CPF). Heights recorded in steps of 1 mm make it a staircase, and PCHIP interpolates between the
steps, so that the median does not jump by a whole step. The height at which the CPF is steepest is
the mode: the height of most of the patch, independent of the joint next to it.

In the manner of thesis Fig. 5-7. The disc has a radius of 50 mm here, which on this grid of 10 mm
gives about as many heights as the thesis had: 81.
"""

import numpy as np
from _ground import belgian_block

import trueterrain as tt
from trueterrain import figures
from trueterrain.profile import HeightDistribution

road, name = belgian_block()
path = tt.offset_path(road, 0.3, spacing=0.01)
disc = tt.Disc(radius=0.05)

# %%
# A joint lowers the median but not the mode. So take a path point at which their difference is at
# its 95 % quantile. The CPF is smoothed over 4 mm before its slope is taken, so that a few heights
# cannot be the steepest part of it.

statistics = [tt.Median(resolution=0.001), tt.statistics.SteepestCpf(bandwidth=0.004)]
median, steepest = (
    tt.tyre_profile(road, path, area=disc, statistic=statistic).height.values
    for statistic in statistics
)
index = int(np.argsort(steepest - median)[int(0.95 * len(path))])

# %%
# Its heights, recorded in steps of 1 mm.

whole = tt.height_distributions(road, path.part(index, index + 1), area=disc)[0]
recorded = HeightDistribution(
    heights=np.sort(np.round(whole.heights, 3)), distances=whole.distances
)
ax = figures.cpf(recorded, resolution=0.001, statistics=statistics)
ax.figure.suptitle(f"{name}, s = {path.s[index]:.2f} m", fontsize="medium")

# %%
# One number: the RMS difference over the whole path.

rms = np.sqrt(np.mean((steepest - median) ** 2))
print(f"steepest height against median: {1000 * rms:.1f} mm RMS")
