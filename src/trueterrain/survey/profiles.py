"""Profiles along the paths of a survey, and their roughness."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_profile
from trueterrain.formats.table import read_waypoints
from trueterrain.profile import PlaneCurve, offset_path, straight_path, waypoint_path
from trueterrain.profile.area import area_flag, area_reach
from trueterrain.profile.settings import take_profile
from trueterrain.roughness import IriSettings, flag_profile, iri
from trueterrain.roughness.plausible import rating_flags
from trueterrain.surface.evaluate import heights_at
from trueterrain.survey._settings import ProfilePathSettings, RoughnessSettings

_PARALLEL = 1.01  # ratio of the lengths of two wheel paths up to which stations lie side by side


def extract_profile(surface: xr.Dataset, settings: ProfilePathSettings) -> xr.Dataset:
    """Profile along a path, as a tyre feels it.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface.
    settings : ProfilePathSettings
        Path, search area and statistic, or the tyre that rolls along the path.

    Returns
    -------
    xarray.Dataset
        Profile of the part of the path under which the surface lies.

    Raises
    ------
    CoverageError
        If the surface does not lie under the path.
    """
    path = _covered_path(surface, settings)
    return take_profile(surface, path, settings.tyre, envelope=settings.envelope)


def extract_profiles(
    surface: xr.Dataset, settings: Sequence[ProfilePathSettings], *, name: str = "surface"
) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Profiles along several paths.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface.
    settings : sequence of ProfilePathSettings
        Paths, search areas and statistics.
    name : str
        Name of the surface in messages.

    Returns
    -------
    profiles : dict of xarray.Dataset
        Profiles by name.
    problems : list of str
        Why profiles were left out, and what is flagged about their search areas.
    """
    found, problems = {}, []
    for one in settings:
        try:
            found[one.name] = extract_profile(surface, one)
        except CoverageError as error:
            problems.append(f"profile {one.name} of {name} is left out: {error}")
        if (flag := area_flag(one.tyre.search_area())) is not None:
            problems.append(f"profile {one.name}: {flag}")
    return found, problems


def rate_profiles(
    profiles: Mapping[str, xr.Dataset], settings: RoughnessSettings = RoughnessSettings()
) -> tuple[dict[str, xr.Dataset], list[str]]:
    """IRI of several profiles, overall and by segment.

    Parameters
    ----------
    profiles : mapping of str to xarray.Dataset
        Profiles by name.
    settings : RoughnessSettings
        Length of the segments, and conventions of the IRI.

    Returns
    -------
    ratings : dict of xarray.Dataset
        As by `trueterrain.iri`, by name.
    problems : list of str
        Why profiles have no IRI, and what is flagged about the others.
    """
    found, problems = {}, []
    for name, profile in profiles.items():
        try:
            found[name] = iri(profile, settings=settings.iri, segment=settings.segment)
        except (CoverageError, ValueError) as error:
            problems.append(f"profile {name} is not rated: {error}")
            continue
        problems += flag_profile(profile.assign_attrs(track=name))
        problems += [f"profile {name}: {flag}" for flag in rating_flags(profile, settings.iri)]
    return found, problems


def rate_wheel_paths(
    profiles: Mapping[str, xr.Dataset],
    ratings: Mapping[str, xr.Dataset],
    settings: IriSettings = IriSettings(),
) -> list[dict[str, Any]]:
    """MRI and HRI of pairs of wheel paths.

    Two profiles are a pair if their names differ only in left and right at the end, such as
    ``lane-1-left`` and ``lane-1-right``.

    Parameters
    ----------
    profiles : mapping of str to xarray.Dataset
        Profiles by name.
    ratings : mapping of str to xarray.Dataset
        Their IRI, as by `rate_profiles`.
    settings : IriSettings
        Conventions of the IRI.

    Returns
    -------
    list of dict
        ``left``, ``right``, ``mri`` and ``hri`` [m/km]; ``hri`` is None if the paths are not
        parallel.
    """
    pairs = []
    for left in ratings:
        right = left.removesuffix("left") + "right"
        if left.endswith("left") and right in ratings:
            mri = 0.5 * float(ratings[left].iri[0] + ratings[right].iri[0])
            hri = _half_car_index(profiles[left], profiles[right], settings)
            pairs.append({"left": left, "right": right, "mri": mri, "hri": hri})
    return pairs


def _covered_path(surface: xr.Dataset, settings: ProfilePathSettings) -> PlaneCurve:
    """Part of a path under which the surface lies, search areas included."""
    if settings.offset is not None:
        path = offset_path(surface, settings.offset, spacing=settings.spacing)
    elif settings.line is not None:
        path = straight_path(settings.line[:2], settings.line[2:], spacing=settings.spacing)
    else:
        assert settings.path is not None  # ProfilePathSettings demands one of them
        path = waypoint_path(*read_waypoints(Path(settings.path)), spacing=settings.spacing)
    seen = np.flatnonzero(np.isfinite(heights_at(surface, path.easting, path.northing)))
    margin = int(np.ceil(area_reach(settings.tyre.search_area()) / settings.spacing))
    if seen.size < 2 * margin + 2:
        raise CoverageError(
            "the surface does not lie under the path",
            place=f"profile {settings.name}",
            cure="Compare the coordinates of path and runs.",
        )
    return path.part(int(seen[0]) + margin, int(seen[-1]) + 1 - margin)


def _half_car_index(left: xr.Dataset, right: xr.Dataset, settings: IriSettings) -> float | None:
    """HRI of two wheel paths [m/km], None if they are not parallel."""
    step = float(left.s[1] - left.s[0])
    numbers = [np.rint(profile.s.values / step).astype(int) for profile in (left, right)]
    both, at_left, at_right = np.intersect1d(*numbers, return_indices=True)
    # paths of a bend differ in length, so equal stations do not lie side by side there
    lengths = [profile.sizes["s"] for profile in (left, right)]
    if both.size < 2 or max(lengths) > _PARALLEL * min(lengths):
        return None
    heights = np.stack([left.height.values[at_left], right.height.values[at_right]])
    tracks = make_profile(both * step, heights, tracks=["left", "right"])
    try:
        return float(iri(tracks, settings=settings).hri)
    except (CoverageError, ValueError):
        return None  # the part that both cover is too short
