"""Grounds that one formula describes, against that formula written out."""

import numpy as np
import numpy.testing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trueterrain.simulate.ground import Cleats, Ground, Plane, Sine, Step, Sum

EXACT = {"rtol": 0, "atol": 1e-12}  # [m] round-off only: the truth has no noise

slopes = st.floats(-0.3, 0.3)
coordinates = st.floats(-1000.0, 1000.0)


@given(slopes, slopes, coordinates, coordinates)
def test_plane_rises_by_its_slopes(slope, camber, x, y):
    plane = Plane(elevation=2.0, slope=slope, camber=camber)
    npt.assert_allclose(plane.height(x, y), 2.0 + slope * x + camber * y, **EXACT)


def test_heights_have_the_common_shape_and_are_float64():
    height = Plane(slope=1.0).height(np.arange(3)[:, None], np.arange(4, dtype=np.float32))
    assert height.shape == (3, 4)
    assert height.dtype == np.float64
    assert Plane().height(1, 2).shape == ()
    assert Plane().height([], []).shape == (0,)


@pytest.mark.parametrize("ground", [Plane(elevation=1.0), Step(), Sine(amplitude=1, wavelength=1)])
def test_no_height_where_a_coordinate_is_not_finite(ground):
    height = ground.height([0.0, np.nan, np.inf, 1.0], [0.0, 0.0, 0.0, -np.inf])
    assert np.isfinite(height).tolist() == [True, False, False, False]


def test_sine_has_its_values_at_quarters_of_the_wavelength():
    sine = Sine(amplitude=0.02, wavelength=4.0)
    npt.assert_allclose(
        sine.height([0, 1, 2, 3, 4, -1], 7.0), [0, 0.02, 0, -0.02, 0, -0.02], **EXACT
    )
    shifted = Sine(amplitude=0.02, wavelength=4.0, phase=np.pi / 2)
    npt.assert_allclose(shifted.height([0, 1, 2], 0.0), [0.02, 0, -0.02], **EXACT)


def test_sine_runs_in_its_direction():
    sine = Sine(amplitude=1.0, wavelength=4.0, direction=np.pi / 2)
    npt.assert_allclose(sine.height(3.3, [0.0, 1.0, 3.0]), [0, 1, -1], **EXACT)


def test_step_rises_over_its_width():
    step = Step(position=2.0, rise=0.12, width=0.04)
    npt.assert_allclose(
        step.height([1.0, 2.0, 2.01, 2.04, 9.0], 0.0), [0, 0, 0.03, 0.12, 0.12], **EXACT
    )


def test_step_without_width_is_a_vertical_face():
    step = Step(position=2.0, rise=-0.1)
    before = np.nextafter(2.0, 0.0)
    npt.assert_allclose(step.height([before, 2.0], 0.0), [0.0, -0.1], **EXACT)


def test_step_is_climbed_in_its_direction():
    step = Step(position=-1.0, rise=0.1, direction=np.pi)
    npt.assert_allclose(step.height([2.0, 0.5, -3.0], 0.0), [0.0, 0.1, 0.1], **EXACT)


def test_cleats_end_at_their_edges_and_are_as_many_as_asked_for():
    cleats = Cleats(first=1.0, spacing=0.5, number=3, width=0.25, rise=0.02)
    edges = np.array([0.875, 1.125, 1.375, 1.625, 1.875, 2.125])
    outside = np.where(np.arange(6) % 2 == 0, edges - 1e-9, edges + 1e-9)
    npt.assert_allclose(cleats.height(edges, 0.0), 0.02, **EXACT)
    npt.assert_allclose(cleats.height(outside, 0.0), 0.0, **EXACT)
    npt.assert_allclose(cleats.height([0.5, 2.5, -100.0, 100.0], 0.0), 0.0, **EXACT)


@pytest.mark.parametrize(
    ("shape", "at_half", "area"),
    [("rectangle", 1.0, 1.0), ("triangle", 0.5, 0.5), ("semicircle", np.sqrt(0.75), np.pi / 4)],
)
def test_cleats_have_the_section_asked_for(shape, at_half, area):
    cleat = Cleats(first=0.0, width=0.04, rise=0.02, shape=shape)
    npt.assert_allclose(
        cleat.height([0.0, 0.01, -0.01], 5.0), [0.02, *[0.02 * at_half] * 2], **EXACT
    )
    middles = (np.arange(100_000) + 0.5) * 1e-6 - 0.05  # midpoint rule on 0.1 m
    mean = cleat.height(middles, 0.0).mean() * 0.1
    npt.assert_allclose(mean, area * 0.04 * 0.02, rtol=0, atol=1e-8)  # [m^2] of the midpoint rule


def test_grounds_add_up_in_any_number():
    a, b, c = Plane(elevation=1.0), Step(position=0.0, rise=0.1), Plane(slope=0.5)
    total = a + b + c
    assert isinstance(total, Sum)
    assert total.parts == (a, b, c)
    assert (a + (b + c)).parts == total.parts
    npt.assert_allclose(total.height([-2.0, 2.0], 0.0), [0.0, 2.1], **EXACT)


def test_a_ground_does_not_add_to_a_number():
    with pytest.raises(TypeError):
        Plane() + 1.0


def test_grounds_are_values():
    assert Plane(slope=0.1) == Plane(slope=0.1)
    assert isinstance(Plane(), Ground)
    with pytest.raises(AttributeError):
        Plane().slope = 0.2


@pytest.mark.parametrize(
    ("kind", "parameters"),
    [
        (Plane, {"slope": np.nan}),
        (Sine, {"amplitude": 1.0, "wavelength": 0.0}),
        (Sine, {"amplitude": np.inf, "wavelength": 1.0}),
        (Step, {"width": -0.1}),
        (Step, {"position": np.nan}),
        (Cleats, {"number": 0}),
        (Cleats, {"number": 1.5}),
        (Cleats, {"number": 2, "spacing": 0.01}),
        (Cleats, {"width": -1.0}),
        (Cleats, {"shape": "circle"}),
        (Sum, {"parts": ()}),
    ],
)
def test_bad_parameters_are_refused(kind, parameters):
    with pytest.raises(ValueError, match="must"):
        kind(**parameters)
