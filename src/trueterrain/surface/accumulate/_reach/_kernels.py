"""Loops that predict the rows a scan reaches; callers check the arguments."""

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _find_strip(px, py, nx, ny, i, x, y):
    """Strip of the line that holds the point (x, y), searched from strip i on."""
    last = px.size - 2
    while i > 0 and (x - px[i]) * ny[i] - (y - py[i]) * nx[i] < 0.0:
        i -= 1
    while i < last and (x - px[i + 1]) * ny[i + 1] - (y - py[i + 1]) * nx[i + 1] >= 0.0:
        i += 1
    return i


@compile_kernel
def scan_reach(
    expansion,
    pieces,
    piece,
    beam,
    furthest,
    px,
    py,
    nx,
    ny,
    dx,
    dy,
    hint,
    right,
    left,
    margin,
    low,
    high,
):
    """Rows that sampled beams of each scan cross, up to a range and within the offsets."""
    rows = px.size - 2
    where, ray = np.empty(2), np.empty(2)
    for n in range(hint.size):
        i = np.int64(hint[n])
        first, last = np.int64(rows), np.int64(0)
        for b in range(piece.size):
            motion = expansion[n * pieces + piece[b]]
            for axis in range(2):
                c = motion[axis]
                where[axis] = c[0] + c[1] * beam[1, b] + c[2] * beam[2, b]
                ray[axis] = 0.0
                for k in range(3, 9):
                    ray[axis] += c[k] * beam[k, b]
            offset = (where[1] - py[i]) * dx[i] - (where[0] - px[i]) * dy[i]
            lateral = ray[1] * dx[i] - ray[0] * dy[i]
            r = furthest
            if lateral > 0.0:
                r = min(r, max((left - offset) / lateral, 0.0))
            elif lateral < 0.0:
                r = min(r, max((right - offset) / lateral, 0.0))
            begin = _find_strip(px, py, nx, ny, i, where[0], where[1])
            end = _find_strip(px, py, nx, ny, begin, where[0] + r * ray[0], where[1] + r * ray[1])
            first = min(first, begin, end)
            last = max(last, begin, end)
        # a strip covers half of the rows of both its nodes
        low[n] = min(max(first - 1 - margin, 0), rows - 1)
        high[n] = max(min(last + margin, rows - 1), 0)
