"""Runs: written block by block, read lazily, checked, described, imported."""

import dataclasses
import json
import math
import shutil
import tracemalloc
import warnings

import numpy as np
import numpy.testing as npt
import pandas as pd
import pytest
import xarray as xr
import zarr

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, FormatError, OutputError, SchemaError
from trueterrain.formats import run as runs
from trueterrain.formats.run import (
    Mounting,
    RunFiles,
    RunWriter,
    ScanTable,
    check_run,
    describe,
    import_run,
    open_run,
    scan_blocks,
)
from trueterrain.formats.run import _scans as scan_tables
from trueterrain.formats.settings import parse_settings, settings_template

HALF_STEP = {"rtol": 0, "atol": 0.5e-4 + 1e-12}  # [m] ranges are rounded to 0.1 mm
ROUND_OFF = {"rtol": 0, "atol": 1e-12}  # a scale that is no power of two

BEAMS, SCANS, EPOCHS, SAMPLES = 11, 2345, 700, 1500
ORIGIN = (11.5, 48.1, 512.25)
POSE = ("east", "north", "up", "roll", "pitch", "yaw")
MOUNTING = Mounting(
    scanner_position=(-1.2, 0.05, 1.9), scanner_rotation=(0.01, -0.02, 0.03), scanner_clock=0.002
)


def recording(*, beams=BEAMS, scans=SCANS):
    """Arrays of a run that last 2.345 s at 1000 scans/s."""
    rng = np.random.default_rng(8)
    ranges = rng.uniform(1.5, 3.0, (scans, beams))
    ranges[rng.random(ranges.shape) < 0.05] = np.nan
    navigation = {name: rng.normal(size=EPOCHS) * 0.01 for name in POSE}
    navigation |= {"time": 99.0 + 0.005 * np.arange(EPOCHS), "sd_up": rng.uniform(0, 1, EPOCHS)}
    return {
        "time": 100.0 + 0.001 * np.arange(scans) + rng.uniform(0, 1e-6, scans),
        "range": ranges,
        "intensity": rng.integers(0, 65536, ranges.shape).astype(np.uint16),
        "angle": np.linspace(-0.7, 0.7, beams),
        "delay": np.linspace(0, 0.0009, beams),
        "navigation": navigation,
        "sample": 96.25 + 0.004 * np.arange(SAMPLES),  # long enough for their median to tell
        "acceleration": rng.normal(9.81, 0.1, (SAMPLES, 3)),
        "position": np.array([[1.0, 0.5, 0.3], [1.0, -0.5, 0.3], [-1.0, 0.0, 0.3]]),
    }


def pose_truth(data):
    wave = np.sin(data["time"])
    return xr.Dataset(
        {
            "time": ("scan", data["time"], {"units": "s"}),
            "matrix": (("scan", "row"), np.stack([wave, 2 * wave], axis=-1)),
            "step": ("row", [1, 2]),
        },
        attrs={"source": "simulated", "seed": np.int64(3)},
    )


def ground_truth():
    return xr.Dataset(
        {"height": (("u", "v"), np.arange(6.0).reshape(2, 3), {"units": "m"})},
        {"u": [0.0, 1.0], "v": [0.0, 1.0, 2.0]},
    )


def record(path, data, *, block=SCANS, accelerometers=True, intensity=True, truth=True, **changed):
    """Write a recording in blocks of one size."""
    chosen = {
        "name": "test",
        "origin": ORIGIN,
        "time_reference": "gps",
        "mounting": MOUNTING,
        "angle": data["angle"],
        "delay": data["delay"],
        "accelerometer_positions": data["position"] if accelerometers else None,
        "truth": {"ground": ground_truth()} if truth is True else truth or None,
    }
    with RunWriter(path, **(chosen | changed)) as run:
        navigation = data["navigation"]
        for start in range(0, len(navigation["time"]), block):
            rows = slice(start, start + block)
            run.append_navigation({name: values[rows] for name, values in navigation.items()})
        for start in range(0, len(data["time"]), block):
            rows = slice(start, start + block)
            strength = data["intensity"][rows] if intensity else None
            run.append_scans(data["time"][rows], data["range"][rows], strength)
            if truth:
                run.append_truth("pose", pose_truth(data).isel(scan=rows), dim="scan")
        for start in range(0, SAMPLES if accelerometers else 0, block):
            rows = slice(start, start + block)
            run.append_accelerometers(data["sample"][rows], data["acceleration"][rows])
    return path


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A complete run on disk; tests do not change it."""
    return record(tmp_path_factory.mktemp("run") / "good.zarr", recording())


@pytest.fixture
def copy(store, tmp_path):
    """A run on disk that may be damaged."""
    return shutil.copytree(store, tmp_path / "bad.zarr")


def loaded(store):
    """A run in memory that may be changed."""
    return open_run(store).load().copy(deep=True)


def group(tree, name):
    return tree[name].to_dataset(inherit=False)


def changed(tree, name, **variables):
    """A tree with variables of a group replaced; their dims and units stay."""
    data = group(tree, name)
    for variable, values in variables.items():
        data[variable] = (data[variable].dims, values, data[variable].attrs)
    return with_group(tree, name, data)


def with_group(tree, name, data):
    parts = {path: node.to_dataset(inherit=False) for path, node in tree.subtree_with_keys}
    return xr.DataTree.from_dict(parts | {name: data})


# --- the store ------------------------------------------------------------------------------------


def test_a_run_is_read_as_it_was_written(store):
    data, tree = recording(), open_run(store)
    scans = group(tree, "scans")
    npt.assert_allclose(scans["range"], data["range"], **HALF_STEP)
    npt.assert_array_equal(np.isnan(scans["range"]), np.isnan(data["range"]))
    for name in ("time", "intensity", "angle", "delay"):
        npt.assert_array_equal(scans[name], data[name])
    for name, values in data["navigation"].items():
        npt.assert_array_equal(tree["navigation"][name], values)
    sensors = group(tree, "accelerometers")
    npt.assert_array_equal(sensors["time"], data["sample"])
    npt.assert_array_equal(sensors["acceleration"], data["acceleration"])
    npt.assert_array_equal(sensors["position"], data["position"])
    xr.testing.assert_identical(group(tree, "truth/ground"), ground_truth())
    pose = group(tree, "truth/pose")
    npt.assert_array_equal(pose["matrix"], pose_truth(data)["matrix"])
    npt.assert_array_equal(pose["step"], [1, 2])
    assert pose.attrs == {"source": "simulated", "seed": 3}


def test_the_store_has_the_specified_layout(store):
    tree = open_run(store)
    assert tree.attrs["kind"] == "trueterrain/run"
    assert tree.attrs["schema"] == 1
    assert tree.attrs["name"] == "test"
    assert tree.attrs["origin"] == list(ORIGIN)
    assert tree.attrs["time_reference"] == "gps"
    assert tree.attrs["mounting"] == {
        "scanner_position": [-1.2, 0.05, 1.9],
        "scanner_rotation": [0.01, -0.02, 0.03],
        "scanner_clock": 0.002,
        "accelerometer_clock": 0.0,
    }
    assert Mounting.from_attrs(tree.attrs["mounting"]) == MOUNTING
    scans = group(tree, "scans")
    dims = {name: variable.dims for name, variable in scans.data_vars.items()}
    assert dims == {
        "time": ("scan",),
        "range": ("scan", "beam"),
        "intensity": ("scan", "beam"),
        "angle": ("beam",),
        "delay": ("beam",),
    }
    assert {name: v.attrs["units"] for name, v in scans.data_vars.items()} == {
        "time": "s",
        "range": "m",
        "intensity": "1",
        "angle": "rad",
        "delay": "s",
    }
    assert dict(tree["accelerometers"].sizes) == {"sample": SAMPLES, "sensor": 3, "axis": 3}
    root = zarr.open_group(store, mode="r")
    assert root.metadata.zarr_format == 3
    ranges = root["scans/range"]
    assert ranges.dtype == np.uint16
    assert ranges.chunks == (1000, BEAMS)
    assert ranges.shards is None
    assert ranges.attrs["scale_factor"] == 1e-4
    assert ranges.attrs["_FillValue"] == 65535 == ranges.fill_value
    assert root["scans/time"].dtype == np.float64


def test_a_run_is_opened_lazily(store, tmp_path):
    copy = shutil.copytree(store, tmp_path / "hollow.zarr")
    tree = open_run(copy)
    for file in (copy / "scans" / "range").glob("c.[12].*"):
        file.unlink()
    assert tree["scans"]["range"].shape == (SCANS, BEAMS)
    assert "dask" not in type(tree["scans"]["range"].variable._data).__module__
    # opening compared the names of the chunks, and read none of them
    npt.assert_allclose(tree["scans"]["range"][:1000], recording()["range"][:1000], **HALF_STEP)
    with pytest.raises(FormatError, match=r"scans/range, chunk c\.1\.0: is damaged \(the file"):
        tree["scans"]["range"].load()
    one = open_run(store)["scans"]["range"].isel(scan=slice(1500, 1510))
    npt.assert_allclose(one, recording()["range"][1500:1510], **HALF_STEP)


def test_a_run_is_opened_once_and_passed_on(store):
    run = open_run(store)
    assert open_run(run) is run
    assert run.source == store
    assert run.file_name == store.name
    assert run.mounting == Mounting.from_attrs(run.attrs["mounting"])
    assert list(run.origin) == run.attrs["origin"]
    steps = run.stored["scans/range"]
    lost = np.isnan(run["scans/range"].values)
    assert steps.dtype == np.uint16
    npt.assert_array_equal(steps.read() == steps.attrs["_FillValue"], lost)
    npt.assert_array_equal((steps.read() * 1e-4)[~lost], run["scans/range"].values[~lost])


def test_a_run_in_memory_has_no_store(store):
    tree = loaded(store)
    run = open_run(tree)
    assert run.source is None
    assert run.file_name == tree.attrs["name"]
    assert open_run(store).copy().source is None
    xr.testing.assert_identical(run["scans"].to_dataset(), tree["scans"].to_dataset())
    with pytest.raises(ValueError, match="write it first"):
        _ = run.stored
    del tree.attrs["mounting"]
    with pytest.raises(SchemaError, match="attribute mounting: is missing"):
        _ = open_run(tree).mounting


def test_blocks_of_any_size_give_the_same_bytes(store, tmp_path):
    data = recording()
    whole = {file.relative_to(store): file.read_bytes() for file in files_of(store)}
    for block in (1, 77, 1000, 1001):
        path = record(tmp_path / f"{block}.zarr", data, block=block) if block > 1 else None
        if path is None:  # scan by scan, for the first few
            continue
        assert {file.relative_to(path): file.read_bytes() for file in files_of(path)} == whole


def files_of(path):
    return sorted(file for file in path.rglob("*") if file.is_file())


def test_scan_by_scan_gives_the_same_bytes(tmp_path):
    data = recording(scans=30)
    data["navigation"] = {name: values[:300] for name, values in data["navigation"].items()}
    bytes_of = {}
    for block in (1, 30):
        path = record(tmp_path / f"{block}.zarr", data, block=block, accelerometers=False)
        bytes_of[block] = [file.read_bytes() for file in files_of(path)]
    assert bytes_of[1] == bytes_of[30]


def test_scan_blocks_give_all_scans_in_order(store):
    whole = group(open_run(store), "scans").load()
    for size in (1, 1000, 999, 10_000):
        if size == 1:
            first = next(scan_blocks(store, size=1))
            assert first.sizes["scan"] == 1
            continue
        blocks = list(scan_blocks(open_run(store), size=size))
        assert [block.attrs["first_scan"] for block in blocks] == list(range(0, SCANS, size))
        for name in ("time", "range", "intensity"):
            joined = np.concatenate([block[name].values for block in blocks])
            npt.assert_array_equal(joined, whole[name].values)
        npt.assert_array_equal(blocks[-1]["angle"], whole["angle"])
    with pytest.raises(ValueError, match="size must be at least 1 scan, got 0"):
        next(scan_blocks(store, size=0))


def test_quantisation_is_exact_to_half_a_step(tmp_path):
    data = recording(beams=3, scans=4)
    data["range"] = np.array(
        [[1.0, 2.00004, 2.00006], [0.0001, 6.5534, np.nan], [1.23456, 3.3, 2.2], [1, 1, 1]]
    )
    data["intensity"] = np.zeros((4, 3))
    path = record(tmp_path / "q.zarr", data, accelerometers=False, truth=False)
    stored = zarr.open_group(path, mode="r")["scans/range"][:]
    npt.assert_array_equal(
        stored, [[10000, 20000, 20001], [1, 65534, 65535], [12346, 33000, 22000], [10000] * 3]
    )


def test_longer_ranges_take_four_bytes(tmp_path):
    data = recording(beams=3, scans=4)
    data["range"] = np.full((4, 3), 123.45678)
    path = record(
        tmp_path / "far.zarr",
        data,
        intensity=False,
        max_range=200.0,
        truth=False,
        accelerometers=False,
    )
    ranges = open_run(path)["scans"]["range"]
    assert ranges.encoding["dtype"] == np.uint32
    npt.assert_allclose(ranges, 123.4568, **ROUND_OFF)
    assert "intensity" not in open_run(path)["scans"]


@pytest.mark.slow
def test_memory_stays_flat_while_a_run_is_written(tmp_path):
    """Fifty times the scans take no more memory."""

    def peak(blocks):
        still = {name: np.zeros(2) for name in POSE}
        ranges = np.full((500, 40), 2.0)
        tracemalloc.start()
        with RunWriter(
            tmp_path / f"{blocks}.zarr",
            name="x",
            origin=ORIGIN,
            time_reference="run",
            mounting=Mounting(),
            angle=np.linspace(-1, 1, 40),
            delay=np.zeros(40),
        ) as run:
            run.append_navigation({"time": [-1.0, 1e6], **still})
            for block in range(blocks):
                run.append_scans(block + np.arange(500) / 500, ranges)
        highest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return highest

    peak(2)  # the first run also loads what it needs
    assert peak(100) < 1.5 * peak(3)


def test_a_run_in_memory_is_written_and_read(store, tmp_path):
    tree = loaded(store)
    calls = []
    runs.write(tree, tmp_path / "again.zarr", progress=lambda *words: calls.append(words))
    again = open_run(tmp_path / "again.zarr")
    for path, node in tree.subtree_with_keys:
        for name, variable in node.to_dataset(inherit=False).variables.items():
            npt.assert_array_equal(again[path].to_dataset(inherit=False)[name], variable)
    assert again.attrs == tree.attrs
    assert calls[-1] == ("scans", SCANS, SCANS)


def test_part_of_a_run_is_written_and_read(store, tmp_path):
    tree = open_run(store)
    scans = group(tree, "scans").isel(scan=slice(100, 200))
    runs.write(with_group(tree, "scans", scans), tmp_path / "cut.zarr")
    npt.assert_array_equal(
        open_run(tmp_path / "cut.zarr")["scans"]["range"], tree["scans"]["range"][100:200]
    )


# --- all or nothing -------------------------------------------------------------------------------


def test_a_run_that_fails_leaves_nothing(tmp_path):
    data = recording()
    data["time"][SCANS // 2] = 0.0
    with pytest.raises(SchemaError, match="must run forward"):
        record(tmp_path / "x.zarr", data, block=100)
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_navigation_or_scans_leaves_nothing(tmp_path):
    data = recording()
    with (
        pytest.raises(SchemaError, match=r"x.zarr: group scans: is missing"),
        RunWriter(
            tmp_path / "x.zarr",
            name="x",
            origin=ORIGIN,
            time_reference="run",
            mounting=Mounting(),
            angle=data["angle"],
            delay=data["delay"],
        ),
    ):
        pass
    data["navigation"] = {name: values[:10] for name, values in data["navigation"].items()}
    with pytest.raises(SchemaError, match=r"x.zarr: scans, variable time: 2345 of 2345 scans lie"):
        record(tmp_path / "x.zarr", data)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten_without_force(tmp_path):
    data = recording()
    path = record(tmp_path / "x.zarr", data)
    with pytest.raises(OutputError, match="exists already"):
        record(path, data)
    data["intensity"] = np.zeros_like(data["intensity"])
    with (
        pytest.raises(ZeroDivisionError),
        RunWriter(
            path,
            name="x",
            origin=ORIGIN,
            time_reference="run",
            mounting=Mounting(),
            force=True,
            angle=data["angle"],
            delay=data["delay"],
        ),
    ):
        _ = 1 / 0
    assert open_run(path)["scans"]["intensity"].values.any()
    record(path, data, force=True)
    assert not open_run(path)["scans"]["intensity"].values.any()
    assert [file.name for file in tmp_path.iterdir()] == ["x.zarr"]


def test_only_stores_are_replaced(tmp_path):
    folder = tmp_path / "precious.zarr"
    folder.mkdir()
    (folder / "work.txt").write_text("years")
    with pytest.raises(OutputError, match="is no Zarr store"):
        record(folder, recording(), force=True)
    assert (folder / "work.txt").read_text() == "years"


def test_paths_of_a_run(tmp_path):
    with pytest.raises(ValueError, match=r"path must end with .zarr"):
        record(tmp_path / "x.run", recording())
    with pytest.raises(OutputError, match="does not exist"):
        record(tmp_path / "no" / "x.zarr", recording())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time_reference": "utc"}, "time_reference must be one of"),
        ({"origin": (0.0, 100.0, 0.0)}, "origin must have"),
        ({"angle": [0.0, 1.0]}, r"same shape \(beam,\), got \(2,\) and \(11,\)"),
        ({"accelerometer_positions": [1.0, 2.0, 3.0]}, r"shape \(sensor, 3\), got \(3,\)"),
        ({"max_range": 0.0}, "max_range must be greater than 0 m"),
        ({"max_range": 1e9}, "max_range must be"),
        ({"truth": {"x": xr.Dataset({"name": ("u", ["a"])})}}, "truth/x/name must hold numbers"),
    ],
)
def test_arguments_of_the_writer(tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        record(tmp_path / "x.zarr", recording(), **change)
    assert list(tmp_path.iterdir()) == []


def test_a_writer_outside_of_a_with_statement(tmp_path):
    data = recording()
    run = RunWriter(
        tmp_path / "x.zarr",
        name="x",
        origin=ORIGIN,
        time_reference="run",
        mounting=Mounting(),
        angle=data["angle"],
        delay=data["delay"],
    )
    with pytest.raises(ValueError, match="with statement"):
        run.append_scans(data["time"], data["range"])


def appending(tmp_path, action):
    """Check that a writer leaves nothing after an error."""
    data = recording()
    try:
        with RunWriter(
            tmp_path / "x.zarr",
            name="x",
            origin=ORIGIN,
            time_reference="run",
            mounting=Mounting(),
            angle=data["angle"],
            delay=data["delay"],
        ) as run:
            action(run, data)
    finally:
        assert list(tmp_path.iterdir()) == []


def test_blocks_must_have_equal_variables_and_shapes(tmp_path):
    def wrong_beams(run, data):
        run.append_scans(data["time"], data["range"][:, :5])

    def wrong_scans(run, data):
        run.append_scans(data["time"][:7], data["range"])

    def wrong_intensity(run, data):
        run.append_scans(data["time"], data["range"], data["intensity"][:3])

    def intensity_goes(run, data):
        run.append_scans(data["time"][:5], data["range"][:5], data["intensity"][:5])
        run.append_scans(data["time"][5:], data["range"][5:])

    def unknown_name(run, data):
        run.append_navigation({"heading": [1.0]})

    def sd_goes(run, data):
        rows = {name: values[:3] for name, values in data["navigation"].items()}
        run.append_navigation(rows)
        later = {name: values[3:] for name, values in data["navigation"].items()}
        run.append_navigation({name: v for name, v in later.items() if name != "sd_up"})

    def no_sensors(run, data):
        run.append_accelerometers(data["sample"], data["acceleration"])

    def no_dim(run, data):
        run.append_truth("pose", pose_truth(data))

    def other_dim(run, data):
        run.append_truth("pose", pose_truth(data), dim="epoch")

    for action, message in (
        (wrong_beams, r"range must have the shape \(2345, 11\), got \(2345, 5\)"),
        (wrong_scans, r"range must have the shape \(7, 11\)"),
        (wrong_intensity, r"intensity must have the shape \(2345, 11\), got \(3, 11\)"),
        (intensity_goes, "scans must hold the same variables in every block, but intensity came"),
        (unknown_name, "navigation must hold .*, got 'heading'"),
        (sd_goes, "sd_up came or went"),
        (no_sensors, "accelerometer_positions must be given"),
        (no_dim, r"dim must be one of \['row', 'scan'\], got None"),
        (other_dim, r"dim must be one of \['row', 'scan'\], got 'epoch'"),
    ):
        with pytest.raises(ValueError, match=message):
            appending(tmp_path, action)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, 6.6])
def test_impossible_ranges_are_refused(tmp_path, value):
    def action(run, data):
        run.append_scans(data["time"][:5], data["range"][:5])
        data["range"][7, 3] = value
        run.append_scans(data["time"][5:], data["range"][5:])

    cure = "max_range" if value > 0 else "NaN where there was no return"
    message = rf"range: must be .* less than 6.5535 m, got {value:g} m at scan 7, beam 3.*{cure}"
    with pytest.raises(SchemaError, match=message):
        appending(tmp_path, action)


@pytest.mark.parametrize("value", [-1.0, 1.5, 70000.0])
def test_impossible_intensities_are_refused(tmp_path, value):
    def action(run, data):
        strength = data["intensity"].astype(float)
        strength[7, 3] = value
        run.append_scans(data["time"], data["range"], strength)

    with pytest.raises(SchemaError, match=r"whole number from 0 to 65535, got .* scan 7, beam 3"):
        appending(tmp_path, action)


def test_intensities_without_a_return_become_zero(tmp_path):
    data = recording()
    data["intensity"] = np.where(np.isnan(data["range"]), np.nan, 5.0)
    path = record(tmp_path / "x.zarr", data)
    npt.assert_array_equal(
        open_run(path)["scans"]["intensity"], np.where(np.isnan(data["range"]), 0, 5)
    )


def test_bad_navigation_is_refused_when_it_is_appended(tmp_path):
    def action(run, data):
        for start in (0, 300):
            rows = slice(start, start + 300)
            block = {name: values[rows].copy() for name, values in data["navigation"].items()}
            if start:
                block["yaw"][5] = np.nan
            run.append_navigation(block)

    with pytest.raises(SchemaError, match=r"navigation, variable yaw: .* nan at index 305 \(time"):
        appending(tmp_path, action)


# --- the mounting ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scanner_position": (0.0, 1.0)}, "scanner_position must be three numbers"),
        ({"scanner_position": (0.0, 1.0, math.nan)}, "scanner_position must be three numbers"),
        ({"scanner_position": (0.0, 0.0, 1900.0)}, "scanner_position must be in metres"),
        ({"scanner_rotation": (0.0, 0.0, 90.0)}, "scanner_rotation must be in radians"),
        ({"scanner_clock": math.inf}, "scanner_clock must be in seconds"),
        ({"accelerometer_clock": 1e6}, "accelerometer_clock must be in seconds"),
    ],
)
def test_impossible_mountings_are_refused(store, change, message):
    with pytest.raises(ValueError, match=message):
        Mounting(**change)
    tree = loaded(store)
    tree.attrs["mounting"] |= {
        name: list(value) if isinstance(value, tuple) else value for name, value in change.items()
    }
    with pytest.raises(SchemaError, match=f"attribute mounting: {message}"):
        check_run(tree)


# --- bad recordings -------------------------------------------------------------------------------


def test_a_good_run_passes(store):
    tree = open_run(store)
    assert check_run(tree, store) is tree
    assert check_run(loaded(store)) is not None
    # rates and accelerations of a run as floats, as long as it is in memory
    check_run(changed(loaded(store), "scans", range=np.full((SCANS, BEAMS), np.float32(2))))


def test_time_that_runs_backwards(store):
    tree = loaded(store)
    time = tree["scans"]["time"].values.copy()
    time[1234] = time[1233] - 0.01
    message = (
        rf"^x.zarr: scans, variable time: must run forward, but value 1234 \({time[1234]:.6f} s\) "
        rf"follows {time[1233]:.6f} s\. Cut"
    )
    with pytest.raises(SchemaError, match=message):
        check_run(changed(tree, "scans", time=time), "x.zarr")
    epochs = tree["navigation"]["time"].values.copy()
    epochs[5] = epochs[4]
    with pytest.raises(
        SchemaError, match="navigation, variable time: must run forward, but value 5"
    ):
        check_run(changed(tree, "navigation", time=epochs))
    samples = tree["accelerometers"]["time"].values[::-1]
    with pytest.raises(SchemaError, match=r"accelerometers, variable time: .*value 1 "):
        check_run(changed(tree, "accelerometers", time=samples))


def test_time_that_runs_backwards_between_two_blocks(store):
    """The rules are checked across the limits of blocks."""
    from trueterrain.core.schemas.navigation import TimeChecker

    clock = TimeChecker(path=None, place="time")
    clock.check(np.array([1.0, 2.0]))
    clock.check(np.array([]))
    with pytest.raises(SchemaError, match=r"value 2 \(2.000000 s\) follows 2.000000 s"):
        clock.check(np.array([2.0, 3.0]))


def test_nan_in_the_navigation(store):
    tree = loaded(store)
    east = tree["navigation"]["east"].values.copy()
    east[[321, 322]] = np.nan
    time = float(tree["navigation"]["time"][321])
    message = (
        rf"navigation, variable east: must be finite everywhere, got nan at index 321 "
        rf"\(time {time:.6f} s\) and 1 more"
    )
    with pytest.raises(SchemaError, match=message):
        check_run(changed(tree, "navigation", east=east))


def test_nan_in_times(store):
    time = loaded(store)["scans"]["time"].values
    time[7] = np.nan
    with pytest.raises(SchemaError, match=r"scans, variable time: must be finite .* at index 7"):
        check_run(changed(loaded(store), "scans", time=time))


def test_scans_outside_of_the_navigation(store):
    tree = loaded(store)
    navigation = group(tree, "navigation")
    short = navigation.isel(epoch=slice(0, 300))  # ends at 100.495 s
    last = float(short["time"][-1])
    true = tree["scans"]["time"].values + 0.002 + 0.0009
    outside = int(np.count_nonzero(true > last))
    message = (
        rf"scans, variable time: {outside} of {SCANS} scans lie outside of the navigation by up to "
        rf"{true[-1] - last:.6g} s: .*clock of 0.002 s.*navigation from 99.000000 s to 100.495000"
    )
    with pytest.raises(SchemaError, match=message):
        check_run(with_group(tree, "navigation", short))
    # a clock that is corrected brings them inside
    check_run(tree)
    tree.attrs["mounting"]["scanner_clock"] = 50.0
    with pytest.raises(SchemaError, match=rf"{SCANS} of {SCANS} scans lie outside"):
        check_run(tree)
    tree.attrs["mounting"]["scanner_clock"] = -1.0005
    with pytest.raises(SchemaError, match="1 of 2345 scans lie outside of the navigation by up"):
        check_run(tree)


def structural_faults():
    def rename(name, **names):
        return lambda tree: with_group(tree, name, group(tree, name).rename(**names))

    def drop(name, variable):
        return lambda tree: with_group(tree, name, group(tree, name).drop_vars(variable))

    def attr(name, value):
        return lambda tree: _with_attr(tree, name, value)

    def units(name, variable, text):
        def change(tree):
            data = group(tree, name)
            data[variable].attrs["units"] = text
            return with_group(tree, name, data)

        return change

    def without(name):
        return lambda tree: tree.drop_nodes(name)

    def extra(name):
        return lambda tree: with_group(tree, name, xr.Dataset())

    def mounted(**values):
        def change(tree):
            tree.attrs["mounting"] |= values
            return tree

        return change

    def unmounted(name):
        def change(tree):
            del tree.attrs["mounting"][name]
            return tree

        return change

    return [
        (attr("kind", "other"), "attribute kind: must be 'trueterrain/run', got 'other'"),
        (attr("schema", 2), "attribute schema: must be 1, got 2. If it is newer"),
        (attr("name", 3), "attribute name: must be a text, got 3"),
        (attr("time_reference", "utc"), "attribute time_reference: must be 'gps' or 'run'"),
        (attr("origin", [1.0]), "attribute origin: origin must be longitude"),
        (attr("origin", "here"), "attribute origin"),
        (attr("origin", None), "attribute origin"),
        (attr("mounting", None), "attribute mounting: must be a table, got None"),
        (mounted(scaner_clock=1.0), r"the key 'scaner_clock' is unknown \(did you mean 'scanner_c"),
        (mounted(scanner_position=3.0), "attribute mounting"),
        (mounted(scanner_clock="late"), "attribute mounting"),
        (unmounted("scanner_clock"), "the key 'scanner_clock' is missing"),
        (without("scans"), "group scans: is missing"),
        (without("navigation"), "group navigation: is missing"),
        (extra("navigaton"), r"group navigaton: is unknown \(did you mean 'navigation'\?\)"),
        (drop("scans", "range"), "scans, variable range: is missing"),
        (drop("navigation", "yaw"), "navigation, variable yaw: is missing"),
        (drop("accelerometers", "position"), "accelerometers, variable position: is missing"),
        (rename("scans", delay="dealy"), r"scans, variable dealy: is unknown \(did you mean 'del"),
        (rename("navigation", sd_up="sd_down"), "navigation, variable sd_down: is unknown"),
        (rename("scans", beam="ray"), r"must have the dimensions \(scan, beam\), got \(scan, ray"),
        (rename("navigation", epoch="time_"), r"must have the dimensions \(epoch\), got \(time_\)"),
        (units("scans", "range", "mm"), "range: must be in m, got units 'mm'"),
        (units("navigation", "yaw", "deg"), "yaw: must be in rad, got units 'deg'"),
    ]


def _with_attr(tree, name, value):
    tree.attrs[name] = value
    return tree


@pytest.mark.parametrize(("change", "message"), structural_faults())
def test_layouts_that_are_not_runs_are_refused(store, change, message):
    with pytest.raises(SchemaError, match=message) as error:
        check_run(change(loaded(store)), "bad.zarr")
    assert str(error.value).startswith("bad.zarr: ")
    assert "\n" not in str(error.value)


def test_transposed_ranges(store):
    tree = loaded(store)
    data = group(tree, "scans").transpose("beam", "scan")
    with pytest.raises(SchemaError, match=r"dimensions \(scan, beam\), got \(beam, scan\)"):
        check_run(with_group(tree, "scans", data))


def test_impossible_values_are_refused(store):
    tree = loaded(store)
    angle = np.linspace(-40.0, 40.0, BEAMS)
    with pytest.raises(SchemaError, match=r"angle: must be within half a turn.*Convert degrees"):
        check_run(changed(tree, "scans", angle=angle))
    angle = np.linspace(-0.7, 0.7, BEAMS)
    angle[[4, 5]] = angle[[5, 4]]
    with pytest.raises(SchemaError, match=r"angle: must rise or fall throughout, but value 5"):
        check_run(changed(tree, "scans", angle=angle))
    check_run(changed(tree, "scans", angle=angle[::-1] * 0 + np.linspace(0.7, -0.7, BEAMS)))
    with pytest.raises(SchemaError, match="angle: must be finite everywhere, got nan at index 0"):
        check_run(changed(tree, "scans", angle=np.full(BEAMS, np.nan)))
    with pytest.raises(SchemaError, match=r"delay: must be from 0 s .*got -0.1 s at index 0"):
        check_run(changed(tree, "scans", delay=np.linspace(-0.1, 0, BEAMS)))
    with pytest.raises(SchemaError, match=r"delay: must be from 0 s to .* \(0.00099\d* s\), got"):
        check_run(changed(tree, "scans", delay=np.linspace(0, 900, BEAMS)))  # microseconds
    with pytest.raises(SchemaError, match=r"roll: must lie within a quarter turn.*Convert degrees"):
        check_run(changed(tree, "navigation", roll=np.full(EPOCHS, 2.5)))
    with pytest.raises(SchemaError, match="sd_up: must not be negative"):
        check_run(changed(tree, "navigation", sd_up=np.full(EPOCHS, -1.0)))


def test_impossible_accelerations_are_refused(store):
    tree = loaded(store)
    good = tree["accelerometers"]["acceleration"].values
    for factor, message in (
        (1 / 9.80665, "at sensor 0. Multiply by 9.80665 if the values are in g"),
        (-1, "got -9.8.* at sensor 0. Change the sign"),
        (0, "9.81 m/s2 for a body at rest"),
    ):
        with pytest.raises(SchemaError, match=message):
            check_run(changed(tree, "accelerometers", acceleration=good * factor))
    short = group(tree, "accelerometers").isel(sample=slice(0, 1000))  # 4 s, in which it may fall
    check_run(
        with_group(tree, "accelerometers", short.assign(acceleration=0.1 * short.acceleration))
    )
    bad = good.copy()
    bad[70, 1] = np.nan
    with pytest.raises(SchemaError, match=r"acceleration: must be finite .* nan at index 70, 1"):
        check_run(changed(tree, "accelerometers", acceleration=bad))
    position = np.full((3, 3), np.inf)
    with pytest.raises(SchemaError, match=r"position: must be finite .* inf at index 0, 0"):
        check_run(changed(tree, "accelerometers", position=position))
    flat = group(tree, "accelerometers").isel(axis=slice(0, 2))
    with pytest.raises(SchemaError, match="position: must have 3 axes, got 2"):
        check_run(with_group(tree, "accelerometers", flat))


def test_empty_runs_are_refused(store):
    tree = loaded(store)
    for name, dim, message in (
        ("scans", "scan", "scans: must have at least 1 scan, got none"),
        ("scans", "beam", "scans: must have at least 1 beam, got none"),
        ("navigation", "epoch", "navigation: must have at least 2 epochs, got 1"),
        ("accelerometers", "sample", "accelerometers: must have at least 2 samples, got none"),
        ("accelerometers", "sensor", "accelerometers: must have at least 1 sensor, got none"),
    ):
        end = 1 if name == "navigation" else 0
        empty = group(tree, name).isel({dim: slice(0, end)})
        with pytest.raises(SchemaError, match=message):
            check_run(with_group(tree, name, empty))


# --- damaged stores -------------------------------------------------------------------------------


def test_missing_chunks_are_detected(copy):
    (copy / "scans" / "range" / "c.1.0").unlink()
    with pytest.raises(FormatError, match=r"bad.zarr: array scans/range: 1 of 3 chunks are mis"):
        check_run(open_run(copy), copy)
    assert "1 of 3 chunks are missing" in describe(copy)["problems"][0]


def test_damaged_chunks_are_named(copy):
    chunk = copy / "scans" / "range" / "c.1.0"
    chunk.write_bytes(chunk.read_bytes()[:50])
    with pytest.raises(FormatError, match=r"array scans/range, chunk c\.1\.0: is damaged"):
        list(scan_blocks(copy))
    assert any("is damaged" in problem for problem in describe(copy)["problems"])


def test_damaged_metadata_are_refused(copy):
    (copy / "scans" / "range" / "zarr.json").write_text('{"shape": [1')
    with pytest.raises(FormatError, match=r"bad.zarr: scans/range/zarr.json: is damaged"):
        open_run(copy)


def test_other_folders_are_refused(tmp_path, store):
    with pytest.raises(FileNotFoundError, match="there is no run"):
        open_run(tmp_path / "no.zarr")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(FormatError, match="is not a Zarr 3 store"):
        open_run(tmp_path / "empty.zarr")
    other = tmp_path / "other.zarr"
    xr.Dataset({"a": ("x", [1.0])}).to_zarr(other, zarr_format=3, consolidated=False)
    with pytest.raises(SchemaError, match=r"other.zarr: attribute kind: must be"):
        open_run(other)
    assert describe(other)["problems"][0].startswith("attribute kind")


# --- description ----------------------------------------------------------------------------------


def test_description_of_a_good_run(store):
    data, summary = recording(), describe(store)
    assert json.loads(json.dumps(summary)) == summary
    assert summary["format"] == "Run"
    assert summary["kind"] == "run"
    assert summary["origin"] == list(ORIGIN)
    assert summary["mounting"]["scanner_clock"] == 0.002
    assert summary["problems"] == []
    assert summary["truth"] == ["ground", "pose"]
    scans = summary["scans"]
    returns = int(np.isfinite(data["range"]).sum())
    assert (scans["count"], scans["beams"], scans["returns"]) == (SCANS, BEAMS, returns)
    assert summary["count"] == returns
    npt.assert_allclose(scans["dropouts"], 1 - returns / data["range"].size, **ROUND_OFF)
    npt.assert_allclose(scans["rate"], 1000, rtol=0, atol=0.1)
    # [s] stamps jitter evenly over 1 us: their difference by 1 us / sqrt(6)
    npt.assert_allclose(scans["jitter"], 1e-6 / math.sqrt(6), rtol=0, atol=2e-8)
    npt.assert_allclose(
        scans["range"], [np.nanmin(data["range"]), np.nanmax(data["range"])], **HALF_STEP
    )
    npt.assert_allclose(scans["angle"], [-0.7, 0.7], **ROUND_OFF)
    assert scans["intensity"]
    assert scans["empty_scans"] == 0
    assert scans["gap_count"] == 0
    npt.assert_allclose(summary["navigation"]["rate"], 200, rtol=0, atol=1e-6)
    for name in ("east", "north", "up"):
        values = data["navigation"][name]
        npt.assert_allclose(summary["extent"][name], [values.min(), values.max()], **ROUND_OFF)
    fifths = [*range(0, EPOCHS, 40), EPOCHS - 1]  # of a second: noise would lengthen the path
    steps = np.diff([data["navigation"][name][fifths] for name in ("east", "north", "up")], axis=1)
    npt.assert_allclose(summary["distance"], np.linalg.norm(steps, axis=0).sum(), rtol=0, atol=1e-9)
    assert summary["accelerometers"]["sensors"] == 3
    assert summary["accelerometers"]["count"] == SAMPLES
    assert summary["bytes"] == sum(file.stat().st_size for file in files_of(store))


def test_description_lists_the_order_of_the_clocks(store):
    order = describe(store)["clock_order"]
    assert [name for name, _ in order["start"]] == ["accelerometers", "navigation", "scans"]
    npt.assert_allclose([t for _, t in order["start"]], [96.25, 99, 100.002], rtol=0, atol=1e-5)
    assert [name for name, _ in order["end"]] == ["accelerometers", "scans", "navigation"]


def test_description_lists_gaps_and_dropouts(tmp_path):
    data = recording()
    keep = np.ones(SCANS, dtype=bool)
    keep[1000:1500] = False
    data["range"] = np.where(np.arange(BEAMS) < 5, np.nan, data["range"])
    data["range"][2000] = np.nan
    data["range"][2001, 7] = 6.5534
    for name in ("time", "range", "intensity"):
        data[name] = data[name][keep]
    path = record(tmp_path / "x.zarr", data, truth=False)
    summary = describe(path)
    gaps = summary["scans"]["gaps"]
    assert len(gaps) == summary["scans"]["gap_count"] == 1
    npt.assert_allclose(gaps[0]["start"], data["time"][999], **ROUND_OFF)
    npt.assert_allclose(gaps[0]["length"], 0.501, rtol=0, atol=2e-6)
    problems = "\n".join(summary["problems"])
    assert "scans: 1 gap in time, the longest 0.501" in problems
    assert "48% of the beams have no return" in problems
    assert "1 of 1845 have no return at all" in problems
    assert "ranges reach the largest that can be stored, 6.5534 m" in problems


def test_description_lists_every_problem(copy):
    root = zarr.open_group(copy, mode="r+")
    root["scans/time"][50] = 0.0
    root["navigation/east"][7] = np.nan
    root["accelerometers/acceleration"][:] = 1.0
    summary = describe(copy)
    problems = summary["problems"]
    assert any(text.startswith("scans, variable time: must run forward") for text in problems)
    assert any(text.startswith("navigation, variable east: must be finite") for text in problems)
    assert any(text.startswith("scans, variable time: 1 of 2345 scans lie") for text in problems)
    assert any("9.80665" in text for text in problems)
    assert math.isfinite(summary["extent"]["east"][0])
    json.dumps(summary, allow_nan=False)


def test_description_flags_jumps_and_jitter(tmp_path):
    data = recording()
    data["navigation"]["east"][300:] += 500.0
    data["navigation"]["time"] += np.where(np.arange(EPOCHS) % 2, 0.002, 0)
    problems = describe(record(tmp_path / "x.zarr", data, truth=False))["problems"]
    assert any("positions jump, as if at" in text for text in problems)
    assert any("navigation: the interval between times varies" in text for text in problems)


# --- import ---------------------------------------------------------------------------------------


def flat(data, folder, *, ending="csv", layout="returns", by="beam", time_of="scan", scan=False):
    """The recording as flat files, and the description of them."""
    folder.mkdir(exist_ok=True)

    def save(frame, name):
        path = folder / f"{name}.{ending}"
        frame.to_parquet(path) if ending == "parquet" else frame.to_csv(path, index=False)
        return path.name

    navigation = save(pd.DataFrame(data["navigation"]), "nav")
    samples = pd.DataFrame(data["acceleration"] / 9.80665, columns=["a", "b", "c"])
    accelerations = save(samples.assign(t=data["sample"]), "acc")
    if layout == "scans":
        frame = pd.DataFrame(data["range"], columns=[f"r{i}" for i in range(BEAMS)])
        strength = pd.DataFrame(data["intensity"], columns=[f"i{i}" for i in range(BEAMS)])
        frame = pd.concat([pd.DataFrame({"t": data["time"]}), frame, strength], axis=1)
        lines = 'range = "r"\nintensity = "i"\nlayout = "scans"\n'
    else:
        number, beam = np.nonzero(np.ones_like(data["range"]))
        time = data["time"][number] + (data["delay"][beam] if time_of == "beam" else 0)
        frame = pd.DataFrame({"t": time, "mm": data["range"].ravel() * 1000})
        frame["strength"] = data["intensity"].ravel()
        frame["which"] = beam if by == "beam" else np.rad2deg(data["angle"])[beam]
        frame["n"] = number
        kept = np.isfinite(frame.mm) | (beam == 0)  # rows without a return may be absent, or empty
        frame = frame[kept].assign(mm=lambda table: table.mm.fillna(0 if ending == "csv" else -1))
        lines = f'range = "mm"\nrange_scale = 0.001\nintensity = "strength"\n{by} = "which"\n'
        lines += f'time_of = "{time_of}"\nno_return = -1\n' + ('scan = "n"\n' if scan else "")
    scans = save(frame, "scans")
    degrees = np.rad2deg(data["angle"])
    text = f"""
name = "test"
origin = {list(ORIGIN)}
[navigation]
file = "{navigation}"
format = "table"
columns = {{ east = "east", north = "north", up = "up", yaw = "yaw", sd_up = "sd_up" }}
[scans]
file = "{scans}"
first_angle = {float(degrees[0])!r}
last_angle = {float(degrees[-1])!r}
beams = {BEAMS}
degrees = true
beam_interval = {0.0009 / (BEAMS - 1)!r}
time = "t"
{lines}
[accelerometers]
file = "{accelerations}"
time = "t"
columns = ["a", "b", "c"]
positions = {data["position"].tolist()}
scale = 9.80665
[mounting]
scanner_position = [-1.2, 0.05, 1.9]
scanner_rotation = [0.01, -0.02, 0.03]
scanner_clock = 0.002
"""
    path = folder / "run.toml"
    path.write_text(text)
    return path


FLAT = [
    {"ending": "csv"},
    {"ending": "parquet", "scan": True},
    {"ending": "parquet", "by": "angle"},
    {"ending": "csv", "by": "angle", "time_of": "beam"},
    {"ending": "parquet", "time_of": "beam", "scan": True},
    {"ending": "csv", "layout": "scans"},
    {"ending": "parquet", "layout": "scans"},
]


@pytest.mark.slow
@pytest.mark.parametrize("kind", FLAT, ids=lambda kind: "-".join(map(str, kind.values())))
@pytest.mark.parametrize("cells", [200, 1_000_000])
def test_flat_files_give_the_run_that_was_written(store, tmp_path, kind, cells, monkeypatch):
    monkeypatch.setattr(scan_tables.scan_table_blocks, "__defaults__", (cells,))
    calls = []
    import_run(
        flat(recording(), tmp_path / "flat", **kind),
        tmp_path / "x.zarr",
        progress=lambda *words: calls.append(words),
    )
    tree, truth = open_run(tmp_path / "x.zarr"), open_run(store)
    # without a return there is no row, and so no intensity
    returned = np.isfinite(truth["scans"]["range"].values)
    npt.assert_array_equal(tree["scans"]["range"], truth["scans"]["range"])
    npt.assert_array_equal(
        tree["scans"]["intensity"].values[returned], truth["scans"]["intensity"].values[returned]
    )
    exact = 0.0 if kind.get("time_of") != "beam" else 2e-14 * 100  # [s] a delay was taken off
    npt.assert_allclose(tree["scans"]["time"], truth["scans"]["time"], rtol=0, atol=exact)
    npt.assert_allclose(tree["scans"]["angle"], truth["scans"]["angle"], **ROUND_OFF)
    npt.assert_allclose(tree["scans"]["delay"], truth["scans"]["delay"], **ROUND_OFF)
    for name in recording()["navigation"]:
        npt.assert_array_equal(tree["navigation"][name], truth["navigation"][name])
    for name in ("time", "acceleration", "position"):
        npt.assert_allclose(
            tree["accelerometers"][name], truth["accelerometers"][name], **ROUND_OFF
        )
    for name in ("name", "origin", "time_reference", "mounting"):
        assert tree.attrs[name] == truth.attrs[name]
    steps = provenance.provenance_steps(tree.to_dataset())
    assert [step["step"] for step in steps] == ["import"]
    assert steps[0]["inputs"][0]["name"] == "run.toml"
    assert calls[-1] == ("accelerometers", SAMPLES, None)


def described(folder, change, **kind):
    """The description of flat files, with some lines changed."""
    path = flat(recording(), folder / "flat", **kind)
    text = path.read_text()
    for old, new in change.items():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("change", "kind", "error", "message"),
    [
        (
            {"beam_interval": "beam_intervall"},
            {},
            FormatError,
            r"run.toml: scans.beam_intervall: is unknown \(did you mean 'beam_interval'\?\)",
        ),
        ({"scanner_clock": "scaner_clock"}, {}, FormatError, "mounting.scaner_clock: is unknown"),
        (
            {"scanner_rotation = [0.01": "scanner_rotation = [90"},
            {},
            FormatError,
            "mounting: scanner_rotation must be in radians",
        ),
        ({"beams = 11": "beams = 0"}, {}, FormatError, "scans: beams must be at least 1, got 0"),
        ({"beams = 11": ""}, {}, FormatError, "scans: the fan must be given either by angles"),
        ({'beam = "which"': ""}, {}, FormatError, "scans: either beam or angle must name"),
        ({"range_scale = 0.001": "range_scale = -1"}, {}, FormatError, "range_scale must be"),
        ({"beam_interval = ": "beam_interval = -"}, {}, FormatError, "must not be negative"),
        ({'["a", "b", "c"]': '["a", "b"]'}, {}, FormatError, "columns must name one column for"),
        ({'time = "t"\ncolumns': "time_scale = 0\ncolumns"}, {}, FormatError, "time_scale must be"),
        ({'format = "table"': 'format = "sbet"'}, {}, FormatError, "columns must be named for a t"),
        ({'file = "nav.csv"': 'file = "gone.csv"'}, {}, FormatError, "gone.csv: does not exist"),
        ({"origin = [11.5, 48.1, 512.25]": ""}, {}, FormatError, "run.toml: origin: is missing"),
        (
            {'time = "t"\nrange': 'time = "tt"\nrange'},
            {},
            FormatError,
            r"scans.csv: header: has no column 'tt' \(did you mean 't'\?\)|has no column 'tt'",
        ),
        (
            {"beams = 11": "beams = 10"},
            {},
            FormatError,
            r"scans.csv: row \d+, column 'which': must be a beam from 0 to 9, got 10",
        ),
        (
            {"beams = 11": "beams = 21"},
            {"by": "angle"},
            SchemaError,
            "delay: must be from 0 s to the time between two scans",
        ),
        (
            {"beams = 11": "beams = 12"},
            {"by": "angle"},
            FormatError,
            r"column 'which': must be the angle of a beam of the fan, got",
        ),
        (
            {"beams = 11": "beams = 12"},
            {"layout": "scans"},
            FormatError,
            r"scans.csv: header: has 11 columns r0, r1, ..., but the fan has 12 beams",
        ),
        (
            {"beam_interval = ": "beam_interval = 5"},
            {"time_of": "beam"},
            FormatError,
            r"scans.csv: row \d+, column 't': must be the time of the scan, plus beam_interval",
        ),
        (
            {"range_scale = 0.001": "range_scale = 1.0"},
            {},
            SchemaError,
            "range: must be greater than 0 m and less than 6.5535 m",
        ),
        ({"scale = 9.80665": ""}, {}, SchemaError, "if the values are in g"),
        ({"scanner_clock = 0.002": "scanner_clock = 3.0"}, {}, SchemaError, "scans lie outside"),
    ],
)
def test_descriptions_that_are_wrong(tmp_path, change, kind, error, message):
    with pytest.raises(error, match=message) as raised:
        import_run(described(tmp_path, change, **kind), tmp_path / "x.zarr")
    assert "\n" not in str(raised.value)
    assert [file.name for file in tmp_path.iterdir()] == ["flat"]


def test_a_beam_twice_in_a_scan(tmp_path):
    path = flat(recording(), tmp_path / "flat")
    table = pd.read_csv(tmp_path / "flat" / "scans.csv")
    twice = pd.concat([table.iloc[:30], table.iloc[29:]])
    twice.to_csv(tmp_path / "flat" / "scans.csv", index=False)
    with pytest.raises(FormatError, match=r"row 31, column 'which': must hold each beam .* once"):
        import_run(path, tmp_path / "x.zarr")


def test_one_number_for_two_scans(tmp_path):
    path = flat(recording(), tmp_path / "flat", scan=True)
    table = pd.read_csv(tmp_path / "flat" / "scans.csv")
    table.loc[5, "t"] += 0.1
    table.to_csv(tmp_path / "flat" / "scans.csv", index=False)
    with pytest.raises(FormatError, match=r"row 6, column 't': must be the time of the scan"):
        import_run(path, tmp_path / "x.zarr")


def test_scans_outside_of_the_navigation_may_be_dropped(tmp_path):
    change = {
        "scanner_clock = 0.002": "scanner_clock = 1.0",
        "degrees = true\n": 'degrees = true\noutside = "drop"\n',
    }
    path = described(tmp_path, change, ending="parquet")
    time = recording()["time"] + 1.0
    inside = int(np.count_nonzero(time + 0.0009 <= 99.0 + 0.005 * (EPOCHS - 1)))
    message = f"{SCANS - inside} scans outside of the navigation are omitted"
    with pytest.warns(UserWarning, match=message):
        import_run(path, tmp_path / "x.zarr")
    assert open_run(tmp_path / "x.zarr")["scans"].sizes["scan"] == inside


def test_navigation_from_an_sbet_with_its_accuracies(tmp_path):
    """Scans of a table with an SBET: the origin is the first record."""
    data = recording()
    path = flat(data, tmp_path / "flat", ending="parquet")
    table = np.zeros((EPOCHS, 17))
    table[:, 0] = data["navigation"]["time"]
    table[:, 1], table[:, 2], table[:, 3] = np.deg2rad(48.0), np.deg2rad(11.0), 500.0
    table[:, 9] = 0.5
    table.astype("<f8").tofile(tmp_path / "flat" / "sbet.out")
    errors = np.ones((9, 10))
    errors[:, 0] = np.arange(98, 107)
    errors.astype("<f8").tofile(tmp_path / "flat" / "smrmsg.out")
    text = path.read_text()
    text = text.replace(f"origin = {list(ORIGIN)}\n", "")
    text = text.replace('file = "nav.parquet"\nformat = "table"', 'file = "sbet.out"')
    lines = [line for line in text.splitlines() if not line.startswith("columns = {")]
    path.write_text("\n".join(lines).replace("[scans]", 'accuracy = "smrmsg.out"\n[scans]'))
    import_run(path, tmp_path / "x.zarr")
    tree = open_run(tmp_path / "x.zarr")
    npt.assert_allclose(tree.attrs["origin"], (11.0, 48.0, 500.0), **ROUND_OFF)
    npt.assert_allclose(tree["navigation"]["yaw"], np.pi / 2 - 0.5, rtol=0, atol=1e-9)
    npt.assert_allclose(tree["navigation"]["sd_yaw"], np.deg2rad(1 / 60), **ROUND_OFF)
    inputs = [
        entry["name"] for entry in provenance.provenance_steps(tree.to_dataset())[0]["inputs"]
    ]
    assert inputs == ["run.toml", "sbet.out", "smrmsg.out", "scans.parquet", "acc.parquet"]
    errors[:, 0] += 1000
    errors.astype("<f8").tofile(tmp_path / "flat" / "smrmsg.out")
    with pytest.raises(CoverageError, match=r"smrmsg.out: accuracies from 1098"):
        import_run(path, tmp_path / "y.zarr")


def test_the_output_is_not_overwritten_by_an_import(tmp_path, store):
    path = flat(recording(), tmp_path / "flat", ending="parquet")
    copy = shutil.copytree(store, tmp_path / "x.zarr")
    with pytest.raises(OutputError, match="exists already"):
        import_run(path, copy)
    import_run(path, copy, force=True)
    assert "truth" not in open_run(copy).children


def test_the_description_has_a_template():
    text = settings_template(RunFiles)
    assert "# name = ... (required: text)" in text
    assert "\n[navigation]\n" in text
    assert "# [navigation.columns]" in text
    assert '\nrange = "range"' in text
    assert "# file = ... (required: text)" in text
    for kind in (RunFiles, ScanTable):
        for field in dataclasses.fields(kind):
            assert field.name in text
    with pytest.raises(FormatError, match="name: is missing"):
        parse_settings(RunFiles, {})


def test_no_warnings_while_a_run_is_opened(store):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        open_run(store).load()
