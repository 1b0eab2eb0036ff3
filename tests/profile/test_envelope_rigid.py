"""Rigid disc and tandem cams: steps, cleats, gaps and slopes with closed-form results."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.ndimage import grey_dilation

from trueterrain.core.schemas import make_profile, make_surface
from trueterrain.profile import straight_path
from trueterrain.profile.envelope import (
    PASSENGER_TYRE,
    TRUCK_TYRE,
    RigidDisc,
    TandemCams,
    effective_road,
    named_tyre,
    tyre_envelope,
)

EXACT = 1e-12  # [m] round-off: the answers are exact for ground that is linear between samples
RESAMPLED = 2e-7  # [m] a dilation of samples 0.2 mm apart misses 0.2 mm^2 / 8 of the curvature

STEP = 0.005  # [m] between samples
S = np.arange(-400, 401) * STEP  # obstacles lie about 0
DISC = RigidDisc(radius=0.3)
CAMS = TandemCams()


def profile(height):
    return make_profile(S, height)


def block(begin, end, rise=0.015):
    """Ground that is higher from one sample to another, inclusive; one sample of ramp outside."""
    return np.where((begin - 1e-9 <= S) & (end + 1e-9 >= S), rise, 0.0)


def above(cam, x):
    """How high the outline of a cam lies above its lowest point; beyond its ends, infinitely."""
    fraction = np.minimum(np.abs(x) / cam.half_length, 1)
    drop = cam.half_height * (1 - (1 - fraction**cam.order) ** (1 / cam.order))
    return np.where(np.abs(x) <= cam.half_length, drop, np.inf)


def over(begin, end, rise, outline, s):
    """A cam over a block on level ground: on the ground, on its top, or on one of its edges."""
    beside = np.maximum(np.maximum(begin - s, s - end), 0)
    return np.maximum(rise - outline(beside), 0)


def circle(x):
    return DISC.radius - np.sqrt(np.maximum(DISC.radius**2 - np.square(x), 0))


@pytest.mark.parametrize(("begin", "end"), [(0.0, 9.0), (-0.02, 0.02), (0.0, 0.0)])
def test_a_disc_climbs_a_step_a_cleat_and_a_needle_along_a_circle(begin, end):
    felt = tyre_envelope(profile(block(begin, end)), tyre=DISC)
    assert_allclose(felt.height, over(begin, end, 0.015, circle, S), rtol=0, atol=EXACT)


def test_a_disc_bridges_a_gap_as_deep_as_its_sagitta():
    gap = 0.04
    ground = np.where(np.abs(S) < gap / 2 - 1e-9, -0.1, 0.0)
    felt = tyre_envelope(profile(ground), tyre=DISC).height.values
    inside = np.abs(S) < gap / 2
    expected = np.where(inside, -circle(gap / 2 - np.abs(S)), 0.0)
    assert_allclose(felt, expected, rtol=0, atol=EXACT)
    assert_allclose(
        felt.min(), -(0.3 - np.sqrt(0.3**2 - gap**2 / 4)), rtol=0, atol=EXACT
    )  # the formula of the docstring


def test_the_slope_of_a_disc_is_that_of_its_tangent_at_the_edge():
    road = effective_road(profile(block(0.0, 9.0)), tyre=DISC)
    on_edge = (S > -0.09) & (S < 0)
    tangent = -S / np.sqrt(DISC.radius**2 - S**2, where=on_edge, out=np.ones_like(S))
    assert_allclose(road.slope[on_edge], tangent[on_edge], rtol=0, atol=1e-9)
    derivative = np.gradient(road.height.values, S)
    assert_allclose(road.slope[on_edge][3:-3], derivative[on_edge][3:-3], rtol=0, atol=2e-3)


@pytest.mark.parametrize(("begin", "end"), [(0.0, 9.0), (-0.01, 0.01), (0.0, 0.0)])
def test_tandem_cams_over_a_step_and_cleats_are_two_cams(begin, end):
    road = effective_road(profile(block(begin, end)), tyre=CAMS)
    front, rear = (
        over(begin, end, 0.015, lambda x: above(CAMS, x), S + shift)
        for shift in (CAMS.spacing / 2, -CAMS.spacing / 2)
    )
    assert_allclose(road.height, (front + rear) / 2, rtol=0, atol=EXACT)
    assert_allclose(road.slope, (front - rear) / CAMS.spacing, rtol=0, atol=EXACT / 0.1)


def test_a_cleat_shorter_than_the_patch_lifts_cams_twice():
    height = tyre_envelope(profile(block(-0.01, 0.01, 0.01)), tyre=CAMS).height.values
    peaks = np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])) + 1
    dip = height[np.abs(S) < 1e-9][0]
    assert_allclose(height[peaks].max(), 0.005, rtol=0, atol=EXACT)  # one of two cams on top
    assert dip < 0.0045
    assert_allclose(height, height[::-1], rtol=0, atol=EXACT)


def test_cams_bridge_a_gap_narrower_than_the_patch():
    gap = 0.04
    ground = np.where(np.abs(S) < gap / 2 - 1e-9, -0.1, 0.0)
    felt = tyre_envelope(profile(ground), tyre=CAMS).height.values

    def one(s):
        beside = np.maximum(gap / 2 - np.abs(s), 0)
        return -above(CAMS, beside)

    expected = (one(S + CAMS.spacing / 2) + one(S - CAMS.spacing / 2)) / 2
    assert_allclose(felt, expected, rtol=0, atol=EXACT)


@given(slope=st.floats(-0.2, 0.2), spacing=st.sampled_from([0.004, 0.01, 0.1]))
@settings(max_examples=20)
def test_on_a_slope_disc_and_cams_are_higher_by_the_documented_offset(slope, spacing):
    s = np.arange(-60, 61) * spacing
    inner = np.abs(s) < 60 * spacing - 0.7 if spacing > 0.02 else np.abs(s) < 0.02
    disc = effective_road(make_profile(s, slope * s), tyre=RigidDisc(radius=0.1))
    cams = effective_road(
        make_profile(s, slope * s),
        tyre=TandemCams(spacing=0.02, half_length=0.1, half_height=0.09, order=1.6),
    )
    level = 0.1 * (np.sqrt(1 + slope**2) - 1)
    assert_allclose((disc.height - slope * s)[inner], level, rtol=0, atol=EXACT)
    assert_allclose(disc.slope[inner], slope, rtol=0, atol=1e-9)
    steep = (abs(slope) * 0.1 / 0.09) ** (1.6 / 0.6)
    level = 0.09 * ((1 + steep) ** (0.6 / 1.6) - 1)
    assert_allclose((cams.height - slope * s)[inner], level, rtol=0, atol=EXACT)
    assert_allclose(cams.slope[inner], slope, rtol=0, atol=1e-9)


def test_disc_and_cams_are_dilations_of_the_ground():
    """The grey dilation of scipy, of the ground, resampled finely, is an independent program."""
    s = np.arange(121) * 0.01
    ground = np.random.default_rng(7).normal(0, 0.004, s.size)
    fine = 0.0002
    at = np.arange(6001) * fine
    line = np.interp(at, s, ground)
    cam = TandemCams(spacing=0.08)
    for tyre, outline, places in (
        (DISC, circle, [0.0]),
        (cam, lambda x: above(cam, x), [0.04, -0.04]),
    ):
        half = min(tyre.reach, 0.25)  # nothing of this ground reaches higher up
        x = np.arange(-round(half / fine), round(half / fine) + 1) * fine
        dilated = grey_dilation(line, structure=-outline(x), mode="nearest")
        expected = np.mean([np.interp(s + place, at, dilated) for place in places], axis=0)
        felt = tyre_envelope(make_profile(s, ground), tyre=tyre).height.values
        inner = (s > 0.3) & (s < 0.9)
        assert_allclose(felt[inner], expected[inner], rtol=0, atol=RESAMPLED)


AXIS = np.arange(-100, 101) * 0.01
PATH = straight_path((-0.3, 0.0), (0.3, 0.0), spacing=0.01)


def field(height):
    """Map of heights over east and north."""
    return make_surface(height(*np.meshgrid(AXIS, AXIS)), easting=AXIS, northing=AXIS)


@pytest.mark.parametrize(
    ("offset", "is_lifted"), [(0.0, True), (0.07, True), (-0.07, True), (0.2, False)]
)
def test_a_ridge_off_centre_lifts_the_whole_width_of_a_disc(offset, is_lifted):
    ridge = field(lambda _, y: np.where(np.abs(y - offset) < 0.005, 0.01, 0.0))
    tyre = RigidDisc(radius=0.3, width=0.14, lines=15)
    height = tyre_envelope(ridge, PATH, tyre=tyre).height
    assert_allclose(height, 0.01 if is_lifted else 0.0, rtol=0, atol=EXACT)


def test_on_a_cross_slope_a_cylinder_is_on_its_edge_and_cams_follow_the_centre():
    crossfall = field(lambda _, y: 0.03 * y + 2)
    disc = effective_road(crossfall, PATH, tyre=RigidDisc(radius=0.3, width=0.14))
    assert_allclose(disc.height, 2 + 0.03 * 0.07, rtol=0, atol=EXACT)
    cams = effective_road(crossfall, PATH)
    assert_allclose(cams.height, 2.0, rtol=0, atol=EXACT)
    assert_allclose(cams.camber, 0.03, rtol=0, atol=EXACT / 0.1)
    assert_allclose(cams.curvature, 0.0, rtol=0, atol=1e-9)


def test_a_cleat_under_the_left_half_tilts_the_effective_plane_to_the_right():
    half = field(lambda x, y: np.where((np.abs(x) < 0.025) & (y > 0), 0.01, 0.0))
    road = effective_road(half, PATH)
    centre = int(np.argmin(np.abs(PATH.easting)))
    assert road.camber[centre] > 0.02
    assert road.slope[centre - 6] > 0 > road.slope[centre + 6]
    assert 0 < road.height[centre] < 0.005


def test_the_curvature_of_a_sine_is_that_of_its_slope():
    wave, amplitude = 2.0, 0.01  # [m] long against the cams: they follow it
    s = np.arange(600) * 0.01
    k = 2 * np.pi / wave
    road = effective_road(make_profile(s, amplitude * np.sin(k * s)), tyre=CAMS)
    inner = (s > 1) & (s < 5)
    expected = -amplitude * k**2 * np.sin(k * s)
    # a slope over 0.11 m is sinc(0.055 m / wave length) = 0.995 of that at a point, and that taken
    # between points 10 mm apart 0.9998; on slopes of 3 % the cams stand 0.02 mm higher
    assert_allclose(road.curvature[inner], expected[inner], rtol=0, atol=0.01 * amplitude * k**2)


def test_the_contact_patches_of_typical_tyres():
    """By hand from the factors of the files: 2 R (Q_RA1 sqrt(d/R) + Q_RA2 d/R)."""
    assert_allclose(PASSENGER_TYRE.deflection, 0.01908, rtol=0, atol=1e-5)
    assert_allclose(PASSENGER_TYRE.contact_length, 0.1318, rtol=0, atol=1e-4)
    assert_allclose(PASSENGER_TYRE.contact_width, 0.1412, rtol=0, atol=2e-4)
    assert_allclose(TRUCK_TYRE.contact_length, 0.2085, rtol=0, atol=1e-4)
    assert_allclose(TRUCK_TYRE.contact_width, 0.2136, rtol=0, atol=2e-4)
    assert named_tyre("passenger") is PASSENGER_TYRE
    for kind in (RigidDisc, TandemCams):
        for tyre in (PASSENGER_TYRE, TRUCK_TYRE):
            assert kind.of(tyre).width == tyre.contact_width


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        (RigidDisc, {"radius": 0.0}, "radius must be greater than 0 m"),
        (RigidDisc, {"width": -0.1}, "width must be at least 0 m"),
        (RigidDisc, {"lines": 0}, "lines must be a whole number of at least 1"),
        (RigidDisc, {"lines": 2.5}, "lines must be a whole number of at least 1"),
        (TandemCams, {"order": 1.0}, "order must be greater than 1"),
        (TandemCams, {"spacing": 0.0}, "spacing must be greater than 0 m"),
        (TandemCams, {"across": 1}, "across and along must be at least 2"),
        (TandemCams, {"half_height": float("nan")}, "half_height must be greater than 0 m"),
    ],
)
def test_impossible_tyres_are_refused(kind, given, says):
    with pytest.raises(ValueError, match=says):
        kind(**given)


def test_an_unknown_tyre_is_refused():
    with pytest.raises(ValueError, match="tyre must be one of passenger, truck, got 'bicycle'"):
        named_tyre("bicycle")
