"""The command ``trueterrain grid``: recorded runs or points to a surface."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import progress_bar, worker_threads, write_json, write_note
from trueterrain.cli._motion import Method, run_trajectory
from trueterrain.cli._options import INTEGER
from trueterrain.cli._points import (
    Bounds,
    Classes,
    Returns,
    note_conversion,
    point_extent,
    point_filter,
)
from trueterrain.cli._recordings import kind_of_all
from trueterrain.core.errors import SchemaError, name_file_in_errors

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.core import Progress
    from trueterrain.formats import PointFilter
    from trueterrain.surface.grid import GridSettings
    from trueterrain.surface.placement import GridPlacement

_MAPS = (".tif", ".tiff")  # endings of grids over easting and northing


def grid(
    file: Annotated[Path, Parameter(name="INPUT")],
    /,
    *more: Annotated[Path, Parameter(name="MORE")],
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    spacing: float = 0.01,
    across: float | None = None,
    right: float = -2.0,
    left: float = 2.0,
    line: Bounds | None = None,
    path: Path | None = None,
    bounds: Bounds | None = None,
    begin: float | None = None,
    end: float | None = None,
    smoothing: float = 1.0,
    statistic: Literal["mean", "median", "percentile", "minimum", "maximum"] = "mean",
    percent: float | None = None,
    radius: float = 0.0,
    power: float = 0.0,
    plain: Annotated[bool, Parameter(negative="")] = False,
    min_count: Annotated[int, INTEGER] = 1,
    fill: float = 0.1,
    down_sample: tuple[int, int] | None = None,
    method: Method = "rts",
    floor: float | None = None,
    saturation: float | None = None,
    nearest: float = 0.0,
    furthest: float | None = None,
    weight: float = 0.0,
    range_noise: float = 0.0005,
    threads: Annotated[int | None, INTEGER] = None,
    crs: str | None = None,
    classes: Classes = None,
    returns: Returns = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
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
    spacing
        Distance between nodes [m]; along a line a multiple of 0.001.
    across
        Distance between nodes across the line, or along northing [m]; by default --spacing.
    right
        Offset of the outermost nodes to the right of a line, left positive [m].
    left
        Offset of the outermost nodes to the left [m].
    line
        Straight reference line: easting and northing of its two ends [m].
    path
        Reference line: CSV file of waypoints with the columns easting and northing [m].
    bounds
        Bounds of a map: minimum easting and northing, maximum easting and northing [m].
    begin
        Navigation time from which a run is used, e.g. the start of a lap [s].
    end
        Navigation time up to which a run is used [s]; a trajectory that crosses itself cannot be
        gridded.
    smoothing
        Standard deviation of the Gaussian that smooths the trajectory or path [m].
    statistic
        Statistic of the heights in a cell.
    percent
        Percentile of --statistic percentile [%].
    radius
        Radius of the disc around a node whose cells are averaged [m]; 0 for the cell of the node
        alone.
    power
        Power of inverse-distance weights of returns in the disc; 0 for equal weights.
    plain
        Do not correct the mean for the slope between the centroid of the returns and the node.
    min_count
        Minimum number of returns; cells with fewer have no height.
    fill
        Maximum extent of interior holes that are filled [m]; 0 for none.
    down_sample
        Numbers of nodes along and across that are combined into one, for smooth terrain; the loss
        of detail is reported.
    method
        Method by which the motion is estimated: "rts" (most accurate), "wiener", "zero-phase",
        "thesis", or "navigation" alone.
    floor
        Intensity below which a return is flagged [counts].
    saturation
        Intensity above which a return is flagged [counts].
    nearest
        Range below which a return is not ground [m].
    furthest
        Range above which a return is not ground [m].
    weight
        Weight of a flagged return, from 0 (rejected) to 1.
    range_noise
        Standard deviation of a range, or of a point without its motion error [m].
    threads
        Number of threads; by default one for each processor. The surface does not depend on it.
    crs
        Coordinate reference system of points whose files name none or a wrong one. Nothing is
        transformed, but feet are converted to metres.
    classes
        Classes of the points to use, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to use: last, first or its number; by default all.
    json
        Print one JSON document {"output", "size", "spacing", "nodes", "count", "sd", "sd_relative",
        "returns", "holes", "down_sample", "problems"}.
    force
        Replace the output if it exists: a file, or a surface in a store.
    """
    from trueterrain import formats
    from trueterrain.core import provenance
    from trueterrain.georeference import Screening
    from trueterrain.surface.grid import GridSettings
    from trueterrain.surface.holes import HoleSettings
    from trueterrain.surface.placement import GridPlacement
    from trueterrain.survey.surfaces import complete_surface

    inputs = [file, *more]
    formats.writer_of("surface", output)
    options = GridSettings(
        statistic=statistic,
        level=not plain,
        min_count=min_count,
        range_noise=range_noise,
        percent=_percentile_fraction(statistic, percent),
        radius=radius,
        power=power,
    )
    screening = Screening(
        floor=floor or 0.0,
        saturation=saturation or float("inf"),
        nearest=nearest,
        furthest=furthest or float("inf"),
        weight=weight,
    )
    placement = GridPlacement(
        spacing=spacing,
        across=across,
        right=right,
        left=left,
        line=line,
        path=None if path is None else str(path),
        bounds=bounds,
        smoothing=smoothing,
        as_map=output.suffix.lower() in _MAPS,
    )
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
    formats.require_writable(
        output, force=force, inputs=[*inputs, *([path] if path else [])], kind="surface"
    )
    workers = worker_threads(threads)
    with progress_bar() as progress:
        if kind == "run":
            from trueterrain.formats.run import open_run
            from trueterrain.surface.runs import PassRecord, grid_runs

            passes = [
                PassRecord(run=run, trajectory=run_trajectory(run, method, begin, end))
                for run in map(open_run, inputs)
            ]
            surface, counts = grid_runs(
                passes,
                placement.of_runs(passes),
                options,
                screening=screening,
                threads=workers,
                progress=progress,
            )
        else:
            surface, counts = _grid_points(inputs, placement, options, crs, only, workers, progress)
    surface, completed = complete_surface(surface, HoleSettings(largest=fill), down_sample)
    holes, loss = completed["holes"], completed["down_sample"]
    files = [one for one in inputs if one.is_file()] + ([path] if path else [])
    stores = [one.name for one in inputs if one.is_dir()]
    parameters = {"stores": stores, "options": options, "holes": holes, "down_sample": loss}
    if kind == "run":
        parameters |= {"begin": begin, "end": end}
    if only is not None:
        parameters["only"] = only
    surface = provenance.add_step(surface, "grid", parameters=parameters, inputs=files)
    formats.write(surface, output, force=force)
    problems = counts.pop("problems", [])
    report = _json_report(output, surface, counts, holes, loss) | {"problems": problems}
    if json:
        write_json(report)
    else:
        for text in _summary_lines(report):
            write_note(text)


def _grid_points(
    files: list[Path],
    placement: "GridPlacement",
    options: "GridSettings",
    crs: str | None,
    only: "PointFilter | None",
    threads: int,
    progress: "Progress",
) -> "tuple[xr.Dataset, dict[str, Any]]":
    from trueterrain.formats.point_filter import flag_of_classes
    from trueterrain.geometry.crs import parse_crs
    from trueterrain.surface.grid import grid_points

    if crs is not None:
        parse_crs(crs)
    note_conversion(files, crs)
    blocks = _PointBlocks(files, crs, only, progress)
    extents = [point_extent(file, crs) for file in files]
    surface = grid_points(blocks, placement.of_points(extents), options, threads=threads)
    outside = int(surface.attrs.pop("outside"))
    flag = flag_of_classes(blocks.counts.classes)
    counts = {"used": blocks.points - outside, "outside": outside}
    return surface, counts | {"problems": [flag] if flag else []}


def _check_times(begin: float | None, end: float | None, kind: str, inputs: list[Path]) -> None:
    if begin is None and end is None:
        return
    if kind != "run" or len(inputs) > 1:
        message = "--begin and --end are times of one run; grid it alone."
        raise ValueError(message)


class _PointBlocks:
    """Blocks of points of files; can be iterated repeatedly."""

    def __init__(
        self, files: list[Path], crs: str | None, only: "PointFilter | None", progress: "Progress"
    ) -> None:
        from trueterrain.formats.point_filter import ReturnCounts, classes_needed

        self._files = files
        self._crs = crs
        self._only = only
        self._variables = ("sd", *classes_needed(only))
        self._progress = progress
        self.points = 0
        self.counts = ReturnCounts()

    def __iter__(self) -> "Iterator[xr.Dataset]":
        from trueterrain import formats
        from trueterrain.formats.point_filter import ReturnCounts

        self.points, self.counts = 0, ReturnCounts()
        first: str | None = None
        for file in self._files:
            with name_file_in_errors(file):
                for block in formats.point_blocks(
                    file, crs=self._crs, variables=self._variables, only=self._only
                ):
                    found = str(block.attrs.get("crs", ""))
                    first = found if first is None else first
                    if found != first:
                        raise SchemaError(
                            f"all points must have the same CRS, got {found[:40]!r} after "
                            f"{first[:40]!r} of {self._files[0].name}",
                            cure="Transform them first, or name the CRS of all: --crs.",
                        )
                    yield block
                    self.points += block.sizes["point"]
                    self.counts.add(block)
                    self._progress(f"{self.points:,} points", 0, None)


def _percentile_fraction(statistic: str, percent: float | None) -> float:
    if (statistic == "percentile") != (percent is not None):
        message = "--statistic percentile and --percent need each other, e.g. --percent 85."
        raise ValueError(message)
    return 50.0 if percent is None else percent


def _json_report(
    output: Path,
    surface: "xr.Dataset",
    counts: dict[str, Any],
    holes: dict[str, Any],
    loss: dict[str, float] | None,
) -> dict[str, Any]:
    from trueterrain.surface.evaluate import summarise_surface

    return {
        "output": str(output),
        **summarise_surface(surface),
        "returns": counts,
        "holes": holes,
        "down_sample": loss,
    }


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
