"""Loops from the sums of cells to heights and standard deviations; callers check the arguments."""

import math

import numpy as np

from trueterrain.core.kernels import compile_kernel

#: Cells to either side whose scatter is pooled.
REACH = 2


@compile_kernel(error_model="numpy")
def cell_moments(count, totals, squares, step, mean, deviation):
    """Mean of each cell, and the sum of squared deviations from it; NaN in empty cells.

    count : weighted number of returns, shape (row, column)
    totals, squares : sums of heights and of their squares, shape (row, column) [step, step²]
    step : step of the heights [m]
    mean, deviation : output, shape (row, column) [m, m²]
    """
    for i in range(count.shape[0]):
        for j in range(count.shape[1]):
            n = np.int64(count[i, j])
            if n == 0:
                mean[i, j] = math.nan
                deviation[i, j] = math.nan
                continue
            total = totals[i, j]
            # integer part of the mean by floating point, which is faster than integer division;
            # the lines below correct it if rounding put it one too high or too low
            base = np.int64(math.floor(total / n))
            rest = total - n * base
            if rest < 0:
                base -= 1
                rest += n
            elif rest >= n:
                base += 1
                rest -= n
            # sum of (h - base)²: sums of squares may overflow, but this is right modulo 2^64, and
            # it is small
            around = squares[i, j] - 2 * base * total + n * base * base
            mean[i, j] = (base + rest / n) * step
            deviation[i, j] = max(around - rest * (rest / n), 0.0) * (step * step)


@compile_kernel(error_model="numpy")
def _limited_slope(before, here, after, ratio):
    """Mean of the steps to both sides, at most `ratio` times the gentler of them."""
    a, b = here - before, after - here
    if math.isnan(a):
        a = b
    if math.isnan(b):
        b = a
    if not a * b > 0.0:  # NaN too
        return 0.0
    mean = 0.5 * (a + b)
    limit = ratio * min(abs(a), abs(b))
    return min(max(mean, -limit), limit)


@compile_kernel(error_model="numpy")
def cell_slopes(height, ratio, slope_u, slope_v):
    """Slopes along both axes.

    height : shape (row, column) [m]; NaN where there is none
    ratio : slope limit: times the gentler of the steps to both sides [1]
    slope_u, slope_v : output, shape (row, column) [m per cell]
    """
    rows, columns = height.shape
    for i in range(rows):
        for j in range(columns):
            here = height[i, j]
            slope_u[i, j] = _limited_slope(
                height[i - 1, j] if i > 0 else math.nan,
                here,
                height[i + 1, j] if i < rows - 1 else math.nan,
                ratio,
            )
            slope_v[i, j] = _limited_slope(
                height[i, j - 1] if j > 0 else math.nan,
                here,
                height[i, j + 1] if j < columns - 1 else math.nan,
                ratio,
            )


@compile_kernel(error_model="numpy")
def level_means(mean, count, alongs, acrosses, parts, slope_u, slope_v, height):
    """Means reduced along the slope from the mean position of the returns to the nodes.

    mean : shape (row, column) [m]
    count : weighted number of returns, shape (row, column)
    alongs, acrosses : sums of positions in the cell, from the node, shape (row, column)
        [1/parts of a cell]
    parts : parts of a cell [1]
    slope_u, slope_v : shape (row, column) [m per cell]
    height : output, shape (row, column) [m]
    """
    for i in range(mean.shape[0]):
        for j in range(mean.shape[1]):
            if count[i, j] == 0:
                height[i, j] = math.nan
                continue
            per = 1.0 / (parts * float(count[i, j]))
            height[i, j] = mean[i, j] - per * (
                slope_u[i, j] * alongs[i, j] + slope_v[i, j] * acrosses[i, j]
            )


@compile_kernel(error_model="numpy")
def cell_scatter(
    deviation, count, weight, between, slope_u, slope_v, levelled, total, degrees_of_freedom
):
    """Squared deviations less those by slope and passes, and their degrees of freedom.

    deviation : sum of squared deviations, weighted, shape (row, column) [m²]
    count : weighted number of returns, shape (row, column)
    weight : weight of a good return
    between : part of the deviations by differences of passes, shape (row, column) or (0, 0) [m²]
    slope_u, slope_v : shape (row, column) [m per cell]
    levelled : whether deviations by the slope are removed
    total, degrees_of_freedom : output, shape (row, column) [m², 1]
    """
    passes = between.size > 0
    for i in range(deviation.shape[0]):
        for j in range(deviation.shape[1]):
            n = count[i, j] / weight
            total[i, j] = 0.0
            degrees_of_freedom[i, j] = max(n - 1.0, 0.0)
            if n > 1.0:
                rest = deviation[i, j] / weight
                if passes:
                    rest -= between[i, j]
                if levelled:
                    # variance of a uniform position in the cell is 1/12 of its size squared
                    rest -= (n - 1.0) * (slope_u[i, j] ** 2 + slope_v[i, j] ** 2) / 12.0
                total[i, j] = max(rest, 0.0)


@compile_kernel(error_model="numpy")
def box_sums(values, row, out):
    """Sums over 5 x 5 cells, `REACH` to either side.

    The order of the additions is fixed by the cell, so the sums do not depend on the window.

    values : shape (row, column)
    row : buffer, shape (column + 2 REACH,)
    out : output, shape (row, column)
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
def pool_variance(total, degrees_of_freedom, min_variance, single):
    """Variance of a single return, at least `min_variance`; NaN if both are unknown.

    total : sums of squared deviations, shape (row, column) [m²]
    degrees_of_freedom : shape (row, column)
    min_variance : variance of the range noise, 0 if it is not known [m²]
    single : output, shape (row, column) [m²]
    """
    for i in range(total.shape[0]):
        for j in range(total.shape[1]):
            found = min_variance if min_variance > 0.0 else math.nan
            if degrees_of_freedom[i, j] > 0.0:
                found = max(total[i, j] / degrees_of_freedom[i, j], min_variance)
            single[i, j] = found


@compile_kernel(error_model="numpy")
def store_rows(
    value,
    single,
    n,
    effective,
    pose,
    slope_u,
    slope_v,
    horizontal_variance,
    spacing_u,
    spacing_v,
    variance_factor,
    min_count,
    first,
    height,
    sd,
    count,
):
    """Heights, standard deviations and counts of the rows from `first` on.

    The variance of a height is that of a return over the effective count, plus that of the pose,
    plus that of the horizontal position times the slope squared (propagation of errors).

    value : heights, shape (row, column) [m]
    single : variance of a return, shape (row, column) [m²]
    n, effective : number of returns, and of independent returns of equal weight
    pose : variance by the pose, shape (row, column) [m²]
    slope_u, slope_v : shape (row, column) [m per cell]
    horizontal_variance : of the pose [m²]
    spacing_u, spacing_v : size of a cell [m]
    variance_factor : variance of the statistic over that of a mean [1]
    min_count : returns that a height needs
    first : row of `value` that is the first row of the output
    height, sd, count : output, shape (rows, column) [m, m, 1]
    """
    for i in range(height.shape[0]):
        k = first + i
        for j in range(height.shape[1]):
            count[i, j] = np.int32(math.ceil(n[k, j]))
            if n[k, j] < min_count:
                height[i, j] = math.nan
                sd[i, j] = math.nan
                continue
            from_pose = pose[k, j]
            if horizontal_variance > 0.0:
                slope = (slope_u[k, j] / spacing_u) ** 2 + (slope_v[k, j] / spacing_v) ** 2
                from_pose += horizontal_variance * slope
            height[i, j] = value[k, j]
            sd[i, j] = math.sqrt(variance_factor * single[k, j] / effective[k, j] + from_pose)


@compile_kernel(error_model="numpy")
def search_disc(
    mean,
    count,
    alongs,
    acrosses,
    parts,
    step_u,
    step_v,
    weight,
    levelled,
    found,
    n,
    effective,
    slope_u,
    slope_v,
):
    """Weighted means over a disc around each node, on the fitted plane if `levelled`.

    mean : shape (row, column) [m]
    count : weighted number of returns, shape (row, column)
    alongs, acrosses : sums of positions in the cell, shape (row, column) [1/parts of a cell]
    parts : parts of a cell [1]
    step_u, step_v : cells of the disc from its centre, shape (cell,)
    weight : weights of their returns, shape (cell,) [1]
    levelled : whether the value is that of the fitted plane at the node
    found : output, heights, shape (row, column) [m]
    n, effective : output, number of returns, and of independent returns of equal weight
    slope_u, slope_v : output, slopes of the plane, shape (row, column) [m per cell]
    """
    rows, columns = mean.shape
    for i in range(rows):
        for j in range(columns):
            total = heights = squares = along = across = 0.0
            number = 0
            for k in range(step_u.size):
                a, b = i + step_u[k], j + step_v[k]
                if not (0 <= a < rows and 0 <= b < columns) or count[a, b] == 0:
                    continue
                c = float(count[a, b])
                w = weight[k] * c
                number += count[a, b]
                total += w
                squares += weight[k] * w
                heights += w * mean[a, b]
                along += w * step_u[k] + weight[k] * alongs[a, b] / parts
                across += w * step_v[k] + weight[k] * acrosses[a, b] / parts
            n[i, j] = number
            slope_u[i, j] = slope_v[i, j] = 0.0
            if number == 0:
                found[i, j] = math.nan
                effective[i, j] = 0.0
                continue
            centre, along, across = heights / total, along / total, across / total
            # normal equations of a plane about the weighted mean: sums of x², xy, y², xz, yz
            xx = xy = yy = xz = yz = 0.0
            for k in range(step_u.size):
                a, b = i + step_u[k], j + step_v[k]
                if not (0 <= a < rows and 0 <= b < columns) or count[a, b] == 0:
                    continue
                c = float(count[a, b])
                w = weight[k] * c
                x = step_u[k] + alongs[a, b] / (parts * c) - along
                y = step_v[k] + acrosses[a, b] / (parts * c) - across
                xx += w * x * x
                xy += w * x * y
                yy += w * y * y
                xz += w * x * (mean[a, b] - centre)
                yz += w * y * (mean[a, b] - centre)
            variance = squares / (total * total)
            determinant = xx * yy - xy * xy
            # cells that lie almost in a line do not determine a plane
            if determinant > 0.05 * xx * yy:
                p = (yy * xz - xy * yz) / determinant
                q = (xx * yz - xy * xz) / determinant
                slope_u[i, j], slope_v[i, j] = p, q
                if levelled:
                    centre -= p * along + q * across
                    reach = yy * along * along - 2.0 * xy * along * across + xx * across * across
                    # variance of the plane at the node, not at the mean position
                    variance *= 1.0 + total * reach / determinant
            found[i, j] = centre
            effective[i, j] = 1.0 / variance
