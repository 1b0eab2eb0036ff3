"""Loops over the sorted heights of many path points. No checks: the callers make them.

`start` marks the slices of the path points in `z`, the ascending heights; empty slices give NaN.
"""

import math

import numpy as np
from numba import prange

from trueterrain.core.kernels import compile_kernel


@compile_kernel(parallel=True)
def area_mean(start, z):
    """Mean and its standard error s / sqrt(n)."""
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        total = 0.0
        for m in range(first, last):
            total += z[m] - z[first]
        value[k] = z[first] + total / n
        if n > 1:
            squares = 0.0
            for m in range(first, last):
                squares += (z[m] - value[k]) ** 2
            sd[k] = math.sqrt(squares / (n - 1) / n)
    return value, sd


@compile_kernel(parallel=True)
def area_quantile(start, z, probability, weights, weights_begin):
    """Sample quantile (linear between order statistics) and its Maritz-Jarrett standard error.

    ``weights[weights_begin[n]:][:n]`` are the weights of a slice of n heights.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        position = probability * (n - 1)
        below = min(int(position), n - 1)
        above = min(below + 1, n - 1)
        part = position - below
        low, high = z[first + below], z[first + above]
        # the middle of two is their mean: bit for bit what a median is everywhere else
        value[k] = 0.5 * (low + high) if part == 0.5 else low + part * (high - low)
        if n > 1:
            moment = squares = 0.0
            for m in range(n):
                w = weights[weights_begin[n] + m]
                offset = z[first + m] - value[k]
                moment += w * offset
                squares += w * offset * offset
            sd[k] = math.sqrt(max(squares - moment * moment, 0.0))
    return value, sd


@compile_kernel(parallel=True)
def area_window(start, z, low, high):
    """Mean of the ranks between two shares of the heights, and its winsorised standard error."""
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        total = weight = 0.0
        for m in range(n):
            # height m stands for the ranks from m/n to (m+1)/n
            w = min((m + 1.0) / n, high) - max(m / n, low)
            if w > 0.0:
                total += w * (z[first + m] - z[first])
                weight += w
        value[k] = z[first] + total / weight
        if n > 1:
            # a window narrower than the scatter of its own ranks is as uncertain as those
            middle = 0.5 * (low + high)
            half = max(0.5 * (high - low), 2.0 * math.sqrt(middle * (1.0 - middle) / n))
            lower, upper = max(middle - half, 0.0), min(middle + half, 1.0)
            bottom = _height_at_share(z, first, last, lower)
            top = _height_at_share(z, first, last, upper)
            average = squares = 0.0
            for m in range(first, last):
                average += min(max(z[m], bottom), top) - bottom
            average = bottom + average / n
            for m in range(first, last):
                squares += (min(max(z[m], bottom), top) - average) ** 2
            sd[k] = math.sqrt(squares / (n - 1) / n) / (upper - lower)
    return value, sd


@compile_kernel
def _height_at_share(z, first, last, share):
    """Height below which a share of the heights lies; each stands at the middle of its rank."""
    position = min(max(share * (last - first) - 0.5, 0.0), last - first - 1.0)
    below = min(int(position), last - first - 2)
    low = z[first + below]
    return low + (position - below) * (z[first + below + 1] - low)


@compile_kernel(parallel=True)
def weighted_mean(start, z, distance, power, core):
    """Inverse-distance weighted mean, and the root of n sum w^2 / (sum w)^2."""
    value, growth = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        if last == first:
            continue
        total = weight = weight_squares = 0.0
        for m in range(first, last):
            w = (core / max(distance[m], core)) ** power
            total += w * (z[m] - z[first])
            weight += w
            weight_squares += w * w
        value[k] = z[first] + total / weight
        growth[k] = math.sqrt((last - first) * weight_squares) / weight
    return value, growth


@compile_kernel(parallel=True)
def weighted_median(start, z, distance, power, core):
    """Inverse-distance weighted median, and the root of n sum w^2 / (sum w)^2.

    Height m stands at the middle of its own weight; between the heights the CPF is linear.
    """
    value, growth = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        if last == first:
            continue
        weight = weight_squares = 0.0
        for m in range(first, last):
            w = (core / max(distance[m], core)) ** power
            weight += w
            weight_squares += w * w
        growth[k] = math.sqrt((last - first) * weight_squares) / weight
        value[k] = z[last - 1]
        reached = before = 0.0
        for m in range(first, last):
            w = (core / max(distance[m], core)) ** power
            middle = reached + 0.5 * w
            if middle >= 0.5 * weight:
                value[k] = z[m]
                if m > first:
                    part = (0.5 * weight - before) / (middle - before)
                    value[k] = z[m - 1] + part * (z[m] - z[m - 1])
                break
            before = middle
            reached += w
    return value, growth


@compile_kernel(parallel=True)
def continued_quantile(start, z, probability, resolution, same, gap):
    """Quantile of quantised heights whose CPF is continued by PCHIP, and its standard error.

    Knots as in `HeightDistribution.steps`. The error is half of Woodruff's interval, and what is
    not known inside of a step that holds a large share of the heights.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        edge, share = np.empty(2 * n + 1), np.empty(2 * n + 1)
        edge[0], share[0] = z[first] - 0.5 * resolution, 0.0
        knots, recorded = 1, z[first]
        for m in range(first, last):
            if z[m] - recorded <= same * resolution:
                continue
            if z[m] - recorded <= gap * resolution:
                edge[knots] = 0.5 * (recorded + z[m])
            else:  # no height lies in between: the CPF rests
                edge[knots], share[knots] = recorded + 0.5 * resolution, (m - first) / n
                knots += 1
                edge[knots] = z[m] - 0.5 * resolution
            share[knots] = (m - first) / n
            knots, recorded = knots + 1, z[m]
        edge[knots], share[knots] = recorded + 0.5 * resolution, 1.0
        knots += 1
        value[k], mass = _extrapolate_quantile(edge, share, knots, probability)
        if n > 1:
            half = math.sqrt(probability * (1.0 - probability) / n)
            low, _ = _extrapolate_quantile(edge, share, knots, max(probability - half, 0.0))
            high, _ = _extrapolate_quantile(edge, share, knots, min(probability + half, 1.0))
            inside = resolution * mass * mass * math.sqrt(1.0 / 12.0 + (probability - 0.5) ** 2)
            sd[k] = math.hypot(0.5 * (high - low), inside)
    return value, sd


@compile_kernel
def _extrapolate_quantile(edge, share, knots, probability):
    """Height at which the PCHIP through the knots reaches a probability, and its step's share."""
    piece = 0
    while piece < knots - 2 and share[piece + 1] < probability:
        piece += 1
    mass = share[piece + 1] - share[piece]
    if piece < knots - 2 and share[piece + 1] == probability == share[piece + 2]:
        return 0.5 * (edge[piece + 1] + edge[piece + 2]), mass  # the middle of where it rests
    slope = np.zeros(2)
    for side in range(2):
        i = piece + side
        if knots == 2:
            slope[side] = mass / (edge[1] - edge[0])
        elif i == 0 or i == knots - 1:
            a = 0 if i == 0 else knots - 2
            b = 1 if i == 0 else knots - 3
            ha, hb = edge[a + 1] - edge[a], edge[b + 1] - edge[b]
            da, db = (share[a + 1] - share[a]) / ha, (share[b + 1] - share[b]) / hb
            slope[side] = max(((2.0 * ha + hb) * da - ha * db) / (ha + hb), 0.0)
        else:
            ha, hb = edge[i] - edge[i - 1], edge[i + 1] - edge[i]
            da, db = (share[i] - share[i - 1]) / ha, (share[i + 1] - share[i]) / hb
            wa, wb = 2.0 * hb + ha, hb + 2.0 * ha
            if da > 0.0 and db > 0.0:
                slope[side] = (wa + wb) / (wa / da + wb / db)
    # the cubic ascends: bisection cannot miss
    width = edge[piece + 1] - edge[piece]
    low, high = 0.0, 1.0
    for _ in range(60):
        t = 0.5 * (low + high)
        at = (
            share[piece] * (1.0 + 2.0 * t) * (1.0 - t) ** 2
            + share[piece + 1] * t * t * (3.0 - 2.0 * t)
            + width * slope[0] * t * (1.0 - t) ** 2
            - width * slope[1] * t * t * (1.0 - t)
        )
        if at < probability:
            low = t
        else:
            high = t
    return edge[piece] + 0.5 * (low + high) * width, mass


@compile_kernel(parallel=True)
def area_steepest(start, z, bandwidth, smallest, steps, tie):
    """Height where the smoothed CPF is steepest: the mode of a triweight kernel density.

    Of modes that are equally high within the share `tie`, the one nearest to the median counts, of
    two equally near ones the lower. The standard error is that of an M-estimator: root of the sum
    of squared influences over the curvature at the mode, but not more than the scatter of heights.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    used = np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        scatter, spread = _sample_scatter(z, first, last)
        h = bandwidth
        if h <= 0.0:  # normal-scale rule for the slope of a density, in the triweight's units
            h = max(2.978 * 0.9686 * spread * n ** (-1.0 / 7.0), smallest)
        used[k] = h
        median = 0.5 * (z[first + (n - 1) // 2] + z[first + n // 2])
        step = h / steps
        highest = 0.0
        best = best_density = -1.0
        for turn in range(2):  # the highest place of a lattice, then the modes nearly as high
            g, left = -1, first
            before = here = 0.0  # densities at the last two places of the lattice
            while left < last:
                x = z[first] + g * step
                while left < last and z[left] <= x - h:
                    left += 1
                after, jump = 0.0, False
                if left < last:
                    jump = z[left] >= x + h
                    after = _kernel_density(z, left, last, x, h)
                if turn == 0:
                    highest = max(highest, after)
                # a mode between two places rises above the higher one by less than a tenth
                elif here >= 0.9 * highest and here >= before and here >= after:
                    top = _density_mode(z, first, last, x - 2.0 * step, x, h)
                    at = _kernel_density(z, first, last, top, h)
                    equal = abs(at - best_density) <= tie * at
                    nearer = abs(top - median) < abs(best - median) - tie * h
                    if (equal and nearer) or (not equal and at > best_density):
                        best, best_density = top, at
                before, here = here, after
                g += 1
                if jump:  # over the gap to the next heights
                    g = max(g, int(math.floor((z[left] - h - z[first]) / step)))
        value[k] = best
        if n > 1:
            # a mode stands where the curvature happens to be sharp, so that a wider look is more
            # honest; the curvature of a normal density tells how far it falls with the bandwidth
            wide = h * (1.0 + 2.5 / math.sqrt(n))
            blunt = (spread**2 + wide * wide / 9.0) / (spread**2 + h * h / 9.0)
            influence = curvature = 0.0
            for m in range(first, last):
                t = (best - z[m]) / h
                if abs(t) < 1.0:
                    influence += (t * (1.0 - t * t) ** 2) ** 2
                t = (best - z[m]) / wide
                if abs(t) < 1.0:
                    curvature += (1.0 - t * t) * (1.0 - 5.0 * t * t)
            curvature *= (blunt * h * h / (wide * wide)) ** 1.5
            sd[k] = scatter
            if curvature * scatter > h * math.sqrt(influence):
                sd[k] = h * math.sqrt(influence) / curvature
    return value, sd, used


@compile_kernel
def _sample_scatter(z, first, last):
    """Standard deviation, and that of a normal density with the same quarters if it is less."""
    n = last - first
    average = squares = 0.0
    for m in range(first, last):
        average += (z[m] - z[first]) / n
    for m in range(first, last):
        squares += (z[m] - z[first] - average) ** 2
    quarters = z[first + (3 * (n - 1)) // 4] - z[first + (n - 1) // 4]
    scatter = math.sqrt(squares / max(n - 1, 1))
    return scatter, min(scatter, quarters / 1.349)


@compile_kernel
def _kernel_density(z, first, last, x, h):
    """Sum of triweight kernels at x, up to a factor."""
    total = 0.0
    for m in range(first, last):
        t = (x - z[m]) / h
        if t <= -1.0:
            break
        if t < 1.0:
            total += (1.0 - t * t) ** 3
    return total


@compile_kernel
def _density_mode(z, first, last, low, high, h):
    """Place between two heights where the density stops to rise."""
    for _ in range(60):
        x = 0.5 * (low + high)
        slope = 0.0
        for m in range(first, last):
            t = (x - z[m]) / h
            if abs(t) < 1.0:
                slope -= t * (1.0 - t * t) ** 2
        if slope > 0.0:
            low = x
        else:
            high = x
    return 0.5 * (low + high)
