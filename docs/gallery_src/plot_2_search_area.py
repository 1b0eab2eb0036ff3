"""
Which heights count for one path point?
=======================================

Those inside the search area around it: by default a disc of 25 mm radius, the thesis's choice.
Neighbouring areas overlap, so the profile is smooth although path points are independent.

In the manner of thesis Fig. 5-3.
"""

from _ground import belgian_block

import trueterrain as tt
from trueterrain import figures

road, name = belgian_block()
path = tt.offset_path(road, 0.3, spacing=0.01)

ax = figures.search_area_map(road, path, tt.Disc(radius=0.025), station=3.20)
ax.figure.suptitle(name, fontsize="medium")

# %%
# How many heights count, over the whole path? About the area of the disc, 1963 mm², divided by the
# 100 mm² that each node stands for.

count = tt.height_distributions(road, path, area=tt.Disc(radius=0.025)).count
print(f"{count[1:-1].mean():.1f} heights per path point, from {count.min()} to {count.max()}")
