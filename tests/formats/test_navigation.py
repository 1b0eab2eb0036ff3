"""Navigation: SBET, SMRMSG, Boreas poses and tables compared with independent numbers."""

import sys

import numpy as np
import numpy.testing as npt
import pandas as pd
import pyproj
import pytest
from scipy.spatial.transform import Rotation

import trueterrain.formats.navigation as nav
from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError, FormatError, SchemaError, TrueTerrainError
from trueterrain.formats import navigation_signature
from trueterrain.formats.navigation import boreas, columns, sbet, smrmsg
from trueterrain.geometry.navigation_frames import (
    YawUnwrapper,
    check_origin,
    enu_of_geodetic,
    iso8855_of_ned,
)

POSITION = {"rtol": 0, "atol": 2e-8}  # [m] round-off of geocentric coordinates of 6e6 m
ANGLE = {"rtol": 0, "atol": 1e-12}  # [rad] round-off of a product of rotations
POSES = ("boreas-2021-08-05-13-34", "boreas-2021-09-02-11-42")

POSE_NAMES = ("east", "north", "up", "roll", "pitch", "yaw")


def leeward(data):
    return data / "scanning" / "georeference" / "leeward"


def poses(data, name):
    return data / "scanning" / "trajectories" / f"{name}.lidar_poses.csv"


def records(count=5, **replaced):
    """SBET records of a car that drives north at 48 deg north, 11 deg east."""
    table = np.zeros((count, 17))
    table[:, 0] = 1000.0 + 0.005 * np.arange(count)
    table[:, 1] = np.deg2rad(48.0) + 1e-8 * np.arange(count)
    table[:, 2] = np.deg2rad(11.0)
    table[:, 3] = 500.0
    table[:, 4] = 10.0
    for name, values in replaced.items():
        index = {
            "time": 0,
            "latitude": 1,
            "longitude": 2,
            "height": 3,
            "roll": 7,
            "pitch": 8,
            "heading": 9,
            "wander": 10,
        }[name]
        table[:, index] = values
    return table


def sbet_file(folder, table, name="sbet.out"):
    path = folder / name
    table.astype("<f8").tofile(path)
    return path


# --- frames ---------------------------------------------------------------------------------------


def test_positions_equal_the_topocentric_ones_of_proj():
    origin = (11.3, 48.2, 520.0)
    rng = np.random.default_rng(1)
    lon, lat = 11.3 + rng.uniform(-0.1, 0.1, 50), 48.2 + rng.uniform(-0.1, 0.1, 50)
    height = rng.uniform(0, 1000, 50)
    proj = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart "
        "+ellps=WGS84 +step +proj=topocentric +ellps=WGS84 +lon_0=11.3 +lat_0=48.2 +h_0=520"
    )
    truth = np.stack(proj.transform(lon, lat, height), axis=-1)
    npt.assert_allclose(
        enu_of_geodetic(np.deg2rad(lon), np.deg2rad(lat), height, origin), truth, **POSITION
    )


def test_angles_of_iso_8855_for_a_body_at_the_origin():
    rng = np.random.default_rng(2)
    r, q, h = rng.uniform(-1, 1, 40), rng.uniform(-1, 1, 40), rng.uniform(-7, 7, 40)
    roll, pitch, yaw = iso8855_of_ned(r, q, h)
    ned_frd = Rotation.from_euler("ZYX", np.stack([h, q, r], axis=-1)).as_matrix()
    to_enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    truth = to_enu @ ned_frd @ np.diag([1, -1, -1])
    ours = Rotation.from_euler("ZYX", np.stack([yaw, pitch, roll], axis=-1)).as_matrix()
    npt.assert_allclose(ours, truth, **ANGLE)
    assert np.all(np.abs(yaw) <= np.pi)
    at = {"longitude": np.full(40, 0.2), "latitude": np.full(40, 0.8)}
    again = iso8855_of_ned(r, q, h, **at, origin=(np.rad2deg(0.2), np.rad2deg(0.8), 0.0))
    for one, other in zip(again, (roll, pitch, yaw), strict=True):
        npt.assert_allclose(np.exp(1j * one), np.exp(1j * other), **ANGLE)


def test_attitude_far_from_the_origin_follows_the_positions():
    """A point 1 m in front of (right of, below) the body lies where the ellipsoid puts it."""
    origin = (11.0, 48.0, 400.0)
    lon, lat, height = np.deg2rad(11.2), np.deg2rad(48.15), 600.0
    r, q, h = 0.03, -0.05, 1.1
    roll, pitch, yaw = iso8855_of_ned([r], [q], [h], longitude=[lon], latitude=[lat], origin=origin)
    body = Rotation.from_euler("ZYX", [[yaw[0], pitch[0], roll[0]]])
    here = enu_of_geodetic([lon], [lat], [height], origin)[0]
    ned = Rotation.from_euler("ZYX", [h, q, r]).as_matrix()
    geocentric = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    geodetic = pyproj.Transformer.from_crs(4978, 4979, always_xy=True)
    for frd, flu in (((1, 0, 0), (1, 0, 0)), ((0, 1, 0), (0, -1, 0)), ((0, 0, 1), (0, 0, -1))):
        north, east, down = ned @ frd
        axes = np.array(
            [
                [-np.sin(lon), np.cos(lon), 0],
                [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
                [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
            ]
        )
        place = geocentric.transform(np.rad2deg(lon), np.rad2deg(lat), height)
        there = geodetic.transform(*(np.array(place) + axes.T @ [east, north, -down]))
        truth = enu_of_geodetic(np.deg2rad([there[0]]), np.deg2rad([there[1]]), [there[2]], origin)
        npt.assert_allclose(body.apply(flu)[0], truth[0] - here, **POSITION)


def test_yaw_differs_by_the_convergence_of_the_meridians():
    """5 km east at 45 deg, north points 0.78 mrad to the left of the grid's north."""
    east = 5000.0 / 6.378e6 / np.cos(np.pi / 4)
    _, _, yaw = iso8855_of_ned(
        [0.0], [0.0], [0.0], longitude=[east], latitude=[np.pi / 4], origin=(0.0, 45.0, 0.0)
    )
    npt.assert_allclose(yaw[0] - np.pi / 2, east * np.sin(np.pi / 4), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    "origin", [(1.0, 2.0), (1.0, 91.0, 0.0), (361.0, 0.0, 0.0), (np.nan, 0.0, 0.0)]
)
def test_an_invalid_origin_is_refused(origin):
    with pytest.raises(ValueError, match="origin must"):
        check_origin(origin)


def test_yaw_continues_over_a_full_turn():
    truth = np.linspace(0, 15, 100)
    wrapped = np.angle(np.exp(1j * truth))
    turns = YawUnwrapper()
    parts = [turns.continued(part) for part in (wrapped[:37], wrapped[37:37], wrapped[37:])]
    npt.assert_allclose(np.concatenate(parts), truth, **ANGLE)
    npt.assert_array_equal(np.concatenate(parts), YawUnwrapper().continued(wrapped))


# --- SBET -----------------------------------------------------------------------------------------


def test_the_measured_sbet_is_read_correctly(data):
    navigation = nav.read_sbet(leeward(data) / "sbet.out")
    assert navigation.sizes["epoch"] == 200
    time = navigation.time.values
    npt.assert_allclose(np.diff(time), 0.005, rtol=0, atol=2e-5)  # [s] jitter of the recorder
    assert time[0] == 400825.0013129992
    assert provenance.provenance_steps(navigation)[-1]["parameters"]["format"] == "SBET"
    raw = np.fromfile(leeward(data) / "sbet.out", "<f8").reshape(-1, 17)
    lon, lat, height = navigation.attrs["origin"]
    npt.assert_allclose(
        [lon, lat, height],
        [np.rad2deg(raw[0, 2]), np.rad2deg(raw[0, 1]), raw[0, 3]],
        rtol=0,
        atol=1e-12,
    )
    proj = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lon_0={lon!r} +lat_0={lat!r} +h_0={height!r}"
    )
    truth = np.stack(proj.transform(raw[:, 2], raw[:, 1], raw[:, 3], radians=True), axis=-1)
    ours = np.stack([navigation[name] for name in ("east", "north", "up")], axis=-1)
    npt.assert_allclose(ours, truth, **POSITION)
    npt.assert_allclose(navigation["roll"][0], raw[0, 7], rtol=0, atol=1e-9)
    npt.assert_allclose(navigation.pitch[0], -raw[0, 8], rtol=0, atol=1e-9)
    npt.assert_allclose(navigation.yaw[0], np.pi / 2 - (raw[0, 9] - raw[0, 10]), rtol=0, atol=1e-9)


def test_velocities_of_the_wander_frame_agree_with_the_positions(data):
    """The wander angle is subtracted with the right sign: added, the velocity is off by 3.7 m/s."""
    navigation = nav.read_sbet(leeward(data) / "sbet.out")
    raw = np.fromfile(leeward(data) / "sbet.out", "<f8").reshape(-1, 17)
    along, left, up, wander = raw[:, 4], raw[:, 5], raw[:, 6], raw[:, 10]
    north = along * np.cos(wander) - left * np.sin(wander)
    west = along * np.sin(wander) + left * np.cos(wander)
    time = navigation.time.values
    for name, velocity in (("east", -west), ("north", north), ("up", up)):
        distance = navigation[name].values[-1] - navigation[name].values[0]
        # [m] of 110 m: velocities and positions are filtered, not derived from each other
        npt.assert_allclose(distance, np.trapezoid(velocity, time), rtol=0, atol=0.01)


def test_measured_points_lie_where_the_scanner_looked(data):
    """Published oracle (PDAL 2.8.4): 4454 to 5345 m, slope 0.997, bias 0.105 deg, rest 0.30 deg."""
    import laspy

    navigation = nav.read_sbet(leeward(data) / "sbet.out")
    las = laspy.read(leeward(data) / "points.las")
    time = np.array(las.gps_time)
    assert time.min() > navigation.time[0]
    assert time.max() < navigation.time[-1]
    to_degrees = pyproj.Transformer.from_crs(32611, 4326, always_xy=True)
    lon, lat = to_degrees.transform(np.array(las.x), np.array(las.y))
    points = enu_of_geodetic(
        np.deg2rad(lon), np.deg2rad(lat), np.array(las.z), navigation.attrs["origin"]
    )
    pose = {
        name: np.interp(time, navigation.time.values, navigation[name].values)
        for name in POSE_NAMES
    }
    body = Rotation.from_euler("ZYX", np.stack([pose["yaw"], pose["pitch"], pose["roll"]], axis=-1))
    scanner = np.stack([pose["east"], pose["north"], pose["up"]], axis=-1)
    beam = body.inv().apply(points - scanner)
    length = np.linalg.norm(beam, axis=1)
    npt.assert_allclose(
        [length.min(), length.max()], [4454, 5345], rtol=0, atol=1
    )  # [m] as published
    across = np.rad2deg(np.arctan2(-beam[:, 1], -beam[:, 2]))  # [deg] right positive
    stored = np.array(las.scan_angle_rank, dtype=float)
    slope, bias = np.polyfit(stored, across, 1)
    rest = np.std(across - slope * stored - bias)
    npt.assert_allclose([slope, abs(bias), rest], [0.997, 0.105, 0.30], rtol=0, atol=0.005)


def test_blocks_of_any_size_are_the_same(data, tmp_path):
    table = records(1000, heading=np.linspace(0, 20, 1000), wander=0.02)
    table[:, 0] = 604_799.0 + 0.005 * np.arange(1000)
    table[table[:, 0] >= 604_800.0, 0] -= 604_800.0
    path = sbet_file(tmp_path, table)
    whole = sbet.read(path)
    parts = list(sbet.blocks(path, size=77))
    for name in whole.data_vars:
        joined = np.concatenate([part[name].values for part in parts])
        npt.assert_array_equal(joined, whole[name].values)


def test_wander_is_subtracted_from_the_heading(tmp_path):
    path = sbet_file(tmp_path, records(heading=0.5, wander=0.3))
    npt.assert_allclose(nav.read_sbet(path).yaw[0], np.pi / 2 - 0.2, rtol=0, atol=1e-9)


def test_an_origin_given_by_the_user(tmp_path):
    path = sbet_file(tmp_path, records())
    origin = (11.0, 48.0, 490.0)
    navigation = nav.read_sbet(path, origin=origin)
    assert navigation.attrs["origin"] == list(origin)
    npt.assert_allclose([navigation.east[0], navigation.north[0]], 0, **POSITION)
    npt.assert_allclose(navigation.up[0], 10.0, **POSITION)


def test_the_week_rolls_over(tmp_path):
    time = 604_799.99 + 0.005 * np.arange(5)
    wrapped = np.where(time >= 604_800, time - 604_800, time)
    path = sbet_file(tmp_path, records(time=wrapped))
    npt.assert_allclose(nav.read_sbet(path).time, time, rtol=0, atol=1e-9)
    problems = sbet.describe(path)["problems"]
    assert problems == ["a GPS week begins at record 3"]


def test_sbet_that_was_cut_off(tmp_path):
    path = sbet_file(tmp_path, records())
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(FormatError, match=r"sbet.out: record 5: has 677 bytes.*cut off"):
        nav.read_sbet(path)


def test_an_empty_sbet(tmp_path):
    with pytest.raises(FormatError, match="is empty"):
        nav.read_sbet(sbet_file(tmp_path, records(0)))


def test_a_single_record_is_refused(tmp_path):
    with pytest.raises(SchemaError, match="at least 2 epochs, got 1"):
        nav.read_sbet(sbet_file(tmp_path, records(1)))


def test_time_that_runs_backwards(tmp_path):
    path = sbet_file(tmp_path, records(time=[10.0, 10.005, 10.004, 10.015, 10.02]))
    with pytest.raises(
        SchemaError, match=r"time: must run forward, but value 2 \(10.004000 s\) follows 10.005000"
    ):
        nav.read_sbet(path)


def test_degrees_instead_of_radians(tmp_path):
    path = sbet_file(tmp_path, records(latitude=48.0))
    with pytest.raises(FormatError, match=r"record 1, latitude: .*got 48. Convert degrees"):
        nav.read_sbet(path)
    path = sbet_file(tmp_path, records(longitude=11.0))
    with pytest.raises(FormatError, match=r"record 1, longitude: must be in radians"):
        nav.read_sbet(path)
    path = sbet_file(tmp_path, records(pitch=[0, 0, 3.0, 0, 0]))
    with pytest.raises(FormatError, match="record 3, pitch: must be in radians and within 90 deg"):
        nav.read_sbet(path)


@pytest.mark.parametrize("name", ["time", "latitude", "height", "roll", "heading"])
def test_a_record_that_is_nan(tmp_path, name):
    path = sbet_file(tmp_path, records(**{name: [1000.0, 0.5, np.nan, 0.5, 0.5]}))
    with pytest.raises(FormatError, match=r"record 3, .*must be finite everywhere, got nan"):
        nav.read_sbet(path)


def test_bytes_in_the_wrong_order(tmp_path):
    path = tmp_path / "sbet.out"
    records().astype(">f8").tofile(path)
    with pytest.raises(FormatError, match=r"record 1, .*byte order is wrong"):
        nav.read_sbet(path)


def test_description_of_the_measured_sbet(data):
    summary = sbet.describe(leeward(data) / "sbet.out")
    assert summary["count"] == 200
    npt.assert_allclose(summary["rate"], 200, rtol=0, atol=0.01)
    assert summary["gap_count"] == 0
    assert summary["problems"] == []
    npt.assert_allclose(summary["speed"], 110.4, rtol=0, atol=0.1)
    npt.assert_allclose(summary["extent"]["latitude"], [37.7638, 37.7648], rtol=0, atol=1e-4)


def test_description_lists_gaps(tmp_path):
    path = sbet_file(tmp_path, records(time=[10.0, 10.005, 10.010, 12.0, 12.005]))
    summary = sbet.describe(path)
    assert summary["gap_count"] == 1
    npt.assert_allclose(summary["gaps"][0]["start"], 10.010, rtol=0, atol=1e-9)
    npt.assert_allclose(summary["max_gap"], 1.99, rtol=0, atol=1e-9)
    assert "1 gap in time" in summary["problems"][0]


def test_description_flags_times_beyond_the_gps_week(tmp_path):
    path = sbet_file(tmp_path, records(time=1.3e9 + np.arange(5)))
    assert "no seconds of the GPS week" in sbet.describe(path)["problems"][0]


# --- SMRMSG ---------------------------------------------------------------------------------------


def test_the_measured_accuracies_are_read_correctly(data):
    accuracy = nav.read_smrmsg(data / "scanning" / "accuracy" / "smrmsg.smrmsg")
    assert accuracy.sizes["epoch"] == 21902
    medians = {name: float(accuracy[name].median()) for name in accuracy.data_vars}
    # [m] and [arc minutes]: medians of the file as published beside it
    truth = {"sd_north": 0.0407, "sd_east": 0.0379, "sd_up": 0.0466}
    for name, value in truth.items():
        npt.assert_allclose(medians[name], value, rtol=0, atol=1e-4)
    minutes = [np.rad2deg(medians[f"sd_{name}"]) * 60 for name in ("roll", "pitch", "yaw")]
    npt.assert_allclose(minutes, [0.1314, 0.1317, 1.0378], rtol=0, atol=1e-4)


def test_accuracies_are_interpolated_to_the_epochs(tmp_path):
    path = sbet_file(tmp_path, records(401))
    table = np.tile([0.0, 1, 2, 3, 9, 9, 9, 4, 5, 6.0], (4, 1))
    table[:, 0] = [999.5, 1000.5, 1001.5, 1002.5]
    table[:, 1] = [1, 2, 3, 4]
    sd = sbet_file(tmp_path, table, "smrmsg.out")
    navigation = nav.read_sbet(path, accuracy=sd)
    npt.assert_allclose(
        navigation.sd_north, navigation.time - 998.5, rtol=0, atol=1e-12
    )  # [m] linear
    npt.assert_allclose(navigation.sd_east, 2.0, rtol=0, atol=1e-12)
    npt.assert_allclose(navigation.sd_up, 3.0, rtol=0, atol=1e-12)
    for name, minutes in (("roll", 4), ("pitch", 5), ("yaw", 6)):
        npt.assert_allclose(navigation[f"sd_{name}"], np.deg2rad(minutes / 60), **ANGLE)
    assert navigation.sd_yaw.attrs["units"] == "rad"
    inputs = [entry["name"] for entry in provenance.provenance_steps(navigation)[-1]["inputs"]]
    assert inputs == ["sbet.out", "smrmsg.out"]


def test_accuracies_of_another_day_are_refused(data):
    with pytest.raises(CoverageError, match="do not cover 200 of 200 epochs"):
        nav.read_sbet(
            leeward(data) / "sbet.out", accuracy=data / "scanning" / "accuracy" / "smrmsg.smrmsg"
        )


def test_smrmsg_that_is_damaged(tmp_path):
    table = np.tile([0.0, 1, 2, 3, 9, 9, 9, 4, 5, 6.0], (3, 1))
    table[:, 0] = [1, 2, 3]
    table[1, 3] = -1
    with pytest.raises(FormatError, match=r"record 2, sd_up: must be finite and not negative"):
        nav.read_smrmsg(sbet_file(tmp_path, table))
    path = tmp_path / "short"
    path.write_bytes(b"\0" * 79)
    with pytest.raises(FormatError, match=r"record 1: has 79 bytes"):
        nav.read_smrmsg(path)
    table[:, 0] = [1, 1, 3]
    table[1, 3] = 1
    with pytest.raises(SchemaError, match="must run forward"):
        nav.read_smrmsg(sbet_file(tmp_path, table))


def test_description_of_the_measured_accuracies(data):
    summary = smrmsg.describe(data / "scanning" / "accuracy" / "smrmsg.smrmsg")
    assert summary["kind"] == "accuracy"
    npt.assert_allclose(summary["rate"], 1.0, rtol=0, atol=1e-6)
    npt.assert_allclose(summary["largest"]["sd_up"], 1.127, rtol=0, atol=1e-3)


def start_of(path):
    with path.open("rb") as stream:
        return stream.read(1024)


def test_sbet_and_smrmsg_are_recognised_by_their_values(data):
    a = leeward(data) / "sbet.out"
    b = data / "scanning" / "accuracy" / "smrmsg.smrmsg"
    for path, is_sbet, is_smrmsg in ((a, True, False), (b, False, True)):
        start, size = start_of(path), path.stat().st_size
        assert navigation_signature.is_sbet(start, size) == is_sbet
        assert navigation_signature.is_smrmsg(start, size) == is_smrmsg
    others = sorted(path for path in data.rglob("*") if path.is_file() and path not in (a, b))
    assert len(others) > 50
    for other in others:
        start, size = start_of(other), other.stat().st_size
        assert not navigation_signature.is_sbet(start, size)
        assert not navigation_signature.is_smrmsg(start, size)
    assert not navigation_signature.is_sbet(b"", 0)
    assert not navigation_signature.is_smrmsg(b"\0" * 160, 160)


# --- Boreas ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "rows", "span"), [(POSES[0], 10790, 1119), (POSES[1], 9967, 1034)]
)
def test_the_drives_are_read(data, name, rows, span):
    navigation = nav.read_boreas(poses(data, name))
    summary = boreas.describe(poses(data, name))
    assert navigation.sizes["epoch"] == rows == summary["count"]
    npt.assert_allclose(summary["rate"], 9.64, rtol=0, atol=0.01)  # [1/s]
    npt.assert_allclose(summary["time"][1] - summary["time"][0], span, rtol=0, atol=0.5)
    assert summary["problems"] == []
    assert float(navigation.east[0]) == float(navigation.north[0]) == 0.0


@pytest.mark.parametrize("name", POSES)
def test_velocities_are_the_derivatives_of_the_positions(data, name):
    """Displacements over 10 s are the integral of the velocity, in length and direction."""
    navigation = nav.read_boreas(poses(data, name))
    table = pd.read_csv(poses(data, name))
    time = navigation.time.values
    position = navigation.east.values + 1j * navigation.north.values
    velocity = table.vel_east.to_numpy() + 1j * table.vel_north.to_numpy()
    steps = np.diff(time) * (velocity[1:] + velocity[:-1]) / 2
    driven = np.concatenate([[0], np.cumsum(steps)])
    moved = position[100::100] - position[:-100:100]
    expected = driven[100::100] - driven[:-100:100]
    ratio = np.vdot(expected, moved) / np.vdot(expected, expected)
    npt.assert_allclose(abs(ratio), 1, rtol=0, atol=1e-4)  # a map projection would give 2.1e-4
    npt.assert_allclose(np.angle(ratio), 0, rtol=0, atol=1e-4)  # [rad] a map's north: 1.8e-2
    speed = np.abs(np.gradient(position, time))
    npt.assert_allclose(speed, np.abs(velocity), rtol=0, atol=1.5)  # [m/s] 0.1 s steps, braking
    assert np.sqrt(np.mean((speed - np.abs(velocity)) ** 2)) < 0.05  # [m/s]


@pytest.mark.parametrize("name", POSES)
def test_attitudes_are_those_of_a_car(data, name):
    navigation = nav.read_boreas(poses(data, name))
    table = pd.read_csv(poses(data, name))
    time = navigation.time.values
    east, north, up = (table[f"vel_{axis}"].to_numpy() for axis in ("east", "north", "up"))
    speed = np.hypot(east, north)
    moving = speed > 6  # [m/s]
    course = np.unwrap(np.arctan2(north, east))
    slip = np.angle(np.exp(1j * (navigation.yaw.values - course)))[moving]
    # [rad] straight ahead; the rest is the slip of the lidar in bends
    npt.assert_allclose(np.median(slip), 0, rtol=0, atol=2e-3)
    assert np.std(slip) < 0.02
    # nose-down positive: the pitch is minus the slope of the road (and lifts when accelerating)
    slope = up[moving] / speed[moving]
    acceleration = np.gradient(speed, time)[moving]
    terms = np.stack([slope, acceleration, np.ones(slope.size)], axis=-1)
    factor = np.linalg.lstsq(terms, navigation.pitch.values[moving], rcond=None)[0]
    npt.assert_allclose(factor[0], -1, rtol=0, atol=0.03)
    assert factor[1] < 0  # accelerating lifts the nose
    # right-down positive: the body leans out of the bend; roads fall to the right, where one drives
    left = (speed * np.gradient(course, time))[moving]
    bend = np.abs(left) > 1  # [m/s²]
    roll = navigation["roll"].values[moving]
    assert np.polyfit(left[bend], roll[bend], 1)[0] > 0.002  # [rad per m/s²], flattened by noise
    assert 0.005 < np.median(roll[np.abs(left) < 0.2]) < 0.03  # [rad] crossfall


def test_two_drives_in_one_frame_differ_by_the_published_height(data):
    """Second drive less first, nearest poses within 1 m: median -44 mm, 8218 pairs."""
    from scipy.spatial import cKDTree

    reference = (623425.0, 4848821.0, 150.0)
    first, second = (nav.read_boreas(poses(data, name), reference=reference) for name in POSES)
    tree = cKDTree(np.stack([first.east, first.north], axis=-1))
    distance, nearest = tree.query(np.stack([second.east, second.north], axis=-1))
    near = distance < 1
    difference = second.up.values[near] - first.up.values[nearest[near]]
    npt.assert_allclose(near.sum(), 8218, rtol=0, atol=0)
    npt.assert_allclose(np.median(difference), -0.044, rtol=0, atol=0.001)  # [m]


def test_boreas_poses_that_are_damaged(data, tmp_path):
    lines = poses(data, POSES[0]).read_text().splitlines()[:20]
    path = tmp_path / "lidar_poses.csv"
    path.write_text("\n".join(lines)[:-40] + "\n")
    with pytest.raises(FormatError, match=r"line 20: has \d+ of 13 fields"):
        nav.read_boreas(path)
    path.write_text("\n".join([lines[0].replace("heading", "yaw"), *lines[1:]]) + "\n")
    with pytest.raises(FormatError, match="lacks the columns heading"):
        nav.read_boreas(path)
    path.write_text("\n".join([lines[0], lines[2], lines[1]]) + "\n")
    with pytest.raises(SchemaError, match="must run forward, but value 1"):
        nav.read_boreas(path)


# --- tables ---------------------------------------------------------------------------------------


def our_table(count=300):
    rng = np.random.default_rng(5)
    table = {"time": 5.0 + 0.005 * np.arange(count)}
    table |= {name: rng.normal(size=count) for name in ("east", "north", "up")}
    table |= {name: rng.uniform(-0.1, 0.1, count) for name in ("roll", "pitch")}
    table["yaw"] = np.cumsum(rng.uniform(-0.1, 0.2, count))
    table["sd_up"] = rng.uniform(0.01, 0.02, count)
    return pd.DataFrame(table)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_tables_with_default_names_are_read_exactly(tmp_path, ending):
    table = our_table()
    path = tmp_path / f"nav.{ending}"
    table.to_csv(path, index=False) if ending == "csv" else table.to_parquet(path)
    chosen = nav.NavigationColumns(east="east", north="north", up="up", yaw="yaw", sd_up="sd_up")
    navigation = nav.read_columns(path, chosen)
    for name in table:
        npt.assert_array_equal(navigation[name], table[name])
    parts = list(columns.blocks(path, chosen, size=77))
    for name in table:
        joined = np.concatenate([part[name].values for part in parts])
        npt.assert_array_equal(joined, navigation[name])


def test_a_table_of_degrees_equals_the_sbet(tmp_path):
    table = records(50, heading=np.linspace(0, 3, 50), roll=0.01, pitch=0.02)
    truth = nav.read_sbet(sbet_file(tmp_path, table))
    frame = pd.DataFrame(
        {
            "ms": table[:, 0] * 1000,
            "lon": np.rad2deg(table[:, 2]),
            "lat": np.rad2deg(table[:, 1]),
            "h": table[:, 3],
            "r": np.rad2deg(table[:, 7]),
            "p": np.rad2deg(table[:, 8]),
            "hdg": np.rad2deg(table[:, 9]),
        }
    )
    path = tmp_path / "nav.csv"
    frame.to_csv(path, index=False, sep=";")
    chosen = nav.NavigationColumns(
        time="ms",
        time_scale=0.001,
        longitude="lon",
        latitude="lat",
        height="h",
        roll="r",
        pitch="p",
        heading="hdg",
        degrees=True,
    )
    navigation = nav.read_columns(path, chosen)
    npt.assert_allclose(navigation.attrs["origin"], truth.attrs["origin"], rtol=0, atol=1e-12)
    for name in ("east", "north", "up"):
        npt.assert_allclose(navigation[name], truth[name], **POSITION)
    for name in ("roll", "pitch", "yaw"):
        npt.assert_allclose(navigation[name], truth[name], **ANGLE)


def test_heading_without_a_position_becomes_yaw(tmp_path):
    table = our_table(5).rename(columns={"yaw": "heading"})
    path = tmp_path / "nav.csv"
    table.to_csv(path, index=False)
    navigation = nav.read_columns(
        path, nav.NavigationColumns(east="east", north="north", up="up", heading="heading")
    )
    npt.assert_allclose(navigation.pitch, -table.pitch, **ANGLE)
    npt.assert_allclose(navigation.yaw, np.pi / 2 - table.heading, **ANGLE)


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"yaw": "y"}, "must name positions either"),
        ({"east": "e", "north": "n", "yaw": "y"}, "must name positions either"),
        (dict.fromkeys(("east", "north", "up"), "x"), "must name the direction either"),
        (dict.fromkeys(("east", "north", "up", "yaw", "heading"), "x"), "must name the direction"),
        (dict.fromkeys(("east", "north", "up", "yaw"), "x") | {"time": ""}, "time must name"),
        (dict.fromkeys(("east", "north", "up", "yaw"), "x") | {"time_scale": 0.0}, "time_scale"),
    ],
)
def test_columns_must_name_one_convention(chosen, message):
    with pytest.raises(ValueError, match=message):
        nav.NavigationColumns(**chosen)


def test_tables_that_are_damaged(tmp_path):
    path = tmp_path / "nav.csv"
    table = our_table(5)

    def reading(text):
        path.write_text(text)
        return nav.read_columns(path)

    good = table.to_csv(index=False)
    with pytest.raises(FormatError, match=r"header: has no column 'yaw' \(did you mean 'yaww'\?\)"):
        reading(good.replace("yaw", "yaww"))
    lines = good.splitlines()
    with pytest.raises(FormatError, match=r"line 3, column 'time': must be a number, got 'x'"):
        reading("\n".join([*lines[:2], "x" + lines[2][5:], *lines[3:]]))
    with pytest.raises(FormatError, match=r"line 6: has 3 of 8 fields"):
        reading("\n".join([*lines[:5], "1,2,3"]))
    with pytest.raises(FormatError, match="line 3: has 9 of 8 fields"):
        reading("\n".join([*lines[:2], lines[2] + ",1", *lines[3:]]))
    with pytest.raises(FormatError, match="has no rows"):
        reading(lines[0])
    with pytest.raises(FormatError, match="is empty"):
        reading("")
    with pytest.raises(FormatError, match="begins with numbers"):
        reading("\n".join(lines[1:]))
    with pytest.raises(SchemaError, match=r"row 2, column 'time': must be finite.*got nan"):
        reading("\n".join([*lines[:2], lines[2][lines[2].index(",") :], *lines[3:]]))
    with pytest.raises(SchemaError, match="must run forward"):
        reading("\n".join([lines[0], lines[2], lines[1]]))
    table["roll"] = 20.0
    with pytest.raises(
        SchemaError, match=r"row 1, column 'roll': must be within a quarter .*degrees = true"
    ):
        reading(table.to_csv(index=False))
    path.write_bytes(b"a\0b,c\n")
    with pytest.raises(FormatError, match="is binary"):
        nav.read_columns(path)


def test_names_of_columns_in_latin_1(tmp_path):
    table = our_table(5)
    path = tmp_path / "nav.csv"
    path.write_bytes(table.rename(columns={"up": "Höhe"}).to_csv(index=False).encode("latin-1"))
    found = nav.read_columns(
        path, nav.NavigationColumns(east="east", north="north", up="Höhe", yaw="yaw")
    )
    npt.assert_array_equal(found.up, table["up"])


def test_parquet_that_is_damaged(tmp_path):
    path = tmp_path / "nav.parquet"
    table = our_table(5)
    table["yaw"] = "north"
    table.to_parquet(path)
    with pytest.raises(FormatError, match="column 'yaw': must hold numbers"):
        nav.read_columns(path)
    our_table(5).to_parquet(path)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(FormatError, match="is damaged or cut off"):
        nav.read_columns(path)


def test_parquet_without_pyarrow(tmp_path, monkeypatch):
    path = tmp_path / "nav.parquet"
    our_table(5).to_parquet(path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(TrueTerrainError, match=r"needs the package pyarrow. Install it"):
        nav.read_columns(path)


def test_a_latitude_beyond_the_pole(tmp_path):
    path = tmp_path / "nav.csv"
    frame = our_table(5).rename(columns={"east": "longitude", "north": "latitude", "up": "height"})
    frame["latitude"] = [1.0, 2.0, 95.0, 3.0, 4.0]
    frame.to_csv(path, index=False)
    chosen = nav.NavigationColumns(
        longitude="longitude", latitude="latitude", height="height", yaw="yaw"
    )
    with pytest.raises(SchemaError, match=r"row 3, column 'latitude': must be within 90 deg"):
        nav.read_columns(path, chosen)


# --- schema ---------------------------------------------------------------------------------------


def test_schema_of_navigation():
    good = nav.read_columns.__module__  # imported lazily, from its own module
    assert good == "trueterrain.formats.navigation.columns"
    still = dict.fromkeys(POSE_NAMES, (0.0, 0.0, 0.0))
    data = nav.make_navigation({"time": [0.0, 1.0, 2.0], **still})
    with pytest.raises(SchemaError, match="variable yaw: is missing"):
        nav.check_navigation(data.drop_vars("yaw"))
    with pytest.raises(SchemaError, match=r"variable sd_yaww: is unknown \(did you mean 'sd_yaw'"):
        nav.check_navigation(data.rename(roll="sd_yaww"))
    with pytest.raises(SchemaError, match=r"must have the dimensions \(epoch\), got \(scan\)"):
        nav.check_navigation(data.rename(epoch="scan"))
    with pytest.raises(SchemaError, match="must be in m, got units 'ft'"):
        nav.check_navigation(data.assign(up=data.up.assign_attrs(units="ft")))
    bad = data.copy(deep=True)
    bad.north[1] = np.nan
    rolled = data.assign(roll=data["roll"] + 20)
    rolled["roll"].attrs["units"] = "rad"
    with pytest.raises(SchemaError, match=r"roll: must lie within a quarter .*Convert degrees"):
        nav.check_navigation(rolled)
    with pytest.raises(
        SchemaError, match=r"variable north: .*got nan at index 1 \(time 1.000000 s\)"
    ):
        nav.check_navigation(bad)
    bad = data.assign(sd_up=("epoch", [1.0, -1.0, -2.0], {"units": "m"}))
    with pytest.raises(SchemaError, match=r"sd_up: must not be negative, got -1 .*and 1 more"):
        nav.check_navigation(bad)


def test_unknown_names_of_the_package():
    with pytest.raises(AttributeError, match="read_span"):
        _ = nav.read_span
