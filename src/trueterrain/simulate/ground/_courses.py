"""Grounds along a course, and measured ground, also repeated periodically."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.schemas import check_surface
from trueterrain.simulate.course import Course
from trueterrain.simulate.ground._ground import Floats, Ground, check_finite, check_not_negative

_ROUND_OFF = 1e-9  # [1/m], [m] between equal values


@dataclass(frozen=True, kw_only=True)
class StationTable:
    """Table of a value along a course, interpolated between stations.

    Beyond the first and the last station the value is constant.

    Examples
    --------
    >>> StationTable(station=(0.0, 10.0), value=(0.0, 1.0)).at([-5.0, 5.0, 99.0])
    array([0. , 0.5, 1. ])
    """

    station: tuple[float, ...]
    "Stations, ascending [m]."
    value: tuple[float, ...]
    "Value at each of them."
    smooth: bool = True
    """Whether the slope is continuous (cubics without overshoot, Fritsch and Butland 1984) or the
    interpolation linear."""

    def __post_init__(self) -> None:
        if len(self.station) < 2 or len(self.station) != len(self.value):
            raise ValueError(
                "station and value must be of the same length of at least 2, "
                f"got {len(self.station)} and {len(self.value)}."
            )
        if not (np.isfinite(self.station).all() and np.isfinite(self.value).all()):
            raise ValueError("station and value must be finite.")
        if not (np.diff(self.station) > 0).all():
            raise ValueError("station must ascend.")

    def at(self, station: Floats) -> Floats:
        """Value at stations, shape of `station`."""
        s = np.clip(station, self.station[0], self.station[-1])
        if not self.smooth:
            return np.asarray(np.interp(s, self.station, self.value))
        return np.asarray(self._cubics(s))

    def around(self, length: float) -> "StationTable":
        """Table for a closed course, with one lap before and one after.

        Raises
        ------
        ValueError
            If it does not start at 0 and end at `length`, with the same value at both.
        """
        station, value = np.array(self.station), np.array(self.value)
        if abs(station[0]) > _ROUND_OFF or abs(station[-1] - length) > _ROUND_OFF * length:
            raise ValueError(
                f"station must be from 0 to {length:.9g} m, the length of the closed course, "
                f"got {station[0]} to {station[-1]} m."
            )
        if abs(value[-1] - value[0]) > _ROUND_OFF:
            raise ValueError(
                "value must be the same at both ends of a closed course, "
                f"got {value[0]} and {value[-1]}."
            )
        station[-1] = length
        stations = np.concatenate([station[:-1] - length, station, station[1:] + length])
        values = np.concatenate([value[:-1], value, value[1:]])
        return StationTable(
            station=tuple(stations.tolist()), value=tuple(values.tolist()), smooth=self.smooth
        )

    @cached_property
    def _cubics(self) -> Any:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.station, self.value)


@dataclass(frozen=True, kw_only=True)
class AlongCourse(Ground):
    """Ground along a course: x of a ground becomes the station u, y the offset v.

    The height is ``ground(u, v) + elevation(u) + slope u + banking(u) v`` at the nearest point of
    the course. It is discontinuous where two parts of a course are equally near.

    Examples
    --------
    A road that falls to its left by 5 %, in a left turn:

    >>> from trueterrain.simulate.course import Arc
    >>> from trueterrain.simulate.ground import Plane
    >>> bend = AlongCourse(ground=Plane(), course=Arc(radius=30.0, angle=3.0), banking=-0.05)
    >>> bend.height([0.0, 28.0], [2.0, 30.0]).round(9)
    array([-0.1, -0.1])
    """

    ground: Ground
    "Ground of a straight course along x."
    course: Course
    "The course."
    elevation: StationTable | float = 0.0
    "Height added along the course [m]."
    slope: float = 0.0
    "Slope of the course [m/m]; only for an open one."
    banking: StationTable | float = 0.0
    "Rise to the left [m/m]; a left turn that leans inwards is negative."
    seam: float = 5.0
    """Length before the end of a closed course over which the ground is blended into that of the
    start [m]; 0 leaves a step there unless `ground` is periodic."""

    def __post_init__(self) -> None:
        check_finite(self, "slope")
        check_not_negative(self, "seam")
        for name in ("elevation", "banking"):
            if not isinstance(getattr(self, name), StationTable):
                check_finite(self, name)
        if self.course.closed and self.slope != 0.0:
            raise ValueError(
                f"slope must be 0 on a closed course, which ends at the height of its start, "
                f"got {self.slope} m/m."
            )
        if self.course.closed and self.seam > self.course.length:
            raise ValueError(
                f"seam must be at most the length of the course {self.course.length:.6g} m, "
                f"got {self.seam} m."
            )
        _ = self._tables  # refuses at once a table that does not fit

    @classmethod
    def superelevated(
        cls, *, ground: Ground, course: Course, max_banking: float, **others: Any
    ) -> "AlongCourse":
        """Ground with superelevation: banked inwards in proportion to the curvature.

        Parameters
        ----------
        ground, course : Ground, Course
            As for the class.
        max_banking : float
            Banking at the maximum curvature, at least 0 [m/m].
        **others : Any
            Further parameters of the class.

        Returns
        -------
        AlongCourse
            With a banking that is linear along the clothoids.

        Raises
        ------
        ValueError
            If the curvature of the course is discontinuous, or `max_banking` is negative.

        Examples
        --------
        >>> from trueterrain.simulate.course import Oval
        >>> from trueterrain.simulate.ground import Plane
        >>> oval = Oval(straight=100.0, radius=50.0, transition=30.0)
        >>> track = AlongCourse.superelevated(ground=Plane(), course=oval, max_banking=0.1)
        >>> outside = oval.at([50.0, 200.0], -3.0).position  # in a straight and in a half circle
        >>> track.height(*outside.T).round(9)
        array([0. , 0.3])
        """
        if not (np.isfinite(max_banking) and max_banking >= 0):
            raise ValueError(f"max_banking must be at least 0 m/m, got {max_banking}.")
        parts = course._stretches()
        following = [*pairwise(parts), *([(parts[-1], parts[0])] if course.closed else [])]
        if any(abs(before.end - after.begin) > _ROUND_OFF for before, after in following):
            raise ValueError(
                "course must have clothoids between straights and arcs, so that its banking is "
                "continuous."
            )
        station, curvature = np.array(course.borders).T
        max_curvature = np.abs(curvature).max()
        level = np.zeros(curvature.size)
        banking = -max_banking * curvature / max_curvature if max_curvature > 0 else level
        table = StationTable(
            station=tuple(station.tolist()), value=tuple(banking.tolist()), smooth=False
        )
        return cls(ground=ground, course=course, banking=table, **others)

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters, with descriptions of ground and course."""
        whole = super().to_dict()
        return whole | {"ground": self.ground.to_dict(), "course": self.course.to_dict()}

    def _height(self, x: Floats, y: Floats) -> Floats:
        u, v = self.course.project(x, y)
        height = self.ground._height(u, v)
        if self.course.closed and self.seam > 0:
            begin = self.course.length - self.seam
            in_seam = np.flatnonzero(u > begin)
            if in_seam.size:
                weight = (u[in_seam] - begin) / self.seam
                weight = weight**2 * (3.0 - 2.0 * weight)
                first = self.ground._height(u[in_seam] - self.course.length, v[in_seam])
                height[in_seam] = (1.0 - weight) * height[in_seam] + weight * first
        elevation, banking = self._tables
        return height + (_table_value(elevation, u) + self.slope * u) + _table_value(banking, u) * v

    @cached_property
    def _tables(self) -> tuple[StationTable | float, StationTable | float]:
        both = self.elevation, self.banking
        if not self.course.closed:
            return both
        elevation, banking = (
            part.around(self.course.length) if isinstance(part, StationTable) else part
            for part in both
        )
        return elevation, banking


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured(Ground):
    """Measured surface as ground: bilinear between its nodes, NaN outside and in holes.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface([[0.0, 1.0], [0.0, 1.0]], easting=[0, 1], northing=[0, 1])
    >>> Measured(surface=ramp).height([0.25, 2.0], 0.5)
    array([0.25,  nan])
    """

    surface: xr.Dataset
    "Surface along a reference line, or map."

    def __post_init__(self) -> None:
        check_surface(self.surface)

    @classmethod
    def from_file(cls, path: str | Path, **others: Any) -> Self:
        """Ground from an OpenCRG file.

        Parameters
        ----------
        path : str or Path
            The file.
        **others : Any
            Further parameters of the class.

        Raises
        ------
        FormatError
            If it is damaged or not an OpenCRG file.
        """
        from trueterrain.formats import opencrg

        return cls(surface=opencrg.read(path), **others)

    def _height(self, x: Floats, y: Floats) -> Floats:
        from trueterrain.surface.evaluate import heights_at

        return np.asarray(heights_at(self.surface, x, y))

    def to_dict(self) -> dict[str, Any]:
        """Kind and parameters, and the provenance of the surface."""
        whole = super().to_dict()
        del whole["surface"]
        return whole | {"steps": provenance.provenance_steps(self.surface)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Repeated(Measured):
    """Measured surface repeated periodically: x is u from its start, y is v.

    Mirrored, every other copy is reversed, so that there is no step between them. Otherwise all
    copies have the same direction, with a step if the heights at both ends differ.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> ramp = make_surface([[0.0, 0.0], [1.0, 1.0]], u=[0, 2], v=[-1, 1], easting=[0, 2],
    ...                     northing=[0, 0])
    >>> Repeated(surface=ramp).height([0.5, 1.5, 2.5, 4.5, -0.5], 0.0)
    array([0.25, 0.75, 0.75, 0.25, 0.25])
    >>> Repeated(surface=ramp, mirrored=False).height([0.5, 1.5, 2.5, 4.5, -0.5], 0.0)
    array([0.25, 0.75, 0.25, 0.25, 0.75])
    """

    surface: xr.Dataset
    "Surface along a reference line, which is straightened."
    mirrored: bool = True
    "Whether every other copy is reversed."
    across: bool = False
    "Whether it is repeated laterally too, mirrored; otherwise there is no ground beyond it."
    part_u: tuple[float, float] | None = None
    "Range of stations to use [m]; all by default."
    part_v: tuple[float, float] | None = None
    "Range of offsets to use, for example without ragged edges [m]; all by default."

    def __post_init__(self) -> None:
        super().__post_init__()
        if "u" not in self.surface.dims:
            raise ValueError("surface must lie along a reference line, got a map.")
        for name in ("part_u", "part_v"):
            part, axis = getattr(self, name), np.asarray(self.surface[name[-1]], dtype=float)
            if part is not None and not axis[0] <= part[0] < part[1] <= axis[-1]:
                raise ValueError(
                    f"{name} must be two ascending values from {axis[0]} to {axis[-1]} m, "
                    f"got {part}."
                )

    def _height(self, x: Floats, y: Floats) -> Floats:
        from trueterrain.surface.evaluate import heights_at_uv

        (u0, u1), (v0, v1) = self._part
        u = u0 + (_fold_station(x, u1 - u0) if self.mirrored else np.remainder(x, u1 - u0))
        if self.across:
            v = v0 + _fold_station(y - v0, v1 - v0)
        else:
            v = np.where((y >= v0) & (y <= v1), y, np.inf)
        return np.asarray(heights_at_uv(self.surface, np.clip(u, u0, u1), np.maximum(v, v0)))

    @cached_property
    def _part(self) -> tuple[tuple[float, float], tuple[float, float]]:
        u, v = (np.asarray(self.surface[axis], dtype=float) for axis in "uv")
        along, across = self.part_u, self.part_v
        return (
            (float(u[0]), float(u[-1])) if along is None else along,
            (float(v[0]), float(v[-1])) if across is None else across,
        )


def _table_value(table: StationTable | float, station: Floats) -> Floats | float:
    return table.at(station) if isinstance(table, StationTable) else table


def _fold_station(x: Floats, length: float) -> Floats:
    """Reflect stations into the range from 0 to `length` (triangle wave)."""
    folded = np.remainder(x, 2.0 * length)
    return np.asarray(np.minimum(folded, 2.0 * length - folded))
