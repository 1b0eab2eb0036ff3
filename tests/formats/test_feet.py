"""Point clouds in feet: read in metres, with the equivalent CRS in metres."""

import laspy
import numpy as np
import numpy.testing as npt
import pyproj
import pytest

from trueterrain import formats
from trueterrain.core.errors import FormatError
from trueterrain.formats import las

FOOT, SURVEY_FOOT = 0.3048, 1200 / 3937  # [m] international, US survey
SAME_PLACE = {"rtol": 0, "atol": 1e-6}  # [m] 2e6 ft times the round-off of a factor of 12 digits
# EPSG iterations false eastings in feet to 0.001 ft: its codes of one system in feet and in metres
# differ by up to half of it
SAME_DEGREES = {"rtol": 0, "atol": 2e-9}  # [deg] 0.2 mm on the ground

# CRS, metres in the unit of easting and of height, what is said
FEET = [
    ("EPSG:2264", SURVEY_FOOT, SURVEY_FOOT, "from US survey foot to metres (the CRS names no unit"),
    ("EPSG:2913", FOOT, FOOT, "from foot to metres (the CRS names no unit of heights"),
    ("EPSG:2264+6360", SURVEY_FOOT, SURVEY_FOOT, "from US survey foot to metres"),
    ("EPSG:2913+8228", FOOT, FOOT, "from foot to metres"),
    ("EPSG:2264+5703", SURVEY_FOOT, 1.0, "US survey foot, heights in metre to metres"),
    ("EPSG:26917+6360", 1.0, SURVEY_FOOT, "metre, heights in US survey foot to metres"),
    ("EPSG:26917+8228", 1.0, FOOT, "metre, heights in foot to metres"),
    ("EPSG:2992+6360", FOOT, SURVEY_FOOT, "foot, heights in US survey foot to metres"),
]
KEYS = {1024: 1, 3072: 2264, 3076: 9003}


def write_feet(path, crs=None, keys=None):
    """A file by laspy alone, 2e6 units east, 6e5 north, 250 up, in steps of 0.01 of them."""
    rng = np.random.default_rng(7)
    header = laspy.LasHeader(
        version="1.4" if keys is None else "1.2", point_format=1 if keys else 6
    )
    header.scales, header.offsets = [0.01] * 3, [2e6, 6e5, 0.0]
    if crs is not None:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    if keys is not None:
        header.vlrs.append(geotiff_keys(keys))
    content = laspy.LasData(header)
    for name, low in (("x", 2e6), ("y", 6e5), ("z", 250)):
        content[name] = low + rng.integers(0, 100_000, 200) * 0.01
    content.write(path)
    return np.stack([np.asarray(content[name]) for name in "xyz"])


def geotiff_keys(keys):
    numbers = [1, 1, 0, len(keys), *(n for key, value in keys.items() for n in (key, 0, 1, value))]
    return laspy.VLR("LASF_Projection", 34735, "", np.array(numbers, "<u2").tobytes())


def places(crs, *xy):
    """Longitude and latitude [deg] of the datum of a CRS."""
    crs = pyproj.CRS.from_user_input(crs)
    flat = crs.sub_crs_list[0] if crs.is_compound else crs
    return pyproj.Transformer.from_crs(flat, flat.geodetic_crs, always_xy=True).transform(*xy)


@pytest.mark.parametrize(("crs", "across", "up", "said"), FEET, ids=[one[0] for one in FEET])
def test_feet_become_metres(tmp_path, crs, across, up, said):
    path = tmp_path / "p.las"
    x, y, z = write_feet(path, crs)
    points = las.read(path)
    npt.assert_allclose(points.easting, x * across, **SAME_PLACE)
    npt.assert_allclose(points.northing, y * across, **SAME_PLACE)
    npt.assert_allclose(points.up, z * up, **SAME_PLACE)
    # pyproj as the witness that the new CRS names the same places as the old one in feet
    found = pyproj.CRS.from_user_input(points.attrs["crs"])
    assert {axis.unit_name for axis in found.axis_info} == {"metre"}
    npt.assert_allclose(
        places(found, points.easting, points.northing), places(crs, x, y), **SAME_DEGREES
    )
    assert said in formats.conversion_of(path)
    assert "+" not in crs or found.is_compound


@pytest.mark.parametrize("crs", [one[0] for one in FEET])
def test_converted_metres_are_written_and_read(tmp_path, crs):
    write_feet(tmp_path / "in.las", crs)
    points = las.read(tmp_path / "in.las")
    formats.write(points, tmp_path / "out.laz")
    again = las.read(tmp_path / "out.laz")
    assert formats.conversion_of(tmp_path / "out.laz") == ""
    for name in ("easting", "northing", "up"):
        npt.assert_allclose(again[name], points[name], **SAME_PLACE)
    assert pyproj.CRS(again.attrs["crs"]) == pyproj.CRS(points.attrs["crs"])


def test_bounds_are_metres(tmp_path):
    write_feet(tmp_path / "p.las", "EPSG:2264")
    whole = las.read(tmp_path / "p.las")
    edge = float(np.median(whole.easting))
    part = las.read(tmp_path / "p.las", bounds=(0, 0, edge, 1e7))
    npt.assert_array_equal(part.up, whole.up.values[whole.easting.values <= edge])


@pytest.mark.parametrize(
    ("keys", "across", "up"),
    [
        (KEYS, SURVEY_FOOT, SURVEY_FOOT),
        (KEYS | {4099: 9001}, SURVEY_FOOT, 1.0),
        (KEYS | {4099: 9002}, SURVEY_FOOT, FOOT),
        (KEYS | {4096: 6360}, SURVEY_FOOT, SURVEY_FOOT),
        (KEYS | {4096: 5703}, SURVEY_FOOT, 1.0),
        ({1024: 1, 3072: 26917, 4099: 9003}, 1.0, SURVEY_FOOT),
        ({1024: 1, 3072: 2992}, FOOT, FOOT),
    ],
)
def test_units_by_geotiff_keys(tmp_path, keys, across, up):
    x, _, z = write_feet(tmp_path / "p.las", keys=keys)
    points = las.read(tmp_path / "p.las")
    npt.assert_allclose(points.easting, x * across, **SAME_PLACE)
    npt.assert_allclose(points.up, z * up, **SAME_PLACE)


@pytest.mark.parametrize(("code", "unit"), [(26917, 9003), (2264, 9001), (2264, 9002)])
def test_contradicting_geotiff_keys_are_refused(tmp_path, code, unit):
    path = tmp_path / "p.las"
    write_feet(path, keys={1024: 1, 3072: code, 3076: unit})
    with pytest.raises(FormatError, match=r"by the GeoTIFF key 3076 .* but in .*--crs"):
        las.read(path)
    assert las.read(path, crs="EPSG:26917").attrs["crs"] == "EPSG:26917"


def test_a_crs_in_feet_may_be_given(tmp_path):
    x, _, z = write_feet(tmp_path / "p.las")
    points = las.read(tmp_path / "p.las", crs="EPSG:2913+8228")
    npt.assert_allclose(points.easting, x * FOOT, **SAME_PLACE)
    npt.assert_allclose(points.up, z * FOOT, **SAME_PLACE)
    assert points.attrs["crs"] == "EPSG:2838+5703"
    # a table is in metres, or in the units of its columns, whatever the CRS
    (tmp_path / "p.csv").write_text("x_ft,y_ft,z\n10,20,3\n")
    block = next(formats.point_blocks(tmp_path / "p.csv", crs="EPSG:2913"))
    npt.assert_allclose(block.easting, [10 * FOOT], **SAME_PLACE)
    assert block.attrs["crs"] == "EPSG:2838"
    assert "in metres" in formats.conversion_of(tmp_path / "p.csv", "EPSG:2913")


def test_info_reports_conversion_and_assumptions(tmp_path):
    x, _, _ = write_feet(tmp_path / "p.las", "EPSG:2264")
    found = las.describe(tmp_path / "p.las")
    npt.assert_allclose(found["extent"]["easting"], np.array([x.min(), x.max()]) * SURVEY_FOOT)
    npt.assert_allclose(found["scale"], 0.01 * SURVEY_FOOT)
    assert found["crs_name"] == "NAD83 / North Carolina"
    assert found["units"].startswith("converted from US survey foot to metres")
    assert any("names no unit of heights" in problem for problem in found["problems"])
