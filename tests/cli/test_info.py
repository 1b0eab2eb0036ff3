"""The command info: text, JSON, and files that cannot be read."""

import json

import pytest

from trueterrain import formats
from trueterrain.core.schemas import make_points, make_profile


@pytest.fixture
def profile(tmp_path):
    path = tmp_path / "p.erd"
    formats.write(make_profile([0, 0.1, 0.2], [0.0, 0.01, 0.0]), path)
    return path


@pytest.fixture
def broken(tmp_path):
    path = tmp_path / "broken.laz"
    path.write_bytes(b"LASF" + bytes(100))
    return path


def test_text_of_a_strip(run, data):
    path = data / "scanning" / "strips" / "test_data_77055_627755_LA93_IGN69.laz"
    finished = run("info", path)
    assert finished.code == 0
    assert finished.err == ""
    lines = finished.out.splitlines()
    assert lines[0] == str(path)
    text = finished.out
    for part in (
        "LAZ, points",
        "72,770",
        "EPSG:2154 (RGF93 v1 / Lambert-93)",
        "706: 42,262; 707: 30,508",
        "770550 to 770600 m (50 m)",
        "0.01 m",
        "29.108 points/m²",
        "adjusted standard",
        "the time flag says seconds of the week",
        "9 of 72770 points lie exactly",
    ):
        assert part in text, part


def test_text_of_a_road(run, data):
    text = run("info", data / "opencrg" / "asam" / "belgian_block.crg").out
    for part in (
        "OpenCRG, surface",
        "1,001 x 341",
        "730 to 740 m (10 m)",
        "6.51 % of the nodes",
        "unknown",
    ):
        assert part in text, part


def test_a_file_without_problems_states_this(run, profile):
    finished = run("info", profile)
    assert finished.code == 0
    assert "no problems found" in finished.out
    assert "height: heights 0 to 0.01 m" in finished.out
    assert "s: m; height: m" in finished.out


@pytest.mark.slow
def test_every_real_file_is_shown(run, data):
    files = [
        *sorted((data / "scanning").rglob("*.la[sz]")),
        *sorted((data / "opencrg").rglob("handmade_*.crg")),
        *sorted((data / "profiles").rglob("profile_*.txt")),
    ]
    assert len(files) > 20
    finished = run("info", *files)
    assert finished.code == 0
    assert all(str(file) in finished.out for file in files)


def test_json_is_all_there_is(run, profile, data):
    strip = data / "scanning" / "strips" / "faceraster_2strips_20m.laz"
    finished = run("info", profile, strip, "--json")
    assert finished.code == 0
    assert finished.err == ""
    document = json.loads(finished.out)
    assert [entry["format"] for entry in document["files"]] == ["ERD", "LAZ"]
    assert document["files"][1]["count"] == 18074
    assert document["files"][1]["point_source_ids"] == {"305": 10020, "306": 8054}


def test_one_broken_file_is_one_line(run, broken):
    finished = run("info", broken)
    assert finished.code == 2
    assert finished.out == ""
    assert finished.err.count("\n") == 1
    assert finished.err.startswith(f"trueterrain: error: {broken}: ")


def test_broken_files_do_not_hide_the_others(run, profile, broken, tmp_path):
    finished = run("info", broken, profile, tmp_path / "none.crg")
    assert finished.code == 2
    assert "no problems found" in finished.out
    assert finished.out.count("unreadable") == 2
    assert finished.err.count("\n") == 1
    assert "2 of 3 files cannot be read" in finished.err


def test_broken_files_in_json(run, profile, broken):
    finished = run("info", profile, broken, "--json")
    assert finished.code == 2
    first, second = json.loads(finished.out)["files"]
    assert first["problems"] == []
    assert second["file"] == str(broken)
    assert str(broken) in second["error"]


def test_numbers_that_are_missing_stay_valid_json(run, tmp_path):
    (tmp_path / "p.csv").write_text("s,height\n0,nan\n1,nan\n")
    finished = run("info", tmp_path / "p.csv", "--json")
    (entry,) = json.loads(finished.out)["files"]
    assert entry["tracks"][0]["lowest"] is None
    assert finished.code == 0
    assert "no heights" in run("info", tmp_path / "p.csv").out


def test_points_in_a_table(run, tmp_path):
    formats.write(make_points([0, 1], [0, 1], [0, 1], lane=[1, 2]), tmp_path / "p.csv")
    text = run("info", tmp_path / "p.csv").out
    assert "easting, northing, up, lane" in text
    assert "no problems found" in text
