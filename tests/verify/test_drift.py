"""The drift test, against errors whose statistics are known."""

import numpy as np
import pytest

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_profile
from trueterrain.verify.drift import DriftSettings, drift_test

LENGTH = 4000  # [m]
STEP = 0.5e-3  # [m] of the random walk for each metre
GROWTH_TOLERANCE = 0.06  # of the value, [1]: 6 runs x 4000 m, lags up to 30 m
BIAS, REPEAT = 3e-3, 2e-3  # [m]
FIGURE_TOLERANCE = 0.05e-3  # [m] rms of 4000 white places


def _road(s):
    return 0.3 * np.sin(s / 40.0)


def _profiles(errors):
    s = np.arange(LENGTH + 1.0)
    return [make_profile(s, _road(s) + error) for error in errors], make_profile(s, _road(s))


def test_structure_function_and_allan_deviation_are_those_of_a_random_walk():
    """D(L) = q^2 L, and sigma^2(L) = q^2 (2 L^2 + 1) / (6 L) for sums of white steps."""
    rng = np.random.default_rng(8)
    walks = STEP * rng.normal(size=(6, LENGTH + 1)).cumsum(axis=1)
    found = drift_test(*_profiles(walks))
    growth = found.growth.sel(distance=slice(1, 30))
    lag = growth.distance.values
    truth = {
        "structure": STEP * np.sqrt(lag),
        "repeats": STEP * np.sqrt(lag),
        "allan": STEP * np.sqrt((2 * lag**2 + 1) / (6 * lag)),
    }
    for name, values in truth.items():
        np.testing.assert_allclose(growth[name] / values, 1, rtol=0, atol=GROWTH_TOLERANCE)


def test_bias_and_repeatability_are_separated():
    rng = np.random.default_rng(9)
    shared = BIAS * np.sqrt(2) * np.sin(np.arange(LENGTH + 1.0) / 100.0)
    runs = shared + REPEAT * rng.normal(size=(4, LENGTH + 1))
    profiles, reference = _profiles(runs)
    found = drift_test(profiles, reference)
    np.testing.assert_allclose(found.repeatability.value, REPEAT, rtol=0, atol=FIGURE_TOLERANCE)
    np.testing.assert_allclose(found.shared.value, BIAS, rtol=0, atol=2 * FIGURE_TOLERANCE)
    np.testing.assert_allclose(
        found.row.rms.value, np.hypot(BIAS, REPEAT), rtol=0, atol=2 * FIGURE_TOLERANCE
    )
    assert found.shared.low < BIAS < found.shared.high
    alone = drift_test(profiles)
    assert alone.shared is None
    np.testing.assert_allclose(alone.row.rms.value, REPEAT, rtol=0, atol=FIGURE_TOLERANCE)


def test_errors_are_those_of_the_heights():
    profiles, reference = _profiles([np.full(LENGTH + 1, 0.002), np.full(LENGTH + 1, 0.004)])
    found = drift_test(profiles, reference, DriftSettings(spacing=2.5))
    # between nodes a metre apart the road, a sine of 40 m, is straight within 40 um
    np.testing.assert_allclose(found.errors.error[0], 0.002, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.row.bias.value, 0.003, rtol=0, atol=1e-12)
    assert found.row.maximum == pytest.approx(0.004)
    np.testing.assert_allclose(np.diff(found.errors.s), 2.5, rtol=0, atol=1e-9)


def test_a_single_run_is_an_error():
    profiles, reference = _profiles([np.zeros(LENGTH + 1)])
    with pytest.raises(CoverageError, match=r"needs at least 2 runs, got 1.*Repeat the run"):
        drift_test(profiles, reference)


def test_a_short_common_length_is_an_error():
    profiles, _ = _profiles([np.zeros(LENGTH + 1)] * 2)
    with pytest.raises(CoverageError, match=r"800\.0 m in common, the drift test needs 1000 m"):
        drift_test([profiles[0], profiles[1].isel(s=slice(0, 801))])
    with pytest.raises(CoverageError, match="places are too few"):
        drift_test(profiles, settings=DriftSettings(spacing=500.0))


def test_gaps_and_tracks_are_named():
    profiles, _ = _profiles([np.zeros(LENGTH + 1)] * 2)
    profiles[1]["height"][7] = np.nan
    with pytest.raises(CoverageError, match="s = 7 m: there is no height"):
        drift_test(profiles)
    both = make_profile([0.0, 1.0], [[0.0, 0.0], [0.0, 0.0]], tracks=["left", "right"])
    with pytest.raises(ValueError, match="one track each"):
        drift_test([both, both])


@pytest.mark.parametrize("name", ["spacing", "min_length", "confidence"])
def test_settings_that_break_a_rule_are_refused(name):
    with pytest.raises(ValueError, match=name):
        DriftSettings(**{name: 0.0})
