"""Files whose heights stay on disk hold what small files hold, bit for bit."""

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain import formats
from trueterrain.core.errors import FormatError
from trueterrain.core.row_blocks import stored_rows
from trueterrain.core.schemas import make_surface
from trueterrain.formats import opencrg
from trueterrain.formats.opencrg import _read


@pytest.fixture
def road():
    """Banked road on a bend, with missing edges."""
    u, v = 0.05 * np.arange(300), 0.1 * (np.arange(33) - 16)
    rng = np.random.default_rng(5)
    height = 100 + 0.02 * u[:, None] + 0.01 * v + rng.normal(0, 0.002, (u.size, v.size))
    height[40:60, :3] = np.nan
    angle = 2 * np.arcsin(0.05 / 100) * np.arange(u.size)  # of chords of 50 mm on 50 m radius
    return make_surface(
        height,
        u=u,
        v=v,
        easting=50 * np.sin(angle),
        northing=50 * (1 - np.cos(angle)),
        elevation=100 + 0.02 * u,
        banking=np.full(u.size, 0.01),
    )


@pytest.fixture
def on_disk(monkeypatch):
    """All binary files count as large; blocks have few rows."""
    monkeypatch.setattr("trueterrain.formats.opencrg._read.LARGE", 0)
    monkeypatch.setattr("trueterrain.core.row_blocks._NODES", 700)


@pytest.mark.parametrize("fmt", ["KRBI", "KDBI"])
def test_heights_on_disk_are_those_in_memory(road, tmp_path, fmt, request):
    path = tmp_path / "road.crg"
    opencrg.write(road, path, fmt=fmt)
    expected, summary = opencrg.read(path), formats.info(path)
    assert stored_rows(expected) is None
    request.getfixturevalue("on_disk")
    found = opencrg.read(path)
    assert stored_rows(found) == 700 // 33
    assert formats.info(path) == summary
    npt.assert_array_equal(found.height[[7, 3, 250]], expected.height[[7, 3, 250]])
    npt.assert_array_equal(found.height[5, 2:4], expected.height[5, 2:4])
    npt.assert_array_equal(found.height[-3::-50], expected.height[-3::-50])
    xr.testing.assert_identical(found.load(), expected)


@pytest.mark.usefixtures("on_disk")
@pytest.mark.parametrize(
    ("label", "exchanged"), [(b"D:LONG SECTION", True), (b"D: long section", False)]
)
def test_headers_of_other_programs(road, tmp_path, monkeypatch, label, exchanged):
    """Where long sections cannot be exchanged, the library reads the file as a whole."""
    path, other = tmp_path / "road.crg", tmp_path / "other.crg"
    opencrg.write(road.isel(v=[0, 1, 3, 7, 20, 32]), path)
    content = path.read_bytes()
    assert content.count(b"D:long section") == 6
    other.write_bytes(content.replace(b"D:long section", label))
    copies = []
    make_copy = _read._grid_of_copy
    monkeypatch.setattr(
        _read, "_grid_of_copy", lambda *a: copies.append(make_copy(*a)) or copies[0]
    )
    npt.assert_array_equal(opencrg.read(other).height, opencrg.read(path).height)
    assert (copies[0] is not None) == exchanged


@pytest.mark.usefixtures("on_disk")
def test_damage_of_a_large_file_is_found(road, tmp_path):
    path = tmp_path / "road.crg"
    opencrg.write(road, path)
    content = bytearray(path.read_bytes())
    at = len(content) - 4000
    content[at : at + 4] = np.float32(1e30).astype(">f4").tobytes()
    path.write_bytes(content)
    with pytest.raises(FormatError, match="must be at most"):
        opencrg.read(path)
