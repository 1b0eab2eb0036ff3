"""The command ``trueterrain georeference``: recorded runs to georeferenced points."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import progress_bar, write_json, write_note
from trueterrain.cli._motion import Method, require_run, run_trajectory
from trueterrain.cli._options import INTEGER
from trueterrain.cli._points import PointCounter

if TYPE_CHECKING:
    import xarray as xr


def georeference(
    run: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    method: Method = "rts",
    crs: str | None = None,
    floor: float | None = None,
    saturation: float | None = None,
    nearest: float = 0.0,
    furthest: float | None = None,
    weight: float = 0.0,
    range_noise: float = 0.0005,
    lane: Annotated[int | None, INTEGER] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
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
    method
        Method by which the motion is estimated from navigation and accelerometers: "rts" (most
        accurate), "wiener", "zero-phase", "thesis", or "navigation" alone.
    crs
        Projected coordinate reference system of the points, e.g. EPSG:32632, with ellipsoidal
        heights; by default they stay in the local frame of the run: east, north, up from its
        origin. One whose scale error at the site exceeds 0.35 % is refused.
    floor
        Intensity below which a return is flagged [counts].
    saturation
        Intensity above which a return is flagged [counts].
    nearest
        Range below which a return is not ground [m].
    furthest
        Range above which a return is not ground [m].
    weight
        Weight of a flagged return, from 0 (rejected) to 1; a small weight increases its standard
        deviation.
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
    from trueterrain.georeference import Screening
    from trueterrain.georeference import georeference as points_of

    formats.writer_of("points", output)
    screening = Screening(
        floor=floor or 0.0,
        saturation=saturation or float("inf"),
        nearest=nearest,
        furthest=furthest or float("inf"),
        weight=weight,
    )
    if crs is not None:
        check_crs(crs)
    require_run(run)
    formats.require_writable(output, force=force, inputs=[run], kind="points")
    opened = open_run(run)
    if crs is not None:
        check_crs(crs, opened.origin)
    trajectory = run_trajectory(opened, method)
    blocks = points_of(opened, trajectory, screening=screening, range_noise=range_noise, lane=lane)
    with progress_bar() as progress:
        counted = PointCounter(blocks, progress, opened["scans"].sizes["scan"])
        points = iter(counted)
        if crs is not None:
            origin, system = opened.origin, crs
            points = (into_crs(block, origin, system) for block in iter(counted))
        formats.write(points, output, force=force)
    report = {"output": str(output), **_point_counts(counted.last)}
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
