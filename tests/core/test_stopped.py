"""Outputs stopped at every call to the file system: the old one or the new one, never a mixture."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

import pytest

from trueterrain.core import _staging, whole_folder, whole_output, whole_store, whole_stores
from trueterrain.core._staging import recover_folder
from trueterrain.core.errors import OutputError
from trueterrain.core.manifest import missing_files

pytestmark = pytest.mark.slow

CHANGING = {"os.rename", "os.link", "os.mkdir", "os.remove", "os.rmdir", "shutil.rmtree", "open"}
MOST = 200  # calls of one output; each of these has far fewer


class Killed(BaseException):
    """The process is dead: whatever it tries from here on fails."""


class _Watch:
    """Counts the calls that change the file system, and stops at one of them."""

    def __init__(self) -> None:
        self.left: int | None = None
        self.act: Callable[[], None] = self.die

    def __call__(self, event: str, args: tuple[object, ...]) -> None:
        if self.left is None or event not in CHANGING:
            return
        if event == "open" and not (isinstance(args[2], int) and args[2] & os.O_ACCMODE):
            return
        self.left -= 1
        if self.left < 0:
            self.act()

    def die(self) -> None:
        raise Killed


_WATCH = _Watch()
sys.addaudithook(_WATCH)  # stays for good, and does nothing while `left` is None


@pytest.fixture
def watch() -> Iterator[_Watch]:
    _WATCH.act = _WATCH.die
    yield _WATCH
    _WATCH.left = None


@pytest.fixture(params=["exchange", "links", "neither"])
def system(request, monkeypatch):
    """File systems that exchange names, that have hard links only, and that have neither."""
    if request.param != "exchange":
        monkeypatch.setattr(_staging, "_rename_with_flag", lambda *_: False)
    if request.param == "neither":

        def refuse(*_, **__):
            raise PermissionError

        monkeypatch.setattr(os, "link", refuse)
    return request.param


def write_store(path: Path, word: str, kind: str = "run") -> None:
    (path / "scans").mkdir(parents=True)
    about = {"attributes": {"kind": f"trueterrain/{kind}"}}
    (path / "zarr.json").write_text(json.dumps(about))
    (path / "scans" / "zarr.json").write_text(word)
    (path / "scans" / "c.0.0").write_text(word)


def write_file(path: Path, word: str) -> None:
    path.write_text(word)


def write_result(path: Path, word: str) -> None:
    (path / "report.html").write_text(word)
    (path / f"{word}.crg").write_text(word)
    write_store(path / "points.zarr", word, "points")


def write_both(path: Path, word: str) -> None:
    for name in ("there.zarr", "back.zarr"):
        write_store(path / name, word)


class Case(NamedTuple):
    open: Callable[..., AbstractContextManager[Path]]
    write: Callable[[Path, str], None]


CASES = {
    "file": Case(lambda out, **how: whole_output(out / "a.crg", **how), write_file),
    "store": Case(lambda out, **how: whole_store(out / "a.zarr", ("run",), **how), write_store),
    "folder": Case(lambda out, **how: whole_folder(out / "a", result="x", **how), write_result),
    "stores": Case(
        lambda out, **how: whole_stores(out / "a", ("there.zarr", "back.zarr"), ("run",), **how),
        write_both,
    ),
}


def write(case: Case, out: Path, word: str, *, force: bool = False) -> None:
    with case.open(out, force=force) as temporary:
        case.write(temporary, word)


def seen(out: Path) -> dict[str, str]:
    """All files that are not hidden, and what is in them."""
    return {
        path.relative_to(out).as_posix(): path.read_text()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(out).parts)
    }


def hidden(out: Path) -> list[str]:
    return [str(path) for path in out.rglob(".*")]


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_killed_at_any_call_the_old_or_the_new_output_is_whole(
    tmp_path, watch, system, name, force
):
    case, old = CASES[name], tmp_path / "old"
    old.mkdir()
    if force:
        write(case, old, "old")
        for folder in old.glob("a"):
            (folder / "mine.txt").write_text("mine")
    before, found, killed = seen(old), [], True
    for number in range(MOST):
        out = tmp_path / str(number)
        shutil.copytree(old, out)
        killed, watch.left = False, number
        try:
            write(case, out, "new", force=force)
        except Killed:
            killed = True
        watch.left = None
        if not killed:
            break
        if (out / "a" / "manifest.json").exists():  # without it, a folder is no result
            assert missing_files(out / "a") == []
        for folder in (out, out / "a"):
            recover_folder(folder)
        if system == "neither" and (out / "a.crg").exists() and not (out / "a.crg").stat().st_size:
            (out / "a.crg").unlink()  # such a file system takes a name by an empty file only
        found.append(seen(out))
        # a call that follows leaves nothing of the one that died
        if force or found[-1] == before:
            write(case, out, "new", force=force)
        else:
            with pytest.raises(OutputError, match=r"exists already|is not empty"):
                write(case, out, "new")
        assert hidden(out) == []
    assert not killed
    after = seen(out)
    assert hidden(out) == []
    assert "old" not in after.values()
    assert after.get("a/mine.txt") == before.get("a/mine.txt")
    assert all(one in (before, after) for one in found)
    assert before in found
    assert after in found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["store", "folder", "stores"])
def test_a_stop_during_the_move_waits_for_its_end(tmp_path, watch, monkeypatch, name, number):
    monkeypatch.setattr(_staging, "_rename_with_flag", lambda *_: False)
    case = CASES[name]
    write(case, tmp_path, "old", force=True)
    sent = []

    def stop():
        watch.left = None
        sent.append(number)
        signal.raise_signal(number)

    def end(*_):
        raise KeyboardInterrupt

    moving = {"store": "replace_store", "folder": "replace_entry", "stores": "replace_entry"}[name]
    place = "trueterrain.core.output" if name == "store" else "trueterrain.core._staging"
    whole = getattr(_staging, moving)

    def interrupted(*arguments):
        if not sent:
            watch.act, watch.left = stop, 1
        whole(*arguments)

    monkeypatch.setattr(f"{place}.{moving}", interrupted)
    usual = signal.signal(number, end)
    try:
        with pytest.raises(KeyboardInterrupt):
            write(case, tmp_path, "new", force=True)
        assert signal.getsignal(number) is end
    finally:
        signal.signal(number, usual)
    assert sent == [number]
    assert "old" not in seen(tmp_path).values()
    assert "new" in seen(tmp_path).values()
    assert hidden(tmp_path) == []


@pytest.mark.parametrize("name", CASES)
def test_what_appears_during_the_work_is_not_replaced(tmp_path, system, name):
    case = CASES[name]

    def work() -> None:
        with case.open(tmp_path) as new:
            case.write(new, "new")
            appeared = (
                tmp_path
                / {
                    "file": "a.crg",
                    "store": "a.zarr/x",
                    "folder": "a/x",
                    "stores": "a/back.zarr/x",
                }[name]
            )
            appeared.parent.mkdir(parents=True, exist_ok=True)
            appeared.write_text("meanwhile")

    with pytest.raises(OutputError, match=r"exists already|is not empty"):
        work()
    assert list(seen(tmp_path).values()) == ["meanwhile"]
    assert hidden(tmp_path) == []


def test_a_name_taken_in_the_last_moment_is_not_replaced(tmp_path, system):
    (tmp_path / "new").write_text("new")
    (tmp_path / "a").write_text("meanwhile")
    with pytest.raises(FileExistsError):
        _staging.publish_file(tmp_path / "new", tmp_path / "a")
    assert (tmp_path / "a").read_text() == "meanwhile"
    (tmp_path / "full" / "x").mkdir(parents=True)
    (tmp_path / "folder").mkdir()
    for target in ("a", "full"):
        with pytest.raises(FileExistsError):
            _staging.publish_folder(tmp_path / "folder", tmp_path / target)


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_two_processes_cannot_write_the_same_output(tmp_path, name, force):
    case = CASES[name]
    with case.open(tmp_path, force=force) as new:
        case.write(new, "first")
        with (
            pytest.raises(OutputError, match="is being written by another process"),
            case.open(tmp_path, force=force),
        ):
            pytest.fail("it was opened twice")
        recover_folder(tmp_path)  # as another output in this folder does; the living one stays
    assert "first" in seen(tmp_path).values()


def test_a_folder_of_a_dead_process_goes_and_that_of_a_living_one_stays(tmp_path):
    code = (
        "import sys, time\n"
        "from trueterrain.core import whole_output\n"
        "with whole_output(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half')\n"
        "    print('ready', flush=True)\n"
        "    time.sleep(60)\n"
    )
    arguments = [sys.executable, "-c", code, str(tmp_path / "a.crg")]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
        write(CASES["store"], tmp_path, "new")  # another output beside it
        assert len(list(tmp_path.glob(".a.crg.*"))) == 1
        with pytest.raises(OutputError, match="is being written by another process"):
            write(CASES["file"], tmp_path, "new")
        program.send_signal(signal.SIGKILL)
        program.wait()
    write(CASES["store"], tmp_path, "again", force=True)
    assert hidden(tmp_path) == []
    write(CASES["file"], tmp_path, "new")
    assert (tmp_path / "a.crg").read_text() == "new"


def test_a_move_that_fails_is_completed_by_the_next_call(tmp_path, monkeypatch):
    write(CASES["folder"], tmp_path, "old")

    def fail(*_):
        raise PermissionError(13, "Permission denied", str(tmp_path / "a" / "report.html"))

    with monkeypatch.context() as patched:
        patched.setattr("trueterrain.core._staging.replace_entry", fail)
        with pytest.raises(OutputError, match=r"report\.html: could not be completed"):
            write(CASES["folder"], tmp_path, "new", force=True)
    assert missing_files(tmp_path / "a") == ["manifest.json"]  # no result as it is
    with pytest.raises(OutputError, match="is not empty"), whole_folder(tmp_path / "a", result="x"):
        pass
    recover_folder(tmp_path / "a")
    assert missing_files(tmp_path / "a") == []
    assert "old" not in seen(tmp_path).values()


def test_a_manifest_that_names_files_of_others_removes_none(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    write(CASES["folder"], tmp_path, "old")
    manifest = tmp_path / "a" / "manifest.json"
    manifest.write_text(manifest.read_text().replace("old.crg", "../mine.txt"))
    assert missing_files(tmp_path / "a") == ["manifest.json"]
    with pytest.raises(OutputError, match="which no manifest"):
        write(CASES["folder"], tmp_path, "new", force=True)
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_only_what_the_same_command_wrote_is_replaced(tmp_path):
    folder = tmp_path / "a"
    folder.mkdir()
    (folder / "report.html").write_text("mine")
    with pytest.raises(OutputError, match=r"holds report\.html, which no manifest\.json names"):
        write(CASES["folder"], tmp_path, "new", force=True)
    assert seen(tmp_path) == {"a/report.html": "mine"}
    (folder / "report.html").unlink()
    (folder / "mine.txt").write_text("mine")
    write(CASES["folder"], tmp_path, "old", force=True)
    (folder / "old.crg").write_text("edited")
    (folder / "points.zarr" / "mine.laz").write_text("mine")
    with pytest.raises(OutputError, match=r"holds points\.zarr/mine\.laz"):
        write(CASES["folder"], tmp_path, "new", force=True)
    (folder / "points.zarr" / "mine.laz").unlink()
    write(CASES["folder"], tmp_path, "new", force=True)
    assert (folder / "old.crg").read_text() == "edited"  # the new result lacks it
    with (
        pytest.raises(OutputError, match="a result of another command"),
        whole_folder(folder, result="y", force=True),
    ):
        pass
    assert missing_files(folder) == []
