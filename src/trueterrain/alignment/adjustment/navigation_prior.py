"""How sure corrections are, of what passes have in common too.

Overlaps tell how passes wander from each other, not how they wander together; yet passes of one
kind do both to the same extent. So the wandering that standard deviations rest on is pooled from
what was seen between the passes and from what the navigation claims, by their degrees of freedom.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.model_search import CORRELATION_TIME, trial_priors, usual_sd
from trueterrain.alignment.adjustment.normal_equations import ComponentPrior
from trueterrain.alignment.adjustment.robust_weights import WeightedFit
from trueterrain.alignment.adjustment.shared_cells import SharedCells
from trueterrain.alignment.adjustment.spline import GaussMarkovProcess
from trueterrain.alignment.adjustment.system import AdjustmentSystem
from trueterrain.alignment.settings import ModelTrial, NetworkSettings

Floats = npt.NDArray[np.float64]

#: Degrees of freedom of the deviations of a first-order process from its mean over a time that is
#: short beside that of its correlation: (sum of 1/k²)² / sum of 1/k⁴.
SHORT = 2.5

#: Those that the claim of the navigation is worth, which holds its constant errors as well.
CLAIM = 1.0


def navigation_priors(
    system: AdjustmentSystem,
    fitted: WeightedFit,
    trial: ModelTrial,
    settings: NetworkSettings,
    lanes_sd: Sequence[Floats],
) -> dict[str, ComponentPrior]:
    """Priors by which standard deviations are told.

    Parameters
    ----------
    system : System
        The unknowns.
    fitted : Fitted
        Corrections that were found.
    trial : Trial
        What was chosen.
    settings : NetworkSettings
        Time of correlation.
    lanes_sd : sequence of numpy.ndarray, shape (2, n)
        Times, and standard deviations of the height by the navigation [m].

    Returns
    -------
    dict of Prior
        As those of the trial; if the navigation claims anything, with wandering of the height that
        was seen and is claimed.
    """
    found = trial_priors(trial, settings)
    time = settings.correlation_time or CORRELATION_TIME
    claim = usual_sd(lanes_sd)
    if claim is None:
        return found
    seen, degrees_of_freedom = estimate_drift(system, fitted, time)
    sd = float(
        np.sqrt((degrees_of_freedom * seen**2 + CLAIM * claim**2) / (degrees_of_freedom + CLAIM))
    )
    wander = GaussMarkovProcess(sd=sd, correlation_time=time, order="first")
    return {**found, "height": replace(found["height"], wander=wander)}


def estimate_drift(
    system: AdjustmentSystem, fitted: WeightedFit, time: float
) -> tuple[float, float]:
    """Wandering of passes from each other.

    Parameters
    ----------
    system : System
        The unknowns.
    fitted : Fitted
        Corrections that were found.
    time : float
        Time of correlation [s].

    Returns
    -------
    sd : float
        Standard deviation of a first-order process that deviates from its mean as much as the
        corrections do [m].
    freedom : float
        Degrees of freedom; 0 if there is one pass, which has nothing to wander from.
    """
    group, squares, free, degrees_of_freedom = system.shared.group, 0.0, 0, 0.0
    for number in np.unique(group):
        lanes = np.flatnonzero(group == number)
        moved = [(lane, knots) for lane in lanes if (knots := system.knots[lane]) is not None]
        # without a fixed pass, corrections are relative to their own mean
        own = len(moved) - (1 if len(moved) == lanes.size else 0)
        if own < 1:
            continue
        spans = [knots.spacing * knots.intervals / time for _, knots in moved]
        for (lane, _), span in zip(moved, spans, strict=True):
            height = fitted.solution.x[system.lane_unknowns(int(lane))[0][0]]
            squares += float(np.var(height[1:-1])) / _mean_square_about_mean(span)
        free += own
        degrees_of_freedom += own * (SHORT + 0.5 * float(np.mean(spans)))
    return (float(np.sqrt(squares / free)), degrees_of_freedom) if free else (0.0, 0.0)


def estimate_datum_sd(
    shared: SharedCells,
    lanes_sd: Sequence[Floats],
    wander: GaussMarkovProcess,
    passes: Collection[str],
    settings: NetworkSettings,
) -> dict[str, float | None]:
    """Standard deviation of the datum: the height error that all passes of a group have in common.

    The datum is the mean of the passes, each over its whole time, so its error is the mean of their
    mean errors. Of the variance that the navigation reports, a pass shows the part by which its
    height changes within the pass, which the covariance of the corrections holds already; the rest
    is that of its mean. Fixed passes are as wrong as their navigation says, whatever their number:
    each may carry a part of the ground alone. Control points bring their own variances into the
    adjustment, so they leave nothing.

    Parameters
    ----------
    shared : Shared
        The observations.
    lanes_sd : sequence of numpy.ndarray, shape (2, n)
        Times, and standard deviations of the height by the navigation [m].
    wander : Wander
        Change of heights within a pass, as the covariance of the corrections holds it.
    passes : collection of str
        Names of the passes; what else is fixed is control.
    settings : NetworkSettings
        Correlation of the passes, or the standard deviation itself.

    Returns
    -------
    dict of float or None
        Of each pass [m]; None where a pass of its group reports nothing.
    """
    usual = usual_sd(lanes_sd)
    found: dict[str, float | None] = {}
    for number in np.unique(shared.group):
        members = np.flatnonzero(shared.group == number)
        own = [int(k) for k in members if shared.names[k] in passes]
        fixed = [k for k in own if shared.fixed[k]]
        counted = fixed or own
        sd: float | None = settings.datum_sd
        if sd is None and len(own) < members.size and not fixed:
            sd = 0.0
        elif sd is None and usual is not None and all(lanes_sd[k].size for k in counted):
            reported = np.array([np.mean(lanes_sd[k][1] ** 2) for k in counted])
            sd = float(np.sqrt(reported.mean()))
            if not fixed:
                spans = np.diff(shared.span[counted], axis=1)[:, 0] / wander.correlation_time
                seen = np.minimum(wander.sd / usual, 1.0) ** 2 * reported
                means = reported - seen * [_mean_square_about_mean(float(span)) for span in spans]
                alone, together = means.sum(), np.sqrt(means).sum() ** 2
                both = alone + settings.pass_correlation * (together - alone)
                sd = float(np.sqrt(both)) / len(counted)
        found |= dict.fromkeys((shared.names[k] for k in own), sd)
    return found


def _mean_square_about_mean(span: float) -> float:
    """Mean square of a first-order process of variance 1 about its mean over a time.

    Parameters
    ----------
    span : float
        The time, in times of correlation [1].

    Returns
    -------
    float
        1 - 2 / x + 2 (1 - exp(-x)) / x², near x / 3 for short times.
    """
    if span < 1e-3:
        return span / 3.0
    return float(1.0 - 2.0 / span - 2.0 * np.expm1(-span) / span**2)
