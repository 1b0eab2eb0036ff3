"""Cells that several passes saw, brought together: the observations of the adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.observations.cells import PassCells
from trueterrain.core.errors import CoverageError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Number = TypeVar("Number", np.int64, np.float64)

_WINDOW = 500.0  # [m] side of the squares of which a part is taken
_MIX = np.int64(0x5851F42D4C957F2D)
_LEAST_FREE = 6  # returns with fewer are lent the scatter of others, as if they had some more


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedCells:
    """Cells that are seen at least twice, entry by entry; those of a cell follow each other.

    Passes are in an order of their own, whatever order they were given in.
    """

    names: tuple[str, ...]
    "Names of the passes, those that are corrected and those that are fixed, then of control."

    fixed: npt.NDArray[np.bool_]
    "Which of them get no correction, shape (lane,)."

    span: Floats
    "First and last time of all cells of each, shape (lane, 2) [s] or [m]."

    entries: PassCells
    "All entries; heights are brought to the mean place of their cell, on its plane."

    lane: Integers
    "Pass of each entry, shape (n,)."

    start: Integers
    "First entry of each cell, and their number, shape (cell + 1,)."

    usable: npt.NDArray[np.bool_]
    "False for entries that are grossly wrong, shape (n,)."

    group: Integers
    "Passes that share ground, directly or by others, have the same number, shape (lane,)."

    @property
    def cells(self) -> int:
        """Cells that are seen at least twice."""
        return self.start.size - 1

    def mean(self, values: Floats) -> Floats:
        """Mean of some values over the entries of each cell, shape (cell,)."""
        return np.add.reduceat(values, self.start[:-1]) / np.diff(self.start)

    def per_entry(self, values: npt.NDArray[Number]) -> npt.NDArray[Number]:
        """What holds for cells, entry by entry, shape (n,)."""
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
            The same number for the same place.
        """
        x = np.floor(self.mean(self.entries.easting) / size).astype(np.int64)
        y = np.floor(self.mean(self.entries.northing) / size).astype(np.int64)
        return x * np.int64(1 << 31) + y


def find_shared_cells(
    lanes: Sequence[PassCells], control: Sequence[PassCells], fixed: Sequence[str]
) -> SharedCells:
    """Cells that are seen at least twice.

    Parameters
    ----------
    lanes : sequence of LaneCells
        The passes.
    control : sequence of LaneCells
        Heights that are known, with their variances.
    fixed : sequence of str
        Names of passes that get no correction.

    Returns
    -------
    Shared
        The same whatever the order of the passes and of their cells.

    Raises
    ------
    ValueError
        If names are not unique, or a fixed one is not among them.
    CoverageError
        If there are no cells in a pass, or none is seen twice.
    """
    _check_names(lanes, control, fixed)
    ordered = [*sorted(lanes, key=lambda one: one.name), *sorted(control, key=lambda one: one.name)]
    for one in ordered:
        if not len(one):
            raise CoverageError(f"{one.name} has no cells", cure="Choose larger cells.")
    still = np.array([one in control or one.name in fixed for one in ordered])
    span = np.array([[one.time.min(), one.time.max()] for one in ordered])
    lane = np.repeat(np.arange(len(ordered)), [len(one) for one in ordered])
    cell = np.concatenate([one.cell for one in ordered])
    time = np.concatenate([one.time for one in ordered])
    order = np.lexsort((time, lane, cell))
    _, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    # control alone, and passes that are fixed, tell nothing about the others
    free = np.add.reduceat((~still)[lane[order]].astype(int), first)
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
        fixed=still,
        span=span,
        entries=_on_their_plane(merged, start),
        lane=lane[order].astype(np.int64),
        start=start,
        usable=np.ones(order.size, bool),
        group=_pass_groups(lane[order], start, len(ordered)),
    )


def sample_ground(shared: SharedCells, cells: int) -> tuple[SharedCells, Integers]:
    """Part of the ground, in large squares; what passes are in each stands for passes of its own.

    Parameters
    ----------
    shared : Shared
        All cells.
    cells : int
        How many are wanted; of the squares, as many are taken as are needed.

    Returns
    -------
    Shared
        The same if there are no more cells than that.
    numpy.ndarray of int, shape (lane,)
        Which pass each of its passes is part of.
    """
    if shared.cells <= cells:
        return shared, np.arange(len(shared.names))
    squares, index, count = np.unique(
        shared.squares(_WINDOW), return_inverse=True, return_counts=True
    )
    order = np.argsort(hash_integers(squares), kind="stable")
    order = order[2 * count[order] >= np.median(count)]  # no slivers
    taken = order[: int(np.searchsorted(np.cumsum(count[order]), cells)) + 1]
    kept = np.flatnonzero(np.isin(index, taken))
    each = np.diff(shared.start)[kept]
    start = np.concatenate([[0], np.cumsum(each)]).astype(np.int64)
    pick = np.repeat(shared.start[kept] - start[:-1], each) + np.arange(start[-1])
    key = np.repeat(index[kept], each) * len(shared.names) + shared.lane[pick]
    keys, lane = np.unique(key, return_inverse=True)
    of = keys % len(shared.names)
    entries = shared.entries.part(pick)
    low, high = np.full(keys.size, np.inf), np.full(keys.size, -np.inf)
    np.minimum.at(low, lane, entries.time)
    np.maximum.at(high, lane, entries.time)
    return SharedCells(
        names=tuple(shared.names[k] for k in of),
        fixed=shared.fixed[of],
        span=np.stack([low, high], axis=1),
        entries=entries,
        lane=lane.astype(np.int64),
        start=start,
        usable=shared.usable[pick],
        group=_pass_groups(lane, start, keys.size),
    ), of


def hash_integers(values: Integers) -> Integers:
    """Numbers that look random, the same for the same value, not negative."""
    with np.errstate(over="ignore"):
        mixed = (values * _MIX) ^ ((values * _MIX) >> np.int64(29))
        return np.asarray((mixed * _MIX) >> np.int64(33)) & np.int64((1 << 30) - 1)


def _check_names(
    lanes: Sequence[PassCells], control: Sequence[PassCells], fixed: Sequence[str]
) -> None:
    names = [one.name for one in [*lanes, *control]]
    if not lanes:
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
    """All entries in one, the scatter of few returns pooled with that of the whole pass."""
    parts = []
    for one in ordered:
        scatter = one.variance * one.count
        free = np.maximum(one.count - 3.0, 0.0)
        usual = float(np.median(scatter))
        pooled = (free * scatter + _LEAST_FREE * usual) / (free + _LEAST_FREE)
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
            "ahead",
        )
    }
    return PassCells(name="all", **columns)


def _on_their_plane(entries: PassCells, start: Integers) -> PassCells:
    """Entries with the slope of all passes, and heights at the mean place of their cell."""
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


def _pass_groups(lane: Integers, start: Integers, lanes: int) -> Integers:
    """Number of the group of passes that each pass belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first = np.repeat(lane[start[:-1]], np.diff(start))
    links = coo_array((np.ones(lane.size), (first, lane)), shape=(lanes, lanes))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
