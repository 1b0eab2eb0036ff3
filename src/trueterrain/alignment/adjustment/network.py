"""Many passes, one ground: one least-squares adjustment of all of them at once.

Passes over the same road disagree because their navigation drifts. Each gets a correction that
follows its time, a spline for its height and, where the data tell it, for its roll, pitch and
horizontal place. All are estimated together from the cells that two or more passes saw; the
unknown height of each cell is eliminated, so what is left to solve is sparse, and its cost grows
with the length of the road.

Differences between passes do not tell what all have in common. The datum is the mean of the passes:
the mean of their corrections, each over its whole time, is 0, unless some are fixed or control is
given. What is common to all of them otherwise is as uncertain as the prior says.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment import _kernels
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
    fit_corrections,
    fit_tukey,
    gross_errors,
    left_over,
    variance_factor,
)
from trueterrain.alignment.adjustment.shared_cells import (
    SharedCells,
    find_shared_cells,
    sample_ground,
)
from trueterrain.alignment.adjustment.spline import SplineCorrection
from trueterrain.alignment.adjustment.system import AdjustmentSystem, build_system
from trueterrain.alignment.agreement import (
    LoopClosure,
    PairAgreement,
    PassDriftTest,
    ScreenedDifferences,
    closures_of,
    drift_tests,
    pairs_of,
)
from trueterrain.alignment.observations.cells import PassCells
from trueterrain.alignment.settings import ModelTrial, NetworkSettings
from trueterrain.core.progress import Progress, no_progress

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_GROSS = 4.0  # times further away than what is rejected, with coarse corrections

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
    """What a pass saw and the others did not: vehicles, leaves, puddles."""

    lane: npt.NDArray[np.str_]
    "Name of the pass, shape (n,)."

    cell: Integers
    "Number of the cell, shape (n,)."

    easting: Floats
    "Where it lies [m], shape (n,)."

    northing: Floats
    "Where it lies [m], shape (n,)."

    misfit: Floats
    "Corrected height less that of the ground by what was not rejected there [m], shape (n,)."

    def __len__(self) -> int:
        """How many there are."""
        return self.cell.size


@dataclass(frozen=True, kw_only=True, eq=False)
class AdjustedGround:
    """Ground that at least two passes saw, after the adjustment."""

    cell: Integers
    "Number of the cell, ascending, shape (n,)."

    easting: Floats
    "Mean place of what was seen [m], shape (n,)."

    northing: Floats
    "Mean place of what was seen [m], shape (n,)."

    height: Floats
    "Weighted mean of the corrected heights [m], shape (n,); NaN where all were rejected."

    sd: Floats
    "Its standard deviation relative to the datum, that of the corrections included [m]."

    before: Floats
    "Greatest less least height of the passes as measured [m], shape (n,)."

    after: Floats
    "The same after the adjustment [m], shape (n,)."


@dataclass(frozen=True, kw_only=True, eq=False)
class Adjustment:
    """Passes brought into agreement."""

    corrections: tuple[SplineCorrection, ...]
    "What is to be added to each pass, in the order of their names; fixed ones are not there."

    groups: tuple[tuple[str, ...], ...]
    "Passes that share ground, directly or by others; each group has a datum of its own."

    datum_sd: Mapping[str, float | None]
    """Standard deviation of the datum of each pass [m], fixed passes too: of the height error that
    all passes of its group have in common, and that no difference between them shows. None where
    neither navigation nor control says anything about it."""

    tests: tuple[PassDriftTest, ...]
    "Whether what the passes differ by could be noise: each pass, then all together."

    pairs: tuple[PairAgreement, ...]
    "How each pair of passes agrees before and after."

    closures: tuple[LoopClosure, ...]
    "Loops of passes before and after."

    rejected: RejectedCells
    "Cells that were left out."

    ground: AdjustedGround
    "Cells that at least two passes saw."

    trials: tuple[ModelTrial, ...]
    "What was tried: stiff, loose, with and without components."

    chosen: ModelTrial
    "The one that was taken."

    noise_floor: float
    "Standard deviation that cells have beside that of their own scatter [m]."

    design_effect: float
    "By how much variances are greater because errors of neighbouring cells are alike [1]."

    left: float
    "Standard deviation that corrections leave: what cells of a square still have in common [m]."

    iterations: int
    "Iterations until weights and corrections had converged."

    settings: NetworkSettings
    "What was asked for."

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the passes that were corrected."""
        return tuple(one.name for one in self.corrections)

    def correction(self, name: str) -> SplineCorrection:
        """Correction of one pass.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        Correction
            What is to be added to it.

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
        """Pairs of passes that do not differ anywhere: the same data given twice."""
        return tuple((pair.first, pair.second) for pair in self.pairs if pair.before.rmse == 0)

    @property
    def omitted(self) -> tuple[str, ...]:
        """Components that were asked for, but that the data do not tell."""
        asked = [name for group in self.settings.extra_components for name in group]
        return tuple(name for name in asked if name not in self.chosen.components)


def adjust_passes(
    lanes: Sequence[PassCells],
    *,
    control: Sequence[PassCells] = (),
    fixed: Sequence[str] = (),
    settings: NetworkSettings = NetworkSettings(),
    progress: Progress = no_progress,
) -> Adjustment:
    """Bring passes into agreement.

    Parameters
    ----------
    lanes : sequence of LaneCells
        What each pass saw of the cells of a common grid.
    control : sequence of LaneCells
        Control points or surfaces in the same cells, with the variances of their heights.
    fixed : sequence of str
        Names of passes that are right and get no correction.
    settings : NetworkSettings
        How.
    progress : callable, optional
        Called with what is done, and how much of it.

    Returns
    -------
    Adjustment
        Corrections with their covariance, and how well the passes agree before and after.

    Raises
    ------
    ValueError
        If names are not unique, or a fixed pass is not there.
    CoverageError
        If no cell is seen by two passes, or twice by one.
    TrueTerrainError
        If the adjustment does not converge.

    Notes
    -----
    The height of a cell by a pass is that of the ground less the correction, plus noise of its own
    variance and a floor, which the data tell, for the texture of the ground. Corrections are a
    constant, which is free, and a Gauss-Markov process about it, in proportion to what the
    navigation says of its own height. Its strength, the spacing of the knots and the components
    are those that predict whole squares of ground held back best; of several that do about equally
    well, by their standard error, the stiffest is taken. That says what passes differ by. What they
    have in common no pass can tell; standard deviations take it to be as large as what they differ
    by and what the navigation claims, pooled by their degrees of freedom. Weights are Huber's until
    all has converged, then Tukey's for a few steps, which leave out what moved between the passes.

    Examples
    --------
    Two passes that differ by 10 mm:

    >>> from trueterrain.alignment import lane_cells
    >>> rng = np.random.default_rng(1)
    >>> cell, time, ground = np.arange(400), np.arange(400) * 0.1, rng.normal(0, 0.05, 400)
    >>> passes = [
    ...     lane_cells(name, cell, time, ground + up + rng.normal(0, 1e-3, 400), variance=1e-6,
    ...                easting=0.5 * cell)
    ...     for name, up in (("east", 0.005), ("west", -0.005))]
    >>> adjust(passes).correction("east")([0.0, 20.0]).round(3)
    array([-0.005, -0.005])
    """
    progress("compare passes", 0, None)
    shared = find_shared_cells(lanes, control, fixed)
    by_name = {one.name: one for one in lanes}
    lanes_sd = [_navigation_sd(by_name.get(name)) for name in shared.names]
    coarse = build_system(shared, ("height",), settings.knot_spacings[0], lanes_sd)
    gross = gross_errors(shared, fit_unconstrained(coarse, settings), _GROSS * settings.tukey)
    shared = replace(shared, usable=~gross)
    part, of = sample_ground(shared, settings.sample)
    search = ModelSearch(part, settings, [lanes_sd[k] for k in of], progress)
    chosen = search.run()
    progress("adjust", 0, None)
    system = build_system(shared, chosen.components, chosen.knot_spacing, lanes_sd)
    prior = trial_priors(chosen, settings)
    start = fit_corrections(system, prior, settings)
    factor = design_effect(shared, start, settings.cluster)
    fitted = fit_tukey(system, prior, start, bound=settings.tukey, factor=factor)
    left = left_over(system, fitted)
    progress("say how sure it is", 0, None)
    measured = shared.entries.height
    after = measured + fitted.correction
    folds = folds_of(shared, settings)
    whole, parts = parts_of(system, folds, fitted.weight)
    claims = navigation_priors(system, fitted, chosen, settings, lanes_sd)
    covariance = system.covariance(system.solve(whole, system.known(claims)))
    held_out = measured + cross_validate(system, prior, folds, whole, parts)
    pairs = pairs_of(shared, fitted.robustness, measured, after, held_out)
    ground = _adjusted_ground(system, fitted, covariance)
    datum = estimate_datum_sd(shared, lanes_sd, claims["height"].wander, list(by_name), settings)
    return Adjustment(
        corrections=_pass_corrections(system, fitted, covariance, left, datum),
        datum_sd=datum,
        groups=tuple(
            tuple(shared.names[p] for p in np.flatnonzero(shared.group == group))
            for group in np.unique(shared.group)
        ),
        tests=tuple(drift_tests(system, whole, factor * variance_factor(shared, fitted))),
        pairs=tuple(pairs),
        closures=tuple(closures_of(pairs)),
        rejected=_rejected_cells(shared, fitted, ground),
        ground=ground,
        trials=tuple(search.trials),
        chosen=chosen,
        noise_floor=fitted.floor,
        design_effect=factor,
        left=left,
        iterations=fitted.iterations,
        settings=settings,
    )


def _navigation_sd(lane: PassCells | None) -> Floats:
    """Times and standard deviations of the navigation, shape (2, m); empty if there are none."""
    if lane is None or lane.sd_time is None or lane.sd_height is None:
        return np.zeros((2, 0))
    return np.stack([lane.sd_time, lane.sd_height])


def _pass_corrections(
    system: AdjustmentSystem,
    fitted: WeightedFit,
    covariance: Floats,
    left: float,
    datum: Mapping[str, float | None],
) -> tuple[SplineCorrection, ...]:
    own = covariance[: system.first[-1]]  # the pairs of each interval with itself come first
    seen = np.bincount(
        system.interval[(system.interval >= 0) & (fitted.robustness > 0)],
        minlength=int(system.first[-1]),
    )
    found = []
    for lane, knots in enumerate(system.knots):
        if knots is None:
            continue
        coefficients, offsets = system.lane_unknowns(lane)
        part = slice(system.first[lane], system.first[lane + 1])
        offset = fitted.solution.x[offsets]
        found.append(
            SplineCorrection(
                name=system.shared.names[lane],
                knots=knots,
                components=system.components,
                coefficients=fitted.solution.x[coefficients] + offset[:, None],
                offset=offset,
                covariance=own[part],
                supported=seen[part] > 0,
                left=left,
                datum_sd=datum.get(system.shared.names[lane]),
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
    spread = [
        np.maximum.reduceat(values, first) - np.minimum.reduceat(values, first)
        for values in (entries.height, height)
    ]
    return AdjustedGround(
        cell=entries.cell[first],
        easting=shared.mean(entries.easting),
        northing=shared.mean(entries.northing),
        height=mean,
        sd=np.sqrt(np.maximum(variance, 0.0)),
        before=spread[0],
        after=spread[1],
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
    # where nothing is left, the mean of all says at least how far apart they are
    around = np.where(np.isnan(ground.height), mean, ground.height)
    return RejectedCells(
        lane=np.array(shared.names)[shared.lane[out]],
        cell=entries.cell[out],
        easting=entries.easting[out],
        northing=entries.northing[out],
        misfit=height[out] - around[cell],
    )
