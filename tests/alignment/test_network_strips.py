"""Real airborne strips over the same ground: residuals in held-out cells."""

import laspy
import numpy as np
import pytest

from trueterrain.alignment import CellSettings, NetworkSettings, adjust_passes, cells_of_points
from trueterrain.core.schemas import make_points

pytestmark = pytest.mark.slow

SQUARE = 5.0  # [m] of ground held out together
FOLDS = 5
CELLS = CellSettings(size=1.0, min_count=3, max_sd=0.06, visit_gap=60.0)
PAIRS = {
    "dsmMarker": ["las_with_origin_dsmMarker.laz"],
    "706-707": [
        f"test_data_770{east}_6277{north}_LA93_IGN69.laz"
        for east in (50, 55, 60)
        for north in (55, 60)
    ],
    "4320-4330": ["St_Barth_RGAF09_UTM20N_IGN_1988_SB_subset_100m.laz"],
}


@pytest.fixture
def strips(data, request):
    """Common cells of the ground points of both strips."""
    parts = [laspy.read(data / "scanning" / "strips" / name) for name in PAIRS[request.param]]
    column = {
        name: np.concatenate([np.asarray(part[name], dtype=np.float64) for part in parts])
        for name in ("x", "y", "z", "gps_time", "point_source_id", "classification")
    }
    strip = column["point_source_id"].astype(np.uint16)
    ground = column["classification"] == 2
    numbers, counts = np.unique(strip[ground], return_counts=True)
    kept = ground & np.isin(strip, numbers[np.argsort(counts)[-2:]])
    points = make_points(
        *(column[name][kept] for name in "xyz"), time=column["gps_time"][kept], lane=strip[kept]
    )
    one, other = cells_of_points(points, CELLS)
    _, first, second = np.intersect1d(one.cell, other.cell, return_indices=True)
    return one.part(first), other.part(second)


def in_turn(pair):
    """Folds of the cells."""
    x, y = (np.floor(one / SQUARE).astype(np.int64) for one in (pair[0].easting, pair[0].northing))
    return (x * 7 + y * 3) % FOLDS


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def left_by_network(pair):
    turn, left = in_turn(pair), pair[1].height - pair[0].height
    for fold in range(FOLDS):
        out = turn == fold
        found = adjust_passes([one.part(~out) for one in pair], settings=NetworkSettings())
        for sign, one in zip((-1.0, 1.0), pair, strict=True):
            left[out] += sign * found.correction(one.name).height_at(one.time, one.offset)[out]
    return rms(left)


def left_by_columns(pair, *columns):
    """Least squares of differences by a constant and some columns."""
    turn, raw = in_turn(pair), pair[1].height - pair[0].height
    design = np.stack([np.ones(raw.size), *(one - one.mean() for one in columns)], axis=1)
    left = np.empty(raw.size)
    for fold in range(FOLDS):
        out = turn == fold
        left[out] = (raw - design @ np.linalg.lstsq(design[~out], raw[~out], rcond=None)[0])[out]
    return rms(left)


@pytest.mark.parametrize("strips", ["dsmMarker", "706-707"], indirect=True)
def test_strips_that_drift_agree_at_least_as_well_as_by_any_simple_correction(strips):
    """In held-out cells: constant, linear in the time of either, constant and tilt."""
    one, other = strips
    simple = [
        left_by_columns(strips),
        left_by_columns(strips, one.time),
        left_by_columns(strips, other.time),
        left_by_columns(strips, one.easting),
        left_by_columns(strips, one.northing),
    ]
    assert left_by_network(strips) <= min(simple)


@pytest.mark.parametrize("strips", ["706-707", "4320-4330"], indirect=True)
def test_strips_that_agree_do_not_get_worse(strips):
    one, other = strips
    assert left_by_network(strips) < rms(other.height - one.height)


@pytest.mark.parametrize("strips", ["dsmMarker"], indirect=True)
def test_the_drift_between_two_strips_is_as_published(strips):
    """Published: median -46 mm and root mean square 50.9 mm; a tilt leaves 16.4 mm."""
    found = adjust_passes(strips)
    (pair,) = found.pairs
    assert abs(pair.before.median - -0.046) < 0.001  # [m] cells that differ a little
    assert abs(pair.before.rmse - 0.051) < 0.001  # [m]
    assert pair.held_out.rmse < 0.0164
    assert pair.held_out.rmse < 1.02 * pair.after.rmse  # the corrections are not too loose
    assert max(test.p_value for test in found.tests) < 1e-9
