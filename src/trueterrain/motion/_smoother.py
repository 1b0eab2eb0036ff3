"""Kalman filter and Rauch-Tung-Striebel smoother over a run, in pieces that bound memory."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.motion import _kernels

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.intp]

_PIECE = 4000  # knots whose filtered states are kept at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpaceModel:
    """A linear model of three coordinates, n_p parameters and three drifts, at n knots."""

    step: Float
    "From knot to knot, shape (n - 1,) [s]."

    known: Float
    "What is added to coordinates and rates, shape (n - 1, 6)."

    into_coordinate: Float
    "What parameters add to the coordinates, shape (n - 1, 3, n_p)."

    into_rate: Float
    "What parameters add to the rates, shape (n - 1, 3, n_p)."

    noise: Float
    "Two-sided density of the white acceleration of the coordinates, shape (n - 1, 3, 3)."

    walk: Float
    "Variance of each parameter's random walk per second, shape (n - 1, n_p), or (1, n_p) always."

    decay: Float
    "What is left of each drift after a step, shape (n - 1, 3)."

    drift_noise: Float
    "Variance that each drift gains in a step, shape (n - 1, 3)."

    seen: Int
    "First measurement of each knot, and the one after its last, shape (n, 2)."

    before: Float
    "Time from the knot to each measurement, shape (m,) [s]."

    measured: Float
    "Measurements, shape (m, 3)."

    design: Float
    "Derivatives of the measurements by the coordinates, shape (m, 3, 3)."

    variance: Float
    "Of their white noise, shape (m, 3)."


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothedStates:
    """What all measurements together say at the knots."""

    mean: Float
    "States, shape (n, 6 + n_p + 3)."

    covariance: Float
    "Of the coordinates, shape (n, 3, 3)."

    drift_variance: Float
    "Of the drifts, shape (n, 3)."

    parameter_covariance: Float
    "Of the parameters at the last knot, shape (n_p, n_p)."

    normalised_innovation_squared: Float
    "Mean square of the innovations over their variance, of each measured coordinate, shape (3,)."

    pull: Float
    """For each step, how strongly measurements pull at parameters and drifts (square of the
    adjoint), and how strongly they would by chance: twice the derivative of the log likelihood by
    the variance that the step adds is their difference. Shape (n - 1, n_p + 3, 2), or empty."""


def smooth_states(
    model: StateSpaceModel, state: Float, covariance: Float, *, pulls: bool = False
) -> SmoothedStates:
    """State of a linear model at all knots, given all measurements.

    Parameters
    ----------
    model : Model
        The model.
    state : numpy.ndarray, shape (6 + n_p + 3,)
        Mean at the first knot before any measurement.
    covariance : numpy.ndarray, shape (6 + n_p + 3, 6 + n_p + 3)
        And its covariance.
    pulls : bool
        Whether `SmoothedStates.pull` is wanted.

    Returns
    -------
    Smoothed
        States and covariances.
    """
    n = model.step.size + 1
    starts = np.arange(0, n, _PIECE)
    x, p = state.copy(), covariance.copy()
    checkpoints = []
    for first in starts:
        checkpoints.append((x.copy(), p.copy()))
        _run_forward(model, int(first), min(int(first) + _PIECE, n), x, p, None)
    size = state.size
    mean, cov, drift = np.empty((n, size)), np.empty((n, 3, 3)), np.empty((n, 3))
    adjoint, information = np.zeros(size), np.zeros((size, size))
    pull = np.empty((n - 1 if pulls else 0, size - 6, 2))
    normalised_innovation_squared, count = np.zeros(3), 0
    for first, (x0, p0) in zip(starts[::-1], checkpoints[::-1], strict=True):
        last = min(int(first) + _PIECE, n)
        kept = _Kept.of(size, last - first, model.seen[last - 1, 1] - model.seen[first, 0])
        _run_forward(model, int(first), last, x0, p0, kept)
        if last == n:
            end = kept.covariances[-1][6:-3, 6:-3].copy()
        _kernels.smooth_backward(
            int(first),
            last,
            adjoint,
            information,
            model.step,
            model.into_coordinate,
            model.into_rate,
            model.decay,
            model.seen,
            model.before,
            model.design,
            kept.states,
            kept.covariances,
            kept.gains,
            kept.innovations,
            mean,
            cov,
            drift,
            pull,
        )
        normalised_innovation_squared += (
            kept.innovations[:, :, 0] ** 2 / kept.innovations[:, :, 1]
        ).sum(axis=0)
        count += len(kept.innovations)
    return SmoothedStates(
        mean=mean,
        covariance=cov,
        drift_variance=drift,
        parameter_covariance=end,
        normalised_innovation_squared=normalised_innovation_squared / max(count, 1),
        pull=pull,
    )


@dataclass(frozen=True, eq=False)
class _Kept:
    states: Float
    covariances: Float
    gains: Float
    innovations: Float

    @classmethod
    def of(cls, size: int, knots: int, measurements: int) -> "_Kept":
        return cls(
            np.empty((knots, size)),
            np.empty((knots, size, size)),
            np.empty((measurements, 3, size)),
            np.empty((measurements, 3, 2)),
        )


def _run_forward(
    m: StateSpaceModel, first: int, last: int, x: Float, p: Float, kept: _Kept | None
) -> None:
    kept = _Kept.of(x.size, 0, 0) if kept is None else kept
    _kernels.filter_forward(
        first,
        last,
        x,
        p,
        m.step,
        m.known,
        m.into_coordinate,
        m.into_rate,
        m.noise,
        m.walk,
        m.decay,
        m.drift_noise,
        m.seen,
        m.before,
        m.measured,
        m.design,
        m.variance,
        kept.states,
        kept.covariances,
        kept.gains,
        kept.innovations,
    )
