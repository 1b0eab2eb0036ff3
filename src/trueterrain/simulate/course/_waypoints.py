"""Clothoids through points, of continuous heading and curvature.

Unknown are heading and curvature at each point and the length between each two. Each clothoid must
end in the next point, in the heading there: as many conditions as unknowns but for two, the
curvatures at the ends of an open course. Newton's method solves them all at once; no condition
reaches beyond one clothoid, so the matrix is sparse.
"""

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.course._line import Float, Stretch

_NODES = 32  # of Gauss and Legendre: to round-off for a clothoid that turns by less than pi
_ROUNDS = 60
_EXACT = 1e-12  # [1] of a chord
_SHARPEST = np.pi  # [rad] largest turn from a point to the next
_LONGEST = 3.0  # [1] longest way from a point to the next, as a multiple of the chord


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
        If the points turn too sharply for such a course.
    """
    position = points[:, 0] + 1j * points[:, 1]
    chord = np.diff(np.append(position, position[0])) if closed else np.diff(position)
    n = chord.size
    direction = np.unwrap(np.angle(chord))
    heading, laps = _first_headings(direction, np.abs(chord), closed)
    begin, end = np.arange(n), (np.arange(n) + 1) % heading.size
    # A closed course that comes around has turned by whole turns when it meets its first heading.
    extra = np.where(end == 0, 2.0 * np.pi * laps, 0.0) if closed else np.zeros(n)
    length = np.abs(chord)
    curvature = np.zeros(heading.size)
    np.add.at(curvature, begin, (heading[end] + extra - heading[begin]) / length / 2.0)
    np.add.at(curvature, end, (heading[end] + extra - heading[begin]) / length / 2.0)
    if not closed:
        curvature[[0, -1]] = 0.0
    worst = np.inf
    for _ in range(_ROUNDS):
        error, matrix = _continuity_conditions(
            chord, heading, curvature, length, begin, end, extra, closed
        )
        worst = np.abs(error).max()
        if worst < _EXACT or not np.isfinite(worst):
            break
        step = _solve_sparse(matrix, -error)
        turn, bend, longer = np.split(step, [heading.size, 2 * heading.size])
        share = min(1.0, 0.5 / max(np.abs(turn).max(), np.abs(longer).max(), 1e-300))
        heading = heading + share * turn
        curvature = curvature + share * bend / np.abs(chord).mean()
        length = length * (1.0 + share * longer)
    turned = 0.5 * np.abs(curvature[begin] + curvature[end]) * length
    if not (worst < _EXACT and turned.max() < _SHARPEST and (length < _LONGEST * abs(chord)).all()):
        raise ValueError(
            "points must lie on a course without sharp bends; there is none of continuous "
            "curvature through these. Give more points where the course turns."
        )
    return float(heading[0]), tuple(
        Stretch(length=float(s), begin=float(k0), end=float(k1))
        for s, k0, k1 in zip(length, curvature[begin], curvature[end], strict=True)
    )


def _first_headings(direction: Float, chord: Float, closed: bool) -> tuple[Float, int]:
    """Headings in the points, as circles through three neighbours have them, and whole turns."""
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
    chord: npt.NDArray[np.complex128], heading: Float, curvature: Float, length: Float,
    begin: npt.NDArray[np.int64], end: npt.NDArray[np.int64], extra: Float, closed: bool,
) -> tuple[Float, tuple[Float, Float, Float, int]]:  # fmt: skip
    """What is left to be met, and its derivatives as values, rows, columns and size.

    Unknowns are headings, curvatures times the mean chord, and logarithms of the lengths.
    """
    n, m, scale = chord.size, heading.size, np.abs(chord).mean()
    node, weight = np.polynomial.legendre.leggauss(_NODES)
    t, weight = 0.5 * (node + 1.0), 0.5 * weight
    bend, change = curvature[begin], curvature[end] - curvature[begin]
    turn = length[:, None] * (np.outer(bend, t) + 0.5 * np.outer(change, t**2))
    tangent = np.exp(1j * (heading[begin][:, None] + turn)) * weight
    # Share of the chord: the way of each clothoid, and what moves its end.
    way = length * tangent.sum(axis=1) / chord
    of_heading = 1j * way
    of_bend = 1j * length**2 * (tangent @ (t - 0.5 * t**2)) / chord
    of_end = 1j * length**2 * (tangent @ (0.5 * t**2)) / chord
    of_length = way + 1j * length * (tangent * turn).sum(axis=1) / chord
    gap = way - 1.0
    swing = heading[begin] + 0.5 * length * (bend + curvature[end]) - heading[end] - extra
    error = np.concatenate([gap.real, gap.imag, swing])
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
