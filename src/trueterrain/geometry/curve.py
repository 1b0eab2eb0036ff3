"""Plane curves: points with stations and headings.

Paths of wheels, reference lines of grids and reference paths of overlaps are such curves. They are
constructed in `trueterrain.geometry.path`, `trueterrain.geometry.reference_line` and
`trueterrain.alignment.discontinuity.reference_path`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.geometry._kernels import CrossSections
from trueterrain.geometry._strips import Strips, mitre_normals
from trueterrain.geometry.stations import chord_lengths, equal_stations

Floats = npt.NDArray[np.float64]

_EQUAL = 1e-6  # part of the spacing by which the distances of points may differ
_WIDE = 12.0  # [m] half-width of the strips in which points are located
_BEND = 0.8  # maximum of that half-width over the minimum radius of curvature


class CurveCoordinates(NamedTuple):
    """Coordinates along a curve."""

    station: Floats
    "Stations, clipped to the ends of the curve [m]."

    offset: Floats
    "Lateral distance from the curve, to the left positive [m]."

    beyond: npt.NDArray[np.bool_]
    "Whether the position lies beyond the ends of the curve."


@dataclass(frozen=True, kw_only=True, eq=False)
class PlaneCurve:
    """Points of a plane curve, joined by straight chords."""

    s: Floats
    "Stations: arc length from the start, ascending, shape (s,) [m]."

    easting: Floats
    "Easting, shape (s,) [m]."

    northing: Floats
    "Northing, shape (s,) [m]."

    heading: Floats
    "Direction of travel, counter-clockwise from east, shape (s,) [rad]."

    length: float
    "Length of the whole curve, which may go on after the last point; once around if closed [m]."

    closed: bool = False
    "Whether the last point is followed by the first."

    def __post_init__(self) -> None:
        """Check that the arrays fit together."""
        shapes = {getattr(self, name).shape for name in ("s", "easting", "northing", "heading")}
        if len(shapes) > 1 or self.s.ndim != 1:
            message = "s, easting, northing and heading must be arrays (s,) of one length."
            raise ValueError(message)
        for name in ("s", "easting", "northing", "heading"):
            if not (getattr(self, name).size and np.isfinite(getattr(self, name)).all()):
                message = f"{name} must hold at least one value and finite ones only."
                raise ValueError(message)

    def __len__(self) -> int:
        return self.s.size

    def __getitem__(self, index: slice | npt.NDArray[np.int64]) -> "PlaneCurve":
        """Some of the points, with the same stations, as an open curve."""
        names = ("s", "easting", "northing", "heading")
        arrays: dict[str, Any] = {name: getattr(self, name)[index] for name in names}
        return replace(self, closed=False, **arrays)

    @cached_property
    def spacing(self) -> float:
        """Distance from one point to the next, which must be equal [m]."""
        steps = np.diff(self.s)
        if not (steps.size and np.ptp(steps) <= _EQUAL * steps[0]):
            found = f"{steps.min():g} m to {steps.max():g} m" if steps.size else "one point"
            message = f"the points of the curve must be equally spaced, got {found}; resample it."
            raise ValueError(message)
        return float(steps[0])

    @property
    def curvature(self) -> Floats:
        """Curvature at the inner points, left positive, shape (s - 2,) [1/m]."""
        x, y = np.diff(self.easting), np.diff(self.northing)
        return np.asarray((x[:-1] * y[1:] - y[:-1] * x[1:]) / self.spacing**3)

    @cached_property
    def sections(self) -> CrossSections:
        """Cross-sections at the points, along the bisectors of the chords.

        A `SchemaError` says where the curve doubles back or two points coincide.
        """
        if self.closed:
            inner = self.extend(1).sections
            return CrossSections(*(np.ascontiguousarray(at[1:-1]) for at in inner))
        normals = mitre_normals(self.easting, self.northing)
        arrays = (self.s, self.easting, self.northing, *normals)
        return CrossSections(*(np.ascontiguousarray(at, dtype=np.float64) for at in arrays))

    def part(self, begin: int, end: int) -> "PlaneCurve":
        """Points `begin` to `end` (not included) as a curve of their own.

        Parameters
        ----------
        begin, end : int
            Indices as in a slice.

        Returns
        -------
        PlaneCurve
            Views of the same arrays, with the same stations.
        """
        return self[begin:end]

    def extend(self, count: int) -> "PlaneCurve":
        """Curve with more points before its first and after its last one, equally spaced.

        Parameters
        ----------
        count : int
            Number of points at either end.

        Returns
        -------
        PlaneCurve
            An open curve: straight on beyond the ends, or further around if it is closed.
        """
        n, step = len(self), self.spacing
        before, after = np.arange(-count, 0) * step, np.arange(n, n + count) * step
        return PlaneCurve(
            s=np.concatenate([self.s[0] + before, self.s, self.s[0] + after]),
            easting=_lengthen(self.easting, count, self.closed),
            northing=_lengthen(self.northing, count, self.closed),
            heading=np.pad(self.heading, count, mode="wrap" if self.closed else "edge"),
            length=self.length + 2 * count * step,
        )

    def offset(self, distance: float) -> "PlaneCurve":
        """Parallel of the curve.

        Parameters
        ----------
        distance : float
            Offset along the cross-sections, left positive [m].

        Returns
        -------
        PlaneCurve
            Through the same cross-sections, with stations of its own.
        """
        _, x, y, nx, ny = self.sections
        return polyline_curve(x + distance * nx, y + distance * ny)

    def resample(self, spacing: float) -> "PlaneCurve":
        """Points at equal spacing along the chords, from the first to the last point.

        Parameters
        ----------
        spacing : float
            Arc length between two points [m].

        Returns
        -------
        PlaneCurve
            Each heading is that of the chord.

        Raises
        ------
        ValueError
            If the spacing is not greater than 0 or longer than the curve.
        """
        length = float(self.s[-1] - self.s[0])
        s = equal_stations(length, spacing)
        heading = np.unwrap(np.arctan2(np.diff(self.northing), np.diff(self.easting)))
        along = self.s - self.s[0]
        chord = np.clip(np.searchsorted(along, s, side="right") - 1, 0, heading.size - 1)
        return PlaneCurve(
            s=s,
            easting=np.interp(s, along, self.easting),
            northing=np.interp(s, along, self.northing),
            heading=heading[chord],
            length=length,
        )

    def position_at(
        self, station: npt.ArrayLike, offset: npt.ArrayLike = 0.0
    ) -> tuple[Floats, Floats]:
        """Position of stations and offsets on a curve of equally spaced points.

        Parameters
        ----------
        station : array_like
            Stations [m]; clipped to the ends of an open curve.
        offset : array_like
            Lateral distance at right angles to the heading, which is linear between the points,
            to the left positive [m].

        Returns
        -------
        easting, northing : numpy.ndarray
            Coordinates [m].
        """
        s, v = np.asarray(station, dtype=float) - self.s[0], np.asarray(offset, dtype=float)
        last = len(self) - (not self.closed)
        place = np.clip((s % self.length if self.closed else s) / self.spacing, 0, last)
        near = np.minimum(np.floor(place).astype(np.int64), len(self) - 1)
        further = self.extend(1)
        turn = np.unwrap(further.heading[1:])
        heading = turn[near] + (place - near) * (turn[near + 1] - turn[near])
        at = self.s[0] + place * self.spacing
        return (
            np.interp(at, further.s, further.easting) - v * np.sin(heading),
            np.interp(at, further.s, further.northing) + v * np.cos(heading),
        )

    def project(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> CurveCoordinates:
        """Stations and offsets of positions, on a curve of equally spaced points.

        Parameters
        ----------
        easting, northing : array_like, shape (n,)
            Positions [m].

        Returns
        -------
        CurveCoordinates
            NaN where a position is not finite.

        Notes
        -----
        Near the curve the cross-sections locate a position, as in a grid, so stations are
        continuous on bends; elsewhere the nearest chord does.

        Examples
        --------
        >>> north = curve_of_points(np.arange(11.0), np.zeros(11), np.arange(11.0))
        >>> station, offset, beyond = north.project([-2.0, 0.0], [2.5, 12.0])
        >>> station, offset, beyond
        (array([ 2.5, 10. ]), array([2., 0.]), array([False, True]))
        """
        x, y = (np.ravel(np.asarray(at, dtype=float)) for at in (easting, northing))
        station, offset = self._strips.locate(x, y)
        lost = np.flatnonzero(np.isnan(station) & np.isfinite(x) & np.isfinite(y))
        if lost.size:
            station[lost], offset[lost] = self._nearest_chord(x[lost], y[lost])
        begin, end = self.s[0], self.s[-1]
        if self.closed:
            station = begin + (station - begin) % self.length
            return CurveCoordinates(station, offset, np.zeros(x.size, np.bool_))
        beyond = (station < begin) | (station > end)
        return CurveCoordinates(np.clip(station, begin, end), offset, beyond)

    @cached_property
    def _strips(self) -> Strips:
        """Strips that contain nearly all positions, narrower than the radius of curvature."""
        angle = np.abs(np.diff(np.unwrap(self.heading))).max(initial=0.0)
        half = min(_WIDE, _BEND * self.spacing / angle if angle > 0 else np.inf)
        return Strips(self.extend(int(self.closed)).sections, -half, half)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(np.stack([self.easting, self.northing], axis=1))

    def _nearest_chord(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Station and offset on the nearest chord; the outermost chords are extended."""
        _, near = self._tree.query(np.stack([x, y], axis=1))
        n = len(self)
        best = np.full(x.size, np.inf)
        station, offset = np.empty(x.size), np.empty(x.size)
        for begin in (near - 1, near):
            if not self.closed:
                begin = np.clip(begin, 0, n - 2)
            a, b = begin % n, (begin + 1) % n
            cx, cy = self.easting[b] - self.easting[a], self.northing[b] - self.northing[a]
            dx, dy = x - self.easting[a], y - self.northing[a]
            part = (dx * cx + dy * cy) / (cx * cx + cy * cy)
            low = np.where((begin == 0) & (not self.closed), -np.inf, 0.0)
            high = np.where((begin == n - 2) & (not self.closed), np.inf, 1.0)
            part = np.clip(part, low, high)
            away = np.hypot(dx - part * cx, dy - part * cy)
            closer = away < best
            best = np.where(closer, away, best)
            station = np.where(closer, self.s[0] + (begin + part) * self.spacing, station)
            offset = np.where(closer, np.copysign(away, cx * dy - cy * dx), offset)
        return station, offset


def curve_of_points(
    s: Floats, easting: Floats, northing: Floats, *, closed: bool = False
) -> PlaneCurve:
    """Curve through points at known stations.

    Parameters
    ----------
    s : numpy.ndarray, shape (s,)
        Stations [m].
    easting, northing : numpy.ndarray, shape (s,)
        Points, at least 2 [m].
    closed : bool
        Whether the last point is followed by the first, as far from it as the second.

    Returns
    -------
    PlaneCurve
        The heading at a point is that of the line from the point before to the point after.

    Examples
    --------
    >>> corner = curve_of_points(np.arange(3.0), np.array([0.0, 1, 1]), np.array([0.0, 0, 1]))
    >>> np.rad2deg(corner.heading)
    array([ 0., 45., 90.])
    """
    if s.size < 2 or easting.shape != s.shape or northing.shape != s.shape:
        message = (
            "a curve needs at least 2 points, and an easting and a northing for each station, got "
            f"the shapes {s.shape}, {easting.shape} and {northing.shape}."
        )
        raise ValueError(message)
    x, y = (_lengthen(at, 1, closed) for at in (easting, northing))
    return PlaneCurve(
        s=s,
        easting=easting,
        northing=northing,
        heading=np.arctan2(y[2:] - y[:-2], x[2:] - x[:-2]),
        length=float(s.size * (s[1] - s[0]) if closed else s[-1] - s[0]),
        closed=closed,
    )


def polyline_curve(
    easting: npt.ArrayLike, northing: npt.ArrayLike, *, what: str = "nodes"
) -> PlaneCurve:
    """Curve along straight chords between nodes; its stations are lengths of chords.

    Parameters
    ----------
    easting, northing : array_like, shape (n,)
        Nodes in the order of travel [m]. Repeated ones in a row count once.
    what : str
        What messages call them.

    Returns
    -------
    PlaneCurve
        Through the nodes that differ from the one before.

    Raises
    ------
    ValueError
        If a node is not finite or fewer than two differ.

    Examples
    --------
    >>> polyline_curve([0.0, 3.0, 3.0], [0.0, 4.0, 4.0]).s
    array([0., 5.])
    """
    x, y = np.asarray(easting, dtype=float), np.asarray(northing, dtype=float)
    if x.ndim != 1 or x.shape != y.shape:
        message = f"{what} must be two arrays of one length, got shapes {x.shape} and {y.shape}."
        raise ValueError(message)
    nodes = np.stack([x, y], axis=-1)
    bad = np.flatnonzero(~np.isfinite(nodes).all(axis=-1))
    if bad.size:
        message = f"{what} must be finite, got {nodes[bad[0]]} at index {bad[0]}."
        raise ValueError(message)
    s = chord_lengths(x, y)
    new = np.diff(s, prepend=-1.0) > 0
    if np.count_nonzero(new) < 2:
        message = f"a path needs at least 2 different {what}, got {np.count_nonzero(new)}."
        raise ValueError(message)
    return curve_of_points(s[new], x[new], y[new])


def _lengthen(at: Floats, count: int, closed: bool) -> Floats:
    """Coordinates of points and of more beyond both ends: straight on, or around."""
    if closed:
        return np.pad(at, count, mode="wrap")
    steps = np.arange(1, count + 1)
    return np.concatenate(
        [at[0] - (at[1] - at[0]) * steps[::-1], at, at[-1] + (at[-1] - at[-2]) * steps]
    )
