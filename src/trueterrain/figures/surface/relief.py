"""Surfaces as blocks of ground, seen from above and aside."""

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

_FACETS = 400  # along an axis; more than a page shows
_TALL = 0.1  # ratio of heights to length up to which heights are drawn larger
_ROUND = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_ASIDE, _UP = 0.5, 0.35  # where a metre away from the eye goes on the page [m]
_SUN = (300.0, 45.0)  # [deg] azimuth and altitude of the light
_SHADE = 0.5  # share of the light that comes from the sun
_FRONT, _END = "0.72", "0.6"  # greys of the sides of the block
_BASE = 0.15  # of the range of heights that the block goes on below


def surface_relief(
    surface: xr.Dataset,
    *,
    exaggeration: float | None = None,
    heights: tuple[float, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Surface as a block of ground in a parallel projection, lit from the left.

    Parameters
    ----------
    surface : xarray.Dataset
        Surface along a reference line, which is drawn straight, or map.
    exaggeration : float, optional
        How much larger heights are drawn than distances; by default a round number that shows them.
    heights : tuple of float, optional
        Lowest and highest height of axis and colours, so that surfaces can be compared [m]; by
        default those of the surface.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Stations and heights of the edge in front, in metres: that of the smallest offset (or
        northing). The vertical exaggeration and the width are printed. Where a node has no height
        there is a hole.

    Raises
    ------
    SchemaError
        If the data are no surface.
    CoverageError
        If no node has a height.
    ValueError
        If numbers make no sense.

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
    right, up = float(np.ptp(y)) * _ASIDE, float(np.ptp(y)) * _UP / factor
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
    """Round number by which heights are drawn larger, so that they are seen."""
    return float(max((one for one in _ROUND if one * relief <= _TALL * length), default=1))


def _draw_top(
    ax: "Axes", x: Floats, y: Floats, height: Floats, limits: tuple[float, float], factor: float
) -> None:
    """Facets between four nodes each, those that are further away first."""
    import matplotlib as mpl
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LightSource

    low, high = limits
    away = (y - y[0])[None, :]
    place = np.stack([x[:, None] + _ASIDE * away, height + _UP / factor * away], axis=-1)
    corners = np.stack([place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]], axis=2)
    middle = 0.25 * (height[:-1, :-1] + height[1:, :-1] + height[1:, 1:] + height[:-1, 1:])
    steps = float(np.diff(x).mean()), float(np.diff(y).mean())
    level = np.where(np.isnan(middle), low, middle)
    # rows of an image run down from the north, its columns to the east
    sun = (
        LightSource(*_SUN)
        .hillshade(level.T[::-1], vert_exag=factor, dx=steps[0], dy=steps[1], fraction=1.0)[::-1]
        .T
    )
    colours = mpl.colormaps[canvas.HEIGHT_MAP]((middle - low) / (high - low))
    colours[..., :3] *= (1 - _SHADE + _SHADE * sun)[..., None]
    kept = np.isfinite(middle)[:, ::-1].T
    polygons, colours = (np.moveaxis(each[:, ::-1], 0, 1)[kept] for each in (corners, colours))
    facets = PolyCollection(
        list(polygons), facecolors=colours, edgecolors=colours, linewidths=0.3, rasterized=True
    )
    ax.add_collection(facets)


def _draw_sides(
    ax: "Axes", x: Floats, height: Floats, base: float, away: tuple[float, float]
) -> None:
    """Front of the block, and its end on the right."""
    front = np.where(np.isnan(height[:, 0]), base, height[:, 0])
    ax.fill_between(x, base, front, color=_FRONT, linewidth=0)
    end = np.where(np.isnan(height[-1]), base, height[-1])
    share = np.linspace(0.0, 1.0, end.size)
    across, up = x[-1] + away[0] * share, away[1] * share
    ax.fill_between(across, base + up, end + up, color=_END, linewidth=0)


def _label_axes(ax: "Axes", along: str, x: Floats, limits: tuple[float, float]) -> None:
    name = "Station u" if along == "u" else "Easting"
    canvas.scale_axis(ax.xaxis, canvas.coordinate_scale(x), name)
    canvas.scale_axis(ax.yaxis, canvas.height_scale(limits), "Height in front")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    # both axes belong to the edge in front only
    ax.spines["left"].set_bounds(*limits)
    ax.spines["bottom"].set_bounds(x[0], x[-1])
    ax.xaxis.set_major_locator(_ticks_within(float(x[0]), float(x[-1]), parts=8))
    ax.yaxis.set_major_locator(_ticks_within(*limits, parts=3))


def _ticks_within(first: float, last: float, *, parts: int) -> Any:
    """Round ticks from first to last only."""
    from matplotlib.ticker import MaxNLocator

    class Within(MaxNLocator):
        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            ticks = super().tick_values(max(vmin, first), min(vmax, last))
            slack = 1e-9 * (last - first)
            return [float(tick) for tick in ticks if first - slack <= tick <= last + slack]

    return Within(nbins=parts, steps=[1, 2, 5, 10])


def _thin_surface(surface: xr.Dataset) -> xr.Dataset:
    cuts = {
        dim: slice(None, None, max(-(-size // _FACETS), 1))
        for dim, size in surface["height"].sizes.items()
    }
    return surface.isel(cuts)
