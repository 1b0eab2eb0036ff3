"""
How much of a joint does a tyre feel?
=====================================

A point laser follows each line down into each joint. Lines only 10 mm apart differ, because joints
are rounded, skewed and uneven. The tyre bridges them: its profile is the median of the heights
within 25 mm.

In the manner of thesis Fig. 5-6.
"""

import numpy as np
import scipy.signal
from _ground import belgian_block

import trueterrain as tt
from trueterrain import figures

road, name = belgian_block()
offset = 0.3
tyre = tt.tyre_profile(road, tt.offset_path(road, offset, spacing=0.01))
lines = {
    shift: tt.point_profile(road, tt.offset_path(road, offset + shift, spacing=0.01))
    for shift in (-0.02, -0.01, 0.0, 0.01, 0.02)
}

# %%
# One figure: 1.5 m of the road.

shown = {"s": slice(2.0, 3.5)}
ax = figures.parallel_profiles(
    {shift: line.sel(shown) for shift, line in lines.items()}, tyre.sel(shown)
)
ax.figure.suptitle(name, fontsize="medium")


# %%
# One number. A joint lies below the highest points within 60 mm on both sides of it; its depth is
# counted from the lower one of the two.


def depths(height):
    """Depth of each path point below its surroundings [m]."""
    windows = np.lib.stride_tricks.sliding_window_view(height, 13)
    return np.minimum(windows[:, :6].max(axis=1), windows[:, 7:].max(axis=1)) - windows[:, 6]


on_the_line, for_the_tyre = depths(lines[0.0].height.values), depths(tyre.height.values)
joints = scipy.signal.find_peaks(on_the_line, height=0.004, distance=6)[0]
line_depth = 1000 * on_the_line[joints].mean()
tyre_depth = 1000 * np.mean([for_the_tyre[max(j - 3, 0) : j + 4].max() for j in joints])
print(
    f"{joints.size} joints, on average {line_depth:.1f} mm deep on the line "
    f"and {tyre_depth:.1f} mm for the tyre: {100 * tyre_depth / line_depth:.0f} % of it"
)
