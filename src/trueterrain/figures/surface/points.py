"""Maps of point clouds."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.schemas import check_points
from trueterrain.figures import canvas
from trueterrain.profile import PlaneCurve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FEW = 1000  # points, up to which dots are larger


def points_map(
    points: xr.Dataset,
    *,
    path: PlaneCurve | None = None,
    max_points: int = 200_000,
    ax: "Axes | None" = None,
) -> "Axes":
    """Map of points, coloured by height, with a path.

    Parameters
    ----------
    points : xarray.Dataset
        The points.
    path : PlaneCurve, optional
        Path to draw.
    max_points : int
        Of more points, one of every n is drawn, which the figure notes.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Easting and northing in metres, at equal scale.

    Raises
    ------
    SchemaError
        If the data are not points.
    ValueError
        If `max_points` is less than 1.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> points_map(make_points([0.0, 1.0], [0.0, 1.0], [0.1, 0.2])).get_xlabel()
    'Easting [m]'
    """
    if max_points < 1:
        message = f"max_points must be at least 1 point, got {max_points}."
        raise ValueError(message)
    every = -(-check_points(points).sizes["point"] // max_points)
    shown = points.isel(point=slice(None, None, max(every, 1)))
    length, width = (float(np.ptp(shown[axis].values)) for axis in ("easting", "northing"))
    ax = canvas.axes_or_new(ax, height=canvas.map_height(length, width))
    dots = ax.scatter(
        shown.easting,
        shown.northing,
        c=shown.up,
        s=2 if shown.sizes["point"] > _FEW else 12,
        linewidths=0,
        cmap=canvas.HEIGHT_MAP,
        rasterized=True,
    )
    canvas.colour_bar(dots, ax, canvas.height_scale(shown.up))
    if path is not None:
        canvas.draw_path(ax, path.easting, path.northing)
    ax.set_aspect("equal")
    canvas.scale_axis(ax.xaxis, canvas.coordinate_scale(shown.easting), "Easting")
    canvas.scale_axis(ax.yaxis, canvas.coordinate_scale(shown.northing), "Northing")
    canvas.annotate_axes(ax, "equal scale" + (f", 1 of {every} points shown" if every > 1 else ""))
    canvas.legend_above(ax)
    return ax
