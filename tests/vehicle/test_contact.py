"""The contact patch against integrals worked out apart from it."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from trueterrain.core.errors import CoverageError
from trueterrain.vehicle import Tyre, contact_heights, contact_margin

# Rounding of means of heights of some metres [m]
ROUNDING = 1e-13


def mean_of_lines(heights: np.ndarray, spacing: float, start: float, end: float) -> float:
    """Mean over a stretch of the lines between samples, from every kink within it."""
    station = np.arange(len(heights)) * spacing
    kinks = np.array([start, *station[(station > start) & (station < end)], end])
    return float(np.trapezoid(np.interp(kinks, station, heights), kinks) / (end - start))


@given(
    spacing=st.floats(0.001, 0.2),
    patch_length=st.floats(0.01, 0.4),
    seed=st.integers(0, 1000),
)
def test_the_mean_is_that_of_the_lines_between_samples(spacing, patch_length, seed):
    margin = contact_margin(spacing, patch_length)
    heights = np.random.default_rng(seed).standard_normal(2 * margin + 5)
    found = contact_heights(heights, spacing, patch_length)
    centres = (np.arange(5) + margin) * spacing
    truth = [
        mean_of_lines(heights, spacing, centre - patch_length / 2, centre + patch_length / 2)
        for centre in centres
    ]
    assert found.shape == (5,)
    # a stretch is rounded with its stations, not with itself
    assert_allclose(found, truth, rtol=0, atol=100 * ROUNDING)


@pytest.mark.parametrize("patch_length", [0.0, 0.004, 0.15, 0.1537])
def test_planes_are_reproduced(patch_length):
    """Constant and slope come out unchanged, whatever the ends of the patch."""
    tyre = Tyre(patch_length=patch_length)
    station = 0.005 * np.arange(200)
    heights = 300.0 + 0.08 * station[:, None] + 0.03 * tyre.offsets
    margin = contact_margin(0.005, patch_length)
    found = contact_heights(heights, 0.005, patch_length)
    truth = (300.0 + 0.08 * station)[margin : 200 - margin]
    assert_allclose(found, truth, rtol=0, atol=300 * ROUNDING)


@pytest.mark.parametrize("wavelength", [0.075, 0.1, 0.15, 0.31, 0.6, 2.5])
def test_a_wave_is_attenuated_by_the_sinc_of_the_patch(wavelength):
    """Waves of which a whole number fit into the patch are not felt."""
    spacing, patch_length = 0.0005, 0.15
    station = spacing * np.arange(4000)
    found = contact_heights(np.sin(2 * np.pi * station / wavelength), spacing, patch_length)
    margin = contact_margin(spacing, patch_length)
    truth = np.sinc(patch_length / wavelength) * np.sin(2 * np.pi * station / wavelength)
    chords = 2 * (np.pi * spacing / wavelength) ** 2 / 6  # lines cut the crests of the wave
    assert_allclose(found, truth[margin : 4000 - margin], rtol=0, atol=chords)


def test_a_step_becomes_a_ramp_as_long_as_the_patch():
    heights = np.where(np.arange(400) < 200, 0.0, 0.1)
    found = contact_heights(heights, 0.001, 0.1)
    centre = np.arange(50, 350)  # [mm]; the step is a line from 199 to 200 mm
    ramp = np.clip((centre + 50 - 199.5) / 100, 0.0, 1.0) * 0.1
    assert_allclose(found, ramp, rtol=0, atol=0.1 / 100 / 8 + ROUNDING)  # rounded at both ends


def test_a_gap_narrower_than_the_patch_is_enveloped():
    """A joint 20 mm wide and deep lowers the wheel by its fraction of the patch."""
    heights = np.zeros(1000)
    heights[491:511] = -0.02  # of 1 mm each, with a line of 1 mm on either side: 20 mm in the mean
    found = contact_heights(heights, 0.001, 0.15)
    assert_allclose(found.min(), -0.02 * 20 / 150, rtol=0, atol=ROUNDING)


def test_lines_across_have_equal_weight():
    rng = np.random.default_rng(3)
    heights = rng.standard_normal((80, 5))
    found = contact_heights(heights, 0.01, 0.15)
    truth = np.mean([contact_heights(line, 0.01, 0.15) for line in heights.T], axis=0)
    assert_allclose(found, truth, rtol=0, atol=ROUNDING)
    left_half = np.zeros((80, 4))
    left_half[:, 2:] = 0.1  # a kerb under the left half of the tyre lifts it by half
    assert_allclose(contact_heights(left_half, 0.01, 0.15), 0.05, rtol=0, atol=ROUNDING)


def test_a_point_is_a_patch_without_length():
    heights = np.random.default_rng(4).standard_normal(50)
    assert contact_margin(0.01, 0.0) == 0
    assert (contact_heights(heights, 0.01, 0.0) == heights).all()


@pytest.mark.parametrize(
    ("spacing", "patch_length", "margin"),
    [(0.005, 0.15, 15), (0.005, 0.152, 16), (0.1, 0.15, 1), (0.05, 0.15, 2), (0.03, 0.06, 1)],
)
def test_margins_reach_just_to_the_ends_of_the_patch(spacing, patch_length, margin):
    assert contact_margin(spacing, patch_length) == margin


@given(cut=st.integers(0, 300))
def test_overlapping_blocks_give_the_same_bits_as_one_piece(cut):
    heights = 200 + np.random.default_rng(6).standard_normal((331, 9))
    whole = contact_heights(heights, 0.005, 0.1513)
    margin = contact_margin(0.005, 0.1513)
    pieces = []
    for start, end in ((0, cut), (cut, len(whole))):
        if end > start:
            block = np.asfortranarray(heights[start : end + 2 * margin])
            pieces.append(contact_heights(block, 0.005, 0.1513))
    assert (np.concatenate(pieces) == whole).all()


def test_a_tyre_samples_its_width_at_the_centres_of_equal_strips():
    tyre = Tyre()
    assert (tyre.patch_length, tyre.patch_width, tyre.samples_across) == (0.15, 0.18, 9)
    assert_allclose(np.diff(tyre.offsets), 0.02, rtol=0, atol=ROUNDING)
    assert_allclose(tyre.offsets, -tyre.offsets[::-1], rtol=0, atol=ROUNDING)
    assert_allclose(tyre.offsets[-1], 0.08, rtol=0, atol=ROUNDING)
    assert_allclose(Tyre(samples_across=1).offsets, [0.0], rtol=0, atol=0)


def test_a_tyre_does_not_change():
    with pytest.raises(FrozenInstanceError):
        Tyre().patch_length = 1.0  # type: ignore[misc]  # what is tested


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"patch_length": -0.1}, "patch_length must be finite and at least 0 m, got -0.1"),
        ({"patch_width": np.nan}, "patch_width must be finite and at least 0 m, got nan"),
        ({"samples_across": 0}, "samples_across must be a whole number from 1 on, got 0"),
        ({"samples_across": 2.5}, "samples_across must be a whole number from 1 on, got 2.5"),
    ],
)
def test_an_impossible_tyre_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Tyre(**arguments)


def test_impossible_arguments_are_refused():
    heights = np.zeros(100)
    for spacing in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="spacing must be finite and greater than 0 m, got"):
            contact_heights(heights, spacing, 0.15)
    with pytest.raises(ValueError, match="patch_length must be finite and at least 0 m, got -1"):
        contact_heights(heights, 0.005, -1)
    for shape in ((2, 100, 2), (100, 0)):
        with pytest.raises(ValueError, match=r"heights must have shape \(along, across\), got"):
            contact_heights(np.zeros(shape), 0.005, 0.15)


def test_a_hole_under_a_tyre_is_refused():
    heights = np.zeros((100, 3))
    heights[40, 2] = np.nan
    with pytest.raises(CoverageError, match="got nan m") as raised:
        contact_heights(heights, 0.005, 0.15)
    assert "sample 40, line 2" in str(raised.value)


def test_ground_shorter_than_the_patch_is_refused():
    assert contact_heights(np.zeros(31), 0.005, 0.15).shape == (1,)
    with pytest.raises(CoverageError, match="needs 31 samples along the path, got 30"):
        contact_heights(np.zeros(30), 0.005, 0.15)
