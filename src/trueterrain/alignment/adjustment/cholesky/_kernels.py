"""Loops over the columns of sparse matrices; all checks are made by the callers."""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def compress_pattern(row, column, size):
    """Compressed columns of the lower half of a symmetric matrix: pointers, rows, slots.

    row, column : (place,) places in either half, which may repeat; size : number of unknowns

    Returns pointers (size + 1,), rows (element,) ascending from the diagonal, which is always
    there, and the element of each place, slot (place,).
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
def symbolic_cholesky(pointers, rows):
    """Symbolic Cholesky factorisation: pattern of the factor (George and Liu 1981).

    A column has the rows of the matrix and those of its children in the elimination tree.

    pointers (n + 1,), rows (element,) : lower half of the matrix
    """
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
    """Numeric Cholesky factorisation, left-looking; returns the first column that fails, or -1.

    pointers (n + 1,), rows, values (element,) : lower half of the matrix, rows ascending
    begin (n + 1,), pattern (nonzero,) : pattern of the factor, ascending from the diagonal
    factor : (nonzero,) out
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
    """Solve L Lᵀ x = b in place.

    begin (n + 1,), pattern, factor (nonzero,) : Cholesky factor; x : (n,) right side, solution
    """
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
    """Elements of the inverse within the pattern of the factor (Takahashi et al. 1973).

    begin (n + 1,), pattern, factor (nonzero,) : Cholesky factor; inverse : (nonzero,) out
    """
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
