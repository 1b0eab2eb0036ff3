"""Distributions of heights: the CPF, and its interpolation for quantised heights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.stats import norm

from trueterrain.core.schemas import make_points
from trueterrain.profile import (
    HeightDistribution,
    HeightDistributions,
    Median,
    Percentile,
    height_distributions,
    straight_path,
)

STEP = 1e-3  # [m] the thesis's 1 mm
INVERSE = 1e-12  # [m] what 60 bisections leave of steps of 1 mm, and the round-off of their PCHIP


def one(heights):
    heights = np.sort(np.asarray(heights, float))
    return HeightDistribution(heights=heights, distances=np.zeros_like(heights))


def many(rows):
    """Distributions of the rows of an array or a list of arrays."""
    rows = [np.sort(np.asarray(row, float)) for row in rows]
    start = np.concatenate([[0], np.cumsum([row.size for row in rows])])
    heights = np.concatenate([np.empty(0), *rows])
    return HeightDistributions(start=start, heights=heights, distances=np.zeros_like(heights))


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=60), st.lists(st.floats(-11, 11)))
def test_the_cpf_is_the_fraction_of_heights_that_do_not_exceed_a_height(heights, asked):
    asked = np.array([*asked, *heights])
    probability = [np.mean(np.array(heights) <= at) for at in asked]
    assert_allclose(one(heights).cpf(asked), probability, rtol=0, atol=1e-15)


def test_the_cpf_has_the_shape_of_its_argument():
    assert one([1, 2]).cpf(1.5).shape == ()
    assert one([1, 2]).cpf(np.zeros((2, 3))).shape == (2, 3)
    assert one([1, 2]).continued_cpf(np.zeros((2, 3)), STEP).shape == (2, 3)


def test_no_heights_have_no_probability():
    empty = one([])
    assert np.isnan(empty.cpf([0.0, 1.0])).all()
    assert np.isnan(empty.continued_cpf([0.0, 1.0], STEP)).all()
    assert [part.size for part in empty.steps(STEP)] == [0, 0]


def test_neighbouring_steps_have_a_common_edge():
    edges, probability = one([0.002, 0.002, 0.003, 0.003, 0.003]).steps(STEP)
    assert_allclose(edges, [0.0015, 0.0025, 0.0035], rtol=0, atol=1e-15)
    assert_allclose(probability, [0, 0.4, 1], rtol=0, atol=1e-15)


def test_the_cpf_is_constant_where_a_step_is_empty():
    """A stone of 25 mm on a flat: no height lies between them, so the CPF is constant."""
    stone = one([0.0] * 8 + [0.025] * 2)
    edges, probability = stone.steps(STEP)
    assert_allclose(edges, [-0.0005, 0.0005, 0.0245, 0.0255], rtol=0, atol=1e-15)
    assert_allclose(probability, [0, 0.8, 0.8, 1], rtol=0, atol=1e-15)
    between = np.linspace(0.0005, 0.0245, 50)
    assert_allclose(stone.continued_cpf(between, STEP), 0.8, rtol=0, atol=1e-12)


def test_heights_that_differ_by_round_off_are_of_one_step():
    offset = 812.3456
    clean = np.repeat([0.0, 0.001, 0.002, 0.005], [3, 8, 5, 1])
    dirty = offset + clean + np.random.default_rng(1).normal(0, 1e-13, clean.size)
    edges, probability = one(dirty).steps(STEP)
    wanted, expected = one(clean).steps(STEP)
    assert_allclose(edges, offset + wanted, rtol=0, atol=1e-11)
    assert_allclose(probability, expected, rtol=0, atol=1e-15)


@given(
    st.lists(st.integers(-30, 30), min_size=1, max_size=80),
    st.sampled_from([0.0, 0.4e-3, 700.12345, -3.0007]),
)
def test_the_continuation_is_the_pchip_of_scipy_and_ascends(steps, offset):
    quantised = one(offset + STEP * np.array(steps))
    edges, probability = quantised.steps(STEP)
    assert (np.diff(edges) > 0).all()
    assert (np.diff(probability) >= 0).all()
    at = np.linspace(edges[0] - STEP, edges[-1] + STEP, 700)
    got = quantised.continued_cpf(at, STEP)
    assert (np.diff(got) >= -1e-12).all()
    assert ((got >= 0) & (got <= 1)).all()
    assert_allclose(got[[0, -1]], [0, 1], rtol=0, atol=1e-12)
    inside = (at > edges[0]) & (at < edges[-1])
    assert_allclose(
        got[inside], PchipInterpolator(edges, probability)(at[inside]), rtol=0, atol=1e-12
    )
    # true at the edges of the steps, where it is known from the recorded heights
    assert_allclose(quantised.continued_cpf(edges, STEP), probability, rtol=0, atol=1e-12)
    assert_allclose(quantised.cpf(edges), probability, rtol=0, atol=1e-12)


@given(
    st.lists(st.integers(-12, 12), min_size=1, max_size=80),
    st.floats(0.5, 99.5),
    st.sampled_from([0.0, 0.4e-3, 700.12345]),
)
def test_the_percentile_of_quantised_heights_inverts_the_pchip_of_scipy(steps, percent, offset):
    heights = STEP * np.array(steps) + offset
    edges, probability = one(heights).steps(STEP)
    got = Percentile(percent=percent, resolution=STEP).estimate(many([heights]))[0][0]
    if (
        np.abs(probability - percent / 100) < 1e-9
    ).any():  # where it is constant, any height inverts it
        rest = edges[np.abs(probability - percent / 100) < 1e-9]
        assert rest[0] - 1e-6 <= got <= rest[-1] + 1e-6
        return
    # about an origin of its own: at 700 m scipy's polynomials are only good to 1e-13 each
    curve = PchipInterpolator(edges - offset, probability)
    wanted = offset + brentq(
        lambda z: curve(z) - percent / 100, edges[0] - offset, edges[-1] - offset, xtol=1e-16
    )
    slope = max(curve.derivative()(got - offset), 1e-3)
    assert_allclose(got, wanted, rtol=0, atol=INVERSE + np.spacing(offset) + 1e-14 / slope)


def test_the_percentile_where_the_cpf_is_constant_is_the_midpoint():
    two = many([[0.0] * 5 + [0.025] * 5])
    assert_allclose(Median(resolution=STEP).estimate(two)[0], 0.0125, rtol=0, atol=INVERSE)
    assert_allclose(Median().estimate(two)[0], 0.0125, rtol=0, atol=INVERSE)


def test_one_more_height_on_the_stone_takes_the_median_to_the_stone():
    stone = many([[0.0] * 10 + [0.025] * 11])
    assert_allclose(Median(resolution=STEP).estimate(stone)[0], 0.025, rtol=0, atol=STEP / 2)


@pytest.mark.parametrize("resolution", [1e-5, 1e-4, 1e-3])
def test_heights_that_are_finer_than_the_resolution_have_their_own_median(resolution):
    """Between heights whose steps do not touch, the continuation is the staircase."""
    rng = np.random.default_rng(4)
    rows = rng.normal(0, 0.05, (200, 31))
    got = Median(resolution=resolution).estimate(many(rows))[0]
    assert_allclose(got, np.median(rows, axis=1), rtol=0, atol=resolution / 2)


@pytest.mark.parametrize(
    ("spread", "recorded", "continued"),
    [(0.3e-3, 0.29e-3, 0.17e-3), (0.5e-3, 0.29e-3, 0.08e-3), (2e-3, 0.29e-3, 0.10e-3)],
)
def test_quantised_heights_recover_the_median_far_better_than_their_step(
    spread, recorded, continued
):
    """81 heights recorded to 1 mm: the median itself is off by a uniform rounding."""
    rng = np.random.default_rng(8)
    true = rng.uniform(-0.01, 0.01, (4000, 1)) + spread * rng.normal(size=(4000, 81))
    rounded = np.rint(true / STEP) * STEP
    centre = np.median(true, axis=1)

    def rms(height):
        return np.sqrt(np.mean((height - centre) ** 2))

    assert rms(np.median(rounded, axis=1)) == pytest.approx(recorded, abs=0.02e-3)
    assert rms(Median(resolution=STEP).estimate(many(rounded))[0]) < 1.05 * continued


def test_the_interpolation_of_quantised_heights_does_not_depend_on_the_offset():
    """A surface that was raised by a fraction of its step keeps its shape."""
    rng = np.random.default_rng(9)
    rows = np.rint(rng.normal(0, 1.5, (500, 40))) * STEP
    level = Percentile(percent=30, resolution=STEP)
    for offset in (0.3e-3, 1000.0004):
        height, sd = level.estimate(many(rows + offset))
        wanted, wanted_sd = level.estimate(many(rows))
        assert_allclose(height - offset, wanted, rtol=0, atol=1e-9)
        assert_allclose(sd, wanted_sd, rtol=0, atol=1e-9)


@pytest.mark.parametrize("percent", [20, 50])
@pytest.mark.parametrize("n", [15, 30, 80])
@pytest.mark.parametrize("spread", [0.02, 0.1, 0.3, 0.5, 1.0, 3.0])
def test_the_standard_deviation_of_a_quantised_percentile_is_that_of_its_errors(spread, n, percent):
    """Within a factor: what happened inside of a step is not in the data (docstring)."""
    rng = np.random.default_rng(10)
    centre = rng.uniform(0, 1, (3000, 1))
    heights = STEP * np.rint(centre + spread * rng.normal(size=(3000, n)))
    height, sd = Percentile(percent=percent, resolution=STEP).estimate(many(heights))
    error = height - STEP * (centre[:, 0] + spread * norm.ppf(percent / 100))
    assert 0.55 < np.sqrt(np.mean((error / sd) ** 2)) < 1.55


@pytest.mark.parametrize("resolution", [0.0, -1e-3, np.nan])
def test_a_resolution_must_be_greater_than_zero(resolution):
    for ask in (one([1.0]).steps, lambda r: one([1.0]).continued_cpf(1.0, r)):
        with pytest.raises(ValueError, match=r"resolution must be greater than 0 m, got"):
            ask(resolution)


def test_distributions_are_a_sequence_of_one_per_path_point():
    points = make_points([0.0, 0.01, 1.0], [0.0, 0.0, 0.0], [3.0, 1.0, 2.0])
    found = height_distributions(points, straight_path((0, 0), (1, 0), spacing=0.5))
    assert len(found) == 3
    assert found.count.tolist() == [2, 0, 1]
    assert_array_equal(found[0].heights, [1.0, 3.0])
    assert_allclose(found[0].distances, [0.01, 0.0], rtol=0, atol=1e-12)
    assert found[1].heights.size == 0
    assert_array_equal(found[-1].heights, [2.0])
    assert [d.heights.size for d in found] == [2, 0, 1]
    for beyond in (3, -4):
        with pytest.raises(IndexError):
            found[beyond]
