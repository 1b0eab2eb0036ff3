"""Whether scans lie within the motion that is to place them, and where some are missing."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import Mounting
from trueterrain.formats.run._rules import check_scans
from trueterrain.motion.trajectory import Trajectory

_GAP = 1.5  # usual steps from which on a step between two scans is a gap


@dataclass(frozen=True, kw_only=True)
class MissingScans:
    """Scans that a scanner should have made."""

    count: int
    "How many are missing."

    gaps: int
    "In how many gaps."

    longest: float
    "The longest step from scan to scan [s]; 0 if there is none."

    at: float
    "Stamp of the scan before it [s]; NaN if there is none."


def missing_scans(time: npt.ArrayLike) -> MissingScans:
    """Count the scans that are missing between others, by their stamps.

    Parameters
    ----------
    time : array_like, shape (n,)
        Ascending stamps of the scans [s].

    Returns
    -------
    MissingScans
        Steps longer than one and a half usual ones lack as many scans as usual steps fit in, less
        one.

    Examples
    --------
    >>> missing_scans([0.0, 0.1, 0.2, 0.5, 0.6]).count
    2
    """
    time = np.asarray(time, dtype=float)
    steps = np.diff(time)
    if not steps.size:
        return MissingScans(count=0, gaps=0, longest=0.0, at=float("nan"))
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > _GAP * usual)
    count = int(np.sum(np.rint(steps[gaps] / usual) - 1)) if gaps.size else 0
    longest = int(steps.argmax())
    return MissingScans(
        count=count, gaps=int(gaps.size), longest=float(steps[longest]), at=float(time[longest])
    )


def scan_problems(run: xr.DataTree, trajectory: Trajectory) -> list[str]:
    """What is flagged about the scans of a run, in words.

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
    if not trajectory.covers(last, first):  # the last is not too early, nor the first too late
        raise CoverageError(
            f"the motion, {begin:.3f} s to {end:.3f} s, covers none of the {time.size} scans, "
            f"{first:.3f} s to {last:.3f} s",
            place="scans",
            cure="Compare the clocks of scanner and navigation: `trueterrain info`.",
        )
    missing = missing_scans(time)
    if not missing.gaps:
        return []
    several = "a gap" if missing.gaps == 1 else f"{missing.gaps} gaps, the longest"
    return [
        f"scans: {several} of {missing.longest:.6g} s at {missing.at:.6f} s: the scanner paused, "
        "or its clock jumped"
    ]
