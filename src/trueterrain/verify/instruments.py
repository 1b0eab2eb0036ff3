"""Instruments: what clocks and mounting are off by, found before they are charged to the profiler.

Two recordings of their own tell it: a bounce, parked on a flat floor and rocked by hand, tells the
clocks; runs in both directions over the same ground tell how the scanner sits in the vehicle.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.formats.run import Mounting
from trueterrain.georeference import Calibration, CalibrationSettings
from trueterrain.georeference.observability import format_parameter, survey_tolerance
from trueterrain.motion import Trajectory
from trueterrain.verify.findings.finding import Finding, is_significant

# A body that heaves at 0.5 m/s is 0.01 mm elsewhere after this; accelerometers are integrated, and
# a wheel hop of 1 mm at 10 Hz is as far elsewhere after the second.
_LEAST_SCANNER_CLOCK, _LEAST_ACCELEROMETER_CLOCK = 2e-5, 1e-4  # [s]
# what a mounting by drawing and tape may be wrong by where passes do not tell it
_NAMES = {
    "roll": ("roll of the scanner", "rad", "tilts the ground across the way"),
    "pitch": ("pitch of the scanner", "rad", "moves the ground along the way, by the height"),
    "yaw": ("yaw of the scanner", "rad", "turns scans against the way"),
    "lever_x": ("lever arm of the scanner, forward", "m", "moves the ground along the way"),
    "lever_y": ("lever arm of the scanner, left", "m", "moves the ground across the way"),
    "lever_z": ("lever arm of the scanner, up", "m", "moves all heights alike"),
    "clock": (
        "clock of the scanner, over the ground",
        "s",
        "moves the ground along the way, by the speed",
    ),
}
_FIELDS = {
    "roll": ("scanner_rotation", 0),
    "pitch": ("scanner_rotation", 1),
    "yaw": ("scanner_rotation", 2),
    "lever_x": ("scanner_position", 0),
    "lever_y": ("scanner_position", 1),
    "lever_z": ("scanner_position", 2),
    "clock": ("scanner_clock", None),
}


def clock_findings(run: xr.DataTree, *, accelerometer_delay: float = 0.0) -> list[Finding]:
    """What clocks are off by, beyond what the mounting of the run says.

    Parameters
    ----------
    run : xarray.DataTree
        A bounce: parked on a flat floor, rocked by hand for 10 s and more.
    accelerometer_delay : float
        Delay of the accelerometers' filter against aliases; without it, it is found as a part of
        their clock [s].

    Returns
    -------
    list of Finding
        Of the accelerometers and of the scanner: what is to be added to their stamps besides what
        the run says [s].

    Notes
    -----
    The clock of the accelerometers is compared with navigation, that of the scanner with the
    accelerometers as they were found, whose standard deviation enters its own; see
    `trueterrain.motion.clocks`. What is too uncertain is not told, with the reason.

    Examples
    --------
    ``[one.value for one in clock_findings(open_run("bounce.zarr"))]`` is what both are off by [s].
    """
    from trueterrain.georeference import mounting_of
    from trueterrain.motion.clocks import (
        accelerometer_clock_from_navigation,
        scanner_clock_from_bounce,
    )

    names = "clock of the accelerometers", "clock of the scanner"
    declared = mounting_of(run)
    clock, uncertainty, bound = declared.accelerometer_clock, 0.0, ""
    try:
        found = accelerometer_clock_from_navigation(run, accelerometer_delay=accelerometer_delay)
    except CoverageError as error:
        first = _unobservable_finding(names[0], "s", _reason_text(error))
        bound = " It is as true as the clock of the accelerometers, which is not told."
    else:
        clock, uncertainty = found.clock, found.sd
        filtered = "" if accelerometer_delay else " The delay of their filter is part of it."
        first = _clock_finding(
            names[0],
            clock - declared.accelerometer_clock,
            found.sd,
            _LEAST_ACCELEROMETER_CLOCK,
            filtered,
        )
    try:
        seen = scanner_clock_from_bounce(
            run, accelerometer_clock=clock, accelerometer_delay=accelerometer_delay
        )
    except CoverageError as error:
        return [first, _unobservable_finding(names[1], "s", _reason_text(error))]
    off, sd = seen.clock - declared.scanner_clock, math.hypot(seen.sd, uncertainty)
    return [first, _clock_finding(names[1], off, sd, _LEAST_SCANNER_CLOCK, bound)]


def boresight_findings(
    runs: Sequence[xr.DataTree | str | Path],
    trajectories: Sequence[Trajectory],
    settings: CalibrationSettings = CalibrationSettings(unobservable="hold"),
) -> list[Finding]:
    """How the scanner sits otherwise than the runs say.

    Parameters
    ----------
    runs : sequence of xarray.DataTree or path
        Two or more runs in opposite directions over the same ground, of one mounting.
    trajectories : sequence of Trajectory
        Motion of each.
    settings : CalibrationSettings
        What is estimated, and how; what the runs do not tell should be held.

    Returns
    -------
    list of Finding
        Found less declared for each angle [rad], arm [m] and the clock [s]. What passes do not tell
        has no value, but the reason and what would tell it.

    Raises
    ------
    ValueError
        If there are fewer than two runs, or not as many trajectories.
    SchemaError
        If runs are in different local frames, or state different mountings.

    Notes
    -----
    See `trueterrain.georeference.calibrate`. A parameter may lean on one that is held: pitch moves
    a step as a wrong arm does. What such a one can cause if it is wrong by 0.5 degrees, 10 mm or
    1 ms is not charged to the parameter: up to there it is not told.

    Examples
    --------
    ``boresight_findings([there, back], [motion.trajectory for motion in (first, second)])`` has a
    finding for each angle, each component of the arm and the clock.
    """
    from trueterrain.formats.run import open_run
    from trueterrain.georeference import calibrate_mounting, mounting_of
    from trueterrain.surface.runs import require_one_frame

    paths = [None if isinstance(run, xr.DataTree) else Path(run) for run in runs]
    named = [path for path in paths if path is not None]
    if len(named) == len(runs):
        require_one_frame(named)
    stated = [
        mounting_of(run if isinstance(run, xr.DataTree) else open_run(run), path=path)
        for run, path in zip(runs, paths, strict=True)
    ]
    for path, other in zip(paths, stated, strict=True):
        if replace(other, accelerometer_clock=stated[0].accelerometer_clock) != stated[0]:
            raise SchemaError(
                "differs from that of the first run",
                path=path,
                place="attribute mounting",
                cure="Name runs of one mounting.",
            )
    try:
        found = calibrate_mounting(runs, trajectories, settings=settings)
    except CoverageError as error:
        return [_unobservable_finding("mounting of the scanner", "1", _reason_text(error))]
    return [_mounting_finding(name, found, stated[0]) for name in settings.parameters]


def _clock_finding(name: str, off: float, sd: float, least: float, bound: str = "") -> Finding:
    there = is_significant(off, sd, least=least)
    field = "accelerometer_clock" if "accelerometers" in name else "scanner_clock"
    meaning = (
        f"Stamps are to be increased by so much more than the run says: set {field} of its "
        "mounting; until then, heights are those of another moment of the motion."
        if there
        else f"Stamps are true, within {1e3 * max(4 * sd, least):.2g} ms."
    )
    return Finding(name=name, value=off, sd=sd, unit="s", detected=there, meaning=meaning + bound)


def _mounting_finding(name: str, found: Calibration, declared: Mounting) -> Finding:
    """How much a parameter of the mounting is off, or why it is not told."""
    title, unit, effect = _NAMES[name]
    if name in found.not_observable:
        reason = found.reasons[found.not_observable.index(name)]
        return _unobservable_finding(title, unit, f"The passes do not tell it: {reason}")
    at = found.parameters.index(name)
    off = float(found.value[at]) - _declared_value(declared, name)
    sd = float(found.sd[at])
    caused = {
        held: abs(float(found.sensitivity[at, k])) * survey_tolerance(held)
        for k, held in enumerate(found.held)
    }
    if is_significant(off, sd) and not is_significant(off, sd, least=sum(caused.values())):
        other = max(caused, key=lambda held: caused[held])
        return Finding(
            name=title,
            value=off,
            sd=sd,
            unit=unit,
            detected=None,
            meaning=f"It {effect}, and so does {_NAMES[other][0]}, which these passes do not tell: "
            "either may be off. Measure the latter, and state it in the mounting.",
        )
    there = is_significant(off, sd)
    words = [
        f"It {effect}: state what was found in the mounting of the runs."
        if there
        else "It is as the mounting says, within four standard deviations."
    ]
    words += [
        f"It leans on the {_NAMES[held][0]}, which is held: if that is wrong by "
        f"{format_parameter(held, survey_tolerance(held))}, this is by {format_parameter(name, by)}."
        for held, by in caused.items()
        if by > sd
    ]
    meaning = " ".join(words)
    return Finding(name=title, value=off, sd=sd, unit=unit, detected=there, meaning=meaning)


def _declared_value(mounting: Mounting, name: str) -> float:
    field, axis = _FIELDS[name]
    value = getattr(mounting, field)
    return float(value if axis is None else value[axis])


def _reason_text(error: CoverageError) -> str:
    """What hinders, and the cure, without the name of the file, which stands beside it."""
    return f"{error.problem}. {error.cure or ''}".rstrip()


def _unobservable_finding(name: str, unit: str, reason: str) -> Finding:
    words = reason[:1].upper() + reason[1:]
    return Finding(name=name, value=None, sd=None, unit=unit, detected=None, meaning=words)
