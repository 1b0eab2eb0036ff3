"""Where lanes lie over each other: cells in which they have returns, and what they share.

Points stream by, block after block; what stays is a count and a sum of heights for each cell of a
coarse grid that a lane touches. Sums are whole numbers, so cells do not depend on the blocks.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.alignment.discontinuity.sparse_sums import (
    AROUND,
    STRAIGHT,
    Flags,
    Floats,
    Integers,
    SparseSums,
    contains_keys,
    pack_cell,
    unpack_cell,
)
from trueterrain.core.errors import CoverageError, SchemaError, TrueTerrainError

#: Points of a lane: at once, or as blocks that can be gone through several times.
LanePoints = xr.Dataset | Iterable[xr.Dataset] | Callable[[], Iterable[xr.Dataset]]

#: Step in which heights are added up [m].
STEP = 1e-5

_CHUNK = 1 << 20  # [points] looked at a time: sums of their heights stay exact in float64
_CHANCE = 2.0  # standard deviations of a count
_HALF = 2 / 3  # of the mean of a cell and its neighbours, if an edge leaves half of each third
_HIGHEST = 10_000.0  # [m] for the same reason


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupiedCells:
    """Cells of a map grid in which a lane has returns."""

    cell: float
    "Size of the cells [m]."

    key: Integers
    "Packed numbers of the cells, ascending, shape (n,)."

    count: Integers
    "Returns in each, shape (n,)."

    total: Integers
    "Sum of their heights in steps of `STEP`, shape (n,)."

    crs: str = ""
    "Coordinate reference system; empty if it is not known."

    left_out: int = 0
    "Points that are not finite or higher or lower than 10 km."

    @property
    def height(self) -> Floats:
        """Mean height of each cell, shape (n,) [m]."""
        return np.asarray(self.total / self.count * STEP)

    @cached_property
    def covered(self) -> Integers:
        """Cells that the lane covers.

        Those with returns, but for such as its edge cuts, which hold clearly less than their
        neighbours; and holes one cell wide.
        """
        whole = self.key[~self._cut()]
        between = [
            whole[contains_keys(whole, whole + 2 * step) & ~contains_keys(whole, whole + step)]
            + step
            for step in STRAIGHT
        ]
        # stable, which is linear for what is all but sorted
        key = np.sort(np.concatenate([whole, *between]), kind="stable")
        return key[np.diff(key, prepend=-1) > 0]

    def _cut(self) -> Flags:
        """Whether an edge of the lane cuts a cell so that less than half of it is left."""
        total, cells = self.count.astype(float), np.ones(self.key.size)
        for step in AROUND:
            at = np.minimum(np.searchsorted(self.key, self.key + step), self.key.size - 1)
            there = self.key[at] == self.key + step
            total += np.where(there, self.count[at], 0)
            cells += there
        # less than it could be by chance, so that cells of few points all count
        likely = self.count + _CHANCE * np.sqrt(self.count)
        return np.asarray(likely < _HALF * total / cells)


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlap:
    """Cells that two lanes share."""

    lanes: tuple[str, str]
    "Names of the lanes."

    cells: tuple[OccupiedCells, OccupiedCells]
    "All cells of both."

    key: Integers
    "Cells that both cover, to half a cell, ascending, shape (n,)."

    @property
    def cell(self) -> float:
        """Size of the cells [m]."""
        return self.cells[0].cell

    @property
    def area(self) -> float:
        """Area that both lanes cover [m²]; cells of which their edges leave half count whole."""
        return self.key.size * self.cell**2

    @property
    def centres(self) -> tuple[Floats, Floats]:
        """Eastings and northings of the centres of the cells, shape (n,) each [m]."""
        return cell_centres(self.key, self.cell)

    @cached_property
    def shared(self) -> tuple[Integers, Integers, Floats]:
        """Cells with returns of both: keys (m,), counts (2, m) and mean heights (2, m) [m]."""
        key, a, b = np.intersect1d(
            self.cells[0].key, self.cells[1].key, assume_unique=True, return_indices=True
        )
        picked = tuple(zip(self.cells, (a, b), strict=True))
        count = np.stack([cells.count[at] for cells, at in picked])
        return key, count, np.stack([cells.height[at] for cells, at in picked])

    def holds(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> Flags:
        """Whether places lie in the overlap.

        Parameters
        ----------
        easting, northing : array_like
            Places [m].

        Returns
        -------
        numpy.ndarray of bool
            In the shape of the places.
        """
        return contains_keys(self.key, cell_keys(easting, northing, self.cell))


def lane_blocks(points: LanePoints) -> Iterator[xr.Dataset]:
    """Blocks of the points of a lane.

    Parameters
    ----------
    points : xarray.Dataset, iterable of them, or function that returns one
        The lane.

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    ValueError
        If the lane is an iterator, which can be gone through only once.
    """
    if isinstance(points, xr.Dataset):
        yield points
        return
    blocks = points() if callable(points) else points
    if not callable(points) and iter(blocks) is blocks:
        message = (
            "a lane must be a dataset, a sequence of them or a function that returns blocks, got "
            "an iterator, which can be gone through only once."
        )
        raise ValueError(message)
    yield from blocks


def heights_of(block: xr.Dataset) -> Iterator[tuple[Floats, Floats, Integers, int]]:
    """Chunks of a block of points: those that are finite, with heights in whole steps.

    Parameters
    ----------
    block : xarray.Dataset
        Points.

    Yields
    ------
    easting, northing : numpy.ndarray, shape (point,)
        Coordinates [m].
    height : numpy.ndarray of int64, shape (point,)
        Heights in steps of `STEP`.
    left_out : int
        Points of the chunk that are not among them.
    """
    x, y, z = (
        np.ravel(np.asarray(block[name], dtype=np.float64))
        for name in ("easting", "northing", "up")
    )
    for begin in range(0, x.size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        good = np.isfinite(x[part]) & np.isfinite(y[part]) & (np.abs(z[part]) < _HIGHEST)
        height = np.rint(z[part][good] / STEP).astype(np.int64)
        yield x[part][good], y[part][good], height, int(good.size - good.sum())


def occupied_cells(points: LanePoints, cell: float = 0.1, *, name: str = "") -> OccupiedCells:
    """Sort the points of a lane into cells.

    Parameters
    ----------
    points : xarray.Dataset, iterable of them, or function that returns one
        Points of the lane, at once or in blocks.
    cell : float
        Size of the cells [m].
    name : str
        Name of the lane, for messages.

    Returns
    -------
    OccupiedCells
        The same for any blocks and any order of the points.

    Raises
    ------
    ValueError
        If the size is not greater than 0.
    CoverageError
        If there is no point.
    SchemaError
        If blocks have different coordinate reference systems.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> cells = occupied_cells(make_points([0.01, 0.02, 5.0], [0.0, 0.0, 0.0], [1.0, 1.002, 1.1]))
    >>> cells.count, cells.height
    (array([2, 1]), array([1.001, 1.1 ]))
    """
    if not 0 < cell < np.inf:
        message = f"cell must be greater than 0 m, got {cell}."
        raise ValueError(message)
    sums, left_out = SparseSums(2), 0
    place = f"lane {name}" if name else "lane"
    known: str | None = None
    for block in lane_blocks(points):
        crs = str(block.attrs.get("crs", ""))
        if known is not None and crs != known:
            raise _different_crs(place, crs, "the blocks before it", known)
        known = crs
        for x, y, height, bad in heights_of(block):
            left_out += bad
            sums.add(*(np.floor(at / cell).astype(np.int64) for at in (x, y)), height)
    column, row, (count, total) = sums.sums()
    if not count.size:
        raise CoverageError(
            f"holds no point with finite coordinates ({left_out} others)",
            place=place,
            cure="Leave it out.",
        )
    return OccupiedCells(
        cell=cell,
        key=pack_cell(column, row),
        count=count,
        total=total,
        crs=known or "",
        left_out=left_out,
    )


def overlap_of(
    first: OccupiedCells, second: OccupiedCells, *, lanes: tuple[str, str] = ("first", "second")
) -> Overlap | None:
    """Cells that two lanes share.

    Parameters
    ----------
    first, second : OccupiedCells
        Cells of both lanes.
    lanes : tuple of str
        Their names.

    Returns
    -------
    Overlap or None
        None if there is no ground that both cover.

    Raises
    ------
    ValueError
        If the cells are of different sizes.
    SchemaError
        If the lanes have different coordinate reference systems.
    TrueTerrainError
        If both hold the same points.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> one = occupied_cells(make_points([0.5, 1.5, 2.5], [0.5] * 3, [0.0] * 3), 1.0)
    >>> two = occupied_cells(make_points([2.4, 3.4, 4.4], [0.5] * 3, [0.1] * 3), 1.0)
    >>> overlap_of(one, two).area
    1.0
    """
    if first.cell != second.cell:
        message = f"cells must have one size, got {first.cell} and {second.cell} m."
        raise ValueError(message)
    if first.crs != second.crs:
        raise _different_crs(f"lane {lanes[1]}", second.crs, f"lane {lanes[0]}", first.crs)
    if all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("key", "count", "total")
    ):
        raise TrueTerrainError(
            f"holds the same points as lane {lanes[0]}",
            place=f"lane {lanes[1]}",
            cure="Give each pass once.",
        )
    key = np.intersect1d(first.covered, second.covered, assume_unique=True)
    return Overlap(lanes=lanes, cells=(first, second), key=key) if key.size else None


def _different_crs(place: str, crs: str, other: str, known: str) -> SchemaError:
    def said(name: str) -> str:
        return repr(name if len(name) < 40 else name[:36] + " ...") if name else "unknown"

    return SchemaError(
        f"has the coordinate reference system {said(crs)}, but that of {other} is {said(known)}",
        place=place,
        cure="Bring all lanes into one, or state it with --crs.",
    )


def cell_centres(key: Integers, cell: float) -> tuple[Floats, Floats]:
    """Eastings and northings of the centres of cells [m]."""
    column, row = unpack_cell(key)
    return np.asarray((column + 0.5) * cell), np.asarray((row + 0.5) * cell)


def cell_keys(easting: npt.ArrayLike, northing: npt.ArrayLike, cell: float) -> Integers:
    """Packed numbers of the cells in which places lie."""
    x, y = (np.floor(np.asarray(at, float) / cell).astype(np.int64) for at in (easting, northing))
    return pack_cell(x, y)
