"""Which sums of a cell are kept, and counts of returns by outcome."""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

#: Step in which heights are added up [m].
STEP = 1e-5

#: Parts of a cell in which positions inside it are added up.
PARTS = 256

#: Weight of a good return where flagged ones weigh less.
GOOD = 16


@dataclass(frozen=True, kw_only=True)
class KeptSums:
    """Which sums of a cell are kept; each takes memory."""

    extremes: bool = False
    "Min and max height of each cell."

    places: bool = True
    "Mean position of the returns in the cell."

    point_sd: bool = False
    "Variances of points that have a standard deviation of their own."

    agreed: bool = False
    "Whether errors of the poses are common to all passes instead of independent."

    @property
    def bytes(self) -> int:
        """Memory for a cell [bytes]."""
        return 20 + 8 * (self.extremes + self.places + self.point_sd)


@dataclass
class ReturnTotals:
    """Counts of returns by outcome, and of scans."""

    used: int = 0
    "Added to a cell."

    flagged: int = 0
    "Rejected, or with less weight, for their intensity."

    outside: int = 0
    "Outside the grid."

    too_high: int = 0
    "Higher or lower than 10 km, or without height."

    scans: int = 0
    "Scans."

    scans_uncovered: int = 0
    "Scans that the motion does not cover."

    bridged: int = 0
    "Scans at times at which no instrument saw the motion."

    def add(self, other: "ReturnTotals") -> None:
        """Add another one."""
        for entry in fields(self):
            setattr(self, entry.name, getattr(self, entry.name) + getattr(other, entry.name))

    def note(self, counts: npt.NDArray[np.int64]) -> None:
        """Add the counts of a loop: used, flagged, outside, too high."""
        used, flagged, outside, too_high = counts.tolist()
        self.add(ReturnTotals(used=used, flagged=flagged, outside=outside, too_high=too_high))
