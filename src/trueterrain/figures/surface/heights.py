"""Maps of surfaces."""

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr

from trueterrain.core.schemas import check_surface
from trueterrain.figures import canvas
from trueterrain.profile import PlaneCurve
from trueterrain.surface import grid_frame, node_coordinates, xy_to_uv

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_NODES = 1500  # along an axis; more are not visible on a page or screen
_MAX_ASPECT = 8.0  # ratio of length to width up to which a grid is drawn at equal scale
_STRETCHES = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_ROUNDING = 1e-6  # deviation from equal spacing, as a fraction of the spacing

#: Coordinates of a surface map: (u, v), or easting and northing.
Frame = Literal["grid", "ground"]


def surface_map(
    surface: xr.Dataset,
    *,
    path: PlaneCurve | None = None,
    frame: Frame = "grid",
    ax: "Axes | None" = None,
) -> "Axes":
    """Map of the heights of a surface, with a path.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, or over easting and northing.
    path : PlaneCurve, optional
        Path to draw.
    frame : {"grid", "ground"}
        Coordinates of a surface along a reference line: (u, v), which straightens the road, or
        easting and northing. Other surfaces have only the latter.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Both axes in metres, at equal scale; only a long road over (u, v) is stretched laterally, by
        the printed factor. Nodes without height are grey.

    Raises
    ------
    SchemaError
        If the data are not a surface.
    ValueError
        If `frame` is unknown.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface(np.eye(3), u=[0, 1, 2], v=[-1, 0, 1], easting=[0, 0, 0],
    ...                     northing=[0, 1, 2])
    >>> surface_map(road).get_xlabel()
    'Station u [m]'
    >>> surface_map(road, frame="ground").get_xlabel()
    'Easting [m]'
    """
    if frame not in ("grid", "ground"):
        message = f"frame must be 'grid' or 'ground', got {frame!r}."
        raise ValueError(message)
    shown, every = _thin_surface(check_surface(surface))
    scale = canvas.height_scale(shown.height)
    if "u" in surface.dims and frame == "grid":
        ax, image, stretch = _over_grid(shown, ax)
    else:
        ax, image, stretch = _over_ground(shown, ax)
    image.set_cmap(_height_colormap())
    canvas.colour_bar(image, ax, scale)
    if path is not None:
        along_grid = "u" in surface.dims and frame == "grid"
        position = (path.easting, path.northing)
        canvas.draw_path(
            ax, *(xy_to_uv(grid_frame(surface), *position) if along_grid else position)
        )
    if np.isnan(shown.height).any():
        ax.fill_between([], [], [], color=canvas.HOLE_COLOUR, label="no height")
    equal = "equal scale" if stretch == 1 else f"v stretched {stretch:g} times"
    canvas.annotate_axes(ax, equal + (f", 1 of {every} nodes shown" if every > 1 else ""))
    canvas.legend_above(ax)
    return ax


def _over_grid(surface: xr.Dataset, ax: "Axes | None") -> "tuple[Axes, Any, float]":
    u, v = surface.u.values, surface.v.values
    stretch = _width_exaggeration(u[-1] - u[0], v[-1] - v[0])
    ax = canvas.axes_or_new(ax, height=canvas.map_height(u[-1] - u[0], stretch * (v[-1] - v[0])))
    image = _draw_image(ax, u, v, surface.height.values.T)
    ax.set_aspect(stretch)
    canvas.scale_axis(ax.xaxis, canvas.coordinate_scale(u), "Station u")
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(), "Offset v, left +")
    return ax, image, stretch


def _over_ground(surface: xr.Dataset, ax: "Axes | None") -> "tuple[Axes, Any, float]":
    if "u" in surface.dims:
        easting, northing = node_coordinates(surface)
        ax = canvas.axes_or_new(ax, height=canvas.map_height(np.ptp(easting), np.ptp(northing)))
        corners = _cell_corners(easting), _cell_corners(northing)
        image = ax.pcolormesh(*corners, surface.height.values, rasterized=True)
    else:
        easting, northing = surface.easting.values, surface.northing.values
        ax = canvas.axes_or_new(ax, height=canvas.map_height(np.ptp(easting), np.ptp(northing)))
        image = _draw_image(ax, easting, northing, surface.height.values)
    ax.set_aspect("equal")
    canvas.scale_axis(ax.xaxis, canvas.coordinate_scale(easting), "Easting")
    canvas.scale_axis(ax.yaxis, canvas.coordinate_scale(northing), "Northing")
    return ax, image, 1.0


def _cell_corners(nodes: np.ndarray) -> np.ndarray:
    """Corners of the cells around nodes, shape (u + 1, v + 1): midpoints between neighbours."""
    for _ in range(2):  # along u, then along v
        half = np.diff(nodes, axis=0) / 2
        ends = nodes[:1] - half[:1], nodes[-1:] + half[-1:]
        nodes = np.concatenate([ends[0], nodes[:-1] + half, ends[1]]).T
    return nodes


def _draw_image(ax: "Axes", x: np.ndarray, y: np.ndarray, height: np.ndarray) -> Any:
    """Image of nodes over two axes; each node fills the cell around it."""
    if _is_equally_spaced(x) and _is_equally_spaced(y):
        half_x, half_y = (x[1] - x[0]) / 2, (y[1] - y[0]) / 2
        extent = (x[0] - half_x, x[-1] + half_x, y[0] - half_y, y[-1] + half_y)
        return ax.imshow(height, origin="lower", extent=extent, interpolation="nearest")
    return ax.pcolormesh(x, y, height, shading="nearest", rasterized=True)


def _is_equally_spaced(axis: np.ndarray) -> bool:
    steps = np.diff(axis)
    return bool(np.ptp(steps) <= 2 * _ROUNDING * steps.mean())


def _thin_surface(surface: xr.Dataset) -> tuple[xr.Dataset, int]:
    """Surface with at most `_MAX_NODES` along each axis, and the larger of the two strides."""
    strides = {dim: -(-size // _MAX_NODES) for dim, size in surface.height.sizes.items()}
    cuts = {dim: slice(None, None, stride) for dim, stride in strides.items()}
    return surface.isel(cuts), max(strides.values())


def _width_exaggeration(length: float, width: float) -> float:
    """Minimum round factor by which the width is stretched to be visible."""
    needed = length / (_MAX_ASPECT * width)
    return next((factor for factor in _STRETCHES if factor >= needed), _STRETCHES[-1])


def _height_colormap() -> Any:
    import matplotlib as mpl

    return mpl.colormaps[canvas.HEIGHT_MAP].with_extremes(bad=canvas.HOLE_COLOUR)
