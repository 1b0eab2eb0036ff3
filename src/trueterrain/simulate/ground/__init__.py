"""Ground that the package makes itself: heights at any point, from parameters and a seed."""

from trueterrain.simulate.ground._belgian_block import BelgianBlock
from trueterrain.simulate.ground._debris import Cracks, Stone, Stones
from trueterrain.simulate.ground._ground import Ground, Sum
from trueterrain.simulate.ground._iso8608 import Road, track_coherence
from trueterrain.simulate.ground._measured import Measured
from trueterrain.simulate.ground._sampling import sample_points, sample_road, sample_surface
from trueterrain.simulate.ground._shapes import Cleats, Plane, Sine, Step

__all__ = [
    "BelgianBlock",
    "Cleats",
    "Cracks",
    "Ground",
    "Measured",
    "Plane",
    "Road",
    "Sine",
    "Step",
    "Stone",
    "Stones",
    "Sum",
    "sample_points",
    "sample_road",
    "sample_surface",
    "track_coherence",
]
