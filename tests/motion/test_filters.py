"""Integration and complementary filters against closed-form results."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.motion import _complementary as filters
from trueterrain.motion._inertial import (
    InertialAccelerations,
    lever_height,
    observes_roll_and_pitch,
)
from trueterrain.motion._inputs import NavigationInput, SmoothedSeries, bridge_variance
from trueterrain.motion._noise import accelerometer_noise_density, fit_white_and_random_walk

RATE = 2000.0  # [Hz]
GAIN = 1e-4  # of double integration at 50 Hz; the trapezoid loses 4e-3 at 2 kHz, 1.6e-2 at 1 kHz


def oscillation(frequency, duration=4.0, apart=2, amplitude=1e-3):
    """Accelerations of a sine of 1 mm, and the sine at the knots."""
    fine = np.arange(round(duration * RATE) + 1) / RATE
    omega = 2 * np.pi * frequency
    acceleration = -amplitude * omega**2 * np.sin(omega * fine)[:, None] * np.ones(3)
    knot = np.arange(0, fine.size, apart)
    inertial = InertialAccelerations(
        sample_time=fine,
        acceleration=acceleration,
        knot_index=knot,
        weights=np.full((3, 3), 1 / 3),
        per_sensor=acceleration,
        missing_density=np.zeros((fine.size - 1, 3)),
        missing=np.zeros(fine.size, dtype=bool),
        centre=np.zeros(3),
        observes_attitude=True,
    )
    truth = amplitude * np.sin(omega * fine[knot])[:, None] * np.ones(3)
    return inertial, truth


@pytest.mark.parametrize("frequency", [0.5, 10.0, 50.0])
def test_double_integration_keeps_the_amplitude(frequency):
    inertial, truth = oscillation(frequency)
    value, rate = filters.integrate_acceleration(inertial, truth)
    assert_allclose(value, truth, rtol=0, atol=GAIN * 1e-3)
    omega = 2 * np.pi * frequency
    speed = 1e-3 * omega * np.cos(omega * inertial.time)[:, None] * np.ones(3)
    assert_allclose(rate, speed, rtol=0, atol=GAIN * 1e-3 * omega)


def test_integrals_of_a_cubic_are_exact():
    inertial, _ = oscillation(1.0, duration=0.1)
    t = inertial.sample_time[:, None]
    once, twice = inertial.integrals(t**3)
    k = inertial.time
    h = np.diff(k)
    inner = slice(1, -2)  # at the ends the series is extrapolated linearly
    assert_allclose(once[inner, 0], (np.diff(k**4) / 4)[inner], rtol=0, atol=1e-18)
    exact = np.diff(k**5) / 20 - h * k[:-1] ** 4 / 4
    assert_allclose(twice[inner, 0], exact[inner], rtol=0, atol=1e-18)


@pytest.mark.parametrize(("order", "gain"), [(1, 1.0), (2, 0.0), (3, 1.0), (4, 2**0.5), (6, 0.0)])
def test_causal_pair_at_its_crossover(order, gain):
    """Sum of low-pass and high-pass at 10 Hz, exact for analog filters."""
    inertial, truth = oscillation(10.0, duration=6.0)
    fused, _, _ = filters.causal_filter(inertial, truth, cutoff=10.0, order=order)
    decayed = inertial.time > 3.0
    found = np.sqrt(2) * np.std(fused[decayed, 0]) / 1e-3
    assert_allclose(found, gain, rtol=0, atol=2e-3)


@pytest.mark.parametrize("frequency", [1.0, 10.0, 30.0])
def test_zero_phase_pair_does_not_change_the_motion(frequency):
    inertial, truth = oscillation(frequency)
    for order in (2, 4):
        value, _ = filters.zero_phase(inertial, truth, cutoff=10.0, order=order)
        assert_allclose(value, truth, rtol=0, atol=GAIN * 1e-3)


def test_crossover_of_equal_noise():
    """50 ug/sqrt(Hz) and 1 mm white in 100 Hz: 0.35 Hz (reference)."""
    density = 50e-6 * 9.80665
    one = np.ones(3)
    spectra = filters.ErrorSpectra(
        white=1e-6 / 100 * one,
        random_walk=0 * one,
        acceleration=density**2 * one,
        bias_walk=0 * one,
    )
    assert_allclose(filters.crossover_frequency(spectra), 0.35, rtol=0, atol=0.005)


def test_wiener_filter_has_less_error_than_any_butterworth_filter():
    """White noise of both instruments: its error is the smallest, and as large as computed."""
    rng = np.random.default_rng(2)
    inertial, truth = oscillation(1.3, duration=30.0)
    density, white = 1e-3, 2e-3
    noisy = inertial.acceleration + density * np.sqrt(RATE / 2) * rng.standard_normal(
        inertial.acceleration.shape
    )
    inertial = InertialAccelerations(**{**vars(inertial), "acceleration": noisy})
    navigation = truth + white * rng.standard_normal(truth.shape)
    one = np.ones(3)
    spectra = filters.ErrorSpectra(
        white=2 * white**2 / 1000.0 * one,
        random_walk=0 * one,
        acceleration=density**2 * one,
        bias_walk=0 * one,
    )
    error = np.std(filters.wiener_filter(inertial, navigation, spectra)[0] - truth)
    for cutoff in (0.2, 0.5, 1.0, 3.0, 10.0):
        other, _ = filters.zero_phase(inertial, navigation, cutoff=cutoff, order=2)
        assert error < np.std(other - truth)
    frequency = np.geomspace(0.01, 500.0, 2000)
    variance = filters.filter_variance(
        spectra, filters.low_pass_gain(spectra, frequency), frequency
    )
    assert 0.8 < error / np.sqrt(variance[0]) < 1.2  # 30 s at 0.5 Hz, three series: sd 0.08


def test_noise_of_a_series_without_drift():
    noise = 3e-4 * np.random.default_rng(1).standard_normal(4000)
    white, random_walk = fit_white_and_random_walk(noise, 200.0)
    assert_allclose(white, 3e-4, rtol=0, atol=1.5e-5)  # sd 4e-6
    assert random_walk == 0.0


def test_quietest_octave_excludes_the_motion():
    time = np.arange(0.0, 10.0, 1 / RATE)
    noise = 5e-4 * np.sqrt(RATE / 2) * np.random.default_rng(1).standard_normal(time.size)
    moving = noise + 5 * np.sin(2 * np.pi * 11 * time) + 0.5 * np.sin(2 * np.pi * 47 * time)
    assert_allclose(accelerometer_noise_density(moving, RATE), 5e-4, rtol=0, atol=5e-5)


def test_lever_height_derivatives():
    """Against finite differences."""
    point = np.array([1.3, -0.7, 0.9])
    step = 1e-6
    value, by_roll, by_pitch = lever_height(0.1, -0.2, point)
    near = [lever_height(0.1 + step, -0.2, point)[0], lever_height(0.1, -0.2 + step, point)[0]]
    assert_allclose((np.array(near) - value) / step, [by_roll, by_pitch], rtol=0, atol=1e-5)


def test_collinear_sensors_do_not_observe_roll_and_pitch():
    assert not observes_roll_and_pitch(np.zeros((1, 3)))
    assert not observes_roll_and_pitch(np.array([[0.0, 1, 0], [0, -1, 0]]))
    assert not observes_roll_and_pitch(np.zeros((4, 3)))


def test_bridge_variance_equals_that_of_random_draws():
    """White acceleration between known positions and velocities, drawn on a fine grid."""
    n, length, density = 200, 2.0, 0.7
    rng = np.random.default_rng(5)
    h = length / n
    push = rng.standard_normal((4000, n)) * np.sqrt(density * h)
    remaining = length - (np.arange(n) + 0.5) * h
    # condition on position and velocity at the end
    ends = np.stack([np.ones(n), remaining])
    push -= push @ ends.T @ np.linalg.solve(ends @ ends.T, ends)
    position = np.cumsum(np.cumsum(push, axis=1) * h, axis=1)
    drawn = position[:, [n // 4, n // 2]].var(axis=0)
    at = np.array([(n // 4 + 0.5) * h, (n // 2 + 0.5) * h])
    expected = bridge_variance(at, ((0.0, length),), density)
    assert_allclose(drawn / expected, 1.0, rtol=0, atol=0.1)  # 4000 draws: sd 0.02, and the grid


def test_smoothing_keeps_a_cubic():
    time = np.arange(0.0, 2.0, 0.005)
    pose = np.stack([time**3, 1 - time**2, *[0 * time] * 4], axis=1)
    navigation = NavigationInput(
        time=time, pose=pose, sd=np.zeros_like(pose), step=0.005, gaps=(), dropped=0
    )
    smooth = SmoothedSeries(navigation, [0, 1], window=0.2, slow=1.0)
    at = np.linspace(0.0, 1.99, 77)
    assert_allclose(smooth.value(at), np.stack([at**3, 1 - at**2], 1), rtol=0, atol=1e-9)
    assert_allclose(smooth.rate(at), np.stack([3 * at**2, -2 * at], 1), rtol=0, atol=1e-7)
    assert_allclose(smooth.second(at), np.stack([6 * at, 0 * at - 2], 1), rtol=0, atol=1e-5)
