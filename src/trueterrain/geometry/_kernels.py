"""Loops over points and the strips of a curve; all checks are made by the callers.

A *strip* i is the part of the road between the nodes i and i + 1 of its reference line, a *block*
a run of strips, a *bucket* a square of ground that lists the blocks whose boxes touch it.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.core.kernels import compile_kernel

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


class CrossSections(NamedTuple):
    """Where the cross-sections of a curve lie: at offset v, ``easting + v * normal_easting``."""

    station: Floats
    "Stations of the points of the curve, shape (s,) [m]."

    easting: Floats
    "Points of the curve, shape (s,) [m]."

    northing: Floats
    "Points of the curve, shape (s,) [m]."

    normal_easting: Floats
    "Direction per metre of offset, to the left, shape (s,) [m/m]."

    normal_northing: Floats
    "Direction per metre of offset, to the left, shape (s,) [m/m]."


class StripIndex(NamedTuple):
    """Which strips can hold a point: blocks of strips with their boxes, and buckets of blocks."""

    right: float
    left: float
    edge: float
    block_starts: npt.NDArray[np.int64]
    boxes: Floats
    scan_all: npt.NDArray[np.bool_]
    bucket_starts: npt.NDArray[np.int64]
    bucket_items: npt.NDArray[np.int32]
    bucket_easting: float
    bucket_northing: float
    bucket_size: float
    columns: int
    rows: int


@compile_kernel
def fill_buckets(
    boxes: Floats, origin_x: float, origin_y: float, size: float, columns: int, rows: int
) -> tuple[Integers, npt.NDArray[np.int32]]:
    """Blocks of each bucket, as starts and items; `boxes` holds x0, y0, x1, y1 of each block."""
    counts = np.zeros(columns * rows + 1, np.int64)
    starts = counts
    items = np.empty(0, np.int32)
    for turn in range(2):
        if turn == 1:
            for k in range(1, counts.size):
                counts[k] += counts[k - 1]
            starts = counts.copy()
            items = np.empty(counts[-1], np.int32)
        for b in range(boxes.shape[0]):
            c0 = max(0, int((boxes[b, 0] - origin_x) / size))
            c1 = min(columns - 1, int((boxes[b, 2] - origin_x) / size))
            r0 = max(0, int((boxes[b, 1] - origin_y) / size))
            r1 = min(rows - 1, int((boxes[b, 3] - origin_y) / size))
            for r in range(r0, r1 + 1):
                for c in range(c0, c1 + 1):
                    k = r * columns + c
                    if turn == 0:
                        counts[k + 1] += 1
                    else:
                        items[counts[k]] = b
                        counts[k] += 1
    return starts, items


@compile_kernel
def place_points(sections: CrossSections, u: Floats, v: Floats, x: Floats, y: Floats) -> None:
    """Ground coordinates of (u, v); straight on beyond both ends."""
    nodes, px, py, nx, ny = sections
    last = nodes.size - 2
    i = 0
    for k in range(u.size):
        i = _find_interval(nodes, u[k], i, last)
        t = (u[k] - nodes[i]) / (nodes[i + 1] - nodes[i])
        # beyond an end, on along the end chord with the cross-section of the end node
        a = min(max(t, 0.0), 1.0)
        x[k] = (1 - a) * (px[i] + v[k] * nx[i]) + a * (px[i + 1] + v[k] * nx[i + 1])
        y[k] = (1 - a) * (py[i] + v[k] * ny[i]) + a * (py[i + 1] + v[k] * ny[i + 1])
        x[k] += (t - a) * (px[i + 1] - px[i])
        y[k] += (t - a) * (py[i + 1] - py[i])


@compile_kernel
def locate_points(
    sections: CrossSections, index: StripIndex, x: Floats, y: Floats, u: Floats, v: Floats
) -> None:
    """Grid coordinates of (x, y), NaN outside; of several hits the one nearest to the line."""
    nodes = sections.station
    v_right, v_left, edge = index.right, index.left, index.edge
    boxes = index.boxes
    hint = 0
    for k in range(x.size):
        u[k] = np.nan
        v[k] = np.nan
        column = (x[k] - index.bucket_easting) / index.bucket_size
        row = (y[k] - index.bucket_northing) / index.bucket_size
        # written so that NaN fails too
        if not (column >= 0 and row >= 0 and column < index.columns and row < index.rows):
            continue
        bucket = int(row) * index.columns + int(column)
        nearest = np.inf
        for item in range(index.bucket_starts[bucket], index.bucket_starts[bucket + 1]):
            b = index.bucket_items[item]
            if x[k] < boxes[b, 0] or y[k] < boxes[b, 1]:
                continue
            if x[k] > boxes[b, 2] or y[k] > boxes[b, 3]:
                continue
            first = index.block_starts[b]
            end = index.block_starts[b + 1]
            if index.scan_all[b]:
                low = first
            else:
                low = _strip_in_block(sections, first, end, hint, x[k], y[k])
                end = low + 1
            for i in range(low, end):
                ahead, across = _in_strip(sections, i, edge, x[k], y[k])
                if not (ahead >= 0 and across >= v_right - edge and across <= v_left + edge):
                    continue
                across = min(max(across, v_right), v_left)
                if abs(across) < nearest:
                    nearest = abs(across)
                    u[k] = (1 - ahead) * nodes[i] + ahead * nodes[i + 1]
                    v[k] = across
                    hint = i


@compile_kernel
def _section_side(sections: CrossSections, i: int, x: float, y: float) -> float:
    """Positive if the point lies ahead of the cross-section through node i."""
    _, px, py, nx, ny = sections
    return float((x - px[i]) * ny[i] - (y - py[i]) * nx[i])


@compile_kernel
def _strip_in_block(
    sections: CrossSections, first: int, end: int, hint: int, x: float, y: float
) -> int:
    """Last strip of a block whose beginning is not ahead of the point.

    The hint saves the search but never changes its result.
    """
    if (
        first <= hint < end
        and (hint == first or _section_side(sections, hint, x, y) >= 0)
        and (hint == end - 1 or _section_side(sections, hint + 1, x, y) < 0)
    ):
        return hint
    low = first
    high = end - 1
    while low < high:
        middle = (low + high + 1) // 2
        if _section_side(sections, middle, x, y) >= 0:
            low = middle
        else:
            high = middle - 1
    return low


@compile_kernel
def _in_strip(
    sections: CrossSections, i: int, edge: float, x: float, y: float
) -> tuple[float, float]:
    """Fraction along and offset across strip i; fraction -1 if the point is not between its ends.

    Both normals of a strip reach equally far from its chord, so lines of equal offset are parallel
    to the chord and the offset is the distance from it.
    """
    _, px, py, nx, ny = sections
    dx = px[i + 1] - px[i]
    dy = py[i + 1] - py[i]
    length = np.sqrt(dx * dx + dy * dy)
    dx /= length
    dy /= length
    across = (y - py[i]) * dx - (x - px[i]) * dy
    begin = across * (nx[i] * dx + ny[i] * dy)
    finish = length + across * (nx[i + 1] * dx + ny[i + 1] * dy)
    along = (x - px[i]) * dx + (y - py[i]) * dy
    if finish <= begin or along < begin - edge or along > finish + edge:
        return -1.0, across
    return min(max((along - begin) / (finish - begin), 0.0), 1.0), across


@compile_kernel
def interpolate_bilinear(
    u_nodes: Floats,
    v_nodes: Floats,
    height: Floats,
    snap: float,
    u: Floats,
    v: Floats,
    z: Floats,
) -> None:
    """Heights at (u, v); NaN outside, and where a node that carries weight is NaN."""
    last_u = u_nodes.size - 2
    last_v = v_nodes.size - 2
    i = 0
    j = 0
    for k in range(u.size):
        z[k] = np.nan
        if not (u[k] >= u_nodes[0] - snap and u[k] <= u_nodes[last_u + 1] + snap):
            continue
        if not (v[k] >= v_nodes[0] - snap and v[k] <= v_nodes[last_v + 1] + snap):
            continue
        i = _find_interval(u_nodes, u[k], i, last_u)
        j = _find_interval(v_nodes, v[k], j, last_v)
        a = _upper_weight(u_nodes[i], u_nodes[i + 1], u[k], snap)
        b = _upper_weight(v_nodes[j], v_nodes[j + 1], v[k], snap)
        total = 0.0
        if a < 1 and b < 1:
            total += (1 - a) * (1 - b) * height[i, j]
        if a > 0 and b < 1:
            total += a * (1 - b) * height[i + 1, j]
        if a < 1 and b > 0:
            total += (1 - a) * b * height[i, j + 1]
        if a > 0 and b > 0:
            total += a * b * height[i + 1, j + 1]
        z[k] = total


@compile_kernel
def _find_interval(nodes: Floats, at: float, hint: int, last: int) -> int:
    """Interval [nodes[i], nodes[i + 1]) that holds `at`, the end intervals beyond the ends."""
    if nodes[hint] <= at < nodes[hint + 1]:
        return hint
    if hint < last and nodes[hint + 1] <= at < nodes[hint + 2]:
        return hint + 1
    low = 0
    high = last
    while low < high:
        middle = (low + high + 1) // 2
        if nodes[middle] <= at:
            low = middle
        else:
            high = middle - 1
    return low


@compile_kernel
def _upper_weight(low: float, high: float, at: float, snap: float) -> float:
    """Weight of the upper node: exactly 0 or 1 within `snap` of a node."""
    if at - low <= snap:
        return 0.0
    if high - at <= snap:
        return 1.0
    return (at - low) / (high - low)
