"""Quarter car against the World Bank's matrices and its own frequency response."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.roughness import IRI_SPEED, QuarterCar

# Matrices for steps of 0.25 m that the World Bank printed (Technical Paper 46), 7 digits
WORLD_BANK_S = np.array(
    [
        [0.9966071, 0.01091514, -0.002083274, 0.0003190145],
        [-0.5563044, 0.9438768, -0.8324718, 0.05064701],
        [0.02153176, 0.002126763, 0.7508714, 0.008221888],
        [3.335013, 0.3376467, -39.12762, 0.4347564],
    ]
)
WORLD_BANK_P = np.array([0.005476107, 1.388776, 0.2275968, 35.79262])
PRINTED_S = 4e-7  # [1] relative: single precision and 7 printed digits
PRINTED_P = 2e-5  # [1] relative: p1 is a small difference in single precision

# abs(H) of the golden car at 80 km/h, 4 decimals
WAVELENGTHS = [60, 30, 15, 10, 5, 3, 2.4, 2, 1.3]  # [m]
GAINS = [0.0919, 0.4548, 1.5273, 1.2597, 1.1697, 1.4532, 1.6640, 1.5335, 0.5309]
FOUR_DECIMALS = 5.1e-5  # [1]

EXACT = 1e-12  # [1] rounding of the matrix exponential, whose elements reach 40


def test_transition_is_the_world_banks():
    S, p = QuarterCar().transition(0.25)
    assert_allclose(S / WORLD_BANK_S, 1, rtol=0, atol=PRINTED_S)
    assert_allclose(p / WORLD_BANK_P, 1, rtol=0, atol=PRINTED_P)


def test_gain_is_that_of_the_table():
    assert_allclose(QuarterCar().gain(WAVELENGTHS), GAINS, rtol=0, atol=FOUR_DECIMALS)


def test_gain_keeps_the_shape_of_the_wavelengths():
    assert QuarterCar().gain(15.0).shape == ()
    assert QuarterCar().gain([[15.0], [10.0]]).shape == (2, 1)


def test_two_steps_are_one_step_of_twice_the_length():
    S, p = QuarterCar().transition(0.1)
    S2, p2 = QuarterCar().transition(0.2)
    assert_allclose(S @ S, S2, rtol=0, atol=EXACT)
    assert_allclose(S @ p + p, p2, rtol=0, atol=EXACT)


def test_a_constant_slope_is_followed_without_suspension_travel():
    car = QuarterCar(tyre_stiffness=500.0, spring_stiffness=80.0, damping=3.0, mass_ratio=0.2)
    S, p = car.transition(0.3)
    climbing = np.array([1.0, 0.0, 1.0, 0.0])
    assert_allclose(S @ climbing + p, climbing, rtol=0, atol=EXACT)


def test_half_the_speed_responds_as_to_twice_the_wavelength():
    slow = QuarterCar().gain(7.5, speed=IRI_SPEED / 2)
    assert_allclose(slow, QuarterCar().gain(15.0), rtol=0, atol=EXACT)


@pytest.mark.parametrize("name", ["tyre_stiffness", "spring_stiffness", "damping", "mass_ratio"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_parameters_must_be_positive(name, value):
    with pytest.raises(ValueError, match=f"{name} must be finite and greater than 0"):
        QuarterCar(**{name: value})


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_lengths_and_speeds_must_be_positive(value):
    with pytest.raises(ValueError, match="step must be finite"):
        QuarterCar().transition(value)
    with pytest.raises(ValueError, match="speed must be finite"):
        QuarterCar().transition(0.1, speed=value)
    with pytest.raises(ValueError, match="wavelength must be finite"):
        QuarterCar().gain([1.0, value])
