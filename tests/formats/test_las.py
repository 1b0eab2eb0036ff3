"""LAS, LAZ and COPC: real files compared with laspy, written files with their input."""

import io
import json
import struct
from pathlib import Path

import laspy
import lazrs
import numpy as np
import numpy.testing as npt
import pyproj
import pytest

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, FormatError, OutputError, SchemaError
from trueterrain.core.schemas import make_points
from trueterrain.formats import las
from trueterrain.formats.las._describe import DuplicateCounter
from trueterrain.formats.signature import recognise_format

EXACT = {"rtol": 0, "atol": 0}  # the same integers with the same scale
HALF_STEP = {"rtol": 0, "atol": 0.5e-4 + 1e-9}  # [m] rounding to 0.1 mm, and of float64 at 6e6 m
STRIPS = [
    "faceraster_2strips_20m.laz",
    "las_with_origin_dsmMarker.laz",
    "las_with_several_extra_byte_bloc.laz",
    "St_Barth_RGAF09_UTM20N_IGN_1988_SB_subset_100m.laz",
    "test_data_77055_627755_LA93_IGN69.laz",
    "test_semis_2021_0382_6565_LA93_IGN69_cropped.laz",
]


@pytest.fixture(params=STRIPS)
def strip(data, request):
    return data / "scanning" / "strips" / request.param


@pytest.fixture
def faces(data):
    return data / "scanning" / "strips" / "faceraster_2strips_20m.laz"


def cloud(size=1000, **more):
    """A cloud with every variable, on a grid of 0.1 mm so that nothing is rounded."""
    rng = np.random.default_rng(5)
    east = 691000 + rng.integers(0, 10**6, size) * 1e-4
    north = 5334000 + rng.integers(0, 10**6, size) * 1e-4
    named = {
        "time": 3e8 + np.arange(size) * 1e-3,
        "intensity": rng.integers(0, 2**16, size),
        "lane": np.arange(size) % 2 + 1,
        "sd": rng.random(size).astype(np.float32),
        "sd_relative": rng.random(size).astype(np.float32),
    }
    up = 500 + rng.integers(0, 10**5, size) * 1e-4
    return make_points(east, north, up, crs="EPSG:25832", **(named | more))


def concatenated(blocks, name):
    return np.concatenate([block[name].values for block in blocks])


# ---- reading real files, compared with laspy


def test_points_are_those_of_laspy(strip):
    points = las.read(strip)
    truth = laspy.read(strip)
    assert points.sizes["point"] == truth.header.point_count
    for name, dimension in {
        "easting": truth.x,
        "northing": truth.y,
        "up": truth.z,
        "time": truth.gps_time,
        "intensity": truth.intensity,
        "lane": truth.point_source_id,
    }.items():
        npt.assert_allclose(points[name], np.asarray(dimension), **EXACT)
    assert points.attrs["crs"] in ("EPSG:2154", "")
    assert points.attrs["gps_time_kind"] == "adjusted standard"
    assert provenance.provenance_steps(points)[-1]["inputs"][0]["name"] == strip.name


@pytest.mark.slow
def test_blocks_give_all_points_in_order(strip):
    whole = las.read(strip)
    blocks = list(las.blocks(strip, size=7001))
    assert max(block.sizes["point"] for block in blocks) <= 7001
    for name in whole.data_vars:
        npt.assert_array_equal(concatenated(blocks, name), whole[name])


def test_bounds_include_their_edges(faces):
    truth = laspy.read(faces)
    x, y = np.asarray(truth.x), np.asarray(truth.y)
    bounds = (float(x[7]), float(np.median(y)), float(x[7]) + 5, float(y.max()))
    inside = (x >= bounds[0]) & (x <= bounds[2]) & (y >= bounds[1]) & (y <= bounds[3])
    assert 0 < inside.sum() < x.size
    points = las.read(faces, bounds=bounds)
    npt.assert_array_equal(points.easting, x[inside])
    npt.assert_array_equal(
        concatenated(las.blocks(faces, bounds=bounds, size=999), "northing"), y[inside]
    )


def test_nothing_within_bounds(faces):
    assert list(las.blocks(faces, bounds=(0, 0, 1, 1))) == []
    with pytest.raises(CoverageError, match="no points within the bounds"):
        las.read(faces, bounds=(0, 0, 1, 1))


def test_kind_of_time_agrees_with_the_flag(data):
    points = las.read(data / "scanning" / "georeference" / "leeward" / "points.las")
    assert points.attrs["gps_time_kind"] == "week seconds"
    assert points.attrs["crs"] == "EPSG:32611"  # named by its citation only


def test_time_offset_of_las_1_5(tmp_path):
    header = laspy.LasHeader(version="1.5", point_format=6)
    header.global_encoding.gps_time_offset = True
    header.gps_time_offset = 1400  # [1e6 s], so that times stay small
    content = laspy.LasData(header)
    content.x, content.y, content.z = [0.0, 1.0], [0.0, 1.0], [0.0, 1.0]
    content.gps_time = [0.5, 1.5]
    content.write(tmp_path / "p.las")
    points = las.read(tmp_path / "p.las")
    npt.assert_allclose(points.time, [400_000_000.5, 400_000_001.5], rtol=0, atol=1e-6)
    assert points.attrs["gps_time_kind"] == "adjusted standard"


@pytest.mark.parametrize("arguments", [{"bounds": (1, 0, 0, 1)}, {"size": 0}, {"crs": "EPSG:none"}])
def test_bad_arguments(faces, arguments):
    with pytest.raises(ValueError, match="must be"):
        list(las.blocks(faces, **arguments))


# ---- coordinate reference systems


def test_geocentric_coordinates_are_refused_unless_named_otherwise(data):
    path = data / "scanning" / "georeference" / "leeward" / "points_ecef.las"
    with pytest.raises(FormatError, match=r"geocentric x, y, z .*Transform the file"):
        las.read(path)
    with pytest.raises(FormatError, match="geocentric"):
        next(las.blocks(path))
    assert las.read(path, crs="EPSG:32611").attrs["crs"] == "EPSG:32611"
    assert any("geocentric" in problem for problem in las.describe(path)["problems"])


def test_degrees_are_refused(tmp_path):
    path = tmp_path / "p.las"
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_crs(pyproj.CRS.from_epsg(4326))
    lasdata = laspy.LasData(header)
    lasdata.x, lasdata.y, lasdata.z = [1.0, 2.0], [3.0, 4.0], [5.0, 6.0]
    lasdata.write(path)
    with pytest.raises(FormatError) as caught:
        las.read(path)
    assert "degrees" in str(caught.value)
    assert "--crs" in str(caught.value)
    assert any("degrees" in problem for problem in las.describe(path)["problems"])
    npt.assert_array_equal(las.read(path, crs="EPSG:25832").easting, [1, 2])


def test_a_missing_crs_is_listed_as_a_problem(data):
    path = data / "scanning" / "strips" / STRIPS[3]
    assert las.read(path).attrs["crs"] == ""
    assert las.read(path, crs="EPSG:5490").attrs["crs"] == "EPSG:5490"
    assert "the CRS is missing" in las.describe(path)["problems"]


# ---- writing


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_round_trip(tmp_path, ending):
    points = provenance.add_step(cloud(), "made")
    path = tmp_path / f"p.{ending}"
    las.write(points, path)
    again = las.read(path)
    for name in ("easting", "northing", "up"):
        npt.assert_allclose(again[name], points[name], **HALF_STEP)
    for name in ("time", "intensity", "lane", "sd", "sd_relative"):
        npt.assert_array_equal(again[name], points[name])
    assert again.attrs["crs"] == "EPSG:25832"
    assert again.attrs["gps_time_kind"] == "adjusted standard"
    assert [step["step"] for step in provenance.provenance_steps(again)] == ["made", "read"]
    assert las.describe(path)["problems"] == []


def test_coordinates_are_exact_to_a_tenth_of_a_millimetre(tmp_path):
    las.write(cloud(), tmp_path / "p.laz")
    witness = laspy.read(tmp_path / "p.laz")
    header = witness.header
    assert (str(header.version), header.point_format.id) == ("1.4", 6)
    assert header.are_points_compressed
    npt.assert_array_equal(header.scales, 0.0001)
    npt.assert_array_equal(header.offsets, np.rint(header.offsets))
    assert np.abs(header.offsets - [691050, 5334050, 505]).max() <= 1
    assert header.global_encoding.wkt
    assert header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
    assert header.parse_crs().to_epsg() == 25832
    assert list(header.point_format.extra_dimension_names) == ["sd", "sd_relative"]
    assert set(np.asarray(witness.return_number)) == {1}


@pytest.mark.parametrize("kind", ["week seconds", "adjusted standard"])
def test_kind_of_time_is_kept(tmp_path, kind):
    points = cloud(time=np.linspace(1e5, 1e5 + 1, 1000)).assign_attrs(gps_time_kind=kind)
    las.write(points, tmp_path / "p.laz")
    assert las.read(tmp_path / "p.laz").attrs["gps_time_kind"] == kind


def test_writing_block_by_block_gives_the_same_points(tmp_path):
    points = cloud()
    las.write(points, tmp_path / "whole.laz")
    parts = (points.isel(point=slice(start, start + 77)) for start in range(0, 1000, 77))
    las.write(parts, tmp_path / "parts.laz")
    whole, again = las.read(tmp_path / "whole.laz"), las.read(tmp_path / "parts.laz")
    for name in whole.data_vars:
        npt.assert_allclose(again[name], whole[name], rtol=0, atol=2e-9)  # [m] other offset


def test_a_real_strip_is_converted_without_loss(faces, tmp_path):
    las.write(las.blocks(faces, size=5000), tmp_path / "p.laz")
    before, after = las.read(faces), las.read(tmp_path / "p.laz")
    for name in before.data_vars:
        npt.assert_allclose(after[name], before[name], **HALF_STEP)
    assert after.attrs["crs"] == "EPSG:2154"


def test_vertical_crs_is_kept(tmp_path):
    las.write(cloud().assign_attrs(crs="EPSG:2154+5720"), tmp_path / "p.laz")
    crs = pyproj.CRS.from_user_input(las.read(tmp_path / "p.laz").attrs["crs"])
    assert [part.to_epsg() for part in crs.sub_crs_list] == [2154, 5720]


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"easting": [0, 3e5]}, r"point 2 lies .* from the offset 150000 .*scale=0\.001"),
        ({"easting": [0, 1e6]}, r"point 1 lies .*at most 214748 m fit"),
        ({"up": [0, np.nan]}, "variable up: must be finite everywhere, got nan at point 2"),
        ({"lane": [1, -1]}, "variable lane: must hold whole numbers from 0 to 65535, got -1"),
        ({"intensity": [0.5, 1]}, r"variable intensity: .* got 0\.5 at point 1"),
        ({"time": [0, np.nan]}, "variable time: must be finite"),
    ],
)
def test_values_beyond_the_range_of_las_are_refused(tmp_path, change, rule):
    named = {"easting": [0, 1], "northing": [0, 1], "up": [0, 1]} | change
    if change.get("easting") == [0, 3e5]:
        # the offset comes from the first block
        near = make_points([1.5e5], [0], [0])
        far = make_points([1.5e5 + 2.2e5], [0], [0])
        data = iter([near, far])
    else:
        data = make_points(named.pop("easting"), named.pop("northing"), named.pop("up"), **named)
    with pytest.raises(SchemaError, match=rule):
        las.write(data, tmp_path / "p.laz")
    assert list(tmp_path.iterdir()) == []


def test_coarser_scale_holds_more(tmp_path):
    las.write(make_points([0, 1e6], [0, 0], [0, 0]), tmp_path / "p.laz", scale=0.001)
    npt.assert_allclose(las.read(tmp_path / "p.laz").easting, [0, 1e6], rtol=0, atol=1e-9)


def test_bad_names_and_arguments_of_write(tmp_path):
    points = cloud(3)
    with pytest.raises(ValueError, match="COPC can be read but not written"):
        las.write(points, tmp_path / "p.copc.laz")
    with pytest.raises(ValueError, match=r"must end with \.las or \.laz"):
        las.write(points, tmp_path / "p.xyz")
    for scale in (0.0, -0.001, 0.2, 1e300, np.inf, np.nan):
        with pytest.raises(ValueError, match=r"scale must be greater than 0 m and at most 0\.1 m"):
            las.write(points, tmp_path / "p.laz", scale=scale)
    with pytest.raises(CoverageError, match="no points"):
        las.write(iter([]), tmp_path / "p.laz")
    with pytest.raises(SchemaError, match="attribute crs"):
        las.write(points.assign_attrs(crs="Atlantis"), tmp_path / "p.laz")
    with pytest.raises(SchemaError, match="same variables"):
        las.write(iter([points, points.drop_vars("sd")]), tmp_path / "p.laz")
    assert list(tmp_path.iterdir()) == []
    las.write(points, tmp_path / "p.laz")
    with pytest.raises(OutputError, match="exists already"):
        las.write(points, tmp_path / "p.laz")


# ---- damage


def readers(path):
    yield lambda: las.read(path)
    yield lambda: list(las.blocks(path, size=1000))
    yield lambda: las.describe(path)


def assert_refused(path):
    for function in readers(path):
        with pytest.raises(FormatError) as caught:
            function()
        message = str(caught.value)
        assert message.startswith(f"{path}: ")
        assert caught.value.place
        assert caught.value.cure
        assert "\n" not in message


@pytest.mark.parametrize("name", [STRIPS[0], STRIPS[1], STRIPS[3]])
@pytest.mark.parametrize("part", [0.001, 0.005, 0.02, 0.5, 0.9999])
def test_laz_that_is_cut_off(data, tmp_path, name, part):
    content = (data / "scanning" / "strips" / name).read_bytes()
    path = tmp_path / "p.laz"
    path.write_bytes(content[: int(len(content) * part)])
    assert_refused(path)


@pytest.mark.parametrize("size", [0, 3, 50, 226, 227, 300, 900, 20000, 45690])
def test_las_that_is_cut_off(data, tmp_path, size):
    content = (data / "scanning" / "georeference" / "leeward" / "points.las").read_bytes()
    path = tmp_path / "p.las"
    path.write_bytes(content[:size])
    assert_refused(path)


@pytest.mark.parametrize("name", [STRIPS[0], STRIPS[1]])
@pytest.mark.parametrize("surplus", [1, 5000, 10**8])
def test_header_with_too_many_points(data, tmp_path, name, surplus):
    content = bytearray((data / "scanning" / "strips" / name).read_bytes())
    form, place = ("<Q", 247) if content[25] >= 4 else ("<I", 107)
    (count,) = struct.unpack_from(form, content, place)
    struct.pack_into(form, content, place, count + surplus)
    path = tmp_path / "p.laz"
    path.write_bytes(content)
    assert_refused(path)


def test_las_header_with_too_many_points(data, tmp_path):
    content = bytearray(
        (data / "scanning" / "georeference" / "leeward" / "points.las").read_bytes()
    )
    struct.pack_into("<I", content, 107, 1326)
    path = tmp_path / "p.las"
    path.write_bytes(content)
    with pytest.raises(
        FormatError, match="1326 points that its header announces, but ends after 1325"
    ):
        las.read(path)


def test_text_with_the_ending_of_laz(tmp_path):
    path = tmp_path / "p.laz"
    path.write_text("easting,northing,up\n1,2,3\n" * 100)
    assert_refused(path)


def test_garbage_in_the_points(faces, tmp_path, capfd):
    content = bytearray(faces.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 500] = np.random.default_rng(0).bytes(500)
    path = tmp_path / "p.laz"
    path.write_bytes(content)
    assert_refused(path)
    assert capfd.readouterr().err == ""


def test_file_without_points(tmp_path):
    laspy.LasData(laspy.LasHeader(version="1.4", point_format=6)).write(tmp_path / "p.las")
    with pytest.raises(CoverageError, match="no points"):
        las.read(tmp_path / "p.las")
    assert list(las.blocks(tmp_path / "p.las")) == []
    assert "there are no points" in las.describe(tmp_path / "p.las")["problems"]


# ---- describing


@pytest.mark.slow
def test_description_agrees_with_laspy(strip):
    summary = las.describe(strip)
    truth = laspy.read(strip)
    json.dumps(summary)
    assert summary["format"] == "LAZ"
    assert summary["count"] == len(truth.x)
    for name, axis in zip(("easting", "northing", "up"), (truth.x, truth.y, truth.z), strict=True):
        npt.assert_allclose(summary["extent"][name], [axis.min(), axis.max()], **EXACT)
    ids, counts = np.unique(truth.point_source_id, return_counts=True)
    assert summary["point_source_ids"] == dict(zip(map(str, ids), counts, strict=True))
    classes, counts = np.unique(truth.classification, return_counts=True)
    assert summary["classes"] == dict(zip(map(str, classes), counts, strict=True))
    assert summary["returns"]["1"] == int((np.asarray(truth.return_number) == 1).sum())
    time = np.asarray(truth.gps_time)
    assert (summary["time"]["start"], summary["time"]["end"]) == (time.min(), time.max())
    integers = np.stack([truth.X, truth.Y, truth.Z], axis=1)
    repeated = len(integers) - len(np.unique(integers, axis=0))
    found = [text for text in summary["problems"] if "exactly where another lies" in text]
    assert found == (
        [f"{repeated} of {len(integers)} points lie exactly where another lies"] if repeated else []
    )


def test_points_without_time_and_lane_are_described(tmp_path):
    las.write(make_points([0, 1], [0, 1], [0, 1]), tmp_path / "p.laz")
    summary = las.describe(tmp_path / "p.laz")
    assert summary["time"] is None
    assert "all times are 0" in summary["problems"]


def test_wrong_time_flags_of_real_files_are_flagged(data):
    tile = las.describe(data / "scanning" / "strips" / "test_data_77055_627755_LA93_IGN69.laz")
    assert (tile["time"]["flag"], tile["time"]["kind"]) == ("week seconds", "adjusted standard")
    assert tile["time"]["first"].startswith("2021-05-28")
    assert any("the time flag says seconds of the week" in text for text in tile["problems"])
    honest = las.describe(data / "scanning" / "strips" / "las_with_origin_dsmMarker.laz")
    assert not any("time flag" in text for text in honest["problems"])


def test_stray_passes_of_real_files_are_flagged(data):
    problems = las.describe(data / "scanning" / "strips" / STRIPS[3])["problems"]
    assert any("4310 (467 points), 4340 (680 points)" in text for text in problems)


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (lambda f: f.header.vlrs.clear(), "the CRS is missing"),
        (lambda f: f.gps_time.__setitem__(slice(None), 0), "all times are 0"),
        (lambda f: f.gps_time.__setitem__(slice(5), 0), "5 points have time 0"),
        (lambda f: f.gps_time.__setitem__(3, np.nan), "1 points have a time that is not finite"),
        (lambda f: f.gps_time.__setitem__(slice(None), -f.gps_time), "time falls 999 times"),
        (lambda f: f.gps_time.__setitem__(slice(None), 1e5), "adjusted standard time, but"),
        (lambda f: f.gps_time.__setitem__(slice(None), 1.4e9), "not adjusted?"),
        (lambda f: f.point_source_id.__setitem__(slice(None), 0), "passes cannot be separated"),
        (lambda f: f.point_source_id.__setitem__(slice(7), 0), "7 points have point_source_id 0"),
        (lambda f: f.point_source_id.__setitem__(slice(2), 9), "9 (2 points)"),
        (lambda f: f.points.array.__setitem__(slice(9), f.points.array[10:19]), "9 of 1000 points"),
    ],
)
def test_problems_are_found(tmp_path, spoil, problem):
    las.write(cloud(), tmp_path / "good.las")
    assert las.describe(tmp_path / "good.las")["problems"] == []
    content = laspy.read(tmp_path / "good.las")
    spoil(content)
    content.write(tmp_path / "bad.las")
    assert any(problem in text for text in las.describe(tmp_path / "bad.las")["problems"])


def test_week_rollover_is_found(tmp_path):
    time = np.linspace(604_700, 604_900, 1000) % 604_800
    las.write(cloud(time=time).assign_attrs(gps_time_kind="week seconds"), tmp_path / "p.laz")
    assert any("rolled over" in text for text in las.describe(tmp_path / "p.laz")["problems"])


@pytest.mark.parametrize(
    ("place", "value", "problem"),
    [
        (179, 700000.0, "the extent in the header differs from that of the points by up to 8900"),
        (255, 5, "the counts by return in the header differ"),
    ],
)
def test_wrong_values_of_the_header_are_flagged(tmp_path, place, value, problem):
    path = tmp_path / "p.las"
    las.write(cloud(), path)
    content = bytearray(path.read_bytes())
    struct.pack_into("<d" if isinstance(value, float) else "<Q", content, place, value)
    path.write_bytes(content)
    assert any(problem in text for text in las.describe(path)["problems"])


@pytest.mark.parametrize(
    ("at", "number", "place"),
    [
        (100, 0xFFFFFFFF, "record 4 of 4294967295"),  # count of records before the points
        (96, 300, "record 1 of 3"),  # start of the points, within the first record
        (94, 0xFFFF, "record 1 of"),  # size of the header
    ],
    ids=["count of records", "start of points", "size of header"],
)
def test_impossible_record_counts_are_refused_at_once(data, tmp_path, at, number, place):
    """Reading the number of records of a damaged header would take hours."""
    content = bytearray((data / "scanning" / "strips" / "faceraster_2strips_20m.laz").read_bytes())
    width = 2 if at == 94 else 4
    content[at : at + width] = number.to_bytes(width, "little")
    (tmp_path / "bad.laz").write_bytes(content)
    for look in (las.read, las.describe):
        with pytest.raises(FormatError, match=rf"bad.laz: byte \d+: {place}"):
            look(tmp_path / "bad.laz")


def test_too_many_chunks_are_refused(data, tmp_path):
    content = bytearray((data / "scanning" / "strips" / "faceraster_2strips_20m.laz").read_bytes())
    points = int.from_bytes(content[96:100], "little")
    table = int.from_bytes(content[points : points + 8], "little")
    content[table + 4 : table + 8] = b"\xff\xff\xff\xff"
    (tmp_path / "bad.laz").write_bytes(content)
    with pytest.raises(FormatError, match="cannot hold the 4294967295 chunks"):
        las.read(tmp_path / "bad.laz")


def test_a_truncated_header_is_refused(tmp_path):
    (tmp_path / "bad.las").write_bytes(b"LASF" + bytes(100))
    with pytest.raises(FormatError, match="ends at byte 104, within its header"):
        las.read(tmp_path / "bad.las")


def test_a_coarse_scale_is_flagged(tmp_path):
    las.write(cloud(), tmp_path / "p.laz", scale=0.01)
    problems = las.describe(tmp_path / "p.laz")["problems"]
    assert any("rounded to 0.01 m: too coarse" in text for text in problems)


def test_duplicates_are_estimated_in_bounded_memory():
    rng = np.random.default_rng(3)
    places = rng.permutation(200_000)
    repeated = rng.choice(places, 50_000, replace=False)
    counter = DuplicateCounter(limit=10_000)
    for part in np.array_split(np.concatenate([places, repeated]), 7):
        counter.add(part, -part, part // 3)
    assert not counter.exact
    # binomial: 50,000 pairs sampled with 1/32 give 1562 +- 40, i.e. 2.5 %
    npt.assert_allclose(counter.count, 50_000, rtol=0, atol=4 * 0.025 * 50_000)


# ---- COPC: laspy reads it, but no available library writes it, so a small file is built here


def write_copc(path: Path, points, levels=3) -> None:
    """Write points into an octree of the given depth, following COPC 1.0."""
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 1e-4), np.array([691000.0, 5334000.0, 500.0])
    header.add_crs(pyproj.CRS.from_epsg(25832))
    record = laspy.ScaleAwarePointRecord.zeros(points.sizes["point"], header=header)
    record.x, record.y, record.z = (points[n].values for n in ("easting", "northing", "up"))
    record["gps_time"] = points.time.values
    record["point_source_id"] = points.lane.values

    center, half = np.array([691050.0, 5334050.0, 550.0]), 50.0
    level = np.arange(len(record)) % levels
    place = np.stack([record.x, record.y, record.z], axis=1)
    cells = np.floor((place - (center - half)) / (2 * half / 2**level)[:, None]).astype(int)
    keys = np.column_stack([level, np.clip(cells, 0, 2 ** level[:, None] - 1)])

    vlr = lazrs.LazVlr.new_for_compression(6, 0, True)
    laszip = bytes(vlr.record_data())
    wkt = header.vlrs[0].record_data_bytes()
    data_start = 375 + 54 + 160 + 54 + len(laszip) + 54 + len(wkt)
    entries, chunks, table = [], [], []
    offset = data_start + 8
    nodes = {tuple(map(int, key)) for key in np.unique(keys, axis=0)}
    nodes |= {(d, *(c >> (n - d) for c in xyz)) for n, *xyz in nodes for d in range(n)}
    for key in sorted(nodes):
        own = record.array[(keys == key).all(axis=1)]
        packed = b""
        if len(own):
            packed = _compressed_chunk(vlr, own)
            chunks.append(packed)
            table.append((len(own), len(packed)))
        entries.append((*key, offset if packed else 0, len(packed), len(own)))
        offset += len(packed)

    hierarchy = b"".join(struct.pack("<iiiiQii", *entry) for entry in entries)
    with path.open("wb") as stream:
        stream.write(b"\0" * data_start)
        stream.write(struct.pack("<q", offset))
        stream.write(b"".join(chunks))
        lazrs.write_chunk_table(stream, table, vlr)
        evlr = stream.seek(0, 2)
        stream.write(struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(hierarchy), b""))
        stream.write(hierarchy)
        header.grow(record)
        info = struct.pack(
            "<5d2Q2d88x",
            *center,
            half,
            1.0,
            evlr + 60,
            len(hierarchy),
            points.time.min(),
            points.time.max(),
        )
        stream.seek(0)
        stream.write(_las_header(header, data_start, evlr))
        for user, number, content in (
            (b"copc", 1, info),
            (b"laszip encoded", 22204, laszip),
            (b"LASF_Projection", 2112, wkt),
        ):
            stream.write(struct.pack("<H16sHH32s", 0, user, number, len(content), b""))
            stream.write(content)


def _compressed_chunk(vlr, points):
    stream = io.BytesIO()
    compressor = lazrs.LasZipCompressor(stream, vlr)
    compressor.compress_many(np.frombuffer(points.tobytes(), np.uint8))
    compressor.done()
    content = stream.getvalue()
    (end,) = struct.unpack_from("<q", content)
    return content[8:end]


def _las_header(header, data_start, evlr):
    box = np.stack([header.maxs, header.mins], axis=1).ravel()
    returns = [header.point_count] + [0] * 14
    made, layout = (b"", b"test", 1, 2026), (375, data_start, 3, 6 | 0x80)
    return (
        b"LASF"
        + struct.pack("<HH16xBB32s32sHHHIIB", 0, 0b10001, 1, 4, *made, *layout)
        + struct.pack("<HI5I", 30, 0, *[0] * 5)
        + struct.pack("<12d", *header.scales, *header.offsets, *box)
        + struct.pack("<QQIQ15Q", 0, evlr, 1, header.point_count, *returns)
    )


@pytest.fixture(scope="module")
def copc(tmp_path_factory):
    path = tmp_path_factory.mktemp("copc") / "p.copc.laz"
    write_copc(path, cloud(6000))
    return path


def by_time(blocks):
    order = np.argsort(concatenated(blocks, "time"))
    return {name: concatenated(blocks, name)[order] for name in ("easting", "up", "time", "lane")}


def test_laspy_accepts_the_copc_of_these_tests(copc):
    with laspy.CopcReader.open(copc) as reader:
        assert len(reader.query()) == 6000


def test_copc_is_read_completely(copc):
    again = by_time(list(las.blocks(copc, size=1000)))
    truth = cloud(6000)
    npt.assert_array_equal(again["time"], truth.time)
    npt.assert_allclose(again["easting"], truth.easting, **HALF_STEP)
    assert las.describe(copc)["format"] == recognise_format(copc).name == "COPC"
    assert las.read(copc).attrs["crs"] == "EPSG:25832"


@pytest.mark.parametrize("size", [50, 1000, 10**6])
@pytest.mark.parametrize(
    "bounds",
    [
        (691010.0, 5334020.0, 691060.0, 5334049.0),
        (691050.0, 5334000.0, 691075.0, 5334100.0),  # along the planes of the octree
        (0.0, 0.0, 1e9, 1e9),
    ],
)
def test_copc_by_bounds_gives_each_point_once(copc, bounds, size):
    truth = cloud(6000)
    x, y = np.round(truth.easting, 4), np.round(truth.northing, 4)
    inside = (x >= bounds[0]) & (x <= bounds[2]) & (y >= bounds[1]) & (y <= bounds[3])
    blocks = list(las.blocks(copc, bounds=bounds, size=size))
    assert max(block.sizes["point"] for block in blocks) <= size
    again = by_time(blocks)
    npt.assert_array_equal(again["time"], truth.time[inside])
    npt.assert_array_equal(again["lane"], truth.lane[inside])
    npt.assert_allclose(again["up"], truth.up[inside], **HALF_STEP)


def test_points_on_faces_of_the_octree_are_read_once(tmp_path):
    grid = np.linspace(0, 100, 41)
    x, y = (axis.ravel() for axis in np.meshgrid(grid, grid))
    points = make_points(
        691000 + x,
        5334000 + y,
        np.full(x.size, 550.0),
        time=np.arange(x.size),
        lane=np.ones(x.size),
    )
    write_copc(tmp_path / "p.copc.laz", points)
    blocks = list(las.blocks(tmp_path / "p.copc.laz", bounds=(0, 0, 1e9, 1e9), size=20))
    npt.assert_array_equal(by_time(blocks)["time"], points.time)


@pytest.mark.parametrize("part", [0.02, 0.5, 0.99])
def test_copc_that_is_cut_off(copc, tmp_path, part):
    content = copc.read_bytes()
    path = tmp_path / "p.copc.laz"
    path.write_bytes(content[: int(len(content) * part)])
    with pytest.raises(FormatError):
        las.read(path, bounds=(691010.0, 5334020.0, 691060.0, 5334049.0))
