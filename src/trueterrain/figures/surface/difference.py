"""How surfaces differ: where, and over which distances."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas
from trueterrain.figures.surface.heights import Frame, surface_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BELOW_TO_ABOVE = "RdBu_r"  # white at no difference, readable by colour-blind people
_SHOWN = 99.0  # [%] of differences that the colours span
_LEAST = 1e-6  # [m] that they span at least
_DECADE = 10.0  # [1] range that heights of the axis have at least, so that it has ticks
_MANY = 1e4  # [1] range of an axis from which on only powers of ten are written


def difference_map(
    difference: xr.Dataset,
    *,
    largest: float | None = None,
    frame: Frame = "grid",
    ax: "Axes | None" = None,
) -> "Axes":
    """Differences of height seen from above: blue where the surface lies lower, red where higher.

    Parameters
    ----------
    difference : xarray.Dataset
        Of `trueterrain.surface.difference.surface_difference`.
    largest : float, optional
        Difference at the ends of the colours [m]; by default the magnitude that 99 % of the nodes
        do not exceed.
    frame : {"grid", "ground"}
        As by `surface_map`.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Both axes in metres; nodes without difference are grey.

    Raises
    ------
    ValueError
        If `largest` is not greater than 0.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> apart = make_surface(0.001 * np.eye(3), easting=[0, 1, 2], northing=[0, 1, 2])
    >>> difference_map(apart).get_ylabel()
    'Northing [m]'
    """
    if largest is not None and not largest > 0:
        message = f"largest must be greater than 0 m, got {largest}"
        raise ValueError(message)
    import matplotlib as mpl

    height = difference["height"].values
    if largest is None:
        largest = max(float(np.nanpercentile(np.abs(height), _SHOWN)), _LEAST)
    ax = surface_map(difference, frame=frame, ax=ax)
    image = ax.images[0] if ax.images else ax.collections[0]
    image.set_cmap(mpl.colormaps[_BELOW_TO_ABOVE].with_extremes(bad=canvas.HOLE_COLOUR))
    image.set_clim(-largest, largest)
    bar = next(child for child in ax.child_axes)
    canvas.scale_axis(bar.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height difference")
    return ax


def structure_functions(
    structure: xr.Dataset | Mapping[str, xr.Dataset], *, ax: "Axes | None" = None
) -> "Axes":
    """Structure functions of differences: how much they change over a distance.

    Parameters
    ----------
    structure : xarray.Dataset or mapping of str to xarray.Dataset
        Of `trueterrain.surface.difference.structure_function`, or several with their names.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance [m] and mean square change [mm²], both logarithmic. White noise is a level line,
        drift rises.

    Raises
    ------
    ValueError
        If nothing can be drawn: no difference changes anywhere.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> from trueterrain.surface.difference import structure_function
    >>> ramp = np.outer(np.ones(3), 0.001 * np.arange(8))
    >>> apart = make_surface(ramp, easting=np.arange(8), northing=np.arange(3))
    >>> structure_functions(structure_function(apart)).get_ylabel()
    'Mean square change [mm²]'
    """
    named = {"": structure} if isinstance(structure, xr.Dataset) else structure
    ax = canvas.axes_or_new(ax, height=3.8)
    drawn = False
    for number, (name, one) in enumerate(named.items()):
        seen = one["structure"].values > 0
        drawn = drawn or bool(seen.any())
        ax.plot(
            one["distance"].values[seen],
            1e6 * one["structure"].values[seen],
            color=canvas.COLOURS[number % len(canvas.COLOURS)],
            linewidth=1.3,
            marker="o",
            markersize=3,
            label=name or None,
        )
    if not drawn:
        message = "structure must change somewhere, got differences that are the same everywhere."
        raise ValueError(message)
    ax.set_xscale("log")
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    widen = max(1.0, _DECADE / (high / low)) ** 0.5
    ax.set_ylim(low / widen, high * widen)
    _plain_ticks(ax)
    ax.set_xlabel("Distance [m]")
    ax.set_ylabel("Mean square change [mm²]")
    ax.grid(which="major", color="0.85", linewidth=0.6)
    ax.grid(which="minor", color="0.94", linewidth=0.4)
    ax.set_axisbelow(True)
    canvas.legend_above(ax, notes=False)
    return ax


def _plain_ticks(ax: "Axes") -> None:
    """Plain numbers at 1, 2 and 5 of each decade; only at 1 where there are many decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (ax.xaxis, ax.yaxis):
        low, high = axis.get_view_interval()
        steps = (1.0, 2.0, 5.0) if high / low < _MANY else (1.0,)
        axis.set_major_locator(LogLocator(subs=steps, numticks=20))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
