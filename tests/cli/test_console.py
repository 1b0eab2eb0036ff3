"""Output to a terminal, a pipe or a closed stream: no command fails because of it."""

import io
import json
import subprocess
import sys

import pytest

from trueterrain.cli import main
from trueterrain.core.json_values import printable_text

ESCAPE = "\x1b]0;owned\x07\x1b[31m\x9b2J\u202e"
PROFILE = "s,height\n0,0\n0.1,0.001\n0.2,0\n"


def exit_code(*arguments: object) -> int:
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    return int(stopped.value.code or 0)


@pytest.mark.parametrize("columns", ["0", "1", "-3", "", "wide", "30"])
@pytest.mark.parametrize("arguments", [["--help"], ["iri", "--help"], ["profil"]])
def test_a_terminal_without_a_width_is_no_failure(run, monkeypatch, columns, arguments):
    monkeypatch.setenv("COLUMNS", columns)
    finished = run(*arguments)
    assert finished.code == (2 if arguments == ["profil"] else 0)
    assert "width" not in finished.err


@pytest.mark.parametrize("closed", [["stdout"], ["stderr"], ["stdout", "stderr"]])
@pytest.mark.parametrize(("arguments", "code"), [(["info", "p.csv"], 0), (["iri", "none.erd"], 2)])
def test_closed_streams_discard_output(monkeypatch, tmp_path, capsys, closed, arguments, code):
    """As with `trueterrain info p.csv >&-`: python then has no stream at all."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.csv").write_text(PROFILE)
    for name in closed:
        monkeypatch.setattr(sys, name, None)
    try:
        main(arguments)
        found = 0
    except SystemExit as stopped:
        found = stopped.code
    finally:
        for name in closed:
            getattr(sys, name).close()
    assert found == code


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
@pytest.mark.parametrize("arguments", [["init", "scene"], ["psd", "--help"]])
def test_text_that_an_encoding_lacks_is_written_as_escapes(monkeypatch, encoding, arguments):
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    assert exit_code(*arguments) == 0
    stream.flush()
    text = stream.buffer.getvalue().decode(encoding)
    assert ("²" if encoding != "ascii" else r"\xb2") in text.replace("³", "²").replace("b3", "b2")


def test_a_file_name_that_is_not_unicode_is_escaped(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    monkeypatch.setattr(sys, "stderr", stream)
    assert exit_code("iri", "gr\udcfcn.erd") == 2
    assert rb"gr\udcfcn.erd: No such file" in stream.buffer.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_full_disk_behind_a_stream_is_one_line_without_a_message_at_exit(stream):
    """As with `trueterrain --version > /dev/full`; python itself would exit with 120."""
    arguments = {"stdout": "--version", "stderr": "versio"}[stream]
    code = f"from trueterrain.cli import main; main(['{arguments}'])"
    with open("/dev/full", "w") as full:  # noqa: PTH123
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, stream: full}
        finished = subprocess.run([sys.executable, "-c", code], **streams, text=True, check=False)
    assert finished.returncode == 2
    said = "trueterrain: error: No space left on device.\n"
    assert (finished.stdout, finished.stderr) == (
        (None, said) if stream == "stdout" else ("", None)
    )


def test_a_closed_pipe_of_errors_is_no_failure():
    """As with `trueterrain iri none.erd 2>&1 | head -0`."""
    code = "from trueterrain.cli import main; main(['iri', 'none.erd'])"
    program = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)
    program.stderr.close()
    assert program.wait() == 2


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGPIPE")
@pytest.mark.parametrize("arguments", [["--help"], ["init", "scene"]])
def test_a_reader_that_closes_the_pipe_gives_the_code_of_shells(arguments):
    """As with `trueterrain --help | head -1`: 128 and the number of SIGPIPE."""
    code = f"from trueterrain.cli import main; main({arguments})"
    program = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    program.stdout.close()
    assert program.wait() == 141


def test_control_characters_are_written_as_escapes():
    assert printable_text(ESCAPE) == r"\x1b]0;owned\x07\x1b[31m\x9b2J\u202e"
    assert printable_text("height [µm]\tsd\n°, é, 道路") == "height [µm]\tsd\n°, é, 道路"


def test_control_characters_of_file_names_do_not_reach_the_terminal(run, tmp_path):
    """Names and headers are foreign text, in results, errors and warnings."""
    path = tmp_path / f"a{ESCAPE}.csv"
    path.write_text(PROFILE)
    for arguments in (
        ["info", path],
        ["iri", path],
        ["iri", f"{path}.none"],
        ["psd", path],
        ["rn", path],
        ["evenness", path],
        ["compare", path, path],
        ["plot", path, "-o", f"{path}.png"],
        ["convert", path, "-o", f"{path}.erd"],
        ["init", "drift", path, path],
        ["simulate", f"{path}.toml", "-o", tmp_path],
    ):
        finished = run(*arguments)
        text = finished.out + finished.err
        assert "owned" in text, arguments
        assert not set(text) & set("\x1b\x07\x9b\u202e"), arguments
    assert json.loads(run("info", path, "--json").out)["files"][0]["file"] == str(path)


def test_escapes_in_the_header_of_a_point_cloud_are_written_as_escapes(run, tmp_path):
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.generating_software = "soft\x1b[31mware"
    header.system_identifier = "sys\x1b[0mtem"
    cloud = laspy.LasData(header)
    cloud.x = cloud.y = cloud.z = [0.0, 1.0, 2.0]
    cloud.write(tmp_path / "cloud.las")
    finished = run("info", tmp_path / "cloud.las")
    assert finished.code == 0
    assert "\x1b" not in finished.out
    assert r"\x1b[31mware" in finished.out
