"""Fused motion of simulated instruments against the exact motion."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.motion.trajectory import BRIDGED, EDGE
from trueterrain.simulate.accelerometers import Accelerometers, sensor_triangle
from trueterrain.simulate.drift import GaussMarkovDrift
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scene import read_scene

from ._truth import LASER, Errors, less_line, rms
from .conftest import knots_of, run_of

METHODS = ["navigation", "thesis", "zero-phase", "wiener", "rts"]

PLATE = 13.54  # [m] easting of the plate of the scene
EVENT = 4.88  # [m] length of an excitation event (thesis 3.4)

ZERO_PHASE = 1.2e-3  # [m] required
RTS = 0.3e-3  # [m] required
MIN_THESIS = 2.5e-3  # [m] order 4 in the reference study: 3.0 to 3.1 mm
HONEST = (0.9, 1.1)  # rms of error over standard deviation
NO_NOISE = 1e-4  # [m] with perfect instruments

PERFECT = Navigation(
    drift=GaussMarkovDrift(height_sd=0.0, between_passes=0.0),
    horizontal_sd=0.0,
    attitude_sd=(0.0,) * 3,
    noise=(0.0,) * 6,
)
FLAWLESS = Accelerometers(
    positions=sensor_triangle(tuple(LASER), 0.5),
    noise_density=0.0,
    bias_sd=0.0,
    bias_walk=0.0,
    scale_sd=0.0,
    tilt_sd=0.0,
    filter_order=0,
)


def event_error(run, motion):
    """Error of the laser's height over the event around the plate, less its regression line [m].

    A straight line over 0.9 s is the drift of navigation (17.7 mm, 25 s, like a random walk of 5 mm
    in 1 s), which accelerometers do not observe; the covariance includes it.
    """
    errors = Errors(run, motion.trajectory)
    inside = np.abs(errors.true_point[:, 0] - PLATE) < EVENT / 2
    return rms(less_line(errors.time[inside], errors.up[inside]))


@pytest.fixture(scope="module")
def run(excited):
    scene, knots = excited
    return run_of(knots, scene)


@pytest.fixture(scope="module")
def motions(run):
    """All methods with default settings: the delay of the filter is not stated."""
    return {name: fuse_motion(run, settings=FusionSettings(method=name)) for name in METHODS}


def test_the_method_of_the_thesis_distorts_the_wheel_hop(run, motions):
    assert event_error(run, motions["thesis"]) > MIN_THESIS


def test_zero_phase_over_the_event(run, motions):
    assert event_error(run, motions["zero-phase"]) < ZERO_PHASE
    assert event_error(run, motions["zero-phase"]) < event_error(run, motions["navigation"])


def test_rts_over_the_event(run, motions):
    assert event_error(run, motions["rts"]) < RTS
    assert event_error(run, motions["wiener"]) < RTS


@pytest.mark.parametrize("seed", [2, 3, 4, 5])
def test_rts_over_the_event_with_other_noise(excited, seed):
    scene, knots = excited
    run = run_of(knots, scene, seed=seed)
    assert event_error(run, fuse_motion(run)) < RTS


def test_rts_over_the_whole_drive_less_a_parabola(run, motions):
    """Three events, 4 s: drift and bias leave a parabola."""
    errors = Errors(run, motions["rts"].trajectory)
    since = errors.time - errors.time.mean()
    rest = errors.up - np.polyval(np.polyfit(since, errors.up, 2), since)
    assert rms(rest) < RTS


def test_the_delay_of_the_filter_is_estimated(run, motions, excited):
    scene, _ = excited
    found, sd = motions["rts"].delay
    assert sd < 0.15e-3  # [s] far less than its prior of 1 ms
    assert abs(found - scene.accelerometers.group_delay) < 3 * sd


def test_noise_is_estimated_and_reported(motions, excited):
    scene, _ = excited
    noise = motions["rts"].noise
    navigation, sensors = scene.navigation, scene.accelerometers
    ratio = np.array(noise.white) / navigation.noise[2:5]
    assert_allclose(ratio, 1.0, rtol=0, atol=0.1)  # 850 epochs, half of the band: sd 0.04
    ratio = np.array(noise.accelerometer) / sensors.noise_density
    assert_allclose(ratio, 1.0, rtol=0, atol=0.1)  # 100 Hz, 4 s: sd 0.03
    assert "white" in noise.estimated
    assert "accelerometer" in noise.estimated
    assert_allclose(
        motions["rts"].normalised_innovation_squared, 1.0, rtol=0, atol=0.2
    )  # 850 epochs: sd 0.05, drift
    json.dumps(motions["rts"].to_dict())
    json.dumps(motions["navigation"].to_dict())


def test_stated_noise_is_used(run):
    settings = FusionSettings(
        navigation_noise=(0.002, 1e-4, 1e-4),
        drift_time=(30.0, 40.0, 50.0),
        accelerometer_noise=1e-3,
    )
    noise = fuse_motion(run, settings=settings).noise
    assert noise.white == (0.002, 1e-4, 1e-4)
    assert noise.drift_time == (30.0, 40.0, 50.0)
    assert noise.accelerometer == (1e-3,) * 3
    assert noise.estimated == ()


@pytest.mark.slow
def test_standard_deviations_agree_with_errors(excited):
    """Drift of 0.3 s correlation time: 14 independent values in each of twelve drives.

    A fixed window keeps all of the horizontal drift. Adaptive smoothing removes most of it, which
    its standard deviations do not include: see test_adaptive.
    """
    scene, knots = excited
    quick = 0.3
    drift = GaussMarkovDrift(correlation_time=quick, between_passes=0.0)
    navigation = replace(scene.navigation, drift=drift, attitude_time=quick, horizontal_time=quick)
    scene = replace(scene, navigation=navigation)
    squares = []
    for seed in range(12):
        run = run_of(knots, scene, seed=seed)
        errors = Errors(
            run, fuse_motion(run, settings=FusionSettings(smoothing_window=0.2)).trajectory
        )
        each = np.hstack([errors.origin, errors.rotation]) / errors.sd
        ratio = np.column_stack([errors.up / errors.up_sd, each])
        squares.append(np.mean(ratio**2, axis=0))
    laser, *each = np.sqrt(np.mean(squares, axis=0))
    assert HONEST[0] < laser < HONEST[1]
    assert HONEST[0] < rms(each) < HONEST[1]
    assert_allclose(each, 1.0, rtol=0, atol=0.2)  # 170 independent values: sd 0.06


@pytest.mark.slow
def test_standard_deviations_include_the_drift(excited):
    """Drift is nearly constant over a drive, so errors are compared over several drives."""
    scene, knots = excited
    ratios = []
    for seed in range(12):
        run = run_of(knots, scene, seed=seed, number=seed % 2)
        errors = Errors(
            run, fuse_motion(run, settings=FusionSettings(method="zero-phase")).trajectory
        )
        ratios.append(np.mean((errors.up / errors.up_sd) ** 2))
    assert 0.6 < np.sqrt(np.mean(ratios)) < 1.5  # 12 independent values: sd 0.2


@pytest.mark.slow
@pytest.mark.parametrize("method", ["navigation", "zero-phase", "wiener", "rts"])
@pytest.mark.parametrize("name", ["dynamic-plate-excited", "oval", "bounce"])
def test_perfect_instruments_give_the_exact_motion(name, method):
    """On straight, curved and banked courses."""
    run = perfect_run(name)
    settings = FusionSettings(method=method, gravity=9.80665)
    motion = fuse_motion(run, settings=settings)
    for point in (LASER, np.array([0.0, 2.0, -1.0])):
        errors = Errors(run, motion.trajectory, point)
        assert_allclose(errors.point, 0.0, rtol=0, atol=NO_NOISE)


_RUNS = {}


def perfect_run(name):
    if name not in _RUNS:
        scene, path = read_scene(name)
        if name == "oval":
            scene = replace(scene, passes=(replace(scene.passes[0], length=50.0),))
        scene = replace(scene, navigation=PERFECT, accelerometers=FLAWLESS, declared=None)
        _RUNS[name] = run_of(knots_of(scene, path), scene)
    return _RUNS[name]


def test_perfect_accelerometers_elsewhere_in_the_body():
    """Sensors at other heights and distances: lever arms and centripetal terms."""
    scene, path = read_scene("bounce")
    places = ((1.0, 0.7, 0.2), (0.6, -0.8, 1.5), (-1.2, 0.1, 0.9), (0.3, 0.4, -0.5))
    scene = replace(
        scene,
        navigation=PERFECT,
        declared=None,
        accelerometers=replace(FLAWLESS, positions=places),
    )
    run = run_of(knots_of(scene, path), scene)
    errors = Errors(run, fuse_motion(run, settings=FusionSettings(gravity=9.80665)).trajectory)
    assert_allclose(errors.point, 0.0, rtol=0, atol=NO_NOISE)


@pytest.mark.parametrize("sensors", [[0], [1, 2]])
def test_one_or_two_accelerometers_determine_the_height(run, sensors):
    few = run.copy()
    few["accelerometers"] = run["accelerometers"].to_dataset().isel(sensor=sensors)
    motion = fuse_motion(few)
    assert event_error(few, motion) < RTS
    assert any("do not determine roll and pitch" in problem for problem in motion.problems)


def test_knots_and_flags(motions, run):
    trajectory = motions["rts"].trajectory
    assert_allclose(np.median(np.diff(trajectory.time)), 1e-3, rtol=0, atol=1e-9)
    navigation = run["navigation"]["time"].values
    assert trajectory.time[0] == navigation[0]
    assert trajectory.time[-1] == navigation[-1]
    interior = (trajectory.time > 0.5) & (trajectory.time < 3.5)
    assert not trajectory.flag[interior].any()
    assert (trajectory.flag[[0, -1]] == EDGE).all()
    assert motions["rts"].drift.shape == (trajectory.time.size, 3)


def test_velocity_is_the_derivative_of_the_position(motions):
    """Knots store both; the cubic through them must not oscillate."""
    for name in METHODS:
        trajectory = motions[name].trajectory
        between = 0.5 * (trajectory.time[:-1] + trajectory.time[1:])
        poses = trajectory.at(between)
        step = np.diff(trajectory.time)[:, None]
        chord = np.diff(trajectory.position, axis=0) / step
        assert_allclose(poses.velocity, chord, rtol=0, atol=0.15)  # [m/s] half a step of 300 m/s2


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"method": "kalman"}, "method must be one of navigation, thesis"),
        ({"rate": 0.0}, "rate must be greater than 0"),
        ({"crossover": 600.0}, "crossover below half of rate"),
        ({"order": 0}, "order must be at least 1"),
        ({"drift_time": (1.0, 0.0, 1.0)}, "drift_time must be greater than 0"),
    ],
)
def test_invalid_settings(values, words):
    with pytest.raises(ValueError, match=words):
        FusionSettings(**values)


def test_bridged_and_edge_differ():
    assert BRIDGED & EDGE == 0
