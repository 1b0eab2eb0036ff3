"""Hidden folders in which outputs are written, and recovery of those of processes that died.

Each output has one, beside it or in it: ``.NAME.trueterrain-part``. Its process holds a lock on a
file in it, which ends with the process, however it ends. Whoever gets the lock later knows that
the owner is dead: it completes a move that had begun, and removes the rest.
Renames replace nothing, or exchange two names, as far as the file system supports it.
"""

import errno
import json
import os
import shutil
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from trueterrain.core.errors import OutputError
from trueterrain.core.manifest import MANIFEST
from trueterrain.core.readback import refuse_full_disk

# of renameat2(2); file systems and kernels that lack one of them answer with one of these errors
_HERE, _NOREPLACE, _EXCHANGE = -100, 1, 2
_LACKING = (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP)

ENDING = ".trueterrain-part"
NEW, OLD = "new", "old"  # folders of what is being written, and of what it replaces
_LOCK, _JOURNAL = "lock", "journal.json"


def publish_file(source: Path, target: Path) -> None:
    """Rename a file to a free name.

    Raises
    ------
    FileExistsError
        If the name is taken, even since a moment before.
    """
    if _rename_with_flag(source, target, _NOREPLACE):
        return
    try:
        if not (target.exists() and target.samefile(source)):  # linked before a stop
            os.link(source, target)
        source.unlink()
    except FileExistsError:
        raise
    except OSError:  # no hard links either: take the name by an empty file, then replace that
        if not (target.is_file() and target.stat().st_size == 0):  # taken before a stop
            os.close(os.open(target, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        source.replace(target)


def publish_folder(source: Path, target: Path) -> None:
    """Rename a folder to a free name, or to that of an empty folder.

    Raises
    ------
    FileExistsError
        If a file has it, or a folder that is not empty.
    """
    try:
        source.rename(target)
    except OSError as error:
        if not os.path.lexists(target):
            raise
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from error


def replace_store(source: Path, target: Path, backup: Path) -> None:
    """Replace a folder; the earlier one ends up at `source` or in `backup`."""
    if not _rename_with_flag(source, target, _EXCHANGE):
        replace_entry(source, target, backup)


def replace_entry(source: Path, target: Path, backup: Path) -> None:
    """Rename a file or folder; a folder that has the name goes to `backup`, a file is replaced.

    As long as `source` is there, it can be called again after a stop at any moment.
    """
    if os.path.lexists(target) and (is_folder(source) or is_folder(target)):
        backup.mkdir(exist_ok=True)
        remove_path(backup / target.name)
        target.rename(backup / target.name)
    source.replace(target)


def remove_path(path: Path) -> None:
    """Remove a file, a link, or a folder with its contents; a missing one is no error."""
    if is_folder(path):
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def is_folder(path: Path) -> bool:
    """Whether this is a folder itself, not a link to one."""
    return path.is_dir() and not path.is_symlink()


@contextmanager
def defer_signals() -> Iterator[None]:
    """Defer Ctrl-C and SIGTERM until renames that belong together are done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    # a handler that python did not set (None) could not be restored
    before = {
        int(number): handler
        for number in (signal.SIGINT, signal.SIGTERM)
        if (handler := signal.getsignal(number)) is not None
    }
    try:
        for number in before:
            signal.signal(number, lambda caught, _: waiting.append(caught))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in waiting:
            signal.raise_signal(number)


def _rename_with_flag(source: Path, target: Path, flag: int) -> bool:
    """Rename by renameat2 of Linux; False if kernel or file system lack it."""
    if not sys.platform.startswith("linux"):
        return False
    import ctypes

    call = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if call is None:
        return False
    sys.audit("os.rename", str(source), str(target), _HERE, _HERE)
    if call(_HERE, os.fsencode(source), _HERE, os.fsencode(target), flag) == 0:
        return True
    code = ctypes.get_errno()
    if code in _LACKING:
        return False
    raise OSError(code, os.strerror(code), str(target))


@contextmanager
def staging_folder(folder: Path, name: str, output: Path) -> Iterator[Path]:
    """Hidden folder that only this process writes to; removed at the end with its contents.

    Parameters
    ----------
    folder : Path
        Where it is made, on the file system of the output.
    name : str
        Name of the output.
    output : Path
        Path of the output in messages.

    Yields
    ------
    Path
        The hidden folder, with an empty folder ``new``.

    Raises
    ------
    OutputError
        If another process writes the same output, or the disk is full.
    """
    recover_folder(folder)
    staging, lock = folder / f".{name}{ENDING}", None
    try:
        with defer_signals():  # so that a signal finds the folder either registered or absent
            staging, lock = _lock_folder(staging, output)
        (staging / NEW).mkdir()
        yield staging
    except OSError as error:
        refuse_full_disk(error, output)
        raise
    finally:
        if lock is not None:
            try:
                if not (staging / _JOURNAL).exists():  # otherwise the next call completes the move
                    _discard_folder(staging)
            finally:
                os.close(lock)


def recover_folder(folder: Path) -> None:
    """Complete or remove unfinished outputs of processes that died."""
    for staging in sorted(folder.glob(f".*{ENDING}")):
        try:
            lock = os.open(staging / _LOCK, os.O_RDWR)
        except OSError:
            # removed halfway, or just being made; its owner makes it again then
            with suppress(OSError):
                staging.rmdir()
            continue
        try:
            if _lock_file(lock) and _is_lock_of(staging, lock):
                _resume_move(staging)
                _discard_folder(staging)
        finally:
            os.close(lock)


def move_in(staging: Path, names: Sequence[str], removed: Sequence[str] = ()) -> None:
    """Move the outputs into the folder above the hidden one, all of them or none.

    Once the journal is there, the next call completes what this one cannot.

    Parameters
    ----------
    staging : Path
        The hidden folder, inside the folder of the outputs.
    names : sequence of str
        Files and folders in ``new`` to move; those of the same name are replaced.
    removed : sequence of str
        Files in the folder of the outputs that the new ones make void.
    """
    folder, draft = staging.parent, staging / f"{_JOURNAL}.part"
    about = {
        "names": sorted(names, key=lambda name: name == MANIFEST),  # the manifest is the last
        "replaced": [name for name in names if os.path.lexists(folder / name)],
        "removed": list(removed),
    }
    with draft.open("w", encoding="utf-8") as stream:
        json.dump(about, stream)
        stream.flush()
        os.fsync(stream.fileno())
    with defer_signals():
        draft.rename(staging / _JOURNAL)
        try:
            _resume_move(staging)
        except OSError as error:
            raise OutputError(
                f"could not be completed ({error.strerror}); what was written is in {staging}",
                path=error.filename2 or error.filename or folder,
                cure="When the reason is gone, the next call into this folder completes it.",
            ) from error


def is_staging(path: Path) -> bool:
    """Whether this is the hidden folder of an output."""
    return path.name.startswith(".") and path.name.endswith(ENDING)


def _resume_move(staging: Path) -> None:
    """Complete a move that had begun, from wherever it stopped."""
    folder, new, old = staging.parent, staging / NEW, staging / OLD
    if (staging / _JOURNAL).exists():
        about = json.loads((staging / _JOURNAL).read_text(encoding="utf-8"))
        if (new / MANIFEST).exists():
            (folder / MANIFEST).unlink(missing_ok=True)  # no result from here to the last move
        for name in about["removed"]:
            (folder / name).unlink(missing_ok=True)
            for above in (folder / name).relative_to(folder).parents:
                with suppress(OSError):  # holds other files
                    if above.name:
                        (folder / above).rmdir()
        for name in about["names"]:
            if not os.path.lexists(new / name):
                continue
            if name in about["replaced"]:
                replace_entry(new / name, folder / name, old)
            elif is_folder(new / name):
                publish_folder(new / name, folder / name)
            else:
                publish_file(new / name, folder / name)
        remove_path(old)
        (staging / _JOURNAL).unlink()
    if old.is_dir():  # a store that was about to be replaced
        for path in old.iterdir():
            if not os.path.lexists(folder / path.name):
                path.rename(folder / path.name)


def _lock_folder(staging: Path, output: Path) -> tuple[Path, int]:
    """Make the hidden folder and lock it."""
    while True:
        made = not staging.exists()
        staging.mkdir(exist_ok=True)
        try:
            lock = os.open(staging / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        except FileNotFoundError:  # another process has just finished, and removed it
            continue
        taken = _lock_file(lock)
        if taken is False or (taken is None and not made):
            os.close(lock)
            cure = "Wait until it is done, or choose another name."
            if taken is None:
                cure += f" If there is none, remove {staging}."
            raise OutputError("is being written by another process", path=output, cure=cure)
        if _is_lock_of(staging, lock):
            _resume_move(staging)
            _clear_folder(staging)
            return staging, lock
        os.close(lock)


def _lock_file(file: int) -> bool | None:
    """Lock a file until it is closed: True; False if another process has; None if unsupported."""
    try:
        import fcntl
    except ImportError:  # Windows
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return None
    return True


def _is_lock_of(staging: Path, file: int) -> bool:
    """Whether the file is still the lock, not one that its owner removed meanwhile."""
    try:
        return os.path.samestat((staging / _LOCK).stat(), os.fstat(file))
    except FileNotFoundError:
        return False


def _clear_folder(staging: Path) -> None:
    for path in staging.iterdir():
        if path.name != _LOCK:
            remove_path(path)


def _discard_folder(staging: Path) -> None:
    """Remove the hidden folder, the lock last; the next call removes the rest."""
    with suppress(OSError):
        _clear_folder(staging)
        (staging / _LOCK).unlink(missing_ok=True)
        staging.rmdir()
