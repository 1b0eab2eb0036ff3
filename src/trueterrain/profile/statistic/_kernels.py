"""Loops over the sorted heights of many path points; arguments are checked by the callers.

``start`` (s + 1,) is the first index of the slice of each path point in ``z`` (n,) [m], ascending
within a slice, and in ``distance`` (n,) [m]. Results have the shape (s,); empty slices give NaN.
Sums are of heights above the lowest, so that high ground does not lose digits.
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

    ``weights[weights_begin[n]:][:n]`` are the Maritz-Jarrett weights of a slice of n heights,
    ``probability`` [1] is that of the quantile.
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
        # of two the mean: bit for bit the median of numpy
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
    """Mean of the ranks from fraction ``low`` to ``high``, and its winsorised standard error."""
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
            # a window narrower than the scatter of its ranks, sqrt(p (1 - p) / n), is as uncertain
            # as a window of that width
            centre = 0.5 * (low + high)
            half = max(0.5 * (high - low), 2.0 * math.sqrt(centre * (1.0 - centre) / n))
            lower, upper = max(centre - half, 0.0), min(centre + half, 1.0)
            bottom = _height_at_fraction(z, first, last, lower)
            top = _height_at_fraction(z, first, last, upper)
            average = squares = 0.0
            for m in range(first, last):
                average += min(max(z[m], bottom), top) - bottom
            average = bottom + average / n
            for m in range(first, last):
                squares += (min(max(z[m], bottom), top) - average) ** 2
            sd[k] = math.sqrt(squares / (n - 1) / n) / (upper - lower)
    return value, sd


@compile_kernel
def _height_at_fraction(z, first, last, fraction):
    """Quantile by linear interpolation; a height is at the midpoint of its rank (Hazen)."""
    position = min(max(fraction * (last - first) - 0.5, 0.0), last - first - 1.0)
    below = min(int(position), last - first - 2)
    low = z[first + below]
    return low + (position - below) * (z[first + below + 1] - low)


@compile_kernel(parallel=True)
def weighted_mean(start, z, distance, power, core):
    """Inverse-distance weighted mean, and the root of n sum w^2 / (sum w)^2.

    The weight is (core / max(distance, core)) ** power, with ``core`` in metres; the root is the
    standard error over that of the plain mean.
    """
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

    Weights as in `weighted_mean`. In the weighted CPF a height is at the midpoint of its weight;
    between the heights the CPF is linear.
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
        cumulative = before = 0.0
        for m in range(first, last):
            w = (core / max(distance[m], core)) ** power
            midpoint = cumulative + 0.5 * w
            if midpoint >= 0.5 * weight:
                value[k] = z[m]
                if m > first:
                    part = (0.5 * weight - before) / (midpoint - before)
                    value[k] = z[m - 1] + part * (z[m] - z[m - 1])
                break
            before = midpoint
            cumulative += w
    return value, growth


@compile_kernel(parallel=True)
def continued_quantile(start, z, probability, resolution, same, gap):
    """Quantile of quantised heights whose CPF is interpolated by PCHIP, and its standard error.

    Knots as in `HeightDistribution.steps`: ``resolution`` [m] is a step, ``same`` and ``gap``
    [steps] the differences below which heights are in the same step and in the next one. The
    variance is that of half of Woodruff's interval, plus that of a uniform error within a step
    times the fourth power of the fraction of heights in the step.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        edge, fraction = np.empty(2 * n + 1), np.empty(2 * n + 1)
        edge[0], fraction[0] = z[first] - 0.5 * resolution, 0.0
        knots, recorded = 1, z[first]
        for m in range(first, last):
            if z[m] - recorded <= same * resolution:
                continue
            if z[m] - recorded <= gap * resolution:
                edge[knots] = 0.5 * (recorded + z[m])
            else:  # no height lies in between: the CPF is constant
                edge[knots], fraction[knots] = recorded + 0.5 * resolution, (m - first) / n
                knots += 1
                edge[knots] = z[m] - 0.5 * resolution
            fraction[knots] = (m - first) / n
            knots, recorded = knots + 1, z[m]
        edge[knots], fraction[knots] = recorded + 0.5 * resolution, 1.0
        knots += 1
        value[k], mass = _extrapolate_quantile(edge, fraction, knots, probability)
        if n > 1:
            half = math.sqrt(probability * (1.0 - probability) / n)
            low, _ = _extrapolate_quantile(edge, fraction, knots, max(probability - half, 0.0))
            high, _ = _extrapolate_quantile(edge, fraction, knots, min(probability + half, 1.0))
            inside = resolution * mass * mass * math.sqrt(1.0 / 12.0 + (probability - 0.5) ** 2)
            sd[k] = math.hypot(0.5 * (high - low), inside)
    return value, sd


@compile_kernel
def _extrapolate_quantile(edge, fraction, knots, probability):
    """Height at which the PCHIP through the knots has a probability, and the mass of its step.

    Slopes at the knots are those of Fritsch and Butland (1984): weighted harmonic means inside, a
    three-point formula at the ends, as in ``scipy.interpolate.PchipInterpolator``.
    """
    piece = 0
    while piece < knots - 2 and fraction[piece + 1] < probability:
        piece += 1
    mass = fraction[piece + 1] - fraction[piece]
    if piece < knots - 2 and fraction[piece + 1] == probability == fraction[piece + 2]:
        return 0.5 * (edge[piece + 1] + edge[piece + 2]), mass  # midpoint of a constant piece
    slope = np.zeros(2)
    for side in range(2):
        i = piece + side
        if knots == 2:
            slope[side] = mass / (edge[1] - edge[0])
        elif i == 0 or i == knots - 1:
            a = 0 if i == 0 else knots - 2
            b = 1 if i == 0 else knots - 3
            ha, hb = edge[a + 1] - edge[a], edge[b + 1] - edge[b]
            da, db = (fraction[a + 1] - fraction[a]) / ha, (fraction[b + 1] - fraction[b]) / hb
            slope[side] = max(((2.0 * ha + hb) * da - ha * db) / (ha + hb), 0.0)
        else:
            ha, hb = edge[i] - edge[i - 1], edge[i + 1] - edge[i]
            da, db = (fraction[i] - fraction[i - 1]) / ha, (fraction[i + 1] - fraction[i]) / hb
            wa, wb = 2.0 * hb + ha, hb + 2.0 * ha
            if da > 0.0 and db > 0.0:
                slope[side] = (wa + wb) / (wa / da + wb / db)
    # the cubic is monotonic, so that bisection converges
    width = edge[piece + 1] - edge[piece]
    low, high = 0.0, 1.0
    for _ in range(60):
        t = 0.5 * (low + high)
        at = (
            fraction[piece] * (1.0 + 2.0 * t) * (1.0 - t) ** 2
            + fraction[piece + 1] * t * t * (3.0 - 2.0 * t)
            + width * slope[0] * t * (1.0 - t) ** 2
            - width * slope[1] * t * t * (1.0 - t)
        )
        if at < probability:
            low = t
        else:
            high = t
    return edge[piece] + 0.5 * (low + high) * width, mass


@compile_kernel(parallel=True)
def area_steepest(start, z, bandwidth, min_bandwidth, steps, tie):
    """Height where the smoothed CPF is steepest: the mode of a triweight kernel density.

    ``bandwidth`` [m], or 0 for the normal-scale rule with the lower bound ``min_bandwidth`` [m];
    ``steps`` per bandwidth of the lattice on which the density is evaluated first. Of modes that
    are equally high within the fraction ``tie``, the one nearest to the median is taken, of two
    equally near ones the lower. The standard error is that of an M-estimator: root of the sum of
    squared influences over the curvature at the mode, at most the standard deviation of the
    heights. Also returns the bandwidths.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    used = np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        sample_sd, robust_sd = _sample_scatter(z, first, last)
        h = bandwidth
        if h <= 0.0:
            # normal-scale rule for the derivative of a density: 0.9686 sd n^(-1/7) of a normal
            # kernel, times 2.978 for the triweight kernel
            h = max(2.978 * 0.9686 * robust_sd * n ** (-1.0 / 7.0), min_bandwidth)
        used[k] = h
        median = 0.5 * (z[first + (n - 1) // 2] + z[first + n // 2])
        step = h / steps
        highest = 0.0
        best = best_density = -1.0
        for sweep in range(2):  # first the maximum on the lattice, then all modes nearly as high
            g, left = -1, first
            before = here = 0.0  # densities at the last two points of the lattice
            while left < last:
                x = z[first] + g * step
                while left < last and z[left] <= x - h:
                    left += 1
                after, jump = 0.0, False
                if left < last:
                    jump = z[left] >= x + h
                    after = _kernel_density(z, left, last, x, h)
                if sweep == 0:
                    highest = max(highest, after)
                # between two points of the lattice a mode is higher by less than a tenth
                elif here >= 0.9 * highest and here >= before and here >= after:
                    top = _density_mode(z, first, last, x - 2.0 * step, x, h)
                    at = _kernel_density(z, first, last, top, h)
                    equal = abs(at - best_density) <= tie * at
                    nearer = abs(top - median) < abs(best - median) - tie * h
                    if (equal and nearer) or (not equal and at > best_density):
                        best, best_density = top, at
                before, here = here, after
                g += 1
                if jump:  # skip the gap to the next heights
                    g = max(g, int(math.floor((z[left] - h - z[first]) / step)))
        value[k] = best
        if n > 1:
            # the curvature at the estimated mode is biased upward, so that it is estimated with a
            # wider bandwidth, and corrected by the ratio for a normal density; h^2 / 9 is the
            # variance of the triweight kernel
            wide = h * (1.0 + 2.5 / math.sqrt(n))
            ratio = (robust_sd**2 + wide * wide / 9.0) / (robust_sd**2 + h * h / 9.0)
            influence = curvature = 0.0
            for m in range(first, last):
                t = (best - z[m]) / h
                if abs(t) < 1.0:
                    influence += (t * (1.0 - t * t) ** 2) ** 2
                t = (best - z[m]) / wide
                if abs(t) < 1.0:
                    curvature += (1.0 - t * t) * (1.0 - 5.0 * t * t)
            curvature *= (ratio * h * h / (wide * wide)) ** 1.5
            sd[k] = sample_sd
            if curvature * sample_sd > h * math.sqrt(influence):
                sd[k] = h * math.sqrt(influence) / curvature
    return value, sd, used


@compile_kernel
def _sample_scatter(z, first, last):
    """Standard deviation, and its minimum with the interquartile range over 1.349 (robust)."""
    n = last - first
    average = squares = 0.0
    for m in range(first, last):
        average += (z[m] - z[first]) / n
    for m in range(first, last):
        squares += (z[m] - z[first] - average) ** 2
    interquartile = z[first + (3 * (n - 1)) // 4] - z[first + (n - 1) // 4]
    sample_sd = math.sqrt(squares / max(n - 1, 1))
    return sample_sd, min(sample_sd, interquartile / 1.349)


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
    """Mode between two heights: zero of the derivative of the density, by bisection."""
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
