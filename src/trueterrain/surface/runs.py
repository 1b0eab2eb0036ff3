"""Gridding of recorded runs, straight from ranges without points in between."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import SchemaError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats.run import Run, open_run
from trueterrain.georeference import Screening
from trueterrain.surface._nodes import NodeValues, halo_of
from trueterrain.surface._recordings import Recording, read_ahead
from trueterrain.surface._windows import WindowPlan, plan_windows
from trueterrain.surface.accumulate import CellSums
from trueterrain.surface.cells import Grid
from trueterrain.surface.grid import compute_rows, name_deviations, require_heights
from trueterrain.surface.pass_record import PassRecord
from trueterrain.surface.settings import GridSettings

__all__ = ["BLOCK", "MEMORY", "PassRecord", "grid_runs", "require_one_frame"]

#: Default number of scans in a block: whole chunks of a store.
BLOCK = 4000

#: Default memory for sums [bytes].
MEMORY = 256 << 20


def grid_runs(
    passes: Sequence[PassRecord],
    grid: Grid,
    options: GridSettings = GridSettings(),
    *,
    screening: Screening = Screening(),
    threads: int = 1,
    block: int = BLOCK,
    memory: int = MEMORY,
    progress: Progress = no_progress,
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Grid recorded runs to a surface.

    `trueterrain.survey.build_surface` also fills holes; use this one for the gridding alone.

    Parameters
    ----------
    passes : sequence of PassRecord
        Runs with their motion, whose errors are independent unless `options.agreed` is set.
    grid : Grid
        The cells, in the local frame of the runs.
    options : GridSettings
        Statistic of the heights in a cell.
    screening : Screening
        Which returns are flagged, and whether they are kept.
    threads : int
        Threads that work at once; the surface does not depend on it.
    block : int
        Scans that are read at once; the surface does not depend on it.
    memory : int
        Memory for sums over the returns in cells [bytes]; a long grid is computed window by
        window, so that they take no more unless scans reach far along it. The surface does not
        depend on it.
    progress : callable, optional
        Called with the name of the run, and the scans done and to do.

    Returns
    -------
    surface : xarray.Dataset
        With ``height``, ``count`` and ``sd``; for aligned passes also ``sd_relative``, which leaves
        out the uncertainty of their common datum, see `name_deviations`.
    report : dict
        How many returns were ``used``, ``flagged``, ``outside`` of the grid or ``too_high``, and
        how many ``scans`` there were, ``scans_uncovered`` by the motion and ``bridged``.

    Raises
    ------
    ValueError
        If there is no pass, or `block` or `memory` is less than 1.
    CoverageError
        If the motion covers no scan of a run, or no return lies on the grid.
    SchemaError
        If the runs have different origins.
    FormatError
        If a run is damaged.
    """
    if not passes or block < 1 or memory < 1:
        message = (
            "there must be at least one pass, block must be at least 1 scan, and memory at least "
            "1 byte."
        )
        raise ValueError(message)
    require_one_frame([one.run for one in passes])
    recordings = [Recording(one, with_intensity=screening.needs_intensity) for one in passes]
    wanted = options.kept_sums()
    plan = plan_windows(
        grid,
        recordings,
        wanted,
        margin=halo_of(options, grid),
        memory=memory,
        threads=threads,
        furthest=screening.furthest,
    )
    nodes, return_totals = NodeValues.empty(grid.shape), plan.return_totals
    sums = CellSums(grid, wanted, threads=threads, rows=slice(plan.rows), poses=plan.poses)

    def grid_window(window: range) -> None:
        sums.move(plan.first(window))

        def add(those: CellSums) -> None:
            _add_scans(those, recordings, plan, window, screening, block, progress)

        add(sums)
        return_totals.add(sums.return_totals)
        compute_rows(sums, options, window, nodes, add_data=add)

    for window in plan.windows:
        grid_window(window)
    for window in plan.missed:
        grid_window(window)
    require_heights(nodes, options, return_totals)
    surface = provenance.add_step(
        grid.surface(
            nodes.height, crs="", count=nodes.count, **name_deviations(nodes.sd, sums.datum_sd)
        ),
        "grid",
        parameters={
            "runs": [one.run.file_name for one in passes],
            "options": options,
            "screening": screening,
            "spacing": grid.spacing,
        },
    )
    return surface, asdict(return_totals)


def require_one_frame(runs: Sequence[Run | str | Path]) -> tuple[float, ...]:
    """Origin of the local frame that all runs have in common.

    Parameters
    ----------
    runs : sequence of Run or path
        The runs, or their stores.

    Returns
    -------
    tuple of float
        Longitude [deg], latitude [deg] and ellipsoidal height [m].

    Raises
    ------
    SchemaError
        If one differs.
    """
    opened = [open_run(run) for run in runs]
    first = opened[0]
    for run in opened:
        if run.origin != first.origin:
            raise SchemaError(
                f"is {list(run.origin)}, but that of {first.file_name} is {list(first.origin)}",
                path=run.source,
                place="attribute origin",
                cure="Grid runs of one local frame, or georeference them to points of one CRS.",
            )
    return first.origin


def _add_scans(
    sums: CellSums,
    recordings: Sequence[Recording],
    plan: WindowPlan,
    window: range,
    screening: Screening,
    block: int,
    progress: Progress,
) -> None:
    """Add the scans that reach a window, pass by pass."""
    wanted = (
        (number, index)
        for number, one in enumerate(recordings)
        for index in one.blocks(plan.reaching(number, window), block)
    )
    for number, index, ranges, intensity in read_ahead(recordings, wanted):
        one = recordings[number]
        while sums.passes <= number:
            sums.next_pass()
        reach = plan.reach_of(number, index)
        sums.add_scans(
            one.geometry,
            one.time[index],
            ranges,
            intensity,
            scale=one.scale,
            missing=one.missing,
            screening=screening,
            reach=reach,
        )
        done = int(index[-1]) + 1
        if reach is not None:
            plan.note(number, index, reach, window)
            done = plan.done(number)
        progress(one.name, done, one.time.size)
    while sums.passes < len(recordings):
        sums.next_pass()
