"""Recorded runs against scipy: where their beams end, and what their truth says.

Every ready scene in which something moves is driven for some tenths of a second, with a scanner
without noise that is mounted askew, and with clocks that are wrong. Poses are worked out here from
the knots in ``truth/body`` by `scipy.interpolate.BPoly` and `scipy.spatial.transform.Rotation`,
and the ground from its nodes by `scipy.interpolate.RegularGridInterpolator`.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.testing as npt
import pytest
import xarray as xr
from scipy.interpolate import BPoly, RegularGridInterpolator
from scipy.spatial.transform import Rotation

from trueterrain.formats.run import Mounting, check_run, open_run
from trueterrain.simulate.accelerometers import Accelerometers, sensor_triangle
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.raster import Raster
from trueterrain.simulate.scanner import Scanner
from trueterrain.simulate.scene import Scene, ScenePass, Stage, read_scene, set_stage
from trueterrain.surface import heights_at, node_coordinates

pytestmark = pytest.mark.slow

COMPONENTS = ("east", "north", "up", "roll", "pitch", "yaw")
LEAD = 0.1  # [s] that the other instruments record before the first scan

ON_GROUND = 1e-6  # [m] along the beam: errors of ranges are kept in steps of 1 um
STORED = 0.5e-4 + 1e-6  # [m] half a step of the stored ranges
POSE = 1e-9  # [m], [rad] round-off of a quintic at 100 m
TIME = 1e-12  # [s] round-off
FORCE = 1e-5  # [m/s^2] round-off of a second derivative between knots 0.5 ms apart at 100 m
READING = 1e-9  # [m/s^2] round-off

NOISE_FREE = Scanner(
    range_noise=0.0, intensity_noise=0.0, floor=0.0, saturation_bias=0.0, dropouts=0.0, spot_rays=1
)
ASKEW = Mounting(
    scanner_position=(-2.1, 0.12, 1.15), scanner_rotation=(0.03, -0.04, 0.06), scanner_clock=0.0037
)
NAVIGATION = Navigation(clock_offset=0.0042, clock_rate=-5e-4)
ACCELEROMETERS = Accelerometers(
    positions=sensor_triangle((-2.1, 0.12, 1.15), 0.5),
    noise_density=0.0,
    filter_order=0,
    scale_sd=0.01,
    tilt_sd=0.02,
    clock_offset=-0.0021,
    clock_rate=3e-4,
)


def stretch(name: str, *drives: dict[str, Any], **changes: Any) -> Scene:
    """Parts of the passes of a ready scene, recorded without noise."""
    scene, _ = read_scene(name)
    passes = tuple(replace(drive, **how) for drive, how in zip(scene.passes, drives, strict=True))
    few_waves = tuple(
        {**table, "waves": 200} if "waves" in table else table for table in scene.ground
    )
    return replace(
        scene,
        passes=passes,
        ground=few_waves,
        **{
            "scanner": NOISE_FREE,
            "mounting": ASKEW,
            "navigation": NAVIGATION,
            "accelerometers": ACCELEROMETERS,
        }
        | changes,
    )


def oval() -> Scene:
    """Into a curve with inward lean, and against the course through its middle."""
    scene = stretch("oval", {}, raster=0.02)
    into = ScenePass(name="into", start=58.0, length=4.0, speed=scene.passes[0].speed)
    back = ScenePass(
        name="back",
        start=100.0,
        length=3.0,
        lane=-1.5,
        reverse=True,
        speed={"kind": "ramp", "begin": 8.0, "end": 10.0, "distance": 3.0},
    )
    return replace(scene, passes=(into, back))


def over_the_plate(name: str) -> Scene:
    """While the scanner is over the plate, which is behind the body."""
    (plate,) = (table for table in read_scene(name)[0].ground if table["kind"] == "plate")
    return stretch(name, {"start": plate["east"] + 1.2, "length": 1.9})


def bounce() -> Scene:
    """Bounced, with the scanner's own clock error, and turned against the axes of the raster."""
    scene = stretch("bounce", {})
    standing = replace(scene.passes[0].standing, duration=0.4, yaw=0.6, east=3.0, north=-2.0)
    return replace(scene, passes=(replace(scene.passes[0], standing=standing),))


SCENES = {
    "kerb": lambda: stretch("kerb", {"start": 11.6, "length": 1.2}),
    "belgian-two-lanes": lambda: stretch(
        "belgian-two-lanes", {"start": 20.0, "length": 1.7}, {"start": 24.0, "length": 1.7}
    ),
    "highway-two-lanes": lambda: stretch(
        "highway-two-lanes",
        {"start": 60.0, "length": 6.0},
        {"start": 150.0, "length": 6.0},
        raster=0.02,
    ),
    "three-lanes": lambda: stretch(
        "three-lanes", *({"start": 30.0, "length": 3.0},) * 3, raster=0.02
    ),
    "oval": oval,
    "dynamic-plate": lambda: over_the_plate("dynamic-plate"),
    "dynamic-plate-excited": lambda: over_the_plate("dynamic-plate-excited"),
    "bounce": bounce,
    "boresight": lambda: stretch(
        "boresight",
        {"start": 11.6, "length": 1.6},
        {"start": 13.4, "length": 1.6},
        mounting=read_scene("boresight")[0].mounting,
    ),
}


@dataclass(frozen=True)
class Recorded:
    """A recorded pass, and its motion in scipy's hands."""

    stage: Stage
    run: xr.DataTree
    motion: BPoly

    @property
    def mounting(self) -> Mounting:
        """The true one."""
        return self.stage.scene.mounting

    def pose(self, time: np.ndarray, order: int = 0) -> np.ndarray:
        """Components of the pose, or a derivative of them, shape (n, 6)."""
        assert self.motion.x[0] <= time.min()
        assert time.max() <= self.motion.x[-1]
        return (self.motion.derivative(order) if order else self.motion)(time)


@pytest.fixture(scope="module", params=SCENES)
def passes(request, recorded_scene) -> list[Recorded]:
    scene = SCENES[request.param]()
    stage = set_stage(scene)
    runs = recorded_scene(scene)
    return [Recorded(stage, check_run(open_run(run), run), motion_of(run)) for run in runs]


def motion_of(path) -> BPoly:
    """The quintics through value, rate and acceleration of the knots."""
    body = open_run(path)["truth/body"].to_dataset().load()
    derivatives = np.stack(
        [
            np.stack([body[name + what].values for name in COMPONENTS], axis=1)
            for what in ("", "_rate", "_acceleration")
        ],
        axis=1,
    )
    return BPoly.from_derivatives(body["time"].values, derivatives)


def turned(angles: np.ndarray) -> Rotation:
    """From roll, pitch and yaw: Rz(yaw) Ry(pitch) Rx(roll)."""
    return Rotation.from_euler("ZYX", np.asarray(angles)[..., ::-1])


def rays(recorded: Recorded) -> tuple[np.ndarray, np.ndarray]:
    """Begin and direction of all beams, each of shape (n, 3), georeferenced with scipy alone."""
    scans, mounting = recorded.run["scans"], recorded.mounting
    time = scans["time"].values[:, None] + scans["delay"].values + mounting.scanner_clock
    angle = np.broadcast_to(scans["angle"].values, time.shape).ravel()
    beam = np.stack([np.zeros(angle.size), np.sin(angle), -np.cos(angle)], axis=1)
    pose = recorded.pose(time.ravel())
    body = turned(pose[:, 3:])
    begin = pose[:, :3] + body.apply(mounting.scanner_position)
    return begin, body.apply(turned(mounting.scanner_rotation).apply(beam))


def exact_ranges(run: xr.DataTree) -> np.ndarray:
    """Recorded ranges less their errors, free of their rounding when stored."""
    stored = run["scans/range"].values
    quantum = NOISE_FREE.quantum  # the scanner iterations to the same step as the store
    npt.assert_allclose(stored, np.rint(stored / quantum) * quantum, rtol=0, atol=1e-12)
    return stored - run["truth/returns/range_error"].values


def ground_under(recorded: Recorded, *points: np.ndarray) -> RegularGridInterpolator:
    """The true ground: bilinear between nodes at whole multiples of the spacing."""
    spacing = recorded.stage.scene.raster
    xy = np.concatenate([part[:, :2] for part in points])
    low = np.floor(xy.min(axis=0) / spacing).astype(int)
    high = np.ceil(xy.max(axis=0) / spacing).astype(int)
    east, north = (np.arange(a, b + 1) * spacing for a, b in zip(low, high, strict=True))
    nodes = recorded.stage.ground.height(east[:, None], north)
    return RegularGridInterpolator((east, north), nodes, method="linear")


def test_points_lie_on_the_ground(passes):
    """A little nearer a beam is above the ground, a little further it is below."""
    for recorded in passes:
        begin, direction = rays(recorded)
        true = exact_ranges(recorded.run).ravel()[:, None]
        assert np.isfinite(true).all()
        assert true.size >= 300 * 940
        nearer, further = (begin + (true + d) * direction for d in (-ON_GROUND, ON_GROUND))
        ground = ground_under(recorded, nearer, further)
        assert (nearer[:, 2] > ground(nearer[:, :2])).all()
        assert (further[:, 2] < ground(further[:, :2])).all()
        stored = recorded.run["scans/range"].values.ravel()
        npt.assert_allclose(stored, true[:, 0], rtol=0, atol=STORED)


def test_poses_of_the_scanner_are_those_of_scipy(passes):
    for recorded in passes:
        truth = recorded.run["truth/scanner"]
        time = truth["time"].values
        stamp = recorded.run["scans/time"].values
        npt.assert_allclose(time, stamp + recorded.mounting.scanner_clock, rtol=0, atol=TIME)
        pose = recorded.pose(time)
        body = turned(pose[:, 3:])
        position = pose[:, :3] + body.apply(recorded.mounting.scanner_position)
        found = np.stack([truth[name].values for name in COMPONENTS], axis=1)
        npt.assert_allclose(found[:, :3], position, rtol=0, atol=POSE)
        rotation = body * turned(recorded.mounting.scanner_rotation)
        npt.assert_allclose(
            turned(found[:, 3:]).as_matrix(), rotation.as_matrix(), rtol=0, atol=POSE
        )


def test_errors_of_the_navigation_are_recorded_less_true(passes):
    for recorded in passes:
        navigation, truth = recorded.run["navigation"], recorded.run["truth/navigation"]
        stamp = navigation["time"].values
        clock = NAVIGATION.clock_offset + NAVIGATION.clock_rate * (stamp + LEAD)
        time = truth["true_time"].values
        npt.assert_allclose(time, stamp + clock, rtol=0, atol=TIME)
        pose = recorded.pose(time)
        largest = 0.0
        for number, name in enumerate(COMPONENTS):
            error = truth[f"error_{name}"].values
            npt.assert_allclose(navigation[name].values - error, pose[:, number], rtol=0, atol=POSE)
            largest = max(largest, np.abs(error).max())
        assert largest > 1e-3  # [m] there was something to be tested
        scans = recorded.run["truth/scanner/time"].values  # all with navigation around them
        assert time[0] < scans[0]
        assert scans[-1] + 0.001 < time[-1]


def test_accelerometers_measure_the_second_derivative_of_their_position(passes):
    for recorded in passes:
        group, truth = recorded.run["accelerometers"], recorded.run["truth/accelerometers"]
        stamp, time = group["time"].values, truth["true_time"].values
        clock = ACCELEROMETERS.clock_offset + ACCELEROMETERS.clock_rate * (stamp + LEAD)
        npt.assert_allclose(time, stamp + clock, rtol=0, atol=TIME)
        axis, position = truth["axis"].values, group["position"].values
        npt.assert_allclose(np.linalg.norm(axis, axis=1), 1.0, rtol=0, atol=1e-12)
        assert (np.abs(axis - [0, 0, 1]).max(axis=1) > 1e-3).all()  # tilted, all of them
        rotation, second = rotation_and_second_derivative(recorded, time)
        felt = recorded.pose(time, 2)[:, :3] + [0.0, 0.0, ACCELEROMETERS.gravity]
        felt = felt[:, None, :] + np.einsum("tij,sj->tsi", second, position)
        along = np.einsum("tji,tsj,si->ts", rotation, felt, axis)
        force = truth["specific_force"].values
        npt.assert_allclose(force, along, rtol=0, atol=FORCE)
        # without noise and filter, scale and bias are all that is wrong
        reading = (1.0 + truth["scale_error"].values) * force + truth["bias"].values
        npt.assert_allclose(group["acceleration"].values, reading, rtol=0, atol=READING)


def rotation_and_second_derivative(recorded, time):
    """Matrix from the body to the ground, and how it accelerates, by the product rule."""
    angle, rate, acceleration = (recorded.pose(time, order)[:, 3:] for order in range(3))
    parts = []
    for n in range(3):
        axis = np.eye(3)[n]
        generator = np.cross(axis, np.eye(3), axisb=1).T  # its product with v is axis x v
        value = Rotation.from_rotvec(angle[:, n, None] * axis).as_matrix()
        first = rate[:, n, None, None] * generator @ value
        second = acceleration[:, n, None, None] * generator
        second = (second + rate[:, n, None, None] ** 2 * generator @ generator) @ value
        parts.append((value, first, second))
    (x, dx, ddx), (y, dy, ddy), (z, dz, ddz) = parts
    second = ddz @ y @ x + z @ ddy @ x + z @ y @ ddx
    return z @ y @ x, second + 2.0 * (dz @ dy @ x + dz @ y @ dx + z @ dy @ dx)


def test_the_true_ground_is_the_raster_at_its_nodes_and_lies_under_the_scans(passes):
    for recorded in passes:
        ground = recorded.run["truth/ground"].to_dataset().load()
        east, north = node_coordinates(ground)
        raster = Raster(recorded.stage.ground, spacing=recorded.stage.scene.raster)
        some = slice(None, None, 3)
        truth = raster.height(east[some, some], north[some, some])
        npt.assert_allclose(ground["height"].values[some, some], truth, rtol=0, atol=POSE)
        npt.assert_allclose(np.diff(ground["u"]), recorded.stage.scene.truth.spacing, atol=1e-9)
        begin, direction = rays(recorded)
        point = begin + exact_ranges(recorded.run).reshape(-1, 1) * direction
        assert np.isfinite(heights_at(ground, *point[::11, :2].T)).all()


def test_without_noise_only_rounding_is_wrong_with_a_range(passes):
    for recorded in passes:
        error = recorded.run["truth/returns/range_error"].values
        quantum = NOISE_FREE.quantum
        assert np.abs(error).max() <= 0.5 * quantum + 1e-6
        # uniform over a step, but beams that lie close together have correlated errors
        npt.assert_allclose(error.std(), quantum / np.sqrt(12), rtol=0, atol=0.05 * quantum)


def test_a_run_states_the_declared_mounting_while_the_truth_has_the_true_one(passes):
    for recorded in passes:
        scene = recorded.stage.scene
        true = replace(scene.mounting, accelerometer_clock=ACCELEROMETERS.clock_offset)
        stated = Mounting.from_attrs(recorded.run.attrs["mounting"])
        assert stated == (scene.declared or true)
        assert Mounting.from_attrs(recorded.run["truth/scanner"].attrs["mounting"]) == true
        assert (stated != true) == (scene.name in ("boresight", "bounce"))
