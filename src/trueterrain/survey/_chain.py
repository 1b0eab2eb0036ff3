"""The whole chain: all runs of a survey, how they agree, and the files that are left."""

import itertools
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain._version import __version__
from trueterrain.alignment.discontinuity.alignment import DifferenceSummary
from trueterrain.alignment.merge import MergeResult
from trueterrain.alignment.run_passes import merge_runs
from trueterrain.core import no_progress, whole_folder
from trueterrain.core.json_values import json_values
from trueterrain.core.progress import Progress
from trueterrain.surface.evaluate import heights_at, node_coordinates
from trueterrain.surface.runs import require_one_frame
from trueterrain.survey._lane import SurfaceResult, SurveyRun, find_run, measure_lane, write_points
from trueterrain.survey._pictures import Pictures
from trueterrain.survey._settings import Survey
from trueterrain.verify.truth import TrueHeight

Floats = npt.NDArray[np.float64]

#: Kind of a result that `run` and `merge` write, and files that are in each.
RESULT, REPORTED = "survey", ("report.html", "result.json")

_FEW = 100  # nodes that two lanes must share for a comparison


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyResult:
    """What a survey found, beside the files that it wrote."""

    folder: Path
    "Where the files are."

    files: tuple[str, ...]
    "Their names; the report is report.html."

    numbers: dict[str, Any]
    "What stands in result.json."


def run_survey(
    survey: Survey,
    folder: str | Path,
    *,
    force: bool = False,
    threads: int = 1,
    truth: Callable[[Path], TrueHeight | None] = lambda _: None,
    progress: Progress = no_progress,
) -> SurveyResult:
    """Turn recorded runs into surfaces, profiles, roughness and a report.

    The motion of each run is found. Runs become a lane each, or are brought into agreement and
    become one; lanes are gridded, holes are filled, profiles are taken and rated. Where lanes
    overlap, their heights are compared. All files appear together when the last one is whole, or
    not at all.

    Parameters
    ----------
    survey : Survey
        Runs, and what shall become of them; see `read_survey`.
    folder : str or Path
        Where the files shall be.
    force : bool
        Replace an earlier result in the folder; other files in it stay.
    threads : int
        Threads that grid at once; results do not depend on it.
    truth : callable, optional
        Called with the store of a run, returns the true height as a function of easting and
        northing, if it is known; results are then compared with it.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    SurveyResult
        Files and numbers.

    Raises
    ------
    FormatError
        If a run is damaged.
    SchemaError
        If runs have different origins.
    CoverageError
        If a run has no motion or its returns lie beside the grid.
    OutputError
        If the folder is not empty and `force` is false, or as by `whole_folder`.
    """
    from trueterrain.report import write_report
    from trueterrain.survey._report import report_of

    require_one_frame([Path(run.path) for run in survey.runs])
    with whole_folder(
        folder, result=RESULT, force=force, inputs=_survey_inputs(survey), names=REPORTED
    ) as temporary:
        pictures = Pictures(temporary if survey.outputs.pictures else None)
        runs = [find_run(survey, run, progress) for run in survey.runs]
        before, (runs, merging) = runs, _merge_runs(survey, runs, threads, progress)
        points = [write_points(survey, run, temporary, progress) for run in runs]
        together = [runs] if merging else [[run] for run in runs]
        lanes = [
            measure_lane(
                survey,
                survey.name if merging else some[0].name,
                some,
                temporary,
                threads=threads,
                truth=_truth_of(some, truth),
                look=pictures.of_lane,
                progress=progress,
            )
            for some in together
        ]
        progress("report", 0, None)
        for run in runs:
            pictures.of_motion(run)
        for lane in lanes:
            pictures.of_whole(lane)
        if merging and survey.lanes:
            pictures.of_merging(merging, before, survey.lanes.cells.size)
        numbers = json_values(
            {
                "survey": survey.name,
                "title": survey.title,
                "version": __version__,
                "runs": [run.numbers for run in runs],
                "lanes": [lane.numbers for lane in lanes],
                "merge": merging.to_dict() if merging else None,
                "agreement": [
                    compared
                    for one, other in itertools.combinations(lanes, 2)
                    if (compared := overlap_agreement(one, other)) is not None
                ],
            }
        )
        (temporary / "result.json").write_text(
            json.dumps(numbers, indent=2, allow_nan=False) + "\n"
        )
        files = [one for one in points if one] + [file for lane in lanes for file in lane.files]
        report = report_of(survey, lanes, numbers, pictures, [*files, *pictures.files], merging)
        write_report(report, temporary / "report.html")
        pictures.close()
        written = tuple(sorted(file.name for file in temporary.iterdir()))
    return SurveyResult(folder=Path(folder), files=written, numbers=numbers)


def _survey_inputs(survey: Survey) -> list[str]:
    """All that a survey reads."""
    merging = survey.lanes
    others = [survey.grid.path, *(one.path for one in survey.profiles)]
    if merging is not None:
        others += [merging.path, merging.control]
    return [*(run.path for run in survey.runs), *(path for path in others if path)]


def _merge_runs(
    survey: Survey, runs: list[SurveyRun], threads: int, progress: Progress
) -> tuple[list[SurveyRun], MergeResult | None]:
    """Runs brought into agreement, if the survey asks for it."""
    if survey.lanes is None:
        return runs, None
    times = [run.motion.noise.drift_time[0] for run in runs if run.motion.noise is not None]
    merging, passes = merge_runs(
        {run.name: run.taken for run in runs},
        survey.lanes,
        screening=survey.screening,
        drift_time=float(np.median(times)) if times else None,
        threads=threads,
        progress=progress,
    )
    return [replace(run, taken=passes[run.name]) for run in runs], merging


def _truth_of(
    runs: list[SurveyRun], truth: Callable[[Path], TrueHeight | None]
) -> TrueHeight | None:
    """True ground under several runs: where several know it, what the first says."""
    known = [found for run in runs if (found := truth(run.taken.path)) is not None]
    if len(known) < len(runs):
        return None

    def height(easting: Floats, northing: Floats) -> Floats:
        found = known[0](easting, northing)
        for other in known[1:]:
            found = np.where(np.isfinite(found), found, other(easting, northing))
        return found

    return height


def overlap_agreement(one: SurfaceResult, other: SurfaceResult) -> dict[str, Any] | None:
    """Differences of height where two lanes overlap.

    Parameters
    ----------
    one, other : Lane
        The lanes.

    Returns
    -------
    dict or None
        ``lanes``, and of the height of the second less that of the first in ``n`` nodes some 50 mm
        apart ``median``, ``nmad``, ``rmse`` and ``p95`` [m]; None if they share too few nodes.
    """
    difference = heights_at(other.coarse, *node_coordinates(one.coarse)) - one.coarse.height.values
    found = DifferenceSummary.of(difference)
    if found.n < _FEW:
        return None
    return {"lanes": [one.name, other.name], **asdict(found)}
