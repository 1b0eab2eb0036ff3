"""Steps of the merged ground at the edges of overlaps, in the cells that passes are compared by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from trueterrain.errors import CoverageError
from trueterrain.lanes import overlap as coarse
from trueterrain.lanes._discontinuity_seam import Seam, SharedCells
from trueterrain.lanes._discontinuity_sparse import pack
from trueterrain.lanes.cells import LaneCells
from trueterrain.lanes.overlap import Overlap, overlap_of
from trueterrain.lanes.reference_path import centre_reference

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_STRETCH = 1.0  # [m] of the seam over which a step is averaged
_BAND = 3  # cells beside the edge in which it is looked for


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamAgreement:
    """Steps where one of two passes ends inside the other."""

    lanes: tuple[str, str]
    "Names of the passes."

    before: Seam
    "As measured."

    after: Seam
    "Corrected."


def seams_of(
    cells: Sequence[LaneCells], added: Mapping[str, Floats], size: float
) -> list[SeamAgreement]:
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
    list of SeamAgreement
        Of the overlaps that have a length.
    """
    lanes = {one.name: (_once(one), one) for one in cells}
    found = []
    for pair in combinations(sorted(lanes), 2):
        first, second = (_as_overlap_cells(*lanes[name], size) for name in pair)
        overlap = overlap_of(first, second, lanes=pair)
        seam = _seam(overlap, lanes, added) if overlap else None
        if seam is not None:
            found.append(seam)
    return found


def _seam(
    overlap: Overlap, lanes: Mapping[str, tuple[Integers, LaneCells]], added: Mapping[str, Floats]
) -> SeamAgreement | None:
    try:
        path = centre_reference(overlap)
    except CoverageError:
        return None  # an overlap of a few cells has no edges
    shared = SharedCells(overlap)
    key = coarse.cell_keys(*shared.centres, overlap.cell)
    taken = []
    for name in overlap.lanes:
        rows, lane = lanes[name]
        keys = _keys(lane.cell[rows])
        taken.append(-added[name][rows][np.searchsorted(keys, key)])
    steps = [
        shared.seam(made, path, _STRETCH, _BAND * overlap.cell)
        for made in (np.zeros((2, key.size)), np.stack(taken))
    ]
    return SeamAgreement(lanes=overlap.lanes, before=steps[0], after=steps[1])


def _once(lane: LaneCells) -> Integers:
    """Rows of a pass with each cell once, at its first visit, ascending by their keys."""
    order = np.lexsort((lane.time, _keys(lane.cell)))
    _, first = np.unique(_keys(lane.cell)[order], return_index=True)
    return np.asarray(order[first])


def _keys(cell: Integers) -> Integers:
    """Numbers of cells as overlaps have them."""
    row = ((cell + (1 << 31)) & ((1 << 32) - 1)) - (1 << 31)  # the lower half, with its sign
    return pack((cell - row) >> 32, row)


def _as_overlap_cells(rows: Integers, lane: LaneCells, size: float) -> coarse.OccupiedCells:
    count = lane.count[rows]
    total = np.rint(lane.height[rows] * count / coarse.STEP).astype(np.int64)
    return coarse.OccupiedCells(cell=size, key=_keys(lane.cell[rows]), count=count, total=total)
