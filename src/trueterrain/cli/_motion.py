"""Trajectories of recorded runs on the command line."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from trueterrain.cli._console import write_note
from trueterrain.core.errors import SchemaError

if TYPE_CHECKING:
    from trueterrain.formats.run import Run
    from trueterrain.motion import Trajectory

Method = Literal["navigation", "thesis", "zero-phase", "wiener", "rts"]


def run_trajectory(
    run: "Run | Path", method: Method, begin: float | None = None, end: float | None = None
) -> "Trajectory":
    """Trajectory of the body over a run; problems of motion and scans are noted on stderr.

    Parameters
    ----------
    run : Run or Path
        The run, or its store.
    method : str
        Method of `trueterrain.motion.fuse_motion`.
    begin, end : float, optional
        First and last time of the trajectory [s]; by default those of the navigation.

    Returns
    -------
    Trajectory
        Position and attitude with covariance.

    Raises
    ------
    SchemaError
        If navigation or scans are invalid, such as a clock that runs backward.
    CoverageError
        If there is too little navigation, or it covers no scan.
    """
    from trueterrain.motion import FusionSettings
    from trueterrain.survey.runs import process_run

    processed = process_run(run, FusionSettings(method=method), begin=begin, end=end)
    for problem in processed.problems:
        write_note(f"{processed.record.run.source}: {problem}")
    return processed.trajectory


def require_run(path: Path) -> None:
    """Raise SchemaError if a file is not a recorded run.

    Parameters
    ----------
    path : Path
        The file.
    """
    from trueterrain import formats

    kind = formats.kind_of_file(path)
    if kind != "run":
        raise SchemaError(
            f"must be a recorded run, but is {kind}",
            path=path,
            cure="Name the folder NAME.zarr of a run.",
        )
