"""Ground under a tyre: heights along lines parallel to the path, at equal spacing."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.geometry.curve import PlaneCurve
from trueterrain.geometry.grid_frame import grid_frame, xy_to_uv
from trueterrain.surface.evaluate import heights_at_uv

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

_MIN_STEP = 1e-3  # [m] between samples by default
_MAX_STEP = 1e-2  # [m] between samples by default
_EQUAL = 1e-3  # [steps] tolerance of equal spacing, as of the roughness indices


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundStrip:
    """Ground along lines parallel to the path, for consecutive path points."""

    height: Float
    "Ground, shape (line, sample) [m]; NaN where there is none."

    step: float
    "Distance between samples along the path [m]."

    first: int
    "Index of the sample at the first path point."

    stride: int
    "Number of samples from one path point to the next."

    count: int
    "Number of path points."

    def at_points(self) -> Float:
        """Heights across the path at the path points, shape (line, s) [m]."""
        end = self.first + self.stride * (self.count - 1) + 1
        return self.height[:, self.first : end : self.stride]


class SurfaceLines:
    """Lines on a surface, parallel to a path.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface.
    path : PlaneCurve
        Path points.
    offsets : numpy.ndarray, shape (line,)
        Offsets of the lines, left positive [m].
    step : float or None
        Maximum distance between samples [m]; None for that of the nodes of the surface.
    """

    def __init__(
        self, surface: xr.Dataset, path: PlaneCurve, offsets: Float, step: float | None
    ) -> None:
        # converted once, and not for each part of the path; on disk heights are float64 already
        converted = surface["height"].dtype != np.float64
        self._surface = (
            surface.assign(height=surface["height"].astype(float)) if converted else surface
        )
        self._frame = grid_frame(surface)
        self._path = path
        self._heading = np.unwrap(path.heading)
        self.offsets = offsets
        spacing = _equal_spacing(path.s, "the path")
        node_spacing = float(np.diff(self._frame.u).min())
        self.stride, self.step = _sample_spacing(spacing, node_spacing, step)

    def __len__(self) -> int:
        return len(self._path)

    def samples(self, begin: int, end: int) -> Float:
        """Heights at samples `begin` to `end` (not included), counted from the first path point.

        Beyond its ends the path is extended by its tangents.
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
    """Line of a profile: the ground is level across.

    Parameters
    ----------
    s, height : numpy.ndarray, shape (s,)
        Profile, equally spaced [m].
    step : float or None
        Maximum distance between samples [m]; None for that of the profile.

    Raises
    ------
    CoverageError
        If the profile is not equally spaced.
    """

    def __init__(self, s: Float, height: Float, step: float | None) -> None:
        self._height = height
        self.offsets = np.zeros(1)
        spacing = _equal_spacing(s, "the profile")
        self.stride, self.step = _sample_spacing(spacing, spacing, step)

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

    Before and after the path, where the ground ends, its last height is held.

    Parameters
    ----------
    lines : SurfaceLines or ProfileLine
        Source of the ground.
    begin, end : int
        Path points.
    reach : float
        Longitudinal distance from the path point within which the tyre may touch the ground [m].

    Returns
    -------
    strip : GroundStrip
        Ground, with samples beyond the reach of the tyre at either end.
    known : numpy.ndarray, shape (2,)
        First and last sample that is a height of the ground and not held, counted from the first
        path point.
    """
    margin = int(np.ceil(reach / lines.step)) + 2  # two more, for the slope at the last sample
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
    """Hold the last height of each line, outward from the end of the path, in place.

    Returns the last sample that is not held on any line.
    """
    missing = np.isnan(outward)
    ground = np.maximum.accumulate(np.where(missing, 0, np.arange(outward.shape[1])), axis=1)
    outward[...] = np.take_along_axis(outward, ground, axis=1)
    filled = (missing & ~missing[:, :1])[:, 1:].any(axis=0)
    return int(np.argmax(filled)) if filled.any() else outward.shape[1] - 1


def _equal_spacing(s: Float, what: str) -> float:
    """Spacing of points, which must be equal [m]."""
    if s.size < 2:
        raise CoverageError(
            f"{what} must have at least 2 points for a tyre to roll on, got {s.size}"
        )
    spacing = float((s[-1] - s[0]) / (s.size - 1))
    deviation = np.abs(s - (s[0] + spacing * np.arange(s.size)))
    worst = int(np.argmax(deviation))
    if deviation[worst] > _EQUAL * spacing:
        raise CoverageError(
            f"{what} must be equally spaced for a tyre to roll on, got s = {s[worst]:g} m, "
            f"{deviation[worst]:.2g} m from a multiple of {spacing:g} m",
            cure="Resample it first: `trueterrain convert --spacing`, or `resample_profile`.",
        )
    return spacing


def _sample_spacing(spacing: float, native: float, step: float | None) -> tuple[int, float]:
    """Number of samples from point to point, and the distance between them [m].

    By default that of the ground, `native`, within bounds.
    """
    if step is None:
        step = min(max(native, _MIN_STEP), _MAX_STEP)
    elif not 0 < step < float("inf"):
        message = f"step must be greater than 0 m, got {step}."
        raise ValueError(message)
    stride = max(int(np.ceil(spacing / step - _EQUAL)), 1)
    return stride, spacing / stride
