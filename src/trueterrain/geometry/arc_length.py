"""Points at equal arc length along a smooth curve.

The thesis steps along a path by Eqs. 5-3 and 5-5, whose second one loses the sign of the step and
fails where the path runs along the second axis. Here the curve has a parameter of its own: the arc
length is its integrated speed, and each point solves ``length(t) = k * spacing``.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.geometry.stations import equal_stations

Float = npt.NDArray[np.float64]

#: Error of the arc length over one panel, as a part of the spacing; the promise is 1e-6.
PANEL_TOLERANCE = 1e-9

#: Round-off below which panels are not split further, as a part of the panel's length.
ROUND_OFF = 1e-14

_MAXIMUM_SPLITS = 48
_MAXIMUM_NEWTON_STEPS = 60
_BLOCK = 1 << 16  # points solved at a time, so that their quadrature stays in the caches
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


@dataclass(frozen=True, kw_only=True)
class ParametricCurve:
    """A plane curve with a parameter, smooth between its breaks."""

    position: Callable[[Float], Float]
    "Coordinates at parameter values: shape (n,) -> (n, 2) [m]."

    velocity: Callable[[Float], Float]
    "Derivative of the position: shape (n,) -> (n, 2)."

    breaks: Float
    "Ascending parameter values; the curve runs from the first to the last."


def equidistant_parameters(curve: ParametricCurve, spacing: float) -> tuple[Float, Float, float]:
    """Parameters of points at equal arc length.

    Parameters
    ----------
    curve : ParametricCurve
        The curve to walk along.
    spacing : float
        Arc length between two points [m].

    Returns
    -------
    stations, parameters : numpy.ndarray, shape (n,)
        Arc length [m] and parameter of each point; the first is the curve's start.
    length : float
        Length of the whole curve [m].

    Raises
    ------
    ValueError
        If the curve is shorter than the spacing.
    """
    panels, cumulative = _split_panels(curve, spacing)
    length = float(cumulative[-1])
    targets = equal_stations(length, spacing)
    panel = np.clip(np.searchsorted(cumulative, targets, side="right") - 1, 0, panels.size - 2)
    wanted = targets - cumulative[panel]
    tolerance = max(PANEL_TOLERANCE * spacing, 4 * np.finfo(float).eps * length)
    solved = [
        _solve_parameter(curve, panels[panel[cut]], panels[panel[cut] + 1], wanted[cut], tolerance)
        for cut in (slice(begin, begin + _BLOCK) for begin in range(0, targets.size, _BLOCK))
    ]
    return targets, np.concatenate(solved), length


def _panel_lengths(curve: ParametricCurve, begin: Float, end: Float) -> Float:
    half = 0.5 * (end - begin)
    t = 0.5 * (begin + end)[:, None] + half[:, None] * _NODES
    velocity = curve.velocity(t.ravel())
    speed = np.hypot(velocity[:, 0], velocity[:, 1]).reshape(t.shape)
    return np.asarray(half * (speed @ _WEIGHTS))


def _split_panels(curve: ParametricCurve, spacing: float) -> tuple[Float, Float]:
    """Split the curve until the quadrature of each panel agrees with that of its halves."""
    begin, end = curve.breaks[:-1], curve.breaks[1:]
    done: list[tuple[Float, Float]] = []
    whole = _panel_lengths(curve, begin, end)
    for _ in range(_MAXIMUM_SPLITS):
        middle = 0.5 * (begin + end)
        left, right = _panel_lengths(curve, begin, middle), _panel_lengths(curve, middle, end)
        tolerance = np.maximum(PANEL_TOLERANCE * spacing, ROUND_OFF * (left + right))
        good = np.abs(left + right - whole) <= tolerance
        done.append((begin[good], left[good] + right[good]))
        begin, middle, end = begin[~good], middle[~good], end[~good]
        whole = np.concatenate([left[~good], right[~good]])
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        if begin.size == 0:
            break
    else:  # panels shrunk to round-off around a point of no smoothness: their length is nil
        done.append((begin, whole))
    starts = np.concatenate([part for part, _ in done])
    order = np.argsort(starts)
    lengths = np.concatenate([part for _, part in done])[order]
    return (
        np.append(starts[order], curve.breaks[-1]),
        np.concatenate([[0.0], np.cumsum(lengths)]),
    )


def _solve_parameter(
    curve: ParametricCurve, low: Float, high: Float, wanted: Float, tolerance: float
) -> Float:
    """Newton's method held inside its bracket by bisection: the arc length is monotonic."""
    begin, low, high = low, low.copy(), high.copy()
    t = 0.5 * (low + high)
    rest = np.arange(t.size)
    for _ in range(_MAXIMUM_NEWTON_STEPS):
        at = t[rest]
        excess = _panel_lengths(curve, begin[rest], at) - wanted[rest]
        high[rest] = np.where(excess > 0, at, high[rest])
        low[rest] = np.where(excess > 0, low[rest], at)
        velocity = curve.velocity(at)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = at - excess / np.hypot(velocity[:, 0], velocity[:, 1])
        inside = (step >= low[rest]) & (step <= high[rest])
        far = np.abs(excess) > tolerance
        t[rest] = np.where(inside, step, np.where(far, 0.5 * (low[rest] + high[rest]), at))
        rest = rest[far]
        if rest.size == 0:
            break
    return t
