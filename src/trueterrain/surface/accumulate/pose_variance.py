"""Variance of heights by errors of the pose.

These errors are common to all returns of a pass in a cell, and independent from pass to pass.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.georeference import PoseExpansion
from trueterrain.surface import _kernels
from trueterrain.surface.cells import Grid

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Step in which variances are added up [m²].
VARIANCE_STEP = 1e-12


@dataclass(frozen=True, eq=False)
class PoseVariance:
    """Variance of a height by the pose of a pass, as a + b v + c v² in each row."""

    sums: Integers
    "Of a, b, c, of the mean variance of east and north, and of scans, shape (row, 5)."

    @classmethod
    def empty(cls, grid: Grid) -> "PoseVariance":
        """All sums zero."""
        return cls(np.zeros((grid.shape[0], 5), np.int64))

    def add(
        self,
        motion: PoseExpansion,
        pieces: int,
        hint: npt.NDArray[Any],
        grid: Grid,
        *,
        datum_sd: float = 0.0,
    ) -> None:
        """Add scans to the rows given by their hints; the variance of the datum is left out."""
        x, y, nx, ny, *_ = grid.strips
        variance = motion.variance
        if datum_sd:
            variance = variance - np.array([datum_sd**2, 0, 0, 0, 0, 0, 0])
        _kernels.accumulate_poses(
            motion.body, variance, pieces, x, y, nx, ny, hint, VARIANCE_STEP, self.sums
        )

    @cached_property
    def coefficient(self) -> Floats:
        """a, b and c of all rows, interpolated over rows without scans, shape (3, row)."""
        a, b, c, _, n = self.sums.T
        seen = np.flatnonzero(n)
        if not seen.size:
            return np.zeros((3, n.size))
        at = np.arange(n.size)
        return np.stack(
            [np.interp(at, seen, some[seen] * VARIANCE_STEP / n[seen]) for some in (a, b, c)]
        )

    @cached_property
    def horizontal(self) -> Floats:
        """Sum of horizontal variances [m²], and of scans."""
        _, _, _, place, n = self.sums.T
        return np.array([place.sum() * VARIANCE_STEP, n.sum()], dtype=np.float64)

    def variance(self, rows: slice, v: Floats) -> Floats:
        """Variance of a height in the cells of some rows, at the offsets v [m²]."""
        coefficient = self.coefficient[:, rows]
        found = np.empty((coefficient.shape[1], v.size))
        _kernels.pose_variances(coefficient, v, found)
        return found
