"""Where beams meet the ground first.

On a `Raster` the meeting point is exact: the beam is followed from cell to cell, and within a cell
its height above the bilinear ground is a quadratic of the way. Any other ground is marched along in
small steps, which is slow and good for tests with truths in closed form.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.ground import Ground
from trueterrain.simulate.raster import BLOCK_CELLS, TILE_CELLS, Raster, Tiles

Float = npt.NDArray[np.float64]
Beams = tuple[Float, Float, Float]

#: The spot of a beam without extent.
POINT = ((0.0, 0.0),)

#: Step in which a ground that is no raster is marched along [m]; narrower features may be missed.
MARCH = 1e-3

_BISECTIONS = 40  # from 1 mm to below round-off
_SLOPE_STEP = 1e-6  # [m]
_REACH = 8  # tiles around the vehicle that are kept: more than the largest range of a scanner


def cast_beams(
    ground: Ground,
    origin: Float,
    direction: Float,
    *,
    furthest: float,
    known: set[tuple[int, int]] | None = None,
    forward: Float | None = None,
    spot: npt.ArrayLike = POINT,
) -> tuple[Float, Float]:
    """First intersection of beams with the ground, averaged over their spots.

    Parameters
    ----------
    ground : Ground
        Raster, met exactly; or any other ground, met within 1e-9 m as long as it has no feature
        narrower than 1 mm.
    origin, direction : numpy.ndarray, shape (n, 3)
        Begin [m] and unit direction of each beam.
    furthest : float
        Largest distance [m].
    known : set of (column, row), optional
        Tiles of the raster that beams have met lately; kept up to date.
    forward : numpy.ndarray, shape (n, 3), optional
        Unit vector at right angles to each beam, along which its spot extends; needed only if the
        spot is no point.
    spot : array_like, shape (rays, 2)
        By how much each ray of a spot is turned along `forward`, and at right angles to it [rad]:
        an odd number of rays, the one in the middle is the beam itself.

    Returns
    -------
    distance : numpy.ndarray, shape (n,)
        Mean distance along the rays of each beam [m]; NaN if the middle one meets nothing.
    slope : numpy.ndarray, shape (n, 2)
        Gradient of the ground where the middle one ends, dz/dx and dz/dy.

    Examples
    --------
    >>> from trueterrain.simulate.ground import Plane
    >>> down = np.array([[0.0, 0.0, -1.0]])
    >>> cast(Plane(elevation=0.5), np.array([[0.0, 0.0, 2.0]]), down, furthest=5.0)[0]
    array([1.5])
    """
    rays = np.array(spot, dtype=float)
    forward = np.zeros_like(origin) if forward is None else forward
    if isinstance(ground, Raster):
        known = set() if known is None else known
        return _cast_raster(ground, (origin, direction, forward), rays, furthest, known)
    return _cast_spot(ground, origin, direction, forward, rays, furthest)


def _cast_raster(
    raster: Raster, beams: Beams, spot: Float, furthest: float, known: set[tuple[int, int]]
) -> tuple[Float, Float]:
    """Cast, make the tiles that beams ask for, and cast those beams again."""
    # a few begins tell where the scanner is; beams ask for the tiles that these leave out
    origin = beams[0]
    begins = raster.tile_of(*origin[:: max(len(origin) // 256, 1), :2].T)
    used = _unique_tiles(begins)
    known &= _nearby_tiles(used, known)
    known |= used
    distance, slope, missing = _meet_tiles(raster.tiles(known), beams, spot, furthest)
    todo = np.flatnonzero(distance < 0)
    while todo.size:
        known |= _unique_tiles(missing[todo])
        some = beams[0][todo], beams[1][todo], beams[2][todo]
        again = _meet_tiles(raster.tiles(known), some, spot, furthest)
        distance[todo], slope[todo], missing[todo] = again
        todo = todo[again[0] < 0]
    return distance, slope


def _meet_tiles(
    tiles: Tiles, beams: Beams, spot: Float, furthest: float
) -> tuple[Float, Float, npt.NDArray[np.int64]]:
    """Distances (-1 where a tile is missing), slopes, and the missing tiles."""
    from trueterrain.simulate import _kernels

    number = len(beams[0])
    distance, slope = np.empty(number), np.full((number, 2), np.nan)
    missing = np.empty((number, 2), np.int64)
    _kernels.cast_rays(
        *beams,
        spot,
        furthest,
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
    """Those known tiles that lie within the reach of the beams; the others are left behind."""
    columns, rows = np.array(sorted(used)).T
    return {
        (column, row)
        for column, row in known
        if columns.min() - _REACH <= column <= columns.max() + _REACH
        and rows.min() - _REACH <= row <= rows.max() + _REACH
    }


def _cast_spot(
    ground: Ground, origin: Float, direction: Float, forward: Float, spot: Float, furthest: float
) -> tuple[Float, Float]:
    """Mean over the rays of the spot on ground that is no raster, ray by ray."""
    beside = np.cross(forward, direction)
    total, met = np.zeros(len(origin)), np.zeros(len(origin), np.int64)
    for number, (along, across) in enumerate(spot):
        turned = direction + along * forward + across * beside
        distance, rising = _cast_any(ground, origin, turned, furthest)
        if number == len(spot) // 2:
            seen, slope = np.isfinite(distance), rising
        total += np.where(np.isnan(distance), 0.0, distance)
        met += np.isfinite(distance)
    return np.where(seen, total / np.maximum(met, 1), np.nan), slope


def _cast_any(
    ground: Ground, origin: Float, direction: Float, furthest: float
) -> tuple[Float, Float]:
    """March until a beam is below the ground, then bisect."""

    def above(beam: npt.NDArray[np.intp], at: Float) -> Float:
        point = origin[beam] + at[:, None] * direction[beam]
        return point[:, 2] - ground.height(point[:, 0], point[:, 1])

    low, high = np.zeros(len(origin)), np.full(len(origin), np.nan)
    flying = np.arange(len(origin))
    for n in range(int(np.ceil(furthest / MARCH))):
        at = np.full(flying.size, (n + 1) * MARCH)
        below = above(flying, at) <= 0
        high[flying[below]] = at[below]
        low[flying[~below]] = at[~below]
        flying = flying[~below]
        if not flying.size:
            break
    hit = np.flatnonzero(np.isfinite(high))
    a, b = low[hit], high[hit]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (a + b)
        below = above(hit, middle) <= 0
        a, b = np.where(below, a, middle), np.where(below, middle, b)
    distance = np.full(len(origin), np.nan)
    distance[hit] = 0.5 * (a + b)
    point = origin + distance[:, None] * direction
    tiny = _SLOPE_STEP
    slope = [
        (ground.height(point[:, 0] + ex, point[:, 1] + ey)
         - ground.height(point[:, 0] - ex, point[:, 1] - ey)) / (2 * tiny)
        for ex, ey in ((tiny, 0.0), (0.0, tiny))
    ]  # fmt: skip
    return distance, np.stack(slope, axis=1)
