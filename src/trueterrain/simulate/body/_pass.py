"""Plan of a pass: course, lateral offset, start, length and speed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.course import Course, OffsetLine
from trueterrain.simulate.speed import Speed

Float = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PassPlan:
    """One drive along a line at a constant offset from a course.

    The origin of the body is on the line and its x axis along it: there is no side slip.

    Examples
    --------
    >>> from trueterrain.simulate.course import Straight
    >>> from trueterrain.simulate.speed import Constant
    >>> back = PassPlan(course=Straight(length=100.0), speed=Constant(speed=5.0), lane=-1.5,
    ...                 reverse=True)
    >>> back.duration, back.plan([2.0])[0].round(3)
    (20.0, array([[90.   , -1.5  ,  3.142]]))
    """

    course: Course
    "The course."

    speed: Speed
    "Speed along the line."

    lane: float = 0.0
    "Offset of the line to the left of the course, in either direction of travel [m]."

    reverse: bool = False
    "Whether the direction of travel is against that of the course."

    start: float | None = None
    "Station at time 0 [m]; by default the start, or the end if driven in reverse."

    length: float | None = None
    "Length to drive [m]; by default to the end of the course, or once around."

    def __post_init__(self) -> None:
        available = self.offset_line.length
        if self.length is not None:
            if not (np.isfinite(self.length) and self.length > 0):
                raise ValueError(f"length must be greater than 0 m, got {self.length}.")
            if not self.course.closed and self.length > available * (1 + 1e-9):
                raise ValueError(
                    f"length must be at most {available:.6g} m, the rest of the course, "
                    f"got {self.length} m."
                )
        elif available <= 0:
            raise ValueError("start must be before the end of the course.")
        _ = self.duration  # refuses at once a vehicle that never arrives

    @cached_property
    def duration(self) -> float:
        """Time that the pass takes [s]."""
        return self.speed.duration(self.offset_line.length if self.length is None else self.length)

    def plan(self, time: npt.ArrayLike) -> Float:
        """Motion in the plane, before and after the pass as well.

        Parameters
        ----------
        time : array_like, shape (n,)
            Times [s].

        Returns
        -------
        numpy.ndarray, shape (3, n, 3)
            Easting [m], northing [m] and yaw [rad], their rates and accelerations.
        """
        distance, speed, acceleration = self.speed.at(time)
        line = self.offset_line.at(distance)
        forward = np.column_stack([np.cos(line.heading), np.sin(line.heading)])
        left = np.column_stack([-forward[:, 1], forward[:, 0]])
        # derivatives of the position: v t, then a t + kappa v^2 n (t tangent, n normal)
        out = np.empty((3, distance.size, 3))
        out[0, :, :2], out[0, :, 2] = line.position, line.heading
        out[1, :, :2], out[1, :, 2] = speed[:, None] * forward, line.curvature * speed
        centripetal = line.curvature * speed**2
        out[2, :, :2] = acceleration[:, None] * forward + centripetal[:, None] * left
        out[2, :, 2] = line.curvature_slope * speed**2 + line.curvature * acceleration
        return out

    def to_dict(self) -> dict[str, Any]:
        """Parameters of the pass, for provenance."""
        return {
            "kind": "Pass",
            "course": self.course.to_dict(),
            "speed": self.speed.to_dict(),
            "lane": self.lane,
            "reverse": self.reverse,
            "start": self.start,
            "length": self.length,
        }

    @cached_property
    def offset_line(self) -> OffsetLine:
        """Line along which the pass is driven."""
        return OffsetLine(
            course=self.course, offset=self.lane, reverse=self.reverse, start=self.start
        )
