"""Priors for the covariance of corrections, which includes the drift that passes have in common.

Overlaps show how passes drift relative to each other; drift that they have in common is
unobservable. Passes of one kind do both to the same extent, so the drift on which standard
deviations rest is pooled from the observed relative drift and the reported standard deviation of
navigation, weighted by their degrees of freedom.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.model_search import (
    CORRELATION_TIME,
    reported_sd,
    trial_priors,
)
from trueterrain.alignment.adjustment.normal_equations import ComponentPrior
from trueterrain.alignment.adjustment.robust_weights import WeightedFit
from trueterrain.alignment.adjustment.shared_cells import SharedCells
from trueterrain.alignment.adjustment.spline import GaussMarkovProcess
from trueterrain.alignment.adjustment.system import AdjustmentSystem
from trueterrain.alignment.settings import ModelTrial, NetworkSettings

Floats = npt.NDArray[np.float64]

#: Degrees of freedom of the deviations of a first-order process from its mean over a time that is
#: short against the correlation time. Then it is a Brownian motion, whose Karhunen-Loeve
#: eigenvalues go as 1/k², and Satterthwaite's formula gives (sum of 1/k²)² / sum of 1/k⁴ = 2.5.
DRIFT_DEGREES_OF_FREEDOM = 2.5

#: Degrees of freedom given to the reported standard deviation, which includes constant errors.
REPORTED_DEGREES_OF_FREEDOM = 1.0


def navigation_priors(
    system: AdjustmentSystem,
    fitted: WeightedFit,
    trial: ModelTrial,
    settings: NetworkSettings,
    navigation_sd: Sequence[Floats],
) -> dict[str, ComponentPrior]:
    """Priors for the standard deviations of the corrections.

    Parameters
    ----------
    system : AdjustmentSystem
        The unknowns.
    fitted : WeightedFit
        Estimated corrections.
    trial : ModelTrial
        The chosen model.
    settings : NetworkSettings
        Correlation time.
    navigation_sd : sequence of numpy.ndarray, shape (2, n)
        Times [s] and reported standard deviations of the height [m].

    Returns
    -------
    dict of ComponentPrior
        Those of the trial; with reported standard deviations, the drift of the height is pooled
        from them and from the observed drift.
    """
    found = trial_priors(trial, settings)
    time = settings.correlation_time or CORRELATION_TIME
    reported = reported_sd(navigation_sd)
    if reported is None:
        return found
    observed, degrees_of_freedom = estimate_drift(system, fitted, time)
    sd = float(
        np.sqrt(
            (degrees_of_freedom * observed**2 + REPORTED_DEGREES_OF_FREEDOM * reported**2)
            / (degrees_of_freedom + REPORTED_DEGREES_OF_FREEDOM)
        )
    )
    process = GaussMarkovProcess(sd=sd, correlation_time=time, order="first")
    return {**found, "height": replace(found["height"], process=process)}


def estimate_drift(
    system: AdjustmentSystem, fitted: WeightedFit, time: float
) -> tuple[float, float]:
    """Relative drift of the passes.

    Parameters
    ----------
    system : AdjustmentSystem
        The unknowns.
    fitted : WeightedFit
        Estimated corrections.
    time : float
        Correlation time [s].

    Returns
    -------
    sd : float
        Standard deviation of a first-order process whose deviations from its mean are those of the
        corrections [m].
    degrees_of_freedom : float
        0 if there is one pass only: its drift is unobservable.
    """
    group, squares, free, degrees_of_freedom = system.shared.group, 0.0, 0, 0.0
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        moved = [
            (pass_index, knots)
            for pass_index in members
            if (knots := system.knots[pass_index]) is not None
        ]
        # without a fixed pass, corrections are relative to their own mean
        own = len(moved) - (1 if len(moved) == members.size else 0)
        if own < 1:
            continue
        spans = [knots.spacing * knots.intervals / time for _, knots in moved]
        for (pass_index, _), span in zip(moved, spans, strict=True):
            height = fitted.solution.x[system.pass_unknowns(int(pass_index))[0][0]]
            squares += float(np.var(height[1:-1])) / _mean_square_about_mean(span)
        free += own
        degrees_of_freedom += own * (DRIFT_DEGREES_OF_FREEDOM + 0.5 * float(np.mean(spans)))
    return (float(np.sqrt(squares / free)), degrees_of_freedom) if free else (0.0, 0.0)


def estimate_datum_sd(
    shared: SharedCells,
    navigation_sd: Sequence[Floats],
    process: GaussMarkovProcess,
    passes: Collection[str],
    settings: NetworkSettings,
) -> dict[str, float | None]:
    """Standard deviation of the datum: the height error that all passes of a group have in common.

    The datum is the mean of the passes over time, so its error is the mean of their mean errors.
    Part of the reported variance of a pass is drift within the pass, which the covariance of the
    corrections contains already; the rest is the variance of its mean. Fixed passes have their
    reported variance, whatever their number, since each may carry a part of the ground alone.
    Control points bring their own variances into the adjustment and add none here.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    navigation_sd : sequence of numpy.ndarray, shape (2, n)
        Times [s] and reported standard deviations of the height [m].
    process : GaussMarkovProcess
        Drift of the height within a pass that the covariance of the corrections contains.
    passes : collection of str
        Names of the passes; other members are control points.
    settings : NetworkSettings
        Correlation between passes, or the standard deviation itself.

    Returns
    -------
    dict of float or None
        Of each pass [m]; None if a pass of its group reports nothing.
    """
    typical = reported_sd(navigation_sd)
    found: dict[str, float | None] = {}
    for number in np.unique(shared.group):
        members = np.flatnonzero(shared.group == number)
        own = [int(k) for k in members if shared.names[k] in passes]
        fixed = [k for k in own if shared.fixed[k]]
        counted = fixed or own
        sd: float | None = settings.datum_sd
        if sd is None and len(own) < members.size and not fixed:
            sd = 0.0
        elif sd is None and typical is not None and all(navigation_sd[k].size for k in counted):
            reported = np.array([np.mean(navigation_sd[k][1] ** 2) for k in counted])
            sd = float(np.sqrt(reported.mean()))
            if not fixed:
                spans = np.diff(shared.span[counted], axis=1)[:, 0] / process.correlation_time
                drift = np.minimum(process.sd / typical, 1.0) ** 2 * reported
                means = reported - drift * [_mean_square_about_mean(float(span)) for span in spans]
                # variance of a mean of correlated errors: (1 - rho) sum(s²) + rho (sum s)²
                alone, together = means.sum(), np.sqrt(means).sum() ** 2
                both = alone + settings.pass_correlation * (together - alone)
                sd = float(np.sqrt(both)) / len(counted)
        found |= dict.fromkeys((shared.names[k] for k in own), sd)
    return found


def _mean_square_about_mean(span: float) -> float:
    """Mean square of a first-order process of variance 1 about its mean over a span of time.

    Parameters
    ----------
    span : float
        Span divided by the correlation time [1].

    Returns
    -------
    float
        1 - 2 / x + 2 (1 - exp(-x)) / x², near x / 3 for short times.
    """
    if span < 1e-3:
        return span / 3.0
    return float(1.0 - 2.0 / span - 2.0 * np.expm1(-span) / span**2)
