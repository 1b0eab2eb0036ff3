"""Settings of the calibration of a mounting."""

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
    """Parameters, selection of returns and limits of a calibration."""

    parameters: tuple[Parameter, ...] = (
        "roll",
        "pitch",
        "yaw",
        "lever_x",
        "lever_y",
        "lever_z",
        "clock",
    )
    "Parameters to estimate; the others are held."

    unobservable: Literal["refuse", "hold"] = "refuse"
    "Treatment of a parameter that the passes do not determine: error, or hold its start value."

    spacing: float = 0.04
    "Size of the cells of ground that are compared [m]; a cell should contain at least 3 scans."

    area: tuple[float, float, float, float] | None = None
    """Ground to use: minimum easting and northing, maximum easting and northing [m]; by default all
    ground that two passes have in common."""

    max_angle: float = 0.5
    """Maximum angle of the beams from straight down [rad]: more oblique beams leave shadows next to
    steps, which displace these."""

    cluster: float = 0.5
    "Size of the squares of ground within which errors may be correlated [m]."

    drift_time: tuple[float, float] = (25.0, 60.0)
    """Correlation times of the errors of the motion, of positions and of angles [s]: the
    autocorrelation is then 1/e. That of heights is an initial value; the passes determine it."""

    drift_step: float = 0.15
    """Time from knot to knot of the piecewise linear functions that model these errors [s]; passes
    longer than 24 of these steps have longer ones."""

    height_noise: float = 1e-4
    "Minimum standard deviation of the height of a cell [m]."

    max_angle_sd: float = 5e-4
    "Standard deviation above which an angle counts as unobservable [rad]."

    max_lever_sd: float = 3e-3
    "Standard deviation above which a component of the lever arm counts as unobservable [m]."

    max_clock_sd: float = 2e-4
    "Standard deviation above which the clock counts as unobservable [s]."

    max_iterations: int = 30
    "Iterations in which the estimation must converge."

    screening: Screening = field(default_factory=Screening)
    "Selection of returns."

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
        """Standard deviations up to which each parameter counts as observable, shape (7,)."""
        return np.array([self.max_angle_sd] * 3 + [self.max_lever_sd] * 3 + [self.max_clock_sd])
