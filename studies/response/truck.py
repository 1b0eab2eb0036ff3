"""Tyre of a truck compared with that of a passenger car, by heights.

No vehicle is used here, since no published parameters of a truck are available. The height of a
reduction is compared with that of the tyre rolling over the same ground, in waves longer and
shorter than its patch.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from reductions import STEP
from roads import STATIONS, Course
from trueterrain.profile import (
    PASSENGER_TYRE,
    TRUCK_TYRE,
    Disc,
    LineLaser,
    Mean,
    Median,
    Percentile,
    RadialSpringTyre,
    Statistic,
    TyreData,
    point_profile,
    tyre_envelope,
    tyre_profile,
)
from trueterrain.roughness import Butterworth

TYRES = {"passenger": PASSENGER_TYRE, "truck": TRUCK_TYRE}
STATISTICS: dict[str, Statistic] = {
    "median": Median(),
    "mean": Mean(),
    "70th percentile": Percentile(percent=70.0),
    "85th percentile": Percentile(percent=85.0),
}
RADII = tuple(range(25, 201, 25))  # [mm]
LENGTH = 40.0  # [m] of each road, one wheel path: the widest discs take long
HALF_WIDTH = 0.22  # [m] of the strip
ENDS = round(0.5 / STATIONS)  # path points at either end that a filter may blur

LINE = "bare line", 0
LASER = "springs on the line laser", 0
WIDE_LASER = "springs on a line laser as wide as the patch", 0

Float = npt.NDArray[np.float64]
Which = tuple[str, int]  # statistic and radius [mm], or another reduction and 0


@dataclass(frozen=True, kw_only=True)
class Felt:
    """Difference of a height from the envelope of a tyre, RMS about the mean."""

    longer: float
    "In waves longer than the patch of the tyre [m]."

    shorter: float
    "In shorter waves [m]."


@dataclass(frozen=True, kw_only=True)
class Rolled:
    """Road, and the difference of each reduction from the envelope of each tyre."""

    course: str
    felt: Mapping[str, Mapping[Which, Felt]]


def roll(course: Course) -> Rolled:
    """Roll both tyres along one road, and take all heights there."""
    course = replace(course, length=LENGTH)
    surface, path = course.strip("left", half_width=HALF_WIDTH)

    def rolled(data: TyreData) -> Float:
        tyre = RadialSpringTyre.of(data)
        return np.asarray(tyre_envelope(surface, path, tyre=tyre, step=STEP).height)

    def on_laser(data: TyreData, laser: LineLaser) -> Float:
        line = tyre_envelope(surface, path, tyre=laser, step=STEP)
        tyre = RadialSpringTyre.of(data)
        return np.asarray(tyre_envelope(line, tyre=tyre, step=STEP).height)

    heights: dict[Which, Float] = {
        LINE: np.asarray(point_profile(surface, path).height),
        **{
            (name, radius): np.asarray(
                tyre_profile(
                    surface, path, statistic=statistic, area=Disc(radius=radius / 1000)
                ).height
            )
            for name, statistic in STATISTICS.items()
            for radius in RADII
        },
    }
    felt = {}
    for name, data in TYRES.items():
        truth = rolled(data)
        found = heights | {
            LASER: on_laser(data, LineLaser()),
            WIDE_LASER: on_laser(data, LineLaser(width=data.contact_width)),
        }
        felt[name] = {
            which: _apart(height - truth, data.contact_length) for which, height in found.items()
        }
    return Rolled(course=course.name, felt=felt)


def best_radius(road: Rolled, tyre: str, statistic: str) -> int:
    """Radius with the smallest difference in waves longer than the patch [mm]."""
    return min(RADII, key=lambda radius: road.felt[tyre][statistic, radius].longer)


def growths(rolled: Sequence[Rolled]) -> list[float]:
    """Best radius for the truck over that for the passenger car, of all statistics and roads."""
    return [
        best_radius(road, "truck", name) / best_radius(road, "passenger", name)
        for road in rolled
        for name in STATISTICS
    ]


def _apart(difference: Float, patch: float) -> Felt:
    station = STATIONS * np.arange(difference.size)

    def rms(waves: Butterworth) -> float:
        return float(waves.filtered(station, difference)[ENDS:-ENDS].std())

    return Felt(longer=rms(Butterworth(shortest=patch)), shorter=rms(Butterworth(longest=patch)))
