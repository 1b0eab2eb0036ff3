"""Motion of the body of a virtual vehicle: on its suspension, parked, or prescribed."""

from trueterrain.simulate.body._motion import Motion
from trueterrain.simulate.body._pass import PassPlan
from trueterrain.simulate.body._prescribed import Follower, Parked, Prescribed, Wave
from trueterrain.simulate.body._vehicle import BodyMotion

__all__ = ["BodyMotion", "Follower", "Motion", "Parked", "PassPlan", "Prescribed", "Wave"]
