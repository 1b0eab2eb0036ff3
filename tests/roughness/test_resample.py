"""Resampling of profiles at equal spacing."""

import numpy as np
import pytest

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import resample_profile

ROUNDING = 1e-12  # [m] of sums of some metres


def _uneven(seed=3, count=400):
    steps = np.random.default_rng(seed).uniform(0.02, 0.2, count)
    return 5.0 + np.append(0.0, np.cumsum(steps))


def test_a_slope_stays_a_slope_in_all_tracks():
    s = _uneven()
    road = make_profile(
        s,
        [0.01 * s, -0.02 * s],
        tracks=["left", "right"],
        sd=np.full((2, s.size), 0.001),
        easting=np.stack([s, s]),
    )
    even = resample_profile(road, 0.05)
    np.testing.assert_allclose(np.diff(even.s), 0.05, rtol=0, atol=ROUNDING)
    assert even.s[0] == s[0]
    assert s[-1] - 0.05 < even.s[-1] <= s[-1]
    np.testing.assert_allclose(
        even.height.sel(track="right"), -0.02 * even.s, rtol=0, atol=ROUNDING
    )
    np.testing.assert_allclose(even.easting.sel(track="left"), even.s, rtol=0, atol=ROUNDING)
    assert (even.sd == 0.001).all()
    assert provenance.provenance_steps(even)[-1]["step"] == "resample_profile"


def test_samples_at_their_own_spacing_stay_as_they_are():
    s = 0.25 * np.arange(401)
    road = make_profile(s, np.random.default_rng(1).normal(size=s.size))
    np.testing.assert_array_equal(resample_profile(road, 0.25).height, road.height)


def test_gaps_stay_gaps_and_do_not_grow_beyond_their_neighbours():
    s = 0.1 * np.arange(11)
    height = np.sin(s)
    height[5] = np.nan
    even = resample_profile(make_profile(s, height), 0.05)
    missing = np.flatnonzero(np.isnan(even.height))
    np.testing.assert_array_equal(missing, [9, 10, 11])


@pytest.mark.parametrize("spacing", [0.0, -0.1, np.nan, np.inf])
def test_invalid_spacings_are_refused(spacing):
    with pytest.raises(ValueError, match="spacing must be greater than 0 m"):
        resample_profile(make_profile([0.0, 1.0], [0.0, 0.0]), spacing)


def test_a_profile_shorter_than_the_spacing_is_an_error():
    with pytest.raises(CoverageError, match=r"is 1 m long, shorter than the spacing of 2 m"):
        resample_profile(make_profile([0.0, 1.0], [0.0, 0.0]), 2.0)
