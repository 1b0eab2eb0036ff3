"""Errors of the heights of profiles, station by station; bias and precision of repeats."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.provenance import add_step
from trueterrain.core.renamed import rename_keyword
from trueterrain.core.statistics import nmad
from trueterrain.roughness.agreement._registration import register_pair
from trueterrain.roughness.agreement._signal import ProfileTrack
from trueterrain.roughness.agreement.rating import check_tracks
from trueterrain.roughness.agreement.settings import AgreementSettings

Array = npt.NDArray[np.float64]

Registration = Literal["distance", "shift", "none"]

_LENGTHS = {"units": "m"}
_STATISTICS = ("mean", "rms", "nmad", "p95", "largest")


@rename_keyword("options", "settings")
def height_errors(
    profiles: Mapping[str, xr.Dataset],
    reference: str,
    *,
    registration: Registration = "distance",
    trend: int | None = 1,
    settings: AgreementSettings = AgreementSettings(),
) -> xr.Dataset:
    """Heights of profiles above a reference, after registration of shift, scale and trend.

    Use it where the heights themselves matter; `profile_agreement` compares what a car responds to.

    Parameters
    ----------
    profiles : mapping of str to xarray.Dataset
        Two or more Profiles with their names, all with the same tracks [m].
    reference : str
        Name of the reference.
    registration : {"distance", "shift", "none"}
        Unknowns that maximise the agreement of the filtered profiles: shift and distance-measuring
        error, the shift alone, or none (stations are taken as they are).
    trend : int, optional
        Degree of the polynomial over the stations that is subtracted from each error: 0 for an
        offset, 1 for an inclined line as well; None for nothing.
    settings : AgreementSettings
        Filter by which profiles are registered; heights are compared unfiltered.

    Returns
    -------
    xarray.Dataset
        ``error`` (track, profile, s) [m] at the stations of the reference, NaN outside of a
        profile. Of each track and profile ``mean``, ``rms``, ``nmad`` (1.4826 times the median
        absolute deviation from the median), ``p95`` (magnitude that 95 % do not exceed) and
        ``largest`` magnitude [m], with ``best_shift`` [m] and ``scale`` [m/m]. Over the repeats
        ``mean_error`` and ``sd`` (track, s) [m], and of each track ``bias``, the mean magnitude of
        the mean error, and ``precision``, the mean of the sd [m]; NaN for less than two repeats.
        Both use the stations that all repeats cover.

    Raises
    ------
    ValueError
        If `registration` is unknown, `trend` is negative, or as by `profile_agreement`.
    SchemaError, CoverageError
        As by `profile_agreement`, or if a profile does not overlap with the reference.

    Notes
    -----
    Profiles are linear between their samples. `bias` and `precision` are computed as those of ASTM
    E950 are commonly described: the mean over stations of the magnitude of the mean error, and of
    the standard deviation of repeats (n - 1 degrees of freedom). The text of the standard could not
    be read; filter profiles to a waveband first if it requires one.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 100.0, 0.05)
    >>> road = 0.01 * np.sin(s)
    >>> runs = {"R": road, "1": road + 0.001 * (s > 50), "2": road - 0.001 * (s > 50)}
    >>> runs = {name: make_profile(s, height) for name, height in runs.items()}
    >>> found = height_errors(runs, "R", registration="none", trend=None)
    >>> print((1000 * found.rms.values).round(2), f"{1000 * found.bias.item():.2f} mm")
    [[0.71 0.71]] 0.00 mm
    """
    if registration not in ("distance", "shift", "none"):
        message = f"registration must be distance, shift or none, got {registration!r}"
        raise ValueError(message)
    if trend is not None and trend < 0:
        message = f"trend must be a degree of at least 0, or None, got {trend}"
        raise ValueError(message)
    tracks = check_tracks(profiles, reference, settings)
    names = [name for name in profiles if name != reference]
    labels = list(tracks[reference])
    station = tracks[reference][labels[0]].station
    error = np.full((len(labels), len(names), station.size), np.nan)
    placed = np.zeros((2, len(labels), len(names)))
    for row, label in enumerate(labels):
        for column, name in enumerate(names):
            first, second = tracks[reference][label], tracks[name][label]
            shift, scale = _station_mapping(first, second, registration, settings)
            placed[:, row, column] = shift, scale
            error[row, column] = _height_above(first, second, shift, scale, trend)
    data = _describe_errors(error, station, labels, names).assign(
        best_shift=(("track", "profile"), placed[0], _LENGTHS),
        scale=(("track", "profile"), placed[1], {"units": "m/m"}),
    )
    parameters = {
        "reference": reference,
        "registration": registration,
        "trend": trend,
        "options": settings,
    }
    return add_step(data, "height_errors", parameters=parameters)


def _station_mapping(
    first: ProfileTrack,
    second: ProfileTrack,
    registration: Registration,
    settings: AgreementSettings,
) -> tuple[float, float]:
    """Shift at the first station of the reference [m], and scale [m/m]."""
    if registration == "none":
        return 0.0, 0.0
    pair = register_pair(first, second, settings)
    if registration == "shift" or not np.isfinite(pair.scale):
        return pair.shift, 0.0
    # from the first station after the transient back to that of the track
    transient = pair.starts[0] - float(first.station[0])
    return pair.corrected_shift - pair.scale * transient, pair.scale


def _height_above(
    first: ProfileTrack, second: ProfileTrack, shift: float, scale: float, trend: int | None
) -> Array:
    """Height of the second above the first at the stations of the first; NaN outside of it."""
    at = first.station + shift + scale * (first.station - first.station[0])
    there = np.interp(at, second.station, second.height, left=np.nan, right=np.nan)
    error = there - first.height
    known = np.isfinite(error)
    if np.count_nonzero(known) <= (trend or 0):
        ends = [f"{t.station[0]:g} to {t.station[-1]:g} m" for t in (first, second)]
        raise CoverageError(
            f"do not overlap: {ends[0]}, and {ends[1]}",
            place=f"{first.name} and {second.name}",
            cure="Count stations from the start of each profile.",
        )
    if trend is not None:
        # stations scaled to -1 to 1, for a well-conditioned design
        unit = np.interp(first.station, first.station[[0, -1]], [-1.0, 1.0])
        powers = np.vander(unit, trend + 1)
        error = error - powers @ np.linalg.lstsq(powers[known], error[known], rcond=None)[0]
    return np.asarray(error)


def _describe_errors(
    error: Array, station: Array, labels: list[str], names: list[str]
) -> xr.Dataset:
    """Errors with their statistics, of each profile and over repeats."""
    statistics = np.array([[_error_statistics(one) for one in track] for track in error])
    mean, sd = error.mean(axis=1), np.full_like(error[:, 0], np.nan)
    if len(names) > 1:
        sd = np.where(np.isfinite(mean), error.std(axis=1, ddof=1), np.nan)
    else:
        mean = np.full_like(mean, np.nan)
    data = xr.Dataset(
        {
            "error": (("track", "profile", "s"), error, _LENGTHS),
            "mean_error": (("track", "s"), mean, _LENGTHS),
            "sd": (("track", "s"), sd, _LENGTHS),
            "bias": ("track", _row_means(np.abs(mean)), _LENGTHS),
            "precision": ("track", _row_means(sd), _LENGTHS),
        },
        {"track": labels, "profile": names, "s": ("s", station, _LENGTHS)},
    )
    return data.assign(
        {
            name: (("track", "profile"), statistics[..., at], _LENGTHS)
            for at, name in enumerate(_STATISTICS)
        }
    )


def _row_means(rows: Array) -> Array:
    """Mean of the finite values of each row; NaN if there are none."""
    known = [row[np.isfinite(row)] for row in rows]
    return np.array([row.mean() if row.size else np.nan for row in known])


def _error_statistics(error: Array) -> tuple[float, ...]:
    known = error[np.isfinite(error)]
    size = np.abs(known)
    return (
        float(known.mean()),
        float(np.sqrt(np.mean(known**2))),
        nmad(known),
        float(np.percentile(size, 95)),
        float(size.max()),
    )
