"""The whole chain: all runs of a survey, their agreement, and the files that result."""

import itertools
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain._version import __version__
from trueterrain.alignment.discontinuity.alignment import DifferenceSummary
from trueterrain.alignment.merge import MergeResult
from trueterrain.core import no_progress, whole_folder
from trueterrain.core.json_values import json_values
from trueterrain.core.progress import Progress
from trueterrain.formats.run import Run, open_run
from trueterrain.report import write_report
from trueterrain.surface.evaluate import heights_at, node_coordinates
from trueterrain.surface.runs import require_one_frame
from trueterrain.survey._pictures import Pictures
from trueterrain.survey._products import SurfaceResult, write_points, write_products
from trueterrain.survey._report import report_of
from trueterrain.survey._settings import RunSettings, Survey, run_name
from trueterrain.survey.runs import ProcessedRun, align_passes, process_run
from trueterrain.verify.truth import TrueHeight

Floats = npt.NDArray[np.float64]

#: Kind of a result that `run` and `merge` write, and files that are in each.
RESULT, REPORTED = "survey", ("report.html", "result.json")

_MIN_COMMON = 100  # nodes that two surfaces must have in common for a comparison


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyResult:
    """Files and numbers of a survey."""

    folder: Path
    "Where the files are."

    files: tuple[str, ...]
    "Their names; the report is report.html."

    numbers: dict[str, Any]
    "Contents of result.json."


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

    The steps are those of `process_run`, `align_passes` (if `survey.lanes` is given),
    `build_surface`, `extract_profiles` and `rate_profiles`. Each run becomes a surface of its own,
    or all aligned runs become one. Where surfaces overlap, their heights are compared. All files
    appear together when the last one is complete, or none does.

    Parameters
    ----------
    survey : Survey
        Runs and the settings of all steps; see `read_survey`.
    folder : str or Path
        Folder for the files.
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
        If a run has no motion, or no return lies on the grid.
    OutputError
        If the folder is not empty and `force` is false, or as by `whole_folder`.
    """
    opened = [open_run(run.path) for run in survey.runs]
    require_one_frame(opened)
    with whole_folder(
        folder, result=RESULT, force=force, inputs=_survey_inputs(survey), names=REPORTED
    ) as temporary:
        pictures = Pictures(temporary if survey.outputs.pictures else None)
        before = [
            process_survey_run(survey, settings, progress, opened=run)
            for settings, run in zip(survey.runs, opened, strict=True)
        ]
        runs, merging = before, None
        if survey.lanes is not None:
            runs, merging = align_passes(
                before,
                survey.lanes,
                screening=survey.screening,
                threads=threads,
                progress=progress,
            )
        points = [write_points(survey, run, temporary, progress) for run in runs]
        together = [runs] if merging else [[run] for run in runs]
        surfaces = [
            write_products(
                survey,
                survey.name if merging else some[0].name,
                some,
                temporary,
                threads=threads,
                truth=_truth_of(some, truth),
                draw=pictures.of_lane,
                progress=progress,
            )
            for some in together
        ]
        progress("report", 0, None)
        for run in runs:
            pictures.of_motion(run)
        for surface in surfaces:
            pictures.of_whole(surface)
        if merging and survey.lanes:
            pictures.of_merging(merging, before, survey.lanes.cells.size)
        numbers = _survey_numbers(survey, before, surfaces, merging)
        (temporary / "result.json").write_text(
            json.dumps(numbers, indent=2, allow_nan=False) + "\n"
        )
        files = [one for one in points if one] + [
            file for surface in surfaces for file in surface.files
        ]
        report = report_of(survey, surfaces, numbers, pictures, [*files, *pictures.files], merging)
        write_report(report, temporary / "report.html")
        pictures.close()
        written = tuple(sorted(file.name for file in temporary.iterdir()))
    return SurveyResult(folder=Path(folder), files=written, numbers=numbers)


def process_survey_run(
    survey: Survey,
    run: RunSettings,
    progress: Progress = no_progress,
    *,
    opened: Run | None = None,
) -> ProcessedRun:
    """Estimate the motion of one run of a survey.

    Parameters
    ----------
    survey : Survey
        Settings of the fusion.
    run : RunSettings
        The run, the part of it that is used, and its mounting.
    progress : callable, optional
        Called with a task, the amount done and the total.
    opened : Run, optional
        The run, if it is open already.

    Returns
    -------
    ProcessedRun
        As by `process_run`.
    """
    name = run_name(run)
    progress(f"{name}: motion", 0, None)
    return process_run(
        run.path if opened is None else opened,
        survey.motion,
        name=name,
        mounting=run.mounting,
        begin=run.begin,
        end=run.end,
    )


def _survey_numbers(
    survey: Survey,
    runs: Sequence[ProcessedRun],
    surfaces: Sequence[SurfaceResult],
    merging: MergeResult | None,
) -> dict[str, Any]:
    """Contents of result.json."""
    numbers: dict[str, Any] = json_values(
        {
            "survey": survey.name,
            "title": survey.title,
            "version": __version__,
            "runs": [run.to_dict() for run in runs],
            "lanes": [surface.numbers for surface in surfaces],
            "merge": merging.to_dict() if merging else None,
            "agreement": [
                compared
                for one, other in itertools.combinations(surfaces, 2)
                if (compared := overlap_agreement(one, other)) is not None
            ],
        }
    )
    return numbers


def _survey_inputs(survey: Survey) -> list[str]:
    """All files and stores that a survey reads."""
    merging = survey.lanes
    others = [survey.grid.path, *(one.path for one in survey.profiles)]
    if merging is not None:
        others += [merging.path, merging.control]
    return [*(run.path for run in survey.runs), *(path for path in others if path)]


def _truth_of(
    runs: Sequence[ProcessedRun], truth: Callable[[Path], TrueHeight | None]
) -> TrueHeight | None:
    """True ground under several runs, None if one does not know it; the first run has priority."""
    paths = [path for run in runs if (path := run.record.path) is not None]
    known = [found for path in paths if (found := truth(path)) is not None]
    if len(known) < len(runs):
        return None

    def height(easting: Floats, northing: Floats) -> Floats:
        found = known[0](easting, northing)
        for other in known[1:]:
            found = np.where(np.isfinite(found), found, other(easting, northing))
        return found

    return height


def overlap_agreement(one: SurfaceResult, other: SurfaceResult) -> dict[str, Any] | None:
    """Differences of height where two surfaces overlap.

    Parameters
    ----------
    one, other : SurfaceResult
        The surfaces.

    Returns
    -------
    dict or None
        ``lanes``, and of the height of the second less that of the first in ``n`` nodes some 50 mm
        apart ``median``, ``nmad``, ``rmse`` and ``p95`` [m]; None if they have too few nodes in
        common.
    """
    difference = heights_at(other.coarse, *node_coordinates(one.coarse)) - one.coarse.height.values
    found = DifferenceSummary.of(difference)
    if found.n < _MIN_COMMON:
        return None
    return {"lanes": [one.name, other.name], **asdict(found)}
