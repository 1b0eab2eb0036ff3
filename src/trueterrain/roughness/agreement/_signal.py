"""Tracks of profiles, filtered and resampled at equal spacing."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, TrueTerrainError
from trueterrain.roughness._drive import drive_profile, equal_step, step_response
from trueterrain.roughness._segments import finite_tracks
from trueterrain.roughness.agreement.settings import AgreementSettings
from trueterrain.roughness.filters import Filter
from trueterrain.roughness.settings import QuarterCarSettings

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]

_SINGLE = "profile"  # name of the track of profiles that have one
_EQUAL = 1e-3  # [steps] that a station may be away from equal spacing
_MIN_SAMPLES = 4  # of a cubic spline


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileTrack:
    """One track of a profile, as measured."""

    name: str
    "Name of the profile and of the track, for messages."

    station: Array
    "Distance along the path [m]."

    height: Array
    "Heights [m]."

    @property
    def length(self) -> float:
        """From the first to the last station [m]."""
        return float(self.station[-1] - self.station[0])

    @property
    def spacing(self) -> float:
        """Median distance between samples [m]."""
        return float(np.median(np.diff(self.station)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FilteredSignal:
    """A filtered track at equal spacing."""

    name: str
    "Name of the profile and of the track, for messages."

    start: float
    "First station [m]."

    step: float
    "Spacing [m]."

    values: Array
    "Filtered slope [m/m] or height [m], less its mean."

    @property
    def length(self) -> float:
        """From the first to the last station [m]."""
        return (self.values.size - 1) * self.step

    @property
    def station(self) -> Array:
        """Stations [m]."""
        return np.asarray(self.start + self.step * np.arange(self.values.size))

    @cached_property
    def spline(self) -> "CubicSpline":
        """Cubic spline of the values over the stations."""
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.station, self.values)

    @cached_property
    def cubics(self) -> Array:
        """Coefficients of the spline, highest power first, shape (4, n - 1)."""
        return np.ascontiguousarray(self.spline.c)


def tracks_of(name: str, profile: xr.Dataset, *, from_zero: bool) -> dict[str, ProfileTrack]:
    """Tracks of a profile by name; one alone is called "profile"."""
    with _name_profile(name):
        station, heights, labels = finite_tracks(profile)
    if from_zero:
        station = station - station[0]
    if len(labels) == 1:
        return {_SINGLE: ProfileTrack(name=name, station=station, height=heights[0])}
    return {
        label: ProfileTrack(name=f"{name}, track {label}", station=station, height=height)
        for label, height in zip(labels, heights, strict=True)
    }


def signal_of(track: ProfileTrack, settings: AgreementSettings, step: float) -> FilteredSignal:
    """Filter a track, without the transient, and resample it at equal spacing."""
    at, values = _steady_signal(track, settings)
    if not np.isfinite(values).all() or np.ptp(values) == 0:
        message = "is flat: the filter leaves nothing to compare"
        raise CoverageError(message, place=track.name)
    equal = equal_step(at, _EQUAL)
    if equal is None or abs(equal - step) * at.size > _EQUAL * step:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(at, values)
        at = at[0] + step * np.arange(int((at[-1] - at[0]) / step + _EQUAL) + 1)
        values = spline(at)
    return FilteredSignal(
        name=track.name, start=float(at[0]), step=step, values=values - values.mean()
    )


def _steady_signal(track: ProfileTrack, settings: AgreementSettings) -> tuple[Array, Array]:
    """Stations [m] and values of a filtered track without the transient of the filter."""
    is_car = isinstance(settings.filter, QuarterCarSettings)
    transient = settings.transient_length
    left_out = transient if is_car or settings.filter is None else 2 * transient
    min_length = left_out + settings.min_overlap
    if track.station.size < _MIN_SAMPLES or track.length < min_length:
        message = (
            f"is {track.length:g} m long, which must be at least {min_length:g} m: {left_out:g} m "
            f"for the transient of the filter, and {settings.min_overlap:g} m to be compared"
        )
        cure = "Choose a shorter transient, or a longer profile."
        raise CoverageError(message, place=track.name, cure=cure)
    with _name_profile(track.name):
        at, values = _filter_track(track, settings.filter)
    first, last = track.station[0] + transient, track.station[-1]
    keep = (at >= first) & (at <= (last if is_car else last - transient))
    if np.count_nonzero(keep) < _MIN_SAMPLES:
        message = f"the filter leaves less than {_MIN_SAMPLES} of {track.station.size} samples"
        raise CoverageError(message, place=track.name, cure="Choose a shorter transient.")
    return at[keep], values[keep]


def _filter_track(
    track: ProfileTrack, by: QuarterCarSettings | Filter | None
) -> tuple[Array, Array]:
    """Stations [m] and values of a filtered track.

    A value of a car belongs to the centre of its moving average. Sayers's program assigns it to the
    first sample of the average, whose length depends on the spacing: profilers of different spacing
    would seem to be shifted by centimetres.
    """
    if by is None:
        return track.station, track.height
    if isinstance(by, Filter):
        return track.station, by.filtered(track.station, track.height)
    drive = drive_profile(track.station, track.height, by)
    to_centre = 0.0 if drive.step is None else 0.5 * (drive.base - 1) * drive.step
    return drive.station[1:] + to_centre, step_response(drive)


@contextmanager
def _name_profile(name: str) -> Iterator[None]:
    """Name a profile in the errors of a block."""
    try:
        yield
    except TrueTerrainError as error:
        error.place = name if error.place is None else f"{name}: {error.place}"
        raise
