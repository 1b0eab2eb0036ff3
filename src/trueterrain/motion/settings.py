"""Settings of the fusion of navigation and accelerometers."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

Method = Literal["navigation", "thesis", "zero-phase", "wiener", "rts"]
Three = tuple[float, float, float]

#: Correlation time of the drift of up [s], as observed in two drives over one road (Boreas data
#: set), and of roll and pitch [s], assumed.
DRIFT_TIME: Three = (25.0, 60.0, 60.0)


@dataclass(frozen=True, kw_only=True)
class FusionSettings:
    """Method and parameters of the fusion of navigation and accelerometers."""

    method: Method = "rts"
    """Method by which the motion is estimated: rts (most accurate), wiener, zero-phase, thesis, or
    navigation alone."""

    rate: float = 1000.0
    "Knots per second [Hz]: every n-th accelerometer sample becomes a knot."

    crossover: float = 10.0
    "Crossover frequency of thesis and zero-phase [Hz]."

    order: int = 4
    "Order of the Butterworth filters of thesis and zero-phase."

    smoothing_window: float | None = None
    """Window over which east, north and yaw are smoothed [s]. By default rts adapts the smoothing
    to the motion of the vehicle, over seconds at a steady speed; other methods take 0.2 s."""

    accelerometer_delay: float = 0.0
    "Delay of the anti-alias filter of the accelerometers, in addition to their clock offset [s]."

    accelerometer_clock_rate: float = 0.0
    "Drift of the accelerometer clock, counted from the first epoch of navigation [s/s]."

    accelerometer_delay_sd: float = 0.001
    "Standard deviation of delay and clock offset; rts estimates the remaining error [s]."

    gravity: float | None = None
    "Gravity [m/s^2]; by default normal gravity at the origin of the run."

    max_gap: float = 10.0
    "Longest gap in navigation that is bridged [s]."

    navigation_sd: tuple[float, float, float, float, float, float] = (
        0.02,
        0.02,
        0.03,
        0.00025,
        0.00025,
        0.0005,
    )
    """Standard deviations of east, north, up [m], roll, pitch and yaw [rad] of navigation, used
    where navigation reports none."""

    navigation_noise: Three | None = None
    "White noise of up [m], roll and pitch [rad] of navigation; by default estimated from the run."

    drift_time: Three | None = None
    """Correlation time of the drift of up, roll and pitch [s]; by default estimated where the run
    shows the drift, else 25 s for up and 60 s for roll and pitch."""

    accelerometer_noise: float | None = None
    """White noise of an accelerometer, one-sided [m/s^2/sqrt(Hz)]; by default estimated from the
    run."""

    bias_sd: float = 0.1
    "Standard deviation of the bias of an accelerometer [m/s^2]."

    bias_walk: float = 2e-5
    "Random walk of the bias: standard deviation after 1 s [m/s^2/sqrt(s)]."

    scale_sd: float = 0.001
    "Standard deviation of the scale error of an accelerometer [1]."

    bridge_density: float = 1.0
    "Two-sided spectral density of the unobserved acceleration of the body in a gap [m^2/s^3]."

    bridge_turn_density: float = 0.05
    "The same of the angular acceleration of roll, pitch and yaw [rad^2/s^3]."

    def __post_init__(self) -> None:
        """Check the values."""
        if self.method not in get_args(Method):
            message = f"method must be one of {', '.join(get_args(Method))}, got {self.method!r}."
            raise ValueError(message)
        for name in (
            "rate",
            "crossover",
            "smoothing_window",
            "max_gap",
            "bias_sd",
            "scale_sd",
            "accelerometer_delay_sd",
        ):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                message = f"{name} must be greater than 0, got {value}."
                raise ValueError(message)
        if self.order < 1 or not self.crossover < 0.5 * self.rate:
            message = (
                "order must be at least 1 and crossover below half of rate, "
                f"got {self.order} and {self.crossover} Hz of {self.rate} Hz."
            )
            raise ValueError(message)
        for name in ("navigation_sd", "navigation_noise", "drift_time"):
            values = getattr(self, name)
            if values is not None and not all(0 < value < math.inf for value in values):
                message = f"{name} must be greater than 0, got {values}."
                raise ValueError(message)
