"""Returns of some scans, as the loops take them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.georeference import ScanGeometry, Screening

_NONE: Any = np.empty((0, 0))


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredReturns:
    """Ranges of some scans as they are stored, and what is needed to sort them into cells."""

    geometry: ScanGeometry
    "Motion and beams."

    time: npt.NDArray[np.float64]
    "Stamps of the scans, shape (scan,) [s]."

    ranges: npt.NDArray[Any]
    "Ranges in steps of `scale`, shape (scan, beam)."

    intensity: npt.NDArray[Any] | None
    "Intensities, if they were recorded, shape (scan, beam) [counts]."

    scale: float
    "Step of the ranges [m]."

    missing: Any
    "Number that stands for no return."

    screening: Screening
    "Which returns are flagged."

    weights: tuple[int, int]
    "Of good and of flagged returns."

    def __post_init__(self) -> None:
        """Check the shapes, and that there are intensities if they matter."""
        shape = (self.time.size, self.geometry.angle.size)
        if any(each is not None and each.shape != shape for each in (self.ranges, self.intensity)):
            message = f"ranges and intensity must have the shape {shape}, got {self.ranges.shape}."
            raise ValueError(message)
        if self.screening.needs_intensity and self.intensity is None:
            message = "floor and saturation need intensities, which were not recorded."
            raise ValueError(message)

    def of(self, some: slice | npt.NDArray[np.bool_]) -> "StoredReturns":
        """Those of some scans."""
        intensity = None if self.intensity is None else self.intensity[some]
        return replace(self, time=self.time[some], ranges=self.ranges[some], intensity=intensity)

    def covered(self) -> "StoredReturns":
        """Those of scans that the motion covers."""
        covered = self.geometry.covers(self.time)
        return self if covered.all() else self.of(covered)

    @property
    def loops(self) -> tuple[Any, ...]:
        """What the loops need."""
        screening = self.screening
        return (
            self.ranges,
            self.scale,
            self.missing,
            screening.nearest,
            screening.furthest,
            self.intensity if screening.needs_intensity else _NONE,
            screening.floor,
            screening.saturation,
            *self.weights,
        )
