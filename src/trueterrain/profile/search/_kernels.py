"""Loops that gather the heights inside search areas. No checks: the callers make them.

Every gatherer is called twice: without output arrays it counts, with them it fills. The count of
one path point is the length of its slice, so that all threads write apart from each other.
"""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel

_EMPTY = -1


# inlined, so that the compiler takes the choice of the shape out of the loops: a third faster
@compile_kernel(inline="always")
def _is_inside(shape, half, cos, sin, px, py):
    """Whether a search area holds the point (px, py) from its middle; discs need no turning."""
    if shape == 0 and half[0] == half[1]:
        return px * px + py * py <= half[0] * half[0]
    a, b = cos * px + sin * py, cos * py - sin * px
    if shape == 0:
        return (a / half[0]) ** 2 + (b / half[1]) ** 2 <= 1.0
    return abs(a) <= half[0] and abs(b) <= half[1]


@compile_kernel
def _hash_slot(keys, key):
    """Slot of a key in an open addressed hash table, or the empty one where it would be."""
    mask = keys.size - 1
    slot = ((key * 0x9E3779B97F4A7C15) >> 20) & mask
    while keys[slot] != _EMPTY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@compile_kernel(parallel=True)
def gather_grid(origin, normal, v, height, at, row, heading, shape, half, reach, start, dx, dy, z):
    """Gather nodes of a grid; node (i, j) lies at origin[i] + v[j] * normal[i].

    `row` is the row of the cell in which each path point lies, -1 outside of the surface. Also
    returns which search areas reach the edge of the surface: other nodes may lie beyond it.
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
                ox, oy = x - origin[i, 0], y - origin[i, 1]
                nx, ny = normal[i, 0], normal[i, 1]
                stretch = math.sqrt(nx * nx + ny * ny)
                off_line = (ox * ny - oy * nx) / stretch
                if abs(off_line) > reach:
                    break
                along = (ox * nx + oy * ny) / (stretch * stretch)
                span = math.sqrt(reach * reach - off_line * off_line) / stretch
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

    Returns the quantity of cells; the table (`keys`, `numbers`) is open addressed.
    """
    quantity = 0
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
                    numbers[slot] = quantity
                    column[quantity] = c
                    row[quantity] = r
                    quantity += 1
    return quantity


@compile_kernel(parallel=True)
def find_cells(
    easting, northing, up, low, high, columns, cells_per_metre, coarse, coarse_scale, keys, numbers
):
    """Number of the cell of each point; -1 where no search area comes near it."""
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
def sort_into_cells(cell, quantity):
    """Counting sort: where each cell begins, and the points in the order of their cells."""
    begin = np.zeros(quantity + 1, np.int64)
    for n in range(cell.size):
        begin[cell[n] + 1] += 1
    for c in range(quantity):
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
    """Gather scattered points, sorted into cells, inside the search area of each path point."""
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
                cell = numbers[
                    _hash_slot(keys, r * columns + c)
                ]  # all that are touched have a number
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
    """Take the slope out of each search area: z - b dx - c dy of a robust plane a + b dx + c dy.

    The plane first minimises the sum of absolute residuals (reweighted least squares), so that a
    stone does not tilt it. That plane passes exactly through three heights; Tukey's biweight takes
    it from there to the least squares of all heights but the stone. Where the points do not tell a
    direction (a single scan line), the plane has no slope in it: the normal equations are solved
    along their own axes.
    """
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n < 3:
            continue
        # in an order of their own, so that the sums forget that of the input
        order = np.argsort(z[first:last], kind="mergesort")
        order = order[np.argsort(dy[first:last][order], kind="mergesort")]
        order = order[np.argsort(dx[first:last][order], kind="mergesort")]
        x, y, h = dx[first:last][order], dy[first:last][order], z[first:last][order]
        reference = h[0]
        weight, residual = np.ones(n), np.empty(n)
        b = c = scale = 0.0  # no scale yet: absolute residuals
        for turn in range(2 * iterations):
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
            # principal axes of the points; the weaker one may not carry a slope
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
            settled = abs(b - old_b) + abs(c - old_c) <= tolerance
            if scale > 0.0 and settled:
                break
            if scale == 0.0 and (settled or turn == iterations - 1):
                # six robust standard deviations, as the median of absolute residuals tells them
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
    """Sort each slice by height, equal heights by distance: the order of the input is forgotten.

    The sorted heights overwrite `z`; the distances from the path point go to `distance`.
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
        # sorts short slices, and puts the few equal heights of long ones in order
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
