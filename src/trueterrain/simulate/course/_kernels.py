"""Loops over stations and points; arguments are checked by the callers.

A reference line is a chain of pieces on which curvature is linear and the heading turns little. In
its own axes, x along its first tangent, piece j is at (a(t), b(t)), power series of the share t of
its length.
"""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel

_ROUNDS = 30  # Newton's method needs about 4
_CLOSE = 1e-13  # [1] of the length of a piece, at which it stops
_FLATTEST = 0.05  # [1] least slope that it believes: it is negative beyond the centre of curvature


@compile_kernel
def place_stations(station, begin, length, x, y, heading, bend, twist, a, b, open_ended, out):
    """Write easting, northing, heading, curvature and its slope at each station into `out`."""
    last = length.size - 1
    for n in range(station.size):
        s = station[n]
        j = min(max(np.searchsorted(begin, s, side="right") - 1, 0), last)
        along = s - begin[j]
        beyond = along - length[j]
        if open_ended and (along < 0.0 or (j == last and beyond > 0.0)):
            k = j if along < 0.0 else j + 1
            straight = along if along < 0.0 else beyond
            out[n, 0] = x[k] + straight * math.cos(heading[k])
            out[n, 1] = y[k] + straight * math.sin(heading[k])
            out[n, 2], out[n, 3], out[n, 4] = heading[k], 0.0, 0.0
            continue
        t = along / length[j]
        p, q = 0.0, 0.0
        for k in range(a.shape[1] - 1, -1, -1):
            p = p * t + a[j, k]
            q = q * t + b[j, k]
        c, d = math.cos(heading[j]), math.sin(heading[j])
        out[n, 0] = x[j] + (c * p - d * q)
        out[n, 1] = y[j] + (d * p + c * q)
        out[n, 2] = heading[j] + along * (bend[j] + 0.5 * twist[j] * along)
        out[n, 3] = bend[j] + twist[j] * along
        out[n, 4] = twist[j]


@compile_kernel
def _nearest_on(px, py, j, length, x, y, heading, bend, twist, a, b):
    """Length along piece j, squared distance and offset of the point on it nearest to (px, py)."""
    c, d = math.cos(heading[j]), math.sin(heading[j])
    ex, ey = px - x[j], py - y[j]
    fx, fy = c * ex + d * ey, c * ey - d * ex  # the point in the axes of the piece
    whole = length[j]
    hx, hy = x[j + 1] - x[j], y[j + 1] - y[j]
    t = (ex * hx + ey * hy) / (hx * hx + hy * hy)
    t = min(max(t, 0.0), 1.0)
    gx, gy, v = 0.0, 0.0, 0.0
    for _ in range(_ROUNDS):
        p, q = 0.0, 0.0
        for k in range(a.shape[1] - 1, -1, -1):
            p = p * t + a[j, k]
            q = q * t + b[j, k]
        along = t * whole
        turn = along * (bend[j] + 0.5 * twist[j] * along)
        tx, ty = math.cos(turn), math.sin(turn)
        gx, gy = fx - p, fy - q
        v = tx * gy - ty * gx
        slope = max(1.0 - (bend[j] + twist[j] * along) * v, _FLATTEST)
        before = t
        t = min(max(t + (tx * gx + ty * gy) / (slope * whole), 0.0), 1.0)
        if abs(t - before) < _CLOSE:
            break
    return t * whole, gx * gx + gy * gy, v


@compile_kernel(parallel=True)
def project_points(
    px,
    py,
    begin,
    length,
    x,
    y,
    heading,
    bend,
    twist,
    a,
    b,
    middle_x,
    middle_y,
    first,
    group_x,
    group_y,
    group_reach,
    open_ended,
    u,
    v,
):
    """Write station and offset of the nearest point of the line into `u` and `v`.

    No point of piece j is further from its middle than half of its length, and no point of group g,
    pieces first[g] to first[g + 1], further from the group's middle than its reach.
    """
    groups = group_x.size
    for n in prange(px.size):
        near, least = 0, np.inf
        for g in range(groups):
            away = math.hypot(px[n] - group_x[g], py[n] - group_y[g]) - group_reach[g]
            if away < least:
                near, least = g, away
        best, distance = np.inf, np.inf
        if open_ended:
            for end in range(2):
                k = end * length.size
                c, d = math.cos(heading[k]), math.sin(heading[k])
                ex, ey = px[n] - x[k], py[n] - y[k]
                along, across = c * ex + d * ey, c * ey - d * ex
                if ((end == 0 and along <= 0.0) or (end == 1 and along >= 0.0)) and (
                    across * across < best
                ):
                    best, distance = across * across, abs(across)
                    u[n] = along if end == 0 else begin[length.size] + along
                    v[n] = across
        for round_ in range(groups + 1):  # the nearest group first, so that it rules out the others
            g = near if round_ == 0 else round_ - 1
            if round_ > 0 and g == near:
                continue
            wide = distance + group_reach[g]
            if (px[n] - group_x[g]) ** 2 + (py[n] - group_y[g]) ** 2 > wide * wide:
                continue
            for j in range(first[g], first[g + 1]):
                wide = distance + 0.5 * length[j]
                if (px[n] - middle_x[j]) ** 2 + (py[n] - middle_y[j]) ** 2 > wide * wide:
                    continue
                along, square, across = _nearest_on(
                    px[n], py[n], j, length, x, y, heading, bend, twist, a, b
                )
                if square < best:
                    best, distance = square, math.sqrt(square)
                    u[n] = begin[j] + along
                    v[n] = across
