"""Point clouds brought into agreement: their cells are compared, their points are moved.

A lane is a file, or the points of one number (point_source_id) in one file or in many. Nothing but
cells is kept of it: points stream by, and come out corrected block by block.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
import xarray as xr

from trueterrain.alignment.clouds.corrected import CorrectedClouds, CorrectedPass, with_time
from trueterrain.alignment.clouds.passes import (
    HEIGHTS,
    WEEK,
    CloudPass,
    blocks_of,
    cloud_lanes,
    suggested_cell,
)
from trueterrain.alignment.clouds.stations import station_path
from trueterrain.alignment.clouds.trajectory import path_of_stations, path_of_times, unknown_path
from trueterrain.alignment.discontinuity.alignment import align_lanes
from trueterrain.alignment.discontinuity.reference_path import ReferencePath
from trueterrain.alignment.merge import MergeResult, MergeSettings, merge_cells
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.observations.centring import Path, at_their_middle
from trueterrain.alignment.observations.visit_sums import VisitSums
from trueterrain.alignment.run_passes import control_cells, reference_path
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats.point_filter import flag_of_classes
from trueterrain.surface.cells import Grid
from trueterrain.surface.grid import GridSettings, grid_points

__all__ = [
    "CloudPass",
    "CorrectedClouds",
    "CorrectedPass",
    "cells_of_clouds",
    "cloud_lanes",
    "flag_of_lanes",
    "merge_clouds",
    "merged_surface",
    "suggested_cell",
    "with_cells",
]

_CLUSTER, _BLOCK = 3.0, 5.0  # cells, sides of squares of ground whose errors are alike or held back
_WORSE = 1.2  # times the scatter before, from which on a correction does harm
_LEAST_CELLS = 20  # cells, with fewer a lane is a remnant that tells nothing about its drift


def merge_clouds(
    lanes: Mapping[str, CloudPass],
    settings: MergeSettings = MergeSettings(),
    *,
    path: ReferencePath | None = None,
    progress: Progress = no_progress,
) -> tuple[MergeResult, CorrectedClouds]:
    """Bring point clouds into agreement.

    Parameters
    ----------
    lanes : mapping of str to CloudLane
        From `cloud_lanes`.
    settings : MergeSettings
        How; `suggested_cell` tells a size of the cells that suits the points.
    path : ReferencePath, optional
        Path whose stations stand for time where there is none, and along which the method
        discontinuity compares; by default the one that the settings name.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    merging : Merging
        Corrections, and agreement before and after; its problems say which lanes were left out,
        and what else is flagged.
    corrected : CorrectedClouds
        Lanes by name, each a function that yields blocks of corrected points.

    Raises
    ------
    CoverageError
        If no cell is seen by two lanes, fewer than two lanes have enough cells, or times of one
        pass, an overlap is too thin for the method, or two lanes hold the same points.
    SchemaError
        If coordinates are not finite.
    TrueTerrainError
        If the adjustment does not converge.

    Notes
    -----
    By the method network corrections follow the time of the points. If one lane has none, those of
    all lanes follow their station instead: along the path given, else along the middle of each
    lane. Numbers of the settings in seconds are taken in metres then.

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
    ...     lanes = cloud_lanes(files)
    ...     settings = with_cells(MergeSettings(), suggested_cell(lanes))
    ...     merging, corrected = merge_clouds(lanes, settings)
    ...     up = np.concatenate([block.up for block in corrected["south"]()])
    >>> f"{1e3 * merging.pairs[0].before.median:.1f} mm, {1e3 * up.mean():.1f} mm"
    '8.0 mm, 0.0 mm'
    """
    lanes = {name: lanes[name] for name in sorted(lanes)}
    path = path or reference_path(settings)
    untimed = [name for name, lane in lanes.items() if lane.time is None]
    flags = [flag for lane in lanes.values() for flag in lane.flags]
    ways: dict[str, ReferencePath | None] = dict.fromkeys(lanes)
    timed = settings.method == "network"
    if timed and untimed:
        ways = {name: path or station_path(lane, settings.cells) for name, lane in lanes.items()}
    elif timed:
        lanes, too_long = _of_one_flight(lanes)
        flags += too_long
    cells, left_out = _cloud_cells(lanes, ways, settings, progress, timed=timed)
    kept = {one.name: lanes[one.name] for one in cells}
    paths: dict[str, Path | None] = dict.fromkeys(kept)
    if timed:
        for number, one in enumerate(cells):
            way = ways[one.name]
            where = path_of_times(one) if way is None else path_of_stations(way)
            paths[one.name] = where
            cells[number] = at_their_middle(one, where, settings.cells.size)
    if len(kept) < 2 and settings.method == "discontinuity":
        raise CoverageError(
            f"there is one lane, {next(iter(kept))}, and it has nothing to agree with",
            cure="Name at least two passes that overlap.",
        )
    control = [] if settings.control is None else [control_cells(settings.control, settings)]
    merging = merge_cells(
        cells,
        settings,
        control=control,
        progress=progress,
        align=lambda: align_lanes(
            {name: lane.heights for name, lane in kept.items()},
            settings.discontinuity,
            paths=path,
            fix=next(iter(settings.fixed), None),
            progress=progress,
        ),
    )
    flags += [
        *flag_of_lanes(lanes),
        *left_out,
        *_of_time(kept, untimed if timed else [], path),
        *_flags_of(merging),
    ]
    merging = replace(merging, problems=(*flags, *merging.problems))
    return merging, CorrectedClouds(
        {
            name: CorrectedPass(
                lane=lane,
                merging=merging,
                station=ways[name],
                path=paths[name],
            )
            for name, lane in kept.items()
        }
    )


def cells_of_clouds(
    lanes: Mapping[str, CloudPass],
    settings: MergeSettings = MergeSettings(),
    *,
    cell: float | None = None,
    progress: Progress = no_progress,
) -> tuple[list[PassCells], float, list[str]]:
    """Cells that each lane of point clouds saw, to compare them as they are.

    Parameters
    ----------
    lanes : mapping of str to CloudLane
        From `cloud_lanes`.
    settings : MergeSettings
        Which cells are used.
    cell : float, optional
        Size of the cells [m]; by default what suits the points.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    cells : list of LaneCells
        Of all lanes with enough of them, without times.
    size : float
        Size of the cells [m].
    problems : list of str
        Lanes that were left out, and what else is flagged, in words.

    Raises
    ------
    CoverageError
        If fewer than two lanes have enough cells.
    FormatError
        If a file is damaged.
    """
    settings = with_cells(settings, cell or suggested_cell(lanes))
    ways = dict.fromkeys(lanes)
    cells, left_out = _cloud_cells(lanes, ways, settings, progress, timed=False)
    flags = [flag for lane in lanes.values() for flag in lane.flags]
    return cells, settings.cells.size, [*flags, *left_out]


def flag_of_lanes(lanes: Mapping[str, CloudPass]) -> list[str]:
    """What is no ground among the points of all lanes, in words.

    Parameters
    ----------
    lanes : mapping of str to CloudLane
        From `cloud_lanes`.

    Returns
    -------
    list of str
        One line, or none.
    """
    total: dict[str, int] = {}
    for lane in lanes.values():
        for name, number in lane.classes.items():
            total[name] = total.get(name, 0) + number
    flag = flag_of_classes(total)
    return [flag] if flag else []


def with_cells(settings: MergeSettings, size: float) -> MergeSettings:
    """Settings for cells of another size.

    Parameters
    ----------
    settings : MergeSettings
        For cells of any size.
    size : float
        Size of the cells [m].

    Returns
    -------
    MergeSettings
        With this size, and what goes along with it: squares of ground that are held back together,
        or within which errors are alike, and search areas, spacing and cut-off of the method
        discontinuity as many cells wide as they were.

    Examples
    --------
    >>> coarse = with_cells(MergeSettings(), 1.0)
    >>> coarse.discontinuity.radius, coarse.discontinuity.cut_off, coarse.network.cluster
    (2.0, 25.0, 3.0)
    """
    more = size / settings.cells.size
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
            spacing=found.spacing * more,
            radius=found.radius * more,
            cut_off=found.cut_off * more,
            smoothing=found.smoothing * more,
            cell=found.cell * more,
        ),
    )


def merged_surface(
    corrected: CorrectedClouds,
    grid: Grid,
    options: GridSettings = GridSettings(),
    *,
    threads: int = 1,
) -> xr.Dataset:
    """Surface of all lanes together.

    Parameters
    ----------
    corrected : CorrectedClouds
        Lanes in agreement.
    grid : Grid
        The cells.
    options : GridOptions
        What is taken of the points in each; medians and percentiles read the files several times.
    threads : int
        Threads that work at once; the surface does not depend on it.

    Returns
    -------
    xarray.Dataset
        Surface with ``height``, ``count`` and ``sd_relative``, and ``sd`` where it is known.

    Raises
    ------
    CoverageError
        If there are no points on the grid.

    Notes
    -----
    The variance of a height is the scatter of the points by their count, and what the adjustment
    leaves: the mean of the variances of the corrections of the points in the cell. So these are
    taken as one error that all lanes in the cell share. Those of different lanes are less alike
    than that, and the standard deviation of their mean is not greater: where several lanes lie over
    each other, ``sd_relative`` is on the safe side. It is relative to the datum of the adjustment.
    How sure that is, is known where points bring an ``sd`` of their own, which is not made less by
    the number of lanes, where control points fix it, or where the settings say so: only there is
    ``sd``. The methods discontinuity and grid know no standard deviations, and add none.
    """

    class Again(Iterable[xr.Dataset]):
        """Blocks that can be gone through several times."""

        def __init__(self, left_out: str) -> None:
            self._left_out = left_out

        def __iter__(self) -> Iterator[xr.Dataset]:
            for block in corrected.blocks((*HEIGHTS, "sd", "sd_relative")):
                yield block.drop_vars(self._left_out, errors="ignore")

    both = {"sd", "sd_relative"} <= set(corrected.deviations)
    surface = grid_points(Again("sd_relative" if both else ""), grid, options, threads=threads)
    if both:
        relative = grid_points(Again("sd"), grid, options, threads=threads)
        surface = surface.assign(sd_relative=relative["sd_relative"])
    files = sorted({file for one in corrected.values() for file in one.lane.files})
    merging = next(iter(corrected.values())).merging
    return provenance.add_step(
        surface,
        "grid merged lanes",
        parameters={
            "method": merging.method,
            "lanes": list(corrected),
            "options": options,
            "spacing": grid.spacing,
        },
        inputs=files,
    )


def _cloud_cells(
    lanes: Mapping[str, CloudPass],
    ways: Mapping[str, ReferencePath | None],
    settings: MergeSettings,
    progress: Progress,
    *,
    timed: bool,
) -> tuple[list[PassCells], list[str]]:
    """Cells of the lanes that have enough of them, and what is left out."""
    sums = {name: VisitSums(settings.cells) for name in lanes}
    total, done = sum(lane.count for lane in lanes.values()), 0
    for lane, block in blocks_of(list(lanes.values()), HEIGHTS):
        progress("cells of lanes", done, total)
        with name_file_in_errors(lane.files[0]):
            columns = {name: block[name].values for name in ("easting", "northing", "up")}
            time = np.zeros(block.sizes["point"])
            if timed:
                time = with_time(block, ways[lane.name])["time"].values
            sums[lane.name].add(**columns, time=time)
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
        if len(cells) < _LEAST_CELLS:
            left_out.append(
                f"{name} is left out: {len(cells)} cells with {lanes[name].count} points in all "
                "are a remnant, no pass"
            )
            continue
        found.append(cells)
    if len(found) < min(2, len(lanes)):
        raise CoverageError(
            f"fewer than two lanes have {_LEAST_CELLS} cells of {settings.cells.size:g} m: "
            + "; ".join(left_out),
            cure=f"Choose other cells (the points suggest {suggested_cell(lanes):g} m), fewer "
            "points in each, or allow more scatter.",
        )
    return found, left_out


def _of_one_flight(lanes: Mapping[str, CloudPass]) -> tuple[dict[str, CloudPass], list[str]]:
    """Lanes whose times can be those of one pass, and what is said of the others."""
    kept: dict[str, CloudPass] = {}
    left_out: list[str] = []
    for name, lane in lanes.items():
        if lane.time is None or lane.time[1] - lane.time[0] <= WEEK:
            kept[name] = lane
            continue
        left_out.append(
            f"{name} is left out: its times run from {lane.time[0]:.9g} s to {lane.time[1]:.9g} s, "
            "longer than a week, so it is no single pass"
        )
    if len(kept) < min(2, len(lanes)):
        raise CoverageError(
            f"fewer than two lanes have the times of one pass: {'; '.join(left_out)}",
            cure="Bring all times into one kind and give each flight a number of its own, or take "
            "the method discontinuity, which goes by station.",
        )
    return kept, left_out


def _of_time(
    lanes: Mapping[str, CloudPass], untimed: list[str], path: ReferencePath | None
) -> list[str]:
    """What is flagged about times."""
    problems = []
    if untimed:
        where = "the path given" if path is not None else "the middle of each lane"
        problems.append(
            f"{', '.join(untimed)} without gps_time: corrections follow the station along {where}, "
            "so that drift must not change where a pass comes back to a station"
        )
    week = [name for name, lane in lanes.items() if lane.time_kind == "week seconds"]
    standard = [name for name, lane in lanes.items() if lane.time_kind == "standard"]
    if week and standard:
        problems.append(
            f"times of {', '.join(week)} are seconds of a week, those of {', '.join(standard)} are "
            "not: each lane is corrected by its own, but in one file they do not go together"
        )
    return problems


def _flags_of(merging: MergeResult) -> list[str]:
    """Pairs that agree suspiciously well, or worse than before."""
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
                f"{1e3 * pair.before.nmad:.1f} mm before: it does not suit this ground"
            )
    return problems
