"""The command ``trueterrain compare``: agreement of profiles or surfaces."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import xarray as xr
from cyclopts import Group, Parameter

from trueterrain import formats
from trueterrain.cli._compare_profiles import ProfileComparison
from trueterrain.cli._compare_surfaces import SurfaceComparison
from trueterrain.cli._console import note_compilation, write_json
from trueterrain.cli._options import flatten_settings
from trueterrain.cli._profiles import check_picture, draw_panels, write_warning
from trueterrain.cli._recordings import refuse_recording
from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import kind_of
from trueterrain.roughness import Butterworth, IriSettings
from trueterrain.roughness.agreement import IRI_FILTER, AgreementLimits, AgreementSettings
from trueterrain.roughness.agreement.heights import Registration

_PROFILES = Parameter(group=Group("Profiles", sort_key=1))
_SURFACES = Parameter(group=Group("Surfaces", sort_key=3))


def compare(
    file: Path,
    /,
    *more: Path,
    reference: Path | None = None,
    filter: Annotated[Literal["iri", "butterworth", "none"], _PROFILES] = "iri",  # noqa: A002 - the name of the option
    shortest: Annotated[float, _PROFILES] = 8.0,
    longest: Annotated[float, _PROFILES] = 90.0,
    settling_length: Annotated[float | None, _PROFILES] = None,
    settings: Annotated[
        AgreementSettings, flatten_settings("Profiles", omit=["filter", "transient"])
    ] = AgreementSettings(),
    registration: Annotated[Registration, _PROFILES] = "distance",
    trend: Annotated[int, _PROFILES] = 1,
    limits: Annotated[
        AgreementLimits, flatten_settings("Limits of profiles", sort_key=2)
    ] = AgreementLimits(),
    level: Annotated[Literal["none", "median", "plane"], _SURFACES] = "none",
    lanes: Annotated[list[float] | None, Parameter(consume_multiple=True), _SURFACES] = None,
    speed: Annotated[list[float] | None, Parameter(consume_multiple=True), _SURFACES] = None,
    json: bool = False,
    plot: Path | None = None,
    force: bool = False,
) -> None:
    """Agreement of profiles, or of surfaces, with each other and with a reference.

    Profiles are filtered and rated by cross-correlation at the shift of stations that maximises it:
    100 % only if both shape and amplitude agree. Their distance-measuring error is estimated, and
    their heights are compared with those of the reference. Surfaces are compared node by node:
    statistics and structure function of the difference.

    Example: trueterrain compare run1.erd run2.erd run3.erd --reference surveyed.erd --json

    Parameters
    ----------
    file
        Profile (ERD, CSV, Parquet, NAME.zarr) or surface (CRG, GeoTIFF, NAME.zarr).
    more
        More of the same kind. Without a reference every pair is compared.
    reference
        File with which the others are compared; it does not count as a repeat.
    filter
        Filter before the rating. iri: 0.25 m moving average and golden car; butterworth:
        band pass of heights, forward and backward; none: unfiltered heights.
    shortest
        Shortest wavelength that the filter butterworth passes [m].
    longest
        Longest wavelength that it passes [m]. ASTM E950 names 8 m and 90 m for airfields.
    settling_length
        Length that is left out because the filter has not decayed [m]: after the start for iri (30
        by default), at both ends for butterworth (by default its longest wavelength).
    registration
        Registration before heights are subtracted: distance (shift and distance-measuring
        error), shift, or none.
    trend
        Degree of the polynomial that is subtracted from errors of heights: 0 for an
        offset, 1 for a line; -1 for none.
    level
        Trend that is subtracted from their difference: none, its median, or a plane.
    lanes
        Edges of lanes from right to left, as offsets from the reference line [m].
    speed
        Speed at which each was measured, in the order of the files without the reference
        [km/h].
    json
        Print one JSON document instead of tables; lengths and heights are in m, ratings and
        distance-measuring errors are fractions.
    plot
        Picture to write: .svg, .pdf or .png.
    force
        Replace the picture if it exists.
    """
    paths = [path for path in (file, *more) if path != reference]
    every = paths if reference is None else [reference, *paths]
    if len(every) < 2:
        message = "two files are needed: give another one, or --reference FILE."
        raise ValueError(message)
    check_picture(plot, force=force, inputs=every)
    data = _read_files(every)
    reference_name = None if reference is None else next(iter(data))
    kind = _common_kind(data)
    flags: list[str] = []
    with note_compilation(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        comparison: ProfileComparison | SurfaceComparison
        if kind == "surface":
            comparison = SurfaceComparison.of(
                data, reference_name, level=level, lanes=lanes, speed=speed
            )
        else:
            if lanes or speed:
                message = "--lanes and --speed belong to surfaces, and these are profiles."
                raise ValueError(message)
            by: IriSettings | Butterworth | None = IRI_FILTER if filter == "iri" else None
            if filter == "butterworth":
                by = Butterworth(shortest=shortest, longest=longest)
            settings = replace(settings, filter=by, transient=settling_length)
            comparison = ProfileComparison.of(
                data, reference_name, settings, limits, registration, None if trend < 0 else trend
            )
    flags += dict.fromkeys(str(one.message) for one in caught)
    for flag in flags:
        write_warning(flag)
    if json:
        write_json(comparison.document() | {"flags": flags})
    else:
        comparison.show()
    if plot is not None:
        draw_panels(*comparison.panels(), plot, force=force)


def _read_files(paths: list[Path]) -> dict[str, xr.Dataset]:
    """Data of all files by name; by path where names are equal."""
    data: dict[str, xr.Dataset] = {}
    short = [path.name for path in paths]
    for path in paths:
        refuse_recording(path, formats.kind_of_file(path), "a profile or a surface")
        name = path.name if short.count(path.name) == 1 else str(path)
        if name in data:
            message = f"{path} must be given once."
            raise ValueError(message)
        data[name] = formats.open(path)
    return data


def _common_kind(data: Mapping[str, xr.Dataset]) -> str:
    """Kind of all data: profile or surface."""
    kinds = {name: kind_of(one) for name, one in data.items()}
    for name, kind in kinds.items():
        if kind == "points":
            raise SchemaError(
                "holds points, not a profile or a surface",
                path=name,
                cure=f"Grid it first: trueterrain grid {name} -o surface.crg",
            )
    head, *others = kinds
    for name in others:
        if kinds[name] != kinds[head]:
            raise SchemaError(
                f"is a {kinds[name]}, but {head} is a {kinds[head]}",
                path=name,
                cure="Compare profiles with profiles, and surfaces with surfaces.",
            )
    return kinds[head]
