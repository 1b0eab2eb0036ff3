"""Modes against closed forms, polynomials and published tables."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import eigvals

from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    linear_model,
    named_vehicle,
    vehicle_modes,
    vehicle_names,
)

# Relative rounding of eigenvalues [1]
ROUNDING = 1e-10

# Half of the last digit of the table: frequencies of the body to 0.01 Hz, of wheel hop to 0.1 Hz,
# damping ratios to 0.01
BODY_DIGIT, HOP_DIGIT, RATIO_DIGIT = 0.005, 0.05, 0.005

# Computed apart from this package from the same parameters: undamped frequencies of the body [Hz],
# least and greatest of wheel hop [Hz], least and greatest damping ratio of the body and of the hop
TABLE = {
    "compact": ((1.22, 1.61, 2.24), (12.8, 13.2), (0.23, 0.32), (0.27, 0.30)),
    "sedan": ((1.42, 1.44, 2.30), (11.9, 12.3), (0.29, 0.41), (0.36, 0.40)),
    "van": ((1.41, 1.62, 2.33), (12.4, 13.1), (0.28, 0.31), (0.38, 0.46)),
}


def span(values: np.ndarray) -> tuple[float, float]:
    return values.min(), values.max()


@pytest.mark.parametrize("name", TABLE)
def test_full_cars_have_the_modes_of_the_table(name):
    body, hop, body_ratios, hop_ratios = TABLE[name]
    found = vehicle_modes(linear_model(named_vehicle(name)))
    assert_allclose(found.undamped_frequency[:3], body, rtol=0, atol=BODY_DIGIT)
    assert_allclose(span(found.undamped_frequency[3:]), hop, rtol=0, atol=HOP_DIGIT)
    assert_allclose(span(found.damping_ratio[:3]), body_ratios, rtol=0, atol=RATIO_DIGIT)
    assert_allclose(span(found.damping_ratio[3:]), hop_ratios, rtol=0, atol=RATIO_DIGIT)


def test_the_golden_car_has_the_modes_of_the_table():
    found = vehicle_modes(linear_model(GOLDEN_QUARTER_CAR))
    assert found.names == ("heave", "hop")
    digit = 0.0005  # [Hz], [1]: half of the last digit
    assert_allclose(found.undamped_frequency, [1.208, 11.005], rtol=0, atol=digit)
    assert_allclose(found.natural_frequency, [1.236, 10.755], rtol=0, atol=digit)
    assert_allclose(found.damping_ratio, [0.333, 0.302], rtol=0, atol=digit)
    ratio = found.undamped_frequency[1] / found.undamped_frequency[0]
    assert_allclose(ratio, 9.1, rtol=0, atol=HOP_DIGIT)


def test_equation_3_2_as_printed_has_other_modes():
    """Without the velocity of the body: 1.21 Hz at 0.36 and 11.03 Hz at 0.29."""
    model = linear_model(GOLDEN_QUARTER_CAR)
    damping = model.damping.copy()
    damping[1, 0] = 0.0
    printed = vehicle_modes(replace(model, damping=damping))
    assert_allclose(printed.natural_frequency, [1.21, 11.03], rtol=0, atol=BODY_DIGIT)
    assert_allclose(printed.damping_ratio, [0.36, 0.29], rtol=0, atol=RATIO_DIGIT)


@pytest.mark.parametrize("name", vehicle_names())
def test_the_undamped_quarter_car_has_its_closed_form(name):
    car = named_vehicle(name).corner("rear")
    ms, mu = car.sprung_mass, car.unsprung_mass
    ks, kt = car.suspension_stiffness, car.tyre_stiffness
    # ms mu w^4 - (ms (ks + kt) + mu ks) w^2 + ks kt = 0
    middle = (ms * (ks + kt) + mu * ks) / (2 * ms * mu)
    root = np.sqrt(middle**2 - ks * kt / (ms * mu))
    truth = np.sqrt([middle - root, middle + root]) / (2 * np.pi)
    found = vehicle_modes(linear_model(car))
    assert_allclose(found.undamped_frequency, truth, rtol=0, atol=ROUNDING * truth[1])
    undamped = vehicle_modes(linear_model(replace(car, suspension_damping=0.0)))
    assert_allclose(undamped.natural_frequency, truth, rtol=0, atol=ROUNDING * truth[1])
    assert_allclose(undamped.damped_frequency, truth, rtol=0, atol=ROUNDING * truth[1])
    assert_allclose(undamped.damping_ratio, 0.0, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("tyre_damping", [0.0, 150.0])
def test_the_damped_quarter_car_has_the_roots_of_its_polynomial(tyre_damping):
    car = replace(GOLDEN_QUARTER_CAR, tyre_damping=tyre_damping)
    ms, mu = car.sprung_mass, car.unsprung_mass
    # the determinant of M s² + C s + K, whose elements are polynomials in s
    spring = np.array([0.0, car.suspension_damping, car.suspension_stiffness])
    tyre = np.array([0.0, car.tyre_damping, car.tyre_stiffness])
    body = spring + np.array([ms, 0.0, 0.0])
    wheel = spring + tyre + np.array([mu, 0.0, 0.0])
    roots = np.roots(np.polymul(body, wheel) - np.pad(np.polymul(spring[1:], spring[1:]), (2, 0)))
    roots = roots[roots.imag > 0]
    roots = roots[np.argsort(np.abs(roots))]
    found = vehicle_modes(linear_model(car))
    assert_allclose(found.eigenvalue, roots, rtol=0, atol=ROUNDING * np.abs(roots[1]))
    assert_allclose(found.damping_ratio, -roots.real / np.abs(roots), rtol=0, atol=ROUNDING)
    assert_allclose(found.damped_frequency, roots.imag / 2 / np.pi, rtol=0, atol=10 * ROUNDING)


@pytest.mark.parametrize("name", vehicle_names())
def test_modes_solve_the_equations_of_motion(name):
    model = linear_model(replace(named_vehicle(name), front_tyre_damping=200.0))
    found = vehicle_modes(model)
    scale = ROUNDING * np.abs(model.stiffness).max()
    for s, shape in zip(found.eigenvalue, found.shape, strict=True):
        residual = (model.mass * s**2 + model.damping * s + model.stiffness) @ shape
        assert_allclose(residual, 0.0, rtol=0, atol=scale)
        modal_mass = (shape.conj() @ model.mass @ shape).real
        assert_allclose(modal_mass, 1.0, rtol=0, atol=ROUNDING)
    for f, shape in zip(found.undamped_frequency, found.undamped_shape, strict=True):
        residual = (model.stiffness - model.mass * (2 * np.pi * f) ** 2) @ shape
        assert_allclose(residual, 0.0, rtol=0, atol=scale)
    gram = found.undamped_shape @ model.mass @ found.undamped_shape.T
    assert_allclose(gram, np.eye(7), rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("name", vehicle_names())
def test_no_eigenvalue_is_lost_or_taken_twice(name):
    """The generalised eigenvalues of scipy, from a pencil that inverts no mass."""
    model = linear_model(named_vehicle(name))
    zero, one = np.zeros((7, 7)), np.eye(7)
    pencil = np.block([[zero, one], [-model.stiffness, -model.damping]])
    truth = eigvals(pencil, np.block([[one, zero], [zero, model.mass]]))
    found = vehicle_modes(model).eigenvalue
    key = lambda s: (round(abs(s), 6), s.imag)  # noqa: E731 - order of complex numbers
    found = sorted([*found, *found.conj()], key=key)
    assert_allclose(found, sorted(truth, key=key), rtol=0, atol=1e-7 * np.abs(truth).max())


@pytest.mark.parametrize("factor", [0.001, 0.005, 0.05, 1.0])
@pytest.mark.parametrize("name", vehicle_names())
def test_damping_in_proportion_to_stiffness_has_its_closed_form(name, factor):
    """C = b K leaves the shapes alone and has ratios b w / 2, also beyond 1."""
    model = linear_model(named_vehicle(name))
    found = vehicle_modes(replace(model, damping=factor * model.stiffness))
    w = 2 * np.pi * found.undamped_frequency
    ratio = factor * w / 2
    scale = 1e3 * ROUNDING * max(1.0, ratio.max() ** 2)  # the two roots of a mode lie far apart
    assert_allclose(found.natural_frequency, found.undamped_frequency, rtol=0, atol=scale)
    assert_allclose(found.damping_ratio, ratio, rtol=0, atol=scale)
    oscillation = np.sqrt(np.maximum(1 - ratio**2, 0.0))
    truth = found.undamped_frequency * oscillation
    assert_allclose(found.damped_frequency, truth, rtol=0, atol=scale)


def test_the_overdamped_hop_is_found():
    car = replace(GOLDEN_QUARTER_CAR, tyre_damping=10_000.0)
    found = vehicle_modes(linear_model(car))
    assert found.names == ("heave", "hop")
    assert found.damping_ratio[0] < 1 < found.damping_ratio[1]
    assert found.damped_frequency[1] == 0.0
    assert found.eigenvalue[1].imag == 0.0


@pytest.mark.parametrize("name", vehicle_names())
def test_modes_are_named_once_and_after_their_motion(name):
    model = linear_model(named_vehicle(name))
    found = vehicle_modes(model)
    assert sorted(found.names) == sorted(model.mode_names)
    shape = dict(zip(found.names, found.undamped_shape, strict=True))
    for mode in ("heave", "pitch", "front hop", "rear hop"):  # left and right together
        assert_allclose(shape[mode][[2]], 0.0, rtol=0, atol=1e-6)
        assert_allclose(shape[mode][[3, 5]], shape[mode][[4, 6]], rtol=0, atol=1e-6)
    for mode in ("roll", "front tramp", "rear tramp"):  # left against right
        assert_allclose(shape[mode][:2], 0.0, rtol=0, atol=1e-6)
        assert_allclose(shape[mode][[3, 5]], -shape[mode][[4, 6]], rtol=0, atol=1e-6)
    body = np.abs(shape["roll"][2]), np.abs(shape["front hop"][3])
    assert all(component > 0 for component in body)
    assert found.names.index("roll") == 2
    assert (np.diff(found.undamped_frequency) >= 0).all()


def test_equal_frequencies_are_found():
    """Where body modes coincide, their shapes are arbitrary, but their frequencies are not."""
    golden = named_vehicle("golden car")
    neutral = replace(
        golden,
        pitch_inertia=golden.sprung_mass * golden.front_axle**2,
        roll_inertia=golden.sprung_mass * (golden.front_track / 2) ** 2,
    )
    found, quarter = (
        vehicle_modes(linear_model(neutral)),
        vehicle_modes(linear_model(GOLDEN_QUARTER_CAR)),
    )
    for field in ("undamped_frequency", "natural_frequency", "damping_ratio"):
        whole, part = getattr(found, field), getattr(quarter, field)
        assert_allclose(whole[:3], part[0], rtol=0, atol=1e3 * ROUNDING)
        assert_allclose(whole[4:], part[1], rtol=0, atol=1e3 * ROUNDING)
    # the fourth hop warps the ground plane, which leaves the body at rest
    car = GOLDEN_QUARTER_CAR
    stiffness = car.suspension_stiffness + car.tyre_stiffness
    warp = np.sqrt(stiffness / car.unsprung_mass) / (2 * np.pi)
    assert_allclose(found.undamped_frequency[3], warp, rtol=0, atol=1e3 * ROUNDING)
