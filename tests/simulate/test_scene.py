"""Scenes: the ready ones, their templates, what they show, and scenes that make no sense."""

import dataclasses
import math
import tomllib
from dataclasses import replace

import numpy as np
import numpy.testing as npt
import pytest

from trueterrain.core.errors import FormatError
from trueterrain.formats.run import Mounting, check_run, open_run
from trueterrain.simulate.accelerometers import sensor_triangle
from trueterrain.simulate.body import BodyMotion, Follower
from trueterrain.simulate.rotation import body_to_ground
from trueterrain.simulate.scene import (
    CalibrationPlate,
    Scene,
    ScenePass,
    Standing,
    Vehicle,
    read_scene,
    record_scene,
    scene_names,
    scene_template,
    set_stage,
)
from trueterrain.simulate.scene._scene import LASER
from trueterrain.vehicle import GOLDEN_QUARTER_CAR, named_vehicle

ROUND_OFF = 1e-9  # [m], [s]

READY = [
    "belgian-two-lanes",
    "boresight",
    "bounce",
    "dynamic-plate",
    "dynamic-plate-excited",
    "highway-two-lanes",
    "kerb",
    "oval",
    "static-plate",
    "thesis-excited",
    "thesis-smooth",
    "thesis-static",
    "three-lanes",
]


def stage_of(name):
    scene, path = read_scene(name)
    return set_stage(scene, path=path)


def few_waves(scene):
    """Ground of a scene, coarser, to save time."""
    return tuple({**layer, "waves": 100} if "waves" in layer else layer for layer in scene.ground)


def laser(stage, drive, *, step=0.01):
    """Time, body and laser along a pass, shapes (n,), (n, 6) and (n, 3)."""
    motion = stage.motion(drive)
    time = np.arange(0.0, motion.duration, step)
    pose = motion.knots(0.0, motion.duration).at(time)[0]
    lever = np.array(stage.scene.mounting.scanner_position)
    return time, pose, pose[:, :3] + body_to_ground(pose[:, 3:]) @ lever


def written(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text('name = "s"\n' + text + "\n")
    return path


def staged(path):
    """As far as a scene goes before it is driven."""
    scene, path = read_scene(path)
    stage = set_stage(scene, path=path)
    return [stage.motion(drive) for drive in scene.passes]


# --- ready scenes ---------------------------------------------------------------------------------


def test_the_ready_scenes_are_there():
    assert scene_names() == READY


@pytest.mark.parametrize("name", READY)
def test_a_ready_scene_is_named_as_its_file_and_has_a_title(name):
    scene, path = read_scene(name)
    assert scene.name == name
    assert scene.title
    text = path.read_text()
    assert text.startswith("# ")
    assert len(text.splitlines()) < 30
    assert "schema" not in tomllib.loads(text)


@pytest.mark.slow
@pytest.mark.parametrize("name", READY)
def test_a_ready_scene_records_a_run_that_obeys_all_rules(name, tmp_path):
    """Shortened: the first metre, or 0.3 s, few beams, and few waves of a coarse road."""
    scene, path = read_scene(name)
    passes = tuple(
        replace(drive, length=1.0)
        if drive.standing is None
        else replace(drive, standing=replace(drive.standing, duration=0.3))
        for drive in scene.passes
    )
    short = replace(
        scene,
        passes=passes,
        ground=few_waves(scene),
        raster=max(scene.raster, 0.02),
        scanner=replace(scene.scanner, beams=60, spot_rays=1),
    )
    targets = record_scene(short, tmp_path, path=path)
    assert [target.name for target in targets] == [f"{name}-{d.name}.zarr" for d in passes]
    for target, drive in zip(targets, passes, strict=True):
        run = check_run(open_run(target), target)
        assert run.attrs["name"] == f"{name}-{drive.name}"
        scans = run["scans"]
        speed = drive.speed["speed"]
        seconds = drive.standing.duration if drive.standing else 1.0 / speed
        assert abs(scans.sizes["scan"] - 1000 * seconds) <= 1
        assert np.isfinite(scans["range"].values).mean() > 0.9
        assert set(run["truth"].children) >= {"body", "scanner", "ground", "navigation"}


@pytest.mark.parametrize("name", ["belgian-two-lanes", "highway-two-lanes", "three-lanes"])
def test_lanes_overlap_by_half_a_metre(name):
    scene, _ = read_scene(name)
    lanes = sorted(drive.lane for drive in scene.passes)
    npt.assert_allclose(scene.scanner.swath - np.diff(lanes), 0.5, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize(("name", "cleats"), [("static-plate", 3), ("thesis-static", 2)])
def test_the_static_plate_lies_under_the_laser_and_across_the_scan(name, cleats):
    stage = stage_of(name)
    (drive,) = stage.scene.passes
    _, pose, place = laser(stage, drive, step=1.0)
    (layer,) = stage.scene.ground
    plate = CalibrationPlate(**{key: value for key, value in layer.items() if key != "kind"})
    npt.assert_allclose(place[0, 1], plate.north, rtol=0, atol=ROUND_OFF)
    half = 0.5 * stage.scene.scanner.swath
    across = place[0, 0] + np.linspace(-half, half, 4001)  # the scan is along east
    height = stage.ground.height(across, np.full(across.size, place[0, 1]))
    tops = across[height > plate.thickness + 0.5 * plate.rise]
    assert np.count_nonzero(np.diff(tops) > 0.1) == cleats - 1
    bright = stage.scene.reflectivity.at(across, np.zeros(across.size)) > 0.5
    assert bright.any()
    assert not (bright & (height > plate.thickness + 1e-6)).any()  # stripes are beside the cleats
    wheels = pose[0, :2] + named_vehicle("van").wheel_positions @ [[0, 1], [-1, 0]]  # faces north
    assert (np.abs(wheels - [plate.east, plate.north]).max(axis=1) > 0.5 * plate.width + 0.2).all()


@pytest.mark.parametrize(
    "name", ["dynamic-plate", "dynamic-plate-excited", "thesis-smooth", "thesis-excited"]
)
def test_the_plate_lies_between_the_wheels_and_is_seen_whole(name):
    stage = stage_of(name)
    drive = stage.scene.passes[0]
    plate = next(layer for layer in stage.scene.ground if layer["kind"] == "plate")
    car = stage.scene.vehicle.car
    inner = 0.5 * min(car.front_track, car.rear_track) - 0.5 * stage.scene.vehicle.tyre.patch_width
    assert 0.5 * plate["width"] + 0.1 < inner
    _, _, place = laser(stage, drive)
    assert place[0, 0] < plate["east"] - 2.0
    assert place[-1, 0] > plate["east"] + 2.0
    npt.assert_allclose(place[:, 2].mean(), stage.scene.scanner.nominal_height, rtol=0, atol=0.05)


def test_only_among_events_the_body_swings_and_the_wheels_hop_over_the_plate():
    swings = {}
    for name in ("dynamic-plate", "dynamic-plate-excited"):
        stage = stage_of(name)
        (drive,) = stage.scene.passes
        plate = next(layer for layer in stage.scene.ground if layer["kind"] == "plate")
        time, _, place = laser(stage, drive, step=0.002)
        over = np.abs(place[:, 0] - plate["east"]) < 0.6
        wheels = stage.motion(drive).wheel_heights(time[over])
        swings[name] = np.ptp(place[over, 2]), np.ptp(wheels)
    assert swings["dynamic-plate"] == (0.0, 0.0)
    laser_swing, wheel_swing = swings["dynamic-plate-excited"]
    assert 0.01 < laser_swing < 0.1  # [m] the laser's own; of the whole event 40 to 140 mm
    npt.assert_allclose(wheel_swing, 0.038, rtol=0, atol=1e-6)  # [m] wheels roll over cleats


def test_the_events_leave_the_plate_free():
    stage = stage_of("dynamic-plate-excited")
    plate = next(layer for layer in stage.scene.ground if layer["kind"] == "plate")
    both = np.array([-0.62, 0.62]) + plate["east"]
    npt.assert_array_equal(stage.ground.height(both, [0.0, 0.0]), 0.0)
    cleats = stage.ground.height(np.linspace(0.0, 22.0, 22001), np.full(22001, 1.5))
    assert np.count_nonzero(np.diff(cleats > 0.03, prepend=False).astype(int)) == 2 * 15
    assert np.flatnonzero(cleats).max() * 0.001 > plate["east"] + 0.6


@pytest.mark.slow
def test_the_laps_of_the_oval_overlap_and_lean_inwards():
    scene, _ = read_scene("oval")
    stage = set_stage(replace(scene, ground=few_waves(scene)))
    (drive,) = stage.scene.passes
    assert stage.course.closed
    assert 10.0 < drive.length - stage.course.length < 20.0
    _, pose, place = laser(stage, drive, step=0.05)
    gap = np.hypot(*(place[-1, :2] - place[:80, :2]).T).min()
    assert gap < 0.3  # [m] the second lap is on the first one
    (speed,) = {drive.speed["speed"]}
    assert speed**2 / 25.0 < 3.0  # [m/s^2] sideways, as a car drives
    curve = stage.course.at([60.0], [0.0])
    x, y = curve.position[0]
    normal = np.array([-math.sin(curve.heading[0]), math.cos(curve.heading[0])])
    left, right = (stage.ground.height(*(np.array([x, y]) + v * normal)) for v in (1.5, -1.5))
    npt.assert_allclose((right - left) / 3.0, 0.05, rtol=0, atol=0.01)  # roughness of class B
    assert pose[:, 3].min() < -0.03  # the car leans inwards, to its left


@pytest.mark.slow
def test_boresight_passes_cross_the_steps_in_both_directions():
    stage = stage_of("boresight")
    there, back = (laser(stage, drive) for drive in stage.scene.passes)
    assert there[1][0, 5] == 0.0
    npt.assert_allclose(back[1][0, 5], math.pi, rtol=0, atol=ROUND_OFF)
    for _, _, place in (there, back):
        east = place[:, 0]
        assert east.min() < 9.0  # the straight step is at 10 m, the oblique one from 16 to 18.2 m
        assert east.max() > 20.0
    assert stage.scene.declared == Mounting(scanner_position=LASER)
    assert stage.scene.mounting.scanner_rotation != (0.0, 0.0, 0.0)


def test_the_bounced_run_does_not_know_its_clocks():
    scene, _ = read_scene("bounce")
    assert scene.mounting.scanner_position == LASER
    assert scene.mounting.scanner_clock == 0.0013
    assert scene.accelerometers.clock_offset == -0.0007
    assert scene.accelerometers.positions == sensor_triangle(LASER, 0.5)
    assert scene.declared == Mounting(scanner_position=LASER)


def test_the_laser_sees_the_kerb_and_the_body_falls_by_it():
    stage = stage_of("kerb")
    (drive,) = stage.scene.passes
    _, pose, place = laser(stage, drive)
    assert place[0, 0] < 10.0 < place[-1, 0]
    npt.assert_allclose(pose[0, 2] - pose[-1, 2], 0.12, rtol=0, atol=1e-4)  # [m] at rest again


# --- templates ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", READY)
def test_the_template_of_a_ready_scene_is_that_scene(name, tmp_path):
    scene, _ = read_scene(name)
    path = tmp_path / "scene.toml"
    path.write_text(scene_template(scene))
    assert read_scene(path)[0] == scene


def test_the_template_of_the_default_is_the_default(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(scene_template())
    assert read_scene(path)[0] == Scene(name="scene")
    for word in ("waypoints", "stop-and-go", "belgian-block", "crg", "sprung_mass", "[m/s]"):
        assert word in path.read_text()


def test_missing_keys_of_a_table_have_their_defaults(tmp_path):
    scene, _ = read_scene(
        written(
            tmp_path, "mounting = { scanner_clock = 0.001 }\naccelerometers = { rate = 1000.0 }"
        )
    )
    assert scene.mounting == Mounting(scanner_position=LASER, scanner_clock=0.001)
    assert scene.accelerometers.positions == sensor_triangle(LASER, 0.5)


# --- vehicles -------------------------------------------------------------------------------------


def test_a_vehicle_with_parameters_of_its_own():
    van = named_vehicle("van")
    own = Vehicle(model="van", parameters={"sprung_mass": 1500.0, "cg_height": 0.9})
    assert own.car == replace(van, sprung_mass=1500.0, cg_height=0.9)
    assert Vehicle(model="van").car == van
    quarter = Vehicle(model="quarter car", parameters={"tyre_damping": 10.0})
    assert quarter.car == replace(GOLDEN_QUARTER_CAR, tyre_damping=10.0)
    assert Vehicle(model="rigid").car is None


def test_all_parameters_of_a_vehicle_can_be_given(tmp_path):
    values = dataclasses.asdict(named_vehicle("sedan"))
    table = ", ".join(f"{name} = {value!r}" for name, value in values.items())
    scene, _ = read_scene(written(tmp_path, f"vehicle = {{ parameters = {{ {table} }} }}"))
    assert scene.vehicle.car == named_vehicle("sedan")


def test_vehicles_move_as_what_they_are():
    straight = {"kind": "straight", "length": 10.0}
    drive = ScenePass(name="a")
    for vehicle, kind in (
        (Vehicle(model="rigid", height=0.5, pitch=0.01), Follower),
        (Vehicle(model="quarter car", height=0.7), BodyMotion),
        (Vehicle(model="sedan", parameters={"cg_height": 0.7}), BodyMotion),
    ):
        scene = Scene(
            name="s", course=straight, ground=({"kind": "plane"},), passes=(drive,), vehicle=vehicle
        )
        motion = set_stage(scene).motion(drive)
        assert isinstance(motion, kind)
        up = motion.knots(0.0, 1.0).at([0.5])[0][0, 2]
        npt.assert_allclose(up, 0.5 if kind is Follower else 0.7, rtol=0, atol=ROUND_OFF)


def test_parked_bodies_stand_on_the_ground():
    drive = ScenePass(name="a", standing=Standing(duration=1.0, east=3.0))
    for vehicle in (Vehicle(model="rigid", height=0.9), Vehicle(parameters={"cg_height": 0.9})):
        scene = Scene(
            name="s",
            ground=({"kind": "plane", "elevation": 2.0},),
            passes=(drive,),
            vehicle=vehicle,
        )
        pose = set_stage(scene).motion(drive).knots(0.0, 1.0).pose[0]
        npt.assert_allclose(pose, [3.0, 0, 2.9, 0, 0, 0], rtol=0, atol=ROUND_OFF)


# --- scenes that make no sense --------------------------------------------------------------------

BAD = {
    "rastre = 1": r"rastre: is unknown \(did you mean 'raster'\?\)",
    "scanner = { beems = 3 }": r"scanner\.beems: is unknown \(did you mean 'beams'\?\)",
    "scanner = { beams = 1 }": r"scanner: beams must be at least 2, got 1",
    "scanner = { spot_rays = -1 }": r"spot_rays must be odd and at least 1, got -1",
    "scanner = { saturation_bias = nan }": r"scanner\.saturation_bias must be finite, got nan",
    "scanner = { rate = inf }": r"scanner\.rate must be finite, got inf",
    "reflectivity = { direction = nan }": r"reflectivity\.direction must be finite, got nan",
    "raster = -0.005": r"raster must be at least 0 m, got -0\.005",
    "raster = nan": r"raster must be at least 0 m, got nan",
    "raster = inf": r"raster must be at least 0 m, got inf",
    'raster = "fine"': r'raster: must be a valid number, got "fine"',
    "seed = -1": r"seed must be at least 0, got -1",
    "seed = 1.5": r"seed: must be a valid integer, got 1\.5",
    "origin = [11.0, 148.0, 0.0]": r"a latitude within 90 deg, got 11 and 148",
    'course = "straight"': r'course: must be a table, got "straight"',
    "course = { length = 5.0 }": r"course: kind is missing \(known are straight, arc,",
    'course = { kind = "oval" }': r"course: straight: is missing; radius: is missing",
    'course = { kind = "waypoints", points = [[0.0, 0.0]] }': r"course: points must be at least 2 pairs",
    'course = { kind = "waypoints", points = [[0.0, 0.0], [nan, 0.0]] }': r"course: points must be finite",
    "ground = []": r"ground is missing: it must have at least one layer",
    'ground = { kind = "plane" }': r"ground: must be a valid array, got a table",
    'ground = [{ kind = "plan" }]': r"ground 1: kind 'plan' is unknown \(did you mean 'plane'\?\)",
    'ground = [{ kind = "plane" }, { kind = "plane", slop = 1 }]': r"ground 2: slop: is unknown \(did you mean 'slope'\?\)",
    'ground = [{ kind = "plane", slope = nan }]': r"ground 1: slope must be finite, got nan",
    'ground = [{ kind = "stones", seed = -3 }]': r"ground 1: seed must be at least 0",
    'ground = [{ kind = "plate", length = 0.5 }]': r"ground 1: length must fit the 3 cleats, which need 0\.684 m, got 0\.5 m",
    'ground = [{ kind = "plate", pitch = 0.05 }]': r"ground 1: pitch must be at least the cleat of 0\.076 m, got 0\.05 m",
    'ground = [{ kind = "plate", cleats = [] }]': r"ground 1: cleats must hold at least one",
    'ground = [{ kind = "plate", thickness = -0.1 }]': r"thickness must be at least 0 m, got -0\.1",
    'ground = [{ kind = "plate", rise = nan }]': r"rise must be greater than 0 m, got nan",
    'ground = [{ kind = "plate", north = inf }]': r"north must be finite, got inf",
    'ground = [{ kind = "crg", file = "none.crg" }]': r"ground 1: .*none\.crg: does not exist",
    'ground = [{ kind = "crg", file = "damaged.crg" }]': r"ground 1: .*damaged\.crg: line 1: the header has no end",
    'ground = [{ kind = "crg", file = "damaged.crg", mirored = true }]': r"mirored: is unknown \(did you mean 'mirrored'\?\)",
    'ground = [{ kind = "crg", file = "good.crg", part_u = [0.0, 99.0] }]': r"part_u must be two ascending values from 0\.0 to",
    'ground = [{ kind = "crg" }]': r"ground 1: file: is missing",
    "road = { slope = nan }": r"road: slope must be finite, got nan",
    "road = { superelevation = -0.1 }": r"road: superelevation must be at least 0 m/m, got -0\.1",
    "road = { superelevation = 0.1, banking = 0.1 }": r"banking and superelevation exclude each",
    'course = { kind = "stretches", parts = [{ length = 9.0 }, { length = 9.0, begin = 0.1 }] }\n'
    "road = { superelevation = 0.1 }": r"road: course must have clothoids between straights",
    'course = { kind = "oval", straight = 9.0, radius = 9.0, transition = 9.0 }\n'
    "road = { slope = 0.1 }": r"road: slope must be 0 on a closed course",
    "passes = []": r"passes are missing",
    "passes = 3": r"passes: must be a valid array, got 3",
    "passes = [{ lane = 1.0 }]": r"passes\.0\.name: is missing",
    'passes = [{ name = "a" }, { name = "b" }, { name = "a" }]': r"names that differ, got 'a' 2",
    'passes = [{ name = "a/b" }]': r"name must be a word without slashes, got 'a/b'",
    'passes = [{ name = "" }]': r"name must be a word without slashes, got ''",
    'passes = [{ name = "a", lane = nan }]': r"passes\.0: lane must be finite, got nan",
    'passes = [{ name = "a", length = 0.0 }]': r"pass a: length must be greater than 0 m, got 0",
    'passes = [{ name = "a", length = 90.0 }]': r"pass a: length must be at most 50 m, .* got 90",
    'passes = [{ name = "a", start = 60.0 }]': r"pass a: start must be from 0 to 50 m",
    'passes = [{ name = "a", speed = { kind = "constant", speed = 0 } }]': r"pass a, speed: speed must be greater than 0 m/s, or the vehicle never arrives",
    'passes = [{ name = "a", speed = { kind = "constant", speed = nan } }]': r"pass a, speed: speed must be greater than 0 m/s.* got nan",
    'passes = [{ name = "a", speed = { kind = "ramp", begin = 5.0, end = 0.0, distance = 9.0 } }]': r"pass a: speed must lead to the end of the path: .* rest after 9 m of 50 m",
    'passes = [{ name = "a", speed = { kind = "rampe", begin = 5.0 } }]': r"pass a, speed: kind 'rampe' is unknown \(did you mean 'ramp'\?\)",
    'passes = [{ name = "a", speed = 5.0 }]': r"passes\.0\.speed: must be a table, got 5\.0",
    'passes = [{ name = "a", standing = { duration = -4.0 } }]': r"passes\.0\.standing: duration must be greater than 0 s, got -4",
    'passes = [{ name = "a", standing = { yaw = nan } }]': r"standing: yaw must be finite, got nan",
    'passes = [{ name = "a", lane = 1.0, standing = {} }]': r"standing excludes lane, reverse,",
    'passes = [{ name = "a", standing = { waves = [{ component = "heave", amplitude = 1.0, '
    "frequency = 1.0 }] } }]": r"standing\.waves\.0: component must be one of east, north, up",
    "vehicle = { parameters = { sprung_mass = -1.0 } }": r"vehicle: parameters\.sprung_mass must be finite and greater than 0 kg, got -1",
    "vehicle = { parameters = { sprung_mass = nan } }": r"sprung_mass must be finite .* got nan",
    "vehicle = { parameters = { sprung_mas = 1.0 } }": r"vehicle: parameters\.sprung_mas is unknown \(did you mean 'sprung_mass'\?\)",
    'vehicle = { parameters = { sprung_mass = "much" } }': r'vehicle\.parameters\.sprung_mass: must be a valid number, got "much"',
    'vehicle = { model = "vam" }': r"vehicle: model 'vam' is unknown \(did you mean 'van'\?\)",
    'vehicle = { model = "rigid", parameters = { sprung_mass = 1.0 } }': r"parameters are for a car with suspension",
    "vehicle = { roll = 0.1 }": r"roll, pitch and waves are for a rigid body, got the model 'van'",
    "vehicle = { height = inf }": r"vehicle: height must be finite, got inf",
    "vehicle = { tyre = { patch_length = -1.0 } }": r"vehicle\.tyre: patch_length must be finite",
    "declared = { scaner_position = [0.0, 0.0, 0.0] }": r"declared\.scaner_position: is unknown \(did you mean 'scanner_position'\?\)",
    "declared = { scanner_clock = 1.0 }": r"pass pass: the clocks of scanner .* got 1 s",
    "navigation = { clock_rate = 0.05 }": r"pass pass: the clocks of scanner .* got 0\.5 s",
    "mounting = { scanner_rotation = [90.0, 0.0, 0.0] }": r"scanner_rotation must be in radians",
    "navigation = { drift = { height_sd = -0.1 } }": r"toml: navigation\.drift: height_sd must be at least 0, got -0\.1\.$",
    "navigation = { drift = { hight_sd = 0.1 } }": r"toml: navigation\.drift\.hight_sd: is unknown \(did you mean 'height_sd'\?\)\.$",
    'navigation = { quality = [{ begin = 0.0, state = "bad" }] }': r"navigation\.quality\.0\.state: must be 'base station', 'decimetre', .* got \"bad\"",
    "accelerometers = { positions = [[0.0, 0.0]] }": r"accelerometers\.positions\.0\.2: is missing",
    "truth = { spacing = 0.0 }": r"truth: spacing must be greater than 0 m, got 0",
    "raster = = 1": r"line 2, column 10: is no TOML",
}


@pytest.mark.parametrize("text", BAD)
def test_invalid_scenes_are_refused(text, tmp_path):
    (tmp_path / "damaged.crg").write_text("$CT\n")
    if "good.crg" in text:
        from trueterrain import formats
        from trueterrain.core.schemas import make_surface

        flat = make_surface(
            np.zeros((11, 11)),
            u=np.linspace(0, 10, 11),
            v=np.linspace(-5, 5, 11),
            easting=np.linspace(0, 10, 11),
            northing=np.zeros(11),
        )
        formats.write(flat, tmp_path / "good.crg")
    path = written(tmp_path, text)
    with pytest.raises(FormatError, match=BAD[text]) as raised:
        staged(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)
    assert len(str(raised.value).removeprefix(f"{path}: ")) < 300


def test_a_scene_without_a_name_is_refused(tmp_path):
    (tmp_path / "s.toml").write_text("seed = 1\n")
    with pytest.raises(FormatError, match=r"s\.toml: name: is missing"):
        read_scene(tmp_path / "s.toml")


def test_missing_scenes_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"belgian-two-lane: no ready scene .*'belgian-two-lanes'"):
        read_scene("belgian-two-lane")
    with pytest.raises(ValueError, match="known are belgian-two-lanes, boresight, "):
        read_scene("xyz")
    with pytest.raises(FileNotFoundError):
        read_scene(tmp_path / "none.toml")
