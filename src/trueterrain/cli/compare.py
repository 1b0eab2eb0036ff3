"""``trueterrain compare``: how well profiles or surfaces agree."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from trueterrain.cli._compare_profiles import ProfileComparison
from trueterrain.cli._compare_surfaces import SurfaceComparison
from trueterrain.cli._console import compiling_noted, out_json
from trueterrain.cli._numbers import WHOLE
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
    filter: Literal["iri", "butterworth", "none"] = "iri",  # noqa: A002 - as the option is called
    shortest: float = 8.0,
    longest: float = 90.0,
    settle: float | None = None,
    max_shift: float = 10.0,
    max_scale: float = 0.005,
    align_starts: bool = False,
    registration: Literal["distance", "shift", "none"] = "distance",
    trend: Annotated[int, WHOLE] = 1,
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
    """How well profiles, or surfaces, agree with each other and with a reference.

    Profiles are rated by cross-correlation behind a filter, at the shift of their stations at which
    they agree best: 100 % only if both shape and amplitude agree. Their distance-measuring error is
    found, and their heights are compared with those of the reference. Surfaces are compared node by
    node: where, how much, and over which distances their difference changes.

    Example: trueterrain compare run1.erd run2.erd run3.erd --reference surveyed.erd --json

    Parameters
    ----------
    file
        Profile (ERD, CSV, Parquet, NAME.zarr) or surface (CRG, GeoTIFF, NAME.zarr).
    more
        More of the same kind. Without a reference every pair is compared.
    reference
        What the others are held against; it does not count as a repeat.
    filter
        Profiles: what they pass before they are rated. iri: 0.25 m moving average and golden car;
        butterworth: band-pass of heights, forth and back; none: heights as they are.
    shortest
        Shortest wavelength that the filter butterworth passes [m].
    longest
        Longest wavelength that it passes [m]. ASTM E950 names 8 m and 90 m for airfields.
    settle
        Length that is left out while the filter settles [m]: behind the start for iri (30 by
        default), at both ends for butterworth (by default its longest wavelength).
    max_shift
        Profiles: largest shift of stations that is sought [m].
    max_scale
        Profiles: largest distance-measuring error that is sought [m/m]; 0 for none.
    align_starts
        Profiles: count stations from the start of each.
    registration
        Profiles: by what the heights are registered before they are subtracted: distance (shift and
        distance-measuring error), shift, or none.
    trend
        Profiles: degree of the polynomial that is taken off errors of heights: 0 for an offset, 1
        for a line; -1 for none.
    repeatability
        Limit: least mean rating of all pairs of repeats [1], 0 for none. The default is commonly
        named for AASHTO R 56, and was not checked against its text.
    accuracy
        Limit: least mean rating of repeats against the reference [1], 0 for none; as above.
    distance_error
        Limit: largest distance-measuring error against the reference [m/m].
    bias
        Limit: largest mean magnitude of the mean error of repeats [m].
    precision
        Limit: largest mean standard deviation of repeats [m].
    level
        Surfaces: what is taken off their difference: none, its median, or a plane.
    lanes
        Surfaces: edges of lanes from right to left, as offsets from the reference line [m].
    speed
        Surfaces: speed at which each was measured, in the order of the files, the reference left
        out [km/h].
    json
        Print one JSON document instead of tables; lengths and heights are in m, ratings and errors
        of distance in shares of 1.
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
    named = None if reference is None else next(iter(data))
    kind = _common_kind(data)
    flags: list[str] = []
    with compiling_noted(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        comparison: ProfileComparison | SurfaceComparison
        if kind == "surface":
            comparison = SurfaceComparison.of(data, named, level=level, lanes=lanes, speed=speed)
        else:
            if lanes or speed:
                message = "--lanes and --speed belong to surfaces, and these are profiles."
                raise ValueError(message)
            options = _agreement_settings(
                filter, (shortest, longest), settle, (max_shift, max_scale), align_starts
            )
            limits = _agreement_limits(repeatability, accuracy, distance_error, bias, precision)
            comparison = ProfileComparison.of(
                data, named, options, limits, registration, None if trend < 0 else trend
            )
    flags += dict.fromkeys(str(one.message) for one in caught)
    for flag in flags:
        write_warning(flag)
    if json:
        out_json(comparison.document() | {"flags": flags})
    else:
        comparison.show()
    if plot is not None:
        draw_panels(*comparison.panels(), plot, force=force)


def _read_files(paths: list[Path]) -> "dict[str, xr.Dataset]":
    """Data of all files, by names that tell them apart."""
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
    settle: float | None,
    search: tuple[float, float],
    align_starts: bool,
) -> "AgreementSettings":
    from trueterrain.roughness import Butterworth
    from trueterrain.roughness.agreement import IRI_FILTER, AgreementSettings

    by = {"iri": IRI_FILTER, "none": None}.get(name)
    return AgreementSettings(
        filter=Butterworth(shortest=waves[0], longest=waves[1]) if name == "butterworth" else by,
        transient=settle,
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
