import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.simulate.quality import (
    STATES,
    PositionAccuracy,
    PositionErrors,
    Quality,
    check_quality,
)

EXACT = 1e-12  # [m] round-off
RUNS = 400  # of three components: a variance has a relative sd of sqrt(2 / 1200) = 4 %
SPREAD = 4 * np.sqrt(2 / (3 * RUNS)) / 2  # [1] four of these, for a standard deviation


def state(begin, name):
    return Quality(begin=begin, state=name)


def errors(quality, seconds, *, seed=1, rate=1.0, accuracy=None):
    process = PositionErrors(tuple(quality), accuracy or PositionAccuracy(), seed, "", rate=rate)
    return process.next(np.arange(int(seconds * rate)) / rate)


def many(quality, seconds, **more):
    """Errors of many runs, shape (run, epoch, component), and the variance promised in each."""
    runs = [errors(quality, seconds, seed=seed, **more) for seed in range(RUNS)]
    return np.stack([run[0] for run in runs]), np.stack([run[1] for run in runs])


def test_a_base_station_adds_nothing():
    error, variance, code = errors([], 10)
    assert not error.any() and not variance.any() and not code.any()  # noqa: PT018 - one fact
    error, _, _ = errors([state(5.0, "base station")], 10)
    assert not error.any()


def test_states_hold_from_their_begin():
    quality = [state(t, name) for t, name in zip([2.0, 4.5, 6.0], STATES[1:], strict=True)]
    code = errors(quality, 8)[2]
    npt.assert_array_equal(code, [0, 0, 1, 1, 1, 2, 3, 3])


@pytest.mark.parametrize(
    ("name", "least", "greatest"), [("decimetre", 0.1, 0.1), ("standalone", 0.8, 1.2)]
)
def test_states_have_their_standard_deviations(name, least, greatest):
    error, variance = many([state(0.0, name)], 20)
    for epoch in (0, 19):  # from the first epoch on: the state had held before
        sd = np.sqrt(variance[:, epoch])
        assert least - EXACT <= sd.min()
        assert sd.max() <= greatest + EXACT
        npt.assert_allclose(
            np.sqrt(np.mean((error[:, epoch] / sd[:, None]) ** 2)), 1, rtol=0, atol=SPREAD
        )
    if name == "standalone":  # each run draws its own
        assert np.ptp(variance[:, 0]) > 0.5


def test_a_worse_state_comes_gradually_and_goes_gradually():
    accuracy = PositionAccuracy(standalone_sd=(1.0, 1.0))
    quality = [state(10.0, "standalone"), state(200.0, "base station")]
    error, variance = many(quality, 230, accuracy=accuracy)
    # Time constants of Accuracy: 60 s stand-alone, 5 s with a base station.
    t = np.arange(1, 191)
    npt.assert_allclose(variance[0, 10:200], 1 - np.exp(-2 * t / 60), rtol=0, atol=EXACT)
    t = np.arange(1, 31)
    npt.assert_allclose(
        variance[0, 200:], variance[0, 199] * np.exp(-2 * t / 5), rtol=0, atol=EXACT
    )
    for epoch in (11, 40, 120, 199, 204):
        rms = np.sqrt(np.mean(error[:, epoch] ** 2) / variance[0, epoch])
        npt.assert_allclose(rms, 1, rtol=0, atol=SPREAD)
    assert abs(np.diff(error, axis=1)).max() < 1.0  # no jump: 5 s / 1 s x 4 sd at most


def test_an_outage_grows_from_the_last_value_with_the_square_of_time():
    accuracy = PositionAccuracy(outage_walk=0.0, outage_acceleration=0.01)
    quality = [state(0.0, "decimetre"), state(50.0, "outage")]
    error, _, _ = errors(quality, 100, rate=10.0, accuracy=accuracy)
    t = np.arange(1, 501) / 10
    grown = error[500:] - error[499]
    npt.assert_allclose(
        grown / t[:, None] ** 2, np.tile(grown[-1] / 2500, (500, 1)), rtol=0, atol=1e-11
    )
    assert (abs(grown[-1]) > 0.5).any()


def test_an_outage_without_acceleration_is_a_random_walk():
    accuracy = PositionAccuracy(outage_walk=0.2, outage_acceleration=0.0)
    error, variance = many([state(0.0, "outage")], 25, rate=4.0, accuracy=accuracy)
    for epoch in (0, 24, 99):
        npt.assert_allclose(variance[0, epoch], 0.2**2 * (epoch + 1) / 4, rtol=0, atol=EXACT)
        rms = np.sqrt(np.mean(error[:, epoch] ** 2) / variance[0, epoch])
        npt.assert_allclose(rms, 1, rtol=0, atol=SPREAD)


def test_promised_variance_holds_through_all_states():
    quality = [
        state(5.0, "decimetre"),
        state(20.0, "outage"),
        state(80.0, "standalone"),
        state(120.0, "outage"),
        state(140.0, "base station"),
    ]
    error, variance = many(quality, 160, accuracy=PositionAccuracy(outage_acceleration=3e-3))
    for epoch in (5, 19, 20, 50, 79, 80, 119, 139, 141, 150):
        ratio = error[:, epoch] / np.sqrt(variance[:, epoch])[:, None]
        npt.assert_allclose(np.sqrt(np.mean(ratio**2)), 1, rtol=0, atol=SPREAD)


def test_states_are_the_same_at_any_rate():
    """Promised standard deviations do not depend on the rate of the epochs."""
    quality = [state(10.0, "standalone"), state(40.0, "outage"), state(100.0, "decimetre")]
    slow, fast = (errors(quality, 150, rate=rate)[1] for rate in (2.0, 200.0))
    # An epoch of 0.5 s against 5 ms: the change of a state lies up to one epoch off.
    npt.assert_allclose(np.sqrt(fast[99::100]), np.sqrt(slow), rtol=0, atol=0.02)


def test_blocks_do_not_matter():
    quality = (state(0.3, "standalone"), state(1.0, "outage"), state(1.5, "base station"))
    time = np.arange(500) / 200
    whole = PositionErrors(quality, PositionAccuracy(), 3, "x", rate=200.0).next(time)
    stream = PositionErrors(quality, PositionAccuracy(), 3, "x", rate=200.0)
    blocks = [stream.next(part) for part in np.split(time, [1, 1, 59, 60, 61, 200, 299])]
    for i in range(3):
        npt.assert_array_equal(np.concatenate([block[i] for block in blocks]), whole[i])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: state(0.0, "rtk"), "state must be one of base station, decimetre, .* got 'rtk'"),
        (lambda: state(np.nan, "outage"), "begin must be finite"),
        (lambda: PositionAccuracy(decimetre_sd=-0.1), "decimetre_sd must be at least 0, got -0.1"),
        (lambda: PositionAccuracy(standalone_time=0.0), "standalone_time must be greater than 0"),
        (lambda: PositionAccuracy(outage_walk=np.nan), "outage_walk must be at least 0"),
        (lambda: PositionAccuracy(standalone_sd=(1.2, 0.8)), "standalone_sd must be two ascending"),
        (
            lambda: check_quality((state(2.0, "outage"), state(2.0, "decimetre"))),
            r"order of time, got a begin of 2.0 s after 2.0 s at state 1",
        ),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
