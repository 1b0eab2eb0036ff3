"""Surfaces as blocks of ground in oblique parallel projection."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import check_surface
from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

_MAX_FACETS = 400  # along an axis; more are not visible on a page
_MAX_RELIEF = 0.1  # ratio of heights to length up to which heights are exaggerated
_ROUND = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_RIGHT, _UP = 0.5, 0.35  # [m] on the page for one metre away from the viewer
_SUN = (300.0, 45.0)  # [deg] azimuth and altitude of the light
_SHADE = 0.5  # fraction of the light from the sun
_FRONT, _END = "0.72", "0.6"  # greys of the sides of the block
_BASE = 0.15  # depth of the block below the lowest height, as a fraction of the range


def surface_relief(
    surface: xr.Dataset,
    *,
    exaggeration: float | None = None,
    heights: tuple[float, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Surface as a block of ground in oblique parallel projection, lit from the left.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, which is straightened, or over easting and northing.
    exaggeration : float, optional
        Vertical exaggeration; by default a round number that makes heights visible.
    heights : tuple of float, optional
        Minimum and maximum height of axis and colours [m], to compare surfaces; by default those of
        the surface.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Stations and heights of the front edge [m], which has the minimum offset (or northing). The
        vertical exaggeration and the width are printed. Nodes without a height are holes.

    Raises
    ------
    SchemaError
        If the data are not a surface.
    CoverageError
        If no node has a height.
    ValueError
        If `exaggeration` is not greater than 0, or `heights` do not increase.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> road = make_surface(0.1 * np.eye(3), u=[0, 1, 2], v=[-1, 0, 1], easting=[0, 0, 0],
    ...                     northing=[0, 1, 2])
    >>> surface_relief(road).get_xlabel()
    'Station u [m]'
    """
    shown = _thin_surface(check_surface(surface))
    along, across = ("u", "v") if "u" in shown.dims else ("easting", "northing")
    height = shown["height"].transpose(along, across).values
    if not np.isfinite(height).any():
        raise CoverageError("no node has a height", place="variable height")
    x, y = shown[along].values, shown[across].values
    low, high = _height_limits(height, heights)
    factor = (
        _exaggeration_factor(float(np.ptp(x)), high - low) if exaggeration is None else exaggeration
    )
    if not 0 < factor < np.inf:
        message = f"exaggeration must be greater than 0, got {factor}."
        raise ValueError(message)
    right, up = float(np.ptp(y)) * _RIGHT, float(np.ptp(y)) * _UP / factor
    base = low - _BASE * (high - low)
    shape = (factor * (high + up - base)) / (np.ptp(x) + right)
    ax = canvas.axes_or_new(ax, height=canvas.map_height(1.0, float(shape)))
    _draw_sides(ax, x, height, base, (right, up))
    _draw_top(ax, x, y, height, (low, high), factor)
    ax.set_xlim(x[0], x[-1] + right)
    ax.set_ylim(base, high + up)
    ax.set_aspect(factor)
    _label_axes(ax, along, x, (low, high))
    canvas.annotate_axes(ax, f"vertical exaggeration {factor:g} ×, {np.ptp(y):.3g} m wide")
    return ax


def _height_limits(height: Floats, heights: tuple[float, float] | None) -> tuple[float, float]:
    if heights is None:
        low = float(np.nanmin(height))
        return low, max(float(np.nanmax(height)), low + 1e-3)
    if not heights[0] < heights[1]:
        message = f"heights must ascend, got {heights[0]} m and {heights[1]} m."
        raise ValueError(message)
    return heights


def _exaggeration_factor(length: float, relief: float) -> float:
    """Round vertical exaggeration that makes the relief visible."""
    return float(max((one for one in _ROUND if one * relief <= _MAX_RELIEF * length), default=1))


def _draw_top(
    ax: "Axes", x: Floats, y: Floats, height: Floats, limits: tuple[float, float], factor: float
) -> None:
    """Draw facets between four nodes each, in order of decreasing distance from the viewer."""
    import matplotlib as mpl
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LightSource

    low, high = limits
    away = (y - y[0])[None, :]
    projected = np.stack([x[:, None] + _RIGHT * away, height + _UP / factor * away], axis=-1)
    corners = np.stack(
        [projected[:-1, :-1], projected[1:, :-1], projected[1:, 1:], projected[:-1, 1:]], axis=2
    )
    mean = 0.25 * (height[:-1, :-1] + height[1:, :-1] + height[1:, 1:] + height[:-1, 1:])
    steps = float(np.diff(x).mean()), float(np.diff(y).mean())
    level = np.where(np.isnan(mean), low, mean)
    # hillshade expects rows from north to south and columns from west to east
    sun = (
        LightSource(*_SUN)
        .hillshade(level.T[::-1], vert_exag=factor, dx=steps[0], dy=steps[1], fraction=1.0)[::-1]
        .T
    )
    colours = mpl.colormaps[canvas.HEIGHT_MAP]((mean - low) / (high - low))
    colours[..., :3] *= (1 - _SHADE + _SHADE * sun)[..., None]
    kept = np.isfinite(mean)[:, ::-1].T
    polygons, colours = (np.moveaxis(each[:, ::-1], 0, 1)[kept] for each in (corners, colours))
    facets = PolyCollection(
        list(polygons), facecolors=colours, edgecolors=colours, linewidths=0.3, rasterized=True
    )
    ax.add_collection(facets)


def _draw_sides(
    ax: "Axes", x: Floats, height: Floats, base: float, away: tuple[float, float]
) -> None:
    """Draw the front of the block and its right end."""
    front = np.where(np.isnan(height[:, 0]), base, height[:, 0])
    ax.fill_between(x, base, front, color=_FRONT, linewidth=0)
    end = np.where(np.isnan(height[-1]), base, height[-1])
    fraction = np.linspace(0.0, 1.0, end.size)
    across, up = x[-1] + away[0] * fraction, away[1] * fraction
    ax.fill_between(across, base + up, end + up, color=_END, linewidth=0)


def _label_axes(ax: "Axes", along: str, x: Floats, limits: tuple[float, float]) -> None:
    name = "Station u" if along == "u" else "Easting"
    canvas.scale_axis(ax.xaxis, canvas.coordinate_scale(x), name)
    canvas.scale_axis(ax.yaxis, canvas.height_scale(limits), "Height in front")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    # both axes are those of the front edge
    ax.spines["left"].set_bounds(*limits)
    ax.spines["bottom"].set_bounds(x[0], x[-1])
    ax.xaxis.set_major_locator(_ticks_within(float(x[0]), float(x[-1]), parts=8))
    ax.yaxis.set_major_locator(_ticks_within(*limits, parts=3))


def _ticks_within(first: float, last: float, *, parts: int) -> Any:
    """Locator of round ticks between two values."""
    from matplotlib.ticker import MaxNLocator

    class Within(MaxNLocator):
        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            ticks = super().tick_values(max(vmin, first), min(vmax, last))
            rounding = 1e-9 * (last - first)
            return [float(tick) for tick in ticks if first - rounding <= tick <= last + rounding]

    return Within(nbins=parts, steps=[1, 2, 5, 10])


def _thin_surface(surface: xr.Dataset) -> xr.Dataset:
    cuts = {
        dim: slice(None, None, max(-(-size // _MAX_FACETS), 1))
        for dim, size in surface["height"].sizes.items()
    }
    return surface.isel(cuts)
