"""Returns of some scans, as the kernels take them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.georeference import ScanGeometry, Screening

_NONE: Any = np.empty((0, 0))


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredReturns:
    """Stored ranges of some scans, and all that sorts them into cells."""

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
    "Stored number of a beam without return."

    screening: Screening
    "Which returns are flagged."

    weights: tuple[int, int]
    "Weights of good and of flagged returns."

    def __post_init__(self) -> None:
        """Check the shapes, and that there are intensities if screening needs them."""
        shape = (self.time.size, self.geometry.angle.size)
        if any(each is not None and each.shape != shape for each in (self.ranges, self.intensity)):
            message = f"ranges and intensity must have the shape {shape}, got {self.ranges.shape}."
            raise ValueError(message)
        if self.screening.needs_intensity and self.intensity is None:
            message = "floor and saturation need intensities, which were not recorded."
            raise ValueError(message)

    def of(self, some: slice | npt.NDArray[np.bool_]) -> "StoredReturns":
        """Returns of some of the scans."""
        intensity = None if self.intensity is None else self.intensity[some]
        return replace(self, time=self.time[some], ranges=self.ranges[some], intensity=intensity)

    def covered(self) -> "StoredReturns":
        """Returns of the scans that the motion covers."""
        covered = self.geometry.covers(self.time)
        return self if covered.all() else self.of(covered)

    @property
    def loops(self) -> tuple[Any, ...]:
        """Arguments of the kernel."""
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
