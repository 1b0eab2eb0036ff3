"""Recognition of files by content; dispatch by kind and ending."""

import json

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain import formats
from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import kind_of, make_points, make_profile, make_surface
from trueterrain.formats import erd, las, opencrg, table


@pytest.fixture
def profile():
    return make_profile([0, 1, 2], [0.0, 0.1, 0.0])


@pytest.fixture
def points():
    return make_points([0.0, 1.0], [0.0, 1.0], [0.0, 1.0], lane=[1, 2], time=[1.0, 2.0])


@pytest.fixture
def road():
    u = np.arange(5) * 0.1
    return make_surface(np.zeros((5, 3)), u=u, v=[-0.1, 0, 0.1], easting=u, northing=0 * u)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("opencrg/asam/belgian_block.crg", "OpenCRG"),
        ("opencrg/asam/crg-txt/fileref.crg", "OpenCRG"),
        ("opencrg/chrono/Horstwalde.crg", "OpenCRG"),
        ("scanning/strips/faceraster_2strips_20m.laz", "LAZ"),
        ("scanning/georeference/leeward/points.las", "LAS"),
        ("profiles/michalsorel_iri/profile_1.txt", "CSV"),
        ("scanning/trajectories/boreas-2021-08-05-13-34.lidar_poses.csv", "Boreas poses"),
        ("motion/smsfusion/coning_sculling_sim_highfreq_20251218A.csv", "Navigation table"),
        ("motion/smsfusion/ains_ahrs_imu.parquet", "Parquet"),
    ],
)
def test_real_files_under_any_name(data, tmp_path, name, found):
    assert formats.recognise_format(data / name).name == found
    other = tmp_path / "file.dat"
    other.write_bytes((data / name).read_bytes())
    assert formats.recognise_format(other).name == found


def test_written_files_are_recognised(tmp_path, profile, points):
    for ending in ("erd", "csv", "parquet"):
        formats.write(profile, tmp_path / f"profile.{ending}")
        npt.assert_allclose(formats.open(tmp_path / f"profile.{ending}").height, profile.height)
    for ending in ("las", "laz"):
        formats.write(points, tmp_path / f"points.{ending}")
        assert formats.recognise_format(tmp_path / f"points.{ending}").name == ending.upper()
    for content, found in [(b"II*\0", "GeoTIFF"), (b"MM\0*", "GeoTIFF"), (b"II+\0", "GeoTIFF")]:
        (tmp_path / "map").write_bytes(content + bytes(100))
        assert formats.recognise_format(tmp_path / "map").name == found


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is empty"),
        (b"  \n \n", "blank text"),
        (b"PK\x03\x04rest", "a zip archive"),
        (b"\x89HDF\r\n\x1a\n", "HDF5"),
        (b"ply\nformat ascii 1.0\n", "PLY"),
        (b"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
        (b"Dear reader,\nthis is prose, not numbers.\n", "text that begins with 'Dear reader"),
        (b"\x01\x02\x03\x00\x05", "the bytes 01 02 03 00 05"),
        ("nur ein Wort: Straße\n".encode("latin-1"), "text that begins with 'nur ein"),
    ],
)
def test_unknown_files_are_described(tmp_path, content, words):
    path = tmp_path / "file.laz"
    path.write_bytes(content)
    for function in (formats.open, formats.info, formats.recognise_format):
        with pytest.raises(FormatError) as caught:
            function(path)
        message = str(caught.value)
        assert words in message
        assert "known are OpenCRG, GeoTIFF, LAS, LAZ, COPC, ERD, CSV, Parquet, Zarr" in message
        assert "\n" not in message


def test_folder_and_missing_file(tmp_path):
    with pytest.raises(FormatError, match="is a folder"):
        formats.open(tmp_path)
    with pytest.raises(FileNotFoundError):
        formats.open(tmp_path / "none.laz")


def test_open_gives_the_right_kind(data, tmp_path):
    folder = data / "scanning" / "strips"
    assert kind_of(formats.open(folder / "faceraster_2strips_20m.laz")) == "points"
    assert kind_of(formats.open(data / "opencrg" / "asam" / "belgian_block.crg")) == "surface"
    assert kind_of(formats.open(data / "profiles/michalsorel_iri/profile_1.txt")) == "profile"


@pytest.mark.parametrize(
    ("text", "kind"),
    [("s,height\n0,1\n", "profile"), ("x,y,z\n0,1,2\n", "points"), ("x,y\n0,1\n", "path")],
)
def test_kind_of_tables(tmp_path, text, kind):
    (tmp_path / "t.csv").write_text(text)
    assert formats.kind_of_file(tmp_path / "t.csv") == kind


@pytest.mark.parametrize(
    "names",
    [
        "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading",
        "time,east,north,up,roll,pitch,yaw",
        "TIME, DISTANCE, EASTING, NORTHING, ELLIPSOID HEIGHT, ROLL, PITCH, HEADING",
        "GpsTime,Y,X,Z,Roll,Pitch,PlatformHeading,WanderAngle",
        "GPS Time (s),Lat (deg),Lon (deg),H-Ell (m),Roll (deg),Pitch (deg),Azimuth (deg)",
        "Time_s,PosX_m,PosY_m,PosZ_m,Roll_rad,Pitch_rad,Yaw_rad",
    ],
)
@pytest.mark.parametrize("titles", ["", "POSPac MMS export\nproject: road A1; 12 Nov\n"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_columns_of_navigation_are_not_points(tmp_path, names, titles, separator):
    labels = [name.strip() for name in names.split(",")]
    rows = [[f"{0.5 * row + column:.1f}" for column in range(len(labels))] for row in range(4)]
    lines = [separator.join(row) for row in [labels, *rows]]
    (tmp_path / "n.txt").write_text(titles + "\n".join(lines))
    assert formats.kind_of_file(tmp_path / "n.txt") == "navigation"
    summary = formats.info(tmp_path / "n.txt")
    assert (summary["kind"], summary["count"]) == ("navigation", 4)
    assert summary["rate"] == pytest.approx(2.0 if summary["format"] != "Boreas poses" else 2e6)
    json.dumps(summary)


@pytest.mark.parametrize("separator", [" ", "\t", ",", ";"])
def test_an_sbet_as_text_is_the_same_navigation(tmp_path, separator):
    """17 numbers without names, as decoders of SBET print them."""
    records = np.zeros((300, 17))
    records[:, 0] = 400_825.0 + 0.005 * np.arange(300)
    records[:, 1], records[:, 2] = 0.66 + 1e-8 * np.arange(300), -2.08
    records[:, 3], records[:, 9], records[:, 10] = 691.6, 0.3, 0.01
    records[:, 7:9] = 0.02 * np.sin(records[:, :1])
    title = "made by sbet2text"
    np.savetxt(tmp_path / "sbet.txt", records, delimiter=separator, fmt="%.17g", header=title)
    records.astype("<f8").tofile(tmp_path / "sbet.out")
    assert formats.recognise_format(tmp_path / "sbet.txt").name == "SBET as text"
    text, binary = (formats.open(tmp_path / f"sbet.{ending}") for ending in ("txt", "out"))
    for name in binary.data_vars:
        npt.assert_array_equal(text[name], binary[name])
    assert formats.info(tmp_path / "sbet.txt")["problems"] == []
    (tmp_path / "cut.txt").write_text((tmp_path / "sbet.txt").read_text()[:-30])
    with pytest.raises(FormatError, match=r"line 301: has \d+ of 17 fields"):
        formats.open(tmp_path / "cut.txt")


def test_info_adds_name_size_and_a_wrong_ending(tmp_path, profile):
    erd.write(profile, tmp_path / "p.erd")
    right = formats.info(tmp_path / "p.erd")
    assert right["file"] == str(tmp_path / "p.erd")
    assert right["bytes"] == (tmp_path / "p.erd").stat().st_size
    assert right["problems"] == [
        "spacing 1 m: readers derived from that of UMTRI refuse 1 m and more"
    ]
    (tmp_path / "p.erd").rename(tmp_path / "p.laz")
    wrong = formats.info(tmp_path / "p.laz")
    assert wrong["problems"][0] == "the name ends with '.laz', the content is ERD"
    json.dumps(wrong)


def test_points_block_by_block(tmp_path, points, profile):
    for name in ("p.laz", "p.csv", "p.parquet", "p.zarr"):
        formats.write(iter([points, points]), tmp_path / name)
        blocks = list(formats.point_blocks(tmp_path / name, size=1, crs="EPSG:25832"))
        assert [block.sizes["point"] for block in blocks] == [1, 1, 1, 1]
        assert {block.attrs["crs"] for block in blocks} == {"EPSG:25832"}
        inside = list(formats.point_blocks(tmp_path / name, bounds=(0.5, 0.5, 2, 2)))
        assert sum(block.sizes["point"] for block in inside) == 2
    formats.write(profile, tmp_path / "p.erd")
    with pytest.raises(FormatError, match="holds no points, its format is ERD"):
        list(formats.point_blocks(tmp_path / "p.erd"))


def test_messages_name_the_possible_endings(tmp_path, profile, points, road):
    for data, ending, known in [
        (profile, ".laz", ".erd, .csv, .parquet, .zarr"),
        (points, ".crg", ".laz, .las, .csv, .parquet, .zarr"),
        (iter([points]), ".erd", ".laz, .las, .csv, .parquet, .zarr"),
        (road, ".csv", ".crg, .tif, .tiff, .zarr"),
        (profile, "", ".erd, .csv, .parquet, .zarr"),
    ]:
        with pytest.raises(ValueError, match=f"can be written to {known}, got ending '{ending}'"):
            formats.write(data, tmp_path / f"x{ending}")
    assert list(tmp_path.iterdir()) == []


def test_dispatch_of_writing(tmp_path, profile, points, road):
    formats.write(profile, tmp_path / "p.erd", units="mm")
    assert erd.describe(tmp_path / "p.erd")["units"]["height"] == ["mm"]
    formats.write(points, tmp_path / "p.laz", scale=0.001)
    assert las.describe(tmp_path / "p.laz")["scale"] == [0.001] * 3
    formats.write(points, tmp_path / "p.csv")
    assert table.describe(tmp_path / "p.csv")["count"] == 2
    formats.write(road, tmp_path / "r.crg")
    assert opencrg.describe(tmp_path / "r.crg")["size"] == [5, 3]
