"""Surfaces: gridding of runs and points, where nodes lie, heights at any point.

====================  ===========================================================================
`cells`               grids along a line or over a map, and the cells around their nodes
`placement`           where the nodes of a surface lie: along a run, a line, a path, or over a map
`accumulate`          sums over the returns of each cell, as integers
`grid`, `runs`        from points and from recorded runs to a surface with standard deviations
`holes`, `coarse`     interpolation over small holes; coarser grids for smooth terrain
`difference`          difference of two surfaces
`evaluate`            heights at any point
====================  ===========================================================================
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
    from trueterrain.surface.grid import grid_points, surface_of, trim_surface
    from trueterrain.surface.holes import HoleSettings, fill_holes
    from trueterrain.surface.pass_record import PassRecord
    from trueterrain.surface.placement import GridPlacement
    from trueterrain.surface.runs import grid_runs
    from trueterrain.surface.settings import GridSettings

# modules that import numba or scipy; they are imported when one of their names is first used
_MODULES = {
    "geometry.reference_line": (
        "ReferenceLine",
        "line_from_trajectory",
        "line_through",
        "straight_line",
    ),
    "surface.accumulate": ("CellSums",),
    "surface.cells": ("Grid", "grid_along", "grid_over"),
    "surface.coarse": ("down_sample",),
    "surface.grid": ("grid_points", "surface_of", "trim_surface"),
    "surface.holes": ("HoleSettings", "fill_holes"),
    "surface.pass_record": ("PassRecord",),
    "surface.placement": ("GridPlacement",),
    "surface.runs": ("grid_runs",),
    "surface.settings": ("GridSettings",),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "CellSums",
    "Grid",
    "GridFrame",
    "GridPlacement",
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
    "trim_surface",
    "uv_to_xy",
    "xy_to_uv",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    return getattr(import_module(f"trueterrain.{_MODULE_OF[name]}"), name)
