"""Cross-sections of a curve, and the strips of ground between them.

Across each point of a curve runs a cross-section along the bisector of the two chords that meet
there (their mitre), so a line of constant offset runs parallel to the curve: the geometry of
OpenCRG, in which all chords are equally long.
"""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from trueterrain.core.errors import SchemaError
from trueterrain.geometry import _kernels
from trueterrain.geometry._kernels import CrossSections, StripIndex

Floats = npt.NDArray[np.float64]

#: A point within this distance of the edge of a surface, or of a grid line, is on it [m].
EDGE = 1e-9

_SHARPEST_TURN = np.deg2rad(175)  # [rad] beyond, the mitre has no useful length
_SCANNED_TURN = 1.5  # [rad] of turning in a block, beyond which all of its strips are looked at
_MOST_BUCKETS = 1 << 20  # [1] so that the index of a long road stays small


def mitre_normals(easting: Floats, northing: Floats) -> tuple[Floats, Floats]:
    """Directions of the cross-sections per metre of offset.

    Parameters
    ----------
    easting, northing : numpy.ndarray, shape (s,)
        Points of a curve [m].

    Returns
    -------
    easting, northing : numpy.ndarray, shape (s,)
        ``(a + b) / (1 + a . b)`` with the unit normals `a` and `b` of the chords before and after
        each point; at the ends, the normal of the end chord [m/m].

    Raises
    ------
    SchemaError
        If two points in a row coincide or the curve doubles back.
    """
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


class Strips:
    """Strips of ground between the cross-sections of a curve, bounded by two offsets.

    Parameters
    ----------
    sections : CrossSections
        At least two cross-sections.
    right, left : float
        Offsets of the ends of the cross-sections, left positive [m].
    """

    def __init__(self, sections: CrossSections, right: float, left: float) -> None:
        self._sections, self._right, self._left = sections, right, left

    @cached_property
    def edge(self) -> float:
        """Distance within which a point is on the edge [m]: ``EDGE`` and the round-off here."""
        largest = (np.abs(at).max() for at in (self._ends, self._sections.station))
        return float(EDGE + 4 * np.spacing(max(*largest, abs(self._right), abs(self._left))))

    def locate(self, easting: Floats, northing: Floats) -> tuple[Floats, Floats]:
        """Station and offset of points [m], flat arrays; NaN outside.

        Where strips overlap, the one whose curve is nearest answers.
        """
        station, offset = np.empty(easting.size), np.empty(easting.size)
        _kernels.locate_points(self._sections, self.index, easting, northing, station, offset)
        return station, offset

    @cached_property
    def _ends(self) -> Floats:
        """Right and left end of each cross-section [m], shape (s, 2, 2)."""
        ends = np.array([self._right, self._left])
        _, x, y, nx, ny = self._sections
        return np.stack([x[:, None] + ends * nx[:, None], y[:, None] + ends * ny[:, None]], axis=-1)

    @cached_property
    def index(self) -> StripIndex:
        """Index of the strips; its size is bounded, however long the curve is."""
        chords = np.stack([np.diff(at) for at in self._sections[1:3]], axis=1)
        lengths = np.hypot(*chords.T)
        strips = lengths.size
        # blocks about as long as the road is wide have the boxes that overlap least
        per_block = int(
            np.clip(np.ceil((self._left - self._right) / lengths.mean()), 4, max(4, strips))
        )
        starts = np.append(np.arange(0, strips, per_block), strips)

        low = np.minimum(self._ends[:-1], self._ends[1:]).min(axis=1)
        high = np.maximum(self._ends[:-1], self._ends[1:]).max(axis=1)
        boxes = np.concatenate(
            [
                np.minimum.reduceat(low, starts[:-1]) - self.edge,
                np.maximum.reduceat(high, starts[:-1]) + self.edge,
            ],
            axis=1,
        )
        scan_all = np.add.reduceat(_turn_angles(chords), starts[:-1]) > _SCANNED_TURN
        scan_all |= np.logical_or.reduceat(self._folded(chords, lengths), starts[:-1])

        origin = boxes[:, :2].min(axis=0)
        extent = boxes[:, 2:].max(axis=0) - origin
        most = min(_MOST_BUCKETS, 16 * boxes.shape[0] + 64)
        size = max(np.median(boxes[:, 2:] - boxes[:, :2]), np.sqrt(extent.prod() / most))
        size = float(max(size, extent.max() / most))
        columns, rows = (int(n) for n in extent / size + 1)
        bucket_starts, items = _kernels.fill_buckets(boxes, *origin, size, columns, rows)
        return StripIndex(
            right=float(self._right),
            left=float(self._left),
            edge=self.edge,
            block_starts=starts,
            boxes=boxes,
            scan_all=scan_all,
            bucket_starts=bucket_starts,
            bucket_items=items,
            bucket_easting=float(origin[0]),
            bucket_northing=float(origin[1]),
            bucket_size=size,
            columns=columns,
            rows=rows,
        )

    def _folded(self, chords: Floats, lengths: Floats) -> npt.NDArray[np.bool_]:
        """Whether the cross-sections at both ends of a strip meet within it."""
        right, left = np.diff(self._ends, axis=0).transpose(1, 0, 2)
        along = np.stack([(right * chords).sum(axis=1), (left * chords).sum(axis=1)])
        return np.asarray((along <= 0).any(axis=0) | (lengths <= 0))


def _turn_angles(chords: Floats) -> Floats:
    """Angle between each chord and the next [rad]; the last has none."""
    x, y = chords.T
    cross, dot = x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]
    return np.append(np.abs(np.arctan2(cross, dot)), 0.0)
