"""Motion of the body of a vehicle on its suspension over the ground."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import CoverageError
from trueterrain.simulate.body._motion import (
    CHUNK,
    Motion,
    MotionChunk,
    check_at_least_0,
    check_rate,
)
from trueterrain.simulate.body._pass import PassPlan
from trueterrain.simulate.course import OffsetLine
from trueterrain.simulate.ground import Ground
from trueterrain.vehicle import (
    FullCarParameters,
    LinearModel,
    QuarterCarParameters,
    Tyre,
    VehicleState,
    advance_response,
    contact_heights,
    contact_margin,
    discretise_model,
    linear_model,
    start_state,
)

Float = npt.NDArray[np.float64]

_SLOPE_LENGTH = 2.5  # [m] over which the initial slope of the ground is taken
_UP, _ROLL, _PITCH = 2, 3, 4


@dataclass(frozen=True, kw_only=True)
class WheelPaths:
    """Mean heights under the wheels as functions of the distance of the body along its line.

    They are computed at whole multiples of `spacing`, so that they are independent of the speed,
    and interpolated linearly.
    """

    ground: Ground
    "The ground."

    line: OffsetLine
    "Line that the origin of the body follows."

    wheels: tuple[tuple[str, float, float], ...]
    "Name of each wheel, and its position in the body: x forward, y left [m]."

    tyre: Tyre
    "The contact patch."

    spacing: float
    "Sampling distance along the line [m]."

    def heights(self, distance: Float) -> Float:
        """Height of each wheel, shape (n, wheels) [m].

        Raises
        ------
        CoverageError
            If there is no ground under a wheel.
        """
        first = int(np.floor(distance.min() / self.spacing))
        last = int(np.floor(distance.max() / self.spacing)) + 1
        node = distance / self.spacing - first
        before = np.minimum(node.astype(np.int64), last - first - 1)
        fraction = (node - before)[:, None]
        table = self._table(first, last)
        return np.asarray((1.0 - fraction) * table[before] + fraction * table[before + 1])

    def _table(self, first: int, last: int) -> Float:
        """Heights for the body at `first` to `last` times the spacing."""
        margin = contact_margin(self.spacing, self.tyre.patch_length)
        placement = self.line.at(np.arange(first - margin, last + margin + 1) * self.spacing)
        c, s = np.cos(placement.heading)[:, None], np.sin(placement.heading)[:, None]
        east, north = placement.position[:, :1], placement.position[:, 1:]
        out = np.empty((last - first + 1, len(self.wheels)))
        for n, (name, x, y) in enumerate(self.wheels):
            v = y + self.tyre.offsets
            px, py = east + x * c - v * s, north + x * s + v * c
            heights = self.ground.height(px, py)
            if not np.isfinite(heights).all():
                i, j = np.argwhere(~np.isfinite(heights))[0]
                raise CoverageError(
                    f"there is no ground under the wheel {name}",
                    place=f"easting {px[i, j]:.3f} m, northing {py[i, j]:.3f} m",
                    cure="Drive where there is ground, start later or end earlier, or repeat the "
                    "measured surface",
                )
            out[:, n] = contact_heights(heights, self.spacing, self.tyre.patch_length)
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyMotion(Motion):
    """Motion of a vehicle on its suspension that drives a pass over the ground.

    In the plane the origin of the body follows the line exactly. Vertically the wheels follow the
    ground under their contact patches, at their positions by the yaw, and the body responds as the
    linear model of the vehicle, integrated exactly for wheel heights that are linear between knots.
    Heights are absolute: on a road with a slope of i the body has a pitch of -i, on one whose left
    side is higher by i a roll of i. The small-angle model neglects that i is a tangent, that
    lateral and longitudinal acceleration tilt the body, and that a tilted body moves its wheels.

    The origin of a full car is the centre of gravity of the body, at rest `cg_height` of its
    parameters above level ground. A quarter car has no pitch and roll: the heave of the one at
    `wheel` is that of the whole body, whose origin is `origin_height` above level ground (the
    motion of the laser in Smith 2009, Fig. 3-11 and 3-20).

    The vehicle starts `run_in` seconds before time 0, in static equilibrium on the slope of the
    ground; so there must be ground before the start and after the end.

    Examples
    --------
    >>> from trueterrain.simulate.course import Straight
    >>> from trueterrain.simulate.ground import Plane
    >>> from trueterrain.simulate.speed import Constant
    >>> from trueterrain.vehicle import named_vehicle
    >>> climb = BodyMotion(drive=PassPlan(course=Straight(length=50.0), speed=Constant(speed=10.0)),
    ...                    ground=Plane(slope=0.05), vehicle=named_vehicle("van"))
    >>> print(climb.knots(0.0, 5.0).at([4.0])[0].round(4))
    [[40.      0.      2.8045  0.     -0.05    0.    ]]
    """

    drive: PassPlan
    "Course, offset and speed."

    ground: Ground
    "The ground."

    vehicle: FullCarParameters | QuarterCarParameters
    "The vehicle."

    tyre: Tyre = field(default_factory=Tyre)
    "Contact patch of its tyres."

    wheel: tuple[float, float] = (0.0, 0.0)
    "Position of the wheel of a quarter car in the body: x forward, y left [m]."

    origin_height: float = 0.6
    "Height of the origin of a quarter car above level ground at rest [m]."

    rate: float = 2000.0
    "Knots per second, at least 1000 [Hz]."

    run_in: float = 2.0
    "Time driven before time 0, in which transients decay [s]."

    run_out: float = 0.5
    "Time driven after the end [s]."

    spacing: float = 0.005
    "Sampling distance of the heights along the wheel paths [m]."

    def __post_init__(self) -> None:
        check_rate(self.rate)
        check_at_least_0("s", run_in=self.run_in, run_out=self.run_out)
        if not (np.isfinite(self.spacing) and self.spacing > 0):
            raise ValueError(f"spacing must be greater than 0 m, got {self.spacing}.")
        if not np.isfinite([*self.wheel, self.origin_height]).all():
            raise ValueError("wheel and origin_height must be finite.")

    @property
    def duration(self) -> float:
        """Time that the pass takes [s]."""
        return self.drive.duration

    @property
    def span(self) -> tuple[float, float]:
        """First and last time at which the motion is known [s]."""
        first, last = self._knots_known
        return first / self.rate, last / self.rate

    @property
    def height(self) -> float:
        """Height of the origin of the body above level ground at rest [m]."""
        if isinstance(self.vehicle, QuarterCarParameters):
            return self.origin_height
        return self.vehicle.cg_height

    def wheel_heights(self, time: npt.ArrayLike) -> Float:
        """Input of each wheel: mean height of the ground under its contact patch.

        Parameters
        ----------
        time : array_like, shape (n,)
            Times [s].

        Returns
        -------
        numpy.ndarray, shape (n, wheels)
            Heights [m]: front left, front right, rear left, rear right.

        Raises
        ------
        CoverageError
            If there is no ground under a wheel.
        """
        return self._paths.heights(self.drive.speed.at(time).distance)

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters of the motion, for provenance."""
        vehicle = {"kind": type(self.vehicle).__name__, **asdict(self.vehicle)}
        return super().to_dict() | {"vehicle": vehicle, "tyre": asdict(self.tyre)}

    def _chunks(self, first: int) -> Iterator[MotionChunk]:
        """Chunks from the start of the run-in, since the state depends on all earlier inputs."""
        del first
        begin, last = self._knots_known
        size = round(CHUNK * self.rate)
        discrete = discretise_model(self._model, 1.0 / self.rate)
        state: VehicleState | None = None
        for knot in range(begin, last + 1, size):
            time = np.arange(knot, min(knot + size, last + 1)) / self.rate
            heights = self.wheel_heights(time)
            if state is None:
                state = self._start(time[0], heights[0])
                response, end = advance_response(discrete, state, heights[1:])
                parts = [
                    np.vstack([before, after])
                    for before, after in zip(
                        (state.displacement, state.velocity, state.acceleration),
                        response,
                        strict=True,
                    )
                ]
                state = end
            else:
                response, state = advance_response(discrete, state, heights)
                parts = list(response)
            yield MotionChunk(knot, self._pose_derivatives(time, np.stack(parts)))

    def _pose_derivatives(self, time: Float, response: Float) -> Float:
        """All components of the pose from the response of the model, shape (3, n, coordinates)."""
        out = np.zeros((3, time.size, 6))
        out[:, :, [0, 1, 5]] = self.drive.plan(time)
        names = self._model.freedoms
        out[:, :, _UP] = response[:, :, names.index("heave")]
        out[0, :, _UP] += self.height
        for component, name in ((_ROLL, "roll"), (_PITCH, "pitch")):
            if name in names:
                out[:, :, component] = response[:, :, names.index(name)]
        return out

    def _start(self, time: float, heights: Float) -> VehicleState:
        """Static equilibrium on the ground, moving with its slope."""
        distance, speed, _ = self.drive.speed.at(time)
        ends = self._paths.heights(distance[0] + np.array([0.0, _SLOPE_LENGTH]))
        slope = (ends[1] - ends[0]).mean() / _SLOPE_LENGTH
        return start_state(self._model, heights, wheel_rates=speed[0] * slope)

    @cached_property
    def _knots_known(self) -> tuple[int, int]:
        return (
            -int(np.ceil(self.run_in * self.rate)),
            int(np.ceil((self.duration + self.run_out) * self.rate)),
        )

    @cached_property
    def _model(self) -> LinearModel:
        return linear_model(self.vehicle)

    @cached_property
    def _paths(self) -> WheelPaths:
        if isinstance(self.vehicle, QuarterCarParameters):
            positions = np.array([self.wheel])
        else:
            positions = self.vehicle.wheel_positions
        wheels = tuple(
            (name, float(x), float(y))
            for name, (x, y) in zip(self._model.wheels, positions, strict=True)
        )
        return WheelPaths(
            ground=self.ground,
            line=self.drive.offset_line,
            wheels=wheels,
            tyre=self.tyre,
            spacing=self.spacing,
        )
