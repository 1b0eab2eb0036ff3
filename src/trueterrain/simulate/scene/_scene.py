"""Scene: ground, course, passes, vehicle and instruments of a simulated survey."""

import math
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

from trueterrain.core.errors import FormatError
from trueterrain.formats.run import Mounting
from trueterrain.formats.settings import check_name, read_settings, settings_template
from trueterrain.geometry.navigation_frames import check_origin
from trueterrain.simulate.accelerometers import Accelerometers, sensor_triangle
from trueterrain.simulate.body import BodyMotion, Follower, Motion, Parked, PassPlan
from trueterrain.simulate.course import Course
from trueterrain.simulate.ground import AlongCourse, Ground, Sum
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Reflectivity, Scanner
from trueterrain.simulate.scene._kinds import COURSES, GROUNDS, SPEEDS, build_kind, kind_catalogue
from trueterrain.simulate.scene._parts import (
    RoadShape,
    ScenePass,
    Standing,
    TruthSettings,
    Vehicle,
    suggest_name,
)
from trueterrain.vehicle import FullCarParameters

#: Position of the laser in the body [m]: 0.93 m behind the rear axle of the van, 2 m above ground.
LASER = (-2.25, 0.0, 1.2)

_MAX_CLOCK_DIFFERENCE = 0.09  # [s] navigation is recorded 0.1 s before and after the scans


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Scene of the virtual profiler: everything that determines its recorded runs."""

    name: str
    "Name of the scene; runs are called NAME-PASS.zarr."

    title: str = ""
    "Title of the scene."

    seed: int = 1
    "Seed of all noise: the same seed gives the same runs."

    raster: float = 0.005
    "Spacing of the raster that is the true ground [m]; 0 for the ground itself (slow)."

    origin: tuple[float, float, float] = (11.0, 48.0, 500.0)
    "Longitude [deg], latitude [deg] and ellipsoidal height [m] of the local frame."

    course: dict[str, Any] = field(default_factory=lambda: {"kind": "straight", "length": 50.0})
    "Course: its kind and parameters."

    ground: tuple[dict[str, Any], ...] = ({"kind": "belgian-block"},)
    "Layers of the ground, each with its kind and parameters; their heights add up."

    road: RoadShape = field(default_factory=RoadShape)
    "Shape of the road along the course."

    passes: tuple[ScenePass, ...] = (ScenePass(name="pass"),)
    "The passes."

    vehicle: Vehicle = field(default_factory=Vehicle)
    "The vehicle."

    scanner: Scanner = field(default_factory=Scanner)
    "The scanner."

    reflectivity: Reflectivity = field(default_factory=Reflectivity)
    "Reflectivity of the ground."

    mounting: Mounting = field(default_factory=lambda: Mounting(scanner_position=LASER))
    "True pose of the scanner in the body, and its clock."

    declared: Mounting | None = field(
        default=None, metadata={"table": Mounting(scanner_position=LASER)}
    )
    "Mounting that the run declares instead of the true one, for calibration to correct."

    navigation: Navigation = field(default_factory=Navigation)
    "The navigation."

    accelerometers: Accelerometers = field(
        default_factory=lambda: Accelerometers(positions=sensor_triangle(LASER, 0.5))
    )
    "The accelerometers."

    truth: TruthSettings = field(default_factory=TruthSettings)
    "Contents of the truth."

    def __post_init__(self) -> None:
        """Check the settings that do not need a drive."""
        check_name(self.name)
        if self.seed < 0:
            message = f"seed must be at least 0, got {self.seed}."
            raise ValueError(message)
        if not 0 <= self.raster < math.inf:
            message = f"raster must be at least 0 m, got {self.raster}."
            raise ValueError(message)
        check_origin(self.origin)
        for name in ("scanner", "reflectivity"):
            part = getattr(self, name)
            for entry in fields(part):
                if not math.isfinite(getattr(part, entry.name)):
                    message = (
                        f"{name}.{entry.name} must be finite, got {getattr(part, entry.name)}."
                    )
                    raise ValueError(message)
        if not self.ground:
            message = "ground is missing: it must have at least one layer."
            raise ValueError(message)
        names = [drive.name for drive in self.passes]
        if not names:
            message = "passes are missing: there must be at least one."
            raise ValueError(message)
        repeated = [name for name in names if names.count(name) > 1]
        if repeated:
            message = (
                f"passes must have names that differ, got {repeated[0]!r} {len(repeated)} times."
            )
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """Scene with the objects of its ground and course."""

    scene: Scene
    "The scene."

    course: Course
    "The course."

    ground: Ground
    "The ground, before it is sampled on a raster."

    path: Path | None
    "File of the scene, for messages."

    def motion(self, drive: ScenePass) -> Motion:
        """Motion of the body in a pass.

        Parameters
        ----------
        drive : ScenePass
            A pass of the scene.

        Returns
        -------
        Motion
            Exact motion of the body.

        Raises
        ------
        FormatError
            If the pass is impossible: it never arrives, starts after the end of the course, ...
        """
        place = f"pass {drive.name}"
        try:
            motion = self._motion(drive, place)
            self._check_clocks(motion.duration)
        except ValueError as error:
            raise FormatError(str(error), path=self.path, place=place) from None
        return motion

    def _check_clocks(self, duration: float) -> None:
        """Raise ValueError if scans lie outside the navigation by the declared clock."""
        true, navigation = self.scene.mounting.scanner_clock, self.scene.navigation
        declared = (self.scene.declared or self.scene.mounting).scanner_clock
        begin = declared - true + navigation.clock_offset
        difference = max(abs(begin), abs(begin + navigation.clock_rate * duration))
        if difference > _MAX_CLOCK_DIFFERENCE:
            message = (
                "the clocks of scanner (less the one declared) and navigation must be at most "
                f"{_MAX_CLOCK_DIFFERENCE} s apart, got {difference:.6g} s."
            )
            raise ValueError(message)

    def _motion(self, drive: ScenePass, place: str) -> Motion:
        vehicle = self.scene.vehicle
        if drive.standing is not None:
            return self._parked(drive.standing)
        plan = PassPlan(
            course=self.course,
            speed=build_kind(SPEEDS, drive.speed, f"{place}, speed", path=self.path),
            lane=drive.lane,
            reverse=drive.reverse,
            start=drive.start,
            length=drive.length,
        )
        if vehicle.car is None:
            return Follower(
                drive=plan,
                up=vehicle.height,
                roll=vehicle.roll,
                pitch=vehicle.pitch,
                waves=vehicle.waves,
            )
        return BodyMotion(
            drive=plan,
            ground=self.ground,
            vehicle=vehicle.car,
            tyre=vehicle.tyre,
            wheel=self.scene.mounting.scanner_position[:2],
            origin_height=vehicle.height,
        )

    def _parked(self, standing: Standing) -> Motion:
        vehicle = self.scene.vehicle
        pose = {name: getattr(standing, name) for name in ("east", "north", "yaw", "duration")}
        waves = (*vehicle.waves, *standing.waves)
        if isinstance(vehicle.car, FullCarParameters):
            return Parked.on_ground(ground=self.ground, vehicle=vehicle.car, waves=waves, **pose)
        up = vehicle.height + float(self.ground.height(standing.east, standing.north))
        return Parked(up=up, roll=vehicle.roll, pitch=vehicle.pitch, waves=waves, **pose)


def scene_names() -> list[str]:
    """Names of the ready scenes.

    Returns
    -------
    list of str
        Names in alphabetical order.

    Examples
    --------
    >>> "belgian-two-lanes" in scene_names()
    True
    """
    return sorted(
        file.name.removesuffix(".toml")
        for file in _scene_folder().iterdir()
        if file.name.endswith(".toml")
    )


def read_scene(scene: str | Path) -> tuple[Scene, Path]:
    """Read a scene from a TOML file, or a ready one by its name.

    Parameters
    ----------
    scene : str or Path
        File that ends with .toml, or a name from `scene_names`.

    Returns
    -------
    scene : Scene
        The scene.
    path : Path
        Its file.

    Raises
    ------
    FormatError
        If the file is not a scene.
    ValueError
        If there is no ready scene of that name.

    Examples
    --------
    >>> read_scene("kerb")[0].name
    'kerb'
    """
    path = Path(scene)
    if path.suffix.lower() != ".toml":
        if str(scene) not in scene_names():
            message = (
                f"{scene}: no ready scene has this name, and it is no .toml file "
                f"({suggest_name(str(scene), scene_names())})."
            )
            raise ValueError(message)
        path = Path(str(_scene_folder() / f"{scene}.toml"))
    return read_settings(Scene, path), path


def set_stage(scene: Scene, *, path: Path | None = None) -> Stage:
    """Create the course and the ground of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : Path, optional
        Its file, for messages; paths of CRG files are relative to its folder.

    Returns
    -------
    Stage
        Stage, which gives the motions of the passes.

    Raises
    ------
    FormatError
        If a kind is unknown or a parameter breaks a rule.
    """
    course: Course = build_kind(COURSES, scene.course, "course", path=path)
    layers = [
        build_kind(GROUNDS, table, f"ground {number}", path=path)
        for number, table in enumerate(scene.ground, start=1)
    ]
    ground: Ground = layers[0] if len(layers) == 1 else Sum(parts=tuple(layers))
    try:
        ground = _shape_ground(ground, course, scene.road)
    except ValueError as error:
        raise FormatError(str(error), path=path, place="road") from None
    return Stage(scene=scene, course=course, ground=ground, path=path)


def scene_template(scene: Scene | None = None) -> str:
    """Complete TOML text of a scene with help, and of all kinds of its parts.

    Parameters
    ----------
    scene : Scene, optional
        By default a pass over Belgian block.

    Returns
    -------
    str
        TOML that `read_scene` reads.
    """
    scene = Scene(name="scene") if scene is None else scene
    return settings_template(scene, title="A scene of the virtual profiler.") + kind_catalogue()


def _shape_ground(ground: Ground, course: Course, road: RoadShape) -> Ground:
    if not (road.along_course or road.slope or road.banking or road.superelevation):
        return ground
    if road.superelevation:
        return AlongCourse.superelevated(
            ground=ground, course=course, max_banking=road.superelevation, slope=road.slope
        )
    return AlongCourse(ground=ground, course=course, slope=road.slope, banking=road.banking)


def _scene_folder() -> Any:
    return resources.files("trueterrain.simulate.scene") / "scenes"
