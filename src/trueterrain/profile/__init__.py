"""Tyre profiles along a path (thesis chapter 5).

A profile is a statistic of the heights in a search area around each path point (`tyre_profile`), or
the envelope of a tyre model that rolls over the ground (`tyre_envelope`).
"""

import warnings
from typing import Any

from trueterrain.geometry.curve import PlaneCurve
from trueterrain.geometry.path import (
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
    "PlaneCurve",
    "RadialSpringTyre",
    "Rectangle",
    "RigidDisc",
    "SearchArea",
    "Statistic",
    "SteepestCpf",
    "TandemCams",
    "TyreData",
    "TyreProfileSettings",
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


def __getattr__(name: str) -> Any:
    if name != "WheelPath":
        message = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(message)
    message = "WheelPath is PlaneCurve now; the old name goes with the next release."
    warnings.warn(message, DeprecationWarning, stacklevel=2)
    return PlaneCurve
