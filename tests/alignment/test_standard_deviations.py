"""Standard deviations of corrections against errors over many simulated drives."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from trueterrain.alignment import NetworkSettings, adjust_passes, make_pass_cells
from trueterrain.alignment.merge import MergeSettings, merge_cells
from trueterrain.simulate.drift import GaussMarkovDrift, start_drift

pytestmark = pytest.mark.slow

SPEED = 5.0  # [m/s]
CELL = 0.1  # [m]
NOISE = 0.0007  # [m] of the mean of a cell: texture sampled differently by each pass
REPORTED_SD = 0.0275  # [m] reported by navigation: drift and constant part
DRIFT_SD = 0.025 / np.sqrt(2)  # [m] standard deviation of the drift of one pass
SEEDS = 40  # so that the ratio is known to some 10 %, of a few degrees of freedom each


def simulate_cells(
    seed, duration, *, drift=GaussMarkovDrift(), reported_sd=REPORTED_SD, cell=CELL, passes=2
):
    """Cells of passes with the drift of the simulated navigation, times, and the drift."""
    rng = np.random.default_rng(seed)
    x, y = (
        at.ravel()
        for at in np.meshgrid(
            np.arange(cell / 2, SPEED * duration, cell), np.arange(-0.25, 0.25, cell)
        )
    )
    number = (np.floor(x / cell).astype(np.int64) << 32) + np.floor(y / cell).astype(np.int64)
    ground = 0.01 * np.sin(x) + rng.normal(0, 0.003, x.size)
    time = np.arange(0, duration + 0.005, 0.005)
    pass_cells, drifts = [], {}
    for k, name in enumerate(("left", "right", "middle", "edge")[:passes]):
        found = start_drift(drift, seed=seed, pass_number=k, rate=200.0).next(time)
        drifts[name] = found
        height = ground + np.interp(x / SPEED, time, found) + rng.normal(0, NOISE, x.size)
        pass_cells.append(
            make_pass_cells(
                name,
                number,
                x / SPEED,
                height,
                variance=1e-7,
                easting=x,
                northing=y,
                sd_time=time,
                sd_height=np.full(time.size, reported_sd),
            )
        )
    return pass_cells, time, drifts


@pytest.mark.parametrize("duration", [8.0, 20.0])
def test_sd_includes_drift_common_to_all_passes(duration):
    ratios = []
    for seed in range(SEEDS):
        pass_cells, time, drifts = simulate_cells(seed, duration)
        found = adjust_passes(pass_cells, settings=NetworkSettings(components=("height",)))
        error = np.concatenate([found.correction(name)(time) + drifts[name] for name in drifts])
        sd = np.concatenate([found.correction(name).sd(time) for name in drifts])
        ratios.append(np.mean(((error - error.mean()) / sd) ** 2))
    assert 0.85 < np.sqrt(np.mean(ratios)) < 1.15


FEW = NetworkSettings(components=("height",), knot_spacing=1.0, orders=("first",))  # trials
#: Drives, each with one error common to its passes, nearly constant over 8 s of a
#: correlation of 25 s: the ratio is known to 1 / sqrt(2 x 200) = 5 %, 0.1 is twice that.
DRIVES = 200


def absolute_ratio(drives, settings=FEW, *, passes=2, **more):
    """Root mean square of absolute errors of heights over their standard deviations."""
    drift = GaussMarkovDrift(between_passes=0.0)  # passes are independent
    squares = []
    for seed in range(drives):
        pass_cells, time, drifts = simulate_cells(
            seed, 8.0, drift=drift, reported_sd=DRIFT_SD, cell=0.2, passes=passes
        )
        found = adjust_passes(pass_cells, settings=settings, **more)
        for name, own in drifts.items():
            datum = found.datum_sd[name]
            if name not in found.names:
                error, sd = own, datum
            else:
                error = own + found.correction(name)(time)
                sd = np.hypot(found.correction(name).sd(time), datum)
            squares.append(np.mean((error / sd) ** 2))
    return np.sqrt(np.mean(squares))


def test_absolute_sd_includes_the_error_common_to_all_passes():
    assert 0.9 < absolute_ratio(DRIVES) < 1.1


@pytest.mark.parametrize(("passes", "more"), [(4, {}), (2, {"fixed": ("left",)})])
def test_absolute_sd_of_many_passes_and_of_a_fixed_one(passes, more):
    # 100 drives: the ratio is known to 7 %, so 0.2 are three standard deviations
    assert 0.8 < absolute_ratio(100, passes=passes, **more) < 1.2


def datum_of(settings=FEW, *, duration=8.0, passes=2, reported_sd=REPORTED_SD, **more):
    """Standard deviation of the datum of passes without drift, and their adjustment."""
    still = GaussMarkovDrift(height_sd=0.0, between_passes=0.0)
    pass_cells, time, _ = simulate_cells(
        3, duration, drift=still, cell=0.25, passes=passes, reported_sd=reported_sd
    )
    found = adjust_passes(pass_cells, settings=settings, **more)
    assert len(set(found.datum_sd.values())) == 1
    return found.datum_sd["left"], found, time


def test_datum_sd_is_that_of_the_mean_of_independent_passes():
    """A pass of 8 s shows 3 % of the variance of a drift of 25 s."""
    for passes in (2, 4):
        assert_allclose(datum_of(passes=passes)[0], REPORTED_SD / np.sqrt(passes), rtol=0.03)
    same = replace(FEW, pass_correlation=1.0)
    assert_allclose(datum_of(same, passes=4)[0], REPORTED_SD, rtol=0.03)
    half = replace(FEW, pass_correlation=0.5)
    assert_allclose(datum_of(half)[0], REPORTED_SD * np.sqrt(0.75), rtol=0.03)


def test_total_variance_is_the_reported_one():
    """For any length of a pass: drift within the pass is part of the corrections."""
    for duration in (8.0, 120.0):
        datum, found, time = datum_of(duration=duration, passes=2)
        own = found.correction("left").sd(time)
        whole = np.sqrt(np.mean(own**2) + datum**2)
        assert_allclose(whole, REPORTED_SD / np.sqrt(2), rtol=0.1)


def test_fixed_passes_control_and_settings_define_the_datum():
    assert datum_of(fixed=("left",))[0] == pytest.approx(REPORTED_SD)
    assert datum_of(passes=4, fixed=("left", "edge"))[0] == pytest.approx(REPORTED_SD)  # not halved
    pass_cells, _, _ = simulate_cells(3, 8.0, cell=0.25)
    point = pass_cells[0].part(np.arange(0, len(pass_cells[0]), 20))
    control = make_pass_cells(
        "bench marks",
        point.cell,
        0.0,
        point.height,
        variance=1e-6,
        easting=point.easting,
        northing=point.northing,
    )
    assert datum_of(control=[control])[0] == 0.0  # it is in the corrections
    assert datum_of(control=[control], fixed=("left",))[0] == pytest.approx(REPORTED_SD)
    for more in ({}, {"fixed": ("left",)}, {"control": [control]}):
        assert datum_of(replace(FEW, datum_sd=0.005), **more)[0] == 0.005


def test_datum_sd_is_unknown_without_reported_sd():
    pass_cells, _, _ = simulate_cells(3, 8.0, cell=0.25)
    silent = replace(pass_cells[1], sd_time=None, sd_height=None)
    found = adjust_passes([pass_cells[0], silent], settings=FEW)
    assert found.datum_sd == {"left": None, "right": None}
    assert found.correction("left").datum_sd is None
    assert (
        adjust_passes([pass_cells[0], silent], settings=FEW, fixed=("left",)).datum_sd["right"] > 0
    )
    found = adjust_passes([pass_cells[0], silent], settings=FEW, fixed=("right",))
    assert found.datum_sd == {"left": None, "right": None}


def test_separate_groups_have_separate_datums():
    near, far = simulate_cells(3, 8.0, cell=0.25)[0], simulate_cells(4, 8.0, cell=0.25)[0]
    away = [
        replace(
            one,
            name=f"{one.name} away",
            cell=one.cell + (1 << 50),
            easting=one.easting + 1e4,
            sd_height=3.0 * one.sd_height,
        )
        for one in far
    ]
    found = adjust_passes([*near, *away], settings=FEW)
    assert found.datum_sd["left"] == found.datum_sd["right"] < 0.5 * found.datum_sd["left away"]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"pass_correlation": 1.1}, "pass_correlation must be from 0 to 1, got 1.1"),
        ({"datum_sd": -0.001}, "datum_sd must be at least 0 m, got -0.001"),
    ],
)
def test_wrong_datum_settings_are_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        NetworkSettings(**wrong)


def test_reported_sd_dominates_when_little_drift_is_observable():
    """Drift common to both passes is unobservable, and not taken to be 0."""
    pass_cells, time, _ = simulate_cells(1, 8.0)
    same = pass_cells[0].height + np.random.default_rng(9).normal(0, NOISE, len(pass_cells[0]))
    common_drift = make_pass_cells(
        "right",
        pass_cells[0].cell,
        pass_cells[0].time,
        same,
        variance=1e-7,
        easting=pass_cells[0].easting,
        northing=pass_cells[0].northing,
        sd_time=time,
        sd_height=np.full(time.size, REPORTED_SD),
    )
    settings = NetworkSettings(components=("height",))
    sure = (
        adjust_passes([pass_cells[0], common_drift], settings=settings).correction("left").sd(time)
    )
    unclaimed = [
        make_pass_cells(
            one.name,
            one.cell,
            one.time,
            one.height,
            variance=1e-7,
            easting=one.easting,
            northing=one.northing,
        )
        for one in (pass_cells[0], common_drift)
    ]
    blind = adjust_passes(unclaimed, settings=settings).correction("left").sd(time)
    assert sure.mean() > 0.001
    assert blind.mean() < 0.5 * sure.mean()


def test_grid_method_reports_remaining_steps():
    """Passes that agree except at one place."""
    pass_cells, _, _ = simulate_cells(2, 8.0)
    ground = pass_cells[0].height
    there = np.abs(pass_cells[0].easting - 20.05) < 0.2
    again = [
        make_pass_cells(
            one.name,
            one.cell,
            one.time,
            ground + up * there,
            variance=1e-7,
            easting=one.easting,
            northing=one.northing,
        )
        for one, up in zip(pass_cells, (0.0, 0.01), strict=True)
    ]
    again[1] = replace(again[1], height=again[1].height + 1e-6)  # else they were the same twice
    grid = MergeSettings(method="grid")
    (problem,) = merge_cells(again, grid).problems
    assert "by 10.0 mm at easting 2" in problem
    assert "steps remain" in problem
    assert merge_cells(again, replace(grid, limit=0.02)).problems == ()
