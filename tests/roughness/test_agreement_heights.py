"""Errors of heights after registration: truth, bias and precision of repeats, bad input."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_profile
from trueterrain.roughness.agreement import (
    AgreementLimits,
    AgreementSettings,
    check_limits,
    height_errors,
    profile_agreement,
)

S = np.arange(0.0, 200.0, 0.05)
CHORD_ERROR = 2e-5  # [m] of lines between samples 50 mm apart: step² curvature / 8
ROUND_OFF = 1e-12  # [m]


def road(x):
    waves = ((20.0, 0.02, 0.3), (7.0, 0.006, 1.1), (2.3, 0.002, 2.0), (31.0, 0.03, 0.7))
    return sum(a * np.sin(2 * np.pi * x / length + phase) for length, a, phase in waves)


def test_errors_are_those_after_shift_scale_and_trend():
    measured = road((S - 0.217) / 1.0004) + 0.5 + 1e-4 * S
    runs = {"R": make_profile(S, road(S)), "A": make_profile(S, measured)}
    found = height_errors(runs, "R").squeeze()
    assert_allclose(found.error.dropna("s"), 0.0, rtol=0, atol=4 * CHORD_ERROR)
    assert_allclose(found.best_shift, 0.217, rtol=0, atol=1e-3)
    assert_allclose(found.scale, 4e-4, rtol=0, atol=1e-5)


def test_without_registration_the_errors_are_the_plain_difference():
    runs = {"R": make_profile(S, road(S)), "A": make_profile(S, road(S) + 0.003 * np.sign(S - 100))}
    found = height_errors(runs, "R", registration="none", trend=None).squeeze()
    below = np.count_nonzero(S < 100)
    mean = 0.003 * (S.size - 2 * below - np.count_nonzero(S == 100)) / S.size
    assert_allclose(found["mean"], mean, rtol=0, atol=1e-6)
    assert_allclose(found.rms, 0.003, rtol=0, atol=1e-6)
    assert_allclose([found.largest, found.p95], 0.003, rtol=0, atol=ROUND_OFF)


def test_statistics_of_normal_errors_are_their_standard_deviation():
    sd, n = 0.001, 100_000
    s = 0.05 * np.arange(n)
    noise = sd * np.random.default_rng(2).standard_normal(n)
    runs = {"R": make_profile(s, road(s)), "A": make_profile(s, road(s) + noise)}
    found = height_errors(runs, "R", registration="none", trend=1).squeeze()
    # relative sd of rms 0.7 / sqrt(n), of nmad 1.2 / sqrt(n), of the percentile 1.2 / sqrt(n)
    assert_allclose(
        [found.rms / sd, found.nmad / sd, found.p95 / sd / 1.95996],
        1.0,
        rtol=0,
        atol=5 * 1.2 / np.sqrt(n),
    )


def test_bias_and_precision_of_repeats():
    """Each repeat has an error of its own: known mean and standard deviation at each station."""
    bias, sd = 0.004 * np.sin(2 * np.pi * S / 50), 0.001 * (1 + S / 200)
    runs = {"R": make_profile(S, road(S))}
    for name, side in (("1", -1.0), ("2", 0.0), ("3", 1.0)):
        runs[name] = make_profile(S, road(S) + bias + side * sd)
    found = height_errors(runs, "R", registration="none", trend=None)
    assert_allclose(found.mean_error[0], bias, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.sd[0], sd, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.bias, np.mean(np.abs(bias)), rtol=0, atol=ROUND_OFF)
    assert_allclose(found.precision, sd.mean(), rtol=0, atol=ROUND_OFF)
    rated = profile_agreement(runs, reference="R")
    limits = AgreementLimits(bias=0.003, precision=0.001)
    checks = {check.name: check.passed for check in check_limits(rated, found, limits=limits)}
    assert (checks["bias"], checks["precision"]) == (True, False)


def test_one_repeat_has_no_precision():
    runs = {"R": make_profile(S, road(S)), "A": make_profile(S, road(S))}
    found = height_errors(runs, "R")
    assert np.isnan(found.bias).all()
    assert np.isnan(found.precision).all()
    checks = {
        check.name: check for check in check_limits(profile_agreement(runs, reference="R"), found)
    }
    assert checks["precision"].reason == "there are less than two repeats"


def test_stations_outside_of_a_profile_have_no_error():
    part = S[1000:3000]
    runs = {"R": make_profile(S, road(S)), "A": make_profile(part, road(part))}
    found = height_errors(runs, "R", registration="none").squeeze()
    assert_allclose(np.isfinite(found.error), np.isin(S, part))


def test_bad_input_is_refused():
    runs = {"R": make_profile(S, road(S)), "A": make_profile(S + 900, road(S))}
    with pytest.raises(CoverageError, match=r"R and A: do not overlap: 0 to 199.95 m, and 900"):
        height_errors(runs, "R", registration="none")
    aligned = height_errors(
        runs, "R", registration="none", settings=AgreementSettings(align_starts=True)
    )
    assert_allclose(aligned.rms, 0.0, rtol=0, atol=ROUND_OFF)
    with pytest.raises(ValueError, match="registration must be"):
        height_errors(runs, "R", registration="both")
    with pytest.raises(ValueError, match="trend must be"):
        height_errors(runs, "R", trend=-1)
    with pytest.raises(ValueError, match="reference must be one of R, A, got 'B'"):
        height_errors(runs, "B")
