"""Loops over points; all checks are made by the callers."""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def add_points(x, y, z, t, size, per_step, per_time, parts, bin_length, keys, sums, table, used):
    """Add points to the sums of cells and visits, kept in a hash table with linear probing.

    Sums are integers, which may wrap: centred moments are exact nevertheless.

    x, y, z, t : (point,) coordinates [m] and times [s] or [m]
    size : side of a cell [m]
    per_step, per_time : integer steps per metre of height, and per unit of time
    parts : integer parts of the side of a cell
    bin_length : length of a bin of time; a key is a cell and a bin
    keys : (key, 2) cell and bin; sums : (key, 13) count, x, y, z, t, xx, xy, yy, xz, yz, zz, and
    minimum and maximum of t
    table : (power of 2,) number of the key at a hash, or -1; used : number of keys

    Stops before the table is more than half full. Returns the numbers of points added and of keys.
    """
    mask = np.int64(table.size - 1)
    capacity = min(table.size // 2, keys.shape[0])
    last_cell, last_bin, last = np.int64(-1), np.int64(-1), np.int64(-1)
    for i in range(x.size):
        column, row = math.floor(x[i] / size), math.floor(y[i] / size)
        cell = (np.int64(column) << 32) + np.int64(row)
        when = np.int64(math.floor(t[i] / bin_length))
        if cell != last_cell or when != last_bin or last < 0:
            mixed = (cell ^ (cell >> 29)) * np.int64(0x5851F42D4C957F2D)
            mixed = (mixed ^ (mixed >> 32) ^ when) * np.int64(0x14057B7EF767814F)
            at = (mixed ^ (mixed >> 31)) & mask
            while table[at] >= 0 and (keys[table[at], 0] != cell or keys[table[at], 1] != when):
                at = (at + 1) & mask
            if table[at] < 0:
                if used >= capacity:
                    return i, used
                table[at] = used
                keys[used, 0], keys[used, 1] = cell, when
                sums[used, 11], sums[used, 12] = np.int64(1) << 62, -(np.int64(1) << 62)
                used += 1
            last_cell, last_bin, last = cell, when, table[at]
        px = np.int64(math.floor((x[i] / size - column - 0.5) * parts + 0.5))
        py = np.int64(math.floor((y[i] / size - row - 0.5) * parts + 0.5))
        pz = np.int64(math.floor(z[i] * per_step + 0.5))
        pt = np.int64(math.floor(t[i] * per_time + 0.5))
        sums[last, 0] += 1
        sums[last, 1] += px
        sums[last, 2] += py
        sums[last, 3] += pz
        sums[last, 4] += pt
        sums[last, 5] += px * px
        sums[last, 6] += px * py
        sums[last, 7] += py * py
        sums[last, 8] += px * pz
        sums[last, 9] += py * pz
        sums[last, 10] += pz * pz
        sums[last, 11] = min(sums[last, 11], pt)
        sums[last, 12] = max(sums[last, 12], pt)
    return x.size, used


@compile_kernel
def rehash_keys(keys, used, table):
    """Insert the first `used` keys, (key, 2), into an empty table of -1."""
    mask = np.int64(table.size - 1)
    for k in range(used):
        cell, when = keys[k, 0], keys[k, 1]
        mixed = (cell ^ (cell >> 29)) * np.int64(0x5851F42D4C957F2D)
        mixed = (mixed ^ (mixed >> 32) ^ when) * np.int64(0x14057B7EF767814F)
        at = (mixed ^ (mixed >> 31)) & mask
        while table[at] >= 0:
            at = (at + 1) & mask
        table[at] = k


@compile_kernel
def join_visits(keys, sums, gap):
    """Join sums of the same cell whose times are closer than a gap: one visit.

    keys : (key, 2) sorted by cell, then by time; sums : (key, 13); gap : in integer steps of time

    Works in place; returns the number of visits.
    """
    joined = 0
    for k in range(keys.shape[0]):
        same = joined > 0 and keys[k, 0] == keys[joined - 1, 0]
        if same and sums[k, 11] - sums[joined - 1, 12] <= gap:
            for n in range(11):
                sums[joined - 1, n] += sums[k, n]
            sums[joined - 1, 12] = sums[k, 12]
        else:
            keys[joined] = keys[k]
            sums[joined] = sums[k]
            joined += 1
    return joined
