"""Heights inside the search areas of a path: of gridded surfaces and of scattered points.

On a grid the search proceeds along the rows, from the cell in which a path point lies. A search
area that reaches the edge of the surface may hold nodes that this search does not find: those of
the far end of a closed loop, or all of them if the path point lies outside. There the nodes are
searched as scattered points, so that a surface and its nodes always give the same heights.

For scattered points the path is indexed rather than the points: the cells that its search areas
touch are numbered, then the points are read block by block, and only those that fall into such a
cell are kept. Memory holds the neighbourhood of the path, never the survey.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.row_blocks import load_heights, stored_rows
from trueterrain.geometry.curve import PlaneCurve
from trueterrain.geometry.grid_frame import GridFrame, grid_frame, xy_to_uv
from trueterrain.profile.area import EDGE_TOLERANCE, SearchArea, area_reach
from trueterrain.profile.distribution import HeightDistributions
from trueterrain.profile.search import _kernels
from trueterrain.profile.search._kernels import (
    find_cells,
    gather_grid,
    gather_scattered,
    number_cells,
    sort_into_cells,
)

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

#: Writes the counted heights: called with (start, dx, dy, z), one slice per path point.
Fill = Callable[..., object]

#: Counts the heights of each path point, and returns a function that writes them.
Gatherer = Callable[[PlaneCurve], tuple[Integer, Fill]]

#: Start and outputs of a kernel that only counts.
COUNT_ONLY: tuple[Integer, Float, Float, Float] = (
    np.zeros(1, np.int64),
    np.empty(0),
    np.empty(0),
    np.empty(0),
)

#: Residuals below this have equal weight in the robust plane [m]: far below any scanner's noise.
_LEVEL_STEP = 1e-7
_LEVEL_TOLERANCE = 1e-12
_LEVEL_ITERATIONS = 50

_ROWS = 256  # cross-sections searched as scattered points at a time
_COARSE = 1024  # cells per axis of the coarse mask at most: a byte each, so that it fits in caches
_BLOCK = 1 << 22  # points filtered at a time


def distributions_along(
    gather: Gatherer, path: PlaneCurve, *, level: bool = False
) -> HeightDistributions:
    """Gather, level if asked, and sort the heights of each path point.

    Parameters
    ----------
    gather : Gatherer
        From `grid_gatherer` or `ScatteredHeights.gatherer`.
    path : PlaneCurve
        Path points.
    level : bool
        Whether to subtract the slope of the ground inside each search area.

    Returns
    -------
    HeightDistributions
        One distribution per path point.
    """
    counts, fill = gather(path)
    start = np.concatenate([[0], np.cumsum(counts)])
    dx, dy, heights, distances = (np.empty(start[-1]) for _ in range(4))
    if start[-1]:
        fill(start, dx, dy, heights)
        if level:
            settings = _LEVEL_STEP, _LEVEL_TOLERANCE, _LEVEL_ITERATIONS
            _kernels.level_areas(start, dx, dy, heights, *settings)
        _kernels.sort_heights(start, dx, dy, heights, distances)
    return HeightDistributions(start=start, heights=heights, distances=distances)


def kernel_area(area: SearchArea) -> tuple[int, Float, float]:
    """Shape, half axes and reach of a search area, as the kernels take them."""
    return int(area.shape), np.array(area.half_axes) + EDGE_TOLERANCE, area_reach(area)


def path_arrays(path: PlaneCurve) -> tuple[Float, Float]:
    """Positions (s, 2) and headings (s,) of a path, as the kernels take them."""
    return np.stack([path.easting, path.northing], axis=1), np.ascontiguousarray(path.heading)


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
    frame = grid_frame(surface)
    _, *lines = frame.sections
    origin, normal = np.stack(lines[:2], axis=1), np.stack(lines[2:], axis=1)
    dims = ("u", "v") if "u" in surface.dims else ("easting", "northing")
    load = _row_loader(surface, dims)

    def gather(path: PlaneCurve) -> tuple[Integer, Fill]:
        u, _ = xy_to_uv(frame, path.easting, path.northing)
        row = np.searchsorted(frame.u, u, side="right") - 1
        row = np.where(np.isnan(u), -1, np.clip(row, 0, frame.u.size - 2))
        at, heading = path_arrays(path)
        rows = _reached_rows(origin, normal, at, row, area_reach(area))
        height = load(rows)

        def gather_rows(start: Integer, *output: Float) -> tuple[Integer, npt.NDArray[np.bool_]]:
            own = np.where(row < 0, -1, row - rows.start)
            grid = origin[rows], normal[rows], frame.v, height, at, own, heading
            counts, at_edge = gather_grid(*grid, *kernel_area(area), start, *output)
            return counts, at_edge

        counts, at_edge = gather_rows(*COUNT_ONLY)
        edge = np.flatnonzero(at_edge)
        if edge.size == 0:
            return counts, gather_rows
        counts[edge], fill_edge = _search_scattered(frame, load, path, edge, area)

        def fill(start: Integer, *output: Float) -> None:
            gather_rows(start, *output)
            fill_edge(start[edge], *output)

        return counts, fill

    return gather


def _row_loader(surface: xr.Dataset, dims: tuple[str, str]) -> Callable[[slice], Float]:
    """Heights of some rows; of a surface along a line on disk only these are read."""
    if "u" in surface.dims and stored_rows(surface) is not None:
        return lambda rows: np.ascontiguousarray(load_heights(surface, rows))
    whole = np.ascontiguousarray(surface.height.transpose(*dims), dtype=float)
    return lambda rows: whole[rows]


def _reached_rows(origin: Float, normal: Float, at: Float, row: Integer, reach: float) -> slice:
    """Rows in which the search of some path points ends: the first and the last are out of reach.

    So a search finds the same nodes as among all rows, and the edges of these rows count as edges
    of the surface only where they are.
    """
    known = row >= 0
    if not known.any():
        return slice(0, 2)
    low, high, margin = int(row[known].min()), int(row[known].max()) + 2, 8
    while True:
        rows = slice(max(low - margin, 0), min(high + margin, len(origin)))
        ends = [i for i in (rows.start, rows.stop - 1) if 0 < i < len(origin) - 1]
        away = at[known, None] - origin[ends]
        across = away[..., 0] * normal[ends, 1] - away[..., 1] * normal[ends, 0]
        if (np.abs(across) > reach * np.hypot(*normal[ends].T)).all():
            return rows
        margin *= 2


def _search_scattered(
    frame: GridFrame,
    load: Callable[[slice], Float],
    path: PlaneCurve,
    some: Integer,
    area: SearchArea,
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
            scattered.add_heights(easting.ravel(), northing.ravel(), load(cut).ravel())
    return scattered.gatherer()(some_path)


class ScatteredHeights:
    """Points near a path, sorted into the cells that the search areas touch.

    Parameters
    ----------
    path : PlaneCurve
        Path points.
    area : Disc, Ellipse or Rectangle
        Search area.
    """

    def __init__(self, path: PlaneCurve, area: SearchArea) -> None:
        self._area = area
        self._reach = area_reach(area)
        cell = 2.001 * self._reach  # a search area then touches at most four cells
        at, _ = path_arrays(path)
        margin = self._reach + cell  # so that no cell number is negative
        self._low = at.min(axis=0) - margin
        shape = np.ceil((at.max(axis=0) + margin - self._low) / cell).astype(np.int64)
        self._columns = int(shape[0])
        self._high = shape * cell
        self._per_metre = 1 / cell
        self._coarse_shape = np.minimum(shape, _COARSE)
        self._coarse_scale = self._coarse_shape / shape

        max_cells = 4 * len(at)
        size = 1 << int(2 * max_cells - 1).bit_length()  # at most half full: short probes
        self._keys = np.full(size, -1, np.int64)
        self._numbers = np.empty(size, np.int32)
        column, row = np.empty(max_cells, np.int64), np.empty(max_cells, np.int64)
        self._cell_count = number_cells(
            column,
            row,
            self._columns,
            self._per_metre,
            self._reach,
            at,
            self._low,
            self._keys,
            self._numbers,
        )
        self._coarse = self._coarse_mask(column[: self._cell_count], row[: self._cell_count])
        self._kept: list[tuple[npt.NDArray[np.int32], Float]] = []

    def add(self, points: xr.Dataset) -> None:
        """Keep those points that are near the path; points without a height are left out.

        Parameters
        ----------
        points : xarray.Dataset
            Points, or a block of them.
        """
        self.add_heights(*(np.asarray(points[name]) for name in ("easting", "northing", "up")))

    def add_heights(self, easting: Float, northing: Float, up: Float) -> None:
        """Keep those heights that are near the path; those not finite are left out.

        Parameters
        ----------
        easting, northing, up : numpy.ndarray, shape (point,)
            Coordinates [m].
        """
        columns = tuple(np.ascontiguousarray(c, dtype=float) for c in (easting, northing, up))
        for begin in range(0, columns[0].size, _BLOCK):
            block = tuple(column[begin : begin + _BLOCK] for column in columns)
            cell = find_cells(
                *block,
                self._low,
                self._high,
                self._columns,
                self._per_metre,
                self._coarse,
                self._coarse_scale,
                self._keys,
                self._numbers,
            )
            near = np.flatnonzero(cell >= 0)
            self._kept.append((cell[near], np.stack([column[near] for column in block], axis=1)))

    def gatherer(self) -> Gatherer:
        """Sort the kept points and return the function that gathers for a part of the path.

        Returns
        -------
        Gatherer
            Gathers for the path given at the start, or a part of it.
        """
        cell = np.concatenate([np.empty(0, np.int32), *(cell for cell, _ in self._kept)])
        points = np.concatenate([np.empty((0, 3)), *(points for _, points in self._kept)])
        begin, order = sort_into_cells(cell, self._cell_count)
        points = points[order]

        def gather(path: PlaneCurve) -> tuple[Integer, Fill]:
            at, heading = path_arrays(path)

            def run(start: Integer, *output: Float) -> Integer:
                counts = gather_scattered(
                    points,
                    begin,
                    self._low,
                    self._columns,
                    self._per_metre,
                    self._keys,
                    self._numbers,
                    at,
                    heading,
                    *kernel_area(self._area),
                    start,
                    *output,
                )
                return np.asarray(counts)

            return run(*COUNT_ONLY), run

        return gather

    def _coarse_mask(
        self, column: npt.NDArray[np.int64], row: npt.NDArray[np.int64]
    ) -> npt.NDArray[np.bool_]:
        """Mask of the coarse cells in which the numbered cells lie."""
        columns, rows = self._coarse_shape + 1  # one more: round-off at the far edge
        coarse = np.zeros((rows, columns), bool)
        # the same arithmetic as in `find_cells`, so that round-off is the same
        coarse[
            (row * self._coarse_scale[1]).astype(int), (column * self._coarse_scale[0]).astype(int)
        ] = True
        return coarse
