"""Surfaces: their reference line, where their nodes lie, and their height at any point."""

from trueterrain.surface.evaluate import (
    heights_at,
    heights_at_uv,
    node_coordinates,
    surface_to_points,
)
from trueterrain.surface.reference_line import GridFrame, grid_frame, uv_to_xy, xy_to_uv

__all__ = [
    "GridFrame",
    "grid_frame",
    "heights_at",
    "heights_at_uv",
    "node_coordinates",
    "surface_to_points",
    "uv_to_xy",
    "xy_to_uv",
]
