"""International Roughness Index (IRI) of profiles.

The index is the mean rectified slope of the golden car at 80 km/h: the suspension travel summed
over the road, per length of road [m/km]. It is computed as by the program of Sayers, "On the
Calculation of International Roughness Index from Longitudinal Road Profile", Transportation
Research Record 1501 (1995), which ASTM E1926 adopted; the body of the standard itself was not
available for comparison. Deviations from that program are settings, and off by default.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.provenance import add_step
from trueterrain.core.renamed import rename_keyword
from trueterrain.roughness._drive import ProfileDrive, drive_profile, rate_track, step_response
from trueterrain.roughness._segments import ROUNDING, cut_segments, find_wheel_paths, finite_tracks
from trueterrain.roughness.settings import IriSettings, require_positive

__all__ = ["IN_PER_MI", "IriSettings", "continuous_iri", "iri"]

#: 1 m/km in inches per mile [in/mi].
IN_PER_MI = 63.36

Array = npt.NDArray[np.float64]

_M_PER_KM = 1000.0
_UNIT = {"units": "m/km"}


@rename_keyword("options", "settings")
def iri(
    profile: xr.Dataset,
    *,
    settings: IriSettings = IriSettings(),
    segment: float | None = None,
    wheel_paths: Sequence[str] | None = None,
) -> xr.Dataset:
    """International Roughness Index of each track, of its segments, and of two wheel paths.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].
    settings : IriSettings
        Conventions; by default those of Sayers's program.
    segment : float, optional
        Length of fixed segments from the first sample on [m].
    wheel_paths : sequence of 2 str, optional
        Names of the left and right track. By default both tracks of two, or of more those that are
        named left and right (or l and r, lelev and relev).

    Returns
    -------
    xarray.Dataset
        ``iri`` (track) [m/km]; ``mri``, mean of the IRI of both wheel paths, and ``hri``, IRI of
        their pointwise mean [m/km], NaN if there are not two. With `segment` also ``segment_iri``
        (track, segment), ``segment_mri`` and ``segment_hri`` (segment) [m/km], with the coordinates
        ``start``, ``end`` (segment) [m] and ``complete`` (segment), false for a shorter last one.

    Raises
    ------
    ValueError
        If `segment` is shorter than the spacing, or `wheel_paths` does not name two tracks.
    SchemaError
        If `profile` is not a Profile, or its spacing is unequal and the window needs it equal.
    CoverageError
        If a height is not finite, or the profile is too short or has samples farther apart than
        ``settings.max_spacing``.

    Notes
    -----
    One car drives over the whole profile, and its rectified slope is averaged per segment, weighted
    with the length of each step (``IriSettings(restart=True)`` starts a new car in each segment,
    over the samples from its start to its end). The output at the end of a step stands for the
    whole step, as in the program; where a segment ends between two samples, the profile is straight
    and the output there stands for the part of the step before it. A segment is rated over those of
    its steps that the moving average leaves: the Sayers window removes nint(length / spacing) - 1
    steps at the end of the profile (a value belongs to the station at which its window begins, as
    in the program), the exact window half its length at both ends. A last segment without any step
    is dropped.

    The names MRI and HRI are those of Sayers, "Two Quarter-Car Models for Defining Road Roughness:
    IRI and HRI", Transportation Research Record 1215 (1989); HRI was not checked against the text
    of a standard.

    Examples
    --------
    >>> import numpy as np
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.linspace(0.0, 450.0, 9001)
    >>> left = 0.005 * np.sin(2 * np.pi * s / 15)
    >>> profile = make_profile(s, [left, -left], tracks=["left", "right"])
    >>> index = iri(profile, segment=150.0)
    >>> print(index.segment_iri.sel(track="left").values.round(3))  # the first has the transient
    [1.982 2.035 2.036]
    >>> print(f"MRI {index.mri.item():.3f} m/km, HRI {index.hri.item():.3f} m/km")
    MRI 2.018 m/km, HRI 0.000 m/km
    """
    station, heights, names = finite_tracks(profile)
    segments = cut_segments(station, segment)
    rated = [rate_track(station, height, settings, segments) for height in heights]
    paths = find_wheel_paths(names, wheel_paths)
    kept = np.flatnonzero(np.isfinite(rated[0][1]))
    whole = _M_PER_KM * np.array([total for total, _ in rated])
    parts = _M_PER_KM * np.array([part[kept] for _, part in rated])
    mri, hri = np.nan, np.nan
    segment_mri = segment_hri = np.full(kept.size, np.nan)
    if paths is not None:
        left, right = paths
        mri, segment_mri = whole[[left, right]].mean(), parts[[left, right]].mean(axis=0)
        mean_path = 0.5 * (heights[left] + heights[right])
        total, part = rate_track(station, mean_path, settings, segments)
        hri, segment_hri = _M_PER_KM * total, _M_PER_KM * part[kept]
    data = xr.Dataset(
        {"iri": ("track", whole, _UNIT), "mri": ((), mri, _UNIT), "hri": ((), hri, _UNIT)},
        {"track": names},
    )
    if segment is not None:
        data = data.assign(
            segment_iri=(("track", "segment"), parts, _UNIT),
            segment_mri=("segment", segment_mri, _UNIT),
            segment_hri=("segment", segment_hri, _UNIT),
        ).assign_coords(segments.coordinates(kept))
    return add_step(
        data, "iri", parameters={"options": settings, "segment": segment}, after=profile
    )


@rename_keyword("options", "settings")
def continuous_iri(
    profile: xr.Dataset,
    length: float,
    *,
    step: float | None = None,
    settings: IriSettings = IriSettings(),
) -> xr.Dataset:
    """International Roughness Index in a sliding window along each track.

    Shows where a profile is rough, with the resolution of the window.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].
    length : float
        Length of the window [m].
    step : float, optional
        Distance from one window to the next [m]; by default the mean spacing of the samples.
    settings : IriSettings
        Conventions; by default those of Sayers's program.

    Returns
    -------
    xarray.Dataset
        ``iri`` (track, s) [m/km]; s is the midpoint of the window [m], with the coordinates
        ``start`` and ``end`` (s) [m]. Only windows that lie wholly on what the moving average
        leaves.

    Raises
    ------
    ValueError
        If `length` or `step` is not greater than 0, or ``settings.restart`` is true.
    SchemaError
        If `profile` is not a Profile, or its spacing is unequal and the window needs it equal.
    CoverageError
        If a height is not finite, the profile is shorter than `length`, or has samples farther
        apart than ``settings.max_spacing``.

    Notes
    -----
    One car drives over the whole profile, as in `iri`; its output is integrated once, and windows
    are differences of the integral. A window that ends between two samples takes its fraction of
    the step.

    Examples
    --------
    >>> import numpy as np
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.arange(0.0, 300.0, 0.05)
    >>> profile = make_profile(s, np.where(s < 150, 0.0, 0.02))  # a step of 20 mm
    >>> sliding = continuous_iri(profile, 25.0, step=1.0)
    >>> worst = sliding.iri.sel(track="profile").idxmax("s")
    >>> print(sliding.start.sel(s=worst).item(), sliding.end.sel(s=worst).item())
    149.0 174.0
    """
    for name, value in (("length", length), ("step", step)):
        if value is not None:
            require_positive(name, value, " m")
    if settings.restart:
        message = "restart must be false for a sliding window, got True"
        raise ValueError(message)
    station, heights, names = finite_tracks(profile)
    rows = []
    for height in heights:
        drive = drive_profile(station, height, settings)
        starts = _window_starts(drive, length, step)
        rows.append(_sliding_iri(drive, starts, length))
    data = xr.Dataset(
        {"iri": (("track", "s"), np.array(rows), _UNIT)},
        {
            "track": names,
            "s": ("s", starts + 0.5 * length, {"units": "m"}),
            "start": ("s", starts, {"units": "m"}),
            "end": ("s", starts + length, {"units": "m"}),
        },
    )
    parameters = {"options": settings, "length": length, "step": step}
    return add_step(data, "continuous_iri", parameters=parameters, after=profile)


def _window_starts(drive: ProfileDrive, length: float, step: float | None) -> Array:
    """Stations at which the windows begin [m]."""
    extent = float(drive.station[-1] - drive.station[0])
    spacing = extent / (drive.station.size - 1)
    if extent + ROUNDING * spacing < length:
        message = f"is shorter than the window: {extent:g} m, which must be at least {length:g} m"
        raise CoverageError(message, place="axis s", cure="Choose a shorter window.")
    distance = spacing if step is None else step
    count = math.floor((extent - length) / distance + ROUNDING) + 1
    starts: Array = drive.station[0] + distance * np.arange(count)
    return starts


def _sliding_iri(drive: ProfileDrive, starts: Array, length: float) -> Array:
    travel = abs(step_response(drive)) * np.diff(drive.station)
    integral = np.concatenate([[0.0], np.cumsum(travel)])
    at_edges = np.interp([starts, starts + length], drive.station, integral)
    rated: Array = _M_PER_KM * (at_edges[1] - at_edges[0]) / length
    return rated
