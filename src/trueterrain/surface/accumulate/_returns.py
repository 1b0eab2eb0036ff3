"""Returns of scans: what a kernel reads of them, sums of one thread, quantiles of heights.

Quantiles are exact to the step of heights. The counts of a first pass over the data give the offset
of each cell in one array. A second pass, or several if there are many returns, writes the heights
of each cell into its part of the array.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.georeference import ScanGeometry, Screening
from trueterrain.surface.accumulate import _kernels
from trueterrain.surface.accumulate.pose_variance import PoseVariance
from trueterrain.surface.cells import Grid

#: Step in which heights are added up [m].
STEP = 1e-5

#: Parts of a cell in which positions inside it are added up.
PARTS = 256

#: Weight of a good return where flagged ones weigh less.
GOOD = 16

#: Returns whose heights are in memory at once.
COLLECTED = 50_000_000

_NONE: Any = np.empty((0, 0))


class RangeBlock(NamedTuple):
    """Stored returns of scans, and the rules that screen them."""

    ranges: npt.NDArray[Any]
    "Stored ranges, shape (scan, beam) [scale]."

    scale: float
    "Step of the ranges [m]."

    missing: Any
    "Stored number of a beam without return."

    nearest: float
    "Begin of the range gate [m]."

    furthest: float
    "End of the range gate [m]."

    intensity: Any
    "Intensities, shape (scan, beam), or (0, 0) without screening [counts]."

    floor: float
    "Min intensity that is not flagged [counts]."

    saturation: float
    "Max intensity that is not flagged [counts]."

    good_weight: int
    "Weight of a good return."

    flagged_weight: int
    "Weight of a flagged return."


class CellLayout(NamedTuple):
    """Where the cells of a grid lie, and the steps in which heights and positions are summed."""

    first_u: float
    "Station of the first node [m]."

    per_along: float
    "Cells per metre along the line [1/m]."

    rows: int
    "Nodes along the line."

    v_right: float
    "Offset of the rightmost node [m]."

    per_across: float
    "Cells per metre of offset [1/m]."

    columns: int
    "Nodes across the line."

    first_row: int
    "First row whose cells are kept."

    per_step: float
    "Steps of height per metre [1/m]."

    parts: int
    "Parts of a cell in which positions are summed."

    furthest_height: float
    "Magnitude of the heights that can be summed [m]."

    variance_unit: float
    "Step in which variances are summed [m²]."


class SumArrays(NamedTuple):
    """Sums of cells, shape (cell,); those that are not kept are empty."""

    count: Any
    "Weights."

    totals: Any
    "Heights [step]."

    squares: Any
    "Squares of heights [step²]."

    lows: Any
    "Min heights as positive integers."

    highs: Any
    "Max heights as positive integers."

    alongs: Any
    "Positions in the cell along the line [1/parts]."

    acrosses: Any
    "Positions in the cell across the line [1/parts]."

    variances: Any
    "Variances of the points."

    touched: Any
    "Whether a row has any sum, shape (row,)."


class RowsReached(NamedTuple):
    """Rows that each scan reaches, shape (scan,), or (0,) if they are not noted."""

    low: npt.NDArray[np.int32]
    "First row."

    high: npt.NDArray[np.int32]
    "Last row."

    found: npt.NDArray[np.bool_]
    "Whether the scan was gridded."


class CollectedHeights(NamedTuple):
    """Heights of some cells, one cell after the other; empty if heights are summed instead."""

    first_cell: int
    "The first of these cells."

    cursor: npt.NDArray[np.int64]
    "Where the next height of each cell goes, shape (cell,)."

    values: npt.NDArray[np.int32]
    "Heights, shape (return,) [step]."


@dataclass(frozen=True, kw_only=True)
class KeptSums:
    """Which sums of a cell are kept; each takes memory."""

    extremes: bool = False
    "Min and max height of each cell."

    places: bool = True
    "Mean position of the returns in the cell."

    point_sd: bool = False
    "Variances of points that have a standard deviation of their own."

    agreed: bool = False
    "Whether errors of the poses are common to all passes instead of independent."

    @property
    def bytes(self) -> int:
        """Memory for a cell [bytes]."""
        return 20 + 8 * (self.extremes + self.places + self.point_sd)


@dataclass
class ReturnTotals:
    """Counts of returns by outcome, and of scans."""

    used: int = 0
    "Added to a cell."

    flagged: int = 0
    "Rejected, or with less weight, for their intensity."

    outside: int = 0
    "Outside the grid."

    too_high: int = 0
    "Higher or lower than 10 km, or without height."

    scans: int = 0
    "Scans."

    scans_uncovered: int = 0
    "Scans that the motion does not cover."

    bridged: int = 0
    "Scans at times at which no instrument saw the motion."

    def add(self, other: "ReturnTotals") -> None:
        """Add another one."""
        for entry in fields(self):
            setattr(self, entry.name, getattr(self, entry.name) + getattr(other, entry.name))

    def note(self, counts: npt.NDArray[np.int64]) -> None:
        """Add the counts of a loop: used, flagged, outside, too high."""
        used, flagged, outside, too_high = counts.tolist()
        self.add(ReturnTotals(used=used, flagged=flagged, outside=outside, too_high=too_high))


@dataclass
class ThreadSums:
    """Sums of one thread, flat; arrays of sums that are not kept are empty.

    The operating system gives memory only to pages that are written, so each thread can have
    arrays over all cells.
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
    pose: PoseVariance
    return_totals: ReturnTotals = field(default_factory=ReturnTotals)

    @classmethod
    def empty(cls, grid: Grid, rows: int, wanted: KeptSums) -> "ThreadSums":
        """All sums zero, for some rows of a grid."""
        cells = rows * grid.shape[1]

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
            pose=PoseVariance.empty(grid),
        )

    @property
    def arrays(self) -> SumArrays:
        """All sums of cells, as the loops take them."""
        return SumArrays(*(getattr(self, name) for name in SumArrays._fields))

    def take(self, other: "ThreadSums") -> None:
        """Add the sums of another thread, and set those to zero."""
        _kernels.merge_sums(self.arrays, other.arrays)
        self.pose.sums[...] += other.pose.sums
        other.pose.sums[...] = 0
        self.return_totals.add(other.return_totals)
        other.return_totals = ReturnTotals()

    def clear(self) -> None:
        """Set all sums to zero; the arrays are reused, which is faster than allocating them."""
        _kernels.clear_sums(self.arrays)
        self.pose.sums[...] = 0
        self.return_totals = ReturnTotals()


@dataclass(eq=False)
class HeightCollection:
    """Heights of some cells, one cell after the other."""

    first_cell: int = 0
    cursor: Any = field(default_factory=lambda: np.empty(0, np.int64))
    values: Any = field(default_factory=lambda: np.empty(0, np.int32))

    @property
    def arrays(self) -> CollectedHeights:
        """The collection as the loops take it."""
        return CollectedHeights(self.first_cell, self.cursor, self.values)


def cell_quantiles(
    count: npt.NDArray[np.int32], fraction: float, collect: Callable[[HeightCollection], None]
) -> npt.NDArray[np.float64]:
    """Quantile of the heights in each cell, in steps; NaN in empty cells.

    Parameters
    ----------
    count : numpy.ndarray, shape (row, column)
        Returns.
    fraction : float
        Fraction of the heights below it; linear between two heights, as numpy does [1].
    collect : callable
        Puts the heights of all data into a collection.

    Returns
    -------
    numpy.ndarray, shape (row, column)
        In steps of the heights.

    Raises
    ------
    ValueError
        If the data are not those that were counted.
    """
    rows, columns = count.shape
    found = np.full((rows, columns), np.nan)
    for begin, end in _row_ranges(count.sum(axis=1, dtype=np.int64)):
        ends = np.cumsum(count[begin:end].ravel(), dtype=np.int64)
        if not ends[-1]:
            continue
        collection = HeightCollection(
            first_cell=begin * columns,
            cursor=np.concatenate([[0], ends[:-1]]),
            values=np.empty(ends[-1] + 1, np.int32),
        )
        collect(collection)
        if not np.array_equal(collection.cursor, ends):
            message = "the data must be the same when they are added a second time."
            raise ValueError(message)
        _kernels.cell_quantiles(collection.values, ends, fraction, found[begin:end].reshape(-1))
    return found


def _row_ranges(returns: npt.NDArray[np.int64]) -> list[tuple[int, int]]:
    """Ranges of rows with at most `COLLECTED` returns each, or of one row that has more."""
    found, begin, held = [], 0, 0
    for row, some in enumerate(returns.tolist()):
        if held and held + some > COLLECTED:
            found.append((begin, row))
            begin, held = row, 0
        held += some
    return [*found, (begin, returns.size)]


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredReturns:
    """Stored ranges of some scans, and all that sorts them into cells."""

    geometry: ScanGeometry
    "Motion and beams."

    time: npt.NDArray[np.float64]
    "Stamps of the scans, shape (scan,) [s]."

    ranges: npt.NDArray[Any]
    "Ranges in steps of `scale`, shape (scan, beam)."

    intensity: npt.NDArray[Any] | None
    "Intensities, if they were recorded, shape (scan, beam) [counts]."

    scale: float
    "Step of the ranges [m]."

    missing: Any
    "Stored number of a beam without return."

    screening: Screening
    "Which returns are flagged."

    weights: tuple[int, int]
    "Weights of good and of flagged returns."

    def __post_init__(self) -> None:
        """Check the shapes, and that there are intensities if screening needs them."""
        shape = (self.time.size, self.geometry.angle.size)
        if any(each is not None and each.shape != shape for each in (self.ranges, self.intensity)):
            message = f"ranges and intensity must have the shape {shape}, got {self.ranges.shape}."
            raise ValueError(message)
        if self.screening.needs_intensity and self.intensity is None:
            message = "floor and saturation need intensities, which were not recorded."
            raise ValueError(message)

    def of(self, some: slice | npt.NDArray[np.bool_]) -> "StoredReturns":
        """Returns of some of the scans."""
        intensity = None if self.intensity is None else self.intensity[some]
        return replace(self, time=self.time[some], ranges=self.ranges[some], intensity=intensity)

    def covered(self) -> "StoredReturns":
        """Returns of the scans that the motion covers."""
        covered = self.geometry.covers(self.time)
        return self if covered.all() else self.of(covered)

    @property
    def arrays(self) -> RangeBlock:
        """The returns as the loop takes them."""
        screening = self.screening
        return RangeBlock(
            self.ranges,
            self.scale,
            self.missing,
            screening.nearest,
            screening.furthest,
            self.intensity if screening.needs_intensity else _NONE,
            screening.floor,
            screening.saturation,
            *self.weights,
        )
