"""The command profile: correct use and misuse."""

import json

import numpy as np
import pytest

import trueterrain as tt
from trueterrain.core import provenance
from trueterrain.formats import opencrg

STEP = 0.01  # [m] of the grid and of the path


@pytest.fixture(scope="module")
def road(tmp_path_factory):
    """A 4 m road with a slope and a bump, as a CRG file."""
    u, v = np.arange(401) * STEP, np.arange(-50, 51) * STEP
    bump = 0.02 * np.exp(-(((u - 2.0) / 0.1) ** 2))
    surface = tt.make_surface(
        0.01 * u[:, None] + bump[:, None] + 0 * v, u=u, v=v, easting=u, northing=0 * u
    )
    path = tmp_path_factory.mktemp("road") / "road.crg"
    opencrg.write(surface, path)
    return path


def one_line(finished, *parts):
    """Assert that the command failed with one line that holds all parts."""
    assert finished.code == 2
    assert finished.out == ""
    lines = finished.err.splitlines()
    assert len(lines) == 1, finished.err
    for part in parts:
        assert str(part) in lines[0], lines[0]


def test_a_profile_of_a_road(run, road, tmp_path):
    finished = run("profile", road, "--offset", 0.2, "-o", tmp_path / "p.csv")
    assert finished.code == 0, finished.err
    profile = tt.open(tmp_path / "p.csv")
    header = (tmp_path / "p.csv").read_text().splitlines()[0]
    assert header == "s,easting,northing,height,sd,count"
    assert profile.sizes["s"] == 401
    np.testing.assert_allclose(profile.northing, 0.2, rtol=0, atol=1e-12)
    # far from the bump the road is a plane; the heights of a CRG are float32, 3e-9 m at 4 cm
    plane = (profile.s > 0.1) & (profile.s < 1.0)
    np.testing.assert_allclose(profile.height[plane], 0.01 * profile.s[plane], rtol=0, atol=1e-8)


def test_offset_line_and_waypoints_give_the_same_profile(run, road, tmp_path):
    (tmp_path / "path.csv").write_text("easting,northing\n0,0.2\n1,0.2\n4,0.2\n")
    for name, option in {
        "offset": ("--offset", 0.2),
        "line": ("--line", 0, 0.2, 4, 0.2),
        "waypoints": ("--path", tmp_path / "path.csv"),
    }.items():
        finished = run("profile", road, *option, "-o", tmp_path / f"{name}.csv")
        assert finished.code == 0, finished.err
    offset = tt.open(tmp_path / "offset.csv")
    for name in ("line", "waypoints"):
        other = tt.open(tmp_path / f"{name}.csv")
        # nodes exactly on the edge of a disc count within 10 nm, so that round-off changes nothing
        np.testing.assert_allclose(other.height, offset.height, rtol=0, atol=1e-12)


def test_erd_goes_on_to_iri(run, road, tmp_path):
    assert run("profile", road, "--offset", 0, "-o", tmp_path / "p.erd").code == 0
    finished = run("iri", tmp_path / "p.erd", "--json")
    assert finished.code == 0, finished.err
    assert json.loads(finished.out)["tracks"][0]["iri"] > 0


@pytest.mark.parametrize(
    "options",
    [
        ("--statistic", "mean"),
        ("--statistic", "percentile", "--percent", 85),
        ("--statistic", "trimmed", "--skip", 10),
        ("--statistic", "bridge", "--skip", 15, "--average", 70),
        ("--statistic", "idw-mean", "--power", 1),
        ("--statistic", "idw-median"),
        ("--statistic", "steepest", "--bandwidth", 0.002),
        ("--statistic", "median", "--resolution", 0.001),
        ("--statistic", "point"),
        ("--patch", 0.1, 0.2),
        ("--ellipse", 0.1, 0.2, "--level"),
    ],
    ids=lambda options: " ".join(str(option) for option in options),
)
def test_every_statistic_and_search_area(run, road, tmp_path, options):
    finished = run("profile", road, "--offset", 0, *options, "-o", tmp_path / "p.csv")
    assert finished.code == 0, finished.err
    height = tt.open(tmp_path / "p.csv").height
    assert np.isfinite(height).all()
    assert 0.03 < float(height.max()) < 0.06  # the slope reaches 40 mm, the bump stands on 20 mm


def test_a_cloud_gives_the_same_profile(run, road, tmp_path):
    """Points are rounded to 0.1 mm in LAZ, so that heights differ by half of that."""
    assert run("convert", road, "-o", tmp_path / "cloud.laz").code == 0
    line = ("--line", 0.1, 0.1, 3.9, 0.1)
    assert run("profile", road, *line, "-o", tmp_path / "grid.csv").code == 0
    # the nodes lie 5 mm from the edge of this disc at least, so that rounding moves none across
    finished = run("profile", tmp_path / "cloud.laz", *line, "-o", tmp_path / "cloud.csv")
    assert finished.code == 0, finished.err
    grid, cloud = tt.open(tmp_path / "grid.csv"), tt.open(tmp_path / "cloud.csv")
    np.testing.assert_array_equal(cloud["count"], grid["count"])
    np.testing.assert_allclose(cloud.height, grid.height, rtol=0, atol=0.5e-4 + 1e-9)


def test_thin_search_areas_are_an_error_or_nan(run, road, tmp_path):
    # the road ends at 4 m; discs at 4.01 m and 4.02 m still hold some of its last nodes
    beyond = ("--line", 3.0, 0.0, 5.0, 0.0)
    one_line(
        run("profile", road, *beyond, "-o", tmp_path / "p.csv"),
        "98 of 201 search areas have fewer than 3 heights",
        "s = 1.030 m",
        "--thin nan",
    )
    finished = run("profile", road, *beyond, "--thin", "nan", "-o", tmp_path / "p.csv")
    assert finished.code == 0
    assert "98 thin search areas are NaN" in finished.err


def test_nothing_is_overwritten_without_force(run, road, tmp_path):
    (tmp_path / "p.erd").write_text("mine")
    arguments = ("profile", road, "--offset", 0, "-o", tmp_path / "p.erd")
    one_line(run(*arguments), tmp_path / "p.erd", "exists already", "--force")
    assert (tmp_path / "p.erd").read_text() == "mine"
    assert run(*arguments, "--force").code == 0


def test_no_input_is_replaced_even_by_force(run, road, tmp_path):
    """A CSV file can be the output, the path and the point cloud."""
    (tmp_path / "path.csv").write_text("easting,northing\n1,0\n2,0\n")
    assert run("convert", road, "-o", tmp_path / "cloud.csv").code == 0
    for ground, output in ((road, "path.csv"), (tmp_path / "cloud.csv", "cloud.csv")):
        before = (tmp_path / output).read_bytes()
        finished = run(
            "profile", ground, "--path", tmp_path / "path.csv", "-o", tmp_path / output, "--force"
        )
        one_line(finished, output, "is an input as well", "Choose another name")
        assert (tmp_path / output).read_bytes() == before


def test_units_are_for_erd(run, road, tmp_path):
    one_line(
        run("profile", road, "--offset", 0, "--units", "mm", "-o", tmp_path / "p.csv"),
        "--units is for ERD output",
    )
    arguments = ("profile", road, "--offset", 0, "--units", "mm", "-o", tmp_path / "p.erd")
    assert run(*arguments).code == 0
    assert "UNITSNAMmm" in (tmp_path / "p.erd").read_text()


def test_the_crs_of_the_user_is_kept(run, road, tmp_path):
    arguments = (
        "profile",
        road,
        "--offset",
        0,
        "--crs",
        "EPSG:25832",
        "-o",
        tmp_path / "p.parquet",
    )
    assert run(*arguments).code == 0
    assert tt.open(tmp_path / "p.parquet").attrs["crs"] == "EPSG:25832"


def damaged(road, folder, damage):
    """Make a damaged file; returns its path."""
    content = road.read_bytes()
    name, changed = {
        "truncated CRG": ("cut.crg", content[: len(content) // 2]),
        "mangled line ends": ("mangled.crg", content.replace(b"\n", b"\r\n")),
        "empty file": ("empty.crg", b""),
        "text instead of CRG": ("text.crg", b"no road here\n" * 100),
        "text instead of LAZ": ("text.laz", b"no points here\n" * 100),
    }[damage]
    (folder / name).write_bytes(changed)
    return folder / name


@pytest.mark.parametrize(
    "damage",
    [
        "truncated CRG",
        "mangled line ends",
        "empty file",
        "text instead of CRG",
        "text instead of LAZ",
    ],
)
def test_damaged_files_are_one_line(run, road, tmp_path, damage):
    bad = damaged(road, tmp_path, damage)
    before = bad.read_bytes()
    one_line(run("profile", bad, "--line", 0, 0, 1, 0, "-o", tmp_path / "p.erd"), bad)
    assert not (tmp_path / "p.erd").exists()
    assert bad.read_bytes() == before


def test_half_a_laz_is_one_line(run, road, tmp_path):
    assert run("convert", road, "-o", tmp_path / "whole.laz").code == 0
    content = (tmp_path / "whole.laz").read_bytes()
    half = tmp_path / "half.laz"
    half.write_bytes(content[: len(content) // 2])
    one_line(run("profile", half, "--line", 0, 0, 1, 0, "-o", tmp_path / "p.erd"), half)
    assert not (tmp_path / "p.erd").exists()


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--offset", 9), ("offset 9 m lies outside", "-0.5", "0.5", "Choose an offset")),
        (("--line", 90, 0, 91, 0), ("road.crg", "path lies outside of the ground", "CRS")),
        (("--offset", 0, "--spacing", 0), ("spacing must be greater than 0 m, got 0",)),
        (
            ("--offset", 0, "--spacing", "nan"),
            ("--spacing: must be 0, or from 1e-12",),
        ),
        (("--offset", 0, "--spacing", 1e-12), ("at most 100,000,000 points", "coarser")),
        (("--offset", 0, "--spacing", 5), ("4 m long, shorter than the spacing of 5 m",)),
        (("--offset", 0, "--radius", -0.025), ("radius must be greater than 0 m, got -0.025",)),
        (("--offset", 0, "--patch", 0.1, 0), ("width must be greater than 0 m, got 0",)),
        (("--offset", 0, "--statistic", "percentile"), ("needs percent",)),
        (("--offset", 0, "--percent", 5), ("percent belongs to the statistic percentile",)),
        (("--offset", 0, "--min-count", 0), ("min_count must be at least 1",)),
        (("--offset", 0, "--statistic", "point", "--radius", 1), ("no search area",)),
        (("--offset", 0, "--statistic", "point", "--thin", "nan"), ("no search area",)),
        (("--offset", 0, "--crs", "unknown"), ("EPSG:25832",)),
        (("--offset", 0, "--radius", 0.02, "--patch", 1, 1), ("only one of radius",)),
        ((), ("exactly one of --offset, --line and --path",)),
        (("--offset", 0, "--line", 0, 0, 1, 0), ("exactly one of",)),
        (("--line", 1, 0, 1, 0), ("0 m long, shorter than the spacing",)),
    ],
    ids=lambda value: " ".join(str(item) for item in value),
)
def test_bad_arguments_are_one_line(run, road, tmp_path, options, parts):
    one_line(run("profile", road, *options, "-o", tmp_path / "p.erd"), *parts)
    assert not (tmp_path / "p.erd").exists()


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("easting,northing\n0,0\nnan,0\n2,0\n", ("path.csv", "line 3")),
        ("easting,northing\n0,0\none,0\n2,0\n", ("path.csv", "line 3", "one")),
        ("a,b\n0,0\n1,0\n", ("path.csv", "easting")),
        ("", ("path.csv", "empty")),
        ("easting,northing\n1,0\n", ("path.csv", "2 different waypoints")),
        ("easting,northing\n1,0\n1,0\n", ("path.csv", "2 different waypoints")),
    ],
    ids=["NaN", "text", "wrong columns", "empty", "one waypoint", "one waypoint twice"],
)
def test_bad_waypoints_are_one_line(run, road, tmp_path, content, parts):
    (tmp_path / "path.csv").write_text(content)
    one_line(
        run("profile", road, "--path", tmp_path / "path.csv", "-o", tmp_path / "p.erd"), *parts
    )
    assert not (tmp_path / "p.erd").exists()


def test_an_unknown_ending_is_refused_before_the_work(run, road, tmp_path):
    one_line(run("profile", road, "--offset", 0, "-o", tmp_path / "p.ppf"), ".erd", ".csv")


def test_an_offset_in_a_cloud_is_refused(run, tmp_path):
    tt.write(tt.make_points([0.0, 1.0], [0.0, 0.0], [0.0, 0.0]), tmp_path / "cloud.csv")
    one_line(
        run("profile", tmp_path / "cloud.csv", "--offset", 0, "-o", tmp_path / "p.erd"),
        "cloud.csv",
        "reference line",
        "--line",
    )


def test_a_profile_has_no_ground_beside_it(run, tmp_path):
    tt.write(tt.make_profile([0.0, 0.1], [0.0, 0.0]), tmp_path / "p.erd")
    one_line(
        run("profile", tmp_path / "p.erd", "--line", 0, 0, 1, 0, "-o", tmp_path / "q.erd"),
        "p.erd: is a profile already",
    )


def test_the_measured_belgian_block(run, data, tmp_path):
    """Surface -> profile -> IRI on the real file; and the same from its point cloud."""
    block = data / "opencrg" / "asam" / "belgian_block.crg"
    assert run("profile", block, "--offset", 0.3, "-o", tmp_path / "p.erd").code == 0
    assert run("profile", block, "--offset", 0.3, "-o", tmp_path / "p.csv").code == 0
    finished = run("iri", tmp_path / "p.erd", "--json")
    assert finished.code == 0
    assert json.loads(finished.out)["tracks"][0]["iri"] > 0
    assert run("convert", block, "-o", tmp_path / "cloud.laz").code == 0
    cloud = run(
        "profile", tmp_path / "cloud.laz", "--path", tmp_path / "p.csv", "-o", tmp_path / "c.csv"
    )
    assert cloud.code == 0, cloud.err
    grid, points = tt.open(tmp_path / "p.csv"), tt.open(tmp_path / "c.csv")
    # rounding to 0.1 mm moves single nodes across the edge of a disc; a median of about 20
    # heights of a block that is flat to a millimetre or two hardly notices
    difference = np.abs(points.height.values - grid.height.values[: points.sizes["s"]])
    assert np.median(difference) < 1e-4
    assert difference.max() < 1e-2


def test_stores_give_the_same_profile_and_hold_it(run, tmp_path):
    u, v = 0.1 * np.arange(60), np.linspace(-0.5, 0.5, 21)
    road = tt.make_surface(0.1 * np.sin(u)[:, None] + 0.02 * v, u=u, v=v, easting=u, northing=0 * u)
    tt.write(road, tmp_path / "road.zarr")
    tt.write(tt.surface_to_points(road), tmp_path / "cloud.zarr")
    line = ("--line", 1, 0, 4, 0, "--radius", 0.1)
    found = []
    for source in ("road.zarr", "cloud.zarr"):
        for name in ("p.csv", "p.zarr"):
            output = tmp_path / name
            finished = run("profile", tmp_path / source, *line, "-o", output, "--force")
            assert finished.code == 0, finished.err
        profile = tt.open(tmp_path / "p.zarr")
        (entry,) = provenance.provenance_steps(profile)[-1]["inputs"]
        assert entry["name"] == source
        np.testing.assert_array_equal(profile.height, tt.open(tmp_path / "p.csv").height)
        found.append(profile.height.values)
    np.testing.assert_allclose(*found, rtol=0, atol=1e-12)
    refused = run("profile", tmp_path / "road.zarr", *line, "-o", tmp_path / "p.zarr")
    assert "exists already and is not overwritten" in refused.err
    refused = run("profile", tmp_path / "p.zarr", *line, "-o", tmp_path / "q.zarr")
    assert "is a profile already" in refused.err


def test_a_radius_in_millimetres_is_refused_and_a_wide_one_warned_of(run, road, tmp_path):
    asked = ("profile", road, "--offset", 0, "-o", tmp_path / "p.csv", "--radius")
    one_line(run(*asked, 25), "radius must be at most 1 m", "got 25; is it in millimetres?")
    wide = run(*asked, 0.4)
    assert wide.code == 0
    assert "warning: the search area is 0.8 m long and 0.8 m wide" in wide.err
