"""Points seen from above."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.schemas import check_points
from trueterrain.figures import canvas
from trueterrain.profile import WheelPath

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def points_map(
    points: xr.Dataset,
    *,
    path: WheelPath | None = None,
    most: int = 200_000,
    ax: "Axes | None" = None,
) -> "Axes":
    """Points from above, coloured by height, with a path over them.

    Parameters
    ----------
    points : xarray.Dataset
        The points.
    path : WheelPath, optional
        Path to draw over them.
    most : int
        Of more points than this, one of every n is drawn; the figure says so.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Easting and northing in metres, at equal scale.

    Raises
    ------
    SchemaError
        If the data are no points.
    ValueError
        If `most` is less than 1.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_points
    >>> points_map(make_points([0.0, 1.0], [0.0, 1.0], [0.1, 0.2])).get_xlabel()
    'Easting [m]'
    """
    if most < 1:
        message = f"most must be at least 1 point, got {most}."
        raise ValueError(message)
    every = -(-check_points(points).sizes["point"] // most)
    shown = points.isel(point=slice(None, None, max(every, 1)))
    length, width = (float(np.ptp(shown[axis].values)) for axis in ("easting", "northing"))
    ax = canvas.axes_or_new(ax, height=canvas.map_height(length, width))
    dots = ax.scatter(
        shown.easting,
        shown.northing,
        c=shown.up,
        s=2,
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
