"""The command demo: its results, and no partial output after a failure."""

import json
import signal
import subprocess
import sys

import pytest

import trueterrain as tt

LENGTH = 12.0  # [m] the shortest, to be quick
NAME = "belgian-block"
PROFILES = (
    "left-lane-left",
    "left-lane-right",
    "seam",
    "right-lane-left",
    "right-lane-right",
    "left-lane-left-point",
)
PICTURES = (
    f"{NAME}-surface",
    f"{NAME}-part",
    f"{NAME}-profiles",
    "left-motion",
    "right-motion",
    "merge-correction",
    "merge-before",
    "merge-after",
    "merge-choice",
    "merge-spectrum",
    "merge-seam",
)
FILES = (
    {f"{NAME}.crg", "report.html", "result.json"}
    | {f"{NAME}-{profile}.{ending}" for profile in PROFILES for ending in ("erd", "csv")}
    | {f"{picture}.png" for picture in PICTURES}
)
NEAR = 0.05  # fraction of the IRI: a lateral error of 40 mm, 2 sd of navigation, changes it by 4 %
SEAM = 0.0005  # [m] after merging 12 m of Belgian block


@pytest.mark.slow
def test_the_demo_writes_its_files_and_prints_correct_results(run, tmp_path):
    finished = run("demo", "-o", tmp_path / "demo", "--length", LENGTH, "--seed", 3, "--json")
    assert finished.code == 0, finished.err
    numbers = json.loads(finished.out)
    results = tmp_path / "demo" / "results"
    assert set(numbers["files"]) == FILES
    assert {path.name for path in results.iterdir()} == {*FILES, "manifest.json"}
    result = json.loads((results / "result.json").read_text())
    assert result == {key: numbers[key] for key in result}
    (lane,) = numbers["lanes"]
    assert [profile["name"] for profile in lane["profiles"]] == list(PROFILES)
    for profile in lane["profiles"]:
        written = tt.open(results / f"{NAME}-{profile['name']}.csv")
        assert float(tt.iri(written).iri[0]) == pytest.approx(profile["iri"], rel=1e-12)
        assert profile["iri"] == pytest.approx(lane["truth"]["iri"][profile["name"]], rel=NEAR)
    iri = {profile["name"]: profile["iri"] for profile in lane["profiles"]}
    pairs = [("left-lane-left", "left-lane-right"), ("right-lane-left", "right-lane-right")]
    assert [(pair["left"], pair["right"]) for pair in lane["wheel_paths"]] == pairs
    report = (results / "report.html").read_text()
    for (left, right), pair in zip(pairs, lane["wheel_paths"], strict=True):
        mean = 0.5 * (iri[left] + iri[right])
        assert pair["mri"] == pytest.approx(mean, rel=1e-12)
        assert f"wheel paths {left} and {right}" in report
    assert "mean of 6 profiles" not in report
    assert not [problem for problem in lane["problems"] if "in metres" in problem]
    (seam,) = numbers["merge"]["seams"]
    assert seam["after"] < SEAM < 0.1 * seam["before"]

    # what it leaves behind can be run again, with the same results
    again = run("run", tmp_path / "demo" / "survey.toml", "-o", tmp_path / "again")
    assert again.code == 0, again.err
    for name in FILES:
        assert (tmp_path / "again" / name).read_bytes() == (results / name).read_bytes(), name


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--length", 5), "length must be from 12 m to 500 m, got 5"),
        (("--length", "nan"), "--length: must be 0, or from 1e-12"),
        (("--length", 1e9), "length must be from 12 m to 500 m, got 1e+09"),
        (("--seed", -1), "seed must be"),
    ],
    ids=lambda value: " ".join(str(item) for item in value) if isinstance(value, tuple) else "",
)
def test_bad_arguments_are_one_line_and_leave_nothing(run, tmp_path, options, part):
    finished = run("demo", "-o", tmp_path / "demo", *options)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.count("\n") == 1
    assert part in finished.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_nothing_is_left_when_it_is_stopped(tmp_path, sent, code):
    arguments = [sys.executable, "-m", "trueterrain", "demo", "-o", str(tmp_path / "demo")]
    # whoever runs the tests in the background ignores SIGINT, and children inherit that
    heed = lambda: signal.signal(sent, signal.SIG_DFL)  # noqa: E731 - called in the child alone
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, preexec_fn=heed) as program:
        assert program.stderr.readline() == "simulating two recordings ...\n"
        program.send_signal(sent)
        program.stderr.read()
    assert program.returncode == code
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_files_is_kept(run, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    finished = run("demo", "-o", tmp_path)
    assert finished.code == 2
    assert "is not empty" in finished.err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
