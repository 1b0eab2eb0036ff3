"""Registration of measured profiles, against plates that were laid down on purpose."""

import numpy as np
import pytest

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.core.schemas import make_profile
from trueterrain.verify.registration.search import register_profile

from ._plates import CORNERS, LENGTH, height_at, machined

SHIFT_TOLERANCE = 2e-4  # [m] heights of 0.1 mm on flanks of 0.8, some 25 of them
OFFSET_TOLERANCE = 3e-5  # [m] noise of 0.1 mm over 300 heights
TILT_TOLERANCE = 6e-5  # [rad] the same over 1.2 m
NOISE = 1e-4  # [m]
STRETCH_TOLERANCE = 2e-4  # [m/m] 0.1 mm on flanks of 0.8 and 0.4, 25 each, 0.6 m apart

#: Two triangles on a plate: flanks tell where they lie, upright faces only to a sample [m].
TRIANGLES = np.array(
    [[0.0, 0.2, 0.25, 0.3, 0.8, 0.85, 0.9, LENGTH], [0.0, 0.0, 0.04, 0.0, 0.0, 0.02, 0.0, 0.0]]
)


def _measured(shift, offset, tilt, *, turned=False, seed=3, step=0.004):
    x = np.arange(-2.0, 2.0, step)
    s = x - shift
    rng = np.random.default_rng(seed)
    plate = height_at(LENGTH - s if turned else s)
    return x, plate + offset + tilt * (s - LENGTH / 2) + NOISE * rng.normal(size=x.size)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("shift", [-1.31, 0.2057])
def test_offset_tilt_and_shift_are_found(shift, turned):
    x, z = _measured(shift, -2.0, 0.01, turned=turned)
    found = register_profile(x, z, machined())
    assert found.reversed is turned
    np.testing.assert_allclose(found.shift, shift, rtol=0, atol=SHIFT_TOLERANCE)
    np.testing.assert_allclose(found.offset, -2.0, rtol=0, atol=OFFSET_TOLERANCE)
    np.testing.assert_allclose(found.tilt, 0.01, rtol=0, atol=TILT_TOLERANCE)


def test_a_plate_beside_its_assumed_place_is_named_as_such_not_as_an_error_of_heights():
    x, z = _measured(-0.5, 0.0, 0.0)
    found = register_profile(x, z, machined(), assumed=-0.505, search=0.02)
    np.testing.assert_allclose(found.shift + 0.505, 0.005, rtol=0, atol=SHIFT_TOLERANCE)
    assert found.residual < 1.3 * NOISE
    assert found.unregistered > 10 * found.residual


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("stretch", [0.0, 0.004, -0.0065])
def test_stretch_is_found_on_request(stretch, turned):
    x = np.arange(-2.0, 2.0, 0.004)
    s = (x + 0.5) / (1 + stretch)
    at = LENGTH - s if turned else s
    noise = NOISE * np.random.default_rng(5).normal(size=x.size)
    found = register_profile(
        x,
        np.interp(at, *TRIANGLES) + 0.01 * x - 2.0 + noise,
        make_profile(*TRIANGLES),
        stretch=True,
    )
    assert found.reversed is turned
    np.testing.assert_allclose(found.stretch, stretch, rtol=0, atol=STRETCH_TOLERANCE)
    np.testing.assert_allclose(found.positions(x), at, rtol=0, atol=3 * SHIFT_TOLERANCE)
    np.testing.assert_allclose(found.level(x), 0.01 * x - 2.0, rtol=0, atol=2 * TILT_TOLERANCE)
    assert found.residual < 1.3 * NOISE


def test_stretch_is_not_estimated_by_default():
    x, z = _measured(-0.5, -2.0, 0.01)
    assert register_profile(x * 1.004, z, machined()).stretch == 0.0


def test_a_plate_is_kept_at_its_assumed_place():
    x, z = _measured(-0.5, -2.0, 0.01)
    found = register_profile(x, z, machined(), assumed=-0.52, search=0.0, stretch=True)
    assert (found.shift, found.stretch) == (-0.52, 0.0)
    assert found.unregistered > 10 * NOISE
    np.testing.assert_allclose(found.offset, -2.0, rtol=0, atol=1e-3)  # flanks pull a little


def test_saturated_returns_have_no_influence():
    x, z = _measured(-0.5, -2.0, 0.0)
    s = x + 0.5
    z[(s > 0.8) & (s < 1.0)] += 0.006
    found = register_profile(x, z, machined())
    np.testing.assert_allclose(found.tilt, 0.0, rtol=0, atol=3 * TILT_TOLERANCE)
    np.testing.assert_allclose(found.shift, -0.5, rtol=0, atol=SHIFT_TOLERANCE)
    assert found.outliers >= 45


def test_gaps_as_wide_as_cleats_are_no_plate():
    """With both cleats in gaps, hardly any point remains that differs."""
    x = np.arange(-2.0, 3.0, 0.004)
    z = np.interp(x + 1.305, *TRIANGLES)
    for gap in (0.75, 1.35):
        z[np.abs(x - gap) < 0.045] = np.nan
    found = register_profile(x, z, make_profile(*TRIANGLES))
    np.testing.assert_allclose(found.shift, -1.305, rtol=0, atol=SHIFT_TOLERANCE)


def test_ground_without_a_plate_is_an_error():
    x = np.arange(-2.0, 2.0, 0.004)
    z = 0.001 * np.sin(9 * x)
    with pytest.raises(CoverageError, match=r"plate is not found.*State its place"):
        register_profile(x, z, machined())


def test_a_plate_beyond_the_search_is_not_found():
    x, z = _measured(-0.5, 0.0, 0.0)
    with pytest.raises(CoverageError, match="not found"):
        register_profile(x, z, machined(), assumed=0.5, search=0.1)


def test_a_search_outside_of_the_measured_is_an_error():
    x, z = _measured(-0.5, 0.0, 0.0)
    with pytest.raises(CoverageError, match="too few points"):
        register_profile(x, z, machined(), assumed=50.0, search=0.1)


@pytest.mark.parametrize(
    ("profile", "message"),
    [
        (machined(1000.0), "height: spans 40 m.*another unit.*Name the unit"),
        (make_profile(1000 * CORNERS[0], CORNERS[1]), "s: spans 1200 m"),
        (machined(0.3048), "heights are measured as 3.28 times the machined"),
        (machined(0.01), "spans 0.0004 m"),
    ],
)
def test_a_machined_profile_in_another_unit_is_named(profile, message):
    x, z = _measured(-0.5, 0.0, 0.0)
    with pytest.raises(SchemaError, match=message):
        register_profile(x, z, profile)


def test_a_machined_profile_with_tracks_or_gaps_is_refused():
    x, z = _measured(-0.5, 0.0, 0.0)
    both = make_profile(CORNERS[0], [CORNERS[1], CORNERS[1]], tracks=["left", "right"])
    with pytest.raises(SchemaError, match="one track"):
        register_profile(x, z, both)
    gaps = machined()
    gaps["height"][3] = np.nan
    with pytest.raises(SchemaError, match="no gaps"):
        register_profile(x, z, gaps)


def test_arguments_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="one length"):
        register_profile([0.0, 1.0], [0.0], machined())
    with pytest.raises(ValueError, match="search needs assumed"):
        register_profile([0.0, 1.0], [0.0, 1.0], machined(), search=0.1)
