"""Trajectory: position and attitude of the body over time, from knots.

Between two knots the position is the cubic through both positions and velocities. The attitude is a
quaternion; between two knots it rotates by a rotation vector, a cubic through the rotation from
knot to knot and the angular velocities at both. Times that no instrument observed are flagged.
"""

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trueterrain.core.errors import CoverageError
from trueterrain.motion._inertial import BodyCoordinates, lever_height
from trueterrain.motion._inputs import CubicSeries, NavigationInput, Span, inside_spans

Float = npt.NDArray[np.float64]

#: Flags of knots, combined bitwise: no instrument observed the motion; end of a filter.
MEASURED, BRIDGED, EDGE = 0, 1, 2

#: Tolerance of times beyond the first or last knot [s]: sums of stamps, clocks and delays are
#: rounded (by 0.1 µs for GPS seconds), and extrapolating the cubic that far is exact enough.
ROUNDING = 1e-6

_KNOT_TOLERANCE = np.array([1e-5, 5e-6, 5e-6])  # [m, rad, rad] of cubics for up, roll, pitch
_KNOT_TOLERANCE_HORIZONTAL = np.array([1e-4, 1e-4, 5e-5])  # [m, m, rad] for east, north, yaw
_MAX_KNOTS = 2_000_000  # for fast navigation: 0.9 GB


class Poses(NamedTuple):
    """Position and attitude of the body at some times."""

    position: Float
    "t_gb: east, north, up of the origin of the body, shape (m, 3) [m]."

    velocity: Float
    "Derivative of the position, shape (m, 3) [m/s]."

    rotation: Rotation
    "R_gb: body to ground, m rotations."

    angular_velocity: Float
    "In body axes, shape (m, 3) [rad/s]."

    covariance: Float
    "Covariance of east, north, up [m] and of small rotations about them [rad], shape (m, 6, 6)."

    flag: npt.NDArray[np.uint8]
    "0 where measured, else `BRIDGED`, `EDGE` or both."


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """Position and attitude of the body over a span of true time."""

    time: Float
    "True times of the knots, ascending, shape (n,) [s]."

    position: Float
    "t_gb: east, north, up of the origin of the body, shape (n, 3) [m]."

    velocity: Float
    "Derivative of the position, shape (n, 3) [m/s]."

    quaternion: Float
    "R_gb: body to ground, scalar last, shape (n, 4)."

    angular_velocity: Float
    "In body axes, shape (n, 3) [rad/s]."

    covariance: Float
    "Covariance of east, north, up [m] and of small rotations about them [rad], shape (n, 6, 6)."

    flag: npt.NDArray[np.uint8]
    "0 where measured, else `BRIDGED` (not observed), `EDGE` (end of a filter) or both, (n,)."

    datum_sd: float | None = 0.0
    """Standard deviation of the height error that all passes of an adjustment have in common [m];
    `covariance` includes it. 0 for a single pass; None where it is unknown, and `covariance` is
    then relative to the datum of the adjustment."""

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
        """Whether the knots cover spans of time, within `ROUNDING`.

        Parameters
        ----------
        begin, end : array_like
            True times [s].

        Returns
        -------
        numpy.ndarray of bool
            False also where a time is not finite.
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
            (those of both knots combined).

        Raises
        ------
        ValueError
            If a time is not finite or lies outside the knots.

        Examples
        --------
        >>> rest = np.zeros((2, 3))
        >>> straight = Trajectory(
        ...     time=np.array([0.0, 1.0]), position=np.array([[0, 0, 0], [2.0, 0, 0]]),
        ...     velocity=np.array([[2.0, 0, 0], [2.0, 0, 0]]), angular_velocity=rest,
        ...     quaternion=np.array([[0, 0, 0, 1.0], [0, 0, 0, 1.0]]),
        ...     covariance=np.zeros((2, 6, 6)), flag=np.zeros(2, np.uint8))
        >>> straight.at([0.25]).position[0]
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
        # rotation vector from the knot k, in its body axes
        angle = (begin.inv() * Rotation.from_quat(self.quaternion[k + 1])).as_rotvec()
        w0, w1 = self.angular_velocity[k], self.angular_velocity[k + 1]
        vector, rate = _interpolate_hermite(
            x, step, np.zeros_like(angle), w0, angle, _vector_rate(angle, w1)
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
        """Part of the trajectory, such as one lap.

        Parameters
        ----------
        begin, end : float, optional
            True times between which knots are kept [s]; open where None.

        Returns
        -------
        Trajectory
            The knots within these times.

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
    """Cubic Hermite polynomial at x in [0, 1] of a step, and its derivative by time."""
    d, a, b = p1 - p0, step * v0, step * v1
    value = p0 + x * (a + x * (3 * d - 2 * a - b + x * (a + b - 2 * d)))
    rate = (a + x * (2 * (3 * d - 2 * a - b) + x * 3 * (a + b - 2 * d))) / step
    return value, rate


def _vector_rate(vector: Float, body_rate: Float) -> Float:
    """Derivative of a rotation vector from the angular velocity in body axes (Bortz 1971)."""
    # (1 - a/2 cot(a/2)) / a^2, by its series near 0
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    half = 0.5 * angle
    with np.errstate(invalid="ignore", divide="ignore"):
        c = np.where(angle > 1e-4, (1 - half / np.tan(half)) / angle**2, 1 / 12 + angle**2 / 720)
    cross = np.cross(vector, body_rate)
    return np.asarray(body_rate + 0.5 * cross + c * np.cross(vector, cross))


def _body_rate(vector: Float, vector_rate: Float) -> Float:
    """Angular velocity in body axes from a rotation vector and its derivative."""
    # (1 - cos a) / a^2 and (a - sin a) / a^3, by their series near 0
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        small = angle <= 1e-4
        a = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(angle)) / angle**2)
        b = np.where(small, 1 / 6 - angle**2 / 120, (angle - np.sin(angle)) / angle**3)
    cross = np.cross(vector, vector_rate)
    return np.asarray(vector_rate - a * cross + b * np.cross(vector, cross))


def assemble_trajectory(
    time: Float,
    coordinates: BodyCoordinates,
    centre: Float,
    horizontal: CubicSeries,
    horizontal_variance: Float,
    bridged: tuple[Span, ...],
    edge: tuple[float, float],
) -> Trajectory:
    """Trajectory of the origin of the body from its horizontal and vertical coordinates.

    Parameters
    ----------
    time : numpy.ndarray, shape (n,)
        Knots [s].
    coordinates : BodyCoordinates
        Height of a point of the body, roll and pitch.
    centre : numpy.ndarray, shape (3,)
        That point in the body [m].
    horizontal : CubicSeries
        East, north [m] and yaw [rad].
    horizontal_variance : numpy.ndarray, shape (n, 3)
        Their variances [m^2, m^2, rad^2].
    bridged : tuple
        Spans that an instrument did not observe [s].
    edge : tuple of float
        Times at both ends in which transients of filters decay [s].
    """
    roll, pitch = coordinates.value[:, 1], coordinates.value[:, 2]
    lever, by_roll, by_pitch = lever_height(roll, pitch, centre)
    plan, plan_rate = horizontal.value(time), horizontal.rate(time)
    up_rate = coordinates.rate[:, 0] - by_roll * coordinates.rate[:, 1]
    up_rate -= by_pitch * coordinates.rate[:, 2]
    rotation = Rotation.from_euler("ZYX", np.stack([plan[:, 2], pitch, roll], axis=1))
    flag = np.where(inside_spans(time, bridged), BRIDGED, 0).astype(np.uint8)
    flag[(time < time[0] + edge[0]) | (time > time[-1] - edge[1])] |= EDGE
    return Trajectory(
        time=time,
        position=np.stack([plan[:, 0], plan[:, 1], coordinates.value[:, 0] - lever], axis=1),
        velocity=np.stack([plan_rate[:, 0], plan_rate[:, 1], up_rate], axis=1),
        quaternion=rotation.as_quat(),
        angular_velocity=_euler_rates_to_body(
            roll, pitch, coordinates.rate[:, 1], coordinates.rate[:, 2], plan_rate[:, 2]
        ),
        covariance=_pose_covariance(
            coordinates, by_roll, by_pitch, plan[:, 2], horizontal_variance
        ),
        flag=flag,
    )


def _euler_rates_to_body(
    roll: Float, pitch: Float, roll_rate: Float, pitch_rate: Float, yaw_rate: Float
) -> Float:
    """Angular velocity in body axes from the rates of roll, pitch and yaw, shape (n, 3)."""
    a, b, c = roll_rate, pitch_rate, yaw_rate
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.stack([a - c * sp, b * cr + c * cp * sr, c * cp * cr - b * sr], axis=1)


def _pose_covariance(
    coordinates: BodyCoordinates,
    by_roll: Float,
    by_pitch: Float,
    yaw: Float,
    horizontal_variance: Float,
) -> Float:
    """Covariance of east, north, up and small rotations about them, shape (n, 6, 6)."""
    n = yaw.size
    pitch = coordinates.value[:, 2]
    # derivatives of up and the rotations by (height of the point, roll, pitch): roll rotates about
    # x of the body, pitch about the horizontal axis to its left
    design = np.zeros((n, 4, 3))
    design[:, 0, 0], design[:, 0, 1], design[:, 0, 2] = 1.0, -by_roll, -by_pitch
    design[:, 1, 1], design[:, 1, 2] = np.cos(yaw) * np.cos(pitch), -np.sin(yaw)
    design[:, 2, 1], design[:, 2, 2] = np.sin(yaw) * np.cos(pitch), np.cos(yaw)
    design[:, 3, 1] = -np.sin(pitch)
    covariance = np.zeros((n, 6, 6))
    covariance[:, 2:, 2:] = design @ coordinates.covariance @ np.swapaxes(design, 1, 2)
    covariance[:, 0, 0] = horizontal_variance[:, 0]
    covariance[:, 1, 1] = horizontal_variance[:, 1]
    covariance[:, 5, 5] += horizontal_variance[:, 2]
    return covariance


def even_knots(navigation: NavigationInput, rate: float) -> Float:
    """Equidistant knots over the navigation, `rate` of them per second at most."""
    begin, end = navigation.time[[0, -1]]
    count = max(int(np.floor((end - begin) * rate + 1e-9)), 1)
    return np.asarray(np.linspace(begin, end, count + 1))


def knots_of_navigation(
    navigation: NavigationInput, vertical: CubicSeries, horizontal: CubicSeries, rate: float
) -> tuple[Float, list[str]]:
    """Knots between which cubics follow the navigation, and a warning where they do not.

    The rates at the epochs of fast navigation contain its noise and the rounding of its numbers.
    Cubics between knots that are far apart amplify these, so the knots are refined.

    Parameters
    ----------
    navigation : NavigationInput
        Epochs.
    vertical, horizontal : CubicSeries
        Up, roll, pitch; east, north, yaw.
    rate : float
        Knots per second to begin with [Hz].
    """
    from scipy.interpolate import CubicHermiteSpline

    max_rate = 1.0 / navigation.step  # one knot for each epoch
    series_and_tolerances = (
        (vertical, _KNOT_TOLERANCE),
        (horizontal, _KNOT_TOLERANCE_HORIZONTAL),
    )
    while True:
        time = even_knots(navigation, rate)
        errors = [
            np.abs(series.value(navigation.time) - cubic(navigation.time)).max(axis=0) / tolerance
            for series, tolerance in series_and_tolerances
            for cubic in [CubicHermiteSpline(time, series.value(time), series.rate(time))]
        ]
        worst = float(np.max(errors))
        if worst <= 1.0 or rate >= max_rate:
            return time, []
        rate = min(2.0 * rate, max_rate)
        if rate * (time[-1] - time[0]) > _MAX_KNOTS:
            break
    return time, [
        f"navigation: its {max_rate:.0f} epochs per second are followed to "
        f"{1000 * worst * _KNOT_TOLERANCE[0]:.2g} mm only, with {time.size} knots: cut the run "
        "into shorter ones, or thin the navigation out"
    ]
