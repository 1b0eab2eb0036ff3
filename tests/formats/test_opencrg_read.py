"""OpenCRG files compared with the ASAM C-API, in the coordinates in which they are stored."""

import json

import numpy as np
import numpy.testing as npt
import pycrg
import pytest

from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import check_surface
from trueterrain.formats import opencrg

RECORDED_HEIGHT = {"rtol": 0, "atol": 1e-6}  # [m] the C-API holds heights as float32
RECORDED_PLACE = {"rtol": 0, "atol": 1e-9}  # [m] recorded with 17 digits

HANDMADE = [
    "arc",
    "banked",
    "circle",
    "curved",
    "curved_banked_sloped",
    "curved_minimalist",
    "platform",
    "sloped",
    "sloped_opts",
    "straight",
    "straight_double",
    "straight_minimalist",
    "vtest",
]
CHRONO = [
    "opencrg/chrono/Barber",
    "opencrg/chrono/Horstwalde",
    "motion/chrono/halfround_2in",
    "motion/chrono/halfround_4in",
    *(f"opencrg/chrono/detrended_rms_course_{size}in" for size in ("1", "1p5", "2", "3", "4")),
]
ALL = [f"opencrg/asam/crg-txt/handmade_{name}" for name in HANDMADE] + CHRONO
ALL.append("opencrg/asam/belgian_block")


@pytest.mark.parametrize("name", ALL)
def test_heights_and_coordinates_agree_with_the_c_api(data, name):
    path = data / f"{name}.crg"
    surface = check_surface(opencrg.read(path))
    u, v, height = surface.u.values, surface.v.values, surface.height.values
    shift = -1.5 if name.endswith("straight_minimalist") else 0.0  # see the test of that file
    uu, vv = np.broadcast_arrays(u[:, None], v - shift)
    with pycrg.RoadSurface.open(path, apply_modifiers=False) as road:
        z = road.uv_to_z_many(uu.ravel(), vv.ravel()).reshape(height.shape)
        x, y = road.uv_to_xy_many(u, np.zeros(u.size))
    inner = np.isfinite(z)  # on a node beside missing ones the C-API may have none
    assert (np.isfinite(height) | ~inner).all()
    npt.assert_allclose(height[inner], z[inner], **RECORDED_HEIGHT)
    npt.assert_allclose([surface.easting, surface.northing], [x, y], **RECORDED_PLACE)
    assert np.abs(np.diff(surface.heading)).max() < np.pi
    assert surface.heading[0] == surface.heading[1]


def test_recorded_points_of_belgian_block(data):
    surface = opencrg.read(data / "opencrg/asam/belgian_block.crg")
    recorded = np.genfromtxt(
        data / "opencrg/reference/belgian_block_capi201_nomods.csv", delimiter=",", skip_header=2
    )
    u, v, _, _, z = recorded.T[:5]
    inside = (u >= 730) & (u <= 740) & (np.abs(v) <= 1.7)
    u, v, z = u[inside], v[inside], z[inside]
    # bilinear between the four nodes around each point
    i = np.minimum((u - 730) / 0.01, 999.999999).astype(int)
    j = np.minimum((v + 1.7) / 0.01, 339.999999).astype(int)
    a, b = (u - surface.u.values[i]) / 0.01, (v - surface.v.values[j]) / 0.01
    h = surface.height.values
    ours = (1 - a) * ((1 - b) * h[i, j] + b * h[i, j + 1])
    ours += a * ((1 - b) * h[i + 1, j] + b * h[i + 1, j + 1])
    both = np.isfinite(ours) & np.isfinite(z)
    assert both.sum() >= 1950
    npt.assert_allclose(ours[both], z[both], **RECORDED_HEIGHT)


def test_numbers_of_belgian_block(data):
    found = opencrg.describe(data / "opencrg/asam/belgian_block.crg")
    assert found["format"] == "OpenCRG"
    assert found["kind"] == "surface"
    assert found["number_format"] == "KRBI"
    assert found["size"] == [1001, 341]
    assert found["spacing"] == {"u": 0.01, "v": 0.01}
    assert found["range"] == {"u": [730.0, 740.0], "v": [-1.7, 1.7]}
    npt.assert_allclose(found["extent"]["height"], [2.035, 2.183], rtol=0, atol=5e-4)
    npt.assert_allclose(found["curvature"], [-0.038, -0.029], rtol=0, atol=5e-4)
    assert round(found["missing"], 3) == 0.065
    assert found["modifiers"] is None
    assert any("default modifiers" in problem for problem in found["problems"])
    json.dumps(found)


@pytest.mark.parametrize("name", ALL)
def test_every_sample_can_be_described(data, name):
    found = opencrg.describe(data / f"{name}.crg")
    json.dumps(found, allow_nan=False)
    surface = opencrg.read(data / f"{name}.crg")
    assert found["size"] == [surface.sizes["u"], surface.sizes["v"]]


def test_extent_is_that_of_the_corners(data):
    path = data / "opencrg/asam/belgian_block.crg"
    found = opencrg.describe(path)["extent"]
    u = np.arange(73000, 74001) / 100
    with pycrg.RoadSurface.open(path, apply_modifiers=False) as road:
        x, y = road.uv_to_xy_many(np.tile(u, 2), np.repeat([-1.7, 1.7], u.size))
    npt.assert_allclose(found["easting"], [x.min(), x.max()], rtol=0, atol=1e-6)
    npt.assert_allclose(found["northing"], [y.min(), y.max()], rtol=0, atol=1e-6)


def test_a_numbered_grid_without_edges_is_symmetric(data):
    """The two files state that they are equivalent."""
    folder = data / "opencrg/asam/crg-txt"
    bare = opencrg.read(folder / "handmade_straight_minimalist.crg")
    whole = opencrg.read(folder / "handmade_straight.crg")
    npt.assert_array_equal(bare.v, whole.v)
    npt.assert_array_equal(bare.height, whole.height)
    problems = opencrg.describe(folder / "handmade_straight_minimalist.crg")["problems"]
    assert any("LONG_SECTION_V_RIGHT" in problem for problem in problems)


def test_minimalist_and_commented_curve_are_equal(data):
    folder = data / "opencrg/asam/crg-txt"
    bare = opencrg.read(folder / "handmade_curved_minimalist.crg")
    whole = opencrg.read(folder / "handmade_curved.crg")
    for name in ("u", "v", "height", "easting", "northing", "heading"):
        npt.assert_array_equal(bare[name], whole[name])


def test_double_precision_is_kept(data):
    folder = data / "opencrg/asam/crg-txt"
    height = opencrg.read(folder / "handmade_straight_double.crg").height
    assert height.dtype == np.float64
    assert height.values[2, 3] == 0.0111111  # float32 would give 0.011111099...


def test_banking_is_kept_and_contained_in_the_height(data):
    folder = data / "opencrg/asam/crg-txt"
    banked = opencrg.read(folder / "handmade_curved_banked_sloped.crg")
    npt.assert_allclose(banked.banking.values[2], 0.011, rtol=0, atol=1e-9)
    flat = opencrg.read(folder / "handmade_curved.crg").height.values
    rest = banked.height - banked.elevation - banked.banking * banked.v
    same = np.isfinite(rest.values)
    npt.assert_allclose(rest.values[same], flat[same], rtol=0, atol=1e-9)
    assert "banking" not in opencrg.read(folder / "handmade_curved.crg")


def test_modifiers_are_recorded_but_not_applied(data):
    path = data / "opencrg/chrono/Barber.crg"
    surface = opencrg.read(path)
    assert json.loads(surface.attrs["opencrg_modifiers"])["refpoint_x"] == 10.0
    assert json.loads(surface.attrs["opencrg_options"]) == {"refline_continuation": 1.0}
    found = opencrg.describe(path)
    assert found["modifiers"]["refpoint_x"] == 10.0
    assert any("not applied" in p and "refpoint_x" in p for p in found["problems"])


def test_reading_is_recorded(data):
    surface = opencrg.read(data / "opencrg/asam/crg-txt/handmade_arc.crg")
    (step,) = json.loads(surface.attrs["provenance"])
    assert step["step"] == "read"
    assert step["inputs"][0]["name"] == "handmade_arc.crg"


@pytest.mark.parametrize(
    "name", ["fileref", "fileref_mods", "fileref_opts", "testOptionBorderMode"]
)
def test_a_reference_to_another_file_is_refused(data, name):
    with pytest.raises(FormatError, match=r"refers to .*handmade_.*Name that file itself"):
        opencrg.read(data / f"opencrg/asam/crg-txt/{name}.crg")
