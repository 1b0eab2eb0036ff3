"""Navigation: plan of the trajectory, and heights over time."""

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from trueterrain.figures import canvas
from trueterrain.figures.run import groups

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_EPOCHS = 100_000  # of a line


def navigation_plan(navigation: xr.DataTree | xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Plan of the trajectory.

    Parameters
    ----------
    navigation : xarray.DataTree or xarray.Dataset
        A run, or navigation.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        East and north of the origin [m], at equal scale.

    Raises
    ------
    SchemaError
        If a variable is missing.

    Examples
    --------
    >>> from trueterrain.formats.navigation import make_navigation
    >>> names = ("time", "east", "north", "up", "roll", "pitch", "yaw")
    >>> drive = make_navigation({name: [0.0, 1.0] for name in names}, origin=(11.0, 48.0, 500.0))
    >>> navigation_plan(drive).get_xlabel()
    'East of the origin [m]'
    """
    values = _thin_epochs(navigation, ("east", "north"))
    x, y = values["east"], values["north"]
    height = canvas.map_height(float(np.ptp(x)), float(np.ptp(y)))
    ax = canvas.axes_or_new(ax, height=height)
    canvas.draw_path(ax, x, y, label="trajectory")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("East of the origin [m]")
    ax.set_ylabel("North of the origin [m]")
    canvas.draw_grid(ax)
    distance = float(np.hypot(np.diff(x), np.diff(y)).sum())
    canvas.annotate_axes(ax, f"equal scale, {distance:,.0f} m driven")
    canvas.legend_above(ax)
    return ax


def navigation_heights(navigation: xr.DataTree | xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Heights of navigation over time, with a band of one standard deviation if reported.

    Parameters
    ----------
    navigation : xarray.DataTree or xarray.Dataset
        A run, or navigation.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Time [s] and height above the origin [m].

    Raises
    ------
    SchemaError
        If a variable is missing.
    """
    values = _thin_epochs(navigation, ("time", "up"))
    group = _navigation_group(navigation)
    start = canvas.coordinate_scale(values["time"]).base
    time, up = values["time"] - start, values["up"]
    ax = canvas.axes_or_new(ax, height=2.8)
    if "sd_up" in group:
        sd = _thin_epochs(navigation, ("time", "sd_up"))["sd_up"]
        ax.fill_between(
            time,
            up - sd,
            up + sd,
            color=canvas.COLOURS[0],
            alpha=0.25,
            linewidth=0,
            label="± 1 sd",
        )
    ax.plot(time, up, color=canvas.COLOURS[0], linewidth=1.3, label="height")
    ax.set_xlabel(f"Time {canvas.MINUS} {start:.12g} s [s]" if start else "Time [s]")
    canvas.scale_axis(ax.yaxis, canvas.height_scale(up), "Height")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.legend_above(ax, notes=False)
    return ax


def _navigation_group(data: xr.DataTree | xr.Dataset) -> xr.Dataset:
    return groups.run_group(data, "navigation") if isinstance(data, xr.DataTree) else data


def _thin_epochs(data: xr.DataTree | xr.Dataset, names: tuple[str, ...]) -> dict[str, Any]:
    values = groups.equal_columns(_navigation_group(data), names, "navigation")
    every = -(-values[names[0]].size // _MAX_EPOCHS)
    return {name: column[::every] for name, column in values.items()}
