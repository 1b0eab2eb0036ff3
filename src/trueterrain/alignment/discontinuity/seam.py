"""How well two lanes agree: their differences, and the step where one of them ends."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from trueterrain.alignment.difference_summary import DifferenceSummary
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.discontinuity.sparse_sums import (
    STRAIGHT,
    Flags,
    Floats,
    contains_keys,
    pack_cell,
    unpack_cell,
)
from trueterrain.alignment.observations.overlap import Overlap, cell_centres

_SURE = 3  # returns of each lane in a cell, from which their difference counts


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamSteps:
    """Steps that the merged ground makes where a lane ends inside the other one.

    Just inside of the edge of a lane the merged ground is the mean of all returns of both; just
    outside it is the other lane alone, which goes on through the edge. So the merged ground steps
    by its height less that of the other lane in the cells along the edge: the shape of the ground
    itself, and its steps, are no part of that. Cells that the edge cuts are left out.
    """

    station: Floats
    "Middle of each stretch of the path, shape (n,) [m]."

    step: Floats
    """Mean step along each stretch at the edge of the first lane and at that of the second, NaN
    where there is no such edge, shape (2, n) [m]."""

    @property
    def median(self) -> float:
        """Median of the sizes of all steps at both edges [m]; NaN if there are none."""
        known = self.step[np.isfinite(self.step)]
        return float(np.median(np.abs(known))) if known.size else float("nan")


class PairCells:
    """Cells with enough returns of two lanes, and where they lie.

    Parameters
    ----------
    overlap : Overlap
        Of the two lanes.
    """

    def __init__(self, overlap: Overlap) -> None:
        key, count, height = overlap.shared
        sure = (count >= _SURE).all(axis=0)
        self._overlap = overlap
        self._key, self._count, self._height = key[sure], count[:, sure], height[:, sure]
        self._edges: dict[tuple[int, float], Flags] = {}
        self.centres = cell_centres(self._key, overlap.cell)
        "Eastings and northings, shape (n,) each [m]."

    def agreement(self, corrections: Floats) -> DifferenceSummary:
        """Differences of the mean heights in the cells, with corrections (2, n) taken off [m]."""
        first, second = self._height - corrections
        return DifferenceSummary.of(first - second)

    def seam(
        self, corrections: Floats, path: ReferencePath, length: float, band: float
    ) -> SeamSteps:
        """Steps at both edges.

        Parameters
        ----------
        corrections : numpy.ndarray, shape (2, n)
            What is taken off the heights of both lanes [m].
        path : ReferencePath
            Path along the overlap.
        length : float
            Length of the stretches over which steps are averaged [m].
        band : float
            Distance from the cells at the edge within which others count [m].

        Returns
        -------
        Seam
            Along the whole path.
        """
        height = self._height - corrections
        merged = (self._count * height).sum(axis=0) / self._count.sum(axis=0)
        found = path.locate(*self.centres)
        stretches = max(int(np.ceil(path.length / length - 1e-9)), 1)
        long = path.length / stretches
        stretch = np.minimum((found.station / long).astype(np.int64), stretches - 1)
        steps: Any = np.full((2, stretches), np.nan)
        for lane in (0, 1):
            if (lane, band) not in self._edges:
                self._edges[lane, band] = self._edge(lane, band)
            along = self._edges[lane, band] & ~found.beyond
            here, step = stretch[along], (merged - height[1 - lane])[along]
            quantity = np.bincount(here, minlength=stretches)
            some = quantity > 0
            steps[lane, some] = np.bincount(here, step, minlength=stretches)[some] / quantity[some]
        return SeamSteps(station=np.asarray((np.arange(stretches) + 0.5) * long), step=steps)

    def _edge(self, lane: int, band: float) -> Flags:
        """Cells near such as only the other lane covers, but for the outermost: it is cut."""
        other = self._overlap.cells[1 - lane].covered
        alone = other[~contains_keys(self._overlap.key, other)]
        for step in STRAIGHT:  # where both end within a cell, neither goes on
            alone = alone[contains_keys(other, alone + step) & contains_keys(other, alone - step)]
        reach = max(int(np.ceil(band / self._overlap.cell - 1e-9)), 1) + 1
        column, row = unpack_cell(self._key)
        near, cut = np.zeros((2, self._key.size), np.bool_)
        for c in range(-reach, reach + 1):
            for r in range(-reach, reach + 1):
                there = contains_keys(alone, pack_cell(column + c, row + r))
                near |= there
                if max(abs(c), abs(r)) == 1:
                    cut |= there
        return np.asarray(near & ~cut)
