"""Knots of a trajectory from navigation alone: how well they follow it, whatever its rate."""

import numpy as np
import pytest
import xarray as xr

from trueterrain.formats.navigation import make_navigation
from trueterrain.motion import FusionSettings, _fuse, fuse_motion

HEAVE = 0.02  # [m] amplitude of the body at 3 Hz
FOLLOWED = 1e-5  # [m] to which knots follow navigation: the step of heights in a grid
EDGE = 0.02  # [s] at both ends, where splines of few epochs are less sure


def fused(rate, step, *, duration=0.3, frequency=3.0, amplitude=HEAVE):
    """Motion by navigation whose heights have steps, and its largest error between all knots."""
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
def test_fast_navigation_in_steps_is_followed_to_its_steps(rate, step):
    """Cubics over 1 ms through rates of 14 µs made 20 steps out of one."""
    _, error = fused(rate, step)
    # half a step by rounding, as much again by the spline through it, and 100 Hz of a 3 Hz wave
    assert error < step + FOLLOWED


@pytest.mark.parametrize("frequency", [30.0, 100.0, 300.0, 500.0])
def test_fast_motion_has_knots_as_close_as_it_needs(frequency):
    motion, error = fused(20_000, 0.0, frequency=frequency, amplitude=1e-3)
    assert error < FOLLOWED
    assert motion.problems == ()


def test_slow_navigation_keeps_the_knots_asked_for():
    motion, _ = fused(200, 1e-4, duration=2.0)
    np.testing.assert_allclose(np.diff(motion.trajectory.time), 0.001, rtol=1e-3)


def test_where_knots_would_be_too_many_it_is_said(monkeypatch):
    monkeypatch.setattr(_fuse, "_MOST_KNOTS", 1000)
    motion, error = fused(71_000, 1e-4)
    assert error > 5e-4  # [m] what the words are about
    (problem,) = motion.problems
    assert problem.startswith("navigation: its 71000 epochs per second are followed to ")
