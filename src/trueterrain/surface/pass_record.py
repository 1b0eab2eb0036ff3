"""Pass record: a recorded run with the motion that places its returns."""

import warnings
from dataclasses import dataclass
from pathlib import Path

from trueterrain.formats.run import Mounting, Run, open_run
from trueterrain.motion.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False, init=False)
class PassRecord:
    """A run with its trajectory and mounting: all that georeferences its returns.

    Parameters
    ----------
    run : Run or path
        The run, or its store, which is then opened.
    trajectory : Trajectory
        Motion of the body; scans outside its time are left out.
    mounting : Mounting, optional
        Pose of the scanner in the body frame, and its clock; by default that of the run.
    """

    run: Run
    "The run, open."

    trajectory: Trajectory
    "Motion of the body."

    mounting: Mounting
    "Pose of the scanner in the body frame, and its clock."

    def __init__(
        self,
        *,
        run: Run | str | Path | None = None,
        trajectory: Trajectory,
        mounting: Mounting | None = None,
        path: str | Path | None = None,
    ) -> None:
        if path is not None:
            warnings.warn("PassRecord(path=) is now run=.", DeprecationWarning, stacklevel=2)
            run = path
        if run is None:
            message = "run must be a run or its store, got None."
            raise ValueError(message)
        opened = open_run(run)
        object.__setattr__(self, "run", opened)
        object.__setattr__(self, "trajectory", trajectory)
        object.__setattr__(self, "mounting", mounting or opened.mounting)

    @property
    def path(self) -> Path | None:
        """Store of the run, NAME.zarr; None if it is in memory."""
        return self.run.source
