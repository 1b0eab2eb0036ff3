"""Kalman filter and Rauch-Tung-Striebel smoother over a run, in pieces that bound memory."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.intp]

_PIECE = 4000  # knots whose filtered states are stored at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class StateSpaceModel:
    """A linear model of 3 coordinates, their rates, n_p parameters and 3 drifts, at n knots."""

    step: Float
    "Time from knot to knot, shape (n - 1,) [s]."

    increment: Float
    "Known increments of coordinates and rates in a step, shape (n - 1, 6)."

    parameter_design: Float
    """Derivatives of the increments of coordinates and rates in a step by the parameters, shape
    (n - 1, 6, n_p)."""

    noise: Float
    "Two-sided density of the white acceleration of the coordinates, shape (n - 1, 3, 3)."

    random_walk: Float
    """Variance per second of the random walk of each parameter, shape (n - 1, n_p), or (1, n_p) if
    constant."""

    decay: Float
    "Factor of each drift over a step, shape (n - 1, 3)."

    drift_noise: Float
    "Variance that each drift gains in a step, shape (n - 1, 3)."

    epochs: Int
    "First measurement of each knot, and the one after its last, shape (n, 2)."

    time_after_knot: Float
    "Time from the knot to each measurement, shape (m,) [s]."

    measured: Float
    "Measurements, shape (m, 3)."

    design: Float
    "Derivatives of the measurements by the coordinates, shape (m, 3, 3)."

    variance: Float
    "Variance of the white noise of the measurements, shape (m, 3)."


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothedStates:
    """States at the knots given all measurements, with their covariances."""

    mean: Float
    "States, shape (n, 6 + n_p + 3)."

    covariance: Float
    "Covariance of the coordinates, shape (n, 3, 3)."

    drift_variance: Float
    "Variance of the drifts, shape (n, 3)."

    parameter_covariance: Float
    "Covariance of the parameters at the last knot, shape (n_p, n_p)."

    normalised_innovation_squared: Float
    "Mean square of the innovations over their variance, of each measured coordinate, shape (3,)."

    scores: Float
    """For each step and each parameter and drift, the square of the adjoint and its expectation.
    Their difference is twice the derivative of the log likelihood by the variance that the step
    adds. Shape (n - 1, n_p + 3, 2), or empty."""


def smooth_states(
    model: StateSpaceModel, state: Float, covariance: Float, *, with_scores: bool = False
) -> SmoothedStates:
    """States of a linear model at all knots, given all measurements.

    Parameters
    ----------
    model : StateSpaceModel
        Dynamics and measurements.
    state : numpy.ndarray, shape (6 + n_p + 3,)
        Mean at the first knot before any measurement.
    covariance : numpy.ndarray, shape (6 + n_p + 3, 6 + n_p + 3)
        Covariance of that state.
    with_scores : bool
        Whether to compute `SmoothedStates.scores`.

    Returns
    -------
    SmoothedStates
        States and covariances.
    """
    from trueterrain.motion import _kernels  # here, as numba takes long to import

    # The backward recursion needs all filtered states and covariances. The forward recursion stores
    # its state at the begin of each piece; the pieces are filtered a second time, last one first.
    n = model.step.size + 1
    starts = np.arange(0, n, _PIECE)
    x, p = state.copy(), covariance.copy()
    checkpoints = []
    for first in starts:
        checkpoints.append((x.copy(), p.copy()))
        _filter_piece(model, int(first), min(int(first) + _PIECE, n), x, p, None)
    size = state.size
    mean, cov, drift = np.empty((n, size)), np.empty((n, 3, 3)), np.empty((n, 3))
    adjoint, information = np.zeros(size), np.zeros((size, size))
    scores = np.empty((n - 1 if with_scores else 0, size - 6, 2))
    normalised_innovation_squared, count = np.zeros(3), 0
    for first, (x0, p0) in zip(starts[::-1], checkpoints[::-1], strict=True):
        last = min(int(first) + _PIECE, n)
        piece = _FilteredPiece.allocate(
            size, last - first, model.epochs[last - 1, 1] - model.epochs[first, 0]
        )
        _filter_piece(model, int(first), last, x0, p0, piece)
        if last == n:
            end = piece.covariances[-1][6:-3, 6:-3].copy()
        _kernels.smooth_backward(
            int(first),
            last,
            adjoint,
            information,
            model.step,
            model.parameter_design,
            model.decay,
            model.epochs,
            model.time_after_knot,
            model.design,
            piece.states,
            piece.covariances,
            piece.gains,
            piece.innovations,
            mean,
            cov,
            drift,
            scores,
        )
        normalised_innovation_squared += (
            piece.innovations[:, :, 0] ** 2 / piece.innovations[:, :, 1]
        ).sum(axis=0)
        count += len(piece.innovations)
    return SmoothedStates(
        mean=mean,
        covariance=cov,
        drift_variance=drift,
        parameter_covariance=end,
        normalised_innovation_squared=normalised_innovation_squared / max(count, 1),
        scores=scores,
    )


@dataclass(frozen=True, eq=False)
class _FilteredPiece:
    """Filtered states, covariances, gains and innovations of some knots."""

    states: Float
    covariances: Float
    gains: Float
    innovations: Float

    @classmethod
    def allocate(cls, size: int, knots: int, measurements: int) -> "_FilteredPiece":
        return cls(
            np.empty((knots, size)),
            np.empty((knots, size, size)),
            np.empty((measurements, 3, size)),
            np.empty((measurements, 3, 2)),
        )


def _filter_piece(
    m: StateSpaceModel, first: int, last: int, x: Float, p: Float, piece: _FilteredPiece | None
) -> None:
    """Filter from knot `first` to before knot `last`; x and p are updated in place."""
    from trueterrain.motion import _kernels

    piece = _FilteredPiece.allocate(x.size, 0, 0) if piece is None else piece
    _kernels.filter_forward(
        first,
        last,
        x,
        p,
        m.step,
        m.increment,
        m.parameter_design,
        m.noise,
        m.random_walk,
        m.decay,
        m.drift_noise,
        m.epochs,
        m.time_after_knot,
        m.measured,
        m.design,
        m.variance,
        piece.states,
        piece.covariances,
        piece.gains,
        piece.innovations,
    )
