"""Loops of the quarter car and of the moving averages; arguments are checked by the callers.

Arguments that several kernels take:

- ``station`` (n,) [m] ascends, ``height`` [m] belongs to it;
- ``car`` is (K1/mu, K2/mu, C/mu, K2, C, rate): the elements of A [1/s², 1/s] and a bound of its
  norm [1/s], see `QuarterCar.matrices`;
- ``state`` (4,) is the initial state [m/m, 1/s], ``S`` (4, 4) and ``p`` (4,) are the transition
  matrix and partial response of one step, see `QuarterCar.transition`;
- ``base`` is the number of samples that a slope spans, ``scale`` [1/m] the inverse of their length.
"""

import math

from trueterrain.core.kernels import compile_kernel

# A Taylor series of exp(A t) is summed while the bound of its next term exceeds this [1]: below it,
# terms are lost in the rounding of the sum
_NEGLIGIBLE = 1e-17

# Largest part of a step, as rate times time [1]: beyond it, the terms of the series grow so far
# that digits are lost when they cancel
_MAX_PART = 2.0


@compile_kernel
def _exact_step(x0, x1, x2, x3, slope, duration, car):
    """State after `duration` [s] of constant slope [m/m]: Taylor series of exp(A t) times x.

    At unequal spacing each step has a transition of its own, and the series costs less than the
    matrix exponential: at constant input u, x(t) = x + t x' + t^2/2 A x' + ..., x' = A x + B u.
    """
    tyre, spring, damper, body_spring, body_damper, rate = car
    parts = max(1, math.ceil(rate * duration / _MAX_PART))
    dt = duration / parts
    norm = rate * dt  # of A dt
    for _ in range(parts):
        # first term, dt x'
        t0 = dt * x1
        t1 = dt * (body_spring * (x2 - x0) + body_damper * (x3 - x1))
        t2 = dt * x3
        t3 = dt * (tyre * (slope - x2) - spring * (x2 - x0) - damper * (x3 - x1))
        x0 += t0
        x1 += t1
        x2 += t2
        x3 += t3
        bound = norm  # of the k-th term: norm^k / k!
        order = 1.0
        while bound > _NEGLIGIBLE:
            order += 1.0
            bound *= norm / order
            h = dt / order
            travel = t2 - t0
            rate_of_travel = t3 - t1
            t0, t1, t2, t3 = (
                h * t1,
                h * (body_spring * travel + body_damper * rate_of_travel),
                h * t3,
                -h * (tyre * t2 + spring * travel + damper * rate_of_travel),
            )
            x0 += t0
            x1 += t1
            x2 += t2
            x3 += t3
    return x0, x1, x2, x3


@compile_kernel
def unequal_response(station, height, speed, car, state, out):
    """Write the output at the end of each step into `out` (n - 1,) [m/m]; `speed` is in m/s."""
    x0, x1, x2, x3 = state[0], state[1], state[2], state[3]
    for i in range(out.size):
        length = station[i + 1] - station[i]
        slope = (height[i + 1] - height[i]) / length
        x0, x1, x2, x3 = _exact_step(x0, x1, x2, x3, slope, length / speed, car)
        out[i] = x2 - x0


@compile_kernel
def equal_response(height, base, scale, S, p, state, out):
    """Write the output at the end of each step into `out` (steps,) [m/m].

    S and p are unpacked into scalars, which the compiler keeps in registers; the pairing of the
    sums fixes their rounding.
    """
    s00, s01, s02, s03 = S[0, 0], S[0, 1], S[0, 2], S[0, 3]
    s10, s11, s12, s13 = S[1, 0], S[1, 1], S[1, 2], S[1, 3]
    s20, s21, s22, s23 = S[2, 0], S[2, 1], S[2, 2], S[2, 3]
    s30, s31, s32, s33 = S[3, 0], S[3, 1], S[3, 2], S[3, 3]
    p0, p1, p2, p3 = p[0], p[1], p[2], p[3]
    x0, x1, x2, x3 = state[0], state[1], state[2], state[3]
    for i in range(out.size):
        slope = (height[i + base] - height[i]) * scale
        x0, x1, x2, x3 = (
            ((s00 * x0 + s01 * x1) + (s02 * x2 + s03 * x3)) + p0 * slope,
            ((s10 * x0 + s11 * x1) + (s12 * x2 + s13 * x3)) + p1 * slope,
            ((s20 * x0 + s21 * x1) + (s22 * x2 + s23 * x3)) + p2 * slope,
            ((s30 * x0 + s31 * x1) + (s32 * x2 + s33 * x3)) + p3 * slope,
        )
        out[i] = x2 - x0


@compile_kernel
def _rectified_output(output, squared):
    return output * output if squared else abs(output)


@compile_kernel
def equal_sums(height, base, scale, S, p, duration, car, state, squared, edges, sums):
    """Sum abs(output), or its square, over all steps, and between edges into `sums` [steps].

    `edges` (k + 1,) ascend from 0 to the number of steps, `sums` is (k,), `duration` is that of a
    step [s]. An edge within a step divides it: the output at the edge stands for the part before
    it, the output at the end of the step for the part after. The total counts whole steps only, so
    that it does not depend on the edges.
    """
    s00, s01, s02, s03 = S[0, 0], S[0, 1], S[0, 2], S[0, 3]
    s10, s11, s12, s13 = S[1, 0], S[1, 1], S[1, 2], S[1, 3]
    s20, s21, s22, s23 = S[2, 0], S[2, 1], S[2, 2], S[2, 3]
    s30, s31, s32, s33 = S[3, 0], S[3, 1], S[3, 2], S[3, 3]
    p0, p1, p2, p3 = p[0], p[1], p[2], p[3]
    x0, x1, x2, x3 = state[0], state[1], state[2], state[3]
    total = 0.0
    for k in range(sums.size):
        begin, end = edges[k], edges[k + 1]
        first, last = math.ceil(begin), math.floor(end)
        part = 0.0
        if begin < first:
            stop = min(float(first), end)
            slope = (height[first - 1 + base] - height[first - 1]) * scale
            x0, x1, x2, x3 = _exact_step(x0, x1, x2, x3, slope, (stop - begin) * duration, car)
            part += _rectified_output(x2 - x0, squared) * (stop - begin)
            if stop == first:
                total += _rectified_output(x2 - x0, squared)
        whole = 0.0
        for i in range(first, last):
            slope = (height[i + base] - height[i]) * scale
            x0, x1, x2, x3 = (
                ((s00 * x0 + s01 * x1) + (s02 * x2 + s03 * x3)) + p0 * slope,
                ((s10 * x0 + s11 * x1) + (s12 * x2 + s13 * x3)) + p1 * slope,
                ((s20 * x0 + s21 * x1) + (s22 * x2 + s23 * x3)) + p2 * slope,
                ((s30 * x0 + s31 * x1) + (s32 * x2 + s33 * x3)) + p3 * slope,
            )
            whole += _rectified_output(x2 - x0, squared)
        total += whole
        part += whole
        if last >= first and end > last:
            slope = (height[last + base] - height[last]) * scale
            x0, x1, x2, x3 = _exact_step(x0, x1, x2, x3, slope, (end - last) * duration, car)
            part += _rectified_output(x2 - x0, squared) * (end - last)
        sums[k] = part
    return total


@compile_kernel
def mean_of_samples(station, height, half, out):
    """Write the mean of the heights within `half` [m] of each station into `out` (n,) [m]."""
    count = station.size
    low = 0
    for i in range(count):
        while station[low] < station[i] - half:
            low += 1
        total = 0.0
        j = low
        while j < count and station[j] <= station[i] + half:
            total += height[j] - height[i]
            j += 1
        out[i] = height[i] + total / (j - low)


@compile_kernel
def _profile_integral(station, height, begin, end, cell, datum):
    """Integral of the straight-line profile less `datum`, and the cell in which it ended."""
    total = 0.0
    here = begin
    while here < end:
        while cell < station.size - 2 and station[cell + 1] <= here:
            cell += 1
        stop = end
        if cell < station.size - 2 and station[cell + 1] < end:
            stop = station[cell + 1]
        slope = (height[cell + 1] - height[cell]) / (station[cell + 1] - station[cell])
        # a straight line: its integral is its height at the midpoint times the length
        midpoint = height[cell] - datum + slope * (0.5 * (here + stop) - station[cell])
        total += midpoint * (stop - here)
        here = stop
    return total, cell


@compile_kernel
def mean_of_lines(station, height, length, first, out):
    """Write the mean of the straight-line profile over `length` [m] around stations first, ...

    `out` (m,) [m] holds the means at stations first to first + m - 1. Each follows from the one
    before by the integrals that enter and leave the window: the slope between two means, the input
    of the car, then carries no rounding error of the others.
    """
    half = 0.5 * length
    datum = height[first]
    inside, _ = _profile_integral(
        station, height, station[first] - half, station[first] + half, 0, datum
    )
    mean = datum + inside / length
    out[0] = mean
    front = rear = 0  # cells at the ends of the window
    for i in range(1, out.size):
        a, b = station[first + i - 1], station[first + i]
        datum = height[first + i]
        entering, front = _profile_integral(station, height, a + half, b + half, front, datum)
        leaving, rear = _profile_integral(station, height, a - half, b - half, rear, datum)
        mean += (entering - leaving) / length
        out[i] = mean


@compile_kernel
def max_deviation(station, step):
    """Largest distance of a station from equal steps [m]."""
    largest = 0.0
    for i in range(station.size):
        largest = max(largest, abs(station[i] - (station[0] + i * step)))
    return largest
