"""Stations along a pass, which replace missing times of points."""

import numpy as np

from trueterrain.alignment.clouds.passes import CloudPass
from trueterrain.alignment.discontinuity.centre_line import centre_reference
from trueterrain.alignment.discontinuity.reference_path import ReferencePath, straight_reference
from trueterrain.alignment.observations import overlap as coarse
from trueterrain.alignment.observations.overlap import Overlap
from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError

_FULL = 0.5  # fraction of the bounding rectangle that a straight pass covers
_PARTS = 20  # minimum number of reference points along a pass
_SPACING = 1.0  # [m] of the reference points


def station_path(cloud: CloudPass, settings: CellSettings) -> ReferencePath:
    """Path along the centre of a pass.

    Parameters
    ----------
    cloud : CloudPass
        The pass, whose points are read.
    settings : CellSettings
        Size of the cells from which the path is found.

    Returns
    -------
    ReferencePath
        Straight along the principal axis if the pass covers half of its bounding rectangle, else
        along its centre line, curved or closed.
    """
    cells = coarse.occupied_cells(cloud.heights, settings.size, name=cloud.name)
    straight, fraction = _principal_axis(cells)
    if fraction >= _FULL:
        return straight
    whole = Overlap(names=(cloud.name, cloud.name), cells=(cells, cells), key=cells.covered)
    try:
        spacing = straight.curve.spacing
        return centre_reference(whole, spacing=spacing, smoothing=10 * spacing)
    except CoverageError:
        return straight  # scattered pieces have no centre line


def _principal_axis(cells: coarse.OccupiedCells) -> tuple[ReferencePath, float]:
    """Line along the principal axis of cells, and the covered fraction of their rectangle."""
    places = np.stack(coarse.cell_centres(cells.key, cells.cell))
    mean = places.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh((places - mean) @ (places - mean).T)
    axis = axes[:, 1] * (1.0 if tuple(axes[:, 1]) > (0.0, 0.0) else -1.0)
    u = axis @ (places - mean)
    v = np.array([-axis[1], axis[0]]) @ (places - mean)
    begin, end = float(u.min()) - cells.cell, float(u.max()) + cells.cell
    start, stop = (tuple((mean[:, 0] + at * axis).tolist()) for at in (begin, end))
    spacing = min(_SPACING, (end - begin) / _PARTS)
    box = (end - begin - cells.cell) * (float(np.ptp(v)) + cells.cell)
    return straight_reference(start, stop, spacing=spacing), cells.key.size * cells.cell**2 / box
