"""Ride Number (RN) of profiles: ride quality as panels rate it, from 0 (impassable) to 5 (perfect).

A quarter car with other constants than the golden car drives over the profile, by the same program;
the root mean square of its rectified slope, the profile index PI, is mapped to the scale of the
panels. ASTM E1489; Sayers and Karamihas, "Estimation of Rideability by Analyzing Longitudinal Road
Profile", Transportation Research Record 1536 (1996).

The body of the standard was not available. The constants are those by which the index is commonly
quoted, and not checked against it; each can be replaced.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.provenance import add_step
from trueterrain.core.renamed import rename_keyword
from trueterrain.roughness._drive import rate_track
from trueterrain.roughness._segments import cut_segments, find_wheel_paths, finite_tracks
from trueterrain.roughness.quarter_car import QuarterCar
from trueterrain.roughness.settings import LeadIn, QuarterCarSettings, require_positive

__all__ = ["RIDE_NUMBER_CAR", "RideNumberSettings", "ride_number"]

#: Car of the Ride Number: a light wheel and a stiff tyre, which respond to waves up to about 10 m.
RIDE_NUMBER_CAR = QuarterCar(
    tyre_stiffness=5120.0, spring_stiffness=390.0, damping=17.0, mass_ratio=0.036
)

Array = npt.NDArray[np.float64]

_SLOPE = {"units": "m/m"}
_ONE = {"units": "1"}


@dataclass(frozen=True, kw_only=True)
class RideNumberSettings(QuarterCarSettings):
    """Conventions and constants of the Ride Number, not checked against the standard.

    Examples
    --------
    >>> RideNumberSettings().car.tyre_stiffness
    5120.0
    >>> RideNumberSettings(steepness=0.0)
    Traceback (most recent call last):
    ValueError: steepness must be finite and greater than 0, got 0.0
    """

    start_length: float = 19.0
    "Length of the chord whose slope is the initial slope, taken as in Sayers's program [m]."

    best: float = 5.0
    "Ride Number of a perfectly smooth road [1]."

    steepness: float = 160.0
    "Decay of the Ride Number with PI: RN = best exp(-steepness PI), PI in m/m [1]."

    max_spacing: float = 0.16
    """Largest distance between samples that is rated [m]: half of 0.32 m, the shortest wave to
    which the car responds with about half of its largest gain."""

    accurate_spacing: ClassVar[float] = 0.05
    """Largest distance between samples that leaves the index accurate [m]: at 0.05 m the profile
    index of roads was off by up to 0.4 %, at 0.1 m by up to 7 %."""

    car: QuarterCar = field(default_factory=lambda: RIDE_NUMBER_CAR)
    "Parameters of the car."

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("start_length", self.start_length, " m")
        for name in ("best", "steepness"):
            require_positive(name, getattr(self, name), "")

    @property
    def lead(self) -> LeadIn:
        """Chord whose slope is the initial slope of the car."""
        return LeadIn(self.start_length, as_program=True)


@rename_keyword("options", "settings")
def ride_number(
    profile: xr.Dataset,
    *,
    settings: RideNumberSettings = RideNumberSettings(),
    segment: float | None = None,
    wheel_paths: Sequence[str] | None = None,
) -> xr.Dataset:
    """Ride Number of each track, of its segments, and of two wheel paths together.

    Parameters
    ----------
    profile : xarray.Dataset
        Profile with dimension s, optionally track [m].
    settings : RideNumberSettings
        Conventions and constants.
    segment : float, optional
        Length of fixed segments from the first sample on [m].
    wheel_paths : sequence of 2 str, optional
        Names of the left and right track. By default both tracks of two, or of more those that are
        named left and right (or l and r, lelev and relev).

    Returns
    -------
    xarray.Dataset
        ``pi`` (track), root mean square of the rectified slope [m/m], and ``rn`` (track) [1];
        ``rn_both``, the Ride Number of both wheel paths, NaN if there are not two. With `segment`
        also ``segment_pi``, ``segment_rn`` (track, segment) and ``segment_rn_both`` (segment), with
        the coordinates ``start``, ``end`` (segment) [m] and ``complete`` (segment), false for a
        shorter last one.

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
    RN = 5 exp(-160 PI), and PI of both wheel paths is the root mean square of theirs. Moving
    average, segments and drive are those of `trueterrain.roughness.iri.iri`. The constants 5 and
    160, those of the car, and the start on 19 m are quoted from memory of secondary sources: none
    was checked against ASTM E1489. Only the mathematics is checked: the frequency response of the
    car, and the recursion of Sayers's program.

    Examples
    --------
    >>> import numpy as np
    >>> from trueterrain.core.schemas import make_profile
    >>> s = np.linspace(0.0, 450.0, 9001)
    >>> left = 0.002 * np.sin(2 * np.pi * s / 5)
    >>> profile = make_profile(s, [left, 0 * left], tracks=["left", "right"])
    >>> rated = ride_number(profile)
    >>> print(rated.rn.values.round(2), round(rated.rn_both.item(), 2))
    [3.46 5.  ] 3.86
    """
    station, heights, names = finite_tracks(profile)
    segments = cut_segments(station, segment)
    rated = [rate_track(station, height, settings, segments, squared=True) for height in heights]
    kept = np.flatnonzero(np.isfinite(rated[0][1]))
    whole = np.array([total for total, _ in rated])
    parts = np.array([part[kept] for _, part in rated])
    paths = find_wheel_paths(names, wheel_paths)
    both, segment_both = np.nan, np.full(kept.size, np.nan)
    if paths is not None:
        both, segment_both = whole[[*paths]].mean(), parts[[*paths]].mean(axis=0)
    data = xr.Dataset(
        {
            "pi": ("track", np.sqrt(whole), _SLOPE),
            "rn": ("track", _from_square(whole, settings), _ONE),
            "rn_both": ((), _from_square(both, settings), _ONE),
        },
        {"track": names},
    )
    if segment is not None:
        data = data.assign(
            segment_pi=(("track", "segment"), np.sqrt(parts), _SLOPE),
            segment_rn=(("track", "segment"), _from_square(parts, settings), _ONE),
            segment_rn_both=("segment", _from_square(segment_both, settings), _ONE),
        ).assign_coords(segments.coordinates(kept))
    parameters = {"options": settings, "segment": segment}
    return add_step(data, "ride_number", parameters=parameters, after=profile)


def _from_square(mean_square: Array | float, settings: RideNumberSettings) -> Array:
    """Ride Number of a mean square of the rectified slope [m²/m²]."""
    return np.asarray(settings.best * np.exp(-settings.steepness * np.sqrt(mean_square)))
