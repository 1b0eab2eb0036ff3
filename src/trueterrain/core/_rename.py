"""Renames that replace nothing, or exchange two names, as far as the file system supports it."""

import errno
import os
import shutil
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# of renameat2(2); file systems and kernels that lack one of them answer with one of these errors
_HERE, _NOREPLACE, _EXCHANGE = -100, 1, 2
_LACKING = (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP)


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
