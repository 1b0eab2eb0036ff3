"""Runs and points as users have them: each is refused in one line, or flagged and counted."""

import json
from dataclasses import replace

import laspy
import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain import formats
from trueterrain.core.schemas import make_points
from trueterrain.formats.run import open_run, write
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene
from trueterrain.simulate.scene._parts import Standing

from ._runs import Damaged

SPACING = 0.02  # [m]
HALF = 0.3  # [m] of the swath: 60 beams, 10 mm apart
LOST = 65535  # as ranges without return are stored
COMMANDS = ("georeference", "grid")

NARROW = {
    "scanner": Scanner(beams=60, swath=2 * HALF, spot_rays=1, dropouts=0.0),
    "truth": TruthSettings(returns=False, spacing=0.1),
    "raster": 0.02,
}


@pytest.fixture(scope="module")
def recorded(recorded_scene):
    """Six metres of a smooth road at 5 m/s, with default errors."""
    scene, _ = read_scene("belgian-two-lanes")
    scene = replace(
        scene,
        **NARROW,
        passes=(replace(scene.passes[0], start=20.0, length=6.0),),
        ground=({"kind": "road", "road_class": "A", "seed": 3, "waves": 100},),
    )
    (path,) = recorded_scene(scene)
    return path


@pytest.fixture
def copy(recorded, tmp_path):
    """A copy of the run to damage."""
    return Damaged(recorded, tmp_path)


@pytest.fixture
def call(run, tmp_path):
    """Call a command on inputs; what it reported, on a surface or points of that name."""

    def called(command, *inputs, json_out=True, spacing=SPACING, half=HALF, **options):
        more = [part for name, value in options.items() for part in (f"--{name}", *value)]
        if command == "grid":
            more += ["--spacing", spacing, "--right", -half, "--left", half]
        output = tmp_path / ("road.crg" if command == "grid" else "points.laz")
        finished = run(
            command, *inputs, "-o", output, "--force", *more, *(["--json"] if json_out else [])
        )
        return finished, (json.loads(finished.out) if json_out and finished.out else None)

    return called


def refused(finished, *words):
    """One line of error, without output, that says these words."""
    assert (finished.code, finished.out) == (2, ""), finished.err
    *notes, last = finished.err.splitlines()
    assert last.startswith("trueterrain: error: ")
    assert not any("error" in line for line in notes)
    for word in words:
        assert word in last


def uncovered(command, report):
    return report["returns"]["scans_uncovered"] if command == "grid" else report["scans_uncovered"]


def bridged_scans(command, report, beams=60):
    """Scans in gaps of the navigation; points are 60 a scan."""
    return report["returns"]["bridged"] if command == "grid" else report["bridged"] / beams


@pytest.mark.parametrize("command", COMMANDS)
def test_a_gap_in_navigation_is_bridged_flagged_and_counted(call, copy, command):
    time = copy.values("navigation/time")
    copy.keep("navigation", (time < 0.5) | (time > 0.8))
    finished, report = call(command, copy.path)
    assert finished.code == 0, finished.err
    assert f"{copy.path}: navigation: a gap is bridged, the longest 0.31 s" in finished.err
    npt.assert_allclose(bridged_scans(command, report), 310, rtol=0, atol=2)
    finished, _ = call(command, copy.path, json_out=False)
    assert "interpolated across gaps of the navigation" in finished.err


@pytest.mark.parametrize("command", COMMANDS)
def test_a_gap_that_is_too_long_to_bridge_is_refused(call, copy, command):
    time = copy.values("navigation/time")
    copy.replace("navigation/time", np.where(time > 0.6, time + 20.0, time))
    finished, _ = call(command, copy.path)
    refused(finished, str(copy.path), "group navigation", "at 0.600000 s")


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("name", "jump", "words"),
    [
        ("navigation/time", 0.25, ("group navigation", "jumps by 0.250000 s at 0.600000 s")),
        ("navigation/time", -0.25, ("group navigation", "must run forward")),
        ("accelerometers/time", -0.05, ("group accelerometers", "must run forward")),
        ("scans/time", -0.25, ("scans, variable time", "must run forward", "value 601")),
    ],
)
def test_a_clock_that_jumps_is_refused(call, copy, command, name, jump, words):
    time = copy.values(name)
    copy.replace(name, np.where(time > 0.6, time + jump, time))
    finished, _ = call(command, copy.path)
    refused(finished, str(copy.path), *words)


def test_a_clock_of_the_scanner_that_jumps_ahead_is_flagged(call, copy):
    """It looks as if the scanner had paused; what comes too late has no motion, and is counted."""
    time = copy.values("scans/time")
    copy.replace("scans/time", np.where(time > 0.6, time + 0.25, time))
    flag = f"{copy.path}: scans: a gap of 0.251 s at 0.600000 s"
    finished, report = call("georeference", copy.path)
    assert finished.code == 0
    assert flag in finished.err
    assert report["scans_uncovered"] > 100
    finished, _ = call("grid", copy.path)
    assert flag in finished.err
    refused(finished, "each cross-section must have a height", "the first at u = 3.02")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_clock_of_the_accelerometers_that_jumps_ahead_is_flagged(call, copy, command):
    time = copy.values("accelerometers/time")
    copy.replace("accelerometers/time", np.where(time > 0.6, time + 0.05, time))
    finished, report = call(command, copy.path)
    assert finished.code == 0, finished.err
    assert "accelerometers: a gap is bridged, the longest 0.0505 s" in finished.err
    npt.assert_allclose(bridged_scans(command, report), 51, rtol=0, atol=2)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_run_without_navigation_is_refused(call, copy, command):
    finished, _ = call(command, copy.lose("navigation").path)
    refused(finished, str(copy.path), "group navigation: is missing")


@pytest.mark.parametrize("command", COMMANDS)
def test_scans_that_navigation_does_not_reach_are_counted(call, copy, command):
    copy.keep("navigation", copy.values("navigation/time") < 0.8)
    finished, report = call(command, copy.path)
    assert finished.code == 0, finished.err
    npt.assert_allclose(uncovered(command, report), 405, rtol=0, atol=2)
    finished, _ = call(command, copy.path, json_out=False)
    assert "405 scans without motion" in finished.err


@pytest.mark.parametrize("command", COMMANDS)
def test_scans_of_another_time_are_refused(call, copy, command):
    copy.replace("scans/time", copy.values("scans/time") + 1000.0)
    finished, _ = call(command, copy.path)
    refused(
        finished,
        str(copy.path),
        "covers none of the 1200 scans, 1000.000 s to 1001.199 s",
        "Compare the clocks",
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_a_run_without_any_return_is_refused(call, copy, command):
    copy.replace("scans/range", LOST)
    finished, _ = call(command, copy.path)
    refused(finished, "no return in 1200 scans")


@pytest.mark.parametrize("command", COMMANDS)
def test_poses_that_are_not_finite_are_gaps(call, copy, command):
    time = copy.values("navigation/time")
    up = np.where((time > 0.5) & (time < 0.6), np.nan, copy.values("navigation/up"))
    finished, report = call(command, copy.replace("navigation/up", up).path)
    assert finished.code == 0, finished.err
    assert "19 epochs are left out: not finite" in finished.err
    assert "navigation: a gap is bridged, the longest 0.1 s" in finished.err
    npt.assert_allclose(bridged_scans(command, report), 100, rtol=0, atol=2)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("name", "rows", "words"),
    [
        ("navigation/roll", slice(None), "has 0 usable epochs"),
        ("navigation/time", 7, "must be finite everywhere, got nan at index 7"),
        ("scans/time", 7, "must be finite everywhere, got nan at index 7"),
    ],
)
def test_motion_without_finite_values_and_times_that_are_not(
    call, copy, command, name, rows, words
):
    values = copy.values(name)
    values[rows] = np.nan
    finished, _ = call(command, copy.replace(name, values).path)
    refused(finished, str(copy.path), words)


def test_a_scanner_of_one_beam_makes_a_line_of_nodes(call, recorded, tmp_path):
    """And all nodes beside it are counted as not seen."""
    tree = open_run(recorded).load()
    tree["scans"] = xr.DataTree(tree["scans"].to_dataset().isel(beam=[30]))
    path = tmp_path / "one.zarr"
    write(tree, path)
    finished, report = call("georeference", path)
    assert (finished.code, report["points"]) == (0, 1200)
    finished, report = call("grid", path)
    assert finished.code == 0, finished.err
    assert report["size"]["v"] == 31
    assert report["nodes"] == report["size"]["u"]
    assert report["holes"]["unseen_nodes"] == 30 * report["size"]["u"]


@pytest.fixture(scope="module")
def standing(recorded_scene):
    """A vehicle that stands, with default errors of navigation."""
    scene, _ = read_scene("bounce")
    drive = replace(scene.passes[0], standing=Standing(duration=1.0))
    (path,) = recorded_scene(replace(scene, **NARROW, passes=(drive,)))
    return path


def test_a_vehicle_that_stands_has_no_trajectory_to_grid_along(call, standing):
    finished, _ = call("grid", standing)
    refused(finished, "does not move far enough", "Give a reference line, or grid over a map")


def test_a_vehicle_that_stands_still_sees_one_line_of_ground(call, standing):
    finished, report = call("georeference", standing)
    assert (finished.code, report["points"]) == (0, 60_000)
    finished, report = call("grid", standing, line=(-4, 0, -1, 0))
    assert finished.code == 0, finished.err
    assert report["size"]["u"] <= 3
    assert report["count"]["median"] > 100


@pytest.mark.slow
def test_spacing_finer_than_the_data_leaves_nodes_that_are_counted(call, recorded):
    """Beams 10 mm apart, scans 5 mm apart, nodes 2 mm apart."""
    finished, report = call("grid", recorded, spacing=0.002)
    assert finished.code == 0, finished.err
    nodes = report["size"]["u"] * report["size"]["v"]
    holes = report["holes"]
    assert report["nodes"] < 0.1 * nodes
    assert report["nodes"] + holes["open_nodes"] + holes["unseen_nodes"] == nodes
    assert report["count"]["median"] == 1
    finished, _ = call("grid", recorded, spacing=0.002, json_out=False)
    assert f"{report['nodes']:,} with height of 1 returns each" in finished.err


def test_runs_of_different_origins_are_refused(call, recorded, copy):
    copy.attribute("origin", [12.0, 48.0, 500.0])
    finished, _ = call("grid", recorded, copy.path)
    refused(finished, str(copy.path), "attribute origin: is [12.0, 48.0, 500.0]", "one local frame")


def test_points_of_different_systems_are_refused(call, tmp_path):
    """Even where coordinates look similar; --crs corrects a wrong one."""
    rng = np.random.default_rng(1)
    files = []
    for name, crs in (("a", "EPSG:32632"), ("b", "EPSG:25832")):
        x, y, z = rng.uniform(0, 2, (3, 2000))
        files.append(tmp_path / f"{name}.laz")
        formats.write(make_points(500_000 + x, 5e6 + y, z, crs=crs), files[-1])
    finished, _ = call("grid", *files, line=(500_000, 5e6 + 1, 500_002, 5e6 + 1))
    refused(finished, "b.laz: ", "same CRS", "'EPSG:25832' after 'EPSG:32632' of a.laz")
    finished, report = call(
        "grid", *files, line=(500_000, 5e6 + 1, 500_002, 5e6 + 1), crs=("EPSG:32632",)
    )
    assert finished.code == 0, finished.err
    assert report["nodes"] > 0


def test_georeferenced_points_know_the_system_they_are_in(call, recorded, tmp_path):
    """So that those of another one cannot be gridded together with them unnoticed."""
    files = []
    for number, crs in enumerate(("EPSG:32632", "EPSG:25832")):
        finished, _ = call("georeference", recorded, crs=(crs,))
        assert finished.code == 0, finished.err
        files.append((tmp_path / "points.laz").rename(tmp_path / f"{number}.laz"))
        with laspy.open(files[-1]) as points:
            assert points.header.parse_crs().to_epsg() == int(crs[5:])
    x, y = 649_000, 5_317_000
    finished, _ = call("grid", *files, bounds=(x, y, x + 1000, y + 1000), spacing=1.0)
    refused(finished, "same CRS")
