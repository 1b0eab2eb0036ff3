"""From processed runs or files of points to a surface: gridding, holes, coarser grids."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain import formats
from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError, name_file_in_errors
from trueterrain.core.progress import Progress, no_progress
from trueterrain.core.row_blocks import load_rows
from trueterrain.formats import PointFilter, las
from trueterrain.formats.point_filter import ReturnCounts, classes_needed, flag_of_classes
from trueterrain.formats.store import SurfaceStore
from trueterrain.geometry.crs import parse_crs
from trueterrain.georeference import Screening
from trueterrain.surface.coarse import down_sample as keep_coarse_nodes
from trueterrain.surface.grid import grid_points, trim_surface
from trueterrain.surface.holes import (
    HoleSettings,
    count_holes,
    fill_holes,
    filled_blocks,
    without_filled,
)
from trueterrain.surface.placement import GridPlacement
from trueterrain.surface.runs import RunGridding
from trueterrain.surface.settings import GridSettings
from trueterrain.survey.runs import ProcessedRun

Bounds = tuple[float, float, float, float]


def build_surface(
    runs: Sequence[ProcessedRun],
    placement: GridPlacement = GridPlacement(),
    cells: GridSettings = GridSettings(range_noise=0.0005),
    *,
    holes: HoleSettings = HoleSettings(),
    down_sample: tuple[int, int] | None = None,
    screening: Screening = Screening(),
    store: Path | None = None,
    threads: int = 1,
    step: str = "build_surface",
    parameters: Mapping[str, Any] | None = None,
    progress: Progress = no_progress,
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Grid recorded runs to one surface with a standard deviation for each height.

    Parameters
    ----------
    runs : sequence of ProcessedRun
        Runs as by `process_run` or, where several passes see the same ground, `align_passes`.
    placement : GridPlacement
        Where the nodes lie; by default along the trajectory of the first run.
    cells : GridSettings
        Statistic of the heights in a cell. Errors of motion are common to passes that were
        aligned, and independent otherwise.
    holes : HoleSettings
        Which holes are filled.
    down_sample : tuple of int, optional
        Nodes that become one, along and across, for smooth terrain.
    screening : Screening
        Which returns are flagged, and whether they are kept.
    store : Path, optional
        Folder to make for the nodes of a surface along a line, which then stay on disk: memory does
        not grow with its length. The surface is the same, bit for bit.
    threads : int
        Threads that grid at once; the surface does not depend on it.
    step : str
        Name of the step in the provenance.
    parameters : mapping, optional
        Further parameters to record in the provenance.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    surface : xarray.Dataset
        ``height``, ``count``, ``sd``, ``filled``; ``sd_relative`` if passes were aligned.
    report : dict
        Counts of ``returns``, of ``holes``, and the loss by ``down_sample`` (None without).

    Raises
    ------
    CoverageError
        If the trajectory covers no scan of a run, or no return lies on the grid.
    SchemaError
        If the runs have different origins.
    """
    passes = [run.record for run in runs]
    aligned = len(runs) > 1 and all(run.aligned for run in runs)
    gridding = RunGridding(
        passes,
        placement.of_runs(passes),
        replace(cells, agreed=cells.agreed or aligned),
        screening=screening,
        threads=threads,
        progress=lambda run, done, total: progress(f"{run}: scans", done, total),
    )
    if store is None or gridding.grid.line is None:
        surface, returns = gridding.in_memory()
        surface, report = complete_surface(surface, holes, down_sample)
    else:
        surface, returns, filled = _grid_to_store(gridding, store, holes)
        loss = None
        if down_sample is not None:
            surface, loss = keep_coarse_nodes(surface, down_sample)
        report = {"holes": filled, "down_sample": loss}
    motions = [run.settings for run in runs]
    surface = provenance.add_step(
        surface,
        step,
        parameters={
            **(parameters or {}),
            "runs": [one.run.file_name for one in passes],
            "motion": motions[0] if all(one == motions[0] for one in motions) else motions,
            "mounting": [one.mounting for one in passes],
            "holes": holes,
            "down_sample": down_sample,
        },
    )
    return surface, {"returns": returns, **report}


def _grid_to_store(
    gridding: RunGridding, path: Path, holes: HoleSettings
) -> tuple[xr.Dataset, dict[str, Any], dict[str, Any]]:
    """Grid runs window by window to a store, and fill small holes there."""
    store = SurfaceStore(path, gridding.template(filled=np.False_))
    for window in gridding.windows():
        nodes = gridding.compute(window)
        values = {**gridding.variables(nodes), "filled": np.zeros(nodes.height.shape, np.bool_)}
        store.write(slice(window.start, window.stop), values)
    returns = gridding.report()
    whole = store.open()
    surface = trim_surface(whole)
    first = int(np.searchsorted(whole["u"], surface["u"][0]))
    report = count_holes(surface, holes)
    if report["filled_holes"]:
        for rows, height, filled in filled_blocks(surface, holes):
            if filled.any():
                there = slice(first + rows.start, first + rows.stop)
                values = {
                    name: without_filled(load_rows(surface, name, rows), filled)
                    for name in ("sd", "sd_relative")
                    if name in surface
                }
                store.write(there, {"height": height, "filled": filled, **values})
    return trim_surface(store.open()), returns, report


def grid_point_files(
    files: Sequence[str | Path],
    placement: GridPlacement = GridPlacement(),
    cells: GridSettings = GridSettings(range_noise=0.0005),
    *,
    holes: HoleSettings = HoleSettings(),
    down_sample: tuple[int, int] | None = None,
    crs: str | None = None,
    only: PointFilter | None = None,
    threads: int = 1,
    progress: Progress = no_progress,
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Grid files of points to one surface with a standard deviation for each height.

    Parameters
    ----------
    files : sequence of str or Path
        Points of one coordinate reference system, read block by block.
    placement : GridPlacement
        Where the nodes lie; by default over the map that the points cover.
    cells : GridSettings
        Statistic of the heights in a cell.
    holes : HoleSettings
        Which holes are filled.
    down_sample : tuple of int, optional
        Nodes that become one, along and across, for smooth terrain.
    crs : str, optional
        Coordinate reference system, if files name none or a wrong one.
    only : PointFilter, optional
        Which points are used; by default all.
    threads : int
        Threads that grid at once; the surface does not depend on it.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    surface : xarray.Dataset
        ``height``, ``count``, ``sd`` and ``filled``; ``sd_relative`` instead of ``sd`` if the
        points have no standard deviation.
    report : dict
        Counts of ``returns``, of ``holes``, the loss by ``down_sample`` (None without), and
        ``problems`` in words.

    Raises
    ------
    CoverageError
        If no point lies on the grid.
    SchemaError
        If the points have different coordinate reference systems.
    """
    if crs is not None:
        parse_crs(crs)
    paths = [Path(file) for file in files]
    blocks = _PointBlocks(paths, crs, only, progress)
    extents = [_point_extent(path, crs) for path in paths]
    surface = grid_points(blocks, placement.of_points(extents), cells, threads=threads)
    outside = int(surface.attrs.pop("outside"))
    flag = flag_of_classes(blocks.counts.classes)
    surface, report = complete_surface(surface, holes, down_sample)
    returns = {"used": blocks.points - outside, "outside": outside}
    return surface, {"returns": returns, **report, "problems": [flag] if flag else []}


def complete_surface(
    surface: xr.Dataset, holes: HoleSettings, down_sample: tuple[int, int] | None = None
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Trim a gridded surface, fill its small holes and, if asked for, make it coarser.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface as `trueterrain.surface.grid_runs` or `grid_points` returns it; its arrays are
        reused.
    holes : HoleSettings
        Which holes are filled.
    down_sample : tuple of int, optional
        Nodes that become one, along and across.

    Returns
    -------
    surface : xarray.Dataset
        The completed surface.
    report : dict
        ``holes`` as by `trueterrain.surface.fill_holes`, and ``down_sample``: loss of content, or
        None.
    """
    # in place: a surface of an hour takes gigabytes
    surface, filled = fill_holes(trim_surface(surface), holes, in_place=True)
    loss = None
    if down_sample is not None:
        surface, loss = keep_coarse_nodes(surface, down_sample)
    return surface, {"holes": filled, "down_sample": loss}


class _PointBlocks:
    """Blocks of points of files; can be iterated repeatedly."""

    def __init__(
        self, files: list[Path], crs: str | None, only: PointFilter | None, progress: Progress
    ) -> None:
        self._files = files
        self._crs = crs
        self._only = only
        self._variables = ("sd", *classes_needed(only))
        self._progress = progress
        self.points = 0
        self.counts = ReturnCounts()

    def __iter__(self) -> Iterator[xr.Dataset]:
        self.points, self.counts = 0, ReturnCounts()
        first: str | None = None
        for file in self._files:
            with name_file_in_errors(file):
                for block in formats.point_blocks(
                    file, crs=self._crs, variables=self._variables, only=self._only
                ):
                    found = str(block.attrs.get("crs", ""))
                    first = found if first is None else first
                    if found != first:
                        raise SchemaError(
                            f"all points must have the same CRS, got {found[:40]!r} after "
                            f"{first[:40]!r} of {self._files[0].name}",
                            cure="Transform them first, or name the CRS of all: --crs.",
                        )
                    yield block
                    self.points += block.sizes["point"]
                    self.counts.add(block)
                    self._progress(f"{self.points:,} points", 0, None)


def _point_extent(file: Path, crs: str | None) -> Bounds:
    """Bounds of the points in a file [m], from its header if that states them."""
    module = formats.recognise_format(file).module
    if module == "las":
        _, (low, high) = las.header_of(file, crs)
        if np.isfinite([*low, *high]).all() and (low[:2] <= high[:2]).all():
            return float(low[0]), float(low[1]), float(high[0]), float(high[1])
    if module == "store":
        extent = formats.info(file)["extent"]
        if "easting" in extent and "northing" in extent:
            (west, east), (south, north) = extent["easting"], extent["northing"]
            return west, south, east, north
    edges = [np.inf, np.inf, -np.inf, -np.inf]
    for block in formats.point_blocks(file, crs=crs, variables=()):
        for axis, name in enumerate(("easting", "northing")):
            edges[axis] = min(edges[axis], float(block[name].min()))
            edges[axis + 2] = max(edges[axis + 2], float(block[name].max()))
    return edges[0], edges[1], edges[2], edges[3]
