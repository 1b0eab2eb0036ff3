"""Centre line of an overlap: straight, curved or closed, from its cells alone.

Cells at equal distance from one end of the overlap, through neighbouring cells, lie across it
(level sets of the geodesic distance). Their centres are smoothed to a path, which is then moved to
the centre of the cells on both sides of it.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from trueterrain.alignment.discontinuity.low_pass import low_pass
from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.discontinuity.reference_path import waypoint_reference
from trueterrain.alignment.observations.overlap import Overlap, cell_centres, cell_keys
from trueterrain.alignment.observations.sparse_sums import (
    Floats,
    Integers,
    contains_keys,
    pack_cell,
    unpack_cell,
)
from trueterrain.core.errors import CoverageError

_MIN_FRACTION = 0.95  # of the cells in one connected piece
_MAX_FACTOR = 64  # maximum coarsening of cells, to bridge gaps between pieces
_BAND = 1.6  # half-width in cells of a line across the overlap, so that it is connected
_BRANCH = 0.25  # minimum size of the smaller branch of a ring over that of the larger
_PARTS = (0.3, 0.4, 0.5, 0.6, 0.7)  # fractions of the length at which branches are counted
_ITERATIONS = 3  # of moving the path to the centre
_LEVELS = 6  # minimum number of lines across the overlap


def centre_reference(
    overlap: Overlap, *, spacing: float = 0.25, smoothing: float = 10.0
) -> ReferencePath:
    """Reference path along the centre of an overlap, straight, curved or closed.

    Parameters
    ----------
    overlap : Overlap
        The overlap.
    spacing : float
        Distance of the reference points [m].
    smoothing : float
        Wavelength below which the path does not follow the edges of the overlap [m].

    Returns
    -------
    ReferencePath
        From west to east, or from south to north if that is longer; closed courses
        counter-clockwise.

    Raises
    ------
    ValueError
        If a number is not greater than 0.
    CoverageError
        If the overlap is shorter than two spacings, or its shape has no centre line, such as
        scattered pieces.

    Notes
    -----
    Cells at equal distance from one end, from cell to cell, lie across the overlap. Then the path
    is moved to the centre of the cells on both sides of it.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.alignment.observations.overlap import occupied_cells, find_overlap
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 4, 0.1)))
    >>> left, right = (occupied_cells(make_points(x, y + by, 0 * x), 0.2) for by in (0.05, 3.05))
    >>> path = centre_reference(find_overlap(left, right)).curve
    >>> np.round([path.northing.min(), path.northing.max()], 2)
    array([3.5, 3.5])
    """
    for name, value in (("spacing", spacing), ("smoothing", smoothing)):
        if not 0 < value < np.inf:
            message = f"{name} must be greater than 0 m, got {value}."
            raise ValueError(message)
    try:
        easting, northing, closed = centre_waypoints(overlap, spacing, smoothing)
        return waypoint_reference(easting, northing, spacing=spacing, closed=closed)
    except ValueError as error:
        raise CoverageError(
            f"has no centre line for a reference path: {str(error).rstrip('.')}",
            place=f"overlap of {overlap.names[0]} and {overlap.names[1]}",
            cure="Give a line or waypoints, a finer spacing, or finer cells.",
        ) from None


def follow_centre(overlap: Overlap, path: ReferencePath, *, length: float = 0.4) -> ReferencePath:
    """Move the search areas of a path to the centre of the overlap.

    The edges of swaths follow the vehicle, and the overlap with them. Stations a few metres from a
    path with such bends would be ambiguous, so the path stays smooth and only the search areas
    follow the overlap.

    Parameters
    ----------
    overlap : Overlap
        The overlap.
    path : ReferencePath
        Path in the overlap or parallel to it.
    length : float
        Length of path over which the centre is averaged [m].

    Returns
    -------
    ReferencePath
        With new ``lateral``; interpolated where there is no overlap.
    """
    curve = path.curve
    key = part_of_path(overlap, path)
    key = key if key.size else overlap.key
    centre, _ = cross_extent(key, overlap.cell, path, max(length, overlap.cell))
    known = np.isfinite(centre)
    period = curve.length if curve.closed else None
    lateral = np.zeros(known.size)
    if known.any():
        lateral = np.interp(curve.s, curve.s[known], centre[known], period=period)
    return replace(path, lateral=lateral)


class OverlapEdges(NamedTuple):
    """Centre and width of an overlap along a path; NaN outside the overlap."""

    station: Floats
    "Stations, shape (s,) [m]."

    centre: Floats
    "Offset of the centre of the overlap, to the left positive, shape (s,) [m]."

    width: Floats
    "Width, from the area of the cells, shape (s,) [m]."


def overlap_edges(overlap: Overlap, path: ReferencePath) -> OverlapEdges:
    """Measure the centre and the width of an overlap along a path.

    Parameters
    ----------
    overlap : Overlap
        The overlap; only the pieces that the path runs through are used.
    path : ReferencePath
        The path.

    Returns
    -------
    OverlapEdges
        At the reference points, each over a length of one spacing, but at least three cells.
    """
    key = part_of_path(overlap, path)
    found = cross_extent(key, overlap.cell, path, max(path.curve.spacing, 3 * overlap.cell))
    return OverlapEdges(path.curve.s, *found)


def centre_waypoints(
    overlap: Overlap, spacing: float, smoothing: float
) -> tuple[Floats, Floats, bool]:
    """Points along the centre line of the longest piece of an overlap.

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
        If the overlap is too short.
    """
    key, cell = _one_piece(overlap.key, overlap.cell)
    levels, step, closed = _level_set_centres(key, cell)
    nodes = _smooth_nodes(levels, step, smoothing, closed)
    nodes = nodes if closed else _extend_ends(nodes, 2 * step)
    fine = min(spacing, max(overlap.cell, spacing / 4))
    path = waypoint_reference(*nodes.T, spacing=fine, closed=closed)
    own = _cells_of_piece(overlap, key, cell)
    for _ in range(_ITERATIONS):
        centre, _ = cross_extent(own, overlap.cell, path, max(fine, 6 * overlap.cell))
        shift = low_pass(centre, path.curve.spacing, smoothing, closed=closed)
        east, north = path.curve.position_at(path.curve.s, shift)
        path = waypoint_reference(east, north, spacing=fine, closed=closed)
    curve = path.curve
    if closed:
        return _orient_nodes(curve.easting, curve.northing, closed)
    found = path.locate(*cell_centres(own, overlap.cell))
    inside = found.station[~found.beyond]
    if not inside.size or np.ptp(inside) < 2 * spacing:
        message = f"it is {float(np.ptp(inside)) if inside.size else 0.0:g} m long"
        raise ValueError(message)
    kept = (curve.s >= inside.min()) & (curve.s <= inside.max())
    return _orient_nodes(curve.easting[kept], curve.northing[kept], closed)


def cross_extent(
    key: Integers, cell: float, path: ReferencePath, length: float
) -> tuple[Floats, Floats]:
    """Centre and width of cells across a path.

    Parameters
    ----------
    key : numpy.ndarray of int64
        The cells.
    cell : float
        Their size [m].
    path : ReferencePath
        The path.
    length : float
        Length of path over which cells are averaged at each reference point [m].

    Returns
    -------
    centre, width : numpy.ndarray, shape (s,)
        Mean offset of the cells, and their area over the length [m]; NaN without cells.
    """
    found = path.locate(*cell_centres(key, cell))
    station, offset = found.station[~found.beyond], found.offset[~found.beyond]
    curve = path.curve
    begin, end = curve.s - length / 2, curve.s + length / 2
    if curve.closed:
        station = np.concatenate([station - curve.length, station, station + curve.length])
        offset = np.tile(offset, 3)
    order = np.argsort(station, kind="stable")
    station, sums = station[order], np.append(0.0, np.cumsum(offset[order]))
    first, last = np.searchsorted(station, begin), np.searchsorted(station, end)
    count = last - first
    if not curve.closed:
        begin, end = np.maximum(begin, 0.0), np.minimum(end, curve.length)
    with np.errstate(invalid="ignore"):
        centre = (sums[last] - sums[first]) / np.where(count, count, np.nan)
    return centre, np.where(count, count * cell**2 / (end - begin), np.nan)


def part_of_path(overlap: Overlap, path: ReferencePath) -> Integers:
    """Cells of the connected pieces of an overlap that contain reference points.

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
    _, piece = connected_components(_neighbour_graph(overlap.key), directed=False)
    nodes = cell_keys(*path.places, overlap.cell)
    nodes = nodes[contains_keys(overlap.key, nodes)]
    return overlap.key[np.isin(piece, piece[np.searchsorted(overlap.key, nodes)])]


def _one_piece(key: Integers, cell: float) -> tuple[Integers, float]:
    """Largest connected piece, after coarsening cells until it holds nearly all of them."""
    factor = 1
    while True:
        coarse, index = np.unique(_coarsen_keys(key, factor), return_inverse=True)
        _, piece = connected_components(_neighbour_graph(coarse), directed=False)
        sizes = np.bincount(piece[index])
        if sizes.max() >= _MIN_FRACTION * key.size or factor == _MAX_FACTOR:
            return coarse[piece == np.argmax(sizes)], cell * factor
        factor *= 2


def _cells_of_piece(overlap: Overlap, key: Integers, cell: float) -> Integers:
    """Cells of the overlap within a piece of coarser cells."""
    factor = round(cell / overlap.cell)
    return overlap.key[contains_keys(key, _coarsen_keys(overlap.key, factor))]


def _coarsen_keys(key: Integers, factor: int) -> Integers:
    column, row = unpack_cell(key)
    return pack_cell(column // factor, row // factor)


def _neighbour_graph(key: Integers) -> Any:
    """Graph of neighbouring cells, weighted by the distance of their centres in cells."""
    column, row = unpack_cell(key)
    rows, columns, distances = [], [], []
    for dc, dr in ((0, 1), (1, -1), (1, 0), (1, 1)):
        other = pack_cell(column + dc, row + dr)
        there = np.flatnonzero(contains_keys(key, other))
        rows.append(there)
        columns.append(np.searchsorted(key, other[there]))
        distances.append(np.full(there.size, np.hypot(dc, dr)))
    entries = np.concatenate(distances), (np.concatenate(rows), np.concatenate(columns))
    return coo_array(entries, shape=(key.size, key.size)).tocsr()


def _level_set_centres(key: Integers, cell: float) -> tuple[Floats, float, bool]:
    """Centres of the level sets of the distance from one end, (n, 2), their spacing, closed."""
    graph = _neighbour_graph(key)
    distance = _from_end(graph)
    rings = 0
    for part in _PARTS:
        band = np.flatnonzero(np.abs(distance - part * distance.max()) <= _BAND)
        _, piece = connected_components(graph[band][:, band], directed=False)
        sizes = np.bincount(piece)
        rings += int((sizes >= _BRANCH * sizes.max()).sum()) == 2
        if part == 0.5:
            wall = band[piece == np.argmax(sizes)]
    closed = 2 * rings > len(_PARTS)
    at = np.stack(cell_centres(key, cell), axis=1)
    if closed:  # cut one branch of the ring: it becomes a strip between the sides of the cut
        rest = np.setdiff1d(np.arange(key.size), wall)
        graph, at = graph[rest][:, rest], at[rest]
        distance = _from_end(graph)
        reached = np.isfinite(distance)
        distance, at = distance[reached], at[reached]
    length = float(distance.max())
    if not length > 0:
        message = f"its largest piece is one cell of {cell:g} m"
        raise ValueError(message)
    width = distance.size / max(length, 1.0)
    count = max(int(length / max(2.0, width)), _LEVELS)
    level = np.minimum((distance / (length + 1e-9) * count).astype(np.int64), count - 1)
    quantity = np.bincount(level, minlength=count)
    there = quantity > 0
    sums = np.stack([np.bincount(level, one, minlength=count) for one in at.T], axis=1)
    centres: Floats = sums[there] / quantity[there, None]
    if not closed and centres.shape[0] > 4:
        centres = centres[1:-1]  # the first and the last lie in corners
    return centres, length * cell / count, closed


def _from_end(graph: Any) -> Floats:
    """Geodesic distance from one end of the largest piece.

    The farthest cell from the farthest cell from any cell is an end (double sweep).
    """
    _, piece = connected_components(graph, directed=False)
    start = int(np.argmax(piece == np.argmax(np.bincount(piece))))
    for _ in range(2):
        distance = dijkstra(graph, directed=False, indices=start)
        distance = np.where(np.isfinite(distance), distance, -1.0)
        start = int(np.argmax(distance))
    return np.asarray(dijkstra(graph, directed=False, indices=start))


def _smooth_nodes(nodes: Floats, step: float, smoothing: float, closed: bool) -> Floats:
    return np.stack([low_pass(one, step, smoothing, closed=closed) for one in nodes.T], axis=1)


def _extend_ends(nodes: Floats, by: float) -> Floats:
    """Extend a polyline straight at both ends."""

    def beyond(end: Floats, before: Floats) -> Floats:
        direction = end - before
        return np.asarray(end + direction * (by / np.hypot(*direction)))

    first, last = beyond(nodes[0], nodes[1]), beyond(nodes[-1], nodes[-2])
    return np.concatenate([first[None], nodes, last[None]])


def _orient_nodes(x: Floats, y: Floats, closed: bool) -> tuple[Floats, Floats, bool]:
    """Orient nodes from west to east or south to north; counter-clockwise if closed."""
    if closed:
        # the shoelace formula: a negative area is clockwise
        reverse = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0
    else:
        chord = x[-1] - x[0], y[-1] - y[0]
        reverse = chord[int(np.abs(chord[1]) > np.abs(chord[0]))] < 0
    return (x[::-1].copy(), y[::-1].copy(), closed) if reverse else (x, y, closed)
