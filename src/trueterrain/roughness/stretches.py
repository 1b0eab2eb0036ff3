"""Localised roughness: stretches above a threshold, and the histogram of segment indices."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError
from trueterrain.core.provenance import add_step
from trueterrain.core.renamed import rename_keyword
from trueterrain.roughness.iri import IN_PER_MI, continuous_iri
from trueterrain.roughness.settings import IriSettings, require_positive

__all__ = [
    "LONG_CONTINUOUS",
    "SHORT_CONTINUOUS",
    "find_stretches",
    "iri_histogram",
    "localised_roughness",
]

Array = npt.NDArray[np.float64]

#: Window [m] and threshold [m/km] that ProVAL offers for short continuous roughness reports, 25 ft
#: and 90 in/mi, and for long ones, 528 ft and 50 in/mi. Agencies set their own.
SHORT_CONTINUOUS = (7.62, 90.0 / IN_PER_MI)
LONG_CONTINUOUS = (160.9344, 50.0 / IN_PER_MI)


@rename_keyword("options", "settings")
def localised_roughness(
    profile: xr.Dataset,
    threshold: float,
    *,
    length: float = SHORT_CONTINUOUS[0],
    settings: IriSettings = IriSettings(),
) -> xr.Dataset:
    """Stretches of each track where the IRI in a sliding window exceeds a threshold.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].
    threshold : float
        International Roughness Index that is exceeded [m/km].
    length : float
        Length of the window [m]; 7.62 m (25 ft) by default.
    settings : IriSettings
        Conventions of the index.

    Returns
    -------
    xarray.Dataset
        As of `find_stretches`, the peak in m/km.

    Raises
    ------
    ValueError
        If `threshold` or `length` is not greater than 0, or ``settings.restart`` is true.
    SchemaError
        If `profile` is not a Profile, or its spacing is unequal and the window needs it equal.
    CoverageError
        If a height is not finite, or the profile is shorter than `length`.

    Notes
    -----
    The index of a window belongs to its midpoint, and so do stretches; the rough ground itself may
    lie up to half a window before or after. Moving average and start of the car are those of
    `trueterrain.roughness.iri.continuous_iri`, whose first metres carry the transient of the start.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 300.0, 0.05)
    >>> bump = make_profile(s, 0.02 * np.exp(-((s - 150.0) ** 2)))  # 20 mm high, 2 m long
    >>> rough = localised_roughness(bump, 5.0)
    >>> print(rough.start.values.round(1), rough.end.values.round(1), rough.peak.values.round(1))
    [147.4] [154.3] [7.2]
    """
    require_positive("threshold", threshold, " m/km")
    sliding = continuous_iri(profile, length, settings=settings)
    data = find_stretches(sliding["iri"], threshold)
    parameters = {"threshold": threshold, "length": length, "options": settings}
    return add_step(data, "localised_roughness", parameters=parameters, after=profile)


def find_stretches(values: xr.DataArray, threshold: float) -> xr.Dataset:
    """Stretches of each track where values along it exceed a threshold.

    Parameters
    ----------
    values : xarray.DataArray, dims (track, s)
        ``iri`` of `continuous_iri`, or abs of the ``deviation`` of `rolling_straightedge`.
    threshold : float
        Threshold, in the unit of the values.

    Returns
    -------
    xarray.Dataset
        Dimension stretch, in the order of tracks and stations: ``start``, ``end`` [m], where the
        straight line between two values crosses the threshold; ``peak``, the highest value, and
        ``peak_at`` [m]; ``track``, the name of the track. Empty if no value exceeds the threshold.

    Raises
    ------
    SchemaError
        If the values do not have the dimensions track and s.

    Examples
    --------
    >>> values = xr.DataArray([[0.0, 2.0, 3.0, 1.0]], {"track": ["a"], "s": [0.0, 1, 2, 3]})
    >>> found = find_stretches(values, 2.5)
    >>> print(found.start.values, found.end.values, found.peak.values)
    [1.5] [2.25] [3.]
    """
    if values.dims != ("track", "s"):
        found = ", ".join(str(dim) for dim in values.dims)
        raise SchemaError(f"must have the dimensions (track, s), got ({found})", place="values")
    station = np.asarray(values["s"], dtype=float)
    rows = [
        (*row, str(name))
        for name, track in zip(values["track"].values, np.asarray(values), strict=True)
        for row in _stretches_above(station, track, threshold)
    ]
    table = np.array([row[:4] for row in rows], dtype=float).reshape(-1, 4).T
    metre, unit = {"units": "m"}, {"units": str(values.attrs.get("units", ""))}
    return xr.Dataset(
        {
            "start": ("stretch", table[0], metre),
            "end": ("stretch", table[1], metre),
            "peak": ("stretch", table[2], unit),
            "peak_at": ("stretch", table[3], metre),
        },
        {"track": ("stretch", np.array([row[4] for row in rows], dtype=np.str_))},
    )


def iri_histogram(index: xr.Dataset, edges: Sequence[float] | Array) -> xr.Dataset:
    """Histogram of the IRI of segments: length of each track in classes of roughness.

    Parameters
    ----------
    index : xarray.Dataset
        Result of `trueterrain.roughness.iri.iri` with a segment length.
    edges : sequence of float
        Limits between classes of roughness, ascending [m/km]. The first class begins at 0, the last
        has no upper limit.

    Returns
    -------
    xarray.Dataset
        ``length`` (track, class) [m] and ``fraction`` (track, class) [1] of the segments whose IRI
        lies in the class, with the coordinates ``above`` and ``below`` (class) [m/km]; a value on
        a limit belongs to the rougher class.

    Raises
    ------
    ValueError
        If the index has no segments, or the edges do not ascend from above 0.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness.iri import iri
    >>> s = np.arange(0.0, 400.0, 0.1)
    >>> half = make_profile(s, np.where(s < 200, 0.0, 0.01 * np.sin(2 * np.pi * s / 15)))
    >>> print(iri_histogram(iri(half, segment=20.0), [1.0, 2.0]).fraction.values.round(2))
    [[0.5 0.  0.5]]
    """
    if "segment_iri" not in index:
        message = "index must hold segments: call iri(profile, segment=...), got none."
        raise ValueError(message)
    limits = np.asarray(edges, dtype=float)
    if limits.ndim != 1 or limits.size == 0 or not (np.diff(limits, prepend=0.0) > 0).all():
        message = f"edges must be numbers that ascend from above 0 m/km, got {edges}"
        raise ValueError(message)
    width = np.asarray(index["end"] - index["start"], dtype=float)
    which = np.searchsorted(limits, index["segment_iri"].values, side="right")
    length = np.array([np.bincount(row, width, limits.size + 1) for row in which])
    unit = {"units": "m/km"}
    return xr.Dataset(
        {
            "length": (("track", "class"), length, {"units": "m"}),
            "fraction": (("track", "class"), length / width.sum(), {"units": "1"}),
        },
        {
            "track": index["track"].values,
            "above": ("class", np.append(0.0, limits), unit),
            "below": ("class", np.append(limits, np.inf), unit),
        },
    )


def _stretches_above(station: Array, values: Array, threshold: float) -> list[tuple[float, ...]]:
    """Start, end, peak and station of the peak of each stretch above the threshold."""
    inside = np.concatenate([[False], values > threshold, [False]])
    first = np.flatnonzero(inside[1:] & ~inside[:-1])
    stop = np.flatnonzero(inside[:-1] & ~inside[1:])
    found: list[tuple[float, ...]] = []
    for begin, end in zip(first.tolist(), stop.tolist(), strict=True):
        top = begin + int(np.argmax(values[begin:end]))
        low, high = station[0], station[-1]
        if begin > 0:
            low = _threshold_crossing(station, values, threshold, begin)
        if end < values.size:
            high = _threshold_crossing(station, values, threshold, end)
        found.append((float(low), float(high), float(values[top]), float(station[top])))
    return found


def _threshold_crossing(station: Array, values: Array, threshold: float, at: int) -> float:
    """Station at which the line from value `at` - 1 to value `at` crosses the threshold."""
    fraction = (threshold - values[at - 1]) / (values[at] - values[at - 1])
    return float(station[at - 1] + fraction * (station[at] - station[at - 1]))
