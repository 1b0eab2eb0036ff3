"""Reference paths with equally spaced reference points, and coordinates along them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from trueterrain.alignment.observations.sparse_sums import Flags, Floats
from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import make_surface
from trueterrain.geometry.grid_frame import GridFrame, grid_frame, xy_to_uv

_WIDE = 12.0  # [m] half-width of the strip in which a grid frame locates points
_BEND = 0.8  # maximum of that half-width over the minimum radius of curvature


class PathCoordinates(NamedTuple):
    """Coordinates along a path."""

    station: Floats
    "Stations [m], clipped to the ends of the path."

    offset: Floats
    "Lateral distance from the path, to the left positive [m]."

    beyond: Flags
    "Whether the position lies beyond the ends of the path."


@dataclass(frozen=True, kw_only=True, eq=False)
class ReferencePath:
    """Path with equally spaced reference points (thesis 4.3.1).

    Stations are arc lengths; on a circle polar angles times the radius.
    """

    easting: Floats
    "Eastings of the path at the reference points, shape (s,) [m]."

    northing: Floats
    "Northings, shape (s,) [m]."

    spacing: float
    "Arc length from one to the next [m]."

    closed: bool = False
    "Whether the last one is followed by the first."

    centre: tuple[float, float] | None = None
    "Easting and northing of the centre, if stations are polar [m]."

    lateral: Floats | None = None
    """Lateral distance from the path at which heights are compared, to the left positive, shape
    (s,) [m]. It follows the centre of the overlap, so that the path stays smooth. By default 0."""

    def __post_init__(self) -> None:
        """Check shapes and values."""
        if self.easting.ndim != 1 or self.easting.shape != self.northing.shape:
            message = (
                "easting and northing must be arrays of one length, got the shapes "
                f"{self.easting.shape} and {self.northing.shape}."
            )
            raise ValueError(message)
        if self.easting.size < (3 if self.closed else 2):
            message = (
                "a reference path needs at least 2 reference points, or 3 if it is closed, got "
                f"{self.easting.size}."
            )
            raise ValueError(message)
        if not (np.isfinite(self.easting).all() and np.isfinite(self.northing).all()):
            message = "reference points must be finite."
            raise ValueError(message)
        if self.lateral is not None and not (
            self.lateral.shape == self.easting.shape and np.isfinite(self.lateral).all()
        ):
            message = "lateral must hold a finite offset for each reference point."
            raise ValueError(message)
        if not 0 < self.spacing < np.inf:
            message = f"spacing must be greater than 0 m, got {self.spacing}."
            raise ValueError(message)
        if self.centre is None:
            try:
                _ = self._wide
            except SchemaError as error:
                message = f"a reference path must be smooth: {error.place}, {error.problem}."
                raise ValueError(message) from None

    @property
    def station(self) -> Floats:
        """Stations of the reference points, shape (s,) [m]."""
        return np.asarray(np.arange(self.easting.size) * self.spacing)

    @property
    def length(self) -> float:
        """Length of the path, once around if it is closed [m]."""
        return float((self.easting.size - (not self.closed)) * self.spacing)

    @cached_property
    def places(self) -> tuple[Floats, Floats]:
        """Eastings and northings where heights are compared, shape (s,) each [m]."""
        if self.lateral is None:
            return self.easting, self.northing
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        return self.easting - self.lateral * sin, self.northing + self.lateral * cos

    @cached_property
    def heading(self) -> Floats:
        """Direction of the path at its reference points, counter-clockwise from east [rad]."""
        x, y = self._extended(self.spacing)
        return np.arctan2(y[2:] - y[:-2], x[2:] - x[:-2])

    def locate(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> PathCoordinates:
        """Stations and offsets of positions.

        Parameters
        ----------
        easting, northing : array_like, shape (n,)
            Positions [m].

        Returns
        -------
        PathCoordinates
            NaN where a position is not finite.

        Examples
        --------
        >>> path = ReferencePath(easting=np.zeros(11), northing=np.arange(11.0), spacing=1.0)
        >>> station, offset, beyond = path.locate([-2.0, 0.0], [2.5, 12.0])
        >>> station, offset, beyond
        (array([ 2.5, 10. ]), array([2., 0.]), array([False, True]))
        """
        x, y = (np.ravel(np.asarray(at, dtype=float)) for at in (easting, northing))
        if self.centre is not None:
            return self._polar(x, y)
        station, offset = xy_to_uv(self._wide, x, y)
        beyond = np.zeros(x.size, np.bool_)
        lost = np.flatnonzero(np.isnan(station) & np.isfinite(x) & np.isfinite(y))
        if lost.size:
            station[lost], offset[lost] = self._nearest(x[lost], y[lost])
        if self.closed:
            return PathCoordinates(station % self.length, offset, beyond)
        beyond = (station < 0) | (station > self.length)
        return PathCoordinates(np.clip(station, 0.0, self.length), offset, beyond)

    def frame(self, half_width: float, beyond: float = 0.0) -> GridFrame:
        """Grid frame of the strip along the path.

        Parameters
        ----------
        half_width : float
            Half of its width [m].
        beyond : float
            Straight extension beyond both ends [m]; a closed path continues around.

        Returns
        -------
        GridFrame
            Its u is the station; beyond 0 and the length for a closed path.
        """
        x, y = self._extended(max(beyond, self.spacing) if beyond or self.closed else 0.0)
        added = (x.size - self.easting.size) // 2
        u = np.arange(-added, x.size - added) * self.spacing
        flat = make_surface(
            np.zeros((u.size, 2)), u=u, v=[-half_width, half_width], easting=x, northing=y
        )
        return grid_frame(flat)

    def at(self, station: npt.ArrayLike, offset: npt.ArrayLike = 0.0) -> tuple[Floats, Floats]:
        """Eastings and northings [m] of stations and offsets, the inverse of `locate`."""
        s, v = np.asarray(station, dtype=float), np.asarray(offset, dtype=float)
        x, y = self._extended(self.spacing)
        u = np.arange(-1, x.size - 1) * self.spacing
        place = np.clip((s % self.length if self.closed else s) / self.spacing, 0, x.size - 3)
        near = np.floor(place).astype(np.int64)
        nodes = np.append(self.heading, self.heading[0] if self.closed else self.heading[-1])
        turn = np.unwrap(nodes)
        heading = turn[near] + (place - near) * (turn[near + 1] - turn[near])
        return (
            np.interp(place * self.spacing, u, x) - v * np.sin(heading),
            np.interp(place * self.spacing, u, y) + v * np.cos(heading),
        )

    def _extended(self, beyond: float) -> tuple[Floats, Floats]:
        """Reference points, extended beyond both ends."""
        more = int(np.ceil(beyond / self.spacing - 1e-9))
        nodes = self.easting, self.northing
        if self.closed:
            x, y = (np.take(at, np.arange(-more, at.size + more), mode="wrap") for at in nodes)
            return x, y
        steps = np.arange(1, more + 1)
        x, y = (
            np.concatenate(
                [at[0] - (at[1] - at[0]) * steps[::-1], at, at[-1] + (at[-1] - at[-2]) * steps]
            )
            for at in nodes
        )
        return x, y

    @cached_property
    def _wide(self) -> GridFrame:
        """Strip that contains nearly all points, narrower than the radius of curvature."""
        angle = np.abs(np.diff(np.unwrap(self.heading))).max(initial=0.0)
        widest = _BEND * self.spacing / angle if angle > 0 else np.inf
        return self.frame(min(_WIDE, widest))

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import KDTree

        return KDTree(np.stack([self.easting, self.northing], axis=1))

    def _nearest(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Station and offset on the nearest chord; the outermost chords are extended."""
        _, near = self._tree.query(np.stack([x, y], axis=1))
        n = self.easting.size
        best = np.full(x.size, np.inf)
        station, offset = np.empty(x.size), np.empty(x.size)
        for begin in (near - 1, near):
            if not self.closed:
                begin = np.clip(begin, 0, n - 2)
            a, b = begin % n, (begin + 1) % n
            cx, cy = self.easting[b] - self.easting[a], self.northing[b] - self.northing[a]
            dx, dy = x - self.easting[a], y - self.northing[a]
            part = (dx * cx + dy * cy) / (cx * cx + cy * cy)
            low = np.where((begin == 0) & (not self.closed), -np.inf, 0.0)
            high = np.where((begin == n - 2) & (not self.closed), np.inf, 1.0)
            part = np.clip(part, low, high)
            away = np.hypot(dx - part * cx, dy - part * cy)
            closer = away < best
            best = np.where(closer, away, best)
            station = np.where(closer, (begin + part) * self.spacing, station)
            offset = np.where(closer, np.copysign(away, cx * dy - cy * dx), offset)
        return station, offset

    def _polar(self, x: Floats, y: Floats) -> PathCoordinates:
        assert self.centre is not None
        cx, cy = self.centre
        radius = float(np.hypot(self.easting[0] - cx, self.northing[0] - cy))
        begin = np.arctan2(self.northing[0] - cy, self.easting[0] - cx)
        sense = 1.0 if np.sin(self.heading[0] - begin) > 0 else -1.0  # counter-clockwise or not
        angle = sense * (np.arctan2(y - cy, x - cx) - begin) % (2 * np.pi)
        return PathCoordinates(
            radius * angle % self.length,
            sense * (radius - np.hypot(x - cx, y - cy)),
            np.zeros(x.size, np.bool_),
        )
