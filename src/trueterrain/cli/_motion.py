"""Motion of runs on the command line."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from trueterrain.cli._console import write_note
from trueterrain.core.errors import SchemaError

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
    from trueterrain.motion import FusionSettings
    from trueterrain.survey.runs import process_run

    processed = process_run(run, FusionSettings(method=method), begin=begin, end=end)
    for problem in processed.problems:
        write_note(f"{run}: {problem}")
    return processed.trajectory


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
