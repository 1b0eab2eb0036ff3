"""Time response against analytic motions, another integrator, and itself in other steps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    LinearModel,
    VehicleState,
    advance_response,
    discretise_model,
    frequency_response,
    linear_model,
    named_vehicle,
    simulate_response,
    start_state,
    vehicle_modes,
    vehicle_names,
)

# Rounding of a recursion over some thousand steps, as a fraction of the motion [1]
ROUNDING = 1e-10

# What the time response may depart from the analytic one [1]
PROMISED = 1e-3

# Frequencies [Hz] that have whole periods of samples at 4 kHz: below, at and above ride and hop
FREQUENCIES = (
    1.25,
    10.0,
    *(pytest.param(f, marks=pytest.mark.slow) for f in (0.5, 1.6, 2.5, 5.0, 12.5, 20.0)),
)

WITH_TYRE_DAMPING = replace(named_vehicle("van"), front_tyre_damping=250.0, rear_tyre_damping=150.0)
VEHICLES = {
    "golden quarter car": GOLDEN_QUARTER_CAR,
    "quarter car with tyre damping": replace(GOLDEN_QUARTER_CAR, tyre_damping=100.0),
    "van with tyre damping": WITH_TYRE_DAMPING,
    **{name: named_vehicle(name) for name in vehicle_names()},
}


def rough(samples: int, wheels: int, seed: int = 1) -> np.ndarray:
    """Wheel heights that jump about by some 10 mm."""
    return 0.01 * np.random.default_rng(seed).standard_normal((samples, wheels))


def measured_response(model: LinearModel, frequency: float, step: float) -> np.ndarray:
    """Complex gain of displacement, velocity, acceleration to a sine, shape (3, n, w), in time."""
    slowest = -vehicle_modes(model).eigenvalue.real.max()
    decay = np.ceil(np.log(1e9) / slowest * frequency) / frequency  # whole periods
    quiet, period = round(decay / step), round(1 / (frequency * step))
    time = np.arange(quiet + period) * step
    carrier = np.exp(-2j * np.pi * frequency * time[quiet:]) * 2j / period
    gains = []
    for wheel in range(len(model.wheels)):
        heights = np.zeros((len(time), len(model.wheels)))
        heights[:, wheel] = np.sin(2 * np.pi * frequency * time)
        gains.append([carrier @ part[quiet:] for part in simulate_response(model, step, heights)])
    return np.moveaxis(np.array(gains), 0, -1)


def analytic_response(model: LinearModel, frequency: float, step: float) -> np.ndarray:
    """The same from the frequency response; rates under tyre dampers are those before a sample."""
    s = 2j * np.pi * frequency
    displacement = frequency_response(model, frequency)
    rate_before = (1 - np.exp(-s * step)) / step
    jump = np.linalg.solve(model.mass, model.wheel_damping) * (rate_before - s)
    return np.array([displacement, s * displacement, s**2 * displacement + jump])


@pytest.mark.parametrize("frequency", FREQUENCIES)
@pytest.mark.parametrize("name", VEHICLES)
def test_the_response_to_a_sine_is_the_frequency_response(name, frequency):
    """All degrees of freedom, from every wheel, in amplitude and phase, of all three outputs."""
    model = linear_model(VEHICLES[name])
    truth = analytic_response(model, frequency, 1 / 4000)
    error = np.abs(measured_response(model, frequency, 1 / 4000) - truth) / np.abs(truth)
    assert_allclose(error, 0.0, rtol=0, atol=PROMISED)


def test_at_1_khz_the_stated_error_holds_up_to_wheel_hop():
    for name, frequency in (("van", 12.5), ("golden car", 10.0), ("sedan", 1.25)):
        model = linear_model(named_vehicle(name))
        truth = analytic_response(model, frequency, 1e-3)
        error = np.abs(measured_response(model, frequency, 1e-3) - truth) / np.abs(truth)
        assert_allclose(error, 0.0, rtol=0, atol=PROMISED)


@pytest.mark.parametrize("name", ["golden quarter car", "van", "van with tyre damping"])
def test_halving_the_step_quarters_the_error_of_a_sine(name):
    """Only the straight lines between samples err, by the fraction sinc² - 1 = -(pi f T)² / 3."""
    model = linear_model(VEHICLES[name])
    frequency = 12.5
    truth = frequency_response(model, frequency)
    errors = []
    for step in (4e-3, 2e-3, 1e-3):
        error = measured_response(model, frequency, step)[0] / truth - 1
        chords = np.sinc(frequency * step) ** 2 - 1
        # lines alias too: a fraction (f / fs)² at fs - f, where the vehicle hardly answers
        assert_allclose(error, chords, rtol=0, atol=0.1 * abs(chords))
        errors.append(np.abs(error).max())
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_allclose(order, 2.0, rtol=0, atol=0.05)


@pytest.mark.parametrize("name", VEHICLES)
def test_straight_lines_between_samples_are_followed_exactly(name):
    model = linear_model(VEHICLES[name])
    step, parts = 0.004, (2, 4, 10)
    heights = rough(501, len(model.wheels))
    coarse = simulate_response(model, step, heights)
    for part in parts:
        places = np.arange(500 * part + 1) / part
        columns = [np.interp(places, np.arange(501), column) for column in heights.T]
        fine = simulate_response(model, step / part, np.stack(columns, axis=1))
        for one, other in zip(coarse, fine, strict=True):
            scale = ROUNDING * np.abs(one).max()
            assert_allclose(other[::part], one, rtol=0, atol=scale)


def test_another_integrator_on_newtons_law_agrees(newton):
    """Runge-Kutta of order 8, from sample to sample, on forces written out part by part."""
    car, step = WITH_TYRE_DAMPING, 0.01
    heights = rough(60, 4)
    response = simulate_response(linear_model(car), step, heights)
    state = np.concatenate([response.displacement[0], response.velocity[0]])
    for k in range(1, len(heights)):
        before, rate = heights[k - 1], (heights[k] - heights[k - 1]) / step

        def rates_of_change(time, x, before=before, rate=rate):
            return [*x[7:], *newton(car, x[:7], x[7:], before + rate * time, rate)]

        solved = solve_ivp(
            rates_of_change, (0, step), state, method="DOP853", rtol=1e-11, atol=1e-13
        )
        state = solved.y[:, -1]
        acceleration = rates_of_change(step, state)[7:]
        assert_allclose(response.displacement[k], state[:7], rtol=0, atol=1e-10)
        assert_allclose(response.velocity[k], state[7:], rtol=0, atol=1e-9)
        assert_allclose(response.acceleration[k], acceleration, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", VEHICLES)
def test_accelerations_obey_the_equations_of_motion(name):
    model = linear_model(VEHICLES[name])
    step = 0.001
    heights = rough(2000, len(model.wheels))
    q, v, a = simulate_response(model, step, heights)
    rates = np.diff(heights, axis=0, prepend=heights[:1]) / step
    force = heights @ model.wheel_stiffness.T + rates @ model.wheel_damping.T
    force -= v @ model.damping.T + q @ model.stiffness.T
    inertia = a @ model.mass.T
    assert_allclose(inertia, force, rtol=0, atol=ROUNDING * np.abs(inertia).max())


@pytest.mark.parametrize("name", VEHICLES)
def test_free_motion_is_that_of_the_modes(name):
    """Started in one mode on level ground, it moves as Re(shape exp(s t)) for ever."""
    model = linear_model(VEHICLES[name])
    found = vehicle_modes(model)
    step, samples = 0.001, 1500
    time = np.arange(1, samples + 1) * step
    for s, shape in zip(found.eigenvalue, found.shape, strict=True):
        truth = [np.real(np.outer(np.exp(s * time), factor * shape)) for factor in (1, s, s**2)]
        start = VehicleState(
            displacement=shape.real,
            velocity=(s * shape).real,
            acceleration=(s**2 * shape).real,
            wheel_heights=np.zeros(len(model.wheels)),
        )
        run, _ = advance_response(
            discretise_model(model, step), start, np.zeros((samples, len(model.wheels)))
        )
        for part, expected in zip(run, truth, strict=True):
            assert_allclose(part, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize("name", VEHICLES)
def test_energy_only_decays_on_level_ground(name):
    model = linear_model(VEHICLES[name])
    rng = np.random.default_rng(5)
    size, wheels = len(model.freedoms), len(model.wheels)
    start = VehicleState(
        displacement=0.02 * rng.standard_normal(size),
        velocity=0.1 * rng.standard_normal(size),
        acceleration=np.zeros(size),
        wheel_heights=np.zeros(wheels),
    )
    run, _ = advance_response(discretise_model(model, 0.001), start, np.zeros((6000, wheels)))
    q, v = (
        np.vstack(pair) for pair in zip((start.displacement, start.velocity), run, strict=False)
    )
    energy = np.einsum("ki,ij,kj->k", q, model.stiffness, q) / 2
    energy += np.einsum("ki,ij,kj->k", v, model.mass, v) / 2
    assert (np.diff(energy) <= 0).all()
    assert energy[-1] < 1e-8 * energy[0]


@pytest.mark.parametrize("name", VEHICLES)
def test_without_dampers_energy_is_kept(name):
    undamped = {field: 0.0 for field in vars(VEHICLES[name]) if field.endswith("damping")}
    model = linear_model(replace(VEHICLES[name], **undamped))
    wheels = len(model.wheels)
    start = start_state(model, np.linspace(0.01, 0.02, wheels))
    level = replace(start, wheel_heights=np.zeros(wheels))
    q, v, _ = advance_response(discretise_model(model, 0.001), level, np.zeros((5000, wheels)))[0]
    energy = np.einsum("ki,ij,kj->k", q, model.stiffness, q) / 2
    energy += np.einsum("ki,ij,kj->k", v, model.mass, v) / 2
    assert_allclose(energy, energy[0], rtol=0, atol=ROUNDING * energy[0])


@pytest.mark.parametrize("name", vehicle_names())
def test_a_vehicle_at_rest_lies_on_slope_and_bank(name):
    """Nose-down is positive: uphill pitches negative. Left side up rolls positive."""
    car = named_vehicle(name)
    x, y = car.wheel_positions.T
    state = start_state(linear_model(car), 412.0 + 0.05 * x + 0.02 * y)
    expected = [412.0, -0.05, 0.02, *state.wheel_heights]
    assert_allclose(state.displacement, expected, rtol=0, atol=412 * ROUNDING)
    assert (state.velocity == 0).all()
    assert (state.acceleration == 0).all()
    uphill = start_state(linear_model(car), [0.1, 0.1, 0.0, 0.0]).displacement
    assert uphill[1] < 0
    assert_allclose(uphill[1], -0.1 / car.wheelbase, rtol=0, atol=ROUNDING)
    left_up = start_state(linear_model(car), [0.1, 0.0, 0.1, 0.0]).displacement
    assert left_up[2] > 0


@pytest.mark.parametrize("name", VEHICLES)
def test_a_vehicle_at_rest_stays_at_rest(name):
    model = linear_model(VEHICLES[name])
    heights = 500.0 + np.linspace(-0.3, 0.2, len(model.wheels))
    run = simulate_response(model, 0.001, np.tile(heights, (20_000, 1)))
    # heights of 500 m round to 1e-13 m, which springs of 5000 1/s² make accelerations of
    assert_allclose(run.displacement - run.displacement[0], 0.0, rtol=0, atol=1e-10)
    assert_allclose(run.velocity, 0.0, rtol=0, atol=1e-8)
    assert_allclose(run.acceleration, 0.0, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", VEHICLES)
def test_a_vehicle_on_a_long_slope_keeps_its_velocity(name):
    model = linear_model(VEHICLES[name])
    wheels = len(model.wheels)
    start, rate = np.linspace(0.1, 0.0, wheels), 0.3
    time = 0.001 * np.arange(1, 3001)
    state = start_state(model, start, wheel_rates=rate)
    run, _ = advance_response(discretise_model(model, 0.001), state, start + rate * time[:, None])
    assert_allclose(run.velocity, np.tile(state.velocity, (3000, 1)), rtol=0, atol=ROUNDING)
    assert_allclose(run.acceleration, 0.0, rtol=0, atol=1e3 * ROUNDING)
    climbed = run.displacement - state.displacement
    assert_allclose(climbed, np.outer(time, state.velocity), rtol=0, atol=ROUNDING)
    assert_allclose(state.velocity[0], rate, rtol=0, atol=ROUNDING)


def test_the_response_to_a_kerb_decays():
    model = linear_model(named_vehicle("sedan"))
    kerb = np.zeros((10_000, 4))
    kerb[100:] = -0.15
    q, v, a = simulate_response(model, 0.001, kerb)
    assert_allclose(q[:100], 0.0, rtol=0, atol=0)
    assert q[:, 0].min() < -0.15  # it overshoots
    expected = [-0.15, 0.0, 0.0, *[-0.15] * 4]
    decayed = 1e-8  # [m], [rad]: after 9.9 s
    assert_allclose(q[-1], expected, rtol=0, atol=decayed)
    assert_allclose(v[-1], 0.0, rtol=0, atol=1e2 * decayed)
    assert_allclose(a[-1], 0.0, rtol=0, atol=1e4 * decayed)


@pytest.mark.parametrize("name", vehicle_names())
def test_equal_wheel_paths_give_no_roll_and_opposite_ones_only_roll(name):
    model = linear_model(named_vehicle(name))
    road = rough(3000, 2)
    equal = simulate_response(model, 0.001, road[:, [0, 0, 1, 1]])
    opposite = simulate_response(model, 0.001, road[:, [0, 0, 1, 1]] * [1, -1, 1, -1])
    for part in equal:
        assert_allclose(part[:, 2], 0.0, rtol=0, atol=ROUNDING * np.abs(part).max())
        assert_allclose(part[:, 3], part[:, 4], rtol=0, atol=ROUNDING * np.abs(part).max())
    for part in opposite:
        assert_allclose(part[:, :2], 0.0, rtol=0, atol=ROUNDING * np.abs(part).max())


@pytest.mark.parametrize("name", VEHICLES)
@given(cuts=st.lists(st.integers(0, 400), max_size=6))
def test_blocks_give_the_same_bits_as_one_piece(name, cuts):
    model = linear_model(VEHICLES[name])
    discrete, heights = discretise_model(model, 0.001), rough(401, len(model.wheels))
    start = start_state(model, heights[0])
    whole, end = advance_response(discrete, start, heights[1:])
    state, blocks = start, []
    for block in np.split(heights[1:], sorted(cuts)):
        response, state = advance_response(discrete, state, block)
        blocks.append(response)
    for part, pieces in zip(whole, zip(*blocks, strict=True), strict=True):
        assert (np.concatenate(pieces) == part).all()
    for field in vars(end):
        assert (getattr(state, field) == getattr(end, field)).all()
    complete = simulate_response(model, 0.001, heights)
    assert (complete.acceleration[1:] == whole.acceleration).all()


def test_the_layout_of_the_wheel_heights_does_not_matter():
    model = linear_model(named_vehicle("van"))
    heights = rough(500, 8)
    plain = simulate_response(model, 0.001, heights[:, ::2].copy())
    for other in (heights[:, ::2], np.asfortranarray(heights[:, ::2]), heights[:, ::2].tolist()):
        assert (simulate_response(model, 0.001, other).acceleration == plain.acceleration).all()


def test_inputs_are_left_alone_and_outputs_are_their_own():
    model = linear_model(GOLDEN_QUARTER_CAR)
    heights = rough(50, 1)[:, 0]
    kept = heights.copy()
    start = start_state(model, heights[0])
    response, end = advance_response(discretise_model(model, 0.001), start, heights[1:])
    assert (heights == kept).all()
    assert start.wheel_heights == kept[0]
    response.displacement[:] = 0.0
    assert (end.displacement != 0.0).all()


def test_no_samples_change_nothing():
    model = linear_model(named_vehicle("van"))
    start = start_state(model, [0.1, 0.1, 0.0, 0.0])
    response, end = advance_response(discretise_model(model, 0.001), start, np.empty((0, 4)))
    assert response.acceleration.shape == (0, 7)
    assert end is start


@pytest.mark.parametrize("step", [0.0, -1e-3, np.nan, np.inf])
def test_an_impossible_step_is_refused(step):
    with pytest.raises(ValueError, match=f"step must be finite and greater than 0 s, got {step}"):
        discretise_model(linear_model(GOLDEN_QUARTER_CAR), step)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_wheel_heights_that_are_not_finite_are_refused(value):
    model = linear_model(named_vehicle("van"))
    with pytest.raises(ValueError, match=rf"wheel_heights .* got {value} m at wheel rear-left"):
        start_state(model, [0.0, 0.0, value, 0.0])
    with pytest.raises(ValueError, match=rf"wheel_rates .* got {value} m/s at wheel front-left"):
        start_state(model, np.zeros(4), wheel_rates=value)
    heights = np.zeros((9, 4))
    heights[5, 1] = value
    message = rf"wheel_heights must be finite, got {value} m at sample 5, wheel front-right"
    with pytest.raises(ValueError, match=message):
        advance_response(discretise_model(model, 0.001), start_state(model, np.zeros(4)), heights)
    with pytest.raises(ValueError, match=message):
        simulate_response(model, 0.001, heights)


def test_wheel_heights_of_another_shape_are_refused():
    van, quarter = linear_model(named_vehicle("van")), linear_model(GOLDEN_QUARTER_CAR)
    with pytest.raises(ValueError, match=r"wheel_heights must have shape \(4,\), got \(3,\)"):
        start_state(van, np.zeros(3))
    with pytest.raises(ValueError, match=r"must have shape \(samples, 4\), got \(9,\)"):
        simulate_response(van, 0.001, np.zeros(9))
    with pytest.raises(ValueError, match=r"must have shape \(samples, 1\), got \(9, 4\)"):
        simulate_response(quarter, 0.001, np.zeros((9, 4)))
    with pytest.raises(ValueError, match="wheel_heights must have at least 1 sample, got 0"):
        simulate_response(van, 0.001, np.empty((0, 4)))
