"""Write a run that is in memory, or a lazy run that was changed."""

from collections.abc import Iterator
from pathlib import Path

import xarray as xr

from trueterrain.core import Progress, no_progress
from trueterrain.core.schemas.run import QUANTUM, ROW_CHUNK, Mounting
from trueterrain.formats.run._open import BLOCK, scan_blocks
from trueterrain.formats.run._write import RunWriter
from trueterrain.formats.run.rules import check_run, group_of

_ALONG_TIME = ("scan", "epoch", "sample")


def write(
    tree: xr.DataTree,
    path: str | Path,
    *,
    force: bool = False,
    progress: Progress = no_progress,
) -> None:
    """Write a run that is in memory, or a lazy one that was changed.

    Parameters
    ----------
    tree : xarray.DataTree
        The run; it is checked, and copied block by block.
    path : str or Path
        Path of the store to write: a folder ``NAME.zarr``.
    force : bool
        Replace an existing run.
    progress : callable
        Called with ``"scans"``, the number of scans written so far, and the total.

    Raises
    ------
    SchemaError
        If it is not a run, see `check_run`.
    OutputError
        If the store exists and `force` is false.
    """
    check_run(tree)
    scans = group_of(tree, "scans")
    sensors = group_of(tree, "accelerometers") if "accelerometers" in tree.children else None
    # without the encoding of a file, ranges may be of any size: four bytes
    stored = scans["range"].encoding.get("_FillValue", 2**32 - 1)
    nodes = tree.children["truth"].children if "truth" in tree.children else {}
    truth = {name: node.to_dataset(inherit=False) for name, node in nodes.items()}
    growing = {name: group for name, group in truth.items() if _time_of(group)}
    with RunWriter(
        path,
        name=tree.attrs["name"],
        origin=tree.attrs["origin"],
        time_reference=tree.attrs["time_reference"],
        mounting=Mounting.from_attrs(tree.attrs["mounting"]),
        angle=scans["angle"].values,
        delay=scans["delay"].values,
        accelerometer_positions=None if sensors is None else sensors["position"].values,
        truth={name: group for name, group in truth.items() if name not in growing},
        max_range=float(stored - 1) * QUANTUM,
        history=tree.attrs.get("provenance", "[]"),
        force=force,
    ) as run:
        for block in scan_blocks(tree):
            intensity = block["intensity"].values if "intensity" in block else None
            run.append_scans(block["time"].values, block["range"].values, intensity)
            progress("scans", block.attrs["first_scan"] + block.sizes["scan"], scans.sizes["scan"])
        for part in _split_blocks(group_of(tree, "navigation"), "epoch", ROW_CHUNK):
            run.append_navigation(part)
        if sensors is not None:
            for part in _split_blocks(sensors, "sample", ROW_CHUNK):
                run.append_accelerometers(part["time"].values, part["acceleration"].values)
        for name, group in growing.items():
            dim = _time_of(group)
            for part in _split_blocks(group, dim, BLOCK):
                run.append_truth(name, part, dim=dim)


def _time_of(group: xr.Dataset) -> str:
    """Dimension along time; empty if there is none."""
    return next((dim for dim in _ALONG_TIME if dim in group.sizes), "")


def _split_blocks(data: xr.Dataset, dim: str, size: int) -> Iterator[xr.Dataset]:
    for start in range(0, data.sizes[dim], size):
        yield data.isel({dim: slice(start, start + size)})
