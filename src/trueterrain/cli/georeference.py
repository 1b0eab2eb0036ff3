"""The command ``trueterrain georeference``: recorded runs to georeferenced points."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import progress_bar, write_json, write_note
from trueterrain.cli._motion import process_and_note, require_run
from trueterrain.cli._options import INTEGER, flatten_settings
from trueterrain.georeference.screening import Screening
from trueterrain.motion.settings import FusionSettings

if TYPE_CHECKING:
    import xarray as xr


def georeference(
    run: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    crs: str | None = None,
    range_noise: float = 0.0005,
    lane: Annotated[int | None, INTEGER] = None,
    screening: Annotated[Screening, flatten_settings("Returns")] = Screening(),
    motion: Annotated[FusionSettings, flatten_settings("Motion", sort_key=2)] = FusionSettings(),
    json: bool = False,
    force: bool = False,
) -> None:
    """Convert a recorded run to points, each return with the pose at its own time.

    Pose, lever arm, boresight, beam angle and range give the position of each return. Points carry
    their true time, intensity and the standard deviation of their height. Runs of any length are
    processed block by block.

    Example: `trueterrain georeference run.zarr -o points.laz --crs EPSG:32632`

    Parameters
    ----------
    run
        Recorded run, NAME.zarr.
    output
        Points to write: .laz, .las, .csv, .parquet, or .zarr, which is lossless and fastest to
        read and write.
    crs
        Projected coordinate reference system of the points, e.g. EPSG:32632, with ellipsoidal
        heights; by default they stay in the local frame of the run: east, north, up from its
        origin. One whose scale error at the site exceeds 0.35 % is refused.
    range_noise
        Standard deviation of a range [m].
    lane
        Number that is stored as the variable lane of all points.
    json
        Print one JSON document {"output", "points", "scans", "scans_uncovered", "missing",
        "flagged", "bridged"}.
    force
        Replace the output if it exists: a file, or a store of points, a surface or a profile.
    """
    from trueterrain import formats
    from trueterrain.formats.run import open_run
    from trueterrain.geometry.topocentric import check_crs, into_crs
    from trueterrain.survey import georeference_run

    formats.writer_of("points", output)
    if crs is not None:
        check_crs(crs)
    require_run(run)
    formats.require_writable(output, force=force, inputs=[run], kind="points")
    opened = open_run(run)
    if crs is not None:
        check_crs(crs, opened.origin)
    processed = process_and_note(opened, motion)
    last: xr.Dataset | None = None

    def blocks() -> "Iterator[xr.Dataset]":
        nonlocal last
        for block in found:
            last = block
            yield block if crs is None else into_crs(block, opened.origin, crs)

    with progress_bar() as progress:
        found = georeference_run(
            processed, screening=screening, range_noise=range_noise, lane=lane, progress=progress
        )
        formats.write(blocks(), output, force=force)
    report = {"output": str(output), **_point_counts(last)}
    if json:
        write_json(report)
    else:
        write_note(_summary_text(report))


def _point_counts(last: "xr.Dataset | None") -> dict[str, int]:
    """Numbers of points and scans, from the attributes of the last block."""
    assert last is not None  # a run without scans is refused
    names = ("scans", "scans_uncovered", "missing", "flagged", "bridged")
    return {"points": last.attrs["returns"], **{name: last.attrs[name] for name in names}}


def _summary_text(report: dict[str, Any]) -> str:
    text = f"{report['output']}: {report['points']:,} points of {report['scans']:,} scans"
    for name, what in (
        ("scans_uncovered", "scans without motion left out"),
        ("missing", "beams without return"),
        ("flagged", "returns flagged for their intensity"),
        ("bridged", "points interpolated across gaps of the navigation"),
    ):
        if report[name]:
            text += f"; {report[name]:,} {what}"
    return text
