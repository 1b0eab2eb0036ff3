"""GeoTIFF surfaces: round trips, files of other programs, refused files."""

import builtins
import json

import numpy as np
import numpy.testing as npt
import pyproj
import pytest

from trueterrain.core.errors import FormatError, OutputError, TrueTerrainError
from trueterrain.core.provenance import add_step, provenance_steps
from trueterrain.core.schemas import check_surface, make_surface
from trueterrain.formats import geotiff

rasterio = pytest.importorskip("rasterio")

PLACE = {"rtol": 0, "atol": 2e-9}  # [m] round-off of coordinates of some million metres
SINGLE = {"rtol": 0, "atol": 4e-5}  # [m] float32 near 500 m


def ground(crs="EPSG:25832", **optional):
    easting = 691_234.125 + 0.25 * np.arange(7)
    northing = 5_334_567.5 + 0.5 * np.arange(5)
    height = 480 + 0.01 * np.arange(7) + 0.1 * np.arange(5)[:, None] ** 2
    height[1, 2] = np.nan
    return make_surface(height, easting=easting, northing=northing, crs=crs, **optional)


def raw(path, *, bands=1, dtype="float32", values=None, descriptions=(), units=(), **profile):
    """A GeoTIFF as other programs write it: 4 x 3 pixels of 2 m."""
    settings = {
        "driver": "GTiff",
        "width": 4,
        "height": 3,
        "crs": "EPSG:25832",
        "transform": rasterio.Affine(2, 0, 100, 0, -2, 206),
    } | profile
    values = np.arange(12.0).reshape(3, 4) if values is None else np.asarray(values)
    with rasterio.open(path, "w", count=bands, dtype=dtype, **settings) as target:
        for band in range(1, bands + 1):
            target.write(values.astype(dtype), band)
        for band, name in enumerate(descriptions, start=1):
            target.set_band_description(band, name)
        for band, unit in enumerate(units, start=1):
            target.set_band_unit(band, unit)
    return path


@pytest.mark.parametrize(("dtype", "tolerance"), [("float64", PLACE), ("float32", SINGLE)])
def test_round_trip(tmp_path, dtype, tolerance):
    surface = ground()
    path = tmp_path / "ground.tif"
    geotiff.write(surface, path, dtype=dtype)
    again = check_surface(geotiff.read(path))
    npt.assert_allclose(again.height, surface.height, **tolerance)
    npt.assert_allclose(again.easting, surface.easting, **PLACE)
    npt.assert_allclose(again.northing, surface.northing, **PLACE)
    assert again.height.dtype == np.float64
    assert again.attrs["crs"] == "EPSG:25832"
    assert [name.name for name in tmp_path.iterdir()] == ["ground.tif"]


def test_pixel_centres_are_nodes_and_north_is_up(tmp_path):
    path = tmp_path / "ground.tif"
    geotiff.write(ground(), path)
    with rasterio.open(path) as source:
        assert source.xy(0, 0) == pytest.approx((691_234.125, 5_334_569.5), abs=1e-8)
        assert source.transform.e < 0
        assert np.isnan(source.nodata)
        assert source.descriptions == ("height",)
        assert source.read(1)[0, 0] == 480 + 1.6


def test_a_raster_of_another_program(tmp_path):
    surface = geotiff.read(raw(tmp_path / "dem.tif", nodata=7.0))
    npt.assert_array_equal(surface.easting, [101, 103, 105, 107])
    npt.assert_array_equal(surface.northing, [201, 203, 205])
    npt.assert_array_equal(surface.height, [[8, 9, 10, 11], [4, 5, 6, np.nan], [0, 1, 2, 3]])


def test_pixels_that_are_points(tmp_path):
    """GDAL shifts the transform by half a pixel; the nodes must not move."""
    path = raw(tmp_path / "dem.tif")
    with rasterio.open(path, "r+") as target:
        target.update_tags(AREA_OR_POINT="Point")
    npt.assert_array_equal(geotiff.read(path).easting, [101, 103, 105, 107])


def test_south_up_rasters_are_turned(tmp_path):
    path = raw(tmp_path / "dem.tif", transform=rasterio.Affine(2, 0, 100, 0, 2, 200))
    surface = geotiff.read(path)
    npt.assert_array_equal(surface.northing, [201, 203, 205])
    npt.assert_array_equal(surface.height, np.arange(12).reshape(3, 4))


def test_scaled_integers(tmp_path):
    path = raw(tmp_path / "dem.tif", dtype="int16", nodata=3)
    with rasterio.open(path, "r+") as target:
        target.scales, target.offsets = (0.5,), (100.0,)
    height = geotiff.read(path).height.values
    npt.assert_array_equal(height[-1], [100.0, 100.5, 101.0, np.nan])


def test_optional_bands_are_kept(tmp_path):
    shape = (5, 7)
    surface = ground(
        sd=np.full(shape, 0.002),
        sd_relative=np.full(shape, 0.001),
        count=np.arange(35).reshape(shape),
        filled=np.eye(5, 7, dtype=bool),
    )
    path = tmp_path / "ground.tif"
    geotiff.write(surface, path)
    again = geotiff.read(path)
    for name in ("sd", "sd_relative", "count", "filled"):
        npt.assert_array_equal(again[name], surface[name])
    assert again.filled.dtype == bool
    assert np.issubdtype(again["count"].dtype, np.integer)
    assert geotiff.describe(path)["bands"] == [
        "height",
        "sd",
        "sd_relative",
        "count",
        "filled",
    ]


def test_provenance_is_kept(tmp_path):
    path = tmp_path / "ground.tif"
    geotiff.write(add_step(ground(), "grid", parameters={"spacing": 0.25}), path)
    assert [step["step"] for step in provenance_steps(geotiff.read(path))] == ["grid", "read"]


@pytest.mark.parametrize("crs", ["", "EPSG:32632", "EPSG:25832+7837"])
def test_the_crs_is_kept(tmp_path, crs):
    path = tmp_path / "ground.tif"
    geotiff.write(ground(crs), path)
    found = geotiff.read(path).attrs["crs"]
    if crs:
        assert pyproj.CRS(found).to_authority() == pyproj.CRS(crs).to_authority()
        assert pyproj.CRS(found).name == pyproj.CRS(crs).name
    else:
        assert found == ""


def test_a_local_crs_is_kept(tmp_path):
    local = 'LOCAL_CS["proving ground",UNIT["metre",1],AXIS["East",EAST],AXIS["North",NORTH]]'
    path = tmp_path / "ground.tif"
    geotiff.write(ground(local), path)
    assert "proving ground" in geotiff.read(path).attrs["crs"]


def test_description(tmp_path):
    path = tmp_path / "ground.tif"
    geotiff.write(ground(), path)
    found = geotiff.describe(path)
    json.dumps(found, allow_nan=False)
    assert found["format"] == "GeoTIFF"
    assert found["kind"] == "surface"
    assert found["size"] == [5, 7]
    assert found["spacing"] == {"easting": 0.25, "northing": 0.5}
    npt.assert_allclose(found["extent"]["easting"], [691_234.125, 691_235.625], **PLACE)
    npt.assert_allclose(found["extent"]["height"], [480, 481.66], **PLACE)
    assert found["missing"] == 1 / 35
    assert found["crs"] == "EPSG:25832"
    assert found["problems"] == []


def test_flags(tmp_path):
    path = raw(tmp_path / "dem.tif", bands=2, descriptions=["z", "slope"], crs=None)
    problems = " / ".join(geotiff.describe(path)["problems"])
    assert "the CRS is missing" in problems
    assert "bands that are not read: slope" in problems
    flat = raw(tmp_path / "flat.tif", values=np.full((3, 4), 2.0))
    assert geotiff.describe(flat)["problems"] == ["all heights are 2 m"]
    empty = raw(tmp_path / "empty.tif", values=np.full((3, 4), 2.0), nodata=2.0)
    assert geotiff.describe(empty)["problems"] == ["all heights are missing"]
    assert geotiff.describe(empty)["extent"]["height"] is None


def assert_refused(path, match):
    for function in (geotiff.read, geotiff.describe):
        with pytest.raises(FormatError, match=match) as caught:
            function(path)
        message = str(caught.value)
        assert "\n" not in message
        assert path.name in message
        assert caught.value.cure


SENTINEL = np.array([[1, 2, 3, 4.0], [5, 6, -9999, 8], [1, 2, 3, 4]])


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"transform": rasterio.Affine(2, 0.1, 100, 0.1, -2, 206)}, "is rotated or mirrored"),
        ({"transform": rasterio.Affine(-2, 0, 100, 0, -2, 206)}, "is rotated or mirrored"),
        ({"transform": rasterio.Affine.identity(), "crs": None}, "is not georeferenced"),
        ({"crs": "EPSG:4326"}, "degrees .WGS 84.*gdalwarp"),
        ({"crs": "EPSG:2263"}, "US survey foot .*gdalwarp"),
        ({"crs": "EPSG:25832+6360"}, "US survey foot"),
        ({"units": ["ft"]}, "must be in metres, got the unit 'ft'"),
        ({"dtype": "complex64"}, "must be real"),
        ({"bands": 3, "dtype": "uint8", "photometric": "RGB"}, "is an image"),
        ({"values": SENTINEL}, "1 heights such as -9999 m are no ground.*-a_nodata -9999"),
        ({"values": np.full((3, 4), 3e38)}, "12 heights such as 3e.38 m are no ground"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_rasters_that_are_not_surfaces_are_refused(tmp_path, settings, match):
    assert_refused(raw(tmp_path / "dem.tif", **settings), match)


def test_marked_sentinels_are_missing(tmp_path):
    path = raw(tmp_path / "dem.tif", values=SENTINEL, nodata=-9999)
    assert np.isnan(geotiff.read(path).height.values[1, 2])


@pytest.mark.parametrize("fraction", [0.0, 0.01, 0.3, 0.5, 0.9, 0.99])
def test_a_truncated_file_is_refused(tmp_path, fraction):
    path = tmp_path / "ground.tif"
    rng = np.random.default_rng(1)
    surface = make_surface(rng.normal(size=(90, 80)), easting=range(80), northing=range(90))
    geotiff.write(surface, path)
    content = path.read_bytes()
    cut = tmp_path / "cut.tif"
    cut.write_bytes(content[: int(fraction * len(content))])
    assert_refused(cut, "is not a complete GeoTIFF file")


def test_other_files(tmp_path):
    text = tmp_path / "text.tif"
    text.write_text("s,height\n0,1\n")
    assert_refused(text, "is not a complete GeoTIFF file")
    assert_refused(tmp_path / "none.tif", "does not exist")


def along_a_line():
    return make_surface(
        np.zeros((3, 2)), u=[0, 1, 2], v=[0, 1], easting=[0, 1, 2], northing=[0, 0, 0]
    )


@pytest.mark.parametrize(
    ("surface", "match"),
    [
        (along_a_line(), "along a reference line .*Write it as .crg"),
        (ground("EPSG:4326"), "CRS: .* needed, got degrees"),
        (ground("EPSG:2263"), "US survey foot"),
        (ground("EPSG:4978"), "geocentric"),
        (ground("nonsense"), "CRS: crs must be .*got 'nonsense'"),
        (make_surface(np.zeros((2, 3)), easting=[0, 1, 3], northing=[0, 1]), "axis easting: must"),
        (make_surface(np.zeros((3, 2)), easting=[0, 1], northing=[0, 1, 3]), "axis northing: must"),
    ],
)
def test_surfaces_that_are_not_rasters_are_refused(tmp_path, surface, match):
    path = tmp_path / "ground.tif"
    with pytest.raises(OutputError, match=match) as caught:
        geotiff.write(surface, path)
    assert "\n" not in str(caught.value)
    assert caught.value.cure
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_replaced_without_force(tmp_path):
    path = tmp_path / "ground.tif"
    path.write_text("mine")
    with pytest.raises(OutputError, match="exists already"):
        geotiff.write(ground(), path)
    assert path.read_text() == "mine"
    geotiff.write(ground(), path, force=True)
    assert geotiff.read(path).sizes["easting"] == 7


def test_unknown_dtype(tmp_path):
    with pytest.raises(ValueError, match="dtype must be 'float32' or 'float64', got 'int16'"):
        geotiff.write(ground(), tmp_path / "ground.tif", dtype="int16")


def test_without_rasterio(tmp_path, monkeypatch):
    path = raw(tmp_path / "dem.tif")
    real = builtins.__import__

    def absent(name, *rest, **keywords):
        if name.partition(".")[0] == "rasterio":
            raise ImportError(name)
        return real(name, *rest, **keywords)

    monkeypatch.setattr(builtins, "__import__", absent)
    for call in (lambda: geotiff.read(path), lambda: geotiff.write(ground(), tmp_path / "a.tif")):
        with pytest.raises(TrueTerrainError, match=r"pip install trueterrain\[gis\]"):
            call()
