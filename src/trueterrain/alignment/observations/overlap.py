"""Overlaps of passes: the cells that each pass covers, and those that two have in common.

Points are read block by block; a count and a sum of heights is kept for each cell of a coarse grid.
Sums are integers, so cells do not depend on the blocks.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.alignment.observations.sparse_sums import (
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

#: Points of a pass: one dataset, or blocks that can be iterated repeatedly.
PassPoints = xr.Dataset | Iterable[xr.Dataset] | Callable[[], Iterable[xr.Dataset]]

#: Resolution of the sums of heights [m].
STEP = 1e-5

_CHUNK = 1 << 20  # [points] read at a time, so that sums of their heights are exact in float64
_CHANCE = 2.0  # standard deviations of a count, for the test of a cut cell
_HALF = (
    2 / 3
)  # count of a cell over the mean with its neighbours, if an edge halves a third of them
_HIGHEST = 10_000.0  # [m] maximum absolute height, for the same reason


@dataclass(frozen=True, kw_only=True, eq=False)
class OccupiedCells:
    """Cells of a map grid in which a pass has returns."""

    cell: float
    "Size of the cells [m]."

    key: Integers
    "Packed numbers of the cells, ascending, shape (n,)."

    count: Integers
    "Number of returns in each, shape (n,)."

    total: Integers
    "Sum of their heights in steps of `STEP`, shape (n,)."

    crs: str = ""
    "Coordinate reference system; empty if it is not known."

    left_out: int = 0
    "Number of points that are not finite, or whose height exceeds 10 km."

    @property
    def height(self) -> Floats:
        """Mean height of each cell, shape (n,) [m]."""
        return np.asarray(self.total / self.count * STEP)

    @cached_property
    def covered(self) -> Integers:
        """Cells that the pass covers.

        Cells with returns, without those cut by the edge, whose count is significantly less than
        that of their neighbours, and with holes one cell wide closed.
        """
        whole = self.key[~self._cut()]
        between = [
            whole[contains_keys(whole, whole + 2 * step) & ~contains_keys(whole, whole + step)]
            + step
            for step in STRAIGHT
        ]
        # a stable sort is linear on nearly sorted values
        key = np.sort(np.concatenate([whole, *between]), kind="stable")
        return key[np.diff(key, prepend=-1) > 0]

    def _cut(self) -> Flags:
        """Whether less than half of a cell lies inside the edge of the pass."""
        total, cells = self.count.astype(float), np.ones(self.key.size)
        for step in AROUND:
            at = np.minimum(np.searchsorted(self.key, self.key + step), self.key.size - 1)
            there = self.key[at] == self.key + step
            total += np.where(there, self.count[at], 0)
            cells += there
        # upper confidence bound of a Poisson count, so that sparse cells are kept
        upper = self.count + _CHANCE * np.sqrt(self.count)
        return np.asarray(upper < _HALF * total / cells)


@dataclass(frozen=True, kw_only=True, eq=False)
class Overlap:
    """Overlap of two passes: the cells that both cover."""

    names: tuple[str, str]
    "Names of the passes."

    cells: tuple[OccupiedCells, OccupiedCells]
    "Cells of both passes."

    key: Integers
    "Keys of the cells that both cover, ascending, shape (n,)."

    @property
    def cell(self) -> float:
        """Size of the cells [m]."""
        return self.cells[0].cell

    @property
    def area(self) -> float:
        """Area that both passes cover [m²], in whole cells."""
        return self.key.size * self.cell**2

    @property
    def centres(self) -> tuple[Floats, Floats]:
        """Eastings and northings of the centres of the cells, shape (n,) each [m]."""
        return cell_centres(self.key, self.cell)

    @cached_property
    def shared(self) -> tuple[Integers, Integers, Floats]:
        """Cells with returns of both: keys (m,), counts (2, m), mean heights (2, m) [m]."""
        key, a, b = np.intersect1d(
            self.cells[0].key, self.cells[1].key, assume_unique=True, return_indices=True
        )
        picked = tuple(zip(self.cells, (a, b), strict=True))
        count = np.stack([cells.count[at] for cells, at in picked])
        return key, count, np.stack([cells.height[at] for cells, at in picked])

    def holds(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> Flags:
        """Whether positions lie in the overlap.

        Parameters
        ----------
        easting, northing : array_like
            Positions [m].

        Returns
        -------
        numpy.ndarray of bool
            In the shape of the positions.
        """
        return contains_keys(self.key, cell_keys(easting, northing, self.cell))


def point_blocks(points: PassPoints) -> Iterator[xr.Dataset]:
    """Yield the points of a pass in blocks.

    Parameters
    ----------
    points : xarray.Dataset, iterable of them, or function that returns one
        Points of the pass.

    Yields
    ------
    xarray.Dataset
        Points.

    Raises
    ------
    ValueError
        If the points are an iterator, which is exhausted after one iteration.
    """
    if isinstance(points, xr.Dataset):
        yield points
        return
    blocks = points() if callable(points) else points
    if not callable(points) and iter(blocks) is blocks:
        message = (
            "a pass must be a dataset, a sequence of them or a function that returns blocks, got "
            "an iterator, which is exhausted after one iteration."
        )
        raise ValueError(message)
    yield from blocks


def height_steps(block: xr.Dataset) -> Iterator[tuple[Floats, Floats, Integers, int]]:
    """Yield finite points of a block in chunks, with heights in integer steps.

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
        Number of points left out of the chunk.
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


def occupied_cells(points: PassPoints, cell: float = 0.1, *, name: str = "") -> OccupiedCells:
    """Accumulate the points of a pass in cells.

    Parameters
    ----------
    points : xarray.Dataset, iterable of them, or function that returns one
        Points of the pass.
    cell : float
        Size of the cells [m].
    name : str
        Name of the pass, for messages.

    Returns
    -------
    OccupiedCells
        Independent of blocks and order of the points.

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
    place = f"pass {name}" if name else "pass"
    known: str | None = None
    for block in point_blocks(points):
        crs = str(block.attrs.get("crs", ""))
        if known is not None and crs != known:
            raise _different_crs(place, crs, "the blocks before it", known)
        known = crs
        for x, y, height, bad in height_steps(block):
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


def find_overlap(
    first: OccupiedCells, second: OccupiedCells, *, names: tuple[str, str] = ("first", "second")
) -> Overlap | None:
    """Find the cells that two passes cover.

    Parameters
    ----------
    first, second : OccupiedCells
        Cells of both passes.
    names : tuple of str
        Their names.

    Returns
    -------
    Overlap or None
        None if the passes do not overlap.

    Raises
    ------
    ValueError
        If the cells are of different sizes.
    SchemaError
        If the passes have different coordinate reference systems.
    TrueTerrainError
        If both passes hold the same points.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> one = occupied_cells(make_points([0.5, 1.5, 2.5], [0.5] * 3, [0.0] * 3), 1.0)
    >>> two = occupied_cells(make_points([2.4, 3.4, 4.4], [0.5] * 3, [0.1] * 3), 1.0)
    >>> find_overlap(one, two).area
    1.0
    """
    if first.cell != second.cell:
        message = f"cells must have one size, got {first.cell} and {second.cell} m."
        raise ValueError(message)
    if first.crs != second.crs:
        raise _different_crs(f"pass {names[1]}", second.crs, f"pass {names[0]}", first.crs)
    if all(
        np.array_equal(getattr(first, name), getattr(second, name))
        for name in ("key", "count", "total")
    ):
        raise TrueTerrainError(
            f"holds the same points as pass {names[0]}",
            place=f"pass {names[1]}",
            cure="Name each pass once.",
        )
    key = np.intersect1d(first.covered, second.covered, assume_unique=True)
    return Overlap(names=names, cells=(first, second), key=key) if key.size else None


def _different_crs(place: str, crs: str, other: str, known: str) -> SchemaError:
    def shortened(name: str) -> str:
        return repr(name if len(name) < 40 else name[:36] + " ...") if name else "unknown"

    return SchemaError(
        f"has the coordinate reference system {shortened(crs)}, but that of {other} is "
        f"{shortened(known)}",
        place=place,
        cure="Transform all passes to one, or state it with --crs.",
    )


def cell_centres(key: Integers, cell: float) -> tuple[Floats, Floats]:
    """Eastings and northings of the centres of cells [m]."""
    column, row = unpack_cell(key)
    return np.asarray((column + 0.5) * cell), np.asarray((row + 0.5) * cell)


def cell_keys(easting: npt.ArrayLike, northing: npt.ArrayLike, cell: float) -> Integers:
    """Keys of the cells that contain positions."""
    x, y = (np.floor(np.asarray(at, float) / cell).astype(np.int64) for at in (easting, northing))
    return pack_cell(x, y)
