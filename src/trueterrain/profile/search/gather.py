"""Gathering of heights: from slices that are counted and filled to sorted distributions."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from trueterrain.geometry.curve import PlaneCurve
from trueterrain.profile.area import EDGE_TOLERANCE, SearchArea, area_reach
from trueterrain.profile.distribution import HeightDistributions

Float = npt.NDArray[np.float64]
Integer = npt.NDArray[np.int64]

#: Writes the counted heights: called with (start, dx, dy, z), one slice per path point.
Fill = Callable[..., object]

#: Counts the heights of each path point, and returns a function that writes them.
Gatherer = Callable[[PlaneCurve], tuple[Integer, Fill]]

#: Start and outputs of a kernel that only counts.
COUNT_ONLY: tuple[Integer, Float, Float, Float] = (
    np.zeros(1, np.int64),
    np.empty(0),
    np.empty(0),
    np.empty(0),
)

#: Residuals below this have equal weight in the robust plane [m]: far below any scanner's noise.
_LEVEL_STEP = 1e-7
_LEVEL_TOLERANCE = 1e-12
_LEVEL_ITERATIONS = 50


def distributions_along(
    gather: Gatherer, path: PlaneCurve, *, level: bool = False
) -> HeightDistributions:
    """Gather, level if asked, and sort the heights of each path point.

    Parameters
    ----------
    gather : Gatherer
        From `grid_gatherer` or `ScatteredHeights.gatherer`.
    path : PlaneCurve
        Path points.
    level : bool
        Whether to subtract the slope of the ground inside each search area.

    Returns
    -------
    HeightDistributions
        One distribution per path point.
    """
    from trueterrain.profile.search import _kernels

    counts, fill = gather(path)
    start = np.concatenate([[0], np.cumsum(counts)])
    dx, dy, heights, distances = (np.empty(start[-1]) for _ in range(4))
    if start[-1]:
        fill(start, dx, dy, heights)
        if level:
            settings = _LEVEL_STEP, _LEVEL_TOLERANCE, _LEVEL_ITERATIONS
            _kernels.level_areas(start, dx, dy, heights, *settings)
        _kernels.sort_heights(start, dx, dy, heights, distances)
    return HeightDistributions(start=start, heights=heights, distances=distances)


def kernel_area(area: SearchArea) -> tuple[int, Float, float]:
    """Shape, half axes and reach of a search area, as the kernels take them."""
    return int(area.shape), np.array(area.half_axes) + EDGE_TOLERANCE, area_reach(area)


def path_arrays(path: PlaneCurve) -> tuple[Float, Float]:
    """Positions (s, 2) and headings (s,) of a path, as the kernels take them."""
    return np.stack([path.easting, path.northing], axis=1), np.ascontiguousarray(path.heading)
