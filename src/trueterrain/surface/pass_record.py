"""Pass record: a recorded run with the motion that places its returns."""

from dataclasses import dataclass
from pathlib import Path

from trueterrain.formats.run import Mounting
from trueterrain.motion.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class PassRecord:
    """A run with its trajectory and mounting: all that georeferences its returns."""

    path: Path
    "Store of the run, NAME.zarr."

    trajectory: Trajectory
    "Motion of the body; scans outside its time are left out."

    mounting: Mounting | None = None
    "Pose of the scanner in the body frame, and its clock; by default that of the run."
