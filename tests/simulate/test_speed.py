"""Speeds against numerical integration, and against what they promise."""

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from trueterrain.simulate.speed import Constant, Ramp, Standstill, StopAndGo

EXACT = {"rtol": 0, "atol": 1e-9}  # [m], [m/s] round-off over some hundred metres
ARRIVAL = {"rtol": 0, "atol": 1e-9}  # [m] what is left at the end of a pass

SPEEDS = {
    "constant": Constant(speed=5.37),
    "ramp in time": Ramp(begin=3.0, end=15.0, time=8.0, hold=1.5),
    "ramp over a distance": Ramp(begin=12.0, end=2.0, distance=70.0),
    "from rest": Ramp(begin=0.0, end=10.0, time=5.0, hold=2.0),
    "stop and go": StopAndGo(speed=8.0, drive=4.0, stand=3.0),
    "without full acceleration": StopAndGo(speed=0.5, drive=1.0, stand=0.0, jerk=1.0),
}
any_speed = pytest.mark.parametrize("speed", SPEEDS.values(), ids=SPEEDS)


@any_speed
def test_distance_is_the_integral_of_speed_and_speed_of_acceleration(speed):
    begins = speed._pieces.begin
    period = speed._pieces.period
    edges = np.concatenate([begins + n * period for n in range(4)] if period < 99 else [begins])
    for end in (0.7, 4.0, 11.0):
        inside = [e for e in edges if 0 < e < end]
        driven, _ = quad(lambda t: speed.at(t).speed[0], 0, end, points=inside, epsabs=1e-11)
        gained, _ = quad(lambda t: speed.at(t).acceleration[0], 0, end, points=inside, epsabs=1e-11)
        npt.assert_allclose(speed.at(end).distance[0], driven, **EXACT)
        npt.assert_allclose(speed.at(end).speed[0] - speed.at(0.0).speed[0], gained, **EXACT)


@any_speed
def test_speed_and_acceleration_are_continuous(speed):
    time = np.arange(-1.0, 40.0, 1e-4)
    progress = speed.at(time)
    assert np.abs(np.diff(progress.acceleration)).max() < 1e-3  # [m/s^2] 10 m/s^3 at most
    assert np.abs(np.diff(progress.speed)).max() < 1e-3  # [m/s] 5 m/s^2 at most
    assert np.diff(progress.distance).min() > -1e-12
    assert progress.speed.min() > -1e-12


@any_speed
@pytest.mark.parametrize("length", [0.3, 20.0, 137.0])
def test_the_duration_of_a_pass_is_where_its_length_is_reached(speed, length):
    end = speed.duration(length)
    npt.assert_allclose(speed.at(end).distance[0], length, **ARRIVAL)
    assert speed.at(end - 1e-3).distance[0] < length


def test_constant_speed_holds_before_the_start():
    npt.assert_allclose(Constant(speed=4.0).at([-2.0, 3.0]).distance, [-8.0, 12.0], **EXACT)
    npt.assert_allclose(SPEEDS["ramp in time"].at(-2.0).distance, [-6.0], **EXACT)
    npt.assert_allclose(SPEEDS["stop and go"].at(-2.0).distance, [0.0], **EXACT)


def test_a_ramp_takes_its_distance():
    ramp = Ramp(begin=12.0, end=2.0, distance=70.0)
    end = ramp.duration(70.0)
    npt.assert_allclose(end, 10.0, **EXACT)
    npt.assert_allclose([p[0] for p in ramp.at(end)], [70.0, 2.0, 0.0], **EXACT)
    steepest = np.abs(ramp.at(np.linspace(0, end, 1001)).acceleration).max()
    npt.assert_allclose(steepest, 1.5 * 10.0 / 10.0, **EXACT)


@given(st.floats(0.1, 30.0), st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.floats(0.2, 20.0))
def test_stop_and_go_keeps_its_limits(top, acceleration, deceleration, jerk):
    speed = StopAndGo(
        speed=top,
        drive=2.0,
        stand=1.0,
        acceleration=acceleration,
        deceleration=deceleration,
        jerk=jerk,
    )
    period = speed._pieces.period
    progress = speed.at(np.linspace(0.0, 3 * period, 20001))
    assert progress.speed.max() <= top * (1 + 1e-12)
    assert progress.acceleration.max() <= acceleration * (1 + 1e-12)
    assert progress.acceleration.min() >= -deceleration * (1 + 1e-12)
    npt.assert_allclose(speed.at([0.5, period + 0.5]).speed, 0.0, **EXACT)
    npt.assert_allclose(progress.speed.max(), top, rtol=0, atol=1e-2 * top)


def test_stop_and_go_arrives_when_it_stops_for_the_first_time_there():
    speed = SPEEDS["stop and go"]
    leg = speed._per_period
    for stops in (1, 3):
        end = speed.duration(stops * leg)
        npt.assert_allclose(end, stops * speed._pieces.period, rtol=0, atol=1e-3)
        npt.assert_allclose(speed.at(end).distance, stops * leg, **ARRIVAL)


def test_a_trapezoid_is_the_trapezoid():
    speed = StopAndGo(speed=6.0, drive=3.0, stand=2.0, acceleration=1.5, deceleration=3.0, jerk=6.0)
    # ramps of 4 s and 2 s, each longer by the time of its eases, 0.25 s and 0.5 s
    npt.assert_allclose(speed._pieces.period, 2 + 4.25 + 3 + 2.5, **EXACT)
    npt.assert_allclose(speed._per_period, 6 * (4.25 / 2 + 3 + 2.5 / 2), **EXACT)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Constant(speed=0.0), "never arrives .* got 0.0"),
        (lambda: Constant(speed=-3.0), "speed must be greater than 0 m/s"),
        (lambda: Standstill().duration(10.0), "never arrives, it comes to rest after 0 m of 10 m"),
        (lambda: Ramp(begin=10, end=0, distance=30).duration(31), "rest after 30 m of 31 m"),
        (lambda: Ramp(begin=0, end=0, time=1), "never arrives"),
        (lambda: Ramp(begin=1, end=2), "one of time and distance must be given"),
        (lambda: Ramp(begin=1, end=2, time=1, distance=1), "one of time and distance"),
        (lambda: Ramp(begin=1, end=2, time=0), "time must be greater than 0"),
        (lambda: Ramp(begin=-1, end=2, time=1), "begin must be finite and at least 0"),
        (lambda: StopAndGo(speed=0, drive=1, stand=1), "speed must be greater than 0"),
        (lambda: StopAndGo(speed=1, drive=1, stand=-1), "stand must be at least 0 s"),
        (lambda: Constant(speed=1.0).duration(0.0), "length must be greater than 0 m"),
        (lambda: Constant(speed=1.0).duration(np.nan), "length must be greater than 0 m"),
    ],
)
def test_impossible_speeds_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_braking_to_a_stand_arrives_just_in_time():
    brake = Ramp(begin=10.0, end=0.0, distance=30.0)
    npt.assert_allclose(brake.duration(30.0), 6.0, rtol=0, atol=1e-4)
    npt.assert_allclose(brake.at(100.0).distance, 30.0, **EXACT)
    assert brake.to_dict() == {
        "kind": "Ramp",
        "begin": 10.0,
        "end": 0.0,
        "time": None,
        "distance": 30.0,
        "hold": 0.0,
    }
