"""Damaged files and stores of all formats give a one-line error or data, in bounded memory."""

import json
import os
import random
import shutil
import socket
import struct
import subprocess
import sys

import laspy
import numpy as np
import numpy.testing as npt
import pandas as pd
import pytest
import xarray as xr
import zarr
from zarr.codecs import BloscCodec

from trueterrain import formats
from trueterrain.core.errors import FormatError, TrueTerrainError
from trueterrain.core.schemas import make_points, make_profile, make_surface
from trueterrain.formats import _zarr, _zarr_write, las, table
from trueterrain.formats.navigation import columns, sbet, smrmsg
from trueterrain.formats.run import (
    Mounting,
    RunWriter,
    check_run,
    describe,
    open_run,
    scan_blocks,
)

CASES = 60  # of each kind of file; stores have half as many, and each is read by two functions

# --- undamaged files and stores -------------------------------------------------------------------


def write_run(path):
    """A run of four chunks of ranges, with all optional groups and variables."""
    rng = np.random.default_rng(1)
    scans, beams, samples = 3300, 3, 1500
    pose = {name: rng.normal(0, 0.01, 800) for name in ("east", "north", "roll", "pitch", "yaw")}
    pose |= {"time": 99 + 0.005 * np.arange(800), "up": rng.normal(512, 0.01, 800)}
    with RunWriter(
        path,
        name="run",
        origin=(11, 48, 500),
        time_reference="gps",
        mounting=Mounting(),
        angle=[-0.1, 0, 0.1],
        delay=[0, 0, 0],
        accelerometer_positions=[[0, 0, 0]],
    ) as run:
        run.append_navigation(pose | {"sd_up": np.full(800, 0.01)})
        ranges = rng.uniform(1.5, 3.0, (scans, beams))
        strength = rng.integers(1, 4096, (scans, beams)).astype(np.uint16)
        run.append_scans(99.5 + 0.001 * np.arange(scans), ranges, strength)
        time = 99 + 0.002 * np.arange(samples)
        run.append_accelerometers(time, rng.normal(9.81, 0.1, (samples, 1)))


def points(count=1500):
    rng = np.random.default_rng(2)
    return make_points(
        691000 + rng.uniform(0, 100, count),
        5334000 + rng.uniform(0, 100, count),
        510 + rng.uniform(0, 1, count),
        time=np.arange(count) * 0.01,
        crs="EPSG:25832",
        lane=np.repeat(np.array([3, 7], np.uint16), count // 2),
    )


def surface():
    u = 0.1 * np.arange(60)
    return make_surface(
        np.random.default_rng(3).normal(5, 0.01, (60, 5)),
        u=u,
        v=np.linspace(-1, 1, 5),
        easting=u,
        northing=0 * u,
        elevation=0 * u,
    )


def profile():
    heights = np.random.default_rng(4).normal(5, 0.01, (2, 80))
    return make_profile(0.1 * np.arange(80), heights, tracks=["left", "right"])


def write_las(path, *, version, point_format):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales = [1e-3] * 3
    rng = np.random.default_rng(5)
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = rng.uniform(0, 50, (3, 500))
    cloud.gps_time = np.arange(500) * 0.01
    cloud.write(str(path))


def sbet_records(count=60):
    fields = np.zeros((count, 17))
    fields[:, 0] = 400_000 + 0.005 * np.arange(count)
    fields[:, 1:4] = 0.66, -2.08, 100.0
    return fields.tobytes()


def smrmsg_records(count=60):
    fields = np.full((count, 10), 0.05)
    fields[:, 0] = 400_000 + 0.005 * np.arange(count)
    return fields.tobytes()


def write_navigation_table(path):
    names = ("time", "east", "north", "up", "roll", "pitch", "yaw")
    frame = pd.DataFrame({name: 0.01 * np.arange(50) for name in names})
    frame.to_csv(path, index=False) if path.suffix == ".csv" else frame.to_parquet(path)


MADE = {
    "las": ("a.las", lambda p: write_las(p, version="1.2", point_format=1)),
    "laz, one by one": ("a.laz", lambda p: write_las(p, version="1.2", point_format=3)),
    "laz, in layers": ("b.laz", lambda p: write_las(p, version="1.4", point_format=7)),
    "sbet": ("a.out", lambda p: p.write_bytes(sbet_records())),
    "smrmsg": ("b.out", lambda p: p.write_bytes(smrmsg_records())),
    "points, csv": ("a.csv", lambda p: formats.write(points(200), p)),
    "profile, csv": ("b.csv", lambda p: formats.write(profile(), p)),
    "points, parquet": ("a.parquet", lambda p: formats.write(points(200), p)),
    "profile, parquet": ("b.parquet", lambda p: formats.write(profile(), p)),
    "navigation, csv": ("n.csv", write_navigation_table),
    "navigation, parquet": ("n.parquet", write_navigation_table),
    "run": ("a.zarr", write_run),
    "points": ("p.zarr", lambda p: formats.write(points(), p)),
    "surface": ("s.zarr", lambda p: formats.write(surface(), p)),
    "profile": ("l.zarr", lambda p: formats.write(profile(), p)),
}
STORES = ("run", "points", "surface", "profile")
FILES = [kind for kind in MADE if kind not in STORES]


@pytest.fixture
def make(tmp_path):
    """Function that writes an undamaged file or store of a kind."""

    def made(kind):
        name, write = MADE[kind]
        write(tmp_path / name)
        return tmp_path / name

    return made


# --- functions that read -------------------------------------------------------------------------


def look_at(path, kind):
    """All functions that read a kind of file, block by block and at once."""
    if kind == "run":
        tree = open_run(path)
        check_run(tree, path)
        for _ in scan_blocks(path):
            pass
        tree.load()
    elif kind.startswith("navigation"):
        list(columns.blocks(path, columns.OURS, origin=(11.0, 48.0, 500.0)))
    elif kind in ("sbet", "smrmsg"):
        (sbet if kind == "sbet" else smrmsg).read(path)
    else:
        if formats.kind_of_file(path) == "points":
            list(formats.point_blocks(path, bounds=(0, 0, 691050, 5334050)))
        formats.open(path)


def require_one_line(path, kind):
    """Error of reading a file, or nothing; other types of errors are raised."""
    found = None
    for look in (lambda: look_at(path, kind), lambda: json.dumps(formats.info(path))):
        try:
            look()
        except TrueTerrainError as error:
            found = found or error
    assert found is None or ("\n" not in str(found) and str(path) in str(found))
    return found


# --- damage ---------------------------------------------------------------------------------------


def flip_bit(content, rng):
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)


def cut_end(content, rng):
    del content[rng.randrange(len(content)) :]


def overwrite_word(content, rng):
    at = rng.randrange(max(1, len(content) - 4))
    words = (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\xef", b"\xff\xff\xff\x7f")
    content[at : at + 4] = rng.choice(words)


def overwrite_head(content, rng):
    content[rng.randrange(min(len(content), 900))] = rng.choice((0, 255, rng.randrange(256)))


def overwrite_tail(content, rng):
    content[-1 - rng.randrange(min(len(content), 600))] = rng.randrange(256)


def insert_text(content, rng):
    texts = (b'"', b"\n", b"\0", b",", b"9" * 400, b"x" * 140_000, b"inf", b"1e999", b"\xff", b"#")
    at = rng.randrange(len(content))
    content[at:at] = rng.choice(texts)


IN_FILES = (flip_bit, cut_end, overwrite_word, overwrite_head, overwrite_tail, insert_text)


def edit_json(text, rng):
    """Change a number or a type, or remove a key, anywhere in a JSON document."""
    document = json.loads(text)
    places = []

    def collect(node):
        for key in node if isinstance(node, dict) else range(len(node)):
            places.append((node, key))
            if isinstance(node[key], dict | list):
                collect(node[key])

    collect(document)
    node, key = rng.choice(places)
    value = rng.choice((-1, 0, 2**31, 10**400, "abc", None, 1.5, {"a": [1]}, "nothing"))
    if value == "nothing":
        del node[key]
    else:
        node[key] = value
    return json.dumps(document).encode()


@pytest.mark.slow
@pytest.mark.parametrize("kind", FILES)
def test_damaged_files_give_a_one_line_error_or_are_read(make, kind):
    path = make(kind)
    whole = path.read_bytes()
    found = 0
    for seed in range(CASES):
        rng = random.Random(seed)
        content = bytearray(whole)
        rng.choice(IN_FILES)(content, rng)
        path.write_bytes(content)
        found += require_one_line(path, kind) is not None
    assert found > CASES / 6  # that much is damaged beyond reading, whatever the format


@pytest.mark.slow
@pytest.mark.parametrize("kind", STORES)
def test_damaged_stores_give_a_one_line_error_or_are_read(make, kind):
    path = make(kind)
    whole = {file: file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}
    metadata = [file for file in whole if file.name == "zarr.json"]
    chunks = [file for file in whole if file.name != "zarr.json"]
    for seed in range(CASES // 2):
        rng = random.Random(seed)
        in_chunk = seed % 2 == 0
        file = rng.choice(chunks if in_chunk else metadata)
        content = bytearray(whole[file])
        if seed % 10 == 3:
            file.unlink()
        elif in_chunk:
            rng.choice((flip_bit, cut_end, overwrite_head))(content, rng)
            file.write_bytes(content)
        elif seed % 4 == 1:
            file.write_bytes(edit_json(whole[file], rng))
        else:
            flip_bit(content, rng)
            file.write_bytes(content)
        error = require_one_line(path, kind)
        if in_chunk and content != whole[file]:
            assert isinstance(error, FormatError), f"{file} was read though it is damaged"
            assert file.parent.relative_to(path).as_posix() in str(error)
        file.write_bytes(whole[file])
    assert require_one_line(path, kind) is None


# --- runs with missing or damaged chunks ----------------------------------------------------------


def test_flipped_bits_of_a_run_are_detected(make):
    path = make("run")
    arrays = _zarr.open_arrays(path)
    chunks = [(array, file) for array in arrays.values() for file in path.glob(f"{array.name}/c*")]
    for seed in range(300):
        rng = random.Random(seed)
        array, file = rng.choice(chunks)
        whole = file.read_bytes()
        content = bytearray(whole)
        flip_bit(content, rng)
        file.write_bytes(content)
        with pytest.raises(FormatError, match=f"array {array.name}, chunk {file.name}: is damaged"):
            array.verify_chunks()
        file.write_bytes(whole)


def test_a_run_without_an_array_a_chunk_or_metadata_is_not_opened(make, tmp_path):
    path = make("run")
    names = [file.relative_to(path) for file in sorted(path.rglob("*"))]
    assert len(names) > 40
    for number, name in enumerate(names):
        (path / name).rename(tmp_path / "away")
        with pytest.raises(TrueTerrainError, match=r"missing|holds no zarr\.json"):
            open_run(path)
        if number % 7 == 0:
            assert any("missing" in problem for problem in problems_of_run(path)), name
        (tmp_path / "away").rename(path / name)
    open_run(path)


def problems_of_run(path):
    """Message of info about a run, also if it is too damaged to be described."""
    try:
        return describe(path)["problems"]
    except FormatError as error:
        return [str(error)]


def test_the_truth_can_be_removed_from_a_run(make):
    path = make("run")
    truth = xr.Dataset({"height": ("u", [1.0, 2.0])})
    with RunWriter(
        path.with_name("t.zarr"),
        name="run",
        origin=(11, 48, 500),
        time_reference="gps",
        mounting=Mounting(),
        angle=[0],
        delay=[0],
        truth={"ground": truth},
    ) as run:
        run.append_navigation(open_run(path)["navigation"].to_dataset())
        run.append_scans([100.0], [[2.0]])
    shutil.rmtree(path.with_name("t.zarr") / "truth")
    assert "truth" not in open_run(path.with_name("t.zarr")).children


def test_missing_chunks_are_nan_for_other_programs(make):
    path = make("run")
    (path / "navigation" / "up" / "c.0").unlink()
    (path / "scans" / "range" / "c.1.0").unlink()
    root = zarr.open_group(path, mode="r")
    assert np.isnan(root["navigation/up"][:]).all()
    assert (root["scans/range"][1000:2000] == root["scans/range"].attrs["_FillValue"]).all()


def test_info_reports_damage_in_the_truth(make):
    path = make("run")
    copy = path.with_name("t.zarr")
    truth = xr.Dataset({"height": ("u", np.arange(100.0))})
    with RunWriter(
        copy,
        name="run",
        origin=(11, 48, 500),
        time_reference="gps",
        mounting=Mounting(),
        angle=[0],
        delay=[0],
        truth={"ground": truth},
    ) as run:
        run.append_navigation(open_run(path)["navigation"].to_dataset())
        run.append_scans([100.0], [[2.0]])
    chunk = copy / "truth" / "ground" / "height" / "c.0"
    content = bytearray(chunk.read_bytes())
    content[40] ^= 1
    chunk.write_bytes(content)
    (problem,) = [text for text in describe(copy)["problems"] if "damaged" in text]
    assert problem.startswith("array truth/ground/height, chunk c.0: is damaged (its checksum")


def test_info_verifies_the_chunks_of_points(make):
    path = make("points")
    assert formats.info(path)["problems"] == []
    chunk = path / "up" / "c.0"
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    (problem,) = formats.info(path)["problems"]
    assert problem.startswith("array up, chunk c.0: is damaged (its checksum")


def test_runs_of_earlier_versions_are_opened(make, tmp_path, monkeypatch):
    """They have no checksums and no list of arrays, and zeros as fill value."""
    monkeypatch.setattr(
        _zarr_write,
        "make_compressors",
        lambda level, shuffle: [BloscCodec(cname="zstd", clevel=level, shuffle=shuffle)],
    )
    monkeypatch.setattr(_zarr_write, "choose_fill_value", lambda dtype: np.dtype(dtype).type(0))
    old = make("run")
    document = json.loads((old / "zarr.json").read_text())
    del document["attributes"]["arrays"]
    (old / "zarr.json").write_text(json.dumps(document))
    monkeypatch.undo()
    write_run(tmp_path / "new.zarr")
    assert describe(old)["problems"] == []
    for name, node in open_run(tmp_path / "new.zarr").subtree_with_keys:
        xr.testing.assert_identical(open_run(old)[name].to_dataset(), node.to_dataset())
    (old / "navigation" / "up" / "c.0").unlink()
    with pytest.raises(FormatError, match=r"array navigation/up: 1 of 1 chunks are missing"):
        open_run(old)


def test_parts_of_a_stored_array_are_those_of_its_values(make):
    path = make("run")
    lazy = open_run(path)["scans"]["range"]
    whole = lazy.values
    for rows in (slice(5, 2500, 7), slice(2500, 5, -3), [3, 0, 2999], 1234, slice(0, 0)):
        for beams in (slice(None), [2, 0], 1):
            wanted = whole[rows][..., beams]
            npt.assert_array_equal(lazy.isel(scan=rows, beam=beams).values, wanted)
    with pytest.raises(IndexError):
        _zarr.StoredArray(path, "scans/range").read(len(whole))


# --- files with counts that exceed their size -----------------------------------------------------

MEMORY = 400e6  # [bytes] in addition to imports: a block of a million points, and its copies

ASKING = """
import json, resource, sys
from trueterrain import formats
from trueterrain.core.errors import FormatError
formats.info(sys.argv[1])
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
messages = {}
for path in sys.argv[2:]:
    for look in (formats.open, formats.info):
        try:
            look(path)
            messages.setdefault(path, "was read")
        except FormatError as error:
            messages.setdefault(path, str(error))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([messages, (peak - before) * 1024]))
"""


def patched(path, name, at, word):
    content = bytearray(path.read_bytes())
    content[at : at + len(word)] = word
    path.with_name(name).write_bytes(content)
    return path.with_name(name)


@pytest.mark.slow
def test_oversized_counts_are_refused_in_bounded_memory(make):
    """In a separate process, since some of these files ended the process."""
    flat, layered, store = make("laz, one by one"), make("laz, in layers"), make("surface")
    run = make("run")
    asking = {}
    for path in (flat, layered):
        content = path.read_bytes()
        record = content.index(b"laszip encoded") - 2 + 54  # behind the head of the record
        first = struct.unpack_from("<L", content, 96)[0] + 8
        for size in (0xEFFFFFFF, 0x0FFFFFFF, 0):
            word = struct.pack("<L", size)
            name = f"{path.stem} chunks of {size}.laz"
            words = "chunk 1 of 1 announces" if size else "table of chunks"
            asking[patched(path, name, record + 12, word)] = words
    with laspy.open(layered) as reader:
        head = reader.header.point_format.size + 4
    for layer in (0, 3, 9):
        word = struct.pack("<L", 0x7FFFFFFF)
        name = f"layer {layer}.laz"
        asking[patched(layered, name, first + head + 4 * layer, word)] = "its layers announce"
    for folder, names in (
        (store, ["height"]),
        (run, ["scans/range"]),
        (run, ["navigation/up"]),
        (run, sorted(f"navigation/{array.name}" for array in (run / "navigation").glob("[!z]*"))),
    ):
        for key, length in (("shape", 2**31), ("chunk_shape", 2**27)):
            copy = shutil.copytree(folder, folder.with_name(f"{len(asking)}.zarr"))
            for name in names:
                file = copy / name / "zarr.json"
                about = json.loads(file.read_text())
                there = about if key == "shape" else about["chunk_grid"]["configuration"]
                there[key][0] = length
                file.write_text(json.dumps(about))
            asking[copy] = names[0].partition("/")[0]  # the group, or the array
    found = subprocess.run(
        [sys.executable, "-c", ASKING, str(flat), *map(str, asking)],
        check=True,
        capture_output=True,
        text=True,
    )

    messages, grown = json.loads(found.stdout)
    for path, words in asking.items():
        assert words in messages[str(path)], path
    assert grown < MEMORY


def test_circular_pages_of_a_copc_hierarchy_are_refused():
    from trueterrain.formats.las._copc import _Pages

    class Page:
        def seek(self, *_):
            return 320

        def read(self, size):
            return bytes(size)

    pages = _Pages(Page())
    for _ in range(10):
        pages.read(32)
    for size in (32, -1, 0):
        with pytest.raises(ValueError, match="a page of"):
            pages.read(size)


def test_an_sbet_that_is_truncated_while_it_is_read(tmp_path):
    path = tmp_path / "a.out"
    path.write_bytes(sbet_records(20_000))
    blocks = sbet.blocks(path, size=100)
    next(blocks)
    os.truncate(path, 136 * 150)
    with pytest.raises(FormatError, match=r"record \d+: had 2720000 bytes when reading began"):
        list(blocks)


def test_a_field_longer_than_any_number(tmp_path):
    path, long = tmp_path / "a.csv", "7" * 140_000
    for text in (f"s,height\n0,1\n0.1,{long}x\n0.2,1\n", f"s,height,{long}\n0,1,2\n"):
        path.write_text(text)
        for read in (formats.open, formats.info, table.read):
            with pytest.raises(FormatError, match="cannot be split into fields") as caught:
                read(path)
            assert len(str(caught.value)) < 400
    names = "time,east,north,up,roll,pitch,yaw"
    for text in (f"{names},{long}\n", f"{names}\n0,0,0,0,0,0,{long}x\n"):
        path.write_text(text)
        with pytest.raises(FormatError, match="cannot be split into fields"):
            list(columns.blocks(path, columns.OURS, origin=(11.0, 48.0, 500.0)))


def test_pipes_sockets_devices_and_folders_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "folder.laz").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "pipe.csv")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "s"))
        for name, words in (
            ("pipe.csv", "is a pipe, not a file"),
            ("link.csv", "is a pipe, not a file"),
            ("s", "is a socket, not a file"),
            ("/dev/zero", "is a device, not a file"),
            ("folder.laz", "is a folder, not a file"),
        ):
            for read in (formats.open, formats.info, las.read, table.read, sbet.read, smrmsg.read):
                with pytest.raises(FormatError, match=words):
                    read(tmp_path / name)


def test_a_pipe_in_a_store_is_not_a_chunk(make):
    path = make("run")
    (path / "navigation" / "up" / "c.0").unlink()
    os.mkfifo(path / "navigation" / "up" / "c.0")
    with pytest.raises(FormatError, match="array navigation/up: 1 of 1 chunks are missing"):
        open_run(path)
