"""Speed of a virtual vehicle: distance, speed and acceleration in closed form.

They are piecewise polynomials of time, so that distances are exact integrals of speeds. The
acceleration is continuous. Before time 0 the vehicle drives at its first speed.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]


class TravelState(NamedTuple):
    """Distance, speed and acceleration of a vehicle at n times."""

    distance: Float
    "Distance driven since time 0, shape (n,) [m]."
    speed: Float
    "Speed, shape (n,) [m/s]."
    acceleration: Float
    "Acceleration, shape (n,) [m/s^2]."


class _Pieces(NamedTuple):
    """Distance as piecewise polynomials, periodic or with a last piece without end."""

    begin: Float
    "Start time of each piece, shape (n,) [s]."
    powers: Float
    "Coefficients of the powers 0 to 4 of the time since then, shape (n, 5) [m, m/s, ...]."
    period: float
    "Period [s]; infinite if not periodic."


class Speed(ABC):
    """Speed of a vehicle as a function of time."""

    @cached_property
    @abstractmethod
    def _pieces(self) -> _Pieces:
        """Polynomials from time 0 on."""

    def at(self, time: npt.ArrayLike) -> TravelState:
        """Distance, speed and acceleration.

        Parameters
        ----------
        time : array_like
            Times [s]; flattened.

        Returns
        -------
        TravelState
            At these times.

        Examples
        --------
        >>> print(Constant(speed=5.0).at([0.0, 2.0]).distance)
        [ 0. 10.]
        """
        t = np.asarray(time, dtype=float).ravel()
        begin, powers, period = self._pieces
        laps = np.zeros(t.size) if np.isinf(period) else np.maximum(np.floor(t / period), 0.0)
        since = t - laps * period if np.isfinite(period) else t
        j = np.maximum(np.searchsorted(begin, since, side="right") - 1, 0)
        x, p = since - begin[j], powers[j].T
        distance = p[0] + x * (p[1] + x * (p[2] + x * (p[3] + x * p[4])))
        speed = p[1] + x * (2 * p[2] + x * (3 * p[3] + x * 4 * p[4]))
        acceleration = 2 * p[2] + x * (6 * p[3] + x * 12 * p[4])
        before = t < 0.0
        distance[before], speed[before] = p[1][before] * t[before], p[1][before]
        acceleration[before] = 0.0
        return TravelState(distance + laps * self._per_period, speed, acceleration)

    def duration(self, length: float) -> float:
        """Time at which a vehicle that starts at time 0 has driven a length.

        Parameters
        ----------
        length : float
            Length to drive [m].

        Returns
        -------
        float
            Time [s].

        Raises
        ------
        ValueError
            If `length` is not greater than 0, or the vehicle never arrives.

        Examples
        --------
        >>> Constant(speed=5.0).duration(40.0)
        8.0
        >>> Standstill().duration(40.0)
        Traceback (most recent call last):
        ValueError: speed must lead to the end of the path: the vehicle never arrives, it comes to
        rest after 0 m of 40 m.
        """
        if not (np.isfinite(length) and length > 0):
            raise ValueError(f"length must be greater than 0 m, got {length}.")
        begin, powers, period = self._pieces
        laps, remaining = 0.0, float(length)
        if np.isfinite(period):
            laps = np.ceil(length / self._per_period) - 1.0
            remaining = length - laps * self._per_period
            ends = np.append(powers[1:, 0], self._per_period)
        else:
            ends = np.append(powers[1:, 0], np.inf)
        j = min(int(np.searchsorted(ends, remaining)), begin.size - 1)
        if np.isinf(period) and j == begin.size - 1 and not powers[j, 1:].any():
            raise ValueError(
                "speed must lead to the end of the path: the vehicle never arrives, it comes to "
                f"rest after {powers[j, 0]:g} m of {length:g} m."
            )
        last = np.append(begin[1:], period)[j]
        max_time = (
            last - begin[j] if np.isfinite(last) else (remaining - powers[j, 0]) / powers[j, 1]
        )
        return (
            float(laps * period if laps else 0.0)
            + float(begin[j])
            + _reach_distance(powers[j], remaining, float(max_time))
        )

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters, for provenance."""
        names = getattr(self, "__dataclass_fields__", {})
        return {"kind": type(self).__name__, **{name: getattr(self, name) for name in names}}

    @cached_property
    def _per_period(self) -> float:
        begin, powers, period = self._pieces
        if np.isinf(period):
            return 0.0
        return float(np.polyval(powers[-1][::-1], period - begin[-1]))


@dataclass(frozen=True, kw_only=True)
class Constant(Speed):
    """Constant speed.

    Examples
    --------
    >>> Constant(speed=10.0).at(3.0).distance
    array([30.])
    """

    speed: float
    "Speed [m/s]."

    def __post_init__(self) -> None:
        if not (np.isfinite(self.speed) and self.speed > 0):
            raise ValueError(
                "speed must be greater than 0 m/s, or the vehicle never arrives (let it stand "
                f"with Standstill), got {self.speed}."
            )

    @cached_property
    def _pieces(self) -> _Pieces:
        return _Pieces(np.zeros(1), np.array([[0.0, self.speed, 0.0, 0.0, 0.0]]), np.inf)


@dataclass(frozen=True, kw_only=True)
class Standstill(Speed):
    """Standstill at the start of the path.

    Examples
    --------
    >>> Standstill().at([0.0, 9.0]).distance
    array([0., 0.])
    """

    @cached_property
    def _pieces(self) -> _Pieces:
        return _Pieces(np.zeros(1), np.zeros((1, 5)), np.inf)


@dataclass(frozen=True, kw_only=True)
class Ramp(Speed):
    """Change from one constant speed to another.

    Over the time T of the ramp the speed follows 3 x^2 - 2 x^3, x = t / T: the acceleration is a
    parabola with zeros at both ends, at most 1.5 times its mean.

    Examples
    --------
    >>> from_rest = Ramp(begin=0.0, end=20.0, time=10.0)
    >>> from_rest.at(5.0).speed, from_rest.at(10.0).distance
    (array([10.]), array([100.]))
    """

    begin: float
    "Speed before the ramp [m/s]."

    end: float
    "Speed after it [m/s]."

    time: float | None = None
    "Duration of the ramp [s]; this or `distance` must be given."

    distance: float | None = None
    "Distance driven during the ramp [m]."

    hold: float = 0.0
    "Time driven at the first speed, from time 0 to the start of the ramp [s]."

    def __post_init__(self) -> None:
        for name in ("begin", "end", "hold"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be finite and at least 0, got {value}.")
        if self.begin == self.end == 0:
            raise ValueError(
                "one of begin and end must be greater than 0 m/s, or the vehicle never arrives."
            )
        if (self.time is None) == (self.distance is None):
            raise ValueError(
                "one of time and distance must be given, "
                f"got time={self.time} and distance={self.distance}."
            )
        for name in ("time", "distance"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be greater than 0, got {value}.")

    @cached_property
    def _pieces(self) -> _Pieces:
        mean = 0.5 * (self.begin + self.end)
        phase_time = self.time if self.time is not None else (self.distance or 0.0) / mean
        change, before = self.end - self.begin, self.begin * self.hold
        powers = [
            [0.0, self.begin, 0.0, 0.0, 0.0],
            [before, self.begin, 0.0, change / phase_time**2, -0.5 * change / phase_time**3],
            [before + mean * phase_time, self.end, 0.0, 0.0, 0.0],
        ]
        return _Pieces(np.array([0.0, self.hold, self.hold + phase_time]), np.array(powers), np.inf)


@dataclass(frozen=True, kw_only=True)
class StopAndGo(Speed):
    """Periodic stop-and-go: stand, accelerate, drive, brake, with limited jerk.

    Examples
    --------
    >>> traffic = StopAndGo(speed=8.0, drive=10.0, stand=5.0)
    >>> print(traffic.at([2.0, 15.0, 26.0]).speed.round(3))
    [0. 8. 0.]
    """

    speed: float
    "Speed between the stops [m/s]."

    drive: float
    "Time driven at that speed [s]."

    stand: float
    "Time at rest before each start, the first one included [s]."

    acceleration: float = 1.5
    "Maximum acceleration [m/s^2]."

    deceleration: float = 2.0
    "Maximum deceleration [m/s^2]."

    jerk: float = 3.0
    "Change of the acceleration per time [m/s^3]."

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "deceleration", "jerk"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be greater than 0, got {value}.")
        for name in ("drive", "stand"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be at least 0 s, got {value}.")

    @cached_property
    def _pieces(self) -> _Pieces:
        up = _eased_phases(self.speed, self.acceleration, self.jerk)
        down = [
            (time, -jerk) for time, jerk in _eased_phases(self.speed, self.deceleration, self.jerk)
        ]
        phases = [(self.stand, 0.0), *up, (self.drive, 0.0), *down]
        starts, powers = [], []
        time, distance, speed, acceleration = 0.0, 0.0, 0.0, 0.0
        for index, (phase_time, jerk) in enumerate(phases):
            if index == len(up) + 1:  # constant speed: exact values instead of rounded sums
                speed, acceleration = self.speed, 0.0
            if phase_time > 0:
                starts.append(time)
                powers.append([distance, speed, acceleration / 2, jerk / 6, 0.0])
            distance += phase_time * (
                speed + phase_time * (acceleration / 2 + phase_time * jerk / 6)
            )
            speed += phase_time * (acceleration + phase_time * jerk / 2)
            acceleration += phase_time * jerk
            time += phase_time
        return _Pieces(np.array(starts), np.array(powers), time)


def _eased_phases(change: float, acceleration: float, jerk: float) -> list[tuple[float, float]]:
    """Time and jerk of the phases that change the speed by `change`."""
    jerk_time = min(acceleration / jerk, float(np.sqrt(change / jerk)))
    return [
        (jerk_time, jerk),
        (max(change / (jerk * jerk_time) - jerk_time, 0.0), 0.0),
        (jerk_time, -jerk),
    ]


def _reach_distance(powers: Float, distance: float, max_time: float) -> float:
    """Time, from 0 to `max_time`, at which a polynomial reaches a distance."""
    from scipy.optimize import brentq

    def shortfall(x: float) -> float:
        return float(np.polyval(powers[::-1], x)) - distance

    if shortfall(max_time) <= 0.0:
        return max_time
    return 0.0 if shortfall(0.0) >= 0.0 else float(brentq(shortfall, 0.0, max_time, xtol=1e-13))
