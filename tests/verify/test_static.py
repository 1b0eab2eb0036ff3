"""The static test, against plates and faults that are known."""

import numpy as np
import pytest

from trueterrain.core.errors import CoverageError
from trueterrain.georeference import Screening
from trueterrain.verify.static import StaticSettings, static_test

from ._plates import LENGTH, machined, standing

SHIFT_TOLERANCE = 5e-5  # [m] noise of 0.4 mm / sqrt(200) on flanks
NOISE_TOLERANCE = 1e-5  # [m] the spread of 0.4 mm from 200 scans of 350 beams is known to 0.3 %
PART_TOLERANCE = 3e-6  # [m] noise of the mean, 28 um, known to 5 %
STEP = 0.0025  # [m] error of saturated returns, along the beam
STEP_TOLERANCE = 2e-4  # [m] the beams there are up to 17 degrees inclined


def test_noise_shift_and_tilt_are_separated_from_errors():
    (found,) = static_test(standing(), machined())
    np.testing.assert_allclose(found.registration.shift, -0.55, rtol=0, atol=SHIFT_TOLERANCE)
    np.testing.assert_allclose(found.registration.tilt, 0.004, rtol=0, atol=SHIFT_TOLERANCE)
    inclined = np.cos(np.arctan(found.errors.along.values / 2.0))
    true = 0.0004 * float(np.sqrt(np.mean(inclined**2)))
    np.testing.assert_allclose(found.row.noise, true, rtol=0, atol=NOISE_TOLERANCE)
    plain = ~found.errors.edge.values
    noise = np.sqrt(found.parts["noise"] / plain.mean())
    np.testing.assert_allclose(noise, true / np.sqrt(200), rtol=0, atol=PART_TOLERANCE)


def test_parts_add_up_to_the_mean_square_of_the_errors():
    run = standing(bright=(0.8, 0.9, STEP))
    for found in static_test(run, machined(), StaticSettings(screening=Screening(saturation=1e4))):
        total = sum(found.parts.values())
        np.testing.assert_allclose(total, found.row.rms.value**2, rtol=0, atol=1e-15)  # [m^2]
        assert found.row.maximum == np.abs(found.errors.error).max()


def test_saturated_returns_are_charged_to_reflectivity_and_screened_away():
    run = standing(bright=(0.8, 0.9, STEP))
    settings = StaticSettings(screening=Screening(saturation=1e4))
    all_of_them, screened = static_test(run, machined(), settings)
    flagged = all_of_them.errors.flagged.values
    fraction = float(flagged.mean())
    np.testing.assert_allclose(
        np.sqrt(all_of_them.parts["reflectivity"] / fraction), STEP, rtol=0, atol=STEP_TOLERANCE
    )
    assert screened.parts["reflectivity"] == 0
    assert screened.row.count == all_of_them.row.count - flagged.sum()
    s = screened.errors.s.values
    assert not ((s > 0.802) & (s < 0.898)).any()
    assert (screened.row.test, all_of_them.row.test) == ("static, screened", "static")


def test_errors_lie_on_the_machined_profile():
    (found,) = static_test(standing(noise=0.0), machined())
    plain = ~found.errors.edge
    np.testing.assert_allclose(found.errors.error[plain], 0.0, rtol=0, atol=2e-5)  # [m]
    assert found.errors.s.min() >= 0
    assert found.errors.s.max() <= LENGTH
    assert found.row.off_edges.value < found.row.rms.value


def test_fewer_scans_than_needed_are_an_error():
    run = standing(scans=50)
    with pytest.raises(
        CoverageError, match=r"holds 50 scans, the static test needs 100.*Record more scans"
    ):
        static_test(run, machined())
    with pytest.raises(CoverageError, match="needs 60"):
        static_test(run, machined(), StaticSettings(scans=60, min_scans=10))
    (found,) = static_test(run, machined(), StaticSettings(scans=30, min_scans=10))
    assert found.scans == 30


def test_ground_without_the_plate_is_an_error():
    with pytest.raises(CoverageError, match=r"plate is not found"):
        static_test(standing(plate=False), machined())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"min_scans": 1}, "at least 2"),
        ({"present": 0.0}, "present"),
        ({"edge": -1.0}, "edge"),
        ({"confidence": 1.0}, "confidence"),
        ({"search": 0.1}, "assumed"),
    ],
)
def test_settings_that_break_a_rule_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        StaticSettings(**settings)


def test_upright_faces_are_near_the_machined_line_though_their_heights_are_not():
    """A beam that meets a face halfway is right; only its place says little of its height."""
    (found,) = static_test(standing(noise=2e-5, tilt=0.0, shift=-0.5503), machined())
    errors = found.errors
    # four standard deviations of the mean of 200 scans, and what the registration leaves
    np.testing.assert_allclose(errors.distance, 0.0, rtol=0, atol=2e-5)  # [m]
    assert np.abs(errors.error).max() > 0.003
    assert found.row.distance.value < 0.1 * found.row.rms.value
