"""The command plot on recorded runs and on navigation; figures themselves have their own tests."""

import numpy as np
import pytest

from trueterrain.simulate.body import Wave
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import Scene, ScenePass, Vehicle


@pytest.fixture(scope="module")
def runs(recorded_scene):
    """Two passes of a second over a plane, with few beams."""
    swing = Wave(component="up", amplitude=0.01, frequency=2.0)
    scene = Scene(
        name="plane",
        course={"kind": "straight", "length": 2.0},
        ground=({"kind": "plane"},),
        passes=tuple(
            ScenePass(name=name, speed={"kind": "constant", "speed": 2.0}) for name in ("a", "b")
        ),
        vehicle=Vehicle(model="rigid", height=0.8, waves=(swing,)),
        scanner=Scanner(beams=21, rate=100.0, spot_rays=1),
    )
    return recorded_scene(scene)


def is_png(path):
    return path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("show", ["ranges", "scan", "motion", "drift", "spectrum"])
def test_each_part_of_a_run_is_drawn(run, runs, tmp_path, show):
    picture = tmp_path / "x.png"
    done = run("plot", runs[0], "--show", show, "-o", picture, "--resolution", "40")
    assert (done.code, done.out) == (0, "")
    assert "x.png: written" in done.err
    assert is_png(picture)


def test_a_run_is_shown_as_ranges_and_several_as_drift(run, runs, tmp_path):
    for files, name in ((runs[:1], "one.svg"), (runs, "two.svg")):
        assert run("plot", *files, "-o", tmp_path / name).code == 0
    assert "Distance below the scanner" in texts(tmp_path / "one.svg")
    assert "Error of height" in texts(tmp_path / "two.svg")


def texts(path):
    """Texts of an SVG, whose glyphs are drawn but whose words stand in comments."""
    return path.read_text(encoding="utf-8")


def test_a_scan_at_a_time(run, runs, tmp_path):
    assert run("plot", runs[0], "--show", "scan", "--at", "0.5", "-o", tmp_path / "a.svg").code == 0
    assert "scanner at 0.5 s" in texts(tmp_path / "a.svg")
    done = run("plot", runs[0], "--show", "scan", "--at", "7", "-o", tmp_path / "b.svg")
    assert done.code == 2
    assert "there is no scan at 7 s. Give a time from 0 s to 0.99 s." in done.err
    assert not (tmp_path / "b.svg").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--show", "motion", "--at", "0.5"], "--at is for --show ranges and --show scan"),
        (["--show", "nothing"], "nothing"),
    ],
)
def test_invalid_options_are_refused(run, runs, tmp_path, arguments, message):
    done = run("plot", runs[0], *arguments, "-o", tmp_path / "x.png")
    assert done.code == 2
    assert message in done.err


def test_only_the_drift_is_drawn_of_several_runs(run, runs, tmp_path):
    done = run("plot", *runs, "--show", "scan", "-o", tmp_path / "x.png")
    assert done.code == 2
    assert "of several runs only the drift is drawn, got --show scan" in done.err


def test_runs_and_profiles_are_not_drawn_together(run, runs, tmp_path):
    profile = tmp_path / "p.csv"
    profile.write_text("s,height\n0,0\n1,0\n2,0\n")
    done = run("plot", runs[0], profile, "-o", tmp_path / "x.png")
    assert done.code == 2
    assert "p.csv: only runs are drawn together, this is profile. Plot it alone." in done.err
    done = run("plot", profile, "--show", "drift", "-o", tmp_path / "x.png")
    assert "p.csv: --show and --at are for runs, this is profile." in done.err


def test_navigation_tables_are_recognised_by_their_columns(run, tmp_path):
    table = tmp_path / "ins.csv"
    rows = np.column_stack([np.arange(5.0), np.arange(5.0), *np.zeros((5, 5))])
    header = "time,east,north,up,roll,pitch,yaw"
    np.savetxt(table, rows, delimiter=",", header=header, comments="")
    assert run("plot", table, "-o", tmp_path / "path.svg").code == 0
    assert "North of the origin" in texts(tmp_path / "path.svg")


def test_an_sbet_and_boreas_poses(run, data, tmp_path):
    for number, path in enumerate(
        (
            data / "scanning/georeference/leeward/sbet.out",
            data / "scanning/trajectories/boreas-2021-08-05-13-34.lidar_poses.csv",
        )
    ):
        picture = tmp_path / f"{number}.png"
        assert run("plot", path, "-o", picture, "--resolution", "40").code == 0
        assert is_png(picture)


def test_accuracies_and_paths_cannot_be_drawn(run, tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("easting,northing\n0,0\n1,0\n")
    done = run("plot", path, "-o", tmp_path / "x.png")
    assert done.code == 2
    assert "path.csv: holds a path without heights. Plot what it lies on" in done.err
