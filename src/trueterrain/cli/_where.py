"""Where the nodes of a surface shall be, as the command line says it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from trueterrain.surface.cells import Grid
    from trueterrain.surface.line import ReferenceLine
    from trueterrain.surface.runs import Pass

Four = tuple[float, float, float, float]


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
            message = "--line and --path make a surface along a line: write .crg, not a map."
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
        return self._along(line)

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
            return self._along(line)
        return None

    def _along(self, line: "ReferenceLine") -> "Grid":
        from trueterrain.surface.cells import grid_along

        return grid_along(line, right=self.right, left=self.left, spacing=self.across)


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


def _way(one: "Pass") -> "np.ndarray[Any, Any]":
    """Where the scanner is while it scans, shape (n, 3) [m]."""
    import numpy as np

    begin, end = _times(one)
    inside = one.trajectory.time[(one.trajectory.time >= begin) & (one.trajectory.time <= end)]
    poses = one.trajectory.at(inside)
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
    edges = [np.inf, np.inf, -np.inf, -np.inf]
    for block in formats.point_blocks(file, crs=crs):
        for axis, name in enumerate(("easting", "northing")):
            edges[axis] = min(edges[axis], float(block[name].min()))
            edges[axis + 2] = max(edges[axis + 2], float(block[name].max()))
    return edges[0], edges[1], edges[2], edges[3]
