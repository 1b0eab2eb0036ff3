"""The command psd: tables, JSON, pictures, and bad input."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain import roughness
from trueterrain.core.schemas import make_profile
from trueterrain.formats import erd, table
from trueterrain.simulate.ground import Road

WRITTEN = 1e-4  # [1] relative: heights in the files are rounded to 1e-9 m


@pytest.fixture(scope="module")
def two():
    s = 0.1 * np.arange(6001)
    ground = Road(road_class="B", seed=1, waves=2048)
    height = ground.height(s, 0 * s)
    return make_profile(s, [height, 2 * height], tracks=["left", "right"])


@pytest.fixture
def erd_file(tmp_path, two):
    erd.write(two, tmp_path / "two.erd")
    return tmp_path / "two.erd"


def test_json(run, erd_file, two):
    finished = run("psd", erd_file, "--segment", "400", "--json")
    assert (finished.code, finished.err) == (0, "")
    document = json.loads(finished.out)
    assert list(document) == ["file", "tracks", "confidence"]
    truth = roughness.psd(two, segment=400.0)
    for at, track in enumerate(document["tracks"]):
        one = truth.isel(track=at)
        assert track["road_class"] == "BC"[at]
        for name in ("gd_n0", "waviness"):
            found = [track[name][end] for end in ("value", "low", "high")]
            expected = [one[f"{name}{end}"].item() for end in ("", "_low", "_high")]
            assert_allclose(found, expected, rtol=WRITTEN, atol=0)
        assert [segment["end"] for segment in track["segments"]] == pytest.approx([400, 600])
        assert_allclose(
            [segment["gd_n0"]["value"] for segment in track["segments"]],
            one.segment_gd_n0,
            rtol=WRITTEN,
            atol=0,
        )
        densities = [band["density"] for band in track["bands"]]
        assert_allclose(densities, one.smoothed, rtol=WRITTEN, atol=0)
        assert [band["fitted"] for band in track["bands"]] == one.fitted.values.tolist()


def test_segments_too_short_are_null(run, erd_file):
    document = json.loads(run("psd", erd_file, "--segment", "598", "--json").out)
    last = document["tracks"][0]["segments"][-1]
    assert last["road_class"] == ""
    assert last["gd_n0"] == {"value": None, "low": None, "high": None}
    assert "too short" in run("psd", erd_file, "--segment", "598").out


def test_table(run, erd_file, two):
    lines = run("psd", erd_file).out.splitlines()
    truth = roughness.psd(two)
    assert lines[0] == f"Displacement spectrum of {erd_file}"
    assert lines[1].split() == (
        ["track", "from", "[m]", "to", "[m]", "class", "Gd(n0)", "[1e-6", "m³]", "w"]
    )
    words = lines[2].split()
    assert words[:3] == ["left", "whole", "B"]
    assert words[3] == f"{1e6 * truth.gd_n0.values[0]:.4g}"
    assert lines[-1] == (
        "Fitted from 0.011 to 2.83 cycles/m; blocks of 1000 m; intervals of 95 % confidence."
    )


def test_options_reach_the_spectrum(run, erd_file, two):
    arguments = ("--block", "100", "--lowest", "0.1", "--highest", "1", "--waviness", "2")
    document = json.loads(run("psd", erd_file, *arguments, "--confidence", "0.5", "--json").out)
    options = roughness.PsdSettings(block=100, lowest=0.1, highest=1, waviness=2, confidence=0.5)
    truth = roughness.psd(two, settings=options)
    found = document["tracks"][0]["gd_n0"]
    assert_allclose(found["high"], truth.gd_n0_high[0], rtol=WRITTEN, atol=0)
    assert document["tracks"][0]["waviness"] == {"value": 2.0, "low": 2.0, "high": 2.0}
    assert document["confidence"] == 0.5


def test_several_files_and_a_picture(run, erd_file, two, tmp_path):
    table.write(two.isel(track=0, drop=True), tmp_path / "one.csv")
    finished = run("psd", erd_file, tmp_path / "one.csv", "--json", "--plot", tmp_path / "p.png")
    documents = json.loads(finished.out)
    assert [len(document["tracks"]) for document in documents] == [2, 1]
    assert finished.err == f"{tmp_path / 'p.png'}: written\n"
    assert (tmp_path / "p.png").stat().st_size > 1000


def test_bad_files(run, tmp_path):
    s = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 3000))
    table.write(make_profile(s, np.sin(s)), tmp_path / "unequal.csv")
    message = run("psd", tmp_path / "unequal.csv").err
    assert "unequal.csv: axis s: must be equally spaced for a spectrum" in message
    assert "trueterrain convert --spacing" in message
    short = make_profile(0.1 * np.arange(30), 1e-3 * np.sin(np.arange(30.0)))
    erd.write(short, tmp_path / "s.erd")
    assert "s.erd: axis s: has 0 bands" in run("psd", tmp_path / "s.erd").err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--segment", "0"), "segment must be finite and at least"),
        (("--segment", "5"), "segment from 0 to 5 m: has 0 bands"),
        (("--block", "0"), "block must be finite"),
        (("--lowest", "9"), "lowest must be less than highest"),
        (("--confidence", "2"), "confidence must be between 0 and 1"),
    ],
)
def test_bad_arguments(run, erd_file, arguments, message):
    finished = run("psd", erd_file, *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert message in finished.err
