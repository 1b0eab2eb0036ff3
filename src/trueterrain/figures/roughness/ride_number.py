"""Ride Number of segments."""

from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SCALE = (0.0, 5.0)  # from impassable to perfect


def ride_number_segments(rated: xr.Dataset, *, ax: "Axes | None" = None) -> "Axes":
    """Ride Number of each segment as steps, with that of the whole profile.

    Parameters
    ----------
    rated : xarray.Dataset
        Result of `trueterrain.roughness.ride_number` with a segment length.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path [m] and Ride Number, from 0 to 5; that of the whole is in the
        legend.

    Raises
    ------
    ValueError
        If there are no segments.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import ride_number
    >>> s = np.arange(0.0, 60.0, 0.1)
    >>> road = make_profile(s, 0.001 * np.sin(2 * np.pi * s / 5))
    >>> ride_number_segments(ride_number(road, segment=20.0)).get_ylabel()
    'Ride Number'
    """
    if "segment_rn" not in rated:
        message = "rated must hold segments: call ride_number(profile, segment=...), got none."
        raise ValueError(message)
    ax = canvas.axes_or_new(ax, height=3.0)
    edges = np.append(rated["start"].values, rated["end"].values[-1:])
    several = rated.sizes["track"] > 1
    for number, track in enumerate(rated["track"].values):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        one = rated.sel(track=track)
        name = f"{track}, " if several else ""
        ax.stairs(one["segment_rn"].values, edges, color=colour, linewidth=1.6, baseline=None)
        whole = one["rn"].item()
        ax.axhline(
            whole, color=colour, linewidth=1.0, linestyle="--", label=f"{name}whole {whole:.2f}"
        )
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(*_SCALE)
    ax.set_xlabel("Distance along the path s [m]")
    ax.set_ylabel("Ride Number")
    ax.grid(axis="y", color="0.9", linewidth=0.6)
    ax.set_axisbelow(True)
    canvas.annotate_axes(ax, f"segments of {float(edges[1] - edges[0]):g} m; 5 is perfectly smooth")
    canvas.legend_above(ax)
    return ax
