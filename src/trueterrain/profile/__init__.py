"""The profile that a tyre feels (thesis chapter 5): path, search area, distribution, statistic."""

from trueterrain.profile.area import Disc, Ellipse, Rectangle, SearchArea
from trueterrain.profile.distribution import HeightDistribution, HeightDistributions
from trueterrain.profile.extract import height_distributions, point_profile, tyre_profile
from trueterrain.profile.options import ProfileOptions
from trueterrain.profile.path import (
    WheelPath,
    arc_path,
    curve_path,
    function_path,
    offset_path,
    polyline_path,
    straight_path,
    waypoint_path,
)
from trueterrain.profile.statistic import (
    InverseDistance,
    Mean,
    Median,
    Percentile,
    Statistic,
    SteepestCpf,
    Window,
)

__all__ = [
    "Disc",
    "Ellipse",
    "HeightDistribution",
    "HeightDistributions",
    "InverseDistance",
    "Mean",
    "Median",
    "Percentile",
    "ProfileOptions",
    "Rectangle",
    "SearchArea",
    "Statistic",
    "SteepestCpf",
    "WheelPath",
    "Window",
    "arc_path",
    "curve_path",
    "function_path",
    "height_distributions",
    "offset_path",
    "point_profile",
    "polyline_path",
    "straight_path",
    "tyre_profile",
    "waypoint_path",
]
