"""Random numbers and smooth noise as functions of a seed and a cell: loops only, no checks.

A number is a hash of the seed, its purpose (salt) and the integer indices of a cell, never from a
table or a sequential generator. So a ground is unbounded, and the height at a point depends on that
point alone.
"""

import math
from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np

from trueterrain.core.kernels import compile_kernel
from trueterrain.simulate.ground._ground import Floats

_Function = TypeVar("_Function", bound=Callable[..., object])


def typed_kernel(function: _Function) -> _Function:
    """Compile a function, with its type for the type checker."""
    return cast("_Function", compile_kernel(function))


def typed_parallel_kernel(function: _Function) -> _Function:
    """Compile a parallel loop, with its type for the type checker."""
    return cast("_Function", compile_kernel(function, parallel=True))


# Constants of splitmix64 (Steele, Lea, Flood 2014, "Fast splittable pseudorandom number
# generators") and two odd multipliers for the indices.
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_STRIDE_I = np.uint64(0xD6E8FEB86659FD93)
_STRIDE_J = np.uint64(0xA0761D6478BD642F)
_S11, _S16, _S27, _S30, _S31 = (np.uint64(n) for n in (11, 16, 27, 30, 31))
_LOW_16 = np.uint64(0xFFFF)

_MEAN_OF_SUM = 2.0 * 65535.0  # of four 16-bit numbers
_SD_OF_SUM = math.sqrt(4.0 * (65536.0**2 - 1.0) / 12.0)
# Mean square of a smoothly interpolated line of independent values of unit variance: the mean over
# t of (1 - s)^2 + s^2 with s = 3 t^2 - 2 t^3.
_NOISE_POWER = 26.0 / 35.0
MAX_NOISE = math.sqrt(12.0) / _NOISE_POWER  # four extreme neighbours


@typed_kernel
def _mix_bits(z: np.uint64) -> np.uint64:
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@typed_kernel
def seed_key(seed: int) -> np.uint64:
    """Key of a seed for the functions below; those of consecutive seeds are unrelated."""
    return _mix_bits(np.uint64(seed) + _GOLDEN)


@typed_kernel
def _hash_cell(seed: np.uint64, salt: int, i: int, j: int) -> np.uint64:
    # by int64, since plain Python refuses a negative number as uint64
    row, column = np.uint64(np.int64(i)), np.uint64(np.int64(j))
    return _mix_bits(seed + np.uint64(salt) * _GOLDEN + row * _STRIDE_I + column * _STRIDE_J)


@typed_kernel
def unit_uniform(seed: np.uint64, salt: int, i: int, j: int) -> float:
    """Uniform number of a cell in [0, 1)."""
    return float(_hash_cell(seed, salt, i, j) >> _S11) * 2.0**-53


@typed_kernel
def symmetric_uniform(seed: np.uint64, salt: int, i: int, j: int) -> float:
    """Uniform number of a cell in [-1, 1)."""
    return 2.0 * unit_uniform(seed, salt, i, j) - 1.0


@typed_kernel
def cell_normal(seed: np.uint64, salt: int, i: int, j: int) -> float:
    """Nearly normal number of unit variance, within +-3.47: a scaled sum of four uniform ones."""
    h = _hash_cell(seed, salt, i, j)
    total = 0.0
    for _ in range(4):
        total += float(h & _LOW_16)
        h = h >> _S16
    return (total - _MEAN_OF_SUM) / _SD_OF_SUM


@typed_kernel
def smooth_ramp(t: float) -> float:
    """Odd smooth ramp from 0 at t = 0 to 0.5 at t = 0.5."""
    return t * (1.5 - 2.0 * t * t)


@typed_kernel
def smooth_step(t: float) -> float:
    return t * t * (3.0 - 2.0 * t)


@typed_kernel
def noise_line(seed: np.uint64, salt: int, i: int, t: float) -> float:
    """Smooth random function number i, through uniform values in [-1, 1) at whole t."""
    j = math.floor(t)
    s = smooth_step(t - j)
    return (1.0 - s) * symmetric_uniform(seed, salt, i, j) + s * symmetric_uniform(
        seed, salt, i, j + 1
    )


@typed_kernel
def value_noise(seed: np.uint64, salt: int, x: float, y: float) -> float:
    """Smooth random field through normal values at whole x and y, with unit mean square."""
    i, j = math.floor(x), math.floor(y)
    s, t = smooth_step(x - i), smooth_step(y - j)
    near = (1.0 - t) * cell_normal(seed, salt, i, j) + t * cell_normal(seed, salt, i, j + 1)
    far = (1.0 - t) * cell_normal(seed, salt, i + 1, j) + t * cell_normal(seed, salt, i + 1, j + 1)
    return ((1.0 - s) * near + s * far) / _NOISE_POWER


@typed_kernel
def uniform_numbers(seed: int, salt: int, number: int) -> Floats:
    """Uniform numbers in [0, 1); element i depends on seed, salt and i alone."""
    key = seed_key(seed)
    out = np.empty(number)
    for i in range(number):
        out[i] = unit_uniform(key, salt, i, 0)
    return out
