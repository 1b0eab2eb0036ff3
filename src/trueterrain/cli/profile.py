"""The command ``trueterrain profile``: extraction of tyre profiles along a path."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from trueterrain.cli._console import note_compilation, progress_bar, write_note
from trueterrain.cli._options import INTEGER
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
from trueterrain.core.errors import CoverageError, name_file_in_errors

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.core.progress import Progress
    from trueterrain.formats import PointFilter
    from trueterrain.profile import EnvelopeSettings, PlaneCurve, SearchArea, TyreProfileSettings
    from trueterrain.profile.extract import Ground

StatisticName = Literal[
    "median",
    "mean",
    "percentile",
    "trimmed",
    "bridge",
    "idw-mean",
    "idw-median",
    "steepest",
    "point",
]

EnvelopeName = Literal["disc", "cams", "springs", "laser", "patch"]


def profile(
    surface: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    offset: float | None = None,
    line: tuple[float, float, float, float] | None = None,
    path: Path | None = None,
    spacing: float = 0.01,
    radius: float | None = None,
    patch: tuple[float, float] | None = None,
    ellipse: tuple[float, float] | None = None,
    statistic: StatisticName = "median",
    percent: float | None = None,
    skip: float | None = None,
    average: float | None = None,
    power: float | None = None,
    resolution: float | None = None,
    bandwidth: float | None = None,
    level: bool = False,
    min_count: Annotated[int, INTEGER] = 3,
    envelope: EnvelopeName | None = None,
    tyre: Literal["passenger", "truck"] | None = None,
    load: float | None = None,
    thin: Literal["error", "nan"] = "error",
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
    offset
        Path at this offset from the reference line of the surface, left positive [m].
    line
        Straight path: easting and northing of its two ends [m].
    path
        CSV file of waypoints with the columns easting and northing [m].
    spacing
        Arc length between path points [m].
    radius
        Radius of a disc as search area [m]; by default 0.025, at most 1.
    patch
        Rectangle aligned with the path as search area: length and width [m].
    ellipse
        Ellipse aligned with the path as search area: length and width [m].
    statistic
        Statistic of the heights. "trimmed" omits --skip at either end; "bridge" omits the highest
        --skip and averages the next --average; "steepest" is the most frequent height; "point"
        interpolates along the line, without a search area.
    percent
        Percentile of --statistic percentile [%].
    skip
        Fraction of the heights that trimmed and bridge omit [%]; by default 10 and 15.
    average
        Fraction of the heights that bridge averages [%]; by default 70.
    power
        Power of the inverse distance of idw-mean and idw-median; by default 2.
    resolution
        Quantisation step of the heights [m], for median and percentile: the distribution is
        interpolated between the steps.
    bandwidth
        Half width of the kernel of steepest [m]; by default from the scatter of the heights.
    level
        Remove the slope of the ground inside each search area first.
    min_count
        Minimum number of heights in a search area; one with fewer is thin.
    envelope
        Tyre model that rolls along the path instead: "disc", a rigid wheel; "cams", tandem
        elliptical cams; "springs", a deformable tyre at constant load; "laser", the bridge value of
        a line laser; "patch", the mean under the contact patch.
    tyre
        Tyre that gives size and stiffness for --envelope; by default passenger.
    load
        Vertical load for --envelope springs [N]; by default 4000 for a passenger car's tyre and
        35000 for a truck's.
    thin
        Treatment of thin search areas, or of path points without ground under the whole tyre:
        error, or NaN in the profile (CSV only).
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
    from trueterrain import formats
    from trueterrain.core import provenance
    from trueterrain.formats.point_filter import flag_of_classes
    from trueterrain.profile import EnvelopeSettings, TyreProfileSettings
    from trueterrain.profile.area import area_flag

    only = point_filter(classes, returns)
    options = TyreProfileSettings(
        statistic=statistic,
        radius=radius,
        patch=patch,
        ellipse=ellipse,
        percent=percent,
        skip=skip,
        average=average,
        power=power,
        resolution=resolution,
        bandwidth=bandwidth,
        level=level,
        min_count=min_count,
        thin=thin,
    )
    if (flag := area_flag(options.search_area())) is not None:
        write_warning(f"{flag}.")
    rolling = None
    if envelope is not None:
        if options != TyreProfileSettings(thin=thin):
            message = "--envelope rolls a tyre, so no option of a search area can be given."
            raise ValueError(message)
        rolling = EnvelopeSettings(envelope=envelope, tyre=tyre, load=load)
    elif tyre is not None or load is not None:
        message = "--tyre and --load are for --envelope."
        raise ValueError(message)
    inputs = [surface, *([path] if path else [])]
    formats.require_writable(output, force=force, inputs=inputs, kind="profile")
    written = _writer_options(output, units)
    path_options = offset, line, path
    flag = ""
    with name_file_in_errors(surface), note_compilation(), progress_bar() as progress:
        kind = formats.kind_of_file(surface)
        require_points(only, surface, kind)
        if rolling is not None and kind == "profile":
            profile_ground = _profile_as_ground(surface, path_options, crs)
            result = _extract_profile(profile_ground, None, options, rolling, progress)
        else:
            area = options.search_area()
            ground, wheel_path = _ground_and_path(surface, *path_options, spacing, area, crs, only)
            result = _extract_profile(ground, wheel_path, options, rolling, progress)
            if isinstance(ground, PointsAlong):
                flag = flag_of_classes(ground.classes)
    parameters = {} if only is None else {"only": only}
    result = provenance.add_step(result, "profile", parameters=parameters, inputs=inputs)
    formats.write(result, output, force=force, **written)
    _print_summary(result, output)
    if flag:
        write_note(f"warning: {surface}: {flag}")


def _extract_profile(
    ground: "Ground",
    path: "PlaneCurve | None",
    options: "TyreProfileSettings",
    rolling: "EnvelopeSettings | None",
    progress: "Progress",
) -> "xr.Dataset":
    """Profile by a tyre envelope, by interpolation, or by a statistic of search areas."""
    from trueterrain.profile import point_profile, tyre_envelope, tyre_profile

    if rolling is not None:
        return tyre_envelope(
            ground, path, tyre=rolling.model(), thin=options.thin, progress=progress
        )
    assert path is not None  # only a tyre envelope accepts a profile as ground
    chosen = options.estimator()
    if chosen is None:
        return point_profile(ground, path)
    return tyre_profile(
        ground,
        path,
        area=options.search_area(),
        statistic=chosen,
        level=options.level,
        min_count=options.min_count,
        thin=options.thin,
        progress=progress,
    )


def _profile_as_ground(
    path: Path, path_options: tuple[object, object, object], crs: str | None
) -> "xr.Dataset":
    """Profile along which a tyre rolls."""
    from trueterrain.geometry.crs import parse_crs

    if any(option is not None for option in path_options):
        message = "--offset, --line and --path are for surfaces; a profile is its own path."
        raise ValueError(message)
    if crs is not None:
        parse_crs(crs)
    return _open_surface(path, crs)


def _writer_options(output: Path, units: str | None) -> dict[str, str]:
    """Options of the writer; raises ValueError if the output cannot be written."""
    from trueterrain import formats

    if formats.writer_of("profile", output) == "erd":
        return {} if units is None else {"units": units}
    if units is not None:
        message = f"--units is for ERD output (.erd), got {output.suffix}; other formats are in m."
        raise ValueError(message)
    return {}


def _ground_and_path(
    surface: Path,
    offset: float | None,
    line: tuple[float, float, float, float] | None,
    path: Path | None,
    spacing: float,
    area: "SearchArea",
    crs: str | None,
    only: "PointFilter | None",
) -> "tuple[Ground, PlaneCurve]":
    """Ground and path; a point cloud is read block by block, near the path only."""
    from trueterrain import formats
    from trueterrain.formats.point_filter import classes_needed
    from trueterrain.formats.table import read_waypoints
    from trueterrain.geometry.crs import parse_crs
    from trueterrain.profile import offset_path, straight_path, waypoint_path
    from trueterrain.profile.area import area_reach

    if sum(option is not None for option in (offset, line, path)) != 1:
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
    if offset is not None:
        if kind == "points":
            raise CoverageError(
                "--offset needs a reference line, which a point cloud does not have",
                path=surface,
                cure="Name the path with --line or --path.",
            )
        ground = _open_surface(surface, crs)
        return ground, offset_path(ground, offset, spacing=spacing)
    if line is not None:
        wheel_path = straight_path(line[:2], line[2:], spacing=spacing)
    else:
        assert path is not None
        wheel_path = waypoint_path(*read_waypoints(path), spacing=spacing)
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


def _open_surface(path: Path, crs: str | None) -> "xr.Dataset":
    from trueterrain import formats

    surface = formats.open(path)
    return surface if crs is None else surface.assign_attrs(crs=crs)


def _print_summary(result: "xr.Dataset", output: Path) -> None:
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
