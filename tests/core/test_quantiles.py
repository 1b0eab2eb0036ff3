"""Exact quantiles in two sweeps, compared with sorting all values."""

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trueterrain.core.quantiles import exact_quantiles

FRACTIONS = [0.0, 0.1, 0.5, 0.95, 1.0]
ROUNDING = 1e-12  # relative, of the line between two values


def in_blocks(values, count=3):
    return lambda: np.array_split(values, count)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float32, st.integers(1, 60), elements=st.floats(0, 2.0**100, width=32)))
def test_quantiles_of_any_floats_are_those_of_numpy(values):
    expected = np.quantile(values.astype(np.float64), FRACTIONS)
    npt.assert_allclose(exact_quantiles(in_blocks(values), FRACTIONS), expected, rtol=ROUNDING)


def test_quantiles_of_many_values_close_together():
    rng = np.random.default_rng(1)
    values = (0.003 + 1e-5 * rng.random(200_001)).astype(np.float32)
    expected = np.quantile(values.astype(np.float64), FRACTIONS)
    npt.assert_allclose(exact_quantiles(in_blocks(values), FRACTIONS), expected, rtol=ROUNDING)


def test_quantiles_of_counts():
    counts = np.random.default_rng(2).integers(0, 100_000, 5001).astype(np.int32)
    expected = np.quantile(counts, FRACTIONS)
    npt.assert_allclose(exact_quantiles(in_blocks(counts), FRACTIONS), expected, rtol=ROUNDING)


@pytest.mark.parametrize("values", [np.float32([]), np.float32([np.nan])])
def test_without_values_there_are_no_quantiles(values):
    assert exact_quantiles(in_blocks(values), [0.5]) is None


def test_nan_and_negative_zero_do_not_disturb():
    values = np.float32([np.nan, -0.0, 1.0, np.nan, 3.0])
    assert exact_quantiles(in_blocks(values), [0.0, 0.5, 1.0]) == [0.0, 1.0, 3.0]
