"""Calibration plate: cleats of known profile on a level plate (thesis 3.4)."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.ground import Ground

Float = npt.NDArray[np.float64]

Shape = Literal["rectangle", "semicircle", "triangle"]


@dataclass(frozen=True, kw_only=True)
class CalibrationPlate(Ground):
    """Level plate with cleats across the lane: by default a rectangle, a semicircle, a triangle.

    The thesis's calibration surface (section 3.4) has interchangeable cleats on a plate with a grid
    of holes of 152 mm; here their distance is two holes, symmetric about the centre. The cleats are
    along `y`, so that a vehicle that drives along `x` crosses them.

    Examples
    --------
    >>> plate = CalibrationPlate(east=10.0)
    >>> plate.height([10.0, 10.0 - 0.304, 12.0], 0.0).round(4)
    array([0.05, 0.05, 0.  ])
    >>> CalibrationPlate(cleats=("triangle",)).height([0.0, 0.019, 0.304], 0.0).round(4)
    array([0.05 , 0.031, 0.012])
    """

    cleats: tuple[Shape, ...] = ("rectangle", "semicircle", "triangle")
    "Profiles of the cleats, from west to east: rectangle, semicircle, triangle."

    east: float = 0.0
    "Easting of the centre of the plate [m]."

    north: float = 0.0
    "Northing of the centre of the plate [m]."

    length: float = 1.2
    "Extent along x [m]."

    width: float = 1.2
    "Extent along y [m]."

    thickness: float = 0.012
    "Height of the plate above the ground [m]."

    pitch: float = 0.304
    "Distance between the centres of cleats, two holes of 152 mm [m]."

    cleat: float = 0.076
    "Width of a cleat at its foot [m]; the round one is half a circle."

    rise: float = 0.038
    "Height of a cleat above the plate [m]."

    def __post_init__(self) -> None:
        """Check shapes and sizes."""
        for shape in self.cleats:
            if shape not in get_args(Shape):
                message = f"cleats must be some of {', '.join(get_args(Shape))}, got {shape!r}."
                raise ValueError(message)
        if not self.cleats:
            message = "cleats must hold at least one."
            raise ValueError(message)
        for name in ("length", "width", "pitch", "cleat", "rise"):
            if not 0 < getattr(self, name) < math.inf:
                message = f"{name} must be greater than 0 m, got {getattr(self, name)}."
                raise ValueError(message)
        for name in ("east", "north", "thickness"):
            if not math.isfinite(getattr(self, name)):
                message = f"{name} must be finite, got {getattr(self, name)}."
                raise ValueError(message)
        if self.thickness < 0:
            message = f"thickness must be at least 0 m, got {self.thickness}."
            raise ValueError(message)
        if self.pitch < self.cleat:
            message = f"pitch must be at least the cleat of {self.cleat} m, got {self.pitch} m."
            raise ValueError(message)
        min_length = (len(self.cleats) - 1) * self.pitch + self.cleat
        if self.length < min_length:
            message = (
                f"length must fit the {len(self.cleats)} cleats, which need "
                f"{min_length:g} m, got {self.length} m."
            )
            raise ValueError(message)

    def _height(self, x: Float, y: Float) -> Float:
        longitudinal, lateral = x - self.east, y - self.north
        half = 0.5 * self.cleat
        relief = np.zeros_like(longitudinal)
        for number, shape in enumerate(self.cleats):
            distance = longitudinal - (number - 0.5 * (len(self.cleats) - 1)) * self.pitch
            relief = np.maximum(relief, _cleat_relief(shape, distance / half))
        profile = self.thickness + self.rise * relief
        on_plate = (np.abs(longitudinal) <= 0.5 * self.length) & (
            np.abs(lateral) <= 0.5 * self.width
        )
        return np.where(on_plate, profile, 0.0)


def _cleat_relief(shape: Shape, position: Float) -> Float:
    """Height of a cleat over its rise, at positions from -1 to 1 between its edges."""
    if shape == "rectangle":
        return np.where(np.abs(position) <= 1.0, 1.0, 0.0)
    if shape == "triangle":
        return np.asarray(np.maximum(1.0 - np.abs(position), 0.0))
    return np.asarray(np.sqrt(np.maximum(1.0 - position**2, 0.0)))
