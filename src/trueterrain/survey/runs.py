"""Recorded runs: motion of each, points of its returns, agreement of their passes."""

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.alignment.merge import MergeResult, MergeSettings
from trueterrain.alignment.run_passes import merge_runs
from trueterrain.core.errors import name_file_in_errors
from trueterrain.core.progress import Progress, no_progress
from trueterrain.formats.run import Run, open_run
from trueterrain.georeference import Screening, georeference
from trueterrain.georeference.scans import find_scan_problems
from trueterrain.motion import FusedMotion, FusionSettings, Trajectory, fuse_motion
from trueterrain.surface.pass_record import PassRecord
from trueterrain.survey._settings import MountingOverride, run_name


@dataclass(frozen=True, kw_only=True, eq=False)
class ProcessedRun:
    """A recorded run with its motion: what `align_passes` and `build_surface` work on."""

    name: str
    "Name of the run in results."

    record: PassRecord
    "The run, open, the part of its trajectory that is used, and its mounting."

    motion: FusedMotion
    "Result of the fusion over the whole run."

    settings: FusionSettings = field(default_factory=FusionSettings)
    "Settings of the fusion."

    problems: tuple[str, ...] = ()
    "What is flagged about motion and scans, in words."

    aligned: bool = False
    "Whether the trajectory was corrected by `align_passes`."

    numbers: dict[str, Any] = field(default_factory=dict)
    "Scans, beams, duration [s], distance driven [m] and origin of the run, as in result.json."

    @property
    def trajectory(self) -> Trajectory:
        """Motion of the body."""
        return self.record.trajectory

    def to_dict(self) -> dict[str, Any]:
        """Numbers of the run as they stand in result.json.

        Returns
        -------
        dict
            ``name``, ``path``, ``scans``, ``beams``, ``seconds``, ``driven``, ``origin``,
            ``mounting``, ``motion`` and ``problems``.
        """
        return {
            "name": self.name,
            **self.numbers,
            "mounting": asdict(self.record.mounting),
            "motion": self.motion.to_dict(),
            "problems": list(self.problems),
        }


def process_run(
    run: Run | str | Path,
    motion: FusionSettings = FusionSettings(),
    *,
    name: str | None = None,
    mounting: MountingOverride = MountingOverride(),
    begin: float | None = None,
    end: float | None = None,
) -> ProcessedRun:
    """Estimate the motion of a recorded run.

    First step of the chain: opens the run, fuses navigation and accelerometers, and checks that
    the motion covers the scans.

    Parameters
    ----------
    run : Run or path
        The run, or its store NAME.zarr.
    motion : FusionSettings
        Settings of the fusion; by default Kalman filter and smoother (``rts``).
    name : str, optional
        Name of the run in results; by default that of its store.
    mounting : MountingOverride
        Mounting parameters that replace those of the run, e.g. after a calibration.
    begin, end : float, optional
        Times between which the run is used [s]; by default all of it.

    Returns
    -------
    ProcessedRun
        Trajectory and mounting, with all that is flagged about them.

    Raises
    ------
    FormatError
        If the run is damaged.
    SchemaError
        If navigation or scans break a rule, such as a clock that runs backward.
    CoverageError
        If there is too little navigation, or it covers no scan.
    """
    run = open_run(run)
    with name_file_in_errors(run.source), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # each warning is among the problems as well
        fused = fuse_motion(run, settings=motion)
        problems = (*fused.problems, *find_scan_problems(run, fused.trajectory))
        trajectory = fused.trajectory.between(begin, end)
    return ProcessedRun(
        name=name or run_name(run.file_name),
        record=PassRecord(run=run, trajectory=trajectory, mounting=mounting.over(run.mounting)),
        motion=fused,
        settings=motion,
        problems=problems,
        numbers=_run_numbers(run, trajectory),
    )


def georeference_run(
    run: ProcessedRun,
    *,
    screening: Screening = Screening(),
    range_noise: float = 0.0005,
    lane: int | None = None,
    progress: Progress = no_progress,
) -> Iterator[xr.Dataset]:
    """Points of all returns of a run, block by block.

    Parameters
    ----------
    run : ProcessedRun
        The run.
    screening : Screening
        Which returns are flagged, and whether they are kept.
    range_noise : float
        Standard deviation of a range [m].
    lane : int, optional
        Number that is stored as ``lane`` of all points.
    progress : callable, optional
        Called with a task, the scans done and the total.

    Yields
    ------
    xarray.Dataset
        Points with ``time``, ``sd`` and ``intensity``; `trueterrain.write` takes the blocks.
    """
    record = run.record
    blocks = georeference(
        record.run,
        record.trajectory,
        record.mounting,
        screening=screening,
        range_noise=range_noise,
        lane=lane,
    )
    for block in blocks:
        yield block
        progress(f"{run.name}: points", block.attrs["scans"], run.numbers["scans"])


def align_passes(
    runs: Sequence[ProcessedRun],
    settings: MergeSettings = MergeSettings(),
    *,
    screening: Screening = Screening(),
    threads: int = 1,
    progress: Progress = no_progress,
) -> tuple[list[ProcessedRun], MergeResult]:
    """Bring the passes of recorded runs into agreement.

    Navigation drifts by millimetres to centimetres from pass to pass. By default one least-squares
    adjustment of all passes estimates a correction of each trajectory from the heights in the
    cells that passes have in common.

    Parameters
    ----------
    runs : sequence of ProcessedRun
        Runs over the same ground, with different names; one run will do if it comes back to its
        own ground.
    settings : MergeSettings
        Method and parameters of the adjustment.
    screening : Screening
        Which returns are flagged, and whether they are kept.
    threads : int
        Runs whose cells are collected at once; results do not depend on it.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    runs : list of ProcessedRun
        The runs with corrected trajectories.
    result : MergeResult
        Corrections, and agreement of each pair of passes before and after.

    Raises
    ------
    ValueError
        If two runs have the same name.
    CoverageError
        If no cell is seen by two passes, or an overlap is too thin for the method.
    TrueTerrainError
        If the adjustment does not converge.
    """
    names = [run.name for run in runs]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        message = f"runs must have different names, got {repeated[0]!r} more than once."
        raise ValueError(message)
    # fusion estimates the correlation time of the drift of each run; the adjustment takes one
    times = [run.motion.noise.drift_time[0] for run in runs if run.motion.noise is not None]
    result, corrected = merge_runs(
        {run.name: run.record for run in runs},
        settings,
        screening=screening,
        drift_time=float(np.median(times)) if times else None,
        threads=threads,
        progress=progress,
    )
    return [replace(run, record=corrected[run.name], aligned=True) for run in runs], result


def _run_numbers(run: Run, trajectory: Trajectory) -> dict[str, Any]:
    scans = run["scans"]
    time = np.asarray(scans["time"], dtype=np.float64)
    steps = np.diff(trajectory.position[:, :2], axis=0)
    return {
        "path": run.file_name,
        "scans": int(scans.sizes["scan"]),
        "beams": int(scans.sizes["beam"]),
        "seconds": float(np.nanmax(time) - np.nanmin(time)),
        "driven": float(np.hypot(*steps.T).sum()),
        "origin": list(run.origin),
    }
