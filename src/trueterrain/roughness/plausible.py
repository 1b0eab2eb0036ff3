"""What makes a profile implausible before it is rated: mostly a unit that is not what it seems."""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import TrueTerrainError
from trueterrain.core.schemas import ASSUMED
from trueterrain.roughness._rate import rate_track
from trueterrain.roughness._track import (
    IriSettings,
    QuarterCarSettings,
    equal_step,
    nearest_integer,
)
from trueterrain.roughness._tracks import ROUNDING, cut_segments, finite_tracks

__all__ = ["flag_profile", "rating_flags"]

Array = npt.NDArray[np.float64]

_HIGHEST = 9000.0  # [m] no ground is farther from sea level
_GRADE_LENGTH = 100.0  # [m] over which a grade is taken
_LEAST_LENGTH = 10.0  # [m] below, a kerb or a ramp makes a grade
_STEEPEST = 0.2  # [m/m] over that length; roads are built up to about 0.12
# [m/km] Measured Belgian block has 85, courses for off-road vehicles up to 62, and the smoothest
# road, 0.5 m/km, would have 500 if its millimetres passed for metres.
_ROUGHEST = 200.0
_ROUGHEST_ROAD = 30.0  # [m/km] where nobody named the unit: Sayers's scale of roads ends at 20
_SMOOTHEST = 0.1  # [m/km] new roads have 0.5 and more
_FELT = 1.2  # [m] the shortest wave that the golden car feels; a shorter profile may be straight

_UNIT = "are its heights in metres, not in feet or millimetres?"
_SMOOTHED = "was it smoothed away by a search area or a filter, or is its unit larger than a metre?"


def flag_profile(profile: xr.Dataset) -> list[str]:
    """What is implausible about the heights of a profile, one sentence each.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].

    Returns
    -------
    list of str
        Empty if nothing is: a unit that its file names, no height beyond 9000 m, no grade over 0.2
        along 100 m, and an IRI (without moving average) from 0.1 to 200 m/km, or to 30 m/km if the
        file names no unit.

    Raises
    ------
    SchemaError
        If `profile` is not a Profile.
    CoverageError
        If a height is not finite.

    Notes
    -----
    Heights in feet that pass for metres are 3.28 times too large, and so are grades and indices:
    on a flat, smooth road that remains plausible, and is not found. Nor are inches: a road of
    2 m/km then has the index of Belgian block.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 200.0, 0.1)
    >>> flags(make_profile(s, 0.08 * s + 0.005 * np.sin(s)))
    []
    >>> print(flags(make_profile(s, 0.08 * s / 0.3048 + 0.005 * np.sin(s)))[0])
    track profile: climbs 0.26 m/m over 100 m; are its heights in metres, not in feet or ...
    """
    station, heights, names = finite_tracks(profile)
    assumed = profile.attrs.get(ASSUMED)
    roughest = _ROUGHEST_ROAD if assumed else _ROUGHEST
    return [str(assumed)] * bool(assumed) + [
        f"track {name}: {flag}"
        for name, height in zip(names, heights, strict=True)
        for flag in _flag_track(station, height, roughest)
    ]


def rating_flags(profile: xr.Dataset, options: QuarterCarSettings) -> list[str]:
    """What makes an index of a profile inaccurate, one sentence each.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s [m].
    options : CarOptions
        Conventions of an index.

    Returns
    -------
    list of str
        Empty if samples are close enough, or too far apart to be rated at all, and the moving
        average before the car changes something or is not wanted.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> coarse = make_profile([0.0, 0.4, 0.8], [0.0, 0.0, 0.0])
    >>> for flag in rating_flags(coarse, IriOptions()):
    ...     print(flag)
    the window sayers of 0.25 m averages nothing at a spacing of 0.4 m
    samples are up to 0.4 m apart; the index is accurate to 0.305 m, and rated to 0.61 m
    """
    station = np.asarray(profile["s"], dtype=float)
    if station.size < 2:
        return []
    largest = float(np.diff(station).max())
    if largest > options.max_spacing * (1 + ROUNDING):
        return []
    found = []
    if _is_idle(station, options):
        spacing = float(station[-1] - station[0]) / (station.size - 1)
        found.append(
            f"the window {options.window} of {options.window_length:g} m averages nothing "
            f"at a spacing of {spacing:.4g} m"
        )
    if largest > options.accurate_spacing * (1 + ROUNDING):
        found.append(
            f"samples are up to {largest:.4g} m apart; the index is accurate to "
            f"{options.accurate_spacing:g} m, and rated to {options.max_spacing:g} m"
        )
    return found


def _is_idle(station: Array, options: QuarterCarSettings) -> bool:
    """Whether the moving average before the car changes nothing, though it is wanted."""
    length = options.window_length
    if options.window == "sayers":
        step = equal_step(station, options.spacing_tolerance)
        return step is not None and nearest_integer(length / step) <= 1
    return options.window == "centred" and float(np.diff(station).min()) > 0.5 * length


def _flag_track(station: Array, height: Array, roughest: float) -> list[str]:
    found = []
    farthest = float(np.abs(height).max())
    if farthest > _HIGHEST:
        found.append(f"has heights up to {farthest:.6g} m from sea level; {_UNIT}")
    grade, length = _max_slope(station, height)
    if grade > _STEEPEST:
        found.append(f"climbs {grade:.2g} m/m over {length:g} m; {_UNIT}")
    try:
        options = IriSettings(window="none", start="0.5s")
        roughness = 1000.0 * rate_track(station, height, options, cut_segments(station, None))[0]
    except TrueTerrainError:
        return found  # too short or too coarse to be rated, which whoever rates it will say
    if roughness > roughest:
        found.append(f"is rougher than roads are, {roughness:.3g} m/km; {_UNIT}")
    if roughness < _SMOOTHEST and station[-1] - station[0] > _FELT:
        found.append(f"is smoother than any road, {roughness:.3f} m/km; {_SMOOTHED}")
    return found


def _max_slope(station: Array, height: Array) -> tuple[float, float]:
    """Largest slope of a chord, and the length of that chord [m]."""
    room = float(station[-1] - station[0])
    length = min(_GRADE_LENGTH, room)
    if length < _LEAST_LENGTH:
        return 0.0, length
    begins = station <= station[-1] - length
    begins[0] = True  # whatever the rounding of a chord over the whole profile
    chords = np.interp(station[begins] + length, station, height) - height[begins]
    return float(np.abs(chords).max()) / length, length
