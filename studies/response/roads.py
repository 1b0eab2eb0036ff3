"""Four roads, as the two strips of ground that the wheels of a car roll on."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from trueterrain.profile import PlaneCurve, straight_path
from trueterrain.simulate.ground import (
    BelgianBlock,
    Cracks,
    Ground,
    Repeated,
    Road,
    Stones,
    sample_surface,
)

OFFSETS = {"left": 0.69, "right": -0.69}  # [m] of the wheel paths, half the track of the sedan
HALF_WIDTH = 0.16  # [m] of a strip: more than the reach of any search area and any tyre
ENDS = 1.0  # [m] of ground before and after the paths
GRID = 0.005  # [m] between nodes of the ground, as in the thesis; bilinear on the measured one
STATIONS = 0.01  # [m] between path points


@dataclass(frozen=True, kw_only=True)
class Course:
    """Road of the study."""

    name: str
    "Name."

    what: str
    "Description for the page."

    ground: Callable[[], Ground]
    "Makes the ground."

    length: float
    "Length that is driven [m]."

    speed: float
    "Speed [km/h]."

    def strips(self) -> list[tuple[xr.Dataset, PlaneCurve]]:
        """Surface and path of each wheel, left and right."""
        ground = self.ground()
        return [self._strip(ground, offset, HALF_WIDTH) for offset in OFFSETS.values()]

    def strip(self, wheel: str, half_width: float) -> tuple[xr.Dataset, PlaneCurve]:
        """Surface and path of one wheel, as wide as asked for."""
        return self._strip(self.ground(), OFFSETS[wheel], half_width)

    def _strip(
        self, ground: Ground, offset: float, half_width: float
    ) -> tuple[xr.Dataset, PlaneCurve]:
        across = GRID * np.arange(round(2 * half_width / GRID) + 1) - half_width
        along = GRID * np.arange(round((self.length + 2 * ENDS) / GRID) + 1)
        surface = sample_surface(ground, easting=along, northing=offset + across)
        ends = (ENDS, offset), (ENDS + self.length, offset)
        return surface, straight_path(*ends, spacing=STATIONS)


def measured_block() -> Ground:
    """Belgian block of the ASAM OpenCRG sample data, every other copy of it backwards."""
    folder = os.environ.get("TRUETERRAIN_DATA")
    data = Path(folder) if folder else Path(__file__).parents[3] / "shared" / "data"
    path = data / "opencrg" / "asam" / "belgian_block.crg"
    if not path.is_file():
        raise SystemExit(f"no measured Belgian block at {path}: set TRUETERRAIN_DATA to its folder")
    return Repeated.from_file(path, part_v=(-1.2, 1.2))


def generated_block() -> Ground:
    """Belgian block like the measured one, that never repeats."""
    return BelgianBlock(seed=1)


def asphalt() -> Ground:
    """Class B, with grit on it and cracks in it."""
    return (
        Road(road_class="B", waves=2048, seed=11)
        + Stones(density=5.0, diameter_min=0.01, diameter_max=0.03, seed=12)
        + Cracks(spacing=3.0, width=0.02, depth=0.02, share=0.8, seed=13)
        + Cracks(
            pattern="alligator",
            spacing=0.3,
            width=0.01,
            depth=0.008,
            meander=0.05,
            share=0.3,
            seed=14,
        )
    )


def highway() -> Ground:
    """Class A, nothing on it."""
    return Road(road_class="A", waves=2048, seed=21)


COURSES = (
    Course(
        name="measured block",
        what="Belgian block measured on a proving ground (ASAM OpenCRG sample data, 10 m on a grid "
        "of 10 mm), copied end to end, every other copy backwards",
        ground=measured_block,
        length=60.0,
        speed=30.0,
    ),
    Course(
        name="generated block",
        what="`BelgianBlock`, made to the measures of that road",
        ground=generated_block,
        length=60.0,
        speed=30.0,
    ),
    Course(
        name="asphalt",
        what="ISO 8608 class B with 5 stones of 10 to 30 mm per square metre, transverse cracks of "
        "20 mm every 3 m and alligator cracks of 10 mm",
        ground=asphalt,
        length=120.0,
        speed=80.0,
    ),
    Course(
        name="highway",
        what="ISO 8608 class A, waves down to 0.1 m",
        ground=highway,
        length=200.0,
        speed=120.0,
    ),
)
