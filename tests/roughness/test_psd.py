"""Spectra and ISO 8608: published limits, generated roads, coverage of the intervals."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import welch

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import CLASS_LIMITS, N0, PsdSettings, psd, road_class, smoothing_bands
from trueterrain.roughness._spectrum import smooth_bands
from trueterrain.simulate.ground import Road

EXACT = 1e-12  # [1] relative: rounding
REPEATS = 400  # of roads: an rms about 1 has a standard error of 3.5 %


def gaussian_road(rng, count, step, gd_n0, waviness):
    """Random heights [m] of an exact power-law spectrum, by a Fourier series four times as long.

    It has no code in common with the plane waves of `trueterrain.simulate`.
    """
    total = 4 * count
    n = np.fft.rfftfreq(total, step)
    density = np.zeros(n.size)
    density[1:] = gd_n0 * (n[1:] / 0.1) ** -waviness
    amplitude = np.sqrt(density * total / step) / 2
    wave = amplitude * (rng.standard_normal(n.size) + 1j * rng.standard_normal(n.size))
    return np.fft.irfft(wave, total)[:count]


def rough_line(count):
    return np.random.default_rng(9).standard_normal(count)


# Classes and bands


def test_class_limits_are_the_published_ones():
    """Geometric means 16 * 4^k and limits 32, 128 ... 131072, all in 1e-6 m³."""
    upper = [32, 128, 512, 2048, 8192, 32768, 131072]
    mean = [16, 64, 256, 1024, 4096, 16384, 65536, 262144]
    assert list(CLASS_LIMITS) == list("ABCDEFGH")
    assert_allclose([1e6 * row[1] for row in CLASS_LIMITS.values()], mean, rtol=EXACT, atol=0)
    assert_allclose([1e6 * row[2] for row in list(CLASS_LIMITS.values())[:-1]], upper, rtol=EXACT)
    assert_allclose([1e6 * row[0] for row in list(CLASS_LIMITS.values())[1:]], upper, rtol=EXACT)
    assert CLASS_LIMITS["A"][0] == 0.0
    assert CLASS_LIMITS["H"][2] == np.inf


def test_classes_change_at_their_limits():
    for name, (lower, mean, upper) in CLASS_LIMITS.items():
        assert road_class(mean) == name
        assert road_class(max(lower, 1e-12)) == name
        assert road_class(np.nextafter(upper, 0)) == name
    assert road_class([[16e-6, np.nan]]).tolist() == [["A", ""]]
    with pytest.raises(ValueError, match="must not be less than 0"):
        road_class(-1.0)


def test_classes_are_those_of_the_simulated_roads():
    for name in "ABCDEFGH":
        assert road_class(Road(road_class=name).gd(N0)) == name


def test_bands_are_those_printed_with_exact_edges():
    """Printed edges and centres, which are rounded: 0.0014 and 0.0028 by up to 1.4 %."""
    bands = smoothing_bands()
    for centre, lower, upper in (
        (0.0020, 0.0014, 0.0028),
        (0.0313, 0.0221, 0.0442),
        (0.0496, 0.0442, 0.0557),
        (0.2500, 0.2227, 0.2806),
        (0.2806, 0.2726, 0.2888),
        (2.8284, 2.7479, 2.9113),
    ):
        at = abs(bands.centre - centre).argmin()
        found = [bands.centre[at], bands.lower[at], bands.upper[at]]
        assert_allclose(found, [centre, lower, upper], rtol=0, atol=5.1e-5)  # [1/m] 4 decimals
    assert_allclose(bands.lower * bands.upper, bands.centre**2, rtol=EXACT, atol=0)
    octaves = np.log2(bands.upper / bands.lower)
    assert_allclose(octaves, [1] * 5 + [1 / 3] * 8 + [1 / 12] * 59, rtol=0, atol=EXACT)
    assert_allclose(bands.centre[-1], 8.0, rtol=EXACT, atol=0)


def test_smoothing_is_the_sum_of_the_standard():
    """Lines nL to nH of width Be in a band nl to nh, those at its edges by the fraction inside."""
    rng = np.random.default_rng(1)
    Be, G = 0.0017, np.append(np.nan, rng.uniform(1, 2, 2000))  # line 0 is not used
    bands = smoothing_bands()
    bands = bands[(bands.lower > 2 * Be) & (bands.upper < 2000 * Be)]
    truth = []
    for nl, nh in zip(bands.lower, bands.upper, strict=True):
        nL, nH = int(nl / Be + 0.5), int(nh / Be + 0.5)
        total = ((nL + 0.5) * Be - nl) * G[nL] + (nh - (nH - 0.5) * Be) * G[nH]
        total += sum(G[j] * Be for j in range(nL + 1, nH))
        truth.append(total / (nh - nl))
    assert_allclose(
        smooth_bands(G[1:], Be, bands), truth, rtol=1e-11, atol=0
    )  # differences of a sum


# Spectra


@pytest.mark.parametrize(("count", "step", "block"), [(4000, 0.1, 100.0), (4096, 0.05, 51.2)])
def test_spectrum_is_welchs(count, step, block):
    height = np.cumsum(np.random.default_rng(2).standard_normal(count)) * 1e-3
    settings = PsdSettings(block=block, lowest=0.05)
    data = psd(make_profile(step * np.arange(count), height), settings=settings)
    size = round(block / step)
    n, truth = welch(height, 1 / step, "hann", size, size // 2, detrend="linear")
    assert_allclose(data.n, n[1:], rtol=EXACT, atol=0)
    assert_allclose(data.density[0], truth[1:], rtol=1e-9, atol=0)


def test_a_sine_keeps_its_variance():
    s = 0.1 * np.arange(20_000)
    data = psd(make_profile(s, 0.01 * np.sin(2 * np.pi * s / 7.3) + 1e-9 * rough_line(s.size)))
    variance = float(data.density.sum() * (data.n[1] - data.n[0]))
    assert_allclose(variance / (0.01**2 / 2), 1, rtol=0, atol=1e-2)  # [1] 273.97 waves, tapered


def test_height_and_grade_change_nothing():
    s = 0.1 * np.arange(8000)
    height = np.cumsum(rough_line(s.size)) * 1e-3
    plain = psd(make_profile(s, height))
    moved = psd(make_profile(s, height + 321.0 + 0.07 * s))
    assert_allclose(moved.smoothed / plain.smoothed, 1, rtol=0, atol=1e-6)  # [1] steep at 10 m³
    assert_allclose(moved.waviness, plain.waviness, rtol=0, atol=1e-6)


# Generated roads


@pytest.mark.parametrize(
    ("name", "waviness"), [("A", 2.0), ("B", 1.6), ("C", 2.0), ("D", 2.5), ("E", 2.0), ("H", 3.0)]
)
def test_simulated_roads_are_recovered_within_their_intervals(name, waviness):
    gd = CLASS_LIMITS[name][1]
    s = 0.05 * np.arange(20_000)  # fine enough for all waves of the road, up to 10 cycles/m
    road = Road(gd_n0=gd, waviness=waviness, seed=ord(name), lowest=0.005)
    along = make_profile(s, road.height(0.8 * s, 0.6 * s))  # isotropic
    rated = psd(along, settings=PsdSettings(confidence=0.99))
    assert rated.gd_n0_low < gd < rated.gd_n0_high
    assert rated.waviness_low < waviness < rated.waviness_high
    assert rated.waviness_high - rated.waviness_low < 0.3
    assert rated.road_class.item() == name


@pytest.mark.slow
@pytest.mark.parametrize("length", [150.0, 1500.0])
def test_intervals_have_their_stated_coverage(length):
    """Roads of another generator: errors over their sd have an rms of 1, no bias."""
    rng = np.random.default_rng(3)
    gd, w, count = 64e-6, 2.0, round(length / 0.1)
    heights = [gaussian_road(rng, count, 0.1, gd, w) for _ in range(REPEATS)]
    names = [f"{number}" for number in range(REPEATS)]
    rated = psd(make_profile(0.1 * np.arange(count), heights, tracks=names))
    sides = 2 * 1.96  # standard deviations from end to end of an interval of 95 %
    z_gd = np.log(rated.gd_n0 / gd) / (np.log(rated.gd_n0_high / rated.gd_n0_low) / sides)
    z_w = (rated.waviness - w) / ((rated.waviness_high - rated.waviness_low) / sides)
    for z in (z_gd, z_w):
        assert 0.9 < np.sqrt((z**2).mean()) < 1.1
        assert abs(z.mean()) < 0.2  # of a standard deviation; four standard errors
    truth = gd * (rated.centre / N0) ** -w
    inside = (rated.smoothed_low < truth) & (truth < rated.smoothed_high)
    assert 0.94 < inside[:, rated.fitted.values].mean() < 0.97


def test_waviness_can_be_assumed():
    s = 0.1 * np.arange(10_000)
    height = gaussian_road(np.random.default_rng(4), s.size, 0.1, 64e-6, 2.0)
    free = psd(make_profile(s, height))
    fixed = psd(make_profile(s, height), settings=PsdSettings(waviness=2.0))
    assert fixed.waviness == fixed.waviness_low == fixed.waviness_high == 2.0
    assert fixed.gd_n0_low < 64e-6 < fixed.gd_n0_high
    width = np.log(fixed.gd_n0_high / fixed.gd_n0_low)
    assert width < np.log(free.gd_n0_high / free.gd_n0_low)


def test_a_road_that_is_no_power_law_widens_its_intervals():
    s = 0.1 * np.arange(10_000)
    height = gaussian_road(np.random.default_rng(5), s.size, 0.1, 64e-6, 2.0)
    joints = psd(make_profile(s, height + 0.02 * ((s % 5.0) < 0.3)))
    plain = psd(make_profile(s, height))
    assert joints.waviness_high - joints.waviness_low > 2 * (
        plain.waviness_high - plain.waviness_low
    )


def test_segments_are_rated_on_their_own():
    rng = np.random.default_rng(6)
    step, count = 0.1, 5000
    height = [gaussian_road(rng, count, step, gd, 2.0) for gd in (16e-6, 256e-6)]
    joined = np.concatenate([height[0], height[1] - height[1][0] + height[0][-1], np.zeros(100)])
    s = 30.0 + step * np.arange(joined.size)
    rated = psd(make_profile(s, joined), segment=500.0)
    assert rated.segment_road_class.values[0, :2].tolist() == ["A", "C"]
    alone = psd(make_profile(s[:5001], joined[:5001]))
    assert_allclose(rated.segment_gd_n0[0, 0], alone.gd_n0[0], rtol=EXACT, atol=0)
    assert list(rated.complete.values) == [True, True, False]
    assert np.isnan(rated.segment_gd_n0[0, 2])  # 10 m: no band is resolved
    assert rated.segment_road_class[0, 2] == ""


def test_tracks_are_rated_alone_and_settings_are_recorded():
    rng = np.random.default_rng(7)
    heights = np.array([gaussian_road(rng, 5000, 0.1, gd, 2.0) for gd in (16e-6, 1e-3)])
    s = 0.1 * np.arange(5000)
    both = psd(make_profile(s, heights, tracks=["left", "right"]))
    assert both.road_class.values.tolist() == ["A", "D"]
    alone = psd(make_profile(s, heights[1]))
    assert_allclose(both.gd_n0.sel(track="right"), alone.gd_n0[0], rtol=0, atol=0)
    assert provenance_steps(both)[-1]["parameters"]["options"]["block"] == 1000.0
    assert both.density.attrs["units"] == "m3"


# Errors


def test_bad_profiles_are_refused():
    s = 0.1 * np.arange(3000)
    with pytest.raises(CoverageError, match=r"s = 10 m: has no finite height"):
        psd(make_profile(s, np.where(np.arange(3000) == 100, np.nan, 0.0)))
    with pytest.raises(SchemaError, match="must be equally spaced for a spectrum"):
        psd(make_profile(s**1.1, s))
    with pytest.raises(CoverageError, match=r"has 0 bands .* 3 are needed: 3\.9 m in"):
        psd(make_profile(s[:40], rough_line(40)))
    with pytest.raises(CoverageError, match="is flat: its spectrum is 0"):
        psd(make_profile(s, 0 * s))
    with pytest.raises(CoverageError, match=r"segment from 0 to 3 m: has 0 bands"):
        psd(make_profile(s, rough_line(3000)), segment=3.0)
    with pytest.raises(SchemaError, match="must be equally spaced for a spectrum, got one"):
        psd(make_profile([0.0], [0.0]))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"block": 0.0}, "block must be finite and greater than 0 m"),
        ({"lowest": -1.0}, "lowest must be finite and greater than 0 1/m"),
        ({"lowest": 3.0}, "lowest must be less than highest"),
        ({"waviness": np.nan}, "waviness must be finite"),
        ({"confidence": 1.0}, "confidence must be between 0 and 1"),
    ],
)
def test_settings_are_checked(settings, message):
    with pytest.raises(ValueError, match=message):
        PsdSettings(**settings)
