"""Points on the command line: filters by class and return, feet, warnings of other classes."""

import json

import laspy
import numpy as np
import pyproj
import pytest

from trueterrain import formats
from trueterrain.core.schemas import make_points

ROOF = ("--line", 770560, 6277505, 770590, 6277540, "--radius", 1)
GROUND_RISE = 1.0  # [m] of the ground along that line; the roof is 16 m above it
COMMANDS = {  # that read points, each with what it needs beside its input
    "convert": ["-o", "{out}.laz"],
    "grid": ["--spacing", "0.5", "-o", "{out}.tif"],
    "profile": ["--line", "1", "1", "9", "9", "--radius", "0.5", "-o", "{out}.csv"],
    "plot": ["-o", "{out}.png"],
    "merge": ["--check", "--json"],
}


@pytest.fixture
def tile(data):
    return data / "scanning" / "strips" / "test_data_77055_627755_LA93_IGN69.laz"


@pytest.fixture
def garden(tmp_path):
    """Level ground of 10 m, of two passes, with a tree over one quarter and its echo below."""
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, 10, (2, 8000))
    tree = (x < 5) & (y < 5)
    lane = np.arange(8000) % 2 + 1
    ground = make_points(
        np.append(x, x[tree]),
        np.append(y, y[tree]),
        np.append(0 * x, 0 * x[tree] + 6.0),
        classification=np.append(2 + 0 * x, 5 + 0 * x[tree]),
        return_number=np.append(1 + tree, 1 + 0 * x[tree]),
        number_of_returns=np.append(1 + tree, 2 + 0 * x[tree]),
        lane=np.append(lane, lane[tree]),
        crs="EPSG:25832",
    )
    formats.write(ground, tmp_path / "garden.laz")
    return tmp_path / "garden.laz"


def test_a_profile_over_a_roof_is_warned_of(run, tile, tmp_path):
    finished = run("profile", tile, *ROOF, "-o", tmp_path / "p.csv")
    assert finished.code == 0
    warning = next(line for line in finished.err.splitlines() if line.startswith("warning"))
    assert "building (6) 1,149" in warning
    assert "--class 2" in warning
    assert np.ptp(formats.open(tmp_path / "p.csv").height.values) > 10 * GROUND_RISE
    finished = run("profile", tile, *ROOF, "--class", 2, "--thin", "nan", "-o", tmp_path / "g.csv")
    assert "no ground" not in finished.err
    assert np.ptp(formats.open(tmp_path / "g.csv").height.dropna("s").values) < GROUND_RISE


def test_only_points_along_the_path_are_warned_of(run, garden, tmp_path):
    far = run("profile", garden, "--line", 6, 1, 9, 9, "--radius", 0.3, "-o", tmp_path / "p.csv")
    assert far.code == 0
    assert "no ground" not in far.err
    # the tree stands within the rectangle around this line, but not along it
    beside = run("profile", garden, "--line", 1, 7, 9, 4, "--radius", 0.3, "-o", tmp_path / "q.csv")
    assert beside.code == 0
    assert "no ground" not in beside.err
    near = run("profile", garden, "--line", 1, 1, 9, 9, "--radius", 0.3, "-o", tmp_path / "r.csv")
    assert "high vegetation (5)" in near.err


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_points_can_choose_them(run, garden, tmp_path, command):
    out = tmp_path / "out"
    more = [*(one.format(out=out) for one in COMMANDS[command]), "--force"]
    measures = command in ("grid", "profile", "merge")
    assert ("high vegetation (5)" in run(command, garden, *more).err) == measures
    for choice in (("--class", "2"), ("--class", "2,11"), ("--return", "last"), ("--return", "2")):
        finished = run(command, garden, *more, *choice)
        if choice == ("--return", "2") and command == "profile":
            assert "search areas have fewer than 3 heights" in finished.err
            continue
        assert finished.code in (0, 1), finished.err  # 1: passes do not agree
        # pulses through the tree end on the ground: all choices leave it out
        assert "no ground" not in finished.err
    for wrong in (("--class", "ground"), ("--class", "300"), ("--return", "second")):
        finished = run(command, garden, *more, *wrong)
        assert finished.code == 2
        assert len(finished.err.splitlines()) == 1


def test_the_warning_is_in_the_numbers(run, garden, tmp_path):
    finished = run("grid", garden, "--spacing", 0.5, "-o", tmp_path / "g.tif", "--json")
    (problem,) = json.loads(finished.out)["problems"]
    assert "high vegetation (5)" in problem
    chosen = ("--return", "last", "--json")
    finished = run("grid", garden, "--spacing", 0.5, "-o", tmp_path / "h.tif", *chosen)
    assert json.loads(finished.out)["problems"] == []
    assert np.nanmax(formats.open(tmp_path / "h.tif").height) == 0.0


def test_only_points_are_chosen(run, tmp_path, garden):
    assert run("grid", garden, "--spacing", 0.5, "-o", tmp_path / "g.tif").code == 0
    finished = run("convert", tmp_path / "g.tif", "-o", tmp_path / "g.laz", "--class", 2)
    assert finished.code == 2
    assert "choose points" in finished.err


def test_info_names_the_classes(run, garden):
    found = run("info", garden).out
    assert "2 ground: 8,000; 5 high vegetation" in found


@pytest.mark.parametrize("command", COMMANDS)
def test_feet_are_converted_with_a_note(run, tmp_path, command):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = [0.01] * 3
    header.add_crs(pyproj.CRS.from_epsg(2264))
    rng = np.random.default_rng(4)
    content = laspy.LasData(header)
    content.x, content.y = rng.uniform(0, 10 / 0.3048, (2, 8000))
    content.z = np.full(8000, 100.0)
    content.point_source_id = np.arange(8000) % 2 + 1
    content.write(tmp_path / "feet.laz")
    more = [one.format(out=tmp_path / "out") for one in COMMANDS[command]]
    finished = run(command, tmp_path / "feet.laz", *more)
    assert finished.code in (0, 1), finished.err
    assert "converted from US survey foot to metres" in finished.err
    if command in ("grid", "profile", "convert"):
        made = formats.open(next(tmp_path.glob("out.*")))
        height = made["up" if "up" in made else "height"]
        np.testing.assert_allclose(height.dropna(height.dims[0]), 100 * 1200 / 3937, rtol=1e-7)
