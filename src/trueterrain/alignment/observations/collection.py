"""Cells of the ground from points or recorded runs.

Sums over each visit are integers, which are associative, so cells do not depend on the order or the
blocks of points. A plane through the sums gives the height of each cell.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path as FilePath

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.alignment.observations import _kernels
from trueterrain.alignment.observations.cells import PassCells, PassPath, move_to_centres
from trueterrain.alignment.settings import CellSettings
from trueterrain.core.errors import CoverageError, SchemaError, name_file_in_errors
from trueterrain.formats.run import Mounting, open_run, scan_blocks
from trueterrain.georeference import Screening, georeference
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_STEP = 1e-5  # [m] resolution of heights
_TIME_STEP = 1e-6  # [s] or [m] resolution of times
_PARTS = 65536  # resolution of positions, parts of the side of a cell
_FLAT = 3.0  # weight, in returns, of level ground that regularises the slope of a plane
_PATH_STEP = 1.0  # [s] or [m] over which positions of returns are averaged to a path
_PATH_STEPS = 20  # minimum number of these steps
_COLUMNS = 13
_THINNEST = 50  # maximum stride over scans


class VisitSums:
    """Sums over the points of one pass, cell by cell and visit by visit.

    Parameters
    ----------
    settings : CellSettings
        Size of the cells.

    Notes
    -----
    All sums are whole numbers, so cells do not depend on the order of the points or on how they
    came in blocks.
    """

    def __init__(self, settings: CellSettings) -> None:
        self.settings = settings
        self._used = 0
        self._keys, self._sums = np.zeros((0, 2), np.int64), np.zeros((0, _COLUMNS), np.int64)
        self._table = np.zeros(0, np.int64)
        self._grow_table(1 << 12)

    def add(self, easting: Floats, northing: Floats, up: Floats, time: Floats) -> None:
        """Add points to the sums.

        Parameters
        ----------
        easting, northing, up : numpy.ndarray, shape (point,)
            Coordinates [m].
        time : numpy.ndarray, shape (point,)
            Times [s], or stations [m].

        Raises
        ------
        SchemaError
            If a value is not finite.
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
                self.settings.size,
                1.0 / _STEP,
                1.0 / _TIME_STEP,
                _PARTS,
                0.5 * self.settings.visit_gap,
                self._keys,
                self._sums,
                self._table,
                self._used,
            )
            done += added
            if done < columns[0].size:
                self._grow_table(2 * self._table.size)

    def _grow_table(self, size: int) -> None:
        keys, sums = np.zeros((size // 2, 2), np.int64), np.zeros((size // 2, _COLUMNS), np.int64)
        keys[: self._used] = self._keys[: self._used]
        sums[: self._used] = self._sums[: self._used]
        self._keys, self._sums = keys, sums
        self._table = np.full(size, -1, np.int64)
        _kernels.rehash_keys(keys, self._used, self._table)

    def cells(self, name: str, path: PassPath | None = None, **navigation: Floats) -> PassCells:
        """Cells of the pass from the sums.

        Parameters
        ----------
        name : str
            Name of the pass.
        path : callable, optional
            Easting, northing and heading of the pass at some times; by default from
            the mean positions of the returns.
        **navigation : numpy.ndarray
            ``sd_time`` and ``sd_height`` where navigation reports them.

        Returns
        -------
        PassCells
            Cells with enough returns that scatter little about their plane.

        Raises
        ------
        CoverageError
            If there is no such cell.
        """
        order = np.lexsort(self._keys[: self._used].T[::-1])
        keys, sums = self._keys[order], self._sums[order]
        joined = _kernels.join_visits(keys, sums, round(self.settings.visit_gap / _TIME_STEP))
        enough = np.flatnonzero(sums[:joined, 0] >= self.settings.min_count)
        found = _fit_cell_planes(keys[enough, 0], sums[enough], self.settings.size)
        if path is None and enough.size:
            path = _path_of(found)
        even = np.flatnonzero(found["scatter"] <= self.settings.max_sd**2)
        if not even.size:
            raise CoverageError(
                f"{name} has no cell of {self.settings.size:g} m with "
                f"{self.settings.min_count} returns that scatter by less than "
                f"{self.settings.max_sd * 1e3:g} mm",
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
            longitudinal=east * np.cos(heading) + north * np.sin(heading),
            **columns,
            **navigation,
        )


def _fit_cell_planes(cell: Integers, sums: Integers, size: float) -> dict[str, Floats]:
    """Mean position, time and height of cells, slopes, and variance about their planes.

    Least-squares planes from centred second moments, which integer sums give without cancellation.
    """
    count = sums[:, 0]
    n = count.astype(np.float64)
    with np.errstate(over="ignore"):
        mean_x, mean_y = sums[:, 1] / n, sums[:, 2] / n
        base = sums[:, 3] // np.maximum(count, 1)
        rest = sums[:, 3] - count * base
        # int64 sums may wrap; centred moments are small, so they are exact modulo 2^64
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
    residual_square = zz - 2.0 * (slope_x * xz + slope_y * yz)
    residual_square += (
        slope_x**2 * (xx - flat) + 2.0 * slope_x * slope_y * xy + slope_y**2 * (yy - flat)
    )
    # degrees of freedom: one for the mean, and those of two slopes shrunk by the regularisation
    degrees_of_freedom = np.maximum(n - 1.0 - 2.0 * n / (n + _FLAT), 1.0)
    column, row = cell >> 32, cell & 0xFFFFFFFF
    row = np.where(row >= 1 << 31, row - (1 << 32), row)
    column = column + (row < 0)  # packing a negative row subtracts 1 from the column
    return {
        "count": n,
        "time": (sums[:, 11] + later / n) * _TIME_STEP,
        "easting": (column + 0.5 + mean_x / _PARTS) * size,
        "northing": (row + 0.5 + mean_y / _PARTS) * size,
        "height": (base + rest / n) * _STEP,
        "slope_east": slope_x * (_STEP * _PARTS / size),
        "slope_north": slope_y * (_STEP * _PARTS / size),
        "scatter": np.maximum(residual_square / degrees_of_freedom, 1.0 / 12.0) * _STEP**2,
    }


def _path_of(found: dict[str, Floats]) -> PassPath:
    """Path of a pass from the mean positions of its returns."""
    time = found["time"]
    begin, span = time.min(), max(float(np.ptp(time)), 1e-9)
    steps = max(_PATH_STEPS, int(np.ceil(span / _PATH_STEP)))
    step = np.minimum(((time - begin) / span * steps).astype(np.int64), steps - 1)
    count = np.bincount(step, found["count"], steps)
    occupied = count > 0
    at, x, y = (
        (np.bincount(step, found["count"] * found[name], steps)[occupied] / count[occupied])
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
    """Moving mean over five values, over fewer at the ends."""
    box = np.ones(min(5, values.size - 1 + values.size % 2))
    return np.convolve(values, box, "same") / np.convolve(np.ones(values.size), box, "same")


def collect_cell_sums(
    points: xr.Dataset | Iterable[xr.Dataset], settings: CellSettings
) -> dict[int, VisitSums]:
    """Collect the sums of each pass.

    Parameters
    ----------
    points : xarray.Dataset or iterable of xarray.Dataset
        Points with ``time``, in one dataset or in blocks; those without ``lane`` belong to pass 0.
    settings : CellSettings
        Size of the cells.

    Returns
    -------
    dict of int to VisitSums
        By ascending number of the pass.

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
                cure="Corrections are functions of time; give the station along the road as time "
                "if there is none.",
            )
        columns = [block[name].values for name in ("easting", "northing", "up", "time")]
        numbers = block["lane"].values if "lane" in block else np.zeros(columns[0].size, np.int64)
        for number in np.unique(numbers):
            mine = np.flatnonzero(numbers == number)
            some = columns if mine.size == numbers.size else [values[mine] for values in columns]
            found.setdefault(int(number), VisitSums(settings)).add(*some)
    return dict(sorted(found.items()))


def cells_of_points(
    points: xr.Dataset | Iterable[xr.Dataset],
    settings: CellSettings = CellSettings(),
    *,
    names: Mapping[int, str] | None = None,
    path: PassPath | None = None,
) -> list[PassCells]:
    """Cells of each pass from points with times.

    Parameters
    ----------
    points : xarray.Dataset or iterable of xarray.Dataset
        Points with ``time`` [s], in one dataset or in blocks; ``lane`` numbers the passes. Points
        without time may have the station along the road [m] as ``time``.
    settings : CellSettings
        Size of the cells, and which of them are accepted.
    names : mapping of int to str, optional
        Names of the passes; by default their numbers.
    path : callable, optional
        Easting, northing [m] and heading [rad] of the body as functions of time; by default from
        the mean positions of the returns.

    Returns
    -------
    list of PassCells
        One for each pass, by ascending number; independent of order and blocks of the points.

    Raises
    ------
    SchemaError
        If points have no time, or coordinates are not finite.
    CoverageError
        If a pass has no cell with enough returns.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> points = make_points([0.2, 0.8, 0.5], [0.2, 0.4, 0.9], [1.0, 1.1, 1.2], time=[0, 1, 2])
    >>> (south,) = cells_of_points(points, CellSettings(size=1.0, min_count=3, max_sd=1.0))
    >>> south.height, south.time
    (array([1.1]), array([1.]))
    """
    found = collect_cell_sums(points, settings)
    if not found:
        raise CoverageError("there are no points")
    named = names or {}
    return [sums.cells(named.get(number, str(number)), path) for number, sums in found.items()]


def cells_of_run(
    run: str | FilePath | xr.DataTree,
    trajectory: Trajectory,
    settings: CellSettings = CellSettings(),
    *,
    name: str,
    mounting: Mounting | None = None,
    screening: Screening = Screening(),
) -> PassCells:
    """Cells of a recorded run.

    Parameters
    ----------
    run : str, Path or xarray.DataTree
        The run.
    trajectory : Trajectory
        Trajectory of the body.
    settings : CellSettings
        Size of the cells, and which of them are accepted.
    name : str
        Name of the pass.
    mounting : Mounting, optional
        Pose of the scanner in the body frame; by default that of the run.
    screening : Screening
        Which returns are flagged or dropped.

    Returns
    -------
    PassCells
        With the reported standard deviations of the height.

    Raises
    ------
    CoverageError
        If the trajectory covers no scan, or no cell has enough returns.
    FormatError
        If the run is damaged.
    """
    run = open_run(run)
    mounting = mounting or run.mounting
    stride = _scan_stride(run, trajectory, settings)
    sums = VisitSums(settings)
    with name_file_in_errors(run.source or "the run"):
        thinned = (
            block.isel(scan=slice(-block.attrs["first_scan"] % stride, None, stride))
            for block in scan_blocks(run)
        )
        for block in georeference(thinned, trajectory, mounting, screening=screening):
            sums.add(*(block[key].values for key in ("easting", "northing", "up", "time")))
    knots = trajectory.time
    forward = Rotation.from_quat(trajectory.quaternion).apply([1.0, 0.0, 0.0])
    heading = np.unwrap(np.arctan2(forward[:, 1], forward[:, 0]))

    def path(time: Floats) -> tuple[Floats, Floats, Floats]:
        x, y, course = (
            np.interp(time, knots, values)
            for values in (trajectory.position[:, 0], trajectory.position[:, 1], heading)
        )
        return x, y, course

    sd = np.sqrt(trajectory.covariance[:, 2, 2])
    known = bool((sd > 0).all()) and trajectory.datum_sd is not None
    navigation = {"sd_time": trajectory.time, "sd_height": sd} if known else {}
    return move_to_centres(sums.cells(name, path, **navigation), path, settings.size)


def _scan_stride(run: xr.DataTree, trajectory: Trajectory, settings: CellSettings) -> int:
    """Stride over scans that leaves the requested number of scans in a cell."""
    if settings.scans == 0:
        return 1
    stamps = np.asarray(run["scans"]["time"], dtype=np.float64)
    steps = np.diff(stamps[np.isfinite(stamps)])
    speed = float(np.median(np.hypot(*trajectory.velocity[:, :2].T)))
    distance = speed * float(np.median(steps)) if steps.size else 0.0
    if not distance > 0:
        return 1
    return int(np.clip(settings.size / (settings.scans * distance), 1, _THINNEST))
