"""Two passes of Belgian block, driven by the simulator with the drift of the Boreas drives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.alignment.discontinuity.alignment import (
    PassAlignment,
    align_along_paths,
    correct_points,
)
from trueterrain.formats.run import open_run
from trueterrain.georeference import georeference
from trueterrain.motion.trajectory import Trajectory
from trueterrain.simulate.scene import TruthSettings, read_scene

pytestmark = pytest.mark.slow

SEAM = 1e-3  # [m] what the thesis reaches
DRIFT = 1.5e-3  # [m] what of a drift of the first order is shorter than the cut-off of 2.5 m
SPEED = 5.0  # [m/s]


def drifting(run: Path) -> tuple[Trajectory, xr.Dataset]:
    """The true motion with the drift of the navigation in its height, and that navigation."""
    body = open_run(run)["truth/body"].to_dataset().load()
    truth = open_run(run)["truth/navigation"].to_dataset().load()
    position, velocity = (
        np.stack([body[f"{name}{what}"].values for name in ("east", "north", "up")], axis=1)
        for what in ("", "_rate")
    )
    position[:, 2] += np.interp(body.time, truth.true_time, truth.drift_up)
    roll, pitch, yaw = (body[name].values for name in ("roll", "pitch", "yaw"))
    r, p, y = (body[f"{name}_rate"].values for name in ("roll", "pitch", "yaw"))
    turning = [
        r - y * np.sin(pitch),
        p * np.cos(roll) + y * np.sin(roll) * np.cos(pitch),
        -p * np.sin(roll) + y * np.cos(roll) * np.cos(pitch),
    ]
    n = body.sizes["knot"]
    trajectory = Trajectory(
        time=body["time"].values,
        position=position,
        velocity=velocity,
        quaternion=Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=1)).as_quat(),
        angular_velocity=np.stack(turning, axis=1),
        covariance=np.zeros((n, 6, 6)),
        flag=np.zeros(n, np.uint8),
    )
    return trajectory, truth


@pytest.fixture(scope="module")
def driven(recorded_scene) -> tuple[dict[str, list[xr.Dataset]], dict[str, xr.Dataset]]:
    """Points of 6 m of both passes from a scanner with a quarter of the beams and of the rate."""
    scene, _ = read_scene("belgian-two-lanes")
    scene = replace(
        scene,
        raster=0.01,
        truth=TruthSettings(spacing=0.1, returns=False),
        scanner=replace(scene.scanner, beams=235, rate=400.0, spot_rays=1),
        passes=tuple(replace(drive, start=5.0, length=6.0) for drive in scene.passes),
    )
    points, truths = {}, {}
    for run in recorded_scene(scene):
        name = run.stem.removeprefix("belgian-two-lanes-")
        trajectory, truths[name] = drifting(run)
        points[name] = list(georeference(run, trajectory))
    return points, truths


@pytest.fixture(scope="module")
def aligned(driven) -> PassAlignment:
    return align_along_paths(driven[0])


def test_the_seam_is_at_most_a_millimetre(aligned) -> None:
    (found,) = aligned.pairs
    assert found.seam_before.median > 20e-3  # [m] half of a drift of some 90 mm
    assert found.seam_after.median < SEAM
    assert abs(found.after.median) < SEAM
    assert found.discontinuity.gap.mean() < 0.2


def test_the_drift_that_was_injected_is_what_is_found(driven, aligned) -> None:
    _, truths = driven
    (found,) = aligned.pairs
    vector = found.discontinuity
    # where the laser, 2.25 m behind the body, is at each time
    behind = {
        name: np.interp(
            found.path.curve.easting, truth.true_time * SPEED + 5.0 - 2.25, truth.drift_up
        )
        for name, truth in truths.items()
    }
    injected = behind["left"] - behind["right"]
    inner = ~vector.gap
    npt.assert_allclose(
        (vector.filtered[0] - vector.filtered[1])[inner].mean(),
        injected[inner].mean(),
        rtol=0,
        atol=SEAM,
    )
    off = (vector.filtered[0] - vector.filtered[1] - injected)[inner]
    assert np.sqrt(np.mean(off**2)) < DRIFT


def test_corrected_points_agree_when_they_are_aligned_again(driven, aligned) -> None:
    points, _ = driven
    again = align_along_paths(
        {name: [correct_points(block, aligned, name) for block in points[name]] for name in points}
    )
    assert again.pairs[0].seam_before.median < SEAM
    assert np.abs(again.corrections["left"].height).max() < SEAM
