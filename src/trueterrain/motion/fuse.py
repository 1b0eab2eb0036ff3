"""Fusion: where the body was at any time, from navigation and accelerometers together.

=============  ===================================================================================
`method`       what it does
=============  ===================================================================================
`navigation`   navigation alone, interpolated
`thesis`       navigation low-passed and accelerometers high-passed at 10 Hz by causal Butterworth
               filters and integrated twice, as in the thesis (2.3): distorts the wheel hop
`zero-phase`   the same crossover without delay, exactly complementary
`wiener`       zero-phase with the best crossover for the noise of both instruments
`rts`          a Kalman filter and Rauch-Tung-Striebel smoother with biases, errors of scale and
               clock of the accelerometers, and the drift of navigation, as unknowns
=============  ===================================================================================

East, north and yaw come from navigation, smoothed without delay: by rts as far as the vehicle's own
motion allows (see `trueterrain.motion._adaptive`), else in a fixed window. An accelerometer that
reads along z of the body feels gravity, centripetal and braking terms too; all are taken into
account (see `trueterrain.motion._heave`). Three that are not in line tell height, roll and pitch,
fewer the height alone.

Sources: H. Smith III (2009) section 2.3; Smyth and Wu (2007), Karamihas (2021) for the multi-rate
filter with smoothing; Bierman (1973) for the form of the smoother.
"""

import math
import warnings
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.motion._inputs import AccelerometerInput, NavigationInput
from trueterrain.motion._noise import InstrumentNoise
from trueterrain.motion.trajectory import Trajectory

Float = npt.NDArray[np.float64]

Method = Literal["navigation", "thesis", "zero-phase", "wiener", "rts"]
Three = tuple[float, float, float]

#: Time of correlation of the drift of up [s], as two drives over one road show it (Boreas data
#: set), and of roll and pitch [s], an assumption.
DRIFT_TIME: Three = (25.0, 60.0, 60.0)

_COVARIANCE = ("east", "north", "up", "about_east", "about_north", "about_up")


@dataclass(frozen=True, kw_only=True)
class FusionSettings:
    """How motion is found from navigation and accelerometers."""

    method: Method = "rts"
    "navigation, thesis, zero-phase, wiener or rts."

    rate: float = 1000.0
    "Knots per second: every so manieth sample of the accelerometers [Hz]."

    crossover: float = 10.0
    "Crossover of thesis and zero-phase [Hz]."

    order: int = 4
    "Order of their Butterworth filters."

    smoothing_window: float | None = None
    """Window in which east, north and yaw are smoothed [s]. By default rts smooths them as far as
    the vehicle's own motion, found in the run, allows: over seconds at a steady speed; other
    methods take 0.2 s."""

    accelerometer_delay: float = 0.0
    "Delay of the accelerometers' filter against aliases, besides their clock [s]."

    accelerometer_clock_rate: float = 0.0
    "Growth of what is added to their stamps, from the first epoch of navigation on [s/s]."

    accelerometer_delay_sd: float = 0.001
    "How surely it and their clock are known; rts finds the rest [s]."

    gravity: float | None = None
    "Gravity [m/s^2]; by default that of the ellipsoid at the origin of the run."

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
    """Standard deviations of east, north, up [m], roll, pitch and yaw [rad] of navigation, where it
    reports none."""

    navigation_noise: Three | None = None
    "White noise of up [m], roll and pitch [rad] of navigation; measured in the run by default."

    drift_time: Three | None = None
    """Time of correlation of the drift of up, roll and pitch [s]; by default measured where the
    drift shows in the run, else 25 s for up and 60 s for roll and pitch."""

    accelerometer_noise: float | None = None
    "White noise of an accelerometer, one-sided [m/s^2/sqrt(Hz)]; measured in the run by default."

    bias_sd: float = 0.1
    "Standard deviation of the bias of an accelerometer [m/s^2]."

    bias_walk: float = 2e-5
    "Of its random walk after 1 s [m/s^2/sqrt(s)]."

    scale_sd: float = 0.001
    "Of the error of scale of an accelerometer [1]."

    bridge_density: float = 1.0
    "Two-sided density of the acceleration of a body that nothing saw [m^2/s^3]."

    bridge_turn_density: float = 0.05
    "The same of roll, pitch and yaw [rad^2/s^3]."

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


@dataclass(frozen=True, kw_only=True, eq=False)
class FusedMotion:
    """The motion of a run, and how it was found."""

    trajectory: Trajectory
    "Knots of the motion."

    method: Method
    "How it was found."

    noise: InstrumentNoise | None
    "Noise of the instruments as it was used; None for navigation alone."

    crossover: Three | None
    "Where navigation and accelerometers are equally noisy: up, roll, pitch [Hz]."

    drift: Float | None
    "Drift of up, roll and pitch of navigation at the knots, by rts, shape (n, 3) [m, rad, rad]."

    bias: tuple[float, ...] | None
    "Biases of the accelerometers at the end, by rts [m/s^2]."

    delay: tuple[float, float] | None
    """By how much the accelerometers are later than was said, and its standard deviation, by rts
    [s]."""

    normalised_innovation_squared: Three | None
    """Mean square of what navigation says beyond the prediction of rts over what was expected, for
    up, roll, pitch: near 1 if the noise is what it is taken for."""

    gaps: tuple[tuple[str, float, float], ...]
    "What has gaps, and between which times [s]."

    problems: tuple[str, ...]
    "What is flagged, in words."

    def to_dict(self) -> dict[str, Any]:
        """What was found, as JSON takes it."""
        t = self.trajectory
        sd = np.median(np.sqrt(np.einsum("nii->ni", t.covariance)), axis=0)
        return {
            "method": self.method,
            "time": [float(t.time[0]), float(t.time[-1])],
            "knots": int(t.time.size),
            "sd": dict(zip(_COVARIANCE, sd.tolist(), strict=True)),
            "noise": None if self.noise is None else asdict(self.noise),
            "crossover": self.crossover,
            "bias": self.bias,
            "delay": self.delay,
            "normalised_innovation_squared": self.normalised_innovation_squared,
            "gaps": [list(gap) for gap in self.gaps],
            "problems": list(self.problems),
        }


def fuse_motion(run: xr.DataTree, *, settings: FusionSettings | None = None) -> FusedMotion:
    """Motion of the body over a run.

    Parameters
    ----------
    run : xarray.DataTree
        Run with ``navigation`` and, unless the method is navigation, ``accelerometers``.
    settings : FusionSettings, optional
        Method and parameters; by default rts.

    Returns
    -------
    FusedMotion
        Trajectory over the time of the navigation, with its covariance and flags, and a report.

    Raises
    ------
    SchemaError
        If times are not finite, run backward, or the clock of the navigation jumps.
    CoverageError
        If there are too few epochs, a gap is longer than `max_gap`, or the method needs
        accelerometers and there are none (rts then warns and goes by navigation).

    Examples
    --------
    >>> from trueterrain.formats.navigation import make_navigation
    >>> time = np.arange(0.0, 2.0, 0.005)
    >>> still = dict.fromkeys(("north", "up", "roll", "pitch", "yaw"), np.zeros(time.size))
    >>> navigation = make_navigation({"time": time, "east": 5.0 * time, **still})
    >>> run = xr.DataTree.from_dict({"navigation": navigation})
    >>> motion = fuse(run, settings=FusionSettings(method="navigation"))
    >>> motion.trajectory.at([1.0012]).position
    array([[5.006, 0.   , 0.   ]])
    """
    from trueterrain.motion import _fuse
    from trueterrain.motion._inputs import read_accelerometers, read_navigation
    from trueterrain.motion.clocks import accelerometer_clock

    settings = FusionSettings() if settings is None else settings
    navigation = read_navigation(run)
    _refuse_long_gaps(navigation, settings)
    problems = [f"navigation: {navigation.dropped} epochs are left out: not finite or alone"]
    problems = problems if navigation.dropped else []
    sensors = None
    if settings.method != "navigation":
        clock = accelerometer_clock(
            run,
            delay=settings.accelerometer_delay,
            rate=settings.accelerometer_clock_rate,
            begin=float(navigation.time[0]),
        )
        sensors = read_accelerometers(run, clock)
        sensors = _overlapping_samples(sensors, navigation)
    if settings.method != "navigation" and sensors is None:
        rule = "the run has no accelerometers that were on while the navigation was"
        if settings.method != "rts":
            raise CoverageError(
                f"{rule}, which the method {settings.method} needs", cure="Use method navigation."
            )
        warnings.warn(f"{rule}; its motion is that of navigation alone", stacklevel=2)
        problems.append(rule)
    return _fuse.fuse_inputs(run, navigation, sensors, settings, problems)


def _refuse_long_gaps(navigation: NavigationInput, settings: FusionSettings) -> None:
    for begin, end in navigation.gaps:
        if end - begin > settings.max_gap:
            raise CoverageError(
                f"has a gap of {end - begin:.3f} s at {begin:.6f} s, longer than max_gap, "
                f"{settings.max_gap:g} s",
                place="group navigation",
                cure="Cut the run there, or raise max_gap.",
            )


def _overlapping_samples(
    sensors: AccelerometerInput | None, navigation: NavigationInput
) -> AccelerometerInput | None:
    """Accelerometers if at least 4 samples lie within the navigation."""
    if sensors is None:
        return None
    inside = (sensors.time >= navigation.time[0]) & (sensors.time <= navigation.time[-1])
    return sensors if np.count_nonzero(inside) >= 4 else None
