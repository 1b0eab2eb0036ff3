"""Network adjustment: one least-squares adjustment of all passes.

Passes over the same road disagree because their navigation drifts. Each pass gets a correction as a
function of time: a spline for its height and, where observable, for its roll, pitch and horizontal
position. All corrections are estimated together from the cells that two or more passes have in
common. The unknown height of each cell is eliminated, so the normal matrix is sparse, and the cost
grows linearly with the length of the road.

Errors that all passes have in common are unobservable from differences between them. The datum is
the mean of the passes: the mean of their corrections over time is 0, unless passes are fixed or
control points are given. The uncertainty of that mean follows from the prior.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.adjustment.agreement import (
    LoopClosure,
    PairAgreement,
    PassDriftTest,
    ScreenedDifferences,
    drift_tests,
    loop_closures,
    pair_agreements,
)
from trueterrain.alignment.adjustment.model_search import (
    ModelSearch,
    cross_validate,
    fit_unconstrained,
    folds_of,
    parts_of,
    trial_priors,
)
from trueterrain.alignment.adjustment.navigation_prior import estimate_datum_sd, navigation_priors
from trueterrain.alignment.adjustment.robust_weights import (
    WeightedFit,
    design_effect,
    estimate_residual_sd,
    fit_corrections,
    fit_tukey,
    gross_errors,
    variance_factor,
)
from trueterrain.alignment.adjustment.shared_cells import (
    SharedCells,
    find_shared_cells,
    sample_ground,
)
from trueterrain.alignment.adjustment.spline import SplineCorrection
from trueterrain.alignment.adjustment.system import AdjustmentSystem, build_system
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.settings import ModelTrial, NetworkSettings
from trueterrain.core.progress import Progress, no_progress

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_GROSS = 4.0  # times the bound of Tukey's weights, beyond which coarse corrections reject a cell

__all__ = [
    "AdjustedGround",
    "Adjustment",
    "LoopClosure",
    "ModelTrial",
    "NetworkSettings",
    "PairAgreement",
    "PassDriftTest",
    "RejectedCells",
    "ScreenedDifferences",
    "adjust_passes",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class RejectedCells:
    """Rejected cells: objects that one pass saw and others did not, such as vehicles or puddles."""

    name: npt.NDArray[np.str_]
    "Name of the pass, shape (n,)."

    cell: Integers
    "Number of the cell, shape (n,)."

    easting: Floats
    "Mean position of its returns [m], shape (n,)."

    northing: Floats
    "Mean position of its returns [m], shape (n,)."

    misfit: Floats
    "Corrected height less that of the ground from accepted entries [m], shape (n,)."

    def __len__(self) -> int:
        """Number of rejected cells."""
        return self.cell.size


@dataclass(frozen=True, kw_only=True, eq=False)
class AdjustedGround:
    """Adjusted heights of the cells that at least two passes saw."""

    cell: Integers
    "Number of the cell, ascending, shape (n,)."

    easting: Floats
    "Mean position of the returns [m], shape (n,)."

    northing: Floats
    "Mean position of the returns [m], shape (n,)."

    height: Floats
    "Weighted mean of the corrected heights [m], shape (n,); NaN if all entries are rejected."

    sd: Floats
    "Standard deviation relative to the datum, uncertainty of the corrections included [m]."

    before: Floats
    "Range of the heights of the passes before the adjustment [m], shape (n,)."

    after: Floats
    "Range after the adjustment [m], shape (n,)."


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment:
    """Result of the network adjustment."""

    corrections: tuple[SplineCorrection, ...]
    "Corrections to add to each pass, ordered by name; fixed passes have none."

    groups: tuple[tuple[str, ...], ...]
    "Passes connected by common cells, directly or by others; each group has its own datum."

    datum_sd: Mapping[str, float | None]
    """Standard deviation of the datum of each pass [m], fixed passes included: of the height error
    that all passes of its group have in common, which is unobservable. None if neither navigation
    nor control points give it."""

    tests: tuple[PassDriftTest, ...]
    "Tests of the hypothesis that the differences are noise: each pass, then all together."

    pairs: tuple[PairAgreement, ...]
    "Agreement of each pair of passes before and after."

    closures: tuple[LoopClosure, ...]
    "Closures of loops of passes before and after."

    rejected: RejectedCells
    "Rejected cells."

    ground: AdjustedGround
    "Adjusted cells."

    trials: tuple[ModelTrial, ...]
    "Models that were tried."

    chosen: ModelTrial
    "The model that was chosen."

    noise_floor: float
    "Standard deviation of the heights of cells in addition to that of their scatter [m]."

    design_effect: float
    "Design effect: factor of variances, since errors of neighbouring cells are correlated [1]."

    residual_sd: float
    "Standard deviation of errors that cells seen at the same time have in common [m]."

    iterations: int
    "Iterations until the corrections converged."

    settings: NetworkSettings
    "Settings of the adjustment."

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the corrected passes."""
        return tuple(one.name for one in self.corrections)

    def correction(self, name: str) -> SplineCorrection:
        """Correction of one pass.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        SplineCorrection
            Correction to add to it.

        Raises
        ------
        ValueError
            If there is none of this name.
        """
        if name not in self._by_name:
            message = f"name must be one of {', '.join(self.names)}, got {name!r}."
            raise ValueError(message)
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, SplineCorrection]:
        return {one.name: one for one in self.corrections}

    @property
    def identical(self) -> tuple[tuple[str, str], ...]:
        """Pairs of passes without any difference: the same data given twice."""
        return tuple((pair.first, pair.second) for pair in self.pairs if pair.before.rmse == 0)

    @property
    def omitted(self) -> tuple[str, ...]:
        """Requested components that are unobservable or do not improve the prediction."""
        asked = [name for group in self.settings.extra_components for name in group]
        return tuple(name for name in asked if name not in self.chosen.components)


def adjust_passes(
    passes: Sequence[PassCells],
    *,
    control: Sequence[PassCells] = (),
    fixed: Sequence[str] = (),
    settings: NetworkSettings = NetworkSettings(),
    progress: Progress = no_progress,
) -> Adjustment:
    """Align passes by one least-squares adjustment.

    The main method of alignment; use the discontinuity vectors to compare with the thesis.

    Parameters
    ----------
    passes : sequence of PassCells
        Cells of each pass in a common grid.
    control : sequence of PassCells
        Control points or surfaces in the same cells, with the variances of their heights.
    fixed : sequence of str
        Names of passes that define the datum and get no correction.
    settings : NetworkSettings
        Settings of the adjustment.
    progress : callable, optional
        Called with a task, the amount done and the total.

    Returns
    -------
    Adjustment
        Corrections with their covariance, and agreement before and after.

    Raises
    ------
    ValueError
        If names are not unique, or a fixed pass is unknown.
    CoverageError
        If no cell is seen by two passes, or twice by one pass.
    TrueTerrainError
        If the adjustment does not converge.

    Notes
    -----
    Observation equation: the height of a cell in a pass is that of the ground less the correction,
    plus noise. The variance of the noise is that of the scatter in the cell plus a noise floor for
    the texture of the ground, estimated from the residuals. A correction is a constant, which is
    free, and a Gauss-Markov process about it, scaled with the reported standard deviation of the
    height. Its strength, the spacing of the knots and the components are chosen by
    cross-validation with whole squares of ground held out; of models that predict equally well
    within the standard error the most likely is taken.

    Differences give the relative drift of passes. The drift that they have in common is
    unobservable; for standard deviations it is assumed to be as large as the relative drift and as
    the reported standard deviations, pooled by their degrees of freedom. Weights are Huber's until
    convergence, then Tukey's for a few steps, which reject objects that moved between the passes.

    Examples
    --------
    Two passes that differ by 10 mm:

    >>> from trueterrain.alignment import make_pass_cells
    >>> rng = np.random.default_rng(1)
    >>> cell, time, ground = np.arange(400), np.arange(400) * 0.1, rng.normal(0, 0.05, 400)
    >>> passes = [
    ...     make_pass_cells(name, cell, time, ground + up + rng.normal(0, 1e-3, 400), variance=1e-6,
    ...                easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))]
    >>> adjust_passes(passes).correction("east")([0.0, 20.0]).round(3)
    array([-0.005, -0.005])
    """
    progress("compare passes", 0, None)
    shared = find_shared_cells(passes, control, fixed)
    by_name = {one.name: one for one in passes}
    navigation_sd = [_reported_sd(by_name.get(name)) for name in shared.names]
    coarse = build_system(shared, ("height",), settings.knot_spacings[0], navigation_sd)
    gross = gross_errors(shared, fit_unconstrained(coarse, settings), _GROSS * settings.tukey)
    shared = replace(shared, usable=~gross)
    part, of = sample_ground(shared, settings.sample)
    search = ModelSearch(part, settings, [navigation_sd[k] for k in of], progress)
    chosen = search.run()
    progress("adjust", 0, None)
    system = build_system(shared, chosen.components, chosen.knot_spacing, navigation_sd)
    prior = trial_priors(chosen, settings)
    start = fit_corrections(system, prior, settings)
    factor = design_effect(shared, start, settings.cluster)
    fitted = fit_tukey(system, prior, start, bound=settings.tukey, factor=factor)
    residual_sd = estimate_residual_sd(system, fitted)
    progress("estimate the covariance", 0, None)
    measured = shared.entries.height
    after = measured + fitted.correction
    folds = folds_of(shared, settings)
    whole, parts = parts_of(system, folds, fitted.weight)
    priors = navigation_priors(system, fitted, chosen, settings, navigation_sd)
    covariance = system.covariance(system.solve(whole, system.known(priors)))
    held_out = measured + cross_validate(system, prior, folds, whole, parts)
    pairs = pair_agreements(shared, fitted.robustness, measured, after, held_out)
    ground = _adjusted_ground(system, fitted, covariance)
    datum = estimate_datum_sd(
        shared, navigation_sd, priors["height"].process, list(by_name), settings
    )
    return Adjustment(
        corrections=_pass_corrections(system, fitted, covariance, residual_sd, datum),
        datum_sd=datum,
        groups=tuple(
            tuple(shared.names[p] for p in np.flatnonzero(shared.group == group))
            for group in np.unique(shared.group)
        ),
        tests=tuple(drift_tests(system, whole, factor * variance_factor(shared, fitted))),
        pairs=tuple(pairs),
        closures=tuple(loop_closures(pairs)),
        rejected=_rejected_cells(shared, fitted, ground),
        ground=ground,
        trials=tuple(search.trials),
        chosen=chosen,
        noise_floor=fitted.floor,
        design_effect=factor,
        residual_sd=residual_sd,
        iterations=fitted.iterations,
        settings=settings,
    )


def _reported_sd(cells: PassCells | None) -> Floats:
    """Times [s] and reported standard deviations of the height [m], (2, m); empty if none."""
    if cells is None or cells.sd_time is None or cells.sd_height is None:
        return np.zeros((2, 0))
    return np.stack([cells.sd_time, cells.sd_height])


def _pass_corrections(
    system: AdjustmentSystem,
    fitted: WeightedFit,
    covariance: Floats,
    residual_sd: float,
    datum: Mapping[str, float | None],
) -> tuple[SplineCorrection, ...]:
    own = covariance[: system.first[-1]]  # pairs of each interval with itself come first
    seen = np.bincount(
        system.interval[(system.interval >= 0) & (fitted.robustness > 0)],
        minlength=int(system.first[-1]),
    )
    found = []
    for pass_index, knots in enumerate(system.knots):
        if knots is None:
            continue
        coefficients, offsets = system.pass_unknowns(pass_index)
        part = slice(system.first[pass_index], system.first[pass_index + 1])
        offset = fitted.solution.x[offsets]
        found.append(
            SplineCorrection(
                name=system.shared.names[pass_index],
                knots=knots,
                components=system.components,
                coefficients=fitted.solution.x[coefficients] + offset[:, None],
                offset=offset,
                covariance=own[part],
                supported=seen[part] > 0,
                residual_sd=residual_sd,
                datum_sd=datum.get(system.shared.names[pass_index]),
            )
        )
    return tuple(found)


def _adjusted_ground(
    system: AdjustmentSystem, fitted: WeightedFit, covariance: Floats
) -> AdjustedGround:
    shared = system.shared
    entries, first = shared.entries, shared.start[:-1]
    height = entries.height + fitted.correction
    mean, variance = np.empty(shared.cells), np.empty(shared.cells)
    head, after, _, second = system.lists
    _kernels.cell_means(
        shared.start,
        system.interval,
        system.weights,
        system.factor,
        fitted.weight,
        height,
        head,
        second,
        after,
        covariance,
        mean,
        variance,
    )
    ranges = [
        np.maximum.reduceat(values, first) - np.minimum.reduceat(values, first)
        for values in (entries.height, height)
    ]
    return AdjustedGround(
        cell=entries.cell[first],
        easting=shared.mean(entries.easting),
        northing=shared.mean(entries.northing),
        height=mean,
        sd=np.sqrt(np.maximum(variance, 0.0)),
        before=ranges[0],
        after=ranges[1],
    )


def _rejected_cells(
    shared: SharedCells, fitted: WeightedFit, ground: AdjustedGround
) -> RejectedCells:
    out = np.flatnonzero(fitted.robustness == 0)
    cell = np.searchsorted(shared.start, out, side="right") - 1
    entries = shared.entries
    height = entries.height + fitted.correction
    first = shared.start[:-1]
    mean = np.add.reduceat(height, first) / np.diff(shared.start)
    # if all entries of a cell are rejected, compare with their mean
    ground_height = np.where(np.isnan(ground.height), mean, ground.height)
    return RejectedCells(
        name=np.array(shared.names)[shared.pass_index[out]],
        cell=entries.cell[out],
        easting=entries.easting[out],
        northing=entries.northing[out],
        misfit=height[out] - ground_height[cell],
    )
