"""The command ``trueterrain merge``: adjustment of passes over the same ground."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from trueterrain.alignment.discontinuity.vectors import DiscontinuitySettings
from trueterrain.alignment.merge import MergeSettings
from trueterrain.alignment.settings import CellSettings, NetworkSettings
from trueterrain.cli._console import (
    note_compilation,
    progress_bar,
    worker_threads,
    write_json,
    write_line,
    write_note,
)
from trueterrain.cli._options import INTEGER, flatten_settings
from trueterrain.cli._points import Classes, Returns, note_conversion, point_filter
from trueterrain.cli._recordings import kind_of_all

if TYPE_CHECKING:
    from collections.abc import Iterator

    from trueterrain.formats import PointFilter

_METHOD = flatten_settings("Method", omit=["fixed", "cells", "network", "discontinuity"])
_CELLS = flatten_settings("Cells in which passes are compared", omit=["size"], sort_key=2)
_NETWORK = flatten_settings("Network adjustment", sort_key=3)
_VECTORS = flatten_settings("Discontinuity vectors", omit=["spacing", "cell"], sort_key=4)
_POINTS = Parameter(group=Group("Points", sort_key=5))


def merge(
    lane: Annotated[Path, Parameter(name="LANE")],
    /,
    *more: Annotated[Path, Parameter(name="MORE")],
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    settings: Annotated[MergeSettings, _METHOD] = MergeSettings(),
    fix: Annotated[list[str] | None, Parameter(group=_METHOD.group)] = None,
    check: Annotated[bool, Parameter(group=_METHOD.group)] = False,
    cell: Annotated[float | None, Parameter(group=_CELLS.group)] = None,
    cells: Annotated[CellSettings, _CELLS] = CellSettings(),
    network: Annotated[NetworkSettings, _NETWORK] = NetworkSettings(),
    discontinuity: Annotated[DiscontinuitySettings, _VECTORS] = DiscontinuitySettings(),
    spacing: float | None = None,
    threads: Annotated[int | None, INTEGER] = None,
    split: Annotated[bool, _POINTS] = False,
    crs: Annotated[str | None, _POINTS] = None,
    classes: Annotated[Classes, _POINTS] = None,
    returns: Annotated[Returns, _POINTS] = None,
    json: bool = False,
    force: bool = False,
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
    cell
        Size of the cells in which passes are compared [m]; by default 0.1 for runs, for clouds
        according to their density.
    spacing
        Distance between the nodes of the merged surface [m]; by default 0.01 for runs, the size of
        the cells for clouds.
    split
        Split several files by point source ID as well, e.g. tiles of one survey.
    fix
        Pass that is not corrected; may be given several times. By default the mean correction of
        all passes is zero.
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
    settings = replace(
        settings,
        method="grid" if check else settings.method,
        fixed=tuple(fix or ()),
        network=network,
        discontinuity=discontinuity,
        cells=replace(cells, size=settings.cells.size if cell is None else cell),
    )
    if check:
        _check_agreement(
            inputs, settings, runs, split, crs, cell, only, output, json=json, force=force
        )
        return
    assert output is not None
    with note_compilation(), progress_bar() as progress:
        if runs:
            from trueterrain.surface.placement import GridPlacement
            from trueterrain.survey import run_survey, survey_of
            from trueterrain.verify import truth_of

            numbers = run_survey(
                survey_of(
                    inputs,
                    name="merged",
                    title="Merged passes",
                    profiles=(),
                    lanes=settings,
                    grid=GridPlacement(spacing=spacing or 0.01, lap=True),
                ),
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


def _check_agreement(
    inputs: list[Path],
    settings: MergeSettings,
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
    from trueterrain.alignment.clouds.merge import find_cloud_passes, flag_classes
    from trueterrain.core import require_writable, whole_folder
    from trueterrain.report import write_report
    from trueterrain.survey import RESULT, check_point_clouds, check_report, check_runs

    if output is not None:
        require_writable(output, force=force, inputs=inputs, replaces="folder")
    with note_compilation(), progress_bar() as progress:
        if runs:
            found = check_runs(inputs, settings, progress=progress)
        else:
            lanes = find_cloud_passes(
                inputs, split=split or None, crs=crs, only=only, progress=progress
            )
            for flag in flag_classes(lanes):
                write_note(f"warning: {flag}")
            found = check_point_clouds(lanes, settings, cell=cell, progress=progress)
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
