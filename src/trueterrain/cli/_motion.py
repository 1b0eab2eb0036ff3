"""Motion of runs on the command line."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from trueterrain.cli._console import note
from trueterrain.errors import CoverageError, SchemaError, concerning

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.motion import Trajectory

Method = Literal["navigation", "thesis", "zero-phase", "wiener", "rts"]

_GAP = 1.5  # usual steps from which on a step between two scans is a gap


def motion_of(run: Path, method: Method) -> "Trajectory":
    """Motion of the body over a run; what is doubtful about it or the scans goes to stderr.

    Parameters
    ----------
    run : Path
        Store of the run.
    method : str
        How it is found.

    Returns
    -------
    Trajectory
        Over the time of the navigation.

    Raises
    ------
    SchemaError
        If the clock of the scanner is not finite or runs backward, or navigation breaks a rule.
    CoverageError
        If no scan lies within the motion, or there is too little navigation.
    """
    import warnings

    from trueterrain.formats.run import open_run
    from trueterrain.formats.run._rules import check_scans
    from trueterrain.motion import FusionSettings, fuse

    tree = open_run(run)
    check_scans(tree, run)
    with concerning(run), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what it warns of is among the problems as well
        motion = fuse(tree, settings=FusionSettings(method=method))
        _require_scans(tree, motion.trajectory)
    for problem in (*motion.problems, *_gaps(tree)):
        note(f"{run}: {problem}")
    return motion.trajectory


def _require_scans(tree: "xr.DataTree", trajectory: "Trajectory") -> None:
    """Raise CoverageError if no scan lies within the motion."""
    from trueterrain.georeference import mounting_of

    first, last = tree["scans"]["time"].values[[0, -1]] + mounting_of(tree).scanner_clock
    begin, end = trajectory.time[[0, -1]]
    if first >= end or last <= begin:
        raise CoverageError(
            f"last from {first:.3f} s to {last:.3f} s, but the motion from {begin:.3f} s to "
            f"{end:.3f} s: it covers none of them",
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )


def _gaps(tree: "xr.DataTree") -> list[str]:
    """Where scans are missing: a jump of the scanner's clock looks the same."""
    import numpy as np

    time = tree["scans"]["time"].values
    steps = np.diff(time)
    if not steps.size or steps.max() <= _GAP * np.median(steps):
        return []
    at, count = int(steps.argmax()), int((steps > _GAP * np.median(steps)).sum())
    several = "there is a gap" if count == 1 else f"there are {count} gaps, the longest"
    return [
        f"scans: {several} of {steps[at]:.6g} s at {time[at]:.6f} s: the scanner paused, or its "
        "clock jumped"
    ]


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
