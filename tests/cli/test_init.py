"""The command init for accuracy tests: the output is a valid settings file."""

import json
import tomllib

import numpy as np
import pytest

import trueterrain
from trueterrain.core.schemas import make_profile
from trueterrain.formats.settings import read_settings
from trueterrain.verify.certificate import DriftTest, DynamicTest, StaticTest

KINDS = {"static": StaticTest, "dynamic": DynamicTest, "drift": DriftTest}


@pytest.fixture
def profiles(tmp_path):
    """Profiles of two runs along one path."""
    s = np.arange(1201.0)
    rng = np.random.default_rng(3)
    paths = [tmp_path / "first.csv", tmp_path / "second.csv"]
    for path in paths:
        trueterrain.write(make_profile(s, 1e-3 * rng.normal(size=s.size)), path)
    return paths


@pytest.mark.parametrize("kind", KINDS)
def test_the_output_can_be_read(run, kind, tmp_path):
    finished = run("init", kind)
    assert (finished.code, finished.err) == (0, "")
    (tmp_path / "test.toml").write_text(finished.out)
    read = read_settings(KINDS[kind], tmp_path / "test.toml")
    named = {
        "static": {"run": "run.zarr", "machined": "plate.csv"},
        "dynamic": {"runs": {"run": "run.zarr"}, "machined": "plate.csv"},
        "drift": {"profiles": ("run1.csv", "run2.csv")},
    }
    assert read == KINDS[kind](**named[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_every_setting_stands_there_with_its_help(run, kind):
    lines = run("init", kind).out.splitlines()
    assert lines[0].startswith(f"# A {kind} test: ")
    for number, line in enumerate(lines):
        if line and not line.startswith(("#", "[", " ", "]")):
            assert lines[number - 1].startswith("#"), line
    for name in ("title", "system", "date", "boresight", "confidence"):
        assert any(line.startswith(f"{name} = ") for line in lines), name
    for name in ("clock", "rms", "registration"):
        assert any(line.startswith(f"# {name} = ...") for line in lines), name


def test_named_profiles_are_filled_in_and_verified(run, profiles, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = run("init", "drift", *(path.name for path in profiles)).out
    assert tomllib.loads(text)["profiles"] == ["first.csv", "second.csv"]
    (tmp_path / "drift.toml").write_text(text)
    finished = run("verify", "drift", "drift.toml", "-o", "out", "--json")
    assert finished.code == 0, finished.err
    assert json.loads(finished.out)["rows"][0]["count"] == 2402


def test_named_runs_are_filled_in(run, recorded):
    stand, drive = recorded / "stand-run.zarr", recorded / "drive-run.zarr"
    read = tomllib.loads(run("init", "dynamic", stand, drive).out)
    assert read["runs"] == {"stand-run": str(stand), "drive-run": str(drive)}
    assert tomllib.loads(run("init", "static", stand).out)["run"] == str(stand)


@pytest.mark.parametrize("what", ["survey", "static", "dynamic", "drift"])
@pytest.mark.parametrize("file", ["none.zarr", "points.csv", "profile.csv", "notes.txt"])
def test_settings_are_of_files_that_fit(run, tmp_path, monkeypatch, what, file):
    """Else `run` or `verify` fails later, on settings that were printed with exit code 0."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text("easting,northing,up\n0,0,0\n1,0,0\n")
    (tmp_path / "profile.csv").write_text("s,height\n0,0\n1,0\n")
    (tmp_path / "notes.txt").write_text("buy lumber\n")
    (tmp_path / "other.csv").write_text("s,height\n0,0\n1,0\n")
    fits = what == "drift" and file == "profile.csv"
    finished = run("init", what, *(["other.csv"] if what == "drift" else []), file)
    assert finished.code == (0 if fits else 2)
    assert bool(finished.out) is fits
    assert fits or file in finished.err


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["static", "none.zarr"], "there is no run none.zarr"),
        (["drift", "none.csv"], "there is no profile none.csv"),
        (["static", ".", ".."], "a static test is of one run, got ., .."),
        (["dynamic", ".", "."], "runs must have names that differ"),
        (["drift", "."], "a drift test is of two profiles or more"),
        (["statics"], "static"),
    ],
)
def test_missing_settings_are_reported(run, arguments, problem):
    finished = run("init", *arguments)
    assert finished.code == 2
    assert finished.out == ""
    assert problem in " ".join(finished.err.split())


def test_help_names_all_templates_and_where_events_and_plates_are(run):
    text = " ".join(run("init", "--help").out.split())
    for word in ("static", "dynamic", "drift", "event design", "plate design", "verify"):
        assert word in text
