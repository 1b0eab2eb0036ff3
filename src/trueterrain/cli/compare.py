"""The command ``trueterrain compare``: agreement of profiles or surfaces."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from trueterrain.cli._compare_profiles import ProfileComparison
from trueterrain.cli._compare_surfaces import SurfaceComparison
from trueterrain.cli._console import note_compilation, write_json
from trueterrain.cli._options import INTEGER
from trueterrain.cli._profiles import draw_panels, write_warning
from trueterrain.cli._recordings import refuse_recording
from trueterrain.core.errors import SchemaError

if TYPE_CHECKING:
    import xarray as xr

    from trueterrain.roughness.agreement import AgreementLimits, AgreementSettings


def compare(
    file: Path,
    /,
    *more: Path,
    reference: Path | None = None,
    filter: Literal["iri", "butterworth", "none"] = "iri",  # noqa: A002 - the name of the option
    shortest: float = 8.0,
    longest: float = 90.0,
    settling_length: float | None = None,
    max_shift: float = 10.0,
    max_scale: float = 0.005,
    align_starts: bool = False,
    registration: Literal["distance", "shift", "none"] = "distance",
    trend: Annotated[int, INTEGER] = 1,
    repeatability: float = 0.92,
    accuracy: float = 0.90,
    distance_error: float | None = None,
    bias: float | None = None,
    precision: float | None = None,
    level: Literal["none", "median", "plane"] = "none",
    lanes: Annotated[list[float] | None, Parameter(consume_multiple=True)] = None,
    speed: Annotated[list[float] | None, Parameter(consume_multiple=True)] = None,
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
        Profiles: filter before the rating. iri: 0.25 m moving average and golden car; butterworth:
        band pass of heights, forward and backward; none: unfiltered heights.
    shortest
        Shortest wavelength that the filter butterworth passes [m].
    longest
        Longest wavelength that it passes [m]. ASTM E950 names 8 m and 90 m for airfields.
    settling_length
        Length that is left out because the filter has not decayed [m]: after the start for iri (30
        by default), at both ends for butterworth (by default its longest wavelength).
    max_shift
        Profiles: maximum shift of stations in the search [m].
    max_scale
        Profiles: maximum distance-measuring error in the search [m/m]; 0 for none.
    align_starts
        Profiles: count stations from the start of each.
    registration
        Profiles: registration before heights are subtracted: distance (shift and distance-measuring
        error), shift, or none.
    trend
        Profiles: degree of the polynomial that is subtracted from errors of heights: 0 for an
        offset, 1 for a line; -1 for none.
    repeatability
        Limit: minimum mean rating of all pairs of repeats [1], 0 for none. The default is the one
        commonly quoted for AASHTO R 56; it was not checked against its text.
    accuracy
        Limit: minimum mean rating of repeats against the reference [1], 0 for none; as above.
    distance_error
        Limit: maximum distance-measuring error against the reference [m/m].
    bias
        Limit: maximum mean magnitude of the mean error of repeats [m].
    precision
        Limit: maximum mean standard deviation of repeats [m].
    level
        Surfaces: trend that is subtracted from their difference: none, its median, or a plane.
    lanes
        Surfaces: edges of lanes from right to left, as offsets from the reference line [m].
    speed
        Surfaces: speed at which each was measured, in the order of the files without the reference
        [km/h].
    json
        Print one JSON document instead of tables; lengths and heights are in m, ratings and
        distance-measuring errors are fractions.
    plot
        Picture to write: .svg, .pdf or .png.
    force
        Replace the picture if it exists.
    """
    from trueterrain import figures

    paths = [path for path in (file, *more) if path != reference]
    every = paths if reference is None else [reference, *paths]
    if len(every) < 2:
        message = "two files are needed: give another one, or --reference FILE."
        raise ValueError(message)
    if plot is not None:
        figures.require_picture(plot, force=force, inputs=every)
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
            options = _agreement_settings(
                filter, (shortest, longest), settling_length, (max_shift, max_scale), align_starts
            )
            limits = _agreement_limits(repeatability, accuracy, distance_error, bias, precision)
            comparison = ProfileComparison.of(
                data, reference_name, options, limits, registration, None if trend < 0 else trend
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


def _read_files(paths: list[Path]) -> "dict[str, xr.Dataset]":
    """Data of all files by name; by path where names are equal."""
    from trueterrain import formats

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


def _common_kind(data: "Mapping[str, xr.Dataset]") -> str:
    """Kind of all data: profile or surface."""
    from trueterrain.core.schemas import kind_of

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


def _agreement_settings(
    name: str,
    waves: tuple[float, float],
    settling_length: float | None,
    search: tuple[float, float],
    align_starts: bool,
) -> "AgreementSettings":
    from trueterrain.roughness import Butterworth
    from trueterrain.roughness.agreement import IRI_FILTER, AgreementSettings

    by = {"iri": IRI_FILTER, "none": None}.get(name)
    return AgreementSettings(
        filter=Butterworth(shortest=waves[0], longest=waves[1]) if name == "butterworth" else by,
        transient=settling_length,
        max_shift=search[0],
        max_scale=search[1],
        align_starts=align_starts,
    )


def _agreement_limits(
    repeatability: float,
    accuracy: float,
    distance_error: float | None,
    bias: float | None,
    precision: float | None,
) -> "AgreementLimits":
    from trueterrain.roughness.agreement import AgreementLimits

    return AgreementLimits(
        repeatability=repeatability or None,
        accuracy=accuracy or None,
        distance_error=distance_error,
        bias=bias,
        precision=precision,
    )
