"""Figures of roughness: drawn values equal the given ones."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain import figures, roughness
from trueterrain.core.schemas import make_profile

S = 0.1 * np.arange(4000)


@pytest.fixture(autouse=True)
def _closed_figures():
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def two():
    height = np.cumsum(np.random.default_rng(1).standard_normal((2, S.size)), axis=1) * 1e-3
    height[0] += 0.03 * np.exp(-((S - 200) ** 2))
    return make_profile(S, height, tracks=["left", "right"])


def legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_spectrum_shows_bands_fit_and_classes(two):
    data = roughness.psd(two)
    ax = figures.road_spectrum(data)
    drawn = [line.get_ydata() for line in ax.lines]
    for track in range(2):
        assert any(np.array_equal(line, data.smoothed[track]) for line in drawn)
    assert len(ax.collections) == 2  # confidence
    left = data.isel(track=0)
    gd = f"Gd(n0) {1e6 * left.gd_n0.item():.3g}·10⁻⁶ m³"
    assert legend(ax)[0] == f"left: class {left.road_class.item()}, {gd}, w {left.waviness:.2f}"
    limits = [line for line in ax.lines if line.get_color() == "0.6"]
    at_n0 = [np.exp(np.interp(np.log(0.1), *np.log(line.get_data()))) for line in limits]
    truth = [upper for _, _, upper in roughness.CLASS_LIMITS.values()][:-1]
    assert_allclose(at_n0, truth, rtol=1e-9, atol=0)
    letters = [text.get_text() for text in ax.texts if len(text.get_text()) == 1]
    assert set(letters) <= set("ABCDEFGH")
    assert len(letters) >= 4


def test_long_spectra_are_thinned():
    s = 0.02 * np.arange(200_000)
    height = np.cumsum(np.random.default_rng(2).standard_normal(s.size)) * 1e-3
    ax = figures.road_spectrum(roughness.psd(make_profile(s, height)))
    assert max(line.get_xdata().size for line in ax.lines) <= 2000


def test_ride_number_is_drawn_from_0_to_5(two):
    rated = roughness.ride_number(two, segment=100.0)
    ax = figures.ride_number_segments(rated)
    assert ax.get_ylim() == (0.0, 5.0)
    steps = [patch.get_data() for patch in ax.patches]
    assert_allclose(steps[1].values, rated.segment_rn[1], rtol=0, atol=0)
    assert_allclose(steps[1].edges, [0, 100, 200, 300, 399.9], rtol=0, atol=1e-9)
    assert legend(ax)[0] == f"left, whole {rated.rn.values[0]:.2f}"
    with pytest.raises(ValueError, match="rated must hold segments"):
        figures.ride_number_segments(roughness.ride_number(two))


def test_histogram_has_a_bar_for_each_track_and_class(two):
    histogram = roughness.iri_histogram(roughness.iri(two, segment=20.0), [2.0, 4.0])
    ax = figures.roughness_histogram(histogram)
    heights = [[bar.get_height() for bar in bars] for bars in ax.containers]
    assert_allclose(heights, 100 * histogram.fraction, rtol=0, atol=1e-9)
    assert legend(ax) == ["left", "right"]


def test_sliding_windows_are_shaded_where_too_rough(two):
    sliding = roughness.continuous_iri(two, 7.62)
    ax = figures.continuous_roughness(sliding, threshold=6.0)
    worst = sliding.iri.max("track")
    assert legend(ax) == ["left", "right", "above 6 m/km"]
    shaded = sum(patch.get_width() for patch in ax.patches)
    truth = 0.1 * float((worst > 6.0).sum())
    assert_allclose(shaded, truth, rtol=0, atol=0.1 * len(ax.patches))
    assert figures.continuous_roughness(sliding).get_ylabel() == "IRI [m/km]"
    whole = roughness.continuous_iri(two, 399.0, step=1.0)
    figures.continuous_roughness(whole)  # one window only


def test_deviations_are_drawn_with_rings_beyond_the_threshold(two):
    beam = roughness.rolling_straightedge(two, 3.0)
    ax = figures.straightedge_deviation(beam, threshold=0.015)
    assert legend(ax) == ["left", "right", "beyond 15 mm"]
    assert ax.get_ylabel() == "Ground above it [mm]"
    for line, track in zip(ax.lines, beam.deviation, strict=False):
        assert_allclose(line.get_ydata(), track, rtol=0, atol=0)
    found = roughness.find_stretches(abs(beam.deviation), 0.015)
    (rings,) = [line for line in ax.lines if line.get_label() == "beyond 15 mm"]
    assert_allclose(rings.get_xdata(), found.peak_at, rtol=0, atol=0)
    assert_allclose(abs(rings.get_ydata()), found.peak, rtol=0, atol=0)
    limits = [line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "--"]
    assert limits == [-0.015, 0.015]
    low, high = ax.get_ylim()
    assert (low, high) == (-high, high)
    assert any("3 m on two wheels" in text.get_text() for text in ax.texts)


def test_nothing_beyond_the_threshold_has_no_rings():
    flat = make_profile(S, 0 * S)
    ax = figures.straightedge_deviation(roughness.rolling_straightedge(flat), threshold=0.004)
    assert ax.get_legend() is None
    assert ax.get_ylim()[1] > 0.004
    figures.straightedge_deviation(roughness.rolling_straightedge(flat))  # nor a height to scale by


def test_bands_of_wavelength_are_steps_in_their_colours(two):
    rated = roughness.waveband_rms(two, segment=100.0)
    ax = figures.waveband_segments(rated)
    assert legend(ax) == [
        f"{band}, {track}" for band in ("short", "medium", "long") for track in ("left", "right")
    ]
    drawn = {patch.get_label(): patch for patch in ax.patches}
    for band in rated.band.values:
        pair = [drawn[f"{band}, {track}"] for track in ("left", "right")]
        assert pair[0].get_edgecolor() == pair[1].get_edgecolor()
        assert pair[0].get_linestyle() != pair[1].get_linestyle()
    steps = drawn["long, right"].get_data()
    truth = rated.segment_rms.sel(band="long", track="right")
    assert_allclose(steps.values, truth, rtol=0, atol=0)
    assert_allclose(steps.edges, [0, 100, 200, 300, 399.9], rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="rated must hold segments"):
        figures.waveband_segments(roughness.waveband_rms(two))
