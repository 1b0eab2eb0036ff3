"""Outputs appear whole or not at all."""

import os
import shutil
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from trueterrain.engine.readback import refuse_full_disk
from trueterrain.errors import OutputError


@contextmanager
def whole_output(path: str | Path, *, force: bool = False) -> Iterator[Path]:
    """Write a file under a temporary name and rename it when the block ends without error.

    Parameters
    ----------
    path : str or Path
        Where the finished file shall be.
    force : bool
        Replace a file that is there already.

    Yields
    ------
    Path
        Temporary name beside `path`, with the same ending, to write to.

    Raises
    ------
    OutputError
        If the file exists and `force` is false, or its folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_output(Path(folder) / "a.txt") as temporary:
    ...         _ = temporary.write_text("whole")
    ...     (Path(folder) / "a.txt").read_text()
    'whole'
    """
    path = Path(path)
    require_writable(path, force=force)
    temporary = path.with_name(f".{uuid.uuid4().hex[:8]}.part.{path.name}")
    try:
        yield temporary
        # fsync, so that a power cut cannot leave a renamed but empty file
        with temporary.open("rb") as stream:
            os.fsync(stream.fileno())
        temporary.replace(path)
    except OSError as error:
        refuse_full_disk(error, path)
        raise
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()


@contextmanager
def whole_folder(path: str | Path, *, force: bool = False) -> Iterator[Path]:
    """Write files and folders into a temporary one and move them when the block ends without error.

    Parameters
    ----------
    path : str or Path
        Folder in which the finished files shall be; it is made if it does not exist.
    force : bool
        Write into a folder that holds files already: files and folders of the same name are
        replaced, all others stay.

    Yields
    ------
    Path
        Temporary folder to write to.

    Raises
    ------
    OutputError
        If the folder is not empty and `force` is false, or the folder above it does not exist.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as above:
    ...     with whole_folder(Path(above) / "out") as folder:
    ...         _ = (folder / "a.txt").write_text("whole")
    ...     [file.name for file in (Path(above) / "out").iterdir()]
    ['a.txt']
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise OutputError("is a file, not a folder", path=path, cure="Name a folder.")
    if path.is_dir() and any(path.iterdir()) and not force:
        raise OutputError(
            "is not empty and nothing in it is overwritten",
            path=path,
            cure="Choose another folder, or add --force (force=True).",
        )
    if not path.absolute().parent.is_dir():
        raise OutputError(
            f"the folder {path.parent} does not exist", path=path, cure="Create it first."
        )
    temporary = path.absolute().with_name(f".{uuid.uuid4().hex[:8]}.part.{path.name}")
    temporary.mkdir()
    try:
        yield temporary
        path.mkdir(exist_ok=True)
        for file in sorted(temporary.iterdir()):
            if (path / file.name).is_dir():
                shutil.rmtree(path / file.name)
            file.replace(path / file.name)
    except OSError as error:
        refuse_full_disk(error, path)
        raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def require_writable(
    path: str | Path, *, force: bool = False, inputs: Iterable[str | Path] = ()
) -> None:
    """Raise if an output may not be written, before the work for it begins.

    Parameters
    ----------
    path : str or Path
        Where the output shall be.
    force : bool
        Whether a file that is there already may be replaced.
    inputs : iterable of str or Path
        Files that the work reads; none of them is replaced, not even with `force`.

    Raises
    ------
    OutputError
        If the file exists and `force` is false, if it is an input or a folder, or if its folder
        does not exist.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError("is a folder, not a file", path=path, cure="Name a file.")
    if path.exists() and any(path.samefile(file) for file in inputs if Path(file).exists()):
        raise OutputError(
            "is an input as well, and inputs are never modified",
            path=path,
            cure="Choose another name.",
        )
    if path.exists() and not force:
        raise OutputError(
            "exists already and is not overwritten",
            path=path,
            cure="Choose another name, or add --force (force=True).",
        )
    if not path.parent.is_dir():
        raise OutputError(
            f"the folder {path.parent} does not exist", path=path, cure="Create it first."
        )
