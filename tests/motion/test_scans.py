"""Missing scans, counted by the stamps of the others."""

import numpy as np
import pytest

from trueterrain.georeference.scans import count_missing_scans

TIME = 3.0 + 0.001 * np.arange(1000)  # [s]


def test_nothing_is_missing():
    found = count_missing_scans(TIME)
    assert (found.count, found.gaps) == (0, 0)


def test_dropped_scans_are_counted():
    kept = np.ones(TIME.size, bool)
    kept[[100, 200, 201, 202, 700]] = False
    found = count_missing_scans(TIME[kept])
    assert (found.count, found.gaps) == (5, 3)
    np.testing.assert_allclose(found.longest, 0.004, rtol=0, atol=1e-12)  # [s]
    assert found.at == TIME[199]


@pytest.mark.parametrize("time", [[], [1.0]])
def test_too_few_scans_to_miss_any(time):
    assert count_missing_scans(time).count == 0


def test_jitter_of_the_stamps_is_no_gap():
    jitter = 5e-5 * np.random.default_rng(1).normal(size=TIME.size)
    assert count_missing_scans(TIME + jitter).count == 0
