"""Loops over the pose variance of rows; callers check the arguments."""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


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
