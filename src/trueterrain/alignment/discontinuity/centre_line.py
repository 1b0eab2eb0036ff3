"""The middle of an overlap, found from its cells alone, whatever way it runs."""

from typing import Any

import numpy as np

from trueterrain.alignment.discontinuity.low_pass import low_pass
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.discontinuity.reference_path import waypoint_reference
from trueterrain.alignment.discontinuity.sparse_sums import (
    Floats,
    Integers,
    contains_keys,
    pack_cell,
    unpack_cell,
)
from trueterrain.alignment.observations.overlap import Overlap, cell_centres, cell_keys

_MOST_OF_IT = 0.95  # of the cells in one piece are enough
_COARSEST = 64  # cells that are taken together at most, to bridge what separates pieces
_BAND = 1.6  # cells to either side of a line across the overlap, so that it is one piece
_BRANCH = 0.25  # of the larger branch of a ring, which the smaller one has at least
_PARTS = (0.3, 0.4, 0.5, 0.6, 0.7)  # of the way along, where branches are counted
_ROUNDS = 3  # in which the path is moved to the middle
_LEVELS = 6  # lines across the overlap at least


def centre_waypoints(
    overlap: Overlap, spacing: float, smoothing: float
) -> tuple[Floats, Floats, bool]:
    """Points along the middle of the longest piece of an overlap.

    Parameters
    ----------
    overlap : Overlap
        The overlap.
    spacing : float
        Distance of the points [m].
    smoothing : float
        Wavelength below which they do not follow the edges [m].

    Returns
    -------
    easting, northing : numpy.ndarray, shape (n,)
        Points [m].
    closed : bool
        Whether the overlap is a ring.

    Raises
    ------
    ValueError
        If it is too short.
    """
    key, cell = _one_piece(overlap.key, overlap.cell)
    levels, step, closed = _level_set_centres(key, cell)
    nodes = _smooth_nodes(levels, step, smoothing, closed)
    nodes = nodes if closed else _extend_ends(nodes, 2 * step)
    fine = min(spacing, max(overlap.cell, spacing / 4))
    path = waypoint_reference(*nodes.T, spacing=fine, closed=closed)
    own = _cells_of_piece(overlap, key, cell)
    for _ in range(_ROUNDS):
        centre, _ = cross_extent(own, overlap.cell, path, max(fine, 6 * overlap.cell))
        shift = low_pass(centre, path.spacing, smoothing, closed=closed)
        east, north = path.at(path.station, shift)
        path = waypoint_reference(east, north, spacing=fine, closed=closed)
    if closed:
        return _orient_path(path, closed)
    found = path.locate(*cell_centres(own, overlap.cell))
    inside = found.station[~found.beyond]
    if not inside.size or np.ptp(inside) < 2 * spacing:
        message = f"it is {float(np.ptp(inside)) if inside.size else 0.0:g} m long"
        raise ValueError(message)
    kept = (path.station >= inside.min()) & (path.station <= inside.max())
    return _orient_path(
        ReferencePath(easting=path.easting[kept], northing=path.northing[kept], spacing=fine),
        closed,
    )


def cross_extent(
    key: Integers, cell: float, path: ReferencePath, length: float
) -> tuple[Floats, Floats]:
    """Middle and width of cells across a path.

    Parameters
    ----------
    key : numpy.ndarray of int64
        The cells.
    cell : float
        Their size [m].
    path : ReferencePath
        The path.
    length : float
        Stretch of the path over which cells count at each reference point [m].

    Returns
    -------
    centre, width : numpy.ndarray, shape (s,)
        Mean offset of the cells, and their area by the stretch [m]; NaN where there are none.
    """
    found = path.locate(*cell_centres(key, cell))
    station, offset = found.station[~found.beyond], found.offset[~found.beyond]
    begin, end = path.station - length / 2, path.station + length / 2
    if path.closed:
        station = np.concatenate([station - path.length, station, station + path.length])
        offset = np.tile(offset, 3)
    order = np.argsort(station, kind="stable")
    station, sums = station[order], np.append(0.0, np.cumsum(offset[order]))
    first, last = np.searchsorted(station, begin), np.searchsorted(station, end)
    count = last - first
    if not path.closed:
        begin, end = np.maximum(begin, 0.0), np.minimum(end, path.length)
    with np.errstate(invalid="ignore"):
        centre = (sums[last] - sums[first]) / np.where(count, count, np.nan)
    return centre, np.where(count, count * cell**2 / (end - begin), np.nan)


def part_of_path(overlap: Overlap, path: ReferencePath) -> Integers:
    """Cells of those pieces of an overlap in which heights are compared along a path.

    Parameters
    ----------
    overlap : Overlap
        The overlap.
    path : ReferencePath
        The path.

    Returns
    -------
    numpy.ndarray of int64
        Packed numbers of the cells, ascending.
    """
    from scipy.sparse.csgraph import connected_components

    _, piece = connected_components(_neighbour_graph(overlap.key), directed=False)
    nodes = cell_keys(*path.places, overlap.cell)
    nodes = nodes[contains_keys(overlap.key, nodes)]
    return overlap.key[np.isin(piece, piece[np.searchsorted(overlap.key, nodes)])]


def _one_piece(key: Integers, cell: float) -> tuple[Integers, float]:
    """Largest piece of the cells, taken together until it holds nearly all of them."""
    from scipy.sparse.csgraph import connected_components

    factor = 1
    while True:
        coarse, index = np.unique(_coarsen_keys(key, factor), return_inverse=True)
        _, piece = connected_components(_neighbour_graph(coarse), directed=False)
        sizes = np.bincount(piece[index])
        if sizes.max() >= _MOST_OF_IT * key.size or factor == _COARSEST:
            return coarse[piece == np.argmax(sizes)], cell * factor
        factor *= 2


def _cells_of_piece(overlap: Overlap, key: Integers, cell: float) -> Integers:
    """Cells of the overlap that belong to a piece of coarser ones."""
    factor = round(cell / overlap.cell)
    return overlap.key[contains_keys(key, _coarsen_keys(overlap.key, factor))]


def _coarsen_keys(key: Integers, factor: int) -> Integers:
    column, row = unpack_cell(key)
    return pack_cell(column // factor, row // factor)


def _neighbour_graph(key: Integers) -> Any:
    """Which cells touch, and how far apart their centres are in cells."""
    from scipy.sparse import coo_array

    column, row = unpack_cell(key)
    rows, columns, apart = [], [], []
    for dc, dr in ((0, 1), (1, -1), (1, 0), (1, 1)):
        other = pack_cell(column + dc, row + dr)
        there = np.flatnonzero(contains_keys(key, other))
        rows.append(there)
        columns.append(np.searchsorted(key, other[there]))
        apart.append(np.full(there.size, np.hypot(dc, dr)))
    entries = np.concatenate(apart), (np.concatenate(rows), np.concatenate(columns))
    return coo_array(entries, shape=(key.size, key.size)).tocsr()


def _level_set_centres(key: Integers, cell: float) -> tuple[Floats, float, bool]:
    """Centres of the cells that are equally far from one end, (n, 2), their distance, if a ring."""
    from scipy.sparse.csgraph import connected_components

    graph = _neighbour_graph(key)
    away = _from_end(graph)
    rings = 0
    for part in _PARTS:
        band = np.flatnonzero(np.abs(away - part * away.max()) <= _BAND)
        _, piece = connected_components(graph[band][:, band], directed=False)
        sizes = np.bincount(piece)
        rings += int((sizes >= _BRANCH * sizes.max()).sum()) == 2
        if part == 0.5:
            wall = band[piece == np.argmax(sizes)]
    closed = 2 * rings > len(_PARTS)
    at = np.stack(cell_centres(key, cell), axis=1)
    if closed:  # cut through one branch, it is a strip from one side of the cut to the other
        rest = np.setdiff1d(np.arange(key.size), wall)
        graph, at = graph[rest][:, rest], at[rest]
        away = _from_end(graph)
        reached = np.isfinite(away)
        away, at = away[reached], at[reached]
    length = float(away.max())
    if not length > 0:
        message = f"its largest piece is one cell of {cell:g} m"
        raise ValueError(message)
    width = away.size / max(length, 1.0)
    count = max(int(length / max(2.0, width)), _LEVELS)
    level = np.minimum((away / (length + 1e-9) * count).astype(np.int64), count - 1)
    quantity = np.bincount(level, minlength=count)
    there = quantity > 0
    sums = np.stack([np.bincount(level, one, minlength=count) for one in at.T], axis=1)
    middle: Floats = sums[there] / quantity[there, None]
    if not closed and middle.shape[0] > 4:
        middle = middle[1:-1]  # those at the ends lie in corners
    return middle, length * cell / count, closed


def _from_end(graph: Any) -> Floats:
    """Distance from a far end of what is connected, through the cells."""
    from scipy.sparse.csgraph import connected_components, dijkstra

    _, piece = connected_components(graph, directed=False)
    start = int(np.argmax(piece == np.argmax(np.bincount(piece))))
    for _ in range(2):
        away = dijkstra(graph, directed=False, indices=start)
        away = np.where(np.isfinite(away), away, -1.0)
        start = int(np.argmax(away))
    return np.asarray(dijkstra(graph, directed=False, indices=start))


def _smooth_nodes(nodes: Floats, step: float, smoothing: float, closed: bool) -> Floats:
    return np.stack([low_pass(one, step, smoothing, closed=closed) for one in nodes.T], axis=1)


def _extend_ends(nodes: Floats, by: float) -> Floats:
    """Straight on at both ends."""

    def on(end: Floats, before: Floats) -> Floats:
        way = end - before
        return np.asarray(end + way * (by / np.hypot(*way)))

    first, last = on(nodes[0], nodes[1]), on(nodes[-1], nodes[-2])
    return np.concatenate([first[None], nodes, last[None]])


def _orient_path(path: ReferencePath, closed: bool) -> tuple[Floats, Floats, bool]:
    """From west to east or south to north; counter-clockwise if closed."""
    x, y = path.easting, path.northing
    if closed:
        back = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0
    else:
        way = x[-1] - x[0], y[-1] - y[0]
        back = way[int(np.abs(way[1]) > np.abs(way[0]))] < 0
    return (x[::-1].copy(), y[::-1].copy(), closed) if back else (x, y, closed)
