"""Where the nodes of a surface lie on the ground, and which node lies where.

The reference line is a polyline. Across each of its nodes runs a cross-section along the bisector
of the two chords that meet there (their mitre), so a line of constant v runs parallel to the
reference line at distance v: the geometry of OpenCRG, in which all chords are equally long.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import SchemaError
from trueterrain.geometry import _kernels

Floats = npt.NDArray[np.float64]

#: A point within this distance of the edge of a surface, or of a grid line, is on it [m].
EDGE = 1e-9

_SHARPEST_TURN = np.deg2rad(175)  # [rad] beyond, the mitre has no useful length
_SCANNED_TURN = 1.5  # [rad] of turning in a block, beyond which all of its strips are looked at
_MOST_BUCKETS = 1 << 20  # [1] so that the index of a long road stays small


@dataclass(frozen=True, kw_only=True, eq=False)
class GridFrame:
    """Geometry of a surface: node (i, j) lies at ``origin[i] + v[j] * normal[i]``.

    For a map, u is the easting axis, v the northing axis, and the normals point north.
    """

    u: Floats
    "Stations of the cross-sections [m], shape (nu,)."
    v: Floats
    "Offsets across, left positive [m], shape (nv,)."
    origin_easting: Floats
    "Nodes of the reference line [m], shape (nu,)."
    origin_northing: Floats
    "Nodes of the reference line [m], shape (nu,)."
    normal_easting: Floats
    "Direction of the cross-sections per metre of v [m/m], shape (nu,)."
    normal_northing: Floats
    "Direction of the cross-sections per metre of v [m/m], shape (nu,)."

    @property
    def edge(self) -> float:
        """Distance within which a point is on the edge [m]: ``EDGE`` and the round-off here."""
        largest = max(np.abs(self._edges).max(), np.abs(self.u).max(), np.abs(self.v).max())
        return float(EDGE + 4 * np.spacing(largest))

    @cached_property
    def _edges(self) -> Floats:
        """Right and left end of each cross-section [m], shape (nu, 2, 2)."""
        ends = self.v[[0, -1]]
        return np.stack(
            [
                self.origin_easting[:, None] + ends * self.normal_easting[:, None],
                self.origin_northing[:, None] + ends * self.normal_northing[:, None],
            ],
            axis=-1,
        )

    @cached_property
    def _index(self) -> "_Index":
        return _build_index(self)


def grid_frame(surface: xr.Dataset) -> GridFrame:
    """Geometry of a surface.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or map.

    Returns
    -------
    GridFrame
        Positions and cross directions of the cross-sections [m].

    Raises
    ------
    SchemaError
        If two nodes of the reference line coincide or it doubles back at a node.

    Notes
    -----
    The cross direction at a node is ``(a + b) / (1 + a . b)`` with the unit normals `a` and `b` of
    the chords before and after it; at the ends, the normal of the end chord. For chords of equal
    length this is the map of the ASAM OpenCRG standard.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> bend = make_surface(np.zeros((3, 2)), u=[0, 1, 2], v=[0, 1], easting=[0, 1, 1],
    ...                     northing=[0, 0, 1])
    >>> frame = grid_frame(bend)
    >>> frame.normal_easting, frame.normal_northing
    (array([-0., -1., -1.]), array([1., 1., 0.]))
    """
    if "u" not in surface.dims:
        easting = _contiguous_floats(surface["easting"])
        return GridFrame(
            u=easting,
            v=_contiguous_floats(surface["northing"]),
            origin_easting=easting,
            origin_northing=np.zeros_like(easting),
            normal_easting=np.zeros_like(easting),
            normal_northing=np.ones_like(easting),
        )
    easting, northing = (
        _contiguous_floats(surface["easting"]),
        _contiguous_floats(surface["northing"]),
    )
    normal_easting, normal_northing = _mitre_normals(easting, northing)
    return GridFrame(
        u=_contiguous_floats(surface["u"]),
        v=_contiguous_floats(surface["v"]),
        origin_easting=easting,
        origin_northing=northing,
        normal_easting=normal_easting,
        normal_northing=normal_northing,
    )


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
    _kernels.to_xy(frame.u, *_section_lines(frame), u, v, easting, northing)
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
    u, v = np.empty(x.size), np.empty(x.size)
    _kernels.to_uv(
        frame.u,
        *_section_lines(frame),
        frame.v[0],
        frame.v[-1],
        frame.edge,
        *frame._index,
        x,
        y,
        u,
        v,
    )
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


class _Index(NamedTuple):
    """Which strips of a surface can hold a point; see `_kernels.to_uv`."""

    block_starts: npt.NDArray[np.int64]
    boxes: Floats
    scan_all: npt.NDArray[np.bool_]
    bucket_starts: npt.NDArray[np.int64]
    bucket_items: npt.NDArray[np.int32]
    bucket_easting: float
    bucket_northing: float
    bucket_size: float
    columns: int
    rows: int


def _build_index(frame: GridFrame) -> _Index:
    strips = frame.u.size - 1
    chords = np.diff(_section_origins(frame), axis=0)
    lengths = np.hypot(*chords.T)
    width = frame.v[-1] - frame.v[0]
    # blocks about as long as the road is wide have the boxes that overlap least
    per_block = int(np.clip(np.ceil(width / lengths.mean()), 4, max(4, strips)))
    starts = np.append(np.arange(0, strips, per_block), strips)

    corners = frame._edges
    low = np.minimum(corners[:-1], corners[1:]).min(axis=1)
    high = np.maximum(corners[:-1], corners[1:]).max(axis=1)
    boxes = np.concatenate(
        [
            np.minimum.reduceat(low, starts[:-1]) - frame.edge,
            np.maximum.reduceat(high, starts[:-1]) + frame.edge,
        ],
        axis=1,
    )
    scan_all = np.add.reduceat(_turn_angles(chords), starts[:-1]) > _SCANNED_TURN
    scan_all |= np.logical_or.reduceat(_folded_strips(frame, chords, lengths), starts[:-1])

    origin = boxes[:, :2].min(axis=0)
    extent = boxes[:, 2:].max(axis=0) - origin
    most = min(_MOST_BUCKETS, 16 * boxes.shape[0] + 64)
    size = max(np.median(boxes[:, 2:] - boxes[:, :2]), np.sqrt(extent.prod() / most))
    size = max(size, extent.max() / most)
    columns, rows = (int(n) for n in extent / size + 1)
    bucket_starts, items = _kernels.fill_buckets(boxes, *origin, size, columns, rows)
    return _Index(
        block_starts=starts,
        boxes=boxes,
        scan_all=scan_all,
        bucket_starts=bucket_starts,
        bucket_items=items,
        bucket_easting=origin[0],
        bucket_northing=origin[1],
        bucket_size=float(size),
        columns=columns,
        rows=rows,
    )


def _turn_angles(chords: Floats) -> Floats:
    """Angle between each chord and the next [rad]; the last has none."""
    x, y = chords.T
    cross, dot = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    return np.append(np.abs(np.arctan2(cross, dot)), 0.0)


def _folded_strips(frame: GridFrame, chords: Floats, lengths: Floats) -> npt.NDArray[np.bool_]:
    """Whether the cross-sections at both ends of a strip meet within the road."""
    right, left = np.diff(frame._edges, axis=0).transpose(1, 0, 2)
    along = np.stack([(right * chords).sum(axis=1), (left * chords).sum(axis=1)])
    return np.asarray((along <= 0).any(axis=0) | (lengths <= 0))


def _mitre_normals(easting: Floats, northing: Floats) -> tuple[Floats, Floats]:
    dx, dy = np.diff(easting), np.diff(northing)
    lengths = np.hypot(dx, dy)
    if not (lengths > 0).all():
        at = int(np.flatnonzero(~(lengths > 0))[0])
        raise SchemaError(
            "coincide, so the line has no direction there",
            place=f"reference line, nodes {at} and {at + 1}",
            cure="Resample the reference line with chords of equal length.",
        )
    before = np.stack([-dy / lengths, dx / lengths])
    before = np.concatenate([before[:, :1], before], axis=1)
    after = np.concatenate([before[:, 1:], before[:, -1:]], axis=1)
    cosine = (before * after).sum(axis=0)
    if (cosine < np.cos(_SHARPEST_TURN)).any():
        at = int(np.argmin(cosine))
        raise SchemaError(
            f"turns by {np.rad2deg(np.arccos(max(cosine[at], -1.0))):.0f} degrees and doubles back",
            place=f"reference line, node {at}",
            cure="Smooth and resample the reference line.",
        )
    normal = (before + after) / (1 + cosine)
    return normal[0], normal[1]


def _section_lines(frame: GridFrame) -> tuple[Floats, Floats, Floats, Floats]:
    return (
        frame.origin_easting,
        frame.origin_northing,
        frame.normal_easting,
        frame.normal_northing,
    )


def _section_origins(frame: GridFrame) -> Floats:
    return np.stack([frame.origin_easting, frame.origin_northing], axis=1)


def _contiguous_floats(values: npt.ArrayLike) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64)


def _broadcast_flat(
    first: npt.ArrayLike, second: npt.ArrayLike
) -> tuple[Floats, Floats, tuple[int, ...]]:
    """Both arrays broadcast and flattened, and their common shape."""
    a, b = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
    return _contiguous_floats(a.ravel()), _contiguous_floats(b.ravel()), a.shape
