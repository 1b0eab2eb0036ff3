"""The smoother against least squares over all states at once, without recursion."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from trueterrain.motion import _smoother
from trueterrain.motion._smoother import StateSpaceModel, smooth_states

SLOPE = 1e-6  # round-off of differences of log likelihoods near -100, over 2e-4
ROUND_OFF = 1e-8  # of values near 1; the dense normal equations lose more digits than the filter


def model(n=40, parameters=2, seed=1):
    """Knots at uneven steps; measurements at some of them, two at one knot, none at the first."""
    rng = np.random.default_rng(seed)
    step = rng.uniform(0.4, 0.8, n - 1)
    at = np.sort(np.append(rng.choice(np.arange(1, n), 17, replace=False), [20, 20]))
    half = rng.standard_normal((n - 1, 3, 3))
    knots = np.arange(n)
    return StateSpaceModel(
        step=step,
        increment=rng.standard_normal((n - 1, 6)),
        parameter_design=np.concatenate(
            [
                0.1 * rng.standard_normal((n - 1, 3, parameters)),
                rng.standard_normal((n - 1, 3, parameters)),
            ],
            axis=1,
        ),
        noise=half @ np.swapaxes(half, 1, 2) + np.eye(3),
        random_walk=np.linspace((0.1, 0.02), (0.01, 0.2), n - 1),
        decay=rng.uniform(0.8, 1.0, (n - 1, 3)),
        drift_noise=rng.uniform(0.01, 0.1, (n - 1, 3)),
        epochs=np.stack([np.searchsorted(at, knots), np.searchsorted(at, knots, side="right")], 1),
        time_after_knot=rng.uniform(-0.02, 0.02, at.size),
        measured=rng.standard_normal((at.size, 3)),
        design=np.eye(3) + 0.3 * rng.standard_normal((at.size, 3, 3)),
        variance=rng.uniform(0.5, 1.0, (at.size, 3)),
    ), at


def transition(m, k, size):
    f = np.eye(size)
    h = m.step[k]
    f[:3, 3:6] = h * np.eye(3)
    f[:6, 6:-3] = m.parameter_design[k]
    f[-3:, -3:] = np.diag(m.decay[k])
    q = np.zeros((size, size))
    q[:3, :3], q[3:6, 3:6] = m.noise[k] * h**3 / 3, m.noise[k] * h
    q[:3, 3:6] = q[3:6, :3] = m.noise[k] * h**2 / 2
    q[6:-3, 6:-3] = np.diag(m.random_walk[k] * h)
    q[-3:, -3:] = np.diag(m.drift_noise[k])
    return f, q


def dense(m, at, state, covariance):
    """All states at once, by normal equations."""
    n, size = m.step.size + 1, state.size
    normal, right = np.zeros((n * size,) * 2), np.zeros(n * size)
    first = np.linalg.inv(covariance)
    normal[:size, :size] += first
    right[:size] += first @ state
    for k in range(n - 1):
        f, q = transition(m, k, size)
        weight = np.linalg.inv(q)
        both = slice(k * size, (k + 2) * size)
        rows = np.hstack([-f, np.eye(size)])
        known = np.concatenate([m.increment[k], np.zeros(size - 6)])
        normal[both, both] += rows.T @ weight @ rows
        right[both] += rows.T @ weight @ known
    for i, k in enumerate(at):
        rows = np.zeros((3, size))
        rows[:, :3], rows[:, 3:6] = m.design[i], m.design[i] * m.time_after_knot[i]
        rows[:, -3:] = np.eye(3)
        here = slice(k * size, (k + 1) * size)
        normal[here, here] += rows.T @ (rows / m.variance[i][:, None])
        right[here] += rows.T @ (m.measured[i] / m.variance[i])
    whole = np.linalg.inv(normal)
    blocks = np.array(
        [whole[k * size : (k + 1) * size, k * size : (k + 1) * size] for k in range(n)]
    )
    return (whole @ right).reshape(n, size), blocks


@pytest.mark.parametrize("piece", [4000, 7])
def test_equal_to_least_squares_over_all_states(monkeypatch, piece):
    monkeypatch.setattr(_smoother, "_PIECE", piece)
    m, at = model()
    state = np.linspace(-1.0, 1.0, 11)
    covariance = np.diag(np.linspace(0.5, 2.0, 11))
    found = smooth_states(m, state, covariance)
    mean, blocks = dense(m, at, state, covariance)
    assert_allclose(found.mean, mean, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.covariance, blocks[:, :3, :3], rtol=0, atol=ROUND_OFF)
    drift = np.einsum("nii->ni", blocks)[:, -3:]
    assert_allclose(found.drift_variance, drift, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.parameter_covariance, blocks[-1, 6:-3, 6:-3], rtol=0, atol=ROUND_OFF)


def test_results_do_not_depend_on_pieces(monkeypatch):
    m, _ = model()
    state, covariance = np.zeros(11), np.eye(11)
    whole = smooth_states(m, state, covariance)
    monkeypatch.setattr(_smoother, "_PIECE", 5)
    pieces = smooth_states(m, state, covariance)
    for name in ("mean", "covariance", "drift_variance"):
        assert (getattr(pieces, name) == getattr(whole, name)).all()
    # sums over pieces are added in another order
    assert_allclose(
        pieces.normalised_innovation_squared,
        whole.normalised_innovation_squared,
        rtol=0,
        atol=1e-12,
    )


def log_likelihood(m, at, state, covariance):
    """Log likelihood of all measurements from their joint covariance."""
    n, size = m.step.size + 1, state.size
    means, joint = [state], np.zeros((n, n, size, size))
    joint[0, 0] = covariance
    for k in range(n - 1):
        f, q = transition(m, k, size)
        means.append(f @ means[-1] + np.concatenate([m.increment[k], np.zeros(size - 6)]))
        for j in range(k + 1):
            joint[k + 1, j] = f @ joint[k, j]
            joint[j, k + 1] = joint[k + 1, j].T
        joint[k + 1, k + 1] = f @ joint[k, k] @ f.T + q
    rows = np.zeros((at.size, 3, size))
    rows[:, :, :3], rows[:, :, 3:6] = m.design, m.design * m.time_after_knot[:, None, None]
    rows[:, :, -3:] = np.eye(3)
    predicted = np.concatenate([h @ means[k] for h, k in zip(rows, at, strict=True)])
    joint_covariance = np.block(
        [
            [rows[i] @ joint[at[i], at[j]] @ rows[j].T for j in range(at.size)]
            for i in range(at.size)
        ]
    )
    return multivariate_normal(predicted, joint_covariance + np.diag(m.variance.ravel())).logpdf(
        m.measured.ravel()
    )


def test_scores_are_the_derivative_of_the_log_likelihood():
    m, at = model(n=30)
    state, covariance = np.linspace(-1.0, 1.0, 11), np.diag(np.linspace(0.5, 2.0, 11))
    scores = smooth_states(m, state, covariance, with_scores=True).scores
    assert smooth_states(m, state, covariance).scores.size == 0
    for k, p in ((3, 0), (17, 1)):
        ends = []
        for change in (-1e-4, 1e-4):
            walk = m.random_walk.copy()
            walk[k, p] += change
            ends.append(log_likelihood(replace(m, random_walk=walk), at, state, covariance))
        slope = (ends[1] - ends[0]) / 2e-4 / m.step[k]
        assert_allclose(0.5 * (scores[k, p, 0] - scores[k, p, 1]), slope, rtol=0, atol=SLOPE)
    ends = []
    for change in (-1e-4, 1e-4):
        noise = m.drift_noise.copy()
        noise[9, 2] += change
        ends.append(log_likelihood(replace(m, drift_noise=noise), at, state, covariance))
    slope = (ends[1] - ends[0]) / 2e-4
    assert_allclose(0.5 * (scores[9, 4, 0] - scores[9, 4, 1]), slope, rtol=0, atol=SLOPE)
