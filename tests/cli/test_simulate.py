"""The commands simulate and init: runs on disk, summaries, and no partial output."""

import json
import re
from contextlib import contextmanager

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain import formats
from trueterrain.core.schemas import make_surface
from trueterrain.formats.run import check_run, open_run
from trueterrain.simulate.scene import Scene, read_scene, scene_names

SMALL = """
name = "small"
title = "Two short passes"
raster = 0.02
course = { kind = "straight", length = 1.0 }
ground = [{ kind = "sine", amplitude = 0.01, wavelength = 2.0 }]
vehicle = { model = "rigid" }
scanner = { beams = 20, spot_rays = 1 }
truth = { spacing = 0.1 }
passes = [
    { name = "there", speed = { kind = "constant", speed = 5.0 } },
    { name = "back", reverse = true, speed = { kind = "constant", speed = 4.0 } },
]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture
def runs(tmp_path):
    return tmp_path / "runs"


def ranges(path):
    return open_run(path)["scans"]["range"].values


@pytest.mark.slow
def test_each_pass_becomes_a_run(run, scene, runs):
    finished = run("simulate", scene, "-o", runs)
    assert (finished.code, finished.err) == (0, "")
    assert sorted(path.name for path in runs.iterdir()) == ["small-back.zarr", "small-there.zarr"]
    lines = finished.out.splitlines()
    for line, name, scans, seconds in zip(
        lines, ("there", "back"), (200, 250), ("0.200", "0.250"), strict=True
    ):
        path = runs / f"small-{name}.zarr"
        check_run(open_run(path), path)
        said = rf"{re.escape(str(path))} +{scans} scans of 20 beams in {seconds} s, \d+\.\d MB"
        assert re.fullmatch(said, line)


@pytest.mark.slow
def test_json_has_the_same_values(run, scene, runs):
    finished = run("simulate", scene, "-o", runs, "--json", "--seed", 9)
    document = json.loads(finished.out)
    assert document["scene"] == "small"
    assert document["title"] == "Two short passes"
    assert document["seed"] == 9
    there, back = document["runs"]
    assert there["pass"] == "there"
    assert there["path"] == str(runs / "small-there.zarr")
    assert (there["scans"], there["beams"]) == (200, 20)
    npt.assert_allclose(back["seconds"], 0.25, rtol=0, atol=1e-9)
    files = [file for file in (runs / "small-back.zarr").rglob("*") if file.is_file()]
    assert back["bytes"] == sum(file.stat().st_size for file in files)


@pytest.mark.slow
def test_the_seed_determines_the_noise(run, scene, tmp_path):
    recorded = {}
    for name, options in {"a": (), "b": (), "c": ("--seed", 1), "d": ("--seed", 2)}.items():
        command = "simulate", scene, "-o", tmp_path / name, "--pass", "there"
        assert run(*command, *options).code == 0
        recorded[name] = ranges(tmp_path / name / "small-there.zarr")
    npt.assert_array_equal(recorded["a"], recorded["b"])
    npt.assert_array_equal(recorded["a"], recorded["c"])  # as the scene has it
    assert (recorded["a"] != recorded["d"]).any()


@pytest.mark.slow
def test_a_pass_alone_is_as_among_all(run, scene, tmp_path):
    run("simulate", scene, "-o", tmp_path / "all")
    finished = run("simulate", scene, "-o", tmp_path / "one", "--pass", "back")
    assert finished.code == 0
    assert [path.name for path in (tmp_path / "one").iterdir()] == ["small-back.zarr"]
    npt.assert_array_equal(
        ranges(tmp_path / "one" / "small-back.zarr"), ranges(tmp_path / "all" / "small-back.zarr")
    )
    both = run("simulate", "--pass", "back", scene, "--pass", "there", "-o", tmp_path / "two")
    assert len(both.out.splitlines()) == 2


def test_a_pass_that_is_not_there(run, scene, runs):
    finished = run("simulate", scene, "-o", runs, "--pass", "bak")
    assert finished.code == 2
    assert "small.toml: --pass must be one of there, back, got 'bak'." in finished.err
    assert not runs.exists()


@pytest.mark.slow
def test_runs_are_not_overwritten_and_nothing_is_driven_before(run, scene, runs, monkeypatch):
    assert run("simulate", scene, "-o", runs, "--pass", "back").code == 0
    before = ranges(runs / "small-back.zarr")
    with monkeypatch.context() as patched:
        patched.setattr("trueterrain.simulate.scene.record_pass", None)  # must not be called
        finished = run("simulate", scene, "-o", runs, "--seed", 5)
    assert finished.code == 2
    assert finished.err.count("\n") == 1
    assert "small-back.zarr: exists already and is not overwritten" in finished.err
    assert [path.name for path in runs.iterdir()] == ["small-back.zarr"]
    assert run("simulate", scene, "-o", runs, "--seed", 5, "--force").code == 0
    assert (ranges(runs / "small-back.zarr") != before).any()


def test_the_folder_is_made_but_not_the_one_above(run, scene, tmp_path):
    finished = run("simulate", scene, "-o", tmp_path / "a" / "b")
    assert finished.code == 2
    assert f"the folder {tmp_path / 'a'} does not exist" in finished.err
    (tmp_path / "file").write_text("")
    finished = run("simulate", scene, "-o", tmp_path / "file")
    assert "is a file, not a folder" in finished.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "small.toml"]


@pytest.mark.slow
@pytest.mark.parametrize("stopped", ["there", "back"])
def test_ctrl_c_leaves_nothing_half_written(run, scene, runs, monkeypatch, stopped):
    @contextmanager
    def bar():
        def show(name, done, total):
            if name == stopped:
                raise KeyboardInterrupt

        yield show

    monkeypatch.setattr("trueterrain.cli.simulate.progress_bar", bar)
    finished = run("simulate", scene, "-o", runs)
    assert finished.code == 130
    assert finished.err == "trueterrain: stopped; nothing was left half written\n"
    assert not runs.exists()


def test_wheels_outside_of_the_ground_are_one_line(run, tmp_path, runs):
    flat = make_surface(
        np.zeros((21, 11)),
        u=np.linspace(0, 20, 21),
        v=np.linspace(-0.5, 0.5, 11),
        easting=np.linspace(0, 20, 21),
        northing=np.zeros(21),
    )
    formats.write(flat, tmp_path / "narrow.crg")
    path = tmp_path / "s.toml"
    path.write_text('name = "s"\nground = [{ kind = "crg", file = "narrow.crg" }]\n')
    finished = run("simulate", path, "-o", runs)
    assert finished.code == 2
    assert finished.err.startswith(f"trueterrain: error: {path}: pass pass, easting ")
    assert "there is no ground under the wheel front" in finished.err
    assert finished.err.count("\n") == 1
    assert not runs.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "s"\nrastre = 1', r"s\.toml: rastre: is unknown \(did you mean 'raster'\?\)"),
        ('name = "s"\nvehicle = { parameters = { sprung_mass = -1 } }', r"sprung_mass must be"),
        (
            'name = "s"\npasses = [{ name = "a", speed = { kind = "constant", speed = 0 } }]',
            r"s\.toml: pass a, speed: speed must be greater than 0 m/s",
        ),
        ('name = "s"\nground = [{ kind = "crg", file = "none.crg" }]', r"none\.crg: does not"),
        ("name = = 1", r"s\.toml: line 1, column 8: is no TOML"),
    ],
)
def test_bad_scenes_are_one_line_and_write_nothing(run, tmp_path, runs, text, message):
    (tmp_path / "s.toml").write_text(text)
    finished = run("simulate", tmp_path / "s.toml", "-o", runs)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.count("\n") == 1
    assert re.search(message, finished.err)
    assert not runs.exists()


def test_missing_arguments_are_named(run, scene, tmp_path, runs):
    for arguments, message in (
        ((), "name a scene"),
        ((scene,), "name the folder for the runs: --output DIR"),
        (("kerbb", "-o", runs), "kerbb: no ready scene has this name.*did you mean 'kerb'"),
        ((tmp_path / "none.toml", "-o", runs), "none.toml: No such file or directory"),
    ):
        finished = run("simulate", *arguments)
        assert finished.code == 2
        assert re.search(message, finished.err), finished.err
    assert not runs.exists()


def test_ready_scenes_are_listed_with_their_titles(run):
    finished = run("simulate", "--list")
    assert [line.split()[0] for line in finished.out.splitlines()] == scene_names()
    assert "Driving off a kerb of 120 mm at 3 m/s" in finished.out
    documents = json.loads(run("simulate", "--list", "--json").out)
    two = next(document for document in documents if document["name"] == "belgian-two-lanes")
    assert two["passes"] == ["left", "right"]


@pytest.mark.slow
def test_a_ready_scene_is_recorded_whole(run, runs):
    """The static plate, 4 s: the calibration of the thesis's section 3.5.1."""
    finished = run("simulate", "static-plate", "-o", runs)
    assert finished.code == 0
    assert "4,000 scans of 940 beams in 4.000 s" in finished.out
    tree = open_run(runs / "static-plate-static.zarr")
    truth = tree["truth/scanner"]
    assert tree["scans"].sizes["scan"] == truth.sizes["scan"] == 4000
    ranges_of_beams = np.nanmedian(tree["scans"]["range"].values, axis=0)
    height = truth["up"].values[0] - ranges_of_beams * np.cos(tree["scans"]["angle"].values)
    atol = 0.002  # [m] the spot is 10 mm long, and the receiver errs on stripes
    npt.assert_allclose([height.min(), height.max()], [0.0, 0.05], rtol=0, atol=atol)


# --- init -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [None, *scene_names()])
def test_init_prints_the_scene(run, tmp_path, name):
    finished = run("init", "scene", *([] if name is None else [name]))
    assert (finished.code, finished.err) == (0, "")
    path = tmp_path / "scene.toml"
    path.write_text(finished.out)
    expected = Scene(name="scene") if name is None else read_scene(name)[0]
    assert read_scene(path)[0] == expected
    assert all(len(line) <= 102 for line in finished.out.splitlines())


def test_init_completes_a_scene_of_ones_own(run, scene, tmp_path):
    finished = run("init", "scene", scene)
    (tmp_path / "whole.toml").write_text(finished.out)
    assert read_scene(tmp_path / "whole.toml")[0] == read_scene(scene)[0]


def test_a_printed_scene_can_be_simulated(run, scene, tmp_path, runs):
    text = run("init", "scene", scene).out
    (tmp_path / "whole.toml").write_text(text)
    assert run("simulate", tmp_path / "whole.toml", "-o", runs, "--pass", "there").code == 0
    assert np.isfinite(ranges(runs / "small-there.zarr")).mean() > 0.99


def test_init_of_an_unknown_scene(run):
    finished = run("init", "scenes")
    assert finished.code == 2
    assert "scene" in finished.err
    finished = run("init", "scene", "overal")
    assert "did you mean 'oval'?" in finished.err
    assert finished.err.count("\n") == 1


def test_help_is_light(run):
    """Help must not import what simulates."""
    import subprocess
    import sys

    code = (
        "import sys\nfrom trueterrain.cli import main\n"
        "try: main([sys.argv[1], '--help'])\nexcept SystemExit: pass\n"
        "heavy = {'numpy', 'xarray', 'scipy', 'zarr', 'pydantic', 'numba'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    for command in ("simulate", "init"):
        done = subprocess.run(
            [sys.executable, "-c", code, command], capture_output=True, text=True, check=True
        )
        assert done.stdout.splitlines()[-1] == "[]"
