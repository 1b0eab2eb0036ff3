"""Response of vehicles against the frequency response, agreement against formulas."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import make_profile
from trueterrain.roughness import IriSettings, iri
from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    QuarterCarParameters,
    frequency_response,
    linear_model,
    named_vehicle,
)
from trueterrain.verify.response import compare_responses, pseudo_damage, vehicle_response

SPEED = 20.0  # [m/s]
SPACING = 0.01  # [m]
STATIONS = np.arange(0.0, 300.0, SPACING)
LEAD = 200.0  # [m], 10 s: the slowest motion has decayed to 1e-7

#: [1] of an amplitude: heights are linear between samples, pi² (0.01 / 5)² / 3 of a wave of 5 m,
#: and the record holds whole periods of it
SINE = 2e-5

#: [m/km] the index sums rates at samples, not travel between them
IRI = 2e-3

ROUNDING = 1e-12  # [1]


def amplitude(signal, frequency, times):
    """Complex amplitude of a sine that the record holds a whole number of times."""
    count = round(round((times[-1] - times[0]) * frequency) / frequency / (times[1] - times[0]))
    turns = np.exp(-2j * np.pi * frequency * times[:count])
    return 2 * (signal[..., :count] * turns).mean(axis=-1)


def rough(seed, tracks=2):
    """Profile whose heights walk at random."""
    steps = np.random.default_rng(seed).normal(0, 2e-4, (tracks, STATIONS.size))
    return make_profile(STATIONS, steps.cumsum(axis=1), tracks=[f"t{n}" for n in range(tracks)])


@pytest.mark.parametrize("tyre_damping", [0.0, 200.0])
@pytest.mark.parametrize("wavelength", [2.0, 5.0, 20.0])
def test_quarter_car_on_a_sine_obeys_its_frequency_response(wavelength, tyre_damping):
    car = QuarterCarParameters(
        sprung_mass=266.0,
        unsprung_mass=32.0,
        suspension_stiffness=24e3,
        suspension_damping=1800.0,
        tyre_stiffness=158e3,
        tyre_damping=tyre_damping,
    )
    wave = make_profile(STATIONS, np.sin(2 * np.pi * STATIONS / wavelength))
    response = vehicle_response(wave, car, speed=SPEED, lead=LEAD)
    f, times = SPEED / wavelength, response.time.values
    body, wheel = frequency_response(linear_model(car), f)[:, 0]
    s = 2j * np.pi * f
    truth = {
        "body_acceleration": s**2 * body,
        "tyre_force": (car.tyre_stiffness + s * car.tyre_damping) * (1 - wheel),
        "suspension_travel": body - wheel,
    }
    # the motion is that on chords, the force that of a sample: it lacks a part of the height
    chords = SINE * (5.0 / wavelength) ** 2
    if tyre_damping:
        chords *= 2  # kinks between chords shake the wheel through the damper, as much again
    # and rates of the ground are those half a step before
    late = abs(s) ** 2 * car.tyre_damping * 0.5 * SPACING / SPEED
    atol = {
        "body_acceleration": abs(truth["body_acceleration"]) * chords,
        "tyre_force": car.tyre_stiffness * chords + late,
        "suspension_travel": abs(truth["suspension_travel"]) * chords,
    }
    for name, expected in truth.items():
        found = abs(amplitude(response[name].values[0], f, times))
        assert_allclose(found, abs(expected), rtol=0, atol=atol[name])


def test_full_car_on_a_twisted_sine_obeys_its_frequency_response():
    car, wavelength = named_vehicle("sedan"), 5.0
    left = np.sin(2 * np.pi * STATIONS / wavelength)
    right = np.sin(2 * np.pi * STATIONS / wavelength + 1.0)
    road = make_profile(STATIONS, [left, right], tracks=["left", "right"])
    response = vehicle_response(road, car, speed=SPEED, lead=LEAD)
    f, times = SPEED / wavelength, response.time.values
    lag = np.exp(-2j * np.pi * car.wheelbase / wavelength)
    ground = np.array([1, np.exp(1j), lag, lag * np.exp(1j)])
    motion = frequency_response(linear_model(car), f) @ ground
    x, y = car.wheel_positions.T
    body = motion[0] - x * motion[1] + y * motion[2]
    stiffness = np.repeat([car.front_tyre_stiffness, car.rear_tyre_stiffness], 2)
    truth = {
        "body_acceleration": (2j * np.pi * f) ** 2 * body,
        "tyre_force": stiffness * (ground - motion[3:]),
        "suspension_travel": body - motion[3:],
    }
    assert list(response.wheel.values) == ["front-left", "front-right", "rear-left", "rear-right"]
    for name, expected in truth.items():
        found = abs(amplitude(response[name].values, f, times))
        # the rear wheels lie between samples, where chords lack pi² (0.01 / 5)² / 2 of the wave
        assert_allclose(found, abs(expected), rtol=0, atol=2 * SINE * abs(expected).max())


def test_golden_car_at_80_km_h_has_the_travel_of_the_iri():
    road = rough(1, tracks=1)
    response = vehicle_response(road, GOLDEN_QUARTER_CAR, speed=80 / 3.6, lead=0.0)
    rate = np.diff(response.suspension_travel.values[0])
    index = iri(road, settings=IriSettings(window="none", start="level")).iri.item()
    found = 1000 * abs(rate).sum() / (STATIONS[-1] - STATIONS[0])
    assert_allclose(found, index, rtol=0, atol=IRI)


def test_a_quarter_car_follows_each_track_separately():
    road = rough(2)
    both = vehicle_response(road, GOLDEN_QUARTER_CAR, speed=SPEED)
    alone = vehicle_response(road.isel(track=[1]), GOLDEN_QUARTER_CAR, speed=SPEED)
    assert both.sel(wheel=["t1"]).equals(alone)


def test_level_ground_of_any_height_causes_no_motion():
    level = make_profile(STATIONS, np.full((2, STATIONS.size), 104.2), tracks=["left", "right"])
    for vehicle in (GOLDEN_QUARTER_CAR, named_vehicle("van")):
        response = vehicle_response(level, vehicle, speed=SPEED)
        # [m/s^2, N, m] rounding of 104 m, times stiffness over mass and time over the step
        assert abs(response.body_acceleration).max() < 1e-8
        assert abs(response.tyre_force).max() < 1e-6
        assert abs(response.suspension_travel).max() < 1e-11


def test_equal_responses_agree_in_all_statistics():
    response = vehicle_response(rough(3), GOLDEN_QUARTER_CAR, speed=SPEED)
    found = compare_responses(response, response)
    assert_allclose(found.rms_ratio, 1, rtol=0, atol=ROUNDING)
    assert_allclose(found.correlation, 1, rtol=0, atol=ROUNDING)
    assert_allclose(found.error, 0, rtol=0, atol=ROUNDING)
    assert_allclose(found.band_ratio, 1, rtol=0, atol=ROUNDING)


def test_gain_and_noise_agree_with_the_formula():
    gain, noise = 0.8, 0.5
    reference = vehicle_response(rough(4), GOLDEN_QUARTER_CAR, speed=SPEED)
    response = gain * reference
    for name in response:
        signal = reference[name] - reference[name].mean("time")
        other = signal[::-1].values  # of the other track: made independent of this one
        other = other - signal.values * (signal.values * other).sum() / (signal.values**2).sum()
        other *= np.sqrt((signal.values**2).sum() / (other**2).sum())
        response[name] = response[name] + noise * other
    found = compare_responses(response, reference)
    total = np.hypot(gain, noise)
    assert_allclose(found.rms_ratio, total, rtol=0, atol=ROUNDING)
    assert_allclose(found.correlation, gain / total, rtol=0, atol=ROUNDING)
    assert_allclose(found.error, np.hypot(gain - 1, noise), rtol=0, atol=ROUNDING)


def test_a_band_ratio_depends_on_its_band_alone():
    reference = vehicle_response(rough(5), GOLDEN_QUARTER_CAR, speed=SPEED)
    spectrum = np.fft.rfft(reference.tyre_force.values, axis=1)
    count = reference.sizes["time"]
    frequency = np.fft.rfftfreq(count, SPACING / SPEED)
    spectrum[:, (frequency > 7.5) & (frequency < 20.5)] *= 0.5  # beyond the band: the window leaks
    damped = reference.copy()
    damped["tyre_force"] = ("wheel", "time"), np.fft.irfft(spectrum, count, axis=1)
    ratio = compare_responses(
        damped, reference, bands=[(0.5, 7.0), (8.0, 20.0), (21.0, 50.0), (3000.0, 4000.0)]
    ).band_ratio.sel(quantity="tyre_force")
    assert_allclose(ratio[:3], [1, 0.5, 1], rtol=0, atol=1e-6)  # [1] the window leaks
    assert np.isnan(ratio[3])  # beyond what the samples show


def test_damage_of_the_example_of_astm_e1049():
    load = [-2, 1, -3, 5, -1, 3, -4, 4, -2]
    cycles = {3: 0.5, 4: 1.5, 6: 0.5, 8: 1.0, 9: 0.5}  # table of the standard: ranges and counts
    for exponent in (1.0, 3.0, 5.0):
        truth = sum(count * (0.5 * size) ** exponent for size, count in cycles.items())
        assert_allclose(pseudo_damage(load, exponent=exponent), truth, rtol=0, atol=1e-9)


def test_damage_grows_with_the_power_of_the_load():
    reference = vehicle_response(rough(9), GOLDEN_QUARTER_CAR, speed=SPEED)
    found = compare_responses(1.1 * reference, reference, exponent=4.0)
    assert_allclose(found.damage_ratio, 1.1**4, rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="exponent must be greater than 0, got 0"):
        pseudo_damage([0.0, 1.0], exponent=0.0)
    with pytest.raises(ValueError, match="one row of finite values"):
        pseudo_damage([0.0, np.nan])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": 0.0}, "speed must be greater than 0 m/s"),
        ({"speed": np.nan}, "speed must be greater than 0 m/s"),
        ({"lead": -1.0}, "lead must be at least 0 m"),
    ],
)
def test_impossible_drives_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        vehicle_response(rough(6), GOLDEN_QUARTER_CAR, **{"speed": SPEED, **change})


def test_a_full_car_needs_two_tracks():
    with pytest.raises(ValueError, match="must have two tracks, left and right, got 1"):
        vehicle_response(rough(7, tracks=1), named_vehicle("van"), speed=SPEED)


def test_bad_profiles_are_refused_with_place_and_cure():
    s = STATIONS[:500]
    holed = np.zeros(500)
    holed[120] = np.nan
    with pytest.raises(CoverageError, match=r"s = 1\.2 m.*no finite height.*Fill the gap"):
        vehicle_response(make_profile(s, holed), GOLDEN_QUARTER_CAR, speed=SPEED, lead=1.0)
    uneven = make_profile(s**1.1, np.zeros(500))
    with pytest.raises(SchemaError, match="equally spaced for a vehicle to drive on"):
        vehicle_response(uneven, GOLDEN_QUARTER_CAR, speed=SPEED, lead=1.0)
    short = make_profile(s, np.zeros((2, 500)), tracks=["l", "r"])
    with pytest.raises(CoverageError, match=r"4\.99 m long.*lead of 4 m and a wheelbase of 2\.5"):
        vehicle_response(short, named_vehicle("sedan"), speed=SPEED, lead=4.0)


def test_responses_of_other_drives_are_not_compared():
    road = rough(8)
    slow, fast = (vehicle_response(road, GOLDEN_QUARTER_CAR, speed=v) for v in (10.0, 20.0))
    with pytest.raises(SchemaError, match=r"same wheels and times.*same vehicle"):
        compare_responses(slow, fast)
    with pytest.raises(ValueError, match="bands must ascend from 0 Hz or more, got 3 to 2 Hz"):
        compare_responses(slow, slow, bands=[(3.0, 2.0)])
