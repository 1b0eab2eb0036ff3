"""Loops that sort returns and points into cells; all checks are made by the callers.

All sums are whole numbers, so they are the same for any order of the returns. Sums of squares may
pass the end of 64 bits and begin anew: what is wanted of them, the sum of squared deviations from a
mean, is small, and right modulo 2^64.
"""

import math

import numpy as np
from numba import njit

#: Whole numbers as which least and greatest heights are kept: 0 stands for none.
MIDDLE = 1 << 30


@njit(cache=True, nogil=True)
def _place(expansion, beam, ranges, scale, begin, end, where):
    """Places of the returns of one piece of a scan, axis by axis."""
    x1, x2 = beam[1, begin:end], beam[2, begin:end]
    s0, s1, s2 = beam[3, begin:end], beam[4, begin:end], beam[5, begin:end]
    c0, c1, c2 = beam[6, begin:end], beam[7, begin:end], beam[8, begin:end]
    raw = ranges[begin:end]
    for axis in range(3):
        # in variables of their own, so that the loop below is done with vectors
        p0, p1, p2 = expansion[axis, 0], expansion[axis, 1], expansion[axis, 2]
        f0, f1, f2 = expansion[axis, 3], expansion[axis, 4], expansion[axis, 5]
        g0, g1, g2 = expansion[axis, 6], expansion[axis, 7], expansion[axis, 8]
        to = where[axis, begin:end]
        for b in range(end - begin):
            ahead = f0 * s0[b] + f1 * s1[b] + f2 * s2[b]
            ahead += g0 * c0[b] + g1 * c1[b] + g2 * c2[b]
            to[b] = (p0 + p1 * x1[b] + p2 * x2[b]) + raw[b] * scale * ahead


@njit(cache=True, nogil=True)
def scans(
    begin, end, expansion, body, variance, first, beam, ranges, scale, missing, nearest, furthest,
    intensity, floor, saturation, good, doubtful,
    px, py, nx, ny, dx, dy, lean, widen, length, hint,
    v_right, per_across, columns, per_step, parts, furthest_height, variance_unit,
    touched, count, totals, squares, lows, highs, alongs, acrosses, pose, tally,
    first_cell, cursor, values,
):  # fmt: skip
    """Ranges of the scans begin to end into cells, without points in between.

    If there are `values`, heights of cells from `first_cell` on are put there, each cell's where
    its cursor is, and nothing is added up.

    The line has one node more at either end than the grid has rows. `hint` is a strip of it near
    each scan; what is found does not depend on it unless the line overlaps itself. `lean` is how
    far the cross-section at the begin of a strip runs ahead per metre of offset, `widen` how much
    longer the strip grows. `tally` counts returns that are good, doubtful, outside, too high.
    """
    pieces = first.size - 1
    beams = ranges.shape[1]
    where = np.empty((3, beams))
    x, y, z = where[0], where[1], where[2]
    last = length.size - 1
    used, doubted, outside, high = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    screened, extremes, places = intensity.size > 0, lows.size > 0, alongs.size > 0
    collect = values.size > 0
    rows = last  # nodes 1 to last are those of the grid
    for n in range(begin, end):
        for p in range(pieces):
            _place(expansion[n * pieces + p], beam, ranges[n], scale, first[p], first[p + 1], where)
        i = hint[n]
        if not collect:
            _add_pose(
                body[n * pieces + pieces // 2], variance[n * pieces + pieces // 2],
                px[i], py[i], nx[i], ny[i], variance_unit, pose[min(max(i - 1, 0), rows - 1)],
            )  # fmt: skip
        cell = np.int64(-1)
        w_sum, z_sum, z_square = np.int64(0), np.int64(0), np.int64(0)
        z_low, z_high = np.int64(0), np.int64(0)
        u_sum, v_sum = np.int64(0), np.int64(0)
        row = np.int64(-1)
        weight = good
        ax, ay, anx, any_ = px[i], py[i], nx[i], ny[i]
        bx, by, bnx, bny = px[i + 1], py[i + 1], nx[i + 1], ny[i + 1]
        ux, uy, le, wi, ll = dx[i], dy[i], lean[i], widen[i], length[i]
        for b in range(beams):
            raw = ranges[n, b]
            if raw == missing:
                continue
            r = raw * scale
            if not (r >= nearest and r <= furthest):  # NaN too
                continue
            if screened:
                weight = good
                if not (floor <= intensity[n, b] <= saturation):
                    doubted += 1
                    weight = doubtful
                    if weight == 0:
                        continue
            xb, yb, zb = x[b], y[b], z[b]
            if (xb - ax) * any_ - (yb - ay) * anx < 0.0 or (xb - bx) * bny - (yb - by) * bnx >= 0.0:
                while i > 0 and (xb - px[i]) * ny[i] - (yb - py[i]) * nx[i] < 0.0:
                    i -= 1
                while (
                    i < last and (xb - px[i + 1]) * ny[i + 1] - (yb - py[i + 1]) * nx[i + 1] >= 0.0
                ):
                    i += 1
                ax, ay, anx, any_ = px[i], py[i], nx[i], ny[i]
                bx, by, bnx, bny = px[i + 1], py[i + 1], nx[i + 1], ny[i + 1]
                ux, uy, le, wi, ll = dx[i], dy[i], lean[i], widen[i], length[i]
            ex, ey = xb - ax, yb - ay
            left = ey * ux - ex * uy
            t = (ex * ux + ey * uy - left * le) / (ll + left * wi)
            node = np.int64(i)
            if t >= 0.5:
                node += 1
                t -= 1.0
            at = (left - v_right) * per_across + 0.5
            # the ends of the longer line carry no cells
            if not (node >= 1 and node <= last and at >= 0.0 and at < columns and t >= -0.5):
                outside += 1
                continue
            if not (abs(zb) < furthest_height):
                high += 1
                continue
            column = np.int64(at)
            used += 1
            h = np.int64(math.floor(zb * per_step + 0.5))
            here = (node - 1) * columns + column
            if collect:
                place = here - first_cell
                if 0 <= place < cursor.size:
                    values[cursor[place]] = h
                    cursor[place] += 1
                continue
            if here != cell:
                if cell >= 0:
                    count[cell] += w_sum
                    totals[cell] += z_sum
                    squares[cell] += z_square
                    if extremes:
                        lows[cell] = max(lows[cell], MIDDLE - z_low)
                        highs[cell] = max(highs[cell], MIDDLE + z_high)
                    if places:
                        alongs[cell] += u_sum
                        acrosses[cell] += v_sum
                if row != node:
                    row = node
                    touched[row - 1] = True
                cell = here
                w_sum = z_sum = z_square = u_sum = v_sum = np.int64(0)
                z_low = z_high = h
            w_sum += weight
            z_sum += weight * h
            z_square += weight * h * h
            z_low = min(z_low, h)
            z_high = max(z_high, h)
            u_sum += weight * np.int64(math.floor(t * parts + 0.5))
            v_sum += weight * np.int64(math.floor((at - column - 0.5) * parts + 0.5))
        if cell >= 0:
            count[cell] += w_sum
            totals[cell] += z_sum
            squares[cell] += z_square
            if extremes:
                lows[cell] = max(lows[cell], MIDDLE - z_low)
                highs[cell] = max(highs[cell], MIDDLE + z_high)
            if places:
                alongs[cell] += u_sum
                acrosses[cell] += v_sum
    tally[0] += used
    tally[1] += doubted
    tally[2] += outside
    tally[3] += high


@njit(cache=True, nogil=True)
def _add_pose(at, c, px, py, nx, ny, unit, row):
    """Variance of a height at offset v from the pose, as a + b v + c v², into the sums of a row."""
    x0, x1 = py - at[1], ny
    y0, y1 = at[0] - px, -nx
    a = c[0] + 2.0 * (c[1] * x0 + c[2] * y0)
    a += c[3] * x0 * x0 + 2.0 * c[4] * x0 * y0 + c[5] * y0 * y0
    b = 2.0 * (c[1] * x1 + c[2] * y1)
    b += 2.0 * (c[3] * x0 * x1 + c[4] * (x0 * y1 + x1 * y0) + c[5] * y0 * y1)
    d = c[3] * x1 * x1 + 2.0 * c[4] * x1 * y1 + c[5] * y1 * y1
    row[0] += np.int64(math.floor(a / unit + 0.5))
    row[1] += np.int64(math.floor(b / unit + 0.5))
    row[2] += np.int64(math.floor(d / unit + 0.5))
    row[3] += np.int64(math.floor(c[6] / unit + 0.5))
    row[4] += 1


@njit(cache=True, nogil=True)
def points(
    begin, end, u, v, z, sd, first_u, per_along, rows, v_right, per_across, columns, per_step,
    parts, furthest_height, variance_unit, touched, count, totals, squares, lows, highs, alongs,
    acrosses, variances, tally, first_cell, cursor, values,
):  # fmt: skip
    """Points begin to end into cells, or their heights to `values`; NaN in u is outside."""
    collect = values.size > 0
    extremes, places, own = lows.size > 0, alongs.size > 0, variances.size > 0
    used, outside, high = 0, 0, 0
    for k in range(begin, end):
        ahead = (u[k] - first_u) * per_along + 0.5
        left = (v[k] - v_right) * per_across + 0.5
        if not (ahead >= 0.0 and ahead < rows and left >= 0.0 and left < columns):
            outside += 1
            continue
        if not (abs(z[k]) < furthest_height):
            high += 1
            continue
        row, column = np.int64(ahead), np.int64(left)
        h = np.int64(math.floor(z[k] * per_step + 0.5))
        cell = row * columns + column
        if collect:
            place = cell - first_cell
            if 0 <= place < cursor.size:
                values[cursor[place]] = h
                cursor[place] += 1
            continue
        count[cell] += 1
        totals[cell] += h
        squares[cell] += h * h
        if extremes:
            lows[cell] = max(lows[cell], MIDDLE - h)
            highs[cell] = max(highs[cell], MIDDLE + h)
        if places:
            alongs[cell] += np.int64(math.floor((ahead - row - 0.5) * parts + 0.5))
            acrosses[cell] += np.int64(math.floor((left - column - 0.5) * parts + 0.5))
        if own:
            variances[cell] += np.int64(math.floor(sd[k] * sd[k] / variance_unit + 0.5))
        touched[row] = True
        used += 1
    tally[0] += used
    tally[2] += outside
    tally[3] += high


@njit(cache=True, nogil=True)
def merge(count, totals, squares, lows, highs, alongs, acrosses, variances, touched, other):
    """Add the sums of another accumulator, row by row where it has any."""
    columns = count.size // touched.size
    for row in range(touched.size):
        if not other[8][row]:
            continue
        touched[row] = True
        for cell in range(row * columns, (row + 1) * columns):
            if other[0][cell] == 0:
                continue
            count[cell] += other[0][cell]
            totals[cell] += other[1][cell]
            squares[cell] += other[2][cell]
            if lows.size:
                lows[cell] = max(lows[cell], other[3][cell])
                highs[cell] = max(highs[cell], other[4][cell])
            if alongs.size:
                alongs[cell] += other[5][cell]
                acrosses[cell] += other[6][cell]
            if variances.size:
                variances[cell] += other[7][cell]


@njit(cache=True, nogil=True)
def moments(count, totals, squares, mean, deviation):
    """Mean of each cell in steps, and the sum of squared deviations from it; NaN where none is."""
    for cell in range(count.size):
        n = count[cell]
        if n == 0:
            mean[cell] = np.nan
            deviation[cell] = np.nan
            continue
        base = totals[cell] // n
        rest = totals[cell] - n * base
        # right modulo 2^64, and small
        around = squares[cell] - 2 * base * totals[cell] + n * base * base
        mean[cell] = base + rest / n
        deviation[cell] = max(around - rest * (rest / n), 0.0)


@njit(cache=True, nogil=True)
def _slope(before, here, after, steeper):
    """Mean of the steps to both sides, no steeper than so many times the gentler one."""
    a, b = here - before, after - here
    if math.isnan(a):
        a = b
    if math.isnan(b):
        b = a
    if not a * b > 0.0:  # NaN too
        return 0.0
    middle = 0.5 * (a + b)
    limit = steeper * min(abs(a), abs(b))
    return min(max(middle, -limit), limit)


@njit(cache=True, nogil=True)
def slopes(height, steeper, ahead, left):
    """Slopes per cell along both axes."""
    rows, columns = height.shape
    for i in range(rows):
        for j in range(columns):
            here = height[i, j]
            ahead[i, j] = _slope(
                height[i - 1, j] if i > 0 else math.nan, here,
                height[i + 1, j] if i < rows - 1 else math.nan, steeper,
            )  # fmt: skip
            left[i, j] = _slope(
                height[i, j - 1] if j > 0 else math.nan, here,
                height[i, j + 1] if j < columns - 1 else math.nan, steeper,
            )  # fmt: skip


@njit(cache=True, nogil=True)
def level(mean, count, alongs, acrosses, parts, ahead, left, height):
    """Means brought from the mean place of the returns to the nodes."""
    for i in range(mean.shape[0]):
        for j in range(mean.shape[1]):
            if count[i, j] == 0:
                height[i, j] = math.nan
                continue
            per = 1.0 / (parts * float(count[i, j]))
            height[i, j] = mean[i, j] - per * (
                ahead[i, j] * alongs[i, j] + left[i, j] * acrosses[i, j]
            )


@njit(cache=True, nogil=True)
def scatter(deviation, count, weight, between, ahead, left, levelled, total, free):
    """What is left of squared deviations without slope and passes, and its degrees of freedom."""
    for i in range(deviation.shape[0]):
        for j in range(deviation.shape[1]):
            n = count[i, j] / weight
            total[i, j] = 0.0
            free[i, j] = max(n - 1.0, 0.0)
            if n > 1.0:
                rest = deviation[i, j] / weight - between[i, j]
                if levelled:
                    rest -= (n - 1.0) * (ahead[i, j] ** 2 + left[i, j] ** 2) / 12.0
                total[i, j] = max(rest, 0.0)


@njit(cache=True, nogil=True)
def box(values, reach, row, out):
    """Sums over the cells around, added in an order of their own; `row` is room for one row."""
    rows, columns = values.shape
    for i in range(rows):
        for j in range(columns):
            row[j] = 0.0
        for k in range(max(i - reach, 0), min(i + reach + 1, rows)):
            for j in range(columns):
                row[j] += values[k, j]
        for j in range(columns):
            total = 0.0
            for k in range(max(j - reach, 0), min(j + reach + 1, columns)):
                total += row[k]
            out[i, j] = total


@njit(cache=True, nogil=True)
def quantiles(values, ends, share, out):
    """Quantile of the heights of each cell, between two of them by their shares; sorts them."""
    begin = 0
    for cell in range(ends.size):
        end = ends[cell]
        if end == begin:
            out[cell] = math.nan
            continue
        some = values[begin:end]
        some.sort()
        at = share * (end - begin - 1)
        low = int(at)
        high = min(low + 1, end - begin - 1)
        out[cell] = some[low] + (at - low) * (some[high] - some[low])
        begin = end


@njit(cache=True, nogil=True)
def search(
    mean, count, alongs, acrosses, parts, ahead, left, weight, levelled, found, n, effective,
    slope_ahead, slope_left,
):  # fmt: skip
    """Weighted means of the cells around each cell, on the plane that fits them if `levelled`."""
    rows, columns = mean.shape
    for i in range(rows):
        for j in range(columns):
            total = heights = squares = along = across = 0.0
            number = 0
            for k in range(ahead.size):
                a, b = i + ahead[k], j + left[k]
                if not (0 <= a < rows and 0 <= b < columns) or count[a, b] == 0:
                    continue
                c = float(count[a, b])
                w = weight[k] * c
                number += count[a, b]
                total += w
                squares += weight[k] * w
                heights += w * mean[a, b]
                along += w * ahead[k] + weight[k] * alongs[a, b] / parts
                across += w * left[k] + weight[k] * acrosses[a, b] / parts
            n[i, j] = number
            slope_ahead[i, j] = slope_left[i, j] = 0.0
            if number == 0:
                found[i, j] = math.nan
                effective[i, j] = 0.0
                continue
            middle, along, across = heights / total, along / total, across / total
            xx = xy = yy = xz = yz = 0.0
            for k in range(ahead.size):
                a, b = i + ahead[k], j + left[k]
                if not (0 <= a < rows and 0 <= b < columns) or count[a, b] == 0:
                    continue
                c = float(count[a, b])
                w = weight[k] * c
                x = ahead[k] + alongs[a, b] / (parts * c) - along
                y = left[k] + acrosses[a, b] / (parts * c) - across
                xx += w * x * x
                xy += w * x * y
                yy += w * y * y
                xz += w * x * (mean[a, b] - middle)
                yz += w * y * (mean[a, b] - middle)
            variance = squares / (total * total)
            determinant = xx * yy - xy * xy
            # a plane through cells that lie all but in a line would be none
            if determinant > 0.05 * xx * yy:
                p = (yy * xz - xy * yz) / determinant
                q = (xx * yz - xy * xz) / determinant
                slope_ahead[i, j], slope_left[i, j] = p, q
                if levelled:
                    middle -= p * along + q * across
                    reach = yy * along * along - 2.0 * xy * along * across + xx * across * across
                    variance *= 1.0 + total * reach / determinant
            found[i, j] = middle
            effective[i, j] = 1.0 / variance
