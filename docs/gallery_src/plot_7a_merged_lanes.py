"""
How far apart do two passes lie before and after merging?
=========================================================

Where one pass ends inside the other, merged ground makes a step: on one side of the edge it is the
mean of both, on the other side one of them alone. Drift of centimetres makes steps of
centimetres. A least-squares adjustment of both passes brings them into agreement.

In the manner of thesis Figs. 4-7 and 4-9. The passes are 20 m of the scene ``belgian-two-lanes``,
with fewer beams and scans; the drift is that of :doc:`plot_7_two_lanes`.
"""

from _two_lanes import two_lanes

from trueterrain import figures
from trueterrain.alignment.run_passes import merge_runs

merging, _ = merge_runs(two_lanes())
(seam,) = merging.seams

# %%
# One figure: the steps along both edges of the overlap, before and after. The axis is logarithmic,
# to show the remaining steps.

ax = figures.seam_steps(seam)
ax.figure.suptitle("Two passes over Belgian block, 20 m at 5 m/s, simulated", fontsize="medium")

# %%
# One number: the median step. The cells of the fit alone would be too optimistic; so the
# difference in held-out cells is given as well.

held_out = merging.pairs[0].held_out.rmse
print(
    f"Median step {1000 * seam.before.median:.1f} mm before and {1000 * seam.after.median:.2f} mm "
    f"after; held-out cells of 0.1 m differ by {1000 * held_out:.1f} mm (RMSE)."
)
