"""Statistics of the heights inside a search area (thesis 5.2.4 and 5.3).

Every statistic has ``estimate(distributions) -> (height, sd)``. The standard deviation is that of
the statistic itself, from the scatter of the heights, taken as independent samples of the ground
inside the search area: it is zero on a level plane and NaN for a single height.
"""

from trueterrain.profile.statistic.averages import InverseDistance, Mean
from trueterrain.profile.statistic.ranks import Median, Percentile, Window
from trueterrain.profile.statistic.steepest import SteepestCpf

Statistic = Mean | Median | Percentile | Window | InverseDistance | SteepestCpf

__all__ = [
    "InverseDistance",
    "Mean",
    "Median",
    "Percentile",
    "Statistic",
    "SteepestCpf",
    "Window",
]
