"""The matrices of the models against Newton's law, part by part, and what they imply."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    QuarterCarParameters,
    frequency_response,
    linear_model,
    named_vehicle,
    state_space,
    vehicle_names,
)

# Rounding, as a fraction of the largest number that enters [1]
ROUNDING = 1e-12

VEHICLES = vehicle_names()


def with_tyre_damping(name: str):
    return replace(named_vehicle(name), front_tyre_damping=300.0, rear_tyre_damping=200.0)


@pytest.mark.parametrize("name", VEHICLES)
def test_the_full_car_obeys_newton(name, newton):
    car = with_tyre_damping(name)
    A, B, C, D = state_space(linear_model(car))
    rng = np.random.default_rng(1)
    for _ in range(20):
        q, v, u, du = (rng.standard_normal(size) for size in (7, 7, 4, 4))
        truth = newton(car, q, v, u, du)
        state, wheels = np.concatenate([q, v]), np.concatenate([u, du])
        atol = ROUNDING * np.abs(truth).max()
        assert_allclose(A @ state + B @ wheels, [*v, *truth], rtol=0, atol=atol)
        assert_allclose(C @ state + D @ wheels, [*q, *v, *truth], rtol=0, atol=atol)


def test_the_damper_acts_on_the_difference_of_velocities():
    # m_us z_us'' + c_t z_us' + c_s (z_us' - z_s') + (k_s + k_t) z_us - k_s z_s = k_t z_t + c_t z_t'
    ms, mu, ks, cs, kt, ct = 400.0, 50.0, 2e4, 1.5e3, 2e5, 100.0
    model = linear_model(
        QuarterCarParameters(
            sprung_mass=ms,
            unsprung_mass=mu,
            suspension_stiffness=ks,
            suspension_damping=cs,
            tyre_stiffness=kt,
            tyre_damping=ct,
        )
    )
    atol = ROUNDING * kt
    assert_allclose(model.mass, [[ms, 0], [0, mu]], rtol=0, atol=atol)
    assert_allclose(model.damping, [[cs, -cs], [-cs, cs + ct]], rtol=0, atol=atol)
    assert_allclose(model.stiffness, [[ks, -ks], [-ks, ks + kt]], rtol=0, atol=atol)
    assert_allclose(model.wheel_stiffness, [[0], [kt]], rtol=0, atol=atol)
    assert_allclose(model.wheel_damping, [[0], [ct]], rtol=0, atol=atol)


@pytest.mark.parametrize("name", VEHICLES)
def test_matrices_are_symmetric_and_mass_and_stiffness_positive(name):
    model = linear_model(with_tyre_damping(name))
    for matrix in (model.mass, model.damping, model.stiffness):
        assert_allclose(matrix, matrix.T, rtol=0, atol=ROUNDING * np.abs(matrix).max())
    for matrix in (model.mass, model.stiffness):
        assert (np.linalg.eigvalsh(matrix) > 0).all()


def test_names_units_and_shapes_agree():
    for parameters, freedoms, wheels in ((GOLDEN_QUARTER_CAR, 2, 1), (named_vehicle("van"), 7, 4)):
        model = linear_model(parameters)
        assert len(model.freedoms) == len(model.units) == len(model.mode_names) == freedoms
        assert len(model.wheels) == wheels
        assert model.wheel_stiffness.shape == model.wheel_damping.shape == (freedoms, wheels)
    assert model.units[:3] == ("m", "rad", "rad")


@pytest.mark.parametrize("name", VEHICLES)
def test_without_motion_the_body_lies_on_any_plane(name):
    car = with_tyre_damping(name)
    x, y = car.wheel_positions.T
    static = frequency_response(linear_model(car), 0.0)
    height, ahead, left = 0.3, 0.02, -0.01  # [m], slopes [1]: up at the nose, down on the left
    wheels = height + ahead * x + left * y
    expected = [height, -ahead, left, *wheels]
    assert_allclose(static @ wheels, expected, rtol=0, atol=ROUNDING)


def test_frequency_response_is_that_of_the_state_space():
    model = linear_model(with_tyre_damping("sedan"))
    A, B, C, D = state_space(model)
    frequencies = np.array([0.0, 0.7, 1.4, 5.0, 12.0, 40.0])
    responses = frequency_response(model, frequencies)
    assert responses.shape == (6, 7, 4)
    for frequency, response in zip(frequencies, responses, strict=True):
        s = 2j * np.pi * frequency
        inputs = np.vstack([np.eye(4), s * np.eye(4)])
        whole = (C @ np.linalg.solve(s * np.eye(14) - A, B) + D) @ inputs
        truth = np.vstack([response, s * response, s**2 * response])
        assert_allclose(whole, truth, rtol=0, atol=1e3 * ROUNDING * np.abs(truth).max())


def test_the_quarter_car_has_the_textbook_transmissibility():
    """Transmissibility of a body on spring and damper, when the tyre is all but rigid."""
    natural, zeta = 1.2, 0.3
    w = 2 * np.pi * natural
    car = QuarterCarParameters(
        sprung_mass=1.0,
        unsprung_mass=1e-6,
        suspension_stiffness=w**2,
        suspension_damping=2 * zeta * w,
        tyre_stiffness=1e7 * w**2,
    )
    r = np.array([0.2, 0.9, 1.0, np.sqrt(2), 3.0])
    truth = np.sqrt((1 + (2 * zeta * r) ** 2) / ((1 - r**2) ** 2 + (2 * zeta * r) ** 2))
    gain = np.abs(frequency_response(linear_model(car), r * natural)[:, 0, 0])
    rigid = 1e-6  # [1]: the tyre, 1e7 times stiffer than the spring, is still a little compliant
    assert_allclose(gain, truth, rtol=0, atol=rigid)


def test_the_full_golden_car_on_equal_wheels_heaves_as_the_quarter_car():
    frequencies = np.geomspace(0.1, 30, 20)
    full = frequency_response(linear_model(named_vehicle("golden car")), frequencies)
    quarter = frequency_response(linear_model(GOLDEN_QUARTER_CAR), frequencies)
    equal = full @ np.ones(4)
    assert_allclose(equal[:, 0], quarter[:, 0, 0], rtol=0, atol=10 * ROUNDING)
    assert_allclose(equal[:, 3:], quarter[:, [1] * 4, 0], rtol=0, atol=10 * ROUNDING)
    assert_allclose(equal[:, 1:3], 0.0, rtol=0, atol=10 * ROUNDING)


def test_with_neutral_inertias_each_corner_is_a_quarter_car():
    """Inertias of m a b and m (t/2)² uncouple the corners, on ground that is not warped."""
    golden = named_vehicle("golden car")
    neutral = replace(
        golden,
        pitch_inertia=golden.sprung_mass * golden.front_axle * golden.rear_axle,
        roll_inertia=golden.sprung_mass * (golden.front_track / 2) ** 2,
    )
    x, y = neutral.wheel_positions.T
    frequencies = np.geomspace(0.1, 30, 20)
    quarter = frequency_response(linear_model(GOLDEN_QUARTER_CAR), frequencies)
    full = frequency_response(linear_model(neutral), frequencies)
    for wheels in (np.ones(4), x, y):
        motion = full @ wheels
        above = motion[:, [0]] - motion[:, [1]] * x + motion[:, [2]] * y
        assert_allclose(above, quarter[:, 0] * wheels, rtol=0, atol=100 * ROUNDING)
        assert_allclose(motion[:, 3:], quarter[:, 1] * wheels, rtol=0, atol=100 * ROUNDING)


@pytest.mark.parametrize("name", VEHICLES)
def test_symmetric_and_antisymmetric_motion_are_decoupled(name):
    frequencies = [0.5, 1.5, 12.0]
    response = frequency_response(linear_model(named_vehicle(name)), frequencies)
    equal, opposite = response @ [1.0, 1.0, 0.5, 0.5], response @ [1.0, -1.0, 0.5, -0.5]
    assert_allclose(equal[:, 2], 0.0, rtol=0, atol=ROUNDING)
    assert_allclose(opposite[:, :2], 0.0, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("wavelength", "heave", "pitch"),
    # computed apart from this package for the van at 1.42 Hz; half of the last digit printed
    [(None, (20.0, 0.5), (0.19, 0.005)), (4.88, (4.5, 0.05), (0.98, 0.005))],
)
def test_the_wheelbase_filters(wavelength, heave, pitch):
    """A wave as long as the wheelbase lifts the van; one twice as long pitches it."""
    van = named_vehicle("van")
    if wavelength is None:
        wavelength = van.wheelbase
    x = van.wheel_positions[:, 0]
    road = 10.0 * np.exp(2j * np.pi * x / wavelength)  # [mm]; the front axle meets it first
    motion = np.abs(frequency_response(linear_model(van), 1.42) @ road)
    assert_allclose(motion[0], heave[0], rtol=0, atol=heave[1])
    assert_allclose(np.degrees(motion[1] / 1000), pitch[0], rtol=0, atol=pitch[1])
    assert_allclose(motion[2], 0.0, rtol=0, atol=ROUNDING * 10)


def test_no_pitch_if_the_wavelength_is_the_wheelbase_of_a_symmetric_car():
    golden = named_vehicle("golden car")
    road = np.exp(2j * np.pi * golden.wheel_positions[:, 0] / golden.wheelbase)
    motion = frequency_response(linear_model(golden), [0.8, 1.3, 11.0]) @ road
    assert_allclose(motion[:, 1], 0.0, rtol=0, atol=ROUNDING)
    assert (np.abs(motion[:, 0]) > 0.1).all()


@pytest.mark.parametrize("frequency", [-1.0, np.nan, [1.0, np.inf]])
def test_impossible_frequencies_are_refused(frequency):
    with pytest.raises(ValueError, match="frequency must be finite and at least 0 Hz, got"):
        frequency_response(linear_model(GOLDEN_QUARTER_CAR), frequency)
