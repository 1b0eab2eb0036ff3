"""The command compare: profiles and surfaces, tables, JSON, pictures, bad input."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.core.schemas import make_points, make_profile, make_surface
from trueterrain.formats import erd, opencrg, table, write
from trueterrain.roughness.agreement import profile_agreement

WRITTEN = 1e-6  # [1] of a rating: heights in the files are rounded to 1e-9 m
S = np.arange(0.0, 120.0, 0.1)
U, V = np.arange(0.0, 12.0, 0.1), np.arange(-1.0, 1.05, 0.1)


def road(x):
    waves = ((20.0, 0.02, 0.3), (7.0, 0.006, 1.1), (2.3, 0.002, 2.0), (31.0, 0.03, 0.7))
    return sum(a * np.sin(2 * np.pi * x / length + phase) for length, a, phase in waves)


@pytest.fixture
def profiles(tmp_path):
    """A reference, a run that is late, and one that is low and late."""
    runs = {"R": road(S), "one": road(S - 0.25), "two": 0.8 * road(S - 0.1)}
    for name, height in runs.items():
        erd.write(make_profile(S, height), tmp_path / f"{name}.erd")
    return [tmp_path / f"{name}.erd" for name in runs]


@pytest.fixture
def surfaces(tmp_path):
    """A reference, and two surfaces 1 mm and 3 mm above it, 1 mm more on the right."""
    ground = road(U)[:, None] + 0 * V
    for name, above in (("R", 0.0), ("slow", 0.001), ("fast", 0.003)):
        height = ground + above + 0.001 * (V < -1e-9) * (above > 0)
        opencrg.write(
            make_surface(height, u=U, v=V, easting=U, northing=0 * U), tmp_path / f"{name}.crg"
        )
    return [tmp_path / f"{name}.crg" for name in ("R", "slow", "fast")]


def test_json_of_profiles(run, profiles):
    reference, one, two = profiles
    finished = run("compare", one, two, "--reference", reference, "--json")
    assert (finished.code, finished.err) == (0, "")
    document = json.loads(finished.out)
    assert document["kind"] == "profiles"
    assert document["reference"] == "R.erd"
    assert document["filter"].startswith("IRI filter")
    assert document["flags"] == []
    track = document["tracks"][0]
    assert [(pair["first"], pair["second"]) for pair in track["pairs"]] == [
        ("R.erd", "one.erd"),
        ("R.erd", "two.erd"),
        ("one.erd", "two.erd"),
    ]
    assert_allclose(
        [pair["best_shift"] for pair in track["pairs"]], [0.25, 0.1, -0.15], rtol=0, atol=1e-3
    )
    truth = profile_agreement(
        {
            "R": make_profile(S, road(S)),
            "1": make_profile(S, road(S - 0.25)),
            "2": make_profile(S, 0.8 * road(S - 0.1)),
        },
        reference="R",
    )
    assert_allclose(track["accuracy"], truth.accuracy.item(), rtol=0, atol=WRITTEN)
    assert_allclose(track["repeatability"], truth.repeatability.item(), rtol=0, atol=WRITTEN)
    assert [one["profile"] for one in track["heights"]] == ["one.erd", "two.erd"]
    assert track["heights"][0]["rms"] < 1e-4 < track["heights"][1]["rms"]
    checks = {check["name"]: check for check in document["checks"]}
    assert checks["repeatability"]["passed"] is False
    assert checks["repeatability"]["limit"] == 0.92
    assert checks["bias"]["passed"] is None
    assert checks["bias"]["reason"] == "no limit is given"


def test_tables_of_profiles(run, profiles):
    reference, one, two = profiles
    finished = run("compare", one, two, "--reference", reference, "--distance-error", "0.001")
    lines = finished.out.splitlines()
    assert lines[0] == (
        "Agreement of 3 profiles, reference R.erd; "
        "IRI filter (exact window 0.25 m), settling length 30 m."
    )
    assert lines[3].split() == ["R.erd", "one.erd", "two.erd"]
    row = next(line for line in lines if line.split()[:2] == ["R.erd", "two.erd"]).split()
    assert row[2] == pytest.approx("80.0", abs=0) or abs(float(row[2]) - 80) < 0.1
    assert row[3] == "+0.1000"
    text = finished.out
    assert "at least 92.00 %: MISSED" in text
    assert "distance error: " in text
    assert ": kept" in text
    assert "bias: " in text
    assert "not judged: no limit is given" in text
    assert "neither they nor the formula were checked against its text" in text


def test_limits_and_filters_of_the_user(run, profiles):
    arguments = ("--repeatability", "0.5", "--accuracy", "0", "--filter", "butterworth")
    finished = run(
        "compare", *profiles[1:], *arguments, "--settling-length", "20", "--max-scale", "0"
    )
    assert finished.code == 0
    assert "Butterworth filter from 8 to 90 m, order 3 forward and backward" in finished.out
    assert "at least 50.00 %: kept" in finished.out
    assert "accuracy: not judged, no reference is given" in finished.out
    assert "corrected" not in finished.out
    assert "R 56" not in finished.out
    plain = run("compare", *profiles[1:], "--filter", "none", "--json")
    assert json.loads(plain.out)["filter"] == "heights as they are"


def test_each_wheel_path_is_shown(run, tmp_path):
    both = make_profile(S, [road(S), road(S + 50)], tracks=["left", "right"])
    for name in "AB":
        erd.write(both, tmp_path / f"{name}.erd")
    finished = run("compare", tmp_path / "A.erd", tmp_path / "B.erd")
    assert "Track left" in finished.out
    assert "repeatability of right: 100.00 %, at least 92.00 %: kept" in finished.out


def test_json_of_surfaces(run, surfaces):
    reference, slow, fast = surfaces
    lanes = ("--lanes", "-1", "0", "1", "--speed", "40", "60", "--json")
    finished = run("compare", slow, fast, "--reference", reference, *lanes)
    assert (finished.code, finished.err) == (0, "")
    document = json.loads(finished.out)
    assert document["kind"] == "surfaces"
    found = {(row["surface"], tuple(row["lane"] or ())): row for row in document["differences"]}
    assert len(found) == 6
    written = 1e-6  # [m] of heights in the files
    assert_allclose(found["slow.crg", (0, 1)]["rms"], 0.001, rtol=0, atol=written)
    assert_allclose(found["slow.crg", (-1, 0)]["rms"], 0.002, rtol=0, atol=written)
    assert_allclose(found["fast.crg", (-1, 0)]["p95"], 0.004, rtol=0, atol=written)
    assert found["fast.crg", ()]["n"] == U.size * V.size
    assert [(row["speed"], row["lane"]) for row in document["by_speed"]][:2] == [
        (40.0, None), (40.0, [-1.0, 0.0]),
    ]  # fmt: skip
    assert document["left_out"] == []
    axes = [(one["surface"], one["axis"]) for one in document["structure"]]
    assert axes[:2] == [("slow.crg", "along"), ("slow.crg", "across")]
    assert_allclose(document["structure"][0]["structure"], 0.0, rtol=0, atol=written**2)


def test_tables_of_surfaces(run, surfaces):
    finished = run("compare", *surfaces)
    text = finished.out
    assert "slow.crg      R.crg" in text
    assert "fast.crg   slow.crg" in text
    assert "Not compared by lane: no edges of lanes are given (--lanes)." in text
    assert "Not compared by speed: no speeds are given (--speed)." in text
    assert "RMS change of the difference over a distance [mm]" in text


def test_levels_are_taken_off(run, surfaces):
    finished = run("compare", surfaces[1], "--reference", surfaces[0], "--level", "plane", "--json")
    assert abs(json.loads(finished.out)["differences"][0]["mean"]) < 1e-9


@pytest.mark.slow
def test_pictures(run, profiles, surfaces, tmp_path):
    for files in (profiles, surfaces):
        picture = tmp_path / f"{files[0].suffix[1:]}.png"
        finished = run("compare", *files, "--plot", picture)
        assert finished.code == 0
        assert picture.stat().st_size > 20_000
        refused = run("compare", *files, "--plot", picture)
        assert (refused.code, refused.out) == (2, "")
        assert "--force" in refused.err


def test_flags_are_on_stderr_and_in_the_document(run, profiles, tmp_path):
    table.write(make_profile(S, road(S) / 0.3048), tmp_path / "feet.csv")
    finished = run("compare", tmp_path / "feet.csv", profiles[1], "--json")
    flags = json.loads(finished.out)["flags"]
    assert "feet.csv is 3.281 times as high as one.erd: are its heights in feet?" in flags
    assert len(finished.err.splitlines()) == len(flags)
    assert finished.err.startswith("trueterrain: warning: feet.csv")


def refused(run, *arguments):
    """The one line of a comparison that cannot be made."""
    finished = run("compare", *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert len(finished.err.splitlines()) == 1
    return finished.err


def test_files_that_cannot_be_compared_are_one_line(run, profiles, surfaces, tmp_path):
    assert "two files are needed" in refused(run, profiles[0])
    assert "R.crg: is a surface, but R.erd is a profile" in refused(run, profiles[0], surfaces[0])
    short = tmp_path / "short.erd"
    erd.write(make_profile(S[:300], road(S[:300])), short)
    assert "short.erd: is 29.9 m long, which must be at least 50" in refused(
        run, profiles[0], short
    )
    far = tmp_path / "far.erd"
    table.write(make_profile(S + 900, road(S)), far.with_suffix(".csv"))
    assert "overlap by less than 20 m" in refused(run, profiles[0], far.with_suffix(".csv"))
    assert run("compare", profiles[0], far.with_suffix(".csv"), "--align-starts").code == 0
    gap = road(S)
    gap[100] = np.nan
    table.write(make_profile(S, gap), tmp_path / "gap.csv")
    assert "gap.csv: track profile, s = 10 m" in refused(run, profiles[0], tmp_path / "gap.csv")
    points = tmp_path / "points.csv"
    write(make_points([0.0, 1.0], [0.0, 1.0], [0.0, 0.0]), points)
    assert "holds points, not a profile or a surface" in refused(run, profiles[0], points)
    assert "must be given once" in refused(run, profiles[0], profiles[0])


def test_options_of_the_other_kind_or_number_are_one_line(run, profiles, surfaces):
    assert "belong to surfaces" in refused(run, *profiles, "--speed", "40")
    assert "--speed needs --reference" in refused(run, *surfaces, "--speed", "40")
    reference = ("--reference", surfaces[0])
    wrong = refused(run, *surfaces[1:], *reference, "--speed", "40")
    assert "one speed for each of 2 surfaces, got 1" in wrong
    assert "ascending, got 1 0" in refused(run, *surfaces, "--lanes", "1", "0")
