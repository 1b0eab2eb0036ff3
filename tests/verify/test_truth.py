"""Errors against known ground: analytic grounds, lines and maps, and runs without truth."""

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import make_surface
from trueterrain.surface import node_coordinates
from trueterrain.verify import exact_trajectory, ground_errors, true_ground

ROUND_OFF = 1e-12  # [m] of heights of some metres
SD = 0.003  # [m] of errors that are drawn
SHIFT = 0.05  # [m] of the datum
NODES = 1100 * 11
SPREAD = 4 * SD / np.sqrt(2 * NODES)  # [m] four standard deviations of a standard deviation


def plane(easting, northing):
    """True height [m]."""
    return 3.0 + 0.1 * easting - 0.2 * northing


def road(noise=0.0):
    """A surface along a bend, longer than one block, and its errors."""
    u, v = 0.1 * np.arange(1100), np.linspace(-1, 1, 11)
    turn = u / 80.0
    line = {"easting": 80 * np.sin(turn), "northing": 80 * (1 - np.cos(turn))}
    chord = 160 * np.sin(0.05 / 80)
    surface = make_surface(np.zeros((u.size, v.size)), u=chord * np.arange(1100), v=v, **line)
    return surface.assign(
        height=surface["height"].copy(data=plane(*node_coordinates(surface)) + noise)
    )


def test_no_error_is_none():
    found = ground_errors(road(), plane)
    assert found.pop("nodes") == NODES
    npt.assert_allclose(list(found.values()), 0, rtol=0, atol=ROUND_OFF)


def test_shift_and_noise_are_separated():
    noise = SHIFT + SD * np.random.default_rng(1).standard_normal((1100, 11))
    found = ground_errors(road(noise), plane)
    npt.assert_allclose(found["median"], SHIFT, rtol=0, atol=2 * SPREAD)
    for name in ("nmad", "rms_about_median"):
        npt.assert_allclose(found[name], SD, rtol=0, atol=2 * SPREAD)
    npt.assert_allclose(found["p95"], 1.96 * SD, rtol=0, atol=6 * SPREAD)
    npt.assert_allclose(found["rms"], np.hypot(SHIFT, SD), rtol=0, atol=2 * SPREAD)


def test_maps_and_nodes_without_height():
    easting, northing = np.arange(5.0), np.arange(3.0)
    height = plane(easting, northing[:, None])
    height[1, 2] = np.nan
    found = ground_errors(make_surface(height, easting=easting, northing=northing), plane)
    assert found["nodes"] == 14
    npt.assert_allclose(found["rms"], 0, rtol=0, atol=ROUND_OFF)


def test_truth_elsewhere_is_refused():
    with pytest.raises(CoverageError, match="covers no node"):
        ground_errors(road(), lambda easting, _: np.full_like(easting, np.nan))


def test_a_run_that_was_not_simulated_has_none():
    with pytest.raises(CoverageError, match="was not simulated"):
        true_ground(xr.DataTree())


def test_the_truth_of_a_simulated_run_is_its_ground():
    ground = make_surface(
        plane(np.arange(4.0)[:, None], np.array([-1.0, 1.0])),
        u=np.arange(4.0),
        v=[-1.0, 1.0],
        easting=np.arange(4.0),
        northing=np.zeros(4),
    )
    truth = true_ground(xr.DataTree.from_dict({"/truth/ground": ground}))
    at = np.array([1.25]), np.array([-0.5])
    npt.assert_allclose(truth(*at), plane(*at), rtol=0, atol=ROUND_OFF)


def body_of(time):
    """Body that turns and tilts as it drives, with its rates."""
    wave, rate = np.sin(2 * time), 2 * np.cos(2 * time)
    values = {
        "east": 5 * time,
        "north": 0.3 * wave,
        "up": 0.01 * wave,
        "roll": 0.02 * wave,
        "pitch": -0.03 * wave,
        "yaw": 0.5 * wave,
    }
    sizes = {"north": 0.3, "up": 0.01, "roll": 0.02, "pitch": -0.03, "yaw": 0.5}
    rates = {f"{name}_rate": size * rate for name, size in sizes.items()}
    columns = {**values, **rates, "east_rate": np.full_like(time, 5.0), "time": time}
    return xr.Dataset({name: ("knot", column) for name, column in columns.items()})


def test_the_exact_motion_is_that_of_the_knots():
    time = 0.0005 * np.arange(4001)
    body = body_of(time)
    found = exact_trajectory(xr.DataTree.from_dict({"/truth/body": body}))
    between = time[:-1] + 0.00025
    poses = found.at(between)
    true = body_of(between)
    npt.assert_allclose(
        poses.position,
        np.stack([true[name] for name in ("east", "north", "up")], axis=-1),
        rtol=0,
        atol=1e-10,
    )
    angles = poses.rotation.as_euler("ZYX")
    npt.assert_allclose(
        angles,
        np.stack([true[name] for name in ("yaw", "pitch", "roll")], axis=-1),
        rtol=0,
        atol=1e-9,
    )
    steps = (found.at(time[:-1]).rotation.inv() * found.at(time[1:]).rotation).as_rotvec() / 0.0005
    npt.assert_allclose(poses.angular_velocity, steps, rtol=0, atol=1e-6)
    assert not found.covariance.any()


def test_real_runs_have_no_exact_motion():
    with pytest.raises(CoverageError, match="holds no true motion"):
        exact_trajectory(xr.DataTree.from_dict({"/scans": xr.Dataset()}))
