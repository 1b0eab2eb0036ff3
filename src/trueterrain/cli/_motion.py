"""Motion of runs on the command line."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from trueterrain.cli._console import write_note
from trueterrain.core.errors import SchemaError, name_file_in_errors

if TYPE_CHECKING:
    from trueterrain.motion import Trajectory

Method = Literal["navigation", "thesis", "zero-phase", "wiener", "rts"]


def motion_of(
    run: Path, method: Method, begin: float | None = None, end: float | None = None
) -> "Trajectory":
    """Motion of the body over a run; what is flagged about it or the scans goes to stderr.

    Parameters
    ----------
    run : Path
        Store of the run.
    method : str
        How it is found.
    begin, end : float, optional
        Times between which it is taken [s].

    Returns
    -------
    Trajectory
        Over the time of the navigation, or between the times.

    Raises
    ------
    SchemaError
        If navigation or scans break a rule, such as a clock that runs backward.
    CoverageError
        If there is too little navigation, or it covers no scan.
    """
    import warnings

    from trueterrain.formats.run import open_run
    from trueterrain.motion import FusionSettings, fuse_motion
    from trueterrain.motion.scan_gaps import find_scan_problems

    tree = open_run(run)
    with name_file_in_errors(run), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what it warns of is among the problems as well
        motion = fuse_motion(tree, settings=FusionSettings(method=method))
        problems = (*motion.problems, *find_scan_problems(tree, motion.trajectory))
        trajectory = motion.trajectory.between(begin, end)
    for problem in problems:
        write_note(f"{run}: {problem}")
    return trajectory


def require_run(path: Path) -> None:
    """Raise SchemaError if a file is no run.

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
