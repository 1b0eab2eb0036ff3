"""Loops over nodes without height and over the poses of scans; callers check the arguments."""

import math

import numpy as np
import numpy.typing as npt

from trueterrain.core.kernels import compile_kernel

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@compile_kernel
def missing_runs(cells: Floats) -> npt.NDArray[np.int32]:
    """Runs of consecutive cells without a finite value.

    cells : shape (row, column)
    returns row, first and one past the last column of each run, shape (run, 3)
    """
    # the first sweep counts the runs, the second stores them
    runs = np.empty((0, 3), np.int32)
    for sweep in range(2):
        found = 0
        for i in range(cells.shape[0]):
            inside = False
            for j in range(cells.shape[1]):
                missing = not np.isfinite(cells[i, j])
                if missing and not inside:
                    if sweep == 1:
                        runs[found, 0] = i
                        runs[found, 1] = j
                    found += 1
                if sweep == 1 and missing:
                    runs[found - 1, 2] = j + 1
                inside = missing
        if sweep == 0:
            runs = np.empty((found, 3), np.int32)
    return runs


@compile_kernel
def connect_runs(runs: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int32], int]:
    """Connected sets of runs, by union-find.

    runs : shape (run, 3), row by row
    returns the number of the set of each run, shape (run,), in the order of first runs, and the
    number of sets
    """
    number = np.arange(runs.shape[0]).astype(np.int32)
    above = 0
    for k in range(runs.shape[0]):
        while runs[above, 0] < runs[k, 0] - 1 or (
            runs[above, 0] == runs[k, 0] - 1 and runs[above, 2] <= runs[k, 1]
        ):
            above += 1
        neighbour = above
        while runs[neighbour, 0] == runs[k, 0] - 1 and runs[neighbour, 1] < runs[k, 2]:
            a, b = _find_root(number, neighbour), _find_root(number, k)
            number[max(a, b)] = min(a, b)
            neighbour += 1
    count = 0
    for k in range(runs.shape[0]):
        # the root of a set is its first run, so it has its number when the others come
        if number[k] == k:
            number[k] = count
            count += 1
        else:
            number[k] = number[number[k]]
    return number, count


@compile_kernel
def _find_root(number: npt.NDArray[np.int32], k: int) -> int:
    """First run of the set of run k, with path compression."""
    while number[k] != k:
        number[k] = number[number[k]]
        k = number[k]
    return k


@compile_kernel
def measure_holes(
    runs: npt.NDArray[np.int32],
    hole: npt.NDArray[np.int32],
    low: Integers,
    high: Integers,
    nodes: Integers,
) -> None:
    """Extent and size of each hole.

    runs : shape (run, 3)
    hole : hole of each run, shape (run,)
    low, high : output, first and one past the last cell along both axes, shape (hole, 2)
    nodes : output, number of cells, shape (hole,)
    """
    for k in range(runs.shape[0]):
        h = hole[k]
        nodes[h] += runs[k, 2] - runs[k, 1]
        low[h, 0] = min(low[h, 0], runs[k, 0])
        high[h, 0] = max(high[h, 0], runs[k, 0] + 1)
        low[h, 1] = min(low[h, 1], runs[k, 1])
        high[h, 1] = max(high[h, 1], runs[k, 2])


@compile_kernel
def accumulate_poses(body, variance, pieces, px, py, nx, ny, hint, unit, sums):
    """Add the pose variance at the centre of each scan to the sums of its row.

    body : position of the body, shape (scan * pieces, 3) [m]
    variance : of height, roll and pitch, their covariances, and horizontal, shape (..., 7)
    pieces : pieces of a scan
    px, py, nx, ny : nodes of the line and cross directions, shape (node,) [m, 1]
    hint : strip of the line near each scan, shape (scan,)
    unit : step of the variances [m²]
    sums : output, a, b, c, horizontal variance, scans, shape (row, 5)
    """
    last = sums.shape[0] - 1
    for n in range(hint.size):
        i = hint[n]
        centre = n * pieces + pieces // 2
        _add_pose(
            body[centre],
            variance[centre],
            px[i],
            py[i],
            nx[i],
            ny[i],
            unit,
            sums[min(max(i - 1, 0), last)],
        )


@compile_kernel
def _add_pose(at, c, px, py, nx, ny, unit, row):
    """Add the variance of a height at offset v, a + b v + c v², to the sums of a row."""
    x0, x1 = py - at[1], ny
    y0, y1 = at[0] - px, -nx
    a = c[0] + 2.0 * (c[1] * x0 + c[2] * y0)
    a += c[3] * x0 * x0 + 2.0 * c[4] * x0 * y0 + c[5] * y0 * y0
    b = 2.0 * (c[1] * x1 + c[2] * y1)
    b += 2.0 * (c[3] * x0 * x1 + c[4] * (x0 * y1 + x1 * y0) + c[5] * y0 * y1)
    d = c[3] * x1 * x1 + 2.0 * c[4] * x1 * y1 + c[5] * y1 * y1
    row[0] += np.int64(math.floor(a / unit + 0.5))
    row[1] += np.int64(math.floor(b / unit + 0.5))
    row[2] += np.int64(math.floor(d / unit + 0.5))
    row[3] += np.int64(math.floor(c[6] / unit + 0.5))
    row[4] += 1


@compile_kernel
def pose_variances(coefficient, v, out):
    """Pose variance a + b v + c v², at least 0, shape (row, v) [m²]."""
    for i in range(out.shape[0]):
        a, b, c = coefficient[0, i], coefficient[1, i], coefficient[2, i]
        for j in range(v.size):
            out[i, j] = max(a + v[j] * (b + v[j] * c), 0.0)


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
