"""Simulated ground: heights at any point, from parameters and a seed."""

from trueterrain.simulate.ground._belgian_block import BelgianBlock
from trueterrain.simulate.ground._courses import AlongCourse, Measured, Repeated, StationTable
from trueterrain.simulate.ground._debris import Cracks, Stone, Stones
from trueterrain.simulate.ground._ground import Ground, Sum
from trueterrain.simulate.ground._iso8608 import Road, track_coherence
from trueterrain.simulate.ground._sampling import sample_points, sample_road, sample_surface
from trueterrain.simulate.ground._shapes import Cleats, ExcitationEvent, Plane, Sine, Step

__all__ = [
    "AlongCourse",
    "BelgianBlock",
    "Cleats",
    "Cracks",
    "ExcitationEvent",
    "Ground",
    "Measured",
    "Plane",
    "Repeated",
    "Road",
    "Sine",
    "StationTable",
    "Step",
    "Stone",
    "Stones",
    "Sum",
    "sample_points",
    "sample_road",
    "sample_surface",
    "track_coherence",
]
