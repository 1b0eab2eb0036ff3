"""Agreement of profiles by cross-correlation: analytic ratings, shifts, distance, bad input."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import ASSUMED, make_points, make_profile
from trueterrain.formats import open as open_file
from trueterrain.roughness import IriSettings, QuarterCar
from trueterrain.roughness.agreement import (
    AIRFIELD_FILTER,
    AgreementLimits,
    AgreementSettings,
    check_limits,
    filtered_profiles,
    profile_agreement,
)
from trueterrain.roughness.filters import MovingAverage

ROUND_OFF = 1e-12  # [1] of sums of products
WITHIN = 1e-3  # [m] required accuracy of a shift
FINE = 2e-5  # [m] accuracy of a shift of noiseless profiles at spacings up to 100 mm
TRANSIENT = 5e-4  # [1] of a rating: transient of the car that remains after 30 m
AS_HEIGHTS = AgreementSettings(filter=None, max_scale=0)

WAVES = np.random.default_rng(5)
LENGTHS = np.exp(WAVES.uniform(np.log(0.8), np.log(50.0), 150))  # [m]
PHASES = WAVES.uniform(0, 2 * np.pi, LENGTHS.size)


def road(x):
    """Height of a road defined at any station [m]: waves of 0.8 to 50 m of equal slope."""
    return 1e-4 * np.sum(
        LENGTHS[:, None] * np.sin(2 * np.pi * x / LENGTHS[:, None] + PHASES[:, None]), axis=0
    )


def pair(first, second, **settings):
    found = profile_agreement({"A": first, "B": second}, settings=AgreementSettings(**settings))
    return found.sel(first="A", second="B").squeeze("track")


def test_identical_profiles_agree_fully_without_a_shift():
    s = np.arange(0.0, 200.0, 0.05)
    found = pair(make_profile(s, road(s)), make_profile(s, road(s)))
    assert_allclose(found.rating, 1.0, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.corrected_rating, 1.0, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.best_shift, 0.0, rtol=0, atol=1e-9)
    assert_allclose(found.distance_error, 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("spacing", [0.025, 0.1])
@pytest.mark.parametrize("shift", [0.0004, 0.0137, -0.361, 7.8104])
def test_shifted_profiles_agree_fully_and_the_shift_is_found(spacing, shift):
    s = np.arange(0.0, 200.0, spacing)
    found = pair(make_profile(s, road(s)), make_profile(s, road(s - shift)), max_scale=0)
    assert_allclose(found.rating, 1.0, rtol=0, atol=TRANSIENT)
    assert_allclose(found.best_shift, shift, rtol=0, atol=FINE)


def test_a_shift_is_found_within_a_millimetre_at_the_coarsest_spacing_in_use():
    s = np.arange(0.0, 200.0, 0.25)
    found = pair(make_profile(s, road(s)), make_profile(s, road(s - 0.361)))
    assert_allclose(found.best_shift, 0.361, rtol=0, atol=WITHIN)
    assert_allclose(found.rating, 1.0, rtol=0, atol=2 * TRANSIENT)


@pytest.mark.parametrize("window", ["exact", "centred", "none"])
def test_profilers_of_different_spacing_are_not_shifted(window):
    fine, coarse = np.arange(0.0, 200.0, 0.025), np.arange(0.0, 200.0, 0.1)
    by = IriSettings(window=window)
    found = pair(make_profile(fine, road(fine)), make_profile(coarse, road(coarse)), filter=by)
    # the profile is straight between samples 100 mm apart, which flattens its shortest waves
    assert found.rating > 0.98
    assert_allclose(found.best_shift, 0.0, rtol=0, atol=WITHIN)


def test_the_window_of_the_program_is_referred_to_its_centre():
    """Otherwise profiles of 25 mm and 125 mm, both with 0.25 m windows, would be 56 mm apart."""
    fine, coarse = np.arange(0.0, 200.0, 0.025), np.arange(0.0, 200.0, 0.125)
    by = IriSettings(window="sayers")
    found = pair(make_profile(fine, road(fine)), make_profile(coarse, road(coarse)), filter=by)
    assert_allclose(found.best_shift, 0.0, rtol=0, atol=WITHIN)


def test_unequal_spacing_is_no_obstacle():
    s = np.arange(0.0, 200.0, 0.05)
    jittered = s + np.random.default_rng(3).uniform(-0.02, 0.02, s.size)
    found = pair(make_profile(s, road(s)), make_profile(jittered, road(jittered - 0.5)))
    assert_allclose(found.best_shift, 0.5, rtol=0, atol=WITHIN)
    assert_allclose(found.rating, 1.0, rtol=0, atol=2 * TRANSIENT)


@pytest.mark.parametrize("gain", [0.8, 1.0, 1.25, 3.0])
@pytest.mark.parametrize("by", [IriSettings(window="exact"), AIRFIELD_FILTER, None])
def test_a_scaled_profile_is_rated_as_its_scale(gain, by):
    """Q = k P: covariance k, variances 1 and k², so the rating is k / max(1, k²) = min(k, 1/k)."""
    s = np.arange(0.0, 300.0, 0.1)
    found = pair(make_profile(s, road(s)), make_profile(s, gain * road(s)), filter=by, max_scale=0)
    assert_allclose(found.rating, min(gain, 1 / gain), rtol=0, atol=ROUND_OFF)
    assert_allclose(found.correlation, 1.0, rtol=0, atol=ROUND_OFF)
    assert_allclose(found.sd_ratio, gain, rtol=0, atol=1e-9)


@pytest.mark.filterwarnings("ignore:.*rougher than roads")  # white noise on 1 m samples is steep
@pytest.mark.parametrize("ratio", [0.05, 0.3, 1.0])
def test_a_noisy_profile_is_rated_as_its_noise(ratio):
    """Q = P + N, N independent of P, with r times its variance.

    The covariance is var P, the larger variance (1 + r) var P: the rating is 1 / (1 + r). P and N
    are white, so that of n samples the sample value has the standard deviation
    sqrt(2 r + ...) / ((1 + r) sqrt(n)), below 1 / sqrt(n).
    """
    n = 40_000
    rng = np.random.default_rng(7)
    ground = rng.standard_normal(n)
    noisy = ground + np.sqrt(ratio) * rng.standard_normal(n)
    s = 1.0 * np.arange(n)
    found = pair(
        make_profile(s, ground), make_profile(s, noisy), filter=None, max_scale=0, max_shift=5
    )
    assert_allclose(found.rating, 1 / (1 + ratio), rtol=0, atol=4 / np.sqrt(n))
    assert_allclose(found.correlation, 1 / np.sqrt(1 + ratio), rtol=0, atol=4 / np.sqrt(n))
    assert_allclose(found.best_shift, 0.0, rtol=0, atol=0.05)


def test_a_disturbing_wave_is_rated_as_the_response_of_the_car():
    """P and N are sines of different lengths: their filtered variances follow from the gain.

    Slope amplitude 2 pi a / l, times the gain of car and window, is the filtered amplitude; over
    whole waves of both they are uncorrelated, and the rating is that of noise.
    """
    s = np.arange(0.0, 660.0, 0.02)
    lengths, heights = np.array([15.0, 6.0]), np.array([0.010, 0.002])
    ground, wave = (a * np.sin(2 * np.pi * s / x) for a, x in zip(heights, lengths, strict=True))
    found = pair(
        make_profile(s, ground),
        make_profile(s, ground + wave),
        max_scale=0,
        max_shift=0.01,
        transient=60.0,
    )
    gains = QuarterCar().gain(lengths) * np.sinc(0.25 / lengths)
    amplitudes = gains * 2 * np.pi * heights / lengths
    ratio = (amplitudes[1] / amplitudes[0]) ** 2
    assert 0.05 < ratio < 0.5
    assert_allclose(found.rating, 1 / (1 + ratio), rtol=0, atol=1e-3)


def test_a_profile_upside_down_is_rated_below_zero():
    s = np.arange(0.0, 100.0, 0.1)
    found = pair(make_profile(s, road(s)), make_profile(s, -road(s)), max_shift=0.0, max_scale=0)
    assert_allclose(found.rating, -1.0, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("error", [2e-4, -0.003])
def test_the_error_of_the_distance_is_found_and_corrected(error):
    s = np.arange(0.0, 900.0, 0.05)
    ground, measured = make_profile(s, road(s)), make_profile(s, road((s - 0.4) / (1 + error)))
    found = profile_agreement({"R": ground, "A": measured}, reference="R")
    there = found.sel(first="R", second="A").squeeze("track")
    assert there.rating < 0.997
    assert_allclose(there.corrected_rating, 1.0, rtol=0, atol=TRANSIENT)
    assert_allclose(there.distance_error, error, rtol=0, atol=1e-6)  # 1 mm in 1 km
    # at the first station after the 30 m of the car's transient
    at = 30.0
    assert_allclose(there.corrected_shift, 0.4 + error * at, rtol=0, atol=WITHIN)
    back = found.sel(first="A", second="R").squeeze("track")
    assert_allclose(back.distance_error, 1 / (1 + error) - 1, rtol=0, atol=1e-6)
    assert_allclose(back.best_shift, -there.best_shift, rtol=0, atol=ROUND_OFF)
    assert_allclose(back.corrected_shift, (at - 0.4) / (1 + error) - at, rtol=0, atol=WITHIN)


def test_scores_are_means_over_pairs_of_repeats_and_over_the_reference():
    s = np.arange(0.0, 150.0, 0.1)
    gains = {"R": 1.0, "1": 0.9, "2": 0.8, "3": 1.1}
    runs = {name: make_profile(s, gain * road(s)) for name, gain in gains.items()}
    found = profile_agreement(runs, reference="R")
    assert_allclose(found.accuracy, np.mean([0.9, 0.8, 1 / 1.1]), rtol=0, atol=1e-9)
    pairs = [0.8 / 0.9, 0.9 / 1.1, 0.8 / 1.1]
    assert_allclose(found.repeatability, np.mean(pairs), rtol=0, atol=1e-9)
    assert_allclose(found.corrected_repeatability, np.mean(pairs), rtol=0, atol=1e-9)
    matrix = found.rating.sel(track="profile").values
    assert_allclose(matrix, matrix.T, rtol=0, atol=0)
    assert_allclose(np.diag(matrix), 1.0, rtol=0, atol=0)
    assert found.attrs["reference"] == "R"
    assert "agreement" in found.attrs["provenance"]


def test_wheel_paths_are_rated_each_by_itself():
    s = np.arange(0.0, 120.0, 0.1)
    left, right = road(s), road(s + 400)
    both = make_profile(s, [left, right], tracks=["left", "right"])
    other = make_profile(s, [left, 0.5 * right], tracks=["left", "right"])
    found = profile_agreement({"A": both, "B": other})
    assert_allclose(found.repeatability, [1.0, 0.5], rtol=0, atol=1e-9)
    shown = filtered_profiles({"A": both, "B": other}, track="right")
    assert_allclose(shown.filtered[1], 0.5 * shown.filtered[0], rtol=0, atol=1e-12)
    with pytest.raises(ValueError, match="track must be one of left, right, got None"):
        filtered_profiles({"A": both, "B": other})


def test_filtered_profiles_lie_on_each_other_at_their_best_shift():
    s = np.arange(0.0, 300.0, 0.05)
    late = make_profile(s, road((s - 0.3) / 1.002))
    runs = {"A": late, "R": make_profile(s, road(s))}
    shown = filtered_profiles(runs, reference="R", correct_distance=True)
    assert list(shown.profile.values) == ["R", "A"]
    inside = np.isfinite(shown.filtered[1])
    apart = (shown.filtered[1] - shown.filtered[0]).values[inside]
    assert np.sqrt(np.mean(apart**2)) < 0.02 * float(shown.filtered[0].std())
    assert_allclose(shown.scale[1], 0.002, rtol=0, atol=1e-5)


def test_even_and_odd_samples_of_a_measured_profile_agree(data):
    """They stand for the same road by two coarse profilers."""
    whole = open_file(data / "profiles" / "michalsorel_iri" / "profile_1.txt")
    del whole.attrs[ASSUMED]  # its numbers are metres
    even = whole.isel(s=slice(0, None, 2))
    odd = whole.isel(s=slice(1, None, 2))
    found = pair(even, odd)
    assert found.rating > 0.9
    assert_allclose(found.best_shift, 0.0, rtol=0, atol=0.05)  # 1/10 of the spacing of 0.5 m


def test_starts_are_aligned_on_demand():
    s = np.arange(0.0, 100.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(s + 5000.0, road(s))}
    with pytest.raises(
        CoverageError, match=r"A and B: overlap by less than 20 m .* Count stations"
    ):
        profile_agreement(runs)
    found = profile_agreement(runs, settings=AgreementSettings(align_starts=True))
    assert_allclose(found.repeatability, 1.0, rtol=0, atol=1e-9)


def test_a_profile_shorter_than_the_filter_needs_is_refused():
    s, short = np.arange(0.0, 100.0, 0.1), np.arange(0.0, 35.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(short, road(short))}
    with pytest.raises(CoverageError, match=r"^B: is 34.9 m long, which must be at least 50 m: 30"):
        profile_agreement(runs)
    with pytest.raises(CoverageError, match="which must be at least 200 m: 180 m"):
        profile_agreement(runs, settings=AgreementSettings(filter=AIRFIELD_FILTER))


def test_a_missing_height_is_named():
    s = np.arange(0.0, 100.0, 0.1)
    gap = road(s)
    gap[321:330] = np.nan
    with pytest.raises(CoverageError, match=r"^B: track profile, s = 32.1 m: has no finite height"):
        profile_agreement({"A": make_profile(s, road(s)), "B": make_profile(s, gap)})


@pytest.mark.parametrize("by", [IriSettings(), AIRFIELD_FILTER])
def test_unequal_spacing_is_refused_by_filters_that_need_it_equal(by):
    s = np.arange(0.0, 250.0, 0.1)
    jittered = s + np.random.default_rng(3).uniform(-0.02, 0.02, s.size)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(jittered, road(jittered))}
    with pytest.raises(SchemaError, match=r"^B: axis s: must be equally spaced"):
        profile_agreement(runs, settings=AgreementSettings(filter=by))
    smooth = AgreementSettings(filter=MovingAverage(shortest=0.5))  # needs no equal spacing
    assert profile_agreement(runs, settings=smooth).repeatability > 0.999


def test_heights_in_feet_are_flagged():
    s = np.arange(0.0, 100.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(s, road(s) / 0.3048)}
    with pytest.warns(UserWarning, match="B is 3.281 times as high as A: are its heights in feet"):
        found = profile_agreement(runs)
    assert len(found.attrs["flags"]) == 1


def test_stations_in_feet_are_flagged():
    s = np.arange(0.0, 300.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(s / 0.3048, road(s))}
    with pytest.warns(UserWarning, match="B is 983.9.* are the stations of B in feet"):
        profile_agreement(runs, settings=AgreementSettings(max_scale=0))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_heights_in_millimetres_are_flagged():
    s = np.arange(0.0, 100.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(s, 1000 * road(s))}
    flags = profile_agreement(runs).attrs["flags"]
    assert any("B: climbs" in flag for flag in flags)
    assert flags[-1] == "B is 1000 times as high as A: are its heights in millimetres?"


def test_different_lengths_are_flagged():
    s, short = np.arange(0.0, 200.0, 0.1), np.arange(0.0, 120.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(short, road(short))}
    with pytest.warns(UserWarning, match="A is 199.9 m long, B 119.9 m: only the 89.[0-9]+ m"):
        found = profile_agreement(runs)
    assert_allclose(found.repeatability, 1.0, rtol=0, atol=1e-6)


def test_a_search_that_ends_at_its_limit_is_flagged():
    s = np.arange(0.0, 200.0, 0.1)
    runs = {"A": make_profile(s, road(s)), "B": make_profile(s, road(s - 1.3))}
    with pytest.warns(UserWarning, match="is at the end of the search"):
        profile_agreement(runs, settings=AgreementSettings(max_shift=1.3, max_scale=0))


def test_a_periodic_road_is_flagged():
    """A wave of 5 m, 1 m late: 6 m, -4 m and -9 m are as good."""
    s = np.arange(0.0, 200.0, 0.1)
    wave = [0.01 * np.sin(2 * np.pi * (s - late) / 5) for late in (0.0, 1.0)]
    runs = {"A": make_profile(s, wave[0]), "B": make_profile(s, wave[1])}
    with pytest.warns(UserWarning, match="is rated nearly as well as .* the road repeats itself"):
        profile_agreement(runs)
    near = profile_agreement(runs, settings=AgreementSettings(max_shift=2.0))
    assert_allclose(near.best_shift.sel(first="A", second="B"), 1.0, rtol=0, atol=WITHIN)


def test_a_flat_profile_is_refused():
    s = np.arange(0.0, 100.0, 0.1)
    with pytest.raises(CoverageError, match=r"^B: is flat"):
        profile_agreement({"A": make_profile(s, road(s)), "B": make_profile(s, 0 * s)})


def test_tracks_must_be_the_same():
    s = np.arange(0.0, 100.0, 0.1)
    two = make_profile(s, [road(s), road(s)], tracks=["left", "right"])
    with pytest.raises(SchemaError, match=r"^B: has the tracks left, right, but A has profile"):
        profile_agreement({"A": make_profile(s, road(s)), "B": two})


def test_bad_arguments_are_refused():
    s = np.arange(0.0, 100.0, 0.1)
    one = make_profile(s, road(s))
    with pytest.raises(ValueError, match="two or more, got 1"):
        profile_agreement({"A": one})
    with pytest.raises(ValueError, match="reference must be one of A, B, got 'C'"):
        profile_agreement({"A": one, "B": one}, reference="C")
    with pytest.raises(SchemaError, match=r"^B: "):
        profile_agreement({"A": one, "B": make_points([0.0], [0.0], [0.0])})
    for name, value in (("max_scale", 0.2), ("step", 0), ("min_overlap", -1), ("transient", -1)):
        with pytest.raises(ValueError, match=name):
            AgreementSettings(**{name: value})


def test_checks_give_the_reason_if_they_cannot_be_made():
    s = np.arange(0.0, 100.0, 0.1)
    runs = {"1": make_profile(s, road(s)), "2": make_profile(s, 0.91 * road(s))}
    alone = {check.name: check for check in check_limits(profile_agreement(runs))}
    assert alone["repeatability"].passed is False
    assert (alone["repeatability"].limit, alone["repeatability"].reason) == (0.92, "")
    assert (alone["accuracy"].passed, alone["accuracy"].reason) == (None, "no reference is given")
    found = profile_agreement(runs, reference="1")
    limits = AgreementLimits(accuracy=0.9, distance_error=1e-3)
    checks = {check.name: check for check in check_limits(found, limits=limits)}
    assert checks["accuracy"].passed is True
    assert checks["repeatability"].reason == "there are less than two repeats"
    assert checks["distance error"].passed is True
    assert checks["bias"].reason == "no errors of heights are given"
    without_scale = profile_agreement(runs, reference="1", settings=AgreementSettings(max_scale=0))
    checks = {check.name: check for check in check_limits(without_scale, limits=limits)}
    assert checks["distance error"].reason == "the distance error was not searched"
    checks = {
        check.name: check for check in check_limits(found, limits=AgreementLimits(accuracy=0))
    }
    assert (checks["accuracy"].limit, checks["accuracy"].passed) == (None, None)
    assert checks["accuracy"].reason == "no limit is given"
    with pytest.raises(ValueError, match="bias must be finite and greater than 0"):
        AgreementLimits(bias=0)


def test_results_do_not_depend_on_the_order_of_profiles():
    s = np.arange(0.0, 100.0, 0.1)
    runs = {name: make_profile(s, road(s) + 1e-3 * np.sin(i * s)) for i, name in enumerate("ABC")}
    found = profile_agreement(runs, reference="B")
    reversed_order = profile_agreement(dict(reversed(runs.items())), reference="B")
    assert_allclose(reversed_order.accuracy, found.accuracy, rtol=0, atol=ROUND_OFF)
    assert_allclose(reversed_order.repeatability, found.repeatability, rtol=0, atol=ROUND_OFF)
