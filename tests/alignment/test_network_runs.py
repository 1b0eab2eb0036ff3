"""Alignment of recorded runs against the known truth."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from trueterrain.alignment import CellSettings, adjust_passes, cells_of_points, cells_of_run
from trueterrain.formats.run import open_run
from trueterrain.georeference import georeference
from trueterrain.motion import FusionSettings, fuse_motion
from trueterrain.simulate.scene import read_scene

pytestmark = pytest.mark.slow

CELLS = CellSettings(size=0.1, scans=0)
SLOWEST = 8.0  # [m/s] of the passes, which are driven at 10 m/s


@pytest.fixture(scope="module")
def runs(recorded_scene):
    """Two passes of 12 m that overlap by half a metre, and their motion; cells of both."""
    scene, _ = read_scene("three-lanes")
    passes = tuple(replace(one, start=20.0, length=12.0, reverse=False) for one in scene.passes[:2])
    ground = ({"kind": "road", "road_class": "C", "seed": 5, "waves": 256},)
    scene = replace(scene, passes=passes, ground=ground, raster=0.02)
    found = []
    for path in recorded_scene(scene):
        trajectory = fuse_motion(open_run(path), settings=FusionSettings(method="rts")).trajectory
        found.append((path, trajectory, cells_of_run(path, trajectory, CELLS, name=path.stem)))
    return found


def test_cells_of_a_run_are_those_of_its_points(runs):
    path, trajectory, cells = runs[0]
    (points,) = cells_of_points(georeference(path, trajectory), CELLS)
    for name in ("cell", "easting", "northing", "height", "variance", "count"):
        assert_array_equal(getattr(cells, name), getattr(points, name))
    # that of the middle of the cell, as the path of the run tells it
    assert np.abs(cells.time - points.time).max() < CELLS.size / SLOWEST
    # swaths of 4 m, on both sides of the path; the laser sits 2.25 m behind the body
    assert_allclose([cells.offset.min(), cells.offset.max()], [-2.0, 2.0], rtol=0, atol=0.15)
    assert_allclose(np.median(cells.longitudinal), -2.25, rtol=0, atol=0.1)
    assert cells.sd_height is not None
    assert_allclose(cells.sd_height**2, trajectory.covariance[:, 2, 2], rtol=1e-9, atol=0)


def test_two_passes_agree_at_the_seam(runs):
    """Drift of centimetres, and after the adjustment less than 0.2 mm in the median."""
    found = adjust_passes([cells for *_, cells in runs])
    (pair,) = found.pairs
    assert abs(pair.before.median) > 0.01
    assert abs(pair.after.median) < 5e-5
    assert pair.held_out.nmad < 3e-4
    assert pair.after.n > 300


def test_heights_are_true_up_to_the_datum(runs):
    """Remaining error of the motion between the passes at the seam."""
    found = adjust_passes([cells for *_, cells in runs])
    errors = []
    for path, trajectory, cells in runs:
        body = open_run(path)["truth/body"]
        time = np.linspace(cells.time.min() + 0.2, cells.time.max() - 0.2, 200)
        up, roll = (np.interp(time, body["time"], body[name]) for name in ("up", "roll"))
        poses = trajectory.at(time)
        tilt = poses.rotation.as_euler("ZYX")[:, 2] - roll
        seam = -1.75 if path.stem.endswith("left") else 1.75
        error = poses.position[:, 2] - up + tilt * seam
        east = np.interp(time, body["time"], body["east"])
        errors.append((east, error + found.correction(path.stem).height_at(time, seam)))
    east = np.linspace(20.0, 27.0, 100)
    at_seam = [np.interp(east, *one) for one in errors]
    assert np.sqrt(np.mean((at_seam[1] - at_seam[0]) ** 2)) < 1e-3  # [m] 30 mm before
