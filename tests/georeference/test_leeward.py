"""Measured points of an airborne scanner, back to its body and forth again, through its SBET.

The numbers are those of PDAL 2.8.4 for the same files (reverse georeferencing):
ranges of 4454 to 5345 m, angles across that follow the stored scan angles with a slope of 0.997, a
bias of 0.105 deg and a rest of 0.30 deg, as whole degrees leave it (1/sqrt(12) = 0.29 deg).
"""

import tomllib

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr

from trueterrain.formats import las
from trueterrain.formats.navigation import read_sbet
from trueterrain.formats.run import Mounting
from trueterrain.geometry.rotations import enu_of_projected, geodetic_of_enu
from trueterrain.georeference import georeference
from trueterrain.motion import FusionSettings, fuse_motion

MILLIMETRE = 1e-3  # [m] of what comes back after 5 km there and back
RANGE = 1.0  # [m] to which the ranges were published
PUBLISHED = 0.005  # [1] or [deg] to which slope, bias and rest were published
ROUND_TRIP = 1e-5  # [m] PROJ there and back, over 6400 km of radius
ORDER = 7  # every n-th point is transformed forward


@pytest.fixture(scope="module")
def flight(data):
    """Trajectory, points in its frame, times and stored scan angles [deg], origin."""
    import laspy

    folder = data / "scanning" / "georeference" / "leeward"
    zone = tomllib.loads((folder / "config.toml").read_text())["utm_zone"]
    crs = f"EPSG:{32600 + zone}"
    navigation = read_sbet(folder / "sbet.out")
    run = xr.DataTree.from_dict({"navigation": navigation})
    run.attrs["origin"] = navigation.attrs["origin"]
    motion = fuse_motion(run, settings=FusionSettings(method="navigation"))
    points = las.read(folder / "points.las", crs=crs)
    origin = navigation.attrs["origin"]
    place = (points[name].values for name in ("easting", "northing", "up"))
    # the heights of the file are ellipsoidal, as those of the SBET are
    enu = enu_of_projected(*place, crs, origin, undulation=0.0)
    angle = np.array(laspy.read(folder / "points.las").scan_angle_rank, dtype=float)
    return motion.trajectory, points, enu, angle, origin


def in_body(trajectory, time, enu):
    """Vectors from the body to the points, in body axes."""
    pose = trajectory.at(time)
    return pose.rotation.inv().apply(enu - pose.position)


def test_points_lie_where_the_scanner_looked(flight):
    trajectory, points, enu, stored, _ = flight
    vector = in_body(trajectory, points.time.values, enu)
    length = np.linalg.norm(vector, axis=1)
    npt.assert_allclose([length.min(), length.max()], [4454, 5345], rtol=0, atol=RANGE)
    across = np.rad2deg(np.arctan2(-vector[:, 1], -vector[:, 2]))  # right positive, as stored
    slope, bias = np.polyfit(stored, across, 1)
    rest = across - slope * stored - bias
    found = [slope, abs(bias), np.std(rest)]
    npt.assert_allclose(found, [0.997, 0.105, 0.30], rtol=0, atol=PUBLISHED)


def test_poses_of_another_time_do_not_fit(flight):
    """Half a second later the body has turned and moved on: times are taken into account."""
    trajectory, points, enu, _, _ = flight
    time = points.time.values
    early = time < trajectory.time[-1] - 0.5
    vector = in_body(trajectory, time[early], enu[early])
    later = in_body(trajectory, time[early] + 0.5, enu[early])
    assert np.linalg.norm(later - vector, axis=1).min() > 10  # [m]; it flies at 110 m/s


def test_vectors_in_the_body_give_the_points(flight):
    """Through mounting, scan and beam: each return with the fan that its vector lies in."""
    trajectory, points, enu, _, _ = flight
    chosen = slice(None, None, ORDER)
    time, there = points.time.values[chosen], enu[chosen]
    vectors = in_body(trajectory, time, there)
    ranges = np.linalg.norm(vectors, axis=1)
    back = []
    for stamp, (x, y, z), length in zip(time, vectors, ranges, strict=True):
        scan = xr.Dataset(
            {
                "time": ("scan", [stamp - 0.25]),
                "range": (("scan", "beam"), [[length]]),
                "angle": ("beam", [np.arcsin(y / length)]),
                "delay": ("beam", [0.05]),
            }
        )
        mounting = Mounting(scanner_rotation=(0.0, np.arctan2(-x, -z), 0.0), scanner_clock=0.2)
        (point,) = georeference([scan], trajectory, mounting)
        back.append([point[name].item() for name in ("easting", "northing", "up")])
    npt.assert_allclose(back, there, rtol=0, atol=MILLIMETRE)


def test_the_local_frame_leads_back_to_the_map(flight):
    """From the local frame back into UTM, by PROJ alone."""
    import pyproj

    _, points, enu, _, origin = flight
    longitude, latitude, height = geodetic_of_enu(enu, origin)
    to_map = pyproj.Transformer.from_crs(
        4326, int(points.attrs["crs"].split(":")[-1]), always_xy=True
    )
    east, north = to_map.transform(np.rad2deg(longitude), np.rad2deg(latitude))
    stored = np.stack([points[name].values for name in ("easting", "northing", "up")])
    npt.assert_allclose(np.stack([east, north, height]), stored, rtol=0, atol=ROUND_TRIP)
