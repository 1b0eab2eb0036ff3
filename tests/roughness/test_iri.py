"""IRI against a published program and the frequency response; invariances; windows; errors."""

import json

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import IRI_SPEED, IriSettings, QuarterCar, continuous_iri, iri
from trueterrain.roughness._drive import drive_profile, step_response
from trueterrain.roughness._kernels import mean_of_lines

EXACT = 1e-9  # [m/km] rounding only
PRINTED = 1e-6  # [m/km] the published values are quoted with 6 decimals
OTHER_PROGRAM = 1e-7  # [m/km] rounding of the other program, whose exp(20 t) reaches 1e40 in 100 m
SINE = 3e-4  # [1] relative: mean over samples instead of the integral, at 10 mm

PLAIN = IriSettings(window="none", start="0.5s")


def rough(n, seed=1):
    """Heights of a random walk, about as rough as a gravel road [m]."""
    return np.cumsum(np.random.default_rng(seed).standard_normal(n)) * 1e-3


def unequal(n, spacing, seed=2):
    return np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, n) * spacing)


# Independent programs and the frequency response


@pytest.mark.parametrize("length", [20, 100])
def test_published_program_on_equal_spacing(data, length):
    folder = data / "profiles" / "michalsorel_iri"
    station, height = np.loadtxt(folder / "profile_1.txt").T
    start, end, truth, _ = np.loadtxt(folder / f"iri_precise_profile_1_seg{length}.txt").T
    index = iri(make_profile(station, height), settings=PLAIN, segment=length)
    assert not index.complete[-1]  # 544 m: that program leaves the rest out
    whole = index.sel(segment=index.complete.values)
    assert_allclose(whole.segment_iri[0], truth, rtol=0, atol=OTHER_PROGRAM)
    assert_allclose(whole.start, start, rtol=0, atol=EXACT)
    assert_allclose(whole.end, end, rtol=0, atol=EXACT)


@pytest.mark.parametrize("length", [20, 100])
def test_published_program_on_unequal_spacing(data, length):
    """That program smooths this profile, and overwrites samples while it averages them."""
    folder = data / "profiles" / "michalsorel_iri"
    station, height = np.loadtxt(folder / "profile_2.txt").T
    for i, here in enumerate(station):
        height[i] = height[abs(station - here) <= 0.125].mean()
    truth = np.loadtxt(folder / f"iri_precise_profile_2_seg{length}.txt")[:, 2]
    index = iri(make_profile(station, height), settings=PLAIN, segment=length)
    assert_allclose(index.segment_iri[0, : truth.size], truth, rtol=0, atol=OTHER_PROGRAM)


def test_quoted_values():
    """Values quoted from two public programs, to the digits that they print."""
    s = np.linspace(0, 160, 2099)
    height = 0.02 * np.sin(2 * np.pi * s / 60)
    index = iri(make_profile(np.arange(2099) / 13, height))  # its author gave 1/13 m as spacing
    assert_allclose(index.iri, 0.1315, rtol=0, atol=0.00005)  # [m/km] 4 digits; it printed 0.13


def sayers(height, step, base_length=0.25):
    """Sayers's algorithm: window, start, recursion, mean of all values [m/km]."""
    A, B, C = QuarterCar().matrices()
    dt = step / IRI_SPEED
    S = expm(A * dt)
    p = np.linalg.solve(A, (S - np.eye(4)) @ B)
    base = max(int(base_length / step + 0.5), 1)
    lead = min(int(11 / step + 0.5) + 1, height.size)
    slope = (height[lead - 1] - height[0]) / (step * lead)
    x = np.array([slope, 0.0, slope, 0.0])
    travel = []
    for slope in (height[base:] - height[:-base]) / (base * step):
        x = S @ x + p * slope
        travel.append(abs(C @ x))
    return 1000 * np.mean(travel)


@pytest.mark.parametrize("step", [0.01, 0.025, 0.0635, 0.1, 0.1524, 0.25, 0.3])
@pytest.mark.parametrize("length", [5.0, 150.0])
def test_the_default_is_sayerss_program(step, length):
    """0.1 m is a tie of nint(0.25 / step); 5 m is shorter than the 11 m of the start."""
    height = rough(int(length / step))
    station = 478.0 + step * np.arange(height.size)
    truth = sayers(height, step)
    assert_allclose(iri(make_profile(station, height)).iri, truth, rtol=0, atol=1e-8)  # [m/km]


@pytest.mark.parametrize(
    ("window", "attenuated"),
    [("none", False), ("sayers", True), ("centred", True), ("exact", True)],
)
@pytest.mark.parametrize("wavelength", [60, 30, 15, 10, 5, 3, 2.4, 2, 1.3])
def test_sine_has_the_index_of_its_frequency_response(wavelength, window, attenuated):
    """IRI = (2/pi) abs(H) slope amplitude, times sinc(0.25 / wavelength) with a window."""
    amplitude = 0.001  # [m]
    periods = int(np.ceil(400 / wavelength))
    transient = periods * wavelength  # [m] the car's slowest motion has decayed to exp(-46)
    s = np.arange(0, 2 * transient + 1, 0.01)
    profile = make_profile(s, amplitude * np.sin(2 * np.pi * s / wavelength))
    index = iri(profile, settings=IriSettings(window=window), segment=transient)
    truth = 2000 / np.pi * QuarterCar().gain(wavelength) * 2 * np.pi * amplitude / wavelength
    if attenuated:
        truth *= np.sinc(0.25 / wavelength)
    if window == "exact":  # averages the straight lines between the samples, which are flatter
        truth *= np.sinc(0.01 / wavelength) ** 2
    assert_allclose(index.segment_iri[0, 1] / truth, 1, rtol=0, atol=SINE)


def test_unequal_steps_against_one_matrix_exponential_each():
    s, height = unequal(300, 0.2), rough(300)
    A, B, C = QuarterCar().matrices()
    x, travel = np.zeros(4), []
    for dx, slope in zip(np.diff(s), np.diff(height) / np.diff(s), strict=True):
        S = expm(A * dx / IRI_SPEED)
        x = S @ x + np.linalg.solve(A, (S - np.eye(4)) @ B) * slope
        travel.append(abs(C @ x) * dx)
    truth = 1000 * sum(travel) / np.ptp(s)
    index = iri(make_profile(s, height), settings=IriSettings(window="none", start="level"))
    assert_allclose(index.iri, truth, rtol=0, atol=EXACT)


@pytest.mark.parametrize("car", [QuarterCar(damping=60.0), QuarterCar(mass_ratio=3.0)])
def test_other_cars_on_long_unequal_steps(car):
    """Steps of many of the car's time constants are divided until the series converges."""
    settings = IriSettings(window="none", start="level", car=car, max_spacing=20.0)
    s = np.array([0.0, 3.0, 10.0, 30.0])
    drive = drive_profile(s, np.array([0.0, 0.1, 0.0, 0.2]), settings)
    x, truth = np.zeros(4), []
    for dx, slope in zip(np.diff(s), np.diff(drive.height) / np.diff(s), strict=True):
        S, p = car.transition(dx)
        x = S @ x + p * slope
        truth.append(x[2] - x[0])
    assert_allclose(step_response(drive), truth, rtol=0, atol=1e-12)  # [m/m] rounding


# Invariances


def test_samples_on_a_straight_line_change_nothing():
    """A sample at the midpoint of some steps makes the spacing unequal, but not the profile."""
    s, height = 0.25 * np.arange(400), rough(400)
    midpoints = (0.5 * (s[1:] + s[:-1]))[::3]
    finer = np.sort(np.concatenate([s, midpoints]))
    coarse = step_response(drive_profile(s, height, PLAIN))
    fine = step_response(drive_profile(finer, np.interp(finer, s, height), PLAIN))
    at_samples = np.isin(finer[1:], s[1:])
    assert_allclose(fine[at_samples], coarse, rtol=0, atol=1e-12)  # [m/m] rounding


def test_a_segment_end_between_samples_is_a_sample_on_the_straight_line():
    s, height = 0.3 * np.arange(400), rough(400)
    finer = np.union1d(s, [25.0, 50.0, 75.0, 100.0])
    coarse = iri(make_profile(s, height), settings=PLAIN, segment=25.0)
    fine = iri(make_profile(finer, np.interp(finer, s, height)), settings=PLAIN, segment=25.0)
    assert_allclose(coarse.segment_iri, fine.segment_iri, rtol=0, atol=EXACT)
    no_segments = iri(make_profile(s, height), settings=PLAIN)
    assert_allclose(coarse.iri, no_segments.iri, rtol=0, atol=EXACT)


def test_segment_ends_do_not_change_the_whole_on_unequal_spacing():
    profile = make_profile(unequal(500, 0.2), rough(500))
    divided = iri(profile, settings=PLAIN, segment=7.0)
    assert_allclose(divided.iri, iri(profile, settings=PLAIN).iri, rtol=0, atol=EXACT)


def test_the_weighted_mean_of_segments_is_the_index_of_the_whole():
    s = 100.0 + 0.05 * np.arange(21_001)
    index = iri(make_profile(s, rough(s.size)), settings=IriSettings(window="none"), segment=100.0)
    assert list(index.complete.values) == [True] * 10 + [False]
    weighted = (index.segment_iri * (index.end - index.start)).sum() / np.ptp(s)
    assert_allclose(weighted, index.iri[0], rtol=0, atol=EXACT)


def test_segments_may_be_as_short_as_the_steps():
    s, height = 0.25 * np.arange(200), rough(200)
    index = iri(make_profile(s, height), settings=PLAIN, segment=0.25)
    truth = 1000 * abs(step_response(drive_profile(s, height, PLAIN)))
    assert_allclose(index.segment_iri[0], truth, rtol=0, atol=EXACT)


@pytest.mark.parametrize("window", ["sayers", "exact", "none"])
@given(offset=st.floats(-1000, 1000), grade=st.floats(-0.1, 0.1), factor=st.floats(-5, 5))
def test_offset_and_grade_change_nothing_and_a_factor_scales_the_index(
    window, offset, grade, factor
):
    """With the start of 0.5 s: that of the program has a wrong slope on a grade."""
    settings = IriSettings(window=window, start="0.5s")
    s, height = 0.05 * np.arange(1000), rough(1000)
    profile = make_profile(s, offset + grade * s + factor * height)
    truth = abs(factor) * iri(make_profile(s, height), settings=settings).iri
    # [m/km] heights of 1000 m are rounded to 1e-13 m, slopes over 0.05 m to 4e-12
    assert_allclose(iri(profile, settings=settings).iri, truth, rtol=0, atol=1e-7)


def test_a_grade_has_an_index_of_zero():
    s = 0.1 * np.arange(5000)
    index = iri(make_profile(s, 0.06 * s), settings=IriSettings(start="0.5s"))
    assert_allclose(index.iri, 0, rtol=0, atol=EXACT)


def test_the_centred_window_bends_a_grade_at_the_ends_only():
    """It has samples on one side only there, as in the original program."""
    s = 0.05 * np.arange(10_001)
    settings = IriSettings(window="centred", start="0.5s")
    index = iri(make_profile(s, 0.06 * s), settings=settings, segment=100.0)
    assert index.segment_iri[0, 0] > 0.01
    assert_allclose(index.segment_iri[0, 3], 0, rtol=0, atol=EXACT)


def test_the_programs_start_is_short_by_one_sample():
    """11 m hold 110 steps of 0.1 m; the program divides by 111, which excites the car."""
    s = 0.1 * np.arange(5000)
    index = iri(make_profile(s, 0.06 * s), segment=100.0)
    assert index.segment_iri[0, 0] > 0.01
    assert_allclose(index.segment_iri[0, -1], 0, rtol=0, atol=EXACT)
    drive = drive_profile(s, 0.06 * s, IriSettings())
    assert_allclose(drive.slope, 0.06 * 110 / 111, rtol=0, atol=1e-12)  # [m/m] rounding


def test_tracks_are_rated_independently_of_their_order():
    s = 0.1 * np.arange(1000)
    heights = [rough(s.size, seed) for seed in range(3)]
    profile = make_profile(s, heights, tracks=["a", "b", "c"])
    in_order = iri(profile, segment=30.0)
    permuted = iri(profile.isel(track=[2, 0, 1]), segment=30.0)
    xr.testing.assert_identical(in_order.sel(track=["c", "a", "b"]), permuted)
    for name, height in zip("abc", heights, strict=True):
        alone = iri(make_profile(s, height), segment=30.0)
        assert_allclose(in_order.iri.sel(track=name), alone.iri[0], rtol=0, atol=0)


def test_rounded_stations_still_count_as_equally_spaced():
    """Stations off by 0.1 % of a step: the index moves by less than one part in 10,000."""
    height = rough(4000)
    s = 0.05 * np.arange(height.size)
    jitter = np.random.default_rng(3).uniform(-5e-5, 5e-5, s.size)
    jitter[[0, -1]] = 0
    truth = iri(make_profile(s, height)).iri
    rounded = iri(make_profile(s + 0.99 * jitter, height))
    assert_allclose(rounded.iri, truth, rtol=0, atol=0)
    unequal_spacing = iri(
        make_profile(s + 0.99 * jitter, height),
        settings=IriSettings(window="none", start="0.5s", spacing_tolerance=0.0),
    )
    assert_allclose(
        unequal_spacing.iri / iri(make_profile(s, height), settings=PLAIN).iri, 1, rtol=0, atol=1e-4
    )


def test_100_km_do_not_overflow():
    s = 0.05 * np.arange(2_000_001)
    index = iri(make_profile(s, 0.001 * np.sin(2 * np.pi * s / 10)), segment=1000.0)
    truth = 2000 / np.pi * QuarterCar().gain(10.0) * 2 * np.pi * 0.001 / 10 * np.sinc(0.025)
    # the mean of 200 samples per wave differs from its integral by less than 2e-4
    assert_allclose(index.segment_iri[0, 1:-1] / truth, 1, rtol=0, atol=1e-3)
    assert_allclose(index.iri / truth, 1, rtol=0, atol=1e-3)


def test_long_profiles_of_unequal_spacing_do_not_overflow():
    s = unequal(200_000, 0.2)
    profile = make_profile(s, 0.001 * np.sin(2 * np.pi * s / 15))
    index = iri(profile, settings=PLAIN, segment=1500.0)
    truth = 2000 / np.pi * QuarterCar().gain(15.0) * 2 * np.pi * 0.001 / 15
    # chords of up to 0.3 m flatten a wave of 15 m by (pi 0.2 / 15)^2 / 6 and cut its crests
    assert_allclose(index.segment_iri[0, 1:-1] / truth, 1, rtol=0, atol=5e-3)


# Windows


def test_mean_of_lines_on_unequal_spacing():
    s, height = unequal(200, 0.05), rough(200)
    first = 10
    out = np.empty(150)
    mean_of_lines(s, height, 0.25, first, out)
    truth = []
    for here in s[first : first + out.size]:
        nodes = np.union1d(s[abs(s - here) < 0.125], [here - 0.125, here + 0.125])
        truth.append(np.trapezoid(np.interp(nodes, s, height), nodes) / 0.25)
    assert_allclose(out, truth, rtol=0, atol=1e-12)  # [m] rounding


def test_centred_window_is_the_mean_of_the_samples_in_it():
    s, height = unequal(300, 0.05), rough(300)
    truth = [height[abs(s - here) <= 0.125].mean() for here in s]
    drive = drive_profile(s, height, IriSettings(window="centred"))
    assert_allclose(drive.height, truth, rtol=0, atol=1e-12)  # [m] rounding


def test_centred_window_includes_both_ends():
    """At 25 mm, 11 samples lie within 125 mm, whatever the rounding of the stations."""
    s, height = 478.0 + 0.025 * np.arange(200), rough(200)
    drive = drive_profile(s, height, IriSettings(window="centred"))
    truth = np.convolve(height, np.full(11, 1 / 11), mode="valid")
    assert_allclose(drive.height[5:-5], truth, rtol=0, atol=1e-12)  # [m] rounding


def test_centred_window_leaves_wide_spacing_alone():
    s, height = 0.25 * np.arange(200), rough(200)
    drive = drive_profile(s, height, IriSettings(window="centred"))
    assert_allclose(drive.height, height, rtol=0, atol=0)


@pytest.mark.parametrize("window", ["centred", "exact"])
def test_windows_of_unequal_spacing_smooth_like_those_of_equal_spacing(window):
    """A wave of 1 m sampled every 10 mm, with a tenth of the samples lost at random."""
    s = 0.01 * np.arange(50_001)
    kept = np.random.default_rng(4).random(s.size) > 0.1
    height = 0.001 * np.sin(2 * np.pi * s)
    settings = IriSettings(window=window, start="0.5s")
    whole = iri(make_profile(s, height), settings=settings)
    part = iri(make_profile(s[kept], height[kept]), settings=settings)
    assert_allclose(part.iri / whole.iri, 1, rtol=0, atol=5e-3)  # [1] chords of two or three steps


# Segments, wheel paths, sliding windows


def test_restart_rates_each_segment_as_a_profile_of_its_own():
    s, height = 478.0 + 0.25 * np.arange(250), rough(250)
    index = iri(make_profile(s, height), settings=IriSettings(restart=True), segment=20.0)
    for at, value in enumerate(index.segment_iri.values[0]):
        cut = slice(80 * at, 80 * at + 81)
        alone = iri(make_profile(s[cut], height[cut]))
        assert_allclose(value, alone.iri[0], rtol=0, atol=EXACT)
    assert_allclose(index.iri, iri(make_profile(s, height)).iri, rtol=0, atol=EXACT)


def test_restart_changes_short_segments():
    profile = make_profile(0.25 * np.arange(401), rough(401))
    one_drive = iri(profile, segment=20.0).segment_iri
    restarted = iri(profile, settings=IriSettings(restart=True), segment=20.0).segment_iri
    assert abs(one_drive - restarted)[0, 1:].min() > 1e-3


def test_a_last_segment_without_a_step_is_dropped():
    """The Sayers window removes 4 of 5 steps at the end, more than the last 0.1 m has."""
    s = 0.05 * np.arange(403)
    index = iri(make_profile(s, rough(s.size)), segment=10.0)
    assert index.sizes["segment"] == 2
    assert index.complete.all()
    restarted = iri(
        make_profile(s, rough(s.size)), settings=IriSettings(restart=True), segment=10.0
    )
    assert restarted.sizes["segment"] == 2


def test_mri_is_the_mean_of_the_indices_and_hri_the_index_of_the_mean():
    s = 0.1 * np.arange(1500)
    left, right = rough(s.size, 5), rough(s.size, 6)
    index = iri(make_profile(s, [left, right], tracks=["one", "two"]), segment=50.0)
    assert_allclose(index.mri, index.iri.mean(), rtol=0, atol=EXACT)
    assert_allclose(index.segment_mri, index.segment_iri.mean("track"), rtol=0, atol=EXACT)
    mean = iri(make_profile(s, 0.5 * (left + right)), segment=50.0)
    assert_allclose(index.hri, mean.iri[0], rtol=0, atol=EXACT)
    assert_allclose(index.segment_hri, mean.segment_iri[0], rtol=0, atol=EXACT)
    assert index.hri < index.mri


def test_wheel_paths_among_three_tracks():
    s = 0.1 * np.arange(500)
    heights = [rough(s.size, seed) for seed in range(3)]
    named = make_profile(s, heights, tracks=["Left", "centre", "RIGHT"])
    index = iri(named)
    assert_allclose(index.mri, index.iri[[0, 2]].mean(), rtol=0, atol=EXACT)
    unnamed = make_profile(s, heights, tracks=["a", "b", "c"])
    assert np.isnan(iri(unnamed).mri)
    chosen = iri(unnamed, wheel_paths=["c", "b"])
    assert_allclose(chosen.mri, chosen.iri[[1, 2]].mean(), rtol=0, atol=EXACT)


def test_one_track_has_neither_mri_nor_hri():
    index = iri(make_profile(0.1 * np.arange(500), rough(500)))
    assert list(index.track.values) == ["profile"]
    assert np.isnan(index.mri)
    assert np.isnan(index.hri)


@pytest.mark.parametrize("settings", [IriSettings(), PLAIN, IriSettings(window="exact")])
def test_sliding_windows_agree_with_segments(settings):
    s = 478.0 + 0.25 * np.arange(2000)
    profile = make_profile(s, [rough(s.size, 7), rough(s.size, 8)], tracks=["left", "right"])
    index = iri(profile, settings=settings, segment=20.0).isel(segment=slice(1, -1))
    sliding = continuous_iri(profile, 20.0, settings=settings)
    at = [int(abs(sliding.start.values - start).argmin()) for start in index.start.values]
    same = sliding.isel(s=at)
    assert_allclose(same.iri, index.segment_iri, rtol=0, atol=EXACT)
    assert_allclose(same.s, 0.5 * (index.start + index.end), rtol=0, atol=EXACT)


def test_a_sliding_window_as_long_as_the_profile_is_the_whole():
    s, height = unequal(300, 0.2), rough(300)
    sliding = continuous_iri(make_profile(s, height), np.ptp(s), settings=PLAIN)
    assert sliding.sizes["s"] == 1
    whole = iri(make_profile(s, height), settings=PLAIN).iri
    assert_allclose(sliding.iri[0], whole, rtol=0, atol=EXACT)


def test_sliding_windows_take_the_step_asked_for():
    sliding = continuous_iri(make_profile(0.25 * np.arange(401), rough(401)), 10.0, step=3.0)
    assert_allclose(np.diff(sliding.start), 3.0, rtol=0, atol=EXACT)
    assert sliding.end[-1] <= 100.0


def test_conventions_are_recorded_in_the_provenance():
    index = iri(make_profile(0.25 * np.arange(401), rough(401)), settings=PLAIN, segment=20.0)
    step = provenance_steps(index)[-1]
    assert step["step"] == "iri"
    assert step["parameters"]["options"]["window"] == "none"
    assert step["parameters"]["options"]["car"]["mass_ratio"] == 0.15
    assert step["parameters"]["segment"] == 20.0
    assert index.iri.attrs["units"] == "m/km"
    json.dumps(provenance_steps(index))


# Errors


def test_missing_heights_are_named():
    heights = np.zeros((2, 100))
    heights[1, 40:43] = np.nan
    profile = make_profile(0.25 * np.arange(100), heights, tracks=["left", "right"])
    with pytest.raises(CoverageError, match=r"track right, s = 10 m: .*3 of 100.*Fill the gap"):
        iri(profile)
    with pytest.raises(CoverageError, match="track right"):
        continuous_iri(profile, 5.0)


@pytest.mark.parametrize("window", ["sayers", "centred", "exact", "none"])
def test_profiles_that_are_too_short(window):
    settings = IriSettings(window=window)
    with pytest.raises(CoverageError, match="axis s: is too short"):
        iri(make_profile([0.0], [0.0]), settings=settings)
    if window in ("sayers", "exact"):
        with pytest.raises(CoverageError, match=r"5 samples over 0\.2 m"):
            iri(make_profile(0.05 * np.arange(5), np.zeros(5)), settings=settings)


def test_the_programs_window_needs_equal_spacing():
    profile = make_profile(unequal(200, 0.1), rough(200))
    with pytest.raises(SchemaError, match=r"equally spaced.*Choose the window exact"):
        iri(profile)


def test_stations_must_ascend():
    profile = make_profile([0.0, 1.0, 2.0], [0.0, 0.0, 0.0])
    with pytest.raises(SchemaError, match="must ascend"):
        iri(profile.isel(s=[0, 2, 1]))


def test_only_profiles_are_rated():
    with pytest.raises(SchemaError, match="axis s: is missing"):
        iri(xr.Dataset())


@pytest.mark.parametrize("segment", [0.0, -1.0, np.nan, 0.01])
def test_segments_must_hold_a_step(segment):
    with pytest.raises(ValueError, match=r"at least the spacing 0.1 m"):
        iri(make_profile(0.1 * np.arange(100), rough(100)), segment=segment)


@pytest.mark.parametrize("names", [["a"], ["a", "a"], ["a", "c"]])
def test_wheel_paths_must_be_two_of_the_tracks(names):
    profile = make_profile(0.1 * np.arange(100), np.zeros((2, 100)), tracks=["a", "b"])
    with pytest.raises(ValueError, match="wheel_paths must name two of the tracks a, b"):
        iri(profile, wheel_paths=names)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"window": "box"}, "window must be one of sayers"),
        ({"start": "11 m"}, "start must be one of 11m"),
        ({"window_length": 0.0}, "window_length must be finite"),
        ({"speed": -1.0}, "speed must be finite"),
        ({"spacing_tolerance": -1.0}, "spacing_tolerance must be within"),
    ],
)
def test_settings_are_checked(settings, message):
    with pytest.raises(ValueError, match=message):
        IriSettings(**settings)


def test_sliding_windows_are_checked():
    profile = make_profile(0.25 * np.arange(101), rough(101))
    with pytest.raises(CoverageError, match="shorter than the window"):
        continuous_iri(profile, 25.1, settings=PLAIN)
    with pytest.raises(ValueError, match="length must be finite"):
        continuous_iri(profile, 0.0)
    with pytest.raises(ValueError, match="step must be finite"):
        continuous_iri(profile, 5.0, step=-1.0)
    with pytest.raises(ValueError, match="restart must be false"):
        continuous_iri(profile, 5.0, settings=IriSettings(restart=True))
