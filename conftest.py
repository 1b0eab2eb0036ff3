"""Fixtures for the tests and for the examples in docstrings."""

import sys
from collections.abc import Iterator

import numba
import pytest

# Kernels run in one thread: inputs are small, and threads of several workers of pytest-xdist wait
# for each other longer than they compute. Tests of threads set their number themselves.
numba.set_num_threads(1)


@pytest.fixture(autouse=True)
def _close_figures() -> Iterator[None]:
    """Close the figures of each test and example, since pyplot keeps them in memory."""
    yield
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is not None:
        pyplot.close("all")
