"""Differences of surfaces: maps and structure functions."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas
from trueterrain.figures.surface.heights import Frame, surface_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DIVERGING_MAP = "RdBu_r"  # white at 0, readable by colour-blind people
_QUANTILE = 99.0  # [%] of the magnitudes within the colours
_MIN_SPAN = 1e-6  # [m] of the colours
_MIN_RATIO = 10.0  # of the ends of an axis, so that it has ticks


def difference_map(
    difference: xr.Dataset,
    *,
    max_difference: float | None = None,
    frame: Frame = "grid",
    ax: "Axes | None" = None,
) -> "Axes":
    """Map of height differences: blue where the surface is lower, red where it is higher.

    Parameters
    ----------
    difference : xarray.Dataset
        As by `trueterrain.surface.difference.surface_difference`.
    max_difference : float, optional
        Difference at the ends of the colours [m]; by default the 99 % quantile of the magnitude.
    frame : {"grid", "ground"}
        As for `surface_map`.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Both axes in metres; nodes without difference are grey.

    Raises
    ------
    ValueError
        If `max_difference` is not greater than 0.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_surface
    >>> apart = make_surface(0.001 * np.eye(3), easting=[0, 1, 2], northing=[0, 1, 2])
    >>> difference_map(apart).get_ylabel()
    'Northing [m]'
    """
    if max_difference is not None and not max_difference > 0:
        message = f"max_difference must be greater than 0 m, got {max_difference}"
        raise ValueError(message)
    import matplotlib as mpl

    height = difference["height"].values
    if max_difference is None:
        max_difference = max(float(np.nanpercentile(np.abs(height), _QUANTILE)), _MIN_SPAN)
    ax = surface_map(difference, frame=frame, ax=ax)
    image = ax.images[0] if ax.images else ax.collections[0]
    image.set_cmap(mpl.colormaps[_DIVERGING_MAP].with_extremes(bad=canvas.HOLE_COLOUR))
    image.set_clim(-max_difference, max_difference)
    bar = next(child for child in ax.child_axes)
    canvas.scale_axis(bar.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height difference")
    return ax


def structure_functions(
    structure: xr.Dataset | Mapping[str, xr.Dataset], *, ax: "Axes | None" = None
) -> "Axes":
    """Structure functions of differences: mean square change over a distance.

    Parameters
    ----------
    structure : xarray.Dataset or mapping of str to xarray.Dataset
        As by `trueterrain.surface.difference.structure_function`, or several by name.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Distance [m] and mean square change [mm²], both logarithmic. White noise is constant,
        drift increases.

    Raises
    ------
    ValueError
        If no difference changes anywhere.

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
        positive = one["structure"].values > 0
        drawn = drawn or bool(positive.any())
        ax.plot(
            one["distance"].values[positive],
            1e6 * one["structure"].values[positive],
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
    widen = max(1.0, _MIN_RATIO / (high / low)) ** 0.5
    ax.set_ylim(low / widen, high * widen)
    for axis in (ax.xaxis, ax.yaxis):
        canvas.plain_log_axis(axis)
    ax.set_xlabel("Distance [m]")
    ax.set_ylabel("Mean square change [mm²]")
    ax.grid(which="major", color="0.85", linewidth=0.6)
    ax.grid(which="minor", color="0.94", linewidth=0.4)
    ax.set_axisbelow(True)
    canvas.legend_above(ax, notes=False)
    return ax
