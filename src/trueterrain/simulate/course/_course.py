"""Reference lines, and lines at a constant offset from them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.course import _kernels
from trueterrain.simulate.course._line import (
    Float,
    Groups,
    Line,
    Stretch,
    chain_stretches,
    group_pieces,
    place_on_line,
)


class LinePlacement(NamedTuple):
    """Position, direction and curvature of a line at n stations."""

    position: Float
    "Easting and northing, shape (n, 2) [m]."
    heading: Float
    "Direction, counter-clockwise from east, not wrapped, shape (n,) [rad]."
    curvature: Float
    "Change of the heading per length of this line, left positive, shape (n,) [1/m]."
    curvature_slope: Float
    "Change of the curvature per length of this line, shape (n,) [1/m^2]."


class Course(ABC):
    """Reference line of straights, arcs and clothoids; offsets v are positive to its left.

    Position, heading and curvature are exact to round-off at any station. An open course continues
    straight beyond its ends; a closed one repeats, with a heading that is not wrapped.
    """

    @abstractmethod
    def _start(self) -> tuple[float, float, float]:
        """Easting, northing [m] and heading [rad] at station 0."""

    @abstractmethod
    def _stretches(self) -> tuple[Stretch, ...]:
        """Parts of the course in order."""

    @property
    def closed(self) -> bool:
        """Whether the course ends at its start."""
        return False

    @cached_property
    def length(self) -> float:
        """Length of the reference line, once around if it is closed [m]."""
        return float(self._line.begin[-1])

    @cached_property
    def turn(self) -> float:
        """Change of the heading from start to end [rad]; 2 pi for a closed left turn."""
        return float(self._line.heading[-1] - self._line.heading[0])

    @cached_property
    def borders(self) -> tuple[tuple[float, float], ...]:
        """Stations [m] and curvatures [1/m] at the ends of the stretches."""
        stretches = self._stretches()
        stations = np.concatenate([[0.0], np.cumsum([part.length for part in stretches])])
        curvatures = [stretches[0].begin, *(part.end for part in stretches)]
        return tuple(zip(stations.tolist(), curvatures, strict=True))

    def at(self, station: npt.ArrayLike, offset: npt.ArrayLike = 0.0) -> LinePlacement:
        """Position, heading and curvature of the reference line, or of a line parallel to it.

        Parameters
        ----------
        station : array_like
            Distance along the reference line [m], of any shape; flattened.
        offset : array_like
            Offset v to the left of the reference line [m], one or as many as stations.

        Returns
        -------
        LinePlacement
            Of the line at a constant offset through these points.

        Raises
        ------
        ValueError
            If a station is not finite, or an offset lies beyond the centre of the curve.

        Examples
        --------
        >>> from trueterrain.simulate.course import Straight
        >>> east_of_here = Straight(length=100.0).at([0.0, 10.0], offset=2.0)
        >>> east_of_here.position
        array([[ 0., 2.], [10., 2.]])
        """
        stations, offsets = np.broadcast_arrays(
            np.asarray(station, dtype=float), np.asarray(offset, dtype=float)
        )
        stations, offsets = stations.ravel(), offsets.ravel()
        if not (np.isfinite(stations).all() and np.isfinite(offsets).all()):
            raise ValueError("station and offset must be finite.")
        laps = np.floor(stations / self.length) if self.closed else np.zeros(stations.size)
        out = place_on_line(self._line, stations - laps * self.length, open_ended=not self.closed)
        x, y, heading, curvature, slope = out.T
        heading = heading + laps * self.turn
        scale = (
            1.0 - curvature * offsets
        )  # [m/m] length of the parallel line over that of the course
        if scale.size and scale.min() <= 0.0:
            worst = int(scale.argmin())
            raise ValueError(
                f"offset must lie on the road side of the centre of the curve, which is at v = "
                f"{1 / curvature[worst]:.6g} m at station {stations[worst]:.6g} m, "
                f"got {offsets[worst]} m."
            )
        position = np.column_stack([x - offsets * np.sin(heading), y + offsets * np.cos(heading)])
        return LinePlacement(position, heading, curvature / scale, slope / scale**3)

    def project(self, x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Float, Float]:
        """Station and offset of points: the inverse of `at`.

        Parameters
        ----------
        x, y : array_like
            Easting and northing [m], finite, of the same shape; flattened.

        Returns
        -------
        station, offset : numpy.ndarray, shape (n,)
            Of the nearest point of the reference line [m]. Stations of a closed course are in
            [0, length); those of an open one continue beyond its ends.

        Examples
        --------
        >>> from trueterrain.simulate.course import Straight
        >>> Straight(length=100.0).project([-5.0, 30.0], [1.0, -2.0])
        (array([-5., 30.]), array([ 1., -2.]))
        """
        px = np.ascontiguousarray(x, dtype=float).ravel()
        py = np.ascontiguousarray(y, dtype=float).ravel()
        u, v = np.empty(px.size), np.empty(px.size)
        _kernels.project_points(px, py, *self._line, *self._groups, not self.closed, u, v)
        if self.closed:
            u[u >= self.length] = 0.0
        return u, v

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters of the course, for provenance."""
        names = getattr(self, "__dataclass_fields__", {})
        return {"kind": type(self).__name__, **{name: getattr(self, name) for name in names}}

    @cached_property
    def _line(self) -> Line:
        return chain_stretches(self._stretches(), *self._start())

    @cached_property
    def _groups(self) -> Groups:
        return group_pieces(self._line)


@dataclass(frozen=True, kw_only=True)
class OffsetLine:
    """Line at a constant offset from a course, driven in either direction.

    Distances are along the line itself, from the start of the vehicle. In a curve they differ from
    stations: a piece of the course that turns by dh is longer by -offset dh along the line.

    Examples
    --------
    >>> from trueterrain.simulate.course import Straight
    >>> back = OffsetLine(course=Straight(length=100.0), offset=-2.0, reverse=True)
    >>> there = back.at([0.0, 30.0])
    >>> there.position.round(9), there.heading[0] == np.pi
    (array([[100., -2.], [ 70., -2.]]), np.True_)
    """

    course: Course
    "The course."

    offset: float = 0.0
    "Offset v of the line to the left of the course, in either direction of travel [m]."

    reverse: bool = False
    "Whether the direction of travel is against that of the course."

    start: float | None = None
    "Station at distance 0 [m]; by default the start, or the end if driven in reverse."

    def __post_init__(self) -> None:
        if not np.isfinite(self.offset):
            raise ValueError(f"offset must be finite, got {self.offset} m.")
        if self.start is not None:
            if not np.isfinite(self.start):
                raise ValueError(f"start must be finite, got {self.start} m.")
            if not (self.course.closed or 0 <= self.start <= self.course.length):
                raise ValueError(
                    f"start must be from 0 to {self.course.length:.6g} m, the length of the "
                    f"course, got {self.start} m."
                )
        self.course.at(
            [s for s, _ in self.course.borders], self.offset
        )  # the extremes of curvature are at the borders

    @cached_property
    def length(self) -> float:
        """Length from the start to the end of the course, or once around [m]."""
        ends = self._borders[[0, -1]]
        if self.course.closed:
            return float(ends[1] - ends[0])
        return float(
            self._start_distance - ends[0] if self.reverse else ends[1] - self._start_distance
        )

    def station(self, distance: npt.ArrayLike) -> Float:
        """Station of the course at a distance along the line.

        Parameters
        ----------
        distance : array_like
            Distances along the line [m]; flattened.

        Returns
        -------
        numpy.ndarray, shape (n,)
            Stations [m]; on a closed course they increase from lap to lap.
        """
        d = np.asarray(distance, dtype=float).ravel()
        travelled = self._start_distance - d if self.reverse else self._start_distance + d
        line, borders = self.course._line, self._borders
        laps = np.zeros(travelled.size)
        if self.course.closed:
            laps = np.floor(travelled / borders[-1])
            travelled = travelled - laps * borders[-1]
        j = np.clip(np.searchsorted(borders, travelled, side="right") - 1, 0, line.length.size - 1)
        remaining = travelled - borders[j]
        # solve remaining = s (1 - v bend) - s^2 v twist / 2 for s without cancellation
        square, linear = -0.5 * self.offset * line.twist[j], 1.0 - self.offset * line.bend[j]
        root = np.sqrt(np.maximum(linear**2 + 4.0 * square * remaining, 0.0))
        station = line.begin[j] + 2.0 * remaining / (linear + root)
        if not self.course.closed:  # straight beyond the ends
            before, after = travelled < borders[0], travelled > borders[-1]
            station[before] = travelled[before]
            station[after] = line.begin[-1] + travelled[after] - borders[-1]
        return np.asarray(station + laps * self.course.length)

    def at(self, distance: npt.ArrayLike) -> LinePlacement:
        """Position, heading and curvature of the line in the direction of travel.

        Parameters
        ----------
        distance : array_like
            Distances along the line [m]; flattened.

        Returns
        -------
        LinePlacement
            Heading in the direction of travel, curvature per length of the line.
        """
        placement = self.course.at(self.station(distance), self.offset)
        if not self.reverse:
            return placement
        return placement._replace(heading=placement.heading + np.pi, curvature=-placement.curvature)

    @cached_property
    def _borders(self) -> Float:
        """Distance along the line from station 0 at the borders of the pieces [m]."""
        line = self.course._line
        return np.asarray(line.begin - self.offset * (line.heading - line.heading[0]))

    @cached_property
    def _start_distance(self) -> float:
        """Distance along the line from station 0 to the start [m]."""
        line = self.course._line
        start = self.start
        if start is None:
            start = float(line.begin[-1]) if self.reverse else 0.0
        heading = self.course.at(start).heading[0] - line.heading[0]
        return float(start - self.offset * heading)
