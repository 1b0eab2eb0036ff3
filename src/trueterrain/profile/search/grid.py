"""Heights of a gridded surface inside search areas.

From the cell in which a path point lies, the search proceeds along the rows of the grid. A search
area that reaches the edge of the surface may hold nodes that this search does not find: those of
the far end of a closed loop, or all of them if the path point lies outside. There the nodes are
searched as scattered points, so that a surface and its nodes always give the same heights.
"""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.geometry.curve import PlaneCurve
from trueterrain.geometry.grid_frame import GridFrame, grid_frame, xy_to_uv
from trueterrain.profile.area import SearchArea, area_reach
from trueterrain.profile.search.gather import COUNT_ONLY, Fill, Gatherer, kernel_area, path_arrays
from trueterrain.profile.search.scattered import ScatteredHeights

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

_ROWS = 256  # cross-sections searched as scattered points at a time


def grid_gatherer(surface: xr.Dataset, area: SearchArea) -> Gatherer:
    """Prepare a surface for gathering the nodes inside search areas.

    Distances are measured on the ground, not in (u, v): on a bend the nodes of the inner side lie
    closer together than those of the outer one.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface, along a reference line or a map.
    area : Disc, Ellipse or Rectangle
        Search area.

    Returns
    -------
    Gatherer
        Function that gathers for a part of a path.
    """
    from trueterrain.profile.search._kernels import gather_grid

    frame = grid_frame(surface)
    _, *lines = frame.sections
    origin, normal = np.stack(lines[:2], axis=1), np.stack(lines[2:], axis=1)
    dims = ("u", "v") if "u" in surface.dims else ("easting", "northing")
    height = np.ascontiguousarray(surface.height.transpose(*dims), dtype=float)

    def gather(path: PlaneCurve) -> tuple[Integer, Fill]:
        u, _ = xy_to_uv(frame, path.easting, path.northing)
        row = np.searchsorted(frame.u, u, side="right") - 1
        row = np.where(np.isnan(u), -1, np.clip(row, 0, frame.u.size - 2))
        at, heading = path_arrays(path)

        def gather_rows(start: Integer, *output: Float) -> tuple[Integer, npt.NDArray[np.bool_]]:
            grid = origin, normal, frame.v, height, at, row, heading
            counts, at_edge = gather_grid(*grid, *kernel_area(area), start, *output)
            return counts, at_edge

        counts, at_edge = gather_rows(*COUNT_ONLY)
        edge = np.flatnonzero(at_edge)
        if edge.size == 0:
            return counts, gather_rows
        counts[edge], fill_edge = _search_scattered(frame, height, path, edge, area)

        def fill(start: Integer, *output: Float) -> None:
            gather_rows(start, *output)
            fill_edge(start[edge], *output)

        return counts, fill

    return gather


def _search_scattered(
    frame: GridFrame, height: Float, path: PlaneCurve, some: Integer, area: SearchArea
) -> tuple[Integer, Fill]:
    """Gather the nodes in some search areas by searching them as scattered points."""
    some_path = path[some]
    scattered = ScatteredHeights(some_path, area)
    at, _ = path_arrays(some_path)
    for begin in range(0, frame.u.size, _ROWS):
        cut = slice(begin, begin + _ROWS)
        easting, northing = frame.nodes(cut)
        ends = np.stack([easting[:, [0, -1]].ravel(), northing[:, [0, -1]].ravel()], axis=1)
        low, high = ends.min(axis=0) - area_reach(area), ends.max(axis=0) + area_reach(area)
        if ((at >= low) & (at <= high)).all(axis=1).any():
            scattered.add_heights(easting.ravel(), northing.ravel(), height[cut].ravel())
    return scattered.gatherer()(some_path)
