"""Tables of points, profiles and waypoints: CSV, plain text and Parquet."""

import json
import sys

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, FormatError, SchemaError, TrueTerrainError
from trueterrain.core.schemas import ASSUMED, make_points, make_profile, make_surface
from trueterrain.formats import recognise_format, table
from trueterrain.formats.number_table import table_columns

ROUND_OFF = {"rtol": 0, "atol": 1e-12}  # [m] the truth is exact in decimal
ENDINGS = ["csv", "parquet"]


def write_text(folder, text, name="t.csv", encoding="utf-8"):
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


def awkward(size):
    """Numbers that need all digits of float64."""
    rng = np.random.default_rng(7)
    return 771234.5678 + rng.random(size) * 10.0 ** rng.integers(-9, 3, size)


@pytest.mark.parametrize("ending", ENDINGS)
def test_profile_round_trip_keeps_every_bit(tmp_path, ending):
    s = np.cumsum(np.random.default_rng(2).random(1000))
    height = awkward(1000)
    height[3] = np.nan
    profile = make_profile(
        s, height, easting=awkward(1000), northing=-awkward(1000), sd=1 / s, count=np.arange(1000)
    )
    table.write(profile, tmp_path / f"p.{ending}")
    again = table.read(tmp_path / f"p.{ending}")
    for name in ("s", "height", "easting", "northing", "sd", "count"):
        npt.assert_array_equal(again[name], profile[name])
    assert again["count"].dtype == np.int64
    assert [step["step"] for step in provenance.provenance_steps(again)] == ["read"]


def test_columns_of_a_profile(tmp_path):
    profile = make_profile([0, 1], [2, 3], easting=[4, 5], northing=[6, 7], sd=[8, 9], count=[1, 2])
    table.write(profile, tmp_path / "p.csv")
    lines = (tmp_path / "p.csv").read_text().splitlines()
    assert lines[0] == "s,easting,northing,height,sd,count"
    assert [float(word) for word in lines[1].split(",")] == [0, 4, 6, 2, 8, 1]


@pytest.mark.parametrize("ending", ENDINGS)
def test_tracks_round_trip(tmp_path, ending):
    profile = make_profile(
        [0, 1, 2], [[1, 2, 3], [4, 5, 6]], tracks=["left", "right"], sd=np.ones((2, 3))
    )
    table.write(profile, tmp_path / f"p.{ending}")
    again = table.read(tmp_path / f"p.{ending}")
    assert list(again.track.values) == ["left", "right"]
    npt.assert_array_equal(again.height, profile.height)
    npt.assert_array_equal(again.sd, profile.sd)


@pytest.mark.parametrize("ending", ENDINGS)
def test_points_round_trip_keeps_every_bit(tmp_path, ending):
    points = make_points(
        awkward(500),
        -awkward(500),
        awkward(500),
        time=awkward(500),
        intensity=np.arange(500),
        lane=np.arange(500) % 3,
        sd=1 / awkward(500),
        crs="EPSG:25832",
    )
    table.write(points, tmp_path / f"p.{ending}")
    again = table.read(tmp_path / f"p.{ending}")
    for name in points.data_vars:
        npt.assert_array_equal(again[name], points[name])
    assert again.attrs["crs"] == ("EPSG:25832" if ending == "parquet" else "")


@pytest.mark.parametrize("ending", ENDINGS)
def test_points_are_streamed_in_and_out(tmp_path, ending):
    whole = make_points(np.arange(1000.0), np.arange(1000.0) / 3, np.zeros(1000))
    parts = (whole.isel(point=slice(start, start + 70)) for start in range(0, 1000, 70))
    path = tmp_path / f"p.{ending}"
    table.write(parts, path)
    blocks = list(table.blocks(path, size=64))
    assert max(block.sizes["point"] for block in blocks) <= 70
    assert len(blocks) > 10
    npt.assert_array_equal(np.concatenate([block.northing for block in blocks]), whole.northing)
    inside = list(table.blocks(path, bounds=(10, 0, 20, 6), size=64))
    npt.assert_array_equal(np.concatenate([b.easting for b in inside]), np.arange(10, 19))


def test_text_without_header_is_a_profile(data):
    path = data / "profiles" / "michalsorel_iri" / "profile_1.txt"
    profile = table.read(path)
    truth = np.loadtxt(path)
    npt.assert_array_equal(profile.s, truth[:, 0])
    npt.assert_array_equal(profile.height, truth[:, 1])
    summary = table.describe(path)
    npt.assert_allclose(summary["spacing"], 0.25, **ROUND_OFF)
    assert summary["count"] == len(truth)
    irregular = table.describe(path.with_name("profile_2.txt"))
    assert irregular["spacing"][0] < irregular["spacing"][1]


def test_three_numbers_without_header_are_points(tmp_path):
    points = table.read(write_text(tmp_path, "1 2 3\n4 5 6\n", "p.xyz"))
    npt.assert_array_equal(points.up, [3, 6])


@pytest.mark.parametrize(
    ("text", "s", "height"),
    [
        ("s,height\n0,1\n1,2\n", [0, 1], [1, 2]),
        ("\ufeffs;height [mm]\r\n0;1500\r\n1;2500\r\n", [0, 1], [1.5, 2.5]),
        ("# made by hand\n\nS_ft\tHeight_in\n0\t10\n10\t20\n", [0, 3.048], [0.254, 0.508]),
        ("station (km), note, z (cm)\n0.1, a, 5\n0.2, b, 7\n", [100, 200], [0.05, 0.07]),
        ("x z\n0 1\n1 2\n", [0, 1], [1, 2]),
        ("height,s,x,y\n1,0,5,6\n2,1,7,8\n", [0, 1], [1, 2]),
    ],
)
def test_headers_name_units(tmp_path, text, s, height):
    profile = table.read(write_text(tmp_path, text))
    npt.assert_allclose(profile.s, s, **ROUND_OFF)
    npt.assert_allclose(profile.height, height, **ROUND_OFF)


FORMULAS = ("=1+2", "+1-2", "-cmd", "@sum", "\tx", "'=1", "''+a", "=HYPERLINK(1)")


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_names_of_tracks_are_not_formulas_of_spreadsheets(tmp_path, ending):
    """Names come from files of others; a spreadsheet would run such a cell as a formula."""
    names = [*FORMULAS, "left", "-0.75", "+1e3", "'quoted'"]
    written = make_profile([0, 1], np.zeros((len(names), 2)), tracks=names)
    path = tmp_path / f"p{ending}"
    table.write(written, path)
    assert list(table.read(path).track.values) == names
    if ending == ".csv":
        cells = {line.split(",")[0].strip('"') for line in path.read_text().splitlines()[1:]}
        assert {cell for cell in cells if cell[0] in "=+-@\t"} == {"-0.75", "+1e3"}


@pytest.mark.parametrize("station", ["s", "station", "Distance", "s [m]", "chainage (m)"])
@pytest.mark.parametrize(
    ("left", "right", "names", "scale"),
    [
        ("left", "right", ["left", "right"], 1.0),
        ("Left [mm]", "Right [mm]", ["Left", "Right"], 0.001),
        ("left_in", "right_in", ["left", "right"], 0.0254),
        ("LElev (inch)", "RElev (inch)", ["LElev", "RElev"], 0.0254),
        ("L elevation ft", "R elevation ft", ["L", "R"], 0.3048),
        ("left wheel path mm", "right wheel path mm", ["left", "right"], 0.001),
        ("track 1", "track 2", ["track 1", "track 2"], 1.0),
        ("height_left", "height_right", ["left", "right"], 1.0),
    ],
)
def test_columns_named_as_their_tracks(tmp_path, station, left, right, names, scale):
    text = f"{station},{left},speed,{right}\n0,1,9,2\n0.5,3,9,4\n"
    profile = table.read(write_text(tmp_path, text))
    assert list(profile.track.values) == names
    npt.assert_allclose(profile.s, [0, 0.5], **ROUND_OFF)
    npt.assert_allclose(profile.height, [[scale, 3 * scale], [2 * scale, 4 * scale]], **ROUND_OFF)


@pytest.mark.parametrize("unit", ["in", "inch", "inches", "ft", "feet", "mm", "cm", "usft", "m"])
@pytest.mark.parametrize("label", ["{} [{}]", "{} ({})", "{}_{}", "{} {}"])
def test_units_are_read_in_every_notation(tmp_path, unit, label):
    metres = {
        "in": 0.0254,
        "inch": 0.0254,
        "inches": 0.0254,
        "ft": 0.3048,
        "feet": 0.3048,
        "mm": 1e-3,
        "cm": 1e-2,
        "usft": 1200 / 3937,
        "m": 1.0,
    }[unit]
    header = ",".join(label.format(name, unit) for name in ("s", "height"))
    profile = table.read(write_text(tmp_path, f"{header}\n0,1\n2,3\n"))
    npt.assert_allclose(profile.s, [0, 2 * metres], **ROUND_OFF)
    npt.assert_allclose(profile.height, [metres, 3 * metres], **ROUND_OFF)


TITLES = [
    "",
    "Road A1, left wheel path, 2024\n",
    "Measured in May\nby: XY; car 7; 12,5 C\n\n",
    "# made by hand\n",
    "Road A1\n1 of 2\n",
]


@pytest.mark.parametrize("titles", TITLES)
@pytest.mark.parametrize("header", ["s|height|sd", "Station (m)|Elevation|sd", "", "p|q|r"])
@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), (" ", ",")],
)
def test_titles_separators_and_decimal_commas(tmp_path, titles, header, separator, decimal):
    if separator == " " and "(" in header:
        header = "station|elevation|sd"  # a blank divides names as well
    rows = np.array([[478.25, 0.125, 0.5], [478.5, -0.25, 0.5], [478.75, 1e-3, 0.5]])
    lines = [header, *("|".join(f"{value:.4f}" for value in row) for row in rows)]
    lines = [lines[0], *(line.replace(".", decimal) for line in lines[1:])]
    text = titles + "\n".join(lines).replace("|", separator) + "\n"
    path = write_text(tmp_path, text)
    assert recognise_format(path).name == "CSV"
    # a line of as many words as there are numbers behind it names columns, if not those known
    before = header or (titles.strip().splitlines() or [""])[-1].replace("|", separator)
    count = len(before.replace("|", separator).split(None if separator == " " else separator))
    if header.startswith("p") or (not header and count == 3 and before[0] != "#"):
        with pytest.raises(FormatError, match=r"needs columns .* got "):
            table.read(path)
        return
    data = table.read(path)
    found = [data.s, data.height, data.sd] if header else [data.easting, data.northing, data.up]
    npt.assert_array_equal(np.stack(found, axis=1), rows)


@pytest.mark.parametrize("gap", ["", "NA", "nan", "null", "late"])
def test_names_before_rows_with_gaps_are_names(tmp_path, gap):
    path = write_text(tmp_path, f"Run 7\nt,a,b\n0,{gap},1\n1,2,3\n2,3,4\n")
    assert table_columns(path) == ["t", "a", "b"]
    path = write_text(tmp_path, f"Run 7\ns,height,remark\n0,1,{gap}\n1,2,3\n2,3,4\n")
    npt.assert_array_equal(table.read(path).height, [1, 2, 3])


def test_names_of_columns_may_stand_in_a_comment(tmp_path):
    np.savetxt(tmp_path / "t.txt", [[0, 1], [1, 2]], header="s height_mm")
    profile = table.read(tmp_path / "t.txt")
    npt.assert_allclose(profile.height, [0.001, 0.002], **ROUND_OFF)
    assert ASSUMED not in profile.attrs


@pytest.mark.parametrize("spacing", [0.25, 1.0, 3.0, 9.84])
def test_assumed_units_are_reported(tmp_path, spacing):
    """Inches without a header gave an IRI of 6.67 m/km for 1.51."""
    rows = np.column_stack([spacing * np.arange(200), np.zeros(200)])
    np.savetxt(tmp_path / "t.csv", rows, delimiter=",")
    (sentence,) = [
        problem for problem in table.describe(tmp_path / "t.csv")["problems"] if "names" in problem
    ]
    assert sentence == table.read(tmp_path / "t.csv").attrs[ASSUMED]
    assert "taken as s, height in metres, every" in sentence
    assert "such as s [in],height [in]" in sentence
    assert ("are they inches or feet?" in sentence) == (spacing > 0.305)
    named = tmp_path / "named.csv"
    np.savetxt(named, rows, delimiter=",", header="s [in],height [in]", comments="")
    assert ASSUMED not in table.read(named).attrs
    assert not [problem for problem in table.describe(named)["problems"] if "names" in problem]


def test_tracks_in_columns(tmp_path):
    text = "s,height_left,height_right wheel [mm],sd_left\n0,1,2000,5\n1,3,4000,6\n"
    profile = table.read(write_text(tmp_path, text))
    assert list(profile.track.values) == ["left", "right wheel"]
    npt.assert_allclose(profile.height, [[1, 3], [2, 4]], **ROUND_OFF)
    npt.assert_array_equal(profile.sd, [[5, 6], [np.nan, np.nan]])


def test_tracks_in_rows_may_be_mixed(tmp_path):
    text = "track,s,height\nleft,0,1\nright,0,2\nleft,1,3\nright,1,4\n"
    profile = table.read(write_text(tmp_path, text))
    npt.assert_array_equal(profile.height, [[1, 3], [2, 4]])


def test_latin_text_in_other_columns(tmp_path):
    path = write_text(tmp_path, "s,height,straße\n0,1,ä\n1,2,ö\n", encoding="latin-1")
    npt.assert_array_equal(table.read(path).height, [1, 2])


@pytest.mark.parametrize(
    ("text", "place", "rule", "cure"),
    [
        ("", "line 1", "is empty", "again"),
        ("s,height\n", "line 2", "no rows", "again"),
        ("s,heigth\n0,1\n", "header", "s and height", "'heigth' to 'height'"),
        ("a,b\n0,1\n", "header", "got a, b", "Add the column"),
        ("s,height\n0,1\n1,two\n2,3\n", "line 3, column 'height'", "'two'", "Correct"),
        ("s;height\n0;1.5\n1;2,5\n", "line 2, column 'height'", "'1.5'", "or all with a comma"),
        ("s,lft,rgt\n0,1,2\n", "header", "got s, lft, rgt", "height_left, height_right"),
        ("s,height\n0,1\nnan,2\n", "line 3, column 's'", "'nan'", "Remove"),
        ("s,height\n0,1\n1,inf\n", "line 3, column 'height'", "'inf'", "Remove"),
        ("s,height\n0,1\n\n2,1\n1,1\n", "line 5", "1 m follows 2 m", "Sort"),
        ("s,height,sd\n0,1,0\n1,2,0\n2,3\n", "line 4", "2 of 3 fields", "cut off"),
        ("s,height\n0,1\n1,2,3\n2,3\n", "line 3", "3 of 2 fields", "Complete"),
        ("s,height,sd\n0,1,0\n1,2\n2,3,0\n", "line 3", "2 of 3 fields", "Complete"),
        ("s,height [furlong]\n0,1\n", "column 'height [furlong]'", "'furlong'", "Convert"),
        ("s,height,z\n0,1,2\n", None, None, None),
        ("s,height,height [mm]\n0,1,2\n", "header", "both hold height", "Remove or rename"),
        ("x,y,z\n0,1,2\n3,nan,5\n", "line 3, column 'y'", "'nan'", "Remove"),
        ("1 2 3 4\n5 6 7 8\n", "line 1", "4 columns need names", "first line"),
        ("track,s,height\na,0,1\na,1,1\nb,0,1\n", "column 's'", "same values of s", "per track"),
        ("track,s,height\na,0,1\na,1,1\nb,1,1\nb,0,1\n", "line 5", "0 m follows 1 m", "Sort"),
        ("easting,northing\n1,2\n", "header", "it is a path", "heights"),
    ],
)
def test_messages_name_the_place_of_mistakes(tmp_path, text, place, rule, cure):
    path = write_text(tmp_path, text)
    if rule is None:  # 'z' beside 'height' is only another column
        assert any("z" in problem for problem in table.describe(path)["problems"])
        return
    with pytest.raises(FormatError) as caught:
        table.read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {place}: ")
    assert rule in message
    assert cure in message
    assert "\n" not in message


def test_gaps_in_heights_are_allowed(tmp_path):
    path = write_text(tmp_path, "s,height,sd\n0,1,0.1\n1,nan,\n2,3,0.1\n")
    npt.assert_array_equal(table.read(path).height, [1, np.nan, 3])
    assert any("1 of 3 heights are missing" in text for text in table.describe(path)["problems"])


def test_binary_file_is_refused(tmp_path):
    (tmp_path / "t.csv").write_bytes(b"\x89HDF\r\n\x1a\n\0\0")
    with pytest.raises(FormatError, match="is binary, not text"):
        table.read(tmp_path / "t.csv")


@pytest.mark.parametrize(
    "text",
    ["easting,northing\n0,1\n2,3\n", "x y name\n0 1 a\n2 3 b\n", "0 1\n2 3\n", "0 1 9\n2 3 9\n"],
)
def test_waypoints(tmp_path, text):
    easting, northing = table.read_waypoints(write_text(tmp_path, text))
    npt.assert_array_equal(easting, [0, 2])
    npt.assert_array_equal(northing, [1, 3])


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("easting,northing\n0,1\n2,nan\n", "line 3, column 'northing'"),
        ("easting,northing\n0,1\n,2\n", "line 3, column 'easting'"),
        ("easting,height\n0,1\n", "header"),
    ],
)
def test_bad_waypoints(tmp_path, text, place):
    path = write_text(tmp_path, text)
    with pytest.raises(FormatError) as caught:
        table.read_waypoints(path)
    assert str(caught.value).startswith(f"{path}: {place}: ")


def test_real_trajectory_serves_as_path_and_points(data):
    path = data / "scanning" / "trajectories" / "boreas-2021-08-05-13-34.lidar_poses.csv"
    easting, northing = table.read_waypoints(path)
    truth = np.loadtxt(path, delimiter=",", skiprows=1, usecols=(1, 2, 3))
    npt.assert_array_equal(np.stack([easting, northing], axis=1), truth[:, :2])
    npt.assert_array_equal(table.read(path).up, truth[:, 2])
    problems = table.describe(path)["problems"]
    assert any("not understood: GPSTime, vel_east" in problem for problem in problems)


@pytest.mark.parametrize(
    ("damage", "place", "rule"),
    [
        (lambda b: b[: len(b) // 2], None, "damaged or cut off"),
        (lambda b: b"PAR1" + b"x" * 100, None, "damaged or cut off"),
    ],
)
def test_damaged_parquet(tmp_path, damage, place, rule):
    path = tmp_path / "p.parquet"
    table.write(make_profile([0, 1], [0, 0]), path)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(FormatError, match=rule):
        table.read(path)


def test_bad_columns_of_parquet(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "p.parquet"
    pq.write_table(pa.table({"s": [0.0, 1.0], "height": ["a", "b"]}), path)
    with pytest.raises(FormatError, match="column 'height': must hold numbers, got"):
        table.read(path)
    pq.write_table(pa.table({"s": [0.0, None], "height": [1, 2]}), path)
    with pytest.raises(FormatError, match="row 2, column 's'"):
        table.read(path)
    pq.write_table(pa.table({"s": [1.0, 0.0], "height": [1, 2]}), path)
    with pytest.raises(FormatError, match="row 2: s must ascend"):
        table.read(path)


def test_parquet_without_pyarrow_says_how_to_get_it(tmp_path, monkeypatch):
    profile = make_profile([0, 1], [0, 0])
    table.write(profile, tmp_path / "p.parquet")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(TrueTerrainError, match=r"pip install trueterrain\[parquet\]"):
        table.read(tmp_path / "p.parquet")
    with pytest.raises(TrueTerrainError, match=r"pip install trueterrain\[parquet\]"):
        table.write(profile, tmp_path / "q.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["p.parquet"]


def test_data_that_are_not_tables_are_refused(tmp_path):
    surface = make_surface(np.zeros((2, 2)), easting=[0, 1], northing=[0, 1])
    with pytest.raises(SchemaError, match="a surface is not a table"):
        table.write(surface, tmp_path / "p.csv")
    with pytest.raises(CoverageError, match="no points to write"):
        table.write(iter([]), tmp_path / "p.csv")
    different = [make_points([0], [0], [0]), make_points([0], [0], [0], lane=[1])]
    with pytest.raises(SchemaError, match="all blocks must have the same variables"):
        table.write(iter(different), tmp_path / "p.csv")
    with pytest.raises(FormatError, match="holds a profile, not points"):
        list(table.blocks(write_text(tmp_path, "s,height\n0,1\n1,1\n")))
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


@pytest.mark.parametrize("ending", ENDINGS)
def test_describe_points(tmp_path, ending):
    points = make_points([0, 5], [1, -1], [2, 3], lane=[7, 8], time=[10, 20])
    table.write(points, tmp_path / f"p.{ending}")
    summary = table.describe(tmp_path / f"p.{ending}")
    assert summary["kind"] == "points"
    assert summary["count"] == 2
    assert summary["extent"] == {"easting": [0, 5], "northing": [-1, 1], "up": [2, 3]}
    assert summary["lanes"] == {"7": 1, "8": 1}
    assert summary["problems"] == []
    json.dumps(summary)
