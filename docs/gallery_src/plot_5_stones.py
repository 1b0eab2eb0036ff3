"""
How much rougher do loose stones make a road?
=============================================

For a point laser, visibly; for a tyre, not at all. The ground is simulated, so the truth is known:
a smooth road (ISO 8608 class A), bare and with stones of 8 to 30 mm on it. Line and tyre profile
of both are rated by the International Roughness Index (IRI).
"""

import matplotlib.pyplot as plt
import numpy as np

import trueterrain as tt
from trueterrain import figures

smooth = tt.ground.Road(road_class="A", seed=5)
stony = smooth + tt.ground.Stones(density=400.0, diameter_min=0.008, diameter_max=0.03, seed=6)
size = {"length": 100.0, "width": 0.2, "spacing_u": 0.005, "spacing_v": 0.005}
bare, covered = tt.sample_road(smooth, **size), tt.sample_road(stony, **size)

# %%
# The same path over both, once as a line and once as a tyre feels it.

path = tt.offset_path(bare, 0.04, spacing=0.01)
line, line_bare = tt.point_profile(covered, path), tt.point_profile(bare, path)
tyre, tyre_bare = tt.tyre_profile(covered, path), tt.tyre_profile(bare, path)

# %%
# One figure: half a metre around the highest stone on the path, and the difference of the
# tyre's profile of the stony road from the bare road, everywhere.

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 5.2), layout="constrained")
stone = path.s[np.argmax((line.height - line_bare.height).values)]
shown = {"s": slice(stone - 0.25, stone + 0.25)}
figures.profiles({"line": line.sel(shown), "tyre": tyre.sel(shown)}, ax=above)
figures.profile_difference({"line": line, "tyre": tyre.drop_vars("sd")}, line_bare, ax=below)
figure.suptitle("ISO 8608 class A road with stones, simulated", fontsize="medium")

# %%
# One number, twice: the increase of the index by the stones.

for name, stony_profile, bare_profile in [("line", line, line_bare), ("tyre", tyre, tyre_bare)]:
    without, with_stones = (tt.iri(p).iri.item() for p in (bare_profile, stony_profile))
    print(f"{name}: {without:.2f} m/km bare, {with_stones:.2f} m/km with stones")
