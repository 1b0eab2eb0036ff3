"""Loops that gather the heights inside search areas; arguments are checked by the callers.

Every gatherer is called twice: without output arrays it counts, with them it fills. The count of
one path point is the length of its slice, so that threads write to separate slices.

Arguments that several kernels take:

- ``at`` (s, 2) [m] and ``heading`` (s,) [rad] of the path points;
- ``shape``, ``half`` (2,) [m] and ``reach`` [m]: code of the search area (0 ellipse, 1 rectangle),
  half axes and radius of the circle around it, see `kernel_area`;
- ``start`` (s + 1,): first index of the slice of each path point; ``dx``, ``dy``, ``z`` (n,) [m]:
  output, position relative to the path point and height, empty to count only;
- ``keys`` (size,), ``numbers`` (size,): open addressed hash table from the key of a cell
  (row * columns + column) to its number; ``low`` (2,) [m] is the origin of the cells.
"""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel

_EMPTY = -1


# inlined, so that the compiler takes the choice of the shape out of the loops: a third faster
@compile_kernel(inline="always")
def _is_inside(shape, half, cos, sin, px, py):
    """Whether a search area contains the point (px, py) [m] relative to its centre."""
    if shape == 0 and half[0] == half[1]:  # a disc needs no rotation
        return px * px + py * py <= half[0] * half[0]
    a, b = cos * px + sin * py, cos * py - sin * px
    if shape == 0:
        return (a / half[0]) ** 2 + (b / half[1]) ** 2 <= 1.0
    return abs(a) <= half[0] and abs(b) <= half[1]


@compile_kernel
def _hash_slot(keys, key):
    """Slot of a key in an open addressed hash table, or the empty slot for it."""
    # multiplicative hashing by 2^64 / golden ratio (Knuth), linear probing
    mask = keys.size - 1
    slot = ((key * 0x9E3779B97F4A7C15) >> 20) & mask
    while keys[slot] != _EMPTY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@compile_kernel(parallel=True)
def gather_grid(origin, normal, v, height, at, row, heading, shape, half, reach, start, dx, dy, z):
    """Gather nodes of a grid; node (i, j) lies at origin[i] + v[j] * normal[i].

    ``origin`` (u, 2) [m], ``normal`` (u, 2) [1], ``v`` (v,) [m] ascending, ``height`` (u, v) [m];
    ``row`` (s,) is the row of the cell in which each path point lies, -1 outside of the surface.
    Returns the counts and which search areas reach the edge of the surface, beyond which other
    nodes may lie. From its row, the search proceeds to both sides until a row is out of reach.
    """
    fill = dx.size > 0
    counts, at_edge = np.zeros(row.size, np.int64), np.zeros(row.size, np.bool_)
    nu, nv = height.shape
    for k in prange(row.size):
        if row[k] < 0:
            at_edge[k] = True
            continue
        x, y = at[k, 0], at[k, 1]
        cos, sin = math.cos(heading[k]), math.sin(heading[k])
        count = 0
        write = start[k] if fill else 0
        for direction in (-1, 1):
            i = row[k] if direction == -1 else row[k] + 1
            while True:
                if not 0 <= i < nu:
                    at_edge[k] = True
                    break
                # the row is a line through its origin: distance of the path point from it, and
                # the span of v within reach
                ox, oy = x - origin[i, 0], y - origin[i, 1]
                nx, ny = normal[i, 0], normal[i, 1]
                norm = math.sqrt(nx * nx + ny * ny)
                distance = (ox * ny - oy * nx) / norm
                if abs(distance) > reach:
                    break
                along = (ox * nx + oy * ny) / (norm * norm)
                span = math.sqrt(reach * reach - distance * distance) / norm
                if along - span < v[0] or along + span > v[nv - 1]:
                    at_edge[k] = True
                j = np.searchsorted(v, along - span)
                while j < nv and v[j] <= along + span:
                    px = origin[i, 0] + v[j] * nx - x
                    py = origin[i, 1] + v[j] * ny - y
                    inside = _is_inside(shape, half, cos, sin, px, py)
                    if inside and math.isfinite(height[i, j]):
                        if fill:
                            dx[write + count] = px
                            dy[write + count] = py
                            z[write + count] = height[i, j]
                        count += 1
                    j += 1
                i += direction
        counts[k] = count
    return counts, at_edge


@compile_kernel
def number_cells(column, row, columns, cells_per_metre, reach, at, low, keys, numbers):
    """Number the cells that the search areas touch, in path order, in a hash table.

    Writes the column and row of each cell to ``column`` and ``row``, and returns their number.
    """
    count = 0
    for k in range(at.shape[0]):
        left = int(math.floor((at[k, 0] - reach - low[0]) * cells_per_metre))
        right = int(math.floor((at[k, 0] + reach - low[0]) * cells_per_metre))
        bottom = int(math.floor((at[k, 1] - reach - low[1]) * cells_per_metre))
        top = int(math.floor((at[k, 1] + reach - low[1]) * cells_per_metre))
        for r in range(bottom, top + 1):
            for c in range(left, right + 1):
                key = r * columns + c
                slot = _hash_slot(keys, key)
                if keys[slot] == _EMPTY:
                    keys[slot] = key
                    numbers[slot] = count
                    column[count] = c
                    row[count] = r
                    count += 1
    return count


@compile_kernel(parallel=True)
def find_cells(
    easting, northing, up, low, high, columns, cells_per_metre, coarse, coarse_scale, keys, numbers
):
    """Number of the cell of each point; -1 where no search area touches the cell.

    ``easting``, ``northing``, ``up`` (n,) [m]; ``high`` (2,) [m] is the extent of the cells. The
    mask ``coarse`` rejects most points by one look-up in a cache, before the hash table is asked.
    """
    found = np.empty(easting.size, np.int32)
    for n in prange(easting.size):
        found[n] = -1
        x, y = easting[n] - low[0], northing[n] - low[1]
        if not (0.0 <= x < high[0] and 0.0 <= y < high[1]) or not math.isfinite(up[n]):
            continue
        c, r = int(x * cells_per_metre), int(y * cells_per_metre)
        if not coarse[int(r * coarse_scale[1]), int(c * coarse_scale[0])]:
            continue
        key = r * columns + c
        slot = _hash_slot(keys, key)
        if keys[slot] == key:
            found[n] = numbers[slot]
    return found


@compile_kernel
def sort_into_cells(cell, cell_count):
    """Counting sort of points by the number of their ``cell`` (n,).

    Returns the first index of each cell (cell_count + 1,), and the order of the points (n,).
    """
    begin = np.zeros(cell_count + 1, np.int64)
    for n in range(cell.size):
        begin[cell[n] + 1] += 1
    for c in range(cell_count):
        begin[c + 1] += begin[c]
    place = begin[:-1].copy()
    order = np.empty(cell.size, np.int64)
    for n in range(cell.size):
        order[place[cell[n]]] = n
        place[cell[n]] += 1
    return begin, order


@compile_kernel(parallel=True)
def gather_scattered(
    points,
    begin,
    low,
    columns,
    cells_per_metre,
    keys,
    numbers,
    at,
    heading,
    shape,
    half,
    reach,
    start,
    dx,
    dy,
    z,
):
    """Gather scattered points inside the search area of each path point.

    ``points`` (n, 3) [m] are sorted by cell, ``begin`` is the first index of each cell.
    """
    fill = dx.size > 0
    counts = np.zeros(at.shape[0], np.int64)
    for k in prange(at.shape[0]):
        x, y = at[k, 0], at[k, 1]
        cos, sin = math.cos(heading[k]), math.sin(heading[k])
        left = int(math.floor((x - reach - low[0]) * cells_per_metre))
        right = int(math.floor((x + reach - low[0]) * cells_per_metre))
        bottom = int(math.floor((y - reach - low[1]) * cells_per_metre))
        top = int(math.floor((y + reach - low[1]) * cells_per_metre))
        count = 0
        write = start[k] if fill else 0
        for r in range(bottom, top + 1):
            for c in range(left, right + 1):
                # every cell that a search area touches has a number
                cell = numbers[_hash_slot(keys, r * columns + c)]
                for n in range(begin[cell], begin[cell + 1]):
                    px, py = points[n, 0] - x, points[n, 1] - y
                    if _is_inside(shape, half, cos, sin, px, py):
                        if fill:
                            dx[write + count] = px
                            dy[write + count] = py
                            z[write + count] = points[n, 2]
                        count += 1
        counts[k] = count
    return counts


@compile_kernel(parallel=True)
def level_areas(start, dx, dy, z, step, tolerance, iterations):
    """Subtract the slope of each search area: z - b dx - c dy of a robust plane a + b dx + c dy.

    The plane first minimises the sum of absolute residuals, by iteratively reweighted least
    squares, so that a stone does not tilt it. That plane passes exactly through three heights;
    Tukey's biweight then converges to the least squares of all heights without the stone. In a
    direction that the points do not determine (of a single scan line) the slope is 0: the normal
    equations are solved along their principal axes.

    ``step`` [m] is the residual below which weights are equal, ``tolerance`` [1] the change of the
    slope at convergence, ``iterations`` the maximum number for each of the two estimators.
    """
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n < 3:
            continue
        # sorted, so that the sums do not depend on the order of the input
        order = np.argsort(z[first:last], kind="mergesort")
        order = order[np.argsort(dy[first:last][order], kind="mergesort")]
        order = order[np.argsort(dx[first:last][order], kind="mergesort")]
        x, y, h = dx[first:last][order], dy[first:last][order], z[first:last][order]
        reference = h[0]
        weight, residual = np.ones(n), np.empty(n)
        b = c = scale = 0.0  # no scale yet: absolute residuals
        for iteration in range(2 * iterations):
            sw = sx = sy = sz = 0.0
            for m in range(n):
                w = weight[m]
                sw += w
                sx += w * x[m]
                sy += w * y[m]
                sz += w * (h[m] - reference)
            mx, my, mz = sx / sw, sy / sw, sz / sw
            xx = xy = yy = xz = yz = 0.0
            for m in range(n):
                w = weight[m]
                px, py = x[m] - mx, y[m] - my
                pz = h[m] - reference - mz
                xx += w * px * px
                xy += w * px * py
                yy += w * py * py
                xz += w * px * pz
                yz += w * py * pz
            # principal axes of the points; along the weaker one the slope may be undetermined
            half_trace = 0.5 * (xx + yy)
            root = math.sqrt((0.5 * (xx - yy)) ** 2 + xy * xy)
            strong, weak = half_trace + root, half_trace - root
            angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
            ca, sa = math.cos(angle), math.sin(angle)
            slope_strong = (ca * xz + sa * yz) / strong if strong > 0.0 else 0.0
            slope_weak = (ca * yz - sa * xz) / weak if weak > 1e-6 * strong else 0.0
            old_b, old_c = b, c
            b = ca * slope_strong - sa * slope_weak
            c = sa * slope_strong + ca * slope_weak
            a = mz - b * mx - c * my
            for m in range(n):
                residual[m] = abs(h[m] - reference - a - b * x[m] - c * y[m])
            converged = abs(b - old_b) + abs(c - old_c) <= tolerance
            if scale > 0.0 and converged:
                break
            if scale == 0.0 and (converged or iteration == iterations - 1):
                # bound of the biweight: six standard deviations by the median absolute residual
                scale = 6.0 * max(1.4826 * np.median(residual), step)
            for m in range(n):
                if scale == 0.0:
                    weight[m] = 1.0 / max(residual[m], step)
                else:
                    weight[m] = max(1.0 - (residual[m] / scale) ** 2, 0.0) ** 2
        for m in range(n):
            dx[first + m], dy[first + m] = x[m], y[m]
            z[first + m] = h[m] - (b * x[m] + c * y[m])


@compile_kernel(parallel=True)
def sort_heights(start, dx, dy, z, distance):
    """Sort each slice by height, equal heights by distance, whatever the order of the input.

    The sorted heights overwrite ``z``; the distances from the path point go to ``distance`` [m].
    """
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        for m in range(first, last):
            distance[m] = math.sqrt(dx[m] * dx[m] + dy[m] * dy[m])
        if last - first > 48:
            order = np.argsort(z[first:last])
            heights = z[first:last][order]
            distances = distance[first:last][order]
            z[first:last] = heights
            distance[first:last] = distances
            equal = first
            for m in range(first + 1, last + 1):
                if m == last or z[m] != z[equal]:
                    if m - equal > 48:
                        distance[equal:m] = np.sort(distance[equal:m])
                    equal = m
        # insertion sort: of short slices, and of the few equal heights of long ones
        for m in range(first + 1, last):
            height, far = z[m], distance[m]
            hole = m
            while hole > first and (
                z[hole - 1] > height or (z[hole - 1] == height and distance[hole - 1] > far)
            ):
                z[hole] = z[hole - 1]
                distance[hole] = distance[hole - 1]
                hole -= 1
            z[hole] = height
            distance[hole] = far
