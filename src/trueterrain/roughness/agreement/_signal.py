"""Tracks of profiles, filtered and put on equal spacing."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, TrueTerrainError
from trueterrain.roughness._track import (
    QuarterCarSettings,
    drive_profile,
    equal_step,
    step_response,
)
from trueterrain.roughness._tracks import finite_tracks
from trueterrain.roughness.agreement.options import AgreementSettings
from trueterrain.roughness.filters import Filter

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]

_SINGLE = "profile"  # name of the track of profiles that have one
_EQUAL = 1e-3  # [steps] that a station may be away from equal spacing
_FEWEST = 4  # samples of a cubic spline


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileTrack:
    """One track of a profile, as it was measured."""

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
    "What is compared, less its mean."

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
        """Values between the stations."""
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


def signal_of(track: ProfileTrack, options: AgreementSettings, step: float) -> FilteredSignal:
    """A track behind the filter, at equal spacing."""
    at, values = _settled_signal(track, options)
    if not np.isfinite(values).all() or np.ptp(values) == 0:
        message = "is flat: behind the filter there is nothing to compare"
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


def _settled_signal(track: ProfileTrack, options: AgreementSettings) -> tuple[Array, Array]:
    """Stations [m] and values of a track behind the filter, where that has settled."""
    car = isinstance(options.filter, QuarterCarSettings)
    left_out = options.settled if car or options.filter is None else 2 * options.settled
    least = left_out + options.min_overlap
    if track.station.size < _FEWEST or track.length < least:
        message = (
            f"is {track.length:g} m long, which must be at least {least:g} m: {left_out:g} m in "
            f"which the filter settles, and {options.min_overlap:g} m to be compared"
        )
        cure = "Choose a shorter settling length, or a longer profile."
        raise CoverageError(message, place=track.name, cure=cure)
    with _name_profile(track.name):
        at, values = _filter_track(track, options.filter)
    first, last = track.station[0] + options.settled, track.station[-1]
    keep = (at >= first) & (at <= (last if car else last - options.settled))
    if np.count_nonzero(keep) < _FEWEST:
        message = f"the filter leaves less than {_FEWEST} of {track.station.size} samples"
        raise CoverageError(message, place=track.name, cure="Choose a shorter settling length.")
    return at[keep], values[keep]


def _filter_track(
    track: ProfileTrack, by: QuarterCarSettings | Filter | None
) -> tuple[Array, Array]:
    """Stations [m] and values of a track behind a filter.

    Each value of a car stands where the middle of its moving average is: that of Sayers's program
    reaches forward from the station that a value is given there, by a length that depends on the
    spacing, and profilers of different spacing would seem to be shifted by centimetres.
    """
    if by is None:
        return track.station, track.height
    if isinstance(by, Filter):
        return track.station, by.filtered(track.station, track.height)
    way = drive_profile(track.station, track.height, by)
    ahead = 0.0 if way.step is None else 0.5 * (way.base - 1) * way.step
    return way.station[1:] + ahead, step_response(way)


@contextmanager
def _name_profile(name: str) -> Iterator[None]:
    """Name a profile in the errors of a block."""
    try:
        yield
    except TrueTerrainError as error:
        error.place = name if error.place is None else f"{name}: {error.place}"
        raise
