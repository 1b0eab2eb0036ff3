"""Errors of simulated navigation over time."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import xarray as xr

from trueterrain.figures import canvas
from trueterrain.figures.run import groups

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_SAMPLES = 200_000  # of a line


def navigation_errors(
    runs: xr.DataTree | Mapping[str, xr.DataTree],
    *,
    component: Literal["east", "north", "up", "roll", "pitch", "yaw"] = "up",
    ax: "Axes | None" = None,
) -> "Axes":
    """Drift and noise of the navigation of one or several simulated runs.

    Parameters
    ----------
    runs : xarray.DataTree or mapping of str to xarray.DataTree
        A simulated run, or several by name.
    component : str
        Component of the pose. For the height, drift and noise are drawn separately.
    ax : Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    Axes
        Time since the start of each run [s] and error, recorded less true value [m] or [rad].

    Raises
    ------
    SchemaError
        If a run holds no truth.
    ValueError
        If the component is unknown, or there is no run.
    """
    if component not in groups.POSE:
        message = f"component must be one of {', '.join(groups.POSE)}, got {component!r}."
        raise ValueError(message)
    named = {groups.run_title(runs): runs} if isinstance(runs, xr.DataTree) else runs
    if not named:
        message = "runs must hold at least 1 run, got none."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.0)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    drawn = []
    for number, (name, run) in enumerate(named.items()):
        truth = groups.run_group(run, "truth/navigation")
        every = -(-truth.sizes["epoch"] // _MAX_SAMPLES)
        truth = truth.isel(epoch=slice(None, None, every)).load()
        time = truth["true_time"].values
        error = truth[f"error_{component}"].values
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        if component == "up":
            ax.plot(time - time[0], error, color=colour, linewidth=0.5, alpha=0.35)
            ax.plot(
                time - time[0],
                truth["drift_up"].values,
                color=colour,
                linewidth=1.6,
                label=f"{name}: drift",
            )
            ax.plot([], [], color=colour, linewidth=0.8, alpha=0.5, label="with noise")
        else:
            ax.plot(time - time[0], error, color=colour, linewidth=0.8, label=name or None)
        drawn.append(error)
    quantity = {"up": "height"}.get(component, component)
    if component in ("roll", "pitch", "yaw"):
        canvas.degree_axis(ax.yaxis, f"Error of {quantity}")
    else:
        canvas.scale_axis(ax.yaxis, canvas.height_scale(*drawn), f"Error of {quantity}")
    ax.set_xlabel("Time since the start of the run [s]")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.legend_above(ax, notes=False)
    return ax
