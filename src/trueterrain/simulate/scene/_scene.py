"""A scene: which ground is driven over, how, and with which instruments."""

import difflib
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from trueterrain.errors import FormatError
from trueterrain.formats.run import Mounting
from trueterrain.formats.settings import read_settings, settings_template
from trueterrain.simulate.accelerometers import Accelerometers, triangle
from trueterrain.simulate.body import BodyMotion, Follower, Motion, Parked, Pass, Wave
from trueterrain.simulate.course import Course
from trueterrain.simulate.ground import AlongCourse, Ground, Sum
from trueterrain.simulate.navigation import Navigation
from trueterrain.simulate.scanner import Reflectivity, Scanner
from trueterrain.simulate.scene._kinds import COURSES, GROUNDS, SPEEDS, build, catalogue
from trueterrain.vehicle import GOLDEN_QUARTER_CAR, Tyre, named_vehicle

#: Where the laser of the thesis's vehicle sits: 1 m behind the rear axle of the van, 2 m high.
LASER = (-2.25, 0.0, 1.2)


@dataclass(frozen=True, kw_only=True)
class Road:
    """How the ground lies along the course."""

    along_course: bool = False
    "Whether the ground follows the course, its x the station and its y the offset."

    slope: float = 0.0
    "Climb of the course [m/m]."

    banking: float = 0.0
    "Cross slope of the whole course, left side up [m/m]."

    superelevation: float = 0.0
    "Greatest inward lean, in the tightest curve; in proportion to the curvature elsewhere [m/m]."


@dataclass(frozen=True, kw_only=True)
class Standing:
    """Instead of driving: how the vehicle stands."""

    duration: float = 4.0
    "How long it stands [s]."

    east: float = 0.0
    "Easting of the body [m]."

    north: float = 0.0
    "Northing of the body [m]."

    yaw: float = 0.0
    "Direction in which it stands, counter-clockwise from east [rad]."

    waves: tuple[Wave, ...] = ()
    "What bounces it: sines in east, north, up, roll, pitch, yaw."


@dataclass(frozen=True, kw_only=True)
class Drive:
    """One pass over the ground: one recorded run."""

    name: str
    "Name of the pass; the run is called after the scene and it."

    lane: float = 0.0
    "Offset of the lane to the left of the course [m]."

    reverse: bool = False
    "Whether the lane is driven against the course."

    start: float | None = None
    "Station at which it begins [m]; by default where the course does."

    length: float | None = None
    "Length driven [m]; by default to the end of the course, or once around."

    speed: dict[str, Any] = field(default_factory=lambda: {"kind": "constant", "speed": 5.0})
    "Speed: its kind and parameters."

    standing: Standing | None = None
    "Stand instead of driving."


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """The vehicle that carries the instruments."""

    model: str = "van"
    'Full car "compact", "golden car", "sedan" or "van"; "quarter car"; or "rigid".'

    height: float = 0.8
    "Height of the origin of the body over level ground [m]; a full car has its own."

    roll: float = 0.0
    "Roll of a rigid body [rad]."

    pitch: float = 0.0
    "Pitch of a rigid body, nose down positive [rad]."

    waves: tuple[Wave, ...] = ()
    "What moves a rigid body besides: sines in its components."

    tyre: Tyre = field(default_factory=Tyre)
    "Contact patch of the tyres."


@dataclass(frozen=True, kw_only=True)
class Truth:
    """What the truth of a run shall hold besides the exact motion and the injected errors."""

    spacing: float = 0.02
    "Spacing of the surface that shows the ground [m]."

    returns: bool = True
    "Whether to keep the error of every range (2 bytes each)."


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A scene of the virtual profiler."""

    name: str
    "Name of the scene; runs are called NAME-PASS.zarr."

    title: str = ""
    "What it shows."

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

    road: Road = field(default_factory=Road)
    "How the ground lies along the course."

    passes: tuple[Drive, ...] = (Drive(name="pass"),)
    "The passes."

    vehicle: Vehicle = field(default_factory=Vehicle)
    "The vehicle."

    scanner: Scanner = field(default_factory=Scanner)
    "The scanner."

    reflectivity: Reflectivity = field(default_factory=Reflectivity)
    "Brightness of the ground."

    mounting: Mounting = field(default_factory=lambda: Mounting(scanner_position=LASER))
    "Where the scanner truly sits; the clock of the accelerometers is theirs."

    declared: Mounting | None = None
    "Mounting that the run claims instead of the true one, to be found out by calibration."

    navigation: Navigation = field(default_factory=Navigation)
    "The navigation."

    accelerometers: Accelerometers = field(
        default_factory=lambda: Accelerometers(positions=triangle(LASER, 0.5))
    )
    "The accelerometers."

    truth: Truth = field(default_factory=Truth)
    "What the truth holds."

    def __post_init__(self) -> None:
        """Check what can be checked without driving."""
        if not self.name or set(self.name) & set("/\\"):
            message = f"name must be a word without slashes, got {self.name!r}."
            raise ValueError(message)
        if not self.raster >= 0:
            message = f"raster must be at least 0 m, got {self.raster}."
            raise ValueError(message)
        names = [drive.name for drive in self.passes]
        if not names or len(set(names)) < len(names):
            message = f"passes must have names that differ, got {names}."
            raise ValueError(message)


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """A scene with its ground and its course made."""

    scene: Scene
    "The scene."

    course: Course
    "The course."

    ground: Ground
    "The ground, before it is made a raster."

    path: Path | None
    "File of the scene, for messages."

    def motion(self, drive: Drive) -> Motion:
        """How the body moves in a pass.

        Parameters
        ----------
        drive : Drive
            A pass of the scene.

        Returns
        -------
        Motion
            Exact motion of the body.

        Raises
        ------
        FormatError
            If the pass is impossible: never arrives, begins behind the end of the course, ...
        """
        place = f"pass {drive.name}"
        try:
            return self._motion(drive, place)
        except ValueError as error:
            raise FormatError(str(error), path=self.path, place=place) from None

    def _motion(self, drive: Drive, place: str) -> Motion:
        vehicle = self.scene.vehicle
        if drive.standing is not None:
            return self._parked(drive.standing)
        way = Pass(
            course=self.course,
            speed=build(SPEEDS, drive.speed, f"{place}, speed", path=self.path),
            lane=drive.lane,
            reverse=drive.reverse,
            start=drive.start,
            length=drive.length,
        )
        if vehicle.model == "rigid":
            return Follower(
                drive=way, up=vehicle.height, roll=vehicle.roll, pitch=vehicle.pitch,
                waves=vehicle.waves,
            )  # fmt: skip
        if vehicle.model == "quarter car":
            return BodyMotion(
                drive=way, ground=self.ground, vehicle=GOLDEN_QUARTER_CAR, tyre=vehicle.tyre,
                wheel=self.scene.mounting.scanner_position[:2], origin_height=vehicle.height,
            )  # fmt: skip
        car = named_vehicle(vehicle.model)
        return BodyMotion(drive=way, ground=self.ground, vehicle=car, tyre=vehicle.tyre)

    def _parked(self, standing: Standing) -> Motion:
        vehicle = self.scene.vehicle
        how: dict[str, Any] = {
            name: getattr(standing, name) for name in ("east", "north", "yaw", "duration", "waves")
        }
        if vehicle.model in ("rigid", "quarter car"):
            up = vehicle.height + float(self.ground.height(standing.east, standing.north))
            return Parked(up=up, roll=vehicle.roll, pitch=vehicle.pitch, **how)
        car = named_vehicle(vehicle.model)
        return Parked.on_ground(ground=self.ground, vehicle=car, **how)


def scene_names() -> list[str]:
    """Names of the ready scenes.

    Returns
    -------
    list of str
        In alphabetic order.

    Examples
    --------
    >>> "belgian-two-lanes" in scene_names()
    True
    """
    return sorted(file.name.removesuffix(".toml") for file in _folder().iterdir()
                  if file.name.endswith(".toml"))  # fmt: skip


def read_scene(scene: str | Path) -> tuple[Scene, Path]:
    """Scene from a TOML file, or a ready one by its name.

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
        If the file is no scene.
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
            near = difflib.get_close_matches(str(scene), scene_names(), n=1)
            hint = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(scene_names())}."
            message = f"{scene}: no ready scene has this name, and it is no .toml file. {hint}"
            raise ValueError(message)
        path = Path(str(_folder() / f"{scene}.toml"))
    return read_settings(Scene, path), path


def set_stage(scene: Scene, *, path: Path | None = None) -> Stage:
    """Make the course and the ground of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    path : Path, optional
        Its file, for messages; CRG files are looked for beside it.

    Returns
    -------
    Stage
        From which motions come.

    Raises
    ------
    FormatError
        If a kind is unknown or a parameter breaks a rule.
    """
    course: Course = build(COURSES, scene.course, "course", path=path)
    layers = [
        build(GROUNDS, table, f"ground {number}", path=path)
        for number, table in enumerate(scene.ground, start=1)
    ]
    if not layers:
        raise FormatError("ground is missing: at least one layer", path=path)
    ground: Ground = layers[0] if len(layers) == 1 else Sum(parts=tuple(layers))
    return Stage(scene=scene, course=course, ground=_laid(ground, course, scene.road), path=path)


def scene_template(scene: Scene | None = None) -> str:
    """Complete TOML text of a scene with all helps, and of everything that it can be made of.

    Parameters
    ----------
    scene : Scene, optional
        By default one Belgian block lane.

    Returns
    -------
    str
        TOML that `read_scene` reads.
    """
    scene = Scene(name="scene") if scene is None else scene
    return settings_template(scene, title="A scene of the virtual profiler.") + catalogue()


def _laid(ground: Ground, course: Course, road: Road) -> Ground:
    if not (road.along_course or road.slope or road.banking or road.superelevation):
        return ground
    if road.superelevation:
        return AlongCourse.superelevated(
            ground=ground, course=course, greatest=road.superelevation, slope=road.slope
        )
    return AlongCourse(ground=ground, course=course, slope=road.slope, banking=road.banking)


def _folder() -> Any:
    return resources.files("trueterrain.simulate.scene") / "scenes"
