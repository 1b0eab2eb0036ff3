"""Rolling straightedge: distance of the ground from the midpoint of a beam on two wheels."""

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.provenance import add_step
from trueterrain.roughness._segments import ROUNDING, finite_tracks
from trueterrain.roughness.settings import require_positive

__all__ = ["rolling_straightedge"]


def rolling_straightedge(profile: xr.Dataset, length: float = 3.0) -> xr.Dataset:
    """Deviation of each track from the midpoint of a beam that rolls over it.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m]; spacing may be unequal.
    length : float
        Distance of the two wheels that carry the beam, one at either end [m]; 3 m by default, and
        3.048 m (10 ft) or 4.877 m (16 ft) where feet are in use.

    Returns
    -------
    xarray.Dataset
        ``deviation`` (track, s), ground above the beam at its midpoint [m]; s is the station of the
        midpoint, at all samples at which both wheels are on the profile.

    Raises
    ------
    ValueError
        If `length` is not greater than 0.
    SchemaError
        If `profile` is not a Profile.
    CoverageError
        If a height is not finite, or the profile is shorter than the beam.

    Notes
    -----
    Wheels are points, the profile is straight between its samples. A sine of amplitude a and a
    wavelength of w deviates by a (1 - cos(pi length / w)): the gain is 2 for a wave as long as the
    beam, and 0 for one of half its length.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 30.0, 0.01)
    >>> beam = rolling_straightedge(make_profile(s, 0.005 * np.sin(2 * np.pi * s / 3.0)))
    >>> print(f"{1000 * float(beam.deviation.max()):.1f} mm at {float(beam.s[0]):.1f} m or later")
    10.0 mm at 1.5 m or later
    """
    require_positive("length", length, " m")
    station, heights, names = finite_tracks(profile)
    extent = float(station[-1] - station[0])
    slack = ROUNDING * extent / max(station.size - 1, 1)
    half = 0.5 * length
    inside = (station >= station[0] + half - slack) & (station <= station[-1] - half + slack)
    if extent + slack < length or not inside.any():
        raise CoverageError(
            f"is shorter than the straightedge: {extent:g} m, which must be at least {length:g} m",
            place="axis s",
            cure="Choose a shorter straightedge.",
        )
    midpoint = station[inside]
    wheels = [midpoint - half, midpoint + half]
    deviation = np.array(
        [height[inside] - np.interp(wheels, station, height).mean(axis=0) for height in heights]
    )
    data = xr.Dataset(
        {"deviation": (("track", "s"), deviation, {"units": "m"})},
        {"track": names, "s": ("s", midpoint, {"units": "m"})},
    )
    return add_step(data, "rolling_straightedge", parameters={"length": length}, after=profile)
