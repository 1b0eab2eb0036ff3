"""Rolling straightedge: closed forms, unequal spacing, and bad profiles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import find_stretches, rolling_straightedge

EXACT = 1e-12  # [m] rounding


@pytest.mark.parametrize("wavelength", [1.5, 3.0, 6.0, 12.0])
def test_sines_deviate_by_the_closed_form(wavelength):
    s = 0.5 * 0.01 * np.arange(8000)
    wave = np.sin(2 * np.pi * s / wavelength)
    beam = rolling_straightedge(make_profile(s, 0.005 * wave), 3.0)
    truth = 0.005 * (1 - np.cos(3 * np.pi / wavelength)) * wave
    assert_allclose(beam.deviation[0], truth[300:-300], rtol=0, atol=EXACT)
    assert_allclose(beam.s, s[300:-300], rtol=0, atol=0)


def test_a_step_is_half_below_and_half_above_the_beam():
    s = 0.1 * np.arange(200)
    beam = rolling_straightedge(make_profile(s, np.where(s < 10, 0.0, 0.01)), 2.0)
    at = {
        round(float(where), 1): float(value)
        for where, value in zip(beam.s, beam.deviation[0], strict=True)
    }
    assert at[8.5] == 0.0
    assert at[9.5] == pytest.approx(-0.005)
    assert at[10.5] == pytest.approx(0.005)
    assert at[11.5] == 0.0


def test_grades_and_offsets_do_not_deviate_at_any_spacing():
    s = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.3, 500))
    beam = rolling_straightedge(make_profile(s, 300 + 0.08 * s), 4.877)
    assert_allclose(beam.deviation, 0, rtol=0, atol=1e-10)  # [m] heights of 300 m
    assert beam.s[0] >= s[0] + 0.5 * 4.877
    assert beam.s[-1] <= s[-1] - 0.5 * 4.877


def test_a_joint_is_found_as_a_stretch():
    s = 0.05 * np.arange(2000)
    height = [np.where(abs(s - 50) < 0.2, -0.02, 0.0), 0 * s]
    beam = rolling_straightedge(make_profile(s, height, tracks=["left", "right"]))
    found = find_stretches(abs(beam.deviation), 0.015)
    assert list(found.track.values) == ["left"]
    assert 49.7 < found.start.item() < found.end.item() < 50.3
    assert found.peak.item() == pytest.approx(0.02)
    assert provenance_steps(beam)[-1]["parameters"] == {"length": 3.0}


def test_a_profile_as_long_as_the_beam_has_one_value():
    beam = rolling_straightedge(make_profile([0.0, 1.5, 3.0], [0.0, 0.01, 0.004]), 3.0)
    assert_allclose(beam.deviation, [[0.008]], rtol=0, atol=EXACT)


def test_bad_profiles_are_refused():
    s = 0.1 * np.arange(20)
    with pytest.raises(CoverageError, match=r"is shorter than the straightedge: 1\.9 m"):
        rolling_straightedge(make_profile(s, 0 * s))
    with pytest.raises(CoverageError, match="shorter than the straightedge"):
        rolling_straightedge(make_profile([0.0, 3.0], [0.0, 0.0]), 3.0)  # no sample at the midpoint
    with pytest.raises(CoverageError, match="has no finite height"):
        rolling_straightedge(make_profile(s, np.full(20, np.nan)), 1.0)
    with pytest.raises(ValueError, match="length must be finite and greater than 0 m"):
        rolling_straightedge(make_profile(s, 0 * s), 0.0)
