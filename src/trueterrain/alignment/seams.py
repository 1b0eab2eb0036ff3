"""Steps of the merged ground at the edges of overlaps, from the cells of the passes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.centre_line import centre_reference
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.discontinuity.seam import PairCells, SeamSteps
from trueterrain.alignment.observations import overlap as coarse
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.observations.overlap import Overlap, find_overlap
from trueterrain.alignment.observations.sparse_sums import pack_cell
from trueterrain.core.errors import TrueTerrainError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_STRETCH = 1.0  # [m] length along the seam over which a step is averaged
_BAND = 3  # cells from the edge within which a step is measured


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
