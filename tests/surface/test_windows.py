"""Grids that are worked window by window: the same surface, bit for bit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting, RunWriter
from trueterrain.geometry.reference_line import line_through, straight_line
from trueterrain.georeference import Screening
from trueterrain.motion import Trajectory
from trueterrain.surface import _windows
from trueterrain.surface.accumulate import count_scan_visits
from trueterrain.surface.cells import grid_along, grid_over
from trueterrain.surface.grid import GridSettings
from trueterrain.surface.runs import PassRecord, grid_runs

RADIUS = 4.0  # [m] of the circle that is driven
SCANS = 3000
BEAMS = 50
SPACING = 0.02  # [m]
TILTED = Mounting(scanner_position=(0.2, 0.0, 0.0), scanner_rotation=(0.0, 0.3, 0.1))
SCREENING = Screening(floor=100.0, saturation=900.0)


def laps(rate: float = 2.4, back: float = 0.9) -> Trajectory:
    """Two laps and more on a circle, now and then slow, standing and backwards."""
    t = np.arange(-0.1, 5.9, 0.005)  # the last scans are not covered
    angle, speed = rate * t + back * np.sin(3 * t), rate + 3 * back * np.cos(3 * t)
    place = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.full(t.size, 2.0)], axis=1)
    velocity = RADIUS * speed * np.stack([-np.sin(angle), np.cos(angle), 0 * t])
    turning = np.zeros((t.size, 3))
    turning[:, 2] = speed
    spread = np.diag([4e-6, 4e-6, 1e-6, 1e-7, 1e-7, 1e-7])
    return Trajectory(
        time=t,
        position=place,
        velocity=velocity.T,
        quaternion=Rotation.from_euler("Z", (angle + np.pi / 2)[:, None]).as_quat(),
        angular_velocity=turning,
        covariance=(1 + 0.5 * np.sin(t))[:, None, None] * spread,
        flag=np.zeros(t.size, np.uint8),
    )


def recorded(path: Path, seed: int, *, furthest: float) -> Path:
    """Ranges to rough ground, with gaps, wild ones and flagged intensities."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(-0.7, 0.7, BEAMS)
    ranges = 2 / np.cos(angle) + rng.normal(0, 0.01, (SCANS, BEAMS))
    wild = rng.random(ranges.shape)
    ranges[wild < 0.01] = np.nan
    ranges[wild > 0.998] = rng.uniform(0.5, furthest, (wild > 0.998).sum())
    with RunWriter(
        path,
        name=path.stem,
        origin=(11.0, 48.0, 500.0),
        time_reference="run",
        mounting=TILTED,
        angle=angle,
        delay=np.linspace(0, 1.5e-3, BEAMS),
        max_range=furthest,
    ) as run:
        t = np.arange(-0.1, 6.2, 0.01)
        still = dict.fromkeys(("north", "up", "roll", "pitch", "yaw"), np.zeros(t.size))
        run.append_navigation({"time": t, "east": t, **still})
        time = np.arange(SCANS) * 2e-3
        run.append_scans(time, ranges, rng.integers(0, 1000, ranges.shape))
    return path


@pytest.fixture(scope="module")
def passes(tmp_path_factory):
    """Two passes over the same ground; the second one saves greater ranges."""
    folder = tmp_path_factory.mktemp("laps")
    second = laps(rate=-2.2)
    second = replace(second, covariance=3 * second.covariance)
    return [
        PassRecord(run=recorded(folder / "one.zarr", 1, furthest=6.5), trajectory=laps()),
        PassRecord(run=recorded(folder / "two.zarr", 2, furthest=20.0), trajectory=second),
    ]


def arc():
    """Grid along a third of the circle, so that every lap leaves it and comes back."""
    angle = np.linspace(0.2, 2.3, 30)
    line = line_through(
        RADIUS * np.cos(angle), RADIUS * np.sin(angle), spacing=SPACING, smoothing=0.3
    )
    return grid_along(line, right=-1.2, left=1.2, spacing=SPACING)


def over():
    """Map of the whole circle."""
    return grid_over(-5.0, -5.0, 5.0, 5.0, spacing=0.04)


CASES = {
    "mean": (arc, GridSettings(range_noise=1e-3)),
    "weighed": (arc, GridSettings(), Screening(floor=100.0, saturation=900.0, weight=0.5)),
    "minimum": (arc, GridSettings(statistic="minimum", min_count=2)),
    "median": (arc, GridSettings(statistic="median")),
    "percentile": (arc, GridSettings(statistic="percentile", percent=20.0)),
    "disc": (arc, GridSettings(radius=0.07, power=1.0)),
    "map": (over, GridSettings()),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_windows_of_any_size_give_the_same_surface(passes, planned, case):
    where, options, screening = (*CASES[case], SCREENING)[:3]
    grid = where()
    whole, counts = grid_runs(passes, grid, options, screening=screening, memory=1 << 40)
    assert counts["scans"] == 2 * SCANS
    assert min(counts[name] for name in ("used", "outside", "scans_uncovered")) > 100
    for memory, threads, block in ((1, 2, 999), (1_000_000, 1, 4000), (1_500_000, 2, 500)):
        surface, return_totals = grid_runs(
            passes, grid, options, screening=screening, memory=memory, threads=threads, block=block
        )
        for name in ("height", "sd", "count"):
            npt.assert_array_equal(surface[name], whole[name])
        assert return_totals == counts
    assert [len(plan.windows) > 1 for plan in planned] == [False, True, True, True]


@pytest.fixture
def planned(monkeypatch):
    """Plans that are made."""
    plans = []
    plan_windows = _windows.plan_windows

    def noted(*args, **options):
        plans.append(plan_windows(*args, **options))
        return plans[-1]

    monkeypatch.setattr("trueterrain.surface.runs.plan_windows", noted)
    return plans


@pytest.mark.slow
def test_windows_whose_scans_were_not_guessed_are_worked_again(passes, planned, monkeypatch):
    """Guessed for ranges of 0.1 m: the scanner looks ahead, so other rows are reached."""
    whole, counts = grid_runs(passes[1:], arc(), memory=1 << 40)
    monkeypatch.setattr("trueterrain.surface._recordings._REACH", 0.1)
    surface, return_totals = grid_runs(passes[1:], arc(), memory=1)
    assert len(planned[1].windows) >= 3
    assert planned[1].missed
    for name in ("height", "sd", "count"):
        npt.assert_array_equal(surface[name], whole[name])
    assert return_totals == counts


def test_a_long_grid_is_worked_in_windows_and_a_short_one_at_once(passes, planned):
    grid_runs(passes, arc())
    grid_runs(passes, arc(), memory=1_500_000)
    at_once, windows = planned
    assert at_once.windows == [range(arc().shape[0])]
    assert not at_once.reaches
    assert len(windows.windows) > 1
    memory = windows.rows * arc().shape[1] * (28 + 20)
    assert memory <= 1_500_000
    with pytest.raises(ValueError, match="memory at least"):
        grid_runs(passes, arc(), memory=0)


def test_a_grid_along_which_all_scans_reach_far_is_worked_in_few_windows(passes, planned):
    """More of them would only cost time."""
    line = straight_line((RADIUS, -0.3), (RADIUS + 0.9, -0.3), spacing=0.002)
    grid = grid_along(line, right=-0.4, left=0.4, spacing=0.01)
    grid_runs(passes, grid, memory=1)
    (plan,) = planned
    edges = np.array([0, *(window.stop for window in plan.windows)])
    assert count_scan_visits(plan.reaches, edges, plan.margin) <= 2 * 2 * SCANS
    assert len(plan.windows) < 0.6 * grid.shape[0] / (8 * plan.margin)
