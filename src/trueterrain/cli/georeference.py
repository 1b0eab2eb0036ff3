"""The command ``trueterrain georeference``: from a recorded run to points."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from trueterrain.cli._console import out_json, progress_bar, write_note
from trueterrain.cli._motion import Method, motion_of, require_run
from trueterrain.cli._numbers import WHOLE

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.core import Progress


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
    lane: Annotated[int | None, WHOLE] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
    force: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Turn a recorded run into points: every return at its own time.

    Pose, lever arm, boresight, beam and range together give each point, with its true time, its
    intensity and the standard deviation of its height. Runs of any length are worked through block
    by block.

    Example: `trueterrain georeference run.zarr -o points.laz --crs EPSG:32632`

    Parameters
    ----------
    run
        Recorded run, NAME.zarr.
    output
        Points to write: .laz, .las, .csv, .parquet, or .zarr, which keeps every bit and is read
        and written fastest.
    method
        How the motion is found from navigation and accelerometers: "rts" (the best), "wiener",
        "zero-phase", "thesis", or "navigation" alone.
    crs
        Projected system of the points, e.g. EPSG:32632, with ellipsoidal heights; by default they
        stay in the local frame of the run: east, north, up of its origin. One that changes lengths
        by more than 0.35 % at the place is refused.
    floor
        Intensity under which a return is flagged [counts].
    saturation
        Intensity above which a return is flagged [counts].
    nearest
        Range under which a return is no ground [m].
    furthest
        Range beyond which a return is no ground [m].
    weight
        Weight of a flagged return, 0 (rejected) to 1: its standard deviation grows.
    range_noise
        Standard deviation of a range [m].
    lane
        Number that all points get as their lane.
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
    tree = open_run(run)
    if crs is not None:
        check_crs(crs, tree.attrs["origin"])
    trajectory = motion_of(run, method)
    blocks = points_of(run, trajectory, screening=screening, range_noise=range_noise, lane=lane)
    with progress_bar() as progress:
        counted = _PointCounter(blocks, tree["scans"].sizes["scan"], progress)
        points = iter(counted)
        if crs is not None:
            origin, system = tree.attrs["origin"], crs
            points = (into_crs(block, origin, system) for block in iter(counted))
        formats.write(points, output, force=force)
    report = {"output": str(output), **counted.report()}
    if json:
        out_json(report)
    else:
        write_note(_in_words(report))


class _PointCounter:
    """Counts the points that pass and shows them."""

    def __init__(self, blocks: "Iterator[xr.Dataset]", scans: int, progress: "Progress") -> None:
        self._blocks = blocks
        self._scans = scans
        self._progress = progress
        self._attrs: dict[Any, Any] = {}

    def __iter__(self) -> "Iterator[xr.Dataset]":
        for block in self._blocks:
            yield block
            self._attrs = block.attrs
            self._progress(f"{block.attrs['returns']:,} points", block.attrs["scans"], self._scans)

    def report(self) -> dict[str, Any]:
        """How many there were."""
        names = ("scans", "scans_uncovered", "missing", "flagged", "bridged")
        return {"points": self._attrs["returns"], **{name: self._attrs[name] for name in names}}


def _in_words(report: dict[str, Any]) -> str:
    text = f"{report['output']}: {report['points']:,} points of {report['scans']:,} scans"
    for name, words in (
        ("scans_uncovered", "scans without motion left out"),
        ("missing", "beams without return"),
        ("flagged", "returns flagged for their intensity"),
        ("bridged", "points at times that navigation did not see"),
    ):
        if report[name]:
            text += f"; {report[name]:,} {words}"
    return text
