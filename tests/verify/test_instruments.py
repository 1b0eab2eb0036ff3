"""Clocks and mounting that are off by a known amount are found, named, and not more than that."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pypdf import PdfReader

import trueterrain
from trueterrain.core.errors import FormatError, SchemaError
from trueterrain.core.schemas import make_profile
from trueterrain.formats.run import open_run
from trueterrain.motion import fuse_motion
from trueterrain.report import write_report_pdf
from trueterrain.simulate.drift import GaussMarkovDrift
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene
from trueterrain.simulate.scene._parts import ScenePass
from trueterrain.verify.certificate import certify_profiler
from trueterrain.verify.findings.finding import Finding
from trueterrain.verify.instruments import boresight_findings, clock_findings

pytestmark = pytest.mark.slow

SURE = 4.0  # standard deviations: less than 1 of 10,000 errors is larger
HELD = 0.01  # [m] by which the runs state a wrong arm ahead, which passes do not tell
# [rad, m, s] by the yaw, which is wrong by 0.008 rad and held: 0.0088, 0.032 and 0.0054 of it
LEANS = {"roll": 7e-5, "lever_y": 2.5e-4, "clock": 4.3e-5}
ABOVE = 2.02  # [m] of the scanner above the ground
# [rad] of the pitch by where a step lies between two scans, which is common to all of their beams
BETWEEN = 1e-3


def drifting(folder, text):
    """Description of the cheapest test, with more settings."""
    s = np.arange(1201.0)
    rng = np.random.default_rng(3)
    for name in ("a", "b"):
        trueterrain.write(make_profile(s, 1e-3 * rng.normal(size=s.size)), folder / f"{name}.csv")
    config = folder / "drift.toml"
    config.write_text(f'profiles = ["a.csv", "b.csv"]\n{text}\n')
    return config


@pytest.fixture(scope="module")
def bounce(recorded_scene):
    """The scene bounce, with few beams; its true clocks are 1.3 ms and -0.7 ms, stated are none."""
    scene, _ = read_scene("bounce")
    scene = replace(
        scene,
        scanner=replace(scene.scanner, beams=31, rate=250.0, spot_rays=1),
        truth=TruthSettings(returns=False),
    )
    (path,) = recorded_scene(scene)
    return path, scene


@pytest.fixture(scope="module")
def passes(recorded_scene):
    """Both directions over the steps of the scene boresight, with little drift of navigation."""
    scene, _ = read_scene("boresight")

    def drive(name, start, *, reverse):
        return ScenePass(
            name=name,
            reverse=reverse,
            start=start,
            length=6.0,
            speed={"kind": "constant", "speed": 5.0},
        )

    scene = replace(
        scene,
        raster=0.01,
        truth=TruthSettings(returns=False, spacing=0.1),
        scanner=Scanner(beams=100, rate=1000.0, range_noise=2e-4, spot_rays=1),
        navigation=Navigation(
            drift=GaussMarkovDrift(height_sd=0.0),
            horizontal_sd=1e-4,
            attitude_sd=(1e-5, 1e-5, 1e-5),
            noise=(1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5),
        ),
        passes=(drive("there", 11.5, reverse=False), drive("back", 14.0, reverse=True)),
    )
    return recorded_scene(scene), scene


def test_both_clocks_are_found(bounce):
    path, scene = bounce
    delay = scene.accelerometers.group_delay
    first, second = clock_findings(open_run(path), accelerometer_delay=delay)
    for found, name, true in (
        (first, "clock of the accelerometers", scene.accelerometers.clock_offset),
        (second, "clock of the scanner", scene.mounting.scanner_clock),
    ):
        assert (found.name, found.unit, found.detected) == (name, "s", True)
        assert_allclose(found.value, true, rtol=0, atol=SURE * found.sd)
        assert found.sd < 2e-4
        assert "Add the value to" in found.meaning


def test_without_its_delay_the_filter_is_part_of_the_clock(bounce):
    path, scene = bounce
    first, second = clock_findings(open_run(path))
    true = scene.accelerometers.clock_offset - scene.accelerometers.group_delay
    assert_allclose(first.value, true, rtol=0, atol=SURE * first.sd)
    # the scanner is compared with what the accelerometers felt, whenever they stamped it
    assert_allclose(second.value, scene.mounting.scanner_clock, rtol=0, atol=SURE * second.sd)


def test_correct_clocks_are_not_detected(bounce):
    path, scene = bounce
    run = open_run(path)
    stated = {
        "scanner_clock": scene.mounting.scanner_clock,
        "accelerometer_clock": scene.accelerometers.clock_offset - scene.accelerometers.group_delay,
    }
    run.attrs["mounting"] = {**run.attrs["mounting"], **stated}
    for found in clock_findings(run):
        assert found.detected is False
        assert abs(found.value) < SURE * found.sd


def test_the_scanner_clock_is_not_observable_while_driving(passes):
    (path, _), _ = passes
    found = clock_findings(open_run(path))
    assert [one.detected for one in found] == [None, None]
    for one in found:
        assert (one.value, one.sd) == (None, None)
        assert "Take a" in one.meaning
        assert str(path.parent) not in one.meaning


@pytest.fixture(scope="module")
def certified(tmp_path_factory, bounce, passes):
    """A certificate of the cheapest test, with runs for the instruments."""
    folder = tmp_path_factory.mktemp("certified")
    text = f'clock = "{bounce[0]}"\nboresight = {json.dumps([str(path) for path in passes[0]])}'
    return certify_profiler("drift", drifting(folder, text))


def test_the_mounting_is_found_and_unobservable_parameters_have_a_reason(certified, passes):
    scene = passes[1]
    found = {one.name: one for one in certified.instruments}
    true, stated = scene.mounting, scene.declared
    for name, value, leans in (
        ("roll of the scanner", true.scanner_rotation[0], LEANS["roll"]),
        ("lever arm of the scanner, left", true.scanner_position[1], LEANS["lever_y"]),
        ("clock of the scanner, over the ground", true.scanner_clock, LEANS["clock"]),
    ):
        assert found[name].detected is True
        atol = leans + SURE * found[name].sd
        assert_allclose(found[name].value, value, rtol=0, atol=atol, err_msg=name)
    up = found["lever arm of the scanner, up"]
    assert (up.value, up.detected) == (None, None)
    assert "Measure lever_z with a tape" in up.meaning
    assert stated.scanner_position[0] - true.scanner_position[0] == pytest.approx(-HELD)
    pitch = found["pitch of the scanner"]
    assert "depends on the lever arm of the scanner, forward, which is held" in pitch.meaning
    # as much wrong as the arm that it leans on
    wrong = pitch.value - true.scanner_rotation[1]
    assert_allclose(wrong, -HELD / ABOVE, rtol=0, atol=np.hypot(BETWEEN, SURE * pitch.sd))


def test_runs_without_common_ground_determine_nothing(passes, bounce):
    (there, _), _ = passes
    path = fuse_motion(open_run(there)).trajectory
    moved = replace(path, position=path.position + np.array([100.0, 0.0, 0.0]))
    (found,) = boresight_findings([there, there], [path, moved])
    assert isinstance(found, Finding)
    assert (found.value, found.detected) == (None, None)
    assert "have no common ground" in found.meaning


def test_a_certificate_holds_them_with_the_hashes_of_their_runs(certified):
    document = certified.to_dict()
    names = [one["name"] for one in document["instruments"]]
    assert names[:2] == ["clock of the accelerometers", "clock of the scanner"]
    assert len(names) == 9
    hashed = [one["name"] for one in document["inputs"]]
    assert hashed == [
        "drift.toml",
        "a.csv",
        "b.csv",
        "bounce-bounce.zarr",
        "boresight-there.zarr",
        "boresight-back.zarr",
    ]
    scales = {one["name"]: one["scale"] for one in document["recorded"]}
    assert scales["a.csv"] == "not in the data: profiles hold no times"
    assert scales["bounce-bounce.zarr"] == "not in the data: times count from any moment"


def test_the_page_and_the_pdf_show_them(certified, tmp_path):
    from trueterrain.report.certificate import build_certificate

    write_report_pdf(build_certificate(certified, []), tmp_path / "c.pdf")
    pages = [page.extract_text() for page in PdfReader(tmp_path / "c.pdf").pages]
    paper = " ".join(" ".join(pages).split())
    assert "Clocks and mounting" in paper
    assert "They are not applied: the figures are those of the runs as recorded." in paper
    for one in certified.instruments:
        if one.value is not None:
            factor = {"s": 1e3, "rad": 180 / np.pi, "m": 1e3}[one.unit]
            for value in (one.value, one.sd):
                assert f"{factor * value:.4f}".replace("-", "\N{MINUS SIGN}") in paper
        else:
            assert "not observable" in paper


def test_runs_of_different_mountings_are_refused(passes):
    runs = [open_run(path) for path in passes[0]]
    path = fuse_motion(runs[0]).trajectory
    runs[1].attrs["mounting"] = {**runs[1].attrs["mounting"], "scanner_clock": 0.001}
    with pytest.raises(SchemaError, match="attribute mounting: differs from that of the first run"):
        boresight_findings(runs, [path, path])
    runs[1].attrs["mounting"] = {**runs[0].attrs["mounting"], "accelerometer_clock": 0.001}
    with pytest.raises(ValueError, match="with a trajectory each"):
        boresight_findings(runs, [path])


@pytest.mark.parametrize("text", ['clock = "none.zarr"', 'boresight = ["x.zarr", "none.zarr"]'])
def test_a_run_that_is_missing_is_named(tmp_path, text):
    with pytest.raises(FileNotFoundError, match=r"there is no run .*(none|x)\.zarr"):
        certify_profiler("drift", drifting(tmp_path, text))


def test_one_run_is_no_boresight(tmp_path):
    with pytest.raises(FormatError, match=r"boresight must name two runs or more, got 'x\.zarr'"):
        certify_profiler("drift", drifting(tmp_path, 'boresight = ["x.zarr"]'))
