"""The command merge: runs and clouds, their reports, and refused input."""

import json

import laspy
import numpy as np
import numpy.testing as npt
import pytest

import trueterrain as tt
from trueterrain import formats
from trueterrain.core.schemas import make_points

pytestmark = pytest.mark.slow

SEAM = 0.0002  # [m] asked of the network adjustment
APART = 0.012  # [m] between two clouds
MEAN_ERROR = 0.0005  # [m] of the mean of thousands of points with 2 mm noise, and of LAZ


@pytest.fixture(scope="module")
def clouds(tmp_path_factory):
    """Two flights over rolling ground, one 12 mm higher, also as one file."""
    folder = tmp_path_factory.mktemp("clouds")
    rng = np.random.default_rng(5)
    parts = []
    for number, (name, north, up) in enumerate((("south", 0.0, 0.0), ("north", 6.0, APART))):
        x, y = rng.uniform(0, 60, 30_000), north + rng.uniform(0, 10, 30_000)
        z = 0.2 * np.sin(x / 9) + 0.1 * np.cos(y / 7) + up + rng.normal(0, 0.002, x.size)
        order = np.argsort(x)
        points = make_points(
            x[order],
            y[order],
            z[order],
            time=3e8 + 100.0 * number + x[order] / 20,
            lane=np.full(x.size, number + 1),
            crs="EPSG:32632",
        )
        formats.write(points, folder / f"{name}.laz")
        parts.append(points)
    formats.write(iter(parts), folder / "both.laz")
    return folder


def test_runs_are_merged_and_reported_to_agree(run, two_lanes, tmp_path):
    finished = run("merge", *two_lanes, "-o", tmp_path / "out", "--spacing", 0.02)
    assert finished.code == 0, finished.err
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    (seam,) = result["merge"]["seams"]
    assert seam["after"] < SEAM < seam["before"]
    assert f"{1e3 * seam['after']:.2f} mm after" in finished.out
    (lane,) = result["lanes"]
    absolute, relative = (lane["surface"][name]["median"] for name in ("sd", "sd_relative"))
    (datum,) = set(result["merge"]["network"]["datum_sd"].values())
    npt.assert_allclose(absolute, np.hypot(relative, datum), rtol=0.02)  # medians of both
    assert datum > 2 * relative  # the part that is common to two passes with the same drift
    assert f"common to all passes: {1e3 * datum:.2f} mm" in finished.out
    page = (tmp_path / "out" / "report.html").read_text()
    assert f"has a standard deviation of {1e3 * datum:.3g} mm" in page
    road = tt.open(tmp_path / "out" / "merged.crg")
    assert float(road.v.max() - road.v.min()) > 7.0  # both lanes
    assert (tmp_path / "out" / "report.html").exists()
    finished = run("merge", *two_lanes, "-o", tmp_path / "out")
    assert (finished.code, finished.out) == (2, "")
    assert "is not empty" in finished.err


def test_a_check_writes_nothing(run, two_lanes, tmp_path):
    finished = run("merge", *two_lanes, "--check", "--json")
    assert finished.code == 1, finished.err
    found = json.loads(finished.out)
    assert not found["agree"]
    assert found["pairs"][0]["p95"] > found["limit"] == 0.002
    assert list(tmp_path.iterdir()) == []
    finished = run("merge", *two_lanes, "--check", "--limit", 1.0, "-o", tmp_path / "page")
    assert finished.code == 0, finished.err
    assert " agree: 95 %" in finished.out
    names = {path.name for path in (tmp_path / "page").iterdir()}
    assert names == {"report.html", "manifest.json"}


@pytest.mark.parametrize("split", [False, True])
def test_clouds_are_merged(run, clouds, tmp_path, split):
    files = [clouds / "both.laz"] if split else [clouds / "south.laz", clouds / "north.laz"]
    names = ("1", "2") if split else ("south", "north")
    finished = run("merge", *files, "-o", tmp_path / "out", "--json")
    assert finished.code == 0, finished.err
    (pair,) = json.loads(finished.out)["merge"]["pairs"]
    npt.assert_allclose(abs(pair["before"]["median"]), APART, rtol=0, atol=MEAN_ERROR)
    assert abs(pair["after"]["median"]) < MEAN_ERROR
    moved = []
    for name, file in zip(names, ("south", "north"), strict=True):
        before, after = laspy.read(clouds / f"{file}.laz"), laspy.read(tmp_path / f"out/{name}.laz")
        assert len(before.points) == len(after.points)
        moved.append(np.mean(after.z) - np.mean(before.z))
    # each is corrected by half of the difference
    npt.assert_allclose(np.sort(moved), [-APART / 2, APART / 2], rtol=0, atol=MEAN_ERROR)
    surface = tt.open(tmp_path / "out" / "merged.tif")
    assert np.isfinite(surface.height).mean() > 0.9
    # the common error of both flights is not observable
    assert ("sd" in surface, "sd_relative" in surface) == (False, True)
    written = laspy.read(tmp_path / f"out/{names[0]}.laz").point_format
    assert list(written.extra_dimension_names) == ["sd_relative"]
    assert json.loads(finished.out)["surface"]["sd"]["median"] is None
    page = (tmp_path / "out" / "report.html").read_text()
    assert "The height error common to all passes is not known" in page


def test_the_datum_sd_can_be_given(run, clouds, tmp_path):
    files = [clouds / "south.laz", clouds / "north.laz"]
    finished = run("merge", *files, "--datum-sd", 0.02, "-o", tmp_path / "out")
    assert finished.code == 0, finished.err
    assert "common to all passes: 20.00 mm" in finished.out
    surface = tt.open(tmp_path / "out" / "merged.tif")
    both = np.hypot(surface.sd_relative, 0.02)
    npt.assert_allclose(surface.sd, both, rtol=0, atol=1e-4)  # [m] medians of a cell, float32
    points = laspy.read(tmp_path / "out" / "south.laz")
    npt.assert_allclose(points.sd, np.hypot(points.sd_relative, 0.02), rtol=1e-5)


def test_one_pass_stays(run, clouds, tmp_path):
    files = [clouds / "south.laz", clouds / "north.laz"]
    finished = run("merge", *files, "--fix", "south", "-o", tmp_path / "out")
    assert finished.code == 0, finished.err
    before, after = laspy.read(files[0]), laspy.read(tmp_path / "out" / "south.laz")
    npt.assert_allclose(np.sort(after.z), np.sort(before.z), rtol=0, atol=1e-4)


def test_control_points_determine_the_height(run, clouds, tmp_path):
    x, y = (at.ravel() for at in np.meshgrid(np.arange(2.5, 58, 5), np.arange(2.5, 14, 2)))
    z = 0.2 * np.sin(x / 9) + 0.1 * np.cos(y / 7) + 0.1
    rows = [f"{a},{b},{c},0.002" for a, b, c in zip(x, y, z, strict=True)]
    (tmp_path / "control.csv").write_text("\n".join(["easting,northing,up,sd", *rows]) + "\n")
    finished = run(
        "merge",
        clouds / "south.laz",
        clouds / "north.laz",
        "--control",
        tmp_path / "control.csv",
        "-o",
        tmp_path / "out",
    )
    assert finished.code == 0, finished.err
    surface = tt.open(tmp_path / "out" / "merged.tif")
    true = 0.2 * np.sin(surface.easting / 9) + 0.1 * np.cos(surface.northing / 7) + 0.1
    error = (surface.height - true).values
    assert abs(np.nanmedian(error)) < 0.002


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("south.laz",), "at least two passes"),
        (("south.laz", "south.laz"), "given twice"),
        (("south.laz", "far.laz"), "no cell is seen by two passes"),
        (("south.laz", "other.laz"), "coordinate reference system"),
        (("south.laz", "north.laz", "--fix", "west"), "west"),
        (("south.laz", "north.laz", "--method", "grid", "--fix", "south"), "fixed has no meaning"),
        (("south.laz", "north.laz", "--path", "south.laz"), "path goes with"),
    ],
)
def test_invalid_arguments_are_one_line(run, clouds, tmp_path, arguments, part):
    south = formats.open(clouds / "south.laz")
    formats.write(south.assign(easting=south.easting + 500), tmp_path / "far.laz")
    formats.write(south.assign_attrs(crs="EPSG:2154"), tmp_path / "other.laz")
    there = [
        next((f / word for f in (clouds, tmp_path) if (f / word).exists()), word)
        for word in arguments
    ]
    finished = run("merge", *there, "-o", tmp_path / "out")
    assert (finished.code, finished.out) == (2, ""), finished.out
    assert finished.err.count("\n") == 1, finished.err
    assert part in finished.err
    assert not (tmp_path / "out").exists()


def test_an_output_is_needed_unless_it_is_a_check(run, two_lanes):
    finished = run("merge", *two_lanes)
    assert finished.code == 2
    assert "--output" in finished.err


METHODS = [("--check",), *(("--method", name) for name in ("network", "discontinuity", "grid"))]


@pytest.mark.parametrize("options", METHODS, ids=lambda options: options[-1])
@pytest.mark.parametrize(
    "files", [("pont",), ("68",), ("68", "faceraster_2strips_20m")], ids="+".join
)
def test_real_strips_are_merged_or_refused_in_one_line(run, data, tmp_path, files, options):
    """Strips in pieces, beside points that were made up: no statistic ends the command."""
    strips = data / "scanning" / "strips"
    finished = run(
        "merge",
        *(strips / f"{name}.laz" for name in files),
        "--split",
        *options,
        "-o",
        tmp_path / "out",
        "--json",
    )
    if files == ("68",):  # 1000 points on 4 km²
        assert (finished.code, finished.out) == (2, "")
        assert "68 is left out: it has no cell" in finished.err
        lines = [line for line in finished.err.splitlines() if "warning:" not in line]
        assert len(lines) == 1
        return
    assert finished.code == (1 if options == ("--check",) else 0), finished.err
    found = json.loads(finished.out)
    found = found.get("merge", found)
    (pair,) = found["pairs"]
    assert {pair["first"], pair["second"]} == (
        {"310", "401"} if "pont" in files else {"305", "306"}
    )
    assert any(
        "points of source 0 are left out" in problem or problem.startswith("0 is left out")
        for problem in found["problems"]
    )


@pytest.mark.parametrize("together", [None, (), ("--split",)])
def test_a_check_of_all_strips_finishes(run, data, together):
    """Each file, and all of one reference system at once: tiles that do not overlap as well."""
    files = sorted((data / "scanning" / "strips").glob("*.laz"))
    inputs = [[path] for path in files]
    if together is not None:
        inputs = [[path for path in files if not path.name.startswith("St_Barth")]]
    for some in inputs:
        finished = run("merge", *some, "--check", *(together or ()))
        if finished.code == 2:  # one strip, or too few points in a cell
            assert len(some) == 1
            lines = [line for line in finished.err.splitlines() if "warning:" not in line]
            assert len(lines) == 1
            assert (
                "one pass" in finished.err
                or "two passes" in finished.err
                or "two lanes" in finished.err
            )
        else:
            assert finished.code == 1, finished.err
            assert "do NOT agree" in finished.out or "overlaps no other pass" in finished.out


def test_passes_that_agree_leave_the_exit_code_0(run, clouds):
    files = [clouds / "south.laz", clouds / "north.laz"]
    assert run("merge", *files, "--check", "--limit", 10 * APART).code == 0
    finished = run("merge", *files, "--check", "--limit", APART / 2)
    assert finished.code == 1
    assert "do NOT agree" in finished.out


def test_iterations_and_tolerance_are_options(run, clouds, tmp_path):
    files = [clouds / "south.laz", clouds / "north.laz", "-o", tmp_path / "out"]
    finished = run("merge", *files, "--max-iterations", 1)
    assert finished.code == 2
    assert "did not converge in 1 iterations: the correction of" in finished.err
    assert not (tmp_path / "out").exists()
    finished = run("merge", *files, "--relative-tolerance", 0)
    assert finished.code == 2
    assert "relative_tolerance must be greater than 0" in finished.err
