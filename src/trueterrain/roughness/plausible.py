"""What makes a profile implausible before it is rated: mostly a unit that is not what it seems."""

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.errors import TrueTerrainError
from trueterrain.roughness._rate import rate
from trueterrain.roughness._track import CarOptions, IriOptions, equal_step, nearest_integer
from trueterrain.roughness._tracks import cut, tracks

__all__ = ["doubts", "idle_window"]

Array = npt.NDArray[np.float64]

_HIGHEST = 9000.0  # [m] no ground is farther from sea level
_GRADE_LENGTH = 100.0  # [m] over which a grade is taken
_LEAST_LENGTH = 10.0  # [m] below, a kerb or a ramp makes a grade
_STEEPEST = 0.2  # [m/m] over that length; roads are built up to about 0.12
_ROUGHEST = 30.0  # [m/km] Sayers's scale of roads ends at about 20, Belgian block has about 25

_CURE = "are its heights in metres, not in feet or millimetres?"


def doubts(profile: xr.Dataset) -> list[str]:
    """What is implausible about the heights of a profile, one sentence each.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].

    Returns
    -------
    list of str
        Empty if nothing is: no height beyond 9000 m, no grade over 0.2 along 100 m, no IRI (without
        moving average) over 30 m/km.

    Raises
    ------
    SchemaError
        If `profile` is not a Profile.
    CoverageError
        If a height is not finite.

    Notes
    -----
    Heights in feet that pass for metres are 3.28 times too large, and so are grades and indices:
    on a flat, smooth road that remains plausible, and is not found.

    Examples
    --------
    >>> from trueterrain.kinds import make_profile
    >>> s = np.arange(0.0, 200.0, 0.1)
    >>> doubts(make_profile(s, 0.08 * s))
    []
    >>> print(doubts(make_profile(s, 0.08 * s / 0.3048))[0])
    track profile: climbs 0.26 m/m over 100 m; are its heights in metres, not in feet or ...
    """
    station, heights, names = tracks(profile)
    return [
        f"track {name}: {doubt}; {_CURE}"
        for name, height in zip(names, heights, strict=True)
        for doubt in _doubts(station, height)
    ]


def idle_window(profile: xr.Dataset, options: CarOptions) -> str | None:
    """Why the moving average before the car changes nothing, or None if it does or is not wanted.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s [m].
    options : CarOptions
        Conventions of an index.

    Returns
    -------
    str or None
        One sentence.

    Examples
    --------
    >>> from trueterrain.kinds import make_profile
    >>> coarse = make_profile([0.0, 0.25, 0.5], [0.0, 0.0, 0.0])
    >>> print(idle_window(coarse, IriOptions()))
    the window sayers of 0.25 m averages nothing at a spacing of 0.25 m
    """
    station = np.asarray(profile["s"], dtype=float)
    if station.size < 2:
        return None
    length, idle = options.window_length, False
    if options.window == "sayers":
        step = equal_step(station, options.spacing_tolerance)
        idle = step is not None and nearest_integer(length / step) <= 1
    elif options.window == "centred":
        idle = float(np.diff(station).min()) > 0.5 * length
    spacing = float(station[-1] - station[0]) / (station.size - 1)
    sentence = (
        f"the window {options.window} of {length:g} m averages nothing "
        f"at a spacing of {spacing:.4g} m"
    )
    return sentence if idle else None


def _doubts(station: Array, height: Array) -> list[str]:
    found = []
    farthest = float(np.abs(height).max())
    if farthest > _HIGHEST:
        found.append(f"has heights up to {farthest:.6g} m from sea level")
    grade, length = _steepest(station, height)
    if grade > _STEEPEST:
        found.append(f"climbs {grade:.2g} m/m over {length:g} m")
    try:
        options = IriOptions(window="none", start="0.5s")
        roughness = 1000.0 * rate(station, height, options, cut(station, None))[0]
    except TrueTerrainError:
        return found  # too short to be rated, which whoever rates it will say
    if roughness > _ROUGHEST:
        found.append(f"is rougher than roads are, {roughness:.3g} m/km")
    return found


def _steepest(station: Array, height: Array) -> tuple[float, float]:
    """Largest slope of a chord, and the length of that chord [m]."""
    room = float(station[-1] - station[0])
    length = min(_GRADE_LENGTH, room)
    if length < _LEAST_LENGTH:
        return 0.0, length
    begins = station <= station[-1] - length
    begins[0] = True  # whatever the rounding of a chord over the whole profile
    chords = np.interp(station[begins] + length, station, height) - height[begins]
    return float(np.abs(chords).max()) / length, length
