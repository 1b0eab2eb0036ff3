"""Profiles along a path: statistics of search areas, and the bare line."""

from collections.abc import Iterable
from typing import Literal

import numpy as np
import xarray as xr

from trueterrain.core import provenance
from trueterrain.core.errors import CoverageError
from trueterrain.core.progress import Progress, no_progress
from trueterrain.core.schemas import check_points, check_surface, kind_of, make_profile
from trueterrain.geometry.curve import PlaneCurve
from trueterrain.profile.area import Disc, SearchArea, area_reach
from trueterrain.profile.distribution import HeightDistributions
from trueterrain.profile.search.gather import (
    Gatherer,
    ScatteredHeights,
    distributions_along,
    grid_gatherer,
)
from trueterrain.profile.statistic import Median, Statistic
from trueterrain.surface.evaluate import heights_at

#: A surface, a point cloud, or the blocks of a cloud too large for the memory.
Ground = xr.Dataset | Iterable[xr.Dataset]

#: What to do with path points that have too few heights around them.
ThinPolicy = Literal["error", "nan"]

_FIRST_BLOCK = 1 << 8  # path points of the first block
_PATH_BLOCK = 1 << 14  # path points of a block at most
_HEIGHTS = 1 << 22  # heights of a block, about 150 MB, for any search area


def tyre_profile(
    ground: Ground,
    path: PlaneCurve,
    *,
    area: SearchArea = Disc(),
    statistic: Statistic = Median(),
    level: bool = False,
    min_count: int = 3,
    thin: ThinPolicy = "error",
    progress: Progress = no_progress,
) -> xr.Dataset:
    """Tyre profile along a path: a statistic of the heights in a search area at each path point.

    Use it for point clouds and noisy surfaces, or where the deformation of a tyre is not needed;
    `tyre_envelope` rolls a tyre model over a surface instead.

    Parameters
    ----------
    ground : xarray.Dataset or iterable of xarray.Dataset
        Surface, Points, or blocks of Points in any order.
    path : PlaneCurve
        Path points.
    area : Disc, Ellipse or Rectangle
        Search area around each path point; the thesis's is a disc of 25 mm radius.
    statistic : Statistic
        Statistic of the heights; the thesis takes their median.
    level : bool
        Whether to subtract the slope of a robust plane from each search area first. A slope then
        does not count as scatter, and any statistic of a tilted plane is the height of the plane at
        the path point. The standard deviation does not contain that of the slope: with 15 heights
        it is a quarter too small, with 60 a twentieth.
    min_count : int
        Minimum number of heights; a search area with fewer is thin.
    thin : {"error", "nan"}
        Whether thin search areas raise or give NaN. They are never interpolated.
    progress : callable, optional
        Called with the task and the amount done.

    Returns
    -------
    xarray.Dataset
        Profile with ``height``, ``sd``, ``count``, ``easting``, ``northing``; ``attrs["thin"]`` is
        the number of thin search areas.

    Raises
    ------
    CoverageError
        If search areas are thin and `thin` is ``"error"``, or all of them are.
    ValueError
        If `min_count` is less than 1 or `thin` is unknown.

    Notes
    -----
    The result does not depend on the order of the points, on their division into blocks, or on the
    number of threads, not even in the last bit: heights are sorted before they are summed. Nodes of
    a surface are treated as points, also where a search area reaches beyond its edge.

    Source: thesis section 5.2, median in a disc of 25 mm radius.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> from trueterrain.geometry.path import straight_path
    >>> axis = np.arange(0, 1.001, 0.01)
    >>> plane = make_surface(0.1 * axis + np.zeros((101, 1)), easting=axis, northing=axis)
    >>> profile = tyre_profile(plane, straight_path((0.2, 0.5), (0.8, 0.5), spacing=0.2))
    >>> profile.height.values
    array([0.02, 0.04, 0.06, 0.08])
    """
    if min_count < 1:
        message = f"min_count must be at least 1, got {min_count}."
        raise ValueError(message)
    if thin not in ("error", "nan"):
        message = f"thin must be 'error' or 'nan', got {thin!r}."
        raise ValueError(message)
    source, gather = _prepare_ground(ground, path, area)
    height, sd = np.empty(len(path)), np.empty(len(path))
    count = np.empty(len(path), np.int64)
    begin, size = 0, _FIRST_BLOCK
    while begin < len(path):
        block = slice(begin, min(begin + size, len(path)))
        distributions = distributions_along(gather, path[block], level=level)
        height[block], sd[block] = statistic.estimate(distributions)
        count[block] = distributions.count
        begin, size = block.stop, _next_size(distributions)
        progress("profile", begin, len(path))
    is_thin = count < min_count
    _report_thin(path, count, is_thin, area, min_count, thin)
    height[is_thin] = sd[is_thin] = np.nan
    profile = make_profile(
        path.s,
        height,
        sd=sd,
        count=count,
        easting=path.easting,
        northing=path.northing,
        crs=source.attrs.get("crs", ""),
    )
    parameters = {
        "area": area,
        "statistic": statistic,
        "level": level,
        "min_count": min_count,
        "thin": thin,
    }
    profile = provenance.add_step(profile, "tyre_profile", parameters=parameters, after=source)
    return profile.assign_attrs(thin=int(is_thin.sum()))


def point_profile(ground: Ground, path: PlaneCurve) -> xr.Dataset:
    """Profile of the bare line: the height under a point contact, with every stone and joint.

    For comparison with tyre profiles, and for instruments that measure a line.

    Parameters
    ----------
    ground : xarray.Dataset
        Surface; its height between the nodes is bilinear.
    path : PlaneCurve
        Path points.

    Returns
    -------
    xarray.Dataset
        Profile with ``height``, ``easting``, ``northing``.

    Raises
    ------
    CoverageError
        If a path point lies outside of the surface or where it has no height; if the ground is
        scattered points, which define no height between them.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> from trueterrain.geometry.path import straight_path
    >>> ramp = make_surface([[0.0, 1.0], [0.0, 1.0]], easting=[0, 10], northing=[0, 10])
    >>> point_profile(ramp, straight_path((0, 5), (10, 5), spacing=2.5)).height.values
    array([0.  , 0.25, 0.5 , 0.75, 1.  ])
    """
    _require_path(path)
    if not isinstance(ground, xr.Dataset) or kind_of(ground) != "surface":
        raise CoverageError(
            "scattered points have no height between them",
            cure="Grid them first, or use a statistic with a small search area.",
        )
    height = heights_at(check_surface(ground), path.easting, path.northing)
    missing = np.flatnonzero(np.isnan(height))
    if missing.size:
        raise CoverageError(
            f"{missing.size} of {len(path)} path points have no height, the first at "
            f"{_station_text(path, missing[0])}",
            cure="Choose a path inside the surface.",
        )
    profile = make_profile(
        path.s,
        height,
        easting=path.easting,
        northing=path.northing,
        crs=ground.attrs.get("crs", ""),
    )
    return provenance.add_step(profile, "point_profile", after=ground)


def height_distributions(
    ground: Ground, path: PlaneCurve, *, area: SearchArea = Disc(), level: bool = False
) -> HeightDistributions:
    """Distributions of heights (CPF) inside the search area of each path point.

    Use it to see the heights from which `tyre_profile` takes its statistic.

    Parameters
    ----------
    ground : xarray.Dataset or iterable of xarray.Dataset
        Surface, Points, or blocks of Points in any order.
    path : PlaneCurve
        Path points.
    area : Disc, Ellipse or Rectangle
        Search area around each path point.
    level : bool
        Whether to subtract the slope of a robust plane from each search area first.

    Returns
    -------
    HeightDistributions
        One distribution per path point; empty where there is no ground.

    Notes
    -----
    Source: thesis section 5.2.3.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> from trueterrain.geometry.path import straight_path
    >>> points = make_points([0.0, 0.01, 0.02], [0.0, 0.0, 0.0], [5.0, 4.0, 6.0])
    >>> height_distributions(points, straight_path((0, 0), (0.02, 0)))[0].heights
    array([4., 5., 6.])
    """
    _, gather = _prepare_ground(ground, path, area)
    return distributions_along(gather, path, level=level)


def _prepare_ground(
    ground: Ground, path: PlaneCurve, area: SearchArea
) -> tuple[xr.Dataset, Gatherer]:
    """Return the dataset whose attributes describe the ground, and its gatherer."""
    _require_path(path)
    if isinstance(ground, xr.Dataset) and kind_of(ground) == "surface":
        return ground, grid_gatherer(check_surface(ground), area)
    if isinstance(ground, xr.Dataset) and kind_of(ground) == "profile":
        raise CoverageError(
            "a profile has no ground lateral to its line", cure="Give a surface or points."
        )
    scattered = ScatteredHeights(path, area)
    source = xr.Dataset()
    for block in [ground] if isinstance(ground, xr.Dataset) else ground:
        source = check_points(block).isel(point=slice(0, 0))
        scattered.add(block)
    return source, scattered.gatherer()


def _require_path(path: object) -> None:
    # kernels do not check the arrays of a path
    if not isinstance(path, PlaneCurve):
        message = f"path must be a PlaneCurve, after the ground, got {type(path).__name__}."
        raise TypeError(message)


def _next_size(distributions: HeightDistributions) -> int:
    """Path points of the next block, if each has as many heights as those of the last block."""
    size = _HEIGHTS * len(distributions) // max(distributions.heights.size, 1)
    return min(max(size, 1), _PATH_BLOCK)


def _report_thin(
    path: PlaneCurve,
    count: np.ndarray,
    is_thin: np.ndarray,
    area: SearchArea,
    min_count: int,
    policy: ThinPolicy,
) -> None:
    """Raise if search areas are thin and the policy does not permit it."""
    thin = np.flatnonzero(is_thin)
    if thin.size == 0 or (policy == "nan" and thin.size < len(path)):
        return
    if not count.any():
        raise CoverageError(
            f"the path lies outside of the ground: no height within {area_reach(area):.3g} m of it "
            f"(it begins at {_station_text(path, 0)})",
            cure="Check the coordinates and the CRS of the path with `trueterrain info`.",
        )
    cure = "Choose a larger search area or a path inside the ground"
    if policy == "error":
        cure += ', or let these become NaN (--thin nan, thin="nan")'
    raise CoverageError(
        f"{thin.size} of {len(path)} search areas have fewer than {min_count} heights, the "
        f"first at {_station_text(path, thin[0])} with {count[thin[0]]}",
        cure=cure + ".",
    )


def _station_text(path: PlaneCurve, index: int) -> str:
    return (
        f"s = {path.s[index]:.3f} m (easting {path.easting[index]:.3f} m, "
        f"northing {path.northing[index]:.3f} m)"
    )
