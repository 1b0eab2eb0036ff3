"""Signatures in correlated errors: estimates and their standard deviations."""

import numpy as np
import pytest
from scipy.signal import lfilter

from trueterrain.verify.statistics.regression import project_out, regress_signatures

TIME = np.linspace(0.0, 2.0, 400)
MARK = np.sin(2 * np.pi * 3.0 * TIME)[:, None]
LEVEL = np.stack([np.ones_like(TIME), TIME], axis=-1)


def errors(rng, correlation, size=TIME.size):
    """Of standard deviation 1."""
    white = rng.normal(size=size + 200)
    return lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], white)[200:]


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_standard_deviations_are_those_of_the_errors(correlation):
    """Root mean square of error over sd in 200 repeats: 1, or less for correlated errors."""
    rng = np.random.default_rng(11)
    ratios = []
    for _ in range(200):
        error = 2.0 * MARK[:, 0] + 3.0 - TIME + errors(rng, correlation)
        found = regress_signatures(MARK, LEVEL, error, lags=30)
        ratios.append((found.value[0] - 2.0) / found.sd[0])
    assert 0.5 < float(np.sqrt(np.mean(np.square(ratios)))) < 1.15  # 200 values: sd 0.05
    assert np.abs(ratios).max() < 4.0


def test_few_independent_errors_are_not_significant():
    """Of 300 records that hold some twenty independent errors, none is beyond four sd by chance."""
    rng = np.random.default_rng(12)
    few = [
        regress_signatures(MARK[:60], LEVEL[:60], errors(rng, 0.5, 60), lags=7) for _ in range(300)
    ]
    assert max(abs(one.value[0] / one.sd[0]) for one in few) < 4.0


def test_an_exact_fit_leaves_nothing():
    found = regress_signatures(MARK, LEVEL, 2.0 * MARK[:, 0] + 1.0, lags=30)
    np.testing.assert_allclose(found.value, [2.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.sd, [0.0], rtol=0, atol=1e-12)


def test_nuisance_functions_are_projected_out():
    np.testing.assert_allclose(project_out(LEVEL, 5.0 - 2.0 * TIME), 0.0, rtol=0, atol=1e-12)
