"""Robust weights of the cells, and the statistics of residuals that scale the covariance.

The variance of an entry is that of its scatter plus a noise floor estimated from the residuals.
Weights follow the residuals: Huber's until the corrections converge, then Tukey's (redescending),
which reject gross errors.
"""

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

_CHI2_MEDIAN = 0.45493642311957283  # median of the chi-square distribution, f = 1
_SAMPLE = 20_000  # cells from which the noise floor is estimated
_STEADY = 5e-4  # relative tolerance of the noise floor
_PARTS = 8  # of a knot interval within which the residual drift of a pass is constant
_FLOORS = 10  # iterations after which the noise floor is kept
_MAX_EXTENSION, _MAX_DAMPING = 4.0, 0.9  # bounds of the relaxation, as fractions of the step
_STEPS = 3  # iterations with Tukey's weights


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedFit:
    """Corrections and the weights of their last iteration."""

    solution: AdjustmentSolution
    "The corrections."

    equations: NormalEquations
    "Normal equations of the last iteration."

    correction: Floats
    "Correction of the height of each entry, shape (n,) [m]."

    robustness: Floats
    "Robust weight of each entry from 0, if it is rejected, to 1, shape (n,)."

    floor: float
    "Noise floor: standard deviation in addition to that of the scatter [m]."

    weight: Floats
    "Weight of each entry, shape (n,) [1/m²]."

    iterations: int
    "Iterations until convergence."


def fit_corrections(
    system: AdjustmentSystem, prior: Mapping[str, ComponentPrior], settings: NetworkSettings
) -> WeightedFit:
    """Adjust with Huber's weights by iteratively reweighted least squares.

    Parameters
    ----------
    system : AdjustmentSystem
        The unknowns.
    prior : mapping of str to ComponentPrior
        Prior of each component.
    settings : NetworkSettings
        Bound of Huber's weights and tolerances of convergence.

    Returns
    -------
    WeightedFit
        After convergence.

    Raises
    ------
    TrueTerrainError
        If the corrections do not converge.

    Notes
    -----
    The noise floor, which scales the residuals, is re-estimated until it is constant, or for some
    iterations: two floors that lead to each other would alternate for ever. From then on steps are
    relaxed by Anderson's acceleration of depth 1 (Anderson 1965), which damps oscillation and
    extends slow steps, as where a few gross errors determine many weights. The corrections have
    converged if no linear combination of them changes by more than a fraction of its standard
    deviation, or none by more than an absolute tolerance.
    """
    shared = system.shared
    known = system.known(prior)
    x = np.zeros(system.size)
    floor, fixed = np.inf, False
    before: tuple[Floats, Floats] | None = None  # solution and step of the iteration before
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
        change_m = np.abs(fitted.correction - correction)
        parts = system.whiten_change(fitted.solution, step)  # in standard deviations
        change = float(np.sqrt((parts**2).sum()))
        if fixed and (
            change_m.max() <= settings.tolerance or change <= settings.relative_tolerance
        ):
            return fitted
        x = fitted.solution.x
        if before is not None:
            relaxation = _anderson_factor(parts, system.whiten_change(fitted.solution, before[1]))
            x = x - relaxation * (x - before[0])
        before = fitted.solution.x, step
    raise _not_converged(shared, change_m, change, settings)


def _anderson_factor(now: Floats, before: Floats) -> float:
    """Fraction of the last step to undo (Anderson, depth 1); negative extends the step."""
    difference = now - before
    square = float(difference @ difference)
    if square == 0:
        return 0.0
    # minimises |now - a (now - before)|; growing steps are not extended
    lower = 0.0 if now @ now > before @ before else -_MAX_EXTENSION
    return float(np.clip(now @ difference / square, lower, _MAX_DAMPING))


def _not_converged(
    shared: SharedCells, change_m: Floats, change: float, settings: NetworkSettings
) -> TrueTerrainError:
    worst = int(np.argmax(change_m))
    moving = np.unique(shared.pass_index[change_m > settings.tolerance])
    names = dict.fromkeys(shared.names[k] for k in (shared.pass_index[worst], *moving))
    name, entries = next(iter(names)), shared.entries
    others = f" (of {', '.join(list(names)[1:])} by less)" if len(names) > 1 else ""
    return TrueTerrainError(
        f"the adjustment did not converge in {settings.max_iterations} iterations: the correction "
        f"of {name} still changes by {1e3 * change_m[worst]:.3g} mm at easting "
        f"{entries.easting[worst]:.1f} m and northing {entries.northing[worst]:.1f} m{others}; all "
        f"together by up to {change:.2g} standard deviations, more than the relative tolerance of "
        f"{settings.relative_tolerance:g}",
        cure=f"Leave {name} out if it is not of the same ground, or raise max_iterations "
        "or relative_tolerance (--max-iterations, --relative-tolerance).",
    )


def gross_errors(shared: SharedCells, fitted: WeightedFit, bound: float) -> npt.NDArray[np.bool_]:
    """Gross errors: entries so large that they would bias fine corrections.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    fitted : WeightedFit
        Coarse corrections, which a few cells cannot bias.
    bound : float
        Bound in standard deviations.

    Returns
    -------
    numpy.ndarray of bool, shape (n,)
        True for gross errors.
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
    """Adjust with Tukey's weights, starting from Huber's: outliers get no weight.

    Parameters
    ----------
    system : AdjustmentSystem
        The unknowns.
    prior : mapping of str to ComponentPrior
        Prior of each component.
    before : WeightedFit
        Start values.
    bound : float
        Standard deviations beyond which a cell is rejected.
    factor : float
        Design effect, by which all variances are multiplied.

    Returns
    -------
    WeightedFit
        After a fixed number of iterations.
    """
    shared = system.shared
    variance = shared.entries.variance + before.floor**2
    _, redundancy = entry_residuals(shared, before.correction, shared.usable / variance)
    fitted, known = before, system.known(prior)
    for _ in range(_STEPS):
        height = shared.entries.height + fitted.correction
        # keep weights above 0: redescending weights could not recover from 0
        weight = shared.usable * np.maximum(fitted.robustness, 1e-9) / variance
        out, _ = entry_residuals(shared, height, weight)
        beyond = np.minimum(out**2 / (np.maximum(redundancy, 1e-9) * variance * bound**2), 1.0)
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
    """Design effect: variance of sums over squares of ground over that of independent cells.

    Errors of neighbouring cells are correlated, so a mean of them has a greater variance (Kish
    1965).

    Parameters
    ----------
    shared : SharedCells
        The observations.
    fitted : WeightedFit
        Corrections and weights.
    size : float
        Side of the squares [m].

    Returns
    -------
    float
        Factor of variances, at least 1.
    """
    residual, _ = entry_residuals(shared, shared.entries.height + fitted.correction, fitted.weight)
    _, index = np.unique(shared.squares(size), return_inverse=True)
    key = shared.per_entry(index.astype(np.int64)) * len(shared.names) + shared.pass_index
    alone, together = _grouped_sums(key, fitted.weight * residual)
    return max(1.0, together / alone) if alone > 0 else 1.0


def variance_factor(shared: SharedCells, fitted: WeightedFit) -> float:
    """Variance factor of the weighted residuals: 1 if the weights are inverse variances.

    Robust weights decrease with the residuals, so weighted sums scatter less than the weights say.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    fitted : WeightedFit
        Corrections and weights.

    Returns
    -------
    float
        sum (w v)² / sum (w r), r being the redundancy numbers.
    """
    residual, redundancy = entry_residuals(
        shared, shared.entries.height + fitted.correction, fitted.weight
    )
    expected = float((fitted.weight * redundancy).sum())
    return float(((fitted.weight * residual) ** 2).sum()) / expected if expected > 0 else 1.0


def estimate_residual_sd(system: AdjustmentSystem, fitted: WeightedFit) -> float:
    """Standard deviation of the drift that the corrections are too coarse for.

    It is the covariance of the residuals of cells that a pass sees at the same time.

    Parameters
    ----------
    system : AdjustmentSystem
        The unknowns.
    fitted : WeightedFit
        Corrections and weights.

    Returns
    -------
    float
        Residual standard deviation [m].
    """
    shared, entries = system.shared, system.shared.entries
    residual, redundancy = entry_residuals(
        shared, entries.height + fitted.correction, fitted.weight
    )
    step = max(one.spacing for one in system.knots if one is not None) / _PARTS
    at = np.floor((entries.time - shared.span[shared.pass_index, 0]) / step).astype(np.int64)
    key = shared.pass_index * (at.max() + 1) + at
    alone, together = _grouped_sums(key, fitted.weight * residual)
    # subtracting the mean of a cell reduces the errors of its passes: v_i = r_i e_i - sum w_j e_j
    moving = ~shared.fixed[shared.pass_index]
    part = np.where(moving, 1.0 - redundancy, 0.0)
    of_all = shared.per_entry(np.add.reduceat(part**2, shared.start[:-1]))
    own, all_ = _grouped_sums(
        key, fitted.weight * np.sqrt(of_all + np.where(moving, redundancy**2 - part**2, 0.0))
    )
    if all_ <= own * (1.0 + 1e-9):
        return 0.0
    return float(np.sqrt(max(0.0, together - alone) / (all_ - own)))


def _grouped_sums(key: Integers, values: Floats) -> tuple[float, float]:
    """Sum of squares of some values, and of their sums over equal keys."""
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
    """Noise floor: standard deviation of the heights of cells in addition to their scatter.

    Two passes sample the texture of the ground at different places. The floor is that for which
    the median of the squared standardised deviations is the median of chi-square.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    height : numpy.ndarray, shape (n,)
        Corrected heights [m].
    guess : float
        Start value [m].

    Returns
    -------
    float
        At least 1 µm [m].
    """
    sample = np.arange(0, shared.cells, max(1, shared.cells // _SAMPLE))
    each = np.diff(shared.start)[sample]
    start = np.concatenate([[0], np.cumsum(each)]).astype(np.int64)
    pick = np.repeat(shared.start[sample] - start[:-1], each) + np.arange(start[-1])
    height, variance, usable = height[pick], shared.entries.variance[pick], shared.usable[pick]
    out = np.empty(pick.size)

    def excess(floor: float) -> float:
        _kernels.standardised_deviations(start, height, variance + floor**2, usable, out)
        return float(np.median(out[usable] ** 2)) - _CHI2_MEDIAN

    low, high = 1e-6, guess
    if excess(low) <= 0:
        return low
    while excess(high) > 0:
        low, high = high, 2.0 * high
    while high - low > _STEADY * high:
        midpoint = 0.5 * (low + high)
        low, high = (midpoint, high) if excess(midpoint) > 0 else (low, midpoint)
    return high


def entry_residuals(shared: SharedCells, height: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Residuals of the entries.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    height, weight : numpy.ndarray, shape (n,)
        Heights [m] and their weights [1/m²].

    Returns
    -------
    residual : numpy.ndarray, shape (n,)
        Heights less the weighted mean of their cell [m].
    redundancy : numpy.ndarray, shape (n,)
        Redundancy numbers: 1 less the weight of the entry over that of its cell [1].
    """
    residual, redundancy = np.empty(height.size), np.empty(height.size)
    _kernels.cell_residuals(shared.start, height, weight, residual, redundancy)
    return residual, redundancy
