"""``trueterrain plot`` of surfaces, points and profiles: pictures or one line."""

import numpy as np
import pytest
from matplotlib import pyplot as plt

import trueterrain as tt


@pytest.fixture
def files(tmp_path):
    """A road, its nodes, a profile, and a table without a header."""
    road = tt.sample_road(tt.BelgianBlock(seed=1), length=1.0, width=0.6)
    tt.write(road, tmp_path / "road.crg")
    tt.write(tt.surface_to_points(road), tmp_path / "points.laz")
    profile = tt.tyre_profile(road, tt.offset_path(road, 0.1))
    tt.write(profile, tmp_path / "p.erd")
    table = np.stack([profile.s, profile.height], axis=1)
    np.savetxt(tmp_path / "bare.txt", table)
    yield tmp_path
    plt.close("all")


@pytest.mark.parametrize(
    "arguments",
    [("road.crg",), ("road.crg", "--frame", "ground"), ("points.laz",), ("p.erd",), ("bare.txt",),
     ("p.erd", "bare.txt")],
    ids=" ".join,
)  # fmt: skip
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_every_kind_in_every_format(run, files, monkeypatch, arguments, ending):
    monkeypatch.chdir(files)
    finished = run("plot", *arguments, "-o", f"picture.{ending}")
    assert (finished.code, finished.out) == (0, "")
    assert finished.err == f"picture.{ending}: written\n"
    assert (files / f"picture.{ending}").stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("p.erd", "-o", "picture.jpg"), "a figure ends in .png, .svg, .pdf"),
        (("none.erd", "-o", "picture.png"), "none.erd: No such file"),
        (("p.erd", "road.crg", "-o", "picture.png"), "road.crg: only profiles are drawn together"),
        (("p.erd", "-o", "p.erd", "--force"), "p.erd: is an input as well"),
        (("p.erd", "-o", "none/picture.png"), "the folder none does not exist"),
        (("p.erd", "-o", "picture.png", "--resolution", 0), "resolution must be greater than 0"),
    ],
    ids=lambda value: "" if isinstance(value, str) else " ".join(str(item) for item in value),
)
def test_misuse_is_one_line_and_leaves_nothing(run, files, monkeypatch, arguments, part):
    monkeypatch.chdir(files)
    before = {path: path.read_bytes() for path in files.iterdir()}
    finished = run("plot", *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.count("\n") == 1
    assert part in finished.err
    assert {path: path.read_bytes() for path in files.iterdir()} == before
