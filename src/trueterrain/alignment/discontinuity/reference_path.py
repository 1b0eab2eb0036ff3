"""Construction of reference paths: straight, through waypoints, or circular (thesis 4.3.1, 4.4).

The station is the arc length along the path, or on a circle the polar angle times the radius. On a
closed path stations are periodic.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.discontinuity.path import ReferencePath
from trueterrain.alignment.observations.sparse_sums import Floats
from trueterrain.geometry.curve import curve_of_points
from trueterrain.geometry.stations import chord_lengths, require_spacing

__all__ = [
    "ReferencePath",
    "polar_reference",
    "straight_reference",
    "waypoint_reference",
]

_FINE = 8  # samples of a curve per spacing, to integrate its arc length
_SAME = 1e-9  # [m] distance below which waypoints are identical


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
        From `start`; the last point is less than a spacing from `end`.

    Raises
    ------
    ValueError
        If the ends are closer than a spacing.

    Examples
    --------
    >>> straight_reference((0, 0), (1, 0), spacing=0.5).curve.easting
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
        Waypoints in order [m], interpolated by a cubic spline over their distances.
    spacing : float
        Arc length between reference points [m]; adjusted to divide the length of a closed path.
    closed : bool
        Whether the path returns to its first waypoint, which need not be repeated.

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
    >>> ring.curve.length
    62.83
    """
    from scipy.interpolate import CubicSpline

    require_spacing(spacing)
    nodes = _path_waypoints(easting, northing, closed)
    s = chord_lengths(*nodes.T)
    ends: Any = "periodic" if closed else "not-a-knot"
    if nodes.shape[0] == 2:
        slope = (nodes[1] - nodes[0]) / s[1]
        ends = ((1, slope), (1, slope))
    spline = CubicSpline(s, nodes, bc_type=ends)
    fine = np.unique(
        np.concatenate([s, np.linspace(0, s[-1], int(_FINE * s[-1] / spacing) + 2 * _FINE)])
    )
    # arc length of each piece by Simpson's rule
    speed = np.hypot(*spline(fine, 1).T)
    midpoint_speed = np.hypot(*spline(0.5 * (fine[1:] + fine[:-1]), 1).T)
    pieces = np.diff(fine) * (speed[:-1] + 4 * midpoint_speed + speed[1:]) / 6
    arc = np.append(0.0, np.cumsum(pieces))
    parts = arc[-1] / spacing
    count = max(round(parts), 3) if closed else int(parts + 1e-6) + 1
    if parts < 1:
        message = f"the path is {arc[-1]:g} m long, shorter than the spacing of {spacing:g} m."
        raise ValueError(message)
    station = np.arange(count) * float(arc[-1] / count if closed else spacing)
    at = spline(CubicSpline(arc, fine)(np.minimum(station, arc[-1])))
    return ReferencePath(curve=curve_of_points(station, *np.ascontiguousarray(at.T), closed=closed))


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
        Distance of the reference points along the circle, adjusted to divide the circumference [m].
    start_angle : float
        Polar angle of station 0, counter-clockwise from east [rad].
    clockwise : bool
        Whether stations run clockwise.

    Returns
    -------
    ReferencePath
        The station of a position is its polar angle times the radius.

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
    require_spacing(spacing)
    count = max(round(2 * np.pi * radius / spacing), 8)
    angle = start_angle + (-1 if clockwise else 1) * np.arange(count) * (2 * np.pi / count)
    curve = curve_of_points(
        np.arange(count, dtype=np.float64) * (2 * np.pi * radius / count),
        centre[0] + radius * np.cos(angle),
        centre[1] + radius * np.sin(angle),
        closed=True,
    )
    return ReferencePath(curve=curve, centre=(float(centre[0]), float(centre[1])))


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
    min_nodes = 4 if closed else 2
    if nodes.shape[0] < min_nodes:
        message = (
            f"a path needs at least {min_nodes - closed} different waypoints, got {len(nodes)}."
        )
        raise ValueError(message)
    return np.asarray(nodes)
