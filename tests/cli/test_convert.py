"""The command convert: formats of one kind, surfaces to points, impossible conversions."""

import json

import laspy
import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain import formats
from trueterrain.core.schemas import make_points, make_profile, make_surface

HALF_STEP = {"rtol": 0, "atol": 0.5e-4 + 1e-9}  # [m] LAS is written in steps of 0.1 mm
ERD_STEP = {"rtol": 0, "atol": 1e-9}  # [m] heights in ERD files
FLOAT32 = {"rtol": 0, "atol": 1e-6}  # [m] heights below 8 m in CRG files


@pytest.fixture
def profile(tmp_path):
    rng = np.random.default_rng(1)
    s = 0.05 * np.arange(200)
    data = make_profile(s, rng.normal(0, 0.01, s.size), easting=s, northing=0 * s)
    formats.write(data, tmp_path / "profile.csv")
    return tmp_path / "profile.csv"


@pytest.fixture
def road(tmp_path):
    u, v = 0.1 * np.arange(41), 0.1 * np.arange(-5, 6)
    height = 2 + 0.01 * u[:, None] + 0.02 * v
    height[:3, 0] = np.nan
    surface = make_surface(height, u=u, v=v, easting=100 + u, northing=200 + 0 * u)
    formats.write(surface, tmp_path / "road.crg")
    return tmp_path / "road.crg"


def refused(finished, *parts):
    assert finished.code == 2
    assert finished.out == ""
    assert finished.err.count("\n") == 1, finished.err
    for part in parts:
        assert str(part) in finished.err, finished.err


@pytest.mark.parametrize("units", ["m", "mm", "ft", "in"])
def test_profile_to_erd_and_back(run, profile, tmp_path, units):
    finished = run("convert", profile, "-o", tmp_path / "p.erd", "--units", units)
    assert finished.code == 0, finished.err
    assert "200 samples from 0 to 9.95 m" in finished.err
    assert "not kept, since the format cannot hold it: easting, northing" in finished.err
    assert run("convert", tmp_path / "p.erd", "-o", tmp_path / "back.csv").code == 0
    before, after = formats.open(profile), formats.open(tmp_path / "back.csv")
    npt.assert_allclose(after.height, before.height, **ERD_STEP)
    npt.assert_allclose(after.s, before.s, **ERD_STEP)


def test_surface_to_points_in_every_format(run, road, tmp_path):
    surface = formats.open(road)
    count = int(np.isfinite(surface.height).sum())
    for ending in ("laz", "las", "csv", "parquet"):
        output = tmp_path / f"p.{ending}"
        finished = run("convert", road, "-o", output, "--crs", "EPSG:25832")
        assert finished.code == 0, finished.err
        assert f"{count:,} points, 3 nodes without height left out" in finished.err
        points = formats.open(output)
        assert points.sizes["point"] == count
        # a straight road along easting: the nodes are where u and v say
        plane = 2 + 0.01 * (points.easting - 100) + 0.02 * (points.northing - 200)
        npt.assert_allclose(points.up, plane, **HALF_STEP)
    assert laspy.read(tmp_path / "p.laz").header.parse_crs().to_epsg() == 25832
    assert (
        "not kept, since the format cannot hold it: CRS"
        in run("convert", road, "-o", tmp_path / "q.csv", "--crs", "EPSG:25832").err
    )


def test_real_road_to_laz(run, data, tmp_path):
    source = data / "opencrg" / "asam" / "belgian_block.crg"
    assert run("convert", source, "-o", tmp_path / "p.laz").code == 0
    surface = formats.open(source)
    witness = laspy.read(tmp_path / "p.laz")
    heights = np.asarray(surface.height)
    assert len(witness.z) == np.isfinite(heights).sum()
    npt.assert_allclose(np.asarray(witness.z), heights[np.isfinite(heights)], **HALF_STEP)


def test_surface_to_surface(run, tmp_path):
    u, v = 0.1 * np.arange(11), 0.1 * np.arange(-2, 3)
    plane = 1 + 0.1 * u[:, None] + 0.2 * v
    formats.write(make_surface(plane, u=u, v=v, easting=u, northing=0 * u), tmp_path / "full.crg")
    finished = run("convert", tmp_path / "full.crg", "-o", tmp_path / "again.crg")
    assert finished.code == 0
    assert finished.err == f"{tmp_path / 'again.crg'}: 11 x 5 nodes\n"
    before, after = formats.open(tmp_path / "full.crg"), formats.open(tmp_path / "again.crg")
    npt.assert_allclose(after.height, before.height, **FLOAT32)


def test_holes_of_a_map_are_filled_in_crg(run, tmp_path):
    pytest.importorskip("rasterio")
    geotiff = pytest.importorskip("trueterrain.formats.geotiff")
    axis = 0.1 * np.arange(8)
    height = 1 + 0.1 * axis[:, None] + 0.2 * axis
    height[3, 4] = np.nan
    geotiff.write(make_surface(height, easting=axis, northing=axis), tmp_path / "map.tif")
    finished = run("convert", tmp_path / "map.tif", "-o", tmp_path / "map.crg")
    assert finished.code == 0, finished.err
    assert "nodes filled between heights, as the format allows no holes: 1" in finished.err


def test_points_to_points(run, data, tmp_path):
    strip = data / "scanning" / "strips" / "las_with_origin_dsmMarker.laz"
    assert "67,826 points" in run("convert", strip, "-o", tmp_path / "p.parquet").err
    assert run("convert", tmp_path / "p.parquet", "-o", tmp_path / "p.laz").code == 0
    before, after = formats.open(strip), formats.open(tmp_path / "p.laz")
    for name in before.data_vars:
        npt.assert_allclose(after[name], before[name], **HALF_STEP)
    assert after.attrs["crs"] == "EPSG:2154"
    assert after.attrs["gps_time_kind"] == "adjusted standard"


def test_crs_of_the_user_makes_a_file_readable(run, data, tmp_path):
    source = data / "scanning" / "georeference" / "leeward" / "points_ecef.las"
    refused(run("convert", source, "-o", tmp_path / "p.laz"), source, "geocentric", "--crs")
    assert run("convert", source, "-o", tmp_path / "p.laz", "--crs", "EPSG:32611").code == 0
    assert formats.open(tmp_path / "p.laz").attrs["crs"] == "EPSG:32611"


def test_scale(run, tmp_path):
    formats.write(make_points([0, 1e6], [0, 0], [0, 0]), tmp_path / "far.csv")
    refused(run("convert", tmp_path / "far.csv", "-o", tmp_path / "p.laz"), "scale")
    assert (
        run("convert", tmp_path / "far.csv", "-o", tmp_path / "p.laz", "--scale", 0.001).code == 0
    )


def test_profile_at_equal_spacing(run, tmp_path):
    """What filters and spectra ask for, if samples are unequally spaced."""
    s = np.sort(np.random.default_rng(5).uniform(0, 50, 2000))
    height = 0.01 * np.sin(s)
    formats.write(make_profile(s, height), tmp_path / "uneven.csv")
    refused(run("psd", tmp_path / "uneven.csv", "--lowest", 0.1), "trueterrain convert --spacing")
    finished = run("convert", tmp_path / "uneven.csv", "-o", tmp_path / "p.erd", "--spacing", 0.05)
    assert finished.code == 0, finished.err
    assert "waves shorter than 0.1 m are aliased into longer ones" in finished.err
    even = formats.open(tmp_path / "p.erd")
    np.testing.assert_allclose(np.diff(even.s), 0.05, rtol=0, atol=1e-6)  # [m] as ERD iterations
    between = np.interp(even.s, s, height)
    np.testing.assert_allclose(even.height.squeeze(), between, rtol=0, atol=1e-6)
    assert run("psd", tmp_path / "p.erd", "--lowest", 0.1).code == 0


def test_impossible_conversions_state_the_reason(run, profile, road, tmp_path):
    formats.write(make_points([0], [0], [0]), tmp_path / "points.csv")
    (tmp_path / "path.csv").write_text("x,y\n0,0\n1,1\n")
    points, path = tmp_path / "points.csv", tmp_path / "path.csv"
    for source, ending, part in [
        (profile, ".crg", "is a profile, which cannot become .crg"),
        (profile, ".laz", "it has no width"),
        (points, ".crg", "not gridded here"),
        (points, ".erd", "trueterrain profile"),
        (road, ".erd", "trueterrain profile"),
        (road, ".xyz", "must end with"),
        (path, ".csv", "is a path without heights"),
    ]:
        refused(run("convert", source, "-o", tmp_path / f"new{ending}"), part)
    assert not list(tmp_path.glob("new*"))


def test_bad_arguments(run, profile, road, tmp_path):
    out = tmp_path / "new.csv"
    refused(run("convert", profile, "-o", out, "--units", "mm"), "--units is for ERD output")
    refused(run("convert", profile, "-o", out, "--units", "cm"), "units", "cm")
    refused(run("convert", profile, "-o", out, "--scale", 0.1), "--scale is for LAS and LAZ")
    refused(run("convert", road, "-o", out, "--spacing", 0.1), "--spacing is for profiles")
    refused(run("convert", profile, "-o", out, "--spacing", 0), "spacing must be greater than 0")
    refused(run("convert", profile, "-o", out, "--spacing", 900), "profile.csv", "shorter than")
    refused(run("convert", profile, "-o", out, "--crs", "unknown"), "EPSG:25832")
    refused(run("convert", profile, "-o", profile, "--force"), "is an input as well")
    refused(run("convert", profile, "-o", road), "cannot become .crg")
    refused(run("convert", tmp_path / "none.csv", "-o", out), "none.csv")
    refused(run("convert", profile, "-o", tmp_path / "no" / "p.csv"), "does not exist")
    assert not out.exists()


def test_nothing_is_overwritten_without_force(run, profile, tmp_path):
    assert run("convert", profile, "-o", tmp_path / "p.erd").code == 0
    refused(run("convert", profile, "-o", tmp_path / "p.erd"), "exists already", "--force")
    assert run("convert", profile, "-o", tmp_path / "p.erd", "--force").code == 0


def test_damage_leaves_no_output(run, data, tmp_path):
    strip = (data / "scanning" / "strips" / "las_with_origin_dsmMarker.laz").read_bytes()
    (tmp_path / "half.laz").write_bytes(strip[: len(strip) // 2])
    refused(
        run("convert", tmp_path / "half.laz", "-o", tmp_path / "p.csv"), "half.laz", "ends at byte"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["half.laz"]


# --- Zarr stores ----------------------------------------------------------------------------------


def test_every_kind_goes_through_a_store_unchanged(run, profile, road, data, tmp_path):
    """What comes out of a store is what would have come out without it."""
    cloud = data / "scanning" / "strips" / "faceraster_2strips_20m.laz"
    for source, ending in ((profile, "csv"), (road, "crg"), (road, "laz"), (cloud, "laz")):
        store = tmp_path / f"{source.stem}.zarr"
        finished = run("convert", source, "-o", store, "--force")
        assert finished.code == 0, finished.err
        assert "not kept" not in finished.err
        for start, name in ((source, "straight"), (store, "through")):
            finished = run("convert", start, "-o", tmp_path / f"{name}.{ending}", "--force")
            assert finished.code == 0, finished.err
        straight, through = (
            formats.open(tmp_path / f"{name}.{ending}") for name in ("straight", "through")
        )
        attrs = {"provenance": ""}  # which tells of the store, or does not
        xr.testing.assert_identical(through.assign_attrs(attrs), straight.assign_attrs(attrs))


def test_stores_of_every_kind_are_shown(run, profile, road, tmp_path):
    formats.write(make_points([0, 1], [0, 2], [0, 1], lane=[1, 2]), tmp_path / "points.csv")
    for source, parts in (
        (profile, ("Zarr, profile", "200", "0.05 m")),
        (road, ("Zarr, surface", "41 x 11", "0.665 % of the nodes", "100 to 104 m (4 m)")),
        (tmp_path / "points.csv", ("Zarr, points", "1: 1; 2: 1", "0 to 2 m (2 m)")),
    ):
        store = tmp_path / f"{source.stem}.zarr"
        assert run("convert", source, "-o", store, "--crs", "EPSG:25832").code == 0
        text = run("info", store).out
        for part in (*parts, "EPSG:25832", "no problems found"):
            assert part in text, part
        assert json.loads(run("info", store, "--json").out)["files"][0]["format"] == "Zarr"
        assert run("plot", store, "-o", tmp_path / "a.png", "--force").code == 0


def test_stores_that_are_foreign_or_damaged_are_one_line(run, profile, tmp_path):
    xr.Dataset({"height": ("s", [1.0])}).to_zarr(
        tmp_path / "foreign.zarr", zarr_format=3, consolidated=False
    )
    assert run("convert", profile, "-o", tmp_path / "a.zarr").code == 0
    (tmp_path / "a.zarr" / "height" / "c.0").unlink()
    for name, words in (
        ("foreign", "of no kind that is known"),
        ("a", "array height: 1 of 1 chunks are missing"),
    ):
        for command in (("convert",), ("info",)):
            output = ("-o", tmp_path / "new.csv") if command == ("convert",) else ()
            refused(run(*command, tmp_path / f"{name}.zarr", *output), f"{name}.zarr", words)
    refused(
        run("convert", profile, "-o", tmp_path / "foreign.zarr", "--force"), "is never replaced"
    )
    refused(run("convert", profile, "-o", tmp_path / "a.zarr" / "b.zarr"), "within another store")


def test_units_that_nobody_named_are_warned_of(run, tmp_path):
    np.savetxt(tmp_path / "inches.csv", [[0.0, 0.1], [9.84, 0.2], [19.68, 0.1]], delimiter=",")
    finished = run("convert", tmp_path / "inches.csv", "-o", tmp_path / "p.zarr")
    assert finished.code == 0
    assert "taken as s, height in metres, every 9.84 m over 19.68 m" in finished.err
    assert "such as s [in],height [in]" in finished.err
