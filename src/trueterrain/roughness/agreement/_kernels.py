"""Loop over the samples of two overlapping signals; arguments are checked by the callers."""

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def accumulate_products(a, begin, coefficients, step, place, stride, sums):
    """Write the sums of all products of 1, b, b', x b' and a to the upper half of `sums` (5, 5).

    They are the normal equations of one iteration of `refine_registration`.

    - ``a`` (n,): first signal, compared from sample ``begin`` on;
    - ``coefficients`` (4, cells): cubic spline of the second signal b, highest power first, over
      cells of length ``step`` [m]; b' is its slope;
    - ``place`` + i ``stride`` [samples of b] is the position in b of a[begin + i];
    - x is the index of the sample of a, as a fraction of n.
    """
    last = coefficients.shape[1] - 1
    size = a.size
    s01 = s02 = s03 = s04 = s11 = s12 = s13 = s14 = s22 = s23 = s24 = s33 = s34 = s44 = 0.0
    count = 0
    for i in range(size - begin):
        at = place + i * stride
        cell = int(at)
        if cell > last:
            if at > last + 1 + 1e-6:
                break
            cell = last
        cell = max(cell, 0)
        t = (at - cell) * step
        c0, c1 = coefficients[0, cell], coefficients[1, cell]
        c2, c3 = coefficients[2, cell], coefficients[3, cell]
        b = ((c0 * t + c1) * t + c2) * t + c3
        slope = (3.0 * c0 * t + 2.0 * c1) * t + c2
        scaled = slope * ((begin + i) / size)
        value = a[begin + i]
        count += 1
        s01 += b
        s02 += slope
        s03 += scaled
        s04 += value
        s11 += b * b
        s12 += b * slope
        s13 += b * scaled
        s14 += b * value
        s22 += slope * slope
        s23 += slope * scaled
        s24 += slope * value
        s33 += scaled * scaled
        s34 += scaled * value
        s44 += value * value
    sums[0, 0] = count
    sums[0, 1], sums[0, 2], sums[0, 3], sums[0, 4] = s01, s02, s03, s04
    sums[1, 1], sums[1, 2], sums[1, 3], sums[1, 4] = s11, s12, s13, s14
    sums[2, 2], sums[2, 3], sums[2, 4] = s22, s23, s24
    sums[3, 3], sums[3, 4], sums[4, 4] = s33, s34, s44
