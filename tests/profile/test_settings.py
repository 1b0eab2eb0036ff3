"""Profiles by named statistics and tyre models."""

import numpy as np
import pytest
import xarray as xr

import trueterrain as tt
from trueterrain.profile import (
    Disc,
    EnvelopeSettings,
    Percentile,
    TyreProfileSettings,
    named_tyre,
    offset_path,
    point_profile,
    tyre_envelope,
    tyre_profile,
)
from trueterrain.profile.envelope import RigidDisc
from trueterrain.profile.settings import take_profile

SURFACE = tt.sample_road(tt.ground.BelgianBlock(seed=1), length=2.0, width=0.6)
PATH = offset_path(SURFACE, 0.0, spacing=0.05).part(10, 30)


def test_settings_name_statistic_or_tyre():
    settings = TyreProfileSettings(statistic="percentile", percent=80.0, radius=0.05, min_count=2)
    found = take_profile(SURFACE, PATH, settings)
    truth = tyre_profile(SURFACE, PATH, area=Disc(radius=0.05), statistic=Percentile(percent=80.0))
    xr.testing.assert_equal(found, truth)
    found = take_profile(SURFACE, PATH, TyreProfileSettings(statistic="point"))
    xr.testing.assert_equal(found, point_profile(SURFACE, PATH))
    found = take_profile(SURFACE, PATH, envelope=EnvelopeSettings(envelope="disc"))
    truth = tyre_envelope(SURFACE, PATH, tyre=RigidDisc.of(named_tyre("passenger")), thin="error")
    xr.testing.assert_equal(found, truth)
    assert np.ptp(found.height.values) > 0


def test_a_profile_without_path_needs_a_tyre():
    with pytest.raises(ValueError, match="a path must be given"):
        take_profile(SURFACE, None)
