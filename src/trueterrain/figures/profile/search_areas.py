"""Search areas over the heights of the ground (as thesis Fig. 5-3)."""

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import check_points, check_surface, kind_of
from trueterrain.figures import canvas
from trueterrain.profile import Disc, Ellipse, PlaneCurve, Rectangle, SearchArea
from trueterrain.profile.area import EDGE_TOLERANCE, area_reach
from trueterrain.surface import node_coordinates

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AROUND = 2.2  # half width of the ground that is shown, in reaches of the search area
_OUTLINES = 0.4  # distance between the outlines, in half lengths of the search area
_EDGE = 1.05  # of that half width, so that no dot is cut


def search_area_map(
    ground: xr.Dataset,
    path: PlaneCurve,
    area: SearchArea = Disc(),
    *,
    station: float,
    ax: "Axes | None" = None,
) -> "Axes":
    """Path points at equal arc length, and the search area of one of them over the heights.

    Parameters
    ----------
    ground : xarray.Dataset
        Surface or Points.
    path : PlaneCurve
        Path points.
    area : Disc, Ellipse or Rectangle
        Search area.
    station : float
        Arc length of the path point [m]; the nearest one is shown.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance from that path point to east and north in metres, at equal scale. Heights inside
        the search area are ringed; the areas of neighbouring path points are outlined.

    Raises
    ------
    CoverageError
        If there are no heights nearby.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> from trueterrain.profile import straight_path
    >>> axis = np.arange(0.0, 0.2, 0.01)
    >>> plane = make_surface(np.zeros((20, 20)), easting=axis, northing=axis)
    >>> ax = search_area_map(plane, straight_path((0.05, 0.1), (0.15, 0.1)), station=0.05)
    >>> ax.texts[0].get_text()
    'equal scale, 21 heights in the disc of radius 25 mm at s = 0.05 m'
    """
    index = int(np.argmin(np.abs(path.s - station)))
    at = np.array([path.easting[index], path.northing[index]])
    half = _AROUND * area_reach(area)
    east, north, height = _heights_nearby(ground, at, half)
    inside = _inside_area(area, float(path.heading[index]), east, north)
    ax = canvas.axes_or_new(ax, width=6.4, height=5.6)
    rings = np.where(inside, 1.3, 0.0).tolist()
    dots = ax.scatter(
        east,
        north,
        c=height,
        s=26,
        linewidths=rings,
        edgecolors="black",
        cmap=canvas.HEIGHT_MAP,
        label="heights, those inside ringed",
    )
    canvas.colour_bar(dots, ax, canvas.height_scale(height))
    _draw_areas(ax, path, area, index)
    _draw_path_points(ax, path, at)
    ax.set_aspect("equal")
    ax.set(xlim=(-_EDGE * half, _EDGE * half), ylim=(-_EDGE * half, _EDGE * half))
    millimetres = canvas.LengthScale(factor=1000.0, unit="mm")
    canvas.scale_axis(ax.xaxis, millimetres, "East of the path point")
    canvas.scale_axis(ax.yaxis, millimetres, "North of the path point")
    where = f"{_area_name(area)} at s = {path.s[index]:.4g} m"
    canvas.annotate_axes(ax, f"equal scale, {np.count_nonzero(inside)} heights in the {where}")
    canvas.legend_above(ax, columns=2)
    return ax


def _heights_nearby(
    ground: xr.Dataset, at: np.ndarray, half: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights within a square, as distances east and north of its centre, and heights."""
    if kind_of(ground) == "surface":
        easting, northing = node_coordinates(check_surface(ground))
        height = ground.height.values
    else:
        check_points(ground)
        easting, northing, height = (ground[name].values for name in ("easting", "northing", "up"))
    east, north = easting - at[0], northing - at[1]
    near = (np.abs(east) <= half) & (np.abs(north) <= half) & np.isfinite(height)
    if not near.any():
        raise CoverageError(
            f"there is no height within {half:.3g} m of easting {at[0]:.3f} m, "
            f"northing {at[1]:.3f} m",
            cure="Choose a station at which the path is on the ground.",
        )
    return east[near], north[near], height[near]


def _inside_area(
    area: SearchArea, heading: float, east: np.ndarray, north: np.ndarray
) -> np.ndarray:
    along = east * np.cos(heading) + north * np.sin(heading)
    across = north * np.cos(heading) - east * np.sin(heading)
    half_along, half_across = (half + EDGE_TOLERANCE for half in area.half_axes)
    if isinstance(area, Rectangle):
        return np.asarray((np.abs(along) <= half_along) & (np.abs(across) <= half_across))
    return np.asarray(np.hypot(along / half_along, across / half_across) <= 1)


def _draw_areas(ax: "Axes", path: PlaneCurve, area: SearchArea, index: int) -> None:
    """Draw the outline of the search area at the path point, and thin ones of its neighbours."""
    every = max(1, round(_OUTLINES * area.half_axes[0] / (_path_spacing(path) or np.inf)))
    for i in range(index % every, len(path), every):
        east, north = path.easting[i] - path.easting[index], path.northing[i] - path.northing[index]
        if np.hypot(east, north) > 2 * _AROUND * area_reach(area) or i == index:
            continue
        ax.add_patch(_area_outline(area, east, north, path.heading[i], color="0.6", linewidth=0.6))
    bold = {"color": canvas.PATH_COLOUR, "linewidth": 2.2, "zorder": 3}
    ax.add_patch(_area_outline(area, 0.0, 0.0, path.heading[index], **bold))
    ax.plot(
        [],
        [],
        marker="s" if isinstance(area, Rectangle) else "o",
        markersize=9,
        linestyle="none",
        markerfacecolor="none",
        markeredgecolor=canvas.PATH_COLOUR,
        markeredgewidth=2.2,
        label="search area",
    )


def _area_outline(area: SearchArea, east: float, north: float, heading: float, **style: Any) -> Any:
    from matplotlib import patches

    along, across = 2 * area.half_axes[0], 2 * area.half_axes[1]
    degrees = float(np.rad2deg(heading))
    if isinstance(area, Rectangle):
        corner = (east - along / 2, north - across / 2)
        return patches.Rectangle(
            corner, along, across, angle=degrees, rotation_point="center", fill=False, **style
        )
    return patches.Ellipse((east, north), along, across, angle=degrees, fill=False, **style)


def _draw_path_points(ax: "Axes", path: PlaneCurve, at: np.ndarray) -> None:
    spacing = 1000 * _path_spacing(path)
    every = f", every {spacing:.4g} mm of arc length" if spacing else ""
    ax.plot(
        path.easting - at[0],
        path.northing - at[1],
        "-o",
        color=canvas.PATH_COLOUR,
        markersize=5,
        markerfacecolor="white",
        markeredgewidth=1.4,
        linewidth=0.8,
        zorder=4,
        label=f"path points{every}",
    )


def _path_spacing(path: PlaneCurve) -> float:
    """Arc length between two path points [m]; 0 if there is only one."""
    return float(np.diff(path.s[:2]).sum())


def _area_name(area: SearchArea) -> str:
    along, across = (2000 * half for half in area.half_axes)
    if isinstance(area, Disc):
        return f"disc of radius {along / 2:g} mm"
    kind = "ellipse" if isinstance(area, Ellipse) else "rectangle"
    return f"{kind} of {along:g} mm × {across:g} mm"
