"""Surfaces whose nodes stay on disk: every function gives what it gives in memory, bit for bit."""

from functools import partial

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain import formats
from trueterrain.core.schemas import make_surface
from trueterrain.formats.opencrg import write as write_crg
from trueterrain.formats.store import SurfaceStore, open_surface
from trueterrain.geometry.path import offset_path
from trueterrain.profile import Disc, point_profile, tyre_profile
from trueterrain.profile.envelope import RigidDisc, tyre_envelope
from trueterrain.surface import down_sample, fill_holes, heights_at
from trueterrain.surface.evaluate import node_points, summarise_surface, surface_to_points
from trueterrain.surface.grid import trim_surface
from trueterrain.surface.holes import HoleSettings, count_holes, filled_blocks

ROWS, COLUMNS, STEP = 400, 41, 0.02
HOLES = HoleSettings(largest=0.2)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Chunks and blocks of few rows, so that a small surface has many of them."""
    monkeypatch.setattr("trueterrain.formats.store._layout.CHUNK", 17 * COLUMNS)
    monkeypatch.setattr("trueterrain.core.row_blocks._NODES", 23 * COLUMNS)


@pytest.fixture
def road():
    """Rough road along a bend of 30 m radius, with holes and empty ends."""
    rng = np.random.default_rng(3)
    u, v = STEP * np.arange(ROWS), STEP * (np.arange(COLUMNS) - COLUMNS // 2)
    height = 0.05 * np.sin(u)[:, None] + 0.02 * v + rng.normal(0, 0.003, (ROWS, COLUMNS))
    height[rng.random(height.shape) < 0.03] = np.nan
    height[100:130, 10:14] = np.nan
    height[:5] = height[-3:] = np.nan
    sd = np.where(np.isfinite(height), 0.001, np.nan).astype(np.float32)
    return make_surface(
        height,
        u=u,
        v=v,
        easting=30 * np.sin(u / 30),
        northing=30 * (1 - np.cos(u / 30)),
        count=rng.integers(1, 9, height.shape).astype(np.int32),
        sd=sd,
    )


@pytest.fixture
def stored(road, tmp_path):
    """The same road on disk."""
    formats.write(road, tmp_path / "road.zarr")
    return open_surface(tmp_path / "road.zarr")


@pytest.fixture
def path(road):
    """Path along the bend, away from both ends."""
    whole = offset_path(road, 0.1, spacing=0.01)
    return whole.part(60, len(whole) - 60)


def test_opening_reads_no_nodes(stored, monkeypatch):
    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr("trueterrain.formats._zarr.StoredArray.read", refuse)
    part = stored.isel(u=slice(10, 20))
    assert part.height.shape == (10, COLUMNS)
    with pytest.raises(AssertionError):
        part.height.values  # noqa: B018 - the nodes are read here


def test_values_are_those_that_were_written(road, stored):
    xr.testing.assert_identical(stored.load(), road)


def test_summary_and_trimming(road, stored):
    assert summarise_surface(stored) == summarise_surface(road)
    trimmed = trim_surface(stored)
    assert trimmed.sizes["u"] == ROWS - 8
    xr.testing.assert_identical(trimmed.load(), trim_surface(road))


@pytest.mark.parametrize("factor", [(2, 3), (5, 4), (1, 2)])
def test_coarser_surfaces(road, stored, factor):
    coarse, loss = down_sample(stored, factor)
    expected, expected_loss = down_sample(road, factor)
    xr.testing.assert_identical(coarse, expected)
    assert loss == pytest.approx(expected_loss, rel=1e-9)  # sums of blocks, in another order


def test_holes(road, stored):
    filled, report = fill_holes(road, HOLES)
    assert count_holes(stored, HOLES) == report
    assert report["filled_nodes"] > 100
    assert report["open_holes"] == 1
    blocks = list(filled_blocks(stored, HOLES))
    assert len(blocks) > 10
    npt.assert_array_equal(np.concatenate([height for _, height, _ in blocks]), filled.height)
    npt.assert_array_equal(np.concatenate([mark for _, _, mark in blocks]), filled["filled"])


def test_heights_between_the_nodes(road, stored):
    rng = np.random.default_rng(4)
    easting, northing = rng.uniform(-1, 9, 3000), rng.uniform(-1, 2, 3000)
    found = heights_at(stored, easting, northing)
    npt.assert_array_equal(found, heights_at(road, easting, northing))
    assert 200 < np.isfinite(found).sum() < 2900


def test_nodes_as_points(road, stored):
    expected = surface_to_points(road)
    parts = list(node_points(stored))
    assert len(parts) > 10
    for name in ("easting", "northing", "up", "sd"):
        npt.assert_array_equal(np.concatenate([part[name] for part in parts]), expected[name])


@pytest.fixture
def whole_roads(road, tmp_path):
    """Road without holes, in memory and on disk."""
    whole = road.assign(height=road.height.fillna(0.0))
    whole.height.attrs = road.height.attrs
    formats.write(whole, tmp_path / "whole.zarr")
    return whole, open_surface(tmp_path / "whole.zarr")


@pytest.mark.parametrize("radius", [0.03, 0.3])
def test_tyre_profiles(road, stored, path, radius):
    area = Disc(radius=radius)
    found, expected = (
        tyre_profile(ground, path, area=area, thin="nan") for ground in (stored, road)
    )
    for name in ("height", "sd", "count"):
        npt.assert_array_equal(found[name], expected[name])


@pytest.mark.parametrize(
    "profile", [point_profile, partial(tyre_envelope, tyre=RigidDisc(radius=0.3), thin="nan")]
)
def test_profiles_of_lines_and_tyres(whole_roads, path, profile):
    expected, found = (profile(ground, path).height for ground in whole_roads)
    npt.assert_array_equal(found, expected)


def test_crg_files(road, stored, tmp_path):
    write_crg(trim_surface(road), tmp_path / "memory.crg")
    write_crg(trim_surface(stored), tmp_path / "disk.crg")
    assert (tmp_path / "disk.crg").read_bytes() == (tmp_path / "memory.crg").read_bytes()


def test_a_store_written_in_any_order_holds_the_surface(road, tmp_path):
    store = SurfaceStore(tmp_path / "parts.zarr", road)
    for start in (200, 0, 60, 100):
        rows = slice(start, min(start + 140, ROWS) if start < 200 else ROWS)
        store.write(rows, {name: road[name].values[rows] for name in ("height", "count", "sd")})
    xr.testing.assert_identical(store.open().load(), road)
