"""Holes: which there are, and what fills them; and coarser surfaces."""

import numpy as np
import numpy.testing as npt
import pytest
from scipy.ndimage import find_objects, label

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import make_surface
from trueterrain.surface.coarse import down_sample
from trueterrain.surface.holes import HoleSettings, fill_holes

EXACT = 1e-12  # [m] round-off of heights of a metre


def plane(rows=30, columns=20, step=0.1):
    x, y = np.arange(columns) * step, np.arange(rows) * step
    height = 1 + 0.1 * x - 0.2 * y[:, None]
    return make_surface(
        height,
        easting=x,
        northing=y,
        count=np.ones_like(height, int),
        sd=np.full_like(height, 0.01),
        sd_relative=np.full_like(height, 0.002),
    )


def with_holes(surface, *cuts):
    height = surface.height.values.copy()
    for cut in cuts:
        height[cut] = np.nan
    return surface.assign(height=surface.height.copy(data=height))


def test_holes_in_a_plane_are_filled_exactly_and_large_ones_reported():
    whole = plane()
    small, large, edge = np.s_[5:8, 5:7], np.s_[15:25, 5:15], np.s_[0:3, 10]
    filled, report = fill_holes(with_holes(whole, small, large, edge), HoleSettings(largest=0.3))
    npt.assert_allclose(filled.height.values[small], whole.height.values[small], atol=EXACT)
    assert np.isnan(filled.height.values[large]).all()
    assert np.isnan(filled.height.values[edge]).all()
    assert (report["filled_nodes"], report["filled_holes"]) == (6, 1)
    assert (report["open_nodes"], report["open_holes"], report["unseen_nodes"]) == (100, 1, 3)
    (hole,) = report["largest"]
    npt.assert_allclose([hole["northing"], hole["easting"]], [1.95, 0.95], atol=EXACT)
    npt.assert_allclose(hole["extent"], [1.0, 1.0], atol=EXACT)
    assert filled["filled"].values.sum() == 6
    for name in ("sd", "sd_relative"):
        assert np.isnan(filled[name].values[small]).all()
        assert filled[name].values[0, 0] == whole[name].values[0, 0]


def test_heights_of_a_hole_stay_between_those_around_it():
    rng = np.random.default_rng(1)
    rough = plane()
    rough["height"] = rough.height.copy(data=rng.normal(size=rough.height.shape))
    cut = np.s_[5:9, 5:12]
    filled, _ = fill_holes(with_holes(rough, cut), HoleSettings(largest=1.0))
    around = rough.height.values[4:10, 4:13]
    inside = filled.height.values[cut]
    assert around.min() < inside.min()
    assert inside.max() < around.max()


def test_nothing_is_filled_with_a_limit_of_zero():
    holed = with_holes(plane(), np.s_[5, 5])
    same, report = fill_holes(holed, HoleSettings(largest=0.0))
    npt.assert_array_equal(same.height, holed.height)
    assert (report["filled_nodes"], report["open_nodes"]) == (0, 1)
    assert not same["filled"].values.any()


def test_what_was_filled_before_stays_marked():
    once, _ = fill_holes(with_holes(plane(), np.s_[5, 5]))
    twice, report = fill_holes(with_holes(once, np.s_[8, 8]))
    assert report["filled_nodes"] == 1
    assert twice["filled"].values.sum() == 2


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_holes_are_those_that_scipy_labels(seed, turned):
    """Interior ones are filled or open, the others unseen; for heights turned in memory too."""
    rng = np.random.default_rng(seed)
    whole = rng.normal(size=(40, 31))
    whole[rng.random(whole.shape) < 0.1 * (seed + 1)] = np.nan
    height = np.asfortranarray(whole) if turned else whole
    surface = make_surface(height, easting=np.arange(31), northing=np.arange(40))
    filled, report = fill_holes(surface, HoleSettings(largest=3.0))
    names, count = label(np.isnan(whole))
    expected = dict.fromkeys(("filled", "open", "unseen"), 0)
    for number, (rows, columns) in enumerate(find_objects(names), start=1):
        edge = rows.start == 0 or rows.stop == 40 or columns.start == 0 or columns.stop == 31
        small = max(rows.stop - rows.start, columns.stop - columns.start) <= 3
        where = names == number
        expected["unseen" if edge else "filled" if small else "open"] += where.sum()
        assert np.isfinite(filled.height.values[where]).all() == (small and not edge)
    assert {name: report[f"{name}_nodes"] for name in expected} == expected
    assert count > 10


@pytest.mark.parametrize("nodes", [1, 37, 700])
def test_holes_have_the_same_heights_in_blocks_of_any_size(monkeypatch, nodes):
    rng = np.random.default_rng(5)
    rough = with_holes(plane(), rng.random(plane().height.shape) < 0.3)
    rough.height.values[6:14, 5] = np.nan  # a hole over many blocks
    together, report = fill_holes(rough, HoleSettings(largest=0.5))
    monkeypatch.setattr("trueterrain.core.row_blocks._NODES", nodes)
    apart, same = fill_holes(rough, HoleSettings(largest=0.5))
    assert apart.identical(together)
    assert same == report
    assert report["filled_holes"] > 10
    assert report["open_holes"] > 0


def test_large_holes_solved_as_sparse_systems_have_the_same_heights(monkeypatch):
    rng = np.random.default_rng(5)
    rough = with_holes(plane(), rng.random(plane().height.shape) < 0.2)
    banded, _ = fill_holes(rough, HoleSettings(largest=0.5))
    monkeypatch.setattr("trueterrain.surface.holes._MAX_BANDED", 0)
    sparse, _ = fill_holes(rough, HoleSettings(largest=0.5))
    npt.assert_allclose(sparse.height, banded.height, rtol=0, atol=EXACT)


def test_holes_are_filled_in_place_if_that_is_wanted():
    surface = with_holes(plane(), np.s_[5, 5])
    fill_holes(surface)
    assert np.isnan(surface.height.values[5, 5])
    filled, _ = fill_holes(surface, in_place=True)
    assert np.shares_memory(filled.height.values, surface.height.values)
    assert np.isfinite(surface.height.values[5, 5])


def test_surfaces_without_height_are_refused():
    with pytest.raises(SchemaError, match="missing everywhere"):
        fill_holes(with_holes(plane(), np.s_[:]))
    with pytest.raises(ValueError, match="largest must be at least 0"):
        HoleSettings(largest=-1.0)


@pytest.mark.parametrize("factor", [(1, 1), (2, 3), (5, 4)])
def test_a_plane_loses_nothing(factor):
    coarse, report = down_sample(plane(31, 25), factor)
    x, y = coarse.easting.values, coarse.northing.values
    npt.assert_allclose(coarse.height, 1 + 0.1 * x - 0.2 * y[:, None], rtol=0, atol=1e-12)
    npt.assert_allclose([report["rms"], report["largest"]], 0, rtol=0, atol=1e-12)
    npt.assert_allclose(coarse.sd, 0.01, rtol=1e-12)
    npt.assert_allclose(coarse.sd_relative, 0.002, rtol=1e-12)


def test_a_wave_shorter_than_the_new_spacing_is_lost_and_said_to_be():
    surface = plane(40, 400, step=0.01)
    wave = 0.002 * np.sin(2 * np.pi * surface.easting.values / 0.1)
    surface["height"] = surface.height.copy(data=np.tile(wave, (40, 1)))
    _, fine = down_sample(surface, (1, 2))
    _, coarse = down_sample(surface, (1, 10))
    assert fine["kept"] > 0.95
    assert coarse["kept"] < 0.05
    npt.assert_allclose(coarse["rms"], 0.002 / np.sqrt(2), rtol=0.05)


def test_counts_add_up():
    coarse, _ = down_sample(plane(9, 9), (2, 2))
    assert coarse["count"].values[2, 2] == 4
    assert coarse["count"].values[0, 0] == 1


def test_factors_without_sense_are_refused():
    with pytest.raises(ValueError, match="at least 1"):
        down_sample(plane(), (0, 1))
    with pytest.raises(ValueError, match="at least 2 nodes"):
        down_sample(plane(), (1, 20))
