"""Cells around a node that its height is taken from."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.surface.cells import Grid
from trueterrain.surface.settings import GridSettings

_HALO = 6  # rows around a node that its numbers depend on, beside the radius


@dataclass(frozen=True, kw_only=True, eq=False)
class NodeDisc:
    """Cells around a node that its height is taken from."""

    ahead: npt.NDArray[np.int64]
    "Rows from the node."

    left: npt.NDArray[np.int64]
    "Columns from the node."

    weight: npt.NDArray[np.float64]
    "Weight of their returns [1]."


def disc_of(options: GridSettings, grid: Grid) -> NodeDisc | None:
    """Cells whose middle lies in the disc around a node; None for the own cell alone."""
    if not options.radius:
        return None
    steps = grid.spacing
    reach = [int(options.radius / step + 1e-9) for step in steps]
    i, j = np.meshgrid(*(np.arange(-n, n + 1) for n in reach), indexing="ij")
    distance = np.hypot(i * steps[0], j * steps[1])
    inside = distance <= options.radius * (1 + 1e-9)
    # nearer than half a cell is as near as can be told
    weight = np.maximum(distance[inside], 0.5 * min(steps)) ** -options.power
    return NodeDisc(ahead=i[inside], left=j[inside], weight=weight / weight.max())


def halo_of(options: GridSettings, grid: Grid) -> int:
    """Rows to either side of a node that its numbers depend on."""
    disc = disc_of(options, grid)
    return _HALO + (int(np.abs(disc.ahead).max()) if disc else 0)
