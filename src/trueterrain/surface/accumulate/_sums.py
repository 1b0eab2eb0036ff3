"""Sums over the returns of each cell, in whole numbers."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.errors import SchemaError
from trueterrain.georeference import ScanGeometry, Screening
from trueterrain.motion.trajectory import BRIDGED
from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.cells import Grid

Floats = npt.NDArray[np.float64]

#: Step in which heights are added up [m].
STEP = 1e-5

#: Step in which variances are added up [m²].
VARIANCE_STEP = 1e-12

#: Parts of a cell in which places inside it are added up.
PARTS = 256

#: Weight of a good return where doubtful ones weigh less.
GOOD = 16

_HIGHEST = 10_000.0  # [m] least and greatest heights are kept as 30 bit numbers
_CHUNK = 2048  # scans whose motion is worked out at once
_SHARE = 256  # scans that are worth a thread
_POINTS = 1 << 18  # points whose places are worked out at once
_COLLECTED = 50_000_000  # returns whose heights are held at once
_NONE: Any = np.empty((0, 0))


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """Which sums are kept; each costs memory."""

    extremes: bool = False
    "Least and greatest height of each cell."

    places: bool = True
    "Where in the cells the returns lie on average."

    point_sd: bool = False
    "Variances of points that know their standard deviation."


@dataclass
class Tally:
    """How many returns went where."""

    used: int = 0
    "In cells."

    doubtful: int = 0
    "Rejected, or weighed less, for their intensity."

    outside: int = 0
    "Beside the grid."

    too_high: int = 0
    "Higher or lower than 10 km, or without height."

    scans: int = 0
    "Scans."

    scans_uncovered: int = 0
    "Scans that the motion does not cover."

    bridged: int = 0
    "Scans at times at which no instrument saw the motion."

    def add(self, other: "Tally") -> None:
        """Add another one."""
        for entry in fields(self):
            setattr(self, entry.name, getattr(self, entry.name) + getattr(other, entry.name))


@dataclass
class _Part:
    """Sums of one thread, flat; what is not wanted has no room.

    Memory that is never touched costs nothing, so each thread can have all cells.
    """

    count: Any
    totals: Any
    squares: Any
    lows: Any
    highs: Any
    alongs: Any
    acrosses: Any
    variances: Any
    touched: Any
    pose: Any
    tally: Tally = field(default_factory=Tally)

    @classmethod
    def empty(cls, grid: Grid, wanted: Wanted) -> "_Part":
        """All sums zero."""
        rows, columns = grid.shape
        cells = rows * columns

        def some(keep: bool, dtype: Any) -> Any:
            return np.zeros(cells if keep else 0, dtype)

        return cls(
            count=some(True, np.int32),
            totals=some(True, np.int64),
            squares=some(True, np.int64),
            lows=some(wanted.extremes, np.int32),
            highs=some(wanted.extremes, np.int32),
            alongs=some(wanted.places, np.int32),
            acrosses=some(wanted.places, np.int32),
            variances=some(wanted.point_sd, np.int64),
            touched=np.zeros(rows, np.bool_),
            pose=np.zeros((rows, 5), np.int64),
        )

    @property
    def cells(self) -> tuple[Any, ...]:
        """Sums of returns, as the kernels take them."""
        return (
            self.count, self.totals, self.squares, self.lows, self.highs, self.alongs,
            self.acrosses,
        )  # fmt: skip


@dataclass(eq=False)
class _Collection:
    """Room for the heights of some cells, one cell after the other."""

    first_cell: int = 0
    cursor: Any = field(default_factory=lambda: np.empty(0, np.int64))
    values: Any = field(default_factory=lambda: np.empty(0, np.int32))


class CellSums:
    """Sums over returns or points in the cells of a grid.

    All sums are whole numbers: heights in steps of 0.01 mm. The result is the same, bit for bit,
    for any size of blocks, any number of threads and any order of the data.

    Parameters
    ----------
    grid : Grid
        The cells.
    wanted : Wanted
        Which sums are kept.
    threads : int
        Threads that work at once.
    """

    def __init__(self, grid: Grid, wanted: Wanted = Wanted(), *, threads: int = 1) -> None:
        if threads < 1:
            message = f"threads must be at least 1, got {threads}."
            raise ValueError(message)
        self.grid = grid
        self.wanted = wanted
        self.passes = 1
        self.threads = threads
        self._parts = [_Part.empty(grid, wanted)]
        self._weight: int | None = None  # of a good return
        self._earlier: npt.NDArray[np.int32] | None = None  # counts before this pass
        self._independent: Floats | None = None  # n² and n times variance, of finished passes
        self._sideways = np.zeros(2)
        self._collection: _Collection | None = None  # heights are collected instead of added

    @property
    def weight(self) -> int:
        """What a good return counts."""
        return 1 if self._weight is None else self._weight

    @property
    def tally(self) -> Tally:
        """How many returns went where."""
        total = Tally()
        for part in self._parts:
            total.add(part.tally)
        return total

    def add_scans(
        self,
        geometry: ScanGeometry,
        time: npt.ArrayLike,
        ranges: npt.NDArray[Any],
        intensity: npt.NDArray[Any] | None = None,
        *,
        scale: float = 1.0,
        missing: float | None = None,
        screening: Screening = Screening(),
    ) -> None:
        """Add scans, straight from ranges.

        Parameters
        ----------
        geometry : ScanGeometry
            Motion and beams.
        time : array_like, shape (scan,)
            Stamps of the scans [s].
        ranges : numpy.ndarray, shape (scan, beam)
            Ranges in steps of `scale`, as they are stored; NaN where there was no return.
        intensity : numpy.ndarray, shape (scan, beam), optional
            Intensities [counts].
        scale : float
            Step of the ranges [m].
        missing : float, optional
            Number that stands for no return.
        screening : Screening
            Which returns are doubtful, and what becomes of them.

        Raises
        ------
        ValueError
            If shapes do not fit, screening needs intensities that are not given, or its weight is
            not that of the scans before.
        """
        time = np.asarray(time, dtype=np.float64)
        shape = (time.size, geometry.angle.size)
        if ranges.shape != shape or (intensity is not None and intensity.shape != shape):
            message = f"ranges and intensity must have the shape {shape}, got {ranges.shape}."
            raise ValueError(message)
        good, doubtful = self._weights(screening)
        if not screening.needs_intensity:
            intensity = None
        elif intensity is None:
            message = "floor and saturation need intensities, which were not recorded."
            raise ValueError(message)
        lost = ranges.dtype.type(missing) if missing is not None else np.float64(np.nan)

        def work(part: _Part, begin: int, end: int) -> None:
            for start in range(begin, end, _CHUNK):
                rows = slice(start, min(start + _CHUNK, end))
                _add_scans(
                    self.grid, part, geometry, time[rows], ranges[rows],
                    None if intensity is None else intensity[rows], scale, lost, screening,
                    (good, doubtful), self._collection,
                )  # fmt: skip

        self._share(work, time.size, _SHARE)

    def add_points(
        self,
        easting: npt.ArrayLike,
        northing: npt.ArrayLike,
        up: npt.ArrayLike,
        sd: npt.ArrayLike | None = None,
    ) -> None:
        """Add points.

        Parameters
        ----------
        easting, northing, up : array_like, shape (point,)
            Coordinates [m].
        sd : array_like, shape (point,), optional
            Standard deviations of their heights [m]; needed if those are wanted.

        Raises
        ------
        SchemaError
            If standard deviations are wanted and not given.
        """
        x, y, z = (np.asarray(values, dtype=np.float64) for values in (easting, northing, up))
        if self.wanted.point_sd and sd is None:
            raise SchemaError(
                "is missing, but earlier points have it", place="variable sd",
                cure="Grid points with and without standard deviations apart.",
            )  # fmt: skip
        own = np.asarray(sd, dtype=np.float64) if self.wanted.point_sd else np.empty(0)
        along, across = self.grid.spacing
        rows, columns = self.grid.shape
        into = self._collection or _Collection()

        def work(part: _Part, begin: int, end: int) -> None:
            tally = np.zeros(4, np.int64)
            for start in range(begin, end, _POINTS):
                stop = min(start + _POINTS, end)
                u, v = self.grid.locate(x[start:stop], y[start:stop])
                _kernels.points(
                    0, stop - start, u, v, z[start:stop], own[start:stop],
                    self.grid.u[0], 1 / along, rows, self.grid.v[0], 1 / across, columns, 1 / STEP,
                    PARTS, _HIGHEST, VARIANCE_STEP, part.touched, *part.cells, part.variances,
                    tally, into.first_cell, into.cursor, into.values,
                )  # fmt: skip
            if self._collection is None:
                _note(part.tally, tally)

        self._share(work, x.size, _POINTS)

    def next_pass(self) -> None:
        """Say that what follows is another pass, whose motion is known independently."""
        self._merge()
        self._close_pass()
        self.passes += 1

    def total(self) -> "_Part":
        """Sums of all threads."""
        self._merge()
        return self._parts[0]

    def quantile(self, share: float, again: Callable[["CellSums"], None]) -> Floats:
        """Quantile of the heights in each cell, exact to the step of the heights.

        Counts say how much room each cell needs, so that another look at the data, or some for
        many returns, puts the heights of each cell side by side.

        Parameters
        ----------
        share : float
            0.5 for the median; between two heights by their shares, as numpy does [1].
        again : callable
            Adds all the data again.

        Returns
        -------
        numpy.ndarray, shape (u, v)
            NaN where there is no return [m].

        Raises
        ------
        ValueError
            If returns have weights, or the data are not the same again.
        """
        if self.weight != 1:
            message = "quantiles take no weights; reject doubtful returns (weight 0)."
            raise ValueError(message)
        rows, columns = self.grid.shape
        count = self.total().count.reshape(rows, columns)
        found = np.full((rows, columns), np.nan)
        for begin, end in _stretches(count.sum(axis=1, dtype=np.int64)):
            ends = np.cumsum(count[begin:end].ravel(), dtype=np.int64)
            if not ends[-1]:
                continue
            starts = np.concatenate([[0], ends[:-1]])
            self._collection = _Collection(
                first_cell=begin * columns, cursor=starts.copy(),
                values=np.empty(ends[-1] + 1, np.int32),
            )  # fmt: skip
            try:
                again(self)
                if not np.array_equal(self._collection.cursor, ends):
                    message = "the data must be the same when they are added again."
                    raise ValueError(message)
                part = np.empty(ends.size)
                _kernels.quantiles(self._collection.values, ends, share, part)
            finally:
                self._collection = None
            found[begin:end] = part.reshape(end - begin, columns) * STEP
        return found

    def pose_variance(self, rows: slice) -> tuple[Floats, Floats]:
        """Variance of the mean height of each cell that comes from the pose.

        Errors of the pose are the same for all returns of a pass in a cell, and independent from
        pass to pass.

        Parameters
        ----------
        rows : slice
            Rows of the grid.

        Returns
        -------
        variance : numpy.ndarray, shape (row, v)
            Of the mean [m²].
        between : numpy.ndarray, shape (row, v)
            What the passes' differences add to the sum of squared deviations in a cell [m²].
        """
        part = self.total()
        columns = self.grid.shape[1]
        count = part.count.reshape(-1, columns)[rows].astype(np.float64)
        pose = self._pose(part, rows)
        if self._independent is None or self._earlier is None:
            return pose, np.zeros_like(count)
        late = count - self._earlier.reshape(-1, columns)[rows]
        whole = self._independent[0, rows] + late**2 * pose
        each = self._independent[1, rows] + late * pose
        with np.errstate(invalid="ignore", divide="ignore"):
            variance = np.where(count > 0, whole / count**2, np.nan)
            between = np.where(count > 0, each - whole / count, 0.0) / self.weight
        return variance, np.maximum(between, 0.0)

    def sideways_variance(self) -> float:
        """Mean variance of the pose in a horizontal direction [m²]."""
        pose = self.total().pose
        variance, scans = self._sideways + _sideways(pose)
        return float(variance / scans) if scans else 0.0

    def _pose(self, part: _Part, rows: slice) -> Floats:
        """Variance from the pose of this pass, quadratic across each row."""
        a, b, c, _, n = part.pose.T
        seen = np.flatnonzero(n)
        v = self.grid.v
        if not seen.size:
            return np.zeros((len(range(*rows.indices(n.size))), v.size))
        at = np.arange(n.size)[rows]
        a, b, c = (
            np.interp(at, seen, sums[seen] * VARIANCE_STEP / n[seen])[:, None] for sums in (a, b, c)
        )
        return np.asarray(np.maximum(a + v * (b + v * c), 0.0))

    def _close_pass(self) -> None:
        part = self._parts[0]
        rows, columns = self.grid.shape
        if self._independent is None:
            self._independent = np.zeros((2, rows, columns))
        count = part.count.reshape(rows, columns)
        earlier = (
            np.zeros((rows, columns), np.int32) if self._earlier is None
            else self._earlier.reshape(rows, columns)
        )  # fmt: skip
        for start in range(0, rows, _CHUNK):
            some = slice(start, start + _CHUNK)
            late = (count[some] - earlier[some]).astype(np.float64)
            pose = self._pose(part, some)
            self._independent[0, some] += late**2 * pose
            self._independent[1, some] += late * pose
        self._sideways += _sideways(part.pose)
        self._earlier = part.count.copy()
        part.pose[:] = 0

    def _weights(self, screening: Screening) -> tuple[int, int]:
        good = GOOD if screening.needs_intensity and 0 < screening.weight < 1 else 1
        if self._weight not in (None, good):
            message = "all scans must be screened with weights, or none."
            raise ValueError(message)
        self._weight = good
        return good, round(good * screening.weight)

    def _share(self, work: Callable[[_Part, int, int], None], size: int, least: int) -> None:
        """Give each thread a stretch of the data, and sums of its own."""
        threads = max(1, min(self.threads, size // least))
        if self._collection is not None:
            threads = 1  # all write to one place
        while len(self._parts) < threads:
            self._parts.append(_Part.empty(self.grid, self.wanted))
        edges = np.linspace(0, size, threads + 1).astype(int).tolist()
        if threads == 1:
            work(self._parts[0], 0, size)
            return
        _ = self.grid.frame, self.grid.strips, self.grid.near(np.zeros(1), np.zeros(1))
        with ThreadPoolExecutor(threads) as pool:
            jobs = [
                pool.submit(work, part, begin, end)
                for part, begin, end in zip(self._parts, edges, edges[1:], strict=False)
            ]
        for job in jobs:
            job.result()

    def _merge(self) -> None:
        first = self._parts[0]
        for part in self._parts[1:]:
            _kernels.merge(
                *first.cells, first.variances, first.touched,
                (*part.cells, part.variances, part.touched),
            )  # fmt: skip
            first.pose += part.pose
            first.tally.add(part.tally)
        del self._parts[1:]


def _add_scans(
    grid: Grid,
    part: _Part,
    geometry: ScanGeometry,
    time: Floats,
    ranges: npt.NDArray[Any],
    intensity: npt.NDArray[Any] | None,
    scale: float,
    missing: Any,
    screening: Screening,
    weights: tuple[int, int],
    collection: _Collection | None,
) -> None:
    covered = geometry.covers(time)
    counts = Tally(scans=time.size, scans_uncovered=int((~covered).sum()))
    if not covered.all():
        time, ranges = time[covered], ranges[covered]
        intensity = None if intensity is None else intensity[covered]
    motion = geometry.expand(time)
    flags = motion.flag.reshape(time.size, geometry.pieces)
    counts.bridged = int((flags & BRIDGED != 0).any(axis=1).sum())
    middle = motion.coefficient[geometry.pieces // 2 :: geometry.pieces, :2, 0]
    hint = grid.near(middle[:, 0], middle[:, 1])
    tally = np.zeros(4, np.int64)
    into = collection or _Collection()
    _kernels.scans(
        0, time.size, motion.coefficient, motion.body, motion.variance, geometry.first,
        geometry.beam, ranges, scale, missing, screening.nearest, screening.furthest,
        _NONE if intensity is None else intensity, screening.floor, screening.saturation,
        *weights, *grid.strips, hint, grid.v[0], 1 / grid.spacing[1], grid.shape[1], 1 / STEP,
        PARTS, _HIGHEST, VARIANCE_STEP, part.touched, *part.cells, part.pose, tally,
        into.first_cell, into.cursor, into.values,
    )  # fmt: skip
    if collection is None:
        part.tally.add(counts)
        _note(part.tally, tally)


def _stretches(returns: npt.NDArray[np.int64]) -> list[tuple[int, int]]:
    """Stretches of rows that hold no more returns than are collected at once, if a row does not."""
    found, begin, held = [], 0, 0
    for row, some in enumerate(returns.tolist()):
        if held and held + some > _COLLECTED:
            found.append((begin, row))
            begin, held = row, 0
        held += some
    return [*found, (begin, returns.size)]


def _sideways(pose: npt.NDArray[np.int64]) -> Floats:
    """Sum of horizontal variances [m²], and of scans."""
    return np.array([pose[:, 3].sum() * VARIANCE_STEP, pose[:, 4].sum()], dtype=np.float64)


def _note(tally: Tally, counts: npt.NDArray[np.int64]) -> None:
    used, doubtful, outside, too_high = counts.tolist()
    tally.add(Tally(used=used, doubtful=doubtful, outside=outside, too_high=too_high))
