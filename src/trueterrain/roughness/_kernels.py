"""Loops of the quarter car and of the moving averages; arguments are checked by the callers.

``car`` is (K1/mu, K2/mu, C/mu, K2, C, rate): the elements of A and a bound of its norm [1/s].
"""

import math

from trueterrain.core.kernels import compile_kernel

# A Taylor series of exp(A t) is summed while the bound of its next term exceeds this [1]: below it,
# terms are lost in the rounding of the sum
_NEGLIGIBLE = 1e-17

# Longest part of a step, as rate times time [1]: beyond it, the terms of the series grow so far
# that digits are lost when they cancel
_LONGEST = 2.0


@compile_kernel
def _exact_step(x0, x1, x2, x3, slope, duration, car):
    """State after a step of constant slope: the Taylor series of the exponential, applied to x."""
    tyre, spring, damper, body_spring, body_damper, rate = car
    parts = max(1, math.ceil(rate * duration / _LONGEST))
    dt = duration / parts
    reach = rate * dt
    for _ in range(parts):
        t0 = dt * x1
        t1 = dt * (body_spring * (x2 - x0) + body_damper * (x3 - x1))
        t2 = dt * x3
        t3 = dt * (tyre * (slope - x2) - spring * (x2 - x0) - damper * (x3 - x1))
        x0 += t0
        x1 += t1
        x2 += t2
        x3 += t3
        bound = reach
        order = 1.0
        while bound > _NEGLIGIBLE:
            order += 1.0
            bound *= reach / order
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
    """Write the output at the end of each step into `out`, shape (len(station) - 1,)."""
    x0, x1, x2, x3 = state[0], state[1], state[2], state[3]
    for i in range(out.size):
        length = station[i + 1] - station[i]
        slope = (height[i + 1] - height[i]) / length
        x0, x1, x2, x3 = _exact_step(x0, x1, x2, x3, slope, length / speed, car)
        out[i] = x2 - x0


@compile_kernel
def equal_response(height, base, scale, S, p, state, out):
    """Write the output at the end of each step into `out`; the slope spans `base` samples."""
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
    """Sum abs(output), or its square, over all steps, and between edges into `sums`; in steps.

    `edges` ascend from 0 to the number of steps. An edge within a step divides it: the output at
    the edge stands for the part before it, the output at the end of the step for the part after.
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
    """Write the mean of the heights within `half` of each station, both ends included."""
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
        middle = height[cell] - datum + slope * (0.5 * (here + stop) - station[cell])
        total += middle * (stop - here)
        here = stop
    return total, cell


@compile_kernel
def mean_of_lines(station, height, length, first, out):
    """Write the mean of the straight-line profile over `length` around stations first, first+1, ...

    Each mean follows from the one before by what enters and leaves the window, so that the slope
    between two of them, which is all that the car feels, carries no rounding of the others.
    """
    half = 0.5 * length
    datum = height[first]
    inside, _ = _profile_integral(
        station, height, station[first] - half, station[first] + half, 0, datum
    )
    mean = datum + inside / length
    out[0] = mean
    ahead = 0
    behind = 0
    for i in range(1, out.size):
        a, b = station[first + i - 1], station[first + i]
        datum = height[first + i]
        entered, ahead = _profile_integral(station, height, a + half, b + half, ahead, datum)
        left, behind = _profile_integral(station, height, a - half, b - half, behind, datum)
        mean += (entered - left) / length
        out[i] = mean


@compile_kernel
def largest_deviation(station, step):
    """Largest distance of a station from where equal steps would put it."""
    largest = 0.0
    for i in range(station.size):
        largest = max(largest, abs(station[i] - (station[0] + i * step)))
    return largest
