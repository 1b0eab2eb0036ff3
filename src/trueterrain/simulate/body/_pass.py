"""A pass: which lane of a course is driven, from where, how far and how fast."""

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
    """One drive along a lane.

    The origin of the body is on the lane and its x axis along it: the body does not slip sideways.

    Examples
    --------
    >>> from trueterrain.simulate.course import Straight
    >>> from trueterrain.simulate.speed import Constant
    >>> back = Pass(course=Straight(length=100.0), speed=Constant(speed=5.0), lane=-1.5,
    ...             reverse=True)
    >>> back.duration, back.plan([2.0])[0].round(3)
    (20.0, array([[90.   , -1.5  ,  3.142]]))
    """

    course: Course
    "The course."

    speed: Speed
    "Speed along the lane."

    lane: float = 0.0
    "Offset of the lane to the left of the course, whichever way it is driven [m]."

    reverse: bool = False
    "Whether it is driven against the direction of the course."

    start: float | None = None
    "Station at time 0 [m]; by default the begin, or the end if driven in reverse."

    length: float | None = None
    "Length to drive [m]; by default to the end of the course, or once around."

    def __post_init__(self) -> None:
        longest = self._lane.length
        if self.length is not None:
            if not (np.isfinite(self.length) and self.length > 0):
                raise ValueError(f"length must be greater than 0 m, got {self.length}.")
            if not self.course.closed and self.length > longest * (1 + 1e-9):
                raise ValueError(
                    f"length must be at most {longest:.6g} m, what is left of the course, "
                    f"got {self.length} m."
                )
        elif longest <= 0:
            raise ValueError("start must be before the end of the course; nothing is left of it.")
        _ = self.duration  # a vehicle that never arrives is refused at once

    @cached_property
    def duration(self) -> float:
        """Time that the pass takes [s]."""
        return self.speed.duration(self._lane.length if self.length is None else self.length)

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
        place = self._lane.at(distance)
        ahead = np.column_stack([np.cos(place.heading), np.sin(place.heading)])
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        out = np.empty((3, distance.size, 3))
        out[0, :, :2], out[0, :, 2] = place.position, place.heading
        out[1, :, :2], out[1, :, 2] = speed[:, None] * ahead, place.curvature * speed
        sideways = place.curvature * speed**2
        out[2, :, :2] = acceleration[:, None] * ahead + sideways[:, None] * left
        out[2, :, 2] = place.curvature_slope * speed**2 + place.curvature * acceleration
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
    def _lane(self) -> OffsetLine:
        return OffsetLine(
            course=self.course, offset=self.lane, reverse=self.reverse, start=self.start
        )
