"""Profiles over the distance along their path, with their standard deviation."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.schemas import check_profile
from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def profiles(data: xr.Dataset | Mapping[str, xr.Dataset], *, ax: "Axes | None" = None) -> "Axes":
    """Heights of one or several profiles, with a band of one standard deviation where known.

    Parameters
    ----------
    data : xarray.Dataset or mapping of str to xarray.Dataset
        A Profile, or several with their names.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path and height, both in metres; the vertical exaggeration is printed.

    Raises
    ------
    SchemaError
        If the data are no profiles.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> ax = profiles(make_profile([0.0, 1.0, 2.0], [0.0, 0.01, 0.0]))
    >>> ax.get_ylabel()
    'Height [mm]'
    """
    named = {"": data} if isinstance(data, xr.Dataset) else data
    tracks = [
        ((f"{name} {track}" if name else track), line)
        for name, profile in named.items()
        for track, line in _profile_tracks(check_profile(profile))
    ]
    ax = canvas.axes_or_new(ax)
    for number, (name, line) in enumerate(tracks):
        draw_profile(ax, line, name.strip(), canvas.COLOURS[number % len(canvas.COLOURS)])
    label_profile_axes(ax, *[line.height for _, line in tracks])
    canvas.legend_above(ax)
    return ax


def draw_profile(
    ax: "Axes", profile: xr.Dataset, name: str, colour: str, width: float = 1.3
) -> None:
    """Draw the line of one track, and its band."""
    s, height = profile.s.values, profile.height.values
    if "sd" in profile and np.isfinite(profile.sd).any():
        sd = profile.sd.values
        ax.fill_between(
            s,
            height - sd,
            height + sd,
            color=colour,
            alpha=0.25,
            linewidth=0,
            label=f"{name} ± 1 sd".strip(),
        )
    ax.plot(s, height, color=colour, linewidth=width, label=name or None)


def label_profile_axes(ax: "Axes", *heights: xr.DataArray) -> None:
    """Set labels, units and limits of axes that show profiles, and print the exaggeration."""
    ax.set_xlabel("Distance along the path s [m]")
    canvas.scale_axis(ax.yaxis, canvas.height_scale(*heights), "Height")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.note_exaggeration(ax)


def _profile_tracks(profile: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    if "track" not in profile.dims:
        return [("", profile)]
    return [(str(name), profile.sel(track=name)) for name in profile.track.values]
