"""Stations along a lane: what stands for the time of points that have none."""

import numpy as np

from trueterrain.alignment.clouds.passes import CloudPass
from trueterrain.alignment.discontinuity.reference_path import (
    ReferencePath,
    centre_reference,
    straight_reference,
)
from trueterrain.alignment.observations import overlap as coarse
from trueterrain.alignment.observations.overlap import Overlap
from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError

_FULL = 0.5  # share of the rectangle around it that a straight lane fills
_PARTS = 20  # reference points along a lane, at least
_SPACING = 1.0  # [m] of the reference points


def station_path(lane: CloudPass, options: CellSettings) -> ReferencePath:
    """Path along the middle of a lane.

    Parameters
    ----------
    lane : CloudLane
        The lane; its points are read.
    options : CellOptions
        Size of the cells in which it is looked for.

    Returns
    -------
    ReferencePath
        Straight along its principal axis if it fills half of the rectangle around it, else along
        its middle, curved or closed.
    """
    cells = coarse.occupied_cells(lane.heights, options.size, name=lane.name)
    straight, share = _principal_axis(cells)
    if share >= _FULL:
        return straight
    whole = Overlap(lanes=(lane.name, lane.name), cells=(cells, cells), key=cells.covered)
    try:
        return centre_reference(whole, spacing=straight.spacing, smoothing=10 * straight.spacing)
    except CoverageError:
        return straight  # scattered pieces have no middle


def _principal_axis(cells: coarse.OccupiedCells) -> tuple[ReferencePath, float]:
    """Line along the principal axis of some cells, and their share of the rectangle around it."""
    places = np.stack(coarse.cell_centres(cells.key, cells.cell))
    middle = places.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh((places - middle) @ (places - middle).T)
    ahead = axes[:, 1] * (1.0 if tuple(axes[:, 1]) > (0.0, 0.0) else -1.0)
    u = ahead @ (places - middle)
    v = np.array([-ahead[1], ahead[0]]) @ (places - middle)
    begin, end = float(u.min()) - cells.cell, float(u.max()) + cells.cell
    start, stop = (tuple((middle[:, 0] + at * ahead).tolist()) for at in (begin, end))
    spacing = min(_SPACING, (end - begin) / _PARTS)
    box = (end - begin - cells.cell) * (float(np.ptp(v)) + cells.cell)
    return straight_reference(start, stop, spacing=spacing), cells.key.size * cells.cell**2 / box
