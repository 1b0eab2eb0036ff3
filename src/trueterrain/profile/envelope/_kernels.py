"""Loops over path points, cams and springs; arguments are checked by the callers.

Arguments that several kernels take:

- ``strip`` (line, sample) [m]: ground, NaN where missing, ``step`` [m] between samples;
- ``first`` and ``stride``: sample of the first path point, and samples to the next one;
- ``radius`` [m] of the tyre, ``decay`` [rad]: decay length of the band as an angle, ``tension`` [N]
  of the band of one section, ``work`` (4, samples): memory for angles, deflections and slopes.
"""

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
    """Height of the lowest point of each cam on the ground, and the slope there.

    The ground is linear between samples, and a cam touches a sample or, where its outline has the
    slope of the ground, a piece between two samples.

    - ``group`` (c,): group of lines under each cam, ``lines`` (g, 2): first line of a group and one
      after the last, ``top`` (g, sample) [m]: highest height of the lines of a group;
    - ``lead`` (c,): first sample under each cam, relative to the path point; ``shift`` (c,) [m]:
      position of its centre;
    - ``drop`` (c, k) [m]: height of the outline above its lowest point at each sample, infinite
      beyond the cam; ``slope`` (c, k + 2) [m/m]: slope of the outline, one sample more at each end;
    - ``behind``, ``ahead`` (c, k + 1) [m]: a piece can hold the cam no higher than its first sample
      less ``behind`` or its last sample less ``ahead``, so that most pieces are skipped;
    - ``half_length``, ``half_height`` [m], ``order`` of the superellipse;
    - ``height`` [m], ``gradient`` [m/m] (s, c): output, NaN where there is no ground.

    NaN compares as false, so that missing samples are not touched.
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
                    # point of the superellipse whose slope is that of the ground
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
    shapes of the band at or above the ground, it takes that of minimum energy. As deflection over
    the angle seen from the hub, this is the smallest curve above the samples that consists of
    solutions of w'' = w (exponentials per decay length), found like a convex hull in one pass. At a
    sample that the band touches, the contact force is the tension times the kink of the band; the
    forces are the derivatives of the energy.

    ``ground`` (n,) [m], of which samples ``begin`` to ``end`` are used, the first at ``x_begin``
    [m] from the hub; ``hub`` [m]: height of the hub.
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
        # insertion sort by angle: steep ground may reverse the order of samples
        hole = count
        while hole > 0 and angle[hole - 1] > theta:
            angle[hole], deflection[hole] = angle[hole - 1], deflection[hole - 1]
            hole -= 1
        angle[hole], deflection[hole] = theta, deep
        count += 1

    kept = 0  # samples that the band touches, moved to the front; slopes per decay length
    for j in range(count):
        theta, deep = angle[j], deflection[j]
        arrival = deep
        while kept > 0:
            t = kept - 1
            between = (theta - angle[t]) / decay
            if between < 1e-9:  # at the same angle: the sample nearer to the hub counts
                deep = max(deep, deflection[t])
                kept -= 1
                arrival = deep
                continue
            q = math.exp(min(between, 300.0))  # beyond, samples do not interact
            # slopes at both ends of w = a e^t + b e^-t between the two samples
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
        # contact force from the kink of the band, normal to its mean direction
        force = tension / (radius * decay) * (before[t] - leaving)
        tilt = 0.5 * (before[t] + leaving) / (decay * (radius - deflection[t]))
        cos, sin = math.cos(angle[t]), math.sin(angle[t])
        up += force * (cos - tilt * sin)
        forward -= force * (sin + tilt * cos)
        energy += 0.5 * force * deflection[t]
    return up, forward, energy


@compile_kernel
def tyre_forces(strip, begin, end, x_begin, step, hub, radius, decay, tension, work):
    """Vertical and forward force on the hub [N] and energy [J] of all sections together.

    ``strip`` (section, sample) [m]; other arguments as of `section_forces`.
    """
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

    Secant iterations, safeguarded by a bracket, from the mean ground of the contact patch. The
    upper end of the bracket is the height at which the tyre just touches the ground; while there is
    no lower end, a secant outside of the bracket is replaced by a step of one deflection downward,
    then by bisection. NaN where there is no ground, or where it would reach the hub.

    ``load`` [N], ``deflection`` [m] under the rated load, ``tolerance`` [1] of the load;
    ``height`` [m], ``slope`` [m/m] (s,): output.
    """
    sections = strip.shape[0]
    reach = int(radius / step)
    patch = int(math.sqrt(2.0 * radius * deflection) / step)
    for i in prange(height.size):
        work = np.empty((4, 2 * reach + 1))
        ground = np.empty((sections, 2 * reach + 1))
        begin = first + i * stride - reach
        datum = total = 0.0  # heights above the datum, so that high ground does not lose digits
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
            # converged, to the tolerance or to the resolution of heights
            if abs(error) <= tolerance * load or following == hub or high - low <= 1e-15 * radius:
                height[i] = datum + hub
                slope[i] = -forward / load
                break
            last, last_error, hub = hub, error, following
