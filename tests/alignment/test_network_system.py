"""Sparse normal equations against dense ones."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.alignment import GaussMarkovProcess, make_pass_cells
from trueterrain.alignment.adjustment.cholesky.factorisation import pattern_of
from trueterrain.alignment.adjustment.normal_equations import ComponentPrior
from trueterrain.alignment.adjustment.shared_cells import find_shared_cells
from trueterrain.alignment.adjustment.system import DATUM_SD, build_system
from trueterrain.core.errors import TrueTerrainError

RELATIVE = 1e-9  # [1] rounding, with a condition number of 1e6 and less
PRIOR = {
    "height": ComponentPrior(process=GaussMarkovProcess(sd=0.02, order="second"), offset_sd=np.inf),
    "roll": ComponentPrior(process=GaussMarkovProcess(sd=0.001), offset_sd=0.002),
}


@pytest.fixture
def observed():
    """Three passes, one of them back, one coming to some cells twice; weights of any size."""
    rng = np.random.default_rng(3)

    def drive(name, cells, time):
        n = cells.size
        return make_pass_cells(
            name,
            cells,
            time,
            rng.normal(0, 0.05, n),
            variance=rng.uniform(0.5, 2.0, n) * 1e-6,
            easting=cells.astype(float),
            offset=rng.normal(size=n),
            count=9,
        )

    twice = np.concatenate([np.arange(40), np.arange(10)])
    times = np.concatenate([0.3 * np.arange(40), 30.0 + 0.3 * np.arange(10)])
    shared = find_shared_cells(
        [
            drive("a", twice, times),
            drive("b", np.arange(20, 60), 0.4 * np.arange(40)[::-1]),
            drive("c", np.arange(5, 30), 0.2 * np.arange(25)),
        ],
        (),
        (),
    )
    weight = rng.uniform(0.2, 1.0, shared.pass_index.size) / shared.entries.variance
    return shared, weight


class Dense:
    """Dense design, weights and prior."""

    def __init__(self, system, weight):
        shared = system.shared
        n, size = shared.pass_index.size, system.size
        design = np.zeros((n, size))
        for i in range(n):
            unknown = system.unknown[system.interval[i]]
            for k in range(2):
                design[i, unknown[8 + k]] += system.factor[i, k]
                for j in range(4):
                    design[i, unknown[4 * k + j]] += system.factor[i, k] * system.weights[i, j]
        metric = np.zeros((n, n))
        for begin, end in zip(shared.start[:-1], shared.start[1:], strict=True):
            w = weight[begin:end]
            metric[begin:end, begin:end] = np.diag(w) - np.outer(w, w) / w.sum()
        prior = np.zeros((size, size))
        self.offsets = []
        for pass_index in range(3):
            coefficients, offsets = system.pass_unknowns(pass_index)
            self.offsets.append(offsets[0])
            for k, name in enumerate(PRIOR):
                count = coefficients.shape[1]
                sd = np.full(count, PRIOR[name].process.sd)
                rows = PRIOR[name].process.whitening(sd, system.knots[pass_index].spacing)
                white = np.diag(rows[0]) + np.diag(rows[1, 1:], -1) + np.diag(rows[2, 2:], -2)
                prior[np.ix_(coefficients[k], coefficients[k])] += white.T @ white
                prior[offsets[k], offsets[k]] += PRIOR[name].offset_sd ** -2.0
        prior[self.offsets[0], self.offsets[0]] += DATUM_SD**-2.0
        normal = design.T @ metric @ design + prior
        self.inverse = np.linalg.inv(normal)
        self.x = -self.inverse @ design.T @ metric @ shared.entries.height
        self.mean = self.mean_height(system)
        self.project = np.eye(size)
        self.project[self.offsets] -= self.mean

    def mean_height(self, system):
        """Weights of the unknowns in the mean correction of the height, by sampling it."""
        mean = np.zeros(system.size)
        for pass_index, knots in enumerate(system.knots):
            time = knots.begin + (np.arange(20_000) + 0.5) / 20_000 * (knots.end - knots.begin)
            interval, weights = knots.basis(time)
            coefficients, offsets = system.pass_unknowns(pass_index)
            for j in range(4):
                np.add.at(mean, coefficients[0][interval + j], weights[:, j] / time.size / 3)
            mean[offsets[0]] += 1 / 3
        return mean


def test_corrections_are_those_of_the_full_equations(observed):
    shared, weight = observed
    system = build_system(shared, ("height", "roll"), 2.0, [np.zeros((2, 0))] * 3)
    equations = system.equations(weight, np.ones(shared.cells, bool))
    found = system.solve(equations, system.known(PRIOR))
    dense = Dense(system, weight)
    truth = dense.project @ dense.x
    scale = np.abs(truth).max()
    # the mean is sampled, at 20 000 places
    assert_allclose(found.x, truth, rtol=0, atol=1e-7 * scale)
    assert abs(dense.mean @ found.x) < 1e-7 * scale


def test_covariance_is_that_of_the_full_inverse(observed):
    """Of all coefficients of intervals that see a cell in common, the datum applied."""
    shared, weight = observed
    system = build_system(shared, ("height", "roll"), 2.0, [np.zeros((2, 0))] * 3)
    equations = system.equations(weight, np.ones(shared.cells, bool))
    found = system.covariance(system.solve(equations, system.known(PRIOR)))
    dense = Dense(system, weight)
    truth = dense.project @ dense.inverse @ dense.project.T
    whole = np.zeros((system.unknown.shape[0], 8, system.size))
    for interval, unknown in enumerate(system.unknown):
        for n in range(8):
            whole[interval, n, unknown[n]] += 1.0
            whole[interval, n, unknown[8 + n // 4]] += 1.0
    for pair, (one, two) in enumerate(zip(system.lists[2], system.lists[3], strict=True)):
        expected = whole[one] @ truth @ whole[two].T
        assert_allclose(found[pair], expected, rtol=0, atol=1e-7 * np.abs(expected).max())


def test_no_correction_changes_by_more_of_its_sd_than_the_whole_change(observed):
    """The bound used for convergence, and a direction that reaches it."""
    shared, weight = observed
    system = build_system(shared, ("height", "roll"), 2.0, [np.zeros((2, 0))] * 3)
    equations = system.equations(weight, np.ones(shared.cells, bool))
    found = system.solve(equations, system.known(PRIOR))
    dense = Dense(system, weight)
    covariance = dense.project @ dense.inverse @ dense.project.T
    rng = np.random.default_rng(6)
    for row in (*np.eye(system.size), *rng.normal(size=(20, system.size))):
        row = row @ dense.project
        sd = np.sqrt(row @ covariance @ row)
        change = dense.project @ rng.normal(size=system.size)
        assert abs(row @ change) <= np.linalg.norm(system.whiten_change(found, change)) * sd
        steepest = covariance @ row  # the change that reaches the bound
        whole = np.linalg.norm(system.whiten_change(found, steepest))
        assert_allclose(row @ steepest, whole * sd, rtol=1e-4)  # the datum weighs 1e8: its rounding


def test_normal_equations_of_parts_add_up(observed):
    shared, weight = observed
    system = build_system(shared, ("height",), 1.0, [np.zeros((2, 0))] * 3)
    some = np.arange(shared.cells) % 3 == 0
    whole = system.equations(weight, np.ones(shared.cells, bool))
    parts = system.equations(weight, some).plus(system.equations(weight, ~some))
    assert_allclose(parts.blocks, whole.blocks, rtol=RELATIVE, atol=1e-3)
    assert_allclose(parts.right, whole.right, rtol=RELATIVE, atol=1e-3)
    assert (
        parts.degrees_of_freedom
        == whole.degrees_of_freedom
        == shared.pass_index.size - shared.cells
    )


@pytest.fixture
def matrix():
    """A sparse matrix as places, with a wide unknown, and in full."""
    rng = np.random.default_rng(4)
    row = np.concatenate([rng.integers(0, 40, 150), np.full(40, 40)])
    column = np.concatenate([np.minimum(row[:150] + rng.integers(0, 3, 150), 39), np.arange(40)])
    pattern = pattern_of(row, column, 41, wide=np.array([40]))
    values = rng.normal(size=row.size) * np.where(row == column, 1.0, 0.1)
    full = np.zeros((41, 41))
    np.add.at(full, (row, column), values)
    full = full + np.tril(full, -1).T + np.triu(full, 1).T
    full = np.tril(full) + np.tril(full, -1).T
    return pattern, row, column, values, full


def test_sparse_factors_solve_and_invert(matrix):
    pattern, row, column, values, full = matrix
    elements = pattern.sum(values)
    diagonal = np.arange(41)
    shift = 30.0  # makes it positive definite
    elements[pattern.pointers[:-1]] += shift
    full = full + shift * np.eye(41)
    factor = pattern.factor(elements)
    right = np.linspace(-1, 1, 41)
    assert_allclose(factor.solve(right), np.linalg.solve(full, right), rtol=0, atol=RELATIVE)
    assert_allclose(factor.log_determinant, np.linalg.slogdet(full)[1], rtol=RELATIVE, atol=0)
    inverse = np.linalg.inv(full)
    for one, other in ((row, column), (diagonal, diagonal)):
        found = factor.inverse_at(one, other)
        assert_allclose(found, inverse[one, other], rtol=0, atol=RELATIVE)


def test_a_matrix_that_is_not_positive_definite_is_refused(matrix):
    pattern, *_ = matrix
    with pytest.raises(TrueTerrainError, match="not positive definite"):
        pattern.factor(pattern.sum(np.zeros(3)))
