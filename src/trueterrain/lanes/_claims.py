"""How sure corrections are, of what passes have in common too.

Overlaps tell how passes wander from each other, not how they wander together; yet passes of one
kind do both to the same extent. So the wandering that standard deviations rest on is pooled from
what was seen between the passes and from what the navigation claims, by their degrees of freedom.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trueterrain.lanes._choose import CORRELATION_TIME, priors, usual_sd
from trueterrain.lanes._equations import Prior
from trueterrain.lanes._settings import NetworkSettings, Trial
from trueterrain.lanes._system import System
from trueterrain.lanes._weights import Fitted
from trueterrain.lanes.spline import Wander

Floats = npt.NDArray[np.float64]

#: Degrees of freedom of the deviations of a first-order process from its mean over a time that is
#: short beside that of its correlation: (sum of 1/k²)² / sum of 1/k⁴.
SHORT = 2.5

#: Those that the claim of the navigation is worth, which holds its constant errors as well.
CLAIM = 1.0


def claimed(
    system: System,
    fitted: Fitted,
    trial: Trial,
    settings: NetworkSettings,
    lanes_sd: Sequence[Floats],
) -> dict[str, Prior]:
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
    found = priors(trial, settings)
    time = settings.correlation_time or CORRELATION_TIME
    claim = usual_sd(lanes_sd)
    if claim is None:
        return found
    seen, freedom = wandering(system, fitted, time)
    sd = float(np.sqrt((freedom * seen**2 + CLAIM * claim**2) / (freedom + CLAIM)))
    wander = Wander(sd=sd, correlation_time=time, order="first")
    return {**found, "height": replace(found["height"], wander=wander)}


def wandering(system: System, fitted: Fitted, time: float) -> tuple[float, float]:
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
    group, squares, free, freedom = system.shared.group, 0.0, 0, 0.0
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
            squares += float(np.var(height[1:-1])) / _deviation(span)
        free += own
        freedom += own * (SHORT + 0.5 * float(np.mean(spans)))
    return (float(np.sqrt(squares / free)), freedom) if free else (0.0, 0.0)


def _deviation(span: float) -> float:
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
