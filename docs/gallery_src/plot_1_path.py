"""
Are path points equally far apart on a weaving path?
====================================================

A tyre profile needs path points at equal **arc length**: a wheel rolls along its path, not along
the easting. The path here weaves over the road. Its arc length is known in closed form (an
elliptic integral), so the error of the spacing is known.

The thesis computes the path step by step with Eqs. 5-3 and 5-5. As printed, 5-5 squares the slope
and loses its sign: every step is to the left, and the path diverges (dashed).

In the manner of thesis Fig. 5-3.
"""

import numpy as np
from _ground import belgian_block
from scipy.special import ellipeinc

import trueterrain as tt
from trueterrain import figures
from trueterrain.surface import grid_frame, uv_to_xy

road, name = belgian_block()

# %%
# The path: a sine of 0.4 m about the straight line between two points of the road.

frame = grid_frame(road)
(e0, e1), (n0, n1) = uv_to_xy(frame, road.u.values[[30, -30]], [0.2, 0.2])
length = np.hypot(e1 - e0, n1 - n0)
forward = np.array([e1 - e0, n1 - n0]) / length
left = np.array([-forward[1], forward[0]])
amplitude, wave = 0.4, 2 * np.pi / 4.0


def weave(x):
    """Easting and northing after a distance x along the straight line [m]."""
    x = np.asarray(x)[..., None]
    return np.array([e0, n0]) + x * forward + amplitude * np.sin(wave * x) * left


spacing = 0.25
path = tt.paths.curve_path(weave, 0.0, length, spacing=spacing)

# %%
# Reference: the arc length of a sine is an elliptic integral of the second kind.

squared_slope = (amplitude * wave) ** 2
x = (np.stack([path.easting - e0, path.northing - n0], axis=-1) * forward).sum(axis=-1)
parameter = squared_slope / (1 + squared_slope)
arc_length = np.sqrt(1 + squared_slope) / wave * ellipeinc(wave * x, parameter)
error = np.abs(np.diff(arc_length) / spacing - 1).max()
print(f"maximum error of the spacing: {error:.1e} of the spacing")

# %%
# The thesis's form, step by step: dx and dy are both positive for any slope.

steps = [(0.0, 0.0)]
while steps[-1][0] < 3.2:
    x_i, y_i = steps[-1]
    slope_squared = (amplitude * wave * np.cos(wave * x_i)) ** 2
    dx = spacing / np.sqrt(1 + slope_squared)
    dy = spacing * np.sqrt(1 - 1 / (1 + slope_squared))
    steps.append((x_i + dx, y_i + dy))
printed = np.array([e0, n0]) + np.array(steps) @ np.stack([forward, left])

# %%
# One figure.

ax = figures.surface_map(road, frame="ground")
ax.plot(*printed.T, "--", color="white", linewidth=3)
ax.plot(*printed.T, "--", color="black", linewidth=1.5, label="Eq. 5-5 as printed")
ax.plot(
    path.easting,
    path.northing,
    "o",
    color="white",
    markeredgecolor="#D55E00",
    markersize=5,
    label=f"path points, every {spacing:g} m (error {error:.0e} of it)",
)
if ax.get_legend():
    ax.get_legend().remove()  # one legend for all, below
ax.figure.legend(loc="outside lower left", ncols=3, frameon=False, fontsize="small")
ax.figure.suptitle(name, fontsize="medium")
