"""Recordings on the command line: info of runs, navigation and accuracy, good and bad; refusals."""

import json
import re
import shutil

import numpy as np
import pytest
import zarr

from trueterrain.formats import info
from trueterrain.simulate.scene import read_scene

SCENE = """
name = "small"
raster = 0.02
course = { kind = "straight", length = 4.0 }
ground = [{ kind = "sine", amplitude = 0.01, wavelength = 2.0 }]
vehicle = { model = "rigid" }
scanner = { beams = 20, spot_rays = 1 }
mounting = { scanner_clock = 0.0013, scanner_rotation = [0.01, 0.0, 0.0] }
truth = { spacing = 0.1 }
passes = [{ name = "a", speed = { kind = "constant", speed = 5.0 } }]
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory, recorded_scene):
    """A whole run on disk; tests do not change it."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "small.toml").write_text(SCENE)
    return recorded_scene(read_scene(folder / "small.toml")[0])[0]


@pytest.fixture
def copy(store, tmp_path):
    """A run on disk that may be damaged."""
    return shutil.copytree(store, tmp_path / "bad.zarr")


@pytest.fixture
def sbet(data):
    return data / "scanning" / "georeference" / "leeward" / "sbet.out"


@pytest.fixture
def smrmsg(data):
    return data / "scanning" / "accuracy" / "smrmsg.smrmsg"


def rows(text):
    """Titles and texts; where a title goes on, its texts are joined."""
    found, title = {}, ""
    for line in text.splitlines()[1:]:
        key, _, value = line.strip().partition("  ") if line[2] != " " else ("", "", line.strip())
        title = key or title
        found[title] = f"{found.get(title, '')} {value.strip()}".strip()
    return found


# --- info -----------------------------------------------------------------------------------------


def test_text_of_a_run(run, store):
    finished = run("info", store)
    assert (finished.code, finished.err) == (0, "")
    assert finished.out.splitlines()[0] == str(store)
    assert max(map(len, finished.out.splitlines()[1:])) <= 110
    found = rows(finished.out)
    assert re.fullmatch(r"Run, run, [\d,]+ bytes", found["format"])
    assert found["name"] == "small-a"
    assert found["origin"] == "longitude 11 deg, latitude 48 deg, height 500.000 m"
    assert found["time"] == "seconds since an arbitrary epoch"
    for part in (
        "800 scans of 20 beams, 1000 Hz, -0.001 to 0.798 s (0.799 s)",
        "angles -45.000 to 45.000 deg",
        "returns with intensity",
        "of the beams without a return",
    ):
        assert part in found["scans"], part
    assert "200 epochs, 200 Hz, -0.100 to 0.895 s (0.995 s)" in found["navigation"]
    distance, fastest = re.search(
        r"distance ([\d.]+) m, up to ([\d.]+) m/s", found["navigation"]
    ).groups()
    assert abs(float(distance) - 5 * 0.995) < 0.05  # [m] noise of 1 mm in each of some positions
    assert abs(float(fastest) - 5.0) < 0.1
    assert "2,000 samples of 3 sensors, 2000 Hz" in found["accelerometers"]
    assert found["gaps"] == "none"
    assert found["begin"].startswith("navigation -0.100 s, accelerometers -0.100 s, scans 0.00")
    assert found["scanner at"] == (
        "-2.25, 0, 1.2 m (forward, left, up), turned by 0.572958, 0, 0 deg (roll, pitch, yaw)"
    )
    assert found["clocks"] == "scanner +1.3 ms, accelerometers +0 ms"
    assert "ground" in found["truth"]
    assert found["problems"] == "no problems found"


def test_text_of_navigation(run, sbet):
    found = rows(run("info", sbet).out)
    assert found["format"] == "SBET, navigation, 27,200 bytes"
    assert found["epochs"] == (
        "200, 200 Hz, 400825.001 to 400825.997 s (0.995 s), jitter 0.0028 ms (rms)"
    )
    assert found["longitude"] == "-119.0238236 to -119.0233647 deg"
    assert found["height"] == "6991.647 to 6991.681 m"
    assert found["speed"] == "up to 110.40 m/s"
    assert found["gaps"] == "none"
    assert found["CRS"] == "unknown"
    assert found["problems"] == "no problems found"


def test_text_of_accuracy(run, smrmsg):
    found = rows(run("info", smrmsg).out)
    assert found["epochs"] == "21,902, 1 Hz, 536258.000 to 558159.000 s (21901.000 s)"
    assert found["median sd"] == (
        "east 0.038, north 0.041, up 0.047 m; roll 0.0022, pitch 0.0022, yaw 0.0173 deg"
    )
    assert found["largest sd"].startswith("east 0.238, north 0.243, up 1.127 m; roll 0.0039,")


def test_gaps_of_navigation_are_listed(run, sbet, tmp_path):
    records = np.fromfile(sbet, "<f8").reshape(-1, 17)
    records = np.delete(records, [*range(20, 30), *range(100, 150)], axis=0)
    records.tofile(tmp_path / "gaps.out")
    found = rows(run("info", tmp_path / "gaps.out").out)
    assert re.fullmatch(
        r"0\.05\d+ s from 400825\.0\d+ s on 0\.25\d+ s from 400825\.\d+ s on", found["gaps"]
    )
    assert "2 gaps in time, the longest 0.25" in found["problems"]


def test_json_of_recordings_is_that_of_the_formats(run, store, sbet, smrmsg):
    files = json.loads(run("info", store, sbet, smrmsg, "--json").out)["files"]
    assert [entry["kind"] for entry in files] == ["run", "navigation", "accuracy"]
    for entry, path in zip(files, (store, sbet, smrmsg), strict=True):
        assert entry == json.loads(json.dumps(info(path)))
    assert files[0]["scans"]["count"] == 800
    assert files[0]["bytes"] == sum(f.stat().st_size for f in store.rglob("*") if f.is_file())


def attribute(copy, group, change):
    """Change the metadata of a group or array."""
    file = copy / group / "zarr.json"
    text = json.loads(file.read_text())
    change(text)
    file.write_text(json.dumps(text))


def backwards(copy):
    zarr.open_group(copy, mode="r+")["scans/time"][50] = 0.0


def without_numbers(copy):
    zarr.open_group(copy, mode="r+")["navigation/east"][7] = np.nan


def outside(copy):
    attribute(copy, "", lambda text: text["attributes"]["mounting"].update(scanner_clock=3.0))


def misspelt(copy):
    def change(text):
        mounting = text["attributes"]["mounting"]
        mounting["scaner_clock"] = mounting.pop("scanner_clock")

    attribute(copy, "", change)


def another_dimension(copy):
    attribute(copy, "navigation/up", lambda text: text.update(dimension_names=["epochs"]))


def another_unit(copy):
    attribute(copy, "navigation/roll", lambda text: text["attributes"].update(units="deg"))


def another_variable(copy):
    (copy / "navigation" / "yaw").rename(copy / "navigation" / "heading")


def another_group(copy):
    (copy / "accelerometers").rename(copy / "accelerometer")


def without_navigation(copy):
    shutil.rmtree(copy / "navigation")


def without_a_chunk(copy):
    next((copy / "scans" / "range").glob("c.*")).unlink()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        (backwards, r"scans, variable time: must run forward, but value 50 .* follows"),
        (without_numbers, r"navigation, variable east: must be finite .*nan at index 7"),
        (outside, r"scans, variable time: \d+ of 800 scans lie outside of the navigation by up to"),
        (misspelt, r"attribute mounting: the key 'scaner_clock' is unknown \(did you mean"),
        (another_dimension, r"variable up: .*epoch"),
        (another_unit, r"variable roll: .*rad.*deg"),
        (another_variable, r"variable heading: is unknown|variable yaw: is missing"),
        (another_group, r"group accelerometer: is unknown \(did you mean 'accelerometers'\?\)"),
        (without_navigation, r"group navigation: is missing"),
        (without_a_chunk, r"array scans/range: 1 of 1 chunks are missing"),
    ],
)
def test_info_reports_invalid_recordings(run, copy, damage, problem):
    damage(copy)
    finished = run("info", copy)
    assert (finished.code, finished.err) == (0, "")
    reported = rows(finished.out)["problems"]
    assert re.search(problem, reported), reported
    (entry,) = json.loads(run("info", copy, "--json").out)["files"]
    assert any(re.search(problem, text) for text in entry["problems"])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda copy: (copy / "zarr.json").write_text("{"), "zarr.json: is damaged"),
        (lambda copy: (copy / "scans" / "time" / "zarr.json").write_text("{"), "is damaged"),
    ],
)
def test_unreadable_runs_are_one_line(run, copy, damage, message):
    damage(copy)
    finished = run("info", copy)
    assert (finished.code, finished.out) == (2, "")
    assert finished.err.startswith(f"trueterrain: error: {copy}: ")
    assert finished.err.count("\n") == 1
    assert message in finished.err


def test_navigation_that_is_cut_off_is_one_line(run, sbet, tmp_path):
    (tmp_path / "cut.out").write_bytes(sbet.read_bytes()[:-10])
    finished = run("info", tmp_path / "cut.out")
    assert finished.code == 2
    assert "which is no multiple of the 136 bytes of a SBET record" in finished.err
    assert finished.err.count("\n") == 1


# --- commands that want ground --------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["run", "navigation", "accuracy"])
@pytest.mark.parametrize(
    "command",
    [
        ("convert", "FILE", "-o", "x.laz"),
        ("convert", "FILE", "-o", "x.erd"),
        ("iri", "FILE"),
        ("profile", "FILE", "--line", 0, 0, 1, 0, "-o", "x.erd"),
        ("profile", "FILE", "--offset", 0, "-o", "x.erd"),
    ],
)
def test_recordings_are_no_ground_yet(run, store, sbet, smrmsg, tmp_path, kind, command):
    path = {"run": store, "navigation": sbet, "accuracy": smrmsg}[kind]
    places = {"FILE": path, "x.laz": tmp_path / "x.laz", "x.erd": tmp_path / "x.erd"}
    finished = run(*(places.get(word, word) for word in command))
    assert (finished.code, finished.out) == (2, "")
    named = {"run": "a run", "accuracy": "the accuracy of navigation"}.get(kind, kind)
    assert finished.err.startswith(f"trueterrain: error: {path}: is {named}, not a")
    assert "this needs georeferenced points" in finished.err
    assert f"trueterrain info {path}" in finished.err
    assert finished.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
