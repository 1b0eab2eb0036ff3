"""Weights of the cells: what is usual is told by the data, and what is not is left out."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.errors import TrueTerrainError
from trueterrain.lanes import _kernels
from trueterrain.lanes._equations import Equations, Known, Prior, Solution
from trueterrain.lanes._problem import Shared
from trueterrain.lanes._system import System

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_MEDIAN_OF_SQUARE = 0.45493642311957283  # of a standard normal variable, squared
_SOME = 20_000  # cells that tell what is usual
_SETTLED = 5e-4  # change of the floor below which it is kept
_PARTS = 8  # of a knot interval in which a pass is taken to err by the same
_STEPS = 3  # in which what is far away is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted:
    """Corrections, and the weights that they were found with."""

    solution: Solution
    "The corrections."

    equations: Equations
    "Normal equations of the last round."

    correction: Floats
    "Correction of the height of each entry, shape (n,) [m]."

    robustness: Floats
    "Share of its weight that each entry keeps, 0 if it is rejected, shape (n,)."

    floor: float
    "Standard deviation that every cell has beside its own [m]."

    weight: Floats
    "Weight of each entry, shape (n,) [1/m²]."

    rounds: int
    "Rounds that were needed."


def settle(
    system: System,
    prior: Mapping[str, Prior],
    *,
    bound: float,
    tolerance: float,
    most: int,
    start: Floats | None = None,
) -> Fitted:
    """Adjust with Huber's weights, which follow what is left, until nothing changes any more.

    Parameters
    ----------
    system : System
        The unknowns.
    prior : mapping of str to Prior
        What is known of each component before.
    bound : float
        Standard deviations beyond which a cell weighs less.
    tolerance : float
        Change of the corrections below which they are taken as settled [m].
    most : int
        Most rounds.
    start : numpy.ndarray, shape (n,), optional
        Corrections of the entries to start from [m].

    Returns
    -------
    Fitted
        Where it settled.

    Raises
    ------
    TrueTerrainError
        If it does not settle.
    """
    shared = system.shared
    correction = np.zeros(shared.lane.size) if start is None else start
    known = system.known(prior)
    floor, still, change = np.inf, False, np.inf
    for done in range(1, most + 1):
        height = shared.entries.height + correction
        if not still:
            found = noise_floor(shared, height)
            still = abs(found - floor) <= 4.0 * _SETTLED * found
            floor = found
        variance = shared.entries.variance + floor**2
        away = np.empty(height.size)
        _kernels.outlyingness(shared.start, height, variance, shared.usable, away)
        robustness = bound / np.maximum(np.abs(away), bound)
        fitted = _solved(system, known, robustness, variance, floor, done)
        change = float(np.abs(fitted.correction - correction).max())
        correction = fitted.correction
        if still and change <= tolerance:
            return fitted
    raise TrueTerrainError(
        f"the adjustment did not settle: after {most} rounds corrections still change by "
        f"{change * 1e3:.3g} mm",
        cure="Look for passes that are not of the same ground, or allow more rounds.",
    )


def gross_errors(shared: Shared, fitted: Fitted, bound: float) -> npt.NDArray[np.bool_]:
    """What is so far away that it would pull fine corrections along.

    Parameters
    ----------
    shared : Shared
        The observations.
    fitted : Fitted
        Coarse corrections, which a few cells cannot pull.
    bound : float
        Standard deviations beyond which an entry is wrong.

    Returns
    -------
    numpy.ndarray of bool, shape (n,)
        True where it is.
    """
    height = shared.entries.height + fitted.correction
    away = np.empty(height.size)
    _kernels.outlyingness(
        shared.start, height, shared.entries.variance + fitted.floor**2, shared.usable, away
    )  # fmt: skip
    return np.abs(away) > bound


def reject(
    system: System, prior: Mapping[str, Prior], before: Fitted, *, bound: float, factor: float
) -> Fitted:
    """Adjust with Tukey's weights, in a few steps from where Huber's led: outliers get none.

    Parameters
    ----------
    system : System
        The unknowns.
    prior : mapping of str to Prior
        What is known of each component before.
    before : Fitted
        Where to start.
    bound : float
        Standard deviations beyond which a cell is rejected.
    factor : float
        By which all variances are greater than single cells tell.

    Returns
    -------
    Fitted
        After these steps.
    """
    shared = system.shared
    variance = shared.entries.variance + before.floor**2
    _, share = residuals(shared, before.correction, shared.usable / variance)
    fitted, known = before, system.known(prior)
    for _ in range(_STEPS):
        height = shared.entries.height + fitted.correction
        # a weight of 0 could not come back
        weight = shared.usable * np.maximum(fitted.robustness, 1e-9) / variance
        out, _ = residuals(shared, height, weight)
        beyond = np.minimum(out**2 / (np.maximum(share, 1e-9) * variance * bound**2), 1.0)
        fitted = _solved(
            system,
            known,
            shared.usable * (1.0 - beyond) ** 2,
            variance * factor,
            before.floor,
            before.rounds,
        )
    return fitted


def clustering(shared: Shared, fitted: Fitted, size: float) -> float:
    """By how much sums over squares of ground scatter more than those of independent cells would.

    Parameters
    ----------
    shared : Shared
        The observations.
    fitted : Fitted
        What is left of them.
    size : float
        Side of the squares [m].

    Returns
    -------
    float
        Ratio of variances, at least 1.
    """
    left, _ = residuals(shared, shared.entries.height + fitted.correction, fitted.weight)
    _, index = np.unique(shared.squares(size), return_inverse=True)
    key = shared.per_entry(index.astype(np.int64)) * len(shared.names) + shared.lane
    alone, together = _sums(key, fitted.weight * left)
    return max(1.0, together / alone) if alone > 0 else 1.0


def spread(shared: Shared, fitted: Fitted) -> float:
    """Variance of weighted residuals, by what it would be if weights were exact.

    Weights that fall off with the residuals make sums of them scatter less.

    Parameters
    ----------
    shared : Shared
        The observations.
    fitted : Fitted
        What is left of them.

    Returns
    -------
    float
        Ratio of variances.
    """
    left, free = residuals(shared, shared.entries.height + fitted.correction, fitted.weight)
    usual = float((fitted.weight * free).sum())
    return float(((fitted.weight * left) ** 2).sum()) / usual if usual > 0 else 1.0


def left_over(system: System, fitted: Fitted) -> float:
    """What all cells that a pass sees at a time still have in common.

    Parameters
    ----------
    system : System
        The unknowns.
    fitted : Fitted
        Their solution.

    Returns
    -------
    float
        Standard deviation of what is too fine for the knots [m].
    """
    shared, entries = system.shared, system.shared.entries
    left, free = residuals(shared, entries.height + fitted.correction, fitted.weight)
    step = max(one.spacing for one in system.knots if one is not None) / _PARTS
    at = np.floor((entries.time - shared.span[shared.lane, 0]) / step).astype(np.int64)
    key = shared.lane * (at.max() + 1) + at
    alone, together = _sums(key, fitted.weight * left)
    # what becomes of errors of the passes that are corrected, when the mean is taken away
    moving = ~shared.fixed[shared.lane]
    part = np.where(moving, 1.0 - free, 0.0)
    of_all = shared.per_entry(np.add.reduceat(part**2, shared.start[:-1]))
    own, all_ = _sums(
        key, fitted.weight * np.sqrt(of_all + np.where(moving, free**2 - part**2, 0.0))
    )
    if all_ <= own * (1.0 + 1e-9):
        return 0.0
    return float(np.sqrt(max(0.0, together - alone) / (all_ - own)))


def _sums(key: Integers, values: Floats) -> tuple[float, float]:
    """Sum of squares of some values, and of their sums over the same key."""
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    summed = np.add.reduceat(values[order], first)
    return float((values**2).sum()), float((summed**2).sum())


def _solved(
    system: System,
    known: Known,
    robustness: Floats,
    variance: Floats,
    floor: float,
    rounds: int,
) -> Fitted:
    weight = robustness / variance
    equations = system.equations(weight, np.ones(system.shared.cells, bool))
    solution = system.solve(equations, known)
    return Fitted(
        solution=solution, equations=equations, robustness=robustness, floor=floor, weight=weight,
        correction=system.corrections(solution.coefficients), rounds=rounds,
    )  # fmt: skip


def noise_floor(shared: Shared, height: Floats, guess: float = 1e-3) -> float:
    """Standard deviation that cells have beside that of their own scatter.

    Two passes sample the texture of the ground at different places; half of all residuals must be
    within what is usual for half of normal errors.

    Parameters
    ----------
    shared : Shared
        The observations.
    height : numpy.ndarray, shape (n,)
        Corrected heights [m].
    guess : float
        Where to begin to look for it [m].

    Returns
    -------
    float
        At least 1 µm [m].
    """
    some = np.arange(0, shared.cells, max(1, shared.cells // _SOME))
    each = np.diff(shared.start)[some]
    start = np.concatenate([[0], np.cumsum(each)]).astype(np.int64)
    pick = np.repeat(shared.start[some] - start[:-1], each) + np.arange(start[-1])
    height, variance, usable = height[pick], shared.entries.variance[pick], shared.usable[pick]
    out = np.empty(pick.size)

    def excess(floor: float) -> float:
        _kernels.outlyingness(start, height, variance + floor**2, usable, out)
        return float(np.median(out[usable] ** 2)) - _MEDIAN_OF_SQUARE

    low, high = 1e-6, guess
    if excess(low) <= 0:
        return low
    while excess(high) > 0:
        low, high = high, 2.0 * high
    while high - low > _SETTLED * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return high


def residuals(shared: Shared, height: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Residuals of the entries.

    Parameters
    ----------
    shared : Shared
        The observations.
    height, weight : numpy.ndarray, shape (n,)
        Heights [m] and their weights [1/m²].

    Returns
    -------
    residual : numpy.ndarray, shape (n,)
        Heights less the weighted mean of their cell [m].
    free : numpy.ndarray, shape (n,)
        1 less the share of each in that mean.
    """
    out, share = np.empty(height.size), np.empty(height.size)
    _kernels.residuals(shared.start, height, weight, out, share)
    return out, share
