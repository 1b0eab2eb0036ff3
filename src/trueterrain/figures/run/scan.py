"""Points of scans in plan and elevation, with shadows."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.figures import canvas
from trueterrain.figures.run import groups
from trueterrain.surface import heights_at

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SHADOW = 3.0  # ratio of the distance of neighbours to that on level ground: more is a shadow
_MIN_ASPECT = 0.1  # height over width of the plan
_LINE = 2000  # points of the line of the true ground
_AROUND = 3.0  # [m] of the true ground that is read on each side along the trajectory


def scan_plan(
    run: xr.DataTree,
    *,
    at: float | None = None,
    scans: int = 200,
    across: tuple[float, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Plan of the points of consecutive scans, coloured by height.

    Their spacing is smallest under the scanner and increases to the sides, as in Fig. 2-3 of Smith,
    "Improving the Quality of Terrain Measurement" (Virginia Tech, 2009); a narrow stretch with few
    scans shows it best.

    Parameters
    ----------
    run : xarray.DataTree
        Simulated run; its truth gives the exact poses.
    at : float, optional
        Time stamp of the first scan [s]; by default scans at the centre of the run.
    scans : int
        Number of scans.
    across : tuple of float, optional
        Range of lateral distance from the scanner, to the left positive [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Offset, left on the left, and longitudinal distance from the first scan [m], at equal scale;
        the range of the point spacing along a scan is printed, from the 2 % to the 98 % quantile.

    Raises
    ------
    SchemaError
        If the run holds no truth.
    CoverageError
        If there is no scan at that time, or no return.
    ValueError
        If `scans` is less than 1.
    """
    groups.run_group(run, "truth/scanner")
    returns = groups.returns_of(run, groups.scans_from(run, at, scans))
    shown = _shown_beams(returns, across)
    x, y, z = (part[shown] for part in (returns.across, returns.along, returns.up))
    ax = canvas.axes_or_new(ax, height=canvas.map_height(float(np.ptp(x)), float(np.ptp(y))))
    size = 2.0 if x.size > 5000 else 8.0
    dots = ax.scatter(x, y, c=z, s=size, linewidths=0, cmap=canvas.HEIGHT_MAP, rasterized=True)
    canvas.colour_bar(dots, ax, canvas.height_scale(z))
    ax.set_aspect("equal")
    margin = 0.5 * (_MIN_ASPECT * float(np.ptp(x)) - float(np.ptp(y)))
    if margin > 0:  # the scanner hardly moved
        ax.set_ylim(y.min() - margin, y.max() + margin)
    ax.invert_xaxis()
    ax.set_xlabel(f"Offset from the scanner at {returns.time[0]:.6g} s, left + [m]")
    ax.set_ylabel("Longitudinal distance [m]")
    gaps = 1000 * np.abs(np.diff(np.where(shown, returns.across, np.nan), axis=1))
    near, far = np.nanpercentile(gaps, [2, 98]) if np.isfinite(gaps).any() else (np.nan, np.nan)
    count = len(returns.time)
    canvas.annotate_axes(
        ax,
        f"equal scale, {count} scan{'s' if count > 1 else ''}, "
        f"{near:.1f} to {far:.1f} mm from point to point",
    )
    return ax


def scan_elevation(
    run: xr.DataTree,
    *,
    at: float | None = None,
    across: tuple[float, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Elevation of one scan, seen from behind the scanner: points, true ground and shadows.

    Where points of neighbouring beams are more than three times as far apart as on level ground,
    the stretch between them is marked: a higher point hides it, or it is steeper than the beam.

    Parameters
    ----------
    run : xarray.DataTree
        The run. If it holds the truth, points are placed on the ground and the true ground is
        drawn; otherwise they are shown in the axes of the scanner.
    at : float, optional
        Time stamp of the scan [s]; by default at the centre of the run.
    across : tuple of float, optional
        Range of lateral distance from the scanner, to the left positive [m].
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Offset, left on the left, and height [m]; the vertical exaggeration is printed.

    Raises
    ------
    CoverageError
        If there is no scan at that time, or it has no return.
    """
    returns = groups.returns_of(run, groups.scans_from(run, at, 1))
    ax = canvas.axes_or_new(ax)
    seen = np.flatnonzero(_shown_beams(returns, across)[0])
    offset, up, angle = returns.across[0, seen], returns.up[0, seen], returns.angle[seen]
    _draw_true_ground(ax, run, returns, offset)
    for number, index in enumerate(_find_shadows(offset, angle)):
        ax.axvspan(
            offset[index],
            offset[index + 1],
            color=canvas.COLOURS[4],
            alpha=0.35,
            linewidth=0,
            label="not seen" if number == 0 else None,
            zorder=1,
        )
    ax.plot(offset, up, ".", color=canvas.COLOURS[0], markersize=2.5, label="returns", zorder=2)
    ax.invert_xaxis()
    ax.set_xlabel(f"Offset from the scanner at {returns.time[0]:.6g} s, left + [m]")
    name = "Height" if returns.position is not None else "Height above the scanner"
    canvas.scale_axis(ax.yaxis, canvas.height_scale(up), name)
    canvas.draw_grid(ax)
    ax.margins(x=0.01)
    canvas.note_exaggeration(ax)
    canvas.legend_above(ax)
    return ax


def _find_shadows(across: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Indices of returns that are followed by a shadow; beams without return do not count."""
    height = float(np.median(np.abs(across[angle != 0] / np.tan(angle[angle != 0]))))
    level = height * np.abs(np.diff(np.tan(angle)))
    return np.flatnonzero(np.abs(np.diff(across)) > _SHADOW * level)


def _shown_beams(returns: groups.ScanReturns, across: tuple[float, float] | None) -> np.ndarray:
    """Mask of the beams with a return in a lateral range."""
    low, high = (-np.inf, np.inf) if across is None else across
    shown: np.ndarray = (returns.across >= low) & (returns.across <= high)
    if not shown.any():
        where = "" if across is None else f" from {low:g} m to {high:g} m"
        raise CoverageError(f"holds no return{where}", place=f"scan at {returns.time[0]:g} s")
    return shown


def _draw_true_ground(
    ax: "Axes", run: xr.DataTree, returns: groups.ScanReturns, offset: np.ndarray
) -> None:
    """Draw the line of the true ground below the points of a scan, if it is known."""
    position, across = returns.position, returns.across[0]
    inside = np.flatnonzero(np.isfinite(across))
    if position is None or inside.size < 2 or not groups.has_group(run, "truth/ground"):
        return
    # In plan, the points of a scan are nearly on a line: the beams differ in time only slightly.
    line = np.linspace(offset.min(), offset.max(), _LINE)
    east, north = (
        np.polyval(np.polyfit(across[inside], position[0, inside, c], 1), line) for c in (0, 1)
    )
    ground = groups.run_group(run, "truth/ground")
    away = np.hypot(
        ground["easting"].values - east.mean(), ground["northing"].values - north.mean()
    )
    spacing = abs(float(ground["u"][1] - ground["u"][0]))
    first = max(int(away.argmin()) - int(np.ceil(_AROUND / spacing)), 0)
    last = int(away.argmin()) + int(np.ceil(_AROUND / spacing)) + 1
    near = ground.isel(u=slice(first, last)).load()
    ax.plot(
        line,
        heights_at(near, east, north),
        color="0.5",
        linewidth=1.0,
        zorder=1.5,
        label=f"true ground, every {1000 * spacing:g} mm",
    )
