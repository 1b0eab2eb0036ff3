"""No command writes to, into or around its inputs, not even with --force."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from trueterrain import formats
from trueterrain.core.schemas import make_points, make_profile, make_surface

pytestmark = pytest.mark.slow

# command line behind the words that must be in its error
REFUSED = [
    ("is an input as well", "convert p.csv -o p.csv"),
    ("is an input as well", "convert p.csv -o linked.csv"),
    ("is an input as well", "convert linked.csv -o p.csv"),
    ("is an input as well", "convert p.csv -o twin.csv"),
    ("holds the input road.zarr/in.laz", "convert road.zarr/in.laz -o road.zarr"),
    ("holds the input road.zarr/in.laz", "convert road.zarr/in.laz -o linked.zarr"),
    ("lie within another store", "convert p.csv -o one.zarr/p.erd"),
    ("lie within another store", "convert p.csv -o one.zarr/scans/p.zarr"),
    ("holds in.laz", "convert cloud.csv -o road.zarr"),
    ("holds inner.zarr/", "convert cloud.csv -o outer.zarr"),
    ("is a surface in a store", "convert cloud.csv -o surface.zarr"),
    ("is a recorded run", "convert cloud.csv -o one.zarr"),
    ("is an input as well", "filter p.csv --shortest 1 -o p.csv"),
    ("is an input as well", "profile surface.zarr --path path.csv -o path.csv"),
    ("is an input as well", "grid one.zarr -o one.zarr"),
    ("lie within another store", "grid one.zarr -o one.zarr/road.crg"),
    ("is an input as well", "georeference one.zarr -o one.zarr"),
    ("lie within another store", "plot p.csv -o one.zarr/p.png"),
    ("lie within another store", "compare p.csv q.csv --plot one.zarr/p.png"),
    ("lie within another store", "iri p.csv --plot one.zarr/p.png"),
    ("lie within another store", "calibrate one.zarr two.zarr -o one.zarr/c.toml"),
    ("is a recorded run", "run survey.toml -o one.zarr"),
    ("is a recorded run", "run survey.toml -o other.zarr"),
    ("holds the input survey.toml", "run survey.toml -o ."),
    ("holds the input", "run survey.toml -o runs"),
    ("lie within another store", "run survey.toml -o one.zarr/out"),
    ("is an input as well", "merge one.zarr two.zarr -o one.zarr"),
    ("is an input as well", "merge one.zarr two.zarr -o linked-run.zarr"),
    ("holds the input", "merge one.zarr two.zarr -o ."),
    ("holds the input", "merge cloud.csv more.csv -o ."),
    ("is an input as well", "merge one.zarr two.zarr --check -o two.zarr"),
    ("is a recorded run", "simulate scene.toml -o one.zarr"),
    ("is points in a store", "simulate scene.toml -o made"),
    ("holds the input", "verify static static.toml -o ."),
    ("is a recorded run", "verify static static.toml -o two.zarr"),
    ("holds the input", "event design --vehicle car.toml -o ."),
    ("is a recorded run", "plate design -o one.zarr"),
    ("is a recorded run", "demo -o one.zarr"),
]


@pytest.fixture(scope="module")
def project(recorded, machined, tmp_path_factory):
    """Folder with inputs of every kind, some by links."""
    folder = tmp_path_factory.mktemp("project")
    for name in ("one", "two", "other"):
        shutil.copytree(recorded / "drive-run.zarr", folder / f"{name}.zarr")
    (folder / "runs").mkdir()
    shutil.copytree(recorded / "drive-run.zarr", folder / "runs" / "three.zarr")
    points = make_points(np.arange(9.0), np.arange(9.0), np.zeros(9))
    for name in ("road.zarr", "outer.zarr", "outer.zarr/inner.zarr", "road.laz"):
        if name.endswith("inner.zarr"):
            shutil.copytree(folder / "road.zarr", folder / name)
        else:
            formats.write(points, folder / name)
    (folder / "road.laz").rename(folder / "road.zarr" / "in.laz")
    for name in ("cloud.csv", "more.csv"):
        formats.write(points, folder / name)
    (folder / "made").mkdir()
    formats.write(points, folder / "made" / "drive-run.zarr")
    formats.write(
        make_surface(np.zeros((9, 9)), easting=np.arange(9.0), northing=np.arange(9.0)),
        folder / "surface.zarr",
    )
    for name in ("p.csv", "q.csv"):
        formats.write(make_profile(np.arange(50.0), np.sin(np.arange(50.0))), folder / name)
    (folder / "path.csv").write_text("easting,northing\n0,1\n8,1\n")
    (folder / "linked.csv").symlink_to("p.csv")
    (folder / "linked.zarr").symlink_to("road.zarr")
    (folder / "linked-run.zarr").symlink_to(folder / "one.zarr")
    os.link(folder / "p.csv", folder / "twin.csv")
    (folder / "scene.toml").write_text((recorded / "scene.toml").read_text())
    runs = "".join(f'[[runs]]\npath = "{name}.zarr"\n' for name in ("one", "runs/three"))
    (folder / "survey.toml").write_text(f'name = "s"\n{runs}')
    (folder / "car.toml").write_text('name = "car"\n')
    (folder / "static.toml").write_text(f'run = "one.zarr"\nmachined = "{machined}"\n')
    return folder


def files_of(folder):
    """Every file below a folder, what is in it, and when it was written."""
    return {
        path: (path.readlink() if path.is_symlink() else path.read_bytes(), path.lstat().st_mtime)
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file()
    }


@pytest.mark.parametrize(("words", "line"), REFUSED, ids=[line for _, line in REFUSED])
def test_an_input_and_its_folder_are_unchanged(run, project, monkeypatch, words, line):
    monkeypatch.chdir(project)
    before = files_of(project)
    finished = run(*line.split(), "--force")
    assert finished.code == 2, finished.err
    assert finished.err.count("\n") == 1
    assert words in finished.err
    assert files_of(project) == before


def test_a_device_is_never_replaced(run, project, tmp_path):
    os.mkfifo(tmp_path / "pipe.erd")
    finished = run("convert", project / "p.csv", "-o", tmp_path / "pipe.erd", "--force")
    assert finished.code == 2
    assert "device or pipe" in finished.err
    assert (tmp_path / "pipe.erd").is_fifo()


@pytest.mark.slow
def test_a_result_goes_into_the_folder_that_one_is_in(run, tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path / "out")
    for _ in range(2):
        finished = run("plate", "design", "-o", ".", "--force")
        assert finished.code == 0, finished.err
    assert Path().samefile(tmp_path / "out")
    assert (tmp_path / "out" / "manifest.json").exists()
    finished = run("event", "design", "-o", ".", "--force")
    assert finished.code == 2
    assert "holds a result of another command ('plate')" in finished.err
