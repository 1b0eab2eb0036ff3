"""Heights of Belgian block, plane waves, stones and cracks: loops over points, no checks.

`seed` is the key from `seed_key`; u and x, v and y are coordinates along and across the road [m].
"""

import math
from typing import NamedTuple

import numpy as np
from numba import prange

from trueterrain.simulate.ground._ground import Floats
from trueterrain.simulate.ground._noise import (
    MAX_NOISE,
    cell_normal,
    noise_line,
    seed_key,
    smooth_ramp,
    smooth_step,
    symmetric_uniform,
    typed_kernel,
    typed_parallel_kernel,
    unit_uniform,
    value_noise,
)

_CRACK_TAPER = 0.2  # [1] of the length of a piece of a crack, over which its end closes
_POINTS_PER_BLOCK = 512  # [1] points of one loop over the waves, which stay in the cache

# Salts of the hash: the purpose of a random number.
_ROW, _ROW_WAVE, _BOND, _SIDE, _SLANT, _HEIGHT, _TILT_U, _TILT_V = 1, 2, 3, 4, 5, 6, 7, 8
_DEPTH, _TEXTURE, _EDGE, _RAMP, _FIELD, _UNDULATION = 9, 10, 11, 12, 13, 14
_INDEX_STRIDE = 1_000_003  # combines two indices in one
_STONE_U, _STONE_V, _STONE_SIZE = 20, 21, 22
_CRACK, _CRACK_COARSE, _CRACK_FINE, _CRACK_OPEN, _CELL_U, _CELL_V = 30, 31, 32, 33, 34, 35


class Paving(NamedTuple):
    """Parameters of a Belgian block pavement, with the names and units of `BelgianBlock`."""

    row_pitch: float
    row_scatter: float
    row_waviness: float
    row_waviness_length: float
    block_pitch: float
    block_scatter: float
    block_slant: float
    bond: float
    bond_scatter: float
    joint_width: float
    joint_depth: float
    joint_depth_scatter: float
    shoulder: float
    crown: float
    height_scatter: float
    tilt_scatter: float
    lean: float
    bedding: float
    texture: float
    texture_length: float
    field_height: float
    field_scatter: float
    field_length: float
    field_length_scatter: float
    field_width: float
    field_ramp: float
    field_ramp_scatter: float
    lane_ramp: float
    undulation: float
    undulation_length: float


@typed_kernel
def _row_joint(seed: np.uint64, p: Paving, i: int, v: float) -> float:
    """Position u of the joint before row i at v [m]."""
    wave = p.row_waviness * noise_line(seed, _ROW_WAVE, i, v / p.row_waviness_length)
    return i * p.row_pitch + p.row_scatter * symmetric_uniform(seed, _ROW, i, 0) + wave


@typed_kernel
def _side_joint(seed: np.uint64, p: Paving, i: int, j: int) -> float:
    """Position v of the joint to the right of block j of row i, at the centre of the row [m]."""
    bond = p.bond * (i & 1) + p.bond_scatter * symmetric_uniform(seed, _BOND, i, 0)
    return (j + bond) * p.block_pitch + p.block_scatter * symmetric_uniform(seed, _SIDE, i, j)


@typed_kernel
def _slanted_joint(seed: np.uint64, p: Paving, i: int, j: int, offset: float) -> float:
    """Position v of that joint at a distance along the road from the centre of the row [m]."""
    slant = p.block_slant * symmetric_uniform(seed, _SLANT, i, j)
    return _side_joint(seed, p, i, j) + slant * offset


@typed_kernel
def _field_edge(seed: np.uint64, p: Paving, lane: int, k: int, v: float) -> float:
    """Position u of the start of field k of a strip of fields, at v [m]."""
    shift = noise_line(seed, _EDGE, k * _INDEX_STRIDE + lane, 2.0 * v / p.field_width)
    return (k + p.field_length_scatter * shift) * p.field_length


@typed_kernel
def _field_height(seed: np.uint64, p: Paving, lane: int, k: int) -> float:
    sign = 1.0 - 2.0 * ((lane + k) & 1)
    return sign * p.field_height + p.field_scatter * cell_normal(seed, _FIELD, lane, k)


@typed_kernel
def _lane_level(seed: np.uint64, p: Paving, lane: int, u: float, v: float) -> float:
    k = math.floor(u / p.field_length)
    before = _field_edge(seed, p, lane, k, v)
    after = _field_edge(seed, p, lane, k + 1, v)
    if u < before:
        k -= 1
        after = before
        before = _field_edge(seed, p, lane, k, v)
    elif u >= after:
        k += 1
        before = after
        after = _field_edge(seed, p, lane, k + 1, v)
    level = _field_height(seed, p, lane, k)
    other, edge, distance = k - 1, k, u - before
    if after - u < distance:
        other, edge, distance = k + 1, k + 1, after - u
    ramp = p.field_ramp * (1.0 + p.field_ramp_scatter * symmetric_uniform(seed, _RAMP, lane, edge))
    if distance < 0.5 * ramp:
        level += (0.5 - smooth_ramp(distance / ramp)) * (
            _field_height(seed, p, lane, other) - level
        )
    return level


@typed_kernel
def _bed_height(seed: np.uint64, p: Paving, u: float, v: float) -> float:
    """Height of the bed under the blocks [m]."""
    level = p.undulation * value_noise(
        seed, _UNDULATION, u / p.undulation_length, v / p.undulation_length
    )
    if p.field_height == 0.0 and p.field_scatter == 0.0:
        return level
    lane = math.floor(v / p.field_width)
    own = _lane_level(seed, p, lane, u, v)
    right = (v - lane * p.field_width) / p.lane_ramp
    left = ((lane + 1) * p.field_width - v) / p.lane_ramp
    if right < 0.5:
        own += (0.5 - smooth_ramp(right)) * (_lane_level(seed, p, lane - 1, u, v) - own)
    elif left < 0.5:
        own += (0.5 - smooth_ramp(left)) * (_lane_level(seed, p, lane + 1, u, v) - own)
    return level + own


@typed_kernel
def _block_top(seed: np.uint64, p: Paving, i: int, j: int, u: float, v: float) -> float:
    """Height of the top of block j of row i, extrapolated beyond its edges [m]."""
    at_u = (i + 0.5) * p.row_pitch
    at_v = 0.5 * (_side_joint(seed, p, i, j) + _side_joint(seed, p, i, j + 1))
    du, dv = u - at_u, v - at_v
    half_u, half_v = 0.25 * p.row_pitch, 0.25 * p.block_pitch
    before = _bed_height(seed, p, at_u - half_u, at_v)
    after = _bed_height(seed, p, at_u + half_u, at_v)
    right = _bed_height(seed, p, at_u, at_v - half_v)
    left = _bed_height(seed, p, at_u, at_v + half_v)
    slope_u = p.bedding * (after - before) / (2.0 * half_u)
    slope_v = p.bedding * (left - right) / (2.0 * half_v)
    slope_u += p.lean + p.tilt_scatter * cell_normal(seed, _TILT_U, i, j)
    slope_v += p.tilt_scatter * cell_normal(seed, _TILT_V, i, j)
    height = 0.25 * (before + after + right + left) + slope_u * du + slope_v * dv
    height += p.height_scatter * cell_normal(seed, _HEIGHT, i, j)
    along, across = 2.0 * du / p.row_pitch, 2.0 * dv / p.block_pitch
    return height - p.crown * (along * along + across * across)


@typed_kernel
def _shoulder_fall(p: Paving, distance: float) -> float:
    """Depth of the shoulder at a distance from the centre of a joint, from 0 to 1 (the floor)."""
    t = (distance - 0.5 * p.joint_width) / p.shoulder
    if t <= 0.0:
        return 1.0
    return 0.0 if t >= 1.0 else 1.0 - smooth_step(t)


@typed_kernel
def _neighbour_fraction(p: Paving, distance: float) -> float:
    """Weight of the neighbour in the height: one half at the centre of the joint."""
    t = 0.5 * distance / (0.5 * p.joint_width + p.shoulder)
    return 0.0 if t >= 0.5 else 0.5 - smooth_ramp(t)


@typed_kernel
def _row_height(seed: np.uint64, p: Paving, i: int, u: float, v: float) -> tuple[float, float]:
    """Height of the tops of row i [m], and the relative depth at its side joints."""
    offset = u - (i + 0.5) * p.row_pitch
    bond = p.bond * (i & 1) + p.bond_scatter * symmetric_uniform(seed, _BOND, i, 0)
    j = math.floor(v / p.block_pitch - bond)
    right = _slanted_joint(seed, p, i, j, offset)
    left = _slanted_joint(seed, p, i, j + 1, offset)
    if v < right:
        j -= 1
        left = right
        right = _slanted_joint(seed, p, i, j, offset)
    elif v >= left:
        j += 1
        right = left
        left = _slanted_joint(seed, p, i, j + 1, offset)
    height = _block_top(seed, p, i, j, u, v)
    distance = min(v - right, left - v)
    fraction = _neighbour_fraction(p, distance)
    if fraction > 0.0:
        other = _block_top(seed, p, i, j - 1 if v - right < left - v else j + 1, u, v)
        height += fraction * (other - height)
    return height, _shoulder_fall(p, distance)


@typed_kernel
def _pavement_height(seed: np.uint64, p: Paving, u: float, v: float) -> float:
    i = math.floor(u / p.row_pitch)
    before = _row_joint(seed, p, i, v)
    after = _row_joint(seed, p, i + 1, v)
    if u < before:
        i -= 1
        after = before
        before = _row_joint(seed, p, i, v)
    elif u >= after:
        i += 1
        before = after
        after = _row_joint(seed, p, i + 1, v)
    height, depth = _row_height(seed, p, i, u, v)
    distance = min(u - before, after - u)
    fraction = _neighbour_fraction(p, distance)
    if fraction > 0.0:
        other, _ = _row_height(seed, p, i - 1 if u - before < after - u else i + 1, u, v)
        height += fraction * (other - height)
    depth = 1.0 - (1.0 - depth) * (1.0 - _shoulder_fall(p, distance))
    if depth > 0.0:
        uneven = value_noise(seed, _DEPTH, u / p.row_pitch, v / p.block_pitch)
        uneven = max(-1.0, min(1.0, p.joint_depth_scatter * uneven))
        height -= p.joint_depth * (1.0 + uneven) * depth
    return height + p.texture * value_noise(
        seed, _TEXTURE, u / p.texture_length, v / p.texture_length
    )


@typed_parallel_kernel
def belgian_block(seed: int, paving: Paving, u: Floats, v: Floats) -> Floats:
    """Height of a Belgian block pavement at points [m].

    Parameters
    ----------
    seed : seed of the random numbers
    paving : parameters of the pavement
    u, v : (n,) coordinates along and across the road [m]
    """
    key = seed_key(seed)
    out = np.empty(u.size)
    for n in prange(u.size):
        out[n] = _pavement_height(key, paving, u[n], v[n])
    return out


@typed_kernel
def _add_wave(wave: Floats, x: Floats, y: Floats, out: Floats) -> None:
    """Add amplitude * cos(2 pi (kx x + ky y + phase)).

    The cosine is a series about its nearest zero, to 1e-13. Unlike that of the library it is
    vectorised, and gives the same bits for any position of a point in its array.
    """
    amplitude, kx, ky, phase = wave[0], wave[1], wave[2], wave[3]
    for n in range(x.size):
        phase_turns = kx * x[n] + ky * y[n] + phase
        phase_turns -= np.floor(phase_turns + 0.5)
        a = 2.0 * math.pi * (0.25 - abs(phase_turns))
        b = a * a
        s = 1.0 / 355687428096000.0  # 17!
        s = s * b - 1.0 / 1307674368000.0
        s = s * b + 1.0 / 6227020800.0
        s = s * b - 1.0 / 39916800.0
        s = s * b + 1.0 / 362880.0
        s = s * b - 1.0 / 5040.0
        s = s * b + 1.0 / 120.0
        s = s * b - 1.0 / 6.0
        out[n] += amplitude * (a + a * b * s)


@typed_parallel_kernel
def plane_waves(waves: Floats, x: Floats, y: Floats) -> Floats:
    """Sum of plane waves at points [m].

    Parameters
    ----------
    waves : (waves, 4) amplitude [m], wave vector [1/m, 1/m], phase [cycles]
    x, y : (n,) easting and northing [m]
    """
    number = x.size
    out = np.empty(number)
    for block in prange((number + _POINTS_PER_BLOCK - 1) // _POINTS_PER_BLOCK):
        begin = block * _POINTS_PER_BLOCK
        end = min(begin + _POINTS_PER_BLOCK, number)
        near_x, near_y = x[begin:end].copy(), y[begin:end].copy()
        height = np.zeros(end - begin)
        for w in range(waves.shape[0]):
            _add_wave(waves[w], near_x, near_y, height)
        out[begin:end] = height
    return out


@typed_parallel_kernel
def stone_heights(
    seed: int, cell: float, smallest: float, largest: float, ratio: float, x: Floats, y: Floats
) -> Floats:
    """Height of half-ellipsoids, one inside each square cell [m].

    Parameters
    ----------
    seed : seed of the random numbers
    cell : side of a cell [m]
    smallest, largest : range of diameters [m]
    ratio : height over diameter
    x, y : (n,) coordinates along the axes of the cells [m]
    """
    key = seed_key(seed)
    out = np.zeros(x.size)
    for n in prange(x.size):
        i, j = math.floor(x[n] / cell), math.floor(y[n] / cell)
        diameter = smallest * (largest / smallest) ** unit_uniform(key, _STONE_SIZE, i, j)
        spare = cell - diameter
        dx = x[n] - i * cell - 0.5 * diameter - spare * unit_uniform(key, _STONE_U, i, j)
        dy = y[n] - j * cell - 0.5 * diameter - spare * unit_uniform(key, _STONE_V, i, j)
        inside = 1.0 - 4.0 * (dx * dx + dy * dy) / (diameter * diameter)
        if inside > 0.0:
            out[n] = ratio * diameter * math.sqrt(inside)
    return out


@typed_kernel
def _crack_line(seed: np.uint64, spacing: float, meander: float, i: int, v: float) -> float:
    """Position u of transverse crack i at v [m]."""
    deviation = 0.75 * noise_line(seed, _CRACK_COARSE, i, v / spacing)
    deviation += 0.25 * noise_line(seed, _CRACK_FINE, i, 8.0 * v / spacing)
    return (i + 0.5 + 0.25 * symmetric_uniform(seed, _CRACK, i, 0)) * spacing + meander * deviation


@typed_kernel
def _crack_opening(seed: np.uint64, fraction: float, length: float, i: int, v: float) -> float:
    """Opening of transverse crack i at v: 1 where it is open, 0 where it is closed."""
    j = math.floor(v / length)
    if unit_uniform(seed, _CRACK_OPEN, i, j) >= fraction:
        return 0.0
    opening = 1.0
    if unit_uniform(seed, _CRACK_OPEN, i, j - 1) >= fraction:
        opening = min(opening, (v / length - j) / _CRACK_TAPER)
    if unit_uniform(seed, _CRACK_OPEN, i, j + 1) >= fraction:
        opening = min(opening, (j + 1 - v / length) / _CRACK_TAPER)
    return opening


@typed_parallel_kernel
def transverse_cracks(
    seed: int,
    spacing: float,
    meander: float,
    fraction: float,
    length: float,
    width: float,
    u: Floats,
    v: Floats,
) -> Floats:
    """Depth of transverse cracks as a fraction of the full depth.

    Parameters
    ----------
    seed : seed of the random numbers
    spacing : mean distance between cracks [m]
    meander : maximum lateral deviation [m]
    fraction : fraction of the pieces that is open
    length, width : of a piece and of a crack [m]
    u, v : (n,) coordinates along and across the road [m]
    """
    key = seed_key(seed)
    out = np.zeros(u.size)
    for n in prange(u.size):
        centre = math.floor(u[n] / spacing)
        for i in range(centre - 1, centre + 2):
            opening = _crack_opening(key, fraction, length, i, v[n])
            offset = u[n] - _crack_line(key, spacing, meander, i, v[n])
            if opening > 0.0 and abs(offset) < spacing:
                left_position = _crack_line(key, spacing, meander, i, v[n] + 0.5 * width)
                right_position = _crack_line(key, spacing, meander, i, v[n] - 0.5 * width)
                slope = (left_position - right_position) / width
                t = 2.0 * offset / (width * opening * math.sqrt(1.0 + slope * slope))
                out[n] = max(out[n], opening * (1.0 - t * t))
    return out


@typed_kernel
def _seed_point(key: np.uint64, i: int, j: int) -> tuple[float, float]:
    return i + unit_uniform(key, _CELL_U, i, j), j + unit_uniform(key, _CELL_V, i, j)


@typed_kernel
def _edge_distance(key: np.uint64, fraction: float, x: float, y: float) -> float:
    """Distance from the nearest cracked edge of the Voronoi cells of one point per unit square."""
    i0, j0 = math.floor(x), math.floor(y)
    nearest, own_i, own_j = np.inf, i0, j0
    for i in range(i0 - 2, i0 + 3):
        for j in range(j0 - 2, j0 + 3):
            px, py = _seed_point(key, i, j)
            distance = (px - x) ** 2 + (py - y) ** 2
            if distance < nearest:
                nearest, own_i, own_j = distance, i, j
    ax, ay = _seed_point(key, own_i, own_j)
    own = unit_uniform(key, _CRACK_OPEN, own_i, own_j)
    edge = np.inf
    for i in range(own_i - 2, own_i + 3):
        for j in range(own_j - 2, own_j + 3):
            # a number of the edge, the same for both cells
            edge_number = own + unit_uniform(key, _CRACK_OPEN, i, j)
            if (i == own_i and j == own_j) or edge_number - math.floor(edge_number) >= fraction:
                continue
            bx, by = _seed_point(key, i, j)
            nx, ny = bx - ax, by - ay
            to_bisector = (0.5 * (ax + bx) - x) * nx + (0.5 * (ay + by) - y) * ny
            edge = min(edge, to_bisector / math.sqrt(nx * nx + ny * ny))
    return edge


@typed_parallel_kernel
def alligator_cracks(
    seed: int, spacing: float, meander: float, fraction: float, width: float, x: Floats, y: Floats
) -> Floats:
    """Depth of alligator cracks as a fraction of the full depth.

    Parameters
    ----------
    seed : seed of the random numbers
    spacing : side of the squares with one Voronoi point each [m]
    meander : maximum displacement of the edges [m]
    fraction : fraction of the edges that is open
    width : of a crack [m]
    x, y : (n,) coordinates along and across the road [m]
    """
    key = seed_key(seed)
    out = np.zeros(x.size)
    for n in prange(x.size):
        a, b = x[n] / spacing, y[n] / spacing
        warp = meander / spacing / MAX_NOISE
        shift_a = warp * value_noise(key, _CRACK_COARSE, 2.0 * a, 2.0 * b)
        shift_b = warp * value_noise(key, _CRACK_FINE, 2.0 * a, 2.0 * b)
        t = 2.0 * spacing * _edge_distance(key, fraction, a + shift_a, b + shift_b) / width
        if t < 1.0:
            out[n] = 1.0 - t * t
    return out
