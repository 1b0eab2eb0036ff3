"""The numbers of a surface from the sums of its cells, some rows at a time."""

from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from trueterrain.surface.accumulate import STEP, CellSums
from trueterrain.surface.accumulate import _kernels as kernels
from trueterrain.surface.accumulate._sums import PARTS, VARIANCE_STEP
from trueterrain.surface.cells import Grid

if TYPE_CHECKING:
    from trueterrain.surface.grid import GridOptions

Floats = npt.NDArray[np.float64]

#: Rows that are finished at once.
ROWS = 256

_HALO = 6  # rows around them that they depend on, beside the radius
_POOL = 2  # cells to either side whose scatter is pooled
_ROUNDS = 2  # in which slopes and levelled heights settle
_STEEPER = 2.0  # times the gentler of both sides, a slope is believed


@dataclass(frozen=True, kw_only=True, eq=False)
class Disc:
    """Cells around a node that its height is taken from."""

    ahead: npt.NDArray[np.int64]
    "Rows from the node."

    left: npt.NDArray[np.int64]
    "Columns from the node."

    weight: Floats
    "Weight of their returns [1]."


def finish(
    sums: CellSums,
    options: "GridOptions",
    begin: int,
    end: int,
    height: Floats,
    sd: Any,
    count: Any,
) -> None:
    """Heights, standard deviations and counts of some rows."""
    rows, columns = sums.grid.shape
    disc = disc_of(options, sums.grid)
    halo = _HALO + (int(np.abs(disc.ahead).max()) if disc else 0)
    around = slice(max(begin - halo, 0), min(end + halo, rows))
    inner = slice(begin - around.start, end - around.start)
    part = sums.total()

    def of(values: Any) -> Any:
        return values.reshape(rows, columns)[around] if values.size else values

    weights = of(part.count)
    mean, deviation = _moments(weights, of(part.totals), of(part.squares))
    levelled = options.level and options.statistic == "mean"
    ahead, left = np.empty_like(mean), np.empty_like(mean)
    kernels.slopes(mean, _STEEPER, ahead, left)
    plain = mean
    if levelled:
        mean = np.empty_like(plain)
        for round_ in range(_ROUNDS):
            if round_:
                kernels.slopes(mean, _STEEPER, ahead, left)
            kernels.level(
                plain, weights, of(part.alongs), of(part.acrosses), PARTS, ahead, left, mean
            )
    pose, between = sums.pose_variance(around)
    single = _single(
        deviation, weights, sums.weight, between, (ahead, left), options.range_noise,
        levelled=levelled,
    )  # fmt: skip
    if part.variances.size:
        with np.errstate(invalid="ignore", divide="ignore"):
            own = of(part.variances) * VARIANCE_STEP / weights
        pose = pose + np.maximum(own - options.range_noise**2, 0.0)
    n = weights / sums.weight
    effective = n
    if disc is not None:
        places = of(part.alongs), of(part.acrosses)
        mean, n, effective = _searched(plain, weights, sums.weight, places, disc, (ahead, left))
    sideways = sums.sideways_variance()
    if sideways:
        along, across = sums.grid.spacing
        pose = pose + sideways * ((ahead / along) ** 2 + (left / across) ** 2)
    if options.statistic not in ("minimum", "maximum"):
        value = mean
        with np.errstate(invalid="ignore", divide="ignore"):
            variance = _spread(options.share) * single / effective + pose
    else:
        low = options.statistic == "minimum"
        stored = of(part.lows if low else part.highs) - float(kernels.MIDDLE)
        value = (-stored if low else stored) * STEP
        variance = single + pose
    few = n < options.minimum_count
    height[begin:end] = np.where(few, np.nan, value)[inner]
    sd[begin:end] = np.sqrt(np.where(few, np.nan, variance))[inner]
    count[begin:end] = np.ceil(n[inner])


def disc_of(options: "GridOptions", grid: Grid) -> Disc | None:
    """Cells whose middle lies in the disc around a node; None for the own cell alone."""
    if not options.radius:
        return None
    steps = grid.spacing
    reach = [int(options.radius / step + 1e-9) for step in steps]
    i, j = np.meshgrid(*(np.arange(-n, n + 1) for n in reach), indexing="ij")
    distance = np.hypot(i * steps[0], j * steps[1])
    inside = distance <= options.radius * (1 + 1e-9)
    # nearer than half a cell is as near as can be told
    weight = np.maximum(distance[inside], 0.5 * min(steps)) ** -options.power
    return Disc(ahead=i[inside], left=j[inside], weight=weight / weight.max())


def _searched(
    mean: Floats,
    weights: Any,
    weight: int,
    places: tuple[Any, Any],
    disc: Disc,
    slopes: tuple[Floats, Floats],
) -> tuple[Floats, Floats, Floats]:
    """Heights from discs; counts, and how many returns of equal weight they are worth.

    Slopes become those of the planes through the discs.
    """
    found, n, effective = np.empty_like(mean), np.empty_like(mean), np.empty_like(mean)
    levelled = places[0].size > 0
    if not levelled:
        places = np.zeros_like(weights), np.zeros_like(weights)
    kernels.search(
        mean, weights, *places, PARTS, disc.ahead, disc.left, disc.weight, levelled, found, n,
        effective, *slopes,
    )  # fmt: skip
    return found, n / weight, effective / weight


def _spread(share: float | None) -> float:
    """Variance of a quantile of many normal values over that of their mean."""
    if share is None:
        return 1.0
    normal = NormalDist()
    return share * (1 - share) / normal.pdf(normal.inv_cdf(share)) ** 2


def _moments(count: Any, totals: Any, squares: Any) -> tuple[Floats, Floats]:
    """Mean height [m] and sum of squared deviations [m²] of each cell."""
    mean, deviation = np.empty(count.size), np.empty(count.size)
    kernels.moments(count.ravel(), totals.ravel(), squares.ravel(), mean, deviation)
    return mean.reshape(count.shape) * STEP, deviation.reshape(count.shape) * STEP**2


def _single(
    deviation: Floats,
    weights: Any,
    weight: int,
    between: Floats,
    slopes: tuple[Floats, Floats],
    noise: float,
    *,
    levelled: bool,
) -> Floats:
    """Variance of a single return from the scatter in the cells around [m²]."""
    total, free = np.empty_like(deviation), np.empty_like(deviation)
    kernels.scatter(deviation, weights, weight, between, *slopes, levelled, total, free)
    sums = np.empty_like(total), np.empty_like(free)
    row = np.empty(total.shape[1])
    kernels.box(total, _POOL, row, sums[0])
    kernels.box(free, _POOL, row, sums[1])
    with np.errstate(invalid="ignore", divide="ignore"):
        pooled = np.where(sums[1] > 0, sums[0] / sums[1], noise**2 if noise > 0 else np.nan)
    return np.maximum(pooled, noise**2)
