"""Kalman filter forward and fixed-interval smoother backward: loops only, no checks.

The state is, in this order: three coordinates (height, roll, pitch); their rates; parameters of the
accelerometers; the drifts of the three coordinates as navigation gives them. Over a step h

    coordinate += h rate + known + into_coordinate . parameters
    rate       += known + into_rate . parameters
    parameters stay (random walk), drifts decay (Gauss-Markov).

The smoother is that of Rauch, Tung and Striebel in the form of Bryson and Frazier (Bierman, 1973),
which gives the same and needs no inverse.
"""

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _forward_product(matrix, step, into_coordinate, into_rate, decay, out):
    """F times a matrix (n, columns)."""
    n, columns = matrix.shape
    parameters = into_coordinate.shape[1]
    for j in range(3):
        for c in range(columns):
            out[j, c] = matrix[j, c] + step * matrix[3 + j, c]
            out[3 + j, c] = matrix[3 + j, c]
        for p in range(parameters):
            a, b = into_coordinate[j, p], into_rate[j, p]
            for c in range(columns):
                out[j, c] += a * matrix[6 + p, c]
                out[3 + j, c] += b * matrix[6 + p, c]
    for r in range(6, n - 3):
        for c in range(columns):
            out[r, c] = matrix[r, c]
    for j in range(3):
        for c in range(columns):
            out[n - 3 + j, c] = decay[j] * matrix[n - 3 + j, c]


@compile_kernel
def _backward_product(matrix, step, into_coordinate, into_rate, decay, out):
    """F transposed times a matrix (n, columns)."""
    n, columns = matrix.shape
    parameters = into_coordinate.shape[1]
    for j in range(3):
        for c in range(columns):
            out[j, c] = matrix[j, c]
            out[3 + j, c] = matrix[3 + j, c] + step * matrix[j, c]
            out[n - 3 + j, c] = decay[j] * matrix[n - 3 + j, c]
    for p in range(parameters):
        for c in range(columns):
            out[6 + p, c] = matrix[6 + p, c]
        for j in range(3):
            a, b = into_coordinate[j, p], into_rate[j, p]
            for c in range(columns):
                out[6 + p, c] += a * matrix[j, c] + b * matrix[3 + j, c]


@compile_kernel
def _symmetrise(matrix):
    for r in range(matrix.shape[0]):
        for c in range(r):
            mean = 0.5 * (matrix[r, c] + matrix[c, r])
            matrix[r, c] = mean
            matrix[c, r] = mean


@compile_kernel
def filter_forward(
    first,
    last,
    x,
    p,
    step,
    known,
    into_coordinate,
    into_rate,
    noise,
    walk,
    decay,
    drift_noise,
    seen,
    before,
    measured,
    design,
    variance,
    states,
    covariances,
    gains,
    innovations,
):
    """From knot `first` to before knot `last`, at which the filter then stands.

    The state x (n,) and covariance p (n, n) are those before the measurements of knot `first`, and
    are left as those before the measurements of knot `last`. After its measurements, the state and
    covariance of each knot are kept in `states` and `covariances` from index 0, if these have room.

    step (knots-1,), known (knots-1, 6), into_... (knots-1, 3, parameters), noise (knots-1, 3, 3):
    intensity of the white acceleration; walk (knots-1 or 1, parameters): variance per second; decay
    and drift_noise (knots-1, 3); seen (knots, 2): first and last + 1 measurement of a knot; before
    (measurements,): time from the knot to the measurement; measured (measurements, 3), design
    (measurements, 3, 3): of the coordinates in what is measured; variance (measurements, 3).
    """
    n = x.size
    keep = states.shape[0] > 0
    half = np.empty((n, n))
    turned = np.empty((n, n))
    moved = np.empty((n, 1))
    h = np.empty(n)
    gain = np.empty(n)
    for k in range(first, last):
        for m in range(seen[k, 0], seen[k, 1]):
            for c in range(3):
                h[:] = 0.0
                for j in range(3):
                    h[j] = design[m, c, j]
                    h[3 + j] = design[m, c, j] * before[m]
                h[n - 3 + c] = 1.0
                innovation = measured[m, c]
                spread = variance[m, c]
                for r in range(n):
                    total = 0.0
                    for i in range(6):
                        total += p[r, i] * h[i]
                    gain[r] = total + p[r, n - 3 + c]
                for i in range(n):
                    innovation -= h[i] * x[i]
                    spread += h[i] * gain[i]
                for r in range(n):
                    for q in range(n):
                        p[r, q] -= gain[r] * gain[q] / spread
                for r in range(n):
                    gain[r] /= spread
                    x[r] += gain[r] * innovation
                if keep:
                    at = m - seen[first, 0]
                    gains[at, c, :] = gain
                    innovations[at, c, 0] = innovation
                    innovations[at, c, 1] = spread
        if keep:
            states[k - first, :] = x
            covariances[k - first, :, :] = p
        if k == step.size:
            break
        t = step[k]
        moved[:, 0] = x
        _forward_product(moved, t, into_coordinate[k], into_rate[k], decay[k], half[:, :1])
        for r in range(n):
            x[r] = half[r, 0]
        for j in range(6):
            x[j] += known[k, j]
        _forward_product(p, t, into_coordinate[k], into_rate[k], decay[k], half)
        for r in range(n):
            for c in range(n):
                turned[r, c] = half[c, r]
        _forward_product(turned, t, into_coordinate[k], into_rate[k], decay[k], p)
        for i in range(3):
            for j in range(3):
                q = noise[k, i, j]
                p[i, j] += q * t * t * t / 3.0
                p[i, 3 + j] += q * t * t / 2.0
                p[3 + i, j] += q * t * t / 2.0
                p[3 + i, 3 + j] += q * t
            p[n - 3 + i, n - 3 + i] += drift_noise[k, i]
        now = min(k, walk.shape[0] - 1)
        for i in range(walk.shape[1]):
            p[6 + i, 6 + i] += walk[now, i] * t
        _symmetrise(p)


@compile_kernel
def smooth_backward(
    first,
    last,
    adjoint,
    information,
    step,
    into_coordinate,
    into_rate,
    decay,
    seen,
    before,
    design,
    states,
    covariances,
    gains,
    innovations,
    mean,
    covariance,
    apart,
    pull,
):
    """From knot `last` - 1 to knot `first`; see `forward`.

    The adjoint (n,) and the information (n, n) come from the measurements after knot `last` - 1
    and are left as those after knot `first` - 1. Smoothed: mean (knots, n);
    covariance (knots, 3, 3) of the coordinates; apart (knots, 3), the variances of the drifts.
    If `pull` (knots-1, n-6, 2) has room: for each step, the square of the adjoint of parameters and
    drifts, and its expectation; their difference is twice the derivative of the log likelihood by
    the variance that the step adds.
    """
    n = adjoint.size
    half = np.empty((n, n))
    turned = np.empty((n, n))
    moved = np.empty((n, 1))
    h = np.empty(n)
    row = np.empty(n)
    for k in range(last - 1, first - 1, -1):
        x, p = states[k - first], covariances[k - first]
        for r in range(n):
            total = x[r]
            for i in range(n):
                total -= p[r, i] * adjoint[i]
            mean[k, r] = total
        for r in range(6):
            a = r if r < 3 else n - 6 + r
            for c in range(n):
                total = 0.0
                for i in range(n):
                    total += p[a, i] * information[i, c]
                row[c] = total
            if r < 3:
                for c in range(3):
                    total = p[r, c]
                    for i in range(n):
                        total -= row[i] * p[i, c]
                    covariance[k, r, c] = total
            else:
                total = p[a, a]
                for i in range(n):
                    total -= row[i] * p[i, a]
                apart[k, r - 3] = total
        for m in range(seen[k, 1] - 1, seen[k, 0] - 1, -1):
            for c in range(2, -1, -1):
                at = m - seen[first, 0]
                gain = gains[at, c]
                innovation, spread = innovations[at, c, 0], innovations[at, c, 1]
                h[:] = 0.0
                for j in range(3):
                    h[j] = design[m, c, j]
                    h[3 + j] = design[m, c, j] * before[m]
                h[n - 3 + c] = 1.0
                # With C = I - K h: information = C' information C + h h' / S, and so the adjoint.
                along = 0.0
                for i in range(n):
                    along += gain[i] * adjoint[i]
                scale = 1.0 / spread
                for i in range(n):
                    total = 0.0
                    for j in range(n):
                        total += information[i, j] * gain[j]
                    row[i] = total
                    scale += gain[i] * total
                for i in range(n):
                    adjoint[i] -= h[i] * (along + innovation / spread)
                    for j in range(n):
                        information[i, j] += scale * h[i] * h[j] - row[i] * h[j] - h[i] * row[j]
        if k == 0:
            break
        if pull.shape[0] > 0:
            for i in range(6, n):
                pull[k - 1, i - 6, 0] = adjoint[i] ** 2
                pull[k - 1, i - 6, 1] = information[i, i]
        t = step[k - 1]
        a, b, d = into_coordinate[k - 1], into_rate[k - 1], decay[k - 1]
        moved[:, 0] = adjoint
        _backward_product(moved, t, a, b, d, half[:, :1])
        for r in range(n):
            adjoint[r] = half[r, 0]
        _backward_product(information, t, a, b, d, half)
        for r in range(n):
            for c in range(n):
                turned[r, c] = half[c, r]
        _backward_product(turned, t, a, b, d, information)
        _symmetrise(information)
