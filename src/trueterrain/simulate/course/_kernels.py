"""Evaluation of and projection onto a reference line: loops only, no checks.

A reference line is a chain of n clothoid pieces, each with linear curvature and a small change of
heading. In its own axes, x along its first tangent, piece j is at (a(t), b(t)), power series of the
fraction t of its length. The arrays of a line, as in `_line.Line`, are

begin, x, y, heading : (n + 1,) station, easting, northing [m] and heading [rad] of the borders
length, bend, twist : (n,) length [m], first curvature [1/m], change of curvature [1/m^2]
a, b : (n, powers) coefficients of the series [m]
"""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel

_MAX_ITERATIONS = 30  # [1] Newton's method needs about 4
_CONVERGED = 1e-13  # [1] change of t at which the iteration stops
_MIN_SLOPE = 0.05  # [1] bound of the derivative: negative beyond the centre of curvature


@compile_kernel
def place_stations(station, begin, length, x, y, heading, bend, twist, a, b, open_ended, out):
    """Write position, heading and curvature at stations.

    Parameters
    ----------
    station : (m,) stations [m]
    begin, length, x, y, heading, bend, twist, a, b : arrays of the line
    open_ended : whether the line continues straight beyond its ends
    out : (m, 5) written: easting, northing [m], heading [rad], curvature [1/m], its slope [1/m^2]
    """
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
    """Nearest point of piece j to (px, py): length along j, squared distance and offset.

    Newton's method for the zero of the tangential component of the difference.
    """
    c, d = math.cos(heading[j]), math.sin(heading[j])
    ex, ey = px - x[j], py - y[j]
    fx, fy = c * ex + d * ey, c * ey - d * ex  # the point in the axes of the piece
    piece_length = length[j]
    hx, hy = x[j + 1] - x[j], y[j + 1] - y[j]
    t = (ex * hx + ey * hy) / (hx * hx + hy * hy)
    t = min(max(t, 0.0), 1.0)
    gx, gy, v = 0.0, 0.0, 0.0
    for _ in range(_MAX_ITERATIONS):
        p, q = 0.0, 0.0
        for k in range(a.shape[1] - 1, -1, -1):
            p = p * t + a[j, k]
            q = q * t + b[j, k]
        along = t * piece_length
        turn = along * (bend[j] + 0.5 * twist[j] * along)
        tx, ty = math.cos(turn), math.sin(turn)
        gx, gy = fx - p, fy - q
        v = tx * gy - ty * gx
        slope = max(1.0 - (bend[j] + twist[j] * along) * v, _MIN_SLOPE)
        before = t
        t = min(max(t + (tx * gx + ty * gy) / (slope * piece_length), 0.0), 1.0)
        if abs(t - before) < _CONVERGED:
            break
    return t * piece_length, gx * gx + gy * gy, v


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
    centre_x,
    centre_y,
    first,
    group_x,
    group_y,
    group_radius,
    open_ended,
    u,
    v,
):
    """Write station and offset of the nearest point of the line for each point.

    Bounding circles exclude groups and pieces: no point of piece j is further from its centre than
    half of its length, no point of group g further from the centre of the group than its radius.

    Parameters
    ----------
    px, py : (m,) easting and northing of the points [m]
    begin, length, x, y, heading, bend, twist, a, b : arrays of the line
    centre_x, centre_y : (n,) centre of each piece [m]
    first : (groups + 1,) first piece of each group, and n
    group_x, group_y, group_radius : (groups,) bounding circles of the groups [m]
    open_ended : whether the line continues straight beyond its ends
    u, v : (m,) written: station and offset [m]
    """
    groups = group_x.size
    for n in prange(px.size):
        near, min_clearance = 0, np.inf
        for g in range(groups):
            clearance = math.hypot(px[n] - group_x[g], py[n] - group_y[g]) - group_radius[g]
            if clearance < min_clearance:
                near, min_clearance = g, clearance
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
        for attempt in range(groups + 1):  # nearest group first, to exclude the others
            g = near if attempt == 0 else attempt - 1
            if attempt > 0 and g == near:
                continue
            bound = distance + group_radius[g]
            if (px[n] - group_x[g]) ** 2 + (py[n] - group_y[g]) ** 2 > bound * bound:
                continue
            for j in range(first[g], first[g + 1]):
                bound = distance + 0.5 * length[j]
                if (px[n] - centre_x[j]) ** 2 + (py[n] - centre_y[j]) ** 2 > bound * bound:
                    continue
                along, square, across = _nearest_on(
                    px[n], py[n], j, length, x, y, heading, bend, twist, a, b
                )
                if square < best:
                    best, distance = square, math.sqrt(square)
                    u[n] = begin[j] + along
                    v[n] = across
