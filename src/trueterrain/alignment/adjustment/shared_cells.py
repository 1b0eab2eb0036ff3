"""Observations of the adjustment: cells that passes have in common."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from trueterrain.alignment.observations.cells import PassCells
from trueterrain.core.errors import CoverageError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Number = TypeVar("Number", np.int64, np.float64)

_WINDOW = 500.0  # [m] side of the squares in which ground is sampled
_MIX = np.int64(0x5851F42D4C957F2D)
_PRIOR_RETURNS = 6  # degrees of freedom given to the median scatter of the pass when pooling


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedCells:
    """Cells seen at least twice, as entries; the entries of a cell are contiguous.

    An entry is one cell as one pass saw it at one visit. Passes are sorted by name.
    """

    names: tuple[str, ...]
    "Names of the passes, corrected or fixed, then of control."

    fixed: npt.NDArray[np.bool_]
    "True for passes and control without correction, shape (pass,)."

    span: Floats
    "First and last time of all cells of each, shape (pass, 2) [s] or [m]."

    entries: PassCells
    "All entries; heights are reduced to the mean position of their cell along its plane."

    pass_index: Integers
    "Pass of each entry, shape (n,)."

    start: Integers
    "First entry of each cell, then the number of entries, shape (cell + 1,)."

    usable: npt.NDArray[np.bool_]
    "False for gross errors, shape (n,)."

    group: Integers
    "Number of the group of connected passes, shape (pass,)."

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.start.size - 1

    def mean(self, values: Floats) -> Floats:
        """Mean of some values over the entries of each cell, shape (cell,)."""
        return np.add.reduceat(values, self.start[:-1]) / np.diff(self.start)

    def per_entry(self, values: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """Values of cells repeated for their entries, shape (n,)."""
        return np.repeat(values, np.diff(self.start))

    def squares(self, size: float) -> Integers:
        """Square of the ground in which each cell lies.

        Parameters
        ----------
        size : float
            Side of the squares [m].

        Returns
        -------
        numpy.ndarray of int, shape (cell,)
            The same number for the same position.
        """
        x = np.floor(self.mean(self.entries.easting) / size).astype(np.int64)
        y = np.floor(self.mean(self.entries.northing) / size).astype(np.int64)
        return x * np.int64(1 << 31) + y


def find_shared_cells(
    passes: Sequence[PassCells], control: Sequence[PassCells], fixed: Sequence[str]
) -> SharedCells:
    """Find the cells that are seen at least twice, by two passes or by one.

    Parameters
    ----------
    passes : sequence of PassCells
        Cells of the passes.
    control : sequence of PassCells
        Cells of control points, with their variances.
    fixed : sequence of str
        Names of passes that get no correction.

    Returns
    -------
    SharedCells
        Independent of the order of passes and of their cells.

    Raises
    ------
    ValueError
        If names are not unique, or a fixed one is not among them.
    CoverageError
        If a pass has no cells, or no cell is seen twice.
    """
    _check_names(passes, control, fixed)
    ordered = [
        *sorted(passes, key=lambda one: one.name),
        *sorted(control, key=lambda one: one.name),
    ]
    for one in ordered:
        if not len(one):
            raise CoverageError(f"{one.name} has no cells", cure="Choose larger cells.")
    constant = np.array([one in control or one.name in fixed for one in ordered])
    span = np.array([[one.time.min(), one.time.max()] for one in ordered])
    pass_index = np.repeat(np.arange(len(ordered)), [len(one) for one in ordered])
    cell = np.concatenate([one.cell for one in ordered])
    time = np.concatenate([one.time for one in ordered])
    order = np.lexsort((time, pass_index, cell))
    _, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    # cells of control and fixed passes alone hold no information on corrections
    free = np.add.reduceat((~constant)[pass_index[order]].astype(int), first)
    kept = np.flatnonzero((count >= 2) & (free > 0))
    if not kept.size:
        raise CoverageError(
            "no cell is seen by two passes, or twice by one",
            cure="Compare their CRS and places (`trueterrain info`), or choose larger cells.",
        )
    within = np.concatenate([[0], np.cumsum(count[kept])])
    pick = np.repeat(first[kept] - within[:-1], count[kept]) + np.arange(within[-1])
    order = order[pick]
    merged = _merge_cells(ordered, order)
    start = within.astype(np.int64)
    return SharedCells(
        names=tuple(one.name for one in ordered),
        fixed=constant,
        span=span,
        entries=_reduce_heights(merged, start),
        pass_index=pass_index[order].astype(np.int64),
        start=start,
        usable=np.ones(order.size, bool),
        group=_pass_groups(pass_index[order], start, len(ordered)),
    )


def sample_ground(shared: SharedCells, cells: int) -> tuple[SharedCells, Integers]:
    """Sample the ground in large squares; each part of a pass counts as a pass of its own.

    Parameters
    ----------
    shared : SharedCells
        All cells.
    cells : int
        Number of cells; as many squares are taken as are needed.

    Returns
    -------
    SharedCells
        The same object if there are no more cells than that.
    numpy.ndarray of int, shape (pass,)
        Original pass of each of its passes.
    """
    if shared.cells <= cells:
        return shared, np.arange(len(shared.names))
    squares, index, count = np.unique(
        shared.squares(_WINDOW), return_inverse=True, return_counts=True
    )
    order = np.argsort(hash_integers(squares), kind="stable")
    order = order[2 * count[order] >= np.median(count)]  # no partly covered squares
    taken = order[: int(np.searchsorted(np.cumsum(count[order]), cells)) + 1]
    kept = np.flatnonzero(np.isin(index, taken))
    each = np.diff(shared.start)[kept]
    start = np.concatenate([[0], np.cumsum(each)]).astype(np.int64)
    pick = np.repeat(shared.start[kept] - start[:-1], each) + np.arange(start[-1])
    key = np.repeat(index[kept], each) * len(shared.names) + shared.pass_index[pick]
    keys, pass_index = np.unique(key, return_inverse=True)
    of = keys % len(shared.names)
    entries = shared.entries.part(pick)
    low, high = np.full(keys.size, np.inf), np.full(keys.size, -np.inf)
    np.minimum.at(low, pass_index, entries.time)
    np.maximum.at(high, pass_index, entries.time)
    return SharedCells(
        names=tuple(shared.names[k] for k in of),
        fixed=shared.fixed[of],
        span=np.stack([low, high], axis=1),
        entries=entries,
        pass_index=pass_index.astype(np.int64),
        start=start,
        usable=shared.usable[pick],
        group=_pass_groups(pass_index, start, keys.size),
    ), of


def hash_integers(values: Integers) -> Integers:
    """Hash to non-negative integers: a deterministic shuffle."""
    with np.errstate(over="ignore"):
        mixed = (values * _MIX) ^ ((values * _MIX) >> np.int64(29))
        return np.asarray((mixed * _MIX) >> np.int64(33)) & np.int64((1 << 30) - 1)


def _check_names(
    passes: Sequence[PassCells], control: Sequence[PassCells], fixed: Sequence[str]
) -> None:
    names = [one.name for one in [*passes, *control]]
    if not passes:
        message = "there must be at least one pass."
        raise ValueError(message)
    for name in names:
        if names.count(name) > 1:
            message = f"passes must have names that differ, got {name!r} {names.count(name)} times."
            raise ValueError(message)
    for name in fixed:
        if name not in names:
            message = f"fixed must name passes, got {name!r}; there are {', '.join(sorted(names))}."
            raise ValueError(message)


def _merge_cells(ordered: list[PassCells], order: Integers) -> PassCells:
    """Concatenate entries, with the scatter of few returns pooled with that of the pass."""
    parts = []
    for one in ordered:
        scatter = one.variance * one.count
        free = np.maximum(one.count - 3.0, 0.0)
        # weighted mean of two variances by their degrees of freedom; a plane takes 3
        typical = float(np.median(scatter))
        pooled = (free * scatter + _PRIOR_RETURNS * typical) / (free + _PRIOR_RETURNS)
        parts.append(replace(one, variance=pooled / one.count, sd_time=None, sd_height=None))
    columns = {
        name: np.concatenate([getattr(one, name) for one in parts])[order]
        for name in (
            "cell",
            "time",
            "easting",
            "northing",
            "height",
            "variance",
            "count",
            "slope_east",
            "slope_north",
            "offset",
            "longitudinal",
        )
    }
    return PassCells(name="all", **columns)


def _reduce_heights(entries: PassCells, start: Integers) -> PassCells:
    """Reduce heights to the mean position of their cell along its mean slope."""
    first, each = start[:-1], np.diff(start)
    total = np.add.reduceat(entries.count.astype(float), first)

    def mean(values: Floats) -> Floats:
        return np.repeat(np.add.reduceat(values * entries.count, first) / total, each)

    east, north = mean(entries.slope_east), mean(entries.slope_north)
    height = (
        entries.height
        - east * (entries.easting - mean(entries.easting))
        - north * (entries.northing - mean(entries.northing))
    )
    return replace(entries, height=height, slope_east=east, slope_north=north)


def _pass_groups(pass_index: Integers, start: Integers, pass_count: int) -> Integers:
    """Connected components of the passes, linked by common cells."""
    first = np.repeat(pass_index[start[:-1]], np.diff(start))
    links = coo_array(
        (np.ones(pass_index.size), (first, pass_index)), shape=(pass_count, pass_count)
    )
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
