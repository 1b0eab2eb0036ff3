"""Motion: trajectory of the body from navigation and accelerometers (thesis 2.3 and 4.2)."""

from trueterrain.motion.fuse import FusedMotion, fuse_motion
from trueterrain.motion.settings import FusionSettings
from trueterrain.motion.trajectory import Poses, Trajectory

__all__ = ["FusedMotion", "FusionSettings", "Poses", "Trajectory", "fuse_motion"]
