"""Plausibility of a profile before it is rated; mostly finds heights in a wrong unit."""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import TrueTerrainError
from trueterrain.core.schemas import ASSUMED
from trueterrain.roughness._drive import equal_step, nearest_integer, rate_track
from trueterrain.roughness._segments import ROUNDING, cut_segments, finite_tracks
from trueterrain.roughness.settings import IriSettings, QuarterCarSettings

__all__ = ["flag_profile", "rating_flags"]

Array = npt.NDArray[np.float64]

_MAX_HEIGHT = 9000.0  # [m] no ground is farther from sea level
_GRADE_LENGTH = 100.0  # [m] over which a grade is taken
_MIN_GRADE_LENGTH = 10.0  # [m] below, a kerb or a ramp makes a grade
_MAX_GRADE = 0.2  # [m/m] over that length; roads are built up to about 0.12
# [m/km] Measured Belgian block has 85, courses for off-road vehicles up to 62, and the smoothest
# road, 0.5 m/km, has 500 if its millimetres are taken for metres.
_MAX_IRI = 200.0
_MAX_ROAD_IRI = 30.0  # [m/km] where the file names no unit: Sayers's scale of roads ends at 20
_MIN_IRI = 0.1  # [m/km] new roads have 0.5 and more
_MIN_WAVE = 1.2  # [m] to which the golden car responds; a shorter profile may be straight

_UNIT = "are its heights in metres, not in feet or millimetres?"
_SMOOTHED = "was it smoothed away by a search area or a filter, or is its unit larger than a metre?"


def flag_profile(profile: xr.Dataset) -> list[str]:
    """Flag implausible heights of a profile, one sentence each.

    Use it before rating: feet or millimetres that are taken for metres make indices meaningless.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].

    Returns
    -------
    list of str
        Empty if its file names the unit, no height exceeds 9000 m, no grade exceeds 0.2 along
        100 m, and the IRI (without moving average) is from 0.1 to 200 m/km, or to 30 m/km if the
        file names no unit.

    Raises
    ------
    SchemaError
        If `profile` is not a Profile.
    CoverageError
        If a height is not finite.

    Notes
    -----
    Heights in feet that are taken for metres are 3.28 times too large, and so are grades and
    indices: on a flat, smooth road that remains plausible and is not flagged. Nor are inches: a
    road of 2 m/km then has the index of Belgian block.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 200.0, 0.1)
    >>> flag_profile(make_profile(s, 0.08 * s + 0.005 * np.sin(s)))
    []
    >>> print(flag_profile(make_profile(s, 0.08 * s / 0.3048 + 0.005 * np.sin(s)))[0])
    track profile: climbs 0.26 m/m over 100 m; are its heights in metres, not in feet or ...
    """
    station, heights, names = finite_tracks(profile)
    assumed = profile.attrs.get(ASSUMED)
    max_iri = _MAX_ROAD_IRI if assumed else _MAX_IRI
    return [str(assumed)] * bool(assumed) + [
        f"track {name}: {flag}"
        for name, height in zip(names, heights, strict=True)
        for flag in _flag_track(station, height, max_iri)
    ]


def rating_flags(profile: xr.Dataset, settings: QuarterCarSettings) -> list[str]:
    """Flag what makes an index of a profile inaccurate, one sentence each.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s [m].
    settings : QuarterCarSettings
        Conventions of an index.

    Returns
    -------
    list of str
        Empty if samples are close enough, or too far apart to be rated at all, and the moving
        average before the car averages something or is off.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> coarse = make_profile([0.0, 0.4, 0.8], [0.0, 0.0, 0.0])
    >>> for flag in rating_flags(coarse, IriSettings()):
    ...     print(flag)
    the window sayers of 0.25 m averages nothing at a spacing of 0.4 m
    samples are up to 0.4 m apart; the index is accurate to 0.305 m, and rated to 0.61 m
    """
    station = np.asarray(profile["s"], dtype=float)
    if station.size < 2:
        return []
    largest = float(np.diff(station).max())
    if largest > settings.max_spacing * (1 + ROUNDING):
        return []
    found = []
    if _is_idle(station, settings):
        spacing = float(station[-1] - station[0]) / (station.size - 1)
        found.append(
            f"the window {settings.window} of {settings.window_length:g} m averages nothing "
            f"at a spacing of {spacing:.4g} m"
        )
    if largest > settings.accurate_spacing * (1 + ROUNDING):
        found.append(
            f"samples are up to {largest:.4g} m apart; the index is accurate to "
            f"{settings.accurate_spacing:g} m, and rated to {settings.max_spacing:g} m"
        )
    return found


def _is_idle(station: Array, settings: QuarterCarSettings) -> bool:
    """Whether the moving average before the car is on but changes nothing."""
    length = settings.window_length
    if settings.window == "sayers":
        step = equal_step(station, settings.spacing_tolerance)
        return step is not None and nearest_integer(length / step) <= 1
    return settings.window == "centred" and float(np.diff(station).min()) > 0.5 * length


def _flag_track(station: Array, height: Array, max_iri: float) -> list[str]:
    found = []
    magnitude = float(np.abs(height).max())
    if magnitude > _MAX_HEIGHT:
        found.append(f"has heights up to {magnitude:.6g} m from sea level; {_UNIT}")
    grade, length = _max_slope(station, height)
    if grade > _MAX_GRADE:
        found.append(f"climbs {grade:.2g} m/m over {length:g} m; {_UNIT}")
    try:
        settings = IriSettings(window="none", start="0.5s")
        roughness = 1000.0 * rate_track(station, height, settings, cut_segments(station, None))[0]
    except TrueTerrainError:
        return found  # too short or too coarse to be rated; the rating itself reports that
    if roughness > max_iri:
        found.append(f"is rougher than roads are, {roughness:.3g} m/km; {_UNIT}")
    if roughness < _MIN_IRI and station[-1] - station[0] > _MIN_WAVE:
        found.append(f"is smoother than any road, {roughness:.3f} m/km; {_SMOOTHED}")
    return found


def _max_slope(station: Array, height: Array) -> tuple[float, float]:
    """Largest slope of a chord [m/m], and the length of that chord [m]."""
    length = min(_GRADE_LENGTH, float(station[-1] - station[0]))
    if length < _MIN_GRADE_LENGTH:
        return 0.0, length
    begins = station <= station[-1] - length
    begins[0] = True  # also if the length of a chord over the whole profile is rounded up
    chords = np.interp(station[begins] + length, station, height) - height[begins]
    return float(np.abs(chords).max()) / length, length
