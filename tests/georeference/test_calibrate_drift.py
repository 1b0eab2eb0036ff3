"""Calibration on passes whose motion drifts: standard deviations are those of errors."""

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from trueterrain.formats.run import Mounting, open_run
from trueterrain.georeference._differences import rotations_as_parameters
from trueterrain.georeference._motion_errors import MotionErrorModel
from trueterrain.georeference.calibrate import CalibrationSettings, calibrate_mounting
from trueterrain.motion import Trajectory
from trueterrain.simulate.noise import GaussMarkov, named_generator
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene
from trueterrain.simulate.scene._parts import ScenePass

pytestmark = pytest.mark.slow

# of a navigation that drifts a twentieth as much as the class of `Navigation`, as fast
SD = np.array([1e-3, 1e-3, 9e-4, 1.2e-5, 1.2e-5, 2.1e-5])  # [m], [rad]
TIME = np.array([25.0, 25.0, 25.0, 60.0, 60.0, 60.0])  # [s]
REPEATS = 24
RARE = 1e-3  # probability that a right standard deviation is beyond either limit
ASKED = ("roll", "pitch", "lever_y", "clock")
EVERY = CalibrationSettings(parameters=ASKED, max_angle_sd=0.5, max_lever_sd=0.5, max_clock_sd=0.5)
ROUND_OFF = 1e-9  # [1] relative, of inverses


def drive(name, start, *, reverse=False, speed=5.0):
    return ScenePass(
        name=name,
        reverse=reverse,
        start=start,
        length=7.0,
        speed={"kind": "constant", "speed": speed},
    )


@pytest.fixture(scope="module")
def passes(record):
    """Two opposite passes at two speeds without noise, their motion, and the true mounting."""
    scene, _ = read_scene("boresight")
    scanner = Scanner(
        beams=80,
        rate=1000.0,
        range_noise=0.0,
        intensity_noise=0.0,
        floor=0.0,
        saturation_bias=0.0,
        dropouts=0.0,
        spot_rays=1,
    )
    scene = replace(
        scene, scanner=scanner, truth=TruthSettings(returns=False, spacing=0.1), raster=0.01
    )
    drives = drive("there", 11.0), drive("back", 14.0, reverse=True, speed=7.0)
    found = [record(replace(scene, passes=(one,))) for one in drives]
    return (
        [open_run(run).load() for run, _ in found],
        [trajectory for _, trajectory in found],
        scene.mounting,
    )


def drifting(trajectory: Trajectory, seed: int, name: str) -> Trajectory:
    """A motion with the error of a first-order Gauss-Markov process, and its covariance."""
    rate = 1.0 / float(np.median(np.diff(trajectory.time)))
    errors = np.concatenate(
        [
            GaussMarkov(
                rng=named_generator(seed, name, f"{time:g} s"),
                sd=SD[time == TIME],
                correlation_time=time,
                rate=rate,
            ).next(trajectory.time.size)
            for time in (25.0, 60.0)
        ],
        axis=1,
    )
    turned = Rotation.from_quat(trajectory.quaternion) * Rotation.from_rotvec(errors[:, 3:])
    return replace(
        trajectory,
        position=trajectory.position + errors[:, :3],
        quaternion=turned.as_quat(),
        covariance=np.broadcast_to(np.diag(SD**2), (trajectory.time.size, 6, 6)),
    )


def values(mounting: Mounting):
    return np.array(
        [*mounting.scanner_rotation[:2], mounting.scanner_position[1], mounting.scanner_clock]
    )


def test_standard_deviations_hold_where_the_motion_drifts_within_a_pass(passes):
    """Squared errors over variances of some repeats follow a chi-square distribution."""
    runs, trajectories, true = passes
    ratios = []
    for seed in range(REPEATS):
        moved = [
            drifting(trajectory, seed, f"pass {p}") for p, trajectory in enumerate(trajectories)
        ]
        found = calibrate_mounting(runs, moved, mounting=true, settings=EVERY)
        ratios.append((found.value - values(true)) / found.sd)
    rms = np.sqrt(np.mean(np.square(ratios), axis=0))
    low, high = np.sqrt(chi2.ppf([RARE, 1 - RARE], REPEATS) / REPEATS)
    assert (rms > low).all(), (rms, low)
    assert (rms < high).all(), (rms, high)


def test_drift_of_the_motion_increases_standard_deviations(passes):
    runs, trajectories, true = passes
    moved = [drifting(trajectory, 1, f"pass {p}") for p, trajectory in enumerate(trajectories)]
    exact, found = (
        calibrate_mounting(runs, them, mounting=true, settings=EVERY)
        for them in (trajectories, moved)
    )
    assert (found.sd > exact.sd).all()


@pytest.fixture
def errors():
    """Errors of two passes; of the second only heights and rolls are uncertain."""
    sd = np.array([[0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3], [0, 0, 0.03, 1e-3, 0, 0]])
    times = [np.array([1.0, np.nan, 3.0]), np.array([5.0, 5.4])]
    return MotionErrorModel.over(times, sd, TIME, 0.5)


def test_knots_cover_what_is_seen(errors):
    npt.assert_allclose(errors.knots[0], [1.0, 1.5, 2.0, 2.5, 3.0], rtol=0, atol=1e-12)
    npt.assert_allclose(errors.knots[1], [5.0, 5.4], rtol=0, atol=1e-12)
    assert errors.size == 6 * 5 + 2 * 2
    assert errors.horizontal.sum() == 2 * 5
    long = MotionErrorModel.over([np.array([0.0, 1000.0])] * 2, errors.sd, TIME, 0.5)
    assert [knots.size for knots in long.knots] == [25, 25]


def test_the_precision_is_that_of_a_gauss_markov_process(errors):
    knots = errors.knots[0]
    north = slice(knots.size, 2 * knots.size)
    truth = 0.02**2 * np.exp(-np.abs(knots[:, None] - knots) / 25.0)
    found = np.linalg.inv(errors.precision[north, north])
    npt.assert_allclose(found, truth, rtol=ROUND_OFF, atol=0)


def test_the_height_counts_from_the_middle_of_the_pass(errors):
    knots = errors.knots[0]
    up = slice(2 * knots.size, 3 * knots.size)
    found = np.sqrt(np.diag(np.linalg.inv(errors.precision[up, up])))
    assert found[2] < 1e-5  # [m]
    # conditioned on the middle: 1 - exp(-2 lag / time) of the variance
    lag = np.abs(knots - 2.0)
    npt.assert_allclose(found, 0.03 * np.sqrt(-np.expm1(-2 * lag / 25.0)), rtol=1e-4, atol=1e-5)


def test_covariances_of_sums_are_those_of_the_process(errors):
    """Sums of errors at some times, against the covariance of the process between these."""
    rng = np.random.default_rng(4)
    time = np.stack([np.sort(rng.uniform(1.0, 3.0, 40)), np.full(40, 5.2)])
    leverage = rng.normal(size=(2, 40, 3))
    leverage[1] = 0.0
    effect = np.zeros((2, 40, 6))
    effect[0, :, 3] = 1.0
    found = errors.covariance(leverage, effect, time)
    process = 1e-6 * np.exp(-np.abs(time[0][:, None] - time[0]) / 60.0)
    truth = leverage[0].T @ process @ leverage[0]
    # times are taken in steps of 5 ms
    npt.assert_allclose(found, truth, rtol=0, atol=0.02 * np.diag(truth).max())


def test_the_correlation_time_of_slow_heights_is_found():
    """From 5,000 steps of a random walk."""
    rng = np.random.default_rng(5)
    sd = np.zeros((200, 6))
    sd[:, 2] = 0.02
    errors = MotionErrorModel.over([np.array([0.0, 6.0])] * 200, sd, TIME, 0.25)
    assert errors.size == 200 * 25
    true = 400.0  # [s]
    steps = 0.02 * np.sqrt(2 * 0.25 / true) * rng.normal(size=(200, 24))
    walks = np.concatenate([np.zeros((200, 1)), np.cumsum(steps, axis=1)], axis=1)
    found = errors.with_estimated_drift_time(walks.ravel(), np.zeros((errors.size, errors.size)))
    npt.assert_allclose(found.correlation_time[2], true, rtol=0.08, atol=0)  # 4 / sqrt(4800 / 2)
    npt.assert_array_equal(found.correlation_time[[0, 1, 3, 4, 5]], TIME[[0, 1, 3, 4, 5]])


def test_rotations_of_the_body_move_the_scanner():
    """Against points of a beam that is turned with the body."""
    mounting = Mounting(scanner_position=(-2.1, 0.12, 1.15), scanner_rotation=(0.03, -0.04, 0.06))
    beam, small = np.array([0.0, 0.4, -2.0]), 1e-6  # [m], [rad]

    def point(by):
        angles = np.array(mounting.scanner_rotation) + by[:3]
        turned = Rotation.from_euler("ZYX", angles[::-1]).apply(beam)
        return turned + mounting.scanner_position + by[3:6]

    for axis, by in enumerate(rotations_as_parameters(mounting)):
        turn = Rotation.from_rotvec(small * np.eye(3)[axis])
        truth = (turn.apply(point(np.zeros(7))) - point(np.zeros(7))) / small
        found = (point(small * by) - point(np.zeros(7))) / small
        npt.assert_allclose(found, truth, rtol=0, atol=2e-5)  # [m/rad]
