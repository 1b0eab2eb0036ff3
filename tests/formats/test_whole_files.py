"""Full and failing disks: partial files never appear, and never replace a complete one."""

import resource
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import zarr

from trueterrain.core import Checksums
from trueterrain.core.errors import OutputError
from trueterrain.core.schemas import make_points, make_profile, make_surface
from trueterrain.figures import profiles
from trueterrain.figures.output import save_figure
from trueterrain.formats import erd, geotiff, las, opencrg, store, table
from trueterrain.formats.las import _write as las_write
from trueterrain.formats.run import Mounting, RunWriter
from trueterrain.formats.table import _write

NOISE = np.random.default_rng(0)
ALONG = 0.01 * np.arange(60)
SURFACE = make_surface(
    NOISE.normal(0, 1, (60, 60)), easting=np.arange(60.0), northing=np.arange(60.0)
)
ROAD = make_surface(
    NOISE.normal(0, 0.01, (60, 60)), u=ALONG, v=ALONG, easting=ALONG, northing=np.zeros(60)
)
POINTS = make_points(*NOISE.uniform(0, 100, (3, 4000)))
PROFILE = make_profile(0.01 * np.arange(3000), NOISE.normal(0, 0.01, 3000))


def write_run(_, path, *, force=False):
    still = {name: np.zeros(2) for name in ("east", "north", "up", "roll", "pitch", "yaw")}
    with RunWriter(
        path,
        name="run",
        origin=(11.0, 48.0, 500.0),
        time_reference="run",
        mounting=Mounting(),
        angle=np.linspace(-0.5, 0.5, 80),
        delay=np.zeros(80),
        force=force,
    ) as run:
        run.append_navigation({"time": [-1.0, 1.0], **still})
        run.append_scans(0.001 * np.arange(90), NOISE.uniform(1, 6, (90, 80)))


def save_picture(profile, path, *, force=False):
    save_figure(profiles(profile), path, force=force)


WRITERS = {
    "map.tif": (geotiff.write, SURFACE),
    "road.crg": (opencrg.write, ROAD),
    "points.las": (las.write, POINTS),
    "points.laz": (las.write, POINTS),
    "points.csv": (table.write, POINTS),
    "points.parquet": (table.write, POINTS),
    "points.zarr": (store.write, POINTS),
    "surface.zarr": (store.write, SURFACE),
    "profile.zarr": (store.write, PROFILE),
    "profile.erd": (erd.write, PROFILE),
    "run.zarr": (write_run, None),
    "picture.png": (save_picture, PROFILE),
}


@contextmanager
def max_file_size(size):
    """Limit the size of files [bytes], as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def content(path):
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return {file: file.read_bytes() for file in files if file.is_file()}


@pytest.mark.slow
@pytest.mark.parametrize("fraction", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_is_an_error_and_leaves_the_old_file(tmp_path, name, fraction):
    write, data = WRITERS[name]
    path = tmp_path / name
    write(data, path)
    before = content(path)
    largest = max(map(len, before.values()))
    for old in (True, False):
        with (
            max_file_size(max(0, int(fraction * largest) - 1)),
            pytest.raises(OutputError) as caught,
        ):
            write(data, path if old else tmp_path / f"new-{name}", force=True)
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith(str(path if old else tmp_path / f"new-{name}"))
    assert content(path) == before
    assert [file.name for file in tmp_path.iterdir()] == [name]


def damaged_before(monkeypatch, owner, name, path_of):
    """Change a byte of a file after it is written and before it is read back."""
    check = getattr(owner, name)

    def after_damage(*arguments, **keywords):
        path = Path(path_of(*arguments))
        inside = bytearray(path.read_bytes())
        inside[len(inside) // 2] ^= 1
        path.write_bytes(inside)
        return check(*arguments, **keywords)

    monkeypatch.setattr(owner, name, after_damage)


READ_BACK = {
    "map.tif": (geotiff, "_require_same", lambda temporary, *_: temporary),
    "points.las": (las_write, "_require_same", lambda temporary, *_: temporary),
    "points.laz": (las_write, "_require_same", lambda temporary, *_: temporary),
    "points.csv": (_write._CsvWriter, "require_same", lambda writer, _: writer._path),
    "points.parquet": (_write._ParquetWriter, "require_same", lambda writer, _: writer._path),
    "profile.erd": (Checksums, "add_file", lambda _, name, path: path),
}


@pytest.mark.parametrize("name", READ_BACK)
def test_a_changed_byte_is_detected(tmp_path, monkeypatch, name):
    write, data = WRITERS[name]
    damaged_before(monkeypatch, *READ_BACK[name])
    with pytest.raises(OutputError, match=f"/{name}: was not written whole"):
        write(data, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["points.zarr", "surface.zarr", "profile.zarr", "run.zarr"])
def test_a_changed_chunk_is_detected(tmp_path, monkeypatch, name):
    put = zarr.Array.__setitem__

    def put_otherwise(array, selection, values):
        put(array, selection, values)
        if array.ndim and np.size(values) > 1:
            array.set_orthogonal_selection((slice(0, 1),) * array.ndim, np.ravel(values)[-1])

    monkeypatch.setattr(zarr.Array, "__setitem__", put_otherwise)
    write, data = WRITERS[name]
    with pytest.raises(OutputError, match=f"/{name}: was not written whole"):
        write(data, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["points.las", "points.zarr", "points.csv"])
def test_numbers_in_another_byte_order(tmp_path, name):
    """Numbers are the same when libraries convert them to the byte order of the machine."""
    write, points = WRITERS[name]
    turned = points.copy()
    for axis in ("easting", "northing", "up"):
        turned[axis] = turned[axis].astype(">f8")
    write(turned, tmp_path / name)
