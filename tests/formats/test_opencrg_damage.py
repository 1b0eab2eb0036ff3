"""Damaged OpenCRG files: each gives a one-line error that names file, place and cure."""

import re

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core.errors import FormatError
from trueterrain.core.schemas import make_surface
from trueterrain.formats import opencrg

ROWS = 11


def road(v):
    u = 0.5 * np.arange(ROWS)
    easting, northing = np.cumsum(np.full(ROWS, 0.4)), np.cumsum(np.full(ROWS, 0.3))
    height = 0.01 * u[:, None] + 0.05 * np.asarray(v) + 0.002 * np.sin(u)[:, None]
    return make_surface(
        height, u=u, v=v, easting=easting, northing=northing, banking=np.full(ROWS, 0.05)
    )


@pytest.fixture(params=["KRBI", "KDBI", "LRFI", "LDFI"])
def any_format(request, tmp_path):
    """Path of an undamaged file in each format: numbered long sections, banking."""
    path = tmp_path / "good.crg"
    opencrg.write(road([-1, -0.5, 0, 0.5, 1]), path, fmt=request.param)
    return path


@pytest.fixture
def binary(tmp_path):
    path = tmp_path / "good.crg"
    opencrg.write(road([-1, -0.5, 0, 0.5, 1]), path)
    return path


@pytest.fixture
def uneven(tmp_path):
    path = tmp_path / "uneven.crg"
    opencrg.write(road([-1, -0.4, 0, 0.5, 1]), path)
    return path


def damage(path, change):
    """Write a changed copy next to a file; `change` maps (header, data) to bytes."""
    content = path.read_bytes()
    at = content.index(b"$$$$")
    at = content.index(b"\n", at) + 1
    damaged = path.with_name("damaged.crg")
    damaged.write_bytes(change(content[:at], content[at:]))
    return damaged


def without(key):
    """Change that removes the header lines with a key."""
    pattern = re.compile(rb"^" + key + rb".*\n", re.MULTILINE)

    def change(header, payload):
        shorter = pattern.sub(b"", header)
        assert shorter != header
        return shorter + payload

    return change


def with_line(old, new):
    def change(header, payload):
        assert re.search(old, header, re.MULTILINE)
        return re.sub(old, new, header, flags=re.MULTILINE) + payload

    return change


def assert_refused(path, match):
    for function in (opencrg.read, opencrg.describe):
        with pytest.raises(FormatError, match=match) as caught:
            function(path)
        message = str(caught.value)
        assert "\n" not in message
        assert path.name in message
        assert caught.value.cure


@pytest.mark.parametrize("fraction", [0.0, 0.01, 0.3, 0.5, 0.9, 0.99])
def test_a_truncated_file_is_refused(any_format, fraction):
    content = any_format.read_bytes()
    any_format.with_name("cut.crg").write_bytes(content[: int(fraction * len(content))])
    assert_refused(any_format.with_name("cut.crg"), "must")


def test_cut_behind_the_header(any_format):
    assert_refused(damage(any_format, lambda header, _: header), "must")


def test_last_record_lost(any_format):
    assert_refused(damage(any_format, lambda header, payload: header + payload[:-81]), "must")


def test_surplus_bytes_after_the_data(binary):
    assert_refused(damage(binary, lambda header, payload: header + payload + bytes(80)), "must be")


def test_line_ends_converted_to_lf(data, tmp_path):
    good = (data / "opencrg/asam/belgian_block.crg").read_bytes()
    path = tmp_path / "mangled.crg"
    path.write_bytes(good.replace(b"\r\n", b"\n"))
    assert_refused(path, r"must be 1369440 bytes long .*binary")


def test_line_ends_converted_to_crlf(data, tmp_path):
    good = (data / "opencrg/asam/belgian_block.crg").read_bytes()
    path = tmp_path / "mangled.crg"
    path.write_bytes(good.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n"))
    assert_refused(path, r"must be 1369440 bytes long .*binary")


def test_header_with_crlf_alone_is_fine(binary):
    path = damage(binary, lambda header, payload: header.replace(b"\n", b"\r\n") + payload)
    npt.assert_array_equal(opencrg.read(path).height, opencrg.read(binary).height)


def test_text_formats_allow_converted_line_ends(tmp_path):
    path = tmp_path / "good.crg"
    opencrg.write(road([-1, 0, 1]), path, fmt="LRFI")
    converted = tmp_path / "converted.crg"
    converted.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    npt.assert_array_equal(opencrg.read(converted).height, opencrg.read(path).height)


def test_numbers_shifted_by_a_byte(binary):
    path = damage(binary, lambda header, payload: header + b"@" + payload[:-1])
    assert_refused(path, "at most|filled with NaN|finite")


def test_end_u_missing(binary):
    assert_refused(
        damage(binary, without(b"reference_line_end_u")), "REFERENCE_LINE_END_U is missing"
    )


def test_end_u_wrong(binary):
    path = damage(binary, with_line(rb"(reference_line_end_u +=).*", rb"\1 5.2"))
    assert_refused(path, "whole number of increments")
    path = damage(binary, with_line(rb"(reference_line_end_u +=).*", rb"\1 4.5"))
    assert_refused(path, "filled with NaN")
    path = damage(binary, with_line(rb"(reference_line_end_u +=).*", rb"\1 7.5"))
    assert_refused(path, "16 cross-sections of 20 bytes")


def test_increment_missing_or_zero(binary):
    assert_refused(damage(binary, without(b"reference_line_increment")), "INCREMENT is missing")
    path = damage(binary, with_line(rb"(reference_line_increment +=).*", rb"\1 0"))
    assert_refused(path, "INCREMENT must be greater than 0")


@pytest.mark.parametrize("side", [b"right", b"left"])
@pytest.mark.parametrize("kind", ["binary", "uneven"])
def test_one_edge_missing(request, kind, side):
    path = damage(request.getfixturevalue(kind), without(b"long_section_v_" + side))
    assert_refused(path, f"LONG_SECTION_V_{side.decode().upper()} is missing")


def test_both_edges_missing_with_banking(uneven):
    path = damage(uneven, without(b"long_section_v_(right|left)"))
    assert_refused(path, "drop the banking")


def test_both_edges_missing_on_a_numbered_grid(binary):
    path = damage(binary, without(b"long_section_v_(right|left)"))
    npt.assert_array_equal(opencrg.read(path).v, [-1, -0.5, 0, 0.5, 1])
    flags = opencrg.describe(path)["problems"]
    assert sum("programs with the C library" in flag for flag in flags) == 1
    path = damage(path, without(b"long_section_v_increment"))
    assert_refused(path, "LONG_SECTION_V_INCREMENT is missing")


def test_edges_that_do_not_fit(binary, uneven):
    path = damage(binary, with_line(rb"(long_section_v_left +=).*", rb"\1 1.5"))
    assert_refused(path, "are not 0.5 m apart")
    path = damage(uneven, with_line(rb"(long_section_v_left +=).*", rb"\1 1.5"))
    assert_refused(path, "do not reach")


def test_number_format_missing_or_unknown(binary):
    assert_refused(damage(binary, without(b"#:")), "no line #: names the format")
    assert_refused(damage(binary, with_line(rb"^#:KRBI", rb"#:KRBX")), "must be KRBI")


def test_number_format_wrong(binary):
    assert_refused(damage(binary, with_line(rb"^#:KRBI", rb"#:LRFI")), "must be text")
    assert_refused(damage(binary, with_line(rb"^#:KRBI", rb"#:KDBI")), "must be .* bytes long")


def test_text_instead_of_binary_numbers(binary):
    path = damage(binary, lambda header, payload: header + b" 0.0000000" * 60)
    assert_refused(path, "they are text although #: says KRBI")


def test_long_section_lost_or_twice(binary, uneven):
    assert_refused(damage(binary, without(rb"D:long section 3,")), "must be 1 to 4")
    path = damage(uneven, with_line(rb"at v = -0.4,", rb"at v = 0.5,"))
    assert_refused(path, "two long sections lie at v = 0.5 m")
    path = damage(uneven, with_line(rb"long section at v = 0.5,m", rb"long section 4,m"))
    assert_refused(path, "both kinds")
    assert_refused(damage(uneven, with_line(rb"at v = 0.5,m", rb"at v = 0.5,mm")), "must be in m")


def test_start_without_partner(binary):
    assert_refused(damage(binary, without(b"reference_line_start_y")), "stands without")


def test_no_end_of_the_header(binary):
    path = damage(binary, lambda header, payload: re.sub(rb"\$\$\$+\n", b"$$$\n", header) + payload)
    assert_refused(path, "the header has no end")


def test_section_not_ended(binary):
    path = damage(binary, with_line(rb"\$\n(\$ROAD_CRG\n)", rb"\1"))
    assert_refused(path, "not ended by a line with a single")


def test_unpadded_last_record_is_read_and_reported(binary):
    rows = ROWS * 5 * 4
    path = damage(binary, lambda header, payload: header + payload[:rows])
    npt.assert_array_equal(opencrg.read(path).height, opencrg.read(binary).height)
    assert any("not filled up to 80 bytes" in p for p in opencrg.describe(path)["problems"])


def test_last_line_break_lost(tmp_path):
    """The C-API drops a line without one."""
    path = tmp_path / "good.crg"
    opencrg.write(road([-1, 0, 1]), path, fmt="LRFI")
    assert_refused(damage(path, lambda header, payload: header + payload[:-1]), "no line break")


def test_letters_in_the_numbers(tmp_path):
    path = tmp_path / "good.crg"
    opencrg.write(road([-1, 0, 1]), path, fmt="LRFI")
    path = damage(path, lambda header, payload: header + payload.replace(b"0", b"x", 1))
    assert_refused(path, r"cross-section 1, column \d: must be a number")


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "it is empty"),
        (b"LASF" + bytes(400), "LAS or LAZ"),
        (b"s,height\n0,1\n", "must begin with .CT"),
        (b"$CT\nnothing else\n", "no end"),
        (b"$CT\n" + bytes(10_000), "no end"),
    ],
)
def test_other_files(tmp_path, content, match):
    path = tmp_path / "other.crg"
    path.write_bytes(content)
    assert_refused(path, match)


def test_no_file(tmp_path):
    assert_refused(tmp_path / "none.crg", "does not exist")


def test_flags_are_listed(data, tmp_path):
    height = np.zeros((5, 4))
    path = tmp_path / "good.crg"
    flat = make_surface(height, u=range(5), v=[-2, -1, 0, 1], easting=range(5), northing=[0] * 5)
    opencrg.write(flat, path, fmt="LRFI")
    assert opencrg.describe(path)["problems"] == []
    rows = [b" 0.0000000" * 4 for _ in range(5)]
    rows[1] = b" 0.0000000*missing*  0.0000000 0.0000000"
    rows[3] = b"**********" * 4
    odd = damage(path, lambda header, _: header + b"\n".join(rows) + b"\n")
    problems = " / ".join(opencrg.describe(odd)["problems"])
    assert "1 heights are missing between others" in problems
    assert "1 cross-sections have no height, the first at u = 3 m" in problems
    off = with_line(rb"(reference_line_start_u +=).*", rb"\1 0.0004")
    off = damage(odd, lambda h, p: off(re.sub(rb"(end_u +=).*", rb"\1 4.0004", h), p))
    assert any("multiple of 1 mm" in problem for problem in opencrg.describe(off)["problems"])
