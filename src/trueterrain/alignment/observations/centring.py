"""Cells brought to their middle, which all passes share."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.observations.cells import PassCells

Floats = npt.NDArray[np.float64]

#: Easting, northing [m] and heading [rad] of a pass at some times.
Path = Callable[[Floats], tuple[Floats, Floats, Floats]]

_STEP = 0.5  # [s] or [m] over which the speed of a pass is taken, and by which times may change
_SLOW = 1e-3  # [m/s] below which a pass stands


def at_their_middle(cells: PassCells, path: Path, size: float) -> PassCells:
    """Cells with time and offset of their middle, which all lanes share.

    Parameters
    ----------
    cells : LaneCells
        With times of the mean places of their returns.
    path : callable
        Where the pass was at its times.
    size : float
        Size of the cells [m].

    Returns
    -------
    LaneCells
        With the time at which the pass saw the middle of the cell, and ``offset`` and ``ahead`` of
        the middle.

    Notes
    -----
    The returns of two lanes in a cell have different mean places, to which their heights are
    brought along the slope of the ground. Time and offset go along. If they did not, a tilt that
    all lanes share would seem to change what they differ by, and what is left of the slope of the
    ground would be taken for it.
    """
    x, y = ((np.floor(at / size) + 0.5) * size for at in (cells.easting, cells.northing))
    east, north, heading = path(cells.time)
    later = path(cells.time + _STEP)
    speed = np.hypot(later[0] - east, later[1] - north) / _STEP
    cos, sin = np.cos(heading), np.sin(heading)
    along = (x - cells.easting) * cos + (y - cells.northing) * sin
    shift = np.divide(along, speed, out=np.zeros_like(along), where=speed > _SLOW)
    time = cells.time + np.clip(shift, -_STEP, _STEP)
    time = np.clip(time, cells.time.min(), cells.time.max())
    east, north, heading = path(time)
    cos, sin = np.cos(heading), np.sin(heading)
    return replace(
        cells,
        time=time,
        offset=(y - north) * cos - (x - east) * sin,
        ahead=(x - east) * cos + (y - north) * sin,
    )
