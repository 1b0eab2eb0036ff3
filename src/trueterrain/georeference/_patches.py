"""Ground patches of a pass: heights, slopes, and their derivatives by the mounting.

There is one patch around each cell of a map grid: the plane fitted to the returns of one pass with
a kernel some cells wide. The same kernel smooths all passes, so that their planes differ by errors
alone, even over a step. With a Gaussian kernel the slope of the plane is exactly the derivative of
its height, and therefore predicts the effect of a displacement of the returns.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting
from trueterrain.georeference.scans import ScanGeometry
from trueterrain.georeference.screening import Screening
from trueterrain.motion.trajectory import Trajectory

Floats = npt.NDArray[np.float64]

#: Parameters of a mounting, in the order of all derivatives.
NAMES = ("roll", "pitch", "yaw", "lever_x", "lever_y", "lever_z", "clock")

#: Scans in a block.
BLOCK = 500

#: Binomial kernel: variance 1 cell².
KERNEL = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0

#: Cells with which the error of a patch is correlated: the sum of exp(-distance²/4), which is the
#: correlation of two patches under a kernel of variance 1 cell².
CORRELATED_CELLS = 4.0 * math.pi

_PLANE = ("n", "x", "y", "xx", "xy", "yy", "z", "xz", "yz")
_MAX_OFFSET = 0.4  # cells of the centroid of the returns from the centre of the patch
_VARIANCES = (0.6, 1.6)  # cells² of their positions; 1.08 if evenly distributed
_MAX_COVARIANCE = 0.3  # cells² of their positions
_MIN_RETURNS = 0.3  # per cell under the kernel


@dataclass(frozen=True, kw_only=True)
class PatchGrid:
    """Cells of a map grid."""

    west: float
    "Western edge [m]."

    south: float
    "Southern edge [m]."

    spacing: float
    "Size of a cell [m]."

    shape: tuple[int, int]
    "Rows (north) and columns (east)."

    @classmethod
    def over(cls, area: tuple[float, float, float, float], spacing: float) -> "PatchGrid":
        """Grid over west, south, east, north [m]."""
        west, south, east, north = area
        rows = max(1, math.ceil((north - south) / spacing))
        columns = max(1, math.ceil((east - west) / spacing))
        return cls(west=west, south=south, spacing=spacing, shape=(rows, columns))


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPatches:
    """Planes of one pass in all cells of a grid."""

    height: Floats
    "Height at the centre of the cell, (rows, columns) [m]; NaN where there are too few returns."

    slope: Floats
    "Slopes to the east and to the north, (2, rows, columns) [1]."

    shift: Floats
    "Mean derivatives of east, north, up of the returns by the parameters, (7, 3, rows, columns)."

    time: Floats
    "Mean true time of the returns, (rows, columns) [s]."


def fit_patches(
    blocks: Iterable[xr.Dataset],
    trajectory: Trajectory,
    mounting: Mounting,
    grid: PatchGrid,
    screening: Screening,
    max_angle: float,
) -> GroundPatches:
    """Fit the planes of one pass.

    Parameters
    ----------
    blocks : iterable of xarray.Dataset
        Scans.
    trajectory : Trajectory
        Motion of the body.
    mounting : Mounting
        Assumed mounting.
    grid : PatchGrid
        Cells of the patches.
    screening : Screening
        Selection of returns.
    max_angle : float
        Maximum angle of a beam from straight down [rad].

    Returns
    -------
    GroundPatches
        One per cell.
    """
    cells = grid.shape[0] * grid.shape[1]
    sums = np.zeros((len(_PLANE) + 3 * len(NAMES) + 1, cells))
    level, begin = 0.0, float(trajectory.time[0])
    geometry: ScanGeometry | None = None
    for block in blocks:
        if geometry is None:
            geometry = ScanGeometry(trajectory, mounting, block["angle"], block["delay"])
            level = float(trajectory.position[:, 2].mean())
        found = _georeference_returns(geometry, block, screening, max_angle)
        if found is not None:
            _add_returns(sums, *found, grid, level, begin)
    whole: Floats = sums.reshape(-1, *grid.shape)
    count = _convolve_kernel(whole[0])
    # returns are denser below the scanner than to its sides; each cell is divided by its own count,
    # so that density does not displace the centroid
    even = _smooth_sums(whole / np.where(count > 0, count, 1.0), grid.spacing)
    return _fit_planes(even, count, grid.spacing, level, begin)


def ground_extent(
    blocks: Iterable[xr.Dataset],
    trajectory: Trajectory,
    mounting: Mounting,
    screening: Screening,
    max_angle: float,
) -> tuple[float, float, float, float] | None:
    """West, south, east, north of all returns [m]; None if there is none."""
    low, high = np.full(2, np.inf), np.full(2, -np.inf)
    geometry: ScanGeometry | None = None
    for block in blocks:
        if geometry is None:
            geometry = ScanGeometry(trajectory, mounting, block["angle"], block["delay"])
        found = _georeference_returns(geometry, block, screening, max_angle, derivatives=False)
        if found is not None:
            low = np.minimum(low, found[0][:2].min(axis=1))
            high = np.maximum(high, found[0][:2].max(axis=1))
    if not np.isfinite(low).all():
        return None
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _georeference_returns(
    geometry: ScanGeometry,
    scans: xr.Dataset,
    screening: Screening,
    max_angle: float,
    *,
    derivatives: bool = True,
) -> tuple[Floats, Floats, Floats, Floats] | None:
    """Returns (3, m), derivatives by parameters (7, 3, m), weights and true times (m,); or None."""
    time = np.asarray(scans["time"], dtype=np.float64)
    covered = np.flatnonzero(geometry.covers(time))
    ranges = np.asarray(scans["range"], dtype=np.float64)[covered]
    intensity = np.asarray(scans["intensity"])[covered] if "intensity" in scans else None
    weights = screening.weights(ranges, intensity)
    good = (weights > 0) & (np.abs(geometry.angle) <= max_angle)
    if not good.any():
        return None
    motion = geometry.expand(time[covered])
    scanner, speed, left, left_rate, upward, upward_rate = _beam_axes(
        geometry, motion.coefficient, good
    )
    r = ranges[good]
    sine, cosine = (np.broadcast_to(f(geometry.angle), good.shape)[good] for f in (np.sin, np.cos))
    beam = r * (sine * left - cosine * upward)
    points = scanner + beam
    when = (time[covered, None] + (geometry.mounting.scanner_clock + geometry.delay))[good]
    if not derivatives:
        return points, np.empty((7, 3, 0)), weights[good], when
    # derivatives: an angle rotates the beam about its axis, a lever arm displaces it along an axis
    # of the body, the clock displaces it by the velocity of the return
    forward = np.cross(left, upward, axis=0)
    rotation = Rotation.from_euler("ZYX", geometry.mounting.scanner_rotation[::-1]).as_matrix()
    body = [row[0] * forward + row[1] * left + row[2] * upward for row in rotation]
    yaw = geometry.mounting.scanner_rotation[2]
    pitch_axis = -math.sin(yaw) * body[0] + math.cos(yaw) * body[1]
    by_angles = [np.cross(axis, beam, axis=0) for axis in (forward, pitch_axis, body[2])]
    clock = speed + r * (sine * left_rate - cosine * upward_rate)
    return points, np.stack([*by_angles, *body, clock]), weights[good], when


def _beam_axes(
    geometry: ScanGeometry, coefficient: Floats, good: npt.NDArray[np.bool_]
) -> tuple[Floats, ...]:
    """Position, left and upward axis of the scanner at good beams, each with its rate, (3, m)."""
    scans, beams = good.shape
    pieces = coefficient.reshape(scans, geometry.pieces, 3, 9)
    x = geometry.beam[1]
    rates = np.stack([np.zeros(beams), np.ones(beams), 2.0 * x])
    found = []
    for first in (0, 3, 6):
        for powers in (geometry.beam[:3], rates):
            values = np.empty((3, scans, beams))
            for p, (a, b) in enumerate(zip(geometry.first[:-1], geometry.first[1:], strict=True)):
                part = pieces[:, p, :, first : first + 3]
                values[:, :, a:b] = np.einsum("nck,kb->cnb", part, powers[:, a:b])
            found.append(values[:, good])
    return tuple(found)


def _add_returns(
    sums: Floats,
    points: Floats,
    by: Floats,
    weight: Floats,
    time: Floats,
    grid: PatchGrid,
    level: float,
    begin: float,
) -> None:
    """Add returns to the moments of their cells, about the centres of the cells."""
    across = (points[0] - grid.west) / grid.spacing
    along = (points[1] - grid.south) / grid.spacing
    column, row = np.floor(across), np.floor(along)
    inside = (column >= 0) & (column < grid.shape[1]) & (row >= 0) & (row < grid.shape[0])
    cell = (row[inside] * grid.shape[1] + column[inside]).astype(np.intp)
    w = weight[inside]
    x = (across - column - 0.5)[inside] * grid.spacing
    y = (along - row - 0.5)[inside] * grid.spacing
    z = points[2, inside] - level
    plain = [w, w * x, w * y, w * x * x, w * x * y, w * y * y, w * z, w * x * z, w * y * z]
    for channel, values in enumerate(plain):
        sums[channel] += np.bincount(cell, values, minlength=sums.shape[1])
    more = [*by.reshape(-1, by.shape[2]), time - begin]
    for channel, values in enumerate(more, start=len(plain)):
        sums[channel] += np.bincount(cell, w * values[inside], minlength=sums.shape[1])


def _smooth_sums(sums: Floats, spacing: float) -> Floats:
    """Moments under the kernel, about the centre of each cell.

    Moments of a neighbouring cell are shifted to the centre by the parallel axis theorem; the
    kernel is separable.
    """
    n, x, y, xx, xy, yy, z, xz, yz = range(len(_PLANE))
    for axis, (one, two, cross, rising) in ((2, (x, xx, y, xz)), (1, (y, yy, x, yz))):
        whole = np.zeros_like(sums)
        for step, weight in zip(range(-2, 3), KERNEL, strict=True):
            part = _shift_cells(sums, step, axis)
            far = step * spacing
            shifted = part.copy()
            shifted[two] += 2.0 * far * part[one] + far**2 * part[n]
            shifted[one] += far * part[n]
            shifted[xy] += far * part[cross]
            shifted[rising] += far * part[z]
            whole += weight * shifted
        sums = whole
    return sums


def _convolve_kernel(values: Floats) -> Floats:
    """Values convolved with the kernel."""
    for axis in (0, 1):
        values = np.sum(
            [
                w * _shift_cells(values, step, axis)
                for step, w in zip(range(-2, 3), KERNEL, strict=True)
            ],
            axis=0,
        )
    return values


def _shift_cells(values: Floats, step: int, axis: int) -> Floats:
    """Values of the cells `step` further along an axis; 0 outside."""
    moved = np.zeros_like(values)
    count = values.shape[axis]
    there = slice(max(step, 0), count + min(step, 0))
    here = slice(max(-step, 0), count + min(-step, 0))
    index = [slice(None)] * values.ndim
    target = list(index)
    index[axis], target[axis] = there, here
    moved[tuple(target)] = values[tuple(index)]
    return moved


def _fit_planes(
    sums: Floats, count: Floats, spacing: float, level: float, begin: float
) -> GroundPatches:
    """Least-squares planes from moments, where the returns are well distributed."""
    shape = sums.shape[1:]
    height, slope = np.full(shape, np.nan), np.full((2, *shape), np.nan)
    shift, time = np.full((len(NAMES), 3, *shape), np.nan), np.full(shape, np.nan)
    n = np.where(sums[0] > 0, sums[0], np.nan)
    x, y = sums[1] / n, sums[2] / n
    # a plane is well determined if the returns lie around the centre, evenly in both directions
    good = count >= _MIN_RETURNS
    for mean, square in ((x, sums[3]), (y, sums[5])):
        variance = (square / n - mean**2) / spacing**2
        good &= (
            (np.abs(mean) <= _MAX_OFFSET * spacing)
            & (variance > _VARIANCES[0])
            & (variance < _VARIANCES[1])
        )
    good &= np.abs(sums[4] / n - x * y) <= _MAX_COVARIANCE * spacing**2
    s = sums[: len(_PLANE), good]
    normal = np.stack([s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5]], axis=1)
    plane = np.linalg.solve(normal.reshape(-1, 3, 3), s[6:9].T[:, :, None])[:, :, 0]
    height[good] = plane[:, 0] + level
    slope[:, good] = plane[:, 1:].T
    shift.reshape(-1, *shape)[:, good] = sums[len(_PLANE) : -1, good] / s[0]
    time[good] = sums[-1, good] / s[0] + begin
    return GroundPatches(height=height, slope=slope, shift=shift, time=time)
