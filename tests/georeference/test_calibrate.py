"""Calibration on passes over the steps of the scene `boresight`, whose true mounting is known."""

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import Mounting, open_run
from trueterrain.georeference.calibrate import CalibrationSettings, calibrate_mounting
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import TruthSettings, read_scene
from trueterrain.simulate.scene._parts import ScenePass

pytestmark = pytest.mark.slow

COARSE = Scanner(
    beams=200,
    rate=1000.0,
    range_noise=0.0,
    intensity_noise=0.0,
    floor=0.0,
    saturation_bias=0.0,
    dropouts=0.0,
    spot_rays=1,
)
FIVE = ("roll", "pitch", "yaw", "lever_y", "clock")
NAMES = ("roll", "pitch", "yaw", "lever_x", "lever_y", "lever_z", "clock")

# Without noise what is left is where between two scans, 5 to 9 mm apart, a step lies, averaged over
# the 100 columns of beams along it: some tenths of a millimetre, 2 m below the laser and at most
# 1 m beside it. The heave tells the clock on all of the ground, which tells the roll as well.
CLOSE = {
    "roll": 5e-6,
    "pitch": 2e-4,
    "yaw": 3e-4,
    "lever_x": np.nan,
    "lever_y": 3e-4,
    "lever_z": np.nan,
    "clock": 1e-5,
}
EXPLAINED = 0.1  # of an error that a wrong parameter causes: the problem is not quite linear
HONEST = 0.4  # [1] of the root mean square of errors over their standard deviations
LASTING = 1e5  # [s] of errors that do not change within a pass
NOISE = 0.5e-3  # [m] of a range, as the scanner of the thesis has it


def values(mounting):
    """Values in the order of NAMES."""
    return np.array(
        [*mounting.scanner_rotation, *mounting.scanner_position, mounting.scanner_clock]
    )


def drive(name, *, reverse=False, lane=0.0, speed=5.0):
    """A pass whose laser, 2.25 m behind the body, sees stations 8.75 to 16.75 m."""
    return ScenePass(
        name=name,
        reverse=reverse,
        lane=lane,
        start=14.5 if reverse else 11.0,
        length=8.0,
        speed={"kind": "constant", "speed": speed},
    )


@pytest.fixture(scope="module")
def passes(record):
    """Four passes, in both directions and in adjacent lanes at other speeds; the true mounting."""
    scene, _ = read_scene("boresight")
    drives = (
        drive("there"),
        drive("back", reverse=True),
        drive("left", lane=1.0, speed=9.0),
        drive("right", reverse=True, lane=-1.0, speed=7.0),
    )
    scene = replace(
        scene, scanner=COARSE, truth=TruthSettings(returns=False, spacing=0.1), raster=0.01
    )
    found = [record(replace(scene, passes=(one,))) for one in drives]
    return (
        [open_run(run).load() for run, _ in found],
        [trajectory for _, trajectory in found],
        scene.mounting,
    )


def by_tape(true):
    """What is known before: the arm ahead and up from a tape, the rest nominal."""
    x, _, z = true.scanner_position
    return Mounting(scanner_position=(x, 0.0, z))


def thinned(run, first, rng, noise=NOISE):
    """Every second scan, with noise."""
    tree = run.copy()
    scans = tree["scans"].to_dataset().isel(scan=slice(first, None, 2))
    ranges = scans["range"] + noise * rng.normal(size=scans["range"].shape)
    tree["scans"] = xr.DataTree(scans.assign(range=ranges))
    return tree


def test_finds_the_true_mounting_from_passes_without_noise(passes):
    runs, trajectories, true = passes
    found = calibrate_mounting(
        runs, trajectories, mounting=by_tape(true), settings=CalibrationSettings(parameters=FIVE)
    )
    error = dict(zip(found.parameters, found.value - values(true)[[0, 1, 2, 4, 6]], strict=True))
    for name in FIVE:
        npt.assert_allclose(error[name], 0.0, rtol=0, atol=CLOSE[name], err_msg=name)
    assert found.mounting.scanner_position[::2] == true.scanner_position[::2]
    assert found.residual_after < 0.1 * found.residual_before
    assert found.correspondences > 10_000
    assert found.held == ("lever_x", "lever_z")
    assert found.not_observable == ()
    assert 1 < found.condition < 100
    npt.assert_allclose(np.diag(found.correlation), 1.0, rtol=0, atol=1e-12)
    summary = found.to_dict()
    assert set(summary["value"]) == set(FIVE)
    assert Mounting.from_attrs(summary["mounting"]) == found.mounting


def test_parameters_that_opposite_passes_do_not_determine_are_refused(passes):
    runs, trajectories, _ = passes
    words = (
        r"do not determine .*lever_x .*correlated with pitch.*lever_z .*Measure lever_x with a tape"
    )
    with pytest.raises(CoverageError, match=words):
        calibrate_mounting(runs[:2], trajectories[:2])


def test_unobservable_parameters_are_held_and_their_sensitivity_is_reported(passes):
    """A held parameter that is wrong makes others wrong, by as much as `sensitivity` says."""
    runs, trajectories, true = passes
    start = Mounting.from_attrs(runs[0].attrs["mounting"])
    found = calibrate_mounting(
        runs, trajectories, settings=CalibrationSettings(unobservable="hold")
    )
    assert found.not_observable == ("lever_x", "lever_z")
    assert found.parameters == FIVE
    held = [NAMES.index(name) for name in found.held]
    caused = found.sensitivity @ (values(start) - values(true))[held]
    pitch = found.parameters.index("pitch")
    assert abs(caused[pitch]) > 4e-3  # [rad]: 10 mm over 2 m
    error = found.value - values(true)[[NAMES.index(name) for name in found.parameters]]
    left = np.abs(error - caused) - EXPLAINED * np.abs(caused)
    assert (left < [CLOSE[name] for name in found.parameters]).all()


def test_a_height_error_of_one_pass_becomes_its_offset(passes):
    runs, trajectories, true = passes
    raised = replace(
        trajectories[1], position=trajectories[1].position + np.array([0.0, 0.0, 0.02])
    )
    found = calibrate_mounting(
        runs,
        [trajectories[0], raised, *trajectories[2:]],
        mounting=by_tape(true),
        settings=CalibrationSettings(parameters=FIVE),
    )
    npt.assert_allclose(found.offset, [0.0, 0.02, 0.0, 0.0], rtol=0, atol=2e-5)  # [m]
    error = found.value - values(true)[[0, 1, 2, 4, 6]]
    assert (np.abs(error) < [CLOSE[name] for name in FIVE]).all()


def test_horizontal_errors_of_navigation_are_separated_from_the_mounting(passes):
    """Centimetres, as satellites err: over these the ground around a step is no plane."""
    runs, trajectories, true = passes
    sd = 0.03  # [m]
    rng = np.random.default_rng(3)
    reported = np.diag([sd**2, sd**2, 0, 0, 0, 0])
    moved = [
        replace(
            trajectory,
            position=trajectory.position + sd * np.append(rng.normal(size=2), 0.0),
            covariance=np.broadcast_to(reported, (trajectory.time.size, 6, 6)),
        )
        for trajectory in trajectories
    ]
    found = calibrate_mounting(
        runs, moved, mounting=by_tape(true), settings=CalibrationSettings(parameters=FIVE)
    )
    error = found.value - values(true)[[0, 1, 2, 4, 6]]
    assert (np.abs(error) < [CLOSE[name] for name in FIVE]).all()
    assert found.residual_after < 0.1 * found.residual_before


def test_standard_deviations_are_those_of_errors(passes):
    """Over noise and over where scans fall.

    Where the beams fall across the road is the same in all of them. So the 20 ratios are worth 20
    if noise prevails and 5 if that does: 1/sqrt(2 n) is 0.16 to 0.32 of their root mean square.
    """
    runs, trajectories, true = passes
    rng = np.random.default_rng(7)
    ratios = []
    for _ in range(4):
        noisy = [thinned(run, int(rng.integers(2)), rng) for run in runs]
        found = calibrate_mounting(
            noisy,
            trajectories,
            mounting=by_tape(true),
            settings=CalibrationSettings(parameters=FIVE),
        )
        ratios.append((found.value - values(true)[[0, 1, 2, 4, 6]]) / found.sd)
    npt.assert_allclose(np.sqrt(np.mean(np.square(ratios))), 1.0, rtol=0, atol=HONEST)


def test_flat_ground_determines_the_roll_alone(record):
    scene, _ = read_scene("boresight")
    flat = replace(
        scene,
        ground=({"kind": "plane"},),
        scanner=COARSE,
        raster=0.05,
        truth=TruthSettings(returns=False, spacing=0.1),
    )
    found = [
        record(replace(flat, passes=(one,)))
        for one in (drive("there"), drive("back", reverse=True))
    ]
    runs, trajectories = (
        [open_run(run).load() for run, _ in found],
        [trajectory for _, trajectory in found],
    )
    for name in ("pitch", "yaw", "lever_x", "lever_y", "lever_z", "clock"):
        with pytest.raises(CoverageError, match=f"do not determine {name}"):
            calibrate_mounting(
                runs,
                trajectories,
                settings=CalibrationSettings(parameters=("roll", name), max_iterations=3),
            )
    only = calibrate_mounting(
        runs, trajectories, settings=CalibrationSettings(parameters=("roll",))
    )
    npt.assert_allclose(only.value, 0.004, rtol=0, atol=CLOSE["roll"])


def test_passes_over_other_ground_are_refused(passes):
    runs, trajectories, _ = passes
    away = replace(trajectories[1], position=trajectories[1].position + np.array([100.0, 0.0, 0.0]))
    with pytest.raises(CoverageError, match="have no common ground"):
        calibrate_mounting(runs[:2], [trajectories[0], away])


def test_ground_that_needs_too_many_cells_is_refused(passes):
    runs, trajectories, _ = passes
    settings = CalibrationSettings(area=(0.0, 0.0, 10_000.0, 10.0))
    with pytest.raises(CoverageError, match="Name an area"):
        calibrate_mounting(runs[:2], trajectories[:2], settings=settings)


def test_ground_in_too_few_squares_for_standard_deviations_is_refused(passes):
    runs, trajectories, _ = passes
    settings = CalibrationSettings(parameters=("roll",), cluster=8.0)
    with pytest.raises(CoverageError, match=r"in \d squares .* smaller squares: cluster"):
        calibrate_mounting(runs[:2], trajectories[:2], settings=settings)


def test_passes_without_returns_are_refused(passes):
    runs, trajectories, _ = passes
    blind = runs[1].copy()
    scans = blind["scans"].to_dataset()
    blind["scans"] = xr.DataTree(scans.assign(range=scans["range"] * np.nan))
    with pytest.raises(CoverageError, match="1 of 2 passes have returns"):
        calibrate_mounting([runs[0], blind], trajectories[:2])


def test_invalid_arguments_are_refused(passes):
    runs, trajectories, _ = passes
    with pytest.raises(ValueError, match="at least 2, with a trajectory each, got 1 and 1"):
        calibrate_mounting(runs[:1], trajectories[:1])
    other = runs[1].copy()
    other.attrs = {**other.attrs, "mounting": Mounting(scanner_clock=0.1).to_attrs()}
    with pytest.raises(ValueError, match="one mounting"):
        calibrate_mounting([runs[0], other], trajectories[:2])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"parameters": ("rol",)}, "parameters must be some of"),
        ({"parameters": ()}, "parameters must be some of"),
        ({"parameters": ("roll", "roll")}, "parameters must be some of"),
        ({"unobservable": "guess"}, "refuse or hold"),
        ({"spacing": 0.0}, "spacing must be greater than 0"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"drift_time": (25.0, 0.0)}, "drift_time must be two times greater than 0"),
        ({"drift_step": 0.0}, "drift_step must be greater than 0"),
        ({"area": (1.0, 0.0, 0.0, 1.0)}, "area must be"),
    ],
)
def test_invalid_settings_are_refused(settings, words):
    with pytest.raises(ValueError, match=words):
        CalibrationSettings(**settings)


def test_standard_deviations_include_reported_errors_of_the_motion(passes):
    """Passes rolled and displaced as a whole, by errors drawn from the reported covariance."""
    runs, trajectories, true = passes
    sd = {"aside": 0.010, "roll": 3e-4}  # [m], [rad]
    aside, tilt = sd["aside"] ** 2, sd["roll"] ** 2
    covariance = np.diag([aside, aside, 0, tilt, tilt, 0])
    rng = np.random.default_rng(11)
    settings = CalibrationSettings(
        parameters=("roll", "pitch"),
        max_angle_sd=0.02,
        max_iterations=60,
        drift_time=(LASTING, LASTING),
    )
    start = replace(true, scanner_rotation=(0.0, 0.0, true.scanner_rotation[2]))
    ratios = []
    for _ in range(12):
        moved = []
        for trajectory in trajectories:
            turn = Rotation.from_rotvec([sd["roll"] * rng.normal(), 0.0, 0.0])
            quaternion = (Rotation.from_quat(trajectory.quaternion) * turn).as_quat()
            aside = sd["aside"] * np.append(rng.normal(size=2), 0.0)
            whole = np.broadcast_to(covariance, (trajectory.time.size, 6, 6))
            moved.append(
                replace(
                    trajectory,
                    position=trajectory.position + aside,
                    quaternion=quaternion,
                    covariance=whole,
                )
            )
        found = calibrate_mounting(runs, moved, mounting=start, settings=settings)
        ratios.append((found.value - values(true)[:2]) / found.sd)
        # four passes are not better than the mean of their errors, but for what a body that rolls
        # of itself tells of them: a scanner that is carried aside by 0.4 mm then heaves by 2 um
        assert 0.85 < found.sd[0] / (sd["roll"] / 2) < 1.05
    roll, pitch = np.sqrt(np.mean(np.square(ratios), axis=0))
    npt.assert_allclose(roll, 1.0, rtol=0, atol=HONEST)
    # passes in three lanes tell where they lie, and then the pitch but for noise, which is absent
    assert pitch < 1.0 + HONEST
