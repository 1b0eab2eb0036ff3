"""The command event: sizes, files, and bad input."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.simulate.ground import ExcitationEvent
from trueterrain.vehicle import named_vehicle
from trueterrain.verify.event.design import cross_event, design_event, event_inputs

THESIS = ("--model", "thesis", "--ride", "1.1", "--hop", "11", "--damping", "0.3")
EXACT = 1e-12  # numbers are written with all their digits


def test_the_event_of_the_thesis(run):
    finished = run("event", "design", *THESIS, "--json")
    assert (finished.code, finished.err) == (0, "")
    document = json.loads(finished.out)
    assert list(document) == [
        "design",
        "vehicle",
        "predicted",
        "cut_list",
        "speeds",
        "flags",
        "files",
    ]
    design = document["design"]
    assert (design["number"], design["length"]) == (5, 2.44)
    assert_allclose(design["speed"], 5.368, rtol=0, atol=EXACT)
    assert_allclose(design["spacing"], 0.488, rtol=0, atol=EXACT)
    assert_allclose(design["cleat_ratio"], 0.348, rtol=0, atol=5e-4)
    assert document["predicted"]["strongest"] == "pitch"
    assert "is designed for heave, but excites pitch more" in document["flags"][0]


def test_numbers_are_those_of_the_library(run):
    document = json.loads(run("event", "design", "--vehicle", "sedan", "--json").out)
    car = named_vehicle("sedan")
    design = design_event(event_inputs(car))
    moved = cross_event(
        car, ExcitationEvent(**design.ground).height, design.speed, length=design.extent
    )
    assert_allclose(document["design"]["speed"], design.speed, rtol=0, atol=EXACT)
    assert_allclose(document["predicted"]["laser_span"], moved.laser_span, rtol=0, atol=EXACT)
    assert_allclose(
        list(document["predicted"]["energy"].values()),
        list(moved.energy.values()),
        rtol=0,
        atol=EXACT,
    )
    assert document["design"]["tolerances"] == dict(design.tolerances)


def test_given_values_replace_those_of_the_vehicle(run):
    document = json.loads(
        run(
            "event",
            "design",
            "--wheelbase",
            "4",
            "--ride-tolerance",
            "0.2",
            "--track",
            "1.9",
            "--band",
            "10",
            "12",
            "--json",
        ).out
    )
    assert document["design"]["length"] == 2.0
    assert document["design"]["inputs"]["tolerances"]["ride"] == 0.2
    assert document["cut_list"][0]["length"] == pytest.approx(2.8)
    assert document["speeds"]["band"] == [10.0, 12.0]


def test_text_names_sizes_lumber_driving_and_motion(run):
    text = run("event", "design", *THESIS).out
    for part in (
        "5.37 m/s (19.3 km/h, 12.0 mile/h)",
        "spacing a  0.488 +- 0.0",
        "5 of 2x8",
        "rip from 184 mm",
        "laser 41 mm from peak to peak",
        "The strongest mode of the body is pitch",
        "as printed, w/a is 0.348",
    ):
        assert part.lower() in text.lower(), part


def test_a_vehicle_of_your_own(run, tmp_path):
    scene = tmp_path / "mine.toml"
    scene.write_text(
        'name = "mine"\nground = [{ kind = "plane" }]\n'
        'course = { kind = "straight", length = 50.0 }\n'
        'vehicle = { model = "van", parameters = { sprung_mass = 1800.0 } }\n'
        'passes = [{ name = "one", speed = { kind = "constant", speed = 5.0 } }]\n'
        "mounting = { scanner_position = [-2.0, 0.1, 1.2] }\n"
    )
    document = json.loads(run("event", "design", "--vehicle", scene, "--json").out)
    car = replace(named_vehicle("van"), sprung_mass=1800.0)
    assert_allclose(document["design"]["inputs"]["ride"], event_inputs(car).ride, atol=EXACT)
    design = design_event(event_inputs(car))
    moved = cross_event(
        car,
        ExcitationEvent(**design.ground).height,
        design.speed,
        length=design.extent,
        laser=(-2.0, 0.1),
    )
    assert_allclose(document["predicted"]["laser_span"], moved.laser_span, rtol=0, atol=EXACT)
    scene.write_text(
        scene.read_text()
        .replace("van", "quarter car")
        .replace(", parameters = { sprung_mass = 1800.0 }", "")
    )
    error = run("event", "design", "--vehicle", scene).err
    assert "vehicle must have four wheels, got the model 'quarter car'" in error


def test_a_prediction_for_another_vehicle_is_flagged(run):
    flags = json.loads(run("event", "design", "--hop", "14", "--json").out)["flags"]
    assert any("whose hop is 11.01 Hz, not 14.00" in flag for flag in flags)


def test_one_side_shakes_roll(run):
    arguments = ("--placement", "one side", "--target", "roll", "--events", "2", "--json")
    document = json.loads(run("event", "design", *arguments).out)
    spans = document["predicted"]["spans"]
    assert np.rad2deg(spans["roll"]) > 0.5
    assert document["cut_list"][0]["count"] == 2 * document["design"]["number"]


@pytest.mark.slow
def test_files(run, tmp_path):
    folder = tmp_path / "event"
    finished = run("event", "design", "--vehicle", "van", "-o", folder)
    assert finished.code == 0
    names = {"drawing.svg", "event.pdf", "event.html", "event.json"}
    assert {path.name for path in folder.iterdir()} == {*names, "manifest.json"}
    assert (folder / "event.pdf").read_bytes().count(b"/Type /Page ") == 1
    page = (folder / "event.html").read_text(encoding="utf-8")
    assert "no wheel in hop touches both edges" in page
    written = json.loads((folder / "event.json").read_text(encoding="utf-8"))
    shown = json.loads(run("event", "design", "--vehicle", "van", "--json").out)
    assert written == shown
    assert run("event", "design", "-o", folder).code == 2
    again = tmp_path / "again"
    run("event", "design", "--vehicle", "van", "-o", again)
    for name in names:
        assert (again / name).read_bytes() == (folder / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--vehicle", "lorry"), "vehicle must be one of compact, golden car, sedan, van"),
        (("--hop", "2"), "hop must be from 3 to 400 times ride"),
        (("--hop", "1.5"), "must leave hop above ride"),
        (("--damping", "1.5"), "damping must be greater than 0 and less than 1"),
        (("--length", "-1"), "length must be finite and greater than 0 m"),
        (("--rise", "0.2"), "rise must be at most 89 mm for lumber"),
        (("--events", "0"), "events must be a whole number of at least 1"),
        (("--band", "12", "10"), "low and high must be frequencies"),
        (("--model", "other"), "base-excited"),
    ],
)
def test_bad_arguments(run, arguments, message):
    finished = run("event", "design", *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert message in finished.err
    assert len(finished.err.splitlines()) == 1
