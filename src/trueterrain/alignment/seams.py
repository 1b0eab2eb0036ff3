"""Steps of the merged ground at the edges of overlaps, in the cells that passes are compared by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.reference_path import ReferencePath, centre_reference
from trueterrain.alignment.discontinuity.seam import PairCells, SeamSteps
from trueterrain.alignment.discontinuity.sparse_sums import pack_cell
from trueterrain.alignment.observations import overlap as coarse
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.observations.overlap import Overlap, overlap_of
from trueterrain.core.errors import TrueTerrainError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_STRETCH = 1.0  # [m] of the seam over which a step is averaged
_BAND = 3  # cells beside the edge in which it is looked for


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamAgreement:
    """Steps where one of two passes ends inside the other."""

    lanes: tuple[str, str]
    "Names of the passes."

    before: SeamSteps
    "As measured."

    after: SeamSteps
    "Corrected."


def seams_of(
    cells: Sequence[PassCells], added: Mapping[str, Floats], size: float
) -> tuple[list[SeamAgreement], list[str]]:
    """Steps at the edges of all overlaps.

    Parameters
    ----------
    cells : sequence of LaneCells
        What each pass saw.
    added : mapping of str to numpy.ndarray
        What is added to the heights of each pass, shape (cell,) [m].
    size : float
        Size of the cells [m].

    Returns
    -------
    seams : list of SeamAgreement
        Of the overlaps that a path can follow.
    left_out : list of str
        Of the others: which they are, and why there is no seam, in words.
    """
    lanes = {one.name: (_first_visits(one), one) for one in cells}
    found, left_out = [], []
    for pair in combinations(sorted(lanes), 2):
        first, second = (_as_overlap_cells(*lanes[name], size) for name in pair)
        try:
            overlap = overlap_of(first, second, lanes=pair)
            if overlap is None:
                continue
            path = centre_reference(overlap)
        except TrueTerrainError as error:  # the merging does without
            left_out.append(f"no seam of {pair[0]} and {pair[1]}: the overlap {error.problem}")
            continue
        found.append(_seam_agreement(overlap, path, lanes, added))
    return found, left_out


def _seam_agreement(
    overlap: Overlap,
    path: ReferencePath,
    lanes: Mapping[str, tuple[Integers, PassCells]],
    added: Mapping[str, Floats],
) -> SeamAgreement:
    shared = PairCells(overlap)
    key = coarse.cell_keys(*shared.centres, overlap.cell)
    taken = []
    for name in overlap.lanes:
        rows, lane = lanes[name]
        keys = _cell_keys(lane.cell[rows])
        taken.append(-added[name][rows][np.searchsorted(keys, key)])
    steps = [
        shared.seam(made, path, _STRETCH, _BAND * overlap.cell)
        for made in (np.zeros((2, key.size)), np.stack(taken))
    ]
    return SeamAgreement(lanes=overlap.lanes, before=steps[0], after=steps[1])


def _first_visits(lane: PassCells) -> Integers:
    """Rows of a pass with each cell once, at its first visit, ascending by their keys."""
    order = np.lexsort((lane.time, _cell_keys(lane.cell)))
    _, first = np.unique(_cell_keys(lane.cell)[order], return_index=True)
    return np.asarray(order[first])


def _cell_keys(cell: Integers) -> Integers:
    """Numbers of cells as overlaps have them."""
    row = ((cell + (1 << 31)) & ((1 << 32) - 1)) - (1 << 31)  # the lower half, with its sign
    return pack_cell((cell - row) >> 32, row)


def _as_overlap_cells(rows: Integers, lane: PassCells, size: float) -> coarse.OccupiedCells:
    count = lane.count[rows]
    total = np.rint(lane.height[rows] * count / coarse.STEP).astype(np.int64)
    return coarse.OccupiedCells(
        cell=size, key=_cell_keys(lane.cell[rows]), count=count, total=total
    )
