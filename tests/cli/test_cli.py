"""The command line as a whole: help, version, errors."""

import re
import subprocess
import sys

import pytest
from numba.core.event import trigger_event

from trueterrain import __version__
from trueterrain.cli import command_line
from trueterrain.cli._console import compiling_noted

COMMANDS = (
    "calibrate",
    "compare",
    "convert",
    "demo",
    "doctor",
    "event",
    "georeference",
    "grid",
    "info",
    "init",
    "iri",
    "merge",
    "plate",
    "plot",
    "profile",
    "psd",
    "rn",
    "run",
    "simulate",
    "verify",
)


def test_help_lists_every_command(run):
    finished = run("--help")
    assert finished.code == 0
    for command in COMMANDS:
        assert re.search(rf"│ {command} +\w", finished.out), command


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_every_option(run, command):
    finished = run(command, "--help")
    assert finished.code == 0
    text = " ".join(finished.out.replace("│", " ").split())
    for option in command_line()[command].assemble_argument_collection(parse_docstring=True):
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
def test_compiling_is_said_once_and_on_terminals_only(monkeypatch, capsys, terminal):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    with compiling_noted():
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
