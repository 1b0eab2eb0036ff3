"""Loops over scans and their beams; the callers make all checks.

A *piece* is a sequence of consecutive beams of a scan, short enough for the motion to be a
quadratic of time. Its expansion holds nine coefficients for each ground axis: those of 1, x, x² (x
is the time after the midpoint of the piece) of the position of the scanner, of its left and of its
upward axis.
Quaternions of trajectories are stored scalar last, those within these loops scalar first.
"""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _rotation_vector(w, x, y, z):
    """Rotation vector [rad] of a unit quaternion."""
    # of q and -q, which are the same rotation, the one with the smaller angle
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
    """Quaternion (w, x, y, z) of a rotation vector [rad]."""
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
    """Hamilton product of two quaternions (w, x, y, z)."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@compile_kernel
def _cross_product(ax, ay, az, bx, by, bz):
    """Cross product of two vectors."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@compile_kernel
def _rotate_vector(q, x, y, z):
    """Vector rotated by a unit quaternion: v + 2 w (u x v) + 2 u x (u x v)."""
    w, a, b, c = q
    tx, ty, tz = _cross_product(a, b, c, x, y, z)
    tx, ty, tz = 2.0 * tx, 2.0 * ty, 2.0 * tz
    ux, uy, uz = _cross_product(a, b, c, tx, ty, tz)
    return x + w * tx + ux, y + w * ty + uy, z + w * tz + uz


@compile_kernel
def rotation_steps(quaternion, angular_velocity, vector, rate):
    """Rotation vector from each knot to the next, and its derivative at the next.

    Parameters
    ----------
    quaternion : (knots, 4)
        Body to ground, scalar last.
    angular_velocity : (knots, 3) [rad/s]
        In body axes.
    vector, rate : (knots - 1, 3) [rad], [rad/s]
        Output.
    """
    for k in range(vector.shape[0]):
        a, b = quaternion[k], quaternion[k + 1]
        x, y, z = _rotation_vector(
            *_multiply_quaternions((a[3], -a[0], -a[1], -a[2]), (b[3], b[0], b[1], b[2]))
        )
        # rate = w + v x w / 2 + c v x (v x w) with the rotation vector v (Bortz 1971)
        wx, wy, wz = angular_velocity[k + 1]
        t2 = x * x + y * y + z * z
        if t2 > 1e-8:
            half = 0.5 * math.sqrt(t2)
            c = (1.0 - half / math.tan(half)) / t2
        else:
            c = 1.0 / 12.0 + t2 / 720.0
        ux, uy, uz = _cross_product(x, y, z, wx, wy, wz)
        vx, vy, vz = _cross_product(x, y, z, ux, uy, uz)
        vector[k, 0], vector[k, 1], vector[k, 2] = x, y, z
        rate[k, 0] = wx + 0.5 * ux + c * vx
        rate[k, 1] = wy + 0.5 * uy + c * vy
        rate[k, 2] = wz + 0.5 * uz + c * vz


@compile_kernel
def _find_interval(knots, at, hint):
    """Index k of the interval [knots[k], knots[k + 1]) of a time; `hint` saves the search."""
    last = knots.size - 2
    if knots[hint] <= at and (hint == last or at < knots[hint + 1]):
        return hint
    low, high = 0, last
    while low < high:
        mid = (low + high + 1) // 2
        if knots[mid] <= at:
            low = mid
        else:
            high = mid - 1
    return low


@compile_kernel
def _interpolate_hermite(x, p0, p1, a, b):
    """Cubic at x in [0, 1] through p0 and p1 with the derivatives a and b at the ends."""
    d = p1 - p0
    return p0 + x * (a + x * (3.0 * d - 2.0 * a - b + x * (a + b - 2.0 * d)))


@compile_kernel
def _interpolate_pose(
    at, k, knots, position, velocity, quaternion, angular_velocity, vector, rate, where
):
    """Pose at one time in the interval k: position into `where` (3,), quaternion returned."""
    step = knots[k + 1] - knots[k]
    x = (at - knots[k]) / step
    for c in range(3):
        where[c] = _interpolate_hermite(
            x, position[k, c], position[k + 1, c], step * velocity[k, c], step * velocity[k + 1, c]
        )
    w = angular_velocity[k]
    begin = (quaternion[k, 3], quaternion[k, 0], quaternion[k, 1], quaternion[k, 2])
    by = _rotation_quaternion(
        _interpolate_hermite(x, 0.0, vector[k, 0], step * w[0], step * rate[k, 0]),
        _interpolate_hermite(x, 0.0, vector[k, 1], step * w[1], step * rate[k, 1]),
        _interpolate_hermite(x, 0.0, vector[k, 2], step * w[2], step * rate[k, 2]),
    )
    return _multiply_quaternions(begin, by)


@compile_kernel
def _quadratic_rotation(q, v, a, b, out, row):
    """Coefficients of q exp(a x + b x²) v up to x², into out[:, row : row + 3]."""
    ax, ay, az = _cross_product(a[0], a[1], a[2], v[0], v[1], v[2])
    cx, cy, cz = _cross_product(a[0], a[1], a[2], ax, ay, az)
    bx, by, bz = _cross_product(b[0], b[1], b[2], v[0], v[1], v[2])
    # exp(w) v = v + w x v + w x (w x v) / 2 with w = a x + b x²
    first = _rotate_vector(q, v[0], v[1], v[2])
    second = _rotate_vector(q, ax, ay, az)
    third = _rotate_vector(q, bx + 0.5 * cx, by + 0.5 * cy, bz + 0.5 * cz)
    for c in range(3):
        out[c, row] = first[c]
        out[c, row + 1] = second[c]
        out[c, row + 2] = third[c]


@compile_kernel
def expand_poses(
    time, half, knots, position, velocity, quaternion, angular_velocity, vector, rate, covariance,
    knot_flag, lever, left, upward, out, body, variance, flag,
):  # fmt: skip
    """Expansions around the midpoint of each piece, through the poses at begin, midpoint and end.

    Parameters
    ----------
    time : (n,) [s]
        True time of the midpoint of each piece, scan by scan.
    half : (pieces of a scan,) [s]
        Half of the duration of each piece.
    knots : (knots,) [s]; position, velocity, angular_velocity : (knots, 3); quaternion : (knots, 4)
        Trajectory of the body.
    vector, rate : (knots - 1, 3)
        From `rotation_steps`.
    covariance : (knots, 6, 6); knot_flag : (knots,)
        Covariance and flags of the trajectory.
    lever, left, upward : (3,)
        Lever arm [m] and axes of the scanner in the body.
    out : (n, 3, 9)
        Output: coefficients.
    body : (n, 3) [m]
        Output: position of the body at the midpoint.
    variance : (n, 7)
        Output: covariances of up and of rotations about east and north, as uu, ue, un, ee, en, nn;
        then the mean variance of east and north.
    flag : (n,)
        Output: flags of all knots around the piece, combined.
    """
    early, here, late = np.empty(3), np.empty(3), np.empty(3)
    a, b = np.empty(3), np.empty(3)
    pairs = ((2, 2), (2, 3), (2, 4), (3, 3), (3, 4), (4, 4))
    k = 0
    for n in range(time.size):
        h = half[n % half.size]
        k = _find_interval(knots, time[n] - h, k)
        motion = (knots, position, velocity, quaternion, angular_velocity, vector, rate)
        qe = _interpolate_pose(time[n] - h, k, *motion, early)
        mid = _find_interval(knots, time[n], k)
        q = _interpolate_pose(time[n], mid, *motion, here)
        end = _find_interval(knots, time[n] + h, mid)
        ql = _interpolate_pose(time[n] + h, end, *motion, late)
        # rotations to begin and end relative to the midpoint; the quadratic a x + b x² through both
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
        x = (time[n] - knots[mid]) / (knots[mid + 1] - knots[mid])
        for m in range(6):
            i, j = pairs[m]
            variance[n, m] = (1.0 - x) * covariance[mid, i, j] + x * covariance[mid + 1, i, j]
        variance[n, 6] = 0.0
        for i in range(2):
            variance[n, 6] += 0.5 * (
                (1.0 - x) * covariance[mid, i, i] + x * covariance[mid + 1, i, i]
            )
        flag[n] = knot_flag[k]
        for m in range(k, end + 2):
            flag[n] |= knot_flag[m]


@compile_kernel
def georeference_returns(
    expansion, body, variance, first, beam, ranges, weight, range_variance, points, sd
):
    """Positions and standard deviations of heights of all returns; NaN where the weight is 0.

    Parameters
    ----------
    expansion, body, variance : (scans * pieces, 3, 9), (scans * pieces, 3), (scans * pieces, 7)
        From `expand_poses`.
    first : (pieces + 1,)
        First beam of each piece, and the number of beams.
    beam : (9, beams)
        Powers 0 to 2 of the time after the midpoint of the piece, these times the sine of the beam
        angle, and these times minus its cosine.
    ranges, weight : (scans, beams) [m], [1]
        Ranges and weights.
    range_variance : float [m²]
        Variance of a range.
    points : (scans, beams, 3) [m]
        Output: east, north, up.
    sd : (scans, beams) [m]
        Output: standard deviation of up.
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
                direction = 0.0  # component of the beam; after the loop the vertical one
                for axis in range(3):
                    direction = (
                        e[axis, 3] * beam[3, b]
                        + e[axis, 4] * beam[4, b]
                        + e[axis, 5] * beam[5, b]
                        + e[axis, 6] * beam[6, b]
                        + e[axis, 7] * beam[7, b]
                        + e[axis, 8] * beam[8, b]
                    )
                    where = e[axis, 0] + e[axis, 1] * beam[1, b] + e[axis, 2] * beam[2, b]
                    points[n, b, axis] = where + r * direction
                # up + rotation about east * north arm - rotation about north * east arm
                x, y = points[n, b, 1] - at[1], at[0] - points[n, b, 0]
                total = c[0] + 2.0 * (c[1] * x + c[2] * y)
                total += c[3] * x * x + 2.0 * c[4] * x * y + c[5] * y * y
                total += range_variance * direction * direction
                sd[n, b] = math.sqrt(max(total, 0.0) / weight[n, b])
