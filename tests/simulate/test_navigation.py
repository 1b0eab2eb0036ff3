from itertools import pairwise

import numpy as np
import numpy.testing as npt
import pytest
from scipy.interpolate import BPoly
from scipy.signal import welch

from trueterrain.simulate.drift import DriftSeries, GaussMarkovDrift
from trueterrain.simulate.navigation import Navigation, NavigationStream
from trueterrain.simulate.pose import COMPONENTS, PoseKnots
from trueterrain.simulate.quality import Quality

EXACT = 1e-12  # [m], [rad] round-off of poses of a few metres
PERFECT = {
    "drift": GaussMarkovDrift(height_sd=0.0, between_passes=0.0),
    "horizontal_sd": 0.0,
    "attitude_sd": (0.0,) * 3,
    "noise": (0.0,) * 6,
}


def random_motion(seconds, spacing=0.1, seed=4):
    """A motion of random knots, and scipy's polynomials through them."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds / spacing) + 1) * spacing
    values = [rng.normal(size=(time.size, 6)) * scale for scale in (1, 3, 10)]
    knots = PoseKnots(time=time, pose=values[0], rate=values[1], acceleration=values[2])
    return knots, BPoly.from_derivatives(time, np.stack(values, axis=1))


def still(end):
    zero = np.zeros((2, 6))
    return PoseKnots(time=np.array([0.0, end]), pose=zero, rate=zero, acceleration=zero)


def stationary(parameters, epochs, *, seed=1, pass_number=0):
    """What is recorded of a body at rest at the origin: the errors alone."""
    stream = NavigationStream(parameters, seed=seed, pass_number=pass_number)
    end = epochs / parameters.rate
    return stream.record(still(end), 0.0, end)


def test_perfect_navigation_records_the_exact_motion():
    knots, truth = random_motion(2.0)
    recorded, _ = NavigationStream(Navigation(**PERFECT), seed=1).record(knots, 0.0, 2.0)
    npt.assert_array_equal(recorded["time"], np.arange(400) / 200)
    for column, name in enumerate(COMPONENTS):
        npt.assert_allclose(recorded[name], truth(recorded["time"])[:, column], rtol=0, atol=EXACT)
        npt.assert_array_equal(recorded[f"sd_{name}"], 0)


def test_an_event_at_t_is_stamped_t_less_clock():
    """East moves by 1 m/s, so that it tells the true time."""
    time = np.array([0.0, 10.0])
    pose, rate = np.zeros((2, 6)), np.zeros((2, 6))
    pose[:, 0], rate[:, 0] = time, 1.0
    knots = PoseKnots(time=time, pose=pose, rate=rate, acceleration=np.zeros((2, 6)))
    parameters = Navigation(**PERFECT, clock_offset=0.3, clock_rate=1e-3)
    recorded, truth = NavigationStream(parameters, seed=1).record(knots, 0.0, 10.0)
    clock = 0.3 + 1e-3 * recorded["time"]
    npt.assert_allclose(recorded["time"], recorded["east"] - clock, rtol=0, atol=EXACT)
    npt.assert_allclose(recorded["east"], truth["true_time"], rtol=0, atol=EXACT)
    # Stamps are whole multiples of 5 ms and cover all true times.
    npt.assert_array_equal(recorded["time"], np.arange(-59, -59 + recorded["time"].size) / 200)
    assert 0 <= truth["true_time"][0] < 0.005 * 1.001 < 10 - 0.005 * 1.001 < truth["true_time"][-1]
    assert truth["true_time"][-1] < 10


def test_a_clock_offset_holds_at_the_begin_of_the_pass():
    parameters = Navigation(**PERFECT, clock_offset=0.002, clock_rate=1e-4)
    stream = NavigationStream(parameters, seed=1, begin=1000.0)
    knots = PoseKnots(
        time=np.array([1000.0, 1001.0]),
        **dict.fromkeys(("pose", "rate", "acceleration"), np.zeros((2, 6))),
    )
    recorded, truth = stream.record(knots, 1000.0, 1001.0)
    clock = truth["true_time"] - recorded["time"]
    npt.assert_allclose(clock[[0, -1]], [0.002, 0.0021], rtol=0, atol=1e-6)  # 5 ms x 1e-4


def test_truth_holds_the_injected_errors():
    knots, pose = random_motion(3.0)
    quality = (Quality(begin=1.0, state="standalone"),)
    recorded, truth = NavigationStream(
        Navigation(quality=quality, clock_offset=-0.01), seed=1
    ).record(knots, 0.0, 3.0)
    exact = pose(truth["true_time"])
    for column, name in enumerate(COMPONENTS):
        npt.assert_allclose(
            recorded[name] - exact[:, column], truth[f"error_{name}"], rtol=0, atol=EXACT
        )
    npt.assert_array_equal(truth["quality"], np.where(truth["true_time"] < 1, 0, 2))


QUALITY = (
    Quality(begin=0.2, state="decimetre"),
    Quality(begin=0.5, state="outage"),
    Quality(begin=1.1, state="base station"),
)


@pytest.mark.parametrize("order", ["first", "second"])
@pytest.mark.parametrize("rate", [200.0, 133.0])
def test_blocks_do_not_matter(order, rate):
    """Bit for bit, however a pass is cut, even between the epochs."""
    knots, _ = random_motion(2.0)
    parameters = Navigation(
        rate=rate,
        quality=QUALITY,
        drift=GaussMarkovDrift(order=order),
        clock_offset=0.01,
        clock_rate=1e-5,
    )
    whole = NavigationStream(parameters, seed=3, pass_number=1).record(knots, 0.0, 2.0)
    rng = np.random.default_rng(1)
    for edges in (np.linspace(0, 2, 5), np.r_[0, np.sort(rng.uniform(0, 2, 300)), 2]):
        stream = NavigationStream(parameters, seed=3, pass_number=1)
        blocks = [stream.record(knots, float(a), float(b)) for a, b in pairwise(edges)]
        for part in (0, 1):
            for name, values in whole[part].items():
                joined = np.concatenate([block[part][name] for block in blocks])
                npt.assert_array_equal(joined, values, err_msg=name)


def test_seeds_and_passes_have_errors_of_their_own():
    parameters = Navigation()
    ups = [
        stationary(parameters, 10, seed=seed, pass_number=k).recorded["east"]
        for seed, k in [(1, 0), (1, 1), (2, 0), (1, 0)]
    ]
    npt.assert_array_equal(ups[0], ups[3])
    assert len({tuple(up) for up in ups}) == 3


def test_one_error_does_not_depend_on_the_others():
    """The same seed gives the same noise, whatever else is wrong: errors can be compared."""
    plain = stationary(Navigation(), 50)
    other = stationary(Navigation(quality=QUALITY, attitude_time=5.0), 50)
    npt.assert_array_equal(other.recorded["east"][:40], plain.recorded["east"][:40])
    npt.assert_array_equal(other.truth["drift_up"], plain.truth["drift_up"])


def correlation(x, lag):
    return np.mean(x[lag:] * x[: x.size - lag]) / np.mean(x * x)


def test_drifts_have_their_moments():
    """400,000 s, 25 s and 60 s: at least 6600 correlation times of each error."""
    attitude = (1e-4, 2e-4, 4e-4)
    parameters = Navigation(rate=1.0, horizontal_sd=0.05, attitude_sd=attitude, noise=(0.0,) * 6)
    recorded, truth = stationary(parameters, 400_000)
    sds = (0.05, 0.05, 0.025 / np.sqrt(2), *attitude)
    for name, sd, time in zip(COMPONENTS, sds, [25] * 3 + [60] * 3, strict=True):
        error = recorded[name] - (0.021 if name == "up" else 0.0)
        # Variance of an exponentially correlated signal: relative sd sqrt(2 T / time) = 1.7 % at
        # most, of its root 0.9 %; of its autocorrelation about 1.7 %.
        npt.assert_allclose(error.std() / sd, 1, rtol=0, atol=4 * 0.009)
        npt.assert_allclose(correlation(error, time), np.exp(-1), rtol=0, atol=4 * 0.017)
    npt.assert_array_equal(truth["drift_up"], recorded["up"])


def test_white_noise_is_white_in_each_component():
    sds = (0.001, 0.002, 0.003, 1e-5, 2e-5, 3e-5)
    recorded, _ = stationary(Navigation(**PERFECT | {"noise": sds}), 100_000)
    for name, sd in zip(COMPONENTS, sds, strict=True):
        f, psd = welch(recorded[name], 200.0, nperseg=1024)
        # One-sided density 2 sd^2 / rate; a third of 100,000 samples in each band: 0.8 %.
        for low, high in [(1, 34), (34, 67), (67, 100)]:
            density = psd[(f > low) & (f < high)].mean()
            npt.assert_allclose(density / (2 * sd**2 / 200), 1, rtol=0, atol=4 * 0.008)
    for one, two in pairwise(COMPONENTS):
        together = np.corrcoef(recorded[one], recorded[two])[0, 1]
        npt.assert_allclose(together, 0, rtol=0, atol=4 / np.sqrt(100_000))


@pytest.mark.parametrize("optimism", [1.0, 0.5])
def test_reported_standard_deviations_are_true_or_optimistic(optimism):
    parameters = Navigation(rate=0.5, optimism=optimism, quality=QUALITY[:1])
    blocks = [stationary(parameters, 100_000, pass_number=k) for k in (0, 1)]
    for name in COMPONENTS:
        ratio = np.concatenate(
            [block.recorded[name] / block.recorded[f"sd_{name}"] for block in blocks]
        )
        npt.assert_allclose(np.sqrt(np.mean(ratio**2)) * optimism, 1, rtol=0, atol=0.03)


def test_reported_standard_deviations_are_their_sum_of_squares():
    recorded, _ = stationary(Navigation(), 1)
    degree = np.pi / 180
    npt.assert_allclose(recorded["sd_east"], np.hypot(0.02, 0.001), rtol=0, atol=EXACT)
    up = np.sqrt(0.021**2 + 0.025**2 / 2 + 0.001**2)
    npt.assert_allclose(recorded["sd_up"], up, rtol=0, atol=EXACT)
    # The class of the POS LV 220: 0.02 m, 0.015 and 0.025 degrees; rounded to a thousandth.
    npt.assert_allclose(recorded["sd_roll"] / degree, 0.015, rtol=0, atol=0.0005)
    npt.assert_allclose(recorded["sd_yaw"] / degree, 0.025, rtol=0, atol=0.0005)


def test_quality_shows_in_errors_and_their_standard_deviations():
    quality = (Quality(begin=100.0, state="standalone"), Quality(begin=400.0, state="outage"))
    parameters = Navigation(rate=10.0, quality=quality)
    recorded, truth = stationary(parameters, 6000)
    error = np.stack([truth[f"error_{name}"] for name in COMPONENTS[:3]], axis=1)
    assert np.abs(error[:1000]).max() < 0.15  # 2 cm, up to 5 sd
    assert 0.3 < error[1000:4000].std() < 2.0  # 0.8 m to 1.2 m, five correlation times long
    assert abs(error[4000] - error[3999]).max() < 0.05  # goes on from the last value
    sd = recorded["sd_north"]
    assert 0.8 < sd[3999] < 1.21
    assert sd[-1] > sd[4000] + 0.5  # 200 s of outage: 1e-4 x 200^2 / 2 = 2 m
    npt.assert_array_equal(np.unique(truth["quality"]), [0, 2, 3])


def test_two_passes_differ_by_a_series():
    series = DriftSeries(time=(0.0, 5.0, 10.0), height=(0.0, 0.08, 0.02))
    parameters = Navigation(**PERFECT | {"drift": series})
    one, two = (stationary(parameters, 2000, pass_number=k).recorded for k in (0, 1))
    truth = np.interp(one["time"], series.time, series.height)
    npt.assert_allclose(two["up"] - one["up"], truth, rtol=0, atol=EXACT)


def test_blocks_must_follow_each_other_and_lie_within_the_knots():
    stream = NavigationStream(Navigation(), seed=1)
    with pytest.raises(ValueError, match=r"begin must be the end of the last block, 0.0 s"):
        stream.record(still(2.0), 1.0, 2.0)
    with pytest.raises(ValueError, match=r"time must be from 0.0 s to 2.0 s"):
        stream.record(still(2.0), 0.0, 3.0)
    first = stream.record(still(2.0), 0.0, 1.0).recorded["up"]  # a refusal leaves no trace
    npt.assert_array_equal(first, stationary(Navigation(), 200).recorded["up"])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rate": 0.0}, "rate must be greater than 0, got 0.0"),
        ({"horizontal_sd": -0.1}, "horizontal_sd must be at least 0, got -0.1"),
        ({"horizontal_time": 0.0}, "horizontal_time must be greater than 0"),
        ({"attitude_time": -1.0}, "attitude_time must be greater than 0"),
        ({"attitude_sd": (0.1, 0.1)}, r"attitude_sd must be 3 numbers, got shape \(2,\)"),
        ({"attitude_sd": (0.1, -0.1, 0.1)}, "attitude_sd of pitch must be at least 0, got -0.1"),
        ({"noise": 0.001}, r"noise must be 6 numbers, got shape \(\)"),
        ({"noise": (0.0, 0.0, np.nan, 0.0, 0.0, 0.0)}, "noise of up must be at least 0, got nan"),
        ({"clock_offset": np.inf}, "clock offset must be finite"),
        ({"clock_rate": 1.0}, "clock rate must be"),
        ({"optimism": 0.0}, "optimism must be greater than 0, got 0.0"),
        ({"quality": QUALITY[::-1]}, "quality must be in order of time"),
    ],
)
def test_bad_parameters_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Navigation(**values)


def test_bad_seeds_are_refused():
    with pytest.raises(ValueError, match="seed must be a whole number of at least 0, got -1"):
        NavigationStream(Navigation(), seed=-1)
