"""Where a virtual vehicle drives: reference lines of exact geometry, and lanes beside them."""

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
