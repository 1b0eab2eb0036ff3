"""Specific force along axes fixed in a moving body: loops only, no checks."""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _find_interval(knots, time, guess):
    """Index of the knot interval that contains a time, searched from a guess."""
    last = knots.size - 2
    k = min(max(guess, 0), last)
    while k > 0 and knots[k] > time:
        k -= 1
    while k < last and knots[k + 1] <= time:
        k += 1
    return k


@compile_kernel
def _evaluate_quintic(x, step, per_step, k, c, pose, rate, acceleration):
    """Value, first and second derivative of component c in interval k, at the fraction x of it.

    The quintic Hermite polynomial through value, rate and acceleration at both knots.
    """
    p0, p1 = pose[k, c], pose[k + 1, c]
    v0, v1 = rate[k, c] * step, rate[k + 1, c] * step
    a0, a1 = acceleration[k, c] * step * step, acceleration[k + 1, c] * step * step
    d = p1 - p0 - v0 - 0.5 * a0
    e = v1 - v0 - a0
    f = a1 - a0
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    value = p0 + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
    first = (v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) * per_step
    second = (a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) * (per_step * per_step)
    return value, first, second


@compile_kernel(parallel=True)
def specific_force(times, knots, pose, rate, acceleration, positions, axes, gravity):
    """Specific force of each sensor at each time, shape (n, sensors) [m/s^2].

    Parameters
    ----------
    times : (n,) true times [s]
    knots : (m,) times of the knots [s]
    pose, rate, acceleration : (m, 6) pose at the knots and its derivatives [m], [rad], [s]
    positions : (sensors, 3) positions in the body [m]
    axes : (sensors, 3) unit vectors of the sensitive axes in the body
    gravity : gravity, straight down [m/s^2]
    """
    n, sensors = times.size, positions.shape[0]
    force = np.empty((n, sensors))
    per_second = (knots.size - 1) / (knots[-1] - knots[0])
    for i in prange(n):
        time = times[i]
        k = _find_interval(knots, time, int((time - knots[0]) * per_second))
        step = knots[k + 1] - knots[k]
        per_step = 1.0 / step
        x = (time - knots[k]) * per_step
        _, _, east = _evaluate_quintic(x, step, per_step, k, 0, pose, rate, acceleration)
        _, _, north = _evaluate_quintic(x, step, per_step, k, 1, pose, rate, acceleration)
        _, _, up = _evaluate_quintic(x, step, per_step, k, 2, pose, rate, acceleration)
        roll, p, dp = _evaluate_quintic(x, step, per_step, k, 3, pose, rate, acceleration)
        pitch, q, dq = _evaluate_quintic(x, step, per_step, k, 4, pose, rate, acceleration)
        yaw, r, dr = _evaluate_quintic(x, step, per_step, k, 5, pose, rate, acceleration)
        sr, cr = math.sin(roll), math.cos(roll)
        sp, cp = math.sin(pitch), math.cos(pitch)
        sy, cy = math.sin(yaw), math.cos(yaw)
        # R_gb^T (p'' - g): first by yaw, then by pitch, then by roll
        up += gravity
        forward, left = cy * east + sy * north, cy * north - sy * east
        upright = sp * forward + cp * up
        fx, fy, fz = cp * forward - sp * up, cr * left + sr * upright, cr * upright - sr * left
        # angular velocity and acceleration in body axes, from the rates of the Euler angles
        wx, wy, wz = p - r * sp, q * cr + r * cp * sr, r * cp * cr - q * sr
        ax = dp - dr * sp - r * cp * q
        ay = dq * cr - q * sr * p + dr * cp * sr + r * (cp * cr * p - sp * sr * q)
        az = -dq * sr - q * cr * p + dr * cp * cr - r * (cp * sr * p + sp * cr * q)
        for s in range(sensors):
            rx, ry, rz = positions[s, 0], positions[s, 1], positions[s, 2]
            vx, vy, vz = wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx
            # axis . (f + w' x r + w x (w x r)), with v = w x r
            force[i, s] = (
                axes[s, 0] * (fx + ay * rz - az * ry + wy * vz - wz * vy)
                + axes[s, 1] * (fy + az * rx - ax * rz + wz * vx - wx * vz)
                + axes[s, 2] * (fz + ax * ry - ay * rx + wx * vy - wy * vx)
            )
    return force
