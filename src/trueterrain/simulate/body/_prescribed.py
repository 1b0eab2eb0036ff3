"""Prescribed motions: a parked body, a rigid body along a line, a function of time."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.body._motion import FormulaMotion, check_rate
from trueterrain.simulate.body._pass import PassPlan
from trueterrain.simulate.ground import Ground
from trueterrain.simulate.pose import COMPONENTS
from trueterrain.vehicle import FullCarParameters, linear_model, start_state

Float = npt.NDArray[np.float64]

_DEGREE = 5  # of the splines through poses: the acceleration is differentiable


@dataclass(frozen=True, kw_only=True)
class Wave:
    """A sine in one component of a pose: ``amplitude sin(2 pi frequency t + phase)``.

    Examples
    --------
    >>> Wave(component="up", amplitude=0.02, frequency=1.3).component
    'up'
    """

    component: str
    '``"east"``, ``"north"``, ``"up"``, ``"roll"``, ``"pitch"`` or ``"yaw"``.'

    amplitude: float
    "Amplitude [m] or [rad]."

    frequency: float
    "Frequency [Hz]."

    phase: float = 0.0
    "Phase at time 0 [rad]."

    def __post_init__(self) -> None:
        if self.component not in COMPONENTS:
            raise ValueError(
                f"component must be one of {', '.join(COMPONENTS)}, got {self.component!r}."
            )
        if not np.isfinite([self.amplitude, self.phase]).all():
            raise ValueError("amplitude and phase must be finite.")
        if not (np.isfinite(self.frequency) and self.frequency > 0):
            raise ValueError(f"frequency must be greater than 0 Hz, got {self.frequency}.")


@dataclass(frozen=True, kw_only=True)
class Parked(FormulaMotion):
    """Parked vehicle, at rest or bounced by hand.

    Bounced by 20 mm at 1.3 Hz on a flat floor, it shows the clock offsets between its instruments.

    Examples
    --------
    >>> bounced = Parked(up=0.8, waves=(Wave(component="up", amplitude=0.02, frequency=1.25),))
    >>> print(bounced.knots(0.0, 1.0).at([0.2])[0].round(6))
    [[0.   0.   0.82 0.   0.   0.  ]]
    """

    duration: float = field(default=40.0)
    "Duration [s]."

    east: float = 0.0
    "Easting of the origin of the body [m]."

    north: float = 0.0
    "Northing [m]."

    up: float = 0.6
    "Height [m]."

    roll: float = 0.0
    "Roll [rad]."

    pitch: float = 0.0
    "Pitch, nose down positive [rad]."

    yaw: float = 0.0
    "Yaw, counter-clockwise from east [rad]."

    waves: tuple[Wave, ...] = ()
    "Sines added to its pose."

    rate: float = 2000.0
    "Knots per second, at least 1000 [Hz]."

    def __post_init__(self) -> None:
        check_rate(self.rate)
        if not (np.isfinite(self.duration) and self.duration > 0):
            raise ValueError(f"duration must be greater than 0 s, got {self.duration}.")
        for name in COMPONENTS:
            if not np.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)}.")

    @classmethod
    def on_ground(
        cls,
        *,
        ground: Ground,
        vehicle: FullCarParameters,
        east: float = 0.0,
        north: float = 0.0,
        yaw: float = 0.0,
        **others: Any,
    ) -> "Parked":
        """Vehicle at rest on its suspension on the ground.

        Parameters
        ----------
        ground : Ground
            The ground, on which each wheel stands at one point.
        vehicle : FullCarParameters
            The vehicle, whose centre of gravity is the origin of the body.
        east, north, yaw : float
            Position [m] and direction [rad].
        **others : Any
            Further parameters of the class.

        Returns
        -------
        Parked
            With the height, roll and pitch of static equilibrium.

        Raises
        ------
        ValueError
            If there is no ground under a wheel.

        Examples
        --------
        >>> from trueterrain.simulate.ground import Plane
        >>> from trueterrain.vehicle import named_vehicle
        >>> stands = Parked.on_ground(ground=Plane(camber=0.02), vehicle=named_vehicle("van"))
        >>> round(stands.roll, 9), round(stands.up, 3)
        (0.02, 0.804)
        """
        x, y = vehicle.wheel_positions.T
        c, s = math.cos(yaw), math.sin(yaw)
        heights = ground.height(east + c * x - s * y, north + s * x + c * y)
        model = linear_model(vehicle)
        rest = dict(zip(model.freedoms, start_state(model, heights).displacement, strict=True))
        return cls(
            east=east,
            north=north,
            up=float(rest["heave"]) + vehicle.cg_height,
            roll=float(rest["roll"]),
            pitch=float(rest["pitch"]),
            yaw=yaw,
            **others,
        )

    def _values(self, time: Float) -> Float:
        out = np.zeros((3, time.size, 6))
        out[0] = [getattr(self, name) for name in COMPONENTS]
        _add_waves(out, time, self.waves)
        return out


@dataclass(frozen=True, kw_only=True)
class Follower(FormulaMotion):
    """Rigid body that follows a line at a constant height.

    Examples
    --------
    >>> from trueterrain.simulate.course import Straight
    >>> from trueterrain.simulate.speed import Constant
    >>> rails = Follower(drive=PassPlan(course=Straight(length=20.0), speed=Constant(speed=5.0)))
    >>> print(rails.knots(0.0, 4.0).at([1.0])[0])
    [[5. 0. 2. 0. 0. 0.]]
    """

    drive: PassPlan
    "Course, offset and speed."

    up: float = 2.0
    "Height of the origin of the body [m]."

    roll: float = 0.0
    "Roll [rad]."

    pitch: float = 0.0
    "Pitch, nose down positive [rad]."

    waves: tuple[Wave, ...] = ()
    "Sines added to its motion."

    rate: float = 2000.0
    "Knots per second, at least 1000 [Hz]."

    def __post_init__(self) -> None:
        check_rate(self.rate)
        if not np.isfinite([self.up, self.roll, self.pitch]).all():
            raise ValueError("up, roll and pitch must be finite.")

    @property
    def duration(self) -> float:
        """Time that the pass takes [s]."""
        return self.drive.duration

    def _values(self, time: Float) -> Float:
        out = np.zeros((3, time.size, 6))
        out[:, :, [0, 1, 5]] = self.drive.plan(time)
        out[0, :, 2:5] = self.up, self.roll, self.pitch
        _add_waves(out, time, self.waves)
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class Prescribed(FormulaMotion):
    """Motion given by a function of time.

    Examples
    --------
    >>> def spin(time):
    ...     pose, rate = np.zeros((2, time.size, 6))
    ...     pose[:, 5], rate[:, 5] = 0.5 * time, 0.5
    ...     return pose, rate, np.zeros_like(pose)
    >>> print(Prescribed(function=spin, end=2.0).knots(0.0, 2.0).at([1.5])[0])
    [[0.   0.   0.   0.   0.   0.75]]
    """

    function: Callable[[Float], tuple[Float, Float, Float]]
    """Returns pose, rate and acceleration, each of shape (n, 6), at times of shape (n,); each is
    the derivative of the previous one."""

    end: float
    "Time at which the motion ends [s]."

    known: tuple[float, float] = (-math.inf, math.inf)
    "First and last time at which the function is defined [s]."

    rate: float = 2000.0
    "Knots per second, at least 1000 [Hz]."

    def __post_init__(self) -> None:
        check_rate(self.rate)
        if not (np.isfinite(self.end) and self.end > 0):
            raise ValueError(f"end must be greater than 0 s, got {self.end}.")

    @classmethod
    def from_arrays(
        cls,
        time: npt.ArrayLike,
        pose: npt.ArrayLike,
        *,
        end: float | None = None,
        rate: float = 2000.0,
    ) -> "Prescribed":
        """Motion that interpolates poses by splines of degree 5.

        Parameters
        ----------
        time : array_like, shape (n,)
            Ascending times, at least 6 [s]. Let them reach beyond the begin and the end of the
            motion, which are at 0 and `end`, by the margin of the blocks.
        pose : array_like, shape (n, 6)
            Easting, northing, height [m], roll, pitch and yaw, the angles not wrapped [rad].
        end : float, optional
            Time at which the motion ends [s]; by default the last one.
        rate : float
            Knots per second, at least 1000 [Hz].

        Returns
        -------
        Prescribed
            The motion.

        Raises
        ------
        ValueError
            If a shape is wrong, a value is not finite, times do not ascend, or an angle jumps by
            more than pi.

        Examples
        --------
        >>> time = np.linspace(-1.0, 3.0, 41)
        >>> pose = np.zeros((41, 6))
        >>> pose[:, 2] = time**3
        >>> bob = Prescribed.from_arrays(time, pose, end=2.0)
        >>> print(bob.knots(0.0, 2.0).at([1.5])[2][0, 2].round(6))
        9.0
        """
        from scipy.interpolate import make_interp_spline

        t, p = np.array(time, dtype=float), np.array(pose, dtype=float)
        if t.ndim != 1 or t.size <= _DEGREE or p.shape != (t.size, 6):
            raise ValueError(
                "time must have the shape (n,), n at least 6, and pose (n, 6), "
                f"got {t.shape} and {p.shape}."
            )
        if not (np.isfinite(t).all() and np.isfinite(p).all()):
            raise ValueError("time and pose must be finite.")
        if not (np.diff(t) > 0).all():
            raise ValueError("time must ascend.")
        if np.abs(np.diff(p[:, 3:], axis=0)).max() > np.pi:
            raise ValueError("roll, pitch and yaw must not jump by 2 pi; unwrap them.")
        splines = [make_interp_spline(t, p, k=_DEGREE)]
        splines += [splines[0].derivative(n) for n in (1, 2)]

        def function(at: Float) -> tuple[Float, Float, Float]:
            value, first, second = (np.asarray(spline(at)) for spline in splines)
            return value, first, second

        return cls(
            function=function,
            end=float(t[-1]) if end is None else end,
            known=(float(t[0]), float(t[-1])),
            rate=rate,
        )

    @property
    def duration(self) -> float:
        """Time at which the motion ends [s]."""
        return self.end

    @property
    def span(self) -> tuple[float, float]:
        """Times of the first and the last knot at which the function is defined [s]."""
        first, last = self.known
        return (
            math.ceil(first * self.rate - 1e-6) / self.rate if math.isfinite(first) else first,
            math.floor(last * self.rate + 1e-6) / self.rate if math.isfinite(last) else last,
        )

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters of the motion, for provenance."""
        return super().to_dict() | {"function": getattr(self.function, "__qualname__", "")}

    def _values(self, time: Float) -> Float:
        parts = [np.asarray(part, dtype=float) for part in self.function(time)]
        if len(parts) != 3 or any(part.shape != (time.size, 6) for part in parts):
            raise ValueError(
                "function must give pose, rate and acceleration of the shape (n, 6), got "
                f"{', '.join(str(part.shape) for part in parts)} for {time.size} times."
            )
        return np.stack(parts)


def _add_waves(out: Float, time: Float, waves: Iterable[Wave]) -> None:
    for wave in waves:
        omega = 2.0 * np.pi * wave.frequency
        angle = omega * time + wave.phase
        sine, cosine = wave.amplitude * np.sin(angle), wave.amplitude * np.cos(angle)
        n = COMPONENTS.index(wave.component)
        out[0, :, n] += sine
        out[1, :, n] += omega * cosine
        out[2, :, n] -= omega**2 * sine
