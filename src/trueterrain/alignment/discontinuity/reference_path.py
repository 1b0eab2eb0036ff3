"""Reference paths through an overlap, with equally spaced reference points (thesis 4.3.1, 4.4).

A station is the arc length along the path, or on a circle the polar angle times the radius. On a
closed course stations are periodic: the last reference point is followed by the first.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.path import PathCoordinates, ReferencePath
from trueterrain.alignment.discontinuity.sparse_sums import Floats
from trueterrain.alignment.observations.overlap import Overlap
from trueterrain.core.errors import CoverageError

__all__ = [
    "OverlapEdges",
    "PathCoordinates",
    "ReferencePath",
    "centre_reference",
    "keep_to_middle",
    "overlap_edges",
    "polar_reference",
    "straight_reference",
    "waypoint_reference",
]

_FINE = 8  # samples of a curve per spacing
_SAME = 1e-9  # [m] between waypoints that count once


def straight_reference(
    start: tuple[float, float], end: tuple[float, float], *, spacing: float = 0.25
) -> ReferencePath:
    """Reference path along a straight line.

    Parameters
    ----------
    start, end : tuple of float
        Easting and northing of the ends [m].
    spacing : float
        Distance of the reference points [m].

    Returns
    -------
    ReferencePath
        From `start`; its last point is less than a spacing from `end`.

    Raises
    ------
    ValueError
        If the ends are nearer than a spacing.

    Examples
    --------
    >>> straight_reference((0, 0), (1, 0), spacing=0.5).easting
    array([0. , 0.5, 1. ])
    """
    return waypoint_reference([start[0], end[0]], [start[1], end[1]], spacing=spacing)


def waypoint_reference(
    easting: npt.ArrayLike,
    northing: npt.ArrayLike,
    *,
    spacing: float = 0.25,
    closed: bool = False,
) -> ReferencePath:
    """Reference path along a smooth curve through waypoints.

    Parameters
    ----------
    easting, northing : array_like, shape (n,)
        Waypoints in order [m]; a cubic spline over their distances runs through them.
    spacing : float
        Arc length between reference points [m]; of a closed path the nearest of which it is a
        whole multiple.
    closed : bool
        Whether the path returns to its first waypoint; that need not be repeated.

    Returns
    -------
    ReferencePath
        Stations are arc lengths.

    Raises
    ------
    ValueError
        If waypoints are not finite, too few, or the path is too short.

    Examples
    --------
    >>> angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    >>> ring = waypoint_reference(10 * np.cos(angle), 10 * np.sin(angle), closed=True)
    >>> ring.length
    62.83
    """
    from scipy.interpolate import CubicSpline

    if not 0 < spacing < np.inf:
        message = f"spacing must be greater than 0 m, got {spacing}."
        raise ValueError(message)
    nodes = _path_waypoints(easting, northing, closed)
    s = np.append(0.0, np.cumsum(np.hypot(*np.diff(nodes, axis=0).T)))
    ends: Any = "periodic" if closed else "not-a-knot"
    if nodes.shape[0] == 2:
        slope = (nodes[1] - nodes[0]) / s[1]
        ends = ((1, slope), (1, slope))
    spline = CubicSpline(s, nodes, bc_type=ends)
    fine = np.unique(
        np.concatenate([s, np.linspace(0, s[-1], int(_FINE * s[-1] / spacing) + 2 * _FINE)])
    )
    # Simpson's rule for the length of the pieces between
    speed = np.hypot(*spline(fine, 1).T)
    middle = np.hypot(*spline(0.5 * (fine[1:] + fine[:-1]), 1).T)
    pieces = np.diff(fine) * (speed[:-1] + 4 * middle + speed[1:]) / 6
    arc = np.append(0.0, np.cumsum(pieces))
    parts = arc[-1] / spacing
    count = max(round(parts), 3) if closed else int(parts + 1e-6) + 1
    if parts < 1:
        message = f"the path is {arc[-1]:g} m long, shorter than the spacing of {spacing:g} m."
        raise ValueError(message)
    spacing = arc[-1] / count if closed else spacing
    at = spline(CubicSpline(arc, fine)(np.minimum(np.arange(count) * spacing, arc[-1])))
    return ReferencePath(
        easting=at[:, 0].copy(), northing=at[:, 1].copy(), spacing=float(spacing), closed=closed
    )


def polar_reference(
    centre: tuple[float, float],
    radius: float,
    *,
    spacing: float = 0.25,
    start_angle: float = 0.0,
    clockwise: bool = False,
) -> ReferencePath:
    """Reference path once around a circle, with polar stations (thesis 4.4).

    Parameters
    ----------
    centre : tuple of float
        Easting and northing of the centre [m].
    radius : float
        Radius [m].
    spacing : float
        Distance of the reference points along the circle, taken to the nearest whole part [m].
    start_angle : float
        Where station 0 is, counter-clockwise from east [rad].
    clockwise : bool
        Whether stations run clockwise.

    Returns
    -------
    ReferencePath
        The station of any place is its polar angle times the radius.

    Raises
    ------
    ValueError
        If a number is not finite or not greater than 0.

    Examples
    --------
    >>> polar_reference((0, 0), 10.0).locate([0.0], [9.0]).station / 10 / np.pi
    array([0.5])
    """
    if not (np.isfinite([*centre, start_angle]).all() and 0 < radius < np.inf):
        message = (
            "centre and start_angle must be finite and radius greater than 0 m, got "
            f"{centre}, {start_angle} and {radius}."
        )
        raise ValueError(message)
    if not 0 < spacing < np.inf:
        message = f"spacing must be greater than 0 m, got {spacing}."
        raise ValueError(message)
    count = max(round(2 * np.pi * radius / spacing), 8)
    angle = start_angle + (-1 if clockwise else 1) * np.arange(count) * (2 * np.pi / count)
    return ReferencePath(
        easting=centre[0] + radius * np.cos(angle),
        northing=centre[1] + radius * np.sin(angle),
        spacing=2 * np.pi * radius / count,
        closed=True,
        centre=(float(centre[0]), float(centre[1])),
    )


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
        If the overlap is shorter than two spacings, or its shape has no middle that a path could
        follow, such as scattered pieces.

    Notes
    -----
    The way along the overlap is found from cell to cell: cells equally far from its one end lie
    across it. Then the path is moved to the middle of the cells beside it until it rests.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.alignment.observations.overlap import occupied_cells, overlap_of
    >>> x, y = (at.ravel() for at in np.meshgrid(np.arange(0, 20, 0.1), np.arange(0, 4, 0.1)))
    >>> left, right = (occupied_cells(make_points(x, y + by, 0 * x), 0.2) for by in (0.05, 3.05))
    >>> path = centre_reference(overlap_of(left, right))
    >>> np.round([path.northing.min(), path.northing.max()], 2)
    array([3.5, 3.5])
    """
    from trueterrain.alignment.discontinuity.centre_line import centre_waypoints

    for name, value in (("spacing", spacing), ("smoothing", smoothing)):
        if not 0 < value < np.inf:
            message = f"{name} must be greater than 0 m, got {value}."
            raise ValueError(message)
    try:
        easting, northing, closed = centre_waypoints(overlap, spacing, smoothing)
        return waypoint_reference(easting, northing, spacing=spacing, closed=closed)
    except ValueError as error:
        raise CoverageError(
            f"has no middle to lay a reference path along: {str(error).rstrip('.')}",
            place=f"overlap of {overlap.lanes[0]} and {overlap.lanes[1]}",
            cure="Give a line or waypoints, a finer spacing, or finer cells.",
        ) from None


def keep_to_middle(overlap: Overlap, path: ReferencePath, *, length: float = 0.4) -> ReferencePath:
    """The same path with heights compared in the middle of the overlap beside it.

    Swaths sway with the vehicle, and their overlap with them. A path that swayed as much would not
    tell stations a few metres beside it, so the path stays and only the search areas follow.

    Parameters
    ----------
    overlap : Overlap
        The overlap.
    path : ReferencePath
        The path, in the overlap or beside it.
    length : float
        Stretch of the path over which the middle is taken [m].

    Returns
    -------
    ReferencePath
        With new ``aside``; straight on where there is no overlap.
    """
    from trueterrain.alignment.discontinuity.centre_line import cross_extent, part_of_path

    key = part_of_path(overlap, path)
    key = key if key.size else overlap.key
    middle, _ = cross_extent(key, overlap.cell, path, max(length, overlap.cell))
    known = np.isfinite(middle)
    period = path.length if path.closed else None
    aside = np.zeros(known.size)
    if known.any():
        aside = np.interp(path.station, path.station[known], middle[known], period=period)
    return replace(path, aside=aside)


class OverlapEdges(NamedTuple):
    """Sides of an overlap along a path; NaN where it has none."""

    station: Floats
    "Stations, shape (s,) [m]."

    centre: Floats
    "Offset of the middle of the overlap, left positive, shape (s,) [m]."

    width: Floats
    "Width, from the area of the cells, shape (s,) [m]."


def overlap_edges(overlap: Overlap, path: ReferencePath) -> OverlapEdges:
    """Width of an overlap along a path.

    Parameters
    ----------
    overlap : Overlap
        The overlap; of it those parts count that the path runs through.
    path : ReferencePath
        The path.

    Returns
    -------
    Edges
        At the reference points, each over the stretch that is nearest to it, and not less than
        three cells.
    """
    from trueterrain.alignment.discontinuity.centre_line import cross_extent, part_of_path

    key = part_of_path(overlap, path)
    found = cross_extent(key, overlap.cell, path, max(path.spacing, 3 * overlap.cell))
    return OverlapEdges(path.station, *found)


def _path_waypoints(easting: npt.ArrayLike, northing: npt.ArrayLike, closed: bool) -> Floats:
    x, y = (np.ravel(np.asarray(at, dtype=float)) for at in (easting, northing))
    if x.shape != y.shape or not (np.isfinite(x).all() and np.isfinite(y).all()):
        message = "easting and northing must hold the same number of finite waypoints."
        raise ValueError(message)
    nodes = np.stack([x, y], axis=1)
    if closed:
        nodes = np.concatenate([nodes, nodes[:1]])
    new = np.append(True, np.hypot(*np.diff(nodes, axis=0).T) > _SAME)
    nodes = nodes[new]
    if closed and nodes.shape[0] and np.hypot(*(nodes[-1] - nodes[0])) <= _SAME:
        nodes[-1] = nodes[0]
    least = 4 if closed else 2
    if nodes.shape[0] < least:
        message = f"a path needs at least {least - closed} different waypoints, got {len(nodes)}."
        raise ValueError(message)
    return np.asarray(nodes)
