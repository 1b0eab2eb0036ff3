"""The ground under a tyre: heights along and across the path, sampled where the tyre needs them."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.geometry.grid_frame import grid_frame, xy_to_uv
from trueterrain.geometry.path import WheelPath
from trueterrain.surface.evaluate import heights_at_uv

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

_FINEST = 1e-3  # [m] between samples, however fine the ground is
_COARSEST = 1e-2  # [m] between samples, however coarse the ground is
_EVEN = 1e-3  # [steps] by which a point may miss equal spacing, as where roughness is rated


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundStrip:
    """Ground along lines parallel to the path, for some path points in a row."""

    height: Float
    "Ground, shape (line, sample) [m]; NaN where there is none."

    step: float
    "Distance between samples along the path [m]."

    first: int
    "Sample that belongs to the first path point."

    stride: int
    "Quantity of samples from one path point to the next."

    count: int
    "Quantity of path points."

    def at_points(self) -> Float:
        """Heights abreast of the path points, shape (line, s) [m]."""
        end = self.first + self.stride * (self.count - 1) + 1
        return self.height[:, self.first : end : self.stride]


class SurfaceLines:
    """Lines on a surface, beside a path.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface.
    path : WheelPath
        Path points.
    offsets : numpy.ndarray, shape (line,)
        Offsets of the lines, left positive [m].
    step : float or None
        Largest distance between samples [m]; None for that of the nodes of the surface.
    """

    def __init__(
        self, surface: xr.Dataset, path: WheelPath, offsets: Float, step: float | None
    ) -> None:
        # once, and not for each part of the path
        self._surface = surface.assign(height=surface["height"].astype(float))
        self._frame = grid_frame(surface)
        self._path = path
        self._heading = np.unwrap(path.heading)
        self.offsets = offsets
        spacing = _equal_spacing(path.s, "the path")
        finest = float(np.diff(self._frame.u).min()) if step is None else step
        self.stride, self.step = _sample_spacing(spacing, finest, step)

    def __len__(self) -> int:
        return len(self._path)

    def samples(self, begin: int, end: int) -> Float:
        """Heights at samples `begin` to `end` (not included), counted from the first path point.

        Beyond its ends the path goes straight on.
        """
        path, last = self._path, len(self._path) - 1
        sample = np.arange(begin, end)
        inside = np.clip(sample, 0, last * self.stride)
        low = np.minimum(inside // self.stride, max(last - 1, 0))
        high = np.minimum(low + 1, last)
        part = (inside - low * self.stride) / self.stride
        beyond = (sample - inside) * self.step

        def between(values: Float) -> Float:
            return np.asarray((1 - part) * values[low] + part * values[high])

        heading = between(self._heading)
        cos, sin = np.cos(heading), np.sin(heading)
        easting = between(path.easting) + beyond * cos - self.offsets[:, None] * sin
        northing = between(path.northing) + beyond * sin + self.offsets[:, None] * cos
        u, v = xy_to_uv(self._frame, easting, northing)
        return heights_at_uv(self._surface, u, v)


class ProfileLine:
    """The one line of a profile: the ground is level across.

    Parameters
    ----------
    s, height : numpy.ndarray, shape (s,)
        Profile, equally spaced [m].
    step : float or None
        Largest distance between samples [m]; None for that of the profile.

    Raises
    ------
    CoverageError
        If the profile is not equally spaced.
    """

    def __init__(self, s: Float, height: Float, step: float | None) -> None:
        self._height = height
        self.offsets = np.zeros(1)
        spacing = _equal_spacing(s, "the profile")
        self.stride, self.step = _sample_spacing(spacing, spacing if step is None else step, step)

    def __len__(self) -> int:
        return self._height.size

    def samples(self, begin: int, end: int) -> Float:
        """Heights at samples `begin` to `end` (not included); NaN beyond the profile."""
        sample = np.arange(begin, end)
        at = sample / self.stride
        low = np.clip(np.floor(at).astype(np.int64), 0, self._height.size - 1)
        high = np.minimum(low + 1, self._height.size - 1)
        part = at - low
        on_node = sample % self.stride == 0
        between = (1 - part) * self._height[low] + part * self._height[high]
        height = np.where(on_node, self._height[low], between)
        height[(sample < 0) | (sample > (self._height.size - 1) * self.stride)] = np.nan
        return np.asarray(height[None, :])


Lines = SurfaceLines | ProfileLine


def strip_under(lines: Lines, begin: int, end: int, reach: float) -> tuple[GroundStrip, Integer]:
    """Ground under a tyre at path points `begin` to `end` (not included).

    Ahead of the path and behind it, where the ground ends, its last height is held.

    Parameters
    ----------
    lines : SurfaceLines or ProfileLine
        Where the ground comes from.
    begin, end : int
        Path points.
    reach : float
        How far ahead of and behind the path point the tyre may touch the ground [m].

    Returns
    -------
    strip : Strip
        Ground, and one sample more than the tyre reaches at either end.
    known : numpy.ndarray, shape (2,)
        First and last sample that is a height of the ground and not held, counted from the first
        path point.
    """
    margin = int(np.ceil(reach / lines.step)) + 2  # where the ground has a slope
    low, high = begin * lines.stride - margin, (end - 1) * lines.stride + margin
    last = (len(lines) - 1) * lines.stride
    height = np.ascontiguousarray(lines.samples(low, high + 1))
    known = np.array([low, high])
    if low < 0:
        known[0] = -_hold_heights(height[:, -low::-1])
    if high > last:
        known[1] = last + _hold_heights(height[:, last - low :])
    strip = GroundStrip(
        height=height,
        step=lines.step,
        first=margin,
        stride=lines.stride,
        count=end - begin,
    )
    return strip, known


def _hold_heights(outward: Float) -> int:
    """Hold the last height of each line, outward from the end of the path; where that begins.

    Changes its argument, a view of the strip.
    """
    missing = np.isnan(outward)
    ground = np.maximum.accumulate(np.where(missing, 0, np.arange(outward.shape[1])), axis=1)
    outward[...] = np.take_along_axis(outward, ground, axis=1)
    filled = (missing & ~missing[:, :1])[:, 1:].any(axis=0)
    return int(np.argmax(filled)) if filled.any() else outward.shape[1] - 1


def _equal_spacing(s: Float, what: str) -> float:
    """Distance between points, which must all be equal."""
    if s.size < 2:
        raise CoverageError(
            f"{what} must have at least 2 points for a tyre to roll on, got {s.size}"
        )
    spacing = float((s[-1] - s[0]) / (s.size - 1))
    missed = np.abs(s - (s[0] + spacing * np.arange(s.size)))
    worst = int(np.argmax(missed))
    if missed[worst] > _EVEN * spacing:
        raise CoverageError(
            f"{what} must be equally spaced for a tyre to roll on, got s = {s[worst]:g} m, "
            f"{missed[worst]:.2g} m beside a multiple of {spacing:g} m",
            cure="Resample it first: `trueterrain convert --spacing`, or `resample_profile`.",
        )
    return spacing


def _sample_spacing(spacing: float, finest: float, asked: float | None) -> tuple[int, float]:
    """Quantity of samples from point to point, and the distance between them."""
    if asked is None:
        asked = min(max(finest, _FINEST), _COARSEST)
    elif not 0 < asked < float("inf"):
        message = f"step must be greater than 0 m, got {asked}."
        raise ValueError(message)
    stride = max(int(np.ceil(spacing / asked - _EVEN)), 1)
    return stride, spacing / stride
