"""Point clouds merged: corrected clouds, one surface, and a report."""

import json
from collections.abc import Sequence
from pathlib import Path

from trueterrain import formats
from trueterrain._version import __version__
from trueterrain.alignment.clouds.merge import (
    CloudPass,
    CorrectedClouds,
    find_cloud_passes,
    merge_clouds,
    merged_surface,
    suggested_cell,
    with_cells,
)
from trueterrain.alignment.merge import MergeResult, MergeSettings
from trueterrain.core import no_progress, provenance, whole_folder
from trueterrain.core.json_values import json_values
from trueterrain.core.progress import Progress
from trueterrain.formats import PointFilter
from trueterrain.report import (
    File,
    Files,
    Picture,
    Report,
    Section,
    SurfaceView,
    Table,
    Warnings,
    write_report,
)
from trueterrain.surface.evaluate import summarise_surface
from trueterrain.surface.grid import GridSettings, trim_surface
from trueterrain.surface.placement import GridPlacement
from trueterrain.survey._chain import REPORTED, RESULT, SurveyResult
from trueterrain.survey._pictures import Pictures
from trueterrain.survey._report_merge import merge_headline, merge_section
from trueterrain.survey._report_parts import parse_columns, to_millimetres

_SURFACE = "merged"


def merge_point_clouds(
    files: Sequence[str | Path],
    folder: str | Path,
    settings: MergeSettings = MergeSettings(),
    *,
    split: bool | None = None,
    crs: str | None = None,
    only: PointFilter | None = None,
    cell: float | None = None,
    spacing: float | None = None,
    force: bool = False,
    threads: int = 1,
    progress: Progress = no_progress,
) -> SurveyResult:
    """Bring point clouds into agreement, and write them, their surface and a report.

    Parameters
    ----------
    files : sequence of str or Path
        Points: each file is a pass, or one file is split by its point source ids.
    folder : str or Path
        Folder for the files.
    settings : MergeSettings
        Method and parameters of the adjustment.
    split : bool, optional
        Whether each point source ID is a pass; by default if there is one file.
    crs : str, optional
        Coordinate reference system, if files name none or a wrong one.
    only : PointFilter, optional
        Which points are used; by default all.
    cell : float, optional
        Size of the cells in which passes are compared [m]; by default by the density of the points.
    spacing : float, optional
        Spacing of the surface [m]; by default that of the cells.
    force : bool
        Replace an earlier result in the folder; other files in it stay.
    threads : int
        Threads that grid at once.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    SurveyResult
        Files and numbers.

    Raises
    ------
    CoverageError
        If passes do not overlap.
    SchemaError
        If they have different coordinate reference systems.
    FormatError
        If a file is damaged.
    OutputError
        If the folder is not empty and `force` is false, or as by `whole_folder`.
    """
    lanes = find_cloud_passes(files, split=split, crs=crs, only=only, progress=progress)
    settings = with_cells(settings, cell or suggested_cell(lanes))
    others = [path for path in (settings.path, settings.control) if path]
    with whole_folder(
        folder, result=RESULT, force=force, inputs=[*files, *others], names=REPORTED
    ) as temporary:
        merging, corrected = merge_clouds(lanes, settings, progress=progress)
        pictures = Pictures(temporary)
        pictures.of_merging(merging, [], settings.cells.size)
        written = [*_write_clouds(corrected, temporary, progress)]
        progress("surface", 0, None)
        placement = GridPlacement(spacing=spacing or settings.cells.size)
        grid = placement.of_points([one.cloud.extent for one in corrected.values()])
        surface = trim_surface(merged_surface(corrected, grid, GridSettings(), threads=threads))
        formats.write(surface, temporary / f"{_SURFACE}.tif")
        written.append((f"{_SURFACE}.tif", "the merged surface"))
        pictures.of_surface(_SURFACE, surface)
        numbers = json_values(
            {
                "version": __version__,
                "lanes": {
                    name: {"points": lane.count, "area": lane.area, "time": lane.time}
                    for name, lane in lanes.items()
                },
                "cell": settings.cells.size,
                "surface": summarise_surface(surface),
                "merge": merging.to_dict(),
            }
        )
        (temporary / "result.json").write_text(
            json.dumps(numbers, indent=2, allow_nan=False) + "\n"
        )
        view = SurfaceView(surface=surface, caption="The merged surface.")
        report = _merge_report(lanes, merging, pictures, view, [*written, *pictures.files])
        write_report(report, temporary / "report.html")
        pictures.close()
        names = tuple(sorted(file.name for file in temporary.iterdir()))
    return SurveyResult(folder=Path(folder), files=names, numbers=numbers)


def _write_clouds(
    corrected: CorrectedClouds, folder: Path, progress: Progress
) -> Sequence[tuple[str, str]]:
    found = []
    for number, (name, blocks) in enumerate(corrected.items()):
        progress("corrected clouds", number, len(corrected))
        file = f"{name}.laz"
        formats.write(iter(blocks()), folder / file)
        found.append((file, f"points of {name}, corrected"))
    return found


def _merge_report(
    lanes: dict[str, CloudPass],
    merging: MergeResult,
    pictures: Pictures,
    view: SurfaceView,
    files: Sequence[tuple[str, str]],
) -> Report:
    numbers = summarise_surface(view.surface)
    ground = Table(
        columns=parse_columns(
            "Nodes; Returns per node .0; sd, median [mm] .2; sd, 95 % [mm] .2; "
            "sd relative, median [mm] .2; sd relative, 95 % [mm] .2"
        ),
        rows=[
            (
                numbers["nodes"],
                numbers["count"]["median"],
                *(
                    to_millimetres(numbers[name][which])
                    for name in ("sd", "sd_relative")
                    for which in ("median", "p95")
                ),
            )
        ],
        caption="The merged surface. The relative standard deviation includes the scatter of the "
        "points and the uncertainty of the corrections; the absolute one also includes the height "
        "error common to all passes, and is empty if that is unknown.",
    )
    inputs = Table(
        columns=parse_columns("Pass; Points; Area [m²] .0; Points per m² .1"),
        rows=[(name, lane.count, lane.area, lane.density) for name, lane in lanes.items()],
        caption="The passes.",
    )
    flat = Picture(
        figure=pictures.figures[_SURFACE, "surface"],
        alt="Heights of the merged surface, seen from above",
        caption="The merged surface.",
    )
    flagged = [Section(title="What is flagged", blocks=[Warnings(items=merging.problems)])]
    listed = [File(path=name, note=note) for name, note in files]
    listed.append(File(path="result.json", note="all numbers of this report"))
    return Report(
        title="Merged passes",
        subtitle=", ".join(lanes),
        headline=tuple(merge_headline(merging)),
        sections=(
            *(flagged if merging.problems else []),
            merge_section(merging, pictures),
            Section(title="The ground", blocks=[ground, view, flat]),
            Section(title="Input", blocks=[inputs]),
            Section(title="Files", blocks=[Files(files=listed)]),
        ),
        provenance={_SURFACE: provenance.provenance_steps(view.surface)},
    )
