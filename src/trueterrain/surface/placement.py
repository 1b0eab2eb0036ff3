"""Placement of grids: along the trajectory of a run, a line or a path, or over a map."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from trueterrain.core.errors import CoverageError
from trueterrain.formats.table import read_waypoints
from trueterrain.geometry.reference_line import (
    ReferenceLine,
    line_from_trajectory,
    line_through,
    straight_line,
)
from trueterrain.geometry.stations import chord_lengths
from trueterrain.surface.cells import Grid, grid_along, grid_over
from trueterrain.surface.pass_record import PassRecord

Floats = npt.NDArray[np.float64]
Four = tuple[float, float, float, float]

_MAX_SMOOTHING = 1000.0  # [m] above, the line would not follow the road
_STEPS = 8  # per width at which the grid is checked
_TOUCH = 0.02  # fraction of the width by which parts may overlap: ends that meet, chords of bends


@dataclass(frozen=True, kw_only=True)
class GridPlacement:
    """Settings of the nodes of a surface: spacing, width, and the line or map that they follow."""

    spacing: float = 0.01
    "Distance between nodes [m], along a line a multiple of 0.001."

    across: float | None = None
    "Distance between nodes across the line, or along northing [m]; by default the same."

    right: float = -2.0
    """Offset of the outermost nodes to the right of a line, left positive [m]; with several runs,
    from the rightmost of them."""

    left: float = 2.0
    "Offset of the outermost nodes to the left [m]."

    line: Four | None = None
    "Straight line to grid along: easting and northing of its two ends [m]."

    path: str | None = None
    "CSV file of waypoints to grid along, with the columns easting and northing [m]."

    bounds: Four | None = None
    "Map to grid over: min easting and northing, max easting and northing [m]."

    smoothing: float = 1.0
    "Standard deviation of the Gaussian that smooths a trajectory or a path [m]."

    lap: bool = False
    """Whether a trajectory that comes back over its own ground is cut there, so that all laps are
    gridded on the first; for passes that are brought into agreement."""

    as_map: bool = False
    "Whether runs are gridded over a map instead of along the trajectory of the first."

    def __post_init__(self) -> None:
        """Check that at most one of line, path and bounds is given."""
        if sum(given is not None for given in (self.line, self.path, self.bounds)) > 1:
            message = "only one of line, path and bounds may be given."
            raise ValueError(message)
        if self.as_map and (self.line or self.path):
            message = "line and path make a surface along a line, not a map: write .crg or .zarr."
            raise ValueError(message)
        if not 0 <= self.smoothing <= _MAX_SMOOTHING:
            message = f"smoothing must be from 0 to {_MAX_SMOOTHING:g} m, got {self.smoothing}."
            raise ValueError(message)

    def of_runs(self, passes: Sequence[PassRecord]) -> Grid:
        """Grid for runs: along the trajectory of the first, unless the settings say otherwise.

        Parameters
        ----------
        passes : sequence of PassRecord
            Runs with their motion.

        Returns
        -------
        Grid
            In the local frame of the runs.

        Raises
        ------
        ValueError
            If spacing, width or bounds are invalid.
        CoverageError
            If the body does not move far enough, or turns too sharply.
        """
        given = self._given()
        if given is not None:
            return given
        if self.as_map:
            return self._over(
                [_bounding_box(_scanner_positions(one)) for one in passes],
                max(-self.right, self.left),
            )
        first = passes[0]
        begin, end = _scan_time_span(first)
        line = line_from_trajectory(
            first.trajectory,
            spacing=self.spacing,
            half_width=max(-self.right, self.left),
            smoothing=self.smoothing,
            lever=first.mounting.scanner_position,
            begin=begin,
            end=end,
        )
        offsets = [_lateral_extent(line, _scanner_positions(one)) for one in passes[1:]]
        right = self.right + min((low for low, _ in offsets), default=0.0)
        left = self.left + max((high for _, high in offsets), default=0.0)
        grid = grid_along(line, right=right, left=left, spacing=self.across)
        met = _find_self_overlap(grid)
        if met is not None and self.lap:
            whole = int(np.searchsorted(line.curve.s, met[1])) - 1
            lap = ReferenceLine(curve=line.curve[:whole], elevation=line.elevation[:whole])
            return grid_along(lap, right=right, left=left, spacing=self.across)
        if met is not None:
            raise CoverageError(
                _self_overlap_text(grid, met),
                path=first.path,
                place="trajectory of the run",
                cure=f"Take one lap: end {_time_at(first, met[1] / grid.u[-1]):.1f} s (and begin); "
                "or name the stretch with line or path, or a map with bounds.",
            )
        return grid

    def of_points(self, extents: Sequence[Four]) -> Grid:
        """Grid for points: over the map that they cover, unless the settings say otherwise.

        Parameters
        ----------
        extents : sequence of tuple of float
            West, south, east and north of the points in each file [m].

        Returns
        -------
        Grid
            In the frame of the points.

        Raises
        ------
        ValueError
            If spacing, width or bounds are invalid.
        """
        return self._given() or self._over(extents)

    def _given(self) -> Grid | None:
        if self.bounds is not None:
            return self._over([self.bounds])
        if self.line is not None:
            return self._along(straight_line(self.line[:2], self.line[2:], spacing=self.spacing))
        if self.path is not None:
            line = line_through(
                *read_waypoints(Path(self.path)),
                spacing=self.spacing,
                smoothing=self.smoothing,
                half_width=max(-self.right, self.left, 0.0),
            )
            grid = self._along(line)
            met = _find_self_overlap(grid)
            if met is not None:
                raise CoverageError(
                    _self_overlap_text(grid, met),
                    path=self.path,
                    cure="Give waypoints up to there, a narrower grid (right, left), or a map "
                    "with bounds.",
                )
            return grid
        return None

    def _along(self, line: ReferenceLine) -> Grid:
        return grid_along(line, right=self.right, left=self.left, spacing=self.across)

    def _over(self, extents: Sequence[Four], reach: float = 0.0) -> Grid:
        west, south = (min(extent[axis] for extent in extents) - reach for axis in (0, 1))
        east, north = (max(extent[axis] for extent in extents) + reach for axis in (2, 3))
        return grid_over(
            west, south, east, north, spacing=(self.spacing, self.across or self.spacing)
        )


def _self_overlap_text(grid: Grid, met: tuple[float, float]) -> str:
    width = float(grid.v[-1] - grid.v[0])
    return (
        f"it comes back over itself: the grid, {width:g} m wide, lies at u = {met[1]:.2f} m over "
        f"its part at u = {met[0]:.2f} m, and no ground can be in both"
    )


def _find_self_overlap(grid: Grid) -> tuple[float, float] | None:
    """Stations of the first overlap of a grid along a line with an earlier part of itself.

    The same ground would be in two parts of the grid, and each return in one of them only.

    A bend does not overlap itself, since `grid_along` demands a radius greater than the half width;
    so only parts further apart than half a circle of that radius are compared.
    """
    frame, width = grid.frame, float(grid.v[-1] - grid.v[0])
    every = max(1, int(width / (_STEPS * grid.spacing[0])))
    rows = np.unique(np.append(np.arange(1, frame.u.size - 2, every), frame.u.size - 2))
    # both ends of the cross-sections, and the quadrangles between them, shape (n, corner, axis)
    _, x, y, nx, ny = (at[rows, None] for at in frame.sections)
    ends = np.stack([x + grid.v[[0, -1]] * nx, y + grid.v[[0, -1]] * ny], axis=-1)
    parts = np.concatenate([ends[:-1], ends[1:, ::-1]], axis=1)
    station = frame.u[rows]
    size = np.linalg.norm(parts[:, [0, 1]] - parts[:, [2, 3]], axis=-1).max(initial=0.0)
    pairs = KDTree(parts.mean(axis=1)).query_pairs(size, output_type="ndarray")
    pairs = pairs[station[pairs[:, 1]] - station[pairs[:, 0]] > 0.5 * np.pi * width]
    met = pairs[_overlap_depth(parts[pairs[:, 0]], parts[pairs[:, 1]]) > _TOUCH * width]
    if not met.size:
        return None
    first, second = met[np.lexsort(met.T)[0]]
    return float(station[first]), float(station[second])


def _overlap_depth(a: Floats, b: Floats) -> Floats:
    """Penetration depth of convex quadrangles, shape (n,) [m]; not positive if they are apart.

    Separating axis theorem: they are apart if their projections on the normal of a side are.
    """
    sides = np.concatenate([np.roll(one, -1, axis=1) - one for one in (a, b)], axis=1)
    across = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    on_a, on_b = (np.einsum("nsk,nck->nsc", across, one) for one in (a, b))
    reach = np.minimum(on_a.max(-1), on_b.max(-1)) - np.maximum(on_a.min(-1), on_b.min(-1))
    return np.asarray(reach.min(axis=1, initial=np.inf))


def _time_at(record: PassRecord, fraction: float) -> float:
    """Time at which a fraction of the distance is driven, rounded down to 0.1 s."""
    positions = _scanner_positions(record)
    driven = chord_lengths(positions[:, 0], positions[:, 1])
    at = np.interp(fraction * driven[-1], driven, _motion_times(record))
    return float(np.floor(10 * at) / 10)


def _scan_time_span(record: PassRecord) -> tuple[float, float]:
    """True times of the first and the last scan that the motion covers."""
    stamps = np.asarray(record.run["scans"]["time"], dtype=np.float64)
    clock = record.mounting.scanner_clock
    begin, end = (float(at) + clock for at in (np.nanmin(stamps), np.nanmax(stamps)))
    knots = record.trajectory.time
    return max(begin, float(knots[0])), min(end, float(knots[-1]))


def _motion_times(record: PassRecord) -> npt.NDArray[Any]:
    """Times of the motion while there are scans, shape (n,) [s]."""
    begin, end = _scan_time_span(record)
    time = record.trajectory.time
    return time[(time >= begin) & (time <= end)]


def _scanner_positions(record: PassRecord) -> npt.NDArray[Any]:
    """Positions of the scanner while it scans, shape (n, 3) [m]."""
    poses = record.trajectory.at(_motion_times(record))
    lever = np.array(record.mounting.scanner_position)
    return np.asarray(poses.position + poses.rotation.apply(lever))


def _lateral_extent(line: ReferenceLine, positions: npt.NDArray[Any]) -> tuple[float, float]:
    """Largest offsets of positions to the right and to the left of a line, at least 0 m."""
    found = line.curve.project(positions[:, 0], positions[:, 1])
    # positions before the start or beyond the end of the line have no offset
    offset = found.offset[~found.beyond]
    return float(offset.min(initial=0.0)), float(offset.max(initial=0.0))


def _bounding_box(positions: npt.NDArray[Any]) -> Four:
    low, high = positions.min(axis=0), positions.max(axis=0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
