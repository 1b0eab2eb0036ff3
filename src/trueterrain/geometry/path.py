"""The path that a wheel takes over the ground, as points at equal arc length (thesis 5.2.1).

Straight lines, arcs, functions, waypoints, any curve with a parameter, and lines parallel to the
reference line of a surface. Spacing is the arc length between two points; it is met within one
millionth of itself.
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.geometry.arc_length import ParametricCurve, equidistant_parameters
from trueterrain.geometry.curve import PlaneCurve, polyline_curve
from trueterrain.geometry.grid_frame import EDGE, grid_frame
from trueterrain.geometry.stations import equal_stations, require_spacing

Float = npt.NDArray[np.float64]

#: A sampled curve is refined until its spline misses it by less than this part of the spacing.
CURVE_TOLERANCE = 1e-7

_FIRST_SAMPLES = 65
_MAXIMUM_SAMPLES = (1 << 21) + 1
_SAMPLE_DISTANCE = 16  # spacings between two samples at most, so that no bend is overlooked
_GOLDEN = 0.6180339887498949
_STILL = 1e-6  # part of the mean speed of the parameter, below which it tells no direction


def straight_path(
    start: tuple[float, float], end: tuple[float, float], *, spacing: float = 0.01
) -> PlaneCurve:
    """Straight line between two points.

    Parameters
    ----------
    start, end : tuple of float
        Easting and northing of the ends [m].
    spacing : float
        Arc length between two points [m].

    Returns
    -------
    PlaneCurve
        Points from `start` towards `end`.

    Raises
    ------
    ValueError
        If the ends are not finite or coincide, or the spacing is not greater than 0.

    Examples
    --------
    >>> straight_path((0, 0), (3, 4), spacing=2.5).easting
    array([0. , 1.5, 3. ])
    """
    begin, finish = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    _require_finite("start and end", begin, finish)
    length = float(np.hypot(*(finish - begin)))
    s = equal_stations(length, spacing)
    direction = (finish - begin) / length
    along = begin + s[:, None] * direction
    heading = np.full(s.shape, np.arctan2(direction[1], direction[0]))
    return PlaneCurve(
        s=s, easting=along[:, 0], northing=along[:, 1], heading=heading, length=length
    )


def arc_path(
    centre: tuple[float, float],
    radius: float,
    start_angle: float,
    end_angle: float,
    *,
    spacing: float = 0.01,
) -> PlaneCurve:
    """Arc of a circle.

    Parameters
    ----------
    centre : tuple of float
        Easting and northing of the centre [m].
    radius : float
        Radius [m].
    start_angle, end_angle : float
        Where the arc begins and ends, counter-clockwise from east [rad]. The path runs clockwise
        if the end is less than the start; more than one turn is allowed.
    spacing : float
        Arc length between two points [m].

    Returns
    -------
    PlaneCurve
        Points along the arc.

    Raises
    ------
    ValueError
        If a value is not finite, the radius or the spacing is not greater than 0, or the arc is
        shorter than the spacing.

    Examples
    --------
    >>> quarter = arc_path((0, 0), 2.0, 0.0, np.pi / 2, spacing=0.1)
    >>> float(np.hypot(quarter.easting[-1], quarter.northing[-1]))
    2.0
    """
    _require_finite("centre, radius and angles", centre, radius, start_angle, end_angle)
    if not radius > 0:
        message = f"radius must be greater than 0 m, got {radius}."
        raise ValueError(message)
    turn = end_angle - start_angle
    length = radius * abs(turn)
    s = equal_stations(length, spacing)
    angle = start_angle + np.sign(turn) * s / radius
    return PlaneCurve(
        s=s,
        easting=centre[0] + radius * np.cos(angle),
        northing=centre[1] + radius * np.sin(angle),
        heading=angle + np.sign(turn) * np.pi / 2,
        length=length,
    )


def function_path(
    function: Callable[[Float], Float], start: float, end: float, *, spacing: float = 0.01
) -> PlaneCurve:
    """Path along the graph of a function, northing over easting.

    In arc length, where the thesis steps by its Eqs. 5-3 to 5-5.

    Parameters
    ----------
    function : callable
        Northing [m] of an array of eastings [m]; smooth.
    start, end : float
        Eastings of the ends [m]; the path runs westward if the end is less than the start.
    spacing : float
        Arc length between two points [m].

    Returns
    -------
    PlaneCurve
        Points along the graph of the function.

    Raises
    ------
    ValueError
        If the function is not finite or not smooth, or the spacing is not greater than 0.

    Examples
    --------
    >>> path = function_path(lambda x: np.cosh(x), 0.0, 1.0, spacing=0.1)
    >>> path.length  # sinh(1)
    1.175201
    """
    return curve_path(lambda t: np.stack([t, function(t)], axis=-1), start, end, spacing=spacing)


def curve_path(
    position: Callable[[Float], Float], start: float, end: float, *, spacing: float = 0.01
) -> PlaneCurve:
    """Path along any smooth curve with a parameter: loops and vertical stretches are allowed.

    Parameters
    ----------
    position : callable
        Easting and northing [m], shape (n, 2), of parameters of shape (n,).
    start, end : float
        Parameters of the ends.
    spacing : float
        Arc length between two points [m].

    Returns
    -------
    PlaneCurve
        Points along the curve.

    Raises
    ------
    ValueError
        If the curve is not finite or not smooth, or the spacing is not greater than 0.

    Examples
    --------
    >>> circle = curve_path(lambda t: np.stack([np.cos(t), np.sin(t)], axis=-1), 0.0, 2 * np.pi)
    >>> circle.length
    6.283185
    """
    from scipy.interpolate import CubicSpline

    require_spacing(spacing)
    _require_finite("start and end", start, end)
    if start == end:
        message = f"start and end must differ, both are {start}."
        raise ValueError(message)

    def sample(t: Float) -> Float:
        # the spline's own parameter runs from 0 to 1, so that it ascends in either direction
        at = np.asarray(position(start + (end - start) * t), dtype=float)
        if at.shape != (t.size, 2) or not np.isfinite(at).all():
            message = "position must return finite eastings and northings of shape (n, 2)."
            raise ValueError(message)
        return at

    samples = _FIRST_SAMPLES
    while samples <= _MAXIMUM_SAMPLES:
        t = np.linspace(0.0, 1.0, samples)
        at = sample(t)
        spline = CubicSpline(t, at)
        # compared at irregular places between the samples, so that no period of it escapes
        between = t[:-1] + np.diff(t) * (0.25 + 0.5 * (_GOLDEN * np.arange(samples - 1) % 1))
        error = np.abs(spline(between) - sample(between)).max()
        dense = np.hypot(*np.diff(at, axis=0).T).max() <= _SAMPLE_DISTANCE * spacing
        if dense and error <= max(CURVE_TOLERANCE * spacing, 4 * np.spacing(np.abs(at).max())):
            return _sample_curve(
                ParametricCurve(position=spline, velocity=spline.derivative(), breaks=t), spacing
            )
        samples = 2 * samples - 1
    message = (
        f"the curve is not smooth enough for a spacing of {spacing} m: a spline through {len(t)} "
        f"points of it still misses it by {error:.1e} m. Give its corners as waypoints instead."
    )
    raise ValueError(message)


def waypoint_path(
    easting: npt.ArrayLike, northing: npt.ArrayLike, *, spacing: float = 0.01
) -> PlaneCurve:
    """Path through waypoints: PCHIP of easting and northing over the chord length.

    PCHIP bends between the waypoints but never overshoots them. Since the chord length is the
    parameter, the path may loop and run in any direction.

    Parameters
    ----------
    easting, northing : array_like, shape (n,)
        Waypoints in the order of travel [m]. Repeated ones in a row count once.
    spacing : float
        Arc length between two points [m].

    Returns
    -------
    PlaneCurve
        Points along the path.

    Raises
    ------
    ValueError
        If a waypoint is not finite, fewer than two differ, or the spacing is not greater than 0 or
        longer than the path.

    Examples
    --------
    >>> path = waypoint_path([0.0, 0.0, 0.0], [0.0, 1.0, 3.0], spacing=0.5)  # due north
    >>> path.northing
    array([0. , 0.5, 1. , 1.5, 2. , 2.5, 3. ])
    """
    from scipy.interpolate import PchipInterpolator

    require_spacing(spacing)
    chords = polyline_curve(easting, northing, what="waypoints")
    pchip = PchipInterpolator(chords.s, np.stack([chords.easting, chords.northing], axis=-1))
    curve = ParametricCurve(position=pchip, velocity=pchip.derivative(), breaks=chords.s)
    return _sample_curve(curve, spacing)


def offset_path(surface: xr.Dataset, offset: float, *, spacing: float = 0.01) -> PlaneCurve:
    """Path at a constant offset from the reference line of a surface.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface with a reference line, dims (u, v).
    offset : float
        Distance from the reference line, left positive [m].
    spacing : float
        Arc length between two points [m], along the path, not along the reference line.

    Returns
    -------
    PlaneCurve
        Points along the parallel of the reference line, over its whole length.

    Raises
    ------
    CoverageError
        If the surface is not that wide, or is a map, which has no reference line.
    ValueError
        If the spacing is not greater than 0.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface(np.zeros((3, 2)), u=[0, 1, 2], v=[-1, 1], easting=[0, 0, 0],
    ...                     northing=[0, 1, 2])
    >>> offset_path(road, 0.5, spacing=1.0).easting  # left of north is west
    array([-0.5, -0.5, -0.5])
    """
    if "u" not in surface.dims:
        raise CoverageError(
            "an offset needs a reference line, which only a surface along a road has",
            cure="Give a line (--line) or waypoints (--path) instead.",
        )
    right, left = float(surface.v[0]), float(surface.v[-1])
    if not right - EDGE <= offset <= left + EDGE:
        raise CoverageError(
            f"offset {offset:g} m lies outside the surface, which reaches from v = {right:g} m "
            f"to {left:g} m",
            cure="Choose an offset between them.",
        )
    return grid_frame(surface).curve.offset(offset).resample(spacing)


def polyline_path(
    easting: npt.ArrayLike, northing: npt.ArrayLike, *, spacing: float = 0.01
) -> PlaneCurve:
    """Path along straight chords between nodes.

    Parameters
    ----------
    easting, northing : array_like, shape (n,)
        Nodes in the order of travel [m]. Repeated ones in a row count once.
    spacing : float
        Arc length between two points [m], measured along the chords.

    Returns
    -------
    PlaneCurve
        Points along the chords.

    Raises
    ------
    ValueError
        If a node is not finite, fewer than two differ, or the spacing is not greater than 0 or
        longer than the path.

    Examples
    --------
    >>> polyline_path([0.0, 1.0, 1.0], [0.0, 0.0, 1.0], spacing=0.5).northing
    array([0. , 0. , 0. , 0.5, 1. ])
    """
    return polyline_curve(easting, northing).resample(spacing)


def _sample_curve(curve: ParametricCurve, spacing: float) -> PlaneCurve:
    s, t, length = equidistant_parameters(curve, spacing)
    at, velocity = curve.position(t), curve.velocity(t)
    # where the curve halts to turn back, its velocity tells no direction: that of arrival counts
    still = np.hypot(*velocity.T) <= _STILL * length / (curve.breaks[-1] - curve.breaks[0])
    chord = np.diff(at, axis=0)
    velocity = np.where(still[:, None], np.concatenate([chord[:1], chord]), velocity)
    return PlaneCurve(
        s=s,
        easting=np.ascontiguousarray(at[:, 0]),
        northing=np.ascontiguousarray(at[:, 1]),
        heading=np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0])),
        length=length,
    )


def _require_finite(what: str, *values: npt.ArrayLike) -> None:
    if not all(np.isfinite(value).all() for value in values):
        message = f"{what} must be finite, got {', '.join(str(value) for value in values)}."
        raise ValueError(message)


def __getattr__(name: str) -> Any:
    if name != "WheelPath":
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    message = "WheelPath is PlaneCurve now; the old name goes with the next release."
    warnings.warn(message, DeprecationWarning, stacklevel=2)
    return PlaneCurve
