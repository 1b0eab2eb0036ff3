"""Clothoids through points, of continuous heading and curvature.

The unknowns are heading and curvature at each point and the length of each clothoid. Each clothoid
must end at the next point with the heading there: three conditions each. On an open course the
curvatures at both ends are zero. Newton's method solves all conditions at once; each one involves a
single clothoid, so the matrix is sparse (Bertolazzi and Frego 2018,
"Interpolating clothoid splines with curvature continuity").
"""

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.course._line import Float, Stretch

_NODES = 32  # [1] of Gauss-Legendre quadrature: exact to round-off for a turn of less than pi
_MAX_ITERATIONS = 60
_CONVERGED = 1e-12  # [1] error over the chord
_MAX_TURN = np.pi  # [rad] from a point to the next
_MAX_LENGTH = 3.0  # [1] of a clothoid over its chord


def clothoids_through(points: Float, *, closed: bool) -> tuple[float, tuple[Stretch, ...]]:
    """First heading, and a clothoid from each point to the next.

    Parameters
    ----------
    points : numpy.ndarray, shape (n, 2)
        Easting and northing, neighbours differing [m].
    closed : bool
        Whether the last point is followed by the first one.

    Returns
    -------
    heading : float
        Direction in the first point [rad].
    stretches : tuple of Stretch
        As many as points if closed, else one less.

    Raises
    ------
    ValueError
        If the bends of the points are too sharp for such a course.
    """
    position = points[:, 0] + 1j * points[:, 1]
    chord = np.diff(np.append(position, position[0])) if closed else np.diff(position)
    n = chord.size
    direction = np.unwrap(np.angle(chord))
    heading, laps = _first_headings(direction, np.abs(chord), closed)
    begin, end = np.arange(n), (np.arange(n) + 1) % heading.size
    # on a closed course the heading differs by whole revolutions after one lap
    extra = np.where(end == 0, 2.0 * np.pi * laps, 0.0) if closed else np.zeros(n)
    length = np.abs(chord)
    curvature = np.zeros(heading.size)
    np.add.at(curvature, begin, (heading[end] + extra - heading[begin]) / length / 2.0)
    np.add.at(curvature, end, (heading[end] + extra - heading[begin]) / length / 2.0)
    if not closed:
        curvature[[0, -1]] = 0.0
    max_error = np.inf
    for _ in range(_MAX_ITERATIONS):
        error, matrix = _continuity_conditions(
            chord, heading, curvature, length, begin, end, extra, closed
        )
        max_error = np.abs(error).max()
        if max_error < _CONVERGED or not np.isfinite(max_error):
            break
        step = _solve_sparse(matrix, -error)
        turn, bend, longer = np.split(step, [heading.size, 2 * heading.size])
        # damped step: at most 0.5 rad, and half of a length
        damping = min(1.0, 0.5 / max(np.abs(turn).max(), np.abs(longer).max(), 1e-300))
        heading = heading + damping * turn
        curvature = curvature + damping * bend / np.abs(chord).mean()
        length = length * (1.0 + damping * longer)
    turned = 0.5 * np.abs(curvature[begin] + curvature[end]) * length
    if not (
        max_error < _CONVERGED
        and turned.max() < _MAX_TURN
        and (length < _MAX_LENGTH * abs(chord)).all()
    ):
        raise ValueError(
            "points must lie on a course without sharp bends; there is none of continuous "
            "curvature through these. Give more points where the course turns."
        )
    return float(heading[0]), tuple(
        Stretch(length=float(s), begin=float(k0), end=float(k1))
        for s, k0, k1 in zip(length, curvature[begin], curvature[end], strict=True)
    )


def _first_headings(direction: Float, chord: Float, closed: bool) -> tuple[Float, int]:
    """Headings of circles through three neighbouring points, and the revolutions of a lap."""
    turn = np.diff(direction)
    laps = 0
    if closed:
        last = direction[0] - direction[-1]
        last -= 2.0 * np.pi * np.round(last / (2.0 * np.pi))
        turn = np.append(turn, last)
        laps = round(turn.sum() / (2.0 * np.pi))
    before, after = chord[: turn.size], np.roll(chord, -1)[: turn.size]
    inner = direction[: turn.size] + turn * before / (before + after)
    if closed:
        return np.append(inner[-1] - 2.0 * np.pi * laps, inner[:-1]), laps
    if not turn.size:
        return np.repeat(direction, 2), 0
    first, last = 2.0 * direction[0] - inner[0], 2.0 * direction[-1] - inner[-1]
    return np.concatenate([[first], inner, [last]]), 0


def _continuity_conditions(
    chord: npt.NDArray[np.complex128],
    heading: Float,
    curvature: Float,
    length: Float,
    begin: npt.NDArray[np.int64],
    end: npt.NDArray[np.int64],
    extra: Float,
    closed: bool,
) -> tuple[Float, tuple[Float, Float, Float, int]]:
    """Residuals of the conditions, and their Jacobian as values, rows, columns and size.

    Unknowns are headings, curvatures times the mean chord, and logarithms of the lengths.
    """
    n, m, scale = chord.size, heading.size, np.abs(chord).mean()
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    t, weight = 0.5 * (node + 1.0), 0.5 * weight
    bend, change = curvature[begin], curvature[end] - curvature[begin]
    turn = length[:, None] * (np.outer(bend, t) + 0.5 * np.outer(change, t**2))
    tangent = np.exp(1j * (heading[begin][:, None] + turn)) * weight
    # end of each clothoid relative to its chord, and the derivatives by the unknowns
    displacement = length * tangent.sum(axis=1) / chord
    of_heading = 1j * displacement
    of_bend = 1j * length**2 * (tangent @ (t - 0.5 * t**2)) / chord
    of_end = 1j * length**2 * (tangent @ (0.5 * t**2)) / chord
    of_length = displacement + 1j * length * (tangent * turn).sum(axis=1) / chord
    gap = displacement - 1.0
    heading_gap = heading[begin] + 0.5 * length * (bend + curvature[end]) - heading[end] - extra
    error = np.concatenate([gap.real, gap.imag, heading_gap])
    one, row = np.ones(n), np.arange(n)
    entries = []
    for part, of in ((0, np.real), (1, np.imag)):
        entries += [
            (of(of_heading), part * n + row, begin),
            (of(of_bend) / scale, part * n + row, m + begin),
            (of(of_end) / scale, part * n + row, m + end),
            (of(of_length), part * n + row, 2 * m + row),
        ]
    entries += [
        (one, 2 * n + row, begin),
        (-one, 2 * n + row, end),
        (0.5 * length / scale, 2 * n + row, m + begin),
        (0.5 * length / scale, 2 * n + row, m + end),
        (0.5 * length * (bend + curvature[end]), 2 * n + row, 2 * m + row),
    ]
    if not closed:
        error = np.concatenate([error, curvature[[0, -1]] * scale])
        entries.append((np.ones(2), 3 * n + np.arange(2), m + np.array([0, m - 1])))
    values, rows, columns = (np.concatenate(part) for part in zip(*entries, strict=True))
    return error, (values, rows, columns, error.size)


def _solve_sparse(matrix: tuple[Float, Float, Float, int], right: Float) -> Float:
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    values, rows, columns, size = matrix
    try:
        return np.asarray(splu(csc_matrix((values, (rows, columns)), (size, size))).solve(right))
    except RuntimeError:  # singular
        return np.full(size, np.nan)
