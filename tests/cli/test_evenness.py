"""The command evenness: known waves and bumps, JSON, tables, pictures, and bad input."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.schemas import make_profile
from trueterrain.formats import erd, table
from trueterrain.roughness import WAVEBANDS, Butterworth

ENDS = 1e-8  # [m] the ends of the profile are 400 m away from the segment that is judged
WRITTEN = 2e-9  # [m] heights in the files are rounded to 1e-9 m; a deviation sums two of them
CROSSED = 1e-6  # [m] along the road: what WRITTEN moves a crossing by on a slope of 8 mm/m
LOST = 0.05  # [1] 1 - 1 / (1 + 0.414 / 8), order 3, of a wave half an octave inside its band
STEP = 0.1  # [m]
S = STEP * np.arange(12_001)
WAVE = 0.004 * np.sin(2 * np.pi * S / 4.0)  # of the medium band


@pytest.fixture
def waves(tmp_path):
    """A wave of 4 m, 4 mm high, and one twice as high in a second track."""
    erd.write(make_profile(S, [WAVE, 2 * WAVE], tracks=["left", "right"]), tmp_path / "w.erd")
    return tmp_path / "w.erd"


@pytest.fixture
def bump(tmp_path):
    """A triangle, 8 mm high and 1 m long, at 40 m, and a trench half as deep at 70 m."""
    s = S[:1001]
    height = 0.008 * np.clip(1 - 2 * abs(s - 40), 0, None)
    height -= 0.004 * np.clip(1 - 2 * abs(s - 70), 0, None)
    erd.write(make_profile(s, height), tmp_path / "bump.erd")
    return tmp_path / "bump.erd"


def document(finished):
    assert finished.code == 0, finished.err
    return json.loads(finished.out)


def test_a_sine_has_its_rms_in_its_band(run, waves):
    found = document(run("evenness", waves, "--segment", "400", "--json"))
    assert [band["name"] for band in found["bands"]] == ["short", "medium", "long"]
    for size, track in zip((0.004, 0.008), found["tracks"], strict=True):
        middle = track["segments"][1]
        assert (middle["start"], middle["end"]) == pytest.approx((400, 800))
        for name, band in WAVEBANDS.items():
            truth = size / np.sqrt(2) * band.gain(4.0, spacing=STEP)
            assert_allclose(middle["rms"][name], truth, rtol=0, atol=ENDS)
        assert middle["rms"]["medium"] == pytest.approx(size / np.sqrt(2), rel=LOST)


def test_a_sine_deviates_by_the_closed_form(run, waves):
    found = document(run("evenness", waves, "--straightedge", "2.4", "--json"))
    assert found["straightedge"] == 2.4
    response = 1 - np.cos(np.pi * 2.4 / 4.0)
    for size, track in zip((0.004, 0.008), found["tracks"], strict=True):
        deviation = track["deviation"]
        assert_allclose(abs(deviation["peak"]), size * response, rtol=0, atol=WRITTEN)
        peak = size * response * np.sin(np.pi / 2 * deviation["peak_at"])
        assert_allclose(deviation["peak"], peak, rtol=0, atol=WRITTEN)
        # 95 % of the forty samples of a wave are below the second highest of its sizes
        assert_allclose(
            deviation["p95"], size * response * np.cos(np.pi / 20), rtol=0, atol=WRITTEN
        )


def test_bumps_and_trenches_under_the_straightedge(run, bump):
    found = document(run("evenness", bump, "--segment", "50", "--threshold", "0.003", "--json"))
    (track,) = found["tracks"]
    peaks = [(one["deviation"]["peak"], one["deviation"]["peak_at"]) for one in track["segments"]]
    # the wheels are 1.5 m away, beside the bump: the beam lies on flat ground
    assert_allclose(peaks, [(0.008, 40), (-0.004, 70)], rtol=0, atol=WRITTEN)
    # a slope of 16 mm/m crosses 3 mm 5/16 m from the top, one of 8 mm/m 1/8 m from it; a wheel on
    # the bump lifts the middle of the beam by half of its height
    truth = [(38.5, -0.004, 1 / 8), (40, 0.008, 5 / 16), (41.5, -0.004, 1 / 8), (70, -0.004, 1 / 8)]
    for found, (at, peak, half) in zip(track["stretches"], truth, strict=True):
        expected = {"start": at - half, "end": at + half, "peak": peak, "peak_at": at}
        assert found == pytest.approx(expected, abs=CROSSED)
    assert track["beyond"] == pytest.approx(11 / 8, abs=8 * CROSSED)


def test_table(run, bump):
    finished = run("evenness", bump, "--segment", "60", "--threshold", "0.0048")
    assert (finished.code, finished.err) == (0, "")
    lines = finished.out.splitlines()
    assert lines[0] == f"Evenness of {bump}"
    assert lines[1].split("  ")[-1] == "at [m]"
    assert lines[2].split()[-2:] == ["+8.00", "40.00"]
    assert lines[3].split()[-3:] == ["-4.00", "70.00", "shorter"]
    assert lines[4].split()[1] == "whole"
    assert lines[4].split()[-2:] == ["+8.00", "40.00"]
    assert "beyond 4.8 mm: 1, 0.40 of 97.00 m" in lines[5]
    assert lines[6] == "  39.80 to 40.20 m, up to 8.00 mm above the beam at 40.00 m"
    assert "not checked against the texts of EN 13036" in lines[-1]


def test_bands_of_ones_own(run, waves):
    arguments = ("--band", "near", "1", "5", "--band", "far", "5", "50", "--segment", "400")
    found = document(run("evenness", waves, *arguments, "--json"))
    assert found["bands"] == [
        {"name": "near", "shortest": 1.0, "longest": 5.0},
        {"name": "far", "shortest": 5.0, "longest": 50.0},
    ]
    for name, low, high in (("near", 1.0, 5.0), ("far", 5.0, 50.0)):
        gain = Butterworth(shortest=low, longest=high).gain(4.0, spacing=STEP)
        rms = found["tracks"][0]["segments"][1]["rms"][name]
        assert_allclose(rms, 0.004 / np.sqrt(2) * gain, rtol=0, atol=ENDS)


def test_bands_that_do_not_fit_are_left_out(run, tmp_path):
    table.write(make_profile(S[:200], WAVE[:200]), tmp_path / "short.csv")
    finished = run("evenness", tmp_path / "short.csv", "--json")
    assert "band long is left out: the profile is 19.9 m long" in finished.err
    rms = document(finished)["tracks"][0]["rms"]
    assert rms["long"] is None
    assert rms["medium"] > 0
    assert " - " in run("evenness", tmp_path / "short.csv").out
    coarse = make_profile(5 * S[:500], WAVE[:500])
    table.write(coarse, tmp_path / "coarse.csv")
    finished = run("evenness", tmp_path / "coarse.csv", "--json")
    assert "waves of 0.707 m need a spacing below 0.3535 m, got 0.5 m" in finished.err
    assert document(finished)["tracks"][0]["rms"]["short"] is None


def test_a_segment_that_the_straightedge_does_not_reach_has_no_deviation(run, tmp_path):
    table.write(make_profile(S[:1010], WAVE[:1010]), tmp_path / "p.csv")  # 100.9 m
    found = document(run("evenness", tmp_path / "p.csv", "--json"))
    last = found["tracks"][0]["segments"][-1]
    assert last["deviation"] == {"p95": None, "peak": None, "peak_at": None}
    assert last["rms"]["medium"] > 0


def test_several_files_and_a_picture(run, waves, bump, tmp_path):
    picture = tmp_path / "e.png"
    arguments = ("--threshold", "0.005", "--json", "--plot", picture)
    finished = run("evenness", waves, bump, *arguments)
    assert [len(one["tracks"]) for one in document(finished)] == [2, 1]
    assert finished.err == f"{picture}: written\n"
    assert picture.stat().st_size > 1000
    refused = run("evenness", bump, "--plot", picture)
    assert (refused.code, refused.out) == (2, "")
    assert "exists already" in refused.err
    assert run("evenness", bump, "--plot", picture, "--force").code == 0


def test_implausible_heights_are_questioned(run, tmp_path):
    table.write(make_profile(S[:1000], 1000 * WAVE[:1000]), tmp_path / "mm.csv")
    finished = run("evenness", tmp_path / "mm.csv")
    assert finished.code == 0
    assert "are its heights in metres, not in feet or millimetres?" in finished.err


def test_bad_files(run, tmp_path):
    s = np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 3000))
    table.write(make_profile(s, 1e-3 * np.sin(s)), tmp_path / "unequal.csv")
    message = run("evenness", tmp_path / "unequal.csv").err
    assert "unequal.csv: axis s: must be equally spaced for a Butterworth filter" in message
    table.write(make_profile(S[:20], WAVE[:20]), tmp_path / "tiny.csv")
    message = run("evenness", tmp_path / "tiny.csv").err
    assert "tiny.csv: axis s: is shorter than the straightedge: 1.9 m" in message
    message = run("evenness", tmp_path / "tiny.csv", "--straightedge", "1").err
    assert "tiny.csv: axis s: is shorter than the filter: 1.9 m" in message
    gap = np.where(np.arange(S.size) == 50, np.nan, WAVE)
    table.write(make_profile(S, gap), tmp_path / "gap.csv")
    message = run("evenness", tmp_path / "gap.csv").err
    assert "s = 5 m: has no finite height (1 of 12001 samples have none)" in message


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("--threshold", "4"),
            "--threshold must be greater than 0 and less than 0.5 m, got 4; 4 mm",
        ),
        (("--threshold", "-0.01"), "--threshold must be greater than 0"),
        (("--threshold", "nan"), "--threshold: must be 0, or from 1e-12"),
        (("--segment", "0"), "segment must be finite and at least"),
        (("--straightedge", "0"), "length must be finite and greater than 0 m"),
        (("--band", "a", "3", "1"), "shortest must be less than longest, got 3 and 1 m"),
        (("--band", "a", "1", "3", "--band", "a", "3", "9"), "--band must give each name once"),
    ],
)
def test_bad_arguments(run, bump, arguments, message):
    finished = run("evenness", bump, *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.count("\n") == 1
    assert message in finished.err


def test_of_many_stretches_the_worst_are_printed(run, tmp_path):
    s = np.arange(0.0, 200.0, 0.05)
    height = 0.01 * (1 + s / 200) * np.sin(2 * np.pi * s / 3)
    table.write(make_profile(s, height), tmp_path / "waves.csv")
    finished = run("evenness", tmp_path / "waves.csv", "--threshold", "0.004")
    listed = [line for line in finished.out.splitlines() if " the beam at " in line]
    assert len(listed) == 20
    assert "others that are less; --json lists all" in finished.out
    assert all(float(line.split()[0]) > 100 for line in listed)  # waves grow along the road
