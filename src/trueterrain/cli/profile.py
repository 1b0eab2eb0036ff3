"""The command ``trueterrain profile``: from ground to the profile that a tyre feels."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from trueterrain.cli._console import compiling_noted, progress_bar, write_note
from trueterrain.cli._numbers import WHOLE
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
    from trueterrain.profile import EnvelopeSettings, SearchArea, TyreProfileSettings, WheelPath
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
    min_count: Annotated[int, WHOLE] = 3,
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

    Around each path point a statistic of the heights inside a search area is taken, or with
    --envelope a tyre rolls along the path. Name the path with exactly one of --offset, --line and
    --path; a tyre also rolls along a profile, which is a path of its own.

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
        Radius of the disc that is searched around each path point [m]; by default 0.025, at most 1.
    patch
        Search a rectangle aligned with the path instead: length and width [m].
    ellipse
        Search an ellipse aligned with the path instead: length and width [m].
    statistic
        What is taken of the heights. "trimmed" leaves out --skip at either end; "bridge" leaves
        out the highest --skip and averages the next --average; "steepest" is the most frequent
        height; "point" is the bare line, without a search area.
    percent
        Percentile to take, with --statistic percentile [%].
    skip
        Share of the heights that trimmed and bridge leave out [%]; by default 10 and 15.
    average
        Share of the heights that bridge averages [%]; by default 70.
    power
        Power of the inverse distance of idw-mean and idw-median; by default 2.
    resolution
        Step of quantised heights [m], with median and percentile: continues the distribution
        between the steps.
    bandwidth
        Half width of the kernel of steepest [m]; by default from the scatter of the heights.
    level
        Take the slope of the ground inside each search area out first.
    min_count
        Search areas with fewer heights are thin.
    envelope
        Roll a tyre along the path instead: "disc", a rigid wheel; "cams", tandem elliptical cams;
        "springs", a deformable tyre at constant load; "laser", the bridge value of a line laser;
        "patch", the mean under the contact patch.
    tyre
        Whose size and stiffness --envelope takes; by default passenger.
    load
        Vertical load that --envelope springs carries [N]; by default 4000 for a passenger car's
        tyre and 35000 for a truck's.
    thin
        Whether thin search areas, or path points without ground under all of the tyre, are an
        error or become NaN (CSV only).
    units
        Unit of the heights in an ERD file; by default m.
    crs
        Coordinate reference system of the ground, e.g. EPSG:25832, if its file names none or a
        wrong one. Nothing is transformed, but feet of a point cloud become metres.
    classes
        Classes of the points to take, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to take of the points: last, first or its number; by default all.
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
    ways = offset, line, path
    flag = ""
    with name_file_in_errors(surface), compiling_noted(), progress_bar() as progress:
        kind = formats.kind_of_file(surface)
        require_points(only, surface, kind)
        if rolling is not None and kind == "profile":
            on_line = _profile_as_ground(surface, ways, crs)
            result = _extract_profile(on_line, None, options, rolling, progress)
        else:
            area = options.search_area()
            ground, travelled = _ground_and_path(surface, *ways, spacing, area, crs, only)
            result = _extract_profile(ground, travelled, options, rolling, progress)
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
    path: "WheelPath | None",
    options: "TyreProfileSettings",
    rolling: "EnvelopeSettings | None",
    progress: "Progress",
) -> "xr.Dataset":
    """Profile by what was asked for."""
    from trueterrain.profile import point_profile, tyre_envelope, tyre_profile

    if rolling is not None:
        return tyre_envelope(
            ground, path, tyre=rolling.model(), thin=options.thin, progress=progress
        )
    assert path is not None  # a profile is refused as ground of anything that does not roll
    taken = options.estimator()
    if taken is None:
        return point_profile(ground, path)
    return tyre_profile(
        ground,
        path,
        area=options.search_area(),
        statistic=taken,
        level=options.level,
        min_count=options.min_count,
        thin=options.thin,
        progress=progress,
    )


def _profile_as_ground(
    path: Path, ways: tuple[object, object, object], crs: str | None
) -> "xr.Dataset":
    """Read the profile that a tyre shall roll along."""
    from trueterrain.geometry.crs import parse_crs

    if any(way is not None for way in ways):
        message = "a profile is a path of its own: --offset, --line and --path are for surfaces."
        raise ValueError(message)
    if crs is not None:
        parse_crs(crs)
    return _open_surface(path, crs)


def _writer_options(output: Path, units: str | None) -> dict[str, str]:
    """Options of writing, if the output can be written at all."""
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
) -> "tuple[Ground, WheelPath]":
    """Read the ground and lay the path over it; a cloud stays on disk until it is needed."""
    from trueterrain import formats
    from trueterrain.formats.point_filter import classes_needed
    from trueterrain.formats.table import read_waypoints
    from trueterrain.geometry.crs import parse_crs
    from trueterrain.profile import offset_path, straight_path, waypoint_path
    from trueterrain.profile.area import area_reach

    if sum(way is not None for way in (offset, line, path)) != 1:
        message = "name the path with exactly one of --offset, --line and --path."
        raise ValueError(message)
    kind = formats.kind_of_file(surface)
    refuse_recording(surface, kind, "a surface or a point cloud")
    if kind == "profile":
        raise CoverageError(
            "is a profile already",
            path=surface,
            cure="Give the surface or the point cloud that it shall be taken from, or roll a tyre "
            "along it with --envelope.",
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
        travelled = straight_path(line[:2], line[2:], spacing=spacing)
    else:
        assert path is not None
        travelled = waypoint_path(*read_waypoints(path), spacing=spacing)
    if kind == "surface":
        return _open_surface(surface, crs), travelled
    margin = area_reach(area)
    bounds = (
        travelled.easting.min() - margin,
        travelled.northing.min() - margin,
        travelled.easting.max() + margin,
        travelled.northing.max() + margin,
    )
    note_conversion([surface], crs)
    blocks = formats.point_blocks(
        surface, bounds=bounds, crs=crs, variables=classes_needed(only), only=only
    )
    return PointsAlong(blocks, travelled, margin), travelled


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
        rolled = "held" in result.attrs
        what = "points with too little ground under the tyre" if rolled else "thin search areas"
        text += f"; {result.attrs['thin']} {what} are NaN"
    if result.attrs.get("held"):
        text += (
            f"; at {result.attrs['held']} points the tyre reaches beyond the ends of the ground, "
            "whose heights are held"
        )
    write_note(text)
