"""Search disc of a node."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.surface.cells import Grid
from trueterrain.surface.settings import GridSettings

_HALO = 6  # rows around a node that its numbers depend on, beside the radius


@dataclass(frozen=True, kw_only=True, eq=False)
class NodeDisc:
    """Cells of the disc around a node from which its height is computed."""

    step_u: npt.NDArray[np.int64]
    "Rows from the node."

    step_v: npt.NDArray[np.int64]
    "Columns from the node."

    weight: npt.NDArray[np.float64]
    "Weight of their returns [1]."


def disc_of(options: GridSettings, grid: Grid) -> NodeDisc | None:
    """Cells whose centre lies in the disc around a node; None for its own cell alone."""
    if not options.radius:
        return None
    steps = grid.spacing
    reach = [int(options.radius / step + 1e-9) for step in steps]
    i, j = np.meshgrid(*(np.arange(-n, n + 1) for n in reach), indexing="ij")
    distance = np.hypot(i * steps[0], j * steps[1])
    inside = distance <= options.radius * (1 + 1e-9)
    # positions are known to half a cell, so no distance counts as less than that
    weight = np.maximum(distance[inside], 0.5 * min(steps)) ** -options.power
    return NodeDisc(step_u=i[inside], step_v=j[inside], weight=weight / weight.max())


def halo_of(options: GridSettings, grid: Grid) -> int:
    """Rows to either side of a node that its numbers depend on."""
    disc = disc_of(options, grid)
    return _HALO + (int(np.abs(disc.step_u).max()) if disc else 0)
