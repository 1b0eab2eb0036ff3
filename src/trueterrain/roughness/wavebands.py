"""Root mean square of profiles in bands of wavelength, in the style of EN 13036-5.

The body of the standard was not available. The bands below are those of long use in Europe, quoted
from memory of secondary sources; they and the filter can be replaced, and neither was checked
against the standard.
"""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from trueterrain.core.provenance import add_step
from trueterrain.roughness._segments import cut_segments, finite_tracks
from trueterrain.roughness.filters import Butterworth, Filter

__all__ = ["WAVEBANDS", "waveband_rms"]

#: Short, medium and long waves: two octaves each, 0.7 to 2.8, 2.8 to 11.3 and 11.3 to 45.2 m.
WAVEBANDS: dict[str, Filter] = {
    "short": Butterworth(shortest=0.707, longest=2.828),
    "medium": Butterworth(shortest=2.828, longest=11.312),
    "long": Butterworth(shortest=11.312, longest=45.248),
}


def waveband_rms(
    profile: xr.Dataset,
    *,
    bands: Mapping[str, Filter] = WAVEBANDS,
    segment: float | None = None,
) -> xr.Dataset:
    """Root mean square of each track, and of its segments, in bands of wavelength.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m]; equally spaced for the default bands.
    bands : mapping of str to Filter
        Names and band passes.
    segment : float, optional
        Length of fixed segments from the first sample on [m].

    Returns
    -------
    xarray.Dataset
        ``rms`` (track, band) [m]; with `segment` also ``segment_rms`` (track, band, segment) [m]
        with the coordinates ``start``, ``end`` [m] and ``complete`` (segment).

    Raises
    ------
    ValueError
        If `segment` is shorter than the spacing, no band is given, or the samples are too coarse
        for a band.
    SchemaError
        If `profile` is not a Profile, or its spacing is not equal.
    CoverageError
        If a height is not finite, or the profile is shorter than the longest wave of a band.

    Notes
    -----
    The whole profile is filtered once, then the squares of its samples are averaged; within about
    the longest wave of a band from the ends, the values depend on the extension of the profile
    there. The square is the variance of the unevenness in the band, which the standard names LPV.
    A segment without a sample is NaN.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 500.0, 0.1)
    >>> road = make_profile(s, 0.01 * np.sin(2 * np.pi * s / 5.0))
    >>> print((1000 * waveband_rms(road).rms.sel(track="profile")).round(2).values)
    [0.51 6.95 0.17]
    """
    if not bands:
        message = "bands must name at least one band, got none"
        raise ValueError(message)
    station, heights, names = finite_tracks(profile)
    squares = np.array(
        [[band.filtered(station, height) ** 2 for band in bands.values()] for height in heights]
    )
    data = xr.Dataset(
        {"rms": (("track", "band"), np.sqrt(squares.mean(axis=-1)), {"units": "m"})},
        {"track": names, "band": list(bands)},
    )
    if segment is not None:
        segments = cut_segments(station, segment)
        inside = segments.owned(station)
        count = np.diff(inside)
        parts = np.add.reduceat(squares, inside[:-1], axis=-1) / np.maximum(count, 1)
        rms = np.sqrt(np.where(count > 0, parts, np.nan))
        data["segment_rms"] = (("track", "band", "segment"), rms, {"units": "m"})
        data = data.assign_coords(segments.coordinates(np.arange(segments.start.size)))
    parameters = {"bands": bands, "segment": segment}
    return add_step(data, "waveband_rms", parameters=parameters, after=profile)
