"""Loops over scans and their beams; all checks are made by the callers.

A *piece* is a stretch of consecutive beams of a scan that is so short that the motion during it is
a quadratic. Its expansion holds, for each ground axis, nine coefficients: of 1, x, x² (x the time
after the middle of the piece) of the position of the scanner, of its left and of its upward axis.
"""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _rotation_vector(w, x, y, z):
    """Rotation vector of a unit quaternion."""
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    n2 = x * x + y * y + z * z
    if n2 < 1e-10:
        c = 2.0 + n2 / 3.0
    else:
        n = math.sqrt(n2)
        c = 2.0 * math.atan2(n, w) / n
    return c * x, c * y, c * z


@compile_kernel
def _rotation_quaternion(x, y, z):
    """Quaternion (w, x, y, z) of a rotation vector."""
    t2 = x * x + y * y + z * z
    if t2 < 1e-8:
        s = 0.5 - t2 / 48.0
        w = 1.0 - t2 / 8.0
    else:
        t = math.sqrt(t2)
        s = math.sin(0.5 * t) / t
        w = math.cos(0.5 * t)
    return w, s * x, s * y, s * z


@compile_kernel
def _multiply_quaternions(a, b):
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@compile_kernel
def _cross_product(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@compile_kernel
def _rotate_vector(q, x, y, z):
    """Vector turned by a unit quaternion."""
    w, a, b, c = q
    tx, ty, tz = _cross_product(a, b, c, x, y, z)
    tx, ty, tz = 2.0 * tx, 2.0 * ty, 2.0 * tz
    ux, uy, uz = _cross_product(a, b, c, tx, ty, tz)
    return x + w * tx + ux, y + w * ty + uy, z + w * tz + uz


@compile_kernel
def rotation_steps(quaternion, angular_velocity, turn, rate):
    """Rotation vector from each knot to the next, and its derivative at the next."""
    for k in range(turn.shape[0]):
        a, b = quaternion[k], quaternion[k + 1]
        x, y, z = _rotation_vector(
            *_multiply_quaternions((a[3], -a[0], -a[1], -a[2]), (b[3], b[0], b[1], b[2]))
        )
        wx, wy, wz = angular_velocity[k + 1]
        t2 = x * x + y * y + z * z
        if t2 > 1e-8:
            half = 0.5 * math.sqrt(t2)
            c = (1.0 - half / math.tan(half)) / t2
        else:
            c = 1.0 / 12.0 + t2 / 720.0
        ux, uy, uz = _cross_product(x, y, z, wx, wy, wz)
        vx, vy, vz = _cross_product(x, y, z, ux, uy, uz)
        turn[k, 0], turn[k, 1], turn[k, 2] = x, y, z
        rate[k, 0] = wx + 0.5 * ux + c * vx
        rate[k, 1] = wy + 0.5 * uy + c * vy
        rate[k, 2] = wz + 0.5 * uz + c * vz


@compile_kernel
def _find_interval(knots, at, hint):
    """Interval [knots[k], knots[k + 1]) that holds a time."""
    last = knots.size - 2
    if knots[hint] <= at and (hint == last or at < knots[hint + 1]):
        return hint
    low, high = 0, last
    while low < high:
        middle = (low + high + 1) // 2
        if knots[middle] <= at:
            low = middle
        else:
            high = middle - 1
    return low


@compile_kernel
def _interpolate_hermite(x, p0, p1, a, b):
    d = p1 - p0
    return p0 + x * (a + x * (3.0 * d - 2.0 * a - b + x * (a + b - 2.0 * d)))


@compile_kernel
def _interpolate_pose(
    at, k, knots, position, velocity, quaternion, angular_velocity, turn, rate, where
):
    """Position into `where`, and the attitude, of one time in the interval k."""
    step = knots[k + 1] - knots[k]
    x = (at - knots[k]) / step
    for c in range(3):
        where[c] = _interpolate_hermite(
            x, position[k, c], position[k + 1, c], step * velocity[k, c], step * velocity[k + 1, c]
        )
    w = angular_velocity[k]
    begin = (quaternion[k, 3], quaternion[k, 0], quaternion[k, 1], quaternion[k, 2])
    by = _rotation_quaternion(
        _interpolate_hermite(x, 0.0, turn[k, 0], step * w[0], step * rate[k, 0]),
        _interpolate_hermite(x, 0.0, turn[k, 1], step * w[1], step * rate[k, 1]),
        _interpolate_hermite(x, 0.0, turn[k, 2], step * w[2], step * rate[k, 2]),
    )
    return _multiply_quaternions(begin, by)


@compile_kernel
def _quadratic_rotation(q, v, a, b, out, row):
    """Coefficients of q exp(a x + b x²) v up to x², into out[:, row : row + 3]."""
    ax, ay, az = _cross_product(a[0], a[1], a[2], v[0], v[1], v[2])
    cx, cy, cz = _cross_product(a[0], a[1], a[2], ax, ay, az)
    bx, by, bz = _cross_product(b[0], b[1], b[2], v[0], v[1], v[2])
    first = _rotate_vector(q, v[0], v[1], v[2])
    second = _rotate_vector(q, ax, ay, az)
    third = _rotate_vector(q, bx + 0.5 * cx, by + 0.5 * cy, bz + 0.5 * cz)
    for c in range(3):
        out[c, row] = first[c]
        out[c, row + 1] = second[c]
        out[c, row + 2] = third[c]


@compile_kernel
def expand_poses(
    time, half, knots, position, velocity, quaternion, angular_velocity, turn, rate, covariance,
    knot_flag, lever, left, upward, out, body, variance, flag,
):  # fmt: skip
    """Expansions around the middle of each piece, through the poses at begin, middle and end.

    `variance` holds those of up, and of turns about east and north, as uu, ue, un, ee, en, nn, and
    the mean of those of east and north.
    """
    early, here, late = np.empty(3), np.empty(3), np.empty(3)
    a, b = np.empty(3), np.empty(3)
    pairs = ((2, 2), (2, 3), (2, 4), (3, 3), (3, 4), (4, 4))
    k = 0
    for n in range(time.size):
        h = half[n % half.size]
        k = _find_interval(knots, time[n] - h, k)
        motion = (knots, position, velocity, quaternion, angular_velocity, turn, rate)
        qe = _interpolate_pose(time[n] - h, k, *motion, early)
        middle = _find_interval(knots, time[n], k)
        q = _interpolate_pose(time[n], middle, *motion, here)
        end = _find_interval(knots, time[n] + h, middle)
        ql = _interpolate_pose(time[n] + h, end, *motion, late)
        back = (q[0], -q[1], -q[2], -q[3])
        to_early, to_late = (
            _rotation_vector(*_multiply_quaternions(back, qe)),
            _rotation_vector(*_multiply_quaternions(back, ql)),
        )
        for c in range(3):
            body[n, c] = here[c]
            a[c] = (to_late[c] - to_early[c]) / (2.0 * h)
            b[c] = (to_late[c] + to_early[c]) / (2.0 * h * h)
        _quadratic_rotation(q, lever, a, b, out[n], 0)
        _quadratic_rotation(q, left, a, b, out[n], 3)
        _quadratic_rotation(q, upward, a, b, out[n], 6)
        for c in range(3):
            out[n, c, 0] += here[c]
            out[n, c, 1] += (late[c] - early[c]) / (2.0 * h)
            out[n, c, 2] += (late[c] - 2.0 * here[c] + early[c]) / (2.0 * h * h)
        x = (time[n] - knots[middle]) / (knots[middle + 1] - knots[middle])
        for m in range(6):
            i, j = pairs[m]
            variance[n, m] = (1.0 - x) * covariance[middle, i, j] + x * covariance[middle + 1, i, j]
        variance[n, 6] = 0.0
        for i in range(2):
            variance[n, 6] += 0.5 * (
                (1.0 - x) * covariance[middle, i, i] + x * covariance[middle + 1, i, i]
            )
        flag[n] = knot_flag[k]
        for m in range(k, end + 2):
            flag[n] |= knot_flag[m]


@compile_kernel
def georeference_returns(
    expansion, body, variance, first, beam, ranges, weight, range_variance, points, sd
):
    """East, north, up and standard deviation of all returns; NaN where the weight is 0.

    `beam` holds, per beam, the powers 0 to 2 of its time after the middle of its piece, those times
    the sine of its angle, and those times minus the cosine.
    """
    pieces = first.size - 1
    for n in range(ranges.shape[0]):
        for p in range(pieces):
            m = n * pieces + p
            e, at, c = expansion[m], body[m], variance[m]
            for b in range(first[p], first[p + 1]):
                if weight[n, b] == 0.0:
                    points[n, b, :] = np.nan
                    sd[n, b] = np.nan
                    continue
                r = ranges[n, b]
                ahead = 0.0
                for axis in range(3):
                    ahead = (
                        e[axis, 3] * beam[3, b]
                        + e[axis, 4] * beam[4, b]
                        + e[axis, 5] * beam[5, b]
                        + e[axis, 6] * beam[6, b]
                        + e[axis, 7] * beam[7, b]
                        + e[axis, 8] * beam[8, b]
                    )
                    where = e[axis, 0] + e[axis, 1] * beam[1, b] + e[axis, 2] * beam[2, b]
                    points[n, b, axis] = where + r * ahead
                x, y = points[n, b, 1] - at[1], at[0] - points[n, b, 0]
                total = c[0] + 2.0 * (c[1] * x + c[2] * y)
                total += c[3] * x * x + 2.0 * c[4] * x * y + c[5] * y * y
                total += range_variance * ahead * ahead
                sd[n, b] = math.sqrt(max(total, 0.0) / weight[n, b])
