"""Calibration: where the scanner sits and looks, and its clock, from passes over the same ground.

Two passes over the same ground must see the same ground. What they see differently tells the
mounting: a roll tilts the ground this way and that way in opposite passes, and everything else
moves steps and slopes. Not everything can be told:

===========  =======================================================================================
`lever_z`    moves all passes alike: never from passes on wheels
`yaw`        turns opposite passes in one lane alike: needs lanes beside each other over relief
`clock`      moves the ground by the speed, `pitch` by the height, `lever_x` by itself: needs passes
             of different speeds; pitch and lever_x need heights that differ, and hardly ever can be
             told apart on a road
===========  =======================================================================================

Sources: Filin (2003) "Recovery of systematic biases in laser altimetry data using natural
surfaces"; Skaloud and Lichti (2006) "Rigorous approach to bore-sight self-calibration in airborne
laser scanning"; Cameron, Gelbach and Miller (2011) for the covariance by clusters.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats.run import Mounting
from trueterrain.georeference._differences import (
    ParameterEstimate,
    PatchDifferences,
    fit_parameters,
    remove_pass_offsets,
    rms_difference,
)
from trueterrain.georeference._observable import (
    UnobservableParameter,
    find_uncertain,
    find_unobservable,
    unobservable_error,
)
from trueterrain.georeference._passes import CalibrationPasses
from trueterrain.georeference._patches import NAMES
from trueterrain.georeference._settings import CalibrationSettings
from trueterrain.georeference._wander import MotionErrorModel
from trueterrain.motion.trajectory import Trajectory

__all__ = ["Calibration", "CalibrationSettings", "calibrate_mounting"]

Floats = npt.NDArray[np.float64]

_COARSE = (3.0, 1.0)  # cells of the iterations over the cells asked for
_SETTLED = 0.1  # of its standard deviation by which a parameter may still move
_FEWEST = 2.0  # squares of ground for each parameter and offset
_LEAST = 1.25  # squares of ground for each unknown that is told, errors of the motion among them
_BLIND = 10.0  # standard deviations asked for beyond which a direction is not followed


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A mounting, and how surely it is known."""

    mounting: Mounting
    "What was found; what was not estimated is as it was."

    parameters: tuple[str, ...]
    "What was estimated."

    value: Floats
    "Values [rad, m, s]."

    sd: Floats
    """Standard deviations [rad, m, s], from the scatter of the ground between the passes and from
    what the trajectories claim of themselves, as errors that wander within a pass (first-order
    Gauss-Markov, as slow as `CalibrationSettings.drift_time` says; of heights, as the passes see
    it). They hold if these claims and what is held are right, and if scans lie so closely that it
    does not matter where a step lies between two of them."""

    correlation: Floats
    "Correlations, shape (parameter, parameter)."

    condition: float
    "Condition number of the normal matrix, each parameter in units of its own sd if alone."

    held: tuple[str, ...]
    "Parameters that were not estimated."

    sensitivity: Floats
    """By how much an estimate is wrong if a held parameter is wrong by one, shape (parameter,
    held): pitch stands in for lever_x, for instance."""

    not_observable: tuple[str, ...]
    "What was asked for, and held, since the passes do not tell it."

    reasons: tuple[str, ...]
    "Of each of these: how uncertain it would be, what goes with it, and what would tell it."

    offset: Floats
    "Height of each pass over the first, each in the middle of what it sees [m]."

    offset_sd: Floats
    "Standard deviations of these [m]."

    residual_before: float
    "Root mean square difference of heights between the passes, less offsets [m]."

    residual_after: float
    "The same with what was found [m]."

    correspondences: int
    "Independent pairs of heights that were compared."

    iterations: int
    "Rounds that it took."

    def to_dict(self) -> dict[str, Any]:
        """What was found, as JSON takes it."""
        return {
            "mounting": self.mounting.to_attrs(),
            "value": dict(zip(self.parameters, self.value.tolist(), strict=True)),
            "sd": dict(zip(self.parameters, self.sd.tolist(), strict=True)),
            "correlation": self.correlation.tolist(),
            "condition": self.condition,
            "held": list(self.held),
            "sensitivity": self.sensitivity.tolist(),
            "not_observable": dict(zip(self.not_observable, self.reasons, strict=True)),
            "offset": self.offset.tolist(),
            "offset_sd": self.offset_sd.tolist(),
            "residual": {"before": self.residual_before, "after": self.residual_after},
            "correspondences": self.correspondences,
            "iterations": self.iterations,
        }


def calibrate_mounting(
    runs: Sequence[xr.DataTree | str | Path],
    trajectories: Sequence[Trajectory],
    *,
    mounting: Mounting | None = None,
    settings: CalibrationSettings = CalibrationSettings(),
    progress: Progress = no_progress,
) -> Calibration:
    """Mounting of the scanner from passes over the same ground.

    Parameters
    ----------
    runs : sequence of xarray.DataTree or path
        Two or more passes, in opposite directions; all in one local frame.
    trajectories : sequence of Trajectory
        Motion of each.
    mounting : Mounting, optional
        Where to start; by default what the runs say. It may be wrong by some centimetres of what
        it does to the ground.
    settings : CalibrationSettings
        What is estimated, and how.
    progress : callable
        Called in each round, see `trueterrain.core.Progress`.

    Returns
    -------
    Calibration
        The mounting with standard deviations, correlations, and what could not be told.

    Raises
    ------
    ValueError
        If there are fewer than two runs, not as many trajectories, or runs of different mountings
        and none is given.
    CoverageError
        If the passes share no ground, a parameter cannot be told from it (named, with the cure), or
        no solution is found.

    Notes
    -----
    Gauss-Newton least squares of the heights that the passes see in each cell, its own height being
    an unknown, and an offset in height of each pass. Errors of its position and attitude are broken
    lines in time, as large as its trajectory claims and as slow as `drift_time` says; how much its
    height wanders is found. Cells weigh by the scatter that level and steep ground show; outliers
    weigh less (Huber). Observable is what is known better than `CalibrationSettings` asks for, if
    the errors of cells are what their scatter is.

    Examples
    --------
    ``calibrate([there, back], [motion.trajectory for motion in (first, second)],
    settings=CalibrationSettings(parameters=("roll", "pitch")))`` finds two angles:

    >>> CalibrationSettings(parameters=("roll", "pitch")).parameters
    ('roll', 'pitch')
    """
    if len(runs) < 2 or len(runs) != len(trajectories):
        message = (
            "runs must be at least 2, with a trajectory each, got "
            f"{len(runs)} and {len(trajectories)}."
        )
        raise ValueError(message)
    start = mounting or _common_mounting(runs)
    passes = CalibrationPasses(runs, trajectories, settings, progress)
    chosen = [NAMES.index(name) for name in settings.parameters]
    area = settings.area or passes.area(start)
    before, wander = passes.first(start, area)
    iterations, held = 0, list[UnobservableParameter]()
    while True:
        found, last, result, more = _estimate_mounting(
            passes, area, wander, start, chosen, settings
        )
        iterations += more
        judged = result, chosen, settings.limits, len(runs)
        untold = find_unobservable(*judged) or find_uncertain(*judged)
        if not untold:
            break
        held = sorted([*held, *untold], key=lambda one: one.index)
        kept = [index for index in chosen if index not in [one.index for one in untold]]
        if settings.unobservable == "refuse" or not kept:
            raise unobservable_error(held)
        chosen = kept
    if last.squares < max(_FEWEST * result.step.size, _LEAST * result.unknowns):
        raise CoverageError(
            f"the ground lies in {last.squares} squares of {settings.cluster:g} m, too few for the "
            "standard deviations",
            cure="Take smaller squares: cluster, or more ground.",
        )
    count = len(chosen)
    return _calibration_result(
        found,
        last,
        result,
        chosen,
        before=rms_difference(remove_pass_offsets(before), before),
        iterations=iterations,
        held=held,
        offset=-result.step[count:],
    )


def _common_mounting(runs: Sequence[xr.DataTree | str | Path]) -> Mounting:
    """Mounting that all runs state."""
    from trueterrain.formats.run import open_run
    from trueterrain.georeference.points import mounting_of

    stated = []
    for run in runs:
        if isinstance(run, xr.DataTree):
            stated.append(mounting_of(run))
        else:
            stated.append(mounting_of(open_run(run), path=Path(run)))
    ours = replace(stated[0], accelerometer_clock=0.0)
    for number, other in enumerate(stated):
        if replace(other, accelerometer_clock=0.0) != ours:
            message = f"runs must state one mounting, or mounting be given: run {number} differs."
            raise ValueError(message)
    return stated[0]


def _estimate_mounting(
    passes: CalibrationPasses,
    area: tuple[float, float, float, float],
    wander: MotionErrorModel,
    mounting: Mounting,
    chosen: list[int],
    settings: CalibrationSettings,
) -> tuple[Mounting, PatchDifferences, ParameterEstimate, int]:
    """Gauss-Newton from coarse to fine cells.

    Passes move aside against errors of their motion as well: these are centimetres, over which the
    ground around a step is no plane.
    """
    iterations = 0
    moved = np.zeros(wander.size)
    for coarse in _COARSE:
        while True:
            seen = passes.seen(mounting, area, coarse * settings.spacing, wander, moved)
            reach = _BLIND * settings.limits
            result = fit_parameters(
                seen, chosen, wander, moved, height_noise=settings.height_noise, reach=reach
            )
            wander = result.wander
            step, sd = result.step[: len(chosen)], result.sd[: len(chosen)]
            if (np.abs(step) <= np.maximum(_SETTLED * sd, 1e-3 * settings.limits[chosen])).all():
                break
            iterations += 1
            if iterations > settings.max_iterations:
                if find_unobservable(result, chosen, settings.limits, passes.count):
                    break
                raise CoverageError(
                    f"no mounting explains the passes within {settings.max_iterations} iterations; the "
                    f"last moved {NAMES[chosen[int(np.argmax(np.abs(step) / sd))]]} still",
                    cure="Start from a better mounting, or take larger cells: spacing.",
                )
            mounting = _update_mounting(mounting, chosen, step)
            moved[wander.aside] += result.motion[wander.aside]
    return mounting, seen, result, iterations


def _update_mounting(mounting: Mounting, chosen: list[int], step: Floats) -> Mounting:
    values = _mounting_values(mounting)
    values[chosen] += step
    rotation, position, clock = values[:3].tolist(), values[3:6].tolist(), float(values[6])
    return replace(
        mounting,
        scanner_rotation=tuple(rotation),
        scanner_position=tuple(position),
        scanner_clock=clock,
    )


def _mounting_values(mounting: Mounting) -> Floats:
    return np.array(
        [
            *mounting.scanner_rotation,
            *mounting.scanner_position,
            mounting.scanner_clock,
        ]
    )


def _calibration_result(
    mounting: Mounting,
    seen: PatchDifferences,
    result: ParameterEstimate,
    chosen: list[int],
    *,
    before: float,
    iterations: int,
    held: list[UnobservableParameter],
    offset: Floats,
) -> Calibration:
    count = len(chosen)
    sd = np.sqrt(np.diag(result.covariance))
    correlation = result.covariance / np.outer(sd, sd)
    inverse = np.linalg.inv(result.normal)[:count, :count]
    alone = np.sqrt(np.diag(inverse))
    return Calibration(
        mounting=mounting,
        parameters=tuple(NAMES[index] for index in chosen),
        value=_mounting_values(mounting)[chosen],
        sd=sd[:count],
        correlation=correlation[:count, :count],
        condition=float(np.linalg.cond(inverse / np.outer(alone, alone))),
        held=tuple(name for index, name in enumerate(NAMES) if index not in chosen),
        sensitivity=result.sensitivity[:count],
        not_observable=tuple(one.name for one in held),
        reasons=tuple(f"{one.finding}. {one.cure}" for one in held),
        offset=np.concatenate([[0.0], offset]),
        offset_sd=np.concatenate([[0.0], sd[count : count + offset.size]]),
        residual_before=before,
        residual_after=result.residual,
        correspondences=seen.correspondences,
        iterations=iterations,
    )
