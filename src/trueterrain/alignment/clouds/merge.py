"""Alignment of point clouds: compare their cells, correct their points.

A pass is a file, or the points of one number (point_source_id) in one file or several. Only cells
are kept in memory: points are read, corrected and written block by block.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from trueterrain.alignment.clouds.corrected import (
    CorrectedClouds,
    CorrectedPass,
    merged_surface,
    with_time,
)
from trueterrain.alignment.clouds.inspection import HEIGHTS, WEEK
from trueterrain.alignment.clouds.passes import (
    CloudPass,
    blocks_of,
    find_cloud_passes,
    suggested_cell,
)
from trueterrain.alignment.clouds.trajectory import (
    path_of_stations,
    path_of_times,
    station_path,
    unknown_path,
)
from trueterrain.alignment.discontinuity.alignment import align_along_paths
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.merge import MergeResult, MergeSettings, merge_cells
from trueterrain.alignment.observations.cells import PassCells, PassPath, move_to_centres
from trueterrain.alignment.observations.collection import VisitSums
from trueterrain.alignment.run_passes import control_cells, reference_path
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats.point_filter import flag_of_classes

__all__ = [
    "CloudPass",
    "CorrectedClouds",
    "CorrectedPass",
    "cells_of_clouds",
    "find_cloud_passes",
    "flag_classes",
    "merge_clouds",
    "merged_surface",
    "suggested_cell",
    "with_cells",
]

_CLUSTER, _BLOCK = 3.0, 5.0  # cells, sides of squares of correlated errors and of held-out ground
_WORSE = 1.2  # ratio of the NMAD after to that before above which a pair is flagged
_MIN_CELLS = 20  # cells of a pass; with fewer its drift is unobservable


def merge_clouds(
    passes: Mapping[str, CloudPass],
    settings: MergeSettings = MergeSettings(),
    *,
    path: ReferencePath | None = None,
    progress: Progress = no_progress,
) -> tuple[MergeResult, CorrectedClouds]:
    """Align point clouds, by correcting their points.

    Parameters
    ----------
    passes : mapping of str to CloudPass
        From `find_cloud_passes`.
    settings : MergeSettings
        Method and its settings; `suggested_cell` gives a size of the cells for the points.
    path : ReferencePath, optional
        Path whose stations replace missing times, and along which the method discontinuity
        compares; by default that of the settings.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    merging : MergeResult
        Corrections, agreement before and after, and warnings about passes.
    corrected : CorrectedClouds
        Passes by name; calling one yields blocks of corrected points.

    Raises
    ------
    CoverageError
        If no cell is common to two passes, fewer than two passes have enough cells or plausible
        times, an overlap is too narrow for the method, or two passes hold the same points.
    SchemaError
        If coordinates are not finite.
    TrueTerrainError
        If the adjustment does not converge.

    Notes
    -----
    With the method network, corrections are functions of the time of the points. If a pass has no
    times, those of all passes are functions of station: along the given path, else along the centre
    line of each pass. Settings in seconds are then in metres.

    Examples
    --------
    Two passes over level ground, 8 mm apart:

    >>> import tempfile
    >>> from pathlib import Path
    >>> from trueterrain import formats
    >>> from trueterrain.core.schemas import make_points
    >>> rng = np.random.default_rng(1)
    >>> x, y = np.sort(rng.uniform(0, 30, 9000)), rng.uniform(0, 1, 9000)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = [Path(folder) / "south.laz", Path(folder) / "north.laz"]
    ...     for file, up in zip(files, (0.004, -0.004)):
    ...         z = up + rng.normal(0, 1e-3, x.size)
    ...         formats.write(make_points(x, y, z, time=4e8 + x / 10), file)
    ...     passes = find_cloud_passes(files)
    ...     settings = with_cells(MergeSettings(), suggested_cell(passes))
    ...     merging, corrected = merge_clouds(passes, settings)
    ...     up = np.concatenate([block.up for block in corrected["south"]()])
    >>> f"{1e3 * merging.pairs[0].before.median:.1f} mm, {1e3 * up.mean():.1f} mm"
    '8.0 mm, 0.0 mm'
    """
    passes = {name: passes[name] for name in sorted(passes)}
    path = path or reference_path(settings)
    untimed = [name for name, cloud in passes.items() if cloud.time is None]
    flags = [flag for cloud in passes.values() for flag in cloud.flags]
    station_paths: dict[str, ReferencePath | None] = dict.fromkeys(passes)
    timed = settings.method == "network"
    if timed and untimed:
        station_paths = {
            name: path or station_path(cloud, settings.cells) for name, cloud in passes.items()
        }
    elif timed:
        passes, too_long = _with_plausible_times(passes)
        flags += too_long
    cells, left_out = _cloud_cells(passes, station_paths, settings, progress, timed=timed)
    kept = {one.name: passes[one.name] for one in cells}
    paths: dict[str, PassPath | None] = dict.fromkeys(kept)
    if timed:
        for number, one in enumerate(cells):
            reference = station_paths[one.name]
            where = path_of_times(one) if reference is None else path_of_stations(reference)
            paths[one.name] = where
            cells[number] = move_to_centres(one, where, settings.cells.size)
    if len(kept) < 2 and settings.method == "discontinuity":
        raise CoverageError(
            f"there is one pass only, {next(iter(kept))}",
            cure="Name at least two passes that overlap.",
        )
    control = [] if settings.control is None else [control_cells(settings.control, settings)]
    merging = merge_cells(
        cells,
        settings,
        control=control,
        progress=progress,
        align=lambda: align_along_paths(
            {name: cloud.heights for name, cloud in kept.items()},
            settings.discontinuity,
            paths=path,
            fix=next(iter(settings.fixed), None),
            progress=progress,
        ),
    )
    flags += [
        *flag_classes(passes),
        *left_out,
        *_time_warnings(kept, untimed if timed else [], path),
        *_agreement_warnings(merging),
    ]
    merging = replace(merging, problems=(*flags, *merging.problems))
    return merging, CorrectedClouds(
        {
            name: CorrectedPass(
                cloud=cloud,
                merging=merging,
                station=station_paths[name],
                path=paths[name],
            )
            for name, cloud in kept.items()
        }
    )


def cells_of_clouds(
    passes: Mapping[str, CloudPass],
    settings: MergeSettings = MergeSettings(),
    *,
    cell: float | None = None,
    progress: Progress = no_progress,
) -> tuple[list[PassCells], float, list[str]]:
    """Cells of the passes of point clouds, to compare them without alignment.

    Parameters
    ----------
    passes : mapping of str to CloudPass
        From `find_cloud_passes`.
    settings : MergeSettings
        Which cells are accepted.
    cell : float, optional
        Size of the cells [m]; by default `suggested_cell`.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    cells : list of PassCells
        Cells of all passes that have enough of them, without times.
    size : float
        Size of the cells [m].
    problems : list of str
        Warnings.

    Raises
    ------
    CoverageError
        If fewer than two passes have enough cells.
    FormatError
        If a file is damaged.
    """
    settings = with_cells(settings, cell or suggested_cell(passes))
    station_paths = dict.fromkeys(passes)
    cells, left_out = _cloud_cells(passes, station_paths, settings, progress, timed=False)
    flags = [flag for cloud in passes.values() for flag in cloud.flags]
    return cells, settings.cells.size, [*flags, *left_out]


def flag_classes(passes: Mapping[str, CloudPass]) -> list[str]:
    """Warning about points of all passes that are not ground.

    Parameters
    ----------
    passes : mapping of str to CloudPass
        From `find_cloud_passes`.

    Returns
    -------
    list of str
        One message, or none.
    """
    total: dict[str, int] = {}
    for cloud in passes.values():
        for name, number in cloud.classes.items():
            total[name] = total.get(name, 0) + number
    flag = flag_of_classes(total)
    return [flag] if flag else []


def with_cells(settings: MergeSettings, size: float) -> MergeSettings:
    """Scale settings to another size of the cells.

    Parameters
    ----------
    settings : MergeSettings
        Settings for some size of the cells.
    size : float
        Size of the cells [m].

    Returns
    -------
    MergeSettings
        With this size; the squares of held-out ground and of correlated errors, and the search
        areas, spacing and cut-off of the method discontinuity are scaled with it.

    Examples
    --------
    >>> coarse = with_cells(MergeSettings(), 1.0)
    >>> coarse.discontinuity.radius, coarse.discontinuity.cut_off, coarse.network.cluster
    (2.0, 25.0, 3.0)
    """
    scale = size / settings.cells.size
    found = settings.discontinuity
    return replace(
        settings,
        cells=replace(settings.cells, size=size),
        network=replace(
            settings.network,
            cluster=max(settings.network.cluster, _CLUSTER * size),
            block=max(settings.network.block, _BLOCK * size),
        ),
        discontinuity=replace(
            found,
            spacing=found.spacing * scale,
            radius=found.radius * scale,
            cut_off=found.cut_off * scale,
            smoothing=found.smoothing * scale,
            cell=found.cell * scale,
        ),
    )


def _cloud_cells(
    passes: Mapping[str, CloudPass],
    station_paths: Mapping[str, ReferencePath | None],
    settings: MergeSettings,
    progress: Progress,
    *,
    timed: bool,
) -> tuple[list[PassCells], list[str]]:
    """Cells of the passes that have enough of them, and warnings about the others."""
    sums = {name: VisitSums(settings.cells) for name in passes}
    total, done = sum(cloud.count for cloud in passes.values()), 0
    for cloud, block in blocks_of(list(passes.values()), HEIGHTS):
        progress("cells of lanes", done, total)
        with name_file_in_errors(cloud.files[0]):
            columns = {name: block[name].values for name in ("easting", "northing", "up")}
            time = np.zeros(block.sizes["point"])
            if timed:
                time = with_time(block, station_paths[cloud.name])["time"].values
            sums[cloud.name].add(**columns, time=time)
        done += block.sizes["point"]
    progress("cells of lanes", total, total)
    found: list[PassCells] = []
    left_out: list[str] = []
    for name, one in sums.items():
        try:
            cells = one.cells(name, unknown_path)
        except CoverageError as error:
            left_out.append(f"{name} is left out: it {error.problem.removeprefix(name).strip()}")
            continue
        if len(cells) < _MIN_CELLS:
            left_out.append(
                f"{name} is left out: {len(cells)} cells with {passes[name].count} points in all "
                "are too few for a pass"
            )
            continue
        found.append(cells)
    if len(found) < min(2, len(passes)):
        raise CoverageError(
            f"fewer than two passes have {_MIN_CELLS} cells of {settings.cells.size:g} m: "
            + "; ".join(left_out),
            cure=f"Choose other cells (the points suggest {suggested_cell(passes):g} m), fewer "
            "points in each, or allow more scatter.",
        )
    return found, left_out


def _with_plausible_times(
    passes: Mapping[str, CloudPass],
) -> tuple[dict[str, CloudPass], list[str]]:
    """Passes whose times can be those of one pass, and warnings about the others."""
    kept: dict[str, CloudPass] = {}
    left_out: list[str] = []
    for name, cloud in passes.items():
        if cloud.time is None or cloud.time[1] - cloud.time[0] <= WEEK:
            kept[name] = cloud
            continue
        left_out.append(
            f"{name} is left out: its times run from {cloud.time[0]:.9g} s "
            f"to {cloud.time[1]:.9g} s, longer than a week, so it is no single pass"
        )
    if len(kept) < min(2, len(passes)):
        raise CoverageError(
            f"fewer than two passes have the times of one pass: {'; '.join(left_out)}",
            cure="Bring all times into one kind and give each flight a number of its own, or take "
            "the method discontinuity, which uses stations.",
        )
    return kept, left_out


def _time_warnings(
    passes: Mapping[str, CloudPass], untimed: list[str], path: ReferencePath | None
) -> list[str]:
    """Warnings about times."""
    problems = []
    if untimed:
        where = "the path given" if path is not None else "the centre line of each pass"
        problems.append(
            f"{', '.join(untimed)} without gps_time: corrections follow the station along {where}, "
            "so the drift must be the same whenever a pass returns to a station"
        )
    week = [name for name, cloud in passes.items() if cloud.time_kind == "week seconds"]
    standard = [name for name, cloud in passes.items() if cloud.time_kind == "standard"]
    if week and standard:
        problems.append(
            f"times of {', '.join(week)} are seconds of a week, those of {', '.join(standard)} are "
            "not: each pass is corrected by its own times, but do not write them to one file"
        )
    return problems


def _agreement_warnings(merging: MergeResult) -> list[str]:
    """Warnings about pairs that agree exactly, or worse than before."""
    problems = []
    for pair in merging.pairs:
        names = f"{pair.first} and {pair.second}"
        if pair.before.nmad == 0:
            problems.append(
                f"{names} do not differ at all in most of {pair.before.n} cells: the same points "
                "given twice?"
            )
        elif pair.after.nmad > _WORSE * pair.before.nmad:
            problems.append(
                f"{names} differ by {1e3 * pair.after.nmad:.1f} mm (NMAD) after the correction, by "
                f"{1e3 * pair.before.nmad:.1f} mm before: the method does not suit this ground"
            )
    return problems
