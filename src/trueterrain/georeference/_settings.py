"""Settings of a calibration."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from trueterrain.georeference._patches import NAMES
from trueterrain.georeference.screening import Screening

Floats = npt.NDArray[np.float64]

Parameter = Literal["roll", "pitch", "yaw", "lever_x", "lever_y", "lever_z", "clock"]


@dataclass(frozen=True, kw_only=True)
class CalibrationSettings:
    """How a mounting is found."""

    parameters: tuple[Parameter, ...] = (
        "roll",
        "pitch",
        "yaw",
        "lever_x",
        "lever_y",
        "lever_z",
        "clock",
    )
    "What is estimated; the rest is held."

    unobservable: Literal["refuse", "hold"] = "refuse"
    "What becomes of a parameter that the passes do not tell: an error, or it is held as it was."

    spacing: float = 0.04
    "Size of the cells of ground that are compared [m]; at least three scans should fall into it."

    area: tuple[float, float, float, float] | None = None
    "West, south, east, north of the ground to use [m]; by default all."

    max_angle: float = 0.5
    """Largest angle of the beams that are used, from straight down [rad]: beams that are more
    oblique leave shadows beside steps, which shift these."""

    cluster: float = 0.5
    "Size of the squares of ground within which errors may be alike [m]."

    drift_time: tuple[float, float] = (25.0, 60.0)
    """Times after which errors of the motion, of positions and of angles, are others: the
    autocorrelation is then 1/e [s]. That of heights is where it starts from; passes tell it."""

    drift_step: float = 0.15
    """Time from knot to knot of the broken lines that follow these errors [s]; passes that see the
    ground for longer than 24 of these have longer ones."""

    height_noise: float = 1e-4
    "Least standard deviation that the height of a cell is taken to have [m]."

    max_angle_sd: float = 5e-4
    "Standard deviation beyond which an angle counts as not observable [rad]."

    max_lever_sd: float = 3e-3
    "The same of a component of the lever arm [m]."

    max_clock_sd: float = 2e-4
    "The same of the clock [s]."

    max_iterations: int = 30
    "Rounds after which it gives up."

    screening: Screening = field(default_factory=Screening)
    "Which returns are used."

    def __post_init__(self) -> None:
        """Check the values."""
        unknown = [name for name in self.parameters if name not in NAMES]
        if unknown or not self.parameters or len(set(self.parameters)) != len(self.parameters):
            message = f"parameters must be some of {', '.join(NAMES)}, got {self.parameters}."
            raise ValueError(message)
        if self.unobservable not in ("refuse", "hold"):
            message = f"unobservable must be refuse or hold, got {self.unobservable!r}."
            raise ValueError(message)
        for name in (
            "spacing",
            "max_angle",
            "cluster",
            "drift_step",
            "height_noise",
            "max_angle_sd",
            "max_lever_sd",
            "max_clock_sd",
        ):
            if not 0 < getattr(self, name) < math.inf:
                message = f"{name} must be greater than 0, got {getattr(self, name)}."
                raise ValueError(message)
        if len(self.drift_time) != 2 or not all(0 < time < math.inf for time in self.drift_time):
            message = f"drift_time must be two times greater than 0, got {self.drift_time}."
            raise ValueError(message)
        if self.max_iterations < 1:
            message = f"max_iterations must be at least 1, got {self.max_iterations}."
            raise ValueError(message)
        if self.area and not (self.area[0] < self.area[2] and self.area[1] < self.area[3]):
            message = f"area must be west, south, east, north, got {self.area}."
            raise ValueError(message)

    @property
    def limits(self) -> Floats:
        """Standard deviations up to which each parameter counts as observable."""
        return np.array([self.max_angle_sd] * 3 + [self.max_lever_sd] * 3 + [self.max_clock_sd])
