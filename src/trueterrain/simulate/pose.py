"""True motion of the body: knots with derivatives, and quintic polynomials between them.

The pose at any time is *defined* as the quintic Hermite polynomial through value, rate and
acceleration of the two knots around it. So each virtual instrument evaluates the exact pose at its
own times, and tests do the same with ``scipy.interpolate.BPoly.from_derivatives``.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

#: Components of a pose, in this order: [m] and [rad], ISO 8855 (pitch nose-down positive).
COMPONENTS = ("east", "north", "up", "roll", "pitch", "yaw")


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseKnots:
    """Motion of the body over an interval of time; angles are unwrapped."""

    time: Float
    "Times of the knots, equally spaced, shape (n,) [s]."

    pose: Float
    "Components of the pose, shape (n, 6) [m], [rad]."

    rate: Float
    "First derivatives, shape (n, 6) [m/s], [rad/s]."

    acceleration: Float
    "Second derivatives, shape (n, 6) [m/s^2], [rad/s^2]."

    def at(self, time: npt.ArrayLike) -> tuple[Float, Float, Float]:
        """Pose, rate and acceleration at any time between the first and the last knot.

        Parameters
        ----------
        time : array_like, shape (m,)
            Times [s].

        Returns
        -------
        pose, rate, acceleration : numpy.ndarray, shape (m, 6)
            Values of the quintic and its first two derivatives.

        Raises
        ------
        ValueError
            If a time lies outside the knots.

        Examples
        --------
        >>> zero, one = np.zeros((2, 6)), np.ones((2, 6))
        >>> rising = PoseKnots(time=np.array([0.0, 1.0]), pose=np.array([[0.0] * 6, [1.0] * 6]),
        ...                    rate=one, acceleration=zero)
        >>> rising.at([0.25])[0][0, 2]
        np.float64(0.25)
        """
        time = np.asarray(time, dtype=float)
        if time.size and not (self.time[0] <= time.min() and time.max() <= self.time[-1]):
            message = (
                f"time must be from {self.time[0]} s to {self.time[-1]} s, "
                f"got {time.min()} s to {time.max()} s."
            )
            raise ValueError(message)
        piece = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, self.time.size - 2)
        step = (self.time[piece + 1] - self.time[piece])[:, None]
        x = (time - self.time[piece])[:, None] / step
        ends = (
            self.pose[piece],
            step * self.rate[piece],
            step**2 * self.acceleration[piece],
            self.pose[piece + 1],
            step * self.rate[piece + 1],
            step**2 * self.acceleration[piece + 1],
        )
        coefficients = quintic_coefficients(*ends)
        value = _evaluate_polynomial(coefficients, x)
        first = _evaluate_polynomial([n * c for n, c in enumerate(coefficients)][1:], x)
        second = _evaluate_polynomial([n * (n - 1) * c for n, c in enumerate(coefficients)][2:], x)
        return value, first / step, second / step**2


def quintic_coefficients(
    p0: Float, v0: Float, a0: Float, p1: Float, v1: Float, a1: Float
) -> tuple[Float, Float, Float, Float, Float, Float]:
    """Coefficients of the quintic on [0, 1] from value, first and second derivative at its ends.

    Parameters
    ----------
    p0, v0, a0, p1, v1, a1 : numpy.ndarray
        Values and derivatives at 0 and at 1.

    Returns
    -------
    tuple of numpy.ndarray
        Coefficients of the powers 0 to 5.
    """
    d = p1 - p0 - v0 - 0.5 * a0
    e = v1 - v0 - a0
    f = a1 - a0
    return (
        p0,
        v0,
        0.5 * a0,
        10.0 * d - 4.0 * e + 0.5 * f,
        -15.0 * d + 7.0 * e - f,
        6.0 * d - 3.0 * e + 0.5 * f,
    )


def _evaluate_polynomial(coefficients: "tuple[Float, ...] | list[Float]", x: Float) -> Float:
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total
