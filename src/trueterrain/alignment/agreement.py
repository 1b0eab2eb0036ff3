"""How well passes agree: pair by pair, around loops, and against their own noise."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.adjustment.normal_equations import NormalEquations
from trueterrain.alignment.adjustment.shared_cells import SharedCells
from trueterrain.alignment.adjustment.sparse_cholesky import pattern_of
from trueterrain.alignment.adjustment.system import AdjustmentSystem, pair_places
from trueterrain.alignment.difference_summary import DifferenceSummary

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

_LOOSE = 1.0  # [m] or [rad] that a coefficient may be, where nothing tells it


@dataclass(frozen=True, kw_only=True)
class ScreenedDifferences(DifferenceSummary):
    """Statistics of differences of height between two passes, some of which were rejected."""

    rmse_accepted: float
    "Root mean square of the cells that were not rejected [m]; NaN if all were."


@dataclass(frozen=True, kw_only=True)
class PairAgreement:
    """How two passes agree, or one with itself where it came back."""

    first: str
    "Name of the pass."

    second: str
    "Name of the other; differences are its heights less those of the first."

    before: ScreenedDifferences
    "As they were measured."

    after: ScreenedDifferences
    "After the adjustment."

    held_out: ScreenedDifferences
    "In cells held back, with corrections from all other cells."

    rejected: int
    "Cells that were rejected, by one of the two or both."


@dataclass(frozen=True, kw_only=True)
class LoopClosure:
    """Sum of the median differences of height around a loop of passes."""

    passes: tuple[str, ...]
    "Names of the passes in the order of the loop; one name for a pass that came back."

    before: float
    "As measured [m]."

    after: float
    "After the adjustment [m]."


@dataclass(frozen=True, kw_only=True)
class PassDriftTest:
    """Whether what a pass differs by from the others could be its noise."""

    name: str
    "Name of the pass; empty for all together."

    statistic: float
    "Sum of squares, distributed as chi-square if there is no drift."

    degrees_of_freedom: float
    "Its degrees of freedom."

    p_value: float
    "Probability of so much or more without any drift."


def difference_statistics(values: Floats, accepted: Flags) -> ScreenedDifferences:
    """Statistics of some differences.

    Parameters
    ----------
    values : numpy.ndarray, shape (n,)
        Differences [m].
    accepted : numpy.ndarray of bool, shape (n,)
        Those that were not rejected.

    Returns
    -------
    Differences
        Of all of them.
    """
    kept = values[accepted]
    accepted_rms = float(np.sqrt(np.mean(kept**2))) if kept.size else float("nan")
    return ScreenedDifferences(**asdict(DifferenceSummary.of(values)), rmse_accepted=accepted_rms)


def pairs_of(
    shared: SharedCells, robustness: Floats, before: Floats, after: Floats, held_out: Floats
) -> list[PairAgreement]:
    """How each pair of passes agrees.

    Parameters
    ----------
    shared : Shared
        The observations.
    robustness : numpy.ndarray, shape (n,)
        0 for what was rejected.
    before, after, held_out : numpy.ndarray, shape (n,)
        Heights [m].

    Returns
    -------
    list of PairAgreement
        By the names of the passes.
    """
    each = np.diff(shared.start)
    one, two = (np.empty(int((each * (each - 1) // 2).sum()), np.int64) for _ in range(2))
    _kernels.entry_pairs(shared.start, one, two)
    accepted = (robustness[one] > 0) & (robustness[two] > 0)
    lanes = len(shared.names)
    keys = shared.lane[one] * lanes + shared.lane[two]
    order = np.argsort(keys, kind="stable")
    found, begin = np.unique(keys[order], return_index=True)
    ends = np.append(begin, order.size)
    pairs = []
    for key, low, high in zip(found, ends[:-1], ends[1:], strict=True):
        some = order[low:high]
        good = accepted[some]
        before_, after_, held_ = (
            difference_statistics(values[two[some]] - values[one[some]], good)
            for values in (before, after, held_out)
        )
        pairs.append(
            PairAgreement(
                first=shared.names[key // lanes],
                second=shared.names[key % lanes],
                before=before_,
                after=after_,
                held_out=held_,
                rejected=int((~good).sum()),
            )
        )
    return pairs


def closures_of(pairs: Sequence[PairAgreement]) -> list[LoopClosure]:
    """Loops of passes, of which all others are sums, and passes that came back.

    Parameters
    ----------
    pairs : sequence of PairAgreement
        The pairs.

    Returns
    -------
    list of LoopClosure
        One for each pair beside a tree of shortest ways, and for each pass that came back.
    """
    links = {(pair.first, pair.second): pair for pair in pairs if pair.first != pair.second}
    loops = [
        LoopClosure(passes=(pair.first,), before=pair.before.median, after=pair.after.median)
        for pair in pairs
        if pair.first == pair.second
    ]
    ways = _paths_from_root(links)
    for one, two in links:
        there, back = ways[one], ways[two]
        if there[-2:-1] == (two,) or back[-2:-1] == (one,):
            continue  # a branch of the tree
        while len(there) > 1 and len(back) > 1 and there[1] == back[1]:
            there, back = there[1:], back[1:]
        around = (*there, *back[:0:-1])
        if there[0] != back[0]:
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
    """Shortest way from a root to each pass, by passes that share cells."""
    near: dict[str, list[str]] = {}
    for one, two in links:
        near.setdefault(one, []).append(two)
        near.setdefault(two, []).append(one)
    ways: dict[str, tuple[str, ...]] = {}
    for root in sorted(near):
        if root in ways:
            continue
        ways[root] = (root,)
        row = [root]
        for name in row:  # grows while it is gone through
            for other in sorted(near[name]):
                if other not in ways:
                    ways[other] = (*ways[name], other)
                    row.append(other)
    return ways


def drift_tests(
    system: AdjustmentSystem, equations: NormalEquations, factor: float
) -> list[PassDriftTest]:
    """Whether what passes differ by could be their noise.

    Parameters
    ----------
    system : System
        The unknowns.
    equations : Equations
        Normal equations, with heights as they were measured.
    factor : float
        Variance of the right sides, by what the weights say it is.

    Returns
    -------
    list of DriftTest
        Of each pass, the others as they are, and of all together.

    Notes
    -----
    The right side b of the normal equations is what the measured differences say about the
    coefficients of the splines. Without drift it is noise, with the normal matrix N as its
    covariance, so that bᵀ N⁻¹ b is distributed as chi-square. It does not depend on how stiff the
    corrections are chosen.
    """
    offsets = np.arange(len(system.knots))
    lane = np.searchsorted(system.first, np.arange(system.first[-1]), side="right") - 1
    _, _, one, two = system.lists
    tests = []
    for name, members in [
        *((system.shared.names[p], np.array([p])) for p in offsets if system.knots[p] is not None),
        ("", offsets),
    ]:
        mine = np.isin(lane, members)
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
    from scipy.special import chdtrc

    p_value = float(chdtrc(degrees_of_freedom, statistic)) if degrees_of_freedom > 0 else 1.0
    return PassDriftTest(
        name=name, statistic=statistic, degrees_of_freedom=degrees_of_freedom, p_value=p_value
    )
