"""What is summed up, and how many returns went where."""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, kw_only=True)
class KeptSums:
    """Which sums are kept; each costs memory."""

    extremes: bool = False
    "Least and greatest height of each cell."

    places: bool = True
    "Where in the cells the returns lie on average."

    point_sd: bool = False
    "Variances of points that know their standard deviation."

    agreed: bool = False
    "Whether errors of the poses of passes are the same instead of independent; costs nothing."

    @property
    def bytes(self) -> int:
        """Memory for a cell [bytes]."""
        return 20 + 8 * (self.extremes + self.places + self.point_sd)


@dataclass
class ReturnTotals:
    """How many returns went where."""

    used: int = 0
    "In cells."

    flagged: int = 0
    "Rejected, or weighed less, for their intensity."

    outside: int = 0
    "Beside the grid."

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
        """Add what a loop counted: good returns, flagged ones, those outside and too high."""
        used, flagged, outside, too_high = counts.tolist()
        self.add(ReturnTotals(used=used, flagged=flagged, outside=outside, too_high=too_high))
