"""The commands georeference and grid: from a recorded run, and from points, to a surface."""

import json
import re
import shutil
from dataclasses import replace

import laspy
import numpy as np
import numpy.testing as npt
import pytest

from trueterrain import formats
from trueterrain.core import provenance
from trueterrain.core.schemas import make_points, make_surface
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scene import read_scene, set_stage
from trueterrain.surface import node_coordinates

pytestmark = pytest.mark.slow

GROUND = (
    0.002  # [m] rms of heights by default errors of navigation over some metres, one height off
)
PLACE = 1e-6  # [m] round-off of map projections


@pytest.fixture(scope="module")
def recorded(recorded_scene):
    """Some metres of a ready scene with default errors, and its stage."""
    scene, _ = read_scene("belgian-two-lanes")
    scene = replace(
        scene,
        passes=(replace(scene.passes[0], start=20.0, length=6.0),),
        ground=({"kind": "road", "road_class": "B", "seed": 3, "waves": 200},),
        raster=0.01,
    )
    (path,) = recorded_scene(scene)
    return path, set_stage(scene)


@pytest.mark.slow
def test_a_run_becomes_points_in_its_frame_and_in_a_map(run, recorded, tmp_path):
    path, _ = recorded
    finished = run("georeference", path, "-o", tmp_path / "local.laz", "--json")
    assert finished.code == 0, finished.err
    report = json.loads(finished.out)
    assert report["points"] > 1_000_000
    finished = run("georeference", path, "-o", tmp_path / "map.laz", "--crs", "EPSG:32632")
    assert finished.code == 0, finished.err
    assert f"{report['points']:,} points" in finished.err
    local, moved = laspy.read(tmp_path / "local.laz"), laspy.read(tmp_path / "map.laz")
    assert len(local.points) == len(moved.points) == report["points"]
    # 2 degrees east of the central meridian: scale and convergence of UTM there
    a, b = np.array(local.xyz[::1000]), np.array(moved.xyz[::1000])
    chords = [np.hypot(*np.diff(points[[0, -1], :2], axis=0)[0]) for points in (a, b)]
    npt.assert_allclose(chords[1] / chords[0], 0.99986, rtol=0, atol=1e-4)
    npt.assert_allclose(b[:, 2] - a[:, 2], 500.0, rtol=0, atol=0.001)


def test_a_run_becomes_a_road(run, recorded, tmp_path):
    path, stage = recorded
    finished = run("grid", path, "--spacing", 0.02, "-o", tmp_path / "road.crg", "--json")
    assert finished.code == 0, finished.err
    report = json.loads(finished.out)
    assert report["returns"]["scans_uncovered"] == 0
    road = formats.open(tmp_path / "road.crg")
    truth = Raster(stage.ground, spacing=0.01).height(*node_coordinates(road))
    off = road.height.values - truth
    inner = off[20:-20, 20:-20]
    assert np.nanstd(inner) < GROUND
    assert abs(np.nanmean(inner)) < 0.1  # height of navigation
    assert report["sd"]["median"] < 0.1


def test_a_run_becomes_a_map(run, recorded, tmp_path):
    path, _ = recorded
    pytest.importorskip("rasterio")
    finished = run(
        "grid",
        path,
        "--spacing",
        0.05,
        "-o",
        tmp_path / "map.tif",
        "--method",
        "navigation",
        "--statistic",
        "maximum",
    )
    assert finished.code == 0, finished.err
    surface = formats.open(tmp_path / "map.tif")
    assert surface.height.dims == ("northing", "easting")
    assert "returns each" in finished.err


def test_points_become_a_map_and_a_road_with_the_same_heights(run, tmp_path):
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 6, 40_000), rng.uniform(-1, 1, 40_000)
    cloud = make_points(x, y, 5 + 0.02 * x)
    formats.write(cloud, tmp_path / "cloud.laz")
    formats.write(cloud, tmp_path / "cloud.csv")
    finished = run(
        "grid",
        tmp_path / "cloud.laz",
        tmp_path / "cloud.csv",
        "--line",
        0,
        0,
        6,
        0,
        "--right",
        -1,
        "--left",
        1,
        "--spacing",
        0.1,
        "-o",
        tmp_path / "road.crg",
        "--json",
    )
    assert finished.code == 0, finished.err
    road = formats.open(tmp_path / "road.crg")
    npt.assert_allclose(road.height.values[2:-2, 5], 5 + 0.02 * road.u.values[2:-2], atol=1e-4)
    assert json.loads(finished.out)["returns"] == {"used": 80_000, "outside": 0}
    finished = run(
        "grid",
        tmp_path / "cloud.laz",
        "--spacing",
        0.1,
        "-o",
        tmp_path / "map.crg",
        "--down-sample",
        2,
        2,
    )
    assert finished.code == 0, finished.err
    assert "of the content is left" in finished.err


def test_points_have_percentiles_and_discs(run, tmp_path):
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 2, 20_000), rng.uniform(0, 2, 20_000)
    formats.write(make_points(x, y, rng.uniform(0, 1, 20_000)), tmp_path / "cloud.csv")
    for options, expected in (
        (("--statistic", "percentile", "--percent", 85), 0.85),
        (("--statistic", "median"), 0.5),
        (("--radius", 0.5, "--power", 1), 0.5),
    ):
        finished = run(
            "grid",
            tmp_path / "cloud.csv",
            "--spacing",
            0.2,
            "-o",
            tmp_path / "a.crg",
            "--force",
            *options,
        )
        assert finished.code == 0, finished.err
        height = formats.open(tmp_path / "a.crg").height.values
        npt.assert_allclose(height.mean(), expected, rtol=0, atol=0.02)


def test_two_runs_make_one_road(run, recorded, tmp_path):
    """The same run twice: twice the returns, and the pose counts as known twice."""
    path, _ = recorded
    reports = []
    for number, inputs in enumerate(((path,), (path, path))):
        finished = run(
            "grid", *inputs, "--spacing", 0.05, "-o", tmp_path / f"{number}.crg", "--json"
        )
        assert finished.code == 0, finished.err
        reports.append(json.loads(finished.out))
    assert reports[1]["returns"]["used"] == 2 * reports[0]["returns"]["used"]
    ratio = reports[1]["sd"]["median"] / reports[0]["sd"]["median"]
    npt.assert_allclose(ratio, np.sqrt(0.5), rtol=0, atol=0.05)


def test_a_line_without_points_is_one_line(run, tmp_path):
    (tmp_path / "c.csv").write_text("easting,northing,up\n0,0,1\n1,1,2\n")
    finished = run("grid", tmp_path / "c.csv", "--line", 50, 50, 60, 50, "-o", tmp_path / "a.crg")
    assert finished.code == 2
    assert "0 lie on the grid, 2 outside" in finished.err
    assert len(finished.err.splitlines()) == 1


def test_waypoints_lead_the_line(run, tmp_path):
    angle = np.linspace(0, 1, 60)
    x, y = 20 * np.sin(angle), 20 - 20 * np.cos(angle)
    (tmp_path / "path.csv").write_text(
        "easting,northing\n" + "\n".join(f"{a},{b}" for a, b in zip(x, y, strict=True))
    )
    rng = np.random.default_rng(1)
    radius, at = 20 + rng.uniform(-1, 1, 60_000), rng.uniform(0, 1, 60_000)
    cloud = make_points(radius * np.sin(at), 20 - radius * np.cos(at), radius)
    formats.write(cloud, tmp_path / "cloud.csv")
    finished = run(
        "grid",
        tmp_path / "cloud.csv",
        "--path",
        tmp_path / "path.csv",
        "--smoothing",
        0,
        "--right",
        -0.8,
        "--left",
        0.8,
        "--spacing",
        0.1,
        "-o",
        tmp_path / "road.crg",
    )
    assert finished.code == 0, finished.err
    road = formats.open(tmp_path / "road.crg")
    inner = road.isel(u=slice(3, -3))
    npt.assert_allclose(
        inner.height, np.broadcast_to(20 - road.v.values, inner.height.shape), atol=2e-3
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--line", "0", "0", "1", "0", "--bounds", "0", "0", "1", "1"), "only one of line"),
        (("--spacing", "0"), "greater than 0"),
        (("--threads", "0"), "threads must be from 1 to 1024"),
        (("--min-count", "0"), "min_count must be at least 1"),
        (("--fill", "-1"), "largest must be at least 0"),
        (("--statistic", "percentile"), "--percent need each other"),
        (("--percent", "85"), "--percent need each other"),
        (("--radius", "0.1", "--statistic", "minimum"), "radius goes with the mean"),
        (("--crs", "EPSG:0"), "crs must be an EPSG code"),
        (("--floor", "5", "--saturation", "4"), "less than saturation"),
    ],
)
def test_options_without_sense_are_one_line(run, tmp_path, arguments, words):
    (tmp_path / "c.csv").write_text("easting,northing,up\n0,0,1\n1,1,2\n")
    finished = run("grid", tmp_path / "c.csv", "-o", tmp_path / "a.crg", *arguments)
    assert (finished.code, finished.out) == (2, "")
    assert words in finished.err
    assert not (tmp_path / "a.crg").exists()


def test_inputs_that_do_not_fit_are_one_line(run, recorded, tmp_path):
    path, _ = recorded
    (tmp_path / "c.csv").write_text("easting,northing,up\n0,0,1\n1,1,2\n")
    (tmp_path / "p.csv").write_text("s,height\n0,0\n1,0\n")
    for arguments, words in (
        (
            ("grid", path, tmp_path / "c.csv", "-o", tmp_path / "a.crg"),
            "Grid runs and points separately",
        ),
        (("grid", tmp_path / "p.csv", "-o", tmp_path / "a.crg"), "recorded run or points"),
        (("grid", path, "--line", 0, 0, 9, 0, "-o", tmp_path / "a.tif"), "write .crg"),
        (("georeference", tmp_path / "c.csv", "-o", tmp_path / "a.laz"), "must be a recorded run"),
        (("georeference", path, "-o", tmp_path / "a.laz", "--crs", "EPSG:4326"), "projected"),
        (("georeference", path, "-o", tmp_path / "a.laz", "--crs", "EPSG:7415"), "without heights"),
        (("georeference", path, "-o", tmp_path / "a.laz", "--crs", "EPSG:3857"), "scale factor"),
        (("georeference", path, "-o", tmp_path / "a.crg"), "can be written to"),
        (("georeference", path, "-o", tmp_path / "a.laz", "--furthest", 0.5), "no return in"),
    ):
        finished = run(*arguments)
        assert finished.code == 2
        assert words in finished.err.splitlines()[-1]
    assert not list(tmp_path.glob("a.*"))


# --- Zarr stores ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_run_becomes_points_in_a_store_and_these_a_surface(run, recorded, tmp_path):
    """The same points as in LAZ, but for its steps; and the same surface from either."""
    path, _ = recorded
    for name in ("p.zarr", "p.laz"):
        finished = run("georeference", path, "-o", tmp_path / name, "--json", "--method", "wiener")
        assert finished.code == 0, finished.err
    count = json.loads(finished.out)["points"]
    store, laz = (formats.open(tmp_path / name) for name in ("p.zarr", "p.laz"))
    assert store.sizes["point"] == laz.sizes["point"] == count
    assert {"time", "intensity", "sd"} <= set(store.data_vars)
    assert store.attrs["returns"] == count  # what was counted up to the last block
    assert [step["step"] for step in provenance.provenance_steps(store)] == ["georeference"]
    npt.assert_allclose(store.up, laz.up, rtol=0, atol=0.5e-4 + 1e-9)  # [m] half a step
    text = run("info", tmp_path / "p.zarr").out
    assert "Zarr, points" in text
    assert f"{count:,}" in text
    assert "no problems found" in text
    x, y = store.easting.values, store.northing.values
    west, south = np.floor([x.min(), y.min()]) + 1
    # cells between the edges that steps of 0.1 mm would carry points over
    bounds = (west + 0.02503, south + 0.02503, west + 3, south + 1)
    heights = []
    for name in ("p.zarr", "p.laz"):
        output = tmp_path / f"{name}.surface.zarr"
        finished = run(
            "grid",
            tmp_path / name,
            "--bounds",
            *bounds,
            "--spacing",
            0.05,
            "-o",
            output,
            "--fill",
            0,
        )
        assert finished.code == 0, finished.err
        heights.append(formats.open(output))
    npt.assert_allclose(heights[0].height, heights[1].height, rtol=0, atol=1e-3)
    parameters = provenance.provenance_steps(heights[0])[-1]["parameters"]
    assert parameters["stores"] == ["p.zarr"]
    finished = run("grid", tmp_path / "p.zarr", "--spacing", 0.5, "-o", tmp_path / "all.zarr")
    assert finished.code == 0, finished.err
    surface = formats.open(tmp_path / "all.zarr")
    assert int(surface["count"].sum()) == count  # the extent is that of all points


def test_a_run_becomes_a_road_in_a_store(run, recorded, tmp_path):
    """Along its trajectory as in CRG, with count and standard deviation, which CRG cannot hold."""
    path, _ = recorded
    for name in ("road.zarr", "road.crg"):
        finished = run("grid", path, "--spacing", 0.05, "-o", tmp_path / name)
        assert finished.code == 0, finished.err
    store, crg = (formats.open(tmp_path / name) for name in ("road.zarr", "road.crg"))
    assert {"count", "sd", "filled"} <= set(store.data_vars)
    steps = provenance.provenance_steps(store)
    assert [step["step"] for step in steps] == ["grid", "build_surface", "grid"]
    assert steps[1]["parameters"]["motion"]["method"] == "rts"
    assert store.height.shape == crg.height.shape
    both = np.isfinite(store.height.values) & np.isfinite(crg.height.values)
    assert both.mean() > 0.5
    npt.assert_allclose(store.height.values[both], crg.height.values[both], rtol=0, atol=1e-5)
    text = run("info", tmp_path / "road.zarr").out
    assert "Zarr, surface" in text
    assert run("plot", tmp_path / "road.zarr", "-o", tmp_path / "road.png").code == 0
    assert run("convert", tmp_path / "road.zarr", "-o", tmp_path / "nodes.laz").code == 0


def test_nothing_but_a_surface_is_replaced_by_one_in_a_store(run, recorded, tmp_path):
    path, _ = recorded
    copy = shutil.copytree(path, tmp_path / "other.zarr")
    formats.write(make_points([0, 1], [0, 1], [0, 1]), tmp_path / "p.zarr")
    formats.write(
        make_surface(np.zeros((2, 2)), easting=[0, 1], northing=[0, 1]), tmp_path / "s.zarr"
    )
    for command, output, options, words in (
        ("grid", "p.zarr", (), "exists already and is not overwritten"),
        ("grid", "p.zarr", ("--force",), "is points in a store, which is never replaced"),
        ("georeference", "s.zarr", ("--force",), "is a surface in a store, which is never"),
        ("grid", "other.zarr", ("--force",), "is a recorded run, which is never replaced"),
        ("georeference", "other.zarr", ("--force",), "is a recorded run, which is never replaced"),
    ):
        finished = run(command, path, "-o", tmp_path / output, *options)
        assert finished.code == 2
        assert words in finished.err
    finished = run("grid", copy, "-o", copy, "--force")
    assert "is an input as well" in finished.err
    finished = run("grid", path, "--spacing", 0.1, "-o", tmp_path / "s.zarr", "--force")
    assert finished.code == 0, finished.err
    assert formats.open(tmp_path / "s.zarr").height.size > 4


def test_a_run_where_ground_is_required_names_grid_as_the_cure(run, recorded, tmp_path):
    path, _ = recorded
    finished = run("convert", path, "-o", tmp_path / "a.crg")
    assert finished.code == 2
    assert f"trueterrain grid {path} -o surface.crg" in finished.err


# --- trajectories that cross themselves -----------------------------------------------------------

LAP = """
name = "round"
raster = 0.05
course = { kind = "arc", radius = 6.0, angle = 7.5 }
ground = [{ kind = "sine", amplitude = 0.01, wavelength = 2.0 }]
vehicle = { model = "rigid" }
scanner = { beams = 60, spot_rays = 1 }
truth = { spacing = 0.1 }
passes = [{ name = "a", speed = { kind = "constant", speed = 15.0 } }]
"""


@pytest.fixture(scope="module")
def lap(tmp_path_factory, recorded_scene):
    """A run round a circle, a fifth of it twice."""
    folder = tmp_path_factory.mktemp("lap")
    (folder / "lap.toml").write_text(LAP)
    return recorded_scene(read_scene(folder / "lap.toml")[0])[0]


def test_a_closed_trajectory_is_refused_with_the_options_for_one_lap(run, lap, tmp_path):
    options = ("--method", "navigation", "--spacing", 0.2, "-o", tmp_path / "a.crg")
    finished = run("grid", lap, *options)
    assert finished.code == 2
    assert len(finished.err.splitlines()) == 1
    for part in (
        str(lap),
        "comes back over itself",
        "at u = 0.00 m",
        "line or path",
        "a map with bounds",
    ):
        assert part in finished.err
    end = float(re.search(r"end ([\d.]+) s", finished.err).group(1))
    finished = run("grid", lap, *options, "--end", end, "--json")
    assert finished.code == 0, finished.err
    report = json.loads(finished.out)
    # a circle of 37.7 m, less a step of looking for overlaps and one of time, and the noise
    length = (report["size"]["u"] - 1) * 0.2
    assert 33 < length < 40
    assert report["returns"]["scans_uncovered"] > 0
    # the second lap alone, over the first one, is another surface of the same ground
    finished = run("grid", lap, *options, "--begin", 1.0, "--force")
    assert finished.code == 0, finished.err
    finished = run("grid", lap, *options, "--bounds", -3, -3, 3, 3, "--force")
    assert finished.code == 0, finished.err


def waypoints(path, angles, radius=6.0):
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    path.write_text("easting,northing\n" + "\n".join(map("{},{}".format, x, y)))
    return path


@pytest.mark.parametrize(("turn", "over"), [(2 * np.pi, False), (7.0, True), (19.0, True)])
def test_waypoints_over_themselves(run, tmp_path, turn, over):
    """A whole circle, whose end meets its begin, is no overlap; a spiral on one place is."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-9, 9, (2, 50_000))
    formats.write(make_points(x, y, 0.1 * x), tmp_path / "cloud.zarr")
    path = waypoints(tmp_path / "path.csv", np.arange(0, turn + 1e-9, 2 * np.pi / 80))
    finished = run(
        "grid",
        tmp_path / "cloud.zarr",
        "--path",
        path,
        "--smoothing",
        0,
        "--spacing",
        0.2,
        "-o",
        tmp_path / "a.zarr",
    )
    assert finished.code == (2 if over else 0), finished.err
    if over:
        assert "comes back over itself" in finished.err
        assert f"{path}: " in finished.err
        assert float(re.search(r"at u = ([\d.]+) m over", finished.err).group(1)) < 38.3


@pytest.mark.parametrize(("apart", "over"), [(3.8, True), (4.1, False)])
def test_a_path_that_returns_next_to_itself(run, tmp_path, apart, over):
    """The grid is 4 m wide, half of it on each side, and the path turns around an island."""
    angle = np.linspace(-2.2, 2.2, 60)
    turn = np.stack([30 + 8 * np.cos(angle), 8 * np.sin(angle)])
    ends = [np.array([[0.0, 5.0], [side * apart / 2] * 2]) for side in (-1, 1)]
    x, y = np.concatenate([ends[0], turn, ends[1][:, ::-1]], axis=1)
    (tmp_path / "path.csv").write_text("easting,northing\n" + "\n".join(map("{},{}".format, x, y)))
    rng = np.random.default_rng(1)
    cloud = make_points(rng.uniform(-5, 42, 90_000), rng.uniform(-12, 12, 90_000), np.zeros(90_000))
    formats.write(cloud, tmp_path / "cloud.zarr")
    finished = run(
        "grid",
        tmp_path / "cloud.zarr",
        "--path",
        tmp_path / "path.csv",
        "--spacing",
        0.2,
        "--smoothing",
        0,
        "-o",
        tmp_path / "a.zarr",
    )
    assert ("comes back over itself" in finished.err) == over, finished.err
    assert finished.code == (2 if over else 0), finished.err


def test_times_without_sense_are_one_line(run, recorded, tmp_path):
    path, _ = recorded
    (tmp_path / "c.csv").write_text("easting,northing,up\n0,0,1\n1,1,2\n")
    for arguments, words in (
        ((path, path, "--begin", 0), "times of one run"),
        ((tmp_path / "c.csv", "--end", 0), "times of one run"),
        ((path, "--begin", 2, "--end", 1), "begin must be less than end"),
        ((path, "--begin", 99), "there is no motion from 99 s"),
    ):
        finished = run("grid", *arguments, "-o", tmp_path / "a.crg")
        assert finished.code == 2
        assert words in finished.err.splitlines()[-1]
