"""Surfaces: made from runs or points, where their nodes lie, and their height at any point.

==================  =============================================================================
`line`              reference lines: of a run's own way, through waypoints, straight
`cells`             grids along a line or over a map, and the cells around their nodes
`accumulate`        sums over the returns of each cell, in whole numbers
`grid`, `runs`      from points and from recorded runs to a surface with its standard deviation
`holes`, `coarse`   small holes filled; fewer nodes for smooth terrain, and what is lost
`reference_line`    where nodes lie on the ground, and back
`evaluate`          heights at any point
==================  =============================================================================
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from trueterrain.geometry.grid_frame import GridFrame, grid_frame, uv_to_xy, xy_to_uv
from trueterrain.surface.evaluate import (
    heights_at,
    heights_at_uv,
    node_coordinates,
    surface_to_points,
)

if TYPE_CHECKING:
    from trueterrain.geometry.reference_line import (
        ReferenceLine,
        line_from_trajectory,
        line_through,
        straight_line,
    )
    from trueterrain.surface.accumulate import CellSums
    from trueterrain.surface.cells import Grid, grid_along, grid_over
    from trueterrain.surface.coarse import down_sample
    from trueterrain.surface.grid import GridSettings, grid_points, surface_of
    from trueterrain.surface.holes import HoleSettings, fill_holes
    from trueterrain.surface.runs import PassRecord, grid_runs

# names whose modules need more, and are imported when they are used
_LATER = {
    "CellSums": "accumulate",
    "Filling": "holes",
    "Grid": "cells",
    "GridOptions": "grid",
    "Pass": "runs",
    "ReferenceLine": "line",
    "down_sample": "coarse",
    "fill_holes": "holes",
    "grid_along": "cells",
    "grid_over": "cells",
    "grid_points": "grid",
    "grid_runs": "runs",
    "line_from_trajectory": "line",
    "line_through": "line",
    "straight_line": "line",
    "surface_of": "grid",
}

__all__ = [
    "CellSums",
    "Grid",
    "GridFrame",
    "GridSettings",
    "HoleSettings",
    "PassRecord",
    "ReferenceLine",
    "down_sample",
    "fill_holes",
    "grid_along",
    "grid_frame",
    "grid_over",
    "grid_points",
    "grid_runs",
    "heights_at",
    "heights_at_uv",
    "line_from_trajectory",
    "line_through",
    "node_coordinates",
    "straight_line",
    "surface_of",
    "surface_to_points",
    "uv_to_xy",
    "xy_to_uv",
]


def __getattr__(name: str) -> Any:
    """Name from the module that it lives in."""
    if name not in _LATER:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
