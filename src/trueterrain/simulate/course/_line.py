"""Chains of stretches of linear curvature (straights, arcs, clothoids), evaluated by series."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.simulate.course import _kernels

Float = npt.NDArray[np.float64]

#: Maximum change of heading within a piece [rad]: the series below are exact to round-off.
_MAX_TURN = 0.2
_POWERS = 22  # 0.2 ** 11 / 11! = 5e-16, and a clothoid turns with the square of its length
_GROUP_SIZE = 12  # [1] pieces that the projection excludes at a time


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """Part of a course with linear curvature: straight, arc or clothoid.

    Examples
    --------
    >>> Stretch(length=20.0, begin=0.0, end=0.01).turn
    0.1
    """

    length: float
    "Length [m]."

    begin: float = 0.0
    "Curvature at its start, left positive [1/m]."

    end: float = 0.0
    "Curvature at its end, left positive [1/m]."

    def __post_init__(self) -> None:
        if not (np.isfinite(self.length) and self.length > 0):
            raise ValueError(f"length must be greater than 0 m, got {self.length}.")
        for name in ("begin", "end"):
            if not np.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)} 1/m.")

    @property
    def turn(self) -> float:
        """Change of the heading along it [rad]."""
        return 0.5 * (self.begin + self.end) * self.length


class Line(NamedTuple):
    """Pieces of a line with small changes of heading; arrays of n + 1 are for the borders."""

    begin: Float
    "Station, shape (n + 1,) [m]."
    length: Float
    "Length, shape (n,) [m]."
    x: Float
    "Easting, shape (n + 1,) [m]."
    y: Float
    "Northing, shape (n + 1,) [m]."
    heading: Float
    "Heading, shape (n + 1,) [rad]."
    bend: Float
    "Curvature at the start, shape (n,) [1/m]."
    twist: Float
    "Change of the curvature per length, shape (n,) [1/m^2]."
    a: Float
    "Series along the first tangent, shape (n, powers) [m]."
    b: Float
    "Series to the left of it, shape (n, powers) [m]."


class Groups(NamedTuple):
    """Bounding circles of pieces and of groups, to exclude those that are far from a point."""

    centre_x: Float
    "Easting of the centre of each piece, shape (n,) [m]."
    centre_y: Float
    "Northing of the centre of a piece, shape (n,) [m]."
    first: npt.NDArray[np.int64]
    "First piece of each group, and the number of pieces, shape (groups + 1,)."
    x: Float
    "Easting of the centre of a group, shape (groups,) [m]."
    y: Float
    "Northing of the centre of a group, shape (groups,) [m]."
    radius: Float
    "Radius of the bounding circle of each group, shape (groups,) [m]."


def chain_stretches(
    stretches: Iterable[Stretch], east: float, north: float, heading: float
) -> Line:
    """Line of consecutive stretches from a point and a heading.

    Notes
    -----
    On a piece of length L whose heading turns by b t + g t^2 / 2, t from 0 to 1, the tangent is
    exp(i (b t + g t^2 / 2)), whose series follows from (n + 1) c_{n+1} = i (b c_n + g c_{n-1});
    its integral is the position.
    """
    length, bend, twist = np.array(
        [piece for stretch in stretches for piece in _cut_stretch(stretch)]
    ).T
    b, g = bend * length, twist * length**2
    series = np.zeros((_POWERS, length.size), dtype=complex)
    series[0] = 1.0
    for n in range(_POWERS - 1):
        before = series[n - 1] if n else 0.0
        series[n + 1] = 1j * (b * series[n] + g * before) / (n + 1)
    powers = np.zeros((length.size, _POWERS + 1), dtype=complex)
    powers[:, 1:] = (length * series).T / np.arange(1, _POWERS + 1)
    headings = heading + _running_sums(b + 0.5 * g)
    ends = np.exp(1j * headings[:-1]) * powers.sum(axis=1)
    return Line(
        begin=_running_sums(length),
        length=length,
        x=east + _running_sums(ends.real),
        y=north + _running_sums(ends.imag),
        heading=headings,
        bend=bend,
        twist=twist,
        a=np.ascontiguousarray(powers.real),
        b=np.ascontiguousarray(powers.imag),
    )


def group_pieces(line: Line) -> Groups:
    """Bounding circles of the pieces of a line and of groups of them."""
    centre = place_on_line(line, line.begin[:-1] + 0.5 * line.length, open_ended=False)
    first = np.append(np.arange(0, line.length.size, _GROUP_SIZE), line.length.size)
    x, y, radius = (np.empty(first.size - 1) for _ in range(3))
    for n, (begin, end) in enumerate(pairwise(first)):
        x[n], y[n] = centre[begin:end, 0].mean(), centre[begin:end, 1].mean()
        distance = np.hypot(centre[begin:end, 0] - x[n], centre[begin:end, 1] - y[n])
        radius[n] = (distance + 0.5 * line.length[begin:end]).max()
    return Groups(centre[:, 0].copy(), centre[:, 1].copy(), first, x, y, radius)


def place_on_line(line: Line, station: Float, *, open_ended: bool) -> Float:
    """Easting, northing, heading, curvature and its slope at stations, shape (n, 5)."""
    out = np.empty((station.size, 5))
    _kernels.place_stations(np.ascontiguousarray(station), *line, open_ended, out)
    return out


def _cut_stretch(stretch: Stretch) -> list[tuple[float, float, float]]:
    """Length, first curvature and its slope of equal pieces with small changes of heading."""
    twist = (stretch.end - stretch.begin) / stretch.length
    turn = max(abs(stretch.begin), abs(stretch.end)) * stretch.length
    number = max(int(np.ceil(turn / _MAX_TURN)), 1)
    step = stretch.length / number
    return [(step, stretch.begin + twist * step * n, twist) for n in range(number)]


def _running_sums(steps: Float) -> Float:
    return np.concatenate([[0.0], np.cumsum(steps)])
