"""Heights of a gridded surface inside search areas."""

import numpy as np
import xarray as xr

from trueterrain.profile.area import SearchArea
from trueterrain.profile.path import WheelPath
from trueterrain.profile.search._gather import Gatherer, kernel_area, path_arrays
from trueterrain.surface.reference_line import grid_frame, xy_to_uv


def grid_gatherer(surface: xr.Dataset, area: SearchArea) -> Gatherer:
    """Prepare a surface for gathering the nodes inside search areas.

    Distances are measured on the ground, not in (u, v): on a bend the nodes of the inner side lie
    closer together than those of the outer one.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface, along a reference line or a map.
    area : Disc, Ellipse or Rectangle
        Search area.

    Returns
    -------
    Gatherer
        Function that gathers for a part of a path.
    """
    from trueterrain.profile.search._kernels import gather_grid

    frame = grid_frame(surface)
    origin = np.stack([frame.origin_easting, frame.origin_northing], axis=1)
    normal = np.stack([frame.normal_easting, frame.normal_northing], axis=1)
    dims = ("u", "v") if "u" in surface.dims else ("easting", "northing")
    height = np.ascontiguousarray(surface.height.transpose(*dims), dtype=float)

    def gather(path: WheelPath, *output: np.ndarray) -> np.ndarray:
        u, _ = xy_to_uv(frame, path.easting, path.northing)
        row = np.searchsorted(frame.u, u, side="right") - 1
        row = np.where(np.isnan(u), -1, np.clip(row, 0, frame.u.size - 2))
        at, heading = path_arrays(path)
        return np.asarray(
            gather_grid(
                origin, normal, frame.v, height, at, row, heading, *kernel_area(area), *output
            )
        )

    return gather
