"""A measured flight: trajectory and points of the data set leeward, in both directions."""

from pathlib import Path

import laspy
import numpy as np
import numpy.testing as npt
import pyproj
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from trueterrain.formats.navigation import sbet
from trueterrain.formats.run import Mounting
from trueterrain.geometry.topocentric import into_crs
from trueterrain.georeference import georeference
from trueterrain.motion import FusionSettings, Trajectory, fuse_motion

ROUNDED = 0.3  # [deg] rms of angles that are stored in whole degrees: 1 / sqrt(12), and the mirror
FORWARD = 1e-5  # [m] round-off of a range of 5 km
STORED = 0.01  # [m] step of the coordinates in both files


@pytest.fixture(scope="module")
def leeward(data: Path) -> tuple[Trajectory, np.ndarray, laspy.LasData, list[float]]:
    """Motion, points in its local frame, the points as they are stored, and the origin."""
    folder = data / "scanning" / "georeference" / "leeward"
    navigation = sbet.read(folder / "sbet.out")
    motion = fuse_motion(
        xr.DataTree.from_dict({"navigation": navigation}),
        settings=FusionSettings(method="navigation", smoothing_window=0.02),
    )
    points = laspy.read(folder / "points_ecef.las")
    longitude, latitude, height = navigation.attrs["origin"]
    geocentric = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    centre = np.array(geocentric.transform(longitude, latitude, height))
    # rows of the matrix are east, north and up; by the rotation of the geocentric axes
    axes = Rotation.from_euler("ZY", [90 + longitude, 0.0], degrees=True) * Rotation.from_euler(
        "X", 90 - latitude, degrees=True
    )
    local = axes.inv().apply(points.xyz - centre)
    return motion.trajectory, local, points, [longitude, latitude, height]


def test_points_seen_from_the_body_have_the_stored_scan_angles(leeward):
    trajectory, local, points, _ = leeward
    poses = trajectory.at(np.array(points.gps_time))
    seen = poses.rotation.inv().apply(local - poses.position)
    assert 4400 < np.linalg.norm(seen, axis=1).min() < 4500
    angle = np.rad2deg(np.arctan2(seen[:, 1], -seen[:, 2]))
    stored = np.array(points.scan_angle_rank, dtype=float)  # right positive, ours to the left
    slope, bias = np.polyfit(stored, angle, 1)
    npt.assert_allclose([slope, bias], [-1, 0], rtol=0, atol=0.2)
    rest = angle - slope * stored - bias
    assert np.sqrt(np.mean(rest**2)) < 1.05 * ROUNDED
    npt.assert_allclose(slope, -1, rtol=0, atol=0.01)


def test_vectors_from_the_body_give_the_points(leeward):
    trajectory, local, points, _ = leeward
    times = np.array(points.gps_time)
    poses = trajectory.at(times)
    seen = poses.rotation.inv().apply(local - poses.position)
    for k in range(0, times.size, 60):
        x, y, z = seen[k]
        distance = np.linalg.norm(seen[k])
        # the fan is turned forward until the return lies in it
        tilt = Mounting(scanner_rotation=(0.0, np.arctan2(-x, -z), 0.0))
        scan = xr.Dataset(
            {
                "time": ("scan", times[k : k + 1]),
                "range": (("scan", "beam"), [[distance]]),
                "angle": ("beam", [np.arcsin(y / distance)]),
                "delay": ("beam", [0.0]),
            }
        )
        (found,) = georeference([scan], trajectory, tilt)
        at = [found.easting.item(), found.northing.item(), found.up.item()]
        npt.assert_allclose(at, local[k], rtol=0, atol=FORWARD)


def test_points_in_the_map_are_those_of_the_other_file(leeward, data):
    """UTM zone 11 on WGS 84, computed by somebody else; heights are ellipsoidal."""
    _, local, points, origin = leeward
    from trueterrain.core.schemas import make_points

    moved = into_crs(make_points(*local.T), origin, "EPSG:32611")
    other = laspy.read(data / "scanning" / "georeference" / "leeward" / "points.las")
    npt.assert_array_equal(other.gps_time, points.gps_time)
    found = np.stack([moved.easting, moved.northing, moved.up], axis=1)
    npt.assert_allclose(found, other.xyz, rtol=0, atol=STORED)
