"""Differences of profiles from a reference."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from trueterrain.core.errors import SchemaError
from trueterrain.core.schemas import check_profile
from trueterrain.figures import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SAME_STATION = 1e-6  # [m] stations that differ by less are the same


def profile_difference(
    profile: xr.Dataset | Mapping[str, xr.Dataset],
    reference: xr.Dataset,
    *,
    ax: "Axes | None" = None,
) -> "Axes":
    """Height of profiles above a reference, with the standard deviation of the difference.

    Parameters
    ----------
    profile : xarray.Dataset or mapping of str to xarray.Dataset
        A Profile of one track, or several with their names.
    reference : xarray.Dataset
        Profile of one track at the same stations. The errors of both are taken as independent; an
        unknown standard deviation counts as 0.
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path and difference, both in metres; the RMS is in the legend.

    Raises
    ------
    SchemaError
        If the stations differ, or a profile has several tracks.

    Examples
    --------
    >>> from trueterrain.core.schemas import make_profile
    >>> low, high = make_profile([0.0, 1.0], [0.0, 0.0]), make_profile([0.0, 1.0], [0.001, 0.001])
    >>> profile_difference(high, low).get_legend().get_texts()[0].get_text()
    'difference, RMS 1.00 mm'
    """
    named: Mapping[str, xr.Dataset]
    named = {"difference": profile} if isinstance(profile, xr.Dataset) else profile
    ax = canvas.axes_or_new(ax, height=2.6)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    for number, (name, above) in enumerate(named.items()):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        _draw_difference(ax, check_profile(above), check_profile(reference), name, colour)
    ax.set_xlabel("Distance along the path s [m]")
    canvas.scale_axis(ax.yaxis, canvas.LengthScale(factor=1000.0, unit="mm"), "Height difference")
    ax.margins(x=0)
    canvas.draw_grid(ax)
    canvas.legend_above(ax, notes=False)
    return ax


def _draw_difference(
    ax: "Axes", profile: xr.Dataset, reference: xr.Dataset, name: str, colour: str
) -> None:
    s = _common_stations(profile, reference)
    difference = profile.height.values - reference.height.values
    sd = np.hypot(_known_sd(profile), _known_sd(reference))
    rms = 1000 * float(np.sqrt(np.nanmean(difference**2)))
    ax.plot(s, difference, color=colour, linewidth=1.0, label=f"{name}, RMS {rms:.2f} mm")
    if sd.any():
        ax.fill_between(
            s,
            difference - sd,
            difference + sd,
            color=colour,
            alpha=0.25,
            linewidth=0,
            label="± 1 sd",
        )


def _common_stations(profile: xr.Dataset, reference: xr.Dataset) -> np.ndarray:
    if "track" in profile.dims or "track" in reference.dims:
        raise SchemaError(
            "has several tracks, a difference needs one of each",
            place="dimension track",
            cure="Choose one: profile.sel(track=...).",
        )
    s: np.ndarray = profile.s.values
    other: np.ndarray = reference.s.values
    if s.shape != other.shape or np.abs(s - other).max() > _SAME_STATION:
        raise SchemaError(
            f"differs: {s.size} stations from {s[0]:g} to {s[-1]:g} m, the reference has "
            f"{other.size} from {other[0]:g} to {other[-1]:g} m",
            place="axis s",
            cure="Extract both along the same path.",
        )
    return s


def _known_sd(profile: xr.Dataset) -> np.ndarray:
    if "sd" not in profile:
        return np.zeros(profile.sizes["s"])
    sd: np.ndarray = profile.sd.fillna(0.0).values
    return sd
