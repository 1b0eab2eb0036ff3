"""Where the nodes of a surface lie on the ground, and which node lies where."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.geometry import _kernels
from trueterrain.geometry._kernels import CrossSections
from trueterrain.geometry._strips import EDGE as EDGE
from trueterrain.geometry._strips import Strips
from trueterrain.geometry.curve import PlaneCurve, curve_of_points

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class GridFrame:
    """Geometry of a surface: its node (i, j) lies at offset ``v[j]`` in cross-section i of a curve.

    A curve alone has no width: the frame adds the offsets, and the index by which points are
    located between them. For a map, the curve is its easting axis, and v its northing axis.
    """

    curve: PlaneCurve
    "Reference line, with a point for each row of nodes."

    v: Floats
    "Offsets across, left positive, shape (v,) [m]."

    @property
    def u(self) -> Floats:
        """Stations of the cross-sections, shape (u,) [m]."""
        return self.sections.station

    @property
    def sections(self) -> CrossSections:
        """Cross-sections of the curve."""
        return self.curve.sections

    @cached_property
    def strips(self) -> Strips:
        """Strips between the cross-sections, from the first to the last offset."""
        return Strips(self.sections, self.v[0], self.v[-1])

    @property
    def edge(self) -> float:
        """Distance within which a point is on the edge of the surface [m]."""
        return self.strips.edge

    def nodes(self, rows: slice = slice(None)) -> tuple[Floats, Floats]:
        """Easting and northing of nodes.

        Parameters
        ----------
        rows : slice
            Cross-sections; by default all.

        Returns
        -------
        easting, northing : numpy.ndarray, shape (u, v)
            Coordinates [m].
        """
        _, x, y, nx, ny = (at[rows, None] for at in self.sections)
        return x + self.v * nx, y + self.v * ny


def grid_frame(surface: xr.Dataset) -> GridFrame:
    """Geometry of a surface.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Returns
    -------
    GridFrame
        Its cross-sections and offsets.

    Raises
    ------
    SchemaError
        If two nodes of the reference line coincide or it doubles back at a node.

    Notes
    -----
    Across each node of the line runs a cross-section along the bisector of its two chords. For
    chords of equal length this is the map of the ASAM OpenCRG standard.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> bend = make_surface(np.zeros((3, 2)), u=[0, 1, 2], v=[0, 1], easting=[0, 1, 1],
    ...                     northing=[0, 0, 1])
    >>> frame = grid_frame(bend)
    >>> frame.sections.normal_easting, frame.sections.normal_northing
    (array([-0., -1., -1.]), array([1., 1., 0.]))
    """
    if "u" in surface.dims:
        u, easting, northing, heading = (
            _contiguous_floats(surface[name]) for name in ("u", "easting", "northing", "heading")
        )
        curve = PlaneCurve(
            s=u, easting=easting, northing=northing, heading=heading, length=float(u[-1] - u[0])
        )
        v = _contiguous_floats(surface["v"])
    else:
        axis = _contiguous_floats(surface["easting"])
        curve = curve_of_points(axis, axis, np.zeros(axis.size))
        v = _contiguous_floats(surface["northing"])
    _ = curve.sections  # raises where the line has none
    return GridFrame(curve=curve, v=v)


def uv_to_xy(frame: GridFrame, u: npt.ArrayLike, v: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Ground coordinates of grid coordinates.

    Parameters
    ----------
    frame : GridFrame
        Geometry of the surface.
    u, v : array_like
        Station along and offset across the reference line [m], of shapes that broadcast.

    Returns
    -------
    easting, northing : ndarray
        Coordinates [m]; straight on beyond both ends and beyond the sides.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface(np.zeros((2, 2)), u=[0, 10], v=[-1, 1], easting=[5, 5],
    ...                     northing=[0, 10])
    >>> uv_to_xy(grid_frame(road), 2.5, 1.0)
    (array(4.), array(2.5))
    """
    u, v, shape = _broadcast_flat(u, v)
    easting, northing = np.empty(u.size), np.empty(u.size)
    _kernels.place_points(frame.sections, u, v, easting, northing)
    return easting.reshape(shape), northing.reshape(shape)


def xy_to_uv(
    frame: GridFrame, easting: npt.ArrayLike, northing: npt.ArrayLike
) -> tuple[Floats, Floats]:
    """Grid coordinates of ground coordinates, the inverse of `uv_to_xy`.

    Parameters
    ----------
    frame : GridFrame
        Geometry of the surface.
    easting, northing : array_like
        Coordinates [m], of shapes that broadcast.

    Returns
    -------
    u, v : ndarray
        Station along and offset across the reference line [m]; NaN outside the surface. Points
        within ``frame.edge`` of its edge are inside.

    Notes
    -----
    Where a road overlaps itself, the part whose reference line is nearest answers, so the result
    does not depend on the order of the points.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface(np.zeros((2, 2)), u=[0, 10], v=[-1, 1], easting=[5, 5],
    ...                     northing=[0, 10])
    >>> xy_to_uv(grid_frame(road), [4.0, 0.0], [2.5, 2.5])
    (array([2.5, nan]), array([ 1., nan]))
    """
    x, y, shape = _broadcast_flat(easting, northing)
    u, v = frame.strips.locate(x, y)
    return u.reshape(shape), v.reshape(shape)


def interpolate_bilinear(
    frame: GridFrame, height: Floats, u: npt.ArrayLike, v: npt.ArrayLike
) -> Floats:
    """Heights between the nodes of a grid, bilinear.

    Parameters
    ----------
    frame : GridFrame
        Geometry of the grid.
    height : numpy.ndarray, shape (u, v)
        Heights of the nodes [m].
    u, v : array_like
        Coordinates of the points on the grid [m]; broadcast.

    Returns
    -------
    numpy.ndarray
        NaN outside the grid, and where a node that carries weight has no height [m].
    """
    u, v, shape = _broadcast_flat(u, v)
    z = np.empty(u.size)
    _kernels.interpolate_bilinear(frame.u, frame.v, height, frame.edge, u, v, z)
    return z.reshape(shape)


def _contiguous_floats(values: npt.ArrayLike) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64)


def _broadcast_flat(
    first: npt.ArrayLike, second: npt.ArrayLike
) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Both arrays broadcast and flattened, and their common shape."""
    a, b = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    return _contiguous_floats(a.ravel()), _contiguous_floats(b.ravel()), a.shape
