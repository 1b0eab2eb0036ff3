"""Open runs lazily, and read their scans block by block."""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from trueterrain.formats.run._handle import Run, make_run, open_unchecked
from trueterrain.formats.run.rules import check_layout, group_of

#: Scans in a block by default.
BLOCK = 2000


def open_run(run: str | Path | xr.DataTree) -> Run:
    """Open a run lazily; values are read on access, chunk by chunk.

    Attributes, groups, variables, dimensions and units are checked, and that no chunk is missing.
    Values are not checked, see `check_run`. A damaged chunk is an error when it is read.

    Parameters
    ----------
    run : str, Path or xarray.DataTree
        Folder ``NAME.zarr``. A run that is open already is returned as it is, so that each stage
        takes either; a tree in memory becomes a run without a store, unchecked.

    Returns
    -------
    Run
        An `xarray.DataTree` with the groups ``scans``, ``navigation`` and, where recorded,
        ``accelerometers`` and ``truth``. Ranges are float64 [m], NaN where there was no return.

    Raises
    ------
    FormatError
        If it is not a Zarr store, or is damaged; the message names the array that lacks chunks.
    SchemaError
        If it is not a run.
    """
    if isinstance(run, xr.DataTree):
        return run if isinstance(run, Run) else make_run(run)
    opened = open_unchecked(run)
    check_layout(opened, run)
    opened.require_chunks()
    return opened


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
    scans = group_of(open_run(run), "scans")
    for start in range(0, scans.sizes["scan"], size):
        block = scans.isel(scan=slice(start, start + size)).load()
        yield block.assign_attrs(first_scan=start)
