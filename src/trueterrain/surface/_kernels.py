"""Loops over nodes without height, coarser grids, and poses of scans; callers check arguments."""

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


@compile_kernel
def solve_holes(
    height: Floats,
    runs: npt.NDArray[np.int32],
    starts: Integers,
    weights: Floats,
    max_cost: float,
    filled: npt.NDArray[np.bool_],
) -> npt.NDArray[np.bool_]:
    """Heights of holes by the discrete Laplace equation, hole by hole.

    The five-point stencil, sum of (neighbour - node) / step² = 0, is symmetric and positive
    definite between known heights. With nodes row by row it has a narrow band, so that Cholesky's
    decomposition of a small hole takes microseconds.

    height : input and output, shape (row, column) [m]
    runs : row, first and one past the last column of the runs of each hole, shape (run, 3)
    starts : first run of each hole and the end, shape (hole + 1,)
    weights : 1 / step² along rows and columns, shape (2,) [1/m²]
    max_cost : largest number of operations for a hole
    filled : output, marks of the nodes that were filled, shape (row, column)
    returns which holes are left since they cost more, shape (hole,)
    """
    left = np.zeros(starts.size - 1, np.bool_)
    by_row, by_column = weights
    for h in range(left.size):
        own = runs[starts[h] : starts[h + 1]]
        first, begin = own[0, 0], own[:, 1].min()
        width = own[:, 2].max() - begin
        index = np.full((own[-1, 0] - first + 1, width), -1)
        count, band = 0, 1
        for k in range(own.shape[0]):
            i = own[k, 0] - first
            for j in range(own[k, 1] - begin, own[k, 2] - begin):
                index[i, j] = count
                if i > 0 and index[i - 1, j] >= 0:
                    band = max(band, count - index[i - 1, j])
                count += 1
        if float(count) * band * band > max_cost:
            left[h] = True
            continue
        # column d of a row is the entry d to the left of the diagonal
        matrix = np.zeros((count, band + 1))
        value = np.zeros(count)
        for k in range(own.shape[0]):
            row, i = own[k, 0], own[k, 0] - first
            for column in range(own[k, 1], own[k, 2]):
                j = column - begin
                n = index[i, j]
                matrix[n, 0] = 2 * (by_row + by_column)
                if i > 0 and index[i - 1, j] >= 0:
                    matrix[n, n - index[i - 1, j]] -= by_row
                else:
                    value[n] += by_row * height[row - 1, column]
                if i + 1 == index.shape[0] or index[i + 1, j] < 0:
                    value[n] += by_row * height[row + 1, column]
                if j > 0 and index[i, j - 1] >= 0:
                    matrix[n, 1] -= by_column
                else:
                    value[n] += by_column * height[row, column - 1]
                if j + 1 == width or index[i, j + 1] < 0:
                    value[n] += by_column * height[row, column + 1]
        _solve_banded(matrix, value)
        for k in range(own.shape[0]):
            for column in range(own[k, 1], own[k, 2]):
                height[own[k, 0], column] = value[index[own[k, 0] - first, column - begin]]
                filled[own[k, 0], column] = True
    return left


@compile_kernel
def _solve_banded(matrix: Floats, value: Floats) -> None:
    """Solve a symmetric positive definite banded system in place, by Cholesky's decomposition.

    matrix : entries to the left of the diagonal, shape (row, band + 1); becomes the factor
    value : right side, becomes the solution, shape (row,)
    """
    count, band = matrix.shape[0], matrix.shape[1] - 1
    for n in range(count):
        for d in range(min(band, n), -1, -1):
            m = n - d
            total = matrix[n, d]
            for e in range(1, min(band - d, m) + 1):
                total -= matrix[n, d + e] * matrix[m, e]
            matrix[n, d] = np.sqrt(total) if d == 0 else total / matrix[m, 0]
    for n in range(count):
        for d in range(1, min(band, n) + 1):
            value[n] -= matrix[n, d] * value[n - d]
        value[n] /= matrix[n, 0]
    for n in range(count - 1, -1, -1):
        value[n] /= matrix[n, 0]
        for d in range(1, min(band, n) + 1):
            value[n - d] -= matrix[n, d] * value[n]


@compile_kernel
def gather_nodes(
    values: Floats,
    known: npt.NDArray[np.bool_],
    rows: Integers,
    row_reach: Integers,
    step: int,
    total: Floats,
    weight: Floats,
) -> None:
    """Weighted sums of the nodes around every n-th node.

    A node midway between two coarse nodes counts by half to both. A coarse node at the edge of the
    grid takes its own row or column alone: a mean over one side would be biased on a slope.

    values, known : fine nodes and which of them count, shape (row, column)
    rows : fine row of each coarse row, shape (coarse row,)
    row_reach : fine rows to either side that it takes, negative if the last have half the weight,
        shape (coarse row,)
    step : fine columns from one coarse column to the next
    total : output, sums of the values, shape (coarse row, coarse column)
    weight : output, sums of the weights, of the same shape
    """
    last = values.shape[1] - 1
    half = step // 2
    for i in range(total.shape[0]):
        reach = abs(row_reach[i])
        for j in range(total.shape[1]):
            column = j * step
            across = 0 if column < half or column + half > last else half
            found, sum_of_weights = 0.0, 0.0
            for a in range(-reach, reach + 1):
                row_weight = 0.5 if row_reach[i] < 0 and abs(a) == reach else 1.0
                for b in range(-across, across + 1):
                    if not known[rows[i] + a, column + b]:
                        continue
                    w = row_weight
                    if step % 2 == 0 and across > 0 and abs(b) == across:
                        w *= 0.5
                    found += w * values[rows[i] + a, column + b]
                    sum_of_weights += w
            total[i, j] = found
            weight[i, j] = sum_of_weights


@compile_kernel
def coarsening_moments(
    height: Floats,
    place: Integers,
    fraction: Floats,
    columns: Integers,
    column_fraction: Floats,
    coarse: Floats,
    u: Floats,
    v: Floats,
    datum: float,
    sums: Floats,
) -> None:
    """Sums over the errors of a coarse surface, and over the heights about a plane.

    The coarse surface is bilinear between its nodes; a corner without weight does not count.

    height : fine heights, shape (row, column) [m]
    place, columns : coarse row or column before each fine one, shapes (row,) and (column,)
    fraction, column_fraction : distance from it [coarse steps]
    coarse : coarse heights, shape (coarse row, coarse column) [m]
    u, v : coordinates of the fine nodes, shapes (row,) and (column,) [m]
    datum : height from which heights are counted [m]
    sums : input and output, shape (12,): number of nodes; sums of u, v, h, u², uv, v², uh, vh, h²;
        sum of the squared errors; largest error
    """
    for i in range(height.shape[0]):
        k, s = place[i], fraction[i]
        for j in range(height.shape[1]):
            m, t = columns[j], column_fraction[j]
            between = (1 - s) * (1 - t) * coarse[k, m]
            if t > 0:
                between += (1 - s) * t * coarse[k, m + 1]
            if s > 0:
                between += s * (1 - t) * coarse[k + 1, m]
            if s > 0 and t > 0:
                between += s * t * coarse[k + 1, m + 1]
            error = between - height[i, j]
            if not np.isfinite(error):
                continue
            h = height[i, j] - datum
            sums[0] += 1.0
            sums[1] += u[i]
            sums[2] += v[j]
            sums[3] += h
            sums[4] += u[i] * u[i]
            sums[5] += u[i] * v[j]
            sums[6] += v[j] * v[j]
            sums[7] += u[i] * h
            sums[8] += v[j] * h
            sums[9] += h * h
            sums[10] += error * error
            sums[11] = max(sums[11], abs(error))
