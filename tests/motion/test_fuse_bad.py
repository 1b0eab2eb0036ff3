"""Damaged runs: gaps, jumps, values that are not finite, missing instruments."""

import numpy as np
import pytest
import xarray as xr

from trueterrain.core.errors import CoverageError, SchemaError
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.motion.trajectory import BRIDGED

from ._truth import Errors, rms
from .conftest import run_of

BRIDGED_ERROR = 0.005  # [m] over 0.7 s, in which navigation drifts by 4 mm
OVER_SD = 4.0  # standard deviations that no error may exceed


@pytest.fixture(scope="module")
def run(excited):
    scene, knots = excited
    return run_of(knots, scene, seed=3)


def changed(run, group, **variables):
    """The run with variables of a group replaced."""
    data = run[group].to_dataset()
    replaced = {name: (data[name].dims, values) for name, values in variables.items()}
    return with_group(run, group, data.assign(replaced))


def with_group(run, group, data):
    """The run with a group replaced, or left out if `data` is None."""
    groups = {node.path: node.to_dataset() for node in run.subtree if node.path != f"/{group}"}
    if data is not None:
        groups[f"/{group}"] = data
    return xr.DataTree.from_dict(groups)


def without(run, group, keep):
    """The run with some records of a group only."""
    data = run[group].to_dataset()
    dim = "epoch" if group == "navigation" else "sample"
    return with_group(run, group, data.isel({dim: np.flatnonzero(keep)}))


def times(run, group):
    return run[group]["time"].values


@pytest.mark.parametrize("method", ["navigation", "thesis", "zero-phase", "wiener", "rts"])
def test_a_gap_in_navigation_is_bridged_and_flagged(run, method):
    time = times(run, "navigation")
    gappy = without(run, "navigation", (time < 1.5) | (time > 2.2))
    motion = fuse_motion(gappy, settings=FusionSettings(method=method))
    errors = Errors(gappy, motion.trajectory)
    inside = (errors.time > 1.5) & (errors.time < 2.2)
    assert (errors.flag[inside] & BRIDGED).all()
    outside = (errors.time < 1.49) | (errors.time > 2.21)
    assert not (errors.flag[outside] & BRIDGED).any()
    assert np.abs(errors.up / errors.up_sd).max() < OVER_SD
    assert np.abs(errors.point[:, :2] / errors.sd[:, :2]).max() < OVER_SD
    assert errors.sd[inside, 0].max() > 1.5 * errors.sd[outside, 0].max()
    assert motion.gaps[0][0] == "navigation"
    assert any("navigation: a gap is bridged" in problem for problem in motion.problems)


def test_rts_integrates_the_height_over_a_gap_in_navigation(run):
    time = times(run, "navigation")
    gappy = without(run, "navigation", (time < 1.5) | (time > 2.2))
    errors = Errors(gappy, fuse_motion(gappy).trajectory)
    inside = (errors.time > 1.5) & (errors.time < 2.2)
    assert rms(errors.up[inside] - errors.up[~inside].mean()) < BRIDGED_ERROR


def test_a_gap_in_the_accelerometers(run):
    time = times(run, "accelerometers")
    whole = Errors(run, fuse_motion(run).trajectory)
    gappy = without(run, "accelerometers", (time < 1.5) | (time > 1.8))
    motion = fuse_motion(gappy)
    errors = Errors(gappy, motion.trajectory)
    inside = (errors.time > 1.5) & (errors.time < 1.8)
    assert (errors.flag[inside] & BRIDGED).all()
    assert np.abs(errors.up / errors.up_sd).max() < OVER_SD
    assert errors.sd[inside, 4].max() > whole.sd[inside, 4].max()
    assert rms(errors.up[inside] - whole.up[inside]) < BRIDGED_ERROR
    assert motion.gaps[0][0] == "accelerometers"


def test_single_missing_samples_hardly_matter(run):
    count = times(run, "accelerometers").size
    lossy = without(run, "accelerometers", np.arange(count) % 500 != 200)
    motion = fuse_motion(lossy)
    whole = Errors(run, fuse_motion(run).trajectory)
    errors = Errors(lossy, motion.trajectory)
    assert rms(errors.up - whole.up) < 5e-4  # [m]
    assert any("gaps are bridged" in problem for problem in motion.problems)


def test_accelerometers_that_stop_before_the_end(run):
    time = times(run, "accelerometers")
    motion = fuse_motion(without(run, "accelerometers", time < 2.0))
    errors = Errors(run, motion.trajectory)
    assert (errors.flag[errors.time > 2.01] & BRIDGED).all()
    assert not (errors.flag[(errors.time > 0.2) & (errors.time < 1.99)] & BRIDGED).any()
    assert np.abs(errors.up / errors.up_sd).max() < OVER_SD


def test_a_gap_that_is_too_long(run):
    time = times(run, "navigation")
    gappy = without(run, "navigation", (time < 1.5) | (time > 2.2))
    with pytest.raises(CoverageError, match=r"gap of 0.710 s at 1.495000 s, longer than"):
        fuse_motion(gappy, settings=FusionSettings(max_gap=0.5))


def test_values_that_are_not_finite_are_gaps(run):
    up = run["navigation"]["up"].values.copy()
    up[300:320] = np.nan
    force = run["accelerometers"]["acceleration"].values.copy()
    force[5000:5010, 1] = np.inf
    holed = changed(changed(run, "navigation", up=up), "accelerometers", acceleration=force)
    motion = fuse_motion(holed)
    assert {name for name, _, _ in motion.gaps} == {"navigation", "accelerometers"}
    assert any("20 epochs are left out" in problem for problem in motion.problems)
    assert any("10 samples are left out" in problem for problem in motion.problems)
    assert np.isfinite(motion.trajectory.position).all()
    assert np.isfinite(motion.trajectory.covariance).all()


def test_a_clock_that_jumps_forward(run):
    time = times(run, "navigation").copy()
    time[400:] += 0.25
    with pytest.raises(SchemaError, match=r"jumps by 0.250000 s at 1.895000 s"):
        fuse_motion(changed(run, "navigation", time=time))


def test_an_accelerometer_clock_that_jumps_forward_gives_warnings(run):
    """As a gap, and because navigation then disagrees."""
    time = times(run, "accelerometers").copy()
    time[4000:] += 0.05
    motion = fuse_motion(changed(run, "accelerometers", time=time))
    assert motion.gaps[0][0] == "accelerometers"
    assert any("navigation and accelerometers disagree" in each for each in motion.problems)
    assert not any("disagree" in each for each in fuse_motion(run).problems)


def test_accelerometers_much_later_than_stated(run):
    settings = FusionSettings(accelerometer_delay=-0.01)
    assert any(
        "ms later than stated" in each for each in fuse_motion(run, settings=settings).problems
    )


@pytest.mark.parametrize("group", ["navigation", "accelerometers"])
def test_a_clock_that_jumps_back(run, group):
    time = times(run, group).copy()
    time[400:] -= 0.25
    with pytest.raises(SchemaError, match="must run forward"):
        fuse_motion(changed(run, group, time=time))


def test_a_time_that_is_not_finite(run):
    time = times(run, "navigation").copy()
    time[7] = np.nan
    with pytest.raises(SchemaError, match="must be finite everywhere, got nan at index 7"):
        fuse_motion(changed(run, "navigation", time=time))


def test_without_navigation(run):
    with pytest.raises(SchemaError, match="group navigation: is missing"):
        fuse_motion(with_group(run, "navigation", None))


def test_with_hardly_any_navigation(run):
    with pytest.raises(CoverageError, match="has 0 usable epochs, at least 4"):
        fuse_motion(without(run, "navigation", times(run, "navigation") < -0.09))


def test_without_accelerometers(run):
    bare = with_group(run, "accelerometers", None)
    with pytest.warns(UserWarning, match="the run has no accelerometers"):
        motion = fuse_motion(bare)
    assert motion.method == "navigation"
    assert any("no accelerometers" in problem for problem in motion.problems)
    for method in ("thesis", "zero-phase", "wiener"):
        with pytest.raises(CoverageError, match=f"which the method {method} needs"):
            fuse_motion(bare, settings=FusionSettings(method=method))
    fuse_motion(bare, settings=FusionSettings(method="navigation"))


def test_accelerometers_of_another_day(run):
    later = changed(run, "accelerometers", time=times(run, "accelerometers") + 86400.0)
    with pytest.warns(UserWarning, match="that were on while the navigation was"):
        fuse_motion(later)


def test_navigation_without_standard_deviations(run):
    data = run["navigation"].to_dataset()
    bare = with_group(run, "navigation", data.drop_vars([n for n in data if n.startswith("sd_")]))
    motion = fuse_motion(bare)
    sd = np.sqrt(motion.trajectory.covariance[1000, 0, 0])
    assert sd == FusionSettings().navigation_sd[0]


def test_uneven_epochs(run):
    """Jitter of the epochs of navigation is no gap and hardly matters."""
    scene_time = times(run, "navigation")
    rng = np.random.default_rng(1)
    jitter = np.clip(1e-4 * rng.standard_normal(scene_time.size), -1e-3, 1e-3)
    data = run["navigation"].to_dataset()
    moved = {
        name: np.interp(scene_time + jitter, scene_time, data[name].values)
        for name in ("east", "north", "up", "roll", "pitch", "yaw")
    }
    uneven = changed(run, "navigation", time=scene_time + jitter, **moved)
    motion = fuse_motion(uneven)
    errors, whole = Errors(uneven, motion.trajectory), Errors(run, fuse_motion(run).trajectory)
    assert motion.gaps == ()
    n = min(errors.time.size, whole.time.size)
    assert rms(errors.up[:n].std() - whole.up[:n].std()) < 1e-3  # [m]
