"""Coverage of scans by a trajectory, and scans that are missing."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import Mounting
from trueterrain.formats.run.rules import check_scans
from trueterrain.motion.trajectory import Trajectory

_GAP = 1.5  # median steps above which a step between two scans is a gap


@dataclass(frozen=True, kw_only=True)
class MissingScans:
    """Number of missing scans, and the longest step."""

    count: int
    "Missing scans."

    gaps: int
    "Gaps that contain them."

    longest: float
    "The longest step from scan to scan [s]; 0 if there is none."

    at: float
    "Stamp of the scan before it [s]; NaN if there is none."


def count_missing_scans(time: npt.ArrayLike) -> MissingScans:
    """Count missing scans from the stamps of the others.

    Parameters
    ----------
    time : array_like, shape (n,)
        Ascending stamps of the scans [s].

    Returns
    -------
    MissingScans
        A step longer than 1.5 median steps is a gap; it lacks the scans that would divide it into
        median steps.

    Examples
    --------
    >>> count_missing_scans([0.0, 0.1, 0.2, 0.5, 0.6]).count
    2
    """
    time = np.asarray(time, dtype=float)
    steps = np.diff(time)
    if not steps.size:
        return MissingScans(count=0, gaps=0, longest=0.0, at=float("nan"))
    median = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP * median)
    count = int(np.sum(np.rint(steps[gaps] / median) - 1)) if gaps.size else 0
    longest = int(steps.argmax())
    return MissingScans(
        count=count, gaps=int(gaps.size), longest=float(steps[longest]), at=float(time[longest])
    )


def find_scan_problems(run: xr.DataTree, trajectory: Trajectory) -> list[str]:
    """Warnings about the scans of a run: gaps, which are pauses of the scanner or clock jumps.

    Parameters
    ----------
    run : xarray.DataTree
        The run.
    trajectory : Trajectory
        Motion of the body.

    Returns
    -------
    list of str
        One sentence, or none.

    Raises
    ------
    SchemaError
        If stamps are not finite or do not ascend.
    CoverageError
        If the trajectory covers no scan.
    """
    check_scans(run, None)
    time = np.asarray(run["scans"]["time"], dtype=float)
    clock = Mounting.from_attrs(run.attrs.get("mounting")).scanner_clock
    first, last = time[[0, -1]] + clock
    begin, end = trajectory.time[[0, -1]]
    if not trajectory.covers(last, first):  # last scan after the first knot, first before the last
        raise CoverageError(
            f"the motion, {begin:.3f} s to {end:.3f} s, covers none of the {time.size} scans, "
            f"{first:.3f} s to {last:.3f} s",
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )
    missing = count_missing_scans(time)
    if not missing.gaps:
        return []
    several = "a gap" if missing.gaps == 1 else f"{missing.gaps} gaps, the longest"
    return [
        f"scans: {several} of {missing.longest:.6g} s at {missing.at:.6f} s: the scanner paused, "
        "or its clock jumped"
    ]
