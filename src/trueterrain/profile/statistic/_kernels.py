"""Loops over the sorted heights of many path points. No checks: the callers make them.

`start` marks the slices of the path points in `z`, the ascending heights; empty slices give NaN.
"""

import math

import numpy as np
from numba import njit, prange


@njit(cache=True, nogil=True, parallel=True)
def mean(start, z):
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


@njit(cache=True, nogil=True, parallel=True)
def quantile(start, z, probability, weights, weights_begin):
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


@njit(cache=True, nogil=True, parallel=True)
def window(start, z, low, high):
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
            bottom = z[first + min(int(low * n), n - 1)]
            top = z[first + min(max(int(math.ceil(high * n)) - 1, 0), n - 1)]
            average = squares = 0.0
            for m in range(first, last):
                average += min(max(z[m], bottom), top) - bottom
            average = bottom + average / n
            for m in range(first, last):
                squares += (min(max(z[m], bottom), top) - average) ** 2
            sd[k] = math.sqrt(squares / (n - 1) / n) / (high - low)
    return value, sd


@njit(cache=True, nogil=True, parallel=True)
def weighted_mean(start, z, distance, power, core):
    """Inverse-distance weighted mean and its standard error."""
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
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
        effective = weight * weight / weight_squares
        if last - first > 1:
            squares = 0.0
            for m in range(first, last):
                w = (core / max(distance[m], core)) ** power
                squares += (w * (z[m] - value[k])) ** 2
            sd[k] = math.sqrt(squares * effective / max(effective - 1.0, 1e-12)) / weight
    return value, sd


@njit(cache=True, nogil=True, parallel=True)
def weighted_median(start, z, distance, power, core):
    """Inverse-distance weighted median, and its standard error after Woodruff.

    Height m stands at the middle of its own weight; between the heights the CPF is linear.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        weight = weight_squares = 0.0
        for m in range(first, last):
            w = (core / max(distance[m], core)) ** power
            weight += w
            weight_squares += w * w
        half_interval = 0.5 * math.sqrt(weight_squares) / weight
        found = np.empty(3)
        for q in range(3):
            wanted = (0.5 + (q - 1) * half_interval) * weight
            found[q] = z[last - 1]
            reached = before = 0.0
            for m in range(first, last):
                w = (core / max(distance[m], core)) ** power
                middle = reached + 0.5 * w
                if middle >= wanted:
                    found[q] = z[m]
                    if m > first:
                        part = (wanted - before) / (middle - before)
                        found[q] = z[m - 1] + part * (z[m] - z[m - 1])
                    break
                before = middle
                reached += w
        value[k] = found[1]
        if n > 1:
            sd[k] = 0.5 * (found[2] - found[0])
    return value, sd


@njit(cache=True, nogil=True, parallel=True)
def continued_quantile(start, z, probability, resolution):
    """Quantile of quantised heights whose CPF is continued by PCHIP between the steps."""
    value = np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        edge, share = np.empty(n + 1), np.empty(n + 1)
        edge[0], share[0] = (np.rint(z[first] / resolution) - 0.5) * resolution, 0.0
        knots = 1
        for m in range(first, last):
            upper = (np.rint(z[m] / resolution) + 0.5) * resolution
            if knots == 1 or upper > edge[knots - 1]:
                edge[knots] = upper
                knots += 1
            share[knots - 1] = (m + 1.0 - first) / n
        # the piece in which the probability lies, and the PCHIP slopes at its two ends
        piece = 0
        while piece < knots - 2 and share[piece + 1] < probability:
            piece += 1
        slope = np.zeros(2)
        for side in range(2):
            i = piece + side
            if knots == 2:
                slope[side] = (share[1] - share[0]) / (edge[1] - edge[0])
            elif i == 0 or i == knots - 1:
                a = 0 if i == 0 else knots - 2
                b = 1 if i == 0 else knots - 3
                ha, hb = edge[a + 1] - edge[a], edge[b + 1] - edge[b]
                da, db = (share[a + 1] - share[a]) / ha, (share[b + 1] - share[b]) / hb
                end = ((2.0 * ha + hb) * da - ha * db) / (ha + hb)
                slope[side] = 0.0 if end < 0.0 else end
            else:
                ha, hb = edge[i] - edge[i - 1], edge[i + 1] - edge[i]
                da, db = (share[i] - share[i - 1]) / ha, (share[i + 1] - share[i]) / hb
                wa, wb = 2.0 * hb + ha, hb + 2.0 * ha
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
        value[k] = edge[piece] + 0.5 * (low + high) * width
    return value


@njit(cache=True, nogil=True, parallel=True)
def steepest(start, z, bandwidth, smallest, steps, tie):
    """Height where the smoothed CPF is steepest: the mode of a triweight kernel density.

    Of modes that are equally high within the share `tie`, the one nearest to the median counts.
    The standard error is that of an M-estimator: root of the sum of squared influences over the
    curvature at the mode. It is infinite where the top is flat.
    """
    value, sd = np.full(start.size - 1, np.nan), np.full(start.size - 1, np.nan)
    used = np.full(start.size - 1, np.nan)
    for k in prange(start.size - 1):
        first, last = start[k], start[k + 1]
        n = last - first
        if n == 0:
            continue
        h = bandwidth
        if h <= 0.0:  # normal-scale rule for the slope of a density, in the triweight's units
            average = squares = 0.0
            for m in range(first, last):
                average += (z[m] - z[first]) / n
            for m in range(first, last):
                squares += (z[m] - z[first] - average) ** 2
            spread = math.sqrt(squares / max(n - 1, 1))
            quarter = (z[first + (3 * (n - 1)) // 4] - z[first + (n - 1) // 4]) / 1.349
            if 0.0 < quarter < spread:
                spread = quarter
            h = max(2.978 * 0.9686 * spread * n ** (-1.0 / 7.0), smallest)
        used[k] = h
        middle = 0.5 * (z[first + (n - 1) // 2] + z[first + n // 2])
        bottom = z[first]
        step = h / steps
        grid = int(math.ceil((z[last - 1] - bottom) / step)) + 1
        density = np.zeros(grid + 2)  # one more point at either side of the heights
        left = first
        for g in range(grid + 2):
            x = bottom + (g - 1) * step
            while left < last and z[left] <= x - h:
                left += 1
            for m in range(left, last):
                t = (x - z[m]) / h
                if t <= -1.0:
                    break
                density[g] += (1.0 - t * t) ** 3
        highest = density.max()
        best = best_density = -1.0
        for g in range(1, grid + 1):
            # a mode between two grid points rises above the higher one by less than a tenth
            if density[g] < 0.9 * highest:
                continue
            if density[g] < density[g - 1] or density[g] < density[g + 1]:
                continue
            low, high = bottom + (g - 2) * step, bottom + g * step
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
            x = 0.5 * (low + high)
            at = 0.0
            for m in range(first, last):
                t = (x - z[m]) / h
                if abs(t) < 1.0:
                    at += (1.0 - t * t) ** 3
            equal = abs(at - best_density) <= tie * at
            nearer = abs(x - middle) < abs(best - middle)
            if (equal and nearer) or (not equal and at > best_density):
                best, best_density = x, at
        value[k] = best
        influence = curvature = 0.0
        for m in range(first, last):
            t = (best - z[m]) / h
            if abs(t) < 1.0:
                influence += (t * (1.0 - t * t) ** 2) ** 2
                curvature += (1.0 - t * t) * (1.0 - 5.0 * t * t)
        if n > 1:
            sd[k] = h * math.sqrt(influence) / curvature if curvature > 0.0 else np.inf
    return value, sd, used
