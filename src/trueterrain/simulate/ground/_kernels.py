"""Loops over points: hashing, value noise, blocks, plane waves, stones and cracks.

Randomness at a point comes from a hash of the seed, the use it is put to (salt) and the integer
indices of the cell that the point lies in, never from a table or a running generator. So a ground
has no edge, and the height at a point depends on nothing but that point.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt
from numba import prange

from trueterrain.core.kernels import compile_kernel

Floats = npt.NDArray[np.float64]
_Function = TypeVar("_Function", bound=Callable[..., object])


def _compile_kernel(function: _Function) -> _Function:
    """Compile a loop, and keep its type."""
    return cast("_Function", compile_kernel(function))


def _parallel_kernel(function: _Function) -> _Function:
    """Compile a loop over points that runs on all cores, and keep its type."""
    return cast("_Function", compile_kernel(function, parallel=True))


# Constants of splitmix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
# generators") and two odd multipliers that keep the indices apart.
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_APART_I = np.uint64(0xD6E8FEB86659FD93)
_APART_J = np.uint64(0xA0761D6478BD642F)
_S11, _S16, _S27, _S30, _S31 = (np.uint64(n) for n in (11, 16, 27, 30, 31))
_LOW_16 = np.uint64(0xFFFF)

_MEAN_OF_SUM = 2.0 * 65535.0  # of four 16-bit numbers
_SD_OF_SUM = math.sqrt(4.0 * (65536.0**2 - 1.0) / 12.0)
# Mean square of a smoothly interpolated line of independent values of unit variance: the mean over
# t of (1 - s)^2 + s^2 with s = 3 t^2 - 2 t^3.
_NOISE_POWER = 26.0 / 35.0
_LARGEST_NOISE = math.sqrt(12.0) / _NOISE_POWER  # four extreme neighbours
_CRACK_TAPER = 0.2  # share of the length of a piece of a crack over which its end closes
_POINTS_PER_BLOCK = 512  # points that share one pass over the waves, so that they stay in cache

# What a random number is used for.
_ROW, _ROW_WAVE, _BOND, _SIDE, _SLANT, _HEIGHT, _TILT_U, _TILT_V = 1, 2, 3, 4, 5, 6, 7, 8
_DEPTH, _TEXTURE, _EDGE, _RAMP, _FIELD, _UNDULATION = 9, 10, 11, 12, 13, 14
_FAR = 1_000_003  # keeps two indices apart in one
_STONE_U, _STONE_V, _STONE_SIZE = 20, 21, 22
_CRACK, _CRACK_COARSE, _CRACK_FINE, _CRACK_SHARE, _CELL_U, _CELL_V = 30, 31, 32, 33, 34, 35


class Paving(NamedTuple):
    """Numbers of a Belgian block pavement, as `BelgianBlock` names them; lengths [m]."""

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


@_compile_kernel
def _mix_bits(z: np.uint64) -> np.uint64:
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@_compile_kernel
def _seed_key(seed: int) -> np.uint64:
    """What the functions below take as their seed: neighbouring seeds far apart."""
    return _mix_bits(np.uint64(seed) + _GOLDEN)


@_compile_kernel
def _hash_cell(seed: np.uint64, salt: int, i: int, j: int) -> np.uint64:
    return _mix_bits(
        seed + np.uint64(salt) * _GOLDEN + np.uint64(i) * _APART_I + np.uint64(j) * _APART_J
    )


@_compile_kernel
def _unit_uniform(seed: np.uint64, salt: int, i: int, j: int) -> float:
    """Uniform in [0, 1)."""
    return float(_hash_cell(seed, salt, i, j) >> _S11) * 2.0**-53


@_compile_kernel
def _symmetric_uniform(seed: np.uint64, salt: int, i: int, j: int) -> float:
    """Uniform in [-1, 1)."""
    return 2.0 * _unit_uniform(seed, salt, i, j) - 1.0


@_compile_kernel
def _cell_normal(seed: np.uint64, salt: int, i: int, j: int) -> float:
    """Nearly normal, unit variance, within +-3.47: the sum of four uniform numbers."""
    h = _hash_cell(seed, salt, i, j)
    total = 0.0
    for _ in range(4):
        total += float(h & _LOW_16)
        h = h >> _S16
    return (total - _MEAN_OF_SUM) / _SD_OF_SUM


@_compile_kernel
def _smooth_step(t: float) -> float:
    return t * t * (3.0 - 2.0 * t)


@_compile_kernel
def _noise_line(seed: np.uint64, salt: int, i: int, t: float) -> float:
    """Smooth line number i through uniform values in [-1, 1) at whole t."""
    j = math.floor(t)
    s = _smooth_step(t - j)
    return (1.0 - s) * _symmetric_uniform(seed, salt, i, j) + s * _symmetric_uniform(
        seed, salt, i, j + 1
    )


@_compile_kernel
def _value_noise(seed: np.uint64, salt: int, x: float, y: float) -> float:
    """Smooth field through normal values at whole x and y; unit mean square."""
    i, j = math.floor(x), math.floor(y)
    s, t = _smooth_step(x - i), _smooth_step(y - j)
    near = (1.0 - t) * _cell_normal(seed, salt, i, j) + t * _cell_normal(seed, salt, i, j + 1)
    far = (1.0 - t) * _cell_normal(seed, salt, i + 1, j) + t * _cell_normal(
        seed, salt, i + 1, j + 1
    )
    return ((1.0 - s) * near + s * far) / _NOISE_POWER


@_compile_kernel
def uniform_numbers(seed: int, salt: int, number: int) -> Floats:
    """Numbers in [0, 1): element i depends on seed, salt and i alone."""
    key = _seed_key(seed)
    out = np.empty(number)
    for i in range(number):
        out[i] = _unit_uniform(key, salt, i, 0)
    return out


@_compile_kernel
def _row_joint(seed: np.uint64, p: Paving, i: int, v: float) -> float:
    """Where the joint before row i lies along the road, at v across."""
    wave = p.row_waviness * _noise_line(seed, _ROW_WAVE, i, v / p.row_waviness_length)
    return i * p.row_pitch + p.row_scatter * _symmetric_uniform(seed, _ROW, i, 0) + wave


@_compile_kernel
def _side_joint(seed: np.uint64, p: Paving, i: int, j: int) -> float:
    """Where the joint to the right of block j of row i lies across the road, at mid-row."""
    bond = p.bond * (i & 1) + p.bond_scatter * _symmetric_uniform(seed, _BOND, i, 0)
    return (j + bond) * p.block_pitch + p.block_scatter * _symmetric_uniform(seed, _SIDE, i, j)


@_compile_kernel
def _slanted_joint(seed: np.uint64, p: Paving, i: int, j: int, away: float) -> float:
    """The same joint, a distance away from mid-row."""
    return (
        _side_joint(seed, p, i, j) + p.block_slant * _symmetric_uniform(seed, _SLANT, i, j) * away
    )


@_compile_kernel
def _field_edge(seed: np.uint64, p: Paving, lane: int, k: int, v: float) -> float:
    """Where field k of a lane begins along the road, at v across."""
    shift = _noise_line(seed, _EDGE, k * _FAR + lane, 2.0 * v / p.field_width)
    return (k + p.field_length_scatter * shift) * p.field_length


@_compile_kernel
def _field_height(seed: np.uint64, p: Paving, lane: int, k: int) -> float:
    sign = 1.0 - 2.0 * ((lane + k) & 1)
    return sign * p.field_height + p.field_scatter * _cell_normal(seed, _FIELD, lane, k)


@_compile_kernel
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
    ramp = p.field_ramp * (1.0 + p.field_ramp_scatter * _symmetric_uniform(seed, _RAMP, lane, edge))
    if distance < 0.5 * ramp:
        level += (0.5 - _smooth_ramp(distance / ramp)) * (
            _field_height(seed, p, lane, other) - level
        )
    return level


@_compile_kernel
def _smooth_ramp(t: float) -> float:
    """Odd smooth ramp from 0 at t = 0 to 0.5 at t = 0.5."""
    return t * (1.5 - 2.0 * t * t)


@_compile_kernel
def _bed_height(seed: np.uint64, p: Paving, u: float, v: float) -> float:
    """Height of the bed that the blocks are laid on."""
    level = p.undulation * _value_noise(
        seed, _UNDULATION, u / p.undulation_length, v / p.undulation_length
    )
    if p.field_height == 0.0 and p.field_scatter == 0.0:
        return level
    lane = math.floor(v / p.field_width)
    own = _lane_level(seed, p, lane, u, v)
    right = (v - lane * p.field_width) / p.lane_ramp
    left = ((lane + 1) * p.field_width - v) / p.lane_ramp
    if right < 0.5:
        own += (0.5 - _smooth_ramp(right)) * (_lane_level(seed, p, lane - 1, u, v) - own)
    elif left < 0.5:
        own += (0.5 - _smooth_ramp(left)) * (_lane_level(seed, p, lane + 1, u, v) - own)
    return level + own


@_compile_kernel
def _block_top(seed: np.uint64, p: Paving, i: int, j: int, u: float, v: float) -> float:
    """Height of the top of block j of row i, continued beyond its edges."""
    at_u = (i + 0.5) * p.row_pitch
    at_v = 0.5 * (_side_joint(seed, p, i, j) + _side_joint(seed, p, i, j + 1))
    du, dv = u - at_u, v - at_v
    half_u, half_v = 0.25 * p.row_pitch, 0.25 * p.block_pitch
    before, after = (
        _bed_height(seed, p, at_u - half_u, at_v),
        _bed_height(seed, p, at_u + half_u, at_v),
    )
    right, left = (
        _bed_height(seed, p, at_u, at_v - half_v),
        _bed_height(seed, p, at_u, at_v + half_v),
    )
    slope_u = p.bedding * (after - before) / (2.0 * half_u)
    slope_v = p.bedding * (left - right) / (2.0 * half_v)
    slope_u += p.lean + p.tilt_scatter * _cell_normal(seed, _TILT_U, i, j)
    slope_v += p.tilt_scatter * _cell_normal(seed, _TILT_V, i, j)
    height = 0.25 * (before + after + right + left) + slope_u * du + slope_v * dv
    height += p.height_scatter * _cell_normal(seed, _HEIGHT, i, j)
    along, across = 2.0 * du / p.row_pitch, 2.0 * dv / p.block_pitch
    return height - p.crown * (along * along + across * across)


@_compile_kernel
def _shoulder_fall(p: Paving, distance: float) -> float:
    """How far the shoulder has fallen at a distance from the middle of a joint: 1 is the floor."""
    t = (distance - 0.5 * p.joint_width) / p.shoulder
    if t <= 0.0:
        return 1.0
    return 0.0 if t >= 1.0 else 1.0 - _smooth_step(t)


@_compile_kernel
def _neighbour_fraction(p: Paving, distance: float) -> float:
    """Share of the neighbour in the height: one half in the middle of the joint."""
    t = 0.5 * distance / (0.5 * p.joint_width + p.shoulder)
    return 0.0 if t >= 0.5 else 0.5 - _smooth_ramp(t)


@_compile_kernel
def _row_height(seed: np.uint64, p: Paving, i: int, u: float, v: float) -> tuple[float, float]:
    """Height of the tops of row i, and how far the shoulders at its side joints have fallen."""
    away = u - (i + 0.5) * p.row_pitch
    bond = p.bond * (i & 1) + p.bond_scatter * _symmetric_uniform(seed, _BOND, i, 0)
    j = math.floor(v / p.block_pitch - bond)
    right = _slanted_joint(seed, p, i, j, away)
    left = _slanted_joint(seed, p, i, j + 1, away)
    if v < right:
        j -= 1
        left = right
        right = _slanted_joint(seed, p, i, j, away)
    elif v >= left:
        j += 1
        right = left
        left = _slanted_joint(seed, p, i, j + 1, away)
    height = _block_top(seed, p, i, j, u, v)
    distance = min(v - right, left - v)
    share = _neighbour_fraction(p, distance)
    if share > 0.0:
        other = _block_top(seed, p, i, j - 1 if v - right < left - v else j + 1, u, v)
        height += share * (other - height)
    return height, _shoulder_fall(p, distance)


@_compile_kernel
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
    height, fallen = _row_height(seed, p, i, u, v)
    distance = min(u - before, after - u)
    share = _neighbour_fraction(p, distance)
    if share > 0.0:
        other, _ = _row_height(seed, p, i - 1 if u - before < after - u else i + 1, u, v)
        height += share * (other - height)
    fallen = 1.0 - (1.0 - fallen) * (1.0 - _shoulder_fall(p, distance))
    if fallen > 0.0:
        uneven = _value_noise(seed, _DEPTH, u / p.row_pitch, v / p.block_pitch)
        uneven = max(-1.0, min(1.0, p.joint_depth_scatter * uneven))
        height -= p.joint_depth * (1.0 + uneven) * fallen
    return height + p.texture * _value_noise(
        seed, _TEXTURE, u / p.texture_length, v / p.texture_length
    )


@_parallel_kernel
def belgian_block(seed: int, paving: Paving, u: Floats, v: Floats) -> Floats:
    """Height [m] of a Belgian block pavement at u along and v across the road."""
    key = _seed_key(seed)
    out = np.empty(u.size)
    for n in prange(u.size):
        out[n] = _pavement_height(key, paving, u[n], v[n])
    return out


@_compile_kernel
def _add_wave(wave: Floats, x: Floats, y: Floats, out: Floats) -> None:
    """Add amplitude * cos(2 pi (kx x + ky y + phase)).

    The cosine is its series about the nearest zero crossing, to 1e-13: unlike the library's it
    runs on many points at once, and gives the same bits wherever a point stands in its array.
    """
    amplitude, kx, ky, phase = wave[0], wave[1], wave[2], wave[3]
    for n in range(x.size):
        turn = kx * x[n] + ky * y[n] + phase
        turn -= np.floor(turn + 0.5)
        a = 2.0 * math.pi * (0.25 - abs(turn))
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


@_parallel_kernel
def plane_waves(waves: Floats, x: Floats, y: Floats) -> Floats:
    """Sum of plane waves; each is amplitude [m], kx, ky [1/m], phase [turns]."""
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


@_parallel_kernel
def stone_heights(
    seed: int, cell: float, smallest: float, largest: float, ratio: float, x: Floats, y: Floats
) -> Floats:
    """Height [m] of half-ellipsoids, one wholly within each square cell."""
    key = _seed_key(seed)
    out = np.zeros(x.size)
    for n in prange(x.size):
        i, j = math.floor(x[n] / cell), math.floor(y[n] / cell)
        diameter = smallest * (largest / smallest) ** _unit_uniform(key, _STONE_SIZE, i, j)
        spare = cell - diameter
        dx = x[n] - i * cell - 0.5 * diameter - spare * _unit_uniform(key, _STONE_U, i, j)
        dy = y[n] - j * cell - 0.5 * diameter - spare * _unit_uniform(key, _STONE_V, i, j)
        inside = 1.0 - 4.0 * (dx * dx + dy * dy) / (diameter * diameter)
        if inside > 0.0:
            out[n] = ratio * diameter * math.sqrt(inside)
    return out


@_compile_kernel
def _crack_line(seed: np.uint64, spacing: float, meander: float, i: int, v: float) -> float:
    """Where transverse crack i lies along the road, at v across."""
    wander = 0.75 * _noise_line(seed, _CRACK_COARSE, i, v / spacing)
    wander += 0.25 * _noise_line(seed, _CRACK_FINE, i, 8.0 * v / spacing)
    return (i + 0.5 + 0.25 * _symmetric_uniform(seed, _CRACK, i, 0)) * spacing + meander * wander


@_compile_kernel
def _crack_opening(seed: np.uint64, share: float, length: float, i: int, v: float) -> float:
    """Opening of transverse crack i at v across: 1 where it is, 0 where it is not."""
    j = math.floor(v / length)
    if _unit_uniform(seed, _CRACK_SHARE, i, j) >= share:
        return 0.0
    opening = 1.0
    if _unit_uniform(seed, _CRACK_SHARE, i, j - 1) >= share:
        opening = min(opening, (v / length - j) / _CRACK_TAPER)
    if _unit_uniform(seed, _CRACK_SHARE, i, j + 1) >= share:
        opening = min(opening, (j + 1 - v / length) / _CRACK_TAPER)
    return opening


@_parallel_kernel
def transverse_cracks(
    seed: int,
    spacing: float,
    meander: float,
    share: float,
    length: float,
    width: float,
    u: Floats,
    v: Floats,
) -> Floats:
    """Depth of the cracks as a share of the full depth; u along and v across the road [m]."""
    key = _seed_key(seed)
    out = np.zeros(u.size)
    for n in prange(u.size):
        middle = math.floor(u[n] / spacing)
        for i in range(middle - 1, middle + 2):
            opening = _crack_opening(key, share, length, i, v[n])
            away = u[n] - _crack_line(key, spacing, meander, i, v[n])
            if opening > 0.0 and abs(away) < spacing:
                ahead = _crack_line(key, spacing, meander, i, v[n] + 0.5 * width)
                behind = _crack_line(key, spacing, meander, i, v[n] - 0.5 * width)
                slope = (ahead - behind) / width
                t = 2.0 * away / (width * opening * math.sqrt(1.0 + slope * slope))
                out[n] = max(out[n], opening * (1.0 - t * t))
    return out


@_compile_kernel
def _seed_point(key: np.uint64, i: int, j: int) -> tuple[float, float]:
    return i + _unit_uniform(key, _CELL_U, i, j), j + _unit_uniform(key, _CELL_V, i, j)


@_compile_kernel
def _edge_distance(key: np.uint64, share: float, x: float, y: float) -> float:
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
    own = _unit_uniform(key, _CRACK_SHARE, own_i, own_j)
    edge = np.inf
    for i in range(own_i - 2, own_i + 3):
        for j in range(own_j - 2, own_j + 3):
            both = own + _unit_uniform(key, _CRACK_SHARE, i, j)  # the same from either side
            if (i == own_i and j == own_j) or both - math.floor(both) >= share:
                continue
            bx, by = _seed_point(key, i, j)
            nx, ny = bx - ax, by - ay
            to_middle = (0.5 * (ax + bx) - x) * nx + (0.5 * (ay + by) - y) * ny
            edge = min(edge, to_middle / math.sqrt(nx * nx + ny * ny))
    return edge


@_parallel_kernel
def alligator_cracks(
    seed: int, spacing: float, meander: float, share: float, width: float, x: Floats, y: Floats
) -> Floats:
    """Depth of the cracks as a share of the full depth."""
    key = _seed_key(seed)
    out = np.zeros(x.size)
    for n in prange(x.size):
        a, b = x[n] / spacing, y[n] / spacing
        warp = meander / spacing / _LARGEST_NOISE
        shift_a = warp * _value_noise(key, _CRACK_COARSE, 2.0 * a, 2.0 * b)
        shift_b = warp * _value_noise(key, _CRACK_FINE, 2.0 * a, 2.0 * b)
        t = 2.0 * spacing * _edge_distance(key, share, a + shift_a, b + shift_b) / width
        if t < 1.0:
            out[n] = 1.0 - t * t
    return out
