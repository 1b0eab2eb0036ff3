"""Heights, standard deviations and counts of nodes from the sums of their cells."""

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
import numpy.typing as npt

from trueterrain.surface._nodes import _kernels
from trueterrain.surface.accumulate import HEIGHT_OFFSET, PARTS, STEP, CellSums
from trueterrain.surface.accumulate.pose_variance import VARIANCE_STEP
from trueterrain.surface.cells import Grid
from trueterrain.surface.settings import GridSettings

Floats = npt.NDArray[np.float64]

#: Rows that one job computes.
ROWS = 256

_ITERATIONS = 2  # of slopes and levelled heights, each from the other
_HALO = 6  # rows around a node on which it depends, besides the radius of its disc
_SLOPE_LIMIT = 2.0  # times the gentler of the steps to both sides


@dataclass(frozen=True, eq=False)
class NodeValues:
    """Heights, standard deviations and counts of the nodes of some rows: 16 bytes for each."""

    height: Floats
    "Heights, shape (u, v) [m]."

    sd: npt.NDArray[np.float32]
    "Standard deviations, shape (u, v) [m]."

    count: npt.NDArray[np.int32]
    "Returns, shape (u, v)."

    first: int = 0
    "Row of the grid that comes first."

    @classmethod
    def empty(cls, rows: range, columns: int) -> "NodeValues":
        """Uninitialised arrays."""
        shape = len(rows), columns
        return cls(
            np.empty(shape), np.empty(shape, np.float32), np.empty(shape, np.int32), rows.start
        )

    def of(self, rows: range) -> "NodeValues":
        """Views of some rows of the grid."""
        own = slice(rows.start - self.first, rows.stop - self.first)
        return NodeValues(self.height[own], self.sd[own], self.count[own], rows.start)


@dataclass(frozen=True, kw_only=True, eq=False)
class NodeDisc:
    """Cells of the disc around a node from which its height is computed."""

    step_u: npt.NDArray[np.int64]
    "Rows from the node."

    step_v: npt.NDArray[np.int64]
    "Columns from the node."

    weight: npt.NDArray[np.float64]
    "Weight of their returns [1]."


def disc_of(options: GridSettings, grid: Grid) -> NodeDisc | None:
    """Cells whose centre lies in the disc around a node; None for its own cell alone."""
    if not options.radius:
        return None
    steps = grid.spacing
    reach = [int(options.radius / step + 1e-9) for step in steps]
    i, j = np.meshgrid(*(np.arange(-n, n + 1) for n in reach), indexing="ij")
    distance = np.hypot(i * steps[0], j * steps[1])
    inside = distance <= options.radius * (1 + 1e-9)
    # positions are known to half a cell, so no distance counts as less than that
    weight = np.maximum(distance[inside], 0.5 * min(steps)) ** -options.power
    return NodeDisc(step_u=i[inside], step_v=j[inside], weight=weight / weight.max())


def halo_of(options: GridSettings, grid: Grid) -> int:
    """Rows to either side of a node that its numbers depend on."""
    disc = disc_of(options, grid)
    return _HALO + (int(np.abs(disc.step_u).max()) if disc else 0)


def compute_nodes(
    sums: CellSums, options: GridSettings, begin: int, end: int, nodes: NodeValues
) -> None:
    """Compute the nodes of the rows from `begin` to before `end`.

    The sums must hold `halo_of` more rows to either side, as far as the grid has them.
    """
    disc = disc_of(options, sums.grid)
    halo = halo_of(options, sums.grid)
    around = slice(max(begin - halo, sums.rows.start), min(end + halo, sums.rows.stop))
    part = sums.total()

    def of(values: Any) -> Any:
        if not values.size:
            return values.reshape(0, 0)
        kept = values.reshape(len(sums.rows), -1)
        return kept[around.start - sums.rows.start : around.stop - sums.rows.start]

    weights, places = of(part.count), (of(part.alongs), of(part.acrosses))
    mean, deviation = np.empty(weights.shape), np.empty(weights.shape)
    _kernels.cell_moments(weights, of(part.totals), of(part.squares), STEP, mean, deviation)
    levelled = options.level and options.statistic == "mean"
    slopes = np.empty_like(mean), np.empty_like(mean)
    _kernels.cell_slopes(mean, _SLOPE_LIMIT, *slopes)
    value = mean
    if levelled:
        value = np.empty_like(mean)
        for iteration in range(_ITERATIONS):
            if iteration:
                _kernels.cell_slopes(value, _SLOPE_LIMIT, *slopes)
            _kernels.level_means(mean, weights, *places, PARTS, *slopes, value)
    # the scatter within cells gives the noise of a return; errors of the pose are common to all
    # returns of a pass in a cell, so they do not show there and are added afterwards
    pose, between = sums.pose_variance(around)
    single = _return_variance(
        deviation, weights, sums.weight, between, slopes, options.range_noise, levelled=levelled
    )
    if part.variances.size:
        with np.errstate(invalid="ignore", divide="ignore"):
            own = of(part.variances) * VARIANCE_STEP / weights
        pose = pose + np.maximum(own - options.range_noise**2, 0.0)
    n = effective = weights / sums.weight
    if disc is not None:
        value, n, effective = _search_heights(mean, weights, sums.weight, places, disc, slopes)
    if options.statistic in ("minimum", "maximum"):
        low = options.statistic == "minimum"
        stored = of(part.lows if low else part.highs) - float(HEIGHT_OFFSET)
        value, effective = (-stored if low else stored) * STEP, np.ones_like(n)
    out = nodes.of(range(begin, end))
    _kernels.store_rows(
        value,
        single,
        n,
        effective,
        pose,
        *slopes,
        sums.horizontal_variance(),
        *sums.grid.spacing,
        _quantile_variance_factor(options.fraction),
        options.min_count,
        begin - around.start,
        out.height,
        out.sd,
        out.count,
    )


def _search_heights(
    mean: Floats,
    weights: Any,
    weight: int,
    places: tuple[Any, Any],
    disc: NodeDisc,
    slopes: tuple[Floats, Floats],
) -> tuple[Floats, Floats, Floats]:
    """Heights from search discs; counts, and numbers of independent returns of equal weight.

    Slopes become those of the planes through the discs.
    """
    found, n, effective = np.empty_like(mean), np.empty_like(mean), np.empty_like(mean)
    levelled = places[0].size > 0
    if not levelled:
        places = np.zeros_like(weights), np.zeros_like(weights)
    _kernels.search_disc(
        mean,
        weights,
        *places,
        PARTS,
        disc.step_u,
        disc.step_v,
        disc.weight,
        levelled,
        found,
        n,
        effective,
        *slopes,
    )
    return found, n / weight, effective / weight


def _quantile_variance_factor(fraction: float | None) -> float:
    """Variance of a quantile of many normal values over that of their mean.

    Asymptotically p (1 - p) / (n f(x_p)²), with the density f at the quantile (Cramér 1946).
    """
    if fraction is None:
        return 1.0
    normal = NormalDist()
    return fraction * (1 - fraction) / normal.pdf(normal.inv_cdf(fraction)) ** 2


def _return_variance(
    deviation: Floats,
    weights: Any,
    weight: int,
    between: Floats | None,
    slopes: tuple[Floats, Floats],
    noise: float,
    *,
    levelled: bool,
) -> Floats:
    """Variance of a single return, pooled over the scatter of 5 x 5 cells [m²]."""
    total, degrees = np.empty_like(deviation), np.empty_like(deviation)
    _kernels.cell_scatter(
        deviation,
        weights,
        weight,
        np.empty((0, 0)) if between is None else between,
        *slopes,
        levelled,
        total,
        degrees,
    )
    sums = np.empty_like(total), np.empty_like(degrees)
    row = np.empty(total.shape[1] + 2 * _kernels.REACH)
    _kernels.box_sums(total, row, sums[0])
    _kernels.box_sums(degrees, row, sums[1])
    _kernels.pool_variance(*sums, noise**2, sums[0])
    return sums[0]
