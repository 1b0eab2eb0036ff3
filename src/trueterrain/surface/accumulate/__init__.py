"""Cell statistics in whole numbers: the same for any order, block size and number of threads."""

from trueterrain.surface.accumulate._pose import Pose
from trueterrain.surface.accumulate._reach import Reach, survey, work
from trueterrain.surface.accumulate._sums import STEP, CellSums
from trueterrain.surface.accumulate._tally import Tally, Wanted

__all__ = ["STEP", "CellSums", "Pose", "Reach", "Tally", "Wanted", "survey", "work"]
