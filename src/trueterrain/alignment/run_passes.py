"""Alignment of recorded runs: compare their cells, correct their trajectories."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from trueterrain import formats
from trueterrain.alignment.apply import corrected_trajectory, fixed_trajectory, trajectory_along
from trueterrain.alignment.discontinuity.alignment import align_along_paths
from trueterrain.alignment.discontinuity.reference_path import ReferencePath, waypoint_reference
from trueterrain.alignment.discontinuity.result import PassAlignment
from trueterrain.alignment.merge import MergeResult, MergeSettings, merge_cells
from trueterrain.alignment.observations.cells import PassCells, make_pass_cells
from trueterrain.alignment.observations.collection import cells_of_run
from trueterrain.core.errors import SchemaError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.georeference import Screening, georeference
from trueterrain.surface.runs import PassRecord, require_one_frame


def merge_runs(
    passes: Mapping[str, PassRecord],
    settings: MergeSettings = MergeSettings(),
    *,
    screening: Screening = Screening(),
    drift_time: float | None = None,
    threads: int = 1,
    progress: Progress = no_progress,
) -> tuple[MergeResult, dict[str, PassRecord]]:
    """Align recorded runs, by correcting their trajectories.

    Every product made of the corrected runs afterwards agrees: points, surfaces, profiles.

    Parameters
    ----------
    passes : mapping of str to PassRecord
        Runs with their trajectories, by name.
    settings : MergeSettings
        Method and its settings.
    screening : Screening
        Which returns are flagged or dropped.
    drift_time : float, optional
        Correlation time of the drift of navigation that fusion estimated [s]; the settings take
        precedence.
    threads : int
        Number of runs read at the same time; results do not depend on it.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    merging : MergeResult
        Corrections, and agreement before and after.
    passes : dict of Pass
        Runs with corrected trajectories.

    Raises
    ------
    CoverageError
        If no cell is common to two passes, or an overlap is too narrow for the method.
    SchemaError
        If control points have no standard deviations.
    TrueTerrainError
        If the adjustment does not converge.
    """
    if settings.network.correlation_time is None and drift_time is not None:
        network = replace(settings.network, correlation_time=drift_time)
        settings = replace(settings, network=network)
    cells = cells_of_passes(
        passes, settings, screening=screening, threads=threads, progress=progress
    )
    control = [] if settings.control is None else [control_cells(settings.control, settings)]
    merging = merge_cells(
        cells,
        settings,
        control=control,
        progress=progress,
        align=lambda: _align_runs(passes, settings, screening, progress),
    )
    return merging, {name: _correct_pass(one, name, merging) for name, one in passes.items()}


def cells_of_passes(
    passes: Mapping[str, PassRecord],
    settings: MergeSettings = MergeSettings(),
    *,
    screening: Screening = Screening(),
    threads: int = 1,
    progress: Progress = no_progress,
) -> list[PassCells]:
    """Cells of several runs, to compare or adjust them.

    Parameters
    ----------
    passes : mapping of str to PassRecord
        Runs with their trajectories, by name.
    settings : MergeSettings
        Size of the cells, and which of them are accepted.
    screening : Screening
        Which returns are flagged or dropped.
    threads : int
        Number of runs read at the same time.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    list of PassCells
        In the order of the passes.

    Raises
    ------
    SchemaError
        If the runs have different origins.
    CoverageError
        If a trajectory covers no scan of its run, or no cell has enough returns.
    """
    require_one_frame([one.run for one in passes.values()])
    progress("cells of passes", 0, len(passes))
    with ThreadPoolExecutor(threads) as pool:
        jobs = [
            pool.submit(
                cells_of_run,
                one.run,
                one.trajectory,
                settings.cells,
                name=name,
                mounting=one.mounting,
                screening=screening,
            )
            for name, one in passes.items()
        ]
        cells = []
        for job in jobs:
            cells.append(job.result())
            progress("cells of passes", len(cells), len(passes))
    return cells


def control_cells(path: str | Path, settings: MergeSettings) -> PassCells:
    """Cells of control points: heights that get no correction.

    Parameters
    ----------
    path : str or Path
        Points with ``sd``, in the frame of the passes.
    settings : MergeSettings
        Size of the cells.

    Returns
    -------
    PassCells
        One entry for each point.

    Raises
    ------
    SchemaError
        If the points have no standard deviations.
    FormatError
        If the file holds no points.
    """
    points = formats.open(path)
    if "sd" not in points or "up" not in points:
        raise SchemaError(
            "control needs the columns easting, northing, up and sd",
            path=path,
            cure="Add a column sd: the standard deviation of each height [m].",
        )
    x, y = points["easting"].values, points["northing"].values
    column, row = (np.floor(at / settings.cells.size).astype(np.int64) for at in (x, y))
    return make_pass_cells(
        f"control {Path(path).stem}",
        (column << 32) + row,
        0.0,
        points["up"].values,
        variance=points["sd"].values ** 2,
        easting=x,
        northing=y,
    )


def reference_path(settings: MergeSettings) -> ReferencePath | None:
    """Reference path through the waypoints that the settings name.

    Parameters
    ----------
    settings : MergeSettings
        File of waypoints.

    Returns
    -------
    ReferencePath or None
        None if the settings name no file.
    """
    if settings.path is None:
        return None
    from trueterrain.formats.table import read_waypoints

    return waypoint_reference(
        *read_waypoints(Path(settings.path)), spacing=settings.discontinuity.spacing
    )


def _align_runs(
    passes: Mapping[str, PassRecord],
    settings: MergeSettings,
    screening: Screening,
    progress: Progress,
) -> PassAlignment:
    def points(one: PassRecord) -> Callable[[], Iterator[xr.Dataset]]:
        return lambda: georeference(one.run, one.trajectory, one.mounting, screening=screening)

    return align_along_paths(
        {name: points(one) for name, one in passes.items()},
        settings.discontinuity,
        paths=reference_path(settings),
        fix=next(iter(settings.fixed), None),
        progress=progress,
    )


def _correct_pass(one: PassRecord, name: str, merging: MergeResult) -> PassRecord:
    if merging.alignment is not None:
        raised = trajectory_along(
            one.trajectory, merging.alignment, name, lever_arm=one.mounting.scanner_position
        )
        return replace(one, trajectory=raised)
    found = merging.adjustment
    if found is None:
        return one
    if name in found.names:
        moved = corrected_trajectory(one.trajectory, found.correction(name))
    else:
        moved = fixed_trajectory(one.trajectory, found.datum_sd[name])
    return replace(one, trajectory=moved)
