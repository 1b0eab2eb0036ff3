"""Rectangles on the ground by which points are selected, and ranges of values."""

from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

#: West, south, east and north edge [m].
Bounds = tuple[float, float, float, float]


def check_bounds(bounds: Bounds | None) -> None:
    """Raise a ValueError unless the edges of a rectangle are in order."""
    if bounds is None:
        return
    west, south, east, north = bounds
    if not (west <= east and south <= north):
        message = (
            "bounds must be west, south, east and north edge [m], west <= east and south <= north, "
            f"got {bounds}."
        )
        raise ValueError(message)


def clip_points(points: xr.Dataset, bounds: Bounds) -> xr.Dataset:
    """Points within a rectangle, its edges included."""
    west, south, east, north = bounds
    x, y = points.easting.values, points.northing.values
    inside: Any = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    return points if inside.all() else points.isel(point=np.flatnonzero(inside))


def value_range(values: npt.NDArray[Any]) -> list[float] | None:
    """Minimum and maximum of the finite values; None if there are none."""
    finite = values[np.isfinite(values)]
    return [float(finite.min()), float(finite.max())] if finite.size else None
