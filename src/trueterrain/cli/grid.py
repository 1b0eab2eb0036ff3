"""The command ``trueterrain grid``: recorded runs or points to a surface."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from trueterrain.cli._console import progress_bar, worker_threads, write_json, write_note
from trueterrain.cli._motion import process_and_note
from trueterrain.cli._options import INTEGER, flatten_settings
from trueterrain.cli._points import Classes, Returns, note_conversion, point_filter
from trueterrain.cli._recordings import kind_of_all
from trueterrain.georeference.screening import Screening
from trueterrain.motion.settings import FusionSettings
from trueterrain.surface.holes import HoleSettings
from trueterrain.surface.placement import GridPlacement
from trueterrain.surface.settings import GridSettings

if TYPE_CHECKING:
    import xarray as xr

_MAPS = (".tif", ".tiff")  # endings of grids over easting and northing

_GRID = flatten_settings("Grid", omit=["lap", "as_map"])
# omitted fields have a name or a default of their own here
_NODES = flatten_settings(
    "Heights of nodes", omit=["percent", "level", "agreed", "range_noise"], sort_key=2
)
_HOLES = Parameter(group=Group("Holes and coarser grids", sort_key=3))
_RETURNS = flatten_settings("Returns of runs", sort_key=4)
_MOTION = flatten_settings("Motion of runs", sort_key=5)
_POINTS = Parameter(group=Group("Points", sort_key=6))


def grid(
    file: Annotated[Path, Parameter(name="INPUT")],
    /,
    *more: Annotated[Path, Parameter(name="MORE")],
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    placement: Annotated[GridPlacement, _GRID] = GridPlacement(),
    cells: Annotated[GridSettings, _NODES] = GridSettings(),
    percent: Annotated[float | None, Parameter(group=_NODES.group)] = None,
    plain: Annotated[bool, Parameter(group=_NODES.group)] = False,
    range_noise: Annotated[float, Parameter(group=_NODES.group)] = 0.0005,
    fill: Annotated[float, _HOLES] = HoleSettings().largest,
    down_sample: Annotated[tuple[int, int] | None, _HOLES] = None,
    screening: Annotated[Screening, _RETURNS] = Screening(),
    begin: Annotated[float | None, Parameter(group=_MOTION.group)] = None,
    end: Annotated[float | None, Parameter(group=_MOTION.group)] = None,
    motion: Annotated[FusionSettings, _MOTION] = FusionSettings(),
    crs: Annotated[str | None, _POINTS] = None,
    classes: Annotated[Classes, _POINTS] = None,
    returns: Annotated[Returns, _POINTS] = None,
    threads: Annotated[int | None, INTEGER] = None,
    json: bool = False,
    force: bool = False,
) -> None:
    """Grid recorded runs, or points, to a surface with a standard deviation for each height.

    By default runs are gridded along the trajectory of the first one, and points over easting and
    northing; --line, --path and --bounds choose another grid. Surfaces along a line are written as
    OpenCRG (.crg), maps also as GeoTIFF (.tif); a Zarr store (.zarr) holds both, with count and
    standard deviation of each node.

    Example: `trueterrain grid run.zarr --spacing 0.01 -o road.crg`

    Parameters
    ----------
    file
        Recorded run (NAME.zarr), or points (LAS, LAZ, COPC, CSV, Parquet, NAME.zarr).
    more
        More of the same kind. Motion errors of different runs are assumed to be independent.
    output
        Surface to write: .crg, .zarr or .tif.
    percent
        Percentile of --statistic percentile [%].
    plain
        Do not correct the mean for the slope between the centroid of the returns and the node.
    range_noise
        Standard deviation of a range, or of a point without its motion error [m].
    fill
        Maximum extent of interior holes that are filled [m]; 0 for none.
    down_sample
        Numbers of nodes along and across that are combined into one, for smooth terrain; the loss
        of detail is reported.
    begin
        Navigation time from which a run is used, e.g. the start of a lap [s].
    end
        Navigation time up to which a run is used [s]; a trajectory that crosses itself cannot be
        gridded.
    crs
        Coordinate reference system of points whose files name none or a wrong one. Nothing is
        transformed, but feet are converted to metres.
    classes
        Classes of the points to use, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to use: last, first or its number; by default all.
    threads
        Number of threads; by default one for each processor. The surface does not depend on it.
    json
        Print one JSON document {"output", "size", "spacing", "nodes", "count", "sd", "sd_relative",
        "returns", "holes", "down_sample", "problems"}.
    force
        Replace the output if it exists: a file, or a surface in a store.
    """
    from trueterrain import formats
    from trueterrain.core import provenance
    from trueterrain.survey import build_surface, grid_point_files

    inputs = [file, *more]
    formats.writer_of("surface", output)
    cells = replace(
        cells,
        level=not plain,
        percent=_percentile_fraction(cells.statistic, percent),
        range_noise=range_noise,
    )
    holes = HoleSettings(largest=fill)
    placement = replace(placement, as_map=output.suffix.lower() in _MAPS)
    kind = kind_of_all(
        inputs,
        other="Convert a surface to points first: `trueterrain convert`.",
        mixed="Grid runs and points separately, or georeference the runs first.",
    )
    _check_times(begin, end, kind, inputs)
    only = point_filter(classes, returns)
    if only is not None and kind == "run":
        message = "--class and --return are for points; returns of runs: --floor, --nearest, ..."
        raise ValueError(message)
    paths = [Path(placement.path)] if placement.path else []
    formats.require_writable(output, force=force, inputs=[*inputs, *paths], kind="surface")
    workers = worker_threads(threads)
    with progress_bar() as progress:
        if kind == "run":
            surface, report = build_surface(
                [process_and_note(run, motion, begin, end) for run in inputs],
                placement,
                cells,
                holes=holes,
                down_sample=down_sample,
                screening=screening,
                threads=workers,
                progress=progress,
            )
        else:
            note_conversion(inputs, crs)
            surface, report = grid_point_files(
                inputs,
                placement,
                cells,
                holes=holes,
                down_sample=down_sample,
                crs=crs,
                only=only,
                threads=workers,
                progress=progress,
            )
    parameters: dict[str, Any] = {
        "stores": [one.name for one in inputs if one.is_dir()],
        "options": cells,
        "holes": report["holes"],
        "down_sample": report["down_sample"],
    }
    if kind == "run":
        parameters |= {"begin": begin, "end": end}
    if only is not None:
        parameters["only"] = only
    files = [one for one in inputs if one.is_file()] + paths
    surface = provenance.add_step(surface, "grid", parameters=parameters, inputs=files)
    formats.write(surface, output, force=force)
    report = _json_report(output, surface, report)
    if json:
        write_json(report)
    else:
        for text in _summary_lines(report):
            write_note(text)


def _check_times(begin: float | None, end: float | None, kind: str, inputs: list[Path]) -> None:
    if begin is None and end is None:
        return
    if kind != "run" or len(inputs) > 1:
        message = "--begin and --end are times of one run; grid it alone."
        raise ValueError(message)


def _percentile_fraction(statistic: str, percent: float | None) -> float:
    if (statistic == "percentile") != (percent is not None):
        message = "--statistic percentile and --percent need each other, e.g. --percent 85."
        raise ValueError(message)
    return 50.0 if percent is None else percent


def _json_report(output: Path, surface: "xr.Dataset", report: dict[str, Any]) -> dict[str, Any]:
    from trueterrain.surface.evaluate import summarise_surface

    known = {"output": str(output), **summarise_surface(surface), **report}
    return known | {"problems": report.get("problems", [])}


def _summary_lines(report: dict[str, Any]) -> "Iterator[str]":
    size = " x ".join(f"{n:,}" for n in report["size"].values())
    text = f"{report['output']}: {size} nodes, {report['nodes']:,} with height"
    text += f" of {report['count']['median']:.0f} returns each (median)"
    for name, what in (("sd", ""), ("sd_relative", "relative ")):
        if report[name]["median"] is not None:
            text += f", {what}standard deviation {report[name]['median'] * 1000:.3g} mm"
    yield text
    texts = {
        "outside": "returns outside the grid",
        "too_high": "returns without a height",
        "flagged": "returns flagged for their intensity",
        "scans_uncovered": "scans without motion, or at other times, left out",
        "bridged": "scans interpolated across gaps of the navigation",
    }
    for name, what in texts.items():
        if report["returns"].get(name):
            yield f"{report['returns'][name]:,} {what}"
    holes = report["holes"]
    if holes["filled_holes"]:
        yield f"{holes['filled_holes']:,} holes filled, {holes['filled_nodes']:,} nodes"
    if holes["open_holes"]:
        yield f"{holes['open_holes']:,} larger holes left open, {holes['open_nodes']:,} nodes"
    if report["down_sample"] is not None:
        loss = report["down_sample"]
        yield (
            f"coarser by {loss['rms'] * 1000:.3g} mm rms, {loss['largest'] * 1000:.3g} mm at most; "
            f"{loss['kept']:.2%} of the content is left"
        )
    yield from (f"warning: {problem}" for problem in report["problems"])
