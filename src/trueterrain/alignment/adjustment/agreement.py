"""Agreement of passes: differences of pairs, closures of loops, and tests for drift."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.adjustment.cholesky.factorisation import pattern_of
from trueterrain.alignment.adjustment.normal_equations import NormalEquations, pair_places
from trueterrain.alignment.adjustment.shared_cells import SharedCells
from trueterrain.alignment.adjustment.system import AdjustmentSystem
from trueterrain.surface.difference import DifferenceSummary

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_LOOSE = 1.0  # [m] or [rad] weak prior of coefficients that are unobservable


@dataclass(frozen=True, kw_only=True)
class ScreenedDifferences(DifferenceSummary):
    """Statistics of height differences between two passes, with rejected cells excluded too."""

    rmse_accepted: float
    "Root mean square of accepted cells [m]; NaN if all are rejected."


@dataclass(frozen=True, kw_only=True)
class PairAgreement:
    """Agreement of two passes, or of one pass with itself at repeated visits."""

    first: str
    "Name of the pass."

    second: str
    "Name of the other; differences are its heights less those of the first."

    before: ScreenedDifferences
    "Differences before the adjustment."

    after: ScreenedDifferences
    "Differences after the adjustment."

    held_out: ScreenedDifferences
    "Differences in held-out cells, with corrections from the other cells."

    rejected: int
    "Number of cells rejected in one pass or both."


@dataclass(frozen=True, kw_only=True)
class LoopClosure:
    """Sum of the median differences of height around a loop of passes."""

    passes: tuple[str, ...]
    "Names of the passes in the order of the loop; one name for a repeated visit."

    before: float
    "Before the adjustment [m]."

    after: float
    "After the adjustment [m]."


@dataclass(frozen=True, kw_only=True)
class PassDriftTest:
    """Test of the hypothesis that a pass has no drift relative to the others."""

    name: str
    "Name of the pass; empty for all together."

    statistic: float
    "Score statistic; chi-square distributed without drift."

    degrees_of_freedom: float
    "Degrees of freedom of the statistic."

    p_value: float
    "Probability of this statistic or a greater one without drift."


def difference_statistics(values: Floats, accepted: Flags) -> ScreenedDifferences:
    """Statistics of differences.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Differences [m].
    accepted : numpy.ndarray of bool, shape (n,)
        False for rejected ones.

    Returns
    -------
    ScreenedDifferences
        Statistics of all, and of the accepted ones.
    """
    kept = values[accepted]
    accepted_rms = float(np.sqrt(np.mean(kept**2))) if kept.size else float("nan")
    return ScreenedDifferences(**asdict(DifferenceSummary.of(values)), rmse_accepted=accepted_rms)


def pair_agreements(
    shared: SharedCells, robustness: Floats, before: Floats, after: Floats, held_out: Floats
) -> list[PairAgreement]:
    """Agreement of each pair of passes.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    robustness : numpy.ndarray, shape (n,)
        Robust weights; 0 for rejected entries.
    before, after, held_out : numpy.ndarray, shape (n,)
        Heights before and after the adjustment, and cross-validated [m].

    Returns
    -------
    list of PairAgreement
        Ordered by the names of the passes.
    """
    each = np.diff(shared.start)
    one, two = (np.empty(int((each * (each - 1) // 2).sum()), np.int64) for _ in range(2))
    _kernels.entry_pairs(shared.start, one, two)
    accepted = (robustness[one] > 0) & (robustness[two] > 0)
    pass_count = len(shared.names)
    keys = shared.pass_index[one] * pass_count + shared.pass_index[two]
    order = np.argsort(keys, kind="stable")
    found, begin = np.unique(keys[order], return_index=True)
    ends = np.append(begin, order.size)
    pairs = []
    for key, low, high in zip(found, ends[:-1], ends[1:], strict=True):
        members = order[low:high]
        good = accepted[members]
        before_, after_, held_ = (
            difference_statistics(values[two[members]] - values[one[members]], good)
            for values in (before, after, held_out)
        )
        pairs.append(
            PairAgreement(
                first=shared.names[key // pass_count],
                second=shared.names[key % pass_count],
                before=before_,
                after=after_,
                held_out=held_,
                rejected=int((~good).sum()),
            )
        )
    return pairs


def loop_closures(pairs: Sequence[PairAgreement]) -> list[LoopClosure]:
    """Closures of a basis of loops of passes, and of repeated visits.

    All other loops are sums of these.

    Parameters
    ----------
    pairs : sequence of PairAgreement
        Agreement of the pairs.

    Returns
    -------
    list of LoopClosure
        One for each pair that is not in the spanning tree, and for each pass with repeated visits.
    """
    links = {(pair.first, pair.second): pair for pair in pairs if pair.first != pair.second}
    loops = [
        LoopClosure(passes=(pair.first,), before=pair.before.median, after=pair.after.median)
        for pair in pairs
        if pair.first == pair.second
    ]
    paths = _paths_from_root(links)
    for one, two in links:
        out, back = paths[one], paths[two]
        if out[-2:-1] == (two,) or back[-2:-1] == (one,):
            continue  # an edge of the tree
        while len(out) > 1 and len(back) > 1 and out[1] == back[1]:
            out, back = out[1:], back[1:]
        around = (*out, *back[:0:-1])
        if out[0] != back[0]:
            continue
        steps = list(zip(around, (*around[1:], around[0]), strict=True))
        sums = [0.0, 0.0]
        for a, b in steps:
            sign, pair = (1.0, links[a, b]) if (a, b) in links else (-1.0, links[b, a])
            sums[0] += sign * pair.before.median
            sums[1] += sign * pair.after.median
        loops.append(LoopClosure(passes=around, before=sums[0], after=sums[1]))
    return loops


def _paths_from_root(links: Mapping[tuple[str, str], PairAgreement]) -> dict[str, tuple[str, ...]]:
    """Shortest path from a root to each pass, by a breadth-first tree of common cells."""
    near: dict[str, list[str]] = {}
    for one, two in links:
        near.setdefault(one, []).append(two)
        near.setdefault(two, []).append(one)
    paths: dict[str, tuple[str, ...]] = {}
    for root in sorted(near):
        if root in paths:
            continue
        paths[root] = (root,)
        row = [root]
        for name in row:  # grows during the iteration
            for other in sorted(near[name]):
                if other not in paths:
                    paths[other] = (*paths[name], other)
                    row.append(other)
    return paths


def drift_tests(
    system: AdjustmentSystem, equations: NormalEquations, factor: float
) -> list[PassDriftTest]:
    """Score tests for drift of each pass, and of all together.

    Parameters
    ----------
    system : AdjustmentSystem
        The unknowns.
    equations : NormalEquations
        Normal equations of the uncorrected heights.
    factor : float
        Variance factor of the right-hand side.

    Returns
    -------
    list of PassDriftTest
        For each pass, with the others uncorrected, then for all together.

    Notes
    -----
    The right-hand side b of the normal equations is the score of the coefficients of the splines at
    zero correction. Without drift it is noise with the normal matrix N as its covariance, so
    bᵀ N⁻¹ b is chi-square distributed (Rao's score test). It does not depend on the prior.
    """
    offsets = np.arange(len(system.knots))
    pass_index = np.searchsorted(system.first, np.arange(system.first[-1]), side="right") - 1
    _, _, one, two = system.lists
    tests = []
    for name, members in [
        *((system.shared.names[p], np.array([p])) for p in offsets if system.knots[p] is not None),
        ("", offsets),
    ]:
        mine = np.isin(pass_index, members)
        pairs = np.flatnonzero(mine[one] & mine[two])
        statistic, degrees_of_freedom = _score_statistic(
            system, equations, np.flatnonzero(mine), pairs
        )
        tests.append(_drift_test(name, statistic / factor, degrees_of_freedom))
    return tests


def _score_statistic(
    system: AdjustmentSystem, equations: NormalEquations, intervals: Integers, pairs: Integers
) -> tuple[float, float]:
    """The sum bᵀ (N + q I)⁻¹ b of some intervals, q being small, and the trace of N (N + q I)⁻¹."""
    size = 4 * len(system.components)
    numbers, place = np.unique(system.unknown[intervals, :size], return_inverse=True)
    place = place.reshape(-1, size)
    at = np.full(system.unknown.shape[0], -1, np.int64)
    at[intervals] = np.arange(intervals.size)
    one, two = at[system.lists[2][pairs]], at[system.lists[3][pairs]]
    row, column = pair_places(place, one, two)
    diagonal = np.arange(numbers.size)
    pattern = pattern_of(
        np.concatenate([row, diagonal]), np.concatenate([column, diagonal]), numbers.size
    )
    loose = np.full(numbers.size, _LOOSE**-2.0)
    elements = pattern.sum(loose)
    _kernels.scatter_plain(equations.blocks[pairs], one, two, place, pattern.slot, elements)
    factor = pattern.factor(elements)
    right = np.zeros(numbers.size)
    np.add.at(right, place.ravel(), equations.right[intervals].ravel())
    inverse = factor.inverse_at(diagonal, diagonal)
    return float(right @ factor.solve(right)), numbers.size - float(loose @ inverse)


def _drift_test(name: str, statistic: float, degrees_of_freedom: float) -> PassDriftTest:
    p_value = float(chdtrc(degrees_of_freedom, statistic)) if degrees_of_freedom > 0 else 1.0
    return PassDriftTest(
        name=name, statistic=statistic, degrees_of_freedom=degrees_of_freedom, p_value=p_value
    )
