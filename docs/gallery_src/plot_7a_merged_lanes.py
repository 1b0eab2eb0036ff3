"""
How far apart do two passes lie before and after merging?
=========================================================

Where one pass ends inside the other, merged ground makes a step: on one side of the edge it is the
mean of both, on the other side one of them alone. Passes that drifted apart by centimetres leave
steps of centimetres. One least-squares adjustment of both passes at once brings them together.

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
# else nothing could be read of what is left.

ax = figures.seam_steps(seam)
ax.figure.suptitle("Two passes over Belgian block, 20 m at 5 m/s, simulated", fontsize="medium")

# %%
# One number: the median step. Passes could agree in the very cells that they were fitted to and
# nowhere else; so by how much they differ is also told where ground was held back.

held_out = merging.pairs[0].held_out.rmse
print(
    f"Median step {1000 * seam.before.median:.1f} mm before and {1000 * seam.after.median:.2f} mm "
    f"after; cells of 0.1 m that were held back differ by {1000 * held_out:.1f} mm (RMSE)."
)
