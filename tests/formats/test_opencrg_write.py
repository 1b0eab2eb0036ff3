"""Writing OpenCRG: round trips, refused surfaces, no partial files."""

import json

import numpy as np
import numpy.testing as npt
import pycrg
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trueterrain.core.errors import OutputError
from trueterrain.core.provenance import add_step, provenance_steps
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.formats import opencrg

FORMATS = ["KRBI", "KDBI", "LRFI", "LDFI"]
# [m] rounding of heights of up to 0.5 m above the reference line: float32, and 9 characters
HEIGHT = {"KRBI": 3e-8, "KDBI": 1e-12, "LRFI": 6e-8, "LDFI": 1e-12}
PLACE = {"rtol": 0, "atol": 1e-5}  # [m] headings are rounded to 1e-7 rad over 100 m
EXACT = {"rtol": 0, "atol": 1e-12}  # [m] round-off
PLANE = {"rtol": 0, "atol": 1e-9}  # [m] round-off of a sparse solution of some hundred unknowns


def curved_road(n=201, *, banked=True, sloped=True, offset=0.0, v=None, **optional):
    u = 12.5 + 0.5 * np.arange(n)
    v = np.array([-2.0, -1.25, 0.0, 0.5, 1.5]) if v is None else np.asarray(v, float)
    heading = 2.5 + 0.9 * np.sin(0.05 * (np.arange(n - 1)))
    easting = 691_234.5 + 0.5 * np.concatenate([[0], np.cumsum(np.cos(heading))])
    northing = 5_334_567.25 + 0.5 * np.concatenate([[0], np.cumsum(np.sin(heading))])
    line = {}
    elevation = offset + (0.02 * u + np.sin(0.1 * u) if sloped else np.zeros(n))
    if banked:
        line["banking"] = 0.04 * np.sin(0.03 * u)
    height = elevation[:, None] + 0.2 * np.sin(3 * u)[:, None] * np.cos(2 * v)
    if banked:
        height = height + line["banking"][:, None] * v
    return make_surface(
        height,
        u=u,
        v=v,
        easting=easting,
        northing=northing,
        elevation=elevation,
        crs="EPSG:25832",
        **line,
        **optional,
    )


def straight_road(height, v=None, du=0.5):
    nu, nv = np.shape(height)
    u = du * np.arange(nu)
    v = 0.25 * np.arange(nv) if v is None else v
    return make_surface(height, u=u, v=v, easting=u, northing=np.zeros(nu))


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("banked", [False, True])
@pytest.mark.parametrize("sloped", [False, True])
@pytest.mark.parametrize("v", [None, np.arange(-2, 2.01, 0.25)])
def test_round_trip(tmp_path, fmt, banked, sloped, v):
    road = curved_road(banked=banked, sloped=sloped, v=v, offset=421.75)
    path = tmp_path / "road.crg"
    written = check_surface(opencrg.write(road, path, fmt=fmt))
    again = opencrg.read(path)
    for found in (written, again):
        npt.assert_allclose(found.height, road.height, rtol=0, atol=HEIGHT[fmt])
        npt.assert_array_equal(found.u, road.u)
        npt.assert_array_equal(found.v, road.v)
        npt.assert_allclose(found.easting, road.easting, **PLACE)
        npt.assert_allclose(found.northing, road.northing, **PLACE)
        npt.assert_allclose(found.elevation, road.elevation, rtol=0, atol=1e-4)
        assert ("banking" in found) == banked
        assert found.attrs["crs"] == "EPSG:25832"
    npt.assert_array_equal(written.height, road.height)


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("largest", [1e-12, 1e-5, 9e-4, 0.002, 0.02, 0.2, 0.9, 20.0, 3000.0])
def test_heights_of_any_size_are_written(tmp_path, fmt, largest):
    """Heights above a level line: of both signs, from zero to a mountain."""
    height = largest * np.random.default_rng(1).uniform(-1, 1, (5, 7))
    height -= np.median(height)
    opencrg.write(straight_road(height), tmp_path / "road.crg", fmt=fmt)
    rounding = HEIGHT[fmt] * max(1, 10 * largest)  # digits are lost in proportion
    npt.assert_allclose(opencrg.read(tmp_path / "road.crg").height, height, rtol=0, atol=rounding)


def test_the_c_api_finds_the_road_at_its_position(tmp_path):
    """Evaluated beside the reference line, where a lost edge or banking shows."""
    road = curved_road(offset=421.75)
    path = tmp_path / "road.crg"
    opencrg.write(road, path)
    rng = np.random.default_rng(4)
    i, j = rng.integers(0, road.sizes["u"] - 1, 500), rng.integers(0, road.sizes["v"] - 1, 500)
    a, b = rng.uniform(size=(2, 500))
    h = road.height.values
    truth = (1 - a) * ((1 - b) * h[i, j] + b * h[i, j + 1])
    truth += a * ((1 - b) * h[i + 1, j] + b * h[i + 1, j + 1])
    u = (1 - a) * road.u.values[i] + a * road.u.values[i + 1]
    v = (1 - b) * road.v.values[j] + b * road.v.values[j + 1]
    # modifiers applied, as most programs do: the empty block must keep the road in its place
    with pycrg.RoadSurface.open(path, apply_modifiers=True) as crg:
        npt.assert_allclose(crg.uv_to_z_many(u, v), truth, rtol=0, atol=1e-6)
        x, y = crg.uv_to_xy_many(road.u.values, np.zeros(road.sizes["u"]))
        assert crg.header.modifiers == {}
        for key in ("start_u", "end_u", "increment", "start_x", "end_x", "end_y"):
            assert f"reference_line_{key}" in crg.header.road
        assert {"long_section_v_right", "long_section_v_left"} <= set(crg.header.road)
    npt.assert_allclose([x, y], [road.easting, road.northing], **PLACE)
    assert opencrg.describe(path)["problems"] == []


def test_the_data_fill_whole_records(tmp_path):
    path = tmp_path / "road.crg"
    opencrg.write(curved_road(), path)
    content = path.read_bytes()
    at = content.index(b"\n", content.index(b"$$$$")) + 1
    assert (len(content) - at) % 80 == 0


def test_a_long_straight_does_not_drift(tmp_path):
    n, heading = 40_001, 0.7  # 20 km, where a rounded heading would lead 1 mm astray
    u = 0.5 * np.arange(n)
    line = {"easting": u * np.cos(heading), "northing": u * np.sin(heading)}
    road = make_surface(np.zeros((n, 2)), u=u, v=[-1, 1], **line)
    written = opencrg.write(road, tmp_path / "road.crg")
    npt.assert_allclose(written.easting, road.easting, rtol=0, atol=1e-6)
    npt.assert_allclose(written.northing, road.northing, rtol=0, atol=1e-6)


def test_every_sample_can_be_written(data, tmp_path):
    for name in ("belgian_block", "crg-txt/handmade_curved_banked_sloped", "crg-txt/handmade_arc"):
        road = opencrg.read(data / f"opencrg/asam/{name}.crg")
        written = opencrg.write(road, tmp_path / "again.crg", force=True)
        npt.assert_array_equal(np.isnan(written.height), np.isnan(road.height))
        npt.assert_allclose(written.height, road.height, rtol=0, atol=1e-7)


def test_options_beyond_the_grid_are_kept(data, tmp_path):
    road = opencrg.read(data / "opencrg/chrono/Barber.crg")
    opencrg.write(road, tmp_path / "again.crg")
    assert opencrg.describe(tmp_path / "again.crg")["options"] == {"refline_continuation": 1.0}


def test_provenance_and_crs_are_kept(tmp_path):
    wkt = 'LOCAL_CS["a grid with a long name",UNIT["metre",1]]' + " " * 3 + "AXIS" * 40
    road = add_step(curved_road(), "merge", parameters={"text": "a, b  c" * 20})
    road = road.assign_attrs(crs=" ".join(wkt.split()))
    opencrg.write(road, tmp_path / "road.crg", comment=["$ first", "second " * 30, "Straße"])
    again = opencrg.read(tmp_path / "road.crg")
    assert again.attrs["crs"] == " ".join(wkt.split())
    assert [step["step"] for step in provenance_steps(again)] == ["merge", "read"]
    assert provenance_steps(again)[0]["parameters"]["text"] == " ".join(("a, b  c" * 20).split())
    comment = opencrg.describe(tmp_path / "road.crg")["comment"]
    assert "Stra?e" in comment
    assert max(map(len, comment.splitlines())) <= 72


def test_variables_that_the_file_cannot_hold_are_returned(tmp_path):
    road = curved_road(sd=np.full((201, 5), 0.001), count=np.full((201, 5), 7))
    written = opencrg.write(road, tmp_path / "road.crg")
    npt.assert_array_equal(written.sd, 0.001)
    npt.assert_array_equal(written["count"], 7)
    assert not written.filled.any()
    assert written.attrs["filled"] == 0
    assert [step["step"] for step in json.loads(written.attrs["provenance"])] == ["write"]


def test_a_map_becomes_a_straight_road(tmp_path):
    easting = 691_234.567 + 0.5 * np.arange(20)
    northing = 5_334_567.25 + 0.25 * np.arange(9)
    height = 300 + 0.1 * np.sin(easting) * np.cos(northing)[:, None]
    height[3, 5] = np.nan
    sd = np.full(height.shape, 0.002)
    surface = make_surface(height, easting=easting, northing=northing, sd=sd, crs="EPSG:25832")
    written = opencrg.write(surface, tmp_path / "map.crg")
    npt.assert_allclose(written.easting, easting, rtol=0, atol=1e-8)
    place = written.northing.values[:, None] + written.v.values
    npt.assert_allclose(place, np.broadcast_to(northing, place.shape), rtol=0, atol=1e-8)
    known = np.isfinite(height.T)
    npt.assert_allclose(written.height.values[known], height.T[known], rtol=0, atol=HEIGHT["KRBI"])
    assert written.attrs["filled"] == 1
    assert written.filled.values[5, 3]
    assert np.isnan(written.sd.values[5, 3])


@given(st.integers(0, 10_000), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_holes_in_a_plane_are_filled_exactly(seed, along, across):
    rng = np.random.default_rng(seed)
    v = np.cumsum(rng.uniform(0.1, 0.5, 12))
    u = 0.5 * np.arange(15)
    plane = 3 + along * u[:, None] + across * v
    height = np.where(rng.uniform(size=plane.shape) < 0.4, np.nan, plane)
    height[5:9, 3:8] = np.nan
    road = straight_road(height, v=v)
    filled = opencrg.fill_interior(road)
    valid = np.isfinite(height)
    for row in range(u.size):
        at = np.flatnonzero(valid[row])
        inside = slice(at[0], at[-1] + 1) if at.size else slice(0)
        expected = np.full(v.size, np.nan)
        expected[inside] = plane[row, inside]
        npt.assert_allclose(filled.height.values[row], expected, **PLANE)
    assert filled.attrs["filled"] == int(filled.filled.sum())
    npt.assert_array_equal(filled.height.values[valid], height[valid])


def test_filled_holes_have_no_new_extremes():
    rng = np.random.default_rng(6)
    height = rng.normal(size=(40, 30))
    height[10:30, 5:25] = np.nan
    filled = opencrg.fill_interior(straight_road(height))
    inside = filled.height.values[10:30, 5:25]
    assert np.nanmin(height) <= inside.min()
    assert inside.max() <= np.nanmax(height)


def test_fill_interior_refuses_maps():
    with pytest.raises(ValueError, match="got a map"):
        opencrg.fill_interior(make_surface(np.zeros((2, 2)), easting=[0, 1], northing=[0, 1]))


def test_writing_fills_holes_but_not_edges(tmp_path):
    height = np.tile(np.arange(6.0), (5, 1)) / 10
    height[2, 2:4] = np.nan
    height[1, 0] = height[3, 4:] = np.nan
    written = opencrg.write(straight_road(height), tmp_path / "road.crg")
    assert written.attrs["filled"] == 2
    assert written.filled.values.sum() == 2
    npt.assert_allclose(written.height.values[2, 2:4], [0.2, 0.3], rtol=0, atol=1e-7)
    npt.assert_array_equal(np.isnan(written.height.values).sum(axis=1), [0, 1, 0, 2, 0])


def bent(angle):
    """Chords of 0.5 m that turn by an angle each, under a road 4 m wide."""
    heading = np.deg2rad(angle) * np.arange(10)
    easting = 0.5 * np.concatenate([[0], np.cumsum(np.cos(heading))])
    northing = 0.5 * np.concatenate([[0], np.cumsum(np.sin(heading))])
    return make_surface(
        np.zeros((11, 3)), u=0.5 * np.arange(11), v=[-2, 0, 2], easting=easting, northing=northing
    )


def changed(**values):
    road = straight_road(np.zeros((6, 4)))
    for name, value in values.items():
        if name in road.coords:
            road = road.assign_coords({name: (name, value, road[name].attrs)})
        else:
            road[name] = road[name].copy(data=value)
    return road


GAP = np.zeros((6, 4))
GAP[2] = np.nan
WILD = np.zeros((6, 4))
WILD[1, 2] = 1e30
UNEVEN = 0.5 * np.arange(6) + [0, 0, 0.002, 0, 0, 0]


@pytest.mark.parametrize(
    ("road", "match"),
    [
        (straight_road(np.zeros((4, 3)), du=0.0137), "axis u: the spacing .* got 0.0137 m.*14 mm"),
        (straight_road(np.zeros((4, 3)), du=0.0001), "axis u: .*with a spacing of 1 mm"),
        (changed(u=0.5 * np.arange(6) + 0.0004), "axis u, node 0: must start at"),
        (changed(u=UNEVEN), "axis u, node 2: .*1.002"),
        (changed(v=[0, 0.25, 0.5004, 0.75]), "axis v, node 2: must be a multiple of 1 mm"),
        (changed(v=[0, 0.25, 0.25005, 0.75]), "axis v, node 1: nodes must be at least 1 mm"),
        (changed(easting=UNEVEN), "nodes 1 and 2: all chords .*0.502.*Resample"),
        (changed(height=GAP), "cross-section 2: each cross-section .*u = 1.000 m.*fill the gap"),
        (changed(height=WILD), r"node \(1, 2\): must be at most"),
        (changed(elevation=np.arange(6.0)), "slope must be at most 1 m/m, got 2"),
        (bent(20), "u = .*radius must be greater .*Smooth"),
    ],
)
def test_broken_rules(tmp_path, road, match):
    path = tmp_path / "road.crg"
    with pytest.raises(OutputError, match=match) as caught:
        opencrg.write(road, path)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    assert caught.value.cure
    assert list(tmp_path.iterdir()) == []


def test_small_deviations_are_rounded(tmp_path):
    u = 0.5 * np.arange(6) + 0.00004
    v = np.array([0.00003, 0.25, 0.5, 0.75])
    written = opencrg.write(changed(u=u, v=v), tmp_path / "road.crg")
    npt.assert_array_equal(written.u, 0.5 * np.arange(6))
    npt.assert_array_equal(written.v, [0, 0.25, 0.5, 0.75])


def test_chords_with_accumulating_errors_are_refused(tmp_path):
    """Each chord is within its tolerance, but the end would be off by 45 mm."""
    u = 0.5 * np.arange(1001)
    heading = 0.3 * np.sin(0.01 * np.arange(1000))
    step = 0.500045
    road = make_surface(
        np.zeros((1001, 2)),
        u=u,
        v=[-1, 1],
        easting=np.concatenate([[0], np.cumsum(step * np.cos(heading))]),
        northing=np.concatenate([[0], np.cumsum(step * np.sin(heading))]),
    )
    with pytest.raises(OutputError, match="end"):
        opencrg.write(road, tmp_path / "road.crg")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_replaced_without_force(tmp_path):
    path = tmp_path / "road.crg"
    path.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        opencrg.write(curved_road(), path)
    assert path.read_text() == "mine"
    with pytest.raises(OutputError, match="chords"):
        opencrg.write(changed(easting=UNEVEN), path, force=True)
    assert path.read_text() == "mine"
    opencrg.write(curved_road(), path, force=True)
    assert opencrg.read(path).sizes["u"] == 201


def test_unknown_format(tmp_path):
    with pytest.raises(ValueError, match="fmt must be one of KRBI, KDBI, LRFI, LDFI, got 'XYZ'"):
        opencrg.write(curved_road(), tmp_path / "road.crg", fmt="xyz")
