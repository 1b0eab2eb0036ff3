"""The command rn: tables, JSON, pictures, and bad input."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain import roughness
from trueterrain.core.schemas import make_profile
from trueterrain.formats import erd, table

WRITTEN = 1e-5  # [1] heights in the files are rounded to 1e-9 m


@pytest.fixture
def two():
    s = 0.05 * np.arange(5001)
    height = np.cumsum(np.random.default_rng(1).standard_normal((2, s.size)), axis=1) * 2e-4
    return make_profile(s, height, tracks=["left", "right"])


@pytest.fixture
def erd_file(tmp_path, two):
    erd.write(two, tmp_path / "two.erd")
    return tmp_path / "two.erd"


def test_json(run, erd_file, two):
    finished = run("rn", erd_file, "--json")
    assert (finished.code, finished.err) == (0, "")
    document = json.loads(finished.out)
    assert list(document) == ["file", "tracks", "rn", "segments"]
    truth = roughness.ride_number(two, segment=100.0)
    assert_allclose(document["rn"], truth.rn_both, rtol=0, atol=WRITTEN)
    together = [segment["rn"] for segment in document["segments"]]
    assert_allclose(together, truth.segment_rn_both, rtol=0, atol=WRITTEN)
    for at, track in enumerate(document["tracks"]):
        assert track["name"] == ("left", "right")[at]
        assert_allclose(track["rn"], truth.rn[at], rtol=0, atol=WRITTEN)
        assert_allclose(track["pi"], truth.pi[at], rtol=0, atol=WRITTEN)
        values = [segment["rn"] for segment in track["segments"]]
        assert_allclose(values, truth.segment_rn[at], rtol=0, atol=WRITTEN)
        assert track["segments"][-1]["end"] == pytest.approx(250.0)


def test_one_track_and_several_files(run, erd_file, two, tmp_path):
    table.write(two.isel(track=0, drop=True), tmp_path / "one.csv")
    documents = json.loads(run("rn", erd_file, tmp_path / "one.csv", "--json").out)
    assert documents[1]["rn"] is None
    assert documents[1]["segments"] == []
    same = [document["tracks"][0]["rn"] for document in documents]
    assert_allclose(same[0], same[1], rtol=0, atol=WRITTEN)


def test_table(run, erd_file, two):
    lines = run("rn", erd_file).out.splitlines()
    truth = roughness.ride_number(two, segment=100.0)
    assert lines[0] == f"Ride Number of {erd_file}"
    assert lines[1].split() == ["from", "[m]", "to", "[m]", "left", "right", "both"]
    values = [*truth.segment_rn.values[:, 0], truth.segment_rn_both.values[0]]
    assert lines[2].split() == ["0.00", "100.00", *(f"{value:.2f}" for value in values)]
    assert lines[4].endswith("shorter")
    values = [*truth.rn.values, truth.rn_both.item()]
    assert lines[5].split() == ["whole", *(f"{value:.2f}" for value in values)]
    assert lines[-2] == (
        "Car of the Ride Number at 80 km/h; window sayers (0.25 m); start first 19 m; "
        "one run over the whole profile."
    )
    assert lines[-1] == "The constants were not checked against the text of ASTM E1489."


def test_options_reach_the_index(run, erd_file, two):
    arguments = ["--window", "exact", "--window-length", "0.3", "--restart", "--segment", "60"]
    document = json.loads(run("rn", erd_file, *arguments, "--json").out)
    options = roughness.RideNumberSettings(window="exact", window_length=0.3, restart=True)
    truth = roughness.ride_number(two, settings=options, segment=60.0)
    values = [segment["rn"] for segment in document["tracks"][1]["segments"]]
    assert_allclose(values, truth.segment_rn[1], rtol=0, atol=WRITTEN)


def test_picture(run, erd_file, tmp_path):
    finished = run("rn", erd_file, "--plot", tmp_path / "rn.png")
    assert finished.err == f"{tmp_path / 'rn.png'}: written\n"
    assert (tmp_path / "rn.png").stat().st_size > 1000
    assert run("rn", erd_file, "--plot", tmp_path / "rn.png").code == 2
    assert run("rn", erd_file, "--plot", tmp_path / "rn.png", "--force").code == 0


def test_a_window_that_averages_nothing_is_warned_of(run, tmp_path):
    erd.write(make_profile(0.15 * np.arange(500), np.zeros(500)), tmp_path / "coarse.erd")
    finished = run("rn", tmp_path / "coarse.erd", "--window", "centred")
    assert finished.code == 0
    assert "averages nothing at a spacing of 0.15 m." in finished.err
    assert "samples are up to 0.15 m apart; the index is accurate to 0.05 m" in finished.err


@pytest.mark.parametrize("command", ["iri", "rn"])
@pytest.mark.parametrize("spacing", [0.7, 2.0, 50.0])
def test_coarse_profiles_are_refused(run, tmp_path, command, spacing):
    """A wave of 3.1 m rated 16.1, 3.4 and 0.0 m/km at these spacings."""
    s = spacing * np.arange(300)
    table.write(make_profile(s, 0.01 * np.sin(2 * np.pi * s / 3.1)), tmp_path / "coarse.csv")
    finished = run(command, tmp_path / "coarse.csv")
    assert (finished.code, finished.out) == (2, "")
    assert f"has samples {spacing:g} m apart, which must be at most" in finished.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--segment", "0"), "segment must be finite and at least"),
        (("--wheel-paths", "left", "middle"), "wheel_paths must name two of the tracks"),
        (("--window", "box"), "sayers"),
    ],
)
def test_bad_arguments(run, erd_file, arguments, message):
    finished = run("rn", erd_file, *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert message in finished.err


def test_bad_files(run, tmp_path, data):
    (tmp_path / "gap.csv").write_text("s,height\n" + "".join(f"{i / 10},\n" for i in range(9)))
    assert "gap.csv: track profile, s = 0 m: has no finite" in run("rn", tmp_path / "gap.csv").err
    surface = data / "opencrg" / "asam" / "belgian_block.crg"
    assert "is a surface, not a profile" in run("rn", surface).err
