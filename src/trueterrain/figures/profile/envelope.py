"""Tyre envelopes over the ground profile."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.errors import CoverageError
from trueterrain.core.schemas import check_profile
from trueterrain.figures import canvas
from trueterrain.figures.profile.profiles import label_profile_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GROUND = "0.88"
_OUTLINE = "0.45"
_MARGIN = 0.12  # below the lowest and above the highest ground, as a fraction of the range


def tyre_envelopes(
    ground: xr.Dataset,
    envelopes: Mapping[str, xr.Dataset],
    *,
    between: tuple[float, float] | None = None,
    ax: "Axes | None" = None,
) -> "Axes":
    """Tyre envelopes over the profile of the ground.

    Parameters
    ----------
    ground : xarray.Dataset
        Profile of one track, as of `trueterrain.profile.point_profile`.
    envelopes : mapping of str to xarray.Dataset
        Profiles or effective roads of one track, with the names of their tyres.
    between : tuple of float, optional
        Stations between which they are drawn [m]; by default all.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path and height, both in metres; the vertical exaggeration is printed.

    Raises
    ------
    CoverageError
        If a profile has several tracks, or the ground has no heights between the stations.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.profile import tyre_envelope
    >>> step = make_profile(np.arange(100) * 0.01, np.repeat([0.0, 0.02], 50))
    >>> ax = tyre_envelopes(step, {"disc": tyre_envelope(step)})
    >>> [line.get_label() for line in ax.lines]
    ['ground', 'disc']
    """
    for name, road in {"ground": check_profile(ground), **envelopes}.items():
        if "track" in road.dims:
            raise CoverageError(
                f"{name} has several tracks", cure="Choose one with data.sel(track=...)."
            )
    begin, end = between or (float(ground.s[0]), float(ground.s[-1]))
    shown = {
        name: road.isel(s=(road.s.values >= begin) & (road.s.values <= end))
        for name, road in {"ground": ground, **envelopes}.items()
    }
    line = shown.pop("ground")
    if not np.isfinite(line.height).any():
        raise CoverageError(f"the ground has no heights between {begin:g} m and {end:g} m")
    ax = canvas.axes_or_new(ax)
    heights = [line.height, *(road.height for road in shown.values())]
    low, high = (float(f([f(h) for h in heights])) for f in (np.nanmin, np.nanmax))
    margin = _MARGIN * max(high - low, 1e-3)
    ax.fill_between(line.s, line.height, low - 2 * margin, color=_GROUND, linewidth=0)
    ax.plot(line.s, line.height, color=_OUTLINE, linewidth=1.0, label="ground")
    for number, (name, road) in enumerate(shown.items()):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        ax.plot(road.s, road.height, color=colour, linewidth=1.4, label=name)
    label_profile_axes(ax, *heights)
    ax.set_ylim(low - margin, high + margin)
    canvas.legend_above(ax, columns=5)
    return ax
