"""Pages of excitation events and calibration plates, as Python users write them."""

import json

import pytest

from trueterrain.core.errors import OutputError
from trueterrain.report import predict_event, write_event_page, write_plate_page
from trueterrain.vehicle import named_vehicle
from trueterrain.verify.event.design import design_event, event_inputs
from trueterrain.verify.plate.design import PlateDesign, ScanSetup, view_plate


@pytest.fixture
def event():
    car = named_vehicle("van")
    return predict_event(design_event(event_inputs(car, "pitch")), car, vehicle="van")


def test_the_page_of_an_event_is_a_folder_of_files(event, tmp_path):
    names = write_event_page(event, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(names)
    assert json.loads((tmp_path / "event.json").read_text())["design"] == event.design.to_dict()


def test_an_event_under_one_side_rolls_the_vehicle():
    car = named_vehicle("van")
    both, left = (
        predict_event(design_event(event_inputs(car), placement=placement), car).response
        for placement in ("across", "one side")
    )
    assert both.span("roll") < 1e-6 < 1e-3 < left.span("roll")  # [rad]


def test_a_band_of_falling_frequencies_is_refused(event):
    with pytest.raises(ValueError, match="frequencies above 0 Hz in order"):
        predict_event(event.design, event.car, band=(12.0, 8.0))


def test_the_page_of_a_plate_is_a_folder_of_files(tmp_path):
    design, setup = PlateDesign(), ScanSetup(offset=0.6)
    names = write_plate_page(design, view_plate(design, setup), setup, tmp_path, carried=10.0)
    assert {path.name for path in tmp_path.iterdir()} == set(names)
    numbers = json.loads((tmp_path / "plate.json").read_text())["design"]
    assert numbers["panels"]["steel"] == design.panels("steel", 10.0)


@pytest.mark.slow
def test_a_page_replaces_files_only_if_asked(event, tmp_path):
    write_event_page(event, tmp_path)
    with pytest.raises(OutputError, match="exists"):
        write_event_page(event, tmp_path)
    assert len(write_event_page(event, tmp_path, force=True)) == 4
