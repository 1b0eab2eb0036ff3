"""Stores of points, surfaces and profiles: lossless, and damage is always detected."""

import json
import shutil

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
import zarr

from trueterrain import formats
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, FormatError, OutputError, SchemaError
from trueterrain.core.schemas import make_points, make_profile, make_surface
from trueterrain.formats import store
from trueterrain.formats.store import _layout, _read, _statistics, _write

CHUNK = 100  # points, instead of many: so that small stores have many chunks


@pytest.fixture
def small_chunks(monkeypatch):
    for module in (_layout, _read, _statistics, _write):
        monkeypatch.setattr(module, "CHUNK", CHUNK)


def cloud(count=1234, seed=1, crs="EPSG:25832"):
    """Points along easting as from a scanner, with all variables of points."""
    rng = np.random.default_rng(seed)
    points = make_points(
        691000 + np.sort(rng.uniform(0, 50, count)),
        5334000 + rng.uniform(-2, 2, count),
        512 + rng.normal(0, 0.01, count),
        crs=crs,
        time=4321.0 + 1e-3 * np.arange(count),
        intensity=rng.integers(0, 4096, count).astype(np.uint16),
        lane=np.repeat(np.array([3, 7], np.uint16), [count // 2, count - count // 2]),
        sd=rng.uniform(0.001, 0.002, count).astype(np.float32),
    )
    points = points.assign_attrs(gps_time_kind="week seconds", scans=7, fraction=np.float64(0.1))
    return provenance.add_step(points, "measure", parameters={"beams": [1, 2]})


def road(rows=300, columns=7):
    """Surface along a bend, with holes and all variables of surfaces."""
    rng = np.random.default_rng(2)
    u, v = 0.1 * np.arange(rows), np.linspace(-0.3, 0.3, columns)
    height = rng.normal(512, 0.01, (rows, columns))
    height[:5, :2] = np.nan
    return make_surface(
        height,
        u=u,
        v=v,
        easting=50 * np.sin(u / 50),
        northing=50 - 50 * np.cos(u / 50),
        elevation=512 + 0.01 * u,
        banking=0.02 * np.ones(rows),
        crs="EPSG:25832",
        count=rng.integers(0, 9, (rows, columns)).astype(np.int32),
        sd=rng.uniform(0, 0.01, (rows, columns)).astype(np.float32),
        filled=rng.random((rows, columns)) < 0.1,
    )


def field():
    rng = np.random.default_rng(3)
    return make_surface(
        rng.normal(5, 1, (40, 30)), easting=100 + 0.5 * np.arange(30), northing=7.0 * np.arange(40)
    )


def profiles():
    rng = np.random.default_rng(4)
    s = 0.05 * np.arange(777)
    return make_profile(
        s,
        rng.normal(0, 0.01, (2, s.size)),
        tracks=["left", "right of it"],
        easting=np.tile(s, (2, 1)),
        sd=rng.uniform(0, 1, (2, s.size)),
    )


DATA = {
    "points": cloud,
    "bare points": lambda: make_points([1, 2], [3, 4], [5, 6]),
    "surface": road,
    "map": field,
    "profiles": profiles,
    "profile": lambda: make_profile([0.0, 0.3], [np.nan, 0.1 + 0.2], count=[3, 4]),
    "one of profiles": lambda: profiles().sel(track="left"),
}


# --- round trips ----------------------------------------------------------------------------------


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("name", DATA)
def test_stores_are_lossless(tmp_path, name):
    data = DATA[name]()
    formats.write(data, tmp_path / "a.zarr")
    again = formats.open(tmp_path / "a.zarr")
    xr.testing.assert_identical(again, data)
    for key, variable in data.variables.items():
        if variable.dtype.kind != "U":  # which are as wide as the longest text
            assert again[key].dtype == variable.dtype
            assert again[key].values.tobytes() == variable.values.tobytes()
    assert list(again.data_vars) == list(data.data_vars)
    assert formats.recognise_format(tmp_path / "a.zarr").name == "Zarr"
    assert formats.kind_of_file(tmp_path / "a.zarr") == data.attrs["kind"].split("/")[1]
    json.dumps(formats.info(tmp_path / "a.zarr"))


@pytest.mark.parametrize("name", ["points", "surface", "map", "profile"])
def test_xarray_opens_the_same_data(tmp_path, name):
    data = DATA[name]()
    formats.write(data, tmp_path / "a.zarr")
    with xr.open_dataset(
        tmp_path / "a.zarr", engine="zarr", consolidated=False, chunks=None, decode_times=False
    ) as again:
        xr.testing.assert_identical(again.load(), data)


def test_a_real_road_and_a_real_cloud(data, tmp_path):
    for source in ("opencrg/asam/belgian_block.crg", "scanning/strips/faceraster_2strips_20m.laz"):
        before = formats.open(data / source)
        target = tmp_path / f"{source.rpartition('/')[2]}.zarr"
        formats.write(before, target)
        xr.testing.assert_identical(formats.open(target), before)


def test_values_that_a_store_cannot_hold_are_refused(tmp_path):
    dated = make_profile([0, 1], [0, 1]).assign_coords(when=("s", np.array(["NaT"] * 2, "M8[s]")))
    strange = make_points([0], [0], [0]).assign_attrs(strange=object())
    placed = make_points([0], [0], [0]).assign_coords(place=3)
    for data, words in (
        (dated, "variable when: must hold numbers"),
        (strange, "object cannot be kept in a store"),
        (placed, "variable place: must have the dimension"),
        (xr.Dataset(), "has no known kind"),
    ):
        with pytest.raises(SchemaError, match=words):
            formats.write(data, tmp_path / "a.zarr")
    assert not list(tmp_path.iterdir())


# --- points in blocks -----------------------------------------------------------------------------


def files_of(path):
    return {p.relative_to(path): p.read_bytes() for p in path.rglob("*") if p.is_file()}


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("size", [7, 100, 450, 5000])
def test_blocks_of_any_size_make_the_same_store(tmp_path, size):
    points = cloud()
    formats.write(points, tmp_path / "whole.zarr")
    parts = (points.isel(point=slice(i, i + size)) for i in range(0, points.sizes["point"], size))
    formats.write(parts, tmp_path / "parts.zarr")
    assert files_of(tmp_path / "whole.zarr") == files_of(tmp_path / "parts.zarr")
    blocks = list(formats.point_blocks(tmp_path / "parts.zarr", size=size))
    assert max(block.sizes["point"] for block in blocks) <= size
    xr.testing.assert_identical(xr.concat(blocks, "point"), points)


def test_points_are_written_as_they_come(tmp_path, monkeypatch, small_chunks):
    """When the last block is computed, all but a few chunks are on disk already."""
    held = []

    def parts():
        for number in range(50):
            yield cloud(60, seed=number)
        (temporary,) = tmp_path.glob("*/new/a.zarr")
        held.append(zarr.open_group(temporary, mode="r")["up"].shape[0])

    formats.write(parts(), tmp_path / "a.zarr")
    assert 50 * 60 - held[0] <= 4 * CHUNK + 60


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("size", [50, 300, 10_000])
@pytest.mark.parametrize(
    "bounds",
    [
        (691010.0, 5333999.0, 691011.0, 5334001.0),
        (0.0, 0.0, 1.0, 1.0),
        (-np.inf, 5334001.5, np.inf, np.inf),
        (691000.0, 5333998.0, 691050.0, 5334002.0),
    ],
)
def test_blocks_within_bounds(tmp_path, size, bounds):
    points = cloud()
    formats.write(points, tmp_path / "a.zarr")
    west, south, east, north = bounds
    x, y = points.easting.values, points.northing.values
    inside = np.flatnonzero((x >= west) & (x <= east) & (y >= south) & (y <= north))
    found = list(formats.point_blocks(tmp_path / "a.zarr", bounds=bounds, size=size))
    assert sum(block.sizes["point"] for block in found) == inside.size
    if found:
        xr.testing.assert_identical(xr.concat(found, "point"), points.isel(point=inside))


def test_bounds_include_edges_and_exclude_nan(tmp_path):
    points = make_points([0.0, 1.0, 2.0, np.nan], [0.0, 1.0, 2.0, 1.0], [0.0, 1.0, 2.0, 3.0])
    formats.write(points, tmp_path / "a.zarr")
    (block,) = formats.point_blocks(tmp_path / "a.zarr", bounds=(1, 1, 2, 2))
    npt.assert_array_equal(block.up, [1, 2])
    problems = formats.info(tmp_path / "a.zarr")["problems"]
    assert problems == ["1 of 4 points have coordinates that are not finite"]


@pytest.mark.usefixtures("small_chunks")
def test_only_chunks_that_touch_the_bounds_are_read(tmp_path):
    """Damage of other chunks has no effect."""
    points = cloud()
    formats.write(points, tmp_path / "a.zarr")
    spoil(tmp_path / "a.zarr" / "up" / "c.0")
    east = float(points.easting[-1])
    (block,) = formats.point_blocks(tmp_path / "a.zarr", bounds=(east - 1, 0, east, 1e9))
    assert block.sizes["point"]
    with pytest.raises(FormatError, match=r"array up, chunk c\.0: is damaged"):
        list(formats.point_blocks(tmp_path / "a.zarr", size=CHUNK))


def test_a_crs_of_the_user_and_invalid_arguments(tmp_path):
    formats.write(cloud(10), tmp_path / "a.zarr")
    formats.write(road(), tmp_path / "road.zarr")
    (block,) = formats.point_blocks(tmp_path / "a.zarr", crs="EPSG:2154")
    assert block.attrs["crs"] == "EPSG:2154"
    for arguments, words in (({"size": 0}, "size must"), ({"bounds": (1, 0, 0, 1)}, "bounds must")):
        with pytest.raises(ValueError, match=words):
            list(store.blocks(tmp_path / "a.zarr", **arguments))
    with pytest.raises(FormatError, match="holds a surface, not points"):
        list(formats.point_blocks(tmp_path / "road.zarr"))


def test_blocks_must_have_the_same_variables_and_crs(tmp_path):
    for second, words in (
        (cloud(5).drop_vars("sd"), "must have the same variables"),
        (cloud(5).assign(sd=cloud(5)["sd"].astype(float)), "sd .float64.* after .*sd .float32"),
        (cloud(5, crs=""), "same CRS, got '' after 'EPSG:25832'"),
        (road(), "easting"),
    ):
        with pytest.raises(SchemaError, match=words):
            formats.write(iter([cloud(5), second]), tmp_path / "a.zarr")
    for empty in ([], [cloud(5).isel(point=[])]):
        with pytest.raises(CoverageError, match="no points to write"):
            formats.write(iter(empty), tmp_path / "a.zarr")
    assert not list(tmp_path.iterdir())


def test_attributes_are_those_of_the_last_block(tmp_path):
    """The last block holds the counts of all points."""
    parts = (cloud(5).assign_attrs(returns=n) for n in (5, 10, 15))
    formats.write(parts, tmp_path / "a.zarr")
    assert formats.open(tmp_path / "a.zarr").attrs["returns"] == 15


# --- parts of surfaces and profiles ---------------------------------------------------------------


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize(
    ("name", "dim"), [("surface", "u"), ("map", "northing"), ("profiles", "s")]
)
def test_only_the_requested_part_is_read(tmp_path, name, dim):
    data = DATA[name]()
    formats.write(data, tmp_path / "a.zarr")
    start, end = (float(value) for value in data[dim][[20, 35]])
    part = store.read(tmp_path / "a.zarr", between=(start, end))
    xr.testing.assert_identical(part, data.isel({dim: slice(20, 36)}))
    if name == "surface":
        spoil(tmp_path / "a.zarr" / "height" / "c.0.0")
        store.read(tmp_path / "a.zarr", between=(start, end))
    with pytest.raises(CoverageError, match="rows between -9 and -8 m"):
        store.read(tmp_path / "a.zarr", between=(-9, -8))
    with pytest.raises(ValueError, match="between must be"):
        store.read(tmp_path / "a.zarr", between=(1, 0))


def test_a_surface_that_is_not_in_memory_is_written_in_rows(tmp_path, small_chunks):
    formats.write(road(), tmp_path / "a.zarr")
    with xr.open_dataset(
        tmp_path / "a.zarr", engine="zarr", consolidated=False, chunks=None, cache=False
    ) as lazy:
        formats.write(lazy, tmp_path / "b.zarr")
    xr.testing.assert_identical(formats.open(tmp_path / "b.zarr"), road())


# --- info -----------------------------------------------------------------------------------------


@pytest.mark.usefixtures("small_chunks")
def test_info_of_points_is_that_of_the_values(tmp_path):
    points = cloud()
    formats.write(points, tmp_path / "a.zarr")
    found = formats.info(tmp_path / "a.zarr")
    assert (found["format"], found["kind"], found["count"]) == ("Zarr", "points", 1234)
    for name in ("easting", "northing", "up"):
        assert found["extent"][name] == [float(points[name].min()), float(points[name].max())]
    assert found["time"] == {"kind": "week seconds", "start": 4321.0, "end": 4321.0 + 1.233}
    assert found["lanes"] == {"3": 617, "7": 617}
    assert found["crs"] == "EPSG:25832"
    assert found["problems"] == []
    assert found["bytes"] == sum(map(len, files_of(tmp_path / "a.zarr").values()))


def test_info_of_surfaces_is_that_of_their_crg_and_their_values(tmp_path):
    surface = road()
    formats.write(surface, tmp_path / "a.zarr")
    found = formats.info(tmp_path / "a.zarr")
    assert (found["size"], found["spacing"]) == ([300, 7], {"u": 0.1, "v": 0.1})
    assert found["range"]["v"] == [-0.3, 0.3]
    assert found["missing"] == 10 / 2100
    height = surface.height.values
    assert found["extent"]["height"] == [np.nanmin(height), np.nanmax(height)]
    # outer edge of the bend around (0, 50), which turns by 29.9 m / 50 m
    at = 0.6 * 299 / 300
    npt.assert_allclose(
        [found["extent"]["easting"], found["extent"]["northing"]],
        [[0, 50.3 * np.sin(at)], [-0.3, 50 - 49.7 * np.cos(at)]], rtol=0, atol=0.001,
    )  # fmt: skip
    formats.write(field(), tmp_path / "map.zarr")
    assert formats.info(tmp_path / "map.zarr")["extent"]["northing"] == [0.0, 273.0]


def test_info_lists_foreign_entries_of_a_store(tmp_path):
    formats.write(profiles(), tmp_path / "a.zarr")
    zarr.open_group(tmp_path / "a.zarr", mode="a").create_array("mine", shape=(3,), dtype="f8")
    found = formats.info(tmp_path / "a.zarr")
    assert found["problems"] == ["mine: is not part of the store and is ignored"]
    assert [track["name"] for track in found["tracks"]] == ["left", "right of it"]
    xr.testing.assert_identical(formats.open(tmp_path / "a.zarr"), profiles())


# --- damage ---------------------------------------------------------------------------------------


def spoil(path):
    """Flip one bit in the middle of a file."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(bytes(content))


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


DAMAGE = {
    "a bit of a chunk": (lambda p: spoil(p / "up" / "c.3"), "array up, chunk c.3"),
    "half a chunk": (lambda p: cut(p / "easting" / "c.0"), "array easting, chunk c.0"),
    "an empty chunk": (lambda p: (p / "sd" / "c.2").write_bytes(b""), "array sd, chunk c.2"),
    "no chunk": (lambda p: (p / "time" / "c.1").unlink(), "array time: 1 of 13 chunks are missing"),
    "no array": (lambda p: shutil.rmtree(p / "intensity"), "array intensity: is missing"),
    "half an array": (lambda p: cut(p / "up" / "zarr.json"), "array up"),
    "no summary": (lambda p: shutil.rmtree(p / "summary"), "group summary"),
    "half a summary": (lambda p: cut(p / "summary" / "zarr.json"), "summary/zarr.json"),
    "no bounds": (lambda p: shutil.rmtree(p / "summary" / "bounds"), "summary/bounds: is missing"),
    "half a group": (lambda p: cut(p / "zarr.json"), "zarr.json: is damaged"),
    "no group": (lambda p: (p / "zarr.json").unlink(), "no zarr.json"),
    "another length": (
        lambda p: zarr.open_group(p, mode="a")["northing"].resize((999,)),
        "1234] float64",
    ),
    "another schema": (
        lambda p: zarr.open_group(p, mode="a").attrs.update(schema=9),
        "update trueterrain",
    ),
}


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("name", DAMAGE)
def test_damage_gives_a_one_line_error(tmp_path, name):
    path = tmp_path / "a.zarr"
    formats.write(cloud(), path)
    harm, words = DAMAGE[name]
    harm(path)
    for look in (formats.open, lambda p: list(formats.point_blocks(p))):
        with pytest.raises(FormatError) as caught:
            look(path)
        message = str(caught.value)
        assert message.startswith(f"{path}: ")
        assert words in message
        assert any(cure in message for cure in ("Copy the whole folder", "update", "Convert"))
        assert "\n" not in message


def test_a_store_that_breaks_the_rules_of_its_kind_is_damaged(tmp_path):
    formats.write(field(), tmp_path / "a.zarr")
    zarr.open_group(tmp_path / "a.zarr", mode="a")["height"].attrs["units"] = "ft"
    with pytest.raises(FormatError, match=r"variable height: is damaged \(must be in m"):
        formats.open(tmp_path / "a.zarr")


def test_damage_of_every_array_is_detected(tmp_path):
    for kind, data in (("surface", road()), ("profile", profiles())):
        formats.write(data, tmp_path / f"{kind}.zarr")
        for name in map(str, data.variables):
            broken = shutil.copytree(tmp_path / f"{kind}.zarr", tmp_path / f"{name}.zarr")
            (chunk,) = (broken / name).glob("c*")
            spoil(chunk)
            with pytest.raises(FormatError, match=f"array {name}"):
                formats.open(broken)
            shutil.rmtree(broken)


def test_messages_name_the_kind_of_foreign_folders(tmp_path):
    foreign = tmp_path / "foreign.zarr"
    xr.Dataset({"height": ("s", [1.0, 2.0])}, attrs={"title": "none of ours"}).to_zarr(
        foreign, zarr_format=3, consolidated=False
    )
    xr.Dataset({"height": ("s", [1.0])}).to_zarr(
        tmp_path / "old.zarr", zarr_format=2, consolidated=False
    )
    zarr.create_group(tmp_path / "new.zarr", attributes={"kind": "trueterrain/picture"})
    (tmp_path / "empty.zarr").mkdir()
    (tmp_path / "list.zarr").mkdir()
    (tmp_path / "list.zarr" / "zarr.json").write_text("[1]")
    for name, words in (
        ("foreign", "is a Zarr store, but of no kind that is known"),
        ("old", "Zarr 2 store"),
        ("new", "update trueterrain"),
        ("empty", "holds no zarr.json"),
        ("list", "no kind"),
    ):
        for look in (formats.open, formats.info, formats.kind_of_file, store.read):
            with pytest.raises(FormatError, match=words) as caught:
                look(tmp_path / f"{name}.zarr")
            assert caught.value.cure
    with pytest.raises(FileNotFoundError):
        store.read(tmp_path / "none.zarr")


# --- outputs --------------------------------------------------------------------------------------


def test_force_replaces_only_a_store_of_the_same_kind(tmp_path):
    kept = {"foreign": {"title": "none"}, "run": {"kind": "trueterrain/run"}}
    for name, attrs in kept.items():
        zarr.create_group(tmp_path / f"{name}.zarr", attributes=attrs)
    (tmp_path / "folder.zarr").mkdir()
    (tmp_path / "file.zarr").write_text("a file")
    for name in ("foreign", "run", "folder", "file"):
        with pytest.raises(OutputError, match="exists already"):
            formats.write(cloud(5), tmp_path / f"{name}.zarr")
        with pytest.raises(OutputError, match="replaced"):
            formats.write(cloud(5), tmp_path / f"{name}.zarr", force=True)
    formats.write(road(), tmp_path / "a.zarr")
    with pytest.raises(OutputError, match="exists already"):
        formats.write(cloud(5), tmp_path / "a.zarr")
    with pytest.raises(OutputError, match="is a surface in a store, which is never replaced"):
        formats.write(cloud(5), tmp_path / "a.zarr", force=True)
    formats.write(road().isel(u=slice(3)), tmp_path / "a.zarr", force=True)
    xr.testing.assert_identical(formats.open(tmp_path / "a.zarr"), road().isel(u=slice(3)))
    assert len(list(tmp_path.iterdir())) == 5


def test_a_store_is_replaced_whole_or_not_at_all(tmp_path):
    formats.write(cloud(5), tmp_path / "a.zarr")

    def broken():
        yield cloud(7)
        raise FormatError("the source ends")

    with pytest.raises(FormatError, match="the source ends"):
        formats.write(broken(), tmp_path / "a.zarr", force=True)
    xr.testing.assert_identical(formats.open(tmp_path / "a.zarr"), cloud(5))
    assert [path.name for path in tmp_path.iterdir()] == ["a.zarr"]


def test_outputs_are_checked_before_the_work(tmp_path):
    formats.write(cloud(5), tmp_path / "a.zarr")
    for output, words in (
        ("a.zarr", "is an input as well"),
        ("no/b.zarr", "does not exist"),
        ("a.zarr/b.zarr", "within another store"),
        ("a.csv", ""),
    ):
        if words:
            with pytest.raises(OutputError, match=words):
                formats.require_writable(
                    tmp_path / output, force=True, inputs=[tmp_path / "a.zarr"]
                )
        else:
            formats.require_writable(tmp_path / output, inputs=[tmp_path / "a.zarr"])
    with pytest.raises(ValueError, match=r"must end with \.zarr"):
        store.write(cloud(5), tmp_path / "a.points")
