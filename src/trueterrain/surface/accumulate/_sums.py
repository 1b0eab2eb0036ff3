"""Sums over the returns of each cell, in whole numbers."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import SchemaError
from trueterrain.georeference import ScanGeometry, Screening
from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.accumulate._part import ThreadSums
from trueterrain.surface.accumulate._pose import VARIANCE_STEP, PoseVariance
from trueterrain.surface.accumulate._quantiles import HeightCollection, cell_quantiles
from trueterrain.surface.accumulate._reach import ScanReach, near_line
from trueterrain.surface.accumulate._returns import StoredReturns
from trueterrain.surface.accumulate._tally import KeptSums, ReturnTotals
from trueterrain.surface.cells import Grid

Floats = npt.NDArray[np.float64]

#: Step in which heights are added up [m].
STEP = 1e-5

#: Parts of a cell in which places inside it are added up.
PARTS = 256

#: Weight of a good return where flagged ones weigh less.
GOOD = 16

#: Scans whose motion is worked out at once.
CHUNK = 2048

_HIGHEST = 10_000.0  # [m] least and greatest heights are kept as 30 bit numbers
_SHARE = 256  # scans that are worth a thread
_POINTS = 1 << 18  # points whose places are worked out at once
_UNNOTED = ScanReach.unknown(0)


class CellSums:
    """Sums over returns or points in the cells of a grid, or of some of its rows.

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
    rows : slice, optional
        Rows whose cells are kept; all by default. What lies in others is counted, not added.
    poses : sequence of Pose, optional
        What the pose adds to the variance in each pass, if all scans were looked at before.
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
        "Of the height that all passes have in common, beside the sums [m]; None if not known."
        self.rows = range(grid.shape[0])[slice(None) if rows is None else rows]
        self._known = poses
        self._finished: list[PoseVariance] = []  # of earlier passes
        self._pose: PoseVariance | None = None  # of this pass, until scans are added
        self._parts = [ThreadSums.empty(grid, len(self.rows), wanted)]
        self._weight: int | None = None  # of a good return
        self._earlier: npt.NDArray[np.int32] | None = None  # counts before this pass
        self._independent: Floats | None = None  # of finished passes, see _close_pass
        self._collection: HeightCollection | None = None  # heights are collected instead of added
        self._moves = False  # so the room of threads is needed again

    @property
    def weight(self) -> int:
        """What a good return counts."""
        return 1 if self._weight is None else self._weight

    @property
    def tally(self) -> ReturnTotals:
        """How many returns went where."""
        total = ReturnTotals()
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
        reach: ScanReach | None = None,
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
            Which returns are flagged, and what becomes of them.
        reach : Reach, optional
            Rows that these scans may reach; those that they were found to reach are put there. The
            motion must cover the scans; returns of those found before are not counted again.

        Raises
        ------
        ValueError
            If shapes do not fit, screening needs intensities that are not given, or its weight is
            not that of the scans before.
        """
        time = np.asarray(time, dtype=np.float64)
        self._note_datum(geometry.trajectory.datum_sd)
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
                "is missing, but earlier points have it",
                place="variable sd",
                cure="Grid points with and without standard deviations apart.",
            )
        own = np.asarray(sd, dtype=np.float64) if self.wanted.point_sd else np.empty(0)
        self._note_datum(0.0 if self.wanted.point_sd else None)
        along, across = self.grid.spacing
        rows, columns = self.grid.shape
        into = self._collection or HeightCollection()

        def work(part: ThreadSums, begin: int, end: int) -> None:
            tally = np.zeros(4, np.int64)
            for start in range(begin, end, _POINTS):
                stop = min(start + _POINTS, end)
                u, v = self.grid.locate(x[start:stop], y[start:stop])
                _kernels.accumulate_points(
                    0,
                    stop - start,
                    u,
                    v,
                    z[start:stop],
                    own[start:stop],
                    self.grid.u[0],
                    1 / along,
                    rows,
                    self.grid.v[0],
                    1 / across,
                    columns,
                    1 / STEP,
                    PARTS,
                    _HIGHEST,
                    VARIANCE_STEP,
                    self.rows.start,
                    part.touched,
                    *part.cells,
                    part.variances,
                    tally,
                    into.first_cell,
                    into.cursor,
                    into.values,
                )
            if self._collection is None:
                part.tally.note(tally)

        self._share(work, x.size, _POINTS)

    def next_pass(self) -> None:
        """Say that what follows is another pass, whose motion is known independently."""
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
        """Begin anew with as many other rows; what is known of passes and poses stays.

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

    def quantile(self, share: float, rows: range, again: Callable[["CellSums"], None]) -> Floats:
        """Quantile of the heights in each cell, exact to the step of the heights.

        Parameters
        ----------
        share : float
            0.5 for the median; between two heights by their shares, as numpy does [1].
        rows : range
            Rows of the grid, of those that are kept.
        again : callable
            Adds all the data again.

        Returns
        -------
        numpy.ndarray, shape (row, v)
            NaN where there is no return [m].

        Raises
        ------
        ValueError
            If returns have weights, or the data are not the same again.
        """
        if self.weight != 1:
            message = "quantiles take no weights; reject flagged returns (weight 0)."
            raise ValueError(message)

        columns = self.grid.shape[1]
        first = rows.start - self.rows.start

        def collect(room: HeightCollection) -> None:
            room.first_cell += first * columns
            self._collection = room
            try:
                again(self)
            finally:
                self._collection = None

        count = self._cells(self.total().count)[first : first + len(rows)]
        return cell_quantiles(count, share, collect) * STEP

    def pose_variance(self, rows: slice) -> tuple[Floats, Floats | None]:
        """Variance of the mean height of each cell that comes from the pose.

        Errors of the pose are the same for all returns of a pass in a cell, and independent from
        pass to pass, or the same if the passes were brought into agreement.

        Parameters
        ----------
        rows : slice
            Rows of the grid, of those that are kept.

        Returns
        -------
        variance : numpy.ndarray, shape (row, v)
            Of the mean [m²].
        between : numpy.ndarray, shape (row, v), or None
            What the passes' differences add to the sum of squared deviations in a cell [m²]; None
            if there is one pass.
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

    def sideways_variance(self) -> float:
        """Mean variance of the pose in a horizontal direction [m²]."""
        total = np.zeros(2)
        for pose in (*self._finished, self._pose_now()):
            total += pose.sideways
        variance, scans = total
        return float(variance / scans) if scans else 0.0

    def _note_datum(self, sd: float | None) -> None:
        """Of several datums the least sure one counts."""
        known = self.datum_sd is not None and sd is not None
        self.datum_sd = max(self.datum_sd or 0.0, sd or 0.0) if known else None

    def _cells(self, values: Any) -> Any:
        return values.reshape(len(self.rows), self.grid.shape[1])

    def _pose_now(self) -> PoseVariance:
        """Of this pass, as far as it was added."""
        if self._known:
            return self._known[self.passes - 1]
        if self._pose is None:
            self._pose = PoseVariance(self.total().pose.sums)
        return self._pose

    def _close_pass(self) -> None:
        """Add what the poses of this pass do: n² variance, or n sd if all passes err alike."""
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

    def _share(self, work: Callable[[ThreadSums, int, int], None], size: int, least: int) -> None:
        """Give each thread a stretch of the data, and sums of its own."""
        self._pose = None
        threads = max(1, min(self.threads, size // least))
        if self._collection is not None:
            threads = 1  # all write to one place
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
        """Sort the returns of some scans into cells; if it was not done before, look at them."""
        grid, geometry, collection = self.grid, returns.geometry, self._collection
        if reach is None:
            counts = ReturnTotals(scans=returns.time.size)
            returns = returns.covered()
            counts.scans_uncovered = counts.scans - returns.time.size
            pose = PoseVariance.empty(grid) if collection else part.pose
            motion, hint = near_line(grid, geometry, returns.time, pose, counts)
            if not collection:
                part.tally.add(counts)
            reach = _UNNOTED
        else:
            motion, hint = geometry.expand(returns.time), reach.hint.astype(np.int64)
        into = collection or HeightCollection()
        tally = np.zeros(4, np.int64)
        _kernels.accumulate_scans(
            0,
            returns.time.size,
            motion.coefficient,
            geometry.first,
            geometry.beam,
            *returns.loops,
            *grid.strips,
            hint,
            grid.v[0],
            1 / grid.spacing[1],
            grid.shape[1],
            1 / STEP,
            PARTS,
            _HIGHEST,
            self.rows.start,
            part.touched,
            *part.cells,
            tally,
            reach.low,
            reach.high,
            reach.found,
            into.first_cell,
            into.cursor,
            into.values,
        )
        if not collection:
            part.tally.note(tally)
