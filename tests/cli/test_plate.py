"""The command plate: sizes, the machined profile, files, and bad input."""

import json

import pytest
from numpy.testing import assert_allclose

import trueterrain
from trueterrain.verify.plate.design import PlateDesign, ScanSetup, machined_profile, view_plate

EXACT = 1e-12  # numbers are written with all their digits
WRITTEN = 1e-7  # [m] last digit in the profile


def test_numbers_are_those_of_the_library(run):
    finished = run("plate", "design", "--offset", "0.6", "--json")
    assert (finished.code, finished.err) == (0, "")
    document = json.loads(finished.out)
    assert list(document) == ["design", "view", "files"]
    plate = PlateDesign()
    view = view_plate(plate, ScanSetup(offset=0.6))
    for material, mass in document["design"]["mass"].items():
        assert_allclose(mass, plate.mass(material), rtol=0, atol=1e-9)
    assert document["design"]["holes"] == [7, 7]
    assert document["view"]["returns"] == view.s.size
    assert [edge["seen"] for edge in document["view"]["edges"]] == [e.seen for e in view.edges]
    assert_allclose(document["view"]["shadows"], view.shadows, rtol=0, atol=EXACT)


def test_text(run):
    text = run("plate", "design", "--offset", "0.6", "--carried", "30").out
    for part in (
        "Plate 1.2 x 1.2 m, 12 mm thick, 7 x 7 holes every 152 mm",
        "135 kg in 5 panels",
        "edge       76 x 15 mm",
        "rectangle, left    at 0.182 m: not seen",
        "saturated",
        "of the profile lie in shadow",
    ):
        assert part in text, part


@pytest.mark.slow
def test_files(run, tmp_path):
    folder = tmp_path / "plate"
    finished = run("plate", "design", "--cleats", "rectangle", "triangle", "-o", folder)
    assert finished.code == 0
    names = {"drawing.svg", "drawing.pdf", "profile.csv", "plate.html", "plate.json"}
    assert {path.name for path in folder.iterdir()} == {*names, "manifest.json"}
    read = trueterrain.open(folder / "profile.csv")
    from trueterrain.verify.plate.design import design_plate

    true = machined_profile(design_plate(["rectangle", "triangle"]))
    assert_allclose(read.height, true.height, rtol=0, atol=WRITTEN)
    assert run("plate", "design", "-o", folder).code == 2
    assert run("plate", "design", "-o", folder, "--force").code == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--offset", "5"), "offset must put the plate under the beams"),
        (("--length", "0.5"), "cleats must lie in order"),
        (("--cleats", "cone"), "rectangle"),
        (("--reflectivity", "2"), "the reflectivity of surface 1 must be from 0 to 1"),
        (("--carried", "0"), "carried must be greater than 0 kg"),
        (("--laser-height", "0"), "height must be finite and greater than 0 m"),
        (("--tolerance", "-1"), "tolerance must be greater than 0 m and at most 10 m"),
    ],
)
def test_bad_arguments(run, arguments, message):
    finished = run("plate", "design", *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert message in finished.err
    assert len(finished.err.splitlines()) == 1
