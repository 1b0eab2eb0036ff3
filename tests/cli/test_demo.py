"""``trueterrain demo``: everything that it promises, and nothing left when it fails."""

import json
import signal
import subprocess
import sys

import pytest

import trueterrain as tt

LENGTH = 12.0  # [m] the shortest, to be quick
FILES = {
    "difference.png", "distribution.png", "point.csv", "point.erd", "profiles.png", "result.json",
    "road.crg", "road.png", "search-area.png", "tyre.csv", "tyre.erd",
}  # fmt: skip


def test_the_demo_writes_what_it_says_and_says_what_is_true(run, tmp_path):
    finished = run("demo", "-o", tmp_path / "demo", "--length", LENGTH, "--seed", 3, "--json")
    assert finished.code == 0, finished.err
    numbers = json.loads(finished.out)
    assert {path.name for path in (tmp_path / "demo").iterdir()} == FILES == set(numbers["files"])
    result = json.loads((tmp_path / "demo" / "result.json").read_text())
    assert result == {key: numbers[key] for key in result}
    tyre, point = (tt.open(tmp_path / "demo" / f"{name}.csv") for name in ("tyre", "point"))
    assert float(tt.iri(tyre).iri[0]) == pytest.approx(numbers["iri_tyre"], rel=1e-12)
    assert float(tt.iri(point).iri[0]) == pytest.approx(numbers["iri_point"], rel=1e-12)
    # stones and joints: the tyre feels less of them from point to point
    assert numbers["rms_step_tyre"] < numbers["rms_step_point"]

    again = run("demo", "-o", tmp_path / "again", "--length", LENGTH, "--seed", 3)
    assert again.code == 0
    assert f"{numbers['iri_tyre']:.2f}" in again.out
    one, other = (tmp_path / name / "tyre.csv" for name in ("demo", "again"))
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--length", 5), "length must be from 12 m to 500 m, got 5"),
        (("--length", "nan"), "length must be from 12 m to 500 m, got nan"),
        (("--length", 1e9), "length must be from 12 m to 500 m, got 1e+09"),
        (("--seed", -1), "seed must be at least 0"),
    ],
    ids=lambda value: " ".join(str(item) for item in value) if isinstance(value, tuple) else "",
)
def test_bad_arguments_are_one_line_and_leave_nothing(run, tmp_path, options, part):
    finished = run("demo", "-o", tmp_path / "demo", *options)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.count("\n") == 1
    assert part in finished.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_nothing_is_left_when_it_is_stopped(tmp_path, sent, code):
    arguments = [sys.executable, "-m", "trueterrain", "demo", "-o", str(tmp_path / "demo")]
    # whoever runs the tests in the background ignores SIGINT, and children inherit that
    heed = lambda: signal.signal(sent, signal.SIG_DFL)  # noqa: E731 - called in the child alone
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, preexec_fn=heed) as program:
        assert program.stderr.readline() == "making the road ...\n"
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
