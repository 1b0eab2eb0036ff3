"""Loops over path points, cams and springs; all checks are made by the callers."""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel


@compile_kernel(parallel=True)
def cam_heights(
    strip,
    top,
    group,
    lines,
    first,
    stride,
    step,
    lead,
    drop,
    slope,
    behind,
    ahead,
    shift,
    half_length,
    half_height,
    order,
    height,
    gradient,
):
    """Height of each cam that stands on the ground, less its half height, and the slope there.

    The ground is linear between samples, and a cam touches a sample or, where it is as steep as
    the ground, a piece between two. Cam c stands on the lines `lines[group[c]]`, of which
    `top[group[c]]` is the highest at each sample; its first sample is `lead[c]` samples ahead of
    the path point. `drop` is how far the outline of the cam lies above its lowest point over each
    sample, infinite beyond the cam; `slope`, one longer at either end, is that of the outline. No
    piece can hold the cam higher than the sample at its begin less `behind`, or that at its end
    less `ahead`, so that few need to be looked at. Missing samples (NaN) touch nothing.
    """
    points, cams = height.shape
    samples = drop.shape[1]
    power = order / (order - 1.0)
    for i in prange(points):
        for c in range(cams):
            highest_line = top[group[c]]
            begin = first + i * stride + lead[c]
            highest, at = -np.inf, np.nan
            for k in range(samples):
                candidate = highest_line[begin + k] - drop[c, k]
                if candidate > highest:
                    highest, at = candidate, slope[c, k + 1]
            for k in range(samples + 1):
                left, right = begin + k - 1, begin + k
                if not (
                    highest_line[left] - behind[c, k] > highest
                    or highest_line[right] - ahead[c, k] > highest
                ):
                    continue
                for line in range(lines[group[c], 0], lines[group[c], 1]):
                    rise = (strip[line, right] - strip[line, left]) / step
                    if not slope[c, k] < rise < slope[c, k + 1]:
                        continue
                    steep = (abs(rise) * half_length / half_height) ** power
                    x = math.copysign(half_length * (steep / (1.0 + steep)) ** (1.0 / order), rise)
                    above = half_height * (1.0 - (1.0 / (1.0 + steep)) ** (1.0 / order))
                    along = x - ((lead[c] + k - 1) * step - shift[c])
                    candidate = strip[line, left] + rise * along - above
                    if candidate > highest:
                        highest, at = candidate, rise
            height[i, c] = highest if highest > -np.inf else np.nan
            gradient[i, c] = at


@compile_kernel
def section_forces(ground, begin, end, x_begin, step, hub, radius, decay, tension, work):
    """Vertical and forward force on the hub [N] and energy [J] of one section of a tyre.

    Radial springs of equal stiffness per metre of tread, under a band of constant tension: of all
    shapes of the band that lie nowhere below the ground, it takes that of least energy. As seen
    from the hub, deflection over angle, this is the least curve above the samples that is made of
    pieces of exponentials, found like a convex hull in one pass. A sample that the band rests on
    carries the kink of the band times its tension; the forces are the derivatives of the energy.
    `decay` is the decay length of the band in radians.
    """
    angle, deflection, before, after = work[0], work[1], work[2], work[3]
    count = 0
    for j in range(begin, end):
        x = x_begin + (j - begin) * step
        y = hub - ground[j]
        square = x * x + y * y
        if not square < radius * radius:
            continue
        theta, deep = math.atan2(x, y), radius - math.sqrt(square)
        hole = count
        while hole > 0 and angle[hole - 1] > theta:
            angle[hole], deflection[hole] = angle[hole - 1], deflection[hole - 1]
            hole -= 1
        angle[hole], deflection[hole] = theta, deep
        count += 1

    kept = 0  # samples that the band rests on, moved to the front; slopes per decay length
    for j in range(count):
        theta, deep = angle[j], deflection[j]
        arrival = deep
        while kept > 0:
            t = kept - 1
            between = (theta - angle[t]) / decay
            if between < 1e-9:  # one behind the other: the nearer one counts
                deep = max(deep, deflection[t])
                kept -= 1
                arrival = deep
                continue
            q = math.exp(min(between, 300.0))  # beyond, they know nothing of each other
            leaving = (2.0 * q * deep - deflection[t] * (q * q + 1.0)) / (q * q - 1.0)
            if leaving < before[t]:
                after[t] = leaving
                arrival = (deep * (q * q + 1.0) - 2.0 * q * deflection[t]) / (q * q - 1.0)
                break
            kept -= 1
        angle[kept], deflection[kept], before[kept] = theta, deep, arrival
        kept += 1
    while kept > 0 and -deflection[kept - 1] >= before[kept - 1]:
        kept -= 1

    up = forward = energy = 0.0
    for t in range(kept):
        leaving = after[t] if t < kept - 1 else -deflection[t]
        push = tension / (radius * decay) * (before[t] - leaving)
        turn = 0.5 * (before[t] + leaving) / (decay * (radius - deflection[t]))
        cos, sin = math.cos(angle[t]), math.sin(angle[t])
        up += push * (cos - turn * sin)
        forward -= push * (sin + turn * cos)
        energy += 0.5 * push * deflection[t]
    return up, forward, energy


@compile_kernel
def tyre_forces(strip, begin, end, x_begin, step, hub, radius, decay, tension, work):
    """Vertical and forward force on the hub [N] and energy [J], of all sections together."""
    up = forward = energy = 0.0
    for section in range(strip.shape[0]):
        a, b, c = section_forces(
            strip[section], begin, end, x_begin, step, hub, radius, decay, tension, work
        )
        up += a
        forward += b
        energy += c
    return up, forward, energy


@compile_kernel(parallel=True)
def hub_heights(
    strip,
    first,
    stride,
    step,
    radius,
    decay,
    tension,
    load,
    deflection,
    tolerance,
    iterations,
    height,
    slope,
):
    """Height of the hub at which the springs carry the load, and the slope of their force.

    Secants from where the hub would be above the mean ground of its patch; one that leaves the
    bracket, which begins with the height at which the tyre just touches, halves the bracket or,
    while it has no lower end, sinks on. NaN where there is no ground, or where the hub would come
    down to it.
    """
    sections = strip.shape[0]
    reach = int(radius / step)
    patch = int(math.sqrt(2.0 * radius * deflection) / step)
    for i in prange(height.size):
        work = np.empty((4, 2 * reach + 1))
        ground = np.empty((sections, 2 * reach + 1))
        begin = first + i * stride - reach
        datum = total = 0.0  # heights from there, so that high ground costs no digits
        known = 0
        for section in range(sections):
            for j in range(reach - patch, reach + patch + 1):
                if not np.isnan(strip[section, begin + j]):
                    if known == 0:
                        datum = strip[section, begin + j]
                    total += strip[section, begin + j] - datum
                    known += 1
        touching = -np.inf
        for section in range(sections):
            for j in range(2 * reach + 1):
                ground[section, j] = strip[section, begin + j] - datum
                x = (j - reach) * step
                top = ground[section, j] + math.sqrt(max(radius * radius - x * x, 0.0))
                if top > touching:
                    touching = top
        height[i] = slope[i] = np.nan
        if touching == -np.inf:
            continue
        low, high = -np.inf, touching
        last, last_error = touching, -load
        hub = min(total / max(known, 1) + radius, touching) - deflection
        for _ in range(iterations):
            if not touching - hub < 0.9 * radius:
                break
            up, forward, _ = tyre_forces(
                ground, 0, 2 * reach + 1, -reach * step, step, hub, radius, decay, tension, work
            )
            error = up - load
            if error > 0.0:
                low = hub
            else:
                high = hub
            following = np.nan
            if error != last_error:
                following = hub - error * (hub - last) / (error - last_error)
            if not low <= following <= high:
                following = 0.5 * (low + high) if low > -np.inf else hub - deflection
            # met, or as near as heights can be told apart
            if abs(error) <= tolerance * load or following == hub or high - low <= 1e-15 * radius:
                height[i] = datum + hub
                slope[i] = -forward / load
                break
            last, last_error, hub = hub, error, following
