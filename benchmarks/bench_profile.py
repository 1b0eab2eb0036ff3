"""Medians inside discs, compared with scipy's cKDTree with numpy.median, and along grids."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from trueterrain.core.schemas import make_points, make_surface
from trueterrain.profile import Disc, PlaneCurve, offset_path, straight_path, tyre_profile
from trueterrain.profile.area import EDGE_TOLERANCE

POINTS = 20_000_000
PATH_POINTS = 20_000
RADIUS = 0.025  # [m]


def bench() -> list[dict[str, Any]]:
    """Rows of name, ours, peer, unit, ratio and budget.

    Returns
    -------
    list of dict
        What was measured.
    """
    return [scattered_medians(), grid_medians()]


def scattered_medians() -> dict[str, Any]:
    """Disc medians of scattered points: index included, ours and the peer."""
    rng = np.random.default_rng(2009)
    easting, northing = rng.uniform(0, 202, POINTS), rng.uniform(0, 4, POINTS)
    points = make_points(easting, northing, rng.normal(0, 0.01, POINTS))
    path = straight_path((1.0, 1.5), (1.0 + 0.01 * (PATH_POINTS - 1), 2.5), spacing=0.01)
    tyre_profile(points.isel(point=slice(0, 1_000_000)), path, thin="nan")  # compile
    profile, ours = timed(lambda: tyre_profile(points, path, area=Disc(radius=RADIUS)))
    heights, peer = timed(lambda: tree_medians(points, path))
    np.testing.assert_array_equal(profile.height, heights)  # identical, to the last bit
    return {
        "name": f"disc medians, {POINTS:,} scattered points, {len(path):,} path points",
        "ours": ours,
        "peer": peer,
        "peer_name": "scipy cKDTree + numpy.median",
        "unit": "s",
        "ratio": peer / ours,
        "budget": "ratio >= 30",
        "met": peer / ours >= 30,
    }


def tree_medians(points: xr.Dataset, path: PlaneCurve) -> np.ndarray:
    """Disc medians as one would write them with scipy and numpy."""
    tree = cKDTree(np.stack([points.easting, points.northing], axis=1))
    at = np.stack([path.easting, path.northing], axis=1)
    up = points.up.values
    near = tree.query_ball_point(at, RADIUS + EDGE_TOLERANCE, workers=-1)
    return np.array([np.median(up[indices]) for indices in near])


def grid_medians() -> dict[str, Any]:
    """Disc medians of a gridded surface of 1 km by 4 m at 10 mm."""
    rng = np.random.default_rng(2009)
    u, v = np.arange(100_001) * 0.01, np.arange(-200, 201) * 0.01
    height = rng.normal(0, 0.01, (u.size, v.size))
    surface = make_surface(height, u=u, v=v, easting=u, northing=np.zeros_like(u))
    path = offset_path(surface, 0.303, spacing=0.001)
    tyre_profile(surface, path.part(0, 1000))  # compile
    _, seconds = timed(lambda: tyre_profile(surface, path))
    rate = len(path) / seconds / 1e6
    return {
        "name": f"disc medians on a 10 mm grid, {len(path):,} path points",
        "ours": rate,
        "peer": None,
        "peer_name": None,
        "unit": "M path points/s",
        "ratio": None,
        "budget": ">= 1 M path points/s",
        "met": rate >= 1,
    }


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Result of some work and the seconds it took, the best of five runs if it is quick."""
    seconds: list[float] = []
    while not seconds or (len(seconds) < 5 and seconds[0] < 5):
        begin = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - begin)
    return result, min(seconds)
