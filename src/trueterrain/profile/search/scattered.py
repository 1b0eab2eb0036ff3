"""Heights of scattered points inside search areas.

The path is indexed rather than the points: the cells that its search areas touch are numbered, then
the points are read block by block, and only those that fall into such a cell are kept. Memory holds
the neighbourhood of the path, never the survey.
"""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.geometry.curve import PlaneCurve
from trueterrain.profile.area import SearchArea, area_reach
from trueterrain.profile.search.gather import COUNT_ONLY, Fill, Gatherer, kernel_area, path_arrays

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

_COARSE = 1024  # cells per axis of the coarse mask at most: a byte each, so that it fits in caches
_BLOCK = 1 << 22  # points filtered at a time


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
        from trueterrain.profile.search._kernels import number_cells

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
        from trueterrain.profile.search._kernels import find_cells

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
        from trueterrain.profile.search._kernels import gather_scattered, sort_into_cells

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
