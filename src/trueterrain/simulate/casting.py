"""First intersection of beams with the ground.

On a `Raster` the intersection is exact: the beam is traversed cell by cell, and within a cell its
height above the bilinear ground is a quadratic of the distance. On any other ground the beam
advances in small steps, which is slow, but allows tests against closed forms.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.simulate import _kernels
from trueterrain.simulate.ground import Ground
from trueterrain.simulate.raster import BLOCK_CELLS, TILE_CELLS, Raster, Tiles

Float = npt.NDArray[np.float64]
Beams = tuple[Float, Float, Float]

#: Spot of a beam without extent.
POINT = ((0.0, 0.0),)

#: Step along a beam over ground that is no raster [m]; narrower features may be missed.
MARCH_STEP = 1e-3

_BISECTIONS = 40  # from 1 mm to below round-off
_SLOPE_STEP = 1e-6  # [m]
_TILE_MARGIN = 8  # [1] tiles kept around the beams: more than the maximum range of a scanner


def cast_beams(
    ground: Ground,
    origin: Float,
    direction: Float,
    *,
    max_distance: float,
    known: set[tuple[int, int]] | None = None,
    forward: Float | None = None,
    spot: npt.ArrayLike = POINT,
) -> tuple[Float, Float]:
    """First intersection of beams with the ground, averaged over their spots.

    Parameters
    ----------
    ground : Ground
        Raster, for exact intersections; or any other ground, to 1e-9 m if it has no feature
        narrower than 1 mm.
    origin, direction : numpy.ndarray, shape (n, 3)
        Origin [m] and unit direction of each beam.
    max_distance : float
        Length of the beams [m].
    known : set of (column, row), optional
        Tiles of the raster that recent beams entered; updated in place.
    forward : numpy.ndarray, shape (n, 3), optional
        Unit vector at right angles to each beam, along which its spot extends; needed only if the
        spot is no point.
    spot : array_like, shape (rays, 2)
        Rotation of each ray of a spot along `forward`, and at right angles to it [rad]. The
        number of rays is odd; the central one is the beam.

    Returns
    -------
    distance : numpy.ndarray, shape (n,)
        Mean distance along the rays of each beam [m]; NaN if the central one has no intersection.
    slope : numpy.ndarray, shape (n, 2)
        Gradient of the ground at the end of the central ray, dz/dx and dz/dy.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane
    >>> down = np.array([[0.0, 0.0, -1.0]])
    >>> cast_beams(Plane(elevation=0.5), np.array([[0.0, 0.0, 2.0]]), down, max_distance=5.0)[0]
    array([1.5])
    """
    rays = np.array(spot, dtype=float)
    forward = np.zeros_like(origin) if forward is None else forward
    if isinstance(ground, Raster):
        known = set() if known is None else known
        return _cast_raster(ground, (origin, direction, forward), rays, max_distance, known)
    return _cast_spot(ground, origin, direction, forward, rays, max_distance)


def _cast_raster(
    raster: Raster, beams: Beams, spot: Float, max_distance: float, known: set[tuple[int, int]]
) -> tuple[Float, Float]:
    """Cast, compute the missing tiles, and cast the beams that entered them once more."""
    # Some origins locate the scanner; its beams report the tiles that are still missing.
    origin = beams[0]
    sampled = raster.tile_of(*origin[:: max(len(origin) // 256, 1), :2].T)
    used = _unique_tiles(sampled)
    known &= _nearby_tiles(used, known)
    known |= used
    distance, slope, missing = _cast_tiles(raster.tiles(known), beams, spot, max_distance)
    pending = np.flatnonzero(distance < 0)
    while pending.size:
        known |= _unique_tiles(missing[pending])
        remaining = beams[0][pending], beams[1][pending], beams[2][pending]
        recast = _cast_tiles(raster.tiles(known), remaining, spot, max_distance)
        distance[pending], slope[pending], missing[pending] = recast
        pending = pending[recast[0] < 0]
    return distance, slope


def _cast_tiles(
    tiles: Tiles, beams: Beams, spot: Float, max_distance: float
) -> tuple[Float, Float, npt.NDArray[np.int64]]:
    """Distances (-1 where a tile is missing), slopes, and the missing tiles."""
    number = len(beams[0])
    distance, slope = np.empty(number), np.full((number, 2), np.nan)
    missing = np.empty((number, 2), np.int64)
    _kernels.cast_rays(
        *beams,
        spot,
        max_distance,
        tiles.spacing,
        tiles.first,
        tiles.index,
        tiles.height,
        tiles.block_top,
        tiles.tile_top,
        TILE_CELLS,
        BLOCK_CELLS,
        distance,
        slope,
        missing,
    )
    return distance, slope, missing


def _unique_tiles(tiles: npt.NDArray[np.int64]) -> set[tuple[int, int]]:
    """Tiles without repetition; one key per tile sorts much faster than rows of two."""
    key = np.unique((tiles[:, 0] << 32) + (tiles[:, 1] & 0xFFFFFFFF))
    row = ((key & 0xFFFFFFFF) ^ 0x80000000) - 0x80000000
    return set(zip((key >> 32).tolist(), row.tolist(), strict=True))


def _nearby_tiles(used: set[tuple[int, int]], known: set[tuple[int, int]]) -> set[tuple[int, int]]:
    """Known tiles within the range of the beams; the others are dropped."""
    columns, rows = np.array(sorted(used)).T
    return {
        (column, row)
        for column, row in known
        if columns.min() - _TILE_MARGIN <= column <= columns.max() + _TILE_MARGIN
        and rows.min() - _TILE_MARGIN <= row <= rows.max() + _TILE_MARGIN
    }


def _cast_spot(
    ground: Ground,
    origin: Float,
    direction: Float,
    forward: Float,
    spot: Float,
    max_distance: float,
) -> tuple[Float, Float]:
    """Mean over the rays of the spot on ground that is no raster, one ray at a time."""
    lateral = np.cross(forward, direction)
    total, hits = np.zeros(len(origin)), np.zeros(len(origin), np.int64)
    for number, (along, across) in enumerate(spot):
        rotated = direction + along * forward + across * lateral
        distance, gradient = _cast_marching(ground, origin, rotated, max_distance)
        if number == len(spot) // 2:
            has_hit, slope = np.isfinite(distance), gradient
        total += np.where(np.isnan(distance), 0.0, distance)
        hits += np.isfinite(distance)
    return np.where(has_hit, total / np.maximum(hits, 1), np.nan), slope


def _cast_marching(
    ground: Ground, origin: Float, direction: Float, max_distance: float
) -> tuple[Float, Float]:
    """Advance each beam until it is below the ground, then bisect."""

    def clearance(beam: npt.NDArray[np.intp], at: Float) -> Float:
        point = origin[beam] + at[:, None] * direction[beam]
        return point[:, 2] - ground.height(point[:, 0], point[:, 1])

    low, high = np.zeros(len(origin)), np.full(len(origin), np.nan)
    active = np.arange(len(origin))
    for n in range(int(np.ceil(max_distance / MARCH_STEP))):
        at = np.full(active.size, (n + 1) * MARCH_STEP)
        below = clearance(active, at) <= 0
        high[active[below]] = at[below]
        low[active[~below]] = at[~below]
        active = active[~below]
        if not active.size:
            break
    hit = np.flatnonzero(np.isfinite(high))
    a, b = low[hit], high[hit]
    for _ in range(_BISECTIONS):
        centre = 0.5 * (a + b)
        below = clearance(hit, centre) <= 0
        a, b = np.where(below, a, centre), np.where(below, centre, b)
    distance = np.full(len(origin), np.nan)
    distance[hit] = 0.5 * (a + b)
    point = origin + distance[:, None] * direction
    x, y = point[:, 0], point[:, 1]
    slope = [
        (ground.height(x + ex, y + ey) - ground.height(x - ex, y - ey)) / (2 * _SLOPE_STEP)
        for ex, ey in ((_SLOPE_STEP, 0.0), (0.0, _SLOPE_STEP))
    ]
    return distance, np.stack(slope, axis=1)
