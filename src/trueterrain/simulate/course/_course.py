"""Reference lines and the lanes beside them."""

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
    """Where a line is at each of n stations, and how it turns there."""

    position: Float
    "Easting and northing, shape (n, 2) [m]."
    heading: Float
    "Direction, counter-clockwise from east, not wrapped, shape (n,) [rad]."
    curvature: Float
    "Change of the heading per length of this line, left positive, shape (n,) [1/m]."
    curvature_slope: Float
    "Change of the curvature per length of this line, shape (n,) [1/m^2]."


class Course(ABC):
    """Reference line made of straights, arcs and clothoids; v counts to its left.

    Position, heading and curvature are exact to round-off at any station. A course that is open
    goes straight on beyond its ends; one that is closed begins anew, its heading counting on.
    """

    @abstractmethod
    def _start(self) -> tuple[float, float, float]:
        """Easting, northing [m] and heading [rad] at station 0."""

    @abstractmethod
    def _stretches(self) -> tuple[Stretch, ...]:
        """Parts of the course in their order."""

    @property
    def closed(self) -> bool:
        """Whether the end of the course is its begin."""
        return False

    @cached_property
    def length(self) -> float:
        """Length of the reference line, once around if it is closed [m]."""
        return float(self._line.begin[-1])

    @cached_property
    def turn(self) -> float:
        """Change of the heading from begin to end [rad]; 2 pi around a closed left turn."""
        return float(self._line.heading[-1] - self._line.heading[0])

    @cached_property
    def borders(self) -> tuple[tuple[float, float], ...]:
        """Station [m] and curvature [1/m] where stretches meet, begin and end included."""
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
        Placement
            Of the line through these points at a constant offset.

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
        stretch = 1.0 - curvature * offsets  # [m/m] length of the parallel line
        if stretch.size and stretch.min() <= 0.0:
            worst = int(stretch.argmin())
            raise ValueError(
                f"offset must lie on the road side of the centre of the curve, which is at v = "
                f"{1 / curvature[worst]:.6g} m at station {stations[worst]:.6g} m, "
                f"got {offsets[worst]} m."
            )
        position = np.column_stack([x - offsets * np.sin(heading), y + offsets * np.cos(heading)])
        return LinePlacement(position, heading, curvature / stretch, slope / stretch**3)

    def project(self, x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Float, Float]:
        """Station and offset of points: the inverse of `at`.

        Parameters
        ----------
        x, y : array_like
            Easting and northing [m], finite, of the same shape; flattened.

        Returns
        -------
        station, offset : numpy.ndarray, shape (n,)
            Of the point of the reference line that is nearest [m]. Stations of a closed course
            lie in [0, length), those before and after an open one beyond its ends.

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
    """A line at a constant offset from a course, driven in either direction.

    Distances are those along the lane itself, from where a vehicle begins. In a curve they differ
    from stations: along the lane, a piece of the course that turns by dh is longer by -offset dh.

    Examples
    --------
    >>> from trueterrain.simulate.course import Straight
    >>> back = Lane(course=Straight(length=100.0), offset=-2.0, reverse=True)
    >>> there = back.at([0.0, 30.0])
    >>> there.position.round(9), there.heading[0] == np.pi
    (array([[100., -2.], [ 70., -2.]]), np.True_)
    """

    course: Course
    "The course."

    offset: float = 0.0
    "Offset v of the lane to the left of the course, whichever way it is driven [m]."

    reverse: bool = False
    "Whether it is driven against the direction of the course."

    start: float | None = None
    "Station at distance 0 [m]; by default the begin, or the end if it is driven in reverse."

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
        self.course.at([s for s, _ in self.course.borders], self.offset)  # curvature is extreme

    @cached_property
    def length(self) -> float:
        """Length of the lane from its start to the end of the course, or once around [m]."""
        ends = self._borders[[0, -1]]
        if self.course.closed:
            return float(ends[1] - ends[0])
        return float(self._zero - ends[0] if self.reverse else ends[1] - self._zero)

    def station(self, distance: npt.ArrayLike) -> Float:
        """Station of the course beside which the lane is at a distance.

        Parameters
        ----------
        distance : array_like
            Distances along the lane [m]; flattened.

        Returns
        -------
        numpy.ndarray, shape (n,)
            Stations, on a closed course counting on from lap to lap [m].
        """
        d = np.asarray(distance, dtype=float).ravel()
        along = self._zero - d if self.reverse else self._zero + d
        line, borders = self.course._line, self._borders
        laps = np.zeros(along.size)
        if self.course.closed:
            laps = np.floor(along / borders[-1])
            along = along - laps * borders[-1]
        j = np.clip(np.searchsorted(borders, along, side="right") - 1, 0, line.length.size - 1)
        rest = along - borders[j]
        # rest = s (1 - v bend) - s^2 v twist / 2, solved for s without cancellation
        square, linear = -0.5 * self.offset * line.twist[j], 1.0 - self.offset * line.bend[j]
        root = np.sqrt(np.maximum(linear**2 + 4.0 * square * rest, 0.0))
        station = line.begin[j] + 2.0 * rest / (linear + root)
        if not self.course.closed:  # straight on beyond the ends
            before, after = along < borders[0], along > borders[-1]
            station[before] = along[before]
            station[after] = line.begin[-1] + along[after] - borders[-1]
        return np.asarray(station + laps * self.course.length)

    def at(self, distance: npt.ArrayLike) -> LinePlacement:
        """Position, heading and curvature as a vehicle in the lane meets them.

        Parameters
        ----------
        distance : array_like
            Distances along the lane [m]; flattened.

        Returns
        -------
        Placement
            Heading in the direction of driving, curvature per length of the lane.
        """
        ahead = self.course.at(self.station(distance), self.offset)
        if not self.reverse:
            return ahead
        return ahead._replace(heading=ahead.heading + np.pi, curvature=-ahead.curvature)

    @cached_property
    def _borders(self) -> Float:
        """Distance along the lane from station 0 at the borders of the pieces [m]."""
        line = self.course._line
        return np.asarray(line.begin - self.offset * (line.heading - line.heading[0]))

    @cached_property
    def _zero(self) -> float:
        """Distance along the lane from station 0 to the start [m]."""
        line = self.course._line
        start = self.start
        if start is None:
            start = float(line.begin[-1]) if self.reverse else 0.0
        heading = self.course.at(start).heading[0] - line.heading[0]
        return float(start - self.offset * heading)
