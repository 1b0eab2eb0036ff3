"""The thesis's processing against errors that are known, and nothing of what it published."""

from dataclasses import replace

import numpy as np
import pytest

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import make_profile
from trueterrain.georeference import Screening
from trueterrain.verify.thesis import PLACES, lay_profile, thesis_dynamic, thesis_static

from ._driven import BEGIN, LEVER, SPEED, driven, motion
from ._plates import machined, standing

EXACT = 1e-12  # [m] rounding of heights below a metre
SPACING = 0.004  # [m] of the samples
NODES = [0.0, 0.4, 0.45, 0.5, 0.7, 0.75, 0.8, 1.0]  # [m] of a plate with two triangles
HEIGHTS = [0.0, 0.0, 0.04, 0.0, 0.0, 0.02, 0.0, 0.0]
SLOPE = 0.8  # of the flanks of the first
LEVELLED = 1e-4  # [m] that the line of least squares takes off at a flank
TIMED = 1e-4  # [m] of a heave of 0.04 m/s, places of cells within half a cell and scans between
SEEN = 0.05  # fraction of an error by a stripe that noise, spots and edges may change


@pytest.fixture
def triangles():
    return make_profile(NODES, HEIGHTS)


def measured(begin, *, turned=False):
    """Samples of the triangles on a plate that begins somewhere."""
    x = SPACING * np.arange(-300, 300)
    s = x - begin
    return x, np.interp(1.0 - s if turned else s, NODES, HEIGHTS)


def without_line(x, y):
    return y - np.polyval(np.polyfit(x, y, 1), x)


@pytest.mark.parametrize("aside", [0.0, 0.0007, 0.0019, -0.0019])
def test_an_offset_from_a_sample_is_an_error_on_the_flanks(triangles, aside):
    found = lay_profile(*measured(-0.4 + aside), triangles)
    np.testing.assert_allclose(found.begin, -0.4, rtol=0, atol=EXACT)
    true = np.interp(found.s - aside, NODES, HEIGHTS) - np.interp(found.s, NODES, HEIGHTS)
    true = without_line(found.s, true)
    np.testing.assert_allclose(found.error, true, rtol=0, atol=EXACT)
    np.testing.assert_allclose(found.rms, np.sqrt(np.mean(true**2)), rtol=0, atol=EXACT)
    rising = (found.s > 0.41) & (found.s < 0.44)
    np.testing.assert_allclose(found.error[rising], -SLOPE * aside, rtol=0, atol=LEVELLED)


def test_a_known_offset_from_a_sample_is_no_error(triangles):
    x, z = measured(-0.4 + 0.3 * SPACING)
    assert lay_profile(x, z, triangles).rms > 1e-4
    assert lay_profile(x, z, triangles, beside=0.3).rms < EXACT


@pytest.mark.parametrize("turned", [False, True])
def test_offset_tilt_and_direction_are_no_error(triangles, turned):
    x, z = measured(-0.4, turned=turned)
    found = lay_profile(x, z + 2.0 + 0.01 * x, triangles)
    assert found.reversed is turned
    np.testing.assert_allclose(found.begin, -0.4, rtol=0, atol=EXACT)
    np.testing.assert_allclose(found.error, 0.0, rtol=0, atol=EXACT)


def test_samples_without_height_are_left_out_but_may_begin_the_plate(triangles):
    x, z = measured(-0.4)
    z[np.abs(x + 0.4) < 0.03] = np.nan
    found = lay_profile(x, z, triangles)
    np.testing.assert_allclose(found.begin, -0.4, rtol=0, atol=EXACT)
    assert found.s.min() > 0.029
    assert found.rms < EXACT


def test_a_search_keeps_to_its_place(triangles):
    x, z = measured(-0.4)
    with pytest.raises(CoverageError, match="plate is not found"):
        lay_profile(x, z, triangles, assumed=-0.1, search=0.02)
    assert lay_profile(x, z, triangles, assumed=-0.41, search=0.02).rms < EXACT


def test_all_offsets_from_beams_are_evaluated():
    run = standing(scans=20, noise=0.0)
    found = thesis_static(run, machined())
    np.testing.assert_allclose(found.beside, PLACES)
    np.testing.assert_allclose(found.rms, np.sqrt(np.mean(found.single**2)), rtol=0, atol=EXACT)
    assert found.single.min() < found.rms < found.single.max()
    shown = np.sqrt(np.mean(found.errors["error"] ** 2))
    assert np.abs(found.single - found.rms).min() == pytest.approx(abs(float(shown) - found.rms))
    assert found.maximum in found.largest


def test_screening_removes_the_error_of_a_bright_stripe():
    stripe, error = (0.35, 0.55), 0.003
    run = standing(scans=20, noise=0.0, bright=(*stripe, error))
    place = {"places": (0.0,)}
    every = thesis_static(run, machined(), **place)
    screened = thesis_static(run, machined(), Screening(saturation=19999.0), **place)
    s = every.errors["s"].values
    inside = (s >= stripe[0]) & (s <= stripe[1])
    true = without_line(s, np.where(inside, error, 0.0))
    plain = thesis_static(standing(scans=20, noise=0.0), machined(), **place)
    size = np.sqrt(every.rms**2 - plain.rms**2)
    np.testing.assert_allclose(size, np.sqrt(np.mean(true**2)), rtol=SEEN)
    np.testing.assert_allclose(screened.rms, plain.rms, rtol=0.2)  # beams of the stripe are missing
    assert screened.errors.sizes["s"] < every.errors.sizes["s"]


def test_residual_motion_is_in_the_profile():
    size, turn = 0.002, 2 * np.pi * 3.0
    run, exact = driven(noise=0.0), motion()
    up = exact.position.copy()
    up[:, 2] += size * np.sin(turn * exact.time)
    found, wrong = (
        thesis_dynamic(run, machined(), path, places=(0.0,)).errors
        for path in (exact, replace(exact, position=up))
    )
    s = found["s"].values
    time = (BEGIN + s - LEVER[0]) / SPEED
    heave = without_line(s, size * np.sin(turn * time))
    np.testing.assert_allclose(wrong["error"] - found["error"], heave, rtol=0, atol=TIMED)


def test_the_figures_are_given_as_numbers():
    found = thesis_static(standing(scans=20), machined(), name="mine", places=(0.0, 0.25))
    words = found.to_dict()
    assert words["test"] == "mine"
    assert words["rms_at"] == found.single.tolist()
    assert words["rms_low"] <= words["rms"] <= words["rms_high"]


def test_scans_without_a_plate_are_an_error():
    with pytest.raises(CoverageError, match="plate is not found"):
        thesis_static(standing(scans=5, plate=False), machined())


def test_a_profile_in_another_unit_is_refused():
    with pytest.raises(SchemaError, match="another unit"):
        thesis_static(standing(scans=5), machined(scale=1000.0))


def test_scans_without_returns_are_refused():
    run = standing(scans=5)
    run["scans/range"][:] = np.nan
    with pytest.raises(CoverageError, match="no beam has returns"):
        thesis_static(run, machined())
