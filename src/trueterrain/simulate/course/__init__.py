"""Courses of a virtual vehicle: reference lines of exact geometry, and lines parallel to them."""

from trueterrain.simulate.course._course import Course, LinePlacement, OffsetLine
from trueterrain.simulate.course._line import Stretch
from trueterrain.simulate.course._shapes import Arc, Oval, Straight, Stretches, Waypoints

__all__ = [
    "Arc",
    "Course",
    "LinePlacement",
    "OffsetLine",
    "Oval",
    "Straight",
    "Stretch",
    "Stretches",
    "Waypoints",
]
