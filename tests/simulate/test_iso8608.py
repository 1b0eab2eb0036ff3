"""Random roads against the spectrum and the coherence that they are made for."""

from itertools import pairwise

import numpy as np
import numpy.testing as npt
import pytest
from scipy.integrate import quad
from scipy.signal import csd, welch
from scipy.special import k1

from trueterrain.simulate.ground import Road, track_coherence

BAND = (
    0.15  # [1] of the variance in a third octave: the lowest hold a hundred waves of random place
)
ESTIMATE = 0.15  # [1] of the variance in an octave of a road of 3.3 km: further scatter of Welch
COHERENCE = 0.03  # [1] of the waves themselves in a band of 0.25 decades: found up to 0.014
ESTIMATED_COHERENCE = 0.05  # [1] scatter of an estimate from four roads of 3.3 km
SPACING = 0.05  # [m]
TRACK = 1.5  # [m] between left and right wheel

x = np.arange(65536) * SPACING


def third_octaves(lowest: float, highest: float) -> np.ndarray:
    number = int(3 * np.log2(highest / lowest))
    return highest * 2.0 ** (np.arange(-number, 1) / 3)


def variance(road: Road, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Integral of the spectrum that was asked for [m^2]."""
    return np.array([quad(road.gd, a, b)[0] for a, b in zip(low, high, strict=True)])


@pytest.mark.parametrize(
    ("road_class", "gd"),
    [("A", 16e-6), ("B", 64e-6), ("C", 256e-6), ("D", 1024e-6), ("E", 4096e-6), ("H", 262144e-6)],
)
def test_classes_have_the_geometric_means_of_the_standard(road_class, gd):
    npt.assert_allclose(Road(road_class=road_class).gd(0.1), gd, rtol=1e-12, atol=0)


@pytest.mark.parametrize("waviness", [1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 2, 2.5])
def test_waves_have_the_spectrum_along_every_line(waviness, angle):
    """Along a line a wave of the wave vector k is one of the frequency of its component."""
    road = Road(gd_n0=1e-4, waviness=waviness, seed=6)
    amplitude, kx, ky, _ = road._waves.T
    n = np.abs(np.cos(angle) * kx + np.sin(angle) * ky)
    edges = third_octaves(road.lowest, road.highest)
    found = np.histogram(n, edges, weights=0.5 * amplitude**2)[0]
    ratio = found / variance(road, edges[:-1], edges[1:])
    npt.assert_allclose(ratio, 1.0, rtol=0, atol=BAND)
    npt.assert_allclose(ratio.mean(), 1.0, rtol=0, atol=BAND / np.sqrt(ratio.size))


def test_no_more_than_half_the_spectrum_at_the_lowest_frequency_remains_below_it():
    road = Road(road_class="C", lowest=0.1, highest=1.0)
    amplitude, kx, _, _ = road._waves.T
    below = np.abs(kx) < 0.01
    density = 0.5 * (amplitude[below] ** 2).sum() / 0.01
    # The integral of S(k) over k above `lowest`: half of Gd(lowest), less what `highest` cuts off.
    npt.assert_allclose(density, 0.5 * road.gd(0.1), rtol=2 * BAND, atol=0)


@pytest.mark.slow
@pytest.mark.parametrize("direction", [0.0, 0.9])
def test_heights_have_the_spectrum_and_gd_n0(direction):
    road = Road(road_class="B", seed=11)
    height = road.height(x * np.cos(direction), x * np.sin(direction))
    n, power = welch(height, 1 / SPACING, nperseg=4096)
    edges = 0.05 * 2.0 ** np.arange(8)
    bands = list(pairwise(edges))
    found = np.array([power[(n >= a) & (n < b)].mean() for a, b in bands])
    truth = np.array([road.gd(n[(n >= a) & (n < b)]).mean() for a, b in bands])
    npt.assert_allclose(found / truth, 1.0, rtol=0, atol=ESTIMATE)
    fitted = np.polyfit(np.log(0.5 * (edges[:-1] + edges[1:])), np.log(found), 1)
    npt.assert_allclose(fitted[0], -2.0, rtol=0, atol=0.05)  # [1] ESTIMATE over 7 octaves
    gd_n0 = np.exp(np.log(found / truth).mean()) * 64e-6
    npt.assert_allclose(gd_n0, 64e-6, rtol=0.05, atol=0)  # mean of seven bands


def test_variance_is_that_of_all_waves():
    """For a waviness of 2: pi / 2 times the part of the spectrum above `lowest`."""
    road = Road(road_class="A", lowest=0.05, highest=5.0, seed=2)
    ring = np.pi / 2 - np.arcsin(0.01)
    npt.assert_allclose(
        0.5 * (road._waves[:, 0] ** 2).sum(), ring * road.gd(0.05) * 0.05, rtol=1e-12, atol=0
    )


@pytest.mark.parametrize("seed", range(4))
def test_waves_make_tracks_cohere_as_the_isotropic_theory_says(seed):
    road = Road(road_class="C", seed=seed)
    amplitude, kx, ky, _ = road._waves.T
    cross = amplitude**2 * np.cos(2 * np.pi * ky * TRACK)
    for low, high in pairwise(np.geomspace(0.02, 1.0, 8)):
        band = (np.abs(kx) >= low) & (np.abs(kx) < high)
        n = np.linspace(low, high, 100)
        theory = np.average(track_coherence(n, TRACK), weights=road.gd(n))
        found = cross[band].sum() / (amplitude[band] ** 2).sum()
        npt.assert_allclose(found, theory, rtol=0, atol=COHERENCE)


@pytest.mark.slow
def test_tracks_cohere_as_the_isotropic_theory_says():
    edges = np.geomspace(0.02, 1.0, 8)
    both, alone = np.zeros(7), np.zeros(7)
    for seed in range(4):
        road = Road(road_class="C", seed=seed)
        left, right = road.height(x, TRACK), road.height(x, 0.0)
        n, cross = csd(left, right, 1 / SPACING, nperseg=4096)
        power = [welch(track, 1 / SPACING, nperseg=4096)[1] for track in (left, right)]
        both += np.histogram(n, edges, weights=cross.real)[0]
        alone += np.histogram(n, edges, weights=0.5 * (power[0] + power[1]))[0]
    weight = np.histogram(n, edges, weights=road.gd(np.maximum(n, n[1])))[0]
    theory = np.histogram(
        n, edges, weights=track_coherence(n, TRACK) * road.gd(np.maximum(n, n[1]))
    )
    npt.assert_allclose(both / alone, theory[0] / weight, rtol=0, atol=ESTIMATED_COHERENCE)


def test_track_coherence_is_the_integral_over_the_plane():
    """Cross-spectrum from its definition: the Fourier transform across of a 2-D power law."""
    n, distance = 0.2, 1.5
    for waviness in (2.0, 3.0):

        def density(m, power=0.5 * (waviness + 1)):
            return (n * n + m * m) ** -power

        cross = quad(density, 0, np.inf, weight="cos", wvar=2 * np.pi * distance)[0]
        theory = cross / quad(density, 0, np.inf)[0]
        npt.assert_allclose(
            track_coherence(n, distance, waviness=waviness), theory, rtol=0, atol=1e-7
        )
    argument = 2 * np.pi * n * distance
    npt.assert_allclose(track_coherence(n, distance), argument * k1(argument), rtol=1e-12, atol=0)


def test_tracks_at_zero_distance_are_equal():
    npt.assert_allclose(track_coherence([0.0, 0.1], 0.0), 1.0, rtol=0, atol=0)


def test_full_coherence_is_one_profile_with_the_spectrum():
    road = Road(road_class="C", coherence="full", direction=0.3, seed=1)
    across = np.array([-1.0, 0.0, 2.0])
    c, s = np.cos(0.3), np.sin(0.3)
    tracks = road.height(c * x[:500, None] - s * across, s * x[:500, None] + c * across)
    npt.assert_allclose(tracks, np.repeat(tracks[:, 1:2], 3, axis=1), rtol=0, atol=1e-9)
    amplitude, kx, ky, _ = road._waves.T
    edges = third_octaves(road.lowest, road.highest)
    found = np.histogram(np.hypot(kx, ky), edges, weights=0.5 * amplitude**2)[0]
    npt.assert_allclose(found / variance(road, edges[:-1], edges[1:]), 1.0, rtol=0, atol=BAND)
    total = 0.5 * (amplitude**2).sum()
    npt.assert_allclose(total, quad(road.gd, 0.01, 10.0, limit=200)[0], rtol=1e-6, atol=0)


def test_waviness_of_one_is_logarithmic():
    road = Road(gd_n0=1e-4, waviness=1.0, coherence="full")
    total = 0.5 * (road._waves[:, 0] ** 2).sum()
    npt.assert_allclose(total, 1e-4 * 0.1 * np.log(1000.0), rtol=1e-12, atol=0)


def test_the_cosine_is_the_library_cosine():
    road = Road(road_class="E", waves=50, seed=9)
    amplitude, kx, ky, phase = road._waves.T
    px, py = np.random.default_rng(3).uniform(-300.0, 300.0, (2, 200))
    turns = px[:, None] * kx + py[:, None] * ky + phase
    truth = (amplitude * np.cos(2 * np.pi * turns)).sum(axis=1)
    npt.assert_allclose(road.height(px, py), truth, rtol=0, atol=1e-11)  # [m] of round-off in turns


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"road_class": "A", "gd_n0": 1e-4},
        {"road_class": "Z"},
        {"gd_n0": -1.0},
        {"road_class": "A", "waviness": 9.0},
        {"road_class": "A", "lowest": 0.0},
        {"road_class": "A", "lowest": 20.0},
        {"road_class": "A", "coherence": "none"},
        {"road_class": "A", "waves": 0},
        {"road_class": "A", "direction": np.nan},
        {"road_class": "A", "seed": -3},
    ],
)
def test_bad_parameters_are_refused(parameters):
    with pytest.raises(ValueError, match="must"):
        Road(**parameters)
