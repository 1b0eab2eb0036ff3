"""Choice of the stochastic model of the corrections by cross-validation.

Whole squares of ground are held out in turn and predicted by the corrections from the others, since
errors of neighbouring cells are correlated. Of models that predict equally well within the standard
error, the one with the greatest marginal likelihood is taken: it prefers stiff corrections unless
the data require flexible ones.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment.normal_equations import ComponentPrior, NormalEquations
from trueterrain.alignment.adjustment.robust_weights import (
    WeightedFit,
    entry_residuals,
    fit_corrections,
)
from trueterrain.alignment.adjustment.shared_cells import SharedCells, hash_integers
from trueterrain.alignment.adjustment.spline import GaussMarkovProcess
from trueterrain.alignment.adjustment.system import AdjustmentSystem, build_system
from trueterrain.alignment.settings import ModelTrial, NetworkSettings
from trueterrain.core.progress import Progress

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Correlation time of the drift, measured from two drives over one road [s].
CORRELATION_TIME = 25.0

_STEPS = (
    0.0,
    1e-4,
    3e-4,
    1e-3,
    3e-3,
    1e-2,
    3e-2,
    0.1,
    0.3,
)  # [m] standard deviations of the drift to try
_HALVINGS = 12
_SQUARES = 20  # of the ground at least: the standard error of fewer is not reliable
_SIMILAR = 2.0  # difference of log likelihoods below which two models are equally likely
_FINER = (10.0**0.25, 10.0**0.125)  # factors of the strength in the refinement
_BROAD = 3e-2  # [m] drift with which the weights are estimated


@dataclass(frozen=True, kw_only=True, eq=False)
class CrossValidationFolds:
    """Folds of the cross-validation."""

    number: Integers
    "Fold of each cell, shape (cell,)."

    square: Integers
    "Square of each cell, from 0, shape (cell,)."

    count: int
    "Number of folds."


def folds_of(shared: SharedCells, settings: NetworkSettings) -> CrossValidationFolds:
    """Assign squares of ground to folds, by a hash of their position.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    settings : NetworkSettings
        Size of the squares, number of folds.

    Returns
    -------
    CrossValidationFolds
        The same for the same ground, whatever else is measured.
    """
    min_squares = min(_SQUARES, shared.cells)
    for halved in range(_HALVINGS):
        size = settings.block * 0.5**halved
        squares, index = np.unique(shared.squares(size), return_inverse=True)
        if squares.size >= min_squares:
            break
    else:  # cells without positions: consecutive numbers stand for neighbours
        index = np.arange(shared.cells) * min_squares // shared.cells
        squares = np.arange(min_squares)
    number = hash_integers(squares) % settings.folds
    return CrossValidationFolds(
        number=number[index].astype(np.int64), square=index.astype(np.int64), count=settings.folds
    )


class ModelSearch:
    """Search for the model of the corrections that predicts held-out cells best.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    settings : NetworkSettings
        Range of the search.
    navigation_sd : sequence of numpy.ndarray
        Times and reported standard deviations of each pass, shape (2, m).
    progress : callable
        Called with each trial.
    """

    def __init__(
        self,
        shared: SharedCells,
        settings: NetworkSettings,
        navigation_sd: Sequence[Floats],
        progress: Progress,
    ) -> None:
        self.shared = shared
        self.settings = settings
        self.folds = folds_of(shared, settings)
        self.trials: list[ModelTrial] = []
        self._losses: list[Floats] = []
        self._systems: dict[tuple[tuple[str, ...], float], AdjustmentSystem] = {}
        self._parts: dict[
            tuple[tuple[str, ...], float], tuple[NormalEquations, list[NormalEquations]]
        ] = {}
        self._navigation_sd = navigation_sd
        self._progress = progress
        self.weight = self.robustness = np.zeros(0)

    def system(self, components: tuple[str, ...], spacing: float) -> AdjustmentSystem:
        """System for some components and knot spacing."""
        key = components, spacing
        if key not in self._systems:
            for old in list(self._systems)[:-1]:  # large, and not needed any more
                del self._systems[old]
                self._parts.pop(old, None)
            self._systems[key] = build_system(self.shared, components, spacing, self._navigation_sd)
        return self._systems[key]

    def prior(self, trial: ModelTrial) -> dict[str, ComponentPrior]:
        """Priors of the components of a trial."""
        return trial_priors(trial, self.settings)

    def run(self) -> ModelTrial:
        """Search from few components and coarse knots to many and fine.

        Returns
        -------
        ModelTrial
            The chosen model.
        """
        start = ModelTrial(components=("height",), knot_spacing=0.0, strength=0.0, order="first")
        while True:
            best = self._height(start)
            extended = self._add_component(best)
            if extended is best:
                return best
            # residuals are smaller now, so weights change and finer knots may pay
            start = replace(extended, round=extended.round + 1)

    def _height(self, start: ModelTrial) -> ModelTrial:
        """Strength, order and spacing for given components, with weights estimated for them."""
        spacings = self._spacings()
        system = self.system(start.components, spacings[-1])
        first = fit_unconstrained(system, self.settings)
        self.weight, self.robustness = first.weight, first.robustness
        self._parts.clear()
        best: ModelTrial | None = None
        strengths = dict.fromkeys(self.settings.orders, self._steps)
        for spacing in spacings:
            each = [
                self._best_of(
                    [
                        replace(start, knot_spacing=spacing, strength=strength, order=order)
                        for strength in strengths[order]
                    ]
                )
                for order in self.settings.orders
            ]
            found = self._refined(self._likeliest(each))
            strengths = {
                one.order: self._near(found.strength if one.order == found.order else one.strength)
                for one in each
            }
            gain = np.inf if best is None else found.log_likelihood - best.log_likelihood
            if best is not None and (gain < -_SIMILAR or self._better(best, found, 1.0)):
                break
            best = found
            if best.strength == 0 or gain < _SIMILAR:
                break  # finer knots would give the same
        assert best is not None
        return best

    def _add_component(self, best: ModelTrial) -> ModelTrial:
        """Trial with the component that improves the prediction most, if one does significantly."""
        left = [
            group
            for group in self.settings.extra_components
            if not set(group) <= set(best.components)
        ]
        found = [self._with(best, group) for group in left]
        return max([best, *found], key=lambda one: self._gain(best, one))

    def _near(self, strength: float) -> Sequence[float]:
        if self.settings.strength is not None or strength == 0:
            return (strength,)
        return self._limited((strength / _FINER[0], strength, strength * _FINER[0]))

    @property
    def _steps(self) -> Sequence[float]:
        given = self.settings.strength
        return self._limited(_STEPS) if given is None else (given,)

    def _limited(self, strengths: Sequence[float]) -> Sequence[float]:
        """Strengths up to the reported standard deviation of the height."""
        max_sd = reported_sd(self._navigation_sd) or np.inf
        return tuple(dict.fromkeys(min(one, max_sd) for one in strengths))

    def _spacings(self) -> list[float]:
        spacings = list(self.settings.knot_spacings)
        # an interval with few cells is determined by the prior alone
        length = np.diff(self.shared.span, axis=1).sum()
        seen = self.shared.pass_index.size
        dense = [one for one in spacings if seen * one >= self.settings.min_cells * length]
        return dense or spacings[:1]

    def _with(self, best: ModelTrial, group: tuple[str, ...]) -> ModelTrial:
        """Trial with more components, if they improve the prediction significantly."""
        components = (*best.components, *group)
        if not self._is_observable(best, components):
            return best
        found = self._best_of(
            [
                replace(best, components=components, extra_strength=step)
                for step in (0.0, *self.settings.extra_strengths)
            ]
        )
        if self.settings.strength is None and best.strength > 0 and self._gain(best, found) > 0:
            near = [replace(found, strength=one) for one in self._near(best.strength)[::2]]
            found = self._likeliest([found, self._best_of(near)])
        return found if self._better(found, best, 2.0) else best

    def _is_observable(self, best: ModelTrial, components: tuple[str, ...]) -> bool:
        """Whether the observations determine each component better than its prior does."""
        system = self.system(components, best.knot_spacing)
        _, redundancy = entry_residuals(self.shared, self.shared.entries.height, self.weight)
        scales = [self.settings.scale(name) for name in components[1:]]
        # diagonal of the normal matrix: information on a constant component
        information = ((self.weight * redundancy)[:, None] * system.factor[:, 1:] ** 2).sum(axis=0)
        return bool((information * np.array(scales) ** 2 > 1.0).all())

    def _best_of(self, trials: list[ModelTrial]) -> ModelTrial:
        """The most likely of the trials that are not significantly worse than the best."""
        first = len(self.trials)
        self._try(trials)
        return self._likeliest(self.trials[first:])

    def _likeliest(self, trials: list[ModelTrial]) -> ModelTrial:
        best = min(trials, key=lambda one: self._loss(one).sum())
        found = [one for one in trials if one is best or not self._better(best, one, 1.0)]
        return max(found, key=lambda one: one.log_likelihood)

    def _refined(self, best: ModelTrial) -> ModelTrial:
        """Trial with a strength between those of the list, by bisection of its logarithm."""
        if self.settings.strength is not None or best.strength == 0:
            return best
        for step in _FINER:
            for strength in self._limited((best.strength * step, best.strength / step)):
                found = self._best_of([replace(best, strength=strength)])
                likelier = found.log_likelihood > best.log_likelihood
                if likelier and not self._better(best, found, 1.0):
                    best = found
        return best

    def _better(self, one: ModelTrial, other: ModelTrial, times: float) -> bool:
        gain = self._loss(other) - self._loss(one)
        return bool(gain.sum() > times * _block_sum_sd(gain))

    def _gain(self, one: ModelTrial, other: ModelTrial) -> float:
        return float((self._loss(one) - self._loss(other)).sum())

    def _loss(self, trial: ModelTrial) -> Floats:
        return self._losses[next(k for k, each in enumerate(self.trials) if each is trial)]

    def _try(self, trials: list[ModelTrial]) -> None:
        for trial in trials:
            loss, rmse, likelihood = self._cross_validate(trial)
            self._losses.append(loss)
            self._progress("choose how stiff corrections are", len(self.trials) + 1, None)
            self.trials.append(replace(trial, held_out=rmse, log_likelihood=likelihood))

    def _cross_validate(self, trial: ModelTrial) -> tuple[Floats, float, float]:
        """Loss of each square, RMS of held-out differences [m], and log marginal likelihood."""
        system = self.system(trial.components, trial.knot_spacing)
        key = trial.components, trial.knot_spacing
        shared, prior = self.shared, self.prior(trial)
        if key not in self._parts:
            self._parts[key] = parts_of(system, self.folds, self.weight)
        whole, parts = self._parts[key]
        height = shared.entries.height + cross_validate(system, prior, self.folds, whole, parts)
        residual, redundancy = entry_residuals(shared, height, self.weight)
        square = np.zeros(int(self.folds.square.max()) + 1)
        np.add.at(square, shared.per_entry(self.folds.square), self.weight * residual**2)
        kept = self.robustness
        # 2 sum(v²) / sum(r): the variance of a difference is twice that of a height
        rmse = float(np.sqrt(2.0 * (kept * residual**2).sum() / (kept * redundancy).sum()))
        return square, rmse, system.solve(whole, system.known(prior)).log_likelihood


def fit_unconstrained(system: AdjustmentSystem, settings: NetworkSettings) -> WeightedFit:
    """Fit corrections with a weak prior and Huber's weights, to estimate the weights."""
    flexible = ModelTrial(
        components=system.components,
        knot_spacing=0.0,
        strength=_BROAD,
        order="first",
        extra_strength=settings.extra_strengths[-1] if settings.extra_strengths else 0.0,
    )
    weak_prior = trial_priors(flexible, settings)
    return fit_corrections(system, weak_prior, settings)


def parts_of(
    system: AdjustmentSystem, folds: CrossValidationFolds, weight: Floats
) -> tuple[NormalEquations, list[NormalEquations]]:
    """Normal equations of all cells, and those of each fold."""
    parts = [system.equations(weight, folds.number == fold) for fold in range(folds.count)]
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.plus(part)
    return whole, parts


def cross_validate(
    system: AdjustmentSystem,
    prior: Mapping[str, ComponentPrior],
    folds: CrossValidationFolds,
    whole: NormalEquations,
    parts: Sequence[NormalEquations],
) -> Floats:
    """Correction of each entry from the cells of the other folds, shape (n,) [m]."""
    fold, known = system.shared.per_entry(folds.number), system.known(prior)
    out = np.zeros(fold.size)
    for number, part in enumerate(parts):
        if part.degrees_of_freedom:
            found = system.solve(whole.less(part), known)
            there = fold == number
            out[there] = system.corrections(found.coefficients)[there]
    return out


def trial_priors(trial: ModelTrial, settings: NetworkSettings) -> dict[str, ComponentPrior]:
    """Priors of all components of a trial."""
    found = {}
    for name in trial.components:
        sd = trial.strength if name == "height" else trial.extra_strength * settings.scale(name)
        time = settings.correlation_time or CORRELATION_TIME
        process = GaussMarkovProcess(sd=sd, correlation_time=time, order=trial.order)
        offset_sd = np.inf if name == "height" else settings.scale(name)
        found[name] = ComponentPrior(process=process, offset_sd=offset_sd)
    return found


def reported_sd(navigation_sd: Sequence[Floats]) -> float | None:
    """Typical reported standard deviation of the height.

    Parameters
    ----------
    navigation_sd : sequence of numpy.ndarray, shape (2, n)
        Times [s] and reported standard deviations of the height [m].

    Returns
    -------
    float or None
        Median [m]; None if nothing is reported.
    """
    known = [reported[1] for reported in navigation_sd if reported.size]
    return float(np.median(np.concatenate(known))) if known else None


def _block_sum_sd(gain: Floats) -> float:
    """Standard error of a sum over squares of ground."""
    n = gain.size
    return float(np.sqrt(n / max(n - 1, 1) * ((gain - gain.mean()) ** 2).sum()))
