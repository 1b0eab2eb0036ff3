"""Loops that sort returns and points into cells; all checks are made by the callers.

All sums are integers, so they are the same for any order of the returns. Sums of squares may
overflow 64 bits: only the sum of squared deviations from a mean is computed from them, which is
small and therefore right modulo 2^64.
"""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel

#: Added to min and max heights, which are kept as positive integers: 0 stands for none.
HEIGHT_OFFSET = 1 << 30


@compile_kernel
def _place_returns(expansion, beam, ranges, scale, begin, end, where):
    """Coordinates of the returns of one piece of a scan, axis by axis.

    expansion : coefficients of position and direction over the beams, shape (3, 9)
    beam : powers and products of beam angle and delay, shape (9, beam)
    ranges : stored ranges, shape (beam,) [scale]
    scale : step of the ranges [m]
    begin, end : beams of the piece
    where : output, shape (3, beam) [m]
    """
    x1, x2 = beam[1, begin:end], beam[2, begin:end]
    s0, s1, s2 = beam[3, begin:end], beam[4, begin:end], beam[5, begin:end]
    c0, c1, c2 = beam[6, begin:end], beam[7, begin:end], beam[8, begin:end]
    raw = ranges[begin:end]
    for axis in range(3):
        # scalars, so that the compiler vectorises the loop below
        p0, p1, p2 = expansion[axis, 0], expansion[axis, 1], expansion[axis, 2]
        f0, f1, f2 = expansion[axis, 3], expansion[axis, 4], expansion[axis, 5]
        g0, g1, g2 = expansion[axis, 6], expansion[axis, 7], expansion[axis, 8]
        to = where[axis, begin:end]
        for b in range(end - begin):
            direction = f0 * s0[b] + f1 * s1[b] + f2 * s2[b]
            direction += g0 * c0[b] + g1 * c1[b] + g2 * c2[b]
            to[b] = (p0 + p1 * x1[b] + p2 * x2[b]) + raw[b] * scale * direction


@compile_kernel
def accumulate_scans(
    expansion, first, beam, returns, strips, hint, cells, sums, return_totals, reach, into
):
    """Sort the ranges of scans into cells.

    Cells exist for the rows from `first_row` on. If `values` is not empty, nothing is added: the
    heights of each cell from `first_cell` on are written there at the cursor of the cell.

    expansion : coefficients of position and direction, shape (scan * pieces, 3, 9)
    first : first beam of each piece, and the number of beams, shape (piece + 1,)
    beam : powers and products of beam angle and delay, shape (9, beam)
    returns : `RangeBlock`, of all scans
    strips : `GridStrips`; there is one node more at either end than the grid has rows
    hint : strip near each scan, shape (scan,). Results do not depend on it unless the line overlaps
        itself
    cells : `CellLayout`
    sums : `SumArrays`, output
    return_totals : output, returns that are used, flagged, outside, too high, shape (4,); scans
        whose reach was found before do not count
    reach : `RowsReached`, output
    into : `CollectedHeights`, output, see above
    """
    # unpacked once; the loops read them by the symbols of the formulas
    ranges, scale, missing, nearest, furthest, intensity, floor, saturation = returns[:8]
    good_weight, flagged_weight = returns.good_weight, returns.flagged_weight
    px, py, nx, ny, dx, dy, lean, widen, length = strips
    v_right, per_across, columns = cells.v_right, cells.per_across, cells.columns
    per_step, parts, furthest_height = cells.per_step, cells.parts, cells.furthest_height
    first_row = cells.first_row
    count, totals, squares, lows, highs, alongs, acrosses, _, touched = sums
    reach_low, reach_high, reach_found = reach
    first_cell, cursor, values = into
    pieces = first.size - 1
    beams = ranges.shape[1]
    where = np.empty((3, beams))
    x, y, z = where[0], where[1], where[2]
    last = length.size - 1
    used, flagged, outside, high = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    screened, extremes, places = intensity.size > 0, lows.size > 0, alongs.size > 0
    collect = values.size > 0
    noted = reach_found.size > 0
    rows = touched.size
    for n in range(hint.size):
        for p in range(pieces):
            _place_returns(
                expansion[n * pieces + p], beam, ranges[n], scale, first[p], first[p + 1], where
            )
        i = np.int64(hint[n])
        fresh = np.int64(1)
        if noted and reach_found[n]:
            fresh = np.int64(0)
        lowest, highest = np.int64(last), np.int64(-last)  # from the first row on
        cell = np.int64(-1)
        w_sum, z_sum, z_square = np.int64(0), np.int64(0), np.int64(0)
        z_low, z_high = np.int64(0), np.int64(0)
        u_sum, v_sum = np.int64(0), np.int64(0)
        row = np.int64(-1)
        weight = good_weight
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
                weight = good_weight
                if not (floor <= intensity[n, b] <= saturation):
                    flagged += fresh
                    weight = flagged_weight
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
                outside += fresh
                continue
            if not (abs(zb) < furthest_height):
                high += fresh
                continue
            column = np.int64(at)
            used += fresh
            node -= 1  # nodes 1 to last are rows of the grid
            node -= first_row
            if not (node >= 0 and node < rows):
                lowest, highest = min(lowest, node), max(highest, node)
                continue
            h = np.int64(math.floor(zb * per_step + 0.5))
            here = node * columns + column
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
                        lows[cell] = max(lows[cell], HEIGHT_OFFSET - z_low)
                        highs[cell] = max(highs[cell], HEIGHT_OFFSET + z_high)
                    if places:
                        alongs[cell] += u_sum
                        acrosses[cell] += v_sum
                if row != node:
                    row = node
                    touched[row] = True
                    lowest, highest = min(lowest, node), max(highest, node)
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
                lows[cell] = max(lows[cell], HEIGHT_OFFSET - z_low)
                highs[cell] = max(highs[cell], HEIGHT_OFFSET + z_high)
            if places:
                alongs[cell] += u_sum
                acrosses[cell] += v_sum
        if noted and not collect:
            reach_low[n], reach_high[n] = first_row + lowest, first_row + highest
            reach_found[n] = True
    return_totals[0] += used
    return_totals[1] += flagged
    return_totals[2] += outside
    return_totals[3] += high


@compile_kernel
def accumulate_points(u, v, z, sd, cells, sums, return_totals, into):
    """Sort points into cells; NaN in u is outside.

    u, v, z : coordinates, shape (point,) [m]
    sd : standard deviations of z, shape (point,) or (0,) [m]
    cells, sums, return_totals, into : as in `accumulate_scans`
    """
    first_u, per_along, rows, v_right, per_across, columns, first_row = cells[:7]
    per_step, parts, furthest_height, variance_unit = cells[7:]
    count, totals, squares, lows, highs, alongs, acrosses, variances, touched = sums
    first_cell, cursor, values = into
    collect = values.size > 0
    extremes, places, own = lows.size > 0, alongs.size > 0, variances.size > 0
    used, outside, high = 0, 0, 0
    for k in range(u.size):
        at_u = (u[k] - first_u) * per_along + 0.5
        at_v = (v[k] - v_right) * per_across + 0.5
        if not (at_u >= 0.0 and at_u < rows and at_v >= 0.0 and at_v < columns):
            outside += 1
            continue
        if not (abs(z[k]) < furthest_height):
            high += 1
            continue
        used += 1
        row, column = np.int64(at_u), np.int64(at_v)
        here = row - first_row
        if not (here >= 0 and here < touched.size):
            continue
        h = np.int64(math.floor(z[k] * per_step + 0.5))
        cell = here * columns + column
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
            lows[cell] = max(lows[cell], HEIGHT_OFFSET - h)
            highs[cell] = max(highs[cell], HEIGHT_OFFSET + h)
        if places:
            alongs[cell] += np.int64(math.floor((at_u - row - 0.5) * parts + 0.5))
            acrosses[cell] += np.int64(math.floor((at_v - column - 0.5) * parts + 0.5))
        if own:
            variances[cell] += np.int64(math.floor(sd[k] * sd[k] / variance_unit + 0.5))
        touched[here] = True
    return_totals[0] += used
    return_totals[2] += outside
    return_totals[3] += high


@compile_kernel
def merge_sums(sums, other):
    """Add the sums of another thread, row by row where it has any, and set those to zero."""
    columns = sums.count.size // sums.touched.size
    for row in range(sums.touched.size):
        if not other.touched[row]:
            continue
        sums.touched[row] = True
        begin, end = row * columns, (row + 1) * columns
        for cell in range(begin, end):
            sums.count[cell] += other.count[cell]
            sums.totals[cell] += other.totals[cell]
            sums.squares[cell] += other.squares[cell]
        if sums.lows.size:
            for cell in range(begin, end):
                sums.lows[cell] = max(sums.lows[cell], other.lows[cell])
                sums.highs[cell] = max(sums.highs[cell], other.highs[cell])
        if sums.alongs.size:
            for cell in range(begin, end):
                sums.alongs[cell] += other.alongs[cell]
                sums.acrosses[cell] += other.acrosses[cell]
        if sums.variances.size:
            for cell in range(begin, end):
                sums.variances[cell] += other.variances[cell]
        _clear_row(row, columns, other)


@compile_kernel
def clear_sums(sums):
    """Set the sums of a thread to zero, row by row where it has any."""
    columns = sums.count.size // sums.touched.size
    for row in range(sums.touched.size):
        if sums.touched[row]:
            _clear_row(row, columns, sums)


@compile_kernel
def _clear_row(row, columns, sums):
    begin, end = row * columns, (row + 1) * columns
    sums.count[begin:end] = 0
    sums.totals[begin:end] = 0
    sums.squares[begin:end] = 0
    if sums.lows.size:
        sums.lows[begin:end] = 0
        sums.highs[begin:end] = 0
    if sums.alongs.size:
        sums.alongs[begin:end] = 0
        sums.acrosses[begin:end] = 0
    if sums.variances.size:
        sums.variances[begin:end] = 0
    sums.touched[row] = False


@compile_kernel
def cell_quantiles(values, ends, fraction, out):
    """Quantile of the heights of each cell, linear between two of them.

    values : heights, cell by cell, sorted in place, shape (return,) [step]
    ends : end of each cell in `values`, shape (cell,)
    fraction : of the heights below the quantile [1]
    out : output, shape (cell,) [step]; NaN in empty cells
    """
    begin = 0
    for cell in range(ends.size):
        end = ends[cell]
        if end == begin:
            out[cell] = math.nan
            continue
        some = values[begin:end]
        some.sort()
        at = fraction * (end - begin - 1)
        low = int(at)
        high = min(low + 1, end - begin - 1)
        out[cell] = some[low] + (at - low) * (some[high] - some[low])
        begin = end
