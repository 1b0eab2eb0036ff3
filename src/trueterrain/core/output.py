"""Atomic outputs: complete or absent, and never in place of other data."""

import json
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from trueterrain.core._staging import (
    NEW,
    OLD,
    defer_signals,
    is_folder,
    is_staging,
    move_in,
    publish_file,
    publish_folder,
    replace_store,
    staging_folder,
)
from trueterrain.core.errors import OutputError
from trueterrain.core.manifest import (
    MANIFEST,
    files_below,
    is_as_written,
    read_manifest,
    write_manifest,
)

_OURS = "trueterrain/"  # prefix of the attribute "kind" of a store of this package
_STORE = ("zarr.json", ".zgroup", ".zarray", ".zattrs")  # metadata of Zarr 3 and 2
# files of a Zarr 3 store, not those of another one in it
_PART = re.compile(r"(?!(.*/)?[^/]*\.zarr/)(.*/)?(zarr\.json|c([./]\d+)*)")


@contextmanager
def whole_output(path: str | Path, *, force: bool = False) -> Iterator[Path]:
    """Write a file in a hidden folder and rename it when the block ends without error.

    Parameters
    ----------
    path : str or Path
        Path of the finished file.
    force : bool
        Replace a file that is there already.

    Yields
    ------
    Path
        Temporary file of the same name and ending to write to.

    Raises
    ------
    OutputError
        As by `require_writable`, at the beginning and again at the end; if another process writes
        the same file.

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
    target = _resolve_target(path)
    with staging_folder(target.parent, target.name, path) as staging:
        temporary = staging / NEW / target.name
        yield temporary
        # fsync, so that a power cut cannot leave a renamed but empty file
        with temporary.open("rb") as stream:
            os.fsync(stream.fileno())
        require_writable(path, force=force)
        if force:
            temporary.replace(target)
            return
        try:
            publish_file(temporary, target)
        except FileExistsError:
            raise _exists_error(path) from None


@contextmanager
def whole_store(path: str | Path, kinds: Sequence[str], *, force: bool = False) -> Iterator[Path]:
    """Write a Zarr store in a hidden folder and rename it when the block ends without error.

    Parameters
    ----------
    path : str or Path
        Path of the store: a folder ``NAME.zarr``.
    kinds : sequence of str
        Kinds of store that may be replaced.
    force : bool
        Replace a store that is there already.

    Yields
    ------
    Path
        Temporary path of the same name.

    Raises
    ------
    OutputError
        As by `require_writable`, at the beginning and again at the end; if another process writes
        the same store.
    """
    path = Path(path)
    require_writable(path, force=force, replaces=kinds)
    target = _resolve_target(path)
    with staging_folder(target.parent, target.name, path) as staging:
        temporary = staging / NEW / target.name
        yield temporary
        require_writable(path, force=force, replaces=kinds)
        with defer_signals():
            if target.exists():
                replace_store(temporary, target, staging / OLD)
                return
            try:
                publish_folder(temporary, target)
            except FileExistsError:
                raise _exists_error(path) from None


@contextmanager
def whole_folder(
    path: str | Path,
    *,
    result: str = "",
    force: bool = False,
    inputs: Iterable[str | Path] = (),
    names: Iterable[str] = (),
) -> Iterator[Path]:
    """Write files and folders into a hidden one and move them when the block ends without error.

    Where there was nothing, the folder appears by one rename. Else the files of the earlier result
    are replaced, and those that the new one lacks are removed; from the first of these moves to the
    last there is no manifest, and a call that follows completes them. Files that no manifest names
    stay.

    Parameters
    ----------
    path : str or Path
        Folder of the finished files; it is made if it does not exist.
    result : str
        Kind of the result; it replaces only an earlier one of the same kind.
    force : bool
        Replace an earlier result, or write into a folder that holds other files.
    inputs : iterable of str or Path
        Files, stores and folders that the work reads.
    names : iterable of str
        Files that will be written, as far as known: what has their names is seen before the work.

    Yields
    ------
    Path
        Temporary folder to write to.

    Raises
    ------
    OutputError
        If the folder is not empty and `force` is false, if it holds files that would be replaced
        and are of no earlier result, as by `require_writable`, or if another process writes the
        same folder.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as above:
    ...     with whole_folder(Path(above) / "out") as folder:
    ...         _ = (folder / "a.txt").write_text("whole")
    ...     sorted(file.name for file in (Path(above) / "out").iterdir())
    ['a.txt', 'manifest.json']
    """
    path, inputs = Path(path), list(inputs)
    require_writable(path, force=force, inputs=inputs, replaces="folder")
    target = _resolve_target(path)
    there = target.is_dir()
    # in a folder that exists, so that it may be a mount point or the folder that one is in
    with staging_folder(target if there else target.parent, target.name, path) as staging:
        _require_result(path, target, result, names, force=force)
        temporary = staging / NEW / target.name if not there else staging / NEW
        temporary.mkdir(exist_ok=True)
        yield temporary
        require_writable(path, force=force and there, inputs=inputs, replaces="folder")
        write_manifest(temporary, result)
        made = [file.name for file in temporary.iterdir()]
        if there:
            _require_result(path, target, result, made, force=force)
            move_in(staging, made, _obsolete_files(target, temporary))
            return
        try:
            publish_folder(temporary, target)
        except FileExistsError:
            raise _not_empty(path) from None


@contextmanager
def whole_stores(
    folder: str | Path,
    names: Sequence[str],
    kinds: Sequence[str],
    *,
    force: bool = False,
    inputs: Iterable[str | Path] = (),
) -> Iterator[Path]:
    """Write several Zarr stores, which appear together in a folder that may hold others.

    Parameters
    ----------
    folder : str or Path
        Folder of the stores; it is made if it does not exist.
    names : sequence of str
        Names of the stores, ``NAME.zarr``.
    kinds : sequence of str
        Kinds of store that may be replaced.
    force : bool
        Replace stores that are there already.
    inputs : iterable of str or Path
        Files, stores and folders that the work reads.

    Yields
    ------
    Path
        Temporary folder to write to.

    Raises
    ------
    OutputError
        If one of them may not be written, as by `require_writable`; if another process writes
        them.
    """
    folder, inputs = Path(folder), list(inputs)
    require_writable(folder, force=True, replaces="folder")
    made = not folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        with staging_folder(_resolve_target(folder), names[0], folder / names[0]) as staging:
            for name in names:
                require_writable(folder / name, force=force, inputs=inputs, replaces=kinds)
            yield staging / NEW
            for name in names:
                require_writable(folder / name, force=force, inputs=inputs, replaces=kinds)
            move_in(staging, names)
    finally:
        if made and not any(folder.iterdir()):
            folder.rmdir()


def require_writable(
    path: str | Path,
    *,
    force: bool = False,
    inputs: Iterable[str | Path] = (),
    replaces: str | Sequence[str] = "file",
) -> None:
    """Raise if an output may not be written, before the work for it begins.

    Every command and every writer asks here. Links are followed, of outputs and of inputs.

    Parameters
    ----------
    path : str or Path
        Path of the output.
    force : bool
        Whether an earlier output may be replaced.
    inputs : iterable of str or Path
        Files, stores and folders that the work reads. The output is none of them, holds none and
        lies in none, not even with `force`.
    replaces : str or sequence of str
        What the output is and may replace: ``"file"``, ``"folder"`` for a folder of results, or
        the kinds of Zarr store, such as ``("run",)``.

    Raises
    ------
    ValueError
        If the output is a store, and its name does not end with .zarr.
    OutputError
        If something is there and `force` is false, or it is another thing than the output; if the
        output is, holds or lies in an input, or lies in a store; if its folder does not exist.

    Examples
    --------
    >>> require_writable("missing/road.crg")
    Traceback (most recent call last):
    trueterrain.core.errors.OutputError: missing/road.crg: the folder missing does not exist. ...
    """
    path = Path(path)
    if not isinstance(replaces, str) and path.suffix != ".zarr":
        message = f"path must end with .zarr, got {str(path)!r}."
        raise ValueError(message)
    target = _resolve_target(path)
    if not target.parent.is_dir():
        raise OutputError(
            f"the folder {path.parent} does not exist", path=path, cure="Create it first."
        )
    for above in target.parents:
        if any((above / name).is_file() for name in _STORE):
            raise OutputError(
                f"would lie within another store, {above}",
                path=path,
                cure="Choose a folder beside it.",
            )
    _require_apart(path, target, inputs)
    if target.exists():
        _require_replaceable(path, target, replaces, force=force)


def _require_apart(path: Path, target: Path, inputs: Iterable[str | Path]) -> None:
    """Raise if an output is, holds or lies in an input."""
    for source in inputs:
        other = _resolve_target(Path(source))
        if not other.exists():
            continue
        if target.exists() and target.samefile(other):
            rule = "is an input as well"
        elif any(above.samefile(target) for above in other.parents if target.exists()):
            rule = f"holds the input {source}"
        elif any(above.samefile(other) for above in target.parents if above.exists()):
            rule = f"lies in the input {source}"
        else:
            continue
        raise OutputError(
            f"{rule}, and inputs are never modified", path=path, cure="Choose another name."
        )


def _require_replaceable(
    path: Path, target: Path, replaces: str | Sequence[str], *, force: bool
) -> None:
    """Raise if the existing file or folder is of another kind, or may not be replaced."""
    found = _kind_at_path(target)
    if replaces == "folder":
        if found == "file":
            raise OutputError("is a file, not a folder", path=path, cure="Name a folder.")
        if found != "folder":
            raise OutputError(
                f"is {found}, not a folder for results", path=path, cure="Choose another name."
            )
        if not force and any(not is_staging(one) for one in target.iterdir()):
            raise _not_empty(path)
        return
    if replaces == "file" and found == "folder":
        raise OutputError("is a folder, not a file", path=path, cure="Name a file.")
    if not force:
        raise _exists_error(path)
    kinds = ["file"] if isinstance(replaces, str) else [_kind_text(kind) for kind in replaces]
    if found not in kinds:
        what = "no Zarr store" if found in ("file", "folder") else found
        raise OutputError(
            f"is {what}, which is never replaced", path=path, cure="Choose another name."
        )
    if found == "file":
        return
    for file in files_below(target):
        name = file.relative_to(target).as_posix()
        if not _PART.fullmatch(name) or file.is_symlink():
            raise OutputError(
                f"holds {name}, which is no part of the store and would be lost",
                path=path,
                cure="Move it to another folder, or choose another name.",
            )


def _require_result(
    path: Path, target: Path, result: str, names: Iterable[str], *, force: bool
) -> None:
    """Raise if a folder that exists holds another result, or other files of these names."""
    if not target.is_dir():
        return
    about = read_manifest(target)
    if about is not None and about["result"] != result:
        raise OutputError(
            f"holds a result of another command ({about['result']!r}), which is never replaced",
            path=path,
            cure="Choose another folder.",
        )
    known = set() if about is None else {MANIFEST, *about["files"]}
    for entry in (target / name for name in names):
        if not os.path.lexists(entry):
            continue
        for file in files_below(entry) if is_folder(entry) else [entry]:
            if file.relative_to(target).as_posix() not in known or not force:
                raise OutputError(
                    f"holds {file.relative_to(target)}, which no {MANIFEST} names, and which would "
                    "be replaced",
                    path=path,
                    cure="Move it to another folder, or choose another one.",
                )


def _obsolete_files(folder: Path, new: Path) -> list[str]:
    """Files of the earlier result that the new one lacks and that were not changed since."""
    about = read_manifest(folder)
    files = {} if about is None else about["files"]
    return [
        name
        for name, one in files.items()
        if not (new / name).exists() and is_as_written(folder / name, one)
    ]


def _kind_at_path(path: Path) -> str:
    """Kind of the entry at a path: ``"file"``, ``"folder"``, or another kind in words."""
    if not path.is_dir():
        return "file" if path.is_file() else "no file, but a device or pipe"
    if not any((path / name).is_file() for name in _STORE):
        return "folder"
    try:
        about = json.loads((path / "zarr.json").read_text(encoding="utf-8"))
        kind = str(about["attributes"]["kind"])
    except (OSError, ValueError, TypeError, KeyError):
        return "a store of another program"
    return (
        _kind_text(kind.removeprefix(_OURS))
        if kind.startswith(_OURS)
        else "a store of another kind"
    )


def _kind_text(kind: str) -> str:
    words = {"run": "a recorded run", "points": "points in a store"}
    return words.get(kind, f"a {kind} in a store")


def _resolve_target(path: Path) -> Path:
    """Path with links resolved, whether it exists or not."""
    return Path(os.path.realpath(path))


def _exists_error(path: Path) -> OutputError:
    return OutputError(
        "exists already and is not overwritten",
        path=path,
        cure="Choose another name, or add --force (force=True).",
    )


def _not_empty(path: Path) -> OutputError:
    return OutputError(
        "is not empty and nothing in it is overwritten",
        path=path,
        cure="Choose another folder, or add --force (force=True).",
    )
