"""How the body of a virtual vehicle moves: on springs over the ground, parked, or as prescribed."""

from trueterrain.simulate.body._motion import Motion
from trueterrain.simulate.body._pass import PassPlan
from trueterrain.simulate.body._prescribed import Follower, Parked, Prescribed, Wave
from trueterrain.simulate.body._vehicle import BodyMotion

__all__ = ["BodyMotion", "Follower", "Motion", "Parked", "PassPlan", "Prescribed", "Wave"]
