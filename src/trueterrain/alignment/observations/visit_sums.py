"""Points into the cells that passes are compared by: whole-number sums, then planes."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.observations.centring import Path
from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError, SchemaError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_STEP = 1e-5  # [m] of heights
_TIME_STEP = 1e-6  # [s] or [m]
_PARTS = 65536  # of the side of a cell
_FLAT = 3.0  # returns on level ground that a plane is fitted with beside its own
_PATH_STEP = 1.0  # [s] or [m] over which returns tell where a pass was
_PATH_STEPS = 20  # at least
_COLUMNS = 13


class VisitSums:
    """Sums over the points of one pass, cell by cell and visit by visit.

    Parameters
    ----------
    options : CellOptions
        Size of the cells.

    Notes
    -----
    All sums are whole numbers, so cells do not depend on the order of the points or on how they
    came in blocks.
    """

    def __init__(self, options: CellSettings) -> None:
        self.options = options
        self._used = 0
        self._keys, self._sums = np.zeros((0, 2), np.int64), np.zeros((0, _COLUMNS), np.int64)
        self._table = np.zeros(0, np.int64)
        self._room(1 << 12)

    def add(self, easting: Floats, northing: Floats, up: Floats, time: Floats) -> None:
        """Add points.

        Parameters
        ----------
        easting, northing, up : numpy.ndarray, shape (point,)
            Coordinates [m].
        time : numpy.ndarray, shape (point,)
            Times [s], or stations [m].

        Raises
        ------
        SchemaError
            If one is not finite.
        """
        columns = [np.asarray(one, dtype=np.float64) for one in (easting, northing, up, time)]
        for name, values in zip(("easting", "northing", "up", "time"), columns, strict=True):
            if not np.isfinite(values).all():
                place = int(np.argmin(np.isfinite(values)))
                raise SchemaError("must be finite", place=f"variable {name}, point {place}")
        done = 0
        while done < columns[0].size:
            added, self._used = _kernels.add_points(
                *(values[done:] for values in columns),
                self.options.size,
                1.0 / _STEP,
                1.0 / _TIME_STEP,
                _PARTS,
                0.5 * self.options.visit_gap,
                self._keys,
                self._sums,
                self._table,
                self._used,
            )
            done += added
            if done < columns[0].size:
                self._room(2 * self._table.size)

    def _room(self, size: int) -> None:
        keys, sums = np.zeros((size // 2, 2), np.int64), np.zeros((size // 2, _COLUMNS), np.int64)
        keys[: self._used] = self._keys[: self._used]
        sums[: self._used] = self._sums[: self._used]
        self._keys, self._sums = keys, sums
        self._table = np.full(size, -1, np.int64)
        _kernels.rehash_keys(keys, self._used, self._table)

    def cells(self, name: str, path: Path | None = None, **navigation: Floats) -> PassCells:
        """Cells of the pass.

        Parameters
        ----------
        name : str
            Name of the pass.
        path : callable, optional
            Easting, northing and heading of the pass at some times; by default what the mean
            places of the returns tell.
        **navigation : numpy.ndarray
            ``sd_time`` and ``sd_height``, if the navigation says them.

        Returns
        -------
        LaneCells
            Of all cells with enough returns that are even enough.

        Raises
        ------
        CoverageError
            If there is none.
        """
        order = np.lexsort(self._keys[: self._used].T[::-1])
        keys, sums = self._keys[order], self._sums[order]
        left = _kernels.join_visits(keys, sums, round(self.options.visit_gap / _TIME_STEP))
        enough = np.flatnonzero(sums[:left, 0] >= self.options.min_count)
        found = _fit_cell_planes(keys[enough, 0], sums[enough], self.options.size)
        if path is None and enough.size:
            path = _path_of(found)
        even = np.flatnonzero(found["scatter"] <= self.options.max_sd**2)
        if not even.size:
            raise CoverageError(
                f"{name} has no cell of {self.options.size:g} m with "
                f"{self.options.min_count} returns that scatter by less than "
                f"{self.options.max_sd * 1e3:g} mm",
                cure="Choose larger cells, or allow more scatter.",
            )
        assert path is not None
        columns = {key: values[even] for key, values in found.items()}
        columns["variance"] = columns.pop("scatter") / columns["count"]
        x, y, heading = path(columns["time"])
        east, north = columns["easting"] - x, columns["northing"] - y
        return PassCells(
            name=name,
            cell=keys[enough[even], 0],
            count=columns.pop("count").astype(np.int64),
            offset=north * np.cos(heading) - east * np.sin(heading),
            ahead=east * np.cos(heading) + north * np.sin(heading),
            **columns,
            **navigation,
        )


def _fit_cell_planes(cell: Integers, sums: Integers, size: float) -> dict[str, Floats]:
    """Mean place, time and height of cells, their slopes, and the scatter about their planes."""
    count = sums[:, 0]
    n = count.astype(np.float64)
    with np.errstate(over="ignore"):
        mean_x, mean_y = sums[:, 1] / n, sums[:, 2] / n
        base = sums[:, 3] // np.maximum(count, 1)
        rest = sums[:, 3] - count * base
        # right modulo 2^64, and small
        square = (sums[:, 10] - 2 * base * sums[:, 3] + count * base * base).astype(np.float64)
        xz = (sums[:, 8] - base * sums[:, 1]).astype(np.float64)
        yz = (sums[:, 9] - base * sums[:, 2]).astype(np.float64)
        later = sums[:, 4] - count * sums[:, 11]
    zz = square - rest * (rest / n)
    xz, yz = xz - rest * mean_x, yz - rest * mean_y
    flat = _FLAT * _PARTS**2 / 12.0
    xx = sums[:, 5] - n * mean_x**2 + flat
    yy = sums[:, 7] - n * mean_y**2 + flat
    xy = sums[:, 6] - n * mean_x * mean_y
    determinant = xx * yy - xy * xy
    slope_x = (yy * xz - xy * yz) / determinant
    slope_y = (xx * yz - xy * xz) / determinant
    left = zz - 2.0 * (slope_x * xz + slope_y * yz)
    left += slope_x**2 * (xx - flat) + 2.0 * slope_x * slope_y * xy + slope_y**2 * (yy - flat)
    free = np.maximum(n - 1.0 - 2.0 * n / (n + _FLAT), 1.0)
    column, row = cell >> 32, cell & 0xFFFFFFFF
    row = np.where(row >= 1 << 31, row - (1 << 32), row)
    column = column + (row < 0)  # a negative row borrowed one
    return {
        "count": n,
        "time": (sums[:, 11] + later / n) * _TIME_STEP,
        "easting": (column + 0.5 + mean_x / _PARTS) * size,
        "northing": (row + 0.5 + mean_y / _PARTS) * size,
        "height": (base + rest / n) * _STEP,
        "slope_east": slope_x * (_STEP * _PARTS / size),
        "slope_north": slope_y * (_STEP * _PARTS / size),
        "scatter": np.maximum(left / free, 1.0 / 12.0) * _STEP**2,
    }


def _path_of(found: dict[str, Floats]) -> Path:
    """Where a pass was, by the mean places of its returns."""
    time = found["time"]
    begin, span = time.min(), max(float(np.ptp(time)), 1e-9)
    steps = max(_PATH_STEPS, int(np.ceil(span / _PATH_STEP)))
    step = np.minimum(((time - begin) / span * steps).astype(np.int64), steps - 1)
    count = np.bincount(step, found["count"], steps)
    there = count > 0
    at, x, y = (
        (np.bincount(step, found["count"] * found[name], steps)[there] / count[there])
        for name in ("time", "easting", "northing")
    )
    if at.size < 2:
        return lambda when: (np.full(when.size, x[0]), np.full(when.size, y[0]), 0.0 * when)
    east, north = np.gradient(_moving_mean(x), at), np.gradient(_moving_mean(y), at)
    east, north = _moving_mean(east), _moving_mean(north)

    def path(when: Floats) -> tuple[Floats, Floats, Floats]:
        heading = np.arctan2(np.interp(when, at, north), np.interp(when, at, east))
        return np.interp(when, at, x), np.interp(when, at, y), heading

    return path


def _moving_mean(values: Floats) -> Floats:
    """Mean of five neighbours, of fewer at the ends."""
    box = np.ones(min(5, values.size - 1 + values.size % 2))
    return np.convolve(values, box, "same") / np.convolve(np.ones(values.size), box, "same")


def collect_cell_sums(
    points: xr.Dataset | Iterable[xr.Dataset], options: CellSettings
) -> dict[int, VisitSums]:
    """Sums of the points of each lane.

    Parameters
    ----------
    points : xarray.Dataset or iterable of xarray.Dataset
        Points with ``time``, in one dataset or in blocks; those without ``lane`` are of lane 0.
    options : CellOptions
        Size of the cells.

    Returns
    -------
    dict of int to CellSums
        By the number of the lane, ascending.

    Raises
    ------
    SchemaError
        If there is no time.
    """
    found: dict[int, VisitSums] = {}
    for block in [points] if isinstance(points, xr.Dataset) else points:
        if "time" not in block:
            raise SchemaError(
                "is missing",
                place="variable time",
                cure="Corrections follow the time of the points; without it, give their station "
                "along the road as time.",
            )
        columns = [block[name].values for name in ("easting", "northing", "up", "time")]
        lane = block["lane"].values if "lane" in block else np.zeros(columns[0].size, np.int64)
        for number in np.unique(lane):
            mine = np.flatnonzero(lane == number)
            some = columns if mine.size == lane.size else [values[mine] for values in columns]
            found.setdefault(int(number), VisitSums(options)).add(*some)
    return dict(sorted(found.items()))
