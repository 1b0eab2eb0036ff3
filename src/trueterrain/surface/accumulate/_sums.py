"""Sums over the returns of each cell, as integers."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import SchemaError
from trueterrain.georeference import ScanGeometry, Screening
from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.accumulate._reach import ScanReach, near_line
from trueterrain.surface.accumulate._returns import (
    GOOD,
    PARTS,
    STEP,
    CellLayout,
    HeightCollection,
    KeptSums,
    ReturnTotals,
    RowsReached,
    StoredReturns,
    ThreadSums,
    cell_quantiles,
)
from trueterrain.surface.accumulate.pose_variance import VARIANCE_STEP, PoseVariance
from trueterrain.surface.cells import Grid

Floats = npt.NDArray[np.float64]

#: Scans whose motion is expanded at once.
CHUNK = 2048

_MAX_HEIGHT = 10_000.0  # [m] min and max heights are kept as 30 bit numbers
_MIN_SCANS = 256  # scans from which on another thread pays
_POINTS = 1 << 18  # points whose cells are computed at once
_UNNOTED = ScanReach.unknown(0)


class CellSums:
    """Sums over returns or points in the cells of a grid, or of some of its rows.

    All sums are integers: heights in steps of 0.01 mm. Integer addition is associative, so the
    result is the same, bit for bit, for any size of blocks, any number of threads and any order of
    the data.

    Parameters
    ----------
    grid : Grid
        The cells.
    wanted : KeptSums
        Which sums are kept.
    threads : int
        Threads that work at once.
    rows : slice, optional
        Rows whose cells are kept; all by default. What lies in others is counted, not added.
    poses : sequence of PoseVariance, optional
        Pose variance of each pass, if all scans were looked at before.
    """

    def __init__(
        self,
        grid: Grid,
        wanted: KeptSums = KeptSums(),
        *,
        threads: int = 1,
        rows: slice | None = None,
        poses: Sequence[PoseVariance] = (),
    ) -> None:
        if threads < 1:
            message = f"threads must be at least 1, got {threads}."
            raise ValueError(message)
        self.grid = grid
        self.wanted = wanted
        self.passes = 1
        self.threads = threads
        self.datum_sd: float | None = 0.0
        "Standard deviation of the datum that all passes have in common [m]; None if not known."
        self.rows = range(grid.shape[0])[slice(None) if rows is None else rows]
        self._known = poses
        self._finished: list[PoseVariance] = []  # of earlier passes
        self._pose: PoseVariance | None = None  # of this pass, until scans are added
        self._parts = [ThreadSums.empty(grid, len(self.rows), wanted)]
        self._weight: int | None = None  # of a good return
        self._earlier: npt.NDArray[np.int32] | None = None  # counts before this pass
        self._independent: Floats | None = None  # of finished passes, see _close_pass
        self._collection: HeightCollection | None = None  # heights are collected instead of added
        self._moves = False  # the arrays of threads are reused

    @property
    def weight(self) -> int:
        """Weight of a good return."""
        return 1 if self._weight is None else self._weight

    @property
    def return_totals(self) -> ReturnTotals:
        """Counts of returns by outcome."""
        total = ReturnTotals()
        for part in self._parts:
            total.add(part.return_totals)
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
        reach: ScanReach | None = None,
    ) -> None:
        """Add scans from their ranges, without points in between.

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
            Stored number of a beam without return.
        screening : Screening
            Which returns are flagged, and what becomes of them.
        reach : ScanReach, optional
            Rows that these scans may reach; replaced by those that they reach. The motion must
            cover the scans; returns of scans found before are not counted a second time.

        Raises
        ------
        ValueError
            If shapes do not fit, screening needs intensities that are not given, or its weight is
            not that of the scans before.
        """
        time = np.asarray(time, dtype=np.float64)
        self.note_datum(geometry.trajectory.datum_sd)
        returns = StoredReturns(
            geometry=geometry,
            time=time,
            ranges=ranges,
            intensity=intensity,
            scale=scale,
            missing=ranges.dtype.type(missing) if missing is not None else np.float64(np.nan),
            screening=screening,
            weights=self._weights(screening),
        )

        def work(part: ThreadSums, begin: int, end: int) -> None:
            for start in range(begin, end, CHUNK):
                some = slice(start, min(start + CHUNK, end))
                self._sort(part, returns.of(some), None if reach is None else reach.of(some))

        self._run_threads(work, time.size, _MIN_SCANS)

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
            Standard deviations of their heights [m]; needed if `wanted.point_sd` is set.

        Raises
        ------
        SchemaError
            If standard deviations are needed and not given.
        """
        x, y, z = (np.asarray(values, dtype=np.float64) for values in (easting, northing, up))
        if self.wanted.point_sd and sd is None:
            raise SchemaError(
                "is missing, but earlier points have it",
                place="variable sd",
                cure="Grid points with and without standard deviations apart.",
            )
        own = np.asarray(sd, dtype=np.float64) if self.wanted.point_sd else np.empty(0)
        self.note_datum(0.0 if self.wanted.point_sd else None)
        cells, into = self._layout(), (self._collection or HeightCollection()).arrays

        def work(part: ThreadSums, begin: int, end: int) -> None:
            return_totals = np.zeros(4, np.int64)
            for start in range(begin, end, _POINTS):
                stop = min(start + _POINTS, end)
                u, v = self.grid.locate(x[start:stop], y[start:stop])
                _kernels.accumulate_points(
                    u, v, z[start:stop], own[start:stop], cells, part.arrays, return_totals, into
                )
            if self._collection is None:
                part.return_totals.note(return_totals)

        self._run_threads(work, x.size, _POINTS)

    def next_pass(self) -> None:
        """Begin another pass, whose motion is known independently."""
        self._close_pass()
        self.passes += 1

    def total(self) -> ThreadSums:
        """Sums of all threads."""
        first = self._parts[0]
        for part in self._parts[1:]:
            first.take(part)
        if not self._moves:
            del self._parts[1:]
        return first

    def move(self, first: int) -> None:
        """Set the sums to zero and go to other rows; pose variances of passes stay.

        Parameters
        ----------
        first : int
            The first of them.
        """
        self.rows = range(first, first + len(self.rows))
        self._moves = True
        self.passes = 1
        self._pose = self._earlier = self._independent = None
        self._finished.clear()
        for part in self._parts:
            part.clear()

    def quantile(
        self, fraction: float, rows: range, add_data: Callable[["CellSums"], None]
    ) -> Floats:
        """Quantile of the heights in each cell, exact to the step of the heights.

        Parameters
        ----------
        fraction : float
            0.5 for the median; linear between two heights, as numpy does [1].
        rows : range
            Rows of the grid, of those that are kept.
        add_data : callable
            Adds all the data a second time.

        Returns
        -------
        numpy.ndarray, shape (row, v)
            NaN where there is no return [m].

        Raises
        ------
        ValueError
            If returns have weights, or the data are not the same the second time.
        """
        if self.weight != 1:
            message = "quantiles take no weights; reject flagged returns (weight 0)."
            raise ValueError(message)

        columns = self.grid.shape[1]
        first = rows.start - self.rows.start

        def collect(collection: HeightCollection) -> None:
            collection.first_cell += first * columns
            self._collection = collection
            try:
                add_data(self)
            finally:
                self._collection = None

        count = self._cells(self.total().count)[first : first + len(rows)]
        return cell_quantiles(count, fraction, collect) * STEP

    def pose_variance(self, rows: slice) -> tuple[Floats, Floats | None]:
        """Variance of the mean height of each cell by the pose.

        Errors of the pose are common to all returns of a pass in a cell, and independent from pass
        to pass, or common to all passes if these were brought into agreement.

        Parameters
        ----------
        rows : slice
            Rows of the grid, of those that are kept.

        Returns
        -------
        variance : numpy.ndarray, shape (row, v)
            Of the mean [m²].
        between : numpy.ndarray, shape (row, v), or None
            Part of the sum of squared deviations in a cell by differences of passes [m²]; None if
            there is one pass.
        """
        pose = self._pose_now().variance(rows, self.grid.v)
        if self._independent is None or self._earlier is None:
            return pose, None
        here = slice(rows.start - self.rows.start, rows.stop - self.rows.start)
        count = self._cells(self.total().count)[here].astype(np.float64)
        late = count - self._cells(self._earlier)[here]
        if self.wanted.agreed:
            whole = (self._independent[0, here] + late * np.sqrt(pose)) ** 2
        else:
            whole = self._independent[0, here] + late**2 * pose
        each = self._independent[1, here] + late * pose
        with np.errstate(invalid="ignore", divide="ignore"):
            variance = np.where(count > 0, whole / count**2, np.nan)
            between = np.where(count > 0, each - whole / count, 0.0) / self.weight
        return variance, np.maximum(between, 0.0)

    def horizontal_variance(self) -> float:
        """Mean variance of the pose in a horizontal direction [m²]."""
        total = np.zeros(2)
        for pose in (*self._finished, self._pose_now()):
            total += pose.horizontal
        variance, scans = total
        return float(variance / scans) if scans else 0.0

    def note_datum(self, sd: float | None) -> None:
        """Take up the datum of a pass: of several the largest standard deviation counts.

        Parameters
        ----------
        sd : float or None
            Standard deviation of the height error that it has in common with other passes [m].
        """
        known = self.datum_sd is not None and sd is not None
        self.datum_sd = max(self.datum_sd or 0.0, sd or 0.0) if known else None

    def _layout(self) -> CellLayout:
        """Layout of the cells, as the loops take it."""
        (along, across), (rows, columns) = self.grid.spacing, self.grid.shape
        return CellLayout(
            first_u=self.grid.u[0],
            per_along=1 / along,
            rows=rows,
            v_right=self.grid.v[0],
            per_across=1 / across,
            columns=columns,
            first_row=self.rows.start,
            per_step=1 / STEP,
            parts=PARTS,
            furthest_height=_MAX_HEIGHT,
            variance_unit=VARIANCE_STEP,
        )

    def _cells(self, values: Any) -> Any:
        return values.reshape(len(self.rows), self.grid.shape[1])

    def _pose_now(self) -> PoseVariance:
        """Pose variance of the current pass, as far as it was added."""
        if self._known:
            return self._known[self.passes - 1]
        if self._pose is None:
            self._pose = PoseVariance(self.total().pose.sums)
        return self._pose

    def _close_pass(self) -> None:
        """Add the pose variance of this pass: n² variance, or n sd if errors are common to all."""
        rows, columns = len(self.rows), self.grid.shape[1]
        count = self.total().count
        if self._independent is None or self._earlier is None:
            self._independent = np.zeros((2, rows, columns))
            self._earlier = np.zeros_like(count)
        pose, agreed = self._pose_now(), self.wanted.agreed
        late = self._cells(count - self._earlier)
        for start in range(0, rows, CHUNK):
            some = slice(start, min(start + CHUNK, rows))
            there = slice(self.rows.start + some.start, self.rows.start + some.stop)
            variance = pose.variance(there, self.grid.v)
            n = late[some].astype(np.float64)
            self._independent[0, some] += n * np.sqrt(variance) if agreed else n**2 * variance
            self._independent[1, some] += n * variance
        self._earlier[...] = count
        self._finished.append(pose)
        self._parts[0].pose, self._pose = PoseVariance.empty(self.grid), None

    def _weights(self, screening: Screening) -> tuple[int, int]:
        good = GOOD if screening.needs_intensity and 0 < screening.weight < 1 else 1
        if self._weight not in (None, good):
            message = "all scans must be screened with weights, or none."
            raise ValueError(message)
        self._weight = good
        return good, round(good * screening.weight)

    def _run_threads(
        self, work: Callable[[ThreadSums, int, int], None], size: int, min_size: int
    ) -> None:
        """Give each thread a part of the data, and sums of its own."""
        self._pose = None
        threads = max(1, min(self.threads, size // min_size))
        if self._collection is not None:
            threads = 1  # all heights go to one array
        while len(self._parts) < threads:
            self._parts.append(ThreadSums.empty(self.grid, len(self.rows), self.wanted))
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

    def _sort(self, part: ThreadSums, returns: StoredReturns, reach: ScanReach | None) -> None:
        """Sort the returns of some scans into cells; without `reach`, find their strips first."""
        grid, geometry, collection = self.grid, returns.geometry, self._collection
        if reach is None:
            counts = ReturnTotals(scans=returns.time.size)
            returns = returns.covered()
            counts.scans_uncovered = counts.scans - returns.time.size
            pose = PoseVariance.empty(grid) if collection else part.pose
            motion, hint = near_line(grid, geometry, returns.time, pose, counts)
            if not collection:
                part.return_totals.add(counts)
            reach = _UNNOTED
        else:
            motion, hint = geometry.expand(returns.time), reach.hint.astype(np.int64)
        return_totals = np.zeros(4, np.int64)
        _kernels.accumulate_scans(
            motion.coefficient,
            geometry.first,
            geometry.beam,
            returns.arrays,
            grid.strips,
            hint,
            self._layout(),
            part.arrays,
            return_totals,
            RowsReached(reach.low, reach.high, reach.found),
            (collection or HeightCollection()).arrays,
        )
        if not collection:
            part.return_totals.note(return_totals)
