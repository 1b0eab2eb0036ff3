import numpy as np
import numpy.testing as npt
import pytest
from scipy.signal import welch

from trueterrain.simulate.noise import (
    GaussMarkov,
    RandomWalk,
    SecondOrderGaussMarkov,
    White,
    accumulate_samples,
    named_generator,
)

MANY = 40_000  # components: realisations of one process
# A variance of MANY normal numbers has a relative standard deviation of sqrt(2 / MANY) = 0.7 %;
# four of them are exceeded once in 16,000 tests, and the seeds are fixed.
MOMENT = 4 * np.sqrt(2 / MANY)
EXACT = 1e-13  # [1] round-off in sums of a few hundred numbers of size 1


def processes(name):
    """The process `name` with two components, from its first sample."""
    rng = named_generator(7, name)
    common = {"rng": rng, "rate": 200.0}
    return {
        "white": lambda: White(rng=rng, sd=[1.0, 2.0]),
        "walk": lambda: RandomWalk(density=[1.0, 2.0], **common),
        "first": lambda: GaussMarkov(sd=[1.0, 2.0], correlation_time=0.3, **common),
        "second": lambda: SecondOrderGaussMarkov(sd=[1.0, 2.0], correlation_time=0.3, **common),
    }[name]()


@pytest.mark.parametrize("name", ["white", "walk", "first", "second"])
def test_samples_are_the_same_bits_for_any_blocks(name):
    whole = processes(name).next(1000)
    stream = processes(name)
    cuts = [1, 0, 2, 500, 7, 90, 399, 1]
    npt.assert_array_equal(np.concatenate([stream.next(n) for n in cuts]), whole)


def test_names_and_seeds_have_numbers_of_their_own():
    draws = [
        named_generator(*key).standard_normal(4)
        for key in [(1,), (2,), (1, "a"), (1, "b"), (1, "a", "b"), (1, "ab"), (1, "a b")]
    ]
    assert len({tuple(draw) for draw in draws}) == len(draws)
    npt.assert_array_equal(named_generator(1, "a").standard_normal(4), draws[2])


def test_numbers_are_those_of_a_recorded_run():
    """Numbers must not change with a version: they are part of what a scene and a seed mean."""
    recorded = named_generator(1, "navigation", "drift").integers(0, 1000, 4)
    npt.assert_array_equal(recorded, [826, 305, 696, 225])


def test_white_noise_is_flat_and_normal():
    sd, rate = 0.3, 100.0
    samples = White(rng=named_generator(1, "white"), sd=sd).next(400_000)[:, 0]
    npt.assert_allclose(samples.mean(), 0, rtol=0, atol=4 * sd / np.sqrt(samples.size))
    npt.assert_allclose(np.mean(samples**4) / sd**4, 3, rtol=0, atol=4 * np.sqrt(96 / samples.size))
    f, psd = welch(samples, rate, nperseg=256)
    # A band of Welch's spectrum averages as many squares as there are samples times its fraction.
    for low, high in [(1, 10), (10, 40), (40, 49)]:
        band = (f > low) & (f < high)
        fraction = (high - low) / (rate / 2)
        bound = 4 * np.sqrt(2 / (samples.size * fraction))
        npt.assert_allclose(psd[band].mean() / (2 * sd**2 / rate), 1, rtol=0, atol=bound)


def test_random_walk_spreads_with_the_root_of_time():
    density, rate = 0.5, 20.0
    walk = RandomWalk(rng=named_generator(1, "w"), density=np.full(MANY, density), rate=rate).next(
        101
    )
    npt.assert_array_equal(walk[0], 0)
    for i in (1, 20, 100):
        npt.assert_allclose(walk[i].var() / (density**2 * i / rate), 1, rtol=0, atol=MOMENT)
    steps = np.diff(walk, axis=0)
    npt.assert_allclose(
        (steps[5] * steps[6]).mean() * rate / density**2, 0, rtol=0, atol=4 / np.sqrt(MANY)
    )


def autocorrelation(order, time, correlation_time):
    """That of the two Gauss-Markov processes, from their definition."""
    if order == 1:
        return np.exp(-time / correlation_time)
    from scipy.optimize import brentq

    b = brentq(lambda x: (1 + x) * np.exp(-x) - np.exp(-1), 1, 4) / correlation_time
    return (1 + b * time) * np.exp(-b * time)


@pytest.mark.parametrize(("order", "kind"), [(1, GaussMarkov), (2, SecondOrderGaussMarkov)])
@pytest.mark.parametrize("rate", [2.0, 40.0, 2000.0])
def test_gauss_markov_has_its_moments_from_the_first_sample(order, kind, rate):
    sd, correlation_time, n = 0.025, 2.0, 9
    x = kind(
        rng=named_generator(1, "gm"),
        sd=np.full(MANY, sd),
        correlation_time=correlation_time,
        rate=rate,
    ).next(n)
    for i in (0, 1, n - 1):
        npt.assert_allclose(x[i].var() / sd**2, 1, rtol=0, atol=MOMENT)
        npt.assert_allclose(x[i].mean(), 0, rtol=0, atol=4 * sd / np.sqrt(MANY))
    for lag in (1, 4, n - 1):
        truth = autocorrelation(order, lag / rate, correlation_time)
        npt.assert_allclose((x[0] * x[lag]).mean() / sd**2, truth, rtol=0, atol=MOMENT)
        # What is left when the correlated part is removed shows small steps in full.
        step = x[lag] - x[0]
        truth = 2 * (1 - truth)
        npt.assert_allclose(step.var() / sd**2 / truth, 1, rtol=0, atol=MOMENT)


@pytest.mark.parametrize(("order", "kind"), [(1, GaussMarkov), (2, SecondOrderGaussMarkov)])
def test_gauss_markov_falls_to_1_over_e_after_its_correlation_time(order, kind):
    process = kind(rng=named_generator(2, "gm"), sd=np.ones(MANY), correlation_time=25.0, rate=1.0)
    x = process.next(26)
    npt.assert_allclose((x[0] * x[25]).mean(), np.exp(-1), rtol=0, atol=MOMENT)


def test_first_order_spectrum_is_that_of_theory():
    sd, time, rate = 0.025, 25.0, 20.0
    x = GaussMarkov(rng=named_generator(3, "gm"), sd=sd, correlation_time=time, rate=rate)
    f, psd = welch(x.next(2_000_000)[:, 0], rate, nperseg=65536)
    theory = 4 * sd**2 * time / (1 + (2 * np.pi * f * time) ** 2)
    # 61 overlapping segments, 30 or more lines: 2 / sqrt(61 * 30) = 5 %; far below the Nyquist
    # frequency, where the spectrum of samples is that of the process.
    for low, high in [(0.002, 0.02), (0.02, 0.2), (0.2, 1)]:
        band = (f > low) & (f < high)
        npt.assert_allclose((psd[band] / theory[band]).mean(), 1, rtol=0, atol=0.1)


def test_second_order_is_smooth():
    """Its rate has the standard deviation b sd; that of first order has none at all."""
    sd, time, rate = 1.0, 2.0, 2000.0
    x = SecondOrderGaussMarkov(
        rng=named_generator(1, "gm"), sd=np.full(MANY, sd), correlation_time=time, rate=rate
    ).next(2)
    b = 2.146193220620583 / time
    npt.assert_allclose(np.diff(x, axis=0).std() * rate / (b * sd), 1, rtol=0, atol=MOMENT)


def test_accumulate_is_its_recursion():
    rng = np.random.default_rng(1)
    drive, x = rng.normal(size=(300, 2)), np.array([0.5, -2.0])
    last, truth = x, []
    for w in drive:
        x = 0.9 * x + w
        truth.append(x)
    npt.assert_allclose(accumulate_samples(0.9, drive, last), truth, rtol=0, atol=EXACT)
    assert accumulate_samples(0.9, np.zeros((0, 2)), last).shape == (0, 2)


@pytest.mark.parametrize("seed", [-1, 1.5, True, "a"])
def test_bad_seeds_are_refused(seed):
    with pytest.raises(ValueError, match="seed must be a whole number of at least 0"):
        named_generator(seed)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (White, {"sd": -1.0}, "sd must be at least 0, got -1.0"),
        (White, {"sd": np.nan}, "sd must be at least 0"),
        (White, {"sd": np.ones((2, 2))}, r"sd must be a number or one per component.*\(2, 2\)"),
        (RandomWalk, {"density": -1.0, "rate": 1.0}, "density must be at least 0"),
        (RandomWalk, {"density": 1.0, "rate": 0.0}, "rate must be greater than 0, got 0.0"),
        (GaussMarkov, {"sd": 1.0, "correlation_time": 0.0, "rate": 1.0}, "correlation_time must"),
        (GaussMarkov, {"sd": [1.0, -1.0], "correlation_time": 1.0, "rate": 1.0}, "sd must be"),
        (
            SecondOrderGaussMarkov,
            {"sd": 1.0, "correlation_time": 1.0, "rate": np.inf},
            "rate must be greater than 0",
        ),
    ],
)
def test_bad_parameters_are_refused(kind, values, message):
    with pytest.raises(ValueError, match=message):
        kind(rng=named_generator(1), **values)
