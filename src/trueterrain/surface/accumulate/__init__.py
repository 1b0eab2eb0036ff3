"""Cell statistics in whole numbers: the same for any order, block size and number of threads."""

from trueterrain.surface.accumulate._sums import STEP, CellSums, Tally, Wanted

__all__ = ["STEP", "CellSums", "Tally", "Wanted"]
