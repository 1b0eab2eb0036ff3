"""Grids: nodes of a surface, and the cells around them into which returns are sorted.

The cell of a node reaches half a spacing to either side, also for nodes at the edge.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.spatial import KDTree

from trueterrain.core.schemas import make_surface
from trueterrain.geometry.curve import curve_of_points
from trueterrain.geometry.grid_frame import Floats, GridFrame, xy_to_uv
from trueterrain.geometry.reference_line import ReferenceLine, require_millimetres

_MAX_NODES = 500_000_000  # of 60 bytes each with their sums
_NEAR = 16  # nodes from one entry of the search tree to the next


class GridStrips(NamedTuple):
    """Nodes of a line and the strips between them, as loops take them."""

    px: Floats
    "Eastings of the nodes, from the origin of the frame, shape (node,) [m]."

    py: Floats
    "Northings of the nodes, shape (node,) [m]."

    nx: Floats
    "East components of their cross directions, shape (node,) [1]."

    ny: Floats
    "North components of their cross directions, shape (node,) [1]."

    dx: Floats
    "East components of the directions of the strips, shape (strip,) [1]."

    dy: Floats
    "North components of the directions of the strips, shape (strip,) [1]."

    lean: Floats
    "How far the cross-section at its start leans forward per metre of offset, shape (strip,) [1]."

    widen: Floats
    "How much the strip grows longer per metre of offset, shape (strip,) [1]."

    length: Floats
    "Length, shape (strip,) [m]."


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Nodes of a surface: along a reference line, or over a map."""

    line: ReferenceLine | None
    "Reference line; None for a map."

    u: Floats
    "Stations, or eastings of a map, equally spaced, shape (u,) [m]."

    v: Floats
    "Offsets, left positive, or northings of a map, equally spaced, shape (v,) [m]."

    def __post_init__(self) -> None:
        """Check the size."""
        if self.u.size < 2 or self.v.size < 2:
            message = f"a grid needs at least 2 x 2 nodes, got {self.u.size} x {self.v.size}."
            raise ValueError(message)
        _require_size(self.u.size, self.v.size)

    @property
    def spacing(self) -> tuple[float, float]:
        """Spacing along u and along v [m]."""
        along, across = (float((axis[-1] - axis[0]) / (axis.size - 1)) for axis in (self.u, self.v))
        return along, across

    @property
    def shape(self) -> tuple[int, int]:
        """Nodes along u and along v."""
        return self.u.size, self.v.size

    def surface(self, height: Floats, *, crs: str = "", **cells: Any) -> xr.Dataset:
        """Surface on the grid.

        Parameters
        ----------
        height : numpy.ndarray, shape (u, v)
            Heights [m].
        crs : str
            Coordinate reference system.
        **cells : numpy.ndarray, shape (u, v)
            ``count``, ``sd``, ``sd_relative``, ``filled``.

        Returns
        -------
        xarray.Dataset
            Along the reference line, or over a map with northings first.
        """
        if self.line is None:
            transposed: dict[str, Any] = {name: values.T for name, values in cells.items()}
            return make_surface(height.T, easting=self.u, northing=self.v, crs=crs, **transposed)
        line = self.line
        return make_surface(
            height,
            u=self.u,
            v=self.v,
            easting=line.curve.easting,
            northing=line.curve.northing,
            elevation=line.elevation,
            crs=crs,
            **cells,
        )

    def locate(self, easting: npt.ArrayLike, northing: npt.ArrayLike) -> tuple[Floats, Floats]:
        """Grid coordinates of points, half a spacing beyond the outermost nodes too.

        Parameters
        ----------
        easting, northing : array_like, shape (point,)
            Coordinates [m].

        Returns
        -------
        u, v : numpy.ndarray, shape (point,)
            NaN outside.
        """
        if self.line is None:
            return np.asarray(easting, dtype=np.float64), np.asarray(northing, dtype=np.float64)
        return xy_to_uv(self.frame, easting, northing)

    @cached_property
    def frame(self) -> GridFrame:
        """Frame of the cells: one chord more at either end, half a spacing more across."""
        along, across = self.spacing
        v = np.array([self.v[0] - 0.5 * across, self.v[-1] + 0.5 * across])
        u = np.concatenate([[self.u[0] - along], self.u, [self.u[-1] + along]])
        if self.line is None:
            return GridFrame(curve=curve_of_points(u, u, np.zeros(u.size)), v=v)
        return GridFrame(curve=replace(self.line.curve.extend(1), s=u), v=v)

    @cached_property
    def strips(self) -> "GridStrips":
        """Nodes and cross directions of `frame`, and geometry of the strips between nodes."""
        _, x, y, nx, ny = self.frame.sections
        length = np.hypot(np.diff(x), np.diff(y))
        dx, dy = np.diff(x) / length, np.diff(y) / length
        lean = nx[:-1] * dx + ny[:-1] * dy
        widen = nx[1:] * dx + ny[1:] * dy - lean
        return GridStrips(x, y, nx, ny, dx, dy, lean, widen, length)

    def near(self, easting: Floats, northing: Floats) -> npt.NDArray[np.int64]:
        """Strip of `frame` near each point.

        Parameters
        ----------
        easting, northing : numpy.ndarray, shape (point,)
            Coordinates [m].

        Returns
        -------
        numpy.ndarray of int, shape (point,)
            The strip that holds the point, or one near it.
        """
        u, _ = xy_to_uv(self.frame, easting, northing)
        strip = np.searchsorted(self.frame.u, np.nan_to_num(u, nan=self.u[0]), side="right") - 1
        unknown = np.flatnonzero(np.isnan(u))
        if unknown.size:
            _, nearest = self._tree.query(np.stack([easting[unknown], northing[unknown]], axis=1))
            strip[unknown] = nearest * _NEAR
        return np.clip(strip, 0, self.frame.u.size - 2)

    @cached_property
    def _tree(self) -> Any:
        x, y, *_ = self.strips
        centre = 0.5 * (self.v[0] + self.v[-1])
        nx, ny = self.strips[2:4]
        return KDTree(np.stack([x + centre * nx, y + centre * ny], axis=1)[::_NEAR])


def grid_along(
    line: ReferenceLine, *, right: float = -2.0, left: float = 2.0, spacing: float | None = None
) -> Grid:
    """Grid along a reference line; its spacing along u is that of the line.

    Parameters
    ----------
    line : ReferenceLine
        The line.
    right, left : float
        Offsets of the outermost nodes, left positive [m]; rounded outwards to multiples of the
        spacing.
    spacing : float, optional
        Spacing across [m], a multiple of 1 mm; by default that of the line.

    Returns
    -------
    Grid
        Its offsets are multiples of the spacing.

    Raises
    ------
    ValueError
        If `right` is not less than `left`, the spacing is no multiple of 1 mm, or the line turns
        so sharply that the grid overlaps itself.

    Examples
    --------
    >>> from trueterrain.geometry.reference_line import straight_line
    >>> grid_along(straight_line((0, 0), (5, 0)), right=-1, left=1, spacing=0.02).shape
    (501, 101)
    """
    curve = line.curve
    step = curve.spacing if spacing is None else require_millimetres(spacing, "spacing")
    if not (np.isfinite([right, left]).all() and right < left):
        message = f"right must be less than left, got {right} and {left} m."
        raise ValueError(message)
    _require_size(len(curve), (left - right) / step + 1)
    v = _whole_multiples(right, left, step)
    kappa = curve.curvature
    sharp = np.maximum(kappa * (v[0] - 0.5 * step), kappa * (v[-1] + 0.5 * step))
    if (sharp >= 1).any():
        at = int(np.argmax(sharp))
        message = (
            f"the line turns with a radius of {1 / abs(kappa[at]):.3g} m at u = "
            f"{curve.s[at + 1]:.3f} m, so a grid from {right:g} to {left:g} m overlaps itself; "
            "smooth the line or make the grid narrower."
        )
        raise ValueError(message)
    return Grid(line=line, u=curve.s, v=v)


def grid_over(
    west: float, south: float, east: float, north: float, *, spacing: float | tuple[float, float]
) -> Grid:
    """Grid over a map.

    Parameters
    ----------
    west, south, east, north : float
        Limits of the ground that the cells are to cover [m].
    spacing : float or tuple of float
        Spacing, or spacings along easting and northing [m].

    Returns
    -------
    Grid
        Its nodes are at multiples of the spacing.

    Raises
    ------
    ValueError
        If the limits do not ascend, or a spacing is not greater than 0.

    Examples
    --------
    >>> grid_over(10.2, 5.0, 12.9, 8.0, spacing=0.5).u
    array([10. , 10.5, 11. , 11.5, 12. , 12.5, 13. ])
    """
    along, across = (spacing, spacing) if isinstance(spacing, int | float) else spacing
    if not (np.isfinite([along, across]).all() and along > 0 and across > 0):
        message = f"spacing must be greater than 0 m, got {spacing}."
        raise ValueError(message)
    if not (np.isfinite([west, south, east, north]).all() and west <= east and south <= north):
        message = f"the limits must be west, south, east, north, got {(west, south, east, north)}."
        raise ValueError(message)
    _require_size((east - west) / along + 1, (north - south) / across + 1)
    return Grid(
        line=None, u=_covering_nodes(west, east, along), v=_covering_nodes(south, north, across)
    )


def _require_size(rows: float, columns: float) -> None:
    """Raise ValueError if a grid would have too many nodes, before it is made."""
    if rows * columns > _MAX_NODES:
        message = (
            f"a grid of {rows:,.0f} x {columns:,.0f} nodes is too large; choose a coarser spacing "
            "or a part of the ground."
        )
        raise ValueError(message)


def _whole_multiples(low: float, high: float, step: float) -> Floats:
    """Multiples of a step from the last one not above `low` to the first not below `high`."""
    first, last = int(np.floor(low / step + 1e-6)), int(np.ceil(high / step - 1e-6))
    return np.round(np.arange(first, last + 1) * step, 9)


def _covering_nodes(low: float, high: float, step: float) -> Floats:
    """Nodes whose cells cover an interval, at least two."""
    first = int(np.floor(low / step + 0.5))
    last = int(np.floor(high / step + 0.5))
    if first == last:
        last += 1
    return np.asarray(np.arange(first, last + 1) * float(step))
