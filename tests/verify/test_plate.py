"""Calibration plates: profile, masses, and what a scanner sees, beside the virtual scanner."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import trueterrain
from trueterrain.core.errors import OutputError
from trueterrain.formats.run import Mounting
from trueterrain.simulate.body import Parked
from trueterrain.simulate.ground import Cleats, Ground, Step, Sum
from trueterrain.simulate.scanner import Scanner, ScannerStream
from trueterrain.simulate.scene._plate import CalibrationPlate
from trueterrain.verify.plate.design import (
    PlateCleat,
    PlateDesign,
    ScanSetup,
    cleat_flanks,
    design_plate,
    machined_profile,
    view_plate,
    write_machined,
)

EXACT = 1e-9  # [m] rounding alone
POLYGON = 5e-6  # [m] along beams that glance off arcs, whose chords are within a micrometre
WRITTEN = 1e-7  # [m] last digit in the file


def ground_of(plate, offset):
    """The plate as ground of the virtual profiler, its profile along y, centre at `offset`."""
    parts: list[Ground] = [
        Step(position=offset - plate.length / 2, rise=plate.thickness, direction=np.pi / 2),
        Step(position=offset + plate.length / 2, rise=-plate.thickness, direction=np.pi / 2),
    ]
    parts += [
        Cleats(
            first=offset - plate.length / 2 + plate.foot(cleat) + cleat.width / 2,
            width=cleat.width,
            rise=cleat.rise,
            direction=np.pi / 2,
            shape="rectangle" if cleat.shape == "edge" else cleat.shape,
        )
        for cleat in plate.cleats
    ]
    return Sum(parts=tuple(parts))


def scanned(plate, offset, scanner):
    """Offsets across the lane and heights that the virtual scanner finds, without noise."""
    still = Parked(up=2.0).knots(0.0, 0.01)
    ground = ground_of(plate, offset)
    scans = ScannerStream(scanner, Mounting(), ground, seed=1).record(still, 0.0, 0.001)
    distance = scans.true_range[0]
    return distance * np.sin(scanner.angle), 2.0 - distance * np.cos(scanner.angle)


POINTS = Scanner(
    range_noise=0.0, quantum=0.0, spot_rays=1, dropouts=0.0, intensity_noise=0.0, duty=1e-9
)

# --- profile


@pytest.mark.parametrize(
    "shapes", [("rectangle", "semicircle", "triangle"), ("triangle", "semicircle"), ("semicircle",)]
)
def test_profile_is_that_of_the_plate_of_the_virtual_profiler(shapes):
    plate = design_plate(shapes)
    s = np.linspace(0.001, 1.199, 6001)
    true = CalibrationPlate(east=0.6, cleats=shapes).height(s, 0.0)
    found = np.interp(s, *plate.vertices())
    # next to the foot of an arc, a micrometre aside is much more upwards
    feet = np.array([[plate.foot(c), plate.foot(c) + c.width] for c in plate.cleats]).ravel()
    clear = np.abs(s[:, None] - feet).min(axis=1) > 2e-4
    assert_allclose(found[clear], true[clear], rtol=0, atol=3e-5)
    assert np.median(np.abs(found - true)) < EXACT


def test_arcs_depart_from_their_chords_by_a_micrometre():
    s, height = PlateCleat(shape="semicircle").outline()
    middle = np.hypot(0.5 * (s[1:] + s[:-1]) - 0.038, 0.5 * (height[1:] + height[:-1]))
    assert (0.038 - middle).max() < 1.1e-6
    assert_allclose(np.trapezoid(height, s), PlateCleat(shape="semicircle").area, rtol=1e-4)


@pytest.mark.parametrize("shape", ["rectangle", "triangle", "edge"])
def test_areas_are_those_of_the_outlines(shape):
    cleat = PlateCleat(shape=shape)
    s, height = cleat.outline()
    assert_allclose(np.trapezoid(height, s), cleat.area, rtol=0, atol=1e-6 * 0.04)


def test_edges_of_15_mm():
    plate = PlateDesign()
    profile = machined_profile(plate)
    edge = plate.cleats[-1]
    inside = profile.sel(s=slice(plate.foot(edge) + 1e-5, plate.foot(edge) + edge.width - 1e-5))
    at = np.interp(plate.foot(edge) + 0.03, profile.s, profile.height)
    assert edge.shape == "edge"
    assert_allclose(inside.height, plate.thickness + 0.015, rtol=0, atol=EXACT)
    assert_allclose(at - plate.thickness, 0.015, rtol=0, atol=EXACT)


def test_masses_by_hand():
    plate = design_plate(["rectangle"], length=1.0, width=0.5, thickness=0.01)
    holes = 7 * 3 * math.pi / 4 * 0.01**2
    assert [rows.size for rows in plate.holes()] == [7, 3]
    whole = 0.01 * (1.0 * 0.5 - holes) + 0.076 * 0.038 * 0.5
    assert_allclose(plate.mass("aluminium"), 2700 * whole, rtol=1e-12)
    assert_allclose(plate.mass("steel"), 7850 * whole, rtol=1e-12)
    assert plate.panels("steel", 25.0) == math.ceil(plate.mass_of_plate("steel") / 25.0) == 2


def test_file_is_read_as_the_profile(tmp_path):
    plate = PlateDesign()
    write_machined(plate, tmp_path / "plate.csv")
    read = trueterrain.open(tmp_path / "plate.csv")
    true = machined_profile(plate)
    assert_allclose(
        np.interp(plate.vertices()[0], true.s, true.height), plate.vertices()[1], rtol=0, atol=EXACT
    )
    for name in ("s", "height", "sd"):
        assert_allclose(read[name], true[name], rtol=0, atol=WRITTEN)
    assert trueterrain.info(tmp_path / "plate.csv")["problems"] == []
    assert "tolerance of s and height: +- 0.0001 m" in (tmp_path / "plate.csv").read_text()
    with pytest.raises(OutputError, match="exists"):
        write_machined(plate, tmp_path / "plate.csv")
    write_machined(plate, tmp_path / "plate.csv", force=True)


# --- what a scanner sees


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 0.7, -1.1])
def test_returns_are_those_of_the_virtual_scanner(offset):
    plate = PlateDesign()
    view = view_plate(plate, ScanSetup(angle=POINTS.angle, offset=offset))
    y, z = scanned(plate, offset, POINTS)
    on_plate = np.abs(y - offset) < 0.6
    s = y[on_plate] - offset + 0.6
    assert abs(view.s.size - s.size) <= 2  # faces of the plate itself
    apart = np.hypot(view.s[:, None] - s[None, :], view.height[:, None] - z[on_plate][None, :]).min(
        axis=1
    )
    assert np.sort(apart)[-4] < POLYGON


@pytest.mark.parametrize("offset", [0.7, -1.1])
def test_no_return_comes_from_a_shadow(offset):
    plate = PlateDesign()
    view = view_plate(plate, ScanSetup(offset=offset))
    y, z = scanned(plate, offset, POINTS)
    s = y - offset + 0.6
    for begin, end in view.shadows:
        inside = (s > begin + 2e-4) & (s < end - 2e-4)
        level = z < np.interp(s, *plate.vertices()) + 1e-4
        assert not (inside & level).any()
    assert view.shadows


def test_shadow_of_a_rectangle_by_similar_triangles():
    plate = design_plate(["rectangle"])
    view = view_plate(plate, ScanSetup(offset=1.0, height=2.0))
    ((begin, end),) = view.shadows
    y = 1.038  # far edge of the cleat, 0.05 m above the ground on a plate of 0.012 m
    assert_allclose(begin, 0.6 + 0.038, rtol=0, atol=2e-4)
    assert_allclose(end - begin, 0.038 * y / (2.0 - 0.05), rtol=0, atol=2e-4)


@pytest.mark.slow
def test_slope_limits_are_those_of_the_virtual_scanner():
    """Triangles of different steepness, beside the angle of the beam: Figs. 3-13 and 3-14."""
    for offset in (0.5, 1.2):
        limit = math.atan2(2.0 - 0.012, offset + 0.02)
        for steeper in (-0.05, 0.05):
            rise = 0.02 * math.tan(limit + steeper)
            plate = design_plate(["triangle"], cleat_width=0.04, rise=rise)
            dense = Scanner(
                beams=9400, range_noise=0.0, quantum=0.0, spot_rays=1, dropouts=0.0, duty=1e-9
            )
            view = view_plate(plate, ScanSetup(angle=dense.angle, offset=offset))
            y, z = scanned(plate, offset, dense)
            on_far_face = (y > offset + 1e-3) & (y < offset + 0.019) & (z > 0.0125)
            assert on_far_face.any() == (steeper < 0)
            assert bool(view.shadows) == (steeper > 0)
            far = cleat_flanks(plate)[1]
            if far.slope >= math.radians(60):
                (edge,) = (edge for edge in view.edges if edge.name == far.name)
                assert edge.seen == (steeper < 0)
                assert_allclose(edge.limit, limit, rtol=0, atol=0.01)


def test_points_on_a_face_that_rises_to_the_scanner():
    """A beam meets it at each step of the tangent: rise / h times y over the step."""
    plate = design_plate(["rectangle"])
    view = view_plate(plate, ScanSetup(offset=1.5))
    near, far = view.edges
    assert (near.seen, far.seen, far.on_face) == (True, False, 0)
    y = 1.5 - 0.038
    step = math.pi / 2 / 939
    span = math.atan2(y, 2.0 - 0.05) - math.atan2(y, 2.0 - 0.012)
    assert abs(near.on_face - span / step) <= 1
    assert near.limit == math.pi


def test_along_the_lane_edges_are_blurred_and_nothing_is_in_shadow():
    view = view_plate(PlateDesign(), ScanSetup(lie="along the lane", speed=5.4))
    assert view.shadows == ()
    assert_allclose(np.diff(view.s), 0.0054, rtol=0, atol=EXACT)
    assert_allclose(view.edges[0].blurred, 0.010 / 0.0054, rtol=0, atol=EXACT)
    assert not view.edges[0].seen  # an upright face has no return from above


def test_brightness_by_surface():
    view = view_plate(PlateDesign())
    assert [band.brightness for band in view.bands] == ["clear", "clear", "saturated"]
    assert_allclose(view.bands[1].intensity, 9000 * (2 / 1.988) ** 2, rtol=1e-12)
    dark = view_plate(PlateDesign(bands=(("soot", 0.01),)), ScanSetup(offset=1.0))
    assert dark.bands[0].brightness == "lost"
    assert any("Returns from soot are lost" in flag for flag in dark.flags)


def test_flags_of_a_plate_at_the_rim_of_the_swath():
    view = view_plate(PlateDesign(), ScanSetup(offset=1.8))
    assert any("of its 1.20 m only" in flag for flag in view.flags)
    assert any("lie in shadow" in flag for flag in view.flags)
    coarse = view_plate(PlateDesign(), ScanSetup(angle=np.linspace(-0.7, 0.7, 120)))
    assert any("fewer than five points" in flag for flag in coarse.flags)


def test_beams_from_left_to_right_see_the_same():
    angle = np.linspace(-0.7, 0.7, 200)
    one, other = (view_plate(PlateDesign(), ScanSetup(angle=a)) for a in (angle, angle[::-1]))
    assert_allclose(one.s, other.s, rtol=0, atol=EXACT)


# --- what is refused


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PlateCleat(shape="ellipse"), "shape must be one of rectangle, semicircle"),
        (lambda: PlateCleat(shape="edge", rise=0.0), "width and rise must be greater than 0 m"),
        (lambda: PlateDesign(thickness=math.inf), "thickness must be greater than 0 m"),
        (lambda: PlateDesign(cleats=()), "cleats and bands must each hold"),
        (lambda: PlateDesign(bands=(("white", 1.2),)), "reflectivity of white must be from 0 to 1"),
        (lambda: design_plate(length=0.8), "begins 94 mm before the end of the rim"),
        (lambda: design_plate(cleat_width=0.4), "cleats must lie in order"),
        (
            lambda: PlateDesign(cleats=(PlateCleat(shape="edge", hole=3),), length=0.95),
            "19 mm more, got 0.95 m",
        ),
        (lambda: PlateDesign().mass("wood"), "material must be one of aluminium, steel"),
        (lambda: PlateDesign().panels("steel", 0.0), "carried must be greater than 0 kg"),
        (lambda: ScanSetup(height=-2.0), "height must be finite and greater than 0 m"),
        (lambda: ScanSetup(lie="aslant"), "lie must be one of along the scan, along the lane"),
        (lambda: ScanSetup(angle=[0.1]), "angle must hold two or more"),
        (lambda: ScanSetup(angle=[0.1, 0.0, 0.2]), "angle must ascend or descend"),
        (lambda: ScanSetup(floor=1e6), "floor from 0 to less than saturation"),
        (
            lambda: view_plate(PlateDesign(), ScanSetup(offset=4.0)),
            "offset must put the plate under the beams, which reach from -2.00 m to 2.00 m, got 4",
        ),
    ],
)
def test_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
