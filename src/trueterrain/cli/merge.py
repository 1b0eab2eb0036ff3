"""The command ``trueterrain merge``: adjustment of passes over the same ground."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import (
    note_compilation,
    progress_bar,
    worker_threads,
    write_json,
    write_line,
    write_note,
)
from trueterrain.cli._options import INTEGER
from trueterrain.cli._points import Classes, Returns, note_conversion, point_filter
from trueterrain.cli._recordings import kind_of_all

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from trueterrain.alignment.merge import MergeSettings
    from trueterrain.alignment.observations.cells import PassCells
    from trueterrain.core import Progress
    from trueterrain.formats import PointFilter
    from trueterrain.survey import Survey

Method = Literal["network", "discontinuity", "grid"]


def merge(
    lane: Annotated[Path, Parameter(name="LANE")],
    /,
    *more: Annotated[Path, Parameter(name="MORE")],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    method: Method = "network",
    fix: Annotated[list[str] | None, Parameter(negative="")] = None,
    control: Path | None = None,
    datum_sd: float | None = None,
    path: Path | None = None,
    limit: float = 0.002,
    cell: float | None = None,
    spacing: float | None = None,
    max_iterations: Annotated[int | None, INTEGER] = None,
    relative_tolerance: float | None = None,
    split: Annotated[bool, Parameter(negative="")] = False,
    check: Annotated[bool, Parameter(negative="")] = False,
    threads: Annotated[int | None, INTEGER] = None,
    crs: str | None = None,
    classes: Classes = None,
    returns: Returns = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Bring passes over the same ground into agreement, and report their differences.

    The drift of navigation separates passes by millimetres to centimetres. For recorded runs the
    trajectories are corrected, for point clouds the points by their time. All passes are gridded to
    one surface.

    Example: `trueterrain merge left.zarr right.zarr -o merged`

    Parameters
    ----------
    lane
        Recorded run (NAME.zarr), or points (LAS, LAZ, COPC, CSV, Parquet, .zarr): each file is a
        pass; a single file of points is split by point source ID. A single run is sufficient if it
        returns to the same ground, as around a closed course.
    more
        More of the same kind.
    output
        Folder for report.html, result.json, the merged surface, and corrected clouds.
    method
        network: one least-squares adjustment of all passes; discontinuity: low-pass filtered
        discontinuity vectors along reference paths (the thesis); grid: the mean without correction,
        with a warning where passes disagree.
    fix
        Pass that is not corrected; may be given several times. By default the mean correction of
        all passes is zero.
    control
        CSV file of control points: easting, northing, up and sd [m].
    datum_sd
        Standard deviation of the height error that all passes have in common [m], for network. By
        default that of navigation, a fixed pass or control; unknown for clouds without sd.
    path
        CSV file of waypoints of the reference path, with the columns easting and northing [m], for
        discontinuity. By default the centre line of each overlap.
    limit
        Maximum difference of height between passes, for grid and --check [m].
    cell
        Size of the cells in which passes are compared [m]; by default 0.1 for runs, for clouds
        according to their density.
    spacing
        Distance between the nodes of the merged surface [m]; by default 0.01 for runs, the size of
        the cells for clouds.
    max_iterations
        Iterations in which the network adjustment must converge; by default 300.
    relative_tolerance
        Change of the corrections, relative to their standard deviations, below which the iteration
        has converged; by default 0.01.
    split
        Split several files by point source ID as well, e.g. tiles of one survey.
    check
        Test whether the passes agree, without correcting them; --output is then optional. The exit
        code is 1 if two passes differ by more than the limit, or if a pass overlaps no other.
    threads
        Number of threads; by default one for each processor. Results do not depend on it.
    crs
        Coordinate reference system of points whose files name none or a wrong one. Nothing is
        transformed, but feet are converted to metres.
    classes
        Classes of the points to use, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to use: last, first or its number; by default all.
    json
        Print result.json instead of a summary.
    force
        Replace an earlier result of the same command in the folder; other files in it stay.
    """
    if output is None and not check:
        message = "name the folder for the results: --output DIR (optional only with --check)."
        raise ValueError(message)
    inputs = [lane, *more]
    kind = kind_of_all(
        inputs,
        other="Surfaces are compared with `trueterrain compare`.",
        mixed="Merge runs and points separately, or georeference the runs first.",
    )
    runs = kind == "run"
    only = point_filter(classes, returns)
    if runs and only is not None:
        message = "--class and --return choose points, got recorded runs."
        raise ValueError(message)
    if not runs:
        note_conversion(inputs, crs)
    workers = worker_threads(threads)
    given = {
        "max_iterations": max_iterations,
        "relative_tolerance": relative_tolerance,
        "datum_sd": datum_sd,
    }
    settings = _merge_settings(method, fix, control, path, limit, cell, given, check=check)
    if check:
        _check_agreement(
            inputs, settings, runs, split, crs, cell, only, output, json=json, force=force
        )
        return
    assert output is not None
    with note_compilation(), progress_bar() as progress:
        if runs:
            from trueterrain.survey import run_survey
            from trueterrain.verify import truth_of

            numbers = run_survey(
                _merge_survey(inputs, settings, spacing),
                output,
                force=force,
                threads=workers,
                truth=truth_of,
                progress=progress,
            ).numbers
        else:
            from trueterrain.survey import merge_point_clouds

            numbers = merge_point_clouds(
                inputs,
                output,
                settings,
                split=split or None,
                crs=crs,
                only=only,
                cell=cell,
                spacing=spacing,
                force=force,
                threads=workers,
                progress=progress,
            ).numbers
    if json:
        write_json(numbers)
        return
    for line in summary_lines(numbers["merge"]):
        write_line(line)
    write_note(f"{output / 'report.html'}: the report")


def summary_lines(merged: dict[str, Any]) -> "Iterator[str]":
    """Lines that summarise the adjustment of passes.

    Parameters
    ----------
    merged : dict
        Entry "merge" of result.json.

    Yields
    ------
    str
        Lines.
    """
    for pair in merged["pairs"]:
        before, after = pair["before"], pair["after"]
        yield (
            f"{pair['second']} and {pair['first']}: {1e3 * before['rmse']:.2f} mm apart (RMSE of "
            f"{before['n']:,} cells) before, {1e3 * after['rmse']:.2f} mm after"
        )
    for seam in merged["seams"]:
        if seam["before"] is not None:
            yield (
                f"seam of {' and '.join(seam['lanes'])}: {1e3 * seam['before']:.2f} mm before, "
                f"{1e3 * seam['after']:.2f} mm after"
            )
    if merged["network"]:
        datums = merged["network"]["datum_sd"].values()
        sd = "unknown" if None in datums else f"{1e3 * max(datums):.2f} mm"
        yield f"standard deviation of the height error common to all passes: {sd}"
    for problem in merged["problems"]:
        yield f"flagged: {problem}"


def _merge_settings(
    method: Method,
    fix: list[str] | None,
    control: Path | None,
    path: Path | None,
    limit: float,
    cell: float | None,
    given: "Mapping[str, Any]",
    *,
    check: bool,
) -> "MergeSettings":
    from dataclasses import replace

    from trueterrain.alignment.merge import MergeSettings

    settings = MergeSettings(
        method="grid" if check else method,
        fixed=tuple(fix or ()),
        limit=limit,
        control=None if control is None else str(control),
        path=None if path is None else str(path),
    )
    stated = {name: value for name, value in given.items() if value is not None}
    settings = replace(settings, network=replace(settings.network, **stated))
    if cell is None:
        return settings
    return replace(settings, cells=replace(settings.cells, size=cell))


def _merge_survey(inputs: list[Path], settings: "MergeSettings", spacing: float | None) -> "Survey":
    from trueterrain.surface.placement import GridPlacement
    from trueterrain.survey import survey_of

    return survey_of(
        inputs,
        name="merged",
        title="Merged passes",
        profiles=(),
        lanes=settings,
        grid=GridPlacement(spacing=spacing or 0.01, lap=True),
    )


def _check_agreement(
    inputs: list[Path],
    settings: "MergeSettings",
    runs: bool,
    split: bool,
    crs: str | None,
    cell: float | None,
    only: "PointFilter | None",
    output: Path | None,
    *,
    json: bool,
    force: bool,
) -> None:
    from trueterrain.core import require_writable, whole_folder
    from trueterrain.report import write_report
    from trueterrain.survey import RESULT, check_agreement, check_report

    if output is not None:
        require_writable(output, force=force, inputs=inputs, replaces="folder")
    with note_compilation(), progress_bar() as progress:
        cells, size, problems = _pass_cells(
            inputs, settings, runs, split, crs, cell, only, progress
        )
        found = check_agreement(cells, limit=settings.limit, size=size, problems=problems)
    if output is not None:
        with whole_folder(output, result=RESULT, force=force, inputs=inputs) as folder:
            names = ", ".join(path.name for path in inputs)
            write_report(check_report(found, title=names), folder / "report.html")
    if json:
        write_json(found)
    else:
        for line in _check_lines(found):
            write_line(line)
    if not found["agree"]:
        sys.stdout.flush()  # here main still handles a closed pipe
        sys.exit(1)


def _check_lines(found: dict[str, Any]) -> "Iterator[str]":
    """Lines that summarise the test of agreement."""
    for pair in found["pairs"]:
        verdict = "agree" if pair["agree"] else "do NOT agree"
        yield (
            f"{pair['first']} and {pair['second']} {verdict}: 95 % of {pair['n']:,} cells differ "
            f"by up to {1e3 * pair['p95']:.2f} mm (median {1e3 * pair['median']:+.2f} mm), limit "
            f"{1e3 * found['limit']:g} mm"
        )
    for name in found["alone"]:
        yield f"{name} overlaps no other pass: its agreement is unknown"
    yield from found["problems"]


def _pass_cells(
    inputs: list[Path],
    settings: "MergeSettings",
    runs: bool,
    split: bool,
    crs: str | None,
    cell: float | None,
    only: "PointFilter | None",
    progress: "Progress",
) -> "tuple[list[PassCells], float, list[str]]":
    """Cells of all passes, their size [m], and problems."""
    if not runs:
        from trueterrain.alignment.clouds.merge import (
            cells_of_clouds,
            find_cloud_passes,
            flag_classes,
        )

        lanes = find_cloud_passes(
            inputs, split=split or None, crs=crs, only=only, progress=progress
        )
        for flag in flag_classes(lanes):
            write_note(f"warning: {flag}")
        return cells_of_clouds(lanes, settings, cell=cell, progress=progress)
    from trueterrain.alignment.run_passes import cells_of_passes
    from trueterrain.survey import process_survey_run, run_name, survey_of

    survey = survey_of(inputs)
    found = {run_name(run): process_survey_run(survey, run, progress).record for run in survey.runs}
    return cells_of_passes(found, settings, progress=progress), settings.cells.size, []
