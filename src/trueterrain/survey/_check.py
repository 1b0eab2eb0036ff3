"""Check of the agreement of passes, without correcting them: one page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from trueterrain._version import __version__
from trueterrain.alignment.clouds.merge import CloudPass, cells_of_clouds
from trueterrain.alignment.discontinuity.seams import find_seams
from trueterrain.alignment.merge import MergeSettings, compare_passes, require_different
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.run_passes import cells_of_passes
from trueterrain.core.progress import Progress, no_progress
from trueterrain.report import Block, Number, Report, Section, Table, Text, Verdict, Warnings
from trueterrain.survey._chain import process_survey_run
from trueterrain.survey._report_parts import parse_columns, to_millimetres
from trueterrain.survey._settings import run_name, survey_of


def check_agreement(
    cells: Sequence[PassCells], *, limit: float, size: float, problems: Sequence[str] = ()
) -> dict[str, Any]:
    """Differences of passes where they overlap, compared with a limit.

    Parameters
    ----------
    cells : sequence of PassCells
        Cells of each pass.
    limit : float
        Difference of height that 95 % of the cells must not exceed [m].
    size : float
        Size of the cells [m].
    problems : sequence of str
        Problems found before, in words, such as passes that were left out.

    Returns
    -------
    dict
        ``agree``, ``limit`` [m], ``pairs`` with ``n``, ``median``, ``nmad``, ``rmse``, ``p95`` [m]
        and ``agree``; ``seams`` [m]; ``alone``: passes without ground in common with another;
        ``problems``: passes and seams that were left out and other flags, in words.

    Raises
    ------
    CoverageError
        If no cell is seen by two passes, or two passes hold the same returns.
    """
    require_different(cells)
    pairs = compare_passes(cells)
    none = {one.name: np.zeros(len(one)) for one in cells}
    seams, no_seams = find_seams(cells, none, size)
    paired = {name for pair in pairs for name in (pair.first, pair.second)}
    alone = sorted({one.name for one in cells} - paired)
    found = [
        {
            "first": pair.first,
            "second": pair.second,
            **{
                name: value
                for name, value in asdict(pair.before).items()
                if name != "rmse_accepted"
            },
            "agree": pair.before.p95 <= limit,
        }
        for pair in pairs
    ]
    return {
        "version": __version__,
        "limit": limit,
        "agree": all(pair["agree"] for pair in found) and not alone,
        "pairs": found,
        "seams": [{"lanes": list(seam.names), "median": seam.before.median} for seam in seams],
        "alone": alone,
        "problems": [*problems, *no_seams],
    }


def check_runs(
    runs: Sequence[str | Path], settings: MergeSettings, *, progress: Progress = no_progress
) -> dict[str, Any]:
    """Check whether the passes of recorded runs agree, without correcting them.

    Parameters
    ----------
    runs : sequence of str or Path
        Stores of the runs, with different names.
    settings : MergeSettings
        Cells, and the limit of the differences.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    dict
        As by `check_agreement`.
    """
    survey = survey_of([Path(run) for run in runs])
    records = {
        run_name(run): process_survey_run(survey, run, progress).record for run in survey.runs
    }
    cells = cells_of_passes(records, settings, progress=progress)
    return check_agreement(cells, limit=settings.limit, size=settings.cells.size)


def check_point_clouds(
    passes: Mapping[str, CloudPass],
    settings: MergeSettings,
    *,
    cell: float | None = None,
    progress: Progress = no_progress,
) -> dict[str, Any]:
    """Check whether the passes of point clouds agree, without correcting them.

    Parameters
    ----------
    passes : mapping
        Passes by name, as by `trueterrain.alignment.clouds.merge.find_cloud_passes`.
    settings : MergeSettings
        Cells, and the limit of the differences.
    cell : float, optional
        Size of the cells [m]; by default by the density of the points.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    dict
        As by `check_agreement`.
    """
    cells, size, problems = cells_of_clouds(passes, settings, cell=cell, progress=progress)
    return check_agreement(cells, limit=settings.limit, size=size, problems=problems)


def check_report(found: dict[str, Any], *, title: str) -> Report:
    """One page on the agreement of passes.

    Parameters
    ----------
    found : dict
        As by `check_agreement`.
    title : str
        Title of the page.

    Returns
    -------
    Report
        To be written.
    """
    limit = to_millimetres(found["limit"])
    verdicts: list[Verdict | None] = ["good" if pair["agree"] else "bad" for pair in found["pairs"]]
    blocks: list[Block] = [
        Table(
            columns=parse_columns(
                "Passes; Cells; Median [mm] .2; NMAD [mm] .2; RMSE [mm] .2; 95 % [mm] .2"
            ),
            rows=[
                (
                    f"{pair['second']} - {pair['first']}",
                    pair["n"],
                    *(to_millimetres(pair[name]) for name in ("median", "nmad", "rmse", "p95")),
                )
                for pair in found["pairs"]
            ],
            verdicts=verdicts,
            caption=f"Differences of height in the cells that both passes saw. They agree if 95 % "
            f"of them are within {limit:g} mm.",
        )
    ]
    if found["seams"]:
        blocks.append(
            Table(
                columns=parse_columns("Passes; Seam [mm] .2"),
                rows=[
                    (" - ".join(seam["lanes"]), to_millimetres(seam["median"]))
                    for seam in found["seams"]
                ],
                caption="Steps that the mean of the passes would make at the edges of the overlap.",
            )
        )
    if found["alone"]:
        blocks.append(
            Text(
                paragraph=f"Nothing can be said about {', '.join(found['alone'])}: no other pass "
                "sees the same ground."
            )
        )
    if found["problems"]:
        blocks.append(Warnings(items=found["problems"]))
    worst = max(found["pairs"], key=lambda pair: float(pair["p95"]))
    headline = (
        Number(
            label="Passes agree",
            value="yes" if found["agree"] else "no",
            verdict="good" if found["agree"] else "bad",
            note=f"within {limit:g} mm (95 %)",
        ),
        Number(
            label="Largest difference",
            value=to_millimetres(worst["p95"]),
            unit="mm",
            digits=1,
            note=f"95 %, {worst['first']} and {worst['second']}",
        ),
    )
    return Report(
        title=title,
        subtitle="Agreement of passes, nothing corrected",
        headline=headline,
        sections=(Section(title="How the passes agree", blocks=blocks),),
    )
