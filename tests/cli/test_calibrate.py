"""The command calibrate: passes over the steps of the scene `boresight`, with known mounting."""

import json
import re
import shutil
import tomllib
from dataclasses import replace
from typing import get_args

import numpy as np
import numpy.testing as npt
import pytest
import zarr

from trueterrain.cli.calibrate import Name
from trueterrain.formats.run import open_run
from trueterrain.georeference._patches import NAMES
from trueterrain.simulate.drift import GaussMarkovDrift
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene
from trueterrain.simulate.scene._parts import ScenePass
from trueterrain.survey import read_survey

pytestmark = pytest.mark.slow

SURE = 4.0  # standard deviations: less than 1 of 10,000 errors is larger
# Where steps lie between the columns of 200 beams is common to all scans; see the tests of
# `trueterrain.georeference.calibrate`.
CLOSE = {"roll": 2e-5, "pitch": 3e-4, "yaw": 3e-4, "lever_y": 5e-4, "clock": 3e-5}
OFFSET = 1e-3  # [m] of the height of a pass: white noise of navigation, and what rts leaves
ROUNDED = 1e-9  # [rad, m, s] of what is written
# what the scanner itself does not tell, and what the body tells of errors of its roll as it rolls
PASSES = 80
LOWER = 0.042  # [m] of the second and fourth pass


def drive(name, *, reverse=False, lane=0.0, speed=5.0):
    """A pass whose laser, 2.25 m behind the body, sees stations 8.75 to 16.75 m."""
    return ScenePass(
        name=name,
        reverse=reverse,
        lane=lane,
        start=14.5 if reverse else 11.0,
        length=8.0,
        speed={"kind": "constant", "speed": speed},
    )


@pytest.fixture(scope="module")
def scene():
    """Both directions in one lane, faster in the lanes next to it; navigation hardly drifts."""
    found, _ = read_scene("boresight")
    return replace(
        found,
        raster=0.01,
        truth=TruthSettings(returns=False, spacing=0.1),
        scanner=Scanner(beams=200, rate=1000.0, range_noise=2e-4, spot_rays=1),
        navigation=Navigation(
            drift=GaussMarkovDrift(height_sd=0.0, between_passes=-LOWER),
            horizontal_sd=1e-4,
            attitude_sd=(1e-5, 1e-5, 1e-5),
            noise=(1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5),
        ),
        passes=(
            drive("there"),
            drive("back", reverse=True),
            drive("left", lane=1.0, speed=9.0),
            drive("right", reverse=True, lane=-1.0, speed=7.0),
        ),
    )


@pytest.fixture(scope="module")
def runs(scene, recorded_scene):
    return recorded_scene(scene)


@pytest.fixture
def taped(scene):
    """What a tape tells: the arm ahead and up."""
    x, _, z = scene.mounting.scanner_position
    return "--scanner-position", x, 0.0, z


def true(scene):
    mounting = scene.mounting
    values = [*mounting.scanner_rotation, *mounting.scanner_position, mounting.scanner_clock]
    return dict(zip(NAMES, values, strict=True))


def test_parameters_are_those_of_the_library():
    assert get_args(Name) == NAMES


def test_the_mounting_is_found_and_a_survey_takes_it(run, runs, scene, taped, tmp_path):
    output = tmp_path / "calibration.toml"
    # navigation alone: it is good here, and its errors are white, as the standard deviations want
    how = ("--method", "navigation", "--max-angle-sd", 0.001)
    finished = run("calibrate", *runs, *taped, *how, "-o", output, "--json")
    assert (finished.code, finished.err) == (0, "")
    found, truth = json.loads(finished.out), true(scene)
    assert found["output"] == str(output)
    assert found["runs"] == [str(path) for path in runs]
    assert set(found["value"]) == set(found["sd"]) == set(CLOSE)
    for name, value in found["value"].items():
        atol = np.hypot(CLOSE[name], SURE * found["sd"][name])
        npt.assert_allclose(value, truth[name], rtol=0, atol=atol, err_msg=name)
        assert abs(found["before"][name] - truth[name]) > 5 * found["sd"][name], name
    assert set(found["not_observable"]) == {"lever_x", "lever_z"}
    assert "Measure lever_z with a tape" in found["not_observable"]["lever_z"]
    assert 1 < found["condition"] < 100
    assert found["residual"]["after"] < 0.5 * found["residual"]["before"]
    npt.assert_allclose(found["offset"], [0, -LOWER, 0, -LOWER], rtol=0, atol=OFFSET)

    text = output.read_text()
    assert re.search(
        r"# Roll, pitch, yaw \[rad\]; standard deviation: (\d\.\de-\d\d(, )?){3}\n", text
    )
    assert re.search(r"# Forward, left, up \[m\]; standard deviation: held, \d.*, held\n", text)
    shutil.copytree(runs[0], tmp_path / "there.zarr")
    survey = tmp_path / "survey.toml"
    survey.write_text(f'[[runs]]\npath = "there.zarr"\n{text}')
    override = read_survey(survey).runs[0].mounting
    mounting = override.over(scene.declared)
    for field, value in found["mounting"].items():
        npt.assert_allclose(getattr(mounting, field), value, rtol=0, atol=ROUNDED, err_msg=field)


def test_unobservable_parameters_are_reported_with_the_cure(run, runs, tmp_path):
    finished = run("calibrate", *runs[:2], "-o", tmp_path / "c.toml")
    assert finished.code == 0
    assert finished.err == f"{tmp_path / 'c.toml'}: the mounting for survey.toml\n"
    assert re.search(r"^roll +0\.2\d+ +0\.0\d+ +0\.0000 deg$", finished.out, re.MULTILINE)
    assert re.search(r"^lever_z +1200\.0000 +held +1200\.0000 mm$", finished.out, re.MULTILINE)
    for line in (
        r"lever_z is not .*: sd \d+ mm, at most 3\.0 mm is required.*\. Measure lever_z with a "
        r"tape: it shifts all passes equally\.",
        r"condition number \d.*",
        r"pitch depends on lever_x, which is held: an error of 10 mm there changes pitch by "
        r"0\.28 deg",
        r"boresight-back\.zarr lies 4\d\.\d mm \(sd 0\.\d+\) below boresight-there\.zarr",
    ):
        assert re.search(f"^{line}$", finished.out, re.MULTILINE), (line, finished.out)
    held = tomllib.loads((tmp_path / "c.toml").read_text())["runs"]["mounting"]
    assert held["scanner_position"][2] == 1.2


def test_an_unobservable_parameter_that_is_requested_is_refused(run, runs, tmp_path):
    asked = ("--parameter", "roll", "--parameter", "lever_z")
    finished = run("calibrate", *runs[:2], *asked, "-o", tmp_path / "c.toml")
    assert (finished.code, finished.out) == (2, "")
    assert len(finished.err.splitlines()) == 1
    assert "the passes do not determine lever_z" in finished.err
    assert "Measure lever_z with a tape" in finished.err
    assert list(tmp_path.iterdir()) == []
    finished = run("calibrate", *runs[:2], *asked, "--unobservable", "hold", "--json")
    assert list(json.loads(finished.out)["value"]) == ["roll"]


def test_errors_of_the_motion_are_named_where_they_alone_hide_a_parameter(run, runs, tmp_path):
    """A roll error of 0.001 rad in each pass averages to 0.00005 rad over 400 of them.

    The body that rolls carries its scanner 1 mm aside, which tells nothing if passes are not known
    to lie at their nominal positions.
    """
    reported = {
        "sd_roll": 0.001,
        "sd_pitch": 0.001,
        "sd_east": 0.03,
        "sd_north": 0.03,
    }  # [rad], [m]
    for path in runs[:2]:
        shutil.copytree(path, tmp_path / path.name)
        group = zarr.open_group(tmp_path / path.name, mode="r+")["navigation"]
        for name, sd in reported.items():
            group[name][:] = sd
    stores = sorted(tmp_path.iterdir())
    how = ("--method", "navigation", "--max-angle-sd", 5e-5)
    finished = run("calibrate", *stores, "--parameter", "roll", *how)
    assert (finished.code, finished.out) == (2, "")
    found = re.search(r"Errors of the motion hide roll: about (\d+) such passes", finished.err)
    assert found, finished.err
    npt.assert_allclose(int(found[1]), 400, rtol=0, atol=PASSES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("A", "A"), "is named twice"),
        (("A", "TEXT"), "must be a recorded run, but is"),
        (("A", "MOVED"), "attribute mounting: differs from that of"),
        (("A", "AWAY"), "attribute origin"),
        (("A", "B", "-o", "TEXT"), "exists already"),
        (("A", "B", "--parameter", "rol"), "rol"),
        (("A", "B", "--spacing", 0), "spacing must be greater than 0"),
        (("A", "B", "--area", 100, 100, 101, 101), "the passes have no common ground"),
        (("A",), "RUN2"),
    ],
)
def test_invalid_arguments_are_one_line(run, runs, tmp_path, arguments, message):
    places = {"A": runs[0], "B": runs[1], "TEXT": tmp_path / "profile.csv"}
    places["TEXT"].write_text("s,height\n0,0\n1,0\n")
    for name in ("MOVED", "AWAY"):
        if name in arguments:
            places[name] = tmp_path / f"{name}.zarr"
            shutil.copytree(runs[1], places[name])
            attributes = zarr.open_group(places[name], mode="r+").attrs
            if name == "AWAY":
                attributes["origin"] = [12.0, 48.0, 500.0]
            else:
                attributes["mounting"] = {**attributes["mounting"], "scanner_clock": 0.001}
    before = sorted(tmp_path.iterdir())
    finished = run("calibrate", *(places.get(word, word) for word in arguments))
    assert (finished.code, finished.out) == (2, "")
    assert len(finished.err.splitlines()) == 1
    assert message in finished.err
    assert sorted(tmp_path.iterdir()) == before


def test_a_mounting_that_is_named_holds_for_all_runs(run, runs, tmp_path):
    """Runs that differ in what is named do not matter."""
    moved = tmp_path / "moved.zarr"
    shutil.copytree(runs[1], moved)
    attributes = zarr.open_group(moved, mode="r+").attrs
    attributes["mounting"] = {**attributes["mounting"], "scanner_clock": 0.001}
    assert open_run(moved).attrs["mounting"]["scanner_clock"] == 0.001
    finished = run(
        "calibrate", runs[0], moved, "--scanner-clock", 0.0008, "--parameter", "roll", "--json"
    )
    assert finished.code == 0, finished.err
    found = json.loads(finished.out)
    assert found["mounting"]["scanner_clock"] == 0.0008
    assert list(found["value"]) == ["roll"]
