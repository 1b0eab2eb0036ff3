import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.simulate.drift import (
    DriftSeries,
    GaussMarkovDrift,
    start_drift,
)
from trueterrain.simulate.navigation import Navigation, NavigationStream
from trueterrain.simulate.pose import PoseKnots

EXACT = 1e-12  # [m] round-off
# What was published about the two drives (checked independently when the data were collected):
# rounded to 1 mm and to 0.01.
POSES, MEDIAN, SD = 6937, -0.042, 0.025
PERCENTILES = (-0.087, 0.030)  # 1 % and 99 % [m]
AUTOCORRELATION = {1: 0.96, 5: 0.81, 10: 0.69, 20: 0.44, 30: 0.33, 60: 0.07}
MILLIMETRE = 0.0006  # [m] half a millimetre of rounding, and what pairing of poses leaves
HUNDREDTH = 0.015  # [1] rounding to 0.01, and what interpolation over stops leaves


def autocorrelation(values, lag):
    x = values - values.mean()
    return np.mean(x[lag:] * x[: x.size - lag]) / np.mean(x * x)


def test_the_measured_difference_has_its_known_statistics(measured_drift):
    time, height = measured_drift
    assert time.size == POSES
    npt.assert_allclose(np.median(height), MEDIAN, rtol=0, atol=MILLIMETRE)
    npt.assert_allclose(height.std(), SD, rtol=0, atol=MILLIMETRE)
    npt.assert_allclose(np.percentile(height, [1, 99]), PERCENTILES, rtol=0, atol=MILLIMETRE)
    even = np.interp(np.arange(0, time[-1], 0.1), time, height)
    for lag, truth in AUTOCORRELATION.items():
        npt.assert_allclose(autocorrelation(even, 10 * lag), truth, rtol=0, atol=HUNDREDTH)
    # What is left after a moving mean over 31 s.
    mean = np.convolve(even, np.full(311, 1 / 311), "valid")
    npt.assert_allclose((even[155:-155] - mean).std(), 0.0105, rtol=0, atol=MILLIMETRE)


def test_the_default_drift_has_the_statistics_of_the_measured_one():
    """Published statistics of the difference of two passes, without any file."""
    rate, n = 2.0, 400_000
    time = np.arange(n) / rate
    passes = [
        start_drift(GaussMarkovDrift(), seed=5, pass_number=k, rate=rate).next(time) for k in (0, 1)
    ]
    difference = passes[1] - passes[0]
    # n / rate / 25 s = 8000 correlation times: 25 mm / sqrt(4000) = 0.4 mm for the mean.
    npt.assert_allclose(np.median(difference), MEDIAN, rtol=0, atol=0.0016)
    npt.assert_allclose(difference.std(), SD, rtol=0, atol=0.0012)
    for lag, truth in AUTOCORRELATION.items():
        # The process falls exactly exponentially, the measured signal within 0.03 of that.
        value = autocorrelation(difference, int(lag * rate))
        npt.assert_allclose(value, truth, rtol=0, atol=0.03 + 0.025)
        npt.assert_allclose(value, np.exp(-lag / 25), rtol=0, atol=0.025)
    window = int(31 * rate) + 1
    mean = np.convolve(difference, np.full(window, 1 / window), "valid")
    residual = difference[window // 2 : -(window // 2)] - mean
    npt.assert_allclose(residual.std(), 0.0105, rtol=0, atol=0.001)


def test_short_passes_differ_from_seed_to_seed_as_the_measured_ones_do_from_place_to_place():
    """At one station, over seeds; and the mean over 8 s, which knows the correlation time.

    400 seeds: 25 mm / sqrt(400) = 1.2 mm for the mean, 25 mm / sqrt(800) = 0.9 mm for the standard
    deviation; within three times that.
    """
    still = PoseKnots(
        time=np.array([0.0, 8.0]),
        pose=np.zeros((2, 6)),
        rate=np.zeros((2, 6)),
        acceleration=np.zeros((2, 6)),
    )
    instrument = Navigation(rate=20.0)

    def recorded(seed, number):
        stream = NavigationStream(instrument, seed=seed, pass_number=number)
        return stream.record(still, 0.0, 8.0).recorded["up"]

    up = np.array([[recorded(seed, k) for k in (0, 1)] for seed in range(400)])
    difference = up[:, 1] - up[:, 0]
    npt.assert_allclose(difference[:, 80].mean(), MEDIAN, rtol=0, atol=0.0038)
    npt.assert_allclose(difference[:, 80].std(), SD, rtol=0, atol=0.0027)
    fraction = 8.0 / 25.0
    over_all = SD * np.sqrt(2.0 / fraction**2 * (fraction - 1.0 + np.exp(-fraction)))
    npt.assert_allclose(difference.mean(axis=1).std(), over_all, rtol=0, atol=0.0027)


def test_odd_and_even_passes_lie_either_side():
    parameters = GaussMarkovDrift(height_sd=0.0, between_passes=-0.03)
    starts = [start_drift(parameters, seed=1, pass_number=k, rate=1.0) for k in range(4)]
    heights = [drift.next(np.zeros(1))[0] for drift in starts]
    npt.assert_allclose(heights, [0.015, -0.015, 0.015, -0.015], rtol=0, atol=EXACT)
    assert all(drift.sd == pytest.approx(0.015) for drift in starts)


def test_passes_have_drifts_of_their_own():
    drifts = [
        start_drift(GaussMarkovDrift(between_passes=0.0), seed=seed, pass_number=k, rate=1.0)
        for seed, k in [(1, 0), (1, 1), (1, 2), (2, 0)]
    ]
    series = [tuple(drift.next(np.arange(5.0))) for drift in drifts]
    assert len(set(series)) == 4


def test_second_order_drift_is_smooth():
    def roughness(order):
        drift = start_drift(GaussMarkovDrift(order=order), seed=1, pass_number=0, rate=200.0)
        return np.diff(drift.next(np.zeros(2000))).std()

    assert roughness("second") < 0.05 * roughness("first")


def test_two_passes_differ_by_the_series():
    series = DriftSeries(time=(0.0, 10.0, 20.0), height=(0.0, 0.05, -0.01), stretch=5.0)
    time = np.linspace(0, 20, 41)
    one, two, three, four = (
        start_drift(series, seed=1, pass_number=k, rate=1.0).next(time) for k in range(4)
    )
    truth = np.interp(time, series.time, series.height)
    npt.assert_allclose(two - one, truth, rtol=0, atol=EXACT)
    later = np.interp(20 - np.abs(20 - (time + 5)), series.time, series.height)
    npt.assert_allclose(four - three, later, rtol=0, atol=EXACT)


def test_a_series_continues_mirrored_at_its_ends():
    series = DriftSeries(time=(2.0, 12.0), height=(0.0, 1.0))
    drift = start_drift(series, seed=1, pass_number=1, rate=1.0)
    heights = drift.next(np.array([0.0, 10.0, 15.0, 20.0, 25.0]))
    npt.assert_allclose(heights, [0, 0.5, 0.25, 0, 0.25], rtol=0, atol=EXACT)


def test_sd_of_a_series_is_its_root_mean_square():
    series = DriftSeries(time=(0.0, 1.0, 5.0), height=(1.0, -2.0, 0.5))
    t = (np.arange(100_000) + 0.5) * 5e-5  # [s] midpoint rule: error 1e-9
    heights = np.interp(t, series.time, series.height) / 2
    sd = start_drift(series, seed=1, pass_number=1, rate=1.0).sd
    npt.assert_allclose(sd, np.sqrt(np.mean(heights**2)), rtol=0, atol=1e-8)


def test_the_measured_drift_is_injected_as_it_is(measured_drift):
    time, height = measured_drift
    series = DriftSeries(time=tuple(time), height=tuple(height))
    one, two = (start_drift(series, seed=1, pass_number=k, rate=1.0) for k in (0, 1))
    npt.assert_allclose(two.next(time) - one.next(time), height, rtol=0, atol=EXACT)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (GaussMarkovDrift, {"height_sd": -1.0}, "height_sd must be at least 0, got -1.0"),
        (GaussMarkovDrift, {"correlation_time": 0.0}, "correlation_time must be greater than 0"),
        (GaussMarkovDrift, {"between_passes": np.nan}, "between_passes must be finite"),
        (GaussMarkovDrift, {"order": "third"}, "order must be first or second, got 'third'"),
        (DriftSeries, {"time": (0.0,), "height": (0.0,)}, "at least 2, got 1 and 1"),
        (DriftSeries, {"time": (0.0, 1.0), "height": (0.0,)}, "got 2 and 1"),
        (DriftSeries, {"time": (0.0, np.nan), "height": (0.0, 0.0)}, "must be finite"),
        (
            DriftSeries,
            {"time": (0.0, 2.0, 1.0), "height": (0.0, 0.0, 0.0)},
            "time must ascend, got 1.0 s after 2.0 s at value 2",
        ),
        (
            DriftSeries,
            {"time": (0.0, 1.0), "height": (0.0, 0.0), "stretch": -1.0},
            "stretch must be at least 0",
        ),
    ],
)
def test_bad_parameters_are_refused(kind, values, message):
    with pytest.raises(ValueError, match=message):
        kind(**values)


def test_negative_passes_are_refused():
    with pytest.raises(ValueError, match="pass_number must be at least 0, got -1"):
        start_drift(GaussMarkovDrift(), seed=1, pass_number=-1, rate=1.0)
