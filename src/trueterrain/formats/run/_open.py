"""Runs from a store, lazily."""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from trueterrain.errors import FormatError
from trueterrain.formats.run._rules import check_layout, group_of

#: Scans in a block, unless told otherwise.
BLOCK = 2000


def open_run(path: str | Path) -> xr.DataTree:
    """Run from a store; values are read when they are asked for, chunk by chunk.

    Attributes, groups, variables, dimensions and units are checked, values are not: see
    `check_run`.

    Parameters
    ----------
    path : str or Path
        Folder ``NAME.zarr``.

    Returns
    -------
    xarray.DataTree
        Groups ``scans``, ``navigation`` and, where recorded, ``accelerometers`` and ``truth``.
        Ranges are float64 [m], NaN where there was no return.

    Raises
    ------
    FormatError
        If it is no Zarr store, or damaged.
    SchemaError
        If it is no run.
    """
    return check_layout(open_tree(path), path)


def open_tree(path: str | Path) -> xr.DataTree:
    """Tree from a store, unchecked."""
    path = Path(path)
    if not path.exists():
        message = f"there is no run {path}"
        raise FileNotFoundError(message)
    if not (path / "zarr.json").is_file():
        raise FormatError(
            "is no Zarr 3 store: it holds no zarr.json", path=path,
            cure="Name the folder NAME.zarr of a run, or copy the whole folder again.",
        )  # fmt: skip
    try:
        tree = xr.open_datatree(
            path,
            engine="zarr",
            chunks=None,
            cache=False,
            consolidated=False,
            decode_times=False,
            decode_timedelta=False,
        )
    except (ValueError, KeyError, OSError, TypeError) as error:
        raise _damaged(path, error) from None
    return tree


def scan_blocks(run: xr.DataTree | str | Path, size: int = BLOCK) -> Iterator[xr.Dataset]:
    """Scans of a run block by block, never all at once.

    Parameters
    ----------
    run : xarray.DataTree or path
        The run, or its store.
    size : int
        Largest number of scans in a block; some thousand, in multiples of 1000, are read fastest.

    Yields
    ------
    xarray.Dataset
        ``time`` (scan), ``range`` and perhaps ``intensity`` (scan, beam), ``angle`` and ``delay``
        (beam), in memory; ``attrs["first_scan"]`` is the index of the first scan.

    Raises
    ------
    ValueError
        If `size` is less than 1.
    FormatError
        If a chunk is damaged.
    """
    if size < 1:
        message = f"size must be at least 1 scan, got {size}."
        raise ValueError(message)
    tree = run if isinstance(run, xr.DataTree) else open_run(run)
    scans = group_of(tree, "scans")
    source = None if isinstance(run, xr.DataTree) else run
    for start in range(0, scans.sizes["scan"], size):
        try:
            block = scans.isel(scan=slice(start, start + size)).load()
        except (RuntimeError, ValueError, OSError) as error:
            raise _damaged(source, error, place=f"scans from {start}") from None
        yield block.assign_attrs(first_scan=start)


def _damaged(path: str | Path | None, error: Exception, *, place: str | None = None) -> FormatError:
    return FormatError(
        f"is damaged ({error})", path=path, place=place, cure="Copy the whole folder again."
    )
