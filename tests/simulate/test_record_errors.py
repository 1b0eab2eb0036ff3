"""Errors in a recorded run have the sizes asked for; bounds are four standard errors."""

from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest
from scipy.signal import welch

from trueterrain.formats.run import open_run
from trueterrain.simulate.accelerometers import Accelerometers
from trueterrain.simulate.navigation import Navigation, NavigationStream
from trueterrain.simulate.pose import PoseKnots
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import Scene, ScenePass, Standing, TruthSettings

pytestmark = pytest.mark.slow

DURATION = 10.0  # [s]
BEAMS, RATE = 100, 500.0
SCANNER = Scanner(beams=BEAMS, rate=RATE, dropouts=0.01, spot_rays=1, floor=0.0)
ACCELEROMETERS = Accelerometers(noise_density=0.002, filter_order=4)


@pytest.fixture(scope="module")
def runs(recorded_scene):
    """Two passes of a vehicle that stands on a plane."""
    standing = Standing(duration=DURATION)
    scene = Scene(
        name="still",
        ground=({"kind": "plane"},),
        passes=tuple(ScenePass(name=name, standing=standing) for name in ("first", "second")),
        scanner=SCANNER,
        accelerometers=replace(ACCELEROMETERS),
        truth=TruthSettings(spacing=0.1),
        seed=12,
    )
    return [open_run(path) for path in recorded_scene(scene)]


def test_ranges_have_the_noise_asked_for(runs):
    errors = []
    for run in runs:
        error = run["truth/returns/range_error"].values
        lost = np.isnan(error)
        npt.assert_array_equal(lost, np.isnan(run["scans/range"].values))
        n = error.size  # 500,000 returns
        npt.assert_allclose(lost.mean(), 0.01, rtol=0, atol=4 * np.sqrt(0.01 * 0.99 / n))
        sd = np.hypot(SCANNER.range_noise, SCANNER.quantum / np.sqrt(12))
        npt.assert_allclose(np.nanstd(error) / sd, 1.0, rtol=0, atol=4 / np.sqrt(2 * n))
        npt.assert_allclose(np.nanmean(error), 0.0, rtol=0, atol=4 * sd / np.sqrt(n))
        ranges = run["scans/range"].values  # of a vehicle that stands: what varies is the noise
        npt.assert_allclose(
            np.nanstd(ranges, axis=0) / sd, 1.0, rtol=0, atol=6 / np.sqrt(2 * len(ranges))
        )
        errors.append(np.where(lost, 0.0, error))
    for one, two in (
        (errors[0], errors[1]),  # from pass to pass
        (errors[0][1:], errors[0][:-1]),  # from scan to scan
        (errors[0][:, 1:], errors[0][:, :-1]),  # from beam to beam
    ):
        together = np.corrcoef(one.ravel(), two.ravel())[0, 1]
        npt.assert_allclose(together, 0.0, rtol=0, atol=4 / np.sqrt(one.size))


def test_accelerometers_have_the_noise_density_asked_for(runs):
    for run in runs:
        group, truth = run["accelerometers"], run["truth/accelerometers"]
        exact = (1.0 + truth["scale_error"].values) * truth["specific_force"].values
        noise = group["acceleration"].values - exact - truth["bias"].values
        frequency, density = welch(noise, 2000.0, nperseg=2000, axis=0)
        band = (frequency >= 10) & (frequency <= 200)  # where the filter passes all, within 0.1 %
        # as many squares are averaged as 3 sensors x 20,000 samples x the fraction of the band
        bound = 4 * np.sqrt(2 / (3 * len(noise) * 0.19))
        found = density[band].mean() / ACCELEROMETERS.noise_density**2
        npt.assert_allclose(found, 1.0, rtol=0, atol=bound)


def test_two_passes_drift_apart_by_the_moments_asked_for():
    """Over 400 seeds: median, spread and correlation time of the measured difference."""
    seeds, time = 400, 51.0
    knots = np.zeros((2, 6))
    still = PoseKnots(time=np.array([0.0, time]), pose=knots, rate=knots, acceleration=knots)
    parameters = Navigation(rate=1.0, noise=(0.0,) * 6)
    up = np.array(
        [
            [
                NavigationStream(parameters, seed=seed, pass_number=number)
                .record(still, 0.0, time)
                .recorded["up"]
                for number in (0, 1)
            ]
            for seed in range(seeds)
        ]
    )
    difference = up[:, 1] - up[:, 0]
    sd, mean, within = 0.025, -0.042, 25  # [m], [m], [s]
    for second in (0, 25, 50):
        now = difference[:, second]
        npt.assert_allclose(now.mean(), mean, rtol=0, atol=4 * sd / np.sqrt(seeds))
        npt.assert_allclose(now.std(), sd, rtol=0, atol=4 * sd / np.sqrt(2 * seeds))
    for lag in (within, 2 * within):
        truth = np.exp(-lag / within)
        found = np.corrcoef(difference[:, 0], difference[:, lag])[0, 1]
        npt.assert_allclose(found, truth, rtol=0, atol=4 * (1 - truth**2) / np.sqrt(seeds))
    # what changes within a swath of some seconds: sqrt(2 (1 - exp(-1 / 25))) of the spread
    change = np.diff(difference, axis=1)
    npt.assert_allclose(
        change.std(),
        sd * np.sqrt(2 * (1 - np.exp(-1 / within))),
        rtol=0,
        atol=4 * 0.28 * sd / np.sqrt(2 * change.size),
    )


def test_recorded_navigation_of_two_passes_is_wrong_by_different_errors(runs):
    errors = [run["truth/navigation"].to_dataset().load() for run in runs]
    for name in ("east", "north", "up", "roll", "pitch", "yaw"):
        first, second = (error[f"error_{name}"].values for error in errors)
        assert not np.array_equal(first, second)
    drift = errors[1]["drift_up"].mean() - errors[0]["drift_up"].mean()
    assert abs(float(drift) + 0.042) < 4 * 0.025  # [m] one draw of the difference
