"""Unknowns of the adjustment, their normal equations and their prior.

Each component of the correction of a pass is a constant, the *offset*, plus a spline that models
the drift about it. Offsets of the height are free. If no pass of a group is fixed, its datum is
that the mean of the corrections over time is 0.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.adjustment import _kernels
from trueterrain.alignment.adjustment.cholesky.factorisation import SparsePattern, pattern_of
from trueterrain.alignment.adjustment.normal_equations import (
    AdjustmentSolution,
    ComponentPrior,
    NormalEquations,
    PriorInformation,
    pair_places,
    squared_band,
)
from trueterrain.alignment.adjustment.shared_cells import SharedCells
from trueterrain.alignment.adjustment.spline import SplineKnots, knots_over

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

DATUM_SD = 1e-4  # [m] prior of one offset of each group, which removes the rank defect of the datum
_MEAN_BASIS = (
    np.array([1.0, 11.0, 11.0, 1.0]) / 24.0
)  # integrals of the basis functions over an interval
MIN_SD = 1e-7  # [m] or [rad] drift of a component that is constant


@dataclass(frozen=True, kw_only=True, eq=False)
class _GroupDatum:
    """Datum of a group: the mean height of its corrections, which must be 0."""

    unknowns: Integers
    "Unknowns that it depends on."

    weights: Floats
    "Weight of each."

    offsets: Integers
    "Offsets of the heights of the group."

    def mean_of(self, x: Floats) -> float:
        """Mean height of the corrections [m]."""
        return float((self.weights * x[self.unknowns]).sum())


@dataclass(frozen=True, kw_only=True, eq=False)
class AdjustmentSystem:
    """Unknowns of all corrected passes, and the structure of their normal matrix."""

    shared: SharedCells
    "The observations."

    components: tuple[str, ...]
    "Components of the corrections."

    knots: tuple[SplineKnots | None, ...]
    "Knots of each pass; None if it is fixed."

    first: Integers
    "First interval of each pass, then the number of intervals, shape (pass + 1,)."

    interval: Integers
    "Interval of each entry, -1 where the pass is fixed, shape (n,)."

    weights: Floats
    "Weights of its four coefficients, shape (n, 4)."

    factor: Floats
    "Derivative of the height of an entry with respect to each component, shape (n, k)."

    unknown: Integers
    "Unknowns of each interval: 4 of each component, then the offsets, shape (interval, 5 k)."

    lists: tuple[Integers, Integers, Integers, Integers] = field(repr=False)
    "Pairs of intervals with common cells as linked lists: head, next, first, second."

    pattern: SparsePattern = field(repr=False)
    "Sparsity of the normal matrix: elements of the pairs, then those of the prior."

    relative: tuple[Floats, ...] = field(repr=False)
    "Reported standard deviation at each coefficient over the median of all, per pass."

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.pattern.size

    def equations(self, weight: Floats, use: Flags) -> NormalEquations:
        """Normal equations of some cells.

        Parameters
        ----------
        weight : numpy.ndarray, shape (n,)
            Weight of each entry [1/m²].
        use : numpy.ndarray of bool, shape (cell,)
            Cells to include.

        Returns
        -------
        NormalEquations
            Without the prior.
        """
        head, after, _, second = self.lists
        k = 4 * len(self.components)
        blocks, right = np.zeros((second.size, k, k)), np.zeros((self.first[-1], k))
        square, degrees_of_freedom = _kernels.assemble_normal_equations(
            self.shared.start,
            use,
            self.interval,
            self.weights,
            self.factor,
            weight,
            self.shared.entries.height,
            head,
            after,
            second,
            blocks,
            right,
        )
        return NormalEquations(
            blocks=blocks, right=right, square=square, degrees_of_freedom=degrees_of_freedom
        )

    def solve(self, equations: NormalEquations, known: PriorInformation) -> AdjustmentSolution:
        """Solve the normal equations for the corrections (maximum a posteriori).

        Parameters
        ----------
        equations : NormalEquations
            Normal equations of the cells.
        known : PriorInformation
            Prior information.

        Returns
        -------
        AdjustmentSolution
            All unknowns, with the datum applied.

        Raises
        ------
        TrueTerrainError
            If the matrix is not positive definite.
        """
        elements = known.elements.copy()
        _kernels.scatter_blocks(
            equations.blocks,
            self.lists[2],
            self.lists[3],
            self.unknown,
            self.pattern.slot,
            elements,
        )
        right = np.zeros(self.size)
        _kernels.add_right(equations.right, self.unknown, right)
        factor = self.pattern.factor(elements)
        x = factor.solve(right)
        likelihood = (
            known.log_determinant
            - factor.log_determinant
            - equations.square
            + float((right * x).sum())
        )
        for datum in self._datums:
            x[datum.offsets] -= datum.mean_of(x)
        return AdjustmentSolution(
            factor=factor,
            x=x,
            coefficients=self.coefficients(x),
            log_likelihood=0.5 * likelihood,
        )

    def corrections(self, coefficients: Floats) -> Floats:
        """Correction of the height of each entry, shape (n,) [m]."""
        out = np.empty(self.interval.size)
        _kernels.evaluate_corrections(self.interval, self.weights, self.factor, coefficients, out)
        return out

    def whiten_change(self, solution: AdjustmentSolution, change: Floats) -> Floats:
        """Change of the unknowns in units of their standard deviations.

        Parameters
        ----------
        solution : AdjustmentSolution
            Solution with the factor of the normal matrix.
        change : numpy.ndarray, shape (n,)
            Change of the unknowns.

        Returns
        -------
        numpy.ndarray, shape (n,)
            Independent components, Lᵀ change. The norm of them bounds the change of every linear
            combination of corrections in units of its standard deviation (Cauchy-Schwarz).
        """
        change = change.copy()
        for datum in self._datums:  # undo the datum, in which the factor is not
            change[datum.offsets] -= change[datum.offsets[0]]
        return solution.factor.whiten(change)

    def covariance(self, solution: AdjustmentSolution) -> Floats:
        """Covariance of the coefficients of pairs of intervals, offsets included.

        Parameters
        ----------
        solution : AdjustmentSolution
            Solution of the normal equations.

        Returns
        -------
        numpy.ndarray, shape (pair, 4 k, 4 k)
            In the order of the pairs; relative to the datum.
        """
        _, _, one, two = self.lists
        size = 4 * len(self.components)
        row, column = np.broadcast_arrays(
            self.unknown[one][:, :, None], self.unknown[two][:, None, :]
        )
        found = solution.factor.inverse_at(row.ravel(), column.ravel()).reshape(row.shape)
        found[:, :, :size] += np.repeat(found[:, :, size:], 4, axis=2)
        found[:, :size] += np.repeat(found[:, size:], 4, axis=1)
        found = found[:, :size, :size]
        # cov(x - m, y - m) = cov(x, y) - cov(m, x) - cov(m, y) + var(m), m being the mean
        for datum in self._datums:
            right = np.zeros(self.size)
            right[datum.unknowns] = datum.weights
            with_mean = solution.factor.solve(right)
            each = self.coefficients(with_mean)
            mine = np.isin(self.unknown[:, size], datum.offsets)
            pairs = np.flatnonzero(mine[one])
            found[pairs, :4] -= each[two[pairs], None, :]
            found[pairs, :, :4] -= each[one[pairs], :, None]
            found[pairs, :4, :4] += datum.mean_of(with_mean)
        return found

    @cached_property
    def _datums(self) -> list[_GroupDatum]:
        """Datums of the groups without a fixed pass."""
        found = []
        for members in _datum_groups(self.shared):
            unknowns, weights, offsets = [], [], []
            for pass_index in members:
                coefficients, offset = self.pass_unknowns(pass_index)
                parts = np.zeros(coefficients.shape[1])
                for k in range(4):
                    parts[k : parts.size - 3 + k] += _MEAN_BASIS[k]
                unknowns += [coefficients[0], offset[:1]]
                weights += [parts / parts.sum() / members.size, np.array([1.0 / members.size])]
                offsets.append(offset[0])
            found.append(
                _GroupDatum(
                    unknowns=np.concatenate(unknowns),
                    weights=np.concatenate(weights),
                    offsets=np.array(offsets),
                )
            )
        return found

    def pass_unknowns(self, pass_index: int) -> tuple[Integers, Integers]:
        """Unknowns of a pass: coefficients (component, n), and offsets (component,)."""
        rows = self.unknown[self.first[pass_index] : self.first[pass_index + 1]]
        k = len(self.components)
        begin = rows[0, : 4 * k : 4]
        return begin[:, None] + np.arange(rows.shape[0] + 3), rows[0, 4 * k :]

    def coefficients(self, x: Floats) -> Floats:
        """Coefficients of each interval, offsets included, by some unknowns."""
        k = len(self.components)
        each = x[self.unknown]
        return each[:, : 4 * k] + np.repeat(each[:, 4 * k :], 4, axis=1)

    def known(self, prior: Mapping[str, ComponentPrior]) -> PriorInformation:
        """Prior information as elements of the normal matrix.

        Parameters
        ----------
        prior : mapping of str to ComponentPrior
            Prior of each component.

        Returns
        -------
        PriorInformation
            Argument of `solve`.
        """
        values, log_determinant = [], 0.0
        for pass_index, knots in enumerate(self.knots):
            if knots is None:
                continue
            for name in self.components:
                process = prior[name].process
                sd = np.maximum(process.sd * self.relative[pass_index], MIN_SD)
                rows = process.whitening(sd, knots.spacing)
                log_determinant += 2.0 * float(np.log(rows[0]).sum())
                values += squared_band(rows)
                offset_sd = prior[name].offset_sd
                values.append(np.array([offset_sd**-2.0]))
                if np.isfinite(offset_sd):
                    log_determinant -= 2.0 * float(np.log(offset_sd))
        values += [np.array([DATUM_SD**-2.0]) for _ in _datum_groups(self.shared)]
        elements = self.pattern.sum(np.concatenate(values))
        return PriorInformation(elements=elements, log_determinant=log_determinant)


def build_system(
    shared: SharedCells, components: Sequence[str], spacing: float, navigation_sd: Sequence[Floats]
) -> AdjustmentSystem:
    """Number the unknowns of an adjustment and find the structure of its normal matrix.

    Parameters
    ----------
    shared : SharedCells
        The observations.
    components : sequence of str
        Components of the corrections.
    spacing : float
        Spacing of the knots [s] or [m].
    navigation_sd : sequence of numpy.ndarray
        Of each pass: times [s] and reported standard deviations [m], shape (2, m); empty if
        none are reported.

    Returns
    -------
    AdjustmentSystem
        System to assemble and solve.
    """
    pass_count = len(shared.names)
    knots = tuple(
        None
        if shared.fixed[p]
        else knots_over(float(shared.span[p, 0]), float(shared.span[p, 1]), spacing)
        for p in range(pass_count)
    )
    intervals = [0 if one is None else one.intervals for one in knots]
    first = np.concatenate([[0], np.cumsum(intervals)]).astype(np.int64)
    interval, weights = _locate_knots(shared, knots, first)
    unknown, places_row, places_column, size = _number_unknowns(knots, len(components), shared)
    lists = _kernels.pairs_of(shared.start, interval, int(first[-1]))
    row, column = pair_places(unknown, lists[2], lists[3])
    pattern = pattern_of(
        np.concatenate([row, places_row]),
        np.concatenate([column, places_column]),
        size,
        wide=np.unique(unknown[:, 4 * len(components) :]),
    )
    return AdjustmentSystem(
        shared=shared,
        components=tuple(components),
        knots=knots,
        first=first,
        interval=interval,
        weights=weights,
        factor=_design_factors(shared, components),
        unknown=unknown,
        lists=lists,
        pattern=pattern,
        relative=_relative_sd(knots, navigation_sd),
    )


def _locate_knots(
    shared: SharedCells, knots: Sequence[SplineKnots | None], first: Integers
) -> tuple[Integers, Floats]:
    interval = np.full(shared.pass_index.size, -1, np.int64)
    weights = np.zeros((shared.pass_index.size, 4))
    for pass_index, one in enumerate(knots):
        if one is not None:
            mine = np.flatnonzero(shared.pass_index == pass_index)
            at, by = one.basis(shared.entries.time[mine])
            interval[mine], weights[mine] = first[pass_index] + at, by
    return interval, weights


def _design_factors(shared: SharedCells, components: Sequence[str]) -> Floats:
    entries = shared.entries
    of = {
        "height": np.ones(shared.pass_index.size),
        "roll": entries.offset,
        "pitch": entries.longitudinal,
        "east": -entries.slope_east,
        "north": -entries.slope_north,
    }
    return np.stack([of[name] for name in components], axis=1)


def _relative_sd(
    knots: Sequence[SplineKnots | None], navigation_sd: Sequence[Floats]
) -> tuple[Floats, ...]:
    known = [part[1] for part in navigation_sd if part.size]
    typical = float(np.median(np.concatenate(known))) if known else 1.0
    return tuple(
        np.zeros(0)
        if one is None
        else np.interp(one.places, *reported) / typical
        if reported.size
        else np.ones(one.intervals + 3)
        for one, reported in zip(knots, navigation_sd, strict=True)
    )


def _number_unknowns(
    knots: Sequence[SplineKnots | None], k: int, shared: SharedCells
) -> tuple[Integers, Integers, Integers, int]:
    """Unknowns of each interval, rows and columns of the prior, and the number of unknowns."""
    counts = [0 if one is None else one.intervals + 3 for one in knots]
    offsets = k * sum(counts)
    unknown, row, column, offset_of = [], [], [], np.full(len(knots), -1, np.int64)
    begin, offset = 0, offsets
    for pass_index, one in enumerate(knots):
        if one is None:
            continue
        n = counts[pass_index]
        starts = begin + n * np.arange(k)
        at = np.arange(one.intervals)[:, None]
        coefficients = [start + at + np.arange(4) for start in starts]
        pass_offsets = np.broadcast_to(offset + np.arange(k), (one.intervals, k))
        unknown.append(np.concatenate([*coefficients, pass_offsets], axis=1))
        for part, start in enumerate(starts):
            for back in range(3):
                row.append(start + np.arange(back, n))
                column.append(start + np.arange(n - min(back, n)))
            row.append(np.array([offset + part]))
            column.append(np.array([offset + part]))
        offset_of[pass_index] = offset
        begin, offset = begin + k * n, offset + k
    for members in _datum_groups(shared):
        row.append(offset_of[members[:1]])
        column.append(offset_of[members[:1]])
    return (
        np.concatenate(unknown).astype(np.int64),
        np.concatenate(row).astype(np.int64),
        np.concatenate(column).astype(np.int64),
        offset,
    )


def _datum_groups(shared: SharedCells) -> list[Integers]:
    """Passes of each group without a fixed pass."""
    groups = [np.flatnonzero(shared.group == number) for number in np.unique(shared.group)]
    return [members for members in groups if not shared.fixed[members].any()]
