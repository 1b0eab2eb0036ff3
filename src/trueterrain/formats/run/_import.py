"""Convert flat files, described by a small TOML, to a run."""

import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from trueterrain.core import Progress, no_progress, provenance
from trueterrain.core.errors import FormatError
from trueterrain.formats.navigation import columns as tables
from trueterrain.formats.navigation import sbet, smrmsg
from trueterrain.formats.number_table import table_blocks
from trueterrain.formats.run._files import (
    AccelerometerTable,
    NavigationFiles,
    RunFiles,
    ScanTable,
)
from trueterrain.formats.run._scans import ScanBlock, scan_table_blocks
from trueterrain.formats.run._write import RunWriter
from trueterrain.formats.settings import read_settings

__all__ = ["AccelerometerTable", "NavigationFiles", "RunFiles", "ScanTable", "import_run"]


def import_run(
    description: str | Path,
    output: str | Path,
    *,
    force: bool = False,
    progress: Progress = no_progress,
) -> None:
    r"""Convert flat files to a run, block by block in flat memory.

    Parameters
    ----------
    description : str or Path
        TOML that describes the files, see `RunFiles`;
        ``trueterrain.formats.settings.settings_template(RunFiles)`` is a template. Paths of
        files are relative to it.
    output : str or Path
        Path of the store to write: a folder ``NAME.zarr``.
    force : bool
        Replace an existing run.
    progress : callable
        Called with the numbers of epochs, scans and samples written so far; the total is None.

    Raises
    ------
    FormatError
        If the description or a file is wrong: file, line or row, column, rule and value.
    SchemaError
        If the data break a rule of runs, see `check_run`.
    CoverageError
        If the accuracies do not cover the navigation.
    OutputError
        If the store exists and `force` is false.

    Examples
    --------
    >>> import tempfile
    >>> from trueterrain.formats.run import scan_blocks
    >>> with tempfile.TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     _ = (folder / "run.toml").write_text(
    ...         "name = 'still'\norigin = [11.0, 48.0, 500.0]\n"
    ...         "[navigation]\nfile = 'nav.csv'\nformat = 'table'\n"
    ...         "[scans]\nfile = 'scans.csv'\nlayout = 'scans'\nangles = [-0.1, 0.1]\n"
    ...     )
    ...     _ = (folder / "nav.csv").write_text(
    ...         "time,east,north,up,roll,pitch,yaw\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n"
    ...     )
    ...     _ = (folder / "scans.csv").write_text("time,range0,range1\n0.1,2.01,\n0.2,2.02,1.99\n")
    ...     import_run(folder / "run.toml", folder / "still.zarr")
    ...     next(scan_blocks(folder / "still.zarr")).range.values
    array([[2.01,  nan],
           [2.02, 1.99]])
    """
    description = Path(description)
    files = _with_folder(read_settings(RunFiles, description), description.parent)
    epochs = _navigation_blocks(files, description)
    first = next(epochs)
    origin = files.origin or first.attrs["origin"]
    angle, delay = files.scans.fan()
    sensors = files.accelerometers
    with RunWriter(
        output,
        name=files.name,
        origin=origin,
        time_reference=files.time_reference,
        mounting=files.mounting,
        angle=angle,
        delay=delay,
        accelerometer_positions=None if sensors is None else sensors.positions,
        max_range=files.scans.max_range,
        history=_import_provenance(files, description),
        force=force,
    ) as run:
        start, count = float(first["time"][0]), 0
        end = start
        for block in _chain_blocks(first, epochs):
            run.append_navigation(block)
            end, count = float(block["time"][-1]), count + block.sizes["epoch"]
            progress("navigation", count, None)
        _import_scans(run, files, (start, end), progress)
        if sensors is not None:
            _import_accelerometers(run, sensors, progress)


def _navigation_blocks(files: RunFiles, description: Path) -> Iterator[xr.Dataset]:
    source = files.navigation
    if source.format == "sbet":
        blocks = sbet.blocks(source.file, origin=files.origin)
    else:
        chosen = source.columns or tables.OURS
        if files.origin is None and not chosen.is_geodetic:
            raise FormatError(
                "origin: is missing, and positions in east, north, up do not define it",
                path=description,
                cure="Give origin = [longitude, latitude, height].",
            )
        blocks = tables.blocks(source.file, chosen, origin=files.origin)
    accuracy = None if source.accuracy is None else smrmsg.read(source.accuracy)
    for block in blocks:
        if accuracy is None:
            yield block
        else:
            yield smrmsg.add_accuracy(block, accuracy, path=source.accuracy)


def _chain_blocks(first: xr.Dataset, others: Iterator[xr.Dataset]) -> Iterator[xr.Dataset]:
    yield first
    yield from others


def _import_scans(
    run: RunWriter, files: RunFiles, span: tuple[float, float], progress: Progress
) -> None:
    table = files.scans
    _, delay = table.fan()
    written, dropped = 0, 0
    for block in scan_table_blocks(table.file, table):
        inside = np.ones(block.time.size, dtype=bool)
        if table.outside == "drop":
            true = block.time + files.mounting.scanner_clock
            inside = (true + delay.min() >= span[0]) & (true + delay.max() <= span[1])
            dropped += int(np.count_nonzero(~inside))
        kept = block if inside.all() else _select_scans(block, inside)
        if kept.time.size:
            run.append_scans(kept.time, kept.range, kept.intensity)
        written += kept.time.size
        progress("scans", written, None)
    if dropped:
        message = f"{table.file}: {dropped} scans outside of the navigation are omitted"
        warnings.warn(message, stacklevel=3)


def _select_scans(
    block: ScanBlock, inside: np.ndarray[tuple[int], np.dtype[np.bool_]]
) -> ScanBlock:
    intensity = None if block.intensity is None else block.intensity[inside]
    return ScanBlock(time=block.time[inside], range=block.range[inside], intensity=intensity)


def _import_accelerometers(run: RunWriter, sensors: AccelerometerTable, progress: Progress) -> None:
    count = 0
    for block in table_blocks(sensors.file, [sensors.time, *sensors.columns]):
        values = np.stack([block[name] for name in sensors.columns], axis=-1)
        run.append_accelerometers(block[sensors.time] * sensors.time_scale, values * sensors.scale)
        count += len(values)
        progress("accelerometers", count, None)


def _with_folder(files: RunFiles, folder: Path) -> RunFiles:
    """Files with paths relative to the working folder, not to that of the description."""
    navigation = files.navigation
    accuracy = None if navigation.accuracy is None else folder / navigation.accuracy
    sensors = files.accelerometers
    files = replace(
        files,
        navigation=replace(navigation, file=folder / navigation.file, accuracy=accuracy),
        scans=replace(files.scans, file=folder / files.scans.file),
        accelerometers=sensors and replace(sensors, file=folder / sensors.file),
    )
    for path in _source_paths(files):
        if not path.is_file():
            raise FormatError("does not exist", path=path, cure="Correct the description.")
    return files


def _source_paths(files: RunFiles) -> list[Path]:
    sensors = files.accelerometers
    named = [
        files.navigation.file,
        files.navigation.accuracy,
        files.scans.file,
        None if sensors is None else sensors.file,
    ]
    return [path for path in named if path is not None]


def _import_provenance(files: RunFiles, description: Path) -> str:
    data = provenance.add_step(
        xr.Dataset(),
        "import",
        parameters={"mounting": files.mounting, "name": files.name},
        inputs=[description, *_source_paths(files)],
    )
    return str(data.attrs["provenance"])
