"""The command line as a whole: help, version, errors."""

import re
import subprocess
import sys

import pytest
from numba.core.event import trigger_event

import trueterrain
from trueterrain import __version__
from trueterrain.cli import command_line
from trueterrain.cli._console import note_compilation
from trueterrain.cli._options import RENAMED

GROUPS = {
    "Start": ("demo", "info", "init", "convert"),
    "Survey": ("run", "georeference", "calibrate", "merge", "grid"),
    "Profile": ("profile", "iri", "rn", "psd", "evenness", "filter", "compare"),
    "Accuracy": ("event", "plate", "verify"),
    "Simulate": ("simulate",),
    "Other": ("plot", "doctor"),
}
COMMANDS = [command for commands in GROUPS.values() for command in commands]
MAX_HELP_TIME = 0.3  # [s] of processor time, the budget of the project


def test_help_lists_every_command_in_its_group(run):
    finished = run("--help")
    assert finished.code == 0
    panels = re.split(r"╭─ (\w+) ─+╮\n", finished.out)
    found = {
        title: tuple(re.findall(r"^│ (\w+) +\w", text, re.MULTILINE))
        for title, text in zip(panels[1::2], panels[2::2], strict=True)
    }
    assert found == GROUPS
    assert list(found) == list(GROUPS)


def test_help_imports_no_command():
    """Help stays below 0.3 s only if it imports neither numpy nor the module of a command."""
    code = (
        "import sys, time; from trueterrain.cli import main\n"
        "try: main(['--help'])\n"
        "finally: sys.stderr.write(f'{time.process_time()} ' + ' '.join(sys.modules))"
    )
    finished = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    elapsed, *modules = finished.stderr.split()
    assert float(elapsed) < MAX_HELP_TIME
    assert not {"numpy", "xarray", *(f"trueterrain.cli.{name}" for name in COMMANDS)} & {*modules}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_every_option(run, command):
    finished = run(command, "--help")
    assert finished.code == 0
    text = " ".join(finished.out.replace("│", " ").split())
    options = command_line()[command].assemble_argument_collection(parse_docstring=True)
    for option in (one for one in options if one.show):
        assert option.parameter.help, f"{command} {option.name} has no help"
        assert option.name in text


def test_version(run):
    assert run("--version").out.strip() == __version__


def test_a_misspelt_command_is_one_line_with_the_right_one(run):
    finished = run("profil")
    assert (finished.code, finished.out) == (2, "")
    assert len(finished.err.splitlines()) == 1
    assert '"profile"' in finished.err


def test_a_misspelt_option_is_one_line_with_the_right_one(run):
    finished = run("profile", "a.crg", "--ofset", "0", "-o", "p.erd")
    assert finished.code == 2
    assert len(finished.err.splitlines()) == 1
    assert "--offset" in finished.err


def test_a_missing_file_is_one_line(run, tmp_path):
    finished = run("iri", tmp_path / "none.erd")
    assert finished.code == 2
    assert finished.err.splitlines() == [
        f"trueterrain: error: {tmp_path / 'none.erd'}: No such file or directory."
    ]


def test_debug_shows_the_traceback(run, tmp_path):
    with pytest.raises(FileNotFoundError):
        run("--debug", "iri", tmp_path / "none.erd")


def test_too_little_memory_is_one_line(run, monkeypatch, tmp_path):
    def allocate(path):
        raise MemoryError("Unable to allocate 72.8 TiB")

    monkeypatch.setattr("trueterrain.formats.open", allocate)
    (tmp_path / "p.csv").write_text("s,height\n0,0\n1,0\n")
    finished = run("iri", tmp_path / "p.csv")
    assert finished.code == 2
    assert finished.err == (
        "trueterrain: error: there is not enough memory (Unable to allocate 72.8 TiB). Choose a "
        "coarser spacing, a smaller search area or a part of the data.\n"
    )


def test_a_closed_pipe_is_no_error():
    """As with `trueterrain doctor | head -0`."""
    code = "from trueterrain.cli import main; main(['doctor'])"
    program = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    program.stdout.close()
    assert program.stderr.read() == ""
    program.stderr.close()
    assert program.wait() == 141


@pytest.mark.parametrize("terminal", [True, False])
def test_compilation_is_noted_once_and_on_terminals_only(monkeypatch, capsys, terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    with note_compilation():
        for _ in range(2):
            with trigger_event("numba:compile"):
                pass
    said = "compiling kernels, once on this machine ...\n" if terminal else ""
    assert capsys.readouterr() == ("", said)


def test_doctor_names_version_and_backends(run):
    finished = run("doctor")
    assert finished.code == 0
    assert re.search(rf"trueterrain +{re.escape(__version__)}", finished.out)
    assert "LAZ backends" in finished.out


@pytest.mark.parametrize(
    ("command", "option"),
    [
        (("simulate", "kerb", "-o", "."), "--seed"),
        (("grid", "r.zarr", "-o", "o.crg"), "--threads"),
        (("profile", "s.crg", "-o", "p.erd"), "--min-count"),
        (("compare", "a", "b"), "--trend"),
    ],
)
def test_whole_numbers_are_not_rounded(run, command, option):
    """A seed of 1.5 would be another one than the user thinks."""
    finished = run(*command, option, "1.5")
    assert (finished.code, finished.out) == (2, "")
    assert f"{option}: must be a whole number, got '1.5'" in finished.err


@pytest.mark.parametrize(
    ("command", "old", "new"),
    [(command, *pair) for command, renamed in RENAMED.items() for pair in renamed.items()],
)
def test_an_option_of_an_earlier_version_is_accepted_with_a_note(run, command, old, new):
    """The value reaches the present option: it is refused under its present name."""
    names = {one.name for one in command_line()[command].assemble_argument_collection()}
    assert new in names
    assert old not in names
    inputs = {"calibrate": ("a", "b"), "compare": ("a", "b")}.get(command, ("a", "-o", "b.crg"))
    for value in ([old, "nan"], [f"{old}=nan"]):
        finished = run(command, *inputs, *value)
        note, error = finished.err.splitlines()
        assert note == (
            f"trueterrain: note: {old} is now {new}; the old name goes with the next release"
        )
        assert finished.code == 2
        assert new in error


def test_an_option_of_an_earlier_version_has_the_same_effect(run, tmp_path):
    road = tmp_path / "road.crg"
    trueterrain.write(
        trueterrain.sample_road(trueterrain.ground.BelgianBlock(seed=1), length=1.0, width=0.5),
        road,
    )
    texts = []
    for option in ("--min-count", "--minimum-count"):
        output = tmp_path / f"{option}.csv"
        finished = run("profile", road, "--offset", 0, "--radius", 0.05, option, 2, "-o", output)
        assert finished.code == 0
        assert ("note" in finished.err) == (option == "--minimum-count")
        texts.append(output.read_text())
    assert texts[0] == texts[1]
