"""Loops over cells and intervals of the adjustment; all checks are made by the callers.

Terms and shapes used below:

entry : one cell as one pass saw it; the entries of cell c are ``start[c]`` to ``start[c + 1] - 1``
start : (cell + 1,) first entry of each cell, then the number of entries
interval : (entry,) interval between two knots of the pass, -1 without correction
weights : (entry, 4) values of the four cubic B-splines of the interval [1]
factor : (entry, k) derivative of the height with respect to each of the k components
weight : (entry,) weight of the observation [1/m²]
height : (entry,) height [m]
pair : two intervals with a common cell, the one with the greater number first; linked lists
    ``head`` (interval,), ``after`` (pair,) and ``one``, ``two`` (pair,) hold the pairs of each
    first interval
blocks : (pair, 4 k, 4 k) elements of the normal matrix, the four of the first component first
"""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def spline_basis(time, begin, spacing, intervals, first, interval, weights):
    """Interval of each time, and the four cubic B-splines there.

    time : (n,) [s] or [m]; begin, spacing : of the knots; intervals : their number; first : number
    of the first interval; out: interval (n,), weights (n, 4).
    """
    for i in range(time.size):
        at = (time[i] - begin) / spacing
        k = min(max(int(math.floor(at)), 0), intervals - 1)
        x = at - k
        y = 1.0 - x
        interval[i] = first + k
        weights[i, 0] = y * y * y / 6.0
        weights[i, 1] = (3.0 * x * x * (x - 2.0) + 4.0) / 6.0
        weights[i, 2] = (3.0 * y * y * (y - 2.0) + 4.0) / 6.0
        weights[i, 3] = x * x * x / 6.0


@compile_kernel
def pairs_of(start, interval, intervals):
    """Find the pairs of intervals with common cells: head, next, first and second.

    start, interval : see above; intervals : number of intervals
    """
    head = np.full(intervals, -1, np.int64)
    capacity = 4 * intervals + 16
    after, one, two = (
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int64),
    )
    used = 0
    for k in range(intervals):  # each with itself, even without a cell
        head[k], after[used], one[used], two[used] = used, -1, k, k
        used += 1
    for c in range(start.size - 1):
        for i in range(start[c], start[c + 1]):
            for j in range(start[c], i):
                a, b = max(interval[i], interval[j]), min(interval[i], interval[j])
                if b < 0:
                    continue
                at = head[a]
                while at >= 0 and two[at] != b:
                    at = after[at]
                if at >= 0:
                    continue
                if used == capacity:
                    capacity *= 2
                    after = np.concatenate((after, np.empty(used, np.int64)))
                    one = np.concatenate((one, np.empty(used, np.int64)))
                    two = np.concatenate((two, np.empty(used, np.int64)))
                # after the pair with itself, which is needed most
                after[used], one[used], two[used] = after[head[a]], a, b
                after[head[a]] = used
                used += 1
    return head, after[:used].copy(), one[:used].copy(), two[:used].copy()


@compile_kernel
def assemble_normal_equations(
    start, use, interval, weights, factor, weight, height, head, after, two, blocks, right
):
    """Assemble the normal equations, with the heights of the cells eliminated.

    For a cell with weights w and total W elimination of its height (Schur complement) gives the
    weight matrix diag(w) - w wᵀ / W; only its pairs of entries add to the normal matrix.

    start, interval, weights, factor, weight, height, head, after, two : see above
    use : (cell,) True for cells to include
    blocks (pair, 4 k, 4 k), right (interval, 4 k) : sums, added to

    Returns the weighted sum of squares about the means of the cells, and entries less cells.
    """
    components = factor.shape[1]
    size = 4 * components
    row = np.empty((64, size))
    square, degrees_of_freedom = 0.0, 0
    for c in range(start.size - 1):
        if not use[c]:
            continue
        begin, end = start[c], start[c + 1]
        if end - begin > row.shape[0]:
            row = np.empty((end - begin, size))
        total, mean, used = 0.0, 0.0, 0
        for i in range(begin, end):
            total += weight[i]
            mean += weight[i] * height[i]
            used += weight[i] > 0.0
            for k in range(components):
                for n in range(4):
                    row[i - begin, 4 * k + n] = factor[i, k] * weights[i, n]
        if used < 2:
            continue
        mean /= total
        degrees_of_freedom += used - 1
        for i in range(begin, end):
            if weight[i] == 0.0:
                continue
            weighted = weight[i] * (height[i] - mean)
            square += weighted * (height[i] - mean)
            if interval[i] < 0:
                continue
            for m in range(size):
                right[interval[i], m] -= row[i - begin, m] * weighted
            for j in range(begin, i + 1):
                if interval[j] < 0 or weight[j] == 0.0:
                    continue
                joint = -weight[i] * weight[j] / total
                if i == j:
                    joint += weight[i]
                one, other = i, j
                if interval[j] > interval[i]:
                    one, other = j, i
                at = head[interval[one]]
                while two[at] != interval[other]:
                    at = after[at]
                twice = i != j and interval[i] == interval[j]
                for m in range(size):
                    by = joint * row[one - begin, m]
                    for n in range(size):
                        blocks[at, m, n] += by * row[other - begin, n]
                    if twice:
                        by = joint * row[other - begin, m]
                        for n in range(size):
                            blocks[at, m, n] += by * row[one - begin, n]
    return square, degrees_of_freedom


@compile_kernel
def scatter_blocks(blocks, one, two, unknown, slot, elements):
    """Add blocks of pairs, with their offsets, to the elements of the normal matrix.

    An offset is added to all four coefficients of its component, so its rows and columns are sums
    of theirs. Of the block of an interval with itself only the lower half is used; the block of two
    intervals stands for its transpose as well.

    blocks, one, two : see above; unknown : (interval, 5 k) unknowns of each interval
    slot : (place,) element of each place in order; elements : (element,) sums, added to
    """
    size = blocks.shape[1]
    k = size // 4
    whole = np.empty((5 * k, 5 * k))
    at = 0
    for pair in range(one.size):
        whole[:size, :size] = blocks[pair]
        for m in range(k):
            for n in range(size):
                total = 0.0
                for j in range(4 * m, 4 * m + 4):
                    total += whole[j, n]
                whole[size + m, n] = total
        for m in range(5 * k):
            for n in range(k):
                total = 0.0
                for j in range(4 * n, 4 * n + 4):
                    total += whole[m, j]
                whole[m, size + n] = total
        a, b = one[pair], two[pair]
        for m in range(5 * k):
            for n in range(m + 1 if a == b else 5 * k):
                twice = a != b and unknown[a, m] == unknown[b, n]
                elements[slot[at]] += 2.0 * whole[m, n] if twice else whole[m, n]
                at += 1


@compile_kernel
def scatter_plain(blocks, one, two, unknown, slot, elements):
    """Add blocks of pairs to the elements of a matrix without offsets.

    Arguments as for `scatter_blocks`; unknown : (interval, 4 k).
    """
    size = blocks.shape[1]
    at = 0
    for pair in range(one.size):
        a, b = one[pair], two[pair]
        for m in range(size):
            for n in range(m + 1 if a == b else size):
                twice = a != b and unknown[a, m] == unknown[b, n]
                elements[slot[at]] += 2.0 * blocks[pair, m, n] if twice else blocks[pair, m, n]
                at += 1


@compile_kernel
def evaluate_corrections(interval, weights, factor, coefficients, out):
    """Correction of the height of each entry.

    coefficients : (interval, 4 k), offsets included; out : (entry,) [m]; others see above
    """
    for i in range(interval.size):
        total = 0.0
        if interval[i] >= 0:
            for k in range(factor.shape[1]):
                part = 0.0
                for n in range(4):
                    part += weights[i, n] * coefficients[interval[i], 4 * k + n]
                total += factor[i, k] * part
        out[i] = total


@compile_kernel
def cell_residuals(start, height, weight, residual, redundancy):
    """Residuals from the weighted mean of the cell, and redundancy numbers 1 - w / W.

    start, height, weight : see above; out: residual (entry,) [m], redundancy (entry,) [1]. Both are
    0 in cells without weight.
    """
    for c in range(start.size - 1):
        total, mean = 0.0, 0.0
        for i in range(start[c], start[c + 1]):
            total += weight[i]
            mean += weight[i] * height[i]
        for i in range(start[c], start[c + 1]):
            if total > 0.0:
                residual[i] = height[i] - mean / total
                redundancy[i] = 1.0 - weight[i] / total
            else:
                residual[i] = 0.0
                redundancy[i] = 0.0


@compile_kernel
def standardised_deviations(start, height, variance, usable, out):
    """Deviations from the median of the cell, over their standard deviations.

    The median of three and more is robust against one gross error. Two entries deviate equally from
    their weighted mean. Unusable entries get infinity.

    start, height : see above; variance : (entry,) [m²]; usable : (entry,) bool; out : (entry,) [1]
    """
    values, members = np.empty(64), np.empty(64, np.int64)
    for c in range(start.size - 1):
        if start[c + 1] - start[c] > values.size:
            values = np.empty(start[c + 1] - start[c])
            members = np.empty(start[c + 1] - start[c], np.int64)
        n, mean_variance = 0, 0.0
        for i in range(start[c], start[c + 1]):
            out[i] = math.inf
            if usable[i]:
                k = n
                while (
                    k > 0 and values[k - 1] > height[i]
                ):  # insertion sort: entries of a cell are few
                    values[k] = values[k - 1]
                    k -= 1
                values[k] = height[i]
                members[n] = i
                mean_variance += variance[i]
                n += 1
        if n == 2:
            i, j = members[0], members[1]
            deviation = (height[j] - height[i]) / math.sqrt(variance[i] + variance[j])
            out[i], out[j] = -deviation, deviation
        elif n:
            median = 0.5 * (values[(n - 1) // 2] + values[n // 2])
            for k in range(n):
                i = members[k]
                out[i] = (height[i] - median) / math.sqrt(variance[i] + mean_variance / (n * n))


@compile_kernel
def entry_pairs(start, one, two):
    """Pairs of the entries of each cell, in order.

    start : see above; out: one, two (pair of entries,)
    """
    found = 0
    for c in range(start.size - 1):
        for i in range(start[c], start[c + 1]):
            for j in range(i + 1, start[c + 1]):
                one[found], two[found] = i, j
                found += 1


@compile_kernel
def add_right(right, unknown, out):
    """Add right-hand sides of intervals (interval, 4 k) to those of the unknowns, (unknown,).

    unknown : (interval, 5 k); an offset gets the sum of its four coefficients.
    """
    size = right.shape[1]
    for a in range(right.shape[0]):
        for m in range(size):
            out[unknown[a, m]] += right[a, m]
            out[unknown[a, size + m // 4]] += right[a, m]


@compile_kernel
def cell_means(
    start, interval, weights, factor, weight, height, head, two, after, covariance, mean, variance
):
    """Weighted mean height of each cell, and its variance including that of the corrections.

    start, interval, weights, factor, weight, height, head, two, after : see above
    covariance : (pair, 4 k, 4 k) of the coefficients; out: mean (cell,) [m], variance (cell,) [m²]
    """
    components = factor.shape[1]
    size = 4 * components
    row = np.empty((64, size))
    for c in range(start.size - 1):
        begin, end = start[c], start[c + 1]
        if end - begin > row.shape[0]:
            row = np.empty((end - begin, size))
        total, first = 0.0, 0.0
        for i in range(begin, end):
            total += weight[i]
            first += weight[i] * height[i]
        if total == 0.0:
            mean[c], variance[c] = math.nan, math.nan
            continue
        for i in range(begin, end):
            for k in range(components):
                for n in range(4):
                    row[i - begin, 4 * k + n] = factor[i, k] * weights[i, n] * weight[i] / total
        correction_variance = 0.0
        for i in range(begin, end):
            if interval[i] < 0:
                continue
            for j in range(begin, i + 1):
                if interval[j] < 0:
                    continue
                one, other = i, j
                if interval[j] > interval[i]:
                    one, other = j, i
                at = head[interval[one]]
                while two[at] != interval[other]:
                    at = after[at]
                part = 0.0
                for m in range(size):
                    by = row[one - begin, m]
                    for n in range(size):
                        part += by * covariance[at, m, n] * row[other - begin, n]
                correction_variance += part if i == j else 2.0 * part
        mean[c], variance[c] = first / total, 1.0 / total + correction_variance
