"""ERD profiles: units, tracks, precision and damage."""

import json

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core import provenance
from trueterrain.core.errors import FormatError, OutputError, SchemaError
from trueterrain.core.schemas import make_profile
from trueterrain.formats import erd

PRECISION = {"rtol": 0, "atol": 1e-9}  # [m] promised by erd.write
ROUND_OFF = {"rtol": 0, "atol": 1e-12}  # [m] the truth is exact in decimal

# header as quoted from a public LTPP file: trailing comma, millimetres, free keys
LTPP = """\
ERDFILEV2.00
 2,      3,    -1,      1,     5,   0.0250, -1,
TITLE   Site 010101 run 1
SURVDATE01-JAN-2005
SHORTNAMLElev.  RElev.
UNITSNAMmm      MM
XLABEL  Distance
XUNITS  m
DISTRICT04
END
   1.5  -2.5
   2.5  -3.5
   3.5  -4.5
"""


def write_text(folder, text, name="p.erd"):
    path = folder / name
    path.write_bytes(text.encode("latin-1"))
    return path


def test_files_of_other_programs_are_read(tmp_path):
    profile = erd.read(write_text(tmp_path, LTPP))
    assert profile.height.dims == ("track", "s")
    assert list(profile.track.values) == ["LElev.", "RElev."]
    npt.assert_allclose(profile.s, [0.0, 0.025, 0.05], **ROUND_OFF)
    truth = [[0.0015, 0.0025, 0.0035], [-0.0025, -0.0035, -0.0045]]
    npt.assert_allclose(profile.height, truth, **ROUND_OFF)
    assert json.loads(profile.attrs["erd_header"]) == [
        ["TITLE", "Site 010101 run 1"],
        ["SURVDATE", "01-JAN-2005"],
        ["XLABEL", "Distance"],
        ["DISTRICT", "04"],
    ]
    step = provenance.provenance_steps(profile)[-1]
    assert step["step"] == "read"
    assert step["inputs"][0]["name"] == "p.erd"


@pytest.mark.parametrize(
    ("unit", "metres"), [("m", 1.0), ("MM", 0.001), ("in", 0.0254), ("FT", 0.3048)]
)
def test_units_of_heights(tmp_path, unit, metres):
    text = LTPP.replace("UNITSNAMmm      MM", f"UNITSNAM{unit:<8}mm")
    profile = erd.read(write_text(tmp_path, text))
    npt.assert_allclose(profile.height[0], metres * np.array([1.5, 2.5, 3.5]), **ROUND_OFF)
    npt.assert_allclose(profile.height[1], [-0.0025, -0.0035, -0.0045], **ROUND_OFF)


def test_stations_in_international_feet(tmp_path):
    text = LTPP.replace("XUNITS  m", "XUNITS  FT").replace("0.0250", "0.1000000")
    npt.assert_allclose(erd.read(write_text(tmp_path, text)).s, [0, 0.03048, 0.06096], **ROUND_OFF)


def test_records_may_span_lines_and_have_dos_line_ends(tmp_path):
    head, _, _ = LTPP.partition("   1.5")
    text = (head + "1.5 -2.5 2.5\n-3.5\n3.5D0 -4.5\n\x1a").replace("\n", "\r\n")
    whole = erd.read(write_text(tmp_path, LTPP))
    npt.assert_allclose(
        erd.read(write_text(tmp_path, text, "q.erd")).height, whole.height, **ROUND_OFF
    )


@pytest.mark.parametrize("units", ["m", "mm", "in", "ft"])
@pytest.mark.parametrize("tracks", [None, ["left", "right wheel path"]])
def test_round_trip(tmp_path, units, tracks):
    s = 12.34567 + 0.0762 * np.arange(5000)
    count = 1 if tracks is None else len(tracks)
    height = 312.0 + np.random.default_rng(1).normal(0, 0.1, (count, s.size))
    profile = make_profile(s, height[0] if tracks is None else height, tracks=tracks)
    profile = provenance.add_step(profile, "made")
    profile.attrs["erd_header"] = json.dumps([["TITLE", "Ring  road"], ["DISTRICT", "04"]])
    path = tmp_path / "p.erd"
    erd.write(profile, path, units=units)
    again = erd.read(path)
    npt.assert_allclose(again.s, s, **PRECISION)
    npt.assert_allclose(again.height, profile.height, **PRECISION)
    assert json.loads(again.attrs["erd_header"])[:2] == [
        ["TITLE", "Ring  road"],
        ["DISTRICT", "04"],
    ]
    assert [step["step"] for step in provenance.provenance_steps(again)] == ["made", "read"]
    if tracks:
        assert list(again.track.values) == tracks
    erd.write(again, path, force=True, units=units)  # keys do not pile up
    keys = [line[:8] for line in path.read_text().splitlines()]
    assert keys.count("XSTART  ") == keys.count("HISTORY ") == keys.count("SHORTNAM") == 1


def test_the_name_of_a_single_track_is_kept(tmp_path):
    erd.write(make_profile([0, 1, 2], [0, 0, 1]).assign_attrs(track="left"), tmp_path / "p.erd")
    assert erd.read(tmp_path / "p.erd").attrs["track"] == "left"


def test_the_written_header_suits_simple_readers(tmp_path):
    erd.write(make_profile([0, 0.25, 0.5], [1, 2, 3]), tmp_path / "p.erd", units="mm")
    lines = (tmp_path / "p.erd").read_text().splitlines()
    assert lines[0][:12] == "ERDFILEV2.00"
    fields = lines[1].split(",")
    assert (int(fields[0]), int(fields[1]), int(fields[4]), float(fields[5])) == (1, 3, 5, 0.25)
    end = lines.index("END")
    assert [float(line) for line in lines[end + 1 :]] == [1000, 2000, 3000]


@pytest.mark.parametrize(
    ("change", "place", "rule"),
    [
        (("ERDFILEV2.00", "SOMETHING"), "line 1", "not an ERD file"),
        (("     5,", "     1,"), "line 2", "KEYNUM must be 5"),
        (("0.0250", "0"), "line 2", "greater than 0"),
        (("0.0250, -1,", ""), "line 2", "KEYNUM, step"),
        (("     3,", "     4,"), "line 13", "ends after 6 of 8 numbers"),
        (("     3,", "     2,"), "line 2", "announces 4"),
        (("XUNITS  m", "XUNITS  km"), "key XUNITS", "'km'"),
        (("XUNITS  m\n", ""), "key XUNITS", "must say m or ft"),
        (("UNITSNAMmm      MM", "UNITSNAMmm"), "key UNITSNAM", "each of the 2 channels"),
        (("UNITSNAMmm      MM", "UNITSNAMkm/h    s"), "key UNITSNAM", "at least one channel"),
        (("END\n", ""), "line 12", "no line END"),
        (("-3.5", "-3x5"), "line 12", "'-3x5'"),
        (("DISTRICT04", "XSTART  here"), "key XSTART", "'here'"),
    ],
)
def test_messages_name_the_place_of_damage(tmp_path, change, place, rule):
    assert change[0] in LTPP
    path = write_text(tmp_path, LTPP.replace(*change, 1))
    for function in (erd.read, erd.describe):
        with pytest.raises(FormatError) as caught:
            function(path)
        assert str(caught.value).startswith(f"{path}: {place}: ")
        assert rule in str(caught.value)
        assert caught.value.cure
        assert "\n" not in str(caught.value)


def test_empty_file(tmp_path):
    with pytest.raises(FormatError, match="is empty"):
        erd.read(write_text(tmp_path, ""))


def test_channels_that_are_not_heights_are_omitted_with_a_warning(tmp_path):
    path = write_text(tmp_path, LTPP.replace("UNITSNAMmm      MM", "UNITSNAMkm/h    mm"))
    with pytest.warns(UserWarning, match=r"LElev\. is left out"):
        profile = erd.read(path)
    assert profile.height.dims == ("s",)
    assert profile.attrs["track"] == "RElev."


def test_unequal_spacing_is_refused(tmp_path):
    with pytest.raises(SchemaError, match=r"sample 1 .*Write CSV"):
        erd.write(make_profile([0, 0.5, 2], [0, 0, 0]), tmp_path / "p.erd")
    assert not list(tmp_path.iterdir())


def test_rounded_stations_count_as_equal(tmp_path):
    s = np.round(np.arange(100) / 30, 5)  # [m] rounded to 10 micrometres
    erd.write(make_profile(s, 0 * s), tmp_path / "p.erd")
    npt.assert_allclose(erd.read(tmp_path / "p.erd").s, s, rtol=0, atol=1e-5)


def test_missing_heights_are_refused(tmp_path):
    profile = make_profile([1, 2, 3], [[0, 0, 0], [0, np.nan, 0]], tracks=["left", "right"])
    with pytest.raises(SchemaError, match=r"s = 2 m of track right.*Write CSV"):
        erd.write(profile, tmp_path / "p.erd")
    assert not list(tmp_path.iterdir())


def test_bad_arguments(tmp_path):
    flat = make_profile([0, 1], [0, 0])
    with pytest.raises(ValueError, match="units must be one of m, mm, in, ft, got 'cm'"):
        erd.write(flat, tmp_path / "p.erd", units="cm")
    erd.write(flat, tmp_path / "p.erd")
    with pytest.raises(OutputError, match="exists already"):
        erd.write(flat, tmp_path / "p.erd")


def test_describe(tmp_path):
    summary = erd.describe(write_text(tmp_path, LTPP))
    assert summary["format"] == "ERD"
    assert summary["count"] == 3
    assert [track["name"] for track in summary["tracks"]] == ["LElev.", "RElev."]
    assert summary["units"] == {"s": "m", "height": ["mm", "mm"]}
    npt.assert_allclose(summary["extent"]["s"], [0, 0.05], **ROUND_OFF)
    assert summary["problems"] == []
    json.dumps(summary)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("UNITSNAMmm", "UNITSNAMm "), "is the unit right?"),
        (("  2.5 ", "  nan "), "1 of 3 heights are missing"),
        (("SHORTNAMLElev.  RElev.\n", ""), "SHORTNAM does not name every channel"),
        (("SHORTNAMLElev.  RElev.", "SHORTNAMElev.   Elev."), "two channels are named 'Elev.'"),
        (("0.0250", "1.0"), "1 m and more"),
        (("UNITSNAMmm ", "UNITSNAMkg "), "channel LElev. is in 'kg'"),
    ],
)
def test_describe_lists_what_is_flagged(tmp_path, change, problem):
    assert change[0] in LTPP
    summary = erd.describe(write_text(tmp_path, LTPP.replace(*change, 1)))
    assert any(problem in text for text in summary["problems"])
