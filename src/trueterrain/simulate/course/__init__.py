"""Where a virtual vehicle drives: reference lines of exact geometry, and lanes beside them."""

from trueterrain.simulate.course._course import Course, Lane, Placement
from trueterrain.simulate.course._line import Stretch
from trueterrain.simulate.course._shapes import Arc, Oval, Straight, Stretches, Waypoints

__all__ = [
    "Arc",
    "Course",
    "Lane",
    "Oval",
    "Placement",
    "Straight",
    "Stretch",
    "Stretches",
    "Waypoints",
]
