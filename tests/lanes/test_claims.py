"""Standard deviations of corrections, of what passes have in common too, over many drives."""

from dataclasses import replace

import numpy as np
import pytest

from trueterrain.lanes import NetworkSettings, adjust, lane_cells
from trueterrain.lanes.merge import MergeSettings, merge_cells
from trueterrain.simulate.drift import GaussMarkovDrift, start_drift

SPEED = 5.0  # [m/s]
CELL = 0.1  # [m]
NOISE = 0.0007  # [m] of the mean of a cell, of texture that two passes see differently
CLAIM = 0.0275  # [m] that the navigation claims: its wander and its constant part
SEEDS = 40  # so that the ratio is known to some 10 %, of a few degrees of freedom each


def two_lanes(seed, duration):
    """Cells of two passes with the drift of the virtual navigation, and that drift."""
    rng = np.random.default_rng(seed)
    x, y = (
        at.ravel()
        for at in np.meshgrid(
            np.arange(CELL / 2, SPEED * duration, CELL), np.arange(-0.25, 0.25, CELL)
        )
    )
    number = (np.floor(x / CELL).astype(np.int64) << 32) + np.floor(y / CELL).astype(np.int64)
    ground = 0.01 * np.sin(x) + rng.normal(0, 0.003, x.size)
    time = np.arange(0, duration + 0.005, 0.005)
    lanes, drifts = [], {}
    for k, name in enumerate(("left", "right")):
        drift = start_drift(GaussMarkovDrift(), seed=seed, pass_number=k, rate=200.0).next(time)
        drifts[name] = drift
        height = ground + np.interp(x / SPEED, time, drift) + rng.normal(0, NOISE, x.size)
        lanes.append(
            lane_cells(
                name, number, x / SPEED, height, variance=1e-7, easting=x, northing=y,
                sd_time=time, sd_height=np.full(time.size, CLAIM),
            )
        )  # fmt: skip
    return lanes, time, drifts


@pytest.mark.parametrize("duration", [8.0, 20.0])
def test_standard_deviations_hold_what_passes_have_in_common(duration):
    ratios = []
    for seed in range(SEEDS):
        lanes, time, drifts = two_lanes(seed, duration)
        found = adjust(lanes, settings=NetworkSettings(components=("height",)))
        error = np.concatenate([found.correction(name)(time) + drifts[name] for name in drifts])
        sd = np.concatenate([found.correction(name).sd(time) for name in drifts])
        ratios.append(np.mean(((error - error.mean()) / sd) ** 2))
    assert 0.85 < np.sqrt(np.mean(ratios)) < 1.15


def test_the_claim_of_the_navigation_counts_where_little_was_seen():
    """Drift alike in both passes shows nothing between them, and is not taken for none."""
    lanes, time, _ = two_lanes(1, 8.0)
    same = lanes[0].height + np.random.default_rng(9).normal(0, NOISE, len(lanes[0]))
    alike = lane_cells(
        "right", lanes[0].cell, lanes[0].time, same, variance=1e-7, easting=lanes[0].easting,
        northing=lanes[0].northing, sd_time=time, sd_height=np.full(time.size, CLAIM),
    )  # fmt: skip
    settings = NetworkSettings(components=("height",))
    sure = adjust([lanes[0], alike], settings=settings).correction("left").sd(time)
    unclaimed = [
        lane_cells(
            one.name, one.cell, one.time, one.height, variance=1e-7, easting=one.easting,
            northing=one.northing,
        )
        for one in (lanes[0], alike)
    ]  # fmt: skip
    blind = adjust(unclaimed, settings=settings).correction("left").sd(time)
    assert sure.mean() > 0.001
    assert blind.mean() < 0.5 * sure.mean()


def test_the_grid_method_tells_where_steps_remain():
    """Passes that agree but for one place."""
    lanes, _, _ = two_lanes(2, 8.0)
    ground = lanes[0].height
    there = np.abs(lanes[0].easting - 20.05) < 0.2
    again = [
        lane_cells(
            one.name, one.cell, one.time, ground + up * there, variance=1e-7, easting=one.easting,
            northing=one.northing,
        )
        for one, up in zip(lanes, (0.0, 0.01), strict=True)
    ]  # fmt: skip
    again[1] = replace(again[1], height=again[1].height + 1e-6)  # else they were the same twice
    grid = MergeSettings(method="grid")
    (problem,) = merge_cells(again, grid).problems
    assert "by 10.0 mm at easting 2" in problem
    assert "steps remain" in problem
    assert merge_cells(again, replace(grid, limit=0.02)).problems == ()
