"""Courses: straight, arc, oval, stretches, waypoints."""

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np

from trueterrain.simulate.course._course import Course
from trueterrain.simulate.course._line import Stretch, chain_stretches

Turn = Literal["left", "right"]

_CLOSURE = 1e-6  # [m], [rad] tolerance of the closure of a closed course


@dataclass(frozen=True, kw_only=True)
class _PlacedCourse(Course):
    """Course with a position and a direction at station 0."""

    east: float = 0.0
    "Easting at station 0 [m]."

    north: float = 0.0
    "Northing at station 0 [m]."

    heading: float = 0.0
    "Direction at station 0, counter-clockwise from east [rad]."

    def __post_init__(self) -> None:
        for name in ("east", "north", "heading"):
            if not np.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)}.")

    def _start(self) -> tuple[float, float, float]:
        return self.east, self.north, self.heading


@dataclass(frozen=True, kw_only=True)
class Straight(_PlacedCourse):
    """Straight course.

    Examples
    --------
    >>> Straight(length=50.0, heading=np.pi / 2).at(10.0).position.round(9)
    array([[ 0., 10.]])
    """

    length: float = dataclasses.field()
    "Length [m]."

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_positive("length", self.length, "m")

    def _stretches(self) -> tuple[Stretch, ...]:
        return (Stretch(length=self.length),)


@dataclass(frozen=True, kw_only=True)
class Arc(_PlacedCourse):
    """Circular arc, between clothoids if there are transitions.

    Examples
    --------
    >>> Arc(radius=20.0, angle=np.pi / 2).at(10.0 * np.pi).position.round(9)
    array([[20., 20.]])
    """

    radius: float
    "Radius [m]."

    angle: float
    "Change of the heading from start to end, transitions included [rad]."

    turn_to: Turn = "left"
    '``"left"`` or ``"right"``.'

    transition: float = 0.0
    "Length of the clothoid at each end of the arc [m]."

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_positive("radius", self.radius, "m")
        _check_positive("angle", self.angle, "rad")
        _check_curve(self.turn_to, self.radius, self.angle, self.transition)

    def _stretches(self) -> tuple[Stretch, ...]:
        return _curve_stretches(self.turn_to, self.radius, self.angle, self.transition)


@dataclass(frozen=True, kw_only=True)
class Oval(_PlacedCourse):
    """Closed course: two straights and two half circles, joined by clothoids.

    Curvature is continuous, and so is the yaw rate of a vehicle. Station 0 is at the start of a
    straight.

    Examples
    --------
    >>> oval = Oval(straight=100.0, radius=40.0, transition=20.0)
    >>> print(round(oval.length, 6))
    491.327412
    >>> gap = oval.at(oval.length).position - oval.at(0.0).position
    >>> bool(abs(gap).max() < 1e-9)
    True
    """

    straight: float
    "Length of each straight [m]."

    radius: float
    "Radius of the half circles [m]."

    transition: float
    "Length of each of the four clothoids [m]."

    turn_to: Turn = "left"
    '``"left"``, counter-clockwise, or ``"right"``.'

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("straight", "radius", "transition"):
            _check_positive(name, getattr(self, name), "m")
        _check_curve(self.turn_to, self.radius, np.pi, self.transition)

    @property
    def closed(self) -> bool:
        """True."""
        return True

    def _stretches(self) -> tuple[Stretch, ...]:
        half = (
            Stretch(length=self.straight),
            *_curve_stretches(self.turn_to, self.radius, np.pi, self.transition),
        )
        return half + half


@dataclass(frozen=True, kw_only=True)
class Stretches(_PlacedCourse):
    """Course of consecutive stretches.

    Examples
    --------
    >>> pad = Stretches(parts=(Stretch(length=60 * np.pi, begin=1 / 30, end=1 / 30),), close=True)
    >>> print(pad.at(30 * np.pi).position.round(9))
    [[ 0. 60.]]
    """

    parts: tuple[Stretch, ...]
    "The stretches; the yaw rate is continuous if each starts with the last curvature."

    close: bool = False
    "Whether the course is closed; then it must end at its start."

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.parts:
            raise ValueError("parts must hold at least one stretch, got none.")
        if self.close:
            line = chain_stretches(self.parts, *self._start())
            gap = np.hypot(line.x[-1] - line.x[0], line.y[-1] - line.y[0])
            laps = (line.heading[-1] - line.heading[0]) / (2 * np.pi)
            if gap > _CLOSURE or abs(laps - round(laps)) * 2 * np.pi > _CLOSURE:
                raise ValueError(
                    "a closed course must end at its start, in the same direction; it ends "
                    f"{gap:.6g} m away after {laps:.6g} revolutions."
                )

    @property
    def closed(self) -> bool:
        """Whether the course ends at its start."""
        return self.close

    def _stretches(self) -> tuple[Stretch, ...]:
        return self.parts


@dataclass(frozen=True, kw_only=True)
class Waypoints(Course):
    """Course through points: one clothoid between each two, of continuous curvature.

    The curvature is zero at both ends of an open course.

    Examples
    --------
    >>> bend = Waypoints(points=((0.0, 0.0), (30.0, 0.0), (60.0, 10.0), (80.0, 30.0)))
    >>> station, offset = bend.project([30.0, 60.0], [0.0, 10.0])
    >>> bool(abs(offset).max() < 1e-9)
    True
    """

    points: tuple[tuple[float, float], ...]
    "Easting and northing of each point [m]."

    close: bool = False
    "Whether the course continues from the last point to the first one."

    def __post_init__(self) -> None:
        array = np.asarray(self.points, dtype=float)
        minimum = 3 if self.close else 2
        if array.ndim != 2 or array.shape[1] != 2 or len(array) < minimum:
            raise ValueError(
                f"points must be at least {minimum} pairs of easting and northing, "
                f"got an array of shape {array.shape}."
            )
        if not np.isfinite(array).all():
            raise ValueError("points must be finite.")
        following = np.roll(array, -1, axis=0) if self.close else array[1:]
        apart = np.hypot(*(following - array[: len(following)]).T)
        if not apart.min() > 0:
            raise ValueError(
                f"points must differ from their neighbours, but point {int(apart.argmin())} "
                f"is the same as the next one."
            )
        _ = self._solution  # refuses an impossible course at once

    @property
    def closed(self) -> bool:
        """Whether the course continues from the last point to the first one."""
        return self.close

    @cached_property
    def _solution(self) -> tuple[float, tuple[Stretch, ...]]:
        from trueterrain.simulate.course._waypoints import clothoids_through

        return clothoids_through(np.asarray(self.points, dtype=float), closed=self.close)

    def _start(self) -> tuple[float, float, float]:
        east, north = self.points[0]
        return float(east), float(north), self._solution[0]

    def _stretches(self) -> tuple[Stretch, ...]:
        return self._solution[1]


def _curve_stretches(
    turn_to: Turn, radius: float, angle: float, transition: float
) -> tuple[Stretch, ...]:
    curvature = (1.0 if turn_to == "left" else -1.0) / radius
    arc = radius * angle - transition  # a clothoid turns half as far as an arc of its length
    parts = [
        (transition, 0.0, curvature),
        (arc, curvature, curvature),
        (transition, curvature, 0.0),
    ]
    return tuple(
        Stretch(length=length, begin=begin, end=end) for length, begin, end in parts if length > 0
    )


def _check_curve(turn_to: str, radius: float, angle: float, transition: float) -> None:
    if turn_to not in get_args(Turn):
        raise ValueError(f"turn_to must be 'left' or 'right', got {turn_to!r}.")
    longest = radius * angle
    if not 0 <= transition <= longest:
        raise ValueError(
            f"transition must be from 0 to {longest:.6g} m, so that it fits into the curve, "
            f"got {transition} m."
        )


def _check_positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be greater than 0 {unit}, got {value}.")
