"""Profiles at equal spacing, as filters, spectra and tyres need them."""

import math

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.provenance import add_step
from trueterrain.core.schemas import check_profile, make_profile

Array = npt.NDArray[np.float64]

_ROUNDING = 1e-9  # of a step, by which the last station may lie beyond the profile


def resample_profile(profile: xr.Dataset, spacing: float) -> xr.Dataset:
    """Resample a profile at equal spacing, linearly between its samples.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile of one or several tracks; its samples may be unequally spaced.
    spacing : float
        Distance of the new stations, from the first one on [m].

    Returns
    -------
    xarray.Dataset
        Profile with ``height``, and ``easting``, ``northing`` and ``sd`` if it has them [m]; NaN
        between samples of which one is NaN.

    Raises
    ------
    ValueError
        If the spacing is not greater than 0.
    SchemaError
        If `profile` is not a Profile.
    CoverageError
        If the profile is shorter than the spacing.

    Notes
    -----
    Waves shorter than twice the new spacing are aliased to longer ones: remove them first by
    `filter_profile`. The standard deviation is interpolated as well, which assumes fully correlated
    errors of neighbouring samples and is an upper bound for others.

    Examples
    --------
    >>> uneven = make_profile([0.0, 0.1, 0.3, 0.4], [0.0, 0.01, 0.03, 0.0])
    >>> resample_profile(uneven, 0.1).height.values
    array([0.  , 0.01, 0.02, 0.03, 0.  ])
    """
    if not 0 < spacing < math.inf:
        message = f"spacing must be greater than 0 m, got {spacing}."
        raise ValueError(message)
    check_profile(profile)
    before = profile["s"].values
    count = math.floor((before[-1] - before[0]) / spacing + _ROUNDING)
    if count < 1:
        raise CoverageError(
            f"is {before[-1] - before[0]:g} m long, shorter than the spacing of {spacing:g} m",
            place="axis s",
            cure="Choose a smaller spacing.",
        )
    station = np.minimum(before[0] + spacing * np.arange(count + 1), before[-1])
    tracks = profile["track"].values.tolist() if "track" in profile.dims else None
    kept = {
        name: _interpolate_lines(profile[name].values, before, station)
        for name in ("height", "easting", "northing", "sd")
        if name in profile
    }
    out = make_profile(
        station, kept.pop("height"), tracks=tracks, crs=profile.attrs.get("crs", ""), **kept
    )
    out = out.assign_attrs(profile.attrs | out.attrs)
    return add_step(out, "resample_profile", parameters={"spacing": spacing}, after=profile)


def _interpolate_lines(values: Array, before: Array, station: Array) -> Array:
    """Values on the straight lines between samples, track by track."""
    rows = [np.interp(station, before, row) for row in np.atleast_2d(values)]
    return np.reshape(rows, (*values.shape[:-1], station.size))
