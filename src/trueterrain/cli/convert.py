"""The command ``trueterrain convert``: conversion between file formats."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from trueterrain.cli._console import note_omissions, progress_bar, write_note
from trueterrain.cli._points import (
    Classes,
    PointCounter,
    Returns,
    note_conversion,
    point_filter,
    require_points,
)
from trueterrain.cli._profiles import write_warning
from trueterrain.cli._recordings import refuse_recording
from trueterrain.core.errors import name_file_in_errors

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.formats import PointFilter

_SURFACES = (".crg", ".tif", ".tiff")
_PROFILES = (".erd",)
_CLOUDS = (".laz", ".las")
_TABLES = (".csv", ".parquet")
_STORES = (".zarr",)
_MAX_COARSENING = 1.5  # ratio of new to old spacing above which aliasing is warned of
_KNOWN = (*_SURFACES, *_PROFILES, *_CLOUDS, *_TABLES, *_STORES)


def convert(
    source: Annotated[Path, Parameter(name="INPUT")],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    units: Literal["m", "mm", "ft", "in"] | None = None,
    crs: str | None = None,
    scale: float | None = None,
    spacing: float | None = None,
    classes: Classes = None,
    returns: Returns = None,
    force: bool = False,
) -> None:
    """Convert surfaces, points and profiles between file formats.

    Surfaces are converted to surfaces (.crg, .tif, .zarr) or to points (.laz, .las, .csv,
    .parquet: the nodes), points to points (also .zarr), profiles to profiles (.erd, .csv, .parquet,
    .zarr). Points are converted block by block, whatever their number. A Zarr store (.zarr) keeps
    all variables and attributes.

    Example: trueterrain convert belgian_block.crg -o belgian_block.laz

    Parameters
    ----------
    source
        OpenCRG, GeoTIFF, LAS, LAZ, COPC, ERD, CSV or Parquet file, or NAME.zarr; the format
        is recognised by the content.
    output
        File or store to write; its ending determines the format.
    units
        Unit of the heights in an ERD file; by default m.
    crs
        Coordinate reference system of the input, e.g. EPSG:25832, if its file names none or a
        wrong one. Nothing is transformed, but feet of a point cloud are converted to metres.
    scale
        Step to which coordinates in LAS and LAZ files are rounded [m], at most 0.1; by default
        0.0001, or the step of the input where that is finer or not a multiple of 0.0001.
    spacing
        Profiles: sample spacing of the output, from the first sample on, by linear interpolation
        [m]; by default that of the input. Remove waves shorter than twice the spacing first:
        trueterrain filter.
    classes
        Classes of the points to use, e.g. 2,11 (ground and road surface); by default all.
    returns
        Return of each pulse to use: last, first or its number; by default all.
    force
        Replace the output if it exists: a file, or a store of the same kind of data.
    """
    from trueterrain import formats
    from trueterrain.geometry.crs import parse_crs

    ending = output.suffix.lower()
    kind = formats.kind_of_file(source)
    refuse_recording(source, kind, "a surface, points or a profile")
    _check_conversion(source, kind, output, ending)
    options = _writer_options(ending, units, scale)
    if spacing is not None and kind != "profile":
        message = f"--spacing is for profiles, got {source}, which holds {kind}."
        raise ValueError(message)
    only = point_filter(classes, returns)
    require_points(only, source, kind)
    if crs is not None:
        parse_crs(crs)
    formats.require_writable(output, force=force, inputs=[source], kind=kind)

    def write(data: Any) -> Any:
        return formats.write(data, output, force=force, **options)

    if kind == "points":
        _convert_points(source, output, crs, only, write)
        return
    data = formats.open(source)
    data = data if crs is None else data.assign_attrs(crs=crs)
    if kind == "profile":
        _convert_profile(
            data if spacing is None else _resample_profile(data, spacing, source), output, write
        )
    elif ending in (*_SURFACES, *_STORES):
        _convert_surface(data, output, write)
    else:
        from trueterrain.surface.evaluate import surface_to_points

        points = surface_to_points(data)
        write(points)
        missing = int(data.height.size) - points.sizes["point"]
        without = f", {missing:,} nodes without height left out" if missing else ""
        write_note(f"{output}: {points.sizes['point']:,} points{without}")
        note_omissions(points, output)


def _convert_points(
    source: Path,
    output: Path,
    crs: str | None,
    only: "PointFilter | None",
    write: Callable[[Any], Any],
) -> None:
    from trueterrain import formats

    note_conversion([source], crs)
    with progress_bar() as progress:
        counted = PointCounter(formats.point_blocks(source, crs=crs, only=only), progress)
        write(iter(counted))
    write_note(f"{output}: {counted.points:,} points")
    if counted.last is not None:
        note_omissions(counted.last, output)


def _convert_profile(profile: "xr.Dataset", output: Path, write: Callable[[Any], Any]) -> None:
    from trueterrain.core.schemas import ASSUMED

    if ASSUMED in profile.attrs:
        write_warning(f"its file {profile.attrs[ASSUMED]}.")
    write(profile)
    tracks = profile.sizes.get("track", 1)
    several = f" of {tracks} tracks" if tracks > 1 else ""
    s = profile.s.values
    write_note(f"{output}: {s.size:,} samples{several} from {s[0]:g} to {s[-1]:g} m")
    note_omissions(profile, output)


def _resample_profile(profile: "xr.Dataset", spacing: float, source: Path) -> "xr.Dataset":
    import numpy as np

    from trueterrain.roughness import resample_profile

    with name_file_in_errors(source):
        resampled = resample_profile(profile, spacing)
    old = float(np.median(np.diff(profile["s"].values)))
    if spacing > _MAX_COARSENING * old:
        write_note(
            f"{source}: samples are {old:g} m apart; at {spacing:g} m, waves shorter than "
            f"{2 * spacing:g} m are aliased into longer ones, unless trueterrain filter removed "
            "them"
        )
    return resampled


def _convert_surface(surface: "xr.Dataset", output: Path, write: Callable[[Any], Any]) -> None:
    written = write(surface)
    rows, columns = surface.height.shape
    text = f"{output}: {rows:,} x {columns:,} nodes"
    filled = int(getattr(written, "attrs", {}).get("filled", 0))
    if filled:
        text += f"; nodes filled between heights, as the format allows no holes: {filled:,}"
    write_note(text)
    note_omissions(surface, output)


def _check_conversion(source: Path, kind: str, output: Path, ending: str) -> None:
    if ending not in _KNOWN:
        message = f"{output}: the name must end with {', '.join(_KNOWN)}, got {ending!r}."
        raise ValueError(message)
    possible = {
        "surface": (*_SURFACES, *_CLOUDS, *_TABLES, *_STORES),
        "points": (*_CLOUDS, *_TABLES, *_STORES),
        "profile": (*_PROFILES, *_TABLES, *_STORES),
        "path": (),
    }
    if ending in possible[kind]:
        return
    named = {"points": "holds points", "path": "is a path without heights"}.get(
        kind, f"is a {kind}"
    )
    if ending in _PROFILES and kind != "path":
        cure = f"Extract a profile: trueterrain profile {source} ... -o {output}"
    elif kind == "points":
        cure = f"Points can become {', '.join(possible[kind])}; they are not gridded here."
    elif kind == "profile":
        cure = f"A profile can become {', '.join(possible[kind])}; it has no width."
    else:
        cure = "Use it as a path: trueterrain profile SURFACE --path FILE"
    message = f"{source}: {named}, which cannot become {ending}. {cure}"
    raise ValueError(message)


def _writer_options(ending: str, units: str | None, scale: float | None) -> dict[str, Any]:
    options: dict[str, Any] = {}
    if units is not None:
        if ending not in _PROFILES:
            message = f"--units is for ERD output (.erd), got {ending}; other formats are in m."
            raise ValueError(message)
        options["units"] = units
    if scale is not None:
        if ending not in _CLOUDS:
            message = f"--scale is for LAS and LAZ output, got {ending}."
            raise ValueError(message)
        options["scale"] = scale
    return options
