"""The command ``trueterrain profile``: extraction of tyre profiles along a path."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import xarray as xr
from cyclopts import Group, Parameter

from trueterrain import formats
from trueterrain.cli._console import note_compilation, progress_bar, write_note
from trueterrain.cli._options import flatten_settings
from trueterrain.cli._points import (
    Classes,
    PointsAlong,
    Returns,
    note_conversion,
    point_filter,
    require_points,
)
from trueterrain.cli._profiles import write_warning
from trueterrain.cli._recordings import refuse_recording
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, name_file_in_errors
from trueterrain.formats import PointFilter
from trueterrain.formats.point_filter import classes_needed, flag_of_classes
from trueterrain.formats.table import read_waypoints
from trueterrain.geometry.crs import parse_crs
from trueterrain.profile import (
    EnvelopeSettings,
    PlaneCurve,
    SearchArea,
    TyreProfileSettings,
    offset_path,
    straight_path,
    waypoint_path,
)
from trueterrain.profile.area import area_flag, area_reach
from trueterrain.profile.envelope import TyreName
from trueterrain.profile.extract import Ground
from trueterrain.profile.settings import EnvelopeName, take_profile

_TYRE_MODEL = Parameter(group=Group("Tyre model", sort_key=3))


@dataclass(frozen=True, kw_only=True)
class _PathRequest:
    """Path along which the profile is taken."""

    offset: float | None = None
    "Path at this offset from the reference line of the surface, left positive [m]."

    line: tuple[float, float, float, float] | None = None
    "Straight path: easting and northing of its two ends [m]."

    path: Path | None = None
    "CSV file of waypoints with the columns easting and northing [m]."

    spacing: float = 0.01
    "Arc length between path points [m]."

    def count_paths(self) -> int:
        """Number of paths that are given."""
        return sum(one is not None for one in (self.offset, self.line, self.path))


def profile(
    surface: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    along: Annotated[_PathRequest, flatten_settings("Path")] = _PathRequest(),
    settings: Annotated[
        TyreProfileSettings, flatten_settings("Search area and statistic", sort_key=2)
    ] = TyreProfileSettings(),
    envelope: Annotated[EnvelopeName | None, _TYRE_MODEL] = None,
    tyre: Annotated[TyreName | None, _TYRE_MODEL] = None,
    load: Annotated[float | None, _TYRE_MODEL] = None,
    units: Literal["m", "mm", "ft", "in"] | None = None,
    crs: str | None = None,
    classes: Classes = None,
    returns: Returns = None,
    force: bool = False,
) -> None:
    """Extract the profile that a tyre feels along a path.

    Each height is a statistic of the ground inside a search area around a path point, or, with
    --envelope, the height of a tyre model that rolls along the path. Exactly one of --offset,
    --line and --path gives the path; a tyre model also rolls along a profile, without any of them.

    Example: `trueterrain profile belgian_block.crg --offset 0.3 -o p.erd`

    Parameters
    ----------
    surface
        Surface (OpenCRG, GeoTIFF, Zarr) or point cloud (LAS, LAZ, COPC, CSV, Parquet, Zarr); with
        --envelope a surface or a profile (ERD, CSV).
    output
        Profile to write: .erd or .csv (.parquet, .zarr).
    envelope
        Tyre model that rolls along the path instead: "disc", a rigid wheel; "cams", tandem
        elliptical cams; "springs", a deformable tyre at constant load; "laser", the bridge value of
        a line laser; "patch", the mean under the contact patch.
    tyre
        Tyre that gives size and stiffness for --envelope; by default passenger.
    load
        Vertical load for --envelope springs [N]; by default 4000 for a passenger car's tyre and
        35000 for a truck's.
    units
        Unit of the heights in an ERD file; by default m.
    crs
        Coordinate reference system of the ground, e.g. EPSG:25832, if its file names none or a
        wrong one. Nothing is transformed, but feet of a point cloud are converted to metres.
    classes
        Classes of the points to use, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to use: last, first or its number; by default all.
    force
        Replace the output if it exists.
    """
    only = point_filter(classes, returns)
    if (flag := area_flag(settings.search_area())) is not None:
        write_warning(f"{flag}.")
    rolling = None
    if envelope is not None:
        if settings != TyreProfileSettings(thin=settings.thin):
            message = "--envelope rolls a tyre, so no option of a search area can be given."
            raise ValueError(message)
        rolling = EnvelopeSettings(envelope=envelope, tyre=tyre, load=load)
    elif tyre is not None or load is not None:
        message = "--tyre and --load are for --envelope."
        raise ValueError(message)
    inputs = [surface, *([along.path] if along.path else [])]
    formats.require_writable(output, force=force, inputs=inputs, kind="profile")
    written = _writer_options(output, units)
    flag = ""
    with name_file_in_errors(surface), note_compilation(), progress_bar() as progress:
        kind = formats.kind_of_file(surface)
        require_points(only, surface, kind)
        ground: Ground
        if rolling is not None and kind == "profile":
            ground, path = _profile_as_ground(surface, along, crs), None
        else:
            ground, path = _ground_and_path(surface, along, settings.search_area(), crs, only)
        result = take_profile(ground, path, settings, envelope=rolling, progress=progress)
        if isinstance(ground, PointsAlong):
            flag = flag_of_classes(ground.classes)
    parameters = {} if only is None else {"only": only}
    result = provenance.add_step(result, "profile", parameters=parameters, inputs=inputs)
    formats.write(result, output, force=force, **written)
    _print_summary(result, output)
    if flag:
        write_note(f"warning: {surface}: {flag}")


def _profile_as_ground(path: Path, along: _PathRequest, crs: str | None) -> xr.Dataset:
    """Profile along which a tyre rolls."""
    if along.count_paths() > 0:
        message = "--offset, --line and --path are for surfaces; a profile is its own path."
        raise ValueError(message)
    if crs is not None:
        parse_crs(crs)
    return _open_surface(path, crs)


def _writer_options(output: Path, units: str | None) -> dict[str, str]:
    """Options of the writer; raises ValueError if the output cannot be written."""
    if formats.writer_of("profile", output) == "erd":
        return {} if units is None else {"units": units}
    if units is not None:
        message = f"--units is for ERD output (.erd), got {output.suffix}; other formats are in m."
        raise ValueError(message)
    return {}


def _ground_and_path(
    surface: Path,
    along: _PathRequest,
    area: SearchArea,
    crs: str | None,
    only: PointFilter | None,
) -> tuple[Ground, PlaneCurve]:
    """Ground and path; a point cloud is read block by block, near the path only."""
    if along.count_paths() != 1:
        message = "name the path with exactly one of --offset, --line and --path."
        raise ValueError(message)
    kind = formats.kind_of_file(surface)
    refuse_recording(surface, kind, "a surface or a point cloud")
    if kind == "profile":
        raise CoverageError(
            "is a profile already",
            path=surface,
            cure="Give a surface or a point cloud, or roll a tyre along the profile with "
            "--envelope.",
        )
    if crs is not None:
        parse_crs(crs)
    if along.offset is not None:
        if kind == "points":
            raise CoverageError(
                "--offset needs a reference line, which a point cloud does not have",
                path=surface,
                cure="Name the path with --line or --path.",
            )
        ground = _open_surface(surface, crs)
        return ground, offset_path(ground, along.offset, spacing=along.spacing)
    if along.line is not None:
        wheel_path = straight_path(along.line[:2], along.line[2:], spacing=along.spacing)
    else:
        assert along.path is not None
        wheel_path = waypoint_path(*read_waypoints(along.path), spacing=along.spacing)
    if kind == "surface":
        return _open_surface(surface, crs), wheel_path
    margin = area_reach(area)
    bounds = (
        wheel_path.easting.min() - margin,
        wheel_path.northing.min() - margin,
        wheel_path.easting.max() + margin,
        wheel_path.northing.max() + margin,
    )
    note_conversion([surface], crs)
    blocks = formats.point_blocks(
        surface, bounds=bounds, crs=crs, variables=classes_needed(only), only=only
    )
    return PointsAlong(blocks, wheel_path, margin), wheel_path


def _open_surface(path: Path, crs: str | None) -> xr.Dataset:
    surface = formats.open(path)
    return surface if crs is None else surface.assign_attrs(crs=crs)


def _print_summary(result: xr.Dataset, output: Path) -> None:
    s = result.s.values
    text = f"{output}: {s.size:,} points over {s[-1]:.2f} m every {s[1] - s[0]:g} m"
    if "count" in result:
        counts = result["count"]
        text += f", {int(counts.min())} to {int(counts.max())} heights each"
    if result.attrs.get("thin"):
        envelope = "held" in result.attrs
        what = "points with too little ground under the tyre" if envelope else "thin search areas"
        text += f"; {result.attrs['thin']} {what} are NaN"
    if result.attrs.get("held"):
        text += (
            f"; at {result.attrs['held']} points the tyre reaches beyond the ends of the ground, "
            "whose heights are held"
        )
    write_note(text)
