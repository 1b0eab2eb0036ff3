"""Tyre profiles along a path (thesis chapter 5).

A profile is a statistic of the heights in a search area around each path point (`tyre_profile`), or
the envelope of a tyre model that rolls over the ground (`tyre_envelope`).
"""

from trueterrain.geometry.path import (
    WheelPath,
    arc_path,
    curve_path,
    function_path,
    offset_path,
    polyline_path,
    straight_path,
    waypoint_path,
)
from trueterrain.profile.area import Disc, Ellipse, Rectangle, SearchArea
from trueterrain.profile.distribution import HeightDistribution, HeightDistributions
from trueterrain.profile.envelope import (
    PASSENGER_TYRE,
    TRUCK_TYRE,
    Envelope,
    LineLaser,
    PatchMean,
    RadialSpringTyre,
    RigidDisc,
    TandemCams,
    TyreData,
    effective_road,
    named_tyre,
    tyre_envelope,
)
from trueterrain.profile.extract import height_distributions, point_profile, tyre_profile
from trueterrain.profile.settings import EnvelopeSettings, TyreProfileSettings
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
    "PASSENGER_TYRE",
    "TRUCK_TYRE",
    "Disc",
    "Ellipse",
    "Envelope",
    "EnvelopeSettings",
    "HeightDistribution",
    "HeightDistributions",
    "InverseDistance",
    "LineLaser",
    "Mean",
    "Median",
    "PatchMean",
    "Percentile",
    "RadialSpringTyre",
    "Rectangle",
    "RigidDisc",
    "SearchArea",
    "Statistic",
    "SteepestCpf",
    "TandemCams",
    "TyreData",
    "TyreProfileSettings",
    "WheelPath",
    "Window",
    "arc_path",
    "curve_path",
    "effective_road",
    "function_path",
    "height_distributions",
    "named_tyre",
    "offset_path",
    "point_profile",
    "polyline_path",
    "straight_path",
    "tyre_envelope",
    "tyre_profile",
    "waypoint_path",
]
