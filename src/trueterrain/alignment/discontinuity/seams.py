"""Agreement of two passes in their cells, and the step of the ground where one of them ends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.centre_line import centre_reference
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.observations import overlap as coarse
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.observations.overlap import Overlap, cell_centres, find_overlap
from trueterrain.alignment.observations.sparse_sums import (
    STRAIGHT,
    Flags,
    Floats,
    contains_keys,
    pack_cell,
    unpack_cell,
)
from trueterrain.core.errors import TrueTerrainError
from trueterrain.surface.difference import DifferenceSummary

Integers = npt.NDArray[np.int64]

_MIN_RETURNS = 3  # of each pass in a cell, to use their difference
_STRETCH = 1.0  # [m] length along the seam over which a step is averaged
_BAND = 3  # cells from the edge within which a step is measured


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamSteps:
    """Steps of the merged ground where a pass ends within the other one.

    Just inside the edge of a pass the merged ground is the mean of all returns of both passes; just
    outside it is the other pass alone. The step is the merged height less that of the other pass in
    the cells along the edge, so the shape of the ground cancels. Cells that the edge cuts are left
    out.
    """

    station: Floats
    "Centre of each section of the path, shape (n,) [m]."

    step: Floats
    """Mean step in each section at the edge of the first and of the second pass, shape (2, n) [m];
    NaN where there is no such edge."""

    @property
    def median(self) -> float:
        """Median of the absolute values of all steps [m]; NaN if there are none."""
        known = self.step[np.isfinite(self.step)]
        return float(np.median(np.abs(known))) if known.size else float("nan")


class PairCells:
    """Cells with enough returns of two passes, to compare their heights.

    Parameters
    ----------
    overlap : Overlap
        Overlap of the two passes.
    """

    def __init__(self, overlap: Overlap) -> None:
        key, count, height = overlap.shared
        used = (count >= _MIN_RETURNS).all(axis=0)
        self._overlap = overlap
        self._key, self._count, self._height = key[used], count[:, used], height[:, used]
        self._edges: dict[tuple[int, float], Flags] = {}
        self.centres = cell_centres(self._key, overlap.cell)
        "Eastings and northings of the cells, shape (n,) each [m]."

    def agreement(self, corrections: Floats) -> DifferenceSummary:
        """Differences of the mean heights in the cells, less corrections of shape (2, n) [m]."""
        first, second = self._height - corrections
        return DifferenceSummary.of(first - second)

    def seam(
        self, corrections: Floats, path: ReferencePath, length: float, band: float
    ) -> SeamSteps:
        """Steps at both edges.

        Parameters
        ----------
        corrections : numpy.ndarray, shape (2, n)
            Corrections to subtract from the heights of both passes [m].
        path : ReferencePath
            Path along the overlap.
        length : float
            Length of the sections over which steps are averaged [m].
        band : float
            Distance from the edge within which cells are used [m].

        Returns
        -------
        SeamSteps
            Along the whole path.
        """
        height = self._height - corrections
        merged = (self._count * height).sum(axis=0) / self._count.sum(axis=0)
        found = path.locate(*self.centres)
        sections = max(int(np.ceil(path.curve.length / length - 1e-9)), 1)
        section_length = path.curve.length / sections
        section = np.minimum((found.station / section_length).astype(np.int64), sections - 1)
        steps: Any = np.full((2, sections), np.nan)
        for side in (0, 1):
            if (side, band) not in self._edges:
                self._edges[side, band] = self._edge(side, band)
            along = self._edges[side, band] & ~found.beyond
            here, step = section[along], (merged - height[1 - side])[along]
            quantity = np.bincount(here, minlength=sections)
            some = quantity > 0
            steps[side, some] = np.bincount(here, step, minlength=sections)[some] / quantity[some]
        return SeamSteps(
            station=np.asarray((np.arange(sections) + 0.5) * section_length), step=steps
        )

    def _edge(self, side: int, band: float) -> Flags:
        """Cells near the edge of a pass, without the outermost, which the edge may cut."""
        other = self._overlap.cells[1 - side].covered
        alone = other[~contains_keys(self._overlap.key, other)]
        for step in STRAIGHT:  # where both passes end there is no step
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


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamAgreement:
    """Steps of the merged ground where one of two passes ends within the other."""

    names: tuple[str, str]
    "Names of the passes."

    before: SeamSteps
    "Before the correction."

    after: SeamSteps
    "After the correction."


def find_seams(
    cells: Sequence[PassCells], added: Mapping[str, Floats], size: float
) -> tuple[list[SeamAgreement], list[str]]:
    """Steps at the edges of all overlaps: the measure of a merge that users see.

    Parameters
    ----------
    cells : sequence of PassCells
        Cells of each pass.
    added : mapping of str to numpy.ndarray
        Corrections to add to the heights of each pass, shape (cell,) [m].
    size : float
        Size of the cells [m].

    Returns
    -------
    seams : list of SeamAgreement
        One for each overlap that has a centre line.
    left_out : list of str
        Messages about the other overlaps.
    """
    passes = {one.name: (_first_visits(one), one) for one in cells}
    found, left_out = [], []
    for pair in combinations(sorted(passes), 2):
        first, second = (_as_overlap_cells(*passes[name], size) for name in pair)
        try:
            overlap = find_overlap(first, second, names=pair)
            if overlap is None:
                continue
            path = centre_reference(overlap)
        except TrueTerrainError as error:  # a seam is a diagnostic: the merge goes on without it
            left_out.append(f"no seam of {pair[0]} and {pair[1]}: the overlap {error.problem}")
            continue
        found.append(_seam_agreement(overlap, path, passes, added))
    return found, left_out


def _seam_agreement(
    overlap: Overlap,
    path: ReferencePath,
    passes: Mapping[str, tuple[Integers, PassCells]],
    added: Mapping[str, Floats],
) -> SeamAgreement:
    shared = PairCells(overlap)
    key = coarse.cell_keys(*shared.centres, overlap.cell)
    taken = []
    for name in overlap.names:
        rows, cells = passes[name]
        keys = _cell_keys(cells.cell[rows])
        taken.append(-added[name][rows][np.searchsorted(keys, key)])
    steps = [
        shared.seam(made, path, _STRETCH, _BAND * overlap.cell)
        for made in (np.zeros((2, key.size)), np.stack(taken))
    ]
    return SeamAgreement(names=overlap.names, before=steps[0], after=steps[1])


def _first_visits(cells: PassCells) -> Integers:
    """Rows of the first visit of each cell, ascending by key."""
    order = np.lexsort((cells.time, _cell_keys(cells.cell)))
    _, first = np.unique(_cell_keys(cells.cell)[order], return_index=True)
    return np.asarray(order[first])


def _cell_keys(cell: Integers) -> Integers:
    """Keys of cells in the packing of overlaps."""
    row = ((cell + (1 << 31)) & ((1 << 32) - 1)) - (1 << 31)  # sign-extend the lower 32 bits
    return pack_cell((cell - row) >> 32, row)


def _as_overlap_cells(rows: Integers, cells: PassCells, size: float) -> coarse.OccupiedCells:
    count = cells.count[rows]
    total = np.rint(cells.height[rows] * count / coarse.STEP).astype(np.int64)
    return coarse.OccupiedCells(
        cell=size, key=_cell_keys(cells.cell[rows]), count=count, total=total
    )
