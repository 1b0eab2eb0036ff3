"""Motion: where the body was at any time, and how surely (thesis 2.3 and 4.2)."""

from trueterrain.motion.fuse import FusedMotion, FusionSettings, fuse_motion
from trueterrain.motion.trajectory import Poses, Trajectory

__all__ = ["FusedMotion", "FusionSettings", "Poses", "Trajectory", "fuse_motion"]
