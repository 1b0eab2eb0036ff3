"""A height depends on the point, the parameters and the seed: on nothing else, to the last bit."""

import numba
import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.simulate.ground import (
    BelgianBlock,
    Cleats,
    Cracks,
    Ground,
    Plane,
    Road,
    Sine,
    Step,
    Stones,
)

SAME = {"rtol": 0, "atol": 0.0}  # [m] not a bit may differ

RANDOM = [BelgianBlock, Stones, Cracks]
GROUNDS: list[Ground] = [
    Plane(slope=0.1, camber=-0.03),
    Sine(amplitude=0.02, wavelength=0.7, direction=0.4),
    Step(position=3.0, width=0.3, direction=0.4),
    Cleats(first=1.0, number=5, shape="semicircle", direction=0.4),
    BelgianBlock(seed=1, direction=0.4),
    Road(road_class="C", waves=500, seed=1),
    Stones(seed=1),
    Cracks(seed=1, direction=0.4),
    Cracks(pattern="alligator", spacing=0.3, meander=0.03, seed=1),
    BelgianBlock(seed=2) + Stones(seed=3) + Cracks(seed=4),
]


def name(ground: object) -> str:
    return type(ground).__name__


@pytest.fixture(scope="module")
def points() -> tuple[np.ndarray, np.ndarray]:
    """Points near and far, on either side of zero."""
    x, y = np.random.default_rng(1).uniform(-30.0, 30.0, (2, 5003))
    x[2000:3000] += 512_345.0
    y[2500:3500] -= 5_412_345.0
    return x, y


@pytest.mark.parametrize("ground", GROUNDS, ids=name)
def test_the_order_of_the_points_does_not_matter(ground, points):
    x, y = points
    order = np.random.default_rng(2).permutation(x.size)
    npt.assert_allclose(ground.height(x[order], y[order]), ground.height(x, y)[order], **SAME)


@pytest.mark.parametrize("ground", GROUNDS, ids=name)
@pytest.mark.parametrize("block", [1, 7, 513, 4096])
def test_the_size_of_the_blocks_does_not_matter(ground, points, block):
    x, y = points[0][:1537], points[1][:1537]
    step = range(0, x.size, block)
    pieces = [ground.height(x[i : i + block], y[i : i + block]) for i in step]
    npt.assert_allclose(np.concatenate(pieces), ground.height(x, y), **SAME)


@pytest.mark.parametrize("ground", GROUNDS, ids=name)
def test_the_shape_and_layout_of_the_arrays_do_not_matter(ground, points):
    x, y = points[0][:600], points[1][:600]
    truth = ground.height(x, y)
    npt.assert_allclose(ground.height(x.reshape(20, 30), y.reshape(20, 30)).ravel(), truth, **SAME)
    npt.assert_allclose(ground.height(x[::3], y[::3]), truth[::3], **SAME)
    npt.assert_allclose(ground.height(x[::-1], y[::-1])[::-1], truth, **SAME)
    grid = ground.height(x[:40, None], y[:50])
    npt.assert_allclose([grid[i, i] for i in range(40)], truth[:40], **SAME)
    npt.assert_allclose(ground.height(float(x[5]), float(y[5])), truth[5], **SAME)
    with_gap = ground.height(np.insert(x, 100, np.nan), np.insert(y, 100, 0.0))
    npt.assert_allclose(np.delete(with_gap, 100), truth, **SAME)


@pytest.mark.parametrize("ground", GROUNDS, ids=name)
def test_heights_are_finite_everywhere(ground, points):
    assert np.isfinite(ground.height(*points)).all()


@pytest.mark.parametrize("kind", RANDOM, ids=lambda kind: kind.__name__)
def test_the_seed_determines_the_ground(kind, points):
    first, again, other = kind(seed=7), kind(seed=7), kind(seed=8)
    npt.assert_allclose(first.height(*points), again.height(*points), **SAME)
    assert not np.array_equal(first.height(*points), other.height(*points))


def test_the_seed_determines_the_road(points):
    roads = [Road(road_class="C", waves=300, seed=seed).height(*points) for seed in (7, 7, 8)]
    npt.assert_allclose(roads[0], roads[1], **SAME)
    assert abs(np.corrcoef(roads[0], roads[2])[0, 1]) < 0.2  # [1] other waves, not shifted ones


def test_the_number_of_threads_does_not_matter():
    ground = BelgianBlock(seed=2) + Road(road_class="C", waves=100) + Stones() + Cracks()
    x, y = np.random.default_rng(0).uniform(-9, 9, (2, 3001))
    alone = ground.height(x, y)
    try:
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        npt.assert_array_equal(ground.height(x, y), alone)
    finally:
        numba.set_num_threads(1)
