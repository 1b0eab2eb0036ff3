"""Where the nodes of a surface shall be, as the command line says it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trueterrain.errors import CoverageError

if TYPE_CHECKING:
    import numpy as np

    from trueterrain.surface.cells import Grid
    from trueterrain.surface.line import ReferenceLine
    from trueterrain.surface.runs import Pass

Four = tuple[float, float, float, float]

_STEPS = 8  # of the width, by which a grid is looked at for overlaps
_TOUCH = 0.02  # of the width, by which its parts may overlap: ends that meet, chords of bends


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where the nodes shall be."""

    spacing: float
    across: float | None
    right: float
    left: float
    line: Four | None
    path: Path | None
    bounds: Four | None
    smoothing: float
    as_map: bool

    def __post_init__(self) -> None:
        """Check that options do not exclude each other."""
        if sum(given is not None for given in (self.line, self.path, self.bounds)) > 1:
            message = "only one of --line, --path and --bounds may be given."
            raise ValueError(message)
        if self.as_map and (self.line or self.path):
            message = (
                "--line and --path make a surface along a line: write .crg or .zarr, not a map."
            )
            raise ValueError(message)

    def of_runs(self, passes: "list[Pass]") -> "Grid":
        """Grid for runs: along the way of the first, unless something else was asked for."""
        from trueterrain.surface.line import line_from_trajectory

        given = self._given()
        if given is not None:
            return given
        ways = [_way(one) for one in passes]
        if self.as_map:
            from trueterrain.surface.cells import grid_over

            low = [min(float(way[:, axis].min()) for way in ways) for axis in (0, 1)]
            high = [max(float(way[:, axis].max()) for way in ways) for axis in (0, 1)]
            reach = max(-self.right, self.left)
            return grid_over(
                low[0] - reach, low[1] - reach, high[0] + reach, high[1] + reach,
                spacing=(self.spacing, self.across or self.spacing),
            )  # fmt: skip
        first = passes[0]
        begin, end = _times(first)
        line = line_from_trajectory(
            first.trajectory, spacing=self.spacing, half_width=max(-self.right, self.left),
            smoothing=self.smoothing, lever=_mounting(first), begin=begin, end=end,
        )  # fmt: skip
        grid = self._along(line)
        met = _overlap(grid)
        if met is not None:
            raise CoverageError(
                _met(grid, met), path=first.path, place="way of the run",
                cure=f"Take one lap: --end {_time_at(first, met[1] / line.u[-1]):.1f} (and "
                "--begin); or name the stretch with --line or --path, or a map with --bounds.",
            )  # fmt: skip
        return grid

    def of_points(self, files: list[Path], crs: str | None) -> "Grid":
        """Grid for points: over the map that they cover, unless something else was asked for."""
        from trueterrain.surface.cells import grid_over

        given = self._given()
        if given is not None:
            return given
        extents = [_extent(file, crs) for file in files]
        low = [min(extent[axis] for extent in extents) for axis in (0, 1)]
        high = [max(extent[axis] for extent in extents) for axis in (2, 3)]
        return grid_over(*low, *high, spacing=(self.spacing, self.across or self.spacing))

    def _given(self) -> "Grid | None":
        from trueterrain.formats.table import read_waypoints
        from trueterrain.surface.cells import grid_over
        from trueterrain.surface.line import line_through, straight_line

        if self.bounds is not None:
            return grid_over(*self.bounds, spacing=(self.spacing, self.across or self.spacing))
        if self.line is not None:
            return self._along(
                straight_line(self.line[:2], self.line[2:], spacing=self.spacing)
            )  # fmt: skip
        if self.path is not None:
            line = line_through(
                *read_waypoints(self.path), spacing=self.spacing, smoothing=self.smoothing,
                half_width=max(-self.right, self.left, 0.0),
            )  # fmt: skip
            grid = self._along(line)
            met = _overlap(grid)
            if met is not None:
                raise CoverageError(
                    _met(grid, met), path=self.path,
                    cure="Give waypoints up to there, a narrower grid (--right, --left), or a map "
                    "with --bounds.",
                )  # fmt: skip
            return grid
        return None

    def _along(self, line: "ReferenceLine") -> "Grid":
        from trueterrain.surface.cells import grid_along

        return grid_along(line, right=self.right, left=self.left, spacing=self.across)


def _overlap(grid: "Grid") -> "tuple[float, float] | None":
    """Stations of the first place where a grid along a line lies over an earlier part of itself.

    A bend never overlaps itself, since its radius is greater than the grid is wide; what is left
    are parts further apart than half a circle of that radius.
    """
    import numpy as np
    from scipy.spatial import KDTree

    frame, width = grid.frame, float(grid.v[-1] - grid.v[0])
    every = max(1, int(width / (_STEPS * grid.spacing[0])))
    rows = np.unique(np.append(np.arange(1, frame.u.size - 2, every), frame.u.size - 2))
    # both ends of the cross-sections, and the quadrangles between them, shape (n, corner, axis)
    ends = np.stack(
        [
            frame.origin_easting[rows, None] + grid.v[[0, -1]] * frame.normal_easting[rows, None],
            frame.origin_northing[rows, None] + grid.v[[0, -1]] * frame.normal_northing[rows, None],
        ],
        axis=-1,
    )
    parts = np.concatenate([ends[:-1], ends[1:, ::-1]], axis=1)
    station = frame.u[rows]
    size = np.linalg.norm(parts[:, [0, 1]] - parts[:, [2, 3]], axis=-1).max(initial=0.0)
    pairs = KDTree(parts.mean(axis=1)).query_pairs(size, output_type="ndarray")
    pairs = pairs[station[pairs[:, 1]] - station[pairs[:, 0]] > 0.5 * np.pi * width]
    met = pairs[_depth(parts[pairs[:, 0]], parts[pairs[:, 1]]) > _TOUCH * width]
    if not met.size:
        return None
    first, second = met[np.lexsort(met.T)[0]]
    return float(station[first]), float(station[second])


def _depth(a: "np.ndarray[Any, Any]", b: "np.ndarray[Any, Any]") -> "np.ndarray[Any, Any]":
    """How far convex quadrangles reach into each other, shape (n,) [m]; not positive if apart."""
    import numpy as np

    sides = np.concatenate([np.roll(one, -1, axis=1) - one for one in (a, b)], axis=1)
    across = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    on_a, on_b = (np.einsum("nsk,nck->nsc", across, one) for one in (a, b))
    reach = np.minimum(on_a.max(-1), on_b.max(-1)) - np.maximum(on_a.min(-1), on_b.min(-1))
    return np.asarray(reach.min(axis=1, initial=np.inf))


def _met(grid: "Grid", met: tuple[float, float]) -> str:
    width = float(grid.v[-1] - grid.v[0])
    return (
        f"it comes back over itself: the grid, {width:g} m wide, lies at u = {met[1]:.2f} m over "
        f"its part at u = {met[0]:.2f} m, and no ground can be in both"
    )


def _time_at(one: "Pass", share: float) -> float:
    """Time before which a share of the way is gone, down to a tenth of a second."""
    import numpy as np

    way = _way(one)
    gone = np.append(0.0, np.cumsum(np.hypot(*np.diff(way[:, :2], axis=0).T)))
    at = np.interp(share * gone[-1], gone, _knots(one))
    return float(np.floor(10 * at) / 10)


def _mounting(one: "Pass") -> tuple[float, float, float]:
    from trueterrain.formats.run import open_run
    from trueterrain.georeference import mounting_of

    return mounting_of(open_run(one.path), path=one.path).scanner_position


def _times(one: "Pass") -> tuple[float, float]:
    """True times of the first and the last scan that the motion covers."""
    import numpy as np

    from trueterrain.formats.run import open_run
    from trueterrain.georeference import mounting_of

    tree = open_run(one.path)
    stamps = np.asarray(tree["scans"]["time"], dtype=np.float64)
    clock = mounting_of(tree, path=one.path).scanner_clock
    knots = one.trajectory.time
    begin, end = (float(at) + clock for at in (np.nanmin(stamps), np.nanmax(stamps)))
    return max(begin, float(knots[0])), min(end, float(knots[-1]))


def _knots(one: "Pass") -> "np.ndarray[Any, Any]":
    """Times of the motion while there are scans, shape (n,) [s]."""
    begin, end = _times(one)
    time = one.trajectory.time
    return time[(time >= begin) & (time <= end)]


def _way(one: "Pass") -> "np.ndarray[Any, Any]":
    """Where the scanner is while it scans, shape (n, 3) [m]."""
    import numpy as np

    poses = one.trajectory.at(_knots(one))
    return np.asarray(poses.position + poses.rotation.apply(np.array(_mounting(one))))


def _extent(file: Path, crs: str | None) -> Four:
    """West, south, east, north of the points in a file."""
    import numpy as np

    from trueterrain import formats

    if formats.recognise(file).module == "las":
        import laspy

        with laspy.open(file) as reader:
            low, high = reader.header.mins, reader.header.maxs
        if np.isfinite([*low, *high]).all() and (low[:2] <= high[:2]).all():
            return float(low[0]), float(low[1]), float(high[0]), float(high[1])
    if formats.recognise(file).module == "store":
        extent = formats.info(file)["extent"]
        if "easting" in extent and "northing" in extent:
            (west, east), (south, north) = extent["easting"], extent["northing"]
            return west, south, east, north
    edges = [np.inf, np.inf, -np.inf, -np.inf]
    for block in formats.point_blocks(file, crs=crs):
        for axis, name in enumerate(("easting", "northing")):
            edges[axis] = min(edges[axis], float(block[name].min()))
            edges[axis + 2] = max(edges[axis + 2], float(block[name].max()))
    return edges[0], edges[1], edges[2], edges[3]
