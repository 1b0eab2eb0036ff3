"""Whether scans lie within the motion that is to place them, and where some are missing."""

import numpy as np
import xarray as xr

from trueterrain.errors import CoverageError
from trueterrain.formats.run import Mounting
from trueterrain.formats.run._rules import check_scans
from trueterrain.motion.trajectory import Trajectory

_GAP = 1.5  # usual steps from which on a step between two scans is a gap


def scan_problems(run: xr.DataTree, trajectory: Trajectory) -> list[str]:
    """What is doubtful about the scans of a run, in words.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    trajectory : Trajectory
        Its motion.

    Returns
    -------
    list of str
        Gaps, which are pauses of the scanner or jumps of its clock.

    Raises
    ------
    SchemaError
        If the clock of the scanner is not finite or runs backward.
    CoverageError
        If the motion covers no scan.
    """
    check_scans(run, None)
    time = np.asarray(run["scans"]["time"], dtype=float)
    clock = Mounting.from_attrs(run.attrs.get("mounting")).scanner_clock
    first, last = time[[0, -1]] + clock
    begin, end = trajectory.time[[0, -1]]
    if first >= end or last <= begin:
        raise CoverageError(
            f"the motion, {begin:.3f} s to {end:.3f} s, covers none of the {time.size} scans, "
            f"{first:.3f} s to {last:.3f} s",
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > _GAP * np.median(steps)) if steps.size else steps
    if not gaps.size:
        return []
    longest = int(steps.argmax())
    several = "a gap" if gaps.size == 1 else f"{gaps.size} gaps, the longest"
    return [
        f"scans: {several} of {steps[longest]:.6g} s at {time[longest]:.6f} s: the scanner paused, "
        "or its clock jumped"
    ]
