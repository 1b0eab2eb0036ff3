from itertools import pairwise

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trueterrain.simulate.clock import SimulatedClock, check_next

EXACT = 1e-12  # [s] round-off of times of a few hundred seconds


def test_true_time_is_stamp_plus_clock():
    clock = SimulatedClock(offset=0.25, rate=1e-3, begin=100.0)
    npt.assert_allclose(clock.true(np.array([100.0, 200.0])), [100.25, 200.35], rtol=0, atol=EXACT)


@given(
    offset=st.floats(-1, 1),
    rate=st.floats(-1e-3, 1e-3),
    begin=st.floats(-1e3, 1e3),
    frequency=st.sampled_from([7.0, 100.0, 200.0, 1000.0, 8000.0]),
    edges=st.lists(st.floats(0, 0.5), min_size=3, max_size=6),
)
def test_each_tick_is_in_one_interval(offset, rate, begin, frequency, edges):
    clock = SimulatedClock(offset=offset, rate=rate, begin=begin)
    edges = np.sort(edges) + begin
    whole = clock.ticks(edges[0], edges[-1], frequency)
    parts = [clock.ticks(a, b, frequency) for a, b in pairwise(edges)]
    npt.assert_array_equal(np.concatenate(parts), whole)
    true = clock.true(whole / frequency)
    assert ((edges[0] <= true) & (true < edges[-1])).all()
    beyond = clock.true(np.array([whole[0] - 1, whole[-1] + 1]) / frequency) if whole.size else []
    assert not any(edges[0] <= time < edges[-1] for time in beyond)


def test_a_tick_at_the_end_belongs_to_the_next_block():
    npt.assert_array_equal(SimulatedClock().ticks(0.0, 0.3, 10.0), [0, 1, 2])
    npt.assert_array_equal(SimulatedClock().ticks(0.3, 0.5, 10.0), [3, 4])
    assert SimulatedClock().ticks(0.31, 0.39, 10.0).size == 0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"offset": np.nan}, "clock offset must be finite"),
        ({"begin": np.inf}, "clock begin must be finite"),
        ({"rate": 0.2}, "clock rate must be from -0.1 to 0.1 s/s, got 0.2"),
    ],
)
def test_bad_clocks_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        SimulatedClock(**values)


def test_blocks_must_follow_each_other():
    check_next(1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match=r"begin must be the end of the last block, 1.0 s, got 2"):
        check_next(1.0, 2.0, 3.0)
    with pytest.raises(ValueError, match=r"end must be at least the begin, 1.0 s, got 0.5 s"):
        check_next(1.0, 1.0, 0.5)
    with pytest.raises(ValueError, match="end must be"):
        check_next(1.0, 1.0, np.inf)
