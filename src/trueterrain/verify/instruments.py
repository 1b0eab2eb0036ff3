"""Instrument findings: errors of clocks and mounting from calibration runs.

Two kinds of runs determine them: a bounce, parked on a flat floor and rocked by hand, determines
the clocks; runs in both directions over the same ground determine the mounting of the scanner.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.formats.run import Mounting, open_run
from trueterrain.georeference import (
    Calibration,
    CalibrationSettings,
    calibrate_mounting,
)
from trueterrain.georeference.observability import format_parameter, survey_tolerance
from trueterrain.motion import Trajectory
from trueterrain.motion.clocks import (
    accelerometer_clock_from_navigation,
    scanner_clock_from_bounce,
)
from trueterrain.surface.runs import require_one_frame
from trueterrain.verify.findings.finding import Finding, is_significant

# Smallest clock errors that matter [s]. A body that heaves at 0.5 m/s moves by 0.01 mm in the
# first; accelerations are integrated, and a wheel hop of 1 mm at 10 Hz moves as far in the second.
_MIN_SCANNER_CLOCK, _MIN_ACCELEROMETER_CLOCK = 2e-5, 1e-4
# Title, unit and effect of each parameter of the mounting
_NAMES = {
    "roll": ("roll of the scanner", "rad", "tilts the ground across the path"),
    "pitch": ("pitch of the scanner", "rad", "shifts the ground along the path, by the height"),
    "yaw": ("yaw of the scanner", "rad", "turns the scans relative to the path"),
    "lever_x": ("lever arm of the scanner, forward", "m", "shifts the ground along the path"),
    "lever_y": ("lever arm of the scanner, left", "m", "shifts the ground across the path"),
    "lever_z": ("lever arm of the scanner, up", "m", "shifts all heights by a constant"),
    "clock": (
        "clock of the scanner, over the ground",
        "s",
        "shifts the ground along the path, by the speed",
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
    """Estimate errors of the clocks in the mounting of a run, from a bounce.

    Parameters
    ----------
    run : xarray.DataTree
        A bounce: parked on a flat floor, rocked by hand for at least 10 s.
    accelerometer_delay : float
        Delay of the anti-aliasing filter of the accelerometers; otherwise the estimate of their
        clock includes it [s].

    Returns
    -------
    list of Finding
        Clocks of accelerometers and scanner less those in the mounting, to be added to them [s].

    Notes
    -----
    The clock of the accelerometers is estimated against navigation, that of the scanner against the
    corrected accelerometers, whose variance is added; see `trueterrain.motion.clocks`. A clock that
    is too uncertain is reported as unobservable, with the reason.

    Examples
    --------
    ``[one.value for one in clock_findings(open_run("bounce.zarr"))]`` are the errors of both [s].
    """
    names = "clock of the accelerometers", "clock of the scanner"
    declared = open_run(run).mounting
    clock, uncertainty, bound = declared.accelerometer_clock, 0.0, ""
    try:
        found = accelerometer_clock_from_navigation(run, accelerometer_delay=accelerometer_delay)
    except CoverageError as error:
        first = _unobservable_finding(names[0], "s", _reason_text(error))
        bound = " It relies on the clock of the accelerometers, which is not observable here."
    else:
        clock, uncertainty = found.clock, found.sd
        filtered = "" if accelerometer_delay else " It includes the delay of their filter."
        first = _clock_finding(
            names[0],
            clock - declared.accelerometer_clock,
            found.sd,
            _MIN_ACCELEROMETER_CLOCK,
            filtered,
        )
    try:
        scanner = scanner_clock_from_bounce(
            run, accelerometer_clock=clock, accelerometer_delay=accelerometer_delay
        )
    except CoverageError as error:
        return [first, _unobservable_finding(names[1], "s", _reason_text(error))]
    off, sd = scanner.clock - declared.scanner_clock, math.hypot(scanner.sd, uncertainty)
    return [first, _clock_finding(names[1], off, sd, _MIN_SCANNER_CLOCK, bound)]


def boresight_findings(
    runs: Sequence[xr.DataTree | str | Path],
    trajectories: Sequence[Trajectory],
    settings: CalibrationSettings = CalibrationSettings(unobservable="hold"),
) -> list[Finding]:
    """Estimate errors of the scanner's mounting, from runs in both directions over one ground.

    Parameters
    ----------
    runs : sequence of xarray.DataTree or path
        Two or more runs in opposite directions over the same ground, of one mounting.
    trajectories : sequence of Trajectory
        Motion of each.
    settings : CalibrationSettings
        Settings of the calibration; unobservable parameters should be held.

    Returns
    -------
    list of Finding
        Estimated less declared value of each angle [rad], lever arm [m] and the clock [s].
        Unobservable parameters have no value, but the reason and advice.

    Raises
    ------
    ValueError
        If there are fewer than two runs, or not as many trajectories.
    SchemaError
        If runs are in different local frames, or state different mountings.

    Notes
    -----
    See `trueterrain.georeference.calibrate`. An estimate may depend on a held parameter: an error
    of pitch shifts a step as one of the lever arm does. An estimate that a held parameter could
    cause by an error of 0.5 degrees, 10 mm or 1 ms is not reported as detected.

    Examples
    --------
    ``boresight_findings([there, back], [motion.trajectory for motion in (first, second)])`` has a
    finding for each angle, each component of the arm and the clock.
    """
    opened = [open_run(run) for run in runs]
    if all(run.source for run in opened):
        require_one_frame(opened)
    stated = [run.mounting for run in opened]
    for run, other in zip(opened, stated, strict=True):
        if replace(other, accelerometer_clock=stated[0].accelerometer_clock) != stated[0]:
            raise SchemaError(
                "differs from that of the first run",
                path=run.source,
                place="attribute mounting",
                cure="Name runs of one mounting.",
            )
    try:
        found = calibrate_mounting(opened, trajectories, settings=settings)
    except CoverageError as error:
        return [_unobservable_finding("mounting of the scanner", "1", _reason_text(error))]
    return [_mounting_finding(name, found, stated[0]) for name in settings.parameters]


def _clock_finding(name: str, off: float, sd: float, min_size: float, bound: str = "") -> Finding:
    """Finding of a clock from its error and standard deviation [s]."""
    detected = is_significant(off, sd, min_size=min_size)
    field = "accelerometer_clock" if "accelerometers" in name else "scanner_clock"
    meaning = (
        f"Add the value to {field} of the run's mounting; otherwise heights are computed with "
        "the pose of another time."
        if detected
        else f"The clock is correct within {1e3 * max(4 * sd, min_size):.2g} ms."
    )
    return Finding(
        name=name, value=off, sd=sd, unit="s", detected=detected, meaning=meaning + bound
    )


def _mounting_finding(name: str, found: Calibration, declared: Mounting) -> Finding:
    """Finding of a parameter of the mounting: its error, or why it is unobservable."""
    title, unit, effect = _NAMES[name]
    if name in found.not_observable:
        reason = found.reasons[found.not_observable.index(name)]
        return _unobservable_finding(title, unit, f"Not observable from these passes: {reason}")
    at = found.parameters.index(name)
    off = float(found.value[at]) - _declared_value(declared, name)
    sd = float(found.sd[at])
    # error of the parameter that each held parameter could cause
    caused = {
        held: abs(float(found.sensitivity[at, k])) * survey_tolerance(held)
        for k, held in enumerate(found.held)
    }
    if is_significant(off, sd) and not is_significant(off, sd, min_size=sum(caused.values())):
        other = max(caused, key=lambda held: caused[held])
        return Finding(
            name=title,
            value=off,
            sd=sd,
            unit=unit,
            detected=None,
            meaning=f"It {effect}, and so does {_NAMES[other][0]}, which is not observable from "
            "these passes: either may be wrong. Measure the latter, and state it in the mounting.",
        )
    detected = is_significant(off, sd)
    words = [
        f"It {effect}: add the value to the mounting of the runs."
        if detected
        else "It agrees with the mounting, within four standard deviations."
    ]
    words += [
        f"It depends on the {_NAMES[held][0]}, which is held: an error of "
        f"{format_parameter(held, survey_tolerance(held))} there causes one of "
        f"{format_parameter(name, by)} here."
        for held, by in caused.items()
        if by > sd
    ]
    meaning = " ".join(words)
    return Finding(name=title, value=off, sd=sd, unit=unit, detected=detected, meaning=meaning)


def _declared_value(mounting: Mounting, name: str) -> float:
    field, axis = _FIELDS[name]
    value = getattr(mounting, field)
    return float(value if axis is None else value[axis])


def _reason_text(error: CoverageError) -> str:
    """Problem and cure of an error, without the name of the file."""
    return f"{error.problem}. {error.cure or ''}".rstrip()


def _unobservable_finding(name: str, unit: str, reason: str) -> Finding:
    words = reason[:1].upper() + reason[1:]
    return Finding(name=name, value=None, sd=None, unit=unit, detected=None, meaning=words)
