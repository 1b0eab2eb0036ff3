"""Cell statistics as integer sums: the same for any order, block size and number of threads."""

from trueterrain.surface.accumulate._kernels import HEIGHT_OFFSET
from trueterrain.surface.accumulate._reach import ScanReach, count_scan_visits, scan_reaches
from trueterrain.surface.accumulate._returns import PARTS, STEP, KeptSums, ReturnTotals
from trueterrain.surface.accumulate._sums import CellSums
from trueterrain.surface.accumulate.pose_variance import PoseVariance

__all__ = [
    "HEIGHT_OFFSET",
    "PARTS",
    "STEP",
    "CellSums",
    "KeptSums",
    "PoseVariance",
    "ReturnTotals",
    "ScanReach",
    "count_scan_visits",
    "scan_reaches",
]
