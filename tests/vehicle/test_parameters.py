"""Parameters: what they refuse, and that the named sets are those of their sources."""

import re
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.vehicle import (
    GOLDEN_QUARTER_CAR,
    FullCarParameters,
    QuarterCarParameters,
    named_vehicle,
    vehicle_names,
)

# Rounding to the ten digits at which the sets are written down [1]
DIGITS = 1e-9

# The sources were converted from pounds, and the whole mass was rounded before: a part of one [kg]
POUND = 1e-3

# Rounding of sums and products of doubles [1]
ROUNDING = 1e-12

FILES = {
    "compact": "parameters_vehicle1.yaml",
    "sedan": "parameters_vehicle2.yaml",
    "van": "parameters_vehicle3.yaml",
}


def read_numbers(path: Path) -> dict[str, float]:
    """The lines "name: number" at the outer level of a YAML file."""
    found = re.findall(r"^(\w+): *([-+]?\d[\d.eE+-]*)\s*$", path.read_text("utf-8"), re.MULTILINE)
    return {name: float(number) for name, number in found}


@pytest.mark.parametrize("name", FILES)
def test_named_vehicles_are_those_of_their_files(name: str, data: Path):
    source = read_numbers(data / "motion" / "commonroad" / FILES[name])
    expected = {
        "sprung_mass": source["m_s"],
        "pitch_inertia": source["I_y_s"],
        "roll_inertia": source["I_Phi_s"],
        "front_axle": source["a"],
        "rear_axle": source["b"],
        "front_track": source["T_f"],
        "rear_track": source["T_r"],
        "front_unsprung_mass": source["m_uf"] / 2,
        "rear_unsprung_mass": source["m_ur"] / 2,
        "front_suspension_stiffness": source["K_sf"],
        "rear_suspension_stiffness": source["K_sr"],
        "front_suspension_damping": source["K_sdf"],
        "rear_suspension_damping": source["K_sdr"],
        "front_tyre_stiffness": source["K_zt"],
        "rear_tyre_stiffness": source["K_zt"],
        "front_tyre_damping": 0.0,
        "rear_tyre_damping": 0.0,
        "front_anti_roll_stiffness": -source["K_tsf"],
        "rear_anti_roll_stiffness": -source["K_tsr"],
        "cg_height": source["h_s"],
    }
    vehicle = named_vehicle(name)
    assert set(expected) == {field.name for field in fields(vehicle)}
    for field, truth in expected.items():
        value = getattr(vehicle, field)
        assert_allclose(value, truth, rtol=0, atol=DIGITS * abs(truth), err_msg=field)
    # the unsprung masses of the source are those of axles: with the body they make its whole mass
    assert_allclose(vehicle.total_mass, source["m"], rtol=0, atol=POUND)


def test_the_golden_car_has_its_published_ratios():
    car = GOLDEN_QUARTER_CAR
    ratios = [
        car.suspension_stiffness / car.sprung_mass,
        car.tyre_stiffness / car.sprung_mass,
        car.suspension_damping / car.sprung_mass,
        car.unsprung_mass / car.sprung_mass,
    ]
    assert_allclose(ratios, [63.3, 653.0, 6.0, 0.15], rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("axle", ["front", "rear"])
def test_the_corners_of_the_golden_car_are_golden(axle):
    assert named_vehicle("golden car").corner(axle) == GOLDEN_QUARTER_CAR


def test_corners_carry_the_body():
    van = named_vehicle("van")
    front, rear = van.corner("front"), van.corner("rear")
    carried = 2 * (front.sprung_mass + rear.sprung_mass)
    assert_allclose(carried, van.sprung_mass, rtol=0, atol=ROUNDING * van.sprung_mass)
    # moments about the centre of gravity balance
    moment = front.sprung_mass * van.front_axle - rear.sprung_mass * van.rear_axle
    assert_allclose(moment, 0.0, rtol=0, atol=ROUNDING * van.sprung_mass)
    assert front.suspension_stiffness == van.front_suspension_stiffness
    assert rear.unsprung_mass == van.rear_unsprung_mass


def test_wheels_stand_front_left_first_and_left_is_positive():
    van = named_vehicle("van")
    x, y = van.wheel_positions.T
    assert (np.sign(x) == [1, 1, -1, -1]).all()
    assert (np.sign(y) == [1, -1, 1, -1]).all()
    assert_allclose(x[0] - x[2], van.wheelbase, rtol=0, atol=ROUNDING)
    assert_allclose(y[2] - y[3], van.rear_track, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("field", [field.name for field in fields(QuarterCarParameters)])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_a_quarter_car_refuses_what_cannot_be(field, value):
    with pytest.raises(ValueError, match=f"^{field} must be finite and .* 0 .*, got {value}$"):
        replace(GOLDEN_QUARTER_CAR, **{field: value})


@pytest.mark.parametrize("field", [field.name for field in fields(FullCarParameters)])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_a_full_car_refuses_what_cannot_be(field, value):
    with pytest.raises(ValueError, match=f"^{field} must be finite and .* 0 .*, got {value}$"):
        replace(named_vehicle("van"), **{field: value})


def test_errors_name_the_unit():
    with pytest.raises(ValueError, match=r"sprung_mass must .* greater than 0 kg, got -5"):
        replace(GOLDEN_QUARTER_CAR, sprung_mass=-5)
    with pytest.raises(ValueError, match=r"front_anti_roll_stiffness must .* at least 0 N m/rad"):
        replace(named_vehicle("van"), front_anti_roll_stiffness=-1)


def test_only_damping_and_bars_may_be_absent():
    van = named_vehicle("van")
    for field in fields(van):
        if field.name.endswith(("damping", "anti_roll_stiffness")):
            assert getattr(replace(van, **{field.name: 0.0}), field.name) == 0.0
        else:
            with pytest.raises(ValueError, match="greater than 0"):
                replace(van, **{field.name: 0.0})


def test_parameters_do_not_change():
    with pytest.raises(FrozenInstanceError):
        named_vehicle("van").sprung_mass = 1.0  # type: ignore[misc]  # what is tested


def test_a_corner_of_no_axle_is_refused():
    with pytest.raises(ValueError, match="axle must be 'front' or 'rear', got 'middle'"):
        named_vehicle("van").corner("middle")  # type: ignore[arg-type]  # what is tested


def test_every_name_has_a_vehicle():
    assert vehicle_names() == ("compact", "golden car", "sedan", "van")
    for name in vehicle_names():
        assert isinstance(named_vehicle(name), FullCarParameters)


@pytest.mark.parametrize(
    ("name", "hint"), [("Golden Car", "'golden car'"), ("vann", "'van'"), ("sedans", "'sedan'")]
)
def test_a_misspelt_name_gets_a_suggestion(name, hint):
    with pytest.raises(ValueError, match=f"got {name!r}; did you mean {hint}\\?"):
        named_vehicle(name)


def test_an_unknown_name_gets_the_known_ones():
    with pytest.raises(ValueError, match=r"one of compact, golden car, sedan, van, got 'xyzzy'$"):
        named_vehicle("xyzzy")
