"""Calibration: lever arm, boresight angles and clock of the scanner from passes over one ground.

Passes over the same ground must measure the same heights. Their differences determine the mounting:
an error of roll tilts the ground to opposite sides in opposite passes; all other errors displace
steps and slopes. Not everything is observable:

===========  =======================================================================================
`lever_z`    shifts all passes equally: never observable from a vehicle
`yaw`        rotates opposite passes in one lane equally: needs adjacent lanes over relief
`clock`      displaces the ground by the speed, `pitch` by the height, `lever_x` by itself: needs
             passes at different speeds; pitch and lever_x need different heights and can hardly be
             separated on a road
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
from trueterrain.formats.run import Mounting, Run, open_run
from trueterrain.georeference._differences import (
    ParameterEstimate,
    PatchDifferences,
    estimate_parameters,
    remove_pass_offsets,
    rms_difference,
)
from trueterrain.georeference._motion_errors import MotionErrorModel
from trueterrain.georeference._passes import CalibrationPasses
from trueterrain.georeference._patches import NAMES
from trueterrain.georeference.observability import (
    UnobservableParameter,
    find_uncertain,
    find_unobservable,
    unobservable_error,
)
from trueterrain.georeference.settings import CalibrationSettings
from trueterrain.motion.trajectory import Trajectory

__all__ = ["Calibration", "CalibrationSettings", "calibrate_mounting"]

Floats = npt.NDArray[np.float64]

_COARSE = (3.0, 1.0)  # cells of the iterations in multiples of the spacing
_CONVERGED = 0.1  # standard deviations that the last correction of a parameter may have
_MIN_SQUARES_PER_PARAMETER = 2.0  # squares of ground for each parameter and offset
_MIN_SQUARES_PER_UNKNOWN = (
    1.25  # squares of ground for each effective unknown, errors of the motion included
)
_REACH = 10.0  # required standard deviations; directions determined worse are not corrected


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A calibrated mounting, with standard deviations, correlations and residuals."""

    mounting: Mounting
    "Calibrated mounting; parameters not estimated keep their start values."

    parameters: tuple[str, ...]
    "Estimated parameters."

    value: Floats
    "Estimates [rad, m, s]."

    sd: Floats
    """Standard deviations [rad, m, s], from the scatter of the ground between the passes and from
    the reported standard deviations of the trajectories, taken as first-order Gauss-Markov errors
    within a pass (correlation times of `CalibrationSettings.drift_time`; that of heights is
    estimated). They hold if the reported standard deviations and held parameters are right, and if
    scans are so dense that the position of a step between two of them does not matter."""

    correlation: Floats
    "Correlations, shape (parameter, parameter)."

    condition: float
    "Condition number of the normal matrix, each parameter in units of its standard deviation."

    held: tuple[str, ...]
    "Parameters not estimated."

    sensitivity: Floats
    """Derivatives of the estimates by the held parameters, shape (parameter, held): an error of
    lever_x, for instance, changes pitch."""

    not_observable: tuple[str, ...]
    "Requested parameters that were held, since the passes do not determine them."

    reasons: tuple[str, ...]
    "For each of these: standard deviation, correlated parameters, and the cure."

    offset: Floats
    "Height of each pass over the first, each at the centre of the ground that it sees [m]."

    offset_sd: Floats
    "Standard deviations of the offsets [m]."

    residual_before: float
    "Root mean square difference of heights between the passes, less offsets [m]."

    residual_after: float
    "The same with the calibrated mounting [m]."

    correspondences: int
    "Number of independent height differences."

    iterations: int
    "Number of iterations."

    def to_dict(self) -> dict[str, Any]:
        """Mounting, statistics and reasons, ready for JSON."""
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
        Trajectory of each.
    mounting : Mounting, optional
        Start values; by default those of the runs. They may displace the ground by some
        centimetres.
    settings : CalibrationSettings
        Parameters to estimate, and limits.
    progress : callable
        Called in each iteration, see `trueterrain.core.Progress`.

    Returns
    -------
    Calibration
        Mounting with standard deviations, correlations and unobservable parameters.

    Raises
    ------
    ValueError
        If there are fewer than two runs, not as many trajectories, or runs of different mountings
        and none is given.
    CoverageError
        If the passes have no common ground, a parameter is unobservable (named, with the cure), or
        the iteration does not converge.

    Notes
    -----
    Gauss-Newton least squares of the heights of all passes in each cell; the height of the cell and
    a height offset of each pass are unknowns. Errors of position and attitude are piecewise linear
    in time, with the reported standard deviations of the trajectory and the correlation times of
    `drift_time`; the correlation time of heights is estimated. Cells are weighted by the scatter of
    level and of steep ground, outliers are down-weighted (Huber). A parameter is observable if its
    standard deviation is below the limit of `CalibrationSettings`.

    Examples
    --------
    ``calibrate_mounting([there, back], [motion.trajectory for motion in (first, second)],
    settings=CalibrationSettings(parameters=("roll", "pitch")))`` estimates two angles:

    >>> CalibrationSettings(parameters=("roll", "pitch")).parameters
    ('roll', 'pitch')
    """
    if len(runs) < 2 or len(runs) != len(trajectories):
        message = (
            "runs must be at least 2, with a trajectory each, got "
            f"{len(runs)} and {len(trajectories)}."
        )
        raise ValueError(message)
    opened = [open_run(run) for run in runs]
    start = mounting or _common_mounting(opened)
    passes = CalibrationPasses(opened, trajectories, settings, progress)
    chosen = [NAMES.index(name) for name in settings.parameters]
    area = settings.area or passes.area(start)
    before, errors = passes.first(start, area)
    iterations, held = 0, list[UnobservableParameter]()
    while True:
        found, last, result, more = _estimate_mounting(
            passes, area, errors, start, chosen, settings
        )
        iterations += more
        arguments = result, chosen, settings.limits, len(runs)
        unobservable = find_unobservable(*arguments) or find_uncertain(*arguments)
        if not unobservable:
            break
        held = sorted([*held, *unobservable], key=lambda one: one.index)
        kept = [index for index in chosen if index not in [one.index for one in unobservable]]
        if settings.unobservable == "refuse" or not kept:
            raise unobservable_error(held)
        chosen = kept
    if last.squares < max(
        _MIN_SQUARES_PER_PARAMETER * result.step.size, _MIN_SQUARES_PER_UNKNOWN * result.unknowns
    ):
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


def _common_mounting(runs: Sequence[Run]) -> Mounting:
    """Mounting that all runs state; raises a ValueError if they differ."""
    stated = [run.mounting for run in runs]
    ours = replace(stated[0], accelerometer_clock=0.0)
    for number, other in enumerate(stated):
        if replace(other, accelerometer_clock=0.0) != ours:
            message = f"runs must state one mounting, or mounting be given: run {number} differs."
            raise ValueError(message)
    return stated[0]


def _estimate_mounting(
    passes: CalibrationPasses,
    area: tuple[float, float, float, float],
    errors: MotionErrorModel,
    mounting: Mounting,
    chosen: list[int],
    settings: CalibrationSettings,
) -> tuple[Mounting, PatchDifferences, ParameterEstimate, int]:
    """Gauss-Newton iteration, from coarse to fine cells.

    The passes are also displaced by the estimated horizontal errors of their motion: these are
    centimetres, over which the ground around a step is not a plane, so that the linear model of a
    single iteration does not hold.
    """
    iterations = 0
    moved = np.zeros(errors.size)
    for coarse in _COARSE:
        while True:
            seen = passes.seen(mounting, area, coarse * settings.spacing, errors, moved)
            reach = _REACH * settings.limits
            result = estimate_parameters(
                seen, chosen, errors, moved, height_noise=settings.height_noise, reach=reach
            )
            errors = result.errors
            step, sd = result.step[: len(chosen)], result.sd[: len(chosen)]
            if (np.abs(step) <= np.maximum(_CONVERGED * sd, 1e-3 * settings.limits[chosen])).all():
                break
            iterations += 1
            if iterations > settings.max_iterations:
                if find_unobservable(result, chosen, settings.limits, passes.count):
                    break
                raise CoverageError(
                    f"the calibration does not converge within {settings.max_iterations} "
                    "iterations; the last one changed "
                    f"{NAMES[chosen[int(np.argmax(np.abs(step) / sd))]]}",
                    cure="Start from a better mounting, or take larger cells: spacing.",
                )
            mounting = _update_mounting(mounting, chosen, step)
            moved[errors.horizontal] += result.motion[errors.horizontal]
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
