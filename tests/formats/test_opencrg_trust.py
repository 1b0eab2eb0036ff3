"""Verification of written OpenCRG files: a file that differs from the surface never appears."""

import re
import tracemalloc

import numpy as np
import numpy.testing as npt
import pycrg
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from xarray.backends import BackendArray
from xarray.core import indexing

from trueterrain.core import row_blocks
from trueterrain.core.errors import OutputError
from trueterrain.core.schemas import make_surface
from trueterrain.formats import opencrg
from trueterrain.formats.opencrg import _rules, _stream, _verify, _write
from trueterrain.formats.opencrg._holes import patch_surface
from trueterrain.formats.opencrg._write import blockwise_median

ROWS, COLUMNS = 60, 9
STEP_OF_TEXT = 5e-8  # [m] rounding of heights below 1 m in LRFI: a sign, a point and 7 digits
HEIGHT_OF_FLOAT32 = 2e-6  # [m] of heights up to 2 m, and of what is interpolated between them
BESIDE = 1e-5  # [m] beside a node, far enough that heights there differ by more than that


def road(*, even=True, banked=True, sloped=True, edges=True, holes=False, rows=ROWS):
    """A curved road of 9 nodes across, with heights 421 m above its reference line."""
    u = 0.5 * np.arange(rows)
    v = 0.25 * np.arange(COLUMNS) - 1
    if not even:
        v[3] = -0.3
    heading = 2.5 + 0.3 * np.sin(0.05 * np.arange(rows - 1))
    line = {
        "easting": 691_234.5 + 0.5 * np.concatenate([[0], np.cumsum(np.cos(heading))]),
        "northing": 5_334_567.25 + 0.5 * np.concatenate([[0], np.cumsum(np.sin(heading))]),
    }
    height = 421 + 0.2 * np.sin(3 * u)[:, None] * np.cos(2 * v)
    if sloped:
        line["elevation"] = 0.02 * u + np.sin(0.1 * u)
        height += line["elevation"][:, None]
    if banked:
        line["banking"] = 0.04 * np.sin(0.03 * u) + 0.01
        height += line["banking"][:, None] * v
    if edges:
        height[::3, 0] = height[1::4, -2:] = np.nan
    if holes:
        height[5:20:3, 4] = height[30:40, 3:6] = height[0, 4] = height[-1, 5] = np.nan
    sd = np.full(height.shape, 0.002, dtype=np.float32)
    return make_surface(height, u=u, v=v, sd=sd, crs="EPSG:25832", **line)


@pytest.fixture
def small_blocks(monkeypatch):
    """Blocks of 7 cross-sections, so that the surfaces of these tests count as large."""
    monkeypatch.setattr(row_blocks, "_NODES", 7 * COLUMNS)
    monkeypatch.setattr(_write, "_SAMPLE", 5 * COLUMNS)


@pytest.fixture
def sampled(monkeypatch):
    """The C-API gets only some long sections, as for files beyond 64 MB."""
    monkeypatch.setattr(_verify, "_MAX_BYTES", 4 * 5 * ROWS)


def by_pycrg(surface, path, fmt, monkeypatch):
    """The same file written at once by pycrg, with the same reference line."""
    given_to_pycrg = {}
    whole = pycrg.write

    def listening(path, z, *arguments, **keywords):
        if "x0" in keywords:
            given_to_pycrg.update(keywords)
        whole(path, z, *arguments, **keywords)

    with monkeypatch.context() as patch:
        patch.setattr(pycrg, "write", listening)
        opencrg.write(surface, path, fmt=fmt, force=True)
    written = path.read_bytes()
    with pycrg.DataSet.open(path, apply_modifiers=False) as data:
        line = data.grid()
    v = surface.v.values
    base = line.ref_z[:, None] + line.bank[:, None] * v
    height = opencrg.fill_interior(surface).height.values
    whole(path, height - base, **(given_to_pycrg | {"v": v}))
    return written, path.read_bytes()


@pytest.mark.parametrize("fmt", ["KRBI", "KDBI"])
@pytest.mark.parametrize("even", [False, True])
@pytest.mark.parametrize("line", [(False, False), (True, False), (False, True), (True, True)])
def test_files_equal_those_of_pycrg(tmp_path, monkeypatch, small_blocks, fmt, even, line):
    """Byte by byte, although here pycrg writes neither heights nor the list of long sections."""
    surface = road(even=even, banked=line[0], sloped=line[1], holes=True)
    written, whole = by_pycrg(surface, tmp_path / "road.crg", fmt, monkeypatch)
    assert written == whole


@pytest.mark.parametrize("kind", ["along", "map"])
def test_blocks_do_not_change_a_file(tmp_path, monkeypatch, kind):
    surface = road(holes=True)
    if kind == "map":
        axes = {"easting": 0.25 * np.arange(COLUMNS), "northing": 0.5 * np.arange(ROWS)}
        surface = make_surface(surface.height.values, **axes)
    opencrg.write(surface, tmp_path / "one.crg")
    one = opencrg.read(tmp_path / "one.crg")
    monkeypatch.setattr(row_blocks, "_NODES", 1)
    opencrg.write(surface, tmp_path / "many.crg")
    assert (tmp_path / "many.crg").read_bytes() == (tmp_path / "one.crg").read_bytes()
    xr.testing.assert_equal(opencrg.read(tmp_path / "many.crg"), one)


def test_comments_are_not_parsed_as_header(tmp_path, monkeypatch):
    comment = ["long_section_v_increment = 3", "D:long section 1,m", "#:KDBI", "$", "$" * 72]
    opencrg.write(road(), tmp_path / "road.crg", comment=comment)
    found = opencrg.describe(tmp_path / "road.crg")
    assert found["size"] == [ROWS, COLUMNS]
    assert found["comment"].splitlines()[1:3] == comment[:2]


def test_missing_heights_have_one_nan(tmp_path):
    surface = road()
    opencrg.write(surface, tmp_path / "positive.crg")
    surface["height"] = surface.height.where(surface.height.notnull(), -np.nan)
    opencrg.write(surface, tmp_path / "negative.crg")
    content = (tmp_path / "negative.crg").read_bytes()
    assert content == (tmp_path / "positive.crg").read_bytes()
    assert b"\x7f\xc0\x00\x00" in content
    assert b"\xff\xc0\x00\x00" not in content


def test_a_first_byte_that_the_c_api_skips(tmp_path):
    height = np.zeros((4, 3))
    height[0, 0] = np.array([0x0A000000], dtype="u4").view("f4")[0]
    u = np.arange(4.0)
    surface = make_surface(height, u=u, v=[0, 1, 2], easting=u, northing=np.zeros(4))
    with pytest.raises(OutputError, match="first height is so small"):
        opencrg.write(surface, tmp_path / "road.crg")
    assert list(tmp_path.iterdir()) == []


class Watched(BackendArray):
    """Lazy array that records how many rows are read at a time."""

    def __init__(self, values):
        self.values, self.shape, self.dtype = values, values.shape, values.dtype
        self.most = 0

    def __getitem__(self, key):
        basic = indexing.IndexingSupport.BASIC
        return indexing.explicit_indexing_adapter(key, self.shape, basic, self.read)

    def read(self, key):
        found = self.values[key]
        self.most = max(self.most, len(found))
        return found


@pytest.mark.parametrize("holes", [False, True])
def test_surfaces_on_disk_are_written_block_by_block(tmp_path, small_blocks, holes):
    surface = road(holes=holes)
    opencrg.write(surface, tmp_path / "memory.crg")
    lazy, watched = surface.copy(), {}
    for name in ("height", "sd"):
        watched[name] = Watched(surface[name].values)
        data = indexing.LazilyIndexedArray(watched[name])
        lazy[name] = xr.Variable(("u", "v"), data, surface[name].attrs)
    written = opencrg.write(lazy, tmp_path / "disk.crg")
    assert watched["height"].most <= 7  # a block
    assert watched["sd"].most == 0
    assert (tmp_path / "disk.crg").read_bytes() == (tmp_path / "memory.crg").read_bytes()
    expected = opencrg.fill_interior(surface)
    for name in ("height", "sd", "filled"):
        npt.assert_array_equal(written[name], expected[name])


def test_surfaces_in_a_zarr_store(tmp_path, small_blocks):
    surface = road(holes=True)
    opencrg.write(surface, tmp_path / "memory.crg")
    encoding = {"height": {"chunks": (11, 5)}}
    surface.to_zarr(tmp_path / "store.zarr", consolidated=False, encoding=encoding)
    stored = xr.open_zarr(tmp_path / "store.zarr", chunks=None, consolidated=False)
    opencrg.write(stored, tmp_path / "disk.crg")
    assert (tmp_path / "disk.crg").read_bytes() == (tmp_path / "memory.crg").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("holes", [False, True])
def test_memory(tmp_path, monkeypatch, holes):
    """Writing holds no copy of the heights, reading at most one and a half."""
    surface = road(rows=20_000, holes=holes)
    opencrg.write(road(holes=True), tmp_path / "road.crg")  # imports
    monkeypatch.setattr(row_blocks, "_NODES", 1 << 10)
    monkeypatch.setattr(_write, "_SAMPLE", 1 << 10)
    monkeypatch.setattr(_verify, "_MAX_CELLS", 1 << 10)
    line = sum(surface[name].nbytes for name in ("u", "easting", "northing", "elevation"))
    for work, most in (
        (lambda: opencrg.write(surface, tmp_path / "road.crg", force=True), 0.0),
        (lambda: opencrg.read(tmp_path / "road.crg"), 1.0),
    ):
        tracemalloc.start()
        work()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 8 * line + (most + 0.5) * surface.height.nbytes


def changed_line(key, change):
    """Change a number in a line of the header."""

    def apply(header, payload):
        line = re.compile(rb"^(" + key + rb" += +)(\S+)$", re.MULTILINE)
        assert len(line.findall(header)) == 1
        new = line.sub(lambda m: m[1] + repr(change(float(m[2]))).encode(), header)
        assert new != header
        return new + payload

    return apply


def replaced(old, new):
    def apply(header, payload):
        assert old in header
        return header.replace(old, new, 1) + payload

    return apply


def table(change):
    """Change numbers: three channels of the reference line precede the heights of each section."""

    def apply(header, payload):
        numbers = np.frombuffer(payload, ">f4").copy()
        grid = numbers[: ROWS * (COLUMNS + 3)].reshape(ROWS, COLUMNS + 3)
        grid[:] = change(grid.copy())
        return header + numbers.tobytes()

    return apply


def put(row, column, value):
    def change(grid):
        grid[row, column] = value
        return grid

    return change


def swap(first, second):
    def change(grid):
        grid[:, [first, second]] = grid[:, [second, first]]
        return grid

    return change


DAMAGE = {
    "start_u": changed_line(b"reference_line_start_u", lambda x: x + 0.5),
    "increment": changed_line(b"reference_line_increment", lambda x: x / 2),
    "right": changed_line(b"long_section_v_right", lambda x: x - 0.25),
    "v increment": changed_line(b"long_section_v_increment", lambda x: x / 2),
    "start_x": changed_line(b"reference_line_start_x", lambda x: x + 1e-3),
    "end_x": changed_line(b"reference_line_end_x", lambda x: x + 1e-5),
    "start_z": changed_line(b"reference_line_start_z", lambda x: x + 1e-5),
    "end_z": changed_line(b"reference_line_end_z", lambda x: x + 1e-4),
    "start_y lost": lambda h, p: re.sub(rb"reference_line_start_y.*\n", b"", h) + p,
    "modifiers lost": replaced(b"$ROAD_CRG_MODS\n$\n", b""),
    "a modifier": replaced(b"$ROAD_CRG_MODS\n", b"$ROAD_CRG_MODS\ngrid_nan_mode = 2\n"),
    "number format": replaced(b"#:KRBI", b"#:KDBI"),
    "channels exchanged": replaced(
        b"D:reference line slope,m/m\nD:reference line banking,m/m\n",
        b"D:reference line banking,m/m\nD:reference line slope,m/m\n",
    ),
    "sections exchanged": replaced(
        b"D:long section 2,m\nD:long section 3,m\n", b"D:long section 3,m\nD:long section 2,m\n"
    ),
    "section lost": replaced(b"D:long section 9,m\n", b""),
    "byte order": lambda h, p: h + np.frombuffer(p, "<f4").astype(">f4").tobytes(),
    "from left to right": table(lambda g: np.hstack([g[:, :3], g[:, :2:-1]])),
    "backwards": table(lambda g: g[::-1]),
    "columns and rows": table(lambda g: np.hstack([g[:, :3], g[:, 3:].T.reshape(ROWS, COLUMNS)])),
    "columns exchanged": table(swap(5, 6)),
    "headings as slopes": table(swap(0, 1)),
    "slopes as bankings": table(swap(1, 2)),
    "a block again": table(lambda g: np.vstack([g[:7], g[:7], g[14:]])),
    "one heading": table(put(30, 0, 2.501)),
    "one slope": table(put(30, 1, 0.05)),
    "one banking": table(put(30, 2, 0.05)),
    "one height": table(put(30, 7, 0.2001)),
    "the last height": table(put(-1, -1, 0.2001)),
    "a height at the edge": table(put(0, 3, 0.0)),
    "no height at the edge": table(put(1, 3, np.nan)),
    "a hole": table(put(8, 7, np.nan)),
    "last record lost": lambda h, p: h + p[:-80],
    "a record more": lambda h, p: h + p + p[-80:],
    "no padding": lambda h, p: h + p[:-40] + bytes(40),
    "shifted": lambda h, p: h + p[4:] + p[:4],
}


@pytest.mark.parametrize("size", ["small", "big"])
@pytest.mark.parametrize("name", DAMAGE)
def test_a_wrong_file_does_not_appear(request, tmp_path, monkeypatch, name, size):
    """Errors of any size between the surface and the bytes on disk are detected."""
    if size == "big":
        request.getfixturevalue("small_blocks")
        request.getfixturevalue("sampled")
    check = _verify.require_same

    def after_damage(surface, path, fmt, flat):
        content = path.read_bytes()
        at = content.index(b"$" * 72) + 73
        path.write_bytes(DAMAGE[name](content[:at], content[at:]))
        check(surface, path, fmt, flat)

    surface = road(rows=ROWS)
    opencrg.write(surface, tmp_path / "whole.crg")
    (tmp_path / "whole.crg").unlink()
    monkeypatch.setattr(_verify, "require_same", after_damage)
    with pytest.raises(OutputError):
        opencrg.write(surface, tmp_path / "road.crg")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fmt", ["LRFI", "LDFI"])
def test_a_wrong_text_file_does_not_appear(tmp_path, monkeypatch, fmt):
    whole = pycrg.write

    def lossy(path, z, *arguments, **keywords):
        whole(path, np.asarray(z) + 1e-3 * (np.shape(z)[1] > 2), *arguments, **keywords)

    monkeypatch.setattr(pycrg, "write", lossy)
    with pytest.raises(OutputError, match=r"when it is read back: differences of 0\.001 m"):
        opencrg.write(road(), tmp_path / "road.crg", fmt=fmt)
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_reference_line_does_not_appear(tmp_path, monkeypatch):
    """Heights that are correct only above a different reference line."""
    learn = _stream.flat_road

    def wrong(*arguments):
        flat = learn(*arguments)
        flat.grid.ref_z[20:] += 1e-4
        return flat

    monkeypatch.setattr(_write, "flat_road", wrong)
    with pytest.raises(OutputError, match=r"not .* m\."):
        opencrg.write(road(), tmp_path / "road.crg")
    assert list(tmp_path.iterdir()) == []


@given(
    st.lists(st.one_of(st.integers(-3, 3), st.just(np.nan), st.floats(-9, 9)), min_size=1),
    st.integers(1, 9),
    st.integers(1, 9),
)
def test_blockwise_median_equals_numpy(values, size, step):
    """Values with ties and gaps, any blocks, any sample."""
    values = np.array(values, dtype=float)
    finite = values[np.isfinite(values)]
    if not finite.size:
        values = np.append(values, 0.0)
        finite = np.zeros(1)
    found = blockwise_median(
        lambda: (values[at : at + size] for at in range(0, values.size, size)), values[::step]
    )
    assert found == np.median(finite)


def some_of(count):
    ahead = st.slices(count).filter(lambda chosen: chosen.step is None or chosen.step > 0)
    few = st.lists(st.integers(0, count - 1), max_size=5)
    return st.one_of(st.integers(-count, count - 1), ahead, few, st.just(slice(None, None, -2)))


@settings(max_examples=50)
@given(some_of(ROWS), some_of(COLUMNS))
def test_patched_arrays_support_every_index(rows, columns):
    surface = road(holes=True)
    holes = np.flatnonzero(opencrg.fill_interior(surface).filled.values)
    lazy = patch_surface(surface, holes)
    whole = lazy.height[:].values
    assert np.isfinite(whole.reshape(-1)[holes]).all()
    npt.assert_array_equal(lazy.height[rows, columns], whole[rows][..., columns])


@st.composite
def sections(draw, most=420):
    """Long sections at multiples of 1 mm, equally spaced or not, fewer or more than 200."""
    count = draw(st.integers(2, most))
    step = draw(st.integers(1, 30))
    places = step * np.arange(count)
    if draw(st.booleans()):
        generator = np.random.default_rng(draw(st.integers(0, 99)))
        places = np.sort(generator.choice(step * count, count, replace=False))
    return np.round((places - draw(st.integers(0, 2000))) / 1000, 3)


@pytest.mark.slow
@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sections(), st.data())
def test_every_size_is_written(tmp_path, monkeypatch, v, given):
    """Roads of any width and length, on either side of all limits of blocks, copies and checks."""
    fmt = given.draw(st.sampled_from(["KRBI", "KDBI", "LRFI", "LDFI"]))
    rows = given.draw(st.integers(2, 40 if fmt in ("KRBI", "KDBI") else 4))
    u = 0.01 * np.arange(rows)
    noise = np.random.default_rng(v.size).normal(0, 5e-4, (rows, v.size))  # [m] neighbours differ
    if given.draw(st.booleans()):
        noise[::2, 0] = np.nan
    surface = make_surface(noise, u=u, v=v, easting=u, northing=np.zeros(rows))
    size = 4 if fmt == "KRBI" else 8
    with monkeypatch.context() as limits:
        limits.setattr(_verify, "_MAX_BYTES", given.draw(st.integers(1, size * noise.size + 1000)))
        limits.setattr(_verify, "_MAX_CELLS", given.draw(st.integers(1, 2 * noise.size)))
        limits.setattr(row_blocks, "_NODES", given.draw(st.integers(1, 2 * noise.size)))
        limits.setattr(_write, "_SAMPLE", given.draw(st.integers(1, 2 * noise.size)))
        path = tmp_path / "road.crg"
        if _rules.overlooked_sections(v).any():
            with pytest.raises(OutputError, match="must be equally spaced or at least"):
                opencrg.write(surface, path, fmt=fmt, force=True)
            return
        opencrg.write(surface, path, fmt=fmt, force=True)
    npt.assert_allclose(opencrg.read(path).height, noise, rtol=0, atol=STEP_OF_TEXT)


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sections(most=260))
def test_overlooked_sections_are_those_of_the_c_api(tmp_path, v):
    """The C-API finds wrong heights next to the listed sections, and only there."""
    height = np.random.default_rng(v.size).uniform(1, 2, (2, v.size))
    height[:, ::2] *= -1  # neighbours differ by 2 m or more
    pycrg.write(tmp_path / "road.crg", height, 0.01, v, mods={})
    places = np.concatenate([np.linspace(v[0], v[-1], 5000), v[:-1] + BESIDE, v[1:] - BESIDE])
    with pycrg.RoadSurface.open(tmp_path / "road.crg", apply_modifiers=False) as crg:
        found = crg.uv_to_z_many(np.zeros(places.size), places)
    wrong = np.abs(found - np.interp(places, v, height[0])) > HEIGHT_OF_FLOAT32
    overlooked = _rules.overlooked_sections(v)
    assert overlooked.any() or not wrong.any()
    # little or nothing is wrong behind one that lies at the end of a step of the table
    steps = (v - v[0]) / (v[-1] - v[0]) * 199
    at_end = (np.ceil(steps) - steps) * (v[-1] - v[0]) / 199 < 2 * BESIDE
    assert wrong.any() or not (overlooked & ~at_end).any()


def test_sections_that_the_c_api_overlooks_are_flagged(tmp_path):
    """A file of another program that programs with the C library read wrongly."""
    v = np.delete(0.01 * np.arange(381) - 1.9, 7)
    pycrg.write(tmp_path / "road.crg", np.zeros((3, v.size)), 0.01, v, mods={})
    (found,) = opencrg.describe(tmp_path / "road.crg")["problems"]
    assert found.startswith("the distance between long sections is not the same and at v = -1.87 m")


def test_evaluated_cells_cover_all_columns():
    for rows, columns in ((160_000, 380), (16_000, 380), (1000, 1), (3, 2), (90_000, 64)):
        cells = (rows - 1) * columns
        chosen = np.arange(0, cells, _verify._sampling_step(cells, columns))
        assert chosen.size <= _verify._MAX_CELLS
        assert np.unique(chosen % columns).size == columns or cells < columns
        assert chosen.size > 0.8 * min(cells, _verify._MAX_CELLS)
