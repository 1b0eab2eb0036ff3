"""Points of recorded runs against the ground that was scanned, and against scipy."""

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError
from trueterrain.formats.run import Mounting, open_run, scan_blocks
from trueterrain.georeference import ScanGeometry, Screening, georeference
from trueterrain.georeference.scans import find_scan_problems
from trueterrain.motion import Trajectory
from trueterrain.motion.trajectory import BRIDGED
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scene import set_stage

STORED = 0.5e-4 + 2e-6  # [m] half a step of the stored ranges, and round-off
MICROMETRE = 1e-6  # [m] what the motion within a scan may be wrong
EXACT = 1e-9  # [m] round-off at some metres

ASKEW = Mounting(
    scanner_position=(-2.1, 0.12, 1.15), scanner_rotation=(0.03, -0.04, 0.06), scanner_clock=0.0037
)


def moving(duration=1.0, step=0.005, amplitude=0.02, frequency=12.0, covariance=None):
    """Driving at 8 m/s in a curve, and shaken by some g as a vehicle is."""
    w = 2 * np.pi * frequency
    t = np.arange(0, duration + step / 2, step)
    heave, tilt = amplitude * np.sin(w * t), 0.5 * amplitude * np.sin(w * t + 1)
    yaw = 0.5 * t
    position = np.stack([16 * np.sin(yaw), 16 * (1 - np.cos(yaw)), heave], axis=1)
    velocity = np.stack([8 * np.cos(yaw), 8 * np.sin(yaw), amplitude * w * np.cos(w * t)], axis=1)
    rate = 0.5 * amplitude * w * np.cos(w * t + 1)
    turning = [rate, 0.5 * np.sin(tilt), 0.5 * np.cos(tilt)]
    return Trajectory(
        time=t,
        position=position,
        velocity=velocity,
        quaternion=Rotation.from_euler("ZX", np.stack([yaw, tilt], axis=1)).as_quat(),
        angular_velocity=np.stack(turning, axis=1),
        covariance=np.zeros((t.size, 6, 6))
        if covariance is None
        else np.tile(covariance, (t.size, 1, 1)),
        flag=np.zeros(t.size, np.uint8),
    )


def fan(beams=940, span=0.8e-3):
    return np.linspace(-0.78, 0.78, beams), np.linspace(0, span, beams)


def scans(stamps, angle, delay, ranges=2.0, **more):
    shape = (np.size(stamps), angle.size)
    return xr.Dataset(
        {
            "time": ("scan", np.asarray(stamps, float)),
            "range": (("scan", "beam"), np.broadcast_to(ranges, shape).astype(float)),
            "angle": ("beam", angle),
            "delay": ("beam", delay),
            **{name: (("scan", "beam"), values) for name, values in more.items()},
        }
    )


def beam_by_beam(trajectory, mounting, block):
    """Points with a pose of its own for each beam."""
    time = block.time.values[:, None] + block.delay.values + mounting.scanner_clock
    poses = trajectory.at(time.ravel())
    ranges = block.range.values.ravel()
    angle = np.broadcast_to(block.angle.values, time.shape).ravel()
    direction = np.stack([np.zeros(angle.size), np.sin(angle), -np.cos(angle)], axis=1)
    turned = Rotation.from_euler("ZYX", mounting.scanner_rotation[::-1]).apply(direction)
    arm = np.array(mounting.scanner_position) + ranges[:, None] * turned
    return poses.position + poses.rotation.apply(arm)


@pytest.mark.slow
@pytest.mark.parametrize("span", [0.8e-3, 12e-3])
def test_motion_within_a_scan_is_that_of_each_beam(span):
    trajectory = moving()
    angle, delay = fan(span=span)
    block = scans(np.random.default_rng(1).uniform(0, 0.97, 300), angle, delay, ranges=2.5)
    (points,) = georeference([block], trajectory, ASKEW)
    expected = beam_by_beam(trajectory, ASKEW, block)
    found = np.stack([points.easting, points.northing, points.up], axis=1)
    npt.assert_allclose(found, expected, rtol=0, atol=MICROMETRE)
    assert points.attrs["returns"] == block.range.size
    stamps = block.time.values[:, None] + delay + ASKEW.scanner_clock
    npt.assert_allclose(points.time, stamps.ravel(), rtol=0, atol=1e-12)


def test_a_scan_from_the_last_beam_to_the_first_is_cut_as_well():
    trajectory = moving()
    angle, delay = fan(span=9e-3)
    block = scans([0.2, 0.5], angle, delay[::-1])
    (points,) = georeference([block], trajectory, ASKEW)
    npt.assert_allclose(
        np.stack([points.easting, points.northing, points.up], axis=1),
        beam_by_beam(trajectory, ASKEW, block),
        rtol=0,
        atol=MICROMETRE,
    )


def test_a_scanner_of_one_beam_is_a_profiler():
    trajectory = moving()
    block = scans(np.linspace(0.1, 0.9, 50), np.zeros(1), np.zeros(1))
    (points,) = georeference([block], trajectory, Mounting())
    npt.assert_allclose(
        np.stack([points.easting, points.northing, points.up], axis=1),
        beam_by_beam(trajectory, Mounting(), block),
        rtol=0,
        atol=EXACT,
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["belgian-two-lanes", "oval", "boresight"])
def test_points_lie_on_the_ground_that_was_scanned(name, record, short_scene):
    scene = short_scene(name)
    if name != "boresight":
        scene = replace(scene, mounting=ASKEW)
    run, trajectory = record(scene)
    ground = Raster(set_stage(scene).ground, spacing=scene.raster)
    worst = 0.0
    for points in georeference(run, trajectory, scene.mounting):
        part = points.isel(point=slice(None, None, 7))
        above = part.up.values - ground.height(part.easting.values, part.northing.values)
        # beside a step, a range that is wrong by its rounding ends at another height
        worst = max(worst, float(np.quantile(np.abs(above), 0.99)))
    assert worst < STORED


@pytest.mark.slow
def test_points_are_the_same_for_any_size_of_blocks(record, short_scene):
    run, trajectory = record(short_scene("kerb"))
    whole = xr.concat(list(georeference(run, trajectory)), "point", combine_attrs="drop")
    for size in (1, 77):
        parts = xr.concat(
            list(georeference(run, trajectory, block=size)), "point", combine_attrs="drop"
        )
        for variable in whole:
            npt.assert_array_equal(whole[variable], parts[variable])


def test_standard_deviations_are_those_of_simulated_errors():
    """Heights of one return with poses drawn from their covariance, and noisy ranges."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6)) * np.array([5e-3] * 3 + [2e-3] * 3)[:, None]
    trajectory = moving(covariance=root @ root.T)
    angle, delay = fan(beams=5)
    block = scans([0.5], angle, delay, ranges=2.4)
    (points,) = georeference([block], trajectory, ASKEW, range_noise=1e-3)
    exact = beam_by_beam(trajectory, ASKEW, block)
    body = trajectory.at(0.5 + delay + ASKEW.scanner_clock).position
    draws = 20_000
    errors = rng.normal(size=(draws, 6)) @ root.T
    turned = Rotation.from_rotvec(errors[:, None, 3:].repeat(5, axis=1).reshape(-1, 3))
    arms = turned.apply(np.tile(exact - body, (draws, 1))).reshape(draws, 5, 3)
    down = (exact - beam_by_beam(trajectory, ASKEW, block.assign(range=block.range - 1)))[:, 2]
    heights = (body + arms)[..., 2] + errors[:, None, 2] + 1e-3 * rng.normal(size=(draws, 5)) * down
    npt.assert_allclose(points.sd, heights.std(axis=0), rtol=0.03)


def test_flagged_returns_are_rejected_or_weigh_less():
    trajectory, (angle, delay) = moving(), fan(beams=4)
    counts = np.array([[100, 900, 900, 60000]], np.uint16)
    block = scans([0.5], angle, delay, ranges=[[2, 2, np.nan, 2]], intensity=counts)
    screening = Screening(floor=500.0, saturation=50000.0)
    (points,) = georeference([block], trajectory, Mounting(), screening=screening)
    assert points.intensity.values.tolist() == [900]
    assert {name: points.attrs[name] for name in ("returns", "missing", "flagged")} == {
        "returns": 1,
        "missing": 1,
        "flagged": 2,
    }
    (points,) = georeference(
        [block],
        trajectory,
        Mounting(),
        screening=replace(screening, weight=0.25),
        range_noise=1e-3,
    )
    assert points.intensity.values.tolist() == [100, 900, 60000]
    (plain,) = georeference([block], trajectory, Mounting(), range_noise=1e-3)
    npt.assert_allclose(points.sd / plain.sd, [2, 1, 2], rtol=1e-12)


def test_ranges_beyond_the_limits_are_no_ground():
    trajectory, (angle, delay) = moving(), fan(beams=3)
    block = scans([0.5], angle, delay, ranges=[[0.4, 2.0, 7.0]])
    screening = Screening(nearest=0.5, furthest=6.0)
    (points,) = georeference([block], trajectory, Mounting(), screening=screening, lane=3)
    assert points.sizes["point"] == 1
    assert points.lane.values.tolist() == [3]


def test_scans_without_motion_are_left_out_and_counted():
    trajectory, (angle, delay) = moving(), fan(beams=10)
    block = scans([-0.5, 0.5, np.nan, 0.9996, 1.5], angle, delay)
    (points,) = georeference([block], trajectory, Mounting())
    assert points.sizes["point"] == 10
    assert (points.attrs["scans"], points.attrs["scans_uncovered"]) == (5, 4)


@given(
    start=st.sampled_from([0.0, 17.3, 345_678.9, 1.3e9]),  # [s] of a run, of a week, of GPS
    rate=st.sampled_from([100.0, 200.0, 333.0, 1000.0]),  # [Hz] of the scanner
    clock=st.floats(-2.0, 2.0),  # [s]
    span=st.sampled_from([0.0, 0.4e-3, 0.8e-3]),  # [s] of a scan
    count=st.integers(1, 300),
)
def test_scans_up_to_both_ends_of_the_motion_are_covered(start, rate, clock, span, count):
    """Stamps, clocks and delays are rounded sums; a snapshot lasts no time at all."""
    stamps = start - clock + np.arange(count) / rate
    angle, delay = fan(beams=5, span=span)
    end = start + (count - 1) / rate + span
    knots = np.linspace(start, max(end, start + 0.01), 50)
    still = moving(duration=49.0, step=1.0, amplitude=0.0)
    trajectory = replace(
        still,
        time=knots,
        position=np.zeros((50, 3)),
        velocity=np.zeros((50, 3)),
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (50, 1)),
        angular_velocity=np.zeros((50, 3)),
    )
    mounting = Mounting(scanner_clock=clock)
    (points,) = georeference([scans(stamps, angle, delay)], trajectory, mounting)
    assert points.attrs["scans_uncovered"] == 0
    npt.assert_allclose(points.up, -2 * np.cos(np.tile(angle, count)), rtol=0, atol=EXACT)
    late = scans(stamps + 0.02, angle, delay)  # by more than rounding
    assert not ScanGeometry(trajectory, mounting, angle, delay).covers(late["time"])[-1]


@pytest.mark.parametrize("stamp", [0.0, 1.0])
def test_one_scan_at_an_end_of_the_motion_is_no_problem(stamp):
    angle, delay = fan(beams=5, span=0.0)
    run = xr.DataTree.from_dict({"scans": scans([stamp], angle, delay)})
    run.attrs["mounting"] = Mounting().to_attrs()
    assert find_scan_problems(run, moving()) == []
    (points,) = georeference(run, moving())
    assert points.sizes["point"] == 5
    run["scans"]["time"][:] = 1.1
    with pytest.raises(CoverageError, match="covers none of the 1 scans"):
        find_scan_problems(run, moving())


def test_bridged_motion_is_counted():
    plain = moving()
    flag = plain.flag.copy()
    flag[100] = BRIDGED
    angle, delay = fan(beams=10)
    bridged = replace(plain, flag=flag)
    (points,) = georeference([scans([0.3, 0.4971, 0.501], angle, delay)], bridged, Mounting())
    assert points.attrs["bridged"] == 20


def test_motion_at_another_time_is_refused():
    angle, delay = fan(beams=10)
    with pytest.raises(CoverageError, match=r"covers none of the 2 scans.*Compare the clocks"):
        list(georeference([scans([5, 6], angle, delay)], moving(), Mounting()))


def test_runs_without_returns_are_refused():
    angle, delay = fan(beams=10)
    with pytest.raises(CoverageError, match="no return in 1 scans"):
        list(georeference([scans([0.5], angle, delay, ranges=np.nan)], moving(), Mounting()))


def test_invalid_arguments_are_refused():
    angle, delay = fan(beams=10)
    block = scans([0.5], angle, delay)
    with pytest.raises(ValueError, match="mounting must be given"):
        georeference([block], moving())
    with pytest.raises(ValueError, match="range_noise must be at least 0"):
        georeference([block], moving(), Mounting(), range_noise=-1.0)
    with pytest.raises(ValueError, match="intensities, which were not recorded"):
        list(georeference([block], moving(), Mounting(), screening=Screening(floor=1.0)))
    with pytest.raises(ValueError, match="one value for each beam"):
        ScanGeometry(moving(), Mounting(), angle, delay[1:])
    with pytest.raises(ValueError, match="finite"):
        ScanGeometry(moving(), Mounting(), angle * np.nan, delay)
    with pytest.raises(ValueError, match=r"time must be from .*scan 1"):
        ScanGeometry(moving(), Mounting(), angle, delay).expand([0.5, 3.0])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"floor": 5.0, "saturation": 4.0}, "less than saturation"),
        ({"nearest": -1.0}, "less than furthest"),
        ({"weight": 1.5}, "from 0 to 1"),
    ],
)
def test_invalid_screening_is_refused(settings, words):
    with pytest.raises(ValueError, match=words):
        Screening(**settings)


def test_blocks_of_a_run_can_be_given_as_well(record, short_scene):
    run, trajectory = record(short_scene("kerb"))
    mounting = Mounting.from_attrs(open_run(run).attrs["mounting"])
    blocks = georeference(scan_blocks(run), trajectory, mounting)
    npt.assert_array_equal(next(blocks).up, next(georeference(run, trajectory)).up)
