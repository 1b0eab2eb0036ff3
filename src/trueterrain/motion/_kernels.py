"""Kalman filter forward and fixed-interval smoother backward: loops only, no checks.

The state has n components, in this order: three coordinates (height, roll, pitch); their rates;
n_p parameters of the accelerometers; the drifts of the three coordinates in navigation,
n = 6 + n_p + 3. Over a step h

    coordinate += h rate + increment + design . parameters
    rate       += increment + design . parameters
    parameters are a random walk, drifts a first-order Gauss-Markov process.

The smoother is that of Rauch, Tung and Striebel in the form of Bryson and Frazier (Bierman, 1973),
which gives the same results and inverts no matrix: with the filtered state x and covariance P, the
smoothed state is x - P adjoint and its covariance P - P information P.

All arrays are of float64 except `epochs` (int64).
"""

import numpy as np

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def _forward_product(matrix, step, design, decay, out):
    """Transition matrix F of one step times a matrix (n, columns), into `out` (n, columns).

    step: h [s]; design (6, n_p); decay (3,).
    """
    n, columns = matrix.shape
    parameters = design.shape[1]
    for j in range(3):
        for c in range(columns):
            out[j, c] = matrix[j, c] + step * matrix[3 + j, c]
            out[3 + j, c] = matrix[3 + j, c]
        for p in range(parameters):
            a, b = design[j, p], design[3 + j, p]
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
def _backward_product(matrix, step, design, decay, out):
    """Transposed transition matrix of one step times a matrix (n, columns), into `out`.

    step: h [s]; design (6, n_p); decay (3,).
    """
    n, columns = matrix.shape
    parameters = design.shape[1]
    for j in range(3):
        for c in range(columns):
            out[j, c] = matrix[j, c]
            out[3 + j, c] = matrix[3 + j, c] + step * matrix[j, c]
            out[n - 3 + j, c] = decay[j] * matrix[n - 3 + j, c]
    for p in range(parameters):
        for c in range(columns):
            out[6 + p, c] = matrix[6 + p, c]
        for j in range(3):
            a, b = design[j, p], design[3 + j, p]
            for c in range(columns):
                out[6 + p, c] += a * matrix[j, c] + b * matrix[3 + j, c]


@compile_kernel
def _symmetrise(matrix):
    """Mean of a matrix and its transpose, in place: round-off must not accumulate."""
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
    increment,
    parameter_design,
    noise,
    random_walk,
    decay,
    drift_noise,
    epochs,
    time_after_knot,
    measured,
    design,
    variance,
    states,
    covariances,
    gains,
    innovations,
):
    """Filter from knot `first` to before knot `last`.

    Parameters
    ----------
    first, last : int
        Range of knots.
    x, p : (n,), (n, n)
        State and covariance before the measurements of knot `first`; on return, those before the
        measurements of knot `last`.
    step : (knots - 1,) [s]
        Time from knot to knot.
    increment : (knots - 1, 6)
        Known increments of coordinates and rates.
    parameter_design : (knots - 1, 6, n_p)
        Derivatives of these increments by the parameters.
    noise : (knots - 1, 3, 3)
        Two-sided density of the white acceleration.
    random_walk : (knots - 1 or 1, n_p)
        Variance of the parameters per second.
    decay, drift_noise : (knots - 1, 3)
        Factor of the drifts and variance that they gain in a step.
    epochs : (knots, 2)
        First measurement of each knot, and the one after its last.
    time_after_knot : (measurements,) [s]
        Time from the knot to the measurement.
    measured, variance : (measurements, 3)
        Measurements and the variance of their white noise.
    design : (measurements, 3, 3)
        Derivatives of the measurements by the coordinates.
    states, covariances : (stored knots, n), (stored knots, n, n)
        Output: state and covariance after the measurements of each knot, from index 0; nothing is
        stored if these are empty.
    gains, innovations : (stored measurements, 3, n), (stored measurements, 3, 2)
        Output: Kalman gains; innovations and their variances.
    """
    n = x.size
    keep = states.shape[0] > 0
    half = np.empty((n, n))
    transposed = np.empty((n, n))
    column = np.empty((n, 1))
    h = np.empty(n)
    gain = np.empty(n)
    for k in range(first, last):
        for m in range(epochs[k, 0], epochs[k, 1]):
            # the three components of a measurement are independent: one scalar update each
            for c in range(3):
                # row of the design matrix: coordinates, rates over the time to the epoch, drift c
                h[:] = 0.0
                for j in range(3):
                    h[j] = design[m, c, j]
                    h[3 + j] = design[m, c, j] * time_after_knot[m]
                h[n - 3 + c] = 1.0
                innovation = measured[m, c]
                innovation_variance = variance[m, c]
                for r in range(n):
                    total = 0.0
                    for i in range(6):
                        total += p[r, i] * h[i]
                    gain[r] = total + p[r, n - 3 + c]
                for i in range(n):
                    innovation -= h[i] * x[i]
                    innovation_variance += h[i] * gain[i]
                # gain holds P h here: P -= P h h' P / S, then K = P h / S and x += K innovation
                for r in range(n):
                    for q in range(n):
                        p[r, q] -= gain[r] * gain[q] / innovation_variance
                for r in range(n):
                    gain[r] /= innovation_variance
                    x[r] += gain[r] * innovation
                if keep:
                    at = m - epochs[first, 0]
                    gains[at, c, :] = gain
                    innovations[at, c, 0] = innovation
                    innovations[at, c, 1] = innovation_variance
        if keep:
            states[k - first, :] = x
            covariances[k - first, :, :] = p
        if k == step.size:
            break
        # prediction: x = F x + increment, P = F P F' + Q
        t = step[k]
        column[:, 0] = x
        _forward_product(column, t, parameter_design[k], decay[k], half[:, :1])
        for r in range(n):
            x[r] = half[r, 0]
        for j in range(6):
            x[j] += increment[k, j]
        _forward_product(p, t, parameter_design[k], decay[k], half)
        for r in range(n):
            for c in range(n):
                transposed[r, c] = half[c, r]
        _forward_product(transposed, t, parameter_design[k], decay[k], p)
        # Q of white acceleration of density q, integrated once and twice
        for i in range(3):
            for j in range(3):
                q = noise[k, i, j]
                p[i, j] += q * t * t * t / 3.0
                p[i, 3 + j] += q * t * t / 2.0
                p[3 + i, j] += q * t * t / 2.0
                p[3 + i, 3 + j] += q * t
            p[n - 3 + i, n - 3 + i] += drift_noise[k, i]
        now = min(k, random_walk.shape[0] - 1)
        for i in range(random_walk.shape[1]):
            p[6 + i, 6 + i] += random_walk[now, i] * t
        _symmetrise(p)


@compile_kernel
def smooth_backward(
    first,
    last,
    adjoint,
    information,
    step,
    parameter_design,
    decay,
    epochs,
    time_after_knot,
    design,
    states,
    covariances,
    gains,
    innovations,
    mean,
    covariance,
    drift_variance,
    scores,
):
    """Smooth from knot `last` - 1 back to knot `first`.

    Parameters
    ----------
    first, last : int
        Range of knots, of which `filter_forward` stored states, covariances, gains, innovations.
    adjoint, information : (n,), (n, n)
        From the measurements after knot `last` - 1; on return, from those after knot `first` - 1.
    step ... innovations
        As in `filter_forward`.
    mean : (knots, n)
        Output: smoothed states.
    covariance : (knots, 3, 3)
        Output: covariance of the coordinates.
    drift_variance : (knots, 3)
        Output: variances of the drifts.
    scores : (knots - 1, n - 6, 2) or empty
        Output: for each step, square of the adjoint of parameters and drifts, and its expectation;
        their difference is twice the derivative of the log likelihood by the variance that the step
        adds.
    """
    n = adjoint.size
    half = np.empty((n, n))
    transposed = np.empty((n, n))
    column = np.empty((n, 1))
    h = np.empty(n)
    row = np.empty(n)
    for k in range(last - 1, first - 1, -1):
        x, p = states[k - first], covariances[k - first]
        for r in range(n):
            total = x[r]
            for i in range(n):
                total -= p[r, i] * adjoint[i]
            mean[k, r] = total
        # rows of P - P information P: the coordinates, and the diagonal of the drifts
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
                drift_variance[k, r - 3] = total
        for m in range(epochs[k, 1] - 1, epochs[k, 0] - 1, -1):
            for c in range(2, -1, -1):
                at = m - epochs[first, 0]
                gain = gains[at, c]
                innovation, innovation_variance = innovations[at, c, 0], innovations[at, c, 1]
                h[:] = 0.0
                for j in range(3):
                    h[j] = design[m, c, j]
                    h[3 + j] = design[m, c, j] * time_after_knot[m]
                h[n - 3 + c] = 1.0
                # C = I - K h': information = C' information C + h h' / S, adjoint = C' adjoint -
                # h innovation / S
                along = 0.0
                for i in range(n):
                    along += gain[i] * adjoint[i]
                scale = 1.0 / innovation_variance
                for i in range(n):
                    total = 0.0
                    for j in range(n):
                        total += information[i, j] * gain[j]
                    row[i] = total
                    scale += gain[i] * total
                for i in range(n):
                    adjoint[i] -= h[i] * (along + innovation / innovation_variance)
                    for j in range(n):
                        information[i, j] += scale * h[i] * h[j] - row[i] * h[j] - h[i] * row[j]
        if k == 0:
            break
        if scores.shape[0] > 0:
            for i in range(6, n):
                scores[k - 1, i - 6, 0] = adjoint[i] ** 2
                scores[k - 1, i - 6, 1] = information[i, i]
        # adjoint = F' adjoint, information = F' information F
        t = step[k - 1]
        b, d = parameter_design[k - 1], decay[k - 1]
        column[:, 0] = adjoint
        _backward_product(column, t, b, d, half[:, :1])
        for r in range(n):
            adjoint[r] = half[r, 0]
        _backward_product(information, t, b, d, half)
        for r in range(n):
            for c in range(n):
                transposed[r, c] = half[c, r]
        _backward_product(transposed, t, b, d, information)
        _symmetrise(information)
