"""Loops over the cells of some rows; all checks are made by the callers."""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel

#: Cells to either side whose scatter is pooled.
REACH = 2


@compile_kernel(error_model="numpy")
def cell_moments(count, totals, squares, step, mean, deviation):
    """Mean of each cell, and the sum of squared deviations from it; NaN where none is."""
    for i in range(count.shape[0]):
        for j in range(count.shape[1]):
            n = np.int64(count[i, j])
            if n == 0:
                mean[i, j] = math.nan
                deviation[i, j] = math.nan
                continue
            total = totals[i, j]
            # the whole number below the mean; to divide whole numbers would take longer
            base = np.int64(math.floor(total / n))
            rest = total - n * base
            if rest < 0:
                base -= 1
                rest += n
            elif rest >= n:
                base += 1
                rest -= n
            # right modulo 2^64, and small
            around = squares[i, j] - 2 * base * total + n * base * base
            mean[i, j] = (base + rest / n) * step
            deviation[i, j] = max(around - rest * (rest / n), 0.0) * (step * step)


@compile_kernel(error_model="numpy")
def _limited_slope(before, here, after, steeper):
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


@compile_kernel(error_model="numpy")
def cell_slopes(height, steeper, ahead, left):
    """Slopes per cell along both axes."""
    rows, columns = height.shape
    for i in range(rows):
        for j in range(columns):
            here = height[i, j]
            ahead[i, j] = _limited_slope(
                height[i - 1, j] if i > 0 else math.nan,
                here,
                height[i + 1, j] if i < rows - 1 else math.nan,
                steeper,
            )
            left[i, j] = _limited_slope(
                height[i, j - 1] if j > 0 else math.nan,
                here,
                height[i, j + 1] if j < columns - 1 else math.nan,
                steeper,
            )


@compile_kernel(error_model="numpy")
def level_means(mean, count, alongs, acrosses, parts, ahead, left, height):
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


@compile_kernel(error_model="numpy")
def cell_scatter(deviation, count, weight, between, ahead, left, levelled, total, free):
    """What is left of squared deviations without slope and passes, and its degrees of freedom."""
    passes = between.size > 0
    for i in range(deviation.shape[0]):
        for j in range(deviation.shape[1]):
            n = count[i, j] / weight
            total[i, j] = 0.0
            free[i, j] = max(n - 1.0, 0.0)
            if n > 1.0:
                rest = deviation[i, j] / weight
                if passes:
                    rest -= between[i, j]
                if levelled:
                    rest -= (n - 1.0) * (ahead[i, j] ** 2 + left[i, j] ** 2) / 12.0
                total[i, j] = max(rest, 0.0)


@compile_kernel(error_model="numpy")
def box_sums(values, row, out):
    """Sums over the cells around, `REACH` to either side, added in an order of their own.

    `row` is room for one row and the reach to both sides, where nothing is added.
    """
    rows, columns = values.shape
    row[:] = 0.0
    for i in range(rows):
        row[REACH : REACH + columns] = 0.0
        for k in range(max(i - REACH, 0), min(i + REACH + 1, rows)):
            for j in range(columns):
                row[REACH + j] += values[k, j]
        for j in range(columns):
            total = 0.0
            for k in range(2 * REACH + 1):
                total += row[k + j]
            out[i, j] = total


@compile_kernel(error_model="numpy")
def pool_variance(total, free, least, single):
    """Variance of a single return, not less than `least`; NaN if neither tells it."""
    for i in range(total.shape[0]):
        for j in range(total.shape[1]):
            found = least if least > 0.0 else math.nan
            if free[i, j] > 0.0:
                found = max(total[i, j] / free[i, j], least)
            single[i, j] = found


@compile_kernel(error_model="numpy")
def finish_rows(
    value,
    single,
    n,
    effective,
    pose,
    ahead,
    left,
    sideways,
    along,
    across,
    spread,
    least,
    first,
    height,
    sd,
    count,
):
    """Heights, standard deviations and counts of the rows from `first` on."""
    for i in range(height.shape[0]):
        k = first + i
        for j in range(height.shape[1]):
            count[i, j] = np.int32(math.ceil(n[k, j]))
            if n[k, j] < least:
                height[i, j] = math.nan
                sd[i, j] = math.nan
                continue
            from_pose = pose[k, j]
            if sideways > 0.0:
                slope = (ahead[k, j] / along) ** 2 + (left[k, j] / across) ** 2
                from_pose += sideways * slope
            height[i, j] = value[k, j]
            sd[i, j] = math.sqrt(spread * single[k, j] / effective[k, j] + from_pose)


@compile_kernel(error_model="numpy")
def search_disc(
    mean,
    count,
    alongs,
    acrosses,
    parts,
    ahead,
    left,
    weight,
    levelled,
    found,
    n,
    effective,
    slope_ahead,
    slope_left,
):
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
