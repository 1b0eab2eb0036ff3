"""What a store may replace."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from trueterrain.errors import FormatError, OutputError
from trueterrain.formats.run._store import require_store_writable, whole_store
from trueterrain.formats.signature import kind_of_store


@contextmanager
def whole(path: Path, *, force: bool) -> Iterator[Path]:
    """Write a store under a temporary name and rename it when the block ends without error."""
    require_replaceable(path, force=force)
    with whole_store(path, force=force) as temporary:
        yield temporary


def require_replaceable(
    path: str | Path, *, force: bool = False, inputs: Iterable[str | Path] = ()
) -> None:
    """Raise if a store may not be written, before the work for it begins.

    Parameters
    ----------
    path : str or Path
        Where the store shall be: a folder ``NAME.zarr``.
    force : bool
        Whether points, a surface or a profile that is there already may be replaced.
    inputs : iterable of str or Path
        Files and stores that the work reads; none of them is replaced, not even with `force`.

    Raises
    ------
    ValueError
        If the name does not end with .zarr.
    OutputError
        If it exists and `force` is false, if it is an input, a recorded run or anything else that
        is no store of this kind, if it lies within another store, or if its folder does not exist.

    Examples
    --------
    >>> require_replaceable("nowhere/points.zarr")
    Traceback (most recent call last):
    trueterrain.errors.OutputError: nowhere/points.zarr: the folder nowhere does not exist. ...
    """
    path = Path(path)
    if path.exists() and any(path.samefile(file) for file in inputs if Path(file).exists()):
        raise OutputError(
            "is an input as well, and inputs are never modified", path=path,
            cure="Choose another name.",
        )  # fmt: skip
    require_store_writable(path, force=force)
    if (path.absolute().parent / "zarr.json").exists():
        raise OutputError(
            "would lie within another store", path=path, cure="Choose a folder beside it."
        )
    if path.exists() and _found(path) not in ("points", "surface", "profile"):
        raise OutputError(
            f"is {_found(path)}, which is never replaced", path=path, cure="Choose another name."
        )


def _found(path: Path) -> str:
    try:
        kind = kind_of_store(path)
    except FormatError:
        return "not a store of points, a surface or a profile"
    return "a recorded run" if kind == "run" else kind
