"""Reference lines to grid along: of a run's own path, through waypoints, or straight.

All chords are equally long, as OpenCRG demands, and the radius of every bend stays greater than
the grid is wide.
"""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from trueterrain.core.errors import CoverageError
from trueterrain.geometry.curve import PlaneCurve, curve_of_points
from trueterrain.geometry.stations import chord_lengths

Floats = npt.NDArray[np.float64]

_FINE = 4  # samples of a path per spacing of the line
_COARSE = 0.05  # [m] spacing at which a path is smoothed
_CHORD = 1e-10  # [m] within which all chords are equally long
_STEPS = 50  # of a search that halves its error and more each time
_BEND = 0.9  # of the largest curvature that a grid allows, at which smoothing is enough
_SMOOTHER = 1.5  # by how much more is smoothed if a bend is too sharp
_LONGEST = 200.0  # [m] over which a path is smoothed at most
_MILLIMETRE = 1e-3  # [m]


class MovingBody(Protocol):
    """Motion of a body over time, such as `trueterrain.motion.trajectory.Trajectory`."""

    @property
    def time(self) -> Floats:
        """True times of the knots [s]."""

    def at(self, time: npt.ArrayLike) -> Any:
        """Position, shape (n, 3) [m], and rotation at some times [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferenceLine:
    """Line that a grid follows: a plane curve of equal chords, with elevations.

    A curve of its own kind, since OpenCRG defines the line by a constant increment and the headings
    of its chords, and gives it heights.
    """

    curve: PlaneCurve
    "Nodes, equally far from each other."

    elevation: Floats
    "Height of the line, part of no height of a surface along it, shape (u,) [m]."

    def __post_init__(self) -> None:
        """Check that the nodes are equally spaced and have elevations."""
        _ = self.curve.spacing
        if self.elevation.shape != self.curve.s.shape or not np.isfinite(self.elevation).all():
            message = "elevation must hold a finite value for each station."
            raise ValueError(message)


def straight_line(
    start: tuple[float, float], end: tuple[float, float], *, spacing: float = 0.01
) -> ReferenceLine:
    """Straight reference line.

    Parameters
    ----------
    start, end : tuple of float
        Easting and northing of the ends [m]; the last node lies within half a spacing of `end`.
    spacing : float
        Length of the chords [m], a multiple of 1 mm.

    Returns
    -------
    ReferenceLine
        From `start` on, at elevation 0.

    Raises
    ------
    ValueError
        If the ends are nearer than one spacing, or the spacing is none.

    Examples
    --------
    >>> straight_line((0, 0), (0, 0.03)).curve.northing
    array([0.  , 0.01, 0.02, 0.03])
    """
    step = require_millimetres(spacing, "spacing")
    begin, chord = np.asarray(start, float), np.subtract(end, start).astype(float)
    length = float(np.hypot(*chord))
    if not (np.isfinite(length) and length >= spacing):
        message = f"start and end must be at least {spacing:g} m apart, got {length:g} m."
        raise ValueError(message)
    u = np.round(np.arange(round(length / spacing) + 1) * step, 3)
    at = begin + u[:, None] * chord / length
    return ReferenceLine(curve=curve_of_points(u, at[:, 0], at[:, 1]), elevation=np.zeros(u.size))


def line_through(
    easting: npt.ArrayLike,
    northing: npt.ArrayLike,
    *,
    spacing: float = 0.01,
    half_width: float = 2.0,
    smoothing: float = 0.0,
    elevation: npt.ArrayLike | None = None,
) -> ReferenceLine:
    """Reference line along waypoints.

    Parameters
    ----------
    easting, northing : array_like, shape (point,)
        Waypoints in the order of travel [m]; a cubic spline runs through them, or near them if
        they are smoothed.
    spacing : float
        Length of the chords [m], a multiple of 1 mm.
    half_width : float
        Half width of the grid to either side [m].
    smoothing : float
        Standard deviation of the Gaussian that the path is smoothed with, along its length [m].
        Where a bend is too sharp for the width, the whole path is smoothed more.
    elevation : array_like, shape (point,), optional
        Height of the line at the waypoints [m]; by default 0.

    Returns
    -------
    ReferenceLine
        Its curvature stays under 0.9 / `half_width`.

    Raises
    ------
    ValueError
        If there are fewer than 2 different waypoints, or numbers make no sense.
    CoverageError
        If no reasonable smoothing makes the path as gentle as the width demands.

    Examples
    --------
    >>> bend = np.linspace(0, 1, 50)
    >>> curve = line_through(20 * np.sin(bend), 20 - 20 * np.cos(bend), spacing=0.1).curve
    >>> chords = np.hypot(np.diff(curve.easting), np.diff(curve.northing))
    >>> np.round([chords.min(), chords.max(), curve.curvature.mean()], 3)
    array([0.1 , 0.1 , 0.05])
    """
    require_millimetres(spacing, "spacing")
    x, y = np.asarray(easting, float).ravel(), np.asarray(northing, float).ravel()
    z = np.zeros(x.size) if elevation is None else np.asarray(elevation, float).ravel()
    _check_waypoints(x, y, z, half_width, smoothing)
    s = chord_lengths(x, y)
    kept = np.append(True, np.diff(s) > 0)
    if not s[-1] >= spacing:
        message = f"the waypoints must be at least {spacing:g} m apart, got {s[-1]:g} m."
        raise ValueError(message)
    path = np.stack([x, y, z], axis=1)[kept]
    spline = CubicSpline(s[kept], path) if kept.sum() > 2 else _chord_spline(s[kept], path)
    while True:
        line = _equal_chords(_smooth_spline(spline, s[-1], smoothing), spacing)
        sharpest = float(np.abs(line.curve.curvature).max(initial=0.0))
        if sharpest * half_width <= _BEND:
            return line
        smoothing = max(_SMOOTHER * smoothing, spacing, _COARSE)
        if smoothing > min(_LONGEST, s[-1]):
            raise CoverageError(
                f"the path turns with a radius of {1 / sharpest:.3g} m, too sharp for a grid of "
                f"{half_width:g} m to either side",
                place="reference line",
                cure="Make the grid narrower, give waypoints, or leave the turn out.",
            )


def line_from_trajectory(
    trajectory: MovingBody,
    *,
    spacing: float = 0.01,
    half_width: float = 2.0,
    smoothing: float = 1.0,
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0),
    begin: float | None = None,
    end: float | None = None,
) -> ReferenceLine:
    """Reference line along the path of a body, smoothed.

    Parameters
    ----------
    trajectory : Trajectory
        Motion of the body.
    spacing : float
        Length of the chords [m], a multiple of 1 mm.
    half_width : float
        Half width of the grid to either side [m].
    smoothing : float
        Standard deviation of the Gaussian that the path is smoothed with [m].
    lever : tuple of float
        Point of the body that the line follows: forward, left, up [m]; the scanner's position puts
        the line in the middle of its swath.
    begin, end : float, optional
        True times between which the path is taken [s]; by default all of it.

    Returns
    -------
    ReferenceLine
        In the direction of travel, at the elevation 0.

    Raises
    ------
    ValueError
        If numbers make no sense, or the times lie outside of the trajectory.
    CoverageError
        If the body does not move by a spacing, or turns too sharply.
    """
    begin = float(trajectory.time[0]) if begin is None else begin
    end = float(trajectory.time[-1]) if end is None else end
    if not begin < end:
        message = f"begin must be less than end, got {begin} s and {end} s."
        raise ValueError(message)
    inside = trajectory.time[(trajectory.time > begin) & (trajectory.time < end)]
    poses = trajectory.at(np.concatenate([[begin], inside, [end]]))
    path = poses.position + poses.rotation.apply(np.array(lever))
    x, y = _thin_points(path[:, 0], path[:, 1], max(spacing, _COARSE))
    if x.size < 2:
        raise CoverageError(
            "the body does not move far enough for a reference line",
            place=f"motion from {begin:.3f} s to {end:.3f} s",
            cure="Give a reference line, or grid over a map.",
        )
    return line_through(x, y, spacing=spacing, half_width=half_width, smoothing=smoothing)


def require_millimetres(value: float, name: str) -> float:
    """Return a length if it is a multiple of 1 mm, as grids are made of.

    Parameters
    ----------
    value : float
        The length [m].
    name : str
        What it is called.

    Returns
    -------
    float
        The nearest multiple.

    Raises
    ------
    ValueError
        If it is none, or not greater than 0.
    """
    whole = round(value / _MILLIMETRE) if np.isfinite(value) else 0
    if whole < 1 or abs(value - whole * _MILLIMETRE) > 1e-9:
        message = f"{name} must be a multiple of 0.001 m and greater than 0, got {value:g} m."
        raise ValueError(message)
    return whole * _MILLIMETRE


def _check_waypoints(x: Floats, y: Floats, z: Floats, half_width: float, smoothing: float) -> None:
    if not (x.size == y.size == z.size and x.size >= 2):
        message = (
            "easting, northing and elevation must hold the same number of waypoints and at least "
            f"2, got {x.size}, {y.size} and {z.size}."
        )
        raise ValueError(message)
    if not (np.isfinite(x).all() and np.isfinite(y).all() and np.isfinite(z).all()):
        message = "waypoints must be finite everywhere."
        raise ValueError(message)
    if not (half_width >= 0 and smoothing >= 0):
        message = (
            f"half_width and smoothing must be at least 0 m, got {half_width} and {smoothing} m."
        )
        raise ValueError(message)


def _thin_points(x: Floats, y: Floats, least: float) -> tuple[Floats, Floats]:
    """Points of a path, at least so far apart that noise at rest does not curve it."""
    s = chord_lengths(x, y)
    # some points on each stretch of that length are enough to choose from
    chosen = np.flatnonzero(np.diff(np.floor(s * (_FINE / least)), prepend=-1.0))
    kept = [0]
    for k in chosen.tolist():
        if math.hypot(x[k] - x[kept[-1]], y[k] - y[kept[-1]]) >= least:
            kept.append(k)
    return x[kept], y[kept]


def _chord_spline(s: Floats, path: Floats) -> CubicSpline:
    """Spline of two points."""
    slope = np.diff(path, axis=0)[0] / np.diff(s)
    return CubicSpline(s, path, bc_type=((1, slope), (1, slope)))


def _smooth_spline(spline: CubicSpline, length: float, smoothing: float) -> CubicSpline:
    """The path smoothed along its length; its ends go straight on meanwhile."""
    if smoothing == 0:
        return spline
    step = min(_COARSE, smoothing / _FINE)
    s = np.linspace(0, length, max(round(length / step), 2) + 1)
    path, step = spline(s), s[1] - s[0]
    pad = int(np.ceil(4 * smoothing / step)) + 1
    on = np.arange(1, pad + 1)[:, None] * step
    ends = spline(np.array([0.0, length]), 1)
    padded = np.concatenate([path[0] - on[::-1] * ends[0], path, path[-1] + on * ends[1]])
    smooth = gaussian_filter1d(padded, smoothing / step, axis=0, truncate=4.0)[pad:-pad]
    return CubicSpline(s, smooth)


def _equal_chords(spline: CubicSpline, spacing: float) -> ReferenceLine:
    """Nodes on a path whose chords are all as long as the spacing."""
    end = spline.x[-1]
    fine = np.linspace(0, end, max(int(np.ceil(_FINE * end / spacing)), 8) + 1)
    x, y = spline(fine)[:, :2].T
    arc = chord_lengths(x, y)
    count = int(arc[-1] / spacing + 1e-6)
    at = np.interp(np.arange(count + 1) * spacing, arc, fine)
    if count < 1:
        raise CoverageError(
            f"the path is shorter than the spacing of {spacing:g} m",
            place="reference line",
            cure="Choose a finer spacing.",
        )
    for _ in range(_STEPS):
        nodes = spline(at)
        chords = np.hypot(*np.diff(nodes[:, :2], axis=0).T)
        error = np.append(0.0, np.cumsum(chords - spacing))
        if np.abs(np.diff(error)).max() < _CHORD:
            break
        # the length of a chord and that of its parameters are all but the same
        at = np.minimum(at - error * np.gradient(at) / spacing, end)
    u = np.round(np.arange(count + 1) * spacing, 3)
    return ReferenceLine(curve=curve_of_points(u, nodes[:, 0], nodes[:, 1]), elevation=nodes[:, 2])
