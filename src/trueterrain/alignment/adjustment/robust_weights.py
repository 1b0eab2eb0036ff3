"""Weights of the cells: what is usual is told by the data, and what is not is left out."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.adjustment.normal_equations import (
    AdjustmentSolution,
    ComponentPrior,
    NormalEquations,
    PriorInformation,
)
from trueterrain.alignment.adjustment.shared_cells import SharedCells
from trueterrain.alignment.adjustment.system import AdjustmentSystem
from trueterrain.alignment.settings import NetworkSettings
from trueterrain.core.errors import TrueTerrainError

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_MEDIAN_OF_SQUARE = 0.45493642311957283  # of a standard normal variable, squared
_SOME = 20_000  # cells that tell what is usual
_STEADY = 5e-4  # change of the floor below which it is kept
_PARTS = 8  # of a knot interval in which a pass is taken to err by the same
_FLOORS = 10  # iterations in which the floor follows
_LENGTHENED, _DAMPED = 4.0, 0.9  # most of the distance between two solutions to go on, or back
_STEPS = 3  # in which what is far away is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedFit:
    """Corrections, and the weights that they were found with."""

    solution: AdjustmentSolution
    "The corrections."

    equations: NormalEquations
    "Normal equations of the last iteration."

    correction: Floats
    "Correction of the height of each entry, shape (n,) [m]."

    robustness: Floats
    "Share of its weight that each entry keeps, 0 if it is rejected, shape (n,)."

    floor: float
    "Standard deviation that every cell has beside its own [m]."

    weight: Floats
    "Weight of each entry, shape (n,) [1/m²]."

    iterations: int
    "Iterations that were needed."


def fit_corrections(
    system: AdjustmentSystem, prior: Mapping[str, ComponentPrior], settings: NetworkSettings
) -> WeightedFit:
    """Adjust with Huber's weights, which follow the residuals, until corrections converge.

    Parameters
    ----------
    system : System
        The unknowns.
    prior : mapping of str to Prior
        What is known of each component before.
    settings : NetworkSettings
        Where Huber's weights begin to fall, and when corrections have converged.

    Returns
    -------
    Fitted
        Where they converged.

    Raises
    ------
    TrueTerrainError
        If they do not.

    Notes
    -----
    The noise floor, which is the scale of the weights, follows the corrections until it stays, or
    for some iterations: two floors that lead to each other would never end. From then on the step
    after a solution is that of Anderson's acceleration with one solution before: it damps steps
    that go back and forth, and lengthens those that creep, as where a few gross errors hold many
    weights. Corrections have converged if none changes by more than a fraction of its own standard
    deviation, or by more than a length that is of no use.
    """
    shared = system.shared
    known = system.known(prior)
    x = np.zeros(system.size)
    floor, fixed = np.inf, False
    before: tuple[Floats, Floats] | None = None  # solution, and step that led to it
    for iteration in range(1, settings.max_iterations + 1):
        correction = system.corrections(system.coefficients(x))
        height = shared.entries.height + correction
        if not fixed:
            found = noise_floor(shared, height)
            fixed = abs(found - floor) <= 4.0 * _STEADY * found or iteration >= _FLOORS
            floor, before = found, None
        variance = shared.entries.variance + floor**2
        away = np.empty(height.size)
        _kernels.standardised_deviations(shared.start, height, variance, shared.usable, away)
        robustness = settings.huber / np.maximum(np.abs(away), settings.huber)
        fitted = _solve_weighted(system, known, robustness, variance, floor, iteration)
        step = fitted.solution.x - x
        moved = np.abs(fitted.correction - correction)
        parts = system.in_deviations(fitted.solution, step)
        change = float(np.sqrt((parts**2).sum()))
        if fixed and (moved.max() <= settings.tolerance or change <= settings.relative_tolerance):
            return fitted
        x = fitted.solution.x
        if before is not None:
            back = _part_back(parts, system.in_deviations(fitted.solution, before[1]))
            x = x - back * (x - before[0])
        before = fitted.solution.x, step
    raise _not_converged(shared, moved, change, settings)


def _part_back(now: Floats, before: Floats) -> float:
    """Part of the distance to the solution before by which to go back; on, if it is negative."""
    turn = now - before
    square = float(turn @ turn)
    if square == 0:
        return 0.0
    # steps that grow are not lengthened
    furthest = 0.0 if now @ now > before @ before else -_LENGTHENED
    return float(np.clip(now @ turn / square, furthest, _DAMPED))


def _not_converged(
    shared: SharedCells, moved: Floats, change: float, settings: NetworkSettings
) -> TrueTerrainError:
    worst = int(np.argmax(moved))
    moving = np.unique(shared.lane[moved > settings.tolerance])
    names = dict.fromkeys(shared.names[k] for k in (shared.lane[worst], *moving))
    name, entries = next(iter(names)), shared.entries
    others = f" (of {', '.join(list(names)[1:])} by less)" if len(names) > 1 else ""
    return TrueTerrainError(
        f"the adjustment did not converge in {settings.max_iterations} iterations: the correction "
        f"of {name} still changes by {1e3 * moved[worst]:.3g} mm at easting "
        f"{entries.easting[worst]:.1f} m and northing {entries.northing[worst]:.1f} m{others}; all "
        f"together by up to {change:.2g} standard deviations, more than the relative tolerance of "
        f"{settings.relative_tolerance:g}",
        cure=f"Leave {name} out if it is not of the same ground, or raise max_iterations "
        "or relative_tolerance (--max-iterations, --relative-tolerance).",
    )


def gross_errors(shared: SharedCells, fitted: WeightedFit, bound: float) -> npt.NDArray[np.bool_]:
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
    _kernels.standardised_deviations(
        shared.start, height, shared.entries.variance + fitted.floor**2, shared.usable, away
    )
    return np.abs(away) > bound


def fit_tukey(
    system: AdjustmentSystem,
    prior: Mapping[str, ComponentPrior],
    before: WeightedFit,
    *,
    bound: float,
    factor: float,
) -> WeightedFit:
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
    _, share = entry_residuals(shared, before.correction, shared.usable / variance)
    fitted, known = before, system.known(prior)
    for _ in range(_STEPS):
        height = shared.entries.height + fitted.correction
        # a weight of 0 could not come back
        weight = shared.usable * np.maximum(fitted.robustness, 1e-9) / variance
        out, _ = entry_residuals(shared, height, weight)
        beyond = np.minimum(out**2 / (np.maximum(share, 1e-9) * variance * bound**2), 1.0)
        fitted = _solve_weighted(
            system,
            known,
            shared.usable * (1.0 - beyond) ** 2,
            variance * factor,
            before.floor,
            before.iterations,
        )
    return fitted


def design_effect(shared: SharedCells, fitted: WeightedFit, size: float) -> float:
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
    left, _ = entry_residuals(shared, shared.entries.height + fitted.correction, fitted.weight)
    _, index = np.unique(shared.squares(size), return_inverse=True)
    key = shared.per_entry(index.astype(np.int64)) * len(shared.names) + shared.lane
    alone, together = _grouped_sums(key, fitted.weight * left)
    return max(1.0, together / alone) if alone > 0 else 1.0


def variance_factor(shared: SharedCells, fitted: WeightedFit) -> float:
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
    left, free = entry_residuals(shared, shared.entries.height + fitted.correction, fitted.weight)
    usual = float((fitted.weight * free).sum())
    return float(((fitted.weight * left) ** 2).sum()) / usual if usual > 0 else 1.0


def left_over(system: AdjustmentSystem, fitted: WeightedFit) -> float:
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
    left, free = entry_residuals(shared, entries.height + fitted.correction, fitted.weight)
    step = max(one.spacing for one in system.knots if one is not None) / _PARTS
    at = np.floor((entries.time - shared.span[shared.lane, 0]) / step).astype(np.int64)
    key = shared.lane * (at.max() + 1) + at
    alone, together = _grouped_sums(key, fitted.weight * left)
    # what becomes of errors of the passes that are corrected, when the mean is taken away
    moving = ~shared.fixed[shared.lane]
    part = np.where(moving, 1.0 - free, 0.0)
    of_all = shared.per_entry(np.add.reduceat(part**2, shared.start[:-1]))
    own, all_ = _grouped_sums(
        key, fitted.weight * np.sqrt(of_all + np.where(moving, free**2 - part**2, 0.0))
    )
    if all_ <= own * (1.0 + 1e-9):
        return 0.0
    return float(np.sqrt(max(0.0, together - alone) / (all_ - own)))


def _grouped_sums(key: Integers, values: Floats) -> tuple[float, float]:
    """Sum of squares of some values, and of their sums over the same key."""
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    summed = np.add.reduceat(values[order], first)
    return float((values**2).sum()), float((summed**2).sum())


def _solve_weighted(
    system: AdjustmentSystem,
    known: PriorInformation,
    robustness: Floats,
    variance: Floats,
    floor: float,
    iterations: int,
) -> WeightedFit:
    weight = robustness / variance
    equations = system.equations(weight, np.ones(system.shared.cells, bool))
    solution = system.solve(equations, known)
    return WeightedFit(
        solution=solution,
        equations=equations,
        robustness=robustness,
        floor=floor,
        weight=weight,
        correction=system.corrections(solution.coefficients),
        iterations=iterations,
    )


def noise_floor(shared: SharedCells, height: Floats, guess: float = 1e-3) -> float:
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
        _kernels.standardised_deviations(start, height, variance + floor**2, usable, out)
        return float(np.median(out[usable] ** 2)) - _MEDIAN_OF_SQUARE

    low, high = 1e-6, guess
    if excess(low) <= 0:
        return low
    while excess(high) > 0:
        low, high = high, 2.0 * high
    while high - low > _STEADY * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return high


def entry_residuals(shared: SharedCells, height: Floats, weight: Floats) -> tuple[Floats, Floats]:
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
    _kernels.cell_residuals(shared.start, height, weight, out, share)
    return out, share
