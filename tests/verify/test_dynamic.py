"""The dynamic test, against a plate that was driven over with motion and errors that are known."""

import numpy as np
import pytest
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.formats.run import Mounting
from trueterrain.motion import Trajectory
from trueterrain.verify.dynamic import DynamicSettings, dynamic_test
from trueterrain.verify.motion_rejection import rejection_spectrum

from ._plates import LENGTH, height_at, machined

SPEED = 5.0  # [m/s]
BEGIN = 8.0  # [m] where the plate begins
DURATION = 3.6  # [s]
HEAVE, FREQUENCY = 0.01, 4.0  # [m], [Hz]
SHIFT_TOLERANCE = 3e-4  # [m] noise of 0.1 mm on flanks, scans 5 mm apart
ERROR_TOLERANCE = 3e-5  # [m] means of 18 returns with 0.1 mm
REJECTION_TOLERANCE = 0.2  # [dB] noise of the returns at the frequency of the heave


def _up(time, fraction=1.0):
    return 1.5 + fraction * HEAVE * np.sin(2 * np.pi * FREQUENCY * time)


def _motion(fraction=1.0, duration=DURATION, speed=SPEED):
    """Trajectory with a fraction of the true heave."""
    time = np.arange(-0.05, duration + 0.05, 0.001)
    still = np.zeros_like(time)
    rate = 2 * np.pi * FREQUENCY * HEAVE * fraction * np.cos(2 * np.pi * FREQUENCY * time)
    return Trajectory(
        time=time,
        position=np.stack([speed * time, still, _up(time, fraction)], axis=-1),
        velocity=np.stack([still + speed, still, rate], axis=-1),
        angular_velocity=np.zeros((time.size, 3)),
        quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (time.size, 1)),
        covariance=np.zeros((time.size, 6, 6)),
        flag=np.zeros(time.size, np.uint8),
    )


def _run(*, noise=1e-4, seed=4, plate=True, bump=None):
    """Run with scans straight down, every millisecond."""
    time = np.arange(0, DURATION, 0.001)
    angle = np.linspace(-0.03, 0.03, 9)
    ground = height_at(SPEED * time - BEGIN) if plate else np.zeros_like(time)
    if bump is not None:
        ground = ground + np.where(np.abs(SPEED * time - bump) < 0.1, 0.04, 0.0)
    ranges = (_up(time) - ground)[:, None] / np.cos(angle)
    ranges = ranges + noise * np.random.default_rng(seed).normal(size=ranges.shape)
    scans = xr.Dataset(
        {
            "time": ("scan", time, {"units": "s"}),
            "range": (("scan", "beam"), ranges, {"units": "m"}),
            "angle": ("beam", angle, {"units": "rad"}),
            "delay": ("beam", np.zeros(angle.size), {"units": "s"}),
        }
    )
    tree = xr.DataTree.from_dict({"/scans": scans})
    tree.attrs["mounting"] = Mounting().to_attrs()
    return tree


def test_with_exact_motion_only_noise_remains():
    found = dynamic_test(_run(), machined(), _motion())
    # the first pose is 0.05 s before the first scan
    np.testing.assert_allclose(
        found.registration.shift, BEGIN + 0.05 * SPEED, rtol=0, atol=SHIFT_TOLERANCE
    )
    plain = ~found.errors.edge
    rms = float(np.sqrt((found.errors.error[plain] ** 2).mean()))
    np.testing.assert_allclose(rms, 1e-4 / np.sqrt(18), rtol=0, atol=ERROR_TOLERANCE)
    np.testing.assert_allclose(found.row.noise, 1e-4, rtol=0, atol=ERROR_TOLERANCE)
    np.testing.assert_allclose(found.speed, SPEED, rtol=0, atol=0.01)  # [m/s]
    np.testing.assert_allclose(
        sum(found.parts.values()), found.row.rms.value**2, rtol=0, atol=1e-15
    )


@pytest.mark.parametrize(("fraction", "decibels"), [(0.9, 19.085), (0.99, 39.913)])
def test_rejection_is_the_ratio_of_motion_to_its_residual(fraction, decibels):
    """20 log10(fraction / (1 - fraction)): known motion over unknown motion."""
    settings = DynamicSettings(floor=5.0, assumed=BEGIN + 0.05 * SPEED, search=0.5)
    found = dynamic_test(_run(noise=2e-5), machined(), _motion(fraction), settings)
    at = found.rejection.sel(frequency=FREQUENCY, method="nearest")
    np.testing.assert_allclose(at.rejection, decibels, rtol=0, atol=REJECTION_TOLERANCE)
    assert at.low < decibels < at.high


def test_errors_of_the_motion_appear_over_the_plate():
    found = dynamic_test(_run(), machined(), _motion(0.9))
    time = found.errors.time.values
    lost = -0.1 * HEAVE * np.sin(2 * np.pi * FREQUENCY * time)
    at = found.errors.along.values
    plain = ~found.errors.edge.values

    def levelled(error):  # offset and tilt are the registration's
        return error - np.polyval(np.polyfit(at[plain], error[plain], 1), at)

    # the tilt that the registration takes shifts the plate by a fraction of a millimetre as well
    np.testing.assert_allclose(
        levelled(found.errors.error.values)[plain], levelled(lost)[plain], rtol=0, atol=1.5e-4
    )


def test_a_run_that_does_not_cross_the_plate_is_an_error():
    with pytest.raises(CoverageError, match="plate is not found"):
        dynamic_test(_run(plate=False), machined(), _motion())
    with pytest.raises(CoverageError, match="plate is not found"):
        dynamic_test(_run(), machined(), _motion(), DynamicSettings(end=1.5))


def test_a_vehicle_at_rest_is_an_error():
    with pytest.raises(CoverageError, match=r"moved by 0\.000 m: .*static test"):
        dynamic_test(_run(), machined(), _motion(speed=0.0))


def test_a_strip_without_returns_is_an_error():
    with pytest.raises(CoverageError, match=r"no return in the strip.*Choose another offset"):
        dynamic_test(_run(), machined(), _motion(), DynamicSettings(offset=1.0))


def test_scans_too_far_apart_are_an_error():
    sparse = _run().isel(scan=slice(0, None, 5))
    with pytest.raises(CoverageError, match=r"places on the plate have heights.*Drive slower"):
        dynamic_test(sparse, machined(), _motion())


def test_a_floor_that_is_not_plane_is_an_error():
    with pytest.raises(CoverageError, match=r"not plane: it departs by 4.\.. mm.*shorter floor"):
        dynamic_test(_run(bump=10.0), machined(), _motion(), DynamicSettings(floor=2.0))


def test_a_machined_profile_in_another_unit_is_named():
    with pytest.raises(SchemaError, match="another unit"):
        dynamic_test(_run(), machined(1000.0), _motion())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"spacing": 0.0}, "spacing"),
        ({"width": -1.0}, "width"),
        ({"floor": -1.0}, "floor"),
        ({"search": 1.0}, "assumed"),
        ({"begin": 2.0, "end": 1.0}, "begin must be before"),
        ({"confidence": 2.0}, "confidence"),
    ],
)
def test_settings_that_break_a_rule_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        DynamicSettings(**settings)


def test_the_interval_of_the_rejection_has_its_stated_coverage():
    """Independent white records 20 dB apart; 95 % of 200, less three deviations of 1.5 %."""
    rng = np.random.default_rng(7)
    time = 0.01 * np.arange(256)
    held = 0
    for _ in range(200):
        found = rejection_spectrum(time, rng.normal(size=256), 0.1 * rng.normal(size=256))
        at = found.isel(frequency=found.sizes["frequency"] // 2)
        held += bool(at.low <= 20.0 <= at.high)
    assert held >= 181


def test_records_that_are_too_short_are_refused():
    with pytest.raises(ValueError, match="at least 32 samples"):
        rejection_spectrum(np.arange(9.0), np.ones(9), np.ones(9))


def test_the_plate_is_as_long_as_it_was_machined():
    found = dynamic_test(_run(), machined(), _motion())
    assert found.errors.s.min() >= 0
    assert found.errors.s.max() <= LENGTH


def test_too_few_places_for_a_spectrum_are_an_error():
    with pytest.raises(CoverageError, match=r"too few for a spectrum.*smaller spacing or edge"):
        dynamic_test(_run(), machined(), _motion(), DynamicSettings(edge=0.5))


@pytest.mark.parametrize("late", [0.001, -0.002])
def test_a_clock_error_shows_as_rate_of_the_motion_and_as_shift(late):
    """Stamps that are wrong by dt: error dt times the rate of up, and a plate beside its place."""
    run = _run(noise=2e-5)
    run["scans"] = (
        run["scans"]
        .to_dataset()
        .assign(time=("scan", run["scans/time"].values + late, {"units": "s"}))
    )
    place = BEGIN + 0.05 * SPEED
    found = dynamic_test(run, machined(), _motion(), DynamicSettings(assumed=place, search=0.1))
    np.testing.assert_allclose(
        found.registration.shift - place, SPEED * late, rtol=0, atol=5 * SHIFT_TOLERANCE
    )
    errors = found.errors.isel(s=~found.errors.edge.values)
    time = errors.time.values - late
    rate = 2 * np.pi * FREQUENCY * HEAVE * np.cos(2 * np.pi * FREQUENCY * time)
    level = np.polyfit(time - time.mean(), errors.error.values, 1)
    expected = late * rate
    expected = expected - np.polyval(
        np.polyfit(time - time.mean(), expected, 1), time - time.mean()
    )
    measured = errors.error.values - np.polyval(level, time - time.mean())
    np.testing.assert_allclose(measured, expected, rtol=0, atol=2 * ERROR_TOLERANCE)


def test_a_boresight_error_shows_as_a_plate_beside_its_place():
    """0.1 degrees of pitch at 1.5 m: 2.6 mm along the path, and no error of heights."""
    pitch = np.deg2rad(0.1)
    place = BEGIN + 0.05 * SPEED
    run = _run(noise=2e-5)
    run.attrs["mounting"] = Mounting(scanner_rotation=(0.0, float(pitch), 0.0)).to_attrs()
    found = dynamic_test(run, machined(), _motion(), DynamicSettings(assumed=place, search=0.1))
    beside = abs(found.registration.shift - place)
    np.testing.assert_allclose(beside, 1.5 * np.tan(pitch), rtol=0, atol=5 * SHIFT_TOLERANCE)
    assert found.row.off_edges.value < 5 * ERROR_TOLERANCE
