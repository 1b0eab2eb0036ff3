"""Ride Number against the program's recursion written out, and the response to sines.

No published values were found: the constants are those commonly quoted, and not checked against
ASTM E1489. The tests check that the stated formula is computed.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.provenance import provenance_steps
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import (
    IRI_SPEED,
    RIDE_NUMBER_CAR,
    QuarterCar,
    RideNumberSettings,
    ride_number,
)

EXACT = 1e-12  # [m/m, or 1] rounding of sums of some thousand terms
SINE = 3e-4  # [1] relative: mean over samples instead of the integral, at 10 mm


def rough(n, seed=1):
    """Heights of a random walk [m]."""
    return np.cumsum(np.random.default_rng(seed).standard_normal(n)) * 2e-4


def program(height, step):
    """Sayers's program for the constants of the Ride Number, written out: PI [m/m]."""
    k1, k2, c, mu = 5120.0, 390.0, 17.0, 0.036
    A = np.array(
        [[0, 1, 0, 0], [-k2, -c, k2, c], [0, 0, 0, 1], [k2 / mu, c / mu, -(k1 + k2) / mu, -c / mu]]
    )
    S = expm(A * step / IRI_SPEED)
    p = np.linalg.solve(A, (S - np.eye(4)) @ [0, 0, 0, k1 / mu])
    base = max(int(0.25 / step + 0.5), 1)
    lead = min(int(19 / step + 0.5) + 1, height.size)
    first = (height[lead - 1] - height[0]) / (step * lead)
    x, squares = np.array([first, 0, first, 0]), []
    for slope in (height[base:] - height[:-base]) / (base * step):
        x = S @ x + p * slope
        squares.append((x[2] - x[0]) ** 2)
    return np.sqrt(np.mean(squares))


@pytest.mark.parametrize("step", [0.025, 0.1, 0.1524, 0.25])
@pytest.mark.parametrize("length", [15.0, 150.0])
def test_ride_number_is_sayerss_program_with_its_constants(step, length):
    height = rough(int(length / step))
    profile = make_profile(7.0 + step * np.arange(height.size), height)
    rated = ride_number(profile, settings=RideNumberSettings(max_spacing=0.25))
    truth = program(height, step)
    assert_allclose(rated.pi, truth, rtol=0, atol=EXACT)
    assert_allclose(rated.rn, 5 * np.exp(-160 * truth), rtol=0, atol=1e-9)  # [1] 160 PI / PI


@pytest.mark.parametrize("wavelength", [30, 10, 6, 5, 2, 1])
def test_sine_has_the_index_of_its_frequency_response(wavelength):
    """PI = abs(H) slope amplitude / sqrt(2), times sinc(0.25 / wavelength) of the window."""
    transient = 120.0  # [m] whole periods; the slowest motion has decayed to exp(-60)
    amplitude = 0.0005  # [m]
    s = np.arange(0, 2 * transient + 1, 0.01)
    profile = make_profile(s, amplitude * np.sin(2 * np.pi * s / wavelength))
    rated = ride_number(profile, segment=transient)
    slope = 2 * np.pi * amplitude / wavelength * np.sinc(0.25 / wavelength)
    truth = RIDE_NUMBER_CAR.gain(wavelength) * slope / np.sqrt(2)
    assert_allclose(rated.segment_pi[0, 1] / truth, 1, rtol=0, atol=SINE)


def test_a_smooth_road_is_perfect_and_a_rough_one_impassable():
    s = 0.1 * np.arange(1000)
    assert_allclose(ride_number(make_profile(s, 0 * s)).rn, 5.0, rtol=0, atol=0)
    assert ride_number(make_profile(s, 1000 * rough(1000))).rn < 1e-6


def test_both_wheel_paths_are_the_root_mean_square():
    s = 0.1 * np.arange(1500)
    left, right = rough(s.size, 5), 3 * rough(s.size, 6)
    rated = ride_number(make_profile(s, [left, right], tracks=["one", "two"]), segment=50.0)
    together = np.sqrt((rated.pi**2).mean())
    assert_allclose(rated.rn_both, 5 * np.exp(-160 * together), rtol=0, atol=EXACT)
    together = np.sqrt((rated.segment_pi**2).mean("track"))
    assert_allclose(rated.segment_rn_both, 5 * np.exp(-160 * together), rtol=0, atol=EXACT)
    alone = ride_number(make_profile(s, left), segment=50.0)
    assert_allclose(alone.rn[0], rated.rn[0], rtol=0, atol=0)
    assert np.isnan(alone.rn_both)


def test_the_weighted_mean_square_of_segments_is_that_of_the_whole():
    s = 0.05 * np.arange(4011)
    settings = RideNumberSettings(window="none")
    rated = ride_number(make_profile(s, rough(s.size)), settings=settings, segment=33.3)
    length = rated.end - rated.start
    whole = (rated.segment_pi[0] ** 2 * length).sum() / length.sum()
    # a segment that ends within a step takes the output there, not that at the end of the step
    assert_allclose(np.sqrt(whole) / rated.pi[0], 1, rtol=0, atol=1e-3)


def test_unequal_spacing_with_samples_on_straight_lines_changes_nothing():
    s, height = 0.25 * np.arange(801), rough(801)
    finer = np.sort(np.concatenate([s, (0.5 * (s[1:] + s[:-1]))[::3]]))
    settings = RideNumberSettings(
        window="none", car=QuarterCar(), start_length=10.0, max_spacing=0.25
    )
    coarse = ride_number(make_profile(s, height), settings=settings)
    fine = ride_number(make_profile(finer, np.interp(finer, s, height)), settings=settings)
    # [m/m] the output is taken at the ends of other steps, and the start by the chord's own length
    assert_allclose(fine.pi, coarse.pi, rtol=0, atol=0.03 * coarse.pi.item())


def test_restart_rates_each_segment_as_a_profile_of_its_own():
    s, height = 0.25 * np.arange(250), rough(250)
    settings = RideNumberSettings(restart=True, max_spacing=0.25)
    rated = ride_number(make_profile(s, height), settings=settings, segment=20.0)
    for at, value in enumerate(rated.segment_rn.values[0]):
        cut = slice(80 * at, 80 * at + 81)
        alone = ride_number(make_profile(s[cut], height[cut]), settings=settings)
        assert_allclose(value, alone.rn[0], rtol=0, atol=EXACT)


def test_constants_can_be_replaced_and_are_recorded():
    profile = make_profile(0.1 * np.arange(1000), rough(1000))
    settings = RideNumberSettings(best=10.0, steepness=80.0, start_length=11.0, car=QuarterCar())
    rated = ride_number(profile, settings=settings)
    assert_allclose(rated.rn, 10 * np.exp(-80 * rated.pi), rtol=0, atol=EXACT)
    record = provenance_steps(rated)[-1]
    assert record["step"] == "ride_number"
    assert record["parameters"]["options"]["steepness"] == 80.0
    assert record["parameters"]["options"]["car"]["tyre_stiffness"] == 653.0


def test_bad_profiles_are_refused():
    s = 0.1 * np.arange(100)
    with pytest.raises(CoverageError, match=r"s = 5 m: has no finite height \(1 of 100"):
        ride_number(make_profile(s, np.where(s == s[50], np.nan, 0.0)))
    with pytest.raises(CoverageError, match="too short for the window"):
        ride_number(make_profile(s[:3], 0 * s[:3]))
    with pytest.raises(SchemaError, match="must be equally spaced for the window sayers"):
        ride_number(make_profile(0.01 * s**2 + s, 0 * s))
    with pytest.raises(SchemaError, match="the others have 100"):
        make_profile(s, rough(99))


@pytest.mark.parametrize("name", ["best", "steepness", "start_length", "speed", "window_length"])
def test_settings_must_be_positive(name):
    with pytest.raises(ValueError, match=f"{name} must be finite and greater than 0"):
        RideNumberSettings(**{name: -1.0})
