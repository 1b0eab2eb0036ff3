"""Knots of a trajectory from navigation alone follow it at any rate."""

import numpy as np
import pytest
import xarray as xr

from trueterrain.formats.navigation import make_navigation
from trueterrain.motion import FusionSettings, fuse_motion, trajectory

pytestmark = pytest.mark.slow

HEAVE = 0.02  # [m] amplitude of the body at 3 Hz
FOLLOWED = 1e-5  # [m] tolerance of the knots: the step of heights in a grid
EDGE = 0.02  # [s] at both ends, where splines through few epochs are less accurate


def fused(rate, step, *, duration=0.3, frequency=3.0, amplitude=HEAVE):
    """Motion by navigation whose heights are rounded, and its largest error between knots."""
    t = np.arange(round(duration * rate)) / rate
    z = np.zeros(t.size)

    def up(time):
        return amplitude * np.sin(2 * np.pi * frequency * time)

    height = np.round(up(t) / step) * step if step else up(t)
    navigation = make_navigation(
        {"time": t, "east": 5 * t, "north": z, "up": height, "roll": z, "pitch": z, "yaw": z}
    )
    run = xr.DataTree.from_dict({"navigation": navigation})
    motion = fuse_motion(run, settings=FusionSettings(method="navigation"))
    at = np.random.default_rng(1).uniform(EDGE, t[-1] - EDGE, 5000)
    return motion, np.abs(motion.trajectory.at(at).position[:, 2] - up(at)).max()


@pytest.mark.parametrize("step", [1e-6, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("rate", [100, 1000, 1013, 3000, 10_000, 71_000])
def test_knots_follow_fast_rounded_navigation_to_its_resolution(rate, step):
    """Cubics over 1 ms through rates of 14 µs would amplify a step 20 times."""
    _, error = fused(rate, step)
    # half a step by rounding, as much by the spline, and 100 Hz epochs of a 3 Hz wave
    assert error < step + FOLLOWED


@pytest.mark.parametrize("frequency", [30.0, 100.0, 300.0, 500.0])
def test_knots_are_refined_for_fast_motion(frequency):
    motion, error = fused(20_000, 0.0, frequency=frequency, amplitude=1e-3)
    assert error < FOLLOWED
    assert motion.problems == ()


def test_slow_navigation_keeps_the_requested_knots():
    motion, _ = fused(200, 1e-4, duration=2.0)
    np.testing.assert_allclose(np.diff(motion.trajectory.time), 0.001, rtol=1e-3)


def test_too_many_knots_give_a_warning(monkeypatch):
    monkeypatch.setattr(trajectory, "_MAX_KNOTS", 1000)
    motion, error = fused(71_000, 1e-4)
    assert error > 5e-4  # [m] which the warning reports
    (problem,) = motion.problems
    assert problem.startswith("navigation: its 71000 epochs per second are followed to ")
