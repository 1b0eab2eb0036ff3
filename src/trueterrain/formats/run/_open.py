"""Open runs lazily, and read their scans block by block."""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr
from xarray.core import indexing

from trueterrain.core.errors import FormatError
from trueterrain.formats._zarr import (
    ARRAYS,
    StoredArray,
    damaged_error,
    find_groups,
    open_arrays,
    read_group_attrs,
    require_whole,
)
from trueterrain.formats.run.rules import check_layout, group_of

#: Scans in a block by default.
BLOCK = 2000


def open_run(path: str | Path) -> xr.DataTree:
    """Open a run lazily; values are read on access, chunk by chunk.

    Attributes, groups, variables, dimensions and units are checked, and that no chunk is missing.
    Values are not checked, see `check_run`. A damaged chunk is an error when it is read.

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
        If it is not a Zarr store, or is damaged; the message names the array that lacks chunks.
    SchemaError
        If it is not a run.
    """
    arrays = _open_store(Path(path))
    tree = check_layout(_make_tree(Path(path), arrays), path)
    require_whole(Path(path), arrays)
    return tree


def open_tree(path: str | Path) -> xr.DataTree:
    """Open a store as a tree; neither that it is a run nor that it is complete is checked."""
    return _make_tree(Path(path), _open_store(Path(path)))


def _open_store(path: Path) -> dict[str, StoredArray]:
    """Open the arrays of a store."""
    if not path.exists():
        message = f"there is no run {path}"
        raise FileNotFoundError(message)
    if not (path / "zarr.json").is_file():
        raise FormatError(
            "is not a Zarr 3 store: it holds no zarr.json",
            path=path,
            cure="Name the folder NAME.zarr of a run, or copy the whole folder again.",
        )
    return open_arrays(path)


def _make_tree(path: Path, arrays: dict[str, StoredArray]) -> xr.DataTree:
    groups = {"": xr.Dataset(attrs=read_group_attrs(path))}
    groups |= {name: xr.Dataset(attrs=read_group_attrs(path, name)) for name in find_groups(path)}
    variables: dict[str, dict[str, xr.Variable]] = {name: {} for name in groups}
    groups[""].attrs.pop(ARRAYS, None)
    for name, array in arrays.items():
        group, _, short = name.rpartition("/")
        lazy = indexing.LazilyIndexedArray(array)
        variables[group][short] = xr.Variable(array.dims, lazy, array.attrs)
    for name, attrs in groups.items():
        try:
            data = xr.Dataset(variables[name], attrs=attrs.attrs)
            groups[name] = xr.decode_cf(data, decode_times=False, decode_timedelta=False)
        except (ValueError, TypeError) as error:
            raise damaged_error(path, f"group {name}", error) from None
    return xr.DataTree.from_dict({name or "/": data for name, data in groups.items()})


def scan_blocks(run: xr.DataTree | str | Path, size: int = BLOCK) -> Iterator[xr.Dataset]:
    """Read the scans of a run block by block, in flat memory.

    Parameters
    ----------
    run : xarray.DataTree or path
        The run, or its store.
    size : int
        Largest number of scans in a block; a few thousand, in multiples of 1000, is fastest.

    Yields
    ------
    xarray.Dataset
        ``time`` (scan), ``range`` and, if recorded, ``intensity`` (scan, beam), ``angle`` and
        ``delay`` (beam), in memory; ``attrs["first_scan"]`` is the index of the first scan.

    Raises
    ------
    ValueError
        If `size` is less than 1.
    FormatError
        If a chunk is missing or damaged, naming array and chunk.
    """
    if size < 1:
        message = f"size must be at least 1 scan, got {size}."
        raise ValueError(message)
    tree = run if isinstance(run, xr.DataTree) else open_run(run)
    scans = group_of(tree, "scans")
    for start in range(0, scans.sizes["scan"], size):
        block = scans.isel(scan=slice(start, start + size)).load()
        yield block.assign_attrs(first_scan=start)
