"""
By how much does each pass deviate from the common height?
==========================================================

A reference path follows the centre line of the overlap. Around each of its points the heights of
both passes are collected. Their mean is the reference height, and the deviation of a pass from it
is its discontinuity vector. Drift is slow, so waves shorter than 2.5 m are filtered out; the rest
is subtracted from the whole pass, station by station.

After thesis Figs. 4-4 and 4-5, with the two passes of :doc:`plot_7a_merged_lanes`.
"""

import matplotlib.pyplot as plt
import numpy as np
from _two_lanes import two_lanes

from trueterrain import figures
from trueterrain.alignment.merge import MergeSettings
from trueterrain.alignment.run_passes import merge_runs

merging, _ = merge_runs(two_lanes(), MergeSettings(method="discontinuity"))
(pair,) = merging.alignment.pairs

# %%
# One figure: above, the heights in one search area, in which both passes measured the same stones
# at different heights; below, the deviations of the passes from the reference height along the
# path.

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6.8), layout="constrained")
figures.pass_histograms(pair.discontinuity, station=10.0, ax=above)
figures.discontinuity_vectors(pair, cut_off=merging.alignment.settings.cut_off, ax=below)

# %%
# One number: the difference of the passes, and the residual at the reference points, which are
# waves too short to be drift.

apart = pair.discontinuity.filtered[0] - pair.discontinuity.filtered[1]
print(
    f"The passes are {1000 * np.median(apart):.1f} mm apart, then {1000 * pair.after.rmse:.1f} "
    "mm (RMSE at the reference points)."
)
