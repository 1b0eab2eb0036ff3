"""Loops over cells and sparse columns; all checks are made by the callers.

A cell is a run of *entries*, what the passes saw of it. The correction of a pass is a cubic
B-spline: in an *interval* between two knots four of its coefficients count. With several components
(height, roll, ...) an interval has ``4 k`` unknowns, the four of the first component first. A
*pair* is two intervals, the one with the greater number first, that see a cell in common.
"""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def spline_basis(time, begin, spacing, intervals, first, interval, weights):
    """Interval of each time, and the weights of its four coefficients."""
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
    """Pairs of intervals that cells have in common, as lists: head, next, first and second."""
    head = np.full(intervals, -1, np.int64)
    room = 4 * intervals + 16
    after, one, two = np.empty(room, np.int64), np.empty(room, np.int64), np.empty(room, np.int64)
    used = 0
    for k in range(intervals):  # each with itself, whether a cell is there or not
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
                if used == room:
                    room *= 2
                    after = np.concatenate((after, np.empty(used, np.int64)))
                    one = np.concatenate((one, np.empty(used, np.int64)))
                    two = np.concatenate((two, np.empty(used, np.int64)))
                # behind the pair with itself, which is asked for most
                after[used], one[used], two[used] = after[head[a]], a, b
                after[head[a]] = used
                used += 1
    return head, after[:used].copy(), one[:used].copy(), two[:used].copy()


@compile_kernel
def assemble_normal_equations(
    start, use, interval, weights, factor, weight, height, head, after, two, blocks, right
):
    """Normal equations of the cells to use, their own heights eliminated.

    Adds to the ``blocks`` (pair, 4 k, 4 k) and to the ``right`` sides (interval, 4 k); returns the
    weighted sum of squared differences from the means of the cells, and how many were free.
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
        total, mean, there = 0.0, 0.0, 0
        for i in range(begin, end):
            total += weight[i]
            mean += weight[i] * height[i]
            there += weight[i] > 0.0
            for k in range(components):
                for n in range(4):
                    row[i - begin, 4 * k + n] = factor[i, k] * weights[i, n]
        if there < 2:
            continue
        mean /= total
        degrees_of_freedom += there - 1
        for i in range(begin, end):
            if weight[i] == 0.0:
                continue
            left = weight[i] * (height[i] - mean)
            square += left * (height[i] - mean)
            if interval[i] < 0:
                continue
            for m in range(size):
                right[interval[i], m] -= row[i - begin, m] * left
            for j in range(begin, i + 1):
                if interval[j] < 0 or weight[j] == 0.0:
                    continue
                shared = -weight[i] * weight[j] / total
                if i == j:
                    shared += weight[i]
                one, other = i, j
                if interval[j] > interval[i]:
                    one, other = j, i
                at = head[interval[one]]
                while two[at] != interval[other]:
                    at = after[at]
                twice = i != j and interval[i] == interval[j]
                for m in range(size):
                    by = shared * row[one - begin, m]
                    for n in range(size):
                        blocks[at, m, n] += by * row[other - begin, n]
                    if twice:
                        by = shared * row[other - begin, m]
                        for n in range(size):
                            blocks[at, m, n] += by * row[one - begin, n]
    return square, degrees_of_freedom


@compile_kernel
def scatter_blocks(blocks, one, two, unknown, slot, elements):
    """Add blocks of pairs to the elements of a matrix, offsets with them; `slot` is their place.

    An offset adds to all four coefficients of its component. Of the block of an interval with
    itself only the lower half counts; one of two intervals stands for its transpose as well.
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
    """Add blocks of pairs to the elements of a matrix that has no offsets."""
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
    """Correction at each entry; coefficients are (interval, 4 k), offsets included."""
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
def cell_residuals(start, height, weight, out, share):
    """Heights less the weighted mean of their cell, and 1 less the share of each in that mean.

    Both are 0 where nothing weighs anything.
    """
    for c in range(start.size - 1):
        total, mean = 0.0, 0.0
        for i in range(start[c], start[c + 1]):
            total += weight[i]
            mean += weight[i] * height[i]
        for i in range(start[c], start[c + 1]):
            if total > 0.0:
                out[i] = height[i] - mean / total
                share[i] = 1.0 - weight[i] / total
            else:
                out[i] = 0.0
                share[i] = 0.0


@compile_kernel
def standardised_deviations(start, height, variance, usable, out):
    """Heights less the middle height of their cell, over their standard deviations.

    The middle one of many is not led astray by one that is wrong; two are equally far from their
    mean, weighted by their variances. What is not usable is infinitely far away.
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
                while k > 0 and values[k - 1] > height[i]:  # sorted as they come, they are few
                    values[k] = values[k - 1]
                    k -= 1
                values[k] = height[i]
                members[n] = i
                mean_variance += variance[i]
                n += 1
        if n == 2:
            i, j = members[0], members[1]
            away = (height[j] - height[i]) / math.sqrt(variance[i] + variance[j])
            out[i], out[j] = -away, away
        elif n:
            middle = 0.5 * (values[(n - 1) // 2] + values[n // 2])
            for k in range(n):
                i = members[k]
                out[i] = (height[i] - middle) / math.sqrt(variance[i] + mean_variance / (n * n))


@compile_kernel
def entry_pairs(start, one, two):
    """Pairs of the entries of each cell."""
    found = 0
    for c in range(start.size - 1):
        for i in range(start[c], start[c + 1]):
            for j in range(i + 1, start[c + 1]):
                one[found], two[found] = i, j
                found += 1


@compile_kernel
def compress_pattern(row, column, size):
    """Pattern of the lower half of a matrix: pointers, rows, and the element of each place.

    Places are in either half and may be there several times; the diagonal is there everywhere.
    """
    begin = np.zeros(size + 1, np.int64)
    for k in range(row.size):
        begin[min(row[k], column[k]) + 1] += 1
    longest = 0
    for j in range(size):
        longest = max(longest, begin[j + 1])
        begin[j + 1] += begin[j]
    places = np.empty(row.size, np.int64)
    cursor = begin[:-1].copy()
    for k in range(row.size):
        j = min(row[k], column[k])
        places[cursor[j]] = k
        cursor[j] += 1
    pointers, slot = np.zeros(size + 1, np.int64), np.empty(row.size, np.int64)
    rows = np.empty(row.size + size, np.int64)
    mark, seen = np.full(size, -1, np.int64), np.empty(longest + 1, np.int64)
    where = np.empty(size, np.int64)
    used = 0
    for j in range(size):
        n = 1
        seen[0], mark[j] = j, j
        for at in range(begin[j], begin[j + 1]):
            i = max(row[places[at]], column[places[at]])
            if mark[i] != j:
                mark[i] = j
                seen[n] = i
                n += 1
        seen[:n].sort()
        for k in range(n):
            where[seen[k]] = used
            rows[used] = seen[k]
            used += 1
        for at in range(begin[j], begin[j + 1]):
            slot[places[at]] = where[max(row[places[at]], column[places[at]])]
        pointers[j + 1] = used
    return pointers, rows[:used].copy(), slot


@compile_kernel
def add_right(right, unknown, out):
    """Right sides of intervals to those of the unknowns, offsets with them."""
    size = right.shape[1]
    for a in range(right.shape[0]):
        for m in range(size):
            out[unknown[a, m]] += right[a, m]
            out[unknown[a, size + m // 4]] += right[a, m]


@compile_kernel
def symbolic_cholesky(pointers, rows):
    """Pattern of the Cholesky factor of a symmetric matrix, of which the lower half is given."""
    n = pointers.size - 1
    parent = np.full(n, -1, np.int64)
    child, sibling = np.full(n, -1, np.int64), np.full(n, -1, np.int64)
    mark = np.full(n, -1, np.int64)
    out = np.empty(max(4 * rows.size, 16), np.int64)
    begin = np.zeros(n + 1, np.int64)
    used = 0
    for j in range(n):
        if used + n - j > out.size:
            out = np.concatenate((out, np.empty(out.size + n, np.int64)))
        first = used
        out[used] = j
        used += 1
        mark[j] = j
        for at in range(pointers[j], pointers[j + 1]):
            if mark[rows[at]] != j:
                mark[rows[at]] = j
                out[used] = rows[at]
                used += 1
        k = child[j]
        while k >= 0:
            for at in range(begin[k] + 1, begin[k + 1]):
                if mark[out[at]] != j:
                    mark[out[at]] = j
                    out[used] = out[at]
                    used += 1
            k = sibling[k]
        out[first:used].sort()
        begin[j + 1] = used
        if used > first + 1:
            parent[j] = out[first + 1]
            sibling[j] = child[parent[j]]
            child[parent[j]] = j
    return begin, out[:used].copy()


@compile_kernel
def factorise_cholesky(pointers, rows, values, begin, pattern, factor):
    """Cholesky factor, column by column from those to its left; the first column that fails, or -1.

    ``rows`` of each column ascend and begin with the diagonal, as those of the pattern do.
    """
    n = pointers.size - 1
    work = np.zeros(n)
    waiting, after = np.full(n, -1, np.int64), np.full(n, -1, np.int64)
    place = np.empty(n, np.int64)
    for j in range(n):
        for at in range(pointers[j], pointers[j + 1]):
            work[rows[at]] = values[at]
        k = waiting[j]
        while k >= 0:
            following = after[k]
            here = place[k]
            by = factor[here]
            for at in range(here, begin[k + 1]):
                work[pattern[at]] -= by * factor[at]
            if here + 1 < begin[k + 1]:
                place[k] = here + 1
                to = pattern[here + 1]
                after[k] = waiting[to]
                waiting[to] = k
            k = following
        pivot = work[j]
        if not pivot > 0.0:
            return j
        root = math.sqrt(pivot)
        for at in range(begin[j], begin[j + 1]):
            factor[at] = work[pattern[at]] / root
            work[pattern[at]] = 0.0
        if begin[j] + 1 < begin[j + 1]:
            place[j] = begin[j] + 1
            to = pattern[begin[j] + 1]
            after[j] = waiting[to]
            waiting[to] = j
    return -1


@compile_kernel
def solve_cholesky(begin, pattern, factor, x):
    """Solve with the factor and its transpose, in place."""
    n = begin.size - 1
    for j in range(n):
        x[j] /= factor[begin[j]]
        for at in range(begin[j] + 1, begin[j + 1]):
            x[pattern[at]] -= factor[at] * x[j]
    for j in range(n - 1, -1, -1):
        total = x[j]
        for at in range(begin[j] + 1, begin[j + 1]):
            total -= factor[at] * x[pattern[at]]
        x[j] = total / factor[begin[j]]


@compile_kernel
def selected_inverse(begin, pattern, factor, inverse):
    """Those elements of the inverse that lie in the pattern of the factor (Takahashi et al.)."""
    n = begin.size - 1
    place = np.full(n, -1, np.int64)
    total = np.empty(n)
    for j in range(n - 1, -1, -1):
        first, end = begin[j], begin[j + 1]
        diagonal = factor[first]
        for at in range(first + 1, end):
            place[pattern[at]] = at
            total[at - first] = 0.0
        for at in range(first + 1, end):
            k = pattern[at]
            by = factor[at]
            for to in range(begin[k], begin[k + 1]):
                where = place[pattern[to]]
                if where >= 0:
                    total[where - first] += inverse[to] * by
                    if where != at:
                        total[at - first] += inverse[to] * factor[where]
        own = 1.0 / diagonal
        for at in range(first + 1, end):
            inverse[at] = -total[at - first] / diagonal
            own -= inverse[at] * factor[at]
            place[pattern[at]] = -1
        inverse[first] = own / diagonal


@compile_kernel
def add_points(x, y, z, t, size, per_step, per_time, parts, bin_length, keys, sums, table, used):
    """Points into cells, by a table of their keys; stops before the table is too full.

    A key is the cell and the stretch of time; ``table`` holds its number or -1, ``sums`` count, x,
    y, z, t, xx, xy, yy, xz, yz, zz, least and greatest t. Sums are whole numbers and may wrap.
    Returns how many points were added and how many keys there are.
    """
    mask = np.int64(table.size - 1)
    most = min(table.size // 2, keys.shape[0])
    last_cell, last_bin, last = np.int64(-1), np.int64(-1), np.int64(-1)
    for i in range(x.size):
        column, row = math.floor(x[i] / size), math.floor(y[i] / size)
        cell = (np.int64(column) << 32) + np.int64(row)
        when = np.int64(math.floor(t[i] / bin_length))
        if cell != last_cell or when != last_bin or last < 0:
            mixed = (cell ^ (cell >> 29)) * np.int64(0x5851F42D4C957F2D)
            mixed = (mixed ^ (mixed >> 32) ^ when) * np.int64(0x14057B7EF767814F)
            at = (mixed ^ (mixed >> 31)) & mask
            while table[at] >= 0 and (keys[table[at], 0] != cell or keys[table[at], 1] != when):
                at = (at + 1) & mask
            if table[at] < 0:
                if used >= most:
                    return i, used
                table[at] = used
                keys[used, 0], keys[used, 1] = cell, when
                sums[used, 11], sums[used, 12] = np.int64(1) << 62, -(np.int64(1) << 62)
                used += 1
            last_cell, last_bin, last = cell, when, table[at]
        px = np.int64(math.floor((x[i] / size - column - 0.5) * parts + 0.5))
        py = np.int64(math.floor((y[i] / size - row - 0.5) * parts + 0.5))
        pz = np.int64(math.floor(z[i] * per_step + 0.5))
        pt = np.int64(math.floor(t[i] * per_time + 0.5))
        sums[last, 0] += 1
        sums[last, 1] += px
        sums[last, 2] += py
        sums[last, 3] += pz
        sums[last, 4] += pt
        sums[last, 5] += px * px
        sums[last, 6] += px * py
        sums[last, 7] += py * py
        sums[last, 8] += px * pz
        sums[last, 9] += py * pz
        sums[last, 10] += pz * pz
        sums[last, 11] = min(sums[last, 11], pt)
        sums[last, 12] = max(sums[last, 12], pt)
    return x.size, used


@compile_kernel
def rehash_keys(keys, used, table):
    """Fill an empty table with the keys that there are."""
    mask = np.int64(table.size - 1)
    for k in range(used):
        cell, when = keys[k, 0], keys[k, 1]
        mixed = (cell ^ (cell >> 29)) * np.int64(0x5851F42D4C957F2D)
        mixed = (mixed ^ (mixed >> 32) ^ when) * np.int64(0x14057B7EF767814F)
        at = (mixed ^ (mixed >> 31)) & mask
        while table[at] >= 0:
            at = (at + 1) & mask
        table[at] = k


@compile_kernel
def join_visits(keys, sums, gap):
    """Add sums of a cell that follow each other within a gap of time; returns how many are left.

    Keys are sorted by cell, then by time.
    """
    left = 0
    for k in range(keys.shape[0]):
        joins = left > 0 and keys[k, 0] == keys[left - 1, 0]
        if joins and sums[k, 11] - sums[left - 1, 12] <= gap:
            for n in range(11):
                sums[left - 1, n] += sums[k, n]
            sums[left - 1, 12] = sums[k, 12]
        else:
            keys[left] = keys[k]
            sums[left] = sums[k]
            left += 1
    return left


@compile_kernel
def cell_means(
    start, interval, weights, factor, weight, height, head, two, after, covariance, mean, variance
):
    """Weighted mean height of each cell and its variance, that of the corrections included."""
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
        spread = 0.0
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
                spread += part if i == j else 2.0 * part
        mean[c], variance[c] = first / total, 1.0 / total + spread
