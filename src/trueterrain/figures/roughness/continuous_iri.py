"""International Roughness Index in a sliding window, with stretches above a threshold."""

from typing import TYPE_CHECKING

import xarray as xr

from trueterrain.figures import canvas
from trueterrain.roughness.stretches import find_stretches

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def continuous_roughness(
    sliding: xr.Dataset, *, threshold: float | None = None, ax: "Axes | None" = None
) -> "Axes":
    """IRI of a sliding window over its midpoint, with the stretches above a threshold shaded.

    Parameters
    ----------
    sliding : xarray.Dataset
        Result of `trueterrain.roughness.continuous_iri`.
    threshold : float, optional
        Largest permitted index [m/km].
    ax : Axes, optional
        Where to draw; by default a new figure.

    Returns
    -------
    Axes
        Distance along the path [m] and index [m/km].

    Examples
    --------
    >>> import numpy as np
    >>> from trueterrain.core.schemas import make_profile
    >>> from trueterrain.roughness import continuous_iri
    >>> s = np.arange(0.0, 100.0, 0.1)
    >>> bump = make_profile(s, 0.02 * np.exp(-((s - 50.0) ** 2)))
    >>> ax = continuous_roughness(continuous_iri(bump, 7.62), threshold=5.0)
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['above 5 m/km']
    """
    ax = canvas.axes_or_new(ax, height=3.0)
    several = sliding.sizes["track"] > 1
    for number, track in enumerate(sliding["track"].values):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        name = f"{track}" if several else None
        values = sliding["iri"].sel(track=track)
        ax.plot(sliding["s"], values, color=colour, linewidth=1.2, label=name)
    if threshold is not None:
        ax.axhline(threshold, color="0.3", linewidth=1.0, linestyle="--")
        label: str | None = f"above {threshold:.4g} m/km"
        for begin, end in _merge_stretches(sliding, threshold):
            ax.axvspan(begin, end, color=canvas.COLOURS[1], alpha=0.2, linewidth=0, label=label)
            label = None
    midpoint = sliding["s"].values
    ax.set_xlim(midpoint[0], midpoint[-1] if midpoint.size > 1 else midpoint[0] + 1.0)
    ax.set_ylim(bottom=0)
    ax.set_xlabel("Midpoint of the window s [m]")
    ax.set_ylabel("IRI [m/km]")
    canvas.draw_grid(ax, "y")
    length = float(sliding["end"][0] - sliding["start"][0])
    canvas.annotate_axes(ax, f"sliding window of {length:g} m")
    canvas.legend_above(ax)
    return ax


def _merge_stretches(sliding: xr.Dataset, threshold: float) -> list[tuple[float, float]]:
    """Stretches in which any track is above the threshold."""
    worst = sliding["iri"].max("track").expand_dims(track=["any"]).transpose("track", "s")
    found = find_stretches(worst, threshold)
    return list(zip(found["start"].values, found["end"].values, strict=True))
