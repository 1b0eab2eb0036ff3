"""Scenes of the two tests, and the injected faults."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

from trueterrain.formats.run import Mounting
from trueterrain.simulate.accelerometers import Accelerometers, sensor_triangle
from trueterrain.simulate.scanner import Reflectivity, Scanner
from trueterrain.simulate.scene import Scene, ScenePass, Standing, read_scene

LASER = (-2.25, 0.0, 1.2)  # [m] in the body
MIDDLE = 12.9  # [m] of the plate, driven over
SPEED = 5.4  # [m/s]
SIDE = 0.342  # [m] of the centre of the plate to the right of the standing scanner
BEGINS = -SIDE - 0.6  # [m] to its left: assumed start of the plate
PLATE = 1.2  # [m]
FLOOR = 5.4  # [m] of plane floor evaluated before and after the plate
STRIP = 0.8  # [m] width of the strip of returns
LEAD = 0.1  # [s] of motion before the first scan

#: Places of boards with three cleats along the path [m], and the wheels over them.
BOARDS = (
    (7.4, "both"),
    (10.1, "both"),
    (12.8, "both"),
    (14.4, "left"),
    (16.4, "right"),
    (18.2, "both"),
)
_TRACK = 0.75  # [m] of a wheel from the centre line


@dataclass(frozen=True, kw_only=True)
class Fault:
    """An injected fault, and the finding that must detect it."""

    name: str
    "Name of the fault."

    size: str
    "Size of the fault, as text."

    declared: dict[str, Any] = field(default_factory=dict)
    "Wrong values of the mounting that the run states."

    scale: float = 0.0
    "Scale error of all accelerometers [1]."

    beside: float = 0.0
    "Displacement of the plate to the left of, or beyond, its assumed place [m]."

    white: bool = False
    "Whether a cleat is painted white."

    dropped: int = 0
    "Number of scans lost during the crossing, in two gaps."

    finding: str = ""
    "Name of the finding that must detect it."

    injected: float | None = None
    "Expected value of the finding."


_DEGREE = math.radians(0.1)

#: Injected faults, one after the other.
FAULTS = (
    Fault(name="nothing", size="–"),
    Fault(
        name="clock of the scanner",
        size="1 ms",
        declared={"scanner_clock": 0.001},
        finding="clock of the scanner",
        injected=-0.001,
    ),
    Fault(
        name="boresight, roll",
        size="0.1°",
        declared={"scanner_rotation": (_DEGREE, 0.0, 0.0)},
        finding="boresight roll",
        injected=-_DEGREE,
    ),
    Fault(
        name="boresight, pitch",
        size="0.1°",
        declared={"scanner_rotation": (0.0, _DEGREE, 0.0)},
        finding="lever arm ahead, or boresight pitch",
        injected=2.0 * math.tan(_DEGREE),
    ),
    Fault(
        name="lever arm, ahead",
        size="10 mm",
        declared={"scanner_position": (LASER[0] + 0.01, LASER[1], LASER[2])},
        finding="lever arm ahead, or boresight pitch",
        injected=-0.01,
    ),
    Fault(
        name="lever arm, to the left",
        size="10 mm",
        declared={"scanner_position": (LASER[0], LASER[1] + 0.01, LASER[2])},
        finding="lever arm to the left",
        injected=-0.01,
    ),
    Fault(
        name="lever arm, up",
        size="10 mm",
        declared={"scanner_position": (LASER[0], LASER[1], LASER[2] + 0.01)},
        finding="lever arm up",
        injected=-0.01,
    ),
    Fault(
        name="saturated cleat",
        size="0.7 to 0.8 mm",
        white=True,
        finding="error of bright ground",
        injected=0.0007,
    ),
    Fault(
        name="scale of the accelerometers",
        size="2 %",
        scale=0.02,
        finding="scale of the accelerometers",
        injected=0.02,
    ),
    Fault(
        name="plate beside its place",
        size="5 mm",
        beside=0.005,
        finding="place of the plate",
        injected=0.005,
    ),
    Fault(
        name="scans dropped",
        size="20",
        dropped=20,
        finding="scans lost",
        injected=20.0,
    ),
)


def static_scene(fault: Fault, *, seed: int = 1) -> Scene:
    """The vehicle stands for half a second; its scans cross the cleats.

    The plate lies to the right of the scanner, so that its first cleat begins below it.
    """
    plate = {"kind": "plate", "east": SIDE - fault.beside, "north": LASER[0]}
    stripe = Reflectivity(period=10.0, width=0.076, stripe=0.9) if fault.white else Reflectivity()
    return _scene(
        fault,
        name="static",
        seed=seed,
        ground=(plate,),
        reflectivity=stripe,
        raster=0.002,
        passes=(ScenePass(name="run", standing=Standing(duration=0.5, yaw=0.5 * math.pi)),),
    )


def dynamic_scene(fault: Fault, *, seed: int = 1) -> Scene:
    """A drive over plane floor and plate, whose wheels are excited by boards beside them."""
    east = MIDDLE + fault.beside
    ground: list[dict[str, Any]] = [{"kind": "plate", "east": east, "width": 0.9}]
    for at, wheels in BOARDS:
        sides = {"both": (1, -1), "left": (1,), "right": (-1,)}[wheels]
        ground += [
            {
                "kind": "plate",
                "east": at,
                "north": side * _TRACK,
                "width": 0.3,
                "thickness": 0.0,
                "length": 1.3,
                "pitch": 0.488,
                "cleat": 0.17,
                "rise": 0.05,
            }
            for side in sides
        ]
    # a stripe over the first cleat and 50 mm on both sides of it
    begin = MIDDLE - 0.304 - 0.088
    stripe = Reflectivity(period=begin, width=0.176, stripe=0.9) if fault.white else Reflectivity()
    vehicle = read_scene("dynamic-plate-excited")[0].vehicle
    return _scene(
        fault,
        name="dynamic",
        seed=seed,
        ground=tuple(ground),
        reflectivity=stripe,
        raster=0.005,
        course={"kind": "straight", "length": MIDDLE + 0.6 + FLOOR - LASER[0] + 0.8},
        vehicle=vehicle,
        scanner=Scanner(beams=235, swath=1.0),
        passes=(ScenePass(name="run", speed={"kind": "constant", "speed": SPEED}),),
    )


def _scene(fault: Fault, **parts: Any) -> Scene:
    mounting = Mounting(scanner_position=LASER)
    sensors = Accelerometers(positions=sensor_triangle(LASER, 0.5))
    if fault.scale:
        sensors = replace(sensors, scale=(fault.scale,) * 3)
    declared = None
    if fault.declared:
        declared = replace(mounting, accelerometer_clock=sensors.clock_offset, **fault.declared)
    return Scene(mounting=mounting, declared=declared, accelerometers=sensors, **parts)
