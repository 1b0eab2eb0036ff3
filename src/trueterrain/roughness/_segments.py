"""Tracks, wheel paths and segments of a profile, as all indices use them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import check_profile

Array = npt.NDArray[np.float64]

# Fraction of the spacing by which a station may miss a sample, because of rounding, and still count
# as that sample [1]
ROUNDING = 1e-6

# Names that mark the wheel paths in a profile of more than two tracks
_LEFT = ("left", "l", "lelev", "lelev.")
_RIGHT = ("right", "r", "relev", "relev.")


def finite_tracks(profile: xr.Dataset) -> tuple[Array, list[Array], list[str]]:
    """Stations [m], the heights of each track [m], all of them finite, and their names."""
    check_profile(profile)
    station = np.ascontiguousarray(profile["s"], dtype=float)
    if "track" in profile.dims:
        count = profile.sizes["track"]
        known = "track" in profile.coords
        names = [str(name) for name in profile["track"].values] if known else []
        names = names or [f"track {number}" for number in range(1, count + 1)]
    else:
        names = [str(profile.attrs.get("track", "profile"))]
    block = np.asarray(profile["height"], dtype=float).reshape(len(names), station.size)
    heights = [np.ascontiguousarray(height) for height in block]
    if not heights:
        raise SchemaError("must have at least one track", place="axis track")
    for name, height in zip(names, heights, strict=True):
        bad = ~np.isfinite(height)
        if bad.any():
            message = f"has no finite height ({int(bad.sum())} of {bad.size} samples have none)"
            raise CoverageError(
                message,
                place=f"track {name}, s = {station[int(bad.argmax())]:g} m",
                cure="Fill the gap, or rate the profile before and after it separately.",
            )
    return station, heights, names


def find_wheel_paths(names: list[str], asked: Sequence[str] | None) -> tuple[int, int] | None:
    """Indices of the left and the right wheel path among the tracks, None if there are not two."""
    if asked is not None:
        if len(asked) != 2 or asked[0] == asked[1] or not set(asked) <= set(names):
            message = (
                f"wheel_paths must name two of the tracks {', '.join(names)}, "
                f"got {', '.join(asked)}"
            )
            raise ValueError(message)
        return names.index(asked[0]), names.index(asked[1])
    if len(names) == 2:
        return 0, 1
    lower = [name.strip().lower() for name in names]
    left = [at for at, name in enumerate(lower) if name in _LEFT]
    right = [at for at, name in enumerate(lower) if name in _RIGHT]
    return (left[0], right[0]) if len(left) == len(right) == 1 else None


@dataclass(frozen=True, kw_only=True)
class FixedSegments:
    """Consecutive segments of equal length, from the first sample on."""

    start: Array
    "First station of each [m]."

    end: Array
    "Last station of each [m]."

    complete: npt.NDArray[np.bool_]
    "False for a last segment that is shorter than the others."

    @property
    def edges(self) -> Array:
        """Stations at which segments meet, with both ends [m]."""
        return np.append(self.start, self.end[-1:])

    def owned(self, station: Array) -> npt.NDArray[np.intp]:
        """First sample of each, and the number of samples; a sample at a joint begins the next."""
        slack = ROUNDING * float(station[-1] - station[0]) / (station.size - 1)
        first = np.searchsorted(station, self.edges - slack)
        return np.append(first[:-1], station.size)

    def coordinates(self, kept: npt.NDArray[np.intp]) -> dict[str, tuple[object, ...]]:
        """Coordinates of a dataset with the dimension segment, of the segments `kept`."""
        return {
            "start": ("segment", self.start[kept], {"units": "m"}),
            "end": ("segment", self.end[kept], {"units": "m"}),
            "complete": ("segment", self.complete[kept]),
        }


def cut_segments(station: Array, length: float | None) -> FixedSegments:
    """Divide a track into segments of a length [m]; none if it is None."""
    if length is None:
        return FixedSegments(start=np.empty(0), end=np.empty(0), complete=np.empty(0, dtype=bool))
    extent = float(station[-1] - station[0])
    spacing = extent / max(station.size - 1, 1)
    if not (np.isfinite(length) and length >= spacing and length > 0):
        message = f"segment must be finite and at least the spacing {spacing:g} m, got {length}"
        raise ValueError(message)
    whole = math.floor((extent + ROUNDING * spacing) / length)
    edges = station[0] + length * np.arange(whole + 1)
    complete = np.ones(whole, dtype=bool)
    if station[-1] - edges[-1] > ROUNDING * spacing:
        edges = np.append(edges, station[-1])
        complete = np.append(complete, False)
    return FixedSegments(start=edges[:-1], end=edges[1:], complete=complete)


def sample_range(station: Array, start: float, end: float) -> slice:
    """Samples from a start to an end [m], both included within rounding."""
    slack = ROUNDING * float(station[-1] - station[0]) / (station.size - 1)
    first = int(np.searchsorted(station, start - slack))
    stop = int(np.searchsorted(station, end + slack, side="right"))
    return slice(first, stop)
