"""Trajectory: knots of the motion of the body, and its pose between them.

The position between two knots is the cubic through both positions and velocities. The attitude is a
quaternion: between two knots it turns by the rotation vector that is a cubic through the turn from
knot to knot and the angular velocities at both. What no instrument saw is flagged, never hidden.
"""

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError

Float = npt.NDArray[np.float64]

#: Flags of knots; they add up.
MEASURED, BRIDGED, EDGE = 0, 1, 2

#: Time by which a stamp may lie beyond the first or the last knot [s]: sums of stamps, clocks and
#: delays are rounded (by 0.1 µs for GPS seconds), and the cubic goes on that far without an error.
ROUNDING = 1e-6


class Poses(NamedTuple):
    """Poses at some times."""

    position: Float
    "East, north, up of the body, shape (m, 3) [m]."

    velocity: Float
    "Its derivative, shape (m, 3) [m/s]."

    rotation: Rotation
    "Body to ground, m rotations."

    angular_velocity: Float
    "In body axes, shape (m, 3) [rad/s]."

    covariance: Float
    "Of east, north, up [m] and of small turns about these axes [rad], shape (m, 6, 6)."

    flag: npt.NDArray[np.uint8]
    "0 where measured; `BRIDGED` and `EDGE` add up."


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Motion of the body over a stretch of true time."""

    time: Float
    "True times of the knots, ascending, shape (n,) [s]."

    position: Float
    "East, north, up of the body, shape (n, 3) [m]."

    velocity: Float
    "Its derivative, shape (n, 3) [m/s]."

    quaternion: Float
    "Body to ground, scalar last, shape (n, 4)."

    angular_velocity: Float
    "In body axes, shape (n, 3) [rad/s]."

    covariance: Float
    "Of east, north, up [m] and of small turns about these axes [rad], shape (n, 6, 6)."

    flag: npt.NDArray[np.uint8]
    "0 where measured; `BRIDGED` (no instrument saw it) and `EDGE` (end of a filter) add up, (n,)."

    datum_sd: float | None = 0.0
    """Standard deviation of the height that all passes of an adjustment have in common [m], which
    `covariance` contains. 0 for a pass on its own; None where it is not known, so that `covariance`
    is relative to the datum of the adjustment."""

    def __post_init__(self) -> None:
        """Check shapes and order."""
        n = self.time.size
        shapes = {
            "time": (n,),
            "position": (n, 3),
            "velocity": (n, 3),
            "quaternion": (n, 4),
            "angular_velocity": (n, 3),
            "covariance": (n, 6, 6),
            "flag": (n,),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                message = f"{name} must have the shape {shape}, got {getattr(self, name).shape}."
                raise ValueError(message)
        if n < 2:
            message = f"a trajectory needs at least 2 knots, got {n}."
            raise ValueError(message)
        if not (np.diff(self.time) > 0).all():
            message = "time must ascend."
            raise ValueError(message)

    def covers(self, begin: npt.ArrayLike, end: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Whether the knots cover spans of time, but for `ROUNDING`.

        Parameters
        ----------
        begin, end : array_like
            True times of their begins and ends [s].

        Returns
        -------
        numpy.ndarray of bool
            False too where a time is not finite.
        """
        low, high = self.time[0] - ROUNDING, self.time[-1] + ROUNDING
        return np.asarray((np.asarray(begin) >= low) & (np.asarray(end) <= high))

    def at(self, time: npt.ArrayLike) -> Poses:
        """Poses at any times between the first and the last knot.

        Parameters
        ----------
        time : array_like, shape (m,)
            True times [s].

        Returns
        -------
        Poses
            Positions, rotations, their rates, covariances (linear between the knots) and flags
            (those of both knots).

        Raises
        ------
        ValueError
            If a time is not finite or lies outside of the knots.

        Examples
        --------
        >>> rest = np.zeros((2, 3))
        >>> ahead = Trajectory(
        ...     time=np.array([0.0, 1.0]), position=np.array([[0, 0, 0], [2.0, 0, 0]]),
        ...     velocity=np.array([[2.0, 0, 0], [2.0, 0, 0]]), angular_velocity=rest,
        ...     quaternion=np.array([[0, 0, 0, 1.0], [0, 0, 0, 1.0]]),
        ...     covariance=np.zeros((2, 6, 6)), flag=np.zeros(2, np.uint8))
        >>> ahead.at([0.25]).position[0]
        array([0.5, 0. , 0. ])
        """
        time = np.asarray(time, dtype=float)
        if time.size and not self.covers(time.min(), time.max()):
            message = (
                f"time must be from {self.time[0]:.6f} s to {self.time[-1]:.6f} s, "
                f"got {time.min():.6f} s to {time.max():.6f} s."
            )
            raise ValueError(message)
        k = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 2)
        step = (self.time[k + 1] - self.time[k])[:, None]
        x = (time - self.time[k])[:, None] / step
        position, velocity = _interpolate_hermite(
            x, step, self.position[k], self.velocity[k], self.position[k + 1], self.velocity[k + 1]
        )
        begin = Rotation.from_quat(self.quaternion[k])
        turn = (begin.inv() * Rotation.from_quat(self.quaternion[k + 1])).as_rotvec()
        w0, w1 = self.angular_velocity[k], self.angular_velocity[k + 1]
        vector, rate = _interpolate_hermite(
            x, step, np.zeros_like(turn), w0, turn, _vector_rate(turn, w1)
        )
        return Poses(
            position=position,
            velocity=velocity,
            rotation=begin * Rotation.from_rotvec(vector),
            angular_velocity=_body_rate(vector, rate),
            covariance=(1 - x[..., None]) * self.covariance[k]
            + x[..., None] * self.covariance[k + 1],
            flag=self.flag[k] | self.flag[k + 1],
        )

    def between(self, begin: float | None = None, end: float | None = None) -> "Trajectory":
        """Part of the motion, such as one lap.

        Parameters
        ----------
        begin, end : float, optional
            True times of its first and last knot at the earliest and latest [s].

        Returns
        -------
        Trajectory
            The knots between them.

        Raises
        ------
        ValueError
            If `begin` is not less than `end`.
        CoverageError
            If fewer than 2 knots lie between them.
        """
        if begin is None and end is None:
            return self
        first, last = float(self.time[0]), float(self.time[-1])
        low = first if begin is None else begin
        high = last if end is None else end
        if begin is not None and end is not None and not begin < end:
            message = f"begin must be less than end, got {begin:g} s and {end:g} s."
            raise ValueError(message)
        kept = (self.time >= low) & (self.time <= high)
        if kept.sum() < 2:
            raise CoverageError(
                f"there is no motion from {low:g} s to {high:g} s: it runs from {first:.3f} s to "
                f"{last:.3f} s",
                place="navigation",
                cure="Choose begin and end within these times.",
            )
        arrays = [entry.name for entry in fields(self) if entry.name != "datum_sd"]
        return replace(self, **{name: getattr(self, name)[kept] for name in arrays})


def _interpolate_hermite(
    x: Float, step: Float, p0: Float, v0: Float, p1: Float, v1: Float
) -> tuple[Float, Float]:
    """Cubic on [0, 1] through values and derivatives at its ends, and its derivative in time."""
    d, a, b = p1 - p0, step * v0, step * v1
    value = p0 + x * (a + x * (3 * d - 2 * a - b + x * (a + b - 2 * d)))
    rate = (a + x * (2 * (3 * d - 2 * a - b) + x * 3 * (a + b - 2 * d))) / step
    return value, rate


def _vector_rate(vector: Float, body_rate: Float) -> Float:
    """Derivative of a rotation vector whose rotation turns at a rate in its own (body) axes."""
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    half = 0.5 * angle
    with np.errstate(invalid="ignore", divide="ignore"):
        c = np.where(angle > 1e-4, (1 - half / np.tan(half)) / angle**2, 1 / 12 + angle**2 / 720)
    cross = np.cross(vector, body_rate)
    return np.asarray(body_rate + 0.5 * cross + c * np.cross(vector, cross))


def _body_rate(vector: Float, vector_rate: Float) -> Float:
    """Rate in body axes of a rotation whose vector has a derivative."""
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        small = angle <= 1e-4
        a = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(angle)) / angle**2)
        b = np.where(small, 1 / 6 - angle**2 / 120, (angle - np.sin(angle)) / angle**3)
    cross = np.cross(vector, vector_rate)
    return np.asarray(vector_rate - a * cross + b * np.cross(vector, cross))
