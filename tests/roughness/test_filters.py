"""Filters against their closed-form gains, and their behaviour at the ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import FILTER_250_MM, Butterworth, MovingAverage, filter_profile

EXACT = 1e-9  # [1, or m] rounding, accumulated over some ten thousand samples
DECAYED = 1e-4  # [1] to which the effect of the reflected ends decays in the centre

STEP = 0.1  # [m]
S = STEP * np.arange(30_001)
CENTRE = slice(10_000, 20_000)  # [samples] 1000 m: whole periods of all waves below

LOW = Butterworth(shortest=8.0)
HIGH = Butterworth(longest=90.0, order=2)
BAND = Butterworth(shortest=8.0, longest=90.0)
MEAN = MovingAverage(shortest=0.25)
MEANS = MovingAverage(shortest=1.0, longest=25.0)


def filtered_amplitudes(kind, wavelength):
    """Amplitudes in phase and in quadrature of a unit sine after a filter."""
    wave = 2 * np.pi * S / wavelength
    out = filter_profile(make_profile(S, np.sin(wave)), kind).height.values[CENTRE]
    return 2 * np.mean(out * np.sin(wave)[CENTRE]), 2 * np.mean(out * np.cos(wave)[CENTRE])


@pytest.mark.parametrize("kind", [LOW, HIGH, BAND, MEAN, MEANS])
@pytest.mark.parametrize("wavelength", [0.5, 2.0, 8.0, 20.0, 50.0, 100.0])
def test_sines_pass_by_the_gain_without_phase(kind, wavelength):
    gain, quadrature = filtered_amplitudes(kind, wavelength)
    assert_allclose(gain, kind.gain(wavelength, spacing=STEP), rtol=0, atol=DECAYED)
    assert_allclose(quadrature, 0, rtol=0, atol=DECAYED)


def test_forward_and_backward_together_pass_half_of_the_power_at_the_cut_off():
    for order in (1, 2, 3, 6):
        for kind in (Butterworth(shortest=8.0, order=order), Butterworth(longest=8, order=order)):
            assert_allclose(kind.gain(8.0), np.sqrt(0.5), rtol=0, atol=EXACT)
            assert_allclose(kind.gain(8.0, spacing=1.0), np.sqrt(0.5), rtol=0, atol=EXACT)
        one_octave = np.array([4.0, 2.0])
        far = Butterworth(shortest=100.0, order=order).gain(one_octave)
        decibel = 20 * np.log10(far[0] / far[1])
        # [dB] 12 per octave and order far beyond the cut-off
        assert_allclose(decibel, 12.04 * order, rtol=0, atol=0.05 * order)


def test_the_moving_average_is_that_of_straight_lines():
    station = np.cumsum(np.random.default_rng(1).uniform(0.02, 0.2, 400))
    height = np.random.default_rng(2).standard_normal(400)
    out = filter_profile(make_profile(station, height), MovingAverage(shortest=1.3)).height
    for at in (40, 200, 333):
        ends = station[at] + np.array([-0.65, 0.65])
        nodes = np.union1d(station[abs(station - station[at]) < 0.65], ends)
        truth = np.trapezoid(np.interp(nodes, station, height), nodes) / 1.3
        assert_allclose(out[at], truth, rtol=0, atol=1e-12)  # [m] rounding


def test_the_250_mm_filter_weights_samples_by_their_part_in_the_window():
    """At 50 mm it ends at midpoints of steps: samples 2 steps off count 7/8, 3 steps off 1/8."""
    height = np.random.default_rng(3).standard_normal(500) * 1e-3
    smooth = filter_profile(make_profile(0.05 * np.arange(500), height), FILTER_250_MM).height
    weights = np.array([1, 7, 8, 8, 8, 7, 1]) / 40
    assert_allclose(smooth[3:-3], np.convolve(height, weights, "valid"), rtol=0, atol=EXACT)


@pytest.mark.parametrize("kind", [LOW, HIGH, BAND, MEAN, MEANS])
@given(offset=st.floats(-1000, 1000), grade=st.floats(-0.1, 0.1))
def test_grades_pass_low_passes_and_are_removed_by_high_passes(kind, offset, grade):
    s = S[:2001]
    out = filter_profile(make_profile(s, offset + grade * s), kind).height
    truth = offset + grade * s if kind.longest is None else 0 * s
    assert_allclose(out, truth, rtol=0, atol=1e-8)  # [m] rounding of 1000 m, summed over windows


@pytest.mark.parametrize("kind", [LOW, MEAN])
def test_ends_stay_where_they_are(kind):
    height = np.cumsum(np.random.default_rng(4).standard_normal(2001)) * 1e-3
    out = filter_profile(make_profile(S[:2001], height), kind).height.values
    # [m] a point reflection about the last sample has that sample as its mean
    assert_allclose(out[[0, -1]], height[[0, -1]], rtol=0, atol=1e-4)


def test_low_and_high_pass_of_a_moving_average_add_up_to_the_profile():
    height = np.cumsum(np.random.default_rng(5).standard_normal(2001)) * 1e-3
    profile = make_profile(S[:2001], height)
    low = filter_profile(profile, MovingAverage(shortest=10.0)).height
    high = filter_profile(profile, MovingAverage(longest=10.0)).height
    assert_allclose(low + high, height, rtol=0, atol=EXACT)


def test_reversing_the_road_reverses_the_result():
    height = np.cumsum(np.random.default_rng(6).standard_normal(3000)) * 1e-3
    for kind in (BAND, MEANS):
        forward = filter_profile(make_profile(S[:3000], height), kind).height.values
        backward = filter_profile(make_profile(S[:3000], height[::-1]), kind).height.values
        # [m] a Butterworth filter is applied to one reflected end before the other
        assert_allclose(backward[::-1], forward, rtol=0, atol=1e-5)


def test_tracks_positions_and_history_are_kept():
    height = np.random.default_rng(7).standard_normal((2, 3001))
    profile = make_profile(
        S[:3001],
        height,
        tracks=["left", "right"],
        crs="EPSG:32632",
        easting=height + 5,
        northing=height - 5,
        sd=abs(height),
    )
    out = filter_profile(profile, BAND)
    assert list(out.track.values) == ["left", "right"]
    assert out.crs == "EPSG:32632"
    assert_allclose(out.easting, profile.easting, rtol=0, atol=0)
    assert "sd" not in out
    assert provenance_steps(out)[-1]["parameters"]["by"]["kind"] == "Butterworth"
    alone = filter_profile(make_profile(S[:3001], height[1]), BAND)
    assert_allclose(out.height[1], alone.height, rtol=0, atol=0)


def test_a_profile_shorter_than_the_filter_is_refused():
    profile = make_profile(S[:500], 0 * S[:500])
    for kind in (BAND, MovingAverage(longest=60.0)):
        with pytest.raises(CoverageError, match=r"is shorter than the filter: 49\.9 m"):
            filter_profile(profile, kind)


def test_missing_heights_and_unequal_spacing_are_refused():
    height = np.where(np.arange(3001) == 70, np.nan, 0.0)
    with pytest.raises(CoverageError, match="s = 7 m: has no finite height"):
        filter_profile(make_profile(S[:3001], height), BAND)
    s = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 3000))
    with pytest.raises(SchemaError, match="must be equally spaced for a Butterworth filter"):
        filter_profile(make_profile(s, 0 * s), BAND)
    assert filter_profile(make_profile(s, 0 * s), MEANS).height.shape == (3000,)


def test_waves_that_samples_cannot_show_are_refused():
    profile = make_profile(S[:3001], 0 * S[:3001])
    with pytest.raises(ValueError, match=r"shortest must be more than two spacings of 0\.1 m"):
        filter_profile(profile, Butterworth(shortest=0.2))


@pytest.mark.parametrize("kind", [Butterworth, MovingAverage])
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "one of shortest and longest must be given"),
        ({"shortest": -1.0}, "shortest must be finite and greater than 0 m"),
        ({"longest": np.inf}, "longest must be finite and greater than 0 m"),
        ({"shortest": 90.0, "longest": 8.0}, "shortest must be less than longest"),
    ],
)
def test_filters_are_checked(kind, settings, message):
    with pytest.raises(ValueError, match=message):
        kind(**settings)


@pytest.mark.parametrize("order", [0, 1.5, True])
def test_orders_are_whole(order):
    with pytest.raises(ValueError, match="order must be a whole number"):
        Butterworth(shortest=1.0, order=order)
